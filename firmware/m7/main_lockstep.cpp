// The image that flies in virtual time: the lines and the loop of the one that flies, its clock from an emulator
// (hal/linux/lockstep.hpp is the protocol) through standard input and output of QEMU, which are the emulator's
// socket. Everything of the vehicle goes through the board's UARTs; files of the host, by semihosting, take the
// log and the summary.
//
//   ... -semihosting-config ...,arg=lockstep,arg=FOLDER
//
// FOLDER gets survey.lll and vehicle.json. Exit status: 0, 2 usage, 3 the emulator breaks off, 4 a file cannot be
// written.
#include <array>
#include <cstdint>
#include <cstring>

#include "firmware/m7/entry_points.hpp"
#include "firmware/m7/flight_loop.hpp"
#include "firmware/m7/say.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "hal/m7/semihost.hpp"
#include "proto/log.hpp"

namespace {

using leadline::base::Status;
using leadline::base::TimeUs;
using leadline::firmware::m7::board_clock;
using leadline::firmware::m7::Decimal;
using leadline::firmware::m7::FlightLoop;
using leadline::firmware::m7::kLinkUart;
using leadline::firmware::m7::lines;
using leadline::firmware::m7::the_vehicle;
using leadline::hal::m7::HostFile;
using leadline::hal::m7::OpenMode;

constexpr std::uint32_t kUsage = 2;
constexpr std::uint32_t kInput = 3;
constexpr std::uint32_t kOutput = 4;

// A message of the protocol: magic, kind, t_us, counts of device ports by number and of the link, the last.
constexpr std::uint32_t kMagic = 0x314B4C4CU;  // "LLK1"
constexpr std::uint32_t kGrant = 1;
constexpr std::uint32_t kAnswer = 2;
constexpr std::uint32_t kFinish = 3;
constexpr std::size_t kCounts = 16;
struct Message {
  std::uint32_t magic;
  std::uint32_t kind;
  TimeUs t_us;
  std::array<std::uint64_t, kCounts> counts;
};
static_assert(sizeof(Message) == 144, "as on the wire, on a little-endian machine");

[[gnu::section(".bss.leadline.tools")]] FlightLoop loop;
// A cycle's records: chunks with their frames, and the downlink.
[[gnu::section(".bss.leadline.tools")]] std::uint8_t batch[65536];
HostFile console_in;
HostFile console_out;
HostFile log_file;
const char* folder = nullptr;

// A file of the folder, `name` with its stroke; it is begun anew.
bool open_result(HostFile& file, const char* name) {
  static char path[600];
  const std::size_t folder_size = std::strlen(folder);
  const std::size_t name_size = std::strlen(name) + 1;  // with its zero
  if (folder_size + name_size > sizeof path) {
    return false;
  }
  // NOLINTNEXTLINE(bugprone-not-null-terminated-result): the name follows, with its zero
  std::memcpy(path, folder, folder_size);
  std::memcpy(path + folder_size, name, name_size);
  return file.open(path, OpenMode::kWriteBytes);
}

void write_log(const leadline::proto::LogWriter& writer) {
  if (!log_file.write(writer.data(), writer.size_bytes())) {
    leadline::hal::m7::exit(kOutput);
  }
}

void begin_log(const leadline::firmware::ConfigBlock& block, TimeUs t_us) {
  leadline::proto::LogWriter writer(batch, sizeof batch);
  if (leadline::firmware::log_begin(writer, the_vehicle.config(), block.tables, block.table_count,
                                    t_us, 0) != Status::kOk) {
    leadline::hal::m7::exit(kOutput);
  }
  for (int copy = 0; copy < leadline::firmware::kLogPreambleCopies; ++copy) {
    write_log(writer);
  }
}

void log_cycle() {
  leadline::proto::LogWriter writer(batch, sizeof batch);
  if (leadline::firmware::log_cycle(writer, loop.cycles() - 1U, loop.input(), loop.output()) !=
      Status::kOk) {
    leadline::hal::m7::exit(kOutput);
  }
  write_log(writer);
}

bool next_message(Message& message) {
  auto* const bytes = reinterpret_cast<std::uint8_t*>(&message);
  std::size_t filled = 0;
  while (filled < sizeof message) {
    const std::size_t some = console_in.read(bytes + filled, sizeof message - filled);
    if (some == 0) {
      return false;
    }
    filled += some;
  }
  return message.magic == kMagic;
}

// Waits until the bytes that were granted have come through the lines, and takes them.
void gather(const Message& grant) {
  for (int port = 0; port < loop.port_count(); ++port) {
    const auto total = static_cast<std::uint32_t>(grant.counts[static_cast<std::size_t>(port)]);
    while (lines[port].received() != total) {
      asm volatile("wfi");
    }
  }
  loop.gather(grant.t_us, grant.t_us);
}

// While the next grant is waited for the whole machine stands still: what was written must be out before.
void wait_until_sent() {
  for (const auto& line : lines) {
    while (line.write_room() != leadline::hal::m7::kSendRing_bytes || line.sending()) {
      asm volatile("wfi");
    }
  }
}

bool answer(TimeUs t_us) {
  wait_until_sent();
  Message message{kMagic, kAnswer, t_us, {}};
  for (int port = 0; port < loop.port_count(); ++port) {
    message.counts[static_cast<std::size_t>(port)] = lines[port].counters().bytes_out;
  }
  message.counts[kCounts - 1] = lines[kLinkUart].counters().bytes_out;
  return console_out.write(&message, sizeof message);
}

// ---- Summary ------------------------------------------------------------------------------------

char text[1024];
std::size_t text_size = 0;

void add(const char* words) {
  const std::size_t size = std::strlen(words);
  if (size < sizeof text - text_size) {
    // NOLINTNEXTLINE(bugprone-not-null-terminated-result): its size goes with it
    std::memcpy(text + text_size, words, size);
    text_size += size;
  }
}

void add_number(const char* name, std::uint64_t value) {
  add(name);
  add(Decimal(value).text());
}

void add_hash(const char* name, std::uint64_t value) {
  char digits[17] = {};
  for (unsigned i = 0; i < 16; ++i) {
    digits[i] = "0123456789abcdef"[(value >> (60U - 4U * i)) & 15U];
  }
  add(name);
  add("\"0x");
  add(digits);
  add("\"");
}

bool write_summary(TimeUs t_us) {
  const leadline::proto::LogEnd end = leadline::firmware::log_end_of(the_vehicle, t_us);
  const auto& counters = the_vehicle.counters();
  add_number("{\"cycles\": ", counters.cycles);
  add_number(", \"t_us\": ", static_cast<std::uint64_t>(t_us));
  add_number(", \"pings_in\": ", end.pings_in);
  add_number(", \"pings_mapped\": ", counters.pings_mapped);
  add_number(", \"cells_sent\": ", end.cells_sent);
  add_number(", \"downlink_bytes\": ", end.downlink_bytes);
  add(", \"drained\": ");
  add(the_vehicle.drained() ? "true" : "false");
  add_hash(", \"map_hash\": ", end.map_hash);
  add_hash(", \"link_hash\": ", end.link_hash);
  add_hash(", \"cells_hash\": ", end.cells_hash);
  add("}\n");
  HostFile file;
  const bool written = open_result(file, "/vehicle.json") && file.write(text, text_size);
  file.close();
  return written;
}

// What waits for the link goes out: virtual time need not wait for the link's rate.
TimeUs drain(const leadline::firmware::ConfigBlock& block, TimeUs t_us) {
  constexpr int kMostCycles = 500'000;
  for (int cycle = 0; cycle < kMostCycles && !the_vehicle.drained(); ++cycle) {
    t_us += block.cycle_us;
    loop.buffer().clear();
    loop.gather(t_us, t_us);
    loop.run(t_us, 0);
    log_cycle();
  }
  return t_us;
}

bool fly(const leadline::firmware::ConfigBlock& block) {
  Message message{};
  TimeUs t_us = 0;
  bool begun = false;
  while (next_message(message) && message.kind == kGrant) {
    t_us = message.t_us;
    if (!begun) {
      begin_log(block, t_us);
      begun = true;
    }
    loop.buffer().clear();
    gather(message);
    loop.run(t_us, 0);
    log_cycle();
    if (!answer(t_us)) {
      return false;
    }
  }
  if (message.kind != kFinish) {
    return false;
  }
  t_us = drain(block, t_us);
  wait_until_sent();
  leadline::proto::LogWriter writer(batch, sizeof batch);
  if (writer.end(leadline::firmware::log_end_of(the_vehicle, t_us)) != Status::kOk) {
    return false;
  }
  write_log(writer);
  log_file.close();
  return write_summary(t_us);
}

}  // namespace

void leadline_main() {
  leadline::firmware::m7::end_after_fault(kInput);
  folder = leadline::firmware::m7::command_argument();
  if (folder == nullptr) {
    leadline::hal::m7::exit(kUsage);
  }
  if (!console_in.open(":tt", OpenMode::kReadBytes) ||
      !console_out.open(":tt", OpenMode::kWriteBytes) || !open_result(log_file, "/survey.lll")) {
    leadline::hal::m7::exit(kOutput);
  }
  board_clock.start();
  const auto& block = leadline::firmware::m7::configure_from_flash(1);
  loop.open(block, leadline::firmware::m7::FaultRecord{});
  leadline::hal::m7::exit(fly(block) ? 0 : kInput);
}
