// From reset to leadline_main(), and the vectors.
#include <cstdint>

#include "firmware/m7/entry_points.hpp"
#include "firmware/m7/fault_record.hpp"
#include "hal/m7/registers.hpp"

extern "C" {

// Of sections.ld: addresses, not objects.
extern std::uint32_t leadline_stack_top;
extern std::uint32_t leadline_data_source;
extern std::uint32_t leadline_data_begin;
extern std::uint32_t leadline_data_end;
using Constructor = void (*)();
extern Constructor leadline_init_begin[];
extern Constructor leadline_init_end[];

#define LEADLINE_ZEROED(name)                   \
  extern std::uint32_t leadline_##name##_begin; \
  extern std::uint32_t leadline_##name##_end;
LEADLINE_ZEROED(bss)
LEADLINE_ZEROED(lines)
LEADLINE_ZEROED(tools)
LEADLINE_ZEROED(vehicle)
LEADLINE_ZEROED(voxels)
LEADLINE_ZEROED(columns)
LEADLINE_ZEROED(results)
#undef LEADLINE_ZEROED

void leadline_reset();
}

namespace leadline::firmware::m7 {
namespace {

struct Area {
  std::uint32_t* begin;
  std::uint32_t* end;
};

void zero(const Area& area) {
  for (std::uint32_t* word = area.begin; word != area.end; ++word) {
    *word = 0;
  }
}

}  // namespace
}  // namespace leadline::firmware::m7

extern "C" {

// The compiler calls it; nothing here ends, so nothing is destroyed.
// NOLINTNEXTLINE(*-reserved-identifier,cert-dcl*,readability-identifier-naming): its name
int __aeabi_atexit(void* /*object*/, void (* /*destructor*/)(void*), void* /*module*/) { return 0; }

void leadline_reset() {
  using leadline::firmware::m7::zero;
  using leadline::hal::m7::reg;
  reg(leadline::hal::m7::kCoprocessorAccess) =
      reg(leadline::hal::m7::kCoprocessorAccess) | (0xFU << 20U);
  asm volatile("dsb\n isb" ::: "memory");
  const std::uint32_t* from = &leadline_data_source;
  for (std::uint32_t* word = &leadline_data_begin; word != &leadline_data_end; ++word) {
    *word = *from;
    ++from;
  }
  zero({&leadline_bss_begin, &leadline_bss_end});
  zero({&leadline_lines_begin, &leadline_lines_end});
  zero({&leadline_tools_begin, &leadline_tools_end});
  zero({&leadline_vehicle_begin, &leadline_vehicle_end});
  zero({&leadline_voxels_begin, &leadline_voxels_end});
  zero({&leadline_columns_begin, &leadline_columns_end});
  zero({&leadline_results_begin, &leadline_results_end});
  leadline::firmware::m7::enable_fault_handlers();
  for (Constructor* constructor = leadline_init_begin; constructor != leadline_init_end;
       ++constructor) {
    (*constructor)();
  }
  leadline_main();
  leadline::hal::m7::restart_system();
}

}  // extern "C"

namespace {

using Handler = void (*)();

struct Vectors {
  std::uint32_t* stack;
  Handler handlers[15];
  Handler interrupts[32];
};

constexpr Vectors make_vectors() {
  Vectors table{&leadline_stack_top, {}, {}};
  // Whatever nobody expects is a failure.
  for (Handler& handler : table.handlers) {
    handler = leadline_fault_entry;
  }
  for (Handler& interrupt : table.interrupts) {
    interrupt = leadline_fault_entry;
  }
  table.handlers[0] = leadline_reset;
  table.handlers[14] = leadline_tick;
  constexpr Handler kReceived[leadline::hal::m7::kUarts] = {
      leadline_uart0_receive, leadline_uart1_receive, leadline_uart2_receive,
      leadline_uart3_receive, leadline_uart4_receive};
  constexpr Handler kSent[leadline::hal::m7::kUarts] = {leadline_uart0_sent, leadline_uart1_sent,
                                                        leadline_uart2_sent, leadline_uart3_sent,
                                                        leadline_uart4_sent};
  for (int line = 0; line < leadline::hal::m7::kUarts; ++line) {
    const leadline::hal::m7::UartPlace& place = leadline::hal::m7::kUartPlaces[line];
    table.interrupts[place.rx_interrupt] = kReceived[line];
    table.interrupts[place.tx_interrupt] = kSent[line];
  }
  return table;
}

[[gnu::section(".vectors"), gnu::used]] constexpr Vectors kVectors = make_vectors();

}  // namespace
