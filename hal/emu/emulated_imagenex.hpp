// Imagenex heads from the outside: a switch command of 27 bytes, one measurement, one reply.
// From the 852's serial interface specification v1.04 and the drivers that read 881A and 831L.
#pragma once

#include <cstdint>
#include <functional>

#include "hal/emu/emulated_device.hpp"

namespace leadline::emu {

enum class ImagenexHead : std::uint8_t { kSounder852, kScanner852, k881a, k831l };

struct ImagenexShot {
  base::TimeUs t_transmit_us;
  double angle_deg;  ///< of the head; 0 for the echo sounder
  double range_m;
  int points;
};

struct ImagenexEcho {
  Bytes intensity;      ///< up to `points`; the rest is 0
  double found_m = 0;   ///< by the head's own detector; 0: nothing
  double roll_deg = 0;  ///< 831L
  double pitch_deg = 0;
};

struct EmulatedImagenexConfig {
  ImagenexHead head = ImagenexHead::kSounder852;
  std::int64_t byte_time_ns = 0;
};

class EmulatedImagenex final : public EmulatedDevice {
 public:
  using Measure = std::function<ImagenexEcho(const ImagenexShot&)>;

  EmulatedImagenex(const EmulatedImagenexConfig& config, Measure measure);

  void take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) override;
  void advance(base::TimeUs now_us, Bytes& out) override;
  [[nodiscard]] base::TimeUs next_event_us() const override { return line_.next_us(); }

  void set_silent(bool silent) { silent_ = silent; }
  [[nodiscard]] std::uint64_t shots() const { return shots_; }
  /// Commands that ended too early, came while it was busy, or asked for what it does not have.
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

 private:
  void command(base::TimeUs now_us);
  void step(const Bytes& command);
  [[nodiscard]] double range_of(unsigned code) const;
  [[nodiscard]] unsigned packed_position() const;

  EmulatedImagenexConfig config_;
  Measure measure_;
  SendQueue line_;
  Bytes inbox_;
  base::TimeUs t_free_us_ = 0;
  double angle_deg_ = 0;
  int direction_ = 1;
  bool silent_ = false;
  std::uint64_t shots_ = 0;
  std::uint64_t refused_ = 0;
};

}  // namespace leadline::emu
