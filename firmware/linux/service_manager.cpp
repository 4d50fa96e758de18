#include "firmware/linux/service_manager.hpp"

#include <systemd/sd-daemon.h>

namespace leadline::host {

ServiceManager::ServiceManager() {
  std::uint64_t limit_us = 0;
  if (sd_watchdog_enabled(0, &limit_us) > 0) {
    interval_us_ = static_cast<std::int64_t>(limit_us / 2);
  }
}

void ServiceManager::cycle_done(std::int64_t now_us) {
  if (!ready_) {
    ready_ = true;
    (void)sd_notify(0, "READY=1");
  }
  if (interval_us_ > 0 && now_us >= due_us_) {
    due_us_ = now_us + interval_us_;
    (void)sd_notify(0, "WATCHDOG=1");
  }
}

void ServiceManager::stopping() { (void)sd_notify(0, "STOPPING=1"); }

}  // namespace leadline::host
