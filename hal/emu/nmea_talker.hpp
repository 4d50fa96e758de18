// Attitude, heading, position and pressure sensors that talk NMEA 0183 at fixed rates.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "hal/emu/talker.hpp"

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

struct NmeaTalkerConfig : TalkerConfig {
  std::vector<NmeaSchedule> schedule;
};

class NmeaTalker final : public Talker {
 public:
  using Measure = std::function<NmeaTruth(base::TimeUs)>;

  /// `measure` is called in order of time, once per sentence.
  NmeaTalker(const NmeaTalkerConfig& config, const Measure& measure);
};

}  // namespace leadline::emu
