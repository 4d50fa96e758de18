#include "host_tools/sim/simulator.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <system_error>

#include "host_tools/output_dir.hpp"
#include "host_tools/raster.hpp"
#include "host_tools/sim/exact_math.hpp"
#include "host_tools/sim/random.hpp"
#include "host_tools/sim/require.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

// Streams of the scene's seed; never renumber, or every published scene changes.
enum Stream : std::uint64_t {
  kPlanStream = 0,
  kRangeStream = 1,
  kPointingStream = 2,
  kPositionStream = 3,
  kDriftStream = 4,
  kOutlierStream = 5,
  kDropoutStream = 6,
};

// A lost echo still has an entry; a detector never reports zero or less.
constexpr double kLeastRange_m = 1e-4;

void check_fraction(const char* field, double value) {
  require(value >= 0.0 && value <= 1.0, field, value, "0 .. 1");
}

void check_sigma(const char* field, double value) {
  require(value >= 0.0 && value <= 1e5, field, value, "0 .. 100000");
}

void check_swing(const char* field, const Swing& swing) {
  require(swing.amplitude_deg >= 0.0 && swing.amplitude_deg <= 180.0,
          std::string(field) + ".amplitude_deg", swing.amplitude_deg, "0 .. 180");
  require(swing.period_s > 0.0 && swing.period_s <= 1e6, std::string(field) + ".period_s",
          swing.period_s, "over 0, at most 1e6");
  require(std::fabs(swing.phase_rad) <= 1e3, std::string(field) + ".phase_rad", swing.phase_rad,
          "-1000 .. 1000");
}

void check(const Scene& scene) {
  const SurveySpec& survey = scene.survey;
  require(survey.interval_s >= 1e-6 && survey.interval_s <= 1e5, "interval_s", survey.interval_s,
          "1e-6 .. 1e5");
  if (survey.kind == SurveyKind::kRandom) {
    require(survey.ping_count >= 1 && survey.ping_count <= 100000000, "ping_count",
            static_cast<double>(survey.ping_count), "1 .. 100000000");
    require(survey.altitude_min_m > 0.0 && survey.altitude_min_m <= 1e5, "altitude_min_m",
            survey.altitude_min_m, "over 0, at most 1e5");
    require(survey.altitude_max_m >= survey.altitude_min_m && survey.altitude_max_m <= 1e5,
            "altitude_max_m", survey.altitude_max_m, "altitude_min_m .. 1e5");
    require(survey.max_tilt_deg >= 0.0 && survey.max_tilt_deg < 90.0, "max_tilt_deg",
            survey.max_tilt_deg, "0 .. below 90");
  } else {
    require(survey.line_spacing_m > 0.0 && std::isfinite(survey.line_spacing_m), "line_spacing_m",
            survey.line_spacing_m, "over 0");
    require(survey.along_step_m > 0.0 && std::isfinite(survey.along_step_m), "along_step_m",
            survey.along_step_m, "over 0");
    require(survey.altitude_m > 0.0 && survey.altitude_m <= 1e5, "altitude_m", survey.altitude_m,
            "over 0, at most 1e5");
    require(survey.altitude_smoothing_m >= 0.0 && survey.altitude_smoothing_m <= 1e5,
            "altitude_smoothing_m", survey.altitude_smoothing_m, "0 .. 1e5");
    if (survey.depth_m) {
      require(std::fabs(*survey.depth_m) <= 1e5, "depth_m", *survey.depth_m, "-1e5 .. 1e5");
    }
    require(survey.beam_count >= 1 && survey.beam_count <= 4096, "beam_count",
            static_cast<double>(survey.beam_count), "1 .. 4096");
    require(survey.opening_deg >= 0.0 && survey.opening_deg < 180.0, "opening_deg",
            survey.opening_deg, "0 .. below 180");
    check_swing("roll", survey.roll);
    check_swing("pitch", survey.pitch);
    check_swing("yaw", survey.yaw);
  }
  const ErrorSpec& errors = scene.errors;
  check_sigma("sigma_range_m", errors.sigma_range_m);
  require(errors.sigma_pointing_deg >= 0.0 && errors.sigma_pointing_deg <= 45.0,
          "sigma_pointing_deg", errors.sigma_pointing_deg, "0 .. 45");
  check_sigma("sigma_position_m.north", errors.sigma_position_m.x);
  check_sigma("sigma_position_m.east", errors.sigma_position_m.y);
  check_sigma("sigma_position_m.down", errors.sigma_position_m.z);
  check_sigma("drift_sigma_m", errors.drift_sigma_m);
  require(errors.drift_time_s > 0.0 && errors.drift_time_s <= 1e7, "drift_time_s",
          errors.drift_time_s, "over 0, at most 1e7");
  check_fraction("outlier_fraction", errors.outlier_fraction);
  check_fraction("dropout_fraction", errors.dropout_fraction);
}

// One transmission of the plan: where the transducer really is, how it is really turned, and the beams.
struct Transmission {
  std::int64_t time_us = 0;
  Vec3 position_m;
  Attitude attitude;
};

double swing_deg(const Swing& swing, double time_s) {
  if (swing.amplitude_deg == 0.0) {
    return 0.0;
  }
  return swing.amplitude_deg *
         exact::sin(2.0 * exact::kPi * time_s / swing.period_s + swing.phase_rad);
}

double wrap_360_deg(double angle_deg) {
  const double wrapped = angle_deg - 360.0 * std::floor(angle_deg / 360.0);
  return wrapped < 360.0 ? wrapped : 0.0;
}

// Draws every error in a fixed order, whether the beam turns out to hit or not: the streams then depend
// on the plan alone and not on rounding in the ray tracer.
class Reporter {
 public:
  Reporter(const Scene& scene, Survey* survey)
      : errors_(scene.errors),
        range_(scene.seed, kRangeStream),
        pointing_(scene.seed, kPointingStream),
        position_(scene.seed, kPositionStream),
        drift_(scene.seed, kDriftStream),
        outlier_(scene.seed, kOutlierStream),
        dropout_(scene.seed, kDropoutStream),
        survey_(survey) {}

  // Advances the drift to a new transmission.
  void next_transmission(double elapsed_s) {
    const double keep = exact::exp(-std::min(elapsed_s / errors_.drift_time_s, 700.0));
    const double kick = errors_.drift_sigma_m * std::sqrt(1.0 - keep * keep);
    drift_north_m_ = keep * drift_north_m_ + kick * drift_.normal();
    drift_east_m_ = keep * drift_east_m_ + kick * drift_.normal();
  }

  void report(const Transmission& sent, Vec3 true_direction_frd,
              std::optional<double> true_range_m) {
    const double side = pointing_.normal();
    const double other = pointing_.normal();
    const Vec3 position_error{errors_.sigma_position_m.x * position_.normal(),
                              errors_.sigma_position_m.y * position_.normal(),
                              errors_.sigma_position_m.z * position_.normal()};
    const double range_error_m = errors_.sigma_range_m * range_.normal();
    const bool is_outlier = outlier_.uniform() < errors_.outlier_fraction;
    const double outlier_share = outlier_.uniform();
    const bool is_dropout = dropout_.uniform() < errors_.dropout_fraction;
    if (!true_range_m) {
      ++survey_->missed_count;
      return;
    }
    SimulatedPing ping;
    ping.time_us = sent.time_us;
    ping.position_m = sent.position_m + Vec3{drift_north_m_, drift_east_m_, 0.0} + position_error;
    ping.attitude = sent.attitude;
    ping.beam = beam_angles(misread(true_direction_frd, side, other));
    if (is_dropout) {
      ++survey_->dropout_count;
    } else if (is_outlier) {
      ++survey_->outlier_count;
      ping.range_m = std::max(kLeastRange_m, outlier_share * *true_range_m);
    } else {
      ping.range_m = std::max(kLeastRange_m, *true_range_m + range_error_m);
    }
    survey_->pings.push_back(ping);
  }

 private:
  // The direction as the vehicle believes it to be: turned by a Gaussian angle about two axes.
  Vec3 misread(Vec3 direction, double side, double other) const {
    const double length = std::sqrt(side * side + other * other);
    if (errors_.sigma_pointing_deg == 0.0 || length == 0.0) {
      return direction;
    }
    const exact::SinCos turn =
        exact::sin_cos(length * errors_.sigma_pointing_deg * exact::kRadPerDeg);
    const Basis basis = basis_about(direction);
    return turn.cos * direction + (turn.sin / length) * (side * basis.side + other * basis.other);
  }

  const ErrorSpec& errors_;
  Random range_;
  Random pointing_;
  Random position_;
  Random drift_;
  Random outlier_;
  Random dropout_;
  Survey* survey_;
  double drift_north_m_ = 0.0;
  double drift_east_m_ = 0.0;
};

std::int64_t time_of_us(double interval_s, std::size_t index) {
  return std::llround(interval_s * 1e6) * static_cast<std::int64_t>(index);
}

void fly_random(const Terrain& terrain, const Scene& scene, EchoModel* echo, Survey* survey,
                const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
  const SurveySpec& plan = scene.survey;
  Random random(scene.seed, kPlanStream);
  Reporter reporter(scene, survey);
  const double cos_limit = exact::cos(plan.max_tilt_deg * exact::kRadPerDeg);
  const double length_m = static_cast<double>(terrain.north_count()) * terrain.cell_m();
  const double width_m = static_cast<double>(terrain.east_count()) * terrain.cell_m();
  survey->planned_count = plan.ping_count;
  for (std::size_t k = 0; k < plan.ping_count; ++k) {
    Transmission sent;
    sent.time_us = time_of_us(plan.interval_s, k);
    sent.position_m.x = terrain.origin_north_m() + random.uniform(0.0, length_m);
    sent.position_m.y = terrain.origin_east_m() + random.uniform(0.0, width_m);
    sent.position_m.z = terrain.depth_m(sent.position_m.x, sent.position_m.y) -
                        random.uniform(plan.altitude_min_m, plan.altitude_max_m);
    sent.attitude.heading_deg = random.uniform(0.0, 360.0);
    const double cos_tilt = random.uniform(cos_limit, 1.0);
    const Vec3 direction_frd{std::sqrt(1.0 - cos_tilt * cos_tilt), 0.0, cos_tilt};
    const Vec3 axis = world_from_vehicle(sent.attitude, direction_frd);
    if (k > 0) {
      reporter.next_transmission(plan.interval_s);
    }
    // The outer half cell has no ground, hence no altitude: such a ping is dropped.
    const bool has_ground = terrain.contains(sent.position_m.x, sent.position_m.y);
    reporter.report(
        sent, direction_frd,
        has_ground ? echo->measure(sent.position_m, axis, &survey->touched) : std::nullopt);
    if (progress) {
      progress(k + 1, plan.ping_count);
    }
  }
}

// How deep a vehicle runs that keeps its altitude over (x, y).
double transducer_depth_m(const Terrain& terrain, const SurveySpec& plan, Vec3 position) {
  const double ground_m = terrain.depth_m(position.x, position.y);
  if (plan.altitude_smoothing_m == 0.0) {
    return ground_m - plan.altitude_m;
  }
  constexpr int kSamplesPerSide = 8;
  double sum_m = 0.0;
  for (int k = -kSamplesPerSide; k <= kSamplesPerSide; ++k) {
    sum_m +=
        terrain.depth_m(position.x + plan.altitude_smoothing_m * k / kSamplesPerSide, position.y);
  }
  const double smooth_m = sum_m / (2 * kSamplesPerSide + 1);
  // Never nearer to the ground than half of the altitude, however steep it rises.
  return std::min(smooth_m - plan.altitude_m, ground_m - 0.5 * plan.altitude_m);
}

void fly_lawnmower(const Terrain& terrain, const Scene& scene, EchoModel* echo, Survey* survey,
                   const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
  const SurveySpec& plan = scene.survey;
  // A hair of slack, so that an extent that is a whole number of steps gets its last one.
  const double slack = 1e-9;
  const double length_m = terrain.north_m() - terrain.south_m();
  const double steps = std::floor(length_m / plan.along_step_m + slack);
  const double width_m = static_cast<double>(terrain.east_count()) * terrain.cell_m();
  const double lines = std::floor(width_m / plan.line_spacing_m + 0.5 + slack);
  if (!(steps * lines * static_cast<double>(plan.beam_count) <= 1e8)) {
    throw std::invalid_argument(
        "simulate: line_spacing_m, along_step_m and beam_count give more than "
        "100000000 beams over this terrain");
  }
  const std::size_t step_count = static_cast<std::size_t>(steps) + 1;
  // A spacing wider than the terrain still gets one line, down its middle.
  const std::size_t line_count = std::max<std::size_t>(1, static_cast<std::size_t>(lines));
  survey->planned_count = line_count * step_count * plan.beam_count;
  std::vector<Vec3> beams_frd;
  for (std::size_t k = 0; k < plan.beam_count; ++k) {
    const double across_deg =
        plan.beam_count == 1
            ? 0.0
            : plan.opening_deg *
                  (static_cast<double>(k) / static_cast<double>(plan.beam_count - 1) - 0.5);
    const exact::SinCos across = exact::sin_cos(across_deg * exact::kRadPerDeg);
    beams_frd.push_back({0.0, across.sin, across.cos});
  }
  Reporter reporter(scene, survey);
  std::size_t index = 0;
  for (std::size_t line = 0; line < line_count; ++line) {
    const double east_m =
        line_count == 1 && plan.line_spacing_m > width_m
            ? 0.5 * (terrain.west_m() + terrain.east_m())
            : std::clamp(
                  terrain.origin_east_m() + (static_cast<double>(line) + 0.5) * plan.line_spacing_m,
                  terrain.west_m(), terrain.east_m());
    const bool northward = line % 2 == 0;
    for (std::size_t step = 0; step < step_count; ++step, ++index) {
      Transmission sent;
      sent.time_us = time_of_us(plan.interval_s, index);
      const double time_s = static_cast<double>(sent.time_us) * 1e-6;
      const double along_m = static_cast<double>(step) * plan.along_step_m;
      sent.position_m.x = northward ? terrain.south_m() + along_m : terrain.north_m() - along_m;
      sent.position_m.y = east_m;
      const double ground_m = terrain.depth_m(sent.position_m.x, sent.position_m.y);
      sent.position_m.z =
          plan.depth_m ? *plan.depth_m : transducer_depth_m(terrain, plan, sent.position_m);
      if (sent.position_m.z >= ground_m) {
        throw std::invalid_argument("simulate: depth_m must stay above the ground, got " +
                                    std::to_string(*plan.depth_m) + " over ground at " +
                                    std::to_string(ground_m) + " m");
      }
      sent.attitude.roll_deg = swing_deg(plan.roll, time_s);
      sent.attitude.pitch_deg = swing_deg(plan.pitch, time_s);
      sent.attitude.heading_deg =
          wrap_360_deg((northward ? 0.0 : 180.0) + swing_deg(plan.yaw, time_s));
      if (index > 0) {
        reporter.next_transmission(plan.interval_s);
      }
      for (const Vec3& beam_frd : beams_frd) {
        const Vec3 axis = world_from_vehicle(sent.attitude, beam_frd);
        reporter.report(sent, beam_frd, echo->measure(sent.position_m, axis, &survey->touched));
      }
      if (progress) {
        progress((index + 1) * plan.beam_count, survey->planned_count);
      }
    }
  }
}

// Shortest decimal that reads back as the same value: 3, 0.5, 12.5.
std::string shortest(double value) {
  char buffer[64];
  const std::to_chars_result result =
      std::to_chars(buffer, buffer + sizeof(buffer), value, std::chars_format::fixed);
  return std::string(buffer, result.ptr);
}

// Millimetres of a length in metres, without the noise of the multiplication.
std::string millimetres(double value_m) {
  const double micrometres = std::floor(value_m * 1e6 + 0.5);
  return shortest(micrometres / 1e3);
}

}  // namespace

Survey simulate(const Terrain& terrain, const Scene& scene,
                const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
  check(scene);
  Survey survey;
  survey.touched.assign(terrain.north_count() * terrain.east_count(), 0);
  EchoModel echo(terrain, scene.echo);
  if (scene.survey.kind == SurveyKind::kRandom) {
    fly_random(terrain, scene, &echo, &survey, progress);
  } else {
    fly_lawnmower(terrain, scene, &echo, &survey, progress);
  }
  return survey;
}

std::string format_pings_csv(const Survey& survey) {
  std::string text =
      "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n";
  text.reserve(text.size() + survey.pings.size() * 90);
  for (const SimulatedPing& ping : survey.pings) {
    text += std::to_string(ping.time_us);
    for (const double value :
         {ping.position_m.x, ping.position_m.y, ping.position_m.z, ping.attitude.roll_deg,
          ping.attitude.pitch_deg, ping.attitude.heading_deg, ping.beam.azimuth_deg,
          ping.beam.elevation_deg}) {
      text += ',';
      append_fixed(&text, value, 4);
    }
    text += ',';
    if (ping.range_m) {
      append_fixed(&text, *ping.range_m, 4);
    }
    text += '\n';
  }
  return text;
}

std::string format_map_toml(const Terrain& terrain, const Scene& scene) {
  const double cell_m = terrain.cell_m();
  const double margin = static_cast<double>(scene.declared.down_margin_cells);
  const double top_cell = std::floor(terrain.shallowest_m() / cell_m) - margin;
  const double bottom_cell = std::ceil(terrain.deepest_m() / cell_m) + margin;
  const ErrorSpec& errors = scene.errors;
  std::string text = "[grid]\n";
  text += "cell_mm = " + millimetres(cell_m) + "\n";
  text += "size = [" + std::to_string(terrain.north_count()) + ", " +
          std::to_string(terrain.east_count()) + ", " + shortest(bottom_cell - top_cell) + "]\n";
  text += "origin_mm = [" + millimetres(terrain.origin_north_m()) + ", " +
          millimetres(terrain.origin_east_m()) + ", " + millimetres(top_cell * cell_m) + "]\n";
  text += "\n[sonar]\n";
  text += "beam_half_angle_deg = " + shortest(scene.echo.beam_half_angle_deg) + "\n";
  text += "sigma_pointing_deg = " + shortest(errors.sigma_pointing_deg) + "\n";
  text += "sigma_range_mm = " + millimetres(errors.sigma_range_m) + "\n";
  text += "min_range_mm = " + millimetres(scene.declared.min_range_m) + "\n";
  text += "max_range_mm = " + millimetres(scene.declared.max_range_m) + "\n";
  if (scene.echo.detection_fraction != 0.1) {
    text += "detection_fraction = " + shortest(scene.echo.detection_fraction) + "\n";
  }
  text += "\n[navigation]\n";
  text += "sigma_position_mm = [" + millimetres(errors.sigma_position_m.x) + ", " +
          millimetres(errors.sigma_position_m.y) + ", " + millimetres(errors.sigma_position_m.z) +
          "]\n";
  if (scene.declared.drift && errors.drift_sigma_m > 0.0) {
    text += "sigma_correlated_mm = [" + millimetres(errors.drift_sigma_m) + ", " +
            millimetres(errors.drift_sigma_m) + ", 0]\n";
  }
  return text;
}

void write_scene(const std::string& directory, const Terrain& terrain, const Scene& scene,
                 const Survey& survey) {
  OutputDir out(directory);
  out.write("pings.csv", format_pings_csv(survey));
  out.write("map.toml", format_map_toml(terrain, scene));
  Raster raster = terrain_elevation(terrain);
  out.write("truth.asc", format_esri_ascii(raster));
  for (std::size_t i = 0; i < terrain.north_count(); ++i) {
    for (std::size_t j = 0; j < terrain.east_count(); ++j) {
      raster.at(static_cast<int>(terrain.north_count() - 1 - i), static_cast<int>(j)) =
          survey.touched[i * terrain.east_count() + j];
    }
  }
  out.write("touched.asc", format_esri_ascii(raster, 0));
  out.commit();
}

}  // namespace leadline::host
