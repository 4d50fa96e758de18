// What the codecs of all Ping protocol heads share: counters, and the bookkeeping of one request
// under way on a half-duplex line.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/heads/ping_protocol.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

/// What a head's codec has seen since it was made. Never decremented; wraps at 2^32.
struct PingHeadCounters {
  PingCounters frames;
  std::uint32_t records;       ///< pings delivered
  std::uint32_t repeats;       ///< the same measurement sent again: dropped
  std::uint32_t bad_values;    ///< frame intact, but a field that the device never sends: dropped
  std::uint32_t wrong_device;  ///< another device id or device type: dropped
  std::uint32_t nacks;         ///< refused by the device
  std::uint32_t timeouts;      ///< requests without an answer
  std::uint32_t refused_settings;  ///< settings that read back otherwise after all tries
  std::uint32_t restarts;          ///< start-up sequences after the first (silence, reboot)
};

/// What the head said about itself; zero until it did.
struct PingDeviceInfo {
  std::uint8_t device_type;
  std::uint8_t device_revision;
  std::uint8_t firmware[3];  ///< major, minor, patch
  std::uint8_t protocol[3];
};

/// One request at a time: sent, then answered or given up. Times that go back restart the wait
/// instead of stretching it. O(1).
class PingExchange {
 public:
  void sent(base::TimeUs now_us, std::int64_t timeout_us) {
    t_sent_us_ = now_us;
    timeout_us_ = timeout_us;
    waiting_ = true;
  }
  void answered() { waiting_ = false; }
  [[nodiscard]] bool waiting() const { return waiting_; }
  /// True once per request: it is given up.
  [[nodiscard]] bool gave_up(base::TimeUs now_us) {
    if (!waiting_) {
      return false;
    }
    if (now_us < t_sent_us_) {
      t_sent_us_ = now_us;
    }
    if (now_us - t_sent_us_ < timeout_us_) {
      return false;
    }
    waiting_ = false;
    return true;
  }
  [[nodiscard]] base::TimeUs t_sent_us() const { return t_sent_us_; }

 private:
  base::TimeUs t_sent_us_ = 0;
  std::int64_t timeout_us_ = 0;
  bool waiting_ = false;
};

}  // namespace leadline::hal
