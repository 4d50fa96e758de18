// SIGINT and SIGTERM as an order to end in order, SIGUSR1 as a wish to see results now: for commands that
// run until they are told otherwise.
#pragma once

#include <csignal>

namespace leadline::host {

/// Catches the signals while it lives and restores what was there before. One at a time.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  [[nodiscard]] static bool stopped();
  /// True once after each SIGUSR1.
  [[nodiscard]] static bool take_wish();

 private:
  struct sigaction before_[3];
};

}  // namespace leadline::host
