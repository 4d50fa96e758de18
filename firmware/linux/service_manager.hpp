// What the service manager that started the program is told (systemd: Type=notify, WatchdogSec): nothing where there
// is none.
#pragma once

#include <cstdint>

namespace leadline::host {

class ServiceManager {
 public:
  /// Asks whether somebody waits for signs of life.
  ServiceManager();

  /// A cycle was completed: the first says that the vehicle flies, later ones that it still does, twice in
  /// the time after which it would be taken for dead. Nothing else gives a sign.
  void cycle_done(std::int64_t now_us);
  /// The order to stop has come.
  void stopping();

 private:
  bool ready_ = false;
  std::int64_t interval_us_ = 0;  ///< between two signs; 0: nobody waits
  std::int64_t due_us_ = 0;
};

}  // namespace leadline::host
