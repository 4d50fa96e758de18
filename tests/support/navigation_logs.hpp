// Real logs of an AUV (Doppler log at 1 Hz, reference trajectory) flown through the navigation filter: dead reckoning
// from velocity, depth and attitude. Shared by the test that tables them and the one that judges its constants.
//
// What the logs do not say, found from each log alone, no position or velocity of the reference in it: by how much
// the Doppler log's times differ from the reference's, and how far ahead of it the log sits. Its velocity, turned by
// the attitude, is the change of depth; time and arm are where both agree best.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "estimator/navigation_filter.hpp"
#include "tests/support/test.hpp"

namespace leadline::test {

using base::Bam32;
using base::kEast;
using base::kNorth;
using base::TimeUs;
using estimator::Fusion;
using estimator::LeverArm;
using estimator::NavigationFilter;
using estimator::NavigationFilterConfig;
using estimator::NavMeasurement;

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr int kLogs = 8;

using Row = std::vector<double>;

inline std::vector<Row> read_csv(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  std::vector<Row> rows;
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string field;
    Row row;
    while (std::getline(fields, field, ',')) {
      row.push_back(std::stod(field));
    }
    rows.push_back(row);
  }
  return rows;
}

inline double wrapped(double angle) { return std::remainder(angle, 2 * kPi); }

struct Epoch {
  double t, north, east, depth, v_north, v_east, roll, pitch, heading;
};

struct Log {
  std::vector<Epoch> reference;
  std::vector<std::array<double, 4>> velocity;  // t, forward, starboard, down
  double distance_m = 0;
};

inline Log read_log(int number) {
  const std::string folder = "auv_snapir_dvl_gt/";
  const std::string name = "_trajectory0" + std::to_string(number) + ".csv";
  Log log;
  const auto truth = read_csv(require_data(folder + "GT" + name));
  const double lat0 = truth[0][2];
  const double lon0 = truth[0][1];
  const double e2 = 0.00669437999014;
  const double w2 = 1 - e2 * std::sin(lat0) * std::sin(lat0);
  const double meridian = 6378137.0 * (1 - e2) / (w2 * std::sqrt(w2));
  const double parallel = 6378137.0 / std::sqrt(w2) * std::cos(lat0);
  for (const Row& row : truth) {
    log.reference.push_back({row[0], (row[2] - lat0) * meridian, (row[1] - lon0) * parallel,
                             -row[3], row[4], row[5], row[7], row[8], row[9]});
  }
  for (std::size_t i = 1; i < log.reference.size(); ++i) {
    log.distance_m += std::hypot(log.reference[i].north - log.reference[i - 1].north,
                                 log.reference[i].east - log.reference[i - 1].east);
  }
  for (const Row& row : read_csv(require_data(folder + "DVL" + name))) {
    log.velocity.push_back({row[0], row[1], row[2], row[3]});
  }
  return log;
}

// An angle at `part` of the way from row i - 1 to row i: on the cubic through both whose slopes there are the means
// of those beside. `slope`: its own there, per row.
inline double smooth_angle(const std::vector<Epoch>& r, std::size_t i, double part,
                           double Epoch::*angle, double* slope) {
  const auto step = [&r, angle](std::size_t to) {
    return wrapped(r[to].*angle - r[to - 1].*angle);
  };
  const double rise = step(i);
  const double before = i > 1 ? (step(i - 1) + rise) / 2 : rise;
  const double behind = i + 1 < r.size() ? (rise + step(i + 1)) / 2 : rise;
  const double bend = before + behind - 2 * rise;
  const double curve = 3 * rise - 2 * before - behind;
  *slope = before + part * (2 * curve + part * 3 * bend);
  return r[i - 1].*angle + part * (before + part * (curve + part * bend));
}

struct Reading {
  Epoch at;
  double heading_rate;  // rad/s
  double rate[3];       // of the body about forward, right, down, rad/s
};

// The reference at `t`, interpolated: its attitude, and the rates that belong to it, stand for those of a sensor.
inline Reading reference_at(const Log& log, double t) {
  const auto& r = log.reference;
  std::size_t i = 1;
  while (i + 1 < r.size() && r[i].t < t) {
    ++i;
  }
  const Epoch& a = r[i - 1];
  const Epoch& b = r[i];
  const double part = std::min(std::max((t - a.t) / (b.t - a.t), 0.0), 1.0);
  Reading reading{a, 0, {}};
  Epoch& at = reading.at;
  at.t = t;
  at.depth += part * (b.depth - a.depth);
  double slope[3] = {};
  at.roll = smooth_angle(r, i, part, &Epoch::roll, &slope[0]);
  at.pitch = smooth_angle(r, i, part, &Epoch::pitch, &slope[1]);
  at.heading = smooth_angle(r, i, part, &Epoch::heading, &slope[2]);
  const double roll_rate = slope[0] / (b.t - a.t);
  const double pitch_rate = slope[1] / (b.t - a.t);
  reading.heading_rate = slope[2] / (b.t - a.t);
  const double level = std::cos(at.pitch) * reading.heading_rate;
  reading.rate[0] = roll_rate - std::sin(at.pitch) * reading.heading_rate;
  reading.rate[1] = std::cos(at.roll) * pitch_rate + std::sin(at.roll) * level;
  reading.rate[2] = std::cos(at.roll) * level - std::sin(at.roll) * pitch_rate;
  return reading;
}

/// Time and place of the Doppler log.
struct Alignment {
  double shift_s;  ///< to be added to its times
  double arm_m;    ///< ahead of the reference point
};

// Least squares of the arm for each shift: an arm `l` ahead adds l * (0, rate down, -rate right) to the velocity.
inline Alignment alignment(const Log& log) {
  Alignment best{};
  double least = 1e9;
  constexpr double kMargin_s = 2.0;  // where slopes need neighbours
  for (int step = -50; step <= 50; ++step) {
    const double shift = 0.05 * step;
    double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
    double last_sink = 0, last_arm = 0, last_depth = 0, last_t = -1;
    for (const auto& row : log.velocity) {
      const double t = row[0] + shift;
      if (t < kMargin_s || t > log.reference.back().t - kMargin_s) {
        continue;
      }
      const Reading at = reference_at(log, t);
      const double side = std::cos(at.at.pitch) * std::sin(at.at.roll);
      const double level = std::cos(at.at.pitch) * std::cos(at.at.roll);
      const double sink = -std::sin(at.at.pitch) * row[1] + side * row[2] + level * row[3];
      const double arm = side * at.rate[2] - level * at.rate[1];
      if (last_t >= 0) {
        const double dt = t - last_t;
        const double x = dt * (arm + last_arm) / 2;
        const double y = dt * (sink + last_sink) / 2 - (at.at.depth - last_depth);
        n += 1;
        sx += x;
        sy += y;
        sxx += x * x;
        sxy += x * y;
        syy += y * y;
      }
      last_sink = sink;
      last_arm = arm;
      last_depth = at.at.depth;
      last_t = t;
    }
    const double cxx = sxx - sx * sx / n;
    const double cxy = sxy - sx * sy / n;
    const double rest = (syy - sy * sy / n - cxy * cxy / cxx) / n;
    if (rest < least) {
      least = rest;
      best = {shift, cxy / cxx};
    }
  }
  return best;
}

inline Bam32 bam(double radians) {
  return static_cast<Bam32>(
      static_cast<std::int64_t>(std::llround(radians * 4294967296.0 / (2 * kPi))));
}

inline double plain_error_m(const Log& log) {
  double north = 0;
  double east = 0;
  double last_n = 0;
  double last_e = 0;
  for (std::size_t i = 0; i < log.velocity.size(); ++i) {
    const Epoch& at = log.reference[i];
    const double x = log.velocity[i][1];
    const double y = log.velocity[i][2];
    const double z = log.velocity[i][3];
    const double level = std::cos(at.pitch) * x +
                         std::sin(at.pitch) * (std::sin(at.roll) * y + std::cos(at.roll) * z);
    const double side = std::cos(at.roll) * y - std::sin(at.roll) * z;
    const double vn = std::cos(at.heading) * level - std::sin(at.heading) * side;
    const double ve = std::sin(at.heading) * level + std::cos(at.heading) * side;
    if (i > 0) {
      const double dt = at.t - log.reference[i - 1].t;
      north += dt * (vn + last_n) / 2;
      east += dt * (ve + last_e) / 2;
    }
    last_n = vn;
    last_e = ve;
  }
  return std::hypot(north - log.reference.back().north, east - log.reference.back().east);
}

/// What the reference's own velocity misses its own position by at the end: nobody's error is known better.
inline double reference_error_m(const Log& log) {
  double north = 0;
  double east = 0;
  for (std::size_t i = 1; i < log.reference.size(); ++i) {
    const Epoch& a = log.reference[i - 1];
    const Epoch& b = log.reference[i];
    north += (b.t - a.t) * (a.v_north + b.v_north) / 2;
    east += (b.t - a.t) * (a.v_east + b.v_east) / 2;
  }
  return std::hypot(north - log.reference.back().north, east - log.reference.back().east);
}

/// What the logs do not say about log and vehicle: as all eight choose it (property.navigation_constants_full).
struct NavigationConstants {
  std::int64_t sigma_um_s = 4'000;  ///< of the Doppler log
  float acceleration_m_s2 = 0.05F;  ///< what the motion noise starts from
  float wander = 3e-4F;             ///< of the log's scale and yaw, per root second
  float motion_gain = 0.3F;         ///< 0: constant noise
};

struct Run {
  double error_m = 0;
  double nees2 = 0;  // of the end, two dimensions, per dimension
  double nis = 0;    // of the velocities, per dimension
  double tail = 0;   // part of the velocities beyond what 95 % should stay within
  int gated = 0;
};

// Dead reckoning by the filter: starts from the reference's first position, then velocity, depth, attitude.
inline Run reckon(const Log& log, const Alignment& alignment,
                  const NavigationConstants& constants) {
  const LeverArm lever{static_cast<std::int32_t>(std::lround(alignment.arm_m * 1e3)), 0, 0};
  NavigationFilterConfig config;
  config.acceleration_m_s2 = constants.acceleration_m_s2;
  config.vertical_acceleration_m_s2 = constants.acceleration_m_s2 / 3;
  config.velocity_scale = 4e-3F;
  config.velocity_misalignment_rad = 3e-3F;
  config.velocity_scale_walk = constants.wander;
  config.velocity_misalignment_walk_rad = constants.wander;
  config.motion_gain = constants.motion_gain;
  NavigationFilter filter(config);
  Run run;
  int dimensions = 0;
  std::size_t next = 0;
  const std::uint32_t level_sigma[2] = {500, 500};
  const auto us = [](double s) { return static_cast<TimeUs>(std::llround(s * 1e6)); };
  const double end = log.reference.back().t;
  const int steps = static_cast<int>(end * 10);
  for (int step = 0; step <= steps; ++step) {
    const Reading reading = reference_at(log, step == steps ? end : step * 0.1);
    const Epoch& at = reading.at;
    while (next < log.velocity.size() && log.velocity[next][0] + alignment.shift_s <= at.t) {
      filter.predict(us(log.velocity[next][0] + alignment.shift_s));
      const std::int64_t v[3] = {us(log.velocity[next][1]), us(log.velocity[next][2]),
                                 us(log.velocity[next][3])};
      const Fusion fusion = filter.update_velocity_bottom(v, constants.sigma_um_s, lever, 0);
      if (fusion == Fusion::kFused) {
        const double nis = static_cast<double>(filter.last_nis());
        run.nis += nis;
        run.tail += nis > 7.815 ? 1 : 0;
        dimensions += 3;
      }
      run.gated += fusion == Fusion::kGated ? 1 : 0;
      ++next;
    }
    filter.predict(us(at.t));
    const std::int64_t rates[3] = {us(reading.rate[0]), us(reading.rate[1]), us(reading.rate[2])};
    filter.set_rates(rates);
    static_cast<void>(filter.update_level(bam(at.roll), bam(at.pitch), level_sigma, 0));
    static_cast<void>(filter.update_heading(bam(at.heading), 1'000, 0));
    static_cast<void>(filter.update_depth(us(at.depth), 30'000, {}, 0));
    if (step == 0) {
      const std::int64_t start[2] = {0, 0};
      static_cast<void>(filter.update_position(start, 100'000, {}, 0));
    }
  }
  const double dn =
      static_cast<double>(filter.position_um(kNorth, 0)) * 1e-6 - log.reference.back().north;
  const double de =
      static_cast<double>(filter.position_um(kEast, 0)) * 1e-6 - log.reference.back().east;
  run.error_m = std::hypot(dn, de);
  const auto& p = filter.covariance();
  const double nn = static_cast<double>(p[0]);
  const double ne = static_cast<double>(p[1]);
  const double ee = static_cast<double>(p[estimator::kErrorStates + 1]);
  run.nees2 = (ee * dn * dn - 2 * ne * dn * de + nn * de * de) / (nn * ee - ne * ne) / 2;
  run.nis /= std::max(dimensions, 1);
  run.tail /= std::max(dimensions / 3, 1);
  return run;
}

}  // namespace leadline::test
