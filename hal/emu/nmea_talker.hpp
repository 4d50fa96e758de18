// Attitude, heading, position and pressure sensors that talk NMEA 0183 at fixed rates.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "hal/emu/emulated_device.hpp"

namespace leadline::emu {

/// What the sensors measure at one instant. Angles in degrees, as the vehicle's body axes have them
/// (roll positive starboard down, pitch positive bow up, heading clockwise from north).
struct NmeaTruth {
  double roll_deg = 0;
  double pitch_deg = 0;
  double heading_deg = 0;           ///< true
  double magnetic_heading_deg = 0;  ///< HDM, HDG
  double sigma_roll_deg = 0;
  double sigma_pitch_deg = 0;
  double sigma_heading_deg = 0;
  double latitude_deg = 0;
  double longitude_deg = 0;
  double pressure_pa = 101325;
  double depth_m = 0;     ///< PRVAT in Metres
  double altitude_m = 0;  ///< PRVAT, DBT, DPT; 0: nothing heard
  int fix_quality = 4;    ///< GGA; 0: no fix
  double time_of_day_s = 0;
};

enum class NmeaKind : std::uint8_t {
  kHdg,
  kHdm,
  kHdt,
  kPashr,
  kPrdid,
  kPrvatPressure,
  kPrvatDepth,
  kDbt,
  kDpt,
  kGga
};

/// One sentence, from '$' to CR LF.
[[nodiscard]] std::string nmea_sentence(NmeaKind kind, const NmeaTruth& truth);
/// '$', `body`, '*', checksum, CR LF.
[[nodiscard]] std::string nmea_frame(const std::string& body);

struct NmeaSchedule {
  NmeaKind kind;
  std::int64_t interval_us;
  base::TimeUs first_us;
};

struct NmeaTalkerConfig {
  std::vector<NmeaSchedule> schedule;
  std::int64_t latency_us = 0;    ///< from the measured instant to the first byte
  std::int64_t byte_time_ns = 0;  ///< per byte on the line (115200 baud: 86806)
};

/// Listens to nothing.
class NmeaTalker final : public EmulatedDevice {
 public:
  using Measure = std::function<NmeaTruth(base::TimeUs)>;

  /// `measure` is called in order of time, once per sentence.
  NmeaTalker(const NmeaTalkerConfig& config, Measure measure);

  void take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) override;
  void advance(base::TimeUs now_us, Bytes& out) override;
  [[nodiscard]] base::TimeUs next_event_us() const override;
  void set_silent(bool silent) { silent_ = silent; }

 private:
  [[nodiscard]] std::size_t earliest() const;

  NmeaTalkerConfig config_;
  Measure measure_;
  std::vector<base::TimeUs> due_us_;  ///< per schedule row
  SendQueue line_;
  bool silent_ = false;
};

}  // namespace leadline::emu
