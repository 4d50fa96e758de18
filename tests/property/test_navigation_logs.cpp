// The navigation filter on real logs of an AUV (Doppler log at 1 Hz, reference trajectory): dead reckoning from
// velocity, depth and heading, beside plain integration. Prints the table of estimator/README.md.
//
// What the logs do not say, found from them: the Doppler log's file lags or leads the reference by up to
// 1.5 s, log by log, and the log sits 1.86 m aft of the reference point. The time is found from the log
// itself, where its sideways speed and the turning of the heading agree best; no reference position or
// velocity enters it. The arm was fitted once, on the first four logs.
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "estimator/navigation_filter.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Bam32;
using leadline::base::kEast;
using leadline::base::kNorth;
using leadline::base::TimeUs;
using leadline::estimator::Fusion;
using leadline::estimator::LeverArm;
using leadline::estimator::NavigationFilter;
using leadline::estimator::NavigationFilterConfig;
using leadline::estimator::NavMeasurement;

constexpr double kPi = 3.14159265358979323846;
constexpr int kLogs = 8;

using Row = std::vector<double>;

std::vector<Row> read_csv(const std::string& path) {
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

double wrapped(double angle) { return std::remainder(angle, 2 * kPi); }

struct Epoch {
  double t, north, east, depth, v_north, v_east, roll, pitch, heading;
};

struct Log {
  std::vector<Epoch> reference;
  std::vector<std::array<double, 4>> velocity;  // t, forward, starboard, down
  double distance_m = 0;
};

Log read_log(int number) {
  const std::string folder = "auv_snapir_dvl_gt/";
  const std::string name = "_trajectory0" + std::to_string(number) + ".csv";
  Log log;
  const auto truth = read_csv(leadline::test::require_data(folder + "GT" + name));
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
  for (const Row& row : read_csv(leadline::test::require_data(folder + "DVL" + name))) {
    log.velocity.push_back({row[0], row[1], row[2], row[3]});
  }
  return log;
}

// An angle at `part` of the way from row i - 1 to row i: on the cubic through both whose slopes there are the means
// of those beside. `slope`: its own there, per row.
double smooth_angle(const std::vector<Epoch>& r, std::size_t i, double part, double Epoch::*angle,
                    double* slope) {
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
Reading reference_at(const Log& log, double t) {
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

// Rate of the heading at `t`, rad/s: over the second around it.
double heading_rate(const Log& log, double t) {
  return wrapped(reference_at(log, t + 0.5).at.heading - reference_at(log, t - 0.5).at.heading);
}

// By how much the log's times are early: where sideways speed and turning agree best.
double time_shift_s(const Log& log) {
  double best = 0;
  double best_shift = 0;
  for (double shift = -2.0; shift <= 2.0; shift += 0.05) {
    double sw = 0, sv = 0, sww = 0, svv = 0, swv = 0;
    int n = 0;
    for (std::size_t i = 3; i + 3 < log.velocity.size(); ++i) {
      const double w = heading_rate(log, log.velocity[i][0] + shift);
      const double v = log.velocity[i][2];
      sw += w;
      sv += v;
      sww += w * w;
      svv += v * v;
      swv += w * v;
      ++n;
    }
    const double correlation =
        std::abs(swv - sw * sv / n) / std::sqrt((sww - sw * sw / n) * (svv - sv * sv / n));
    if (correlation > best) {
      best = correlation;
      best_shift = shift;
    }
  }
  return best_shift;
}

Bam32 bam(double radians) {
  return static_cast<Bam32>(
      static_cast<std::int64_t>(std::llround(radians * 4294967296.0 / (2 * kPi))));
}

double plain_error_m(const Log& log) {
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

struct Run {
  double error_m = 0;
  double nees2 = 0;  // of the end, two dimensions, per dimension
  double nis = 0;    // of the velocities, per dimension
  double tail = 0;   // part of the velocities beyond what 95 % should stay within
  int gated = 0;
};

// Dead reckoning by the filter: starts from the reference's first position, then velocity, depth, attitude.
Run reckon(const Log& log, const LeverArm& lever, double shift_s, bool follows = true) {
  NavigationFilterConfig config;
  config.acceleration_m_s2 = 0.15F;
  config.vertical_acceleration_m_s2 = 0.05F;
  config.velocity_scale = 4e-3F;
  config.velocity_misalignment_rad = 3e-3F;
  config.velocity_scale_walk = 6e-4F;
  config.velocity_misalignment_walk_rad = 6e-4F;
  config.motion_gain = follows ? 0.2F : 0.0F;
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
    while (next < log.velocity.size() && log.velocity[next][0] + shift_s <= at.t) {
      filter.predict(us(log.velocity[next][0] + shift_s));
      const std::int64_t v[3] = {us(log.velocity[next][1]), us(log.velocity[next][2]),
                                 us(log.velocity[next][3])};
      const Fusion fusion = filter.update_velocity_bottom(v, 9'000, lever, 0);
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
  const double ee = static_cast<double>(p[leadline::estimator::kErrorStates + 1]);
  run.nees2 = (ee * dn * dn - 2 * ne * dn * de + nn * de * de) / (nn * ee - ne * ne) / 2;
  run.nis /= std::max(dimensions, 1);
  run.tail /= std::max(dimensions / 3, 1);
  return run;
}

TEST(dead_reckoning_of_a_real_vehicle) {
  print_message(
      "| log | way, m | plain, m | %% | filter, %% | with the log's arm, %% | and its time, %% | "
      "shift, s | NEES/2 | NIS/3 | beyond 95 %%, %% | gated | constant noise: %%, NEES/2, NIS/3 "
      "|\n");
  const LeverArm aft{-1'860, 0, 0};
  double plain = 0;
  double bare = 0;
  double armed = 0;
  double timed = 0;
  double nees = 0;
  for (int number = 1; number <= kLogs; ++number) {
    const Log log = read_log(number);
    const double shift = time_shift_s(log);
    const double percent = 100 / log.distance_m;
    const double plain_m = plain_error_m(log);
    const Run none = reckon(log, {}, 0);
    const Run arm = reckon(log, aft, 0);
    const Run both = reckon(log, aft, shift);
    const Run constant = reckon(log, aft, shift, false);
    print_message(
        "| %d | %.0f | %.2f | %.2f | %.2f | %.2f | %.2f | %.1f | %.2f | %.2f | %.1f | %d "
        "| %.2f, %.2f, %.2f |\n",
        number, log.distance_m, plain_m, percent * plain_m, percent * none.error_m,
        percent * arm.error_m, percent * both.error_m, shift, both.nees2, both.nis, 100 * both.tail,
        both.gated, percent * constant.error_m, constant.nees2, constant.nis);
    // 1,200 degrees of freedom: 95 % between 0.92 and 1.08.
    assert_true(both.nis > 0.92 && both.nis < 1.08);
    assert_true(both.gated <= 2);
    plain += percent * plain_m / kLogs;
    bare += percent * none.error_m / kLogs;
    armed += percent * arm.error_m / kLogs;
    timed += percent * both.error_m / kLogs;
    nees += both.nees2 / kLogs;
  }
  print_message("| mean | | | %.2f | %.2f | %.2f | %.2f | | %.2f | | |\n", plain, bare, armed,
                timed, nees);
  assert_true(timed < 0.7 * plain);
  // Sixteen degrees of freedom: 95 % between 0.43 and 1.80.
  assert_true(nees > 0.43 && nees < 1.80);
}

}  // namespace
