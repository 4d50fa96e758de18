#include "host_tools/import/pd0_line.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "estimator/navigator.hpp"
#include "hal/attitude/nmea.hpp"
#include "hal/attitude/pd0.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/import/byte_source.hpp"
#include "host_tools/sim/exact_math.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr std::size_t kRead_bytes = 65536;
constexpr std::int32_t kUsualSpeed_mm_s = 1'500'000;

estimator::NavigatorConfig navigator_config(const estimator::Geodetic& origin) {
  estimator::NavigatorConfig config{};
  config.has_origin = true;
  config.origin = origin;
  config.surface_pressure_pa = 101'325;
  config.water_density_g_m3 = 1'000'000;
  config.gravity_um_s2 = 9'806'650;
  config.sigma_fix_mm = 500;
  config.sigma_depth_mm = 10;
  config.sigma_attitude_urad = 10'000;
  config.sigma_heading_urad = 10'000;
  config.sigma_velocity_mm_s = 50;
  config.acceleration_mm_s2 = 300;
  config.angular_acceleration_urad_s2 = 200'000;
  config.max_gap_us = 5'000'000;
  return config;
}

/// Recorders leave the sentence's sum out: the ensemble has one.
hal::NmeaConfig nmea_config() {
  hal::NmeaConfig config;
  config.require_checksum = false;
  return config;
}

/// Where beam `number` looks, in the vehicle's axes.
Vec3 beam_direction(const hal::Pd0Ensemble& ensemble, std::size_t number) {
  const double angle_rad = ensemble.beam_angle_deg * exact::kRadPerDeg;
  const double out = (ensemble.convex ? 1.0 : -1.0) * std::sin(angle_rad);
  const double down = std::cos(angle_rad);
  // Starboard and forward of the instrument: a beam looks against the axis that it counts for (pd0.hpp).
  constexpr std::array<std::array<double, 2>, 4> kLooks{{{-1, 0}, {1, 0}, {0, 1}, {0, -1}}};
  const double starboard = out * kLooks[number][0];
  const double forward = out * kLooks[number][1];
  const double turn_rad = 0.01 * ensemble.alignment_cdeg * exact::kRadPerDeg;
  return {std::cos(turn_rad) * forward - std::sin(turn_rad) * starboard,
          std::sin(turn_rad) * forward + std::cos(turn_rad) * starboard, down};
}

class LineBuilder {
 public:
  /// `origin`: null: no fix will come.
  LineBuilder(SurveyLine* line, const estimator::Geodetic* origin, base::Bam32 variation_bam32)
      : line_(line),
        variation_bam32_(variation_bam32),
        reckoned_(origin == nullptr),
        navigator_(std::make_unique<estimator::Navigator>()) {
    const estimator::Geodetic nowhere{0, 0};
    if (navigator_->configure(navigator_config(reckoned_ ? nowhere : *origin)) !=
        base::Status::kOk) {
      throw HostError(ExitCode::kInternal, "pd0: the navigator's configuration");
    }
  }

  /// A GGA inside of the ensemble that comes next.
  void take_fix(const base::NavSample& sample) {
    fix_ = sample;
    fixes += 1;
  }

  void take(const base::NavSample& sample, const hal::Pd0Ensemble& ensemble) {
    if (sample.kind == base::NavKind::kVelocity) {
      begin_ensemble(ensemble);
    }
    if (t_us_ == 0) {
      return;
    }
    base::NavSample dated = sample;
    dated.t_us = t_us_;
    dated.attitude.heading_bam32 += variation_bam32_;
    if (sample.kind == base::NavKind::kVelocity) {
      velocity_ = dated;
    } else if (sample.kind == base::NavKind::kAttitude) {
      // The attitude first: it is what turns the velocity.
      navigator_->take(dated);
      navigator_->take(velocity_);
      if (fix_.fields != 0) {
        fix_.t_us = t_us_;
        navigator_->take(fix_);
        fix_.fields = 0;
      }
      keep_place();
      line_->attitudes.push_back(dated);
    }
  }

  std::uint64_t ensembles = 0;
  std::uint64_t fixes = 0;
  std::uint64_t undated = 0;
  std::uint64_t without_range = 0;
  std::uint64_t upwards = 0;

 private:
  void begin_ensemble(const hal::Pd0Ensemble& ensemble) {
    ensembles += 1;
    const bool dated = ensemble.utc_us > t_last_us_;
    undated += dated ? 0 : 1;
    t_us_ = dated ? ensemble.utc_us : 0;
    if (!dated) {
      return;
    }
    if (t_last_us_ == 0) {
      place_here(ensemble.utc_us);
    }
    t_last_us_ = ensemble.utc_us;
    upwards += ensemble.looks_up ? 1 : 0;
    if (!ensemble.looks_up && ensemble.beam_angle_deg != 0) {
      add_beams(ensemble);
    }
  }

  void place_here(base::TimeUs t_us) {
    base::NavSample fix{};
    fix.t_us = t_us;
    fix.quality = 255;
    fix.fields = reckoned_ ? base::kNavGeodetic | base::kNavDepth : base::kNavDepth;
    navigator_->take(fix);
  }

  void add_beams(const hal::Pd0Ensemble& ensemble) {
    for (std::size_t i = 0; i < ensemble.range_cm.size(); ++i) {
      if (ensemble.range_cm[i] == 0) {
        without_range += 1;
        continue;
      }
      SurveyBeam beam{};
      beam.direction = beam_direction(ensemble, i);
      beam.range_m = 0.01 * ensemble.range_cm[i] / beam.direction.z;
      beam.told_speed_mm_s =
          ensemble.sound_speed_m_s != 0 ? ensemble.sound_speed_m_s * 1000 : kUsualSpeed_mm_s;
      const double two_way_s = 2000.0 * beam.range_m / beam.told_speed_mm_s;
      beam.t_transmit_us = ensemble.utc_us;
      beam.t_receive_us = ensemble.utc_us + std::llround(two_way_s * 1e6);
      beam.beam = static_cast<std::uint16_t>(i + 1);
      beam.quality = 255;
      line_->beams.push_back(beam);
    }
  }

  void keep_place() {
    const base::Pose& pose = navigator_->latest();
    const auto place = navigator_->plane().to_geodetic(pose.position_um[base::kNorth],
                                                       pose.position_um[base::kEast]);
    if (pose.t_us != t_us_ || (pose.validity & base::kPoseHorizontal) == 0 || !place.ok()) {
      return;
    }
    base::NavSample sample{};
    sample.t_us = t_us_;
    sample.kind = base::NavKind::kPosition;
    sample.fields = base::kNavGeodetic;
    sample.latitude_e9deg = place.value().latitude_e9deg;
    sample.longitude_e9deg = place.value().longitude_e9deg;
    line_->positions.push_back(sample);
    line_->heights_m.push_back(0);
  }

  SurveyLine* line_;
  base::Bam32 variation_bam32_;
  bool reckoned_;
  std::unique_ptr<estimator::Navigator> navigator_;
  base::TimeUs t_us_ = 0;  ///< of the ensemble under way; 0: it cannot be used
  base::TimeUs t_last_us_ = 0;
  base::NavSample velocity_{};
  base::NavSample fix_{};  ///< of the ensemble under way; no fields: none
};

std::vector<std::uint8_t> whole_file(const std::string& path) {
  ByteSource source(path);
  std::vector<std::uint8_t> bytes;
  for (std::size_t size = source.peek(kRead_bytes); size > 0; size = source.peek(kRead_bytes)) {
    bytes.insert(bytes.end(), source.data(), source.data() + size);
    source.skip(size);
  }
  return bytes;
}

bool first_fix(const std::vector<std::uint8_t>& bytes, estimator::Geodetic* fix) {
  hal::NmeaCodec nmea(nmea_config());
  base::NavSample sample{};
  for (const std::uint8_t byte : bytes) {
    if (nmea.feed(byte, 0, sample) && (sample.fields & base::kNavGeodetic) != 0) {
      *fix = {sample.latitude_e9deg, sample.longitude_e9deg};
      return true;
    }
  }
  return false;
}

/// True course less magnetic course of the first VTG that has both; 0 without one.
double variation_deg(const std::vector<std::uint8_t>& bytes) {
  constexpr std::string_view kStart = "VTG,";
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (std::size_t at = text.find(kStart); at != std::string_view::npos;
       at = text.find(kStart, at + 1)) {
    double course_true_deg = 0;
    double course_magnetic_deg = 0;
    const std::string sentence(text.substr(at, 40));
    if (std::sscanf(sentence.c_str(), "VTG,%lf,T,%lf,M", &course_true_deg, &course_magnetic_deg) ==
        2) {
      return std::remainder(course_true_deg - course_magnetic_deg, 360.0);
    }
  }
  return 0;
}

}  // namespace

SurveyLine read_pd0_line(const std::string& path, std::string* notice) {
  const std::vector<std::uint8_t> bytes = whole_file(path);
  estimator::Geodetic origin{};
  const bool has_fix = first_fix(bytes, &origin);
  hal::Pd0Config config;
  config.true_heading = true;  // made so, below
  config.euler_pitch = true;
  const auto codec = std::make_unique<hal::Pd0Codec>(config);
  hal::NmeaCodec nmea(nmea_config());
  SurveyLine line;
  line.name = path;
  const double turned_deg = variation_deg(bytes);
  LineBuilder builder(&line, has_fix ? &origin : nullptr,
                      static_cast<base::Bam32>(std::llround(turned_deg / 360.0 * 4294967296.0)));
  base::NavSample sample{};
  base::TimeUs byte_us = 0;
  for (const std::uint8_t byte : bytes) {
    byte_us += 1;
    if (nmea.feed(byte, byte_us, sample) && (sample.fields & base::kNavGeodetic) != 0) {
      builder.take_fix(sample);
    }
    bool more = codec->feed(byte, byte_us, sample);
    while (more) {
      builder.take(sample, codec->ensemble());
      more = codec->next(sample);
    }
  }
  if (line.beams.empty()) {
    throw HostError(ExitCode::kInput, path + ": no PD0 ensemble with a range to the bottom among " +
                                          std::to_string(builder.ensembles));
  }
  *notice = std::to_string(builder.ensembles) + " ensembles";
  const std::pair<const char*, std::uint64_t> counts[] = {
      {" without a date of their own", builder.undated},
      {" of an instrument that looks up", builder.upwards},
      {" beams without a bottom", builder.without_range},
      {" damaged", hal::rejected(codec->counters())}};
  for (const auto& [what, count] : counts) {
    *notice += count > 0 ? ", " + std::to_string(count) + what : "";
  }
  if (turned_deg != 0) {
    *notice += ", compass turned by ";
    append_fixed(notice, turned_deg, 1);
    *notice += " degrees";
  }
  *notice += has_fix ? ", " + std::to_string(builder.fixes) + " fixes in them"
                     : "; the track is dead reckoned from latitude 0, longitude 0";
  return line;
}

}  // namespace leadline::host
