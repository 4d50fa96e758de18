#include "host_tools/stop_signals.hpp"

#include <cstddef>

namespace leadline::host {
namespace {

// What a handler may touch.
volatile std::sig_atomic_t stop_flag = 0;
volatile std::sig_atomic_t wish_flag = 0;

constexpr int kSignals[] = {SIGINT, SIGTERM, SIGUSR1};

void on_signal(int number) {
  if (number == SIGUSR1) {
    wish_flag = 1;
  } else {
    stop_flag = 1;
  }
}

}  // namespace

StopSignals::StopSignals() {
  stop_flag = 0;
  wish_flag = 0;
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigemptyset(&action.sa_mask);
  for (std::size_t k = 0; k < 3; ++k) {
    sigaction(kSignals[k], &action, &before_[k]);
  }
}

StopSignals::~StopSignals() {
  for (std::size_t k = 0; k < 3; ++k) {
    sigaction(kSignals[k], &before_[k], nullptr);
  }
}

bool StopSignals::stopped() { return stop_flag != 0; }

bool StopSignals::take_wish() {
  const bool wished = wish_flag != 0;
  wish_flag = 0;
  return wished;
}

}  // namespace leadline::host
