// Images without lines: their interrupts are faults.
#include "firmware/m7/entry_points.hpp"
#include "firmware/m7/fault_record.hpp"

extern "C" {

void leadline_tick() { leadline_fault_entry(); }
#define LEADLINE_LINE(number)                                        \
  void leadline_uart##number##_receive() { leadline_fault_entry(); } \
  void leadline_uart##number##_sent() { leadline_fault_entry(); }
LEADLINE_LINE(0)
LEADLINE_LINE(1)
LEADLINE_LINE(2)
LEADLINE_LINE(3)
LEADLINE_LINE(4)
#undef LEADLINE_LINE

}  // extern "C"
