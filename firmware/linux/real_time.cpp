#include "firmware/linux/real_time.hpp"

#include <cerrno>
#include <cstring>

#include <sched.h>
#include <sys/mman.h>

namespace leadline::host {

std::string RealTimeReport::scheduling() const {
  return priority > 0 ? "fifo " + std::to_string(priority) : "other";
}

std::string RealTimeReport::text() const {
  std::string out = memory_locked ? "memory locked" : "memory not locked: " + memory_problem;
  out += priority > 0 ? ", SCHED_FIFO " + std::to_string(priority) : ", ordinary scheduling";
  return priority_problem.empty() ? out : out + ": " + priority_problem;
}

RealTimeReport ask_for_real_time(int priority) {
  RealTimeReport report;
  report.memory_locked = ::mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  if (!report.memory_locked) {
    report.memory_problem = std::strerror(errno);
    // Without the limit's room for all of it, later allocations would fail where now they only may be slow.
    (void)::munlockall();
  }
  if (priority > 0) {
    sched_param wanted{};
    wanted.sched_priority = priority;
    if (::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &wanted) == 0) {
      report.priority = priority;
    } else {
      report.priority_problem = std::strerror(errno);
    }
  }
  return report;
}

}  // namespace leadline::host
