// The navigator on a simulated vehicle: what the filter gains over raw measurements (the tables of
// estimator/README.md are printed here), and what it does with gaps, jumps, stragglers and nonsense.
#include <cmath>
#include <vector>

#include "estimator/navigator.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Bam32;
using leadline::base::NavSample;
using leadline::base::Pose;
using leadline::base::Status;
using leadline::base::TimeUs;
using leadline::estimator::Geodetic;
using leadline::estimator::KalmanConfig;
using leadline::estimator::KalmanCv;
using leadline::estimator::kJumpCount;
using leadline::estimator::kMaxSampleAge_us;
using leadline::estimator::kStepBackCount;
using leadline::estimator::LocalPlane;
using leadline::estimator::Measurement;
using leadline::estimator::Navigator;
using leadline::estimator::NavigatorConfig;
using leadline::estimator::pressure_depth_um;
using leadline::estimator::SensorMount;
using leadline::test::Random;

constexpr double kPi = 3.14159265358979323846;
constexpr double kBamPerRad = 4294967296.0 / (2.0 * kPi);
constexpr Geodetic kOrigin{47'500'000'000, 9'250'000'000};

Navigator navigator;

NavigatorConfig plain() {
  NavigatorConfig config{};
  config.has_origin = true;
  config.origin = kOrigin;
  config.surface_pressure_pa = 101'325;
  config.water_density_g_m3 = 1'029'000;
  config.gravity_um_s2 = 9'806'650;
  config.sigma_fix_mm = 500;
  config.sigma_depth_mm = 50;
  config.sigma_attitude_urad = 1'745;
  config.sigma_heading_urad = 8'727;
  config.sigma_velocity_mm_s = 50;
  config.acceleration_mm_s2 = 200;  // 0.225 in the turns below
  config.angular_acceleration_urad_s2 = 100'000;
  config.max_gap_us = 600'000;
  return config;
}

void configure(const NavigatorConfig& config) {
  assert_int_equal(navigator.configure(config), Status::kOk);
}

Bam32 bam(double radians) {
  return static_cast<Bam32>(static_cast<std::int64_t>(std::llround(radians * kBamPerRad)));
}
double radians(Bam32 angle) { return static_cast<std::int32_t>(angle) / kBamPerRad; }

NavSample sample_at(TimeUs t_us, std::uint32_t fields) {
  NavSample sample{};
  sample.t_us = t_us;
  sample.fields = fields;
  sample.quality = 255;
  return sample;
}

NavSample fix_at(TimeUs t_us, double north_m, double east_m) {
  LocalPlane plane;
  assert_int_equal(plane.configure(kOrigin), Status::kOk);
  const auto place = plane.to_geodetic(static_cast<std::int64_t>(north_m * 1e6),
                                       static_cast<std::int64_t>(east_m * 1e6));
  NavSample sample = sample_at(t_us, leadline::base::kNavGeodetic);
  sample.latitude_e9deg = place.value().latitude_e9deg;
  sample.longitude_e9deg = place.value().longitude_e9deg;
  return sample;
}

NavSample depth_at(TimeUs t_us, double depth_m) {
  NavSample sample = sample_at(t_us, leadline::base::kNavDepth);
  sample.depth_um = static_cast<std::int64_t>(depth_m * 1e6);
  return sample;
}

NavSample attitude_at(TimeUs t_us, double roll, double pitch, double heading) {
  NavSample sample = sample_at(t_us, leadline::base::kNavRollPitch | leadline::base::kNavHeading);
  sample.attitude = {bam(roll), bam(pitch), bam(heading)};
  return sample;
}

struct Truth {
  double north, east, depth, roll, pitch, heading, speed;
};

// A lawn mower with round turns, 1.5 m/s; depth, roll, pitch and yaw of a small vehicle in a sea way.
Truth truth_at(double t) {
  const double speed = 1.5;
  const double leg = 60.0;
  const double turn = 10.0;  // radius, m
  const double half = leg + kPi * turn;
  const auto number = static_cast<int>(speed * t / half);
  const double way = speed * t - number * half;
  const bool up = number % 2 == 0;
  Truth truth{};
  truth.speed = speed;
  const double base_east = 2 * turn * number;
  if (way < leg) {
    truth.north = up ? way : leg - way;
    truth.east = base_east;
    truth.heading = up ? 0.0 : kPi;
  } else {
    const double angle = (way - leg) / turn;
    truth.north = up ? leg + turn * std::sin(angle) : -turn * std::sin(angle);
    truth.east = base_east + turn * (1 - std::cos(angle));
    truth.heading = up ? angle : kPi - angle;
  }
  truth.depth = 20.0 + 2.0 * std::sin(2 * kPi * t / 90.0) + 0.1 * std::sin(2 * kPi * t / 7.0);
  truth.roll = 5.0 * kPi / 180 * std::sin(2 * kPi * t / 6.0);
  truth.pitch = 3.0 * kPi / 180 * std::sin(2 * kPi * t / 5.1);
  truth.heading += 1.0 * kPi / 180 * std::sin(2 * kPi * t / 11.0);
  return truth;
}

double wrapped(double angle);

// Rates of the body, by differences, with a bias of 3 mrad/s and the noise of a MEMS sensor.
NavSample rates_at(TimeUs t_us, Random& random) {
  const double s = static_cast<double>(t_us) * 1e-6;
  const double h = 1e-4;
  const Truth a = truth_at(s - h);
  const Truth b = truth_at(s + h);
  const Truth now = truth_at(s);
  const double roll = (b.roll - a.roll) / (2 * h);
  const double pitch = (b.pitch - a.pitch) / (2 * h);
  const double heading = wrapped(b.heading - a.heading) / (2 * h);
  const double body[3] = {
      roll - std::sin(now.pitch) * heading,
      std::cos(now.roll) * pitch + std::sin(now.roll) * std::cos(now.pitch) * heading,
      -std::sin(now.roll) * pitch + std::cos(now.roll) * std::cos(now.pitch) * heading};
  NavSample sample = sample_at(t_us, leadline::base::kNavRates);
  for (std::size_t i = 0; i < 3; ++i) {
    sample.rate_urad_s[i] = std::llround(1e6 * (body[i] + 3e-3 + 5e-3 * random.normal()));
  }
  return sample;
}

// A Doppler log 1.2 m ahead, turned by a quarter to starboard in its mount.
const SensorMount kLogMount{{1'200, 0, 0}, {0, 0, leadline::base::kBam32QuarterTurn}};

NavSample log_at(TimeUs t_us, Random& random) {
  const double s = static_cast<double>(t_us) * 1e-6;
  const double h = 1e-3;
  const Truth a = truth_at(s - h);
  const Truth b = truth_at(s + h);
  const Truth now = truth_at(s);
  // Position of the log itself, differentiated.
  const auto ahead = [](const Truth& truth, double(&p)[3]) {
    p[0] = truth.north + 1.2 * std::cos(truth.pitch) * std::cos(truth.heading);
    p[1] = truth.east + 1.2 * std::cos(truth.pitch) * std::sin(truth.heading);
    p[2] = truth.depth - 1.2 * std::sin(truth.pitch);
  };
  double from[3];
  double to[3];
  ahead(a, from);
  ahead(b, to);
  double v[3];
  for (int i = 0; i < 3; ++i) {
    v[i] = (to[i] - from[i]) / (2 * h);
  }
  const double x1 = std::cos(now.heading) * v[0] + std::sin(now.heading) * v[1];
  const double y1 = -std::sin(now.heading) * v[0] + std::cos(now.heading) * v[1];
  const double x = std::cos(now.pitch) * x1 - std::sin(now.pitch) * v[2];
  const double z1 = std::sin(now.pitch) * x1 + std::cos(now.pitch) * v[2];
  const double y = std::cos(now.roll) * y1 + std::sin(now.roll) * z1;
  const double z = -std::sin(now.roll) * y1 + std::cos(now.roll) * z1;
  NavSample sample = sample_at(t_us, leadline::base::kNavVelocityBody);
  // In the log's axes: its bow is the vehicle's starboard.
  sample.velocity_um_s[0] = std::llround(1e6 * (y + 0.02 * random.normal()));
  sample.velocity_um_s[1] = std::llround(1e6 * (-x + 0.02 * random.normal()));
  sample.velocity_um_s[2] = std::llround(1e6 * (z + 0.02 * random.normal()));
  sample.sigma_velocity_um_s = 20'000;
  return sample;
}

double wrapped(double angle) { return std::remainder(angle, 2 * kPi); }

struct Rms {
  double squares = 0;
  int count = 0;
  void add(double error) {
    squares += error * error;
    ++count;
  }
  [[nodiscard]] double value() const { return std::sqrt(squares / std::max(count, 1)); }
};

// One run of ten minutes: rms errors of the navigator at ping times, between the attitude samples, beside
// the same times read off the raw measurements.
struct Result {
  Rms raw_horizontal, filtered_horizontal, raw_depth, filtered_depth, raw_roll, pass_roll, cv_roll;
  double normalized = 0;  // squared horizontal error over the stated variance, mean
  int normalized_count = 0;
  double gap_error_m = 0;
  double gap_sigma_m = 0;
};

struct Sensors {
  TimeUs attitude_us = 20'000;
  TimeUs fix_us = 1'000'000;
  TimeUs depth_us = 100'000;
  TimeUs velocity_us = 0;  // none
  double sigma_fix = 0.5;
  double sigma_depth = 0.05;
  double sigma_attitude = 0.1 * kPi / 180;
  double gap_from_s = 1e9;  // fixes fail for 26 s
  TimeUs fix_delay_us = 0;  // how late fixes come
  TimeUs rates_us = 0;      // rate sensor: none
  TimeUs log_us = 0;        // Doppler log, 1.2 m ahead: none
};

Result simulate(const Sensors& sensors, const NavigatorConfig& config, std::uint64_t stream) {
  configure(config);
  Random random(stream);
  Result result;
  KalmanCv cv_roll(KalmanConfig{static_cast<std::int64_t>(0.1 * kBamPerRad),
                                static_cast<std::int64_t>(0.1 * kBamPerRad), 0, true});
  std::vector<NavSample> late;
  double raw_n = 0, raw_e = 0, raw_d = 0, raw_roll = 0;
  for (TimeUs t = 0; t < 600'000'000; t += 5'000) {
    const double s = static_cast<double>(t) * 1e-6;
    const Truth now = truth_at(s);
    const bool gap = s >= sensors.gap_from_s && s < sensors.gap_from_s + 26.0;
    if (t % sensors.fix_us == 0 && !gap) {
      const double n = now.north + sensors.sigma_fix * random.normal();
      const double e = now.east + sensors.sigma_fix * random.normal();
      raw_n = n;
      raw_e = e;
      late.push_back(fix_at(t, n, e));
    }
    while (!late.empty() && late.front().t_us + sensors.fix_delay_us <= t) {
      navigator.take(late.front());
      late.erase(late.begin());
    }
    if (t % sensors.depth_us == 0) {
      raw_d = now.depth + sensors.sigma_depth * random.normal();
      navigator.take(depth_at(t, raw_d));
    }
    if (sensors.velocity_us != 0 && t % sensors.velocity_us == 0) {
      NavSample sample = sample_at(t, leadline::base::kNavVelocityWorld);
      const double course = now.heading;  // the yaw of the sea way is not a change of course
      const double clean = course - kPi / 180 * std::sin(2 * kPi * s / 11.0);
      sample.velocity_um_s[0] =
          static_cast<std::int64_t>(1e6 * (now.speed * std::cos(clean) + 0.05 * random.normal()));
      sample.velocity_um_s[1] =
          static_cast<std::int64_t>(1e6 * (now.speed * std::sin(clean) + 0.05 * random.normal()));
      const double h = 1e-3;
      sample.velocity_um_s[2] = static_cast<std::int64_t>(
          1e6 * ((truth_at(s + h).depth - now.depth) / h + 0.05 * random.normal()));
      navigator.take(sample);
    }
    if (sensors.rates_us != 0 && t % sensors.rates_us == 0) {
      navigator.take(rates_at(t, random));
    }
    if (sensors.log_us != 0 && t % sensors.log_us == 0) {
      navigator.take(log_at(t, random), kLogMount);
    }
    if (t % sensors.attitude_us == 0) {
      raw_roll = now.roll + sensors.sigma_attitude * random.normal();
      const NavSample sample = attitude_at(
          t, raw_roll, now.pitch + sensors.sigma_attitude * random.normal(), now.heading);
      navigator.take(sample);
      cv_roll.predict(t);
      const auto sigma = static_cast<std::int64_t>(sensors.sigma_attitude * kBamPerRad);
      if (!cv_roll.started()) {
        cv_roll.start(t, sample.attitude.roll_bam32, sigma);
      }
      static_cast<void>(cv_roll.update(Measurement{sample.attitude.roll_bam32, sigma, 0}));
    }
    if (s < 30.0 || t % 35'000 != 0) {
      continue;
    }
    // A ping of half an attitude interval ago, which lies between two poses by now.
    const TimeUs ping_us = t - sensors.attitude_us - 2'500;
    const auto pose = navigator.history().at(ping_us);
    if (!pose.ok()) {
      continue;
    }
    const Truth then = truth_at(static_cast<double>(ping_us) * 1e-6);
    const double dn = static_cast<double>(pose.value().position_um[0]) * 1e-6 - then.north;
    const double de = static_cast<double>(pose.value().position_um[1]) * 1e-6 - then.east;
    const double sigma_n = pose.value().covariance.sigma_position_mm[0] * 1e-3;
    if (gap) {
      if (s >= sensors.gap_from_s + 25.5 && result.gap_sigma_m == 0) {
        result.gap_error_m = std::hypot(dn, de);
        result.gap_sigma_m = sigma_n;
      }
    } else {
      result.filtered_horizontal.add(dn);
      result.filtered_horizontal.add(de);
      result.raw_horizontal.add(raw_n - now.north);
      result.raw_horizontal.add(raw_e - now.east);
    }
    result.normalized += (dn * dn + de * de) / (sigma_n * sigma_n) / 2;
    ++result.normalized_count;
    result.filtered_depth.add(static_cast<double>(pose.value().position_um[2]) * 1e-6 - then.depth);
    result.raw_depth.add(raw_d - now.depth);
    result.pass_roll.add(wrapped(radians(pose.value().attitude.roll_bam32) - then.roll));
    result.raw_roll.add(raw_roll - now.roll);
    KalmanCv predicted = cv_roll;
    predicted.predict(t);
    result.cv_roll.add(wrapped(
        radians(static_cast<Bam32>(static_cast<std::uint64_t>(predicted.value()))) - now.roll));
  }
  return result;
}

TEST(positions_are_better_than_the_fixes_and_sigmas_say_how_good) {
  print_message(
      "| sensors | raw, last value: horizontal, m | filter | depth raw, m | filter | error^2 / "
      "sigma^2 |\n");
  struct Case {
    const char* name;
    TimeUs fix_us;
    double sigma_fix;
    TimeUs velocity_us;
    TimeUs delay_us;
    double most_m;
  };
  const Case cases[] = {{"fix 1 Hz, 0.5 m", 1'000'000, 0.5, 0, 0, 0.52},
                        {"fix 1 Hz, 0.5 m, 0.8 s late", 1'000'000, 0.5, 0, 800'000, 1.0},
                        {"fix 1 Hz, 0.5 m, velocity 5 Hz", 1'000'000, 0.5, 200'000, 0, 0.15},
                        {"fix 0.2 Hz, 1 m, velocity 5 Hz", 5'000'000, 1.0, 200'000, 0, 0.52},
                        {"fix 5 Hz, 0.02 m", 200'000, 0.02, 0, 0, 0.025}};
  for (const Case& c : cases) {
    Sensors sensors;
    sensors.fix_us = c.fix_us;
    sensors.sigma_fix = c.sigma_fix;
    sensors.velocity_us = c.velocity_us;
    sensors.fix_delay_us = c.delay_us;
    NavigatorConfig config = plain();
    config.sigma_fix_mm = static_cast<std::int32_t>(1000 * c.sigma_fix);
    const Result result = simulate(sensors, config, 11);
    const double consistency = result.normalized / result.normalized_count;
    print_message("| %s | %.3f | %.3f | %.3f | %.3f | %.2f |\n", c.name,
                  result.raw_horizontal.value(), result.filtered_horizontal.value(),
                  result.raw_depth.value(), result.filtered_depth.value(), consistency);
    assert_true(result.filtered_horizontal.count > 10'000);
    assert_true(result.filtered_horizontal.value() < c.most_m);
    assert_true(result.filtered_horizontal.value() < 0.95 * result.raw_horizontal.value());
    assert_true(result.filtered_depth.value() < result.raw_depth.value());
    assert_true(consistency < 1.6);
    assert_int_equal(navigator.counters().jumps, 0);
  }
}

TEST(attitude_passed_through_and_interpolated_beats_constant_velocity) {
  print_message(
      "| attitude | raw, last value: roll, mrad | passed through, interpolated | constant velocity "
      "|\n");
  for (const int rate_hz : {50, 20, 10, 5, 2}) {
    Sensors sensors;
    sensors.attitude_us = 1'000'000 / rate_hz;
    const Result result = simulate(sensors, plain(), 12);
    print_message("| %d Hz | %.2f | %.2f | %.2f |\n", rate_hz, 1e3 * result.raw_roll.value(),
                  1e3 * result.pass_roll.value(), 1e3 * result.cv_roll.value());
    assert_true(result.pass_roll.count > 10'000);
    assert_true(result.pass_roll.value() < result.raw_roll.value());
    // Where it is the claim: seldom samples, whose extrapolation overshoots.
    assert_true(rate_hz > 10 || result.pass_roll.value() < result.cv_roll.value());
    // The stated sigma holds what interpolation adds.
    const Pose& pose = navigator.latest();
    const double sigma = pose.covariance.sigma_attitude_urad16[0] * 16e-6;
    assert_true(result.pass_roll.value() < 1.15 * sigma);
  }
}

TEST(a_gap_of_26_seconds_is_bridged_and_owned_up_to) {
  Sensors sensors;
  sensors.gap_from_s = 300.0;
  Rms ratio;
  double sigma = 0;
  for (std::uint64_t run = 0; run < 12; ++run) {
    sensors.gap_from_s = 290.0 + 5.0 * static_cast<double>(run);
    const Result result = simulate(sensors, plain(), 20 + run);
    assert_true(result.gap_sigma_m > 2.0);
    ratio.add(result.gap_error_m / std::sqrt(2.0) / result.gap_sigma_m);
    sigma = result.gap_sigma_m;
    // Afterwards it is as good as ever.
    assert_true(result.filtered_horizontal.value() < 0.60);
  }
  print_message("after 26 s without a fix: stated sigma %.1f m per axis, error / sigma %.2f rms\n",
                sigma, ratio.value());
  assert_true(ratio.value() < 3.0);
}

TEST(a_log_and_rates_bridge_the_gap) {
  print_message("| after 26 s without a fix | stated sigma per axis, m | error / sigma |\n");
  struct Case {
    const char* name;
    TimeUs rates_us, log_us;
    double most_m;
  };
  for (const Case& c : {Case{"no log", 0, 0, 40.0}, Case{"log 5 Hz", 0, 200'000, 1.5},
                        Case{"log 5 Hz, rates 50 Hz", 20'000, 200'000, 1.0}}) {
    Rms ratio;
    double sigma = 0;
    for (std::uint64_t run = 0; run < 12; ++run) {
      Sensors sensors;
      sensors.gap_from_s = 290.0 + 5.0 * static_cast<double>(run);
      sensors.rates_us = c.rates_us;
      sensors.log_us = c.log_us;
      const Result result = simulate(sensors, plain(), 40 + run);
      ratio.add(result.gap_error_m / std::sqrt(2.0) / result.gap_sigma_m);
      sigma = result.gap_sigma_m;
    }
    print_message("| %s | %.2f | %.2f |\n", c.name, sigma, ratio.value());
    assert_true(sigma < c.most_m);
    assert_true(ratio.value() < 1.5);
  }
}

TEST(rates_carry_attitude_between_seldom_samples) {
  print_message("| attitude | roll, interpolated, mrad | with rates 50 Hz, mrad |\n");
  for (const int rate_hz : {50, 10, 5, 2}) {
    Sensors sensors;
    sensors.attitude_us = 1'000'000 / rate_hz;
    const Result without = simulate(sensors, plain(), 13);
    sensors.rates_us = 20'000;
    const Result with = simulate(sensors, plain(), 13);
    print_message("| %d Hz | %.2f | %.2f |\n", rate_hz, 1e3 * without.pass_roll.value(),
                  1e3 * with.pass_roll.value());
    assert_true(with.pass_roll.value() < 0.9 * without.pass_roll.value());
  }
}

TEST(pressure_becomes_depth) {
  // 10 m of sea water: 100,910 Pa.
  assert_near(
      static_cast<double>(pressure_depth_um(101'325 + 100'910, 101'325, 1'029'000, 9'806'650)),
      1e6 * 100'910 / (1029.0 * 9.80665), 1.0);
  assert_near(static_cast<double>(pressure_depth_um(111'500'000, 101'325, 1'050'000, 9'830'000)),
              1e6 * 111'398'675 / (1050.0 * 9.83), 1.0);
  assert_true(pressure_depth_um(100'000, 101'325, 1'029'000, 9'806'650) < 0);
  configure(plain());
  NavSample sample = sample_at(0, leadline::base::kNavPressure);
  sample.pressure_pa = 101'325 + 100'910;
  navigator.take(sample);
  navigator.take(attitude_at(10'000, 0, 0, 0));
  assert_int_equal(navigator.latest().validity,
                   leadline::base::kPoseVertical | leadline::base::kPoseAttitude);
  assert_near(static_cast<double>(navigator.latest().position_um[2]) * 1e-6, 10.0, 0.001);
  assert_int_equal(navigator.latest().covariance.sigma_position_mm[2] >= 50, 1);
}

TEST(fields_make_the_pose_valid_one_by_one) {
  configure(plain());
  assert_int_equal(navigator.latest().validity, 0);
  NavSample level = sample_at(0, leadline::base::kNavRollPitch);
  navigator.take(level);
  assert_int_equal(navigator.latest().validity, 0);  // roll and pitch without a heading
  NavSample magnetic = sample_at(50'000, leadline::base::kNavHeadingMagnetic);
  magnetic.attitude.heading_bam32 = bam(0.5);
  NavigatorConfig config = plain();
  config.magnetic_variation_bam32 = static_cast<std::int32_t>(bam(0.1));
  configure(config);
  navigator.take(magnetic);
  level.t_us = 60'000;
  navigator.take(level);
  assert_int_equal(navigator.latest().validity, leadline::base::kPoseAttitude);
  assert_near(radians(navigator.latest().attitude.heading_bam32), 0.6, 1e-6);
  navigator.take(fix_at(70'000, 3, 4));
  navigator.take(depth_at(75'000, 5));
  level.t_us = 80'000;
  navigator.take(level);
  assert_int_equal(navigator.latest().validity, leadline::base::kPoseAll);
  assert_near(static_cast<double>(navigator.latest().position_um[0]) * 1e-6, 3.0, 0.002);
  assert_near(static_cast<double>(navigator.latest().position_um[1]) * 1e-6, 4.0, 0.002);
  assert_int_equal(navigator.history().size(), navigator.counters().poses);
  // An attitude older than the last pose makes none.
  level.t_us = 79'000;
  navigator.take(level);
  assert_int_equal(navigator.latest().t_us, 80'000);
}

TEST(a_heading_that_comes_apart_is_predicted_to_the_attitude) {
  configure(plain());
  // 0.1 rad/s, once in 200 ms; roll and pitch in between.
  for (TimeUs t = 0; t < 20'000'000; t += 50'000) {
    if (t % 200'000 == 0) {
      NavSample heading = sample_at(t, leadline::base::kNavHeading);
      heading.attitude.heading_bam32 = bam(wrapped(0.1e-6 * static_cast<double>(t)));
      heading.sigma_attitude_urad[2] = 2'000;
      navigator.take(heading);
    }
    navigator.take(sample_at(t, leadline::base::kNavRollPitch));
    if (t > 10'000'000) {
      const double heading = radians(navigator.latest().attitude.heading_bam32);
      assert_near(wrapped(heading - 0.1e-6 * static_cast<double>(t)), 0.0, 0.002);
    }
  }
  // It turns round at once: refused, then believed, in a new epoch.
  const std::uint16_t epoch = navigator.epoch();
  for (std::uint32_t i = 0; i < kJumpCount; ++i) {
    NavSample heading = sample_at(20'000'000 + 200'000 * i, leadline::base::kNavHeading);
    heading.attitude.heading_bam32 = bam(-1.5);
    navigator.take(heading);
  }
  assert_int_equal(navigator.epoch(), epoch + 1);
  navigator.take(sample_at(21'000'000, leadline::base::kNavRollPitch));
  assert_near(radians(navigator.latest().attitude.heading_bam32), -1.5, 0.001);
}

TEST(heading_counts_from_grid_north) {
  configure(plain());
  // 20 km east of the origin: grid north lies 0.2 degrees from true north.
  const double east_m = 20'000;
  navigator.take(fix_at(0, 0, east_m));
  navigator.take(attitude_at(10'000, 0, 0, 0.3));
  const double convergence = east_m / 6'390'000.0 * std::tan(47.5 * kPi / 180);
  assert_near(radians(navigator.latest().attitude.heading_bam32), 0.3 - convergence, 1e-5);
}

TEST(without_an_origin_the_first_confirmed_fix_is_it) {
  NavigatorConfig config = plain();
  config.has_origin = false;
  configure(config);
  NavSample wild = fix_at(0, 0, 0);
  wild.latitude_e9deg = -12'000'000'000;  // half the world away, as a receiver may begin
  navigator.take(wild);
  assert_false(navigator.plane().configured());
  navigator.take(fix_at(1'000'000, 100, 50));
  assert_false(navigator.plane().configured());
  navigator.take(fix_at(2'000'000, 101, 50));
  assert_true(navigator.plane().configured());
  navigator.take(attitude_at(2'010'000, 0, 0, 0));
  assert_near(static_cast<double>(navigator.latest().position_um[0]) * 1e-6, 1.0, 0.1);
  assert_near(static_cast<double>(navigator.latest().position_um[1]) * 1e-6, 0.0, 0.1);
}

TEST(one_wild_fix_is_refused_and_five_that_agree_begin_an_epoch) {
  configure(plain());
  TimeUs t = 0;
  for (; t < 20'000'000; t += 1'000'000) {
    navigator.take(fix_at(t, 0, 0));
  }
  navigator.take(fix_at(t, 60, 0));
  assert_int_equal(navigator.counters().gated, 1);
  navigator.take(fix_at(t + 1'000'000, 0, 0));
  assert_int_equal(navigator.epoch(), 0);
  // Five that disagree with each other are no jump either.
  for (int i = 0; i < 5; ++i) {
    t += 2'000'000;
    navigator.take(fix_at(t, i % 2 == 0 ? 200 : -200, 100 * i));
  }
  assert_int_equal(navigator.epoch(), 0);
  for (std::uint32_t i = 0; i < kJumpCount; ++i) {
    assert_int_equal(navigator.epoch(), 0);
    t += 1'000'000;
    navigator.take(fix_at(t, 500, 0));
  }
  assert_int_equal(navigator.epoch(), 1);
  navigator.take(attitude_at(t + 10'000, 0, 0, 0));
  assert_near(static_cast<double>(navigator.latest().position_um[0]) * 1e-6, 500.0, 0.01);
  // The same for depth.
  navigator.take(depth_at(t + 20'000, 10));
  for (std::uint32_t i = 1; i <= kJumpCount; ++i) {
    navigator.take(depth_at(t + 20'000 + 100'000 * i, 80));
  }
  assert_int_equal(navigator.epoch(), 2);
}

TEST(a_fix_after_a_long_gap_begins_an_epoch) {
  configure(plain());
  for (TimeUs t = 0; t < 10'000'000; t += 1'000'000) {
    navigator.take(fix_at(t, 0, 0));
  }
  // Within what 60 s allow, but far from where it was believed to be.
  navigator.take(fix_at(70'000'000, 25, 0));
  assert_int_equal(navigator.counters().gated, 0);
  assert_int_equal(navigator.epoch(), 1);
}

TEST(stragglers_count_at_their_own_time_and_old_ones_not_at_all) {
  configure(plain());
  // A vehicle at 2 m/s whose fixes come two seconds late.
  TimeUs t = 0;
  for (; t < 60'000'000; t += 100'000) {
    navigator.take(attitude_at(t, 0, 0, 0));
    if (t >= 2'000'000 && t % 1'000'000 == 0) {
      navigator.take(fix_at(t - 2'000'000, 2e-6 * static_cast<double>(t - 2'000'000), 0));
    }
  }
  assert_near(static_cast<double>(navigator.latest().position_um[0]) * 1e-6,
              2e-6 * static_cast<double>(navigator.latest().t_us), 0.3);
  assert_int_equal(navigator.counters().stale, 0);
  navigator.take(fix_at(t - kMaxSampleAge_us - 1'000'000, 0, 0));
  assert_int_equal(navigator.counters().stale, 1);
}

TEST(a_clock_that_was_set_back_starts_over) {
  configure(plain());
  for (TimeUs t = 100'000'000; t < 110'000'000; t += 100'000) {
    navigator.take(attitude_at(t, 0, 0, 0));
  }
  const std::uint16_t epoch = navigator.epoch();
  for (TimeUs t = 10'000'000; t < 20'000'000; t += 100'000) {
    navigator.take(attitude_at(t, 0, 0, 0));
  }
  assert_int_equal(navigator.counters().steps_back, 1);
  assert_int_equal(navigator.counters().stale, kStepBackCount);
  assert_int_equal(navigator.epoch(), epoch + 1);
  assert_int_equal(navigator.latest().t_us, 19'900'000);
  assert_true(navigator.history().at(19'850'000).ok());
}

TEST(where_no_attitude_comes_poses_say_so) {
  configure(plain());
  navigator.tick(0);
  for (TimeUs t = 0; t < 5'000'000; t += 100'000) {
    navigator.take(fix_at(t, 0, 0));
    if (t < 1'000'000) {
      navigator.take(attitude_at(t, 0.1, 0, 0));
    }
    navigator.tick(t + 50'000);
  }
  const Pose& pose = navigator.latest();
  assert_int_equal(pose.validity, leadline::base::kPoseHorizontal);
  assert_true(pose.t_us > 3'000'000);
  assert_true(navigator.counters().poses < 20);
}

TEST(configured_anew_nothing_shows_of_before) {
  configure(plain());
  for (TimeUs t = 0; t < 5'000'000; t += 100'000) {
    navigator.take(fix_at(t, 10, 20));
    navigator.take(attitude_at(t, 0.1, 0.2, 0.3));
  }
  configure(plain());
  for (TimeUs t = 0; t < 2'000'000; t += 100'000) {
    navigator.take(fix_at(t, 0, 0));
    navigator.tick(t + 50'000);
  }
  const Pose& pose = navigator.latest();
  assert_int_equal(pose.validity, leadline::base::kPoseHorizontal);
  // No attitude has come: not that of before either.
  assert_int_equal(pose.attitude.roll_bam32, 0);
  assert_int_equal(pose.attitude.pitch_bam32, 0);
  assert_int_equal(pose.attitude.heading_bam32, 0);
}

TEST(body_velocity_needs_an_attitude_and_turns_with_it) {
  configure(plain());
  NavSample velocity = sample_at(0, leadline::base::kNavVelocityBody);
  velocity.velocity_um_s[0] = 1'000'000;
  navigator.take(velocity);
  assert_int_equal(navigator.counters().unusable, 1);
  navigator.take(fix_at(0, 0, 0));
  navigator.take(depth_at(0, 10));
  for (TimeUs t = 100'000; t <= 20'000'000; t += 100'000) {
    navigator.take(attitude_at(t, 0, -0.1, kPi / 2));
    velocity.t_us = t;
    navigator.take(velocity);
  }
  // East, and down by the pitch.
  assert_near(static_cast<double>(navigator.latest().position_um[0]) * 1e-6, 0.0, 0.1);
  assert_near(static_cast<double>(navigator.latest().position_um[1]) * 1e-6, 20.0 * std::cos(0.1),
              0.6);
  assert_near(static_cast<double>(navigator.latest().position_um[2]) * 1e-6,
              10.0 + 20.0 * std::sin(0.1), 0.3);
  velocity.velocity_um_s[1] = 200'000'000;
  velocity.t_us += 10'000;
  navigator.take(velocity);
  assert_int_equal(navigator.counters().out_of_range, 1);
}

TEST(nonsense_is_counted_and_left) {
  configure(plain());
  NavSample sample = sample_at(INT64_MAX, leadline::base::kNavDepth);
  navigator.take(sample);
  assert_int_equal(navigator.counters().out_of_range, 1);
  sample = depth_at(0, 1);
  sample.quality = 0;
  navigator.take(sample);
  assert_int_equal(navigator.counters().unusable, 1);
  navigator.take(sample_at(0, leadline::base::kNavAltitude));
  assert_int_equal(navigator.counters().unusable, 2);
  sample = fix_at(0, 0, 0);
  sample.latitude_e9deg = 91'000'000'000;
  navigator.take(sample);
  assert_int_equal(navigator.counters().out_of_range, 2);
  sample = sample_at(0, leadline::base::kNavPressure);
  sample.pressure_pa = INT64_MAX;
  navigator.take(sample);
  assert_int_equal(navigator.counters().out_of_range, 3);
  sample = depth_at(0, 0);
  sample.depth_um = 30'000'000'000;
  navigator.take(sample);
  assert_int_equal(navigator.counters().out_of_range, 4);
  assert_int_equal(navigator.counters().fused, 0);
}

TEST(configurations_that_mean_nothing_are_refused) {
  const auto refused = [](auto change) {
    NavigatorConfig config = plain();
    change(config);
    return navigator.configure(config) == Status::kOutOfRange;
  };
  assert_true(refused([](NavigatorConfig& c) { c.water_density_g_m3 = 0; }));
  assert_true(refused([](NavigatorConfig& c) { c.sigma_fix_mm = 0; }));
  assert_true(refused([](NavigatorConfig& c) { c.acceleration_mm_s2 = -1; }));
  assert_true(refused([](NavigatorConfig& c) { c.max_gap_us = -1; }));
  assert_true(refused([](NavigatorConfig& c) { c.surface_pressure_pa = 1'000'000'000; }));
  assert_true(refused([](NavigatorConfig& c) { c.origin.latitude_e9deg = 90'000'000'000; }));
}

}  // namespace
