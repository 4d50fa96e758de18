// What the vehicle's thread asks of Linux so that nothing but its own work decides how long a cycle takes:
// memory that stays in RAM and a place before every thread of ordinary priority. Both need a permission that
// many machines do not give; the vehicle flies without, and says so.
#pragma once

#include <string>

namespace leadline::host {

struct RealTimeReport {
  bool memory_locked = false;
  std::string memory_problem;  ///< why not
  int priority = 0;            ///< SCHED_FIFO's; 0: ordinary scheduling
  std::string priority_problem;

  /// As lines for a person and as one value each for the summary: "true", "fifo 20".
  [[nodiscard]] std::string text() const;
  [[nodiscard]] std::string scheduling() const;
};

/// For the calling thread, and memory of the whole process, present and future: all pages are brought in.
/// `priority` 1 .. 99 of SCHED_FIFO; 0 asks for no priority. Threads made later have ordinary priority.
[[nodiscard]] RealTimeReport ask_for_real_time(int priority);

}  // namespace leadline::host
