// A head that transmits by a clock of its own and listens to nothing.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/emu/emulated_device.hpp"

namespace leadline::emu {

/// A derived class says what each transmission sends.
class FreeRunningHead : public EmulatedDevice {
 public:
  void take(base::TimeUs /*now_us*/, const std::uint8_t* /*data*/,
            std::size_t /*size_bytes*/) override {}
  void advance(base::TimeUs now_us, Bytes& out) override;
  [[nodiscard]] base::TimeUs next_event_us() const override;
  /// From now on nothing is sent (true) or all is well again (false). Time goes on inside.
  void set_silent(bool silent) { silent_ = silent; }

 protected:
  /// First at 0, then every `interval_us` (1 or more).
  explicit FreeRunningHead(std::int64_t interval_us) : interval_us_(interval_us) {}

  /// The transmission at `t_us`: called in order of time.
  virtual void ping(base::TimeUs t_us) = 0;
  /// Bytes that leave at `t_us`, at once.
  void send(base::TimeUs t_us, const Bytes& bytes) { line_.send(t_us, bytes); }

 private:
  std::int64_t interval_us_;
  base::TimeUs t_ping_us_ = 0;
  SendQueue line_;
  bool silent_ = false;
};

}  // namespace leadline::emu
