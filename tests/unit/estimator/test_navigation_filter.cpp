// The navigation filter: the sign of every coupling by hand, consistency (NEES, NIS) on simulated vehicles, and
// what it does with nonsense.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "estimator/navigation_filter.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Bam32;
using leadline::base::kDown;
using leadline::base::kEast;
using leadline::base::kNorth;
using leadline::base::TimeUs;
using leadline::estimator::Fusion;
using leadline::estimator::kErrorStates;
using leadline::estimator::kFaultCount;
using leadline::estimator::kFaultCovariance;
using leadline::estimator::LeverArm;
using leadline::estimator::NavigationFilter;
using leadline::estimator::NavigationFilterConfig;
using leadline::estimator::NavMeasurement;
using leadline::test::Random;

constexpr double kPi = 3.14159265358979323846;
constexpr double kBamPerRad = 4294967296.0 / (2.0 * kPi);
constexpr std::uint32_t kSigmaLevel_urad[2] = {1'745, 1'745};

Bam32 bam(double radians) {
  return static_cast<Bam32>(static_cast<std::int64_t>(std::llround(radians * kBamPerRad)));
}
double radians(Bam32 angle) { return static_cast<std::int32_t>(angle) / kBamPerRad; }
std::int64_t um(double metres) { return std::llround(metres * 1e6); }

using Vec = std::array<double, 3>;

// v_NED = Rz(heading) Ry(pitch) Rx(roll) v.
Vec to_world(double roll, double pitch, double heading, const Vec& v) {
  const double y1 = std::cos(roll) * v[1] - std::sin(roll) * v[2];
  const double z1 = std::sin(roll) * v[1] + std::cos(roll) * v[2];
  const double x2 = std::cos(pitch) * v[0] + std::sin(pitch) * z1;
  const double z2 = -std::sin(pitch) * v[0] + std::cos(pitch) * z1;
  return {std::cos(heading) * x2 - std::sin(heading) * y1,
          std::sin(heading) * x2 + std::cos(heading) * y1, z2};
}

Vec to_body(double roll, double pitch, double heading, const Vec& v) {
  const double x1 = std::cos(heading) * v[0] + std::sin(heading) * v[1];
  const double y1 = -std::sin(heading) * v[0] + std::cos(heading) * v[1];
  const double x2 = std::cos(pitch) * x1 - std::sin(pitch) * v[2];
  const double z2 = std::sin(pitch) * x1 + std::cos(pitch) * v[2];
  return {x2, std::cos(roll) * y1 + std::sin(roll) * z2,
          -std::sin(roll) * y1 + std::cos(roll) * z2};
}

NavigationFilter started(double roll, double pitch, double heading,
                         const NavigationFilterConfig& config = {}) {
  NavigationFilter filter(config);
  filter.predict(0);
  assert_int_equal(filter.update_level(bam(roll), bam(pitch), kSigmaLevel_urad, 0), Fusion::kFused);
  assert_int_equal(filter.update_heading(bam(heading), 2'000, 0), Fusion::kFused);
  return filter;
}

TEST(attitude_comes_back_as_it_was_set) {
  Random random(1);
  for (int i = 0; i < 2'000; ++i) {
    const double roll = (random.uniform() - 0.5) * 2 * kPi * 0.99;
    const double pitch = (random.uniform() - 0.5) * kPi * 0.8;
    const double heading = (random.uniform() - 0.5) * 2 * kPi;
    const NavigationFilter filter = started(roll, pitch, heading);
    const auto attitude = filter.attitude();
    // Near the vertical roll and heading are only as good as single precision over cos(pitch).
    const double most = 1e-5 / std::cos(pitch);
    assert_true(std::abs(std::remainder(radians(attitude.roll_bam32) - roll, 2 * kPi)) < most);
    assert_true(std::abs(radians(attitude.pitch_bam32) - pitch) < 1e-5);
    assert_true(std::abs(std::remainder(radians(attitude.heading_bam32) - heading, 2 * kPi)) <
                most);
  }
}

TEST(a_fix_of_an_antenna_ahead_places_the_vehicle_behind_it) {
  NavigationFilter filter = started(0, 0, kPi / 2);  // bow to the east
  LeverArm lever;
  lever.forward_mm = 2'000;
  lever.right_mm = 500;  // starboard: south
  const std::int64_t fix[2] = {um(10.0), um(20.0)};
  assert_int_equal(filter.update_position(fix, um(0.1), lever, 0), Fusion::kFused);
  assert_true(std::abs(static_cast<double>(filter.position_um(kEast, 0)) * 1e-6 - 18.0) < 1e-3);
  assert_true(std::abs(static_cast<double>(filter.position_um(kNorth, 0)) * 1e-6 - 10.5) < 1e-3);
}

TEST(a_depth_sensor_on_the_stern_is_shallower_with_the_bow_down) {
  NavigationFilter filter = started(0, -0.1, 0);
  LeverArm lever;
  lever.forward_mm = -1'000;
  assert_int_equal(filter.update_depth(um(5.0), um(0.01), lever, 0), Fusion::kFused);
  // Bow down by 0.1 rad lifts the stern by 0.0998 m: the reference point lies deeper.
  assert_true(std::abs(static_cast<double>(filter.position_um(kDown, 0)) * 1e-6 - 5.0998) < 1e-3);
}

TEST(a_log_on_the_bow_feels_the_turn) {
  // Standing still and turning to starboard at 0.2 rad/s: a log 1.5 m ahead moves 0.3 m/s to starboard.
  NavigationFilter filter = started(0, 0, 0);
  const std::int64_t rates[3] = {0, 0, 200'000};
  const std::int64_t seen[3] = {0, 300'000, 0};
  LeverArm lever;
  lever.forward_mm = 1'500;
  for (TimeUs t = 100'000; t < 3'000'000; t += 100'000) {
    filter.predict(t);
    filter.set_rates(rates);
    assert_int_equal(filter.update_heading(bam(0.2 * static_cast<double>(t) * 1e-6), 2'000, 0),
                     Fusion::kFused);
    assert_int_equal(filter.update_velocity_bottom(seen, 10'000, lever, 0), Fusion::kFused);
  }
  assert_true(std::abs(static_cast<double>(filter.velocity_um_s(kNorth))) < 0.02e6);
  assert_true(std::abs(static_cast<double>(filter.velocity_um_s(kEast))) < 0.02e6);
}

TEST(body_speed_goes_where_the_bow_points) {
  NavigationFilter filter = started(0, 0, kPi / 2);
  const std::int64_t ahead[3] = {1'500'000, 0, 0};
  for (TimeUs t = 0; t < 20'000'000; t += 200'000) {
    filter.predict(t);
    static_cast<void>(filter.update_heading(bam(kPi / 2), 2'000, 0));
    assert_int_equal(filter.update_velocity_bottom(ahead, 10'000, {}, 0), Fusion::kFused);
  }
  assert_true(std::abs(static_cast<double>(filter.velocity_um_s(kEast)) * 1e-6 - 1.5) < 0.02);
  assert_true(std::abs(static_cast<double>(filter.velocity_um_s(kNorth)) * 1e-6) < 0.05);
}

TEST(an_altitude_over_a_known_bottom_is_a_depth) {
  NavigationFilter filter = started(0, 0, 0);
  assert_int_equal(filter.update_altitude(um(3.0), um(20.0), um(0.05), {}, 0), Fusion::kNotReady);
  assert_int_equal(filter.update_depth(um(16.0), um(2.0), {}, 0), Fusion::kFused);
  LeverArm lever;
  lever.down_mm = 500;
  assert_int_equal(filter.update_altitude(um(3.0), um(20.0), um(0.01), lever, 0), Fusion::kFused);
  assert_true(std::abs(static_cast<double>(filter.position_um(kDown, 0)) * 1e-6 - 16.5) < 0.01);
}

// A vehicle on a curved path with roll, pitch and a current, with every sensor; one error vector per run.
struct Simulation {
  bool rates = true;
  bool water = false;  // the log sees the water, not the bottom
  double fix_interval_s = 5.0;
  double duration_s = 300.0;
};

struct Outcome {
  double nees_position = 0;  // 3
  double nees_attitude = 0;  // 3
  double nis_sum = 0;
  int nis_dimensions = 0;
  double scale_error_sigmas = 0;
  double misalignment_error_sigmas = 0;
  double current_error_sigmas = 0;
  std::uint32_t gated = 0;
};

// Squared length of e in the covariance's block at `first`.
double nees3(const NavigationFilter& filter, int first, const Vec& e) {
  double m[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      m[i][j] = static_cast<double>(
          filter.covariance()[static_cast<std::size_t>((first + i) * kErrorStates + first + j)]);
    }
  }
  // Gaussian elimination of m x = e.
  Vec x = e;
  for (int i = 0; i < 3; ++i) {
    for (int row = i + 1; row < 3; ++row) {
      const double factor = m[row][i] / m[i][i];
      for (int column = i; column < 3; ++column) {
        m[row][column] -= factor * m[i][column];
      }
      x[static_cast<std::size_t>(row)] -= factor * x[static_cast<std::size_t>(i)];
    }
  }
  for (int i = 2; i >= 0; --i) {
    for (int column = i + 1; column < 3; ++column) {
      x[static_cast<std::size_t>(i)] -= m[i][column] * x[static_cast<std::size_t>(column)];
    }
    x[static_cast<std::size_t>(i)] /= m[i][i];
  }
  return e[0] * x[0] + e[1] * x[1] + e[2] * x[2];
}

Outcome fly(const Simulation& simulation, std::uint64_t stream) {
  Random random(stream);
  NavigationFilterConfig config;
  config.acceleration_m_s2 = 0.1F;
  config.vertical_acceleration_m_s2 = 0.05F;
  config.velocity_turns = false;
  config.current_walk = 0.0F;
  config.rate_bias_walk = 0.0F;
  config.velocity_scale_walk = 0.0F;
  config.velocity_misalignment_walk_rad = 0.0F;
  NavigationFilter filter(config);
  const double dt = 0.02;
  Vec position{random.normal() * 50, random.normal() * 50, 10};
  Vec velocity{random.normal(), random.normal(), 0.1 * random.normal()};
  const double scale = 5e-3 * random.normal();
  const double misalignment = 1e-2 * random.normal();
  const Vec bias{5e-3 * random.normal(), 5e-3 * random.normal(), 5e-3 * random.normal()};
  const Vec current{0.3 * random.normal(), 0.3 * random.normal(), 0.0};
  const LeverArm log_arm{1'200, -300, 400};
  const Vec log_m{1.2, -0.3, 0.4};
  const LeverArm fix_arm{-800, 200, -600};
  const Vec fix_m{-0.8, 0.2, -0.6};
  Outcome outcome;
  const auto take = [&filter, &outcome](Fusion fusion) {
    if (fusion == Fusion::kFused && filter.last_dimension() > 0) {
      outcome.nis_sum += static_cast<double>(filter.last_nis());
      outcome.nis_dimensions += filter.last_dimension();
    }
    outcome.gated += fusion == Fusion::kGated ? 1U : 0U;
  };
  double roll = 0;
  double pitch = 0;
  double heading = 0;
  const int steps = static_cast<int>(simulation.duration_s / dt);
  for (int step = 0; step <= steps; ++step) {
    const double t = step * dt;
    roll = 0.15 * std::sin(0.9 * t);
    pitch = 0.1 * std::sin(0.7 * t + 1.0);
    heading = 0.5 + 0.05 * t + 0.3 * std::sin(0.2 * t);
    const double roll_rate = 0.15 * 0.9 * std::cos(0.9 * t);
    const double pitch_rate = 0.07 * std::cos(0.7 * t + 1.0);
    const double heading_rate = 0.05 + 0.06 * std::cos(0.2 * t);
    const Vec rate{roll_rate - std::sin(pitch) * heading_rate,
                   std::cos(roll) * pitch_rate + std::sin(roll) * std::cos(pitch) * heading_rate,
                   -std::sin(roll) * pitch_rate + std::cos(roll) * std::cos(pitch) * heading_rate};
    if (step > 0) {
      for (std::size_t i = 0; i < 3; ++i) {
        const double q = (i == 2 ? 0.05 : 0.1) * std::sqrt(dt);
        const double kick = q * random.normal();
        position[i] += velocity[i] * dt + kick * dt / 2;
        velocity[i] += kick;
      }
    }
    filter.predict(static_cast<TimeUs>(step) * 20'000);
    if (simulation.rates) {
      std::int64_t measured[3];
      for (std::size_t i = 0; i < 3; ++i) {
        measured[i] =
            std::llround(1e6 * (rate[i] + bias[i] + 2e-3 / std::sqrt(dt) * random.normal()));
      }
      filter.set_rates(measured);
    }
    if (step % 5 == 0) {
      take(filter.update_level(bam(roll + 1.745e-3 * random.normal()),
                               bam(pitch + 1.745e-3 * random.normal()), kSigmaLevel_urad, 0));
      take(filter.update_heading(bam(heading + 8e-3 * random.normal()), 8'000, 0));
    }
    if (step % 10 == 0) {
      const Vec arm = to_world(roll, pitch, heading, log_m);
      take(filter.update_depth(um(position[2] + arm[2] + 0.02 * random.normal()), um(0.02), log_arm,
                               0));
    }
    if (step % 10 == 5 && filter.attitude_started()) {
      Vec ground = velocity;
      if (simulation.water) {
        ground = {velocity[0] - current[0], velocity[1] - current[1], velocity[2]};
      }
      Vec seen = to_body(roll, pitch, heading, ground);
      seen[0] += rate[1] * log_m[2] - rate[2] * log_m[1];
      seen[1] += rate[2] * log_m[0] - rate[0] * log_m[2];
      seen[2] += rate[0] * log_m[1] - rate[1] * log_m[0];
      const double x = std::cos(misalignment) * seen[0] + std::sin(misalignment) * seen[1];
      const double y = -std::sin(misalignment) * seen[0] + std::cos(misalignment) * seen[1];
      const std::int64_t measured[3] = {um((1 + scale) * x + 0.02 * random.normal()),
                                        um((1 + scale) * y + 0.02 * random.normal()),
                                        um((1 + scale) * seen[2] + 0.02 * random.normal())};
      // Without rates the turn of the lever arm is unknown: such a log sits at the reference point.
      if (simulation.rates) {
        take(simulation.water ? filter.update_velocity_water(measured, 20'000, log_arm, 0)
                              : filter.update_velocity_bottom(measured, 20'000, log_arm, 0));
      }
    }
    if (std::fmod(t, simulation.fix_interval_s) < dt / 2) {
      const Vec arm = to_world(roll, pitch, heading, fix_m);
      const std::int64_t fix[2] = {um(position[0] + arm[0] + 0.5 * random.normal()),
                                   um(position[1] + arm[1] + 0.5 * random.normal())};
      take(filter.update_position(fix, um(0.5), fix_arm, 0));
    }
  }
  Vec error{};
  for (std::size_t i = 0; i < 3; ++i) {
    error[i] =
        position[i] -
        static_cast<double>(filter.position_um(static_cast<leadline::base::Axis>(i), 0)) * 1e-6;
  }
  outcome.nees_position = nees3(filter, 0, error);
  // Small rotation from estimate to truth, about NED: from the columns of both rotations.
  const auto attitude = filter.attitude();
  Vec turn{};
  for (const Vec& axis : {Vec{1, 0, 0}, Vec{0, 1, 0}, Vec{0, 0, 1}}) {
    const Vec a = to_world(radians(attitude.roll_bam32), radians(attitude.pitch_bam32),
                           radians(attitude.heading_bam32), axis);
    const Vec b = to_world(roll, pitch, heading, axis);
    turn[0] += (a[1] * b[2] - a[2] * b[1]) / 2;
    turn[1] += (a[2] * b[0] - a[0] * b[2]) / 2;
    turn[2] += (a[0] * b[1] - a[1] * b[0]) / 2;
  }
  outcome.nees_attitude = nees3(filter, 6, turn);
  outcome.scale_error_sigmas =
      (scale - static_cast<double>(filter.state(14))) / static_cast<double>(filter.sigma(14));
  outcome.misalignment_error_sigmas = (misalignment - static_cast<double>(filter.state(15))) /
                                      static_cast<double>(filter.sigma(15));
  outcome.current_error_sigmas =
      (current[0] - static_cast<double>(filter.state(12))) / static_cast<double>(filter.sigma(12));
  assert_int_equal(filter.faults() & kFaultCovariance, 0);
  return outcome;
}

struct Consistency {
  double position = 0, attitude = 0, nis = 0, scale2 = 0, misalignment2 = 0, current2 = 0;
  std::uint32_t gated = 0;
};

Consistency consistency(const Simulation& simulation, int runs) {
  Consistency mean;
  double nis_sum = 0;
  int nis_dimensions = 0;
  for (int run = 0; run < runs; ++run) {
    const Outcome outcome = fly(simulation, 100 + static_cast<std::uint64_t>(run));
    mean.position += outcome.nees_position / (3.0 * runs);
    mean.attitude += outcome.nees_attitude / (3.0 * runs);
    mean.scale2 += outcome.scale_error_sigmas * outcome.scale_error_sigmas / runs;
    mean.misalignment2 +=
        outcome.misalignment_error_sigmas * outcome.misalignment_error_sigmas / runs;
    mean.current2 += outcome.current_error_sigmas * outcome.current_error_sigmas / runs;
    nis_sum += outcome.nis_sum;
    nis_dimensions += outcome.nis_dimensions;
    mean.gated += outcome.gated;
  }
  mean.nis = nis_sum / nis_dimensions;
  return mean;
}

TEST(errors_are_as_large_as_the_filter_says) {
  constexpr int kRuns = 40;
  struct Case {
    const char* name;
    Simulation simulation;
  };
  const Case cases[] = {{"rates, bottom track, fix 0.2 Hz", {true, false, 5.0, 300.0}},
                        {"rates, water track, fix 0.2 Hz", {true, true, 5.0, 300.0}},
                        {"rates, bottom track, fix lost", {true, false, 1e9, 300.0}},
                        {"no rates, no log, fix 0.2 Hz", {false, false, 5.0, 300.0}}};
  print_message(
      "| sensors | position NEES/3 | attitude NEES/3 | NIS/dimension | log scale | yaw | current "
      "|\n");
  for (const Case& c : cases) {
    const Consistency mean = consistency(c.simulation, kRuns);
    print_message("| %s | %.2f | %.2f | %.3f | %.2f | %.2f | %.2f |\n", c.name, mean.position,
                  mean.attitude, mean.nis, mean.scale2, mean.misalignment2, mean.current2);
    // 120 degrees of freedom: 95 % between 0.76 and 1.27; a fixed seed may lie a little outside.
    assert_true(mean.position > 0.6 && mean.position < 1.35);
    assert_true(mean.attitude > 0.6 && mean.attitude < 1.45);
    // Without rates the attitude is free to turn, faster than this vehicle does: innovations are small.
    assert_true((mean.nis > 0.9 || !c.simulation.rates) && mean.nis < 1.1);
    // 40 degrees of freedom: 95 % between 0.61 and 1.48.
    assert_true(mean.scale2 < 1.6 && mean.misalignment2 < 1.6 && mean.current2 < 1.6);
    assert_true(mean.gated < 40);
  }
}

TEST(nothing_that_is_not_a_number_or_far_off_gets_in) {
  NavigationFilter filter = started(0, 0, 0);
  const std::int64_t here[2] = {0, 0};
  assert_int_equal(filter.update_position(here, um(0.1), {}, 0), Fusion::kFused);
  const auto covariance = filter.covariance();
  const std::int64_t far[2] = {um(1e6), um(-1e6)};
  for (std::uint32_t i = 0; i < kFaultCount; ++i) {
    assert_int_equal(filter.update_position(far, um(0.1), {}, 0), Fusion::kGated);
  }
  assert_true((filter.faults() & 1U) != 0);
  assert_true(covariance == filter.covariance());
  assert_int_equal(filter.position_um(kNorth, 0), 0);
  assert_int_equal(filter.update_position(here, um(0.1), {}, 0), Fusion::kFused);
  assert_int_equal(filter.faults(), 0);
  assert_int_equal(filter.counters(NavMeasurement::kPosition).gated, kFaultCount);
  // Rates that nothing turns with are not used.
  const std::int64_t mad[3] = {INT64_MAX, 0, 0};
  filter.set_rates(mad);
  assert_false(filter.has_rates());
}

TEST(velocities_of_a_body_of_unknown_attitude_wait) {
  NavigationFilter filter;
  filter.predict(0);
  const std::int64_t ahead[3] = {1'000'000, 0, 0};
  assert_int_equal(filter.update_velocity_bottom(ahead, 10'000, {}, 0), Fusion::kNotReady);
  assert_int_equal(filter.update_velocity_water(ahead, 10'000, {}, 0), Fusion::kNotReady);
  assert_int_equal(filter.update_velocity_world(ahead, 10'000, 0), Fusion::kFused);
}

TEST(a_gap_grows_the_covariance_alike_in_one_step_or_many) {
  NavigationFilter one = started(0, 0, 0);
  const std::int64_t here[2] = {0, 0};
  const std::int64_t still[3] = {0, 0, 0};
  static_cast<void>(one.update_position(here, um(0.1), {}, 0));
  static_cast<void>(one.update_velocity_world(still, 10'000, 0));
  NavigationFilter many = one;
  one.predict(26'000'000);
  for (TimeUs t = 20'000; t <= 26'000'000; t += 20'000) {
    many.predict(t);
  }
  const double a = one.sigma_position_mm(kNorth);
  const double b = many.sigma_position_mm(kNorth);
  assert_true(a > 10'000 && std::abs(a - b) < 0.002 * a);
}

// One call of any kind with any arguments that a sensor can have.
void call_anything(NavigationFilter& filter, Random& random) {
  const std::int64_t v[3] = {random.between(-9'000'000, 9'000'000),
                             random.between(-9'000'000, 9'000'000),
                             random.between(-9'000'000, 9'000'000)};
  const std::uint32_t sigmas[2] = {static_cast<std::uint32_t>(random.between(1, 3'000'000)),
                                   static_cast<std::uint32_t>(random.between(1, 3'000'000))};
  const std::int64_t sigma = random.between(1, 100'000'000);
  const auto arm = [&random] { return static_cast<std::int32_t>(random.between(-30'000, 30'000)); };
  LeverArm lever;
  lever.forward_mm = arm();
  lever.right_mm = arm();
  lever.down_mm = arm();
  const TimeUs age = random.between(0, 5'000'000);
  const auto angle = [&random] { return static_cast<Bam32>(random.next()); };
  const Bam32 first = angle();
  const Bam32 second = angle();
  switch (random.between(0, 8)) {
    case 0:
      static_cast<void>(filter.update_position(v, sigma, lever, age));
      break;
    case 1:
      static_cast<void>(filter.update_depth(v[0], sigma, lever, age));
      break;
    case 2:
      static_cast<void>(filter.update_level(first, second, sigmas, age));
      break;
    case 3:
      static_cast<void>(filter.update_heading(first, sigmas[0], age));
      break;
    case 4:
      static_cast<void>(filter.update_velocity_bottom(v, sigma, lever, age));
      break;
    case 5:
      static_cast<void>(filter.update_velocity_water(v, sigma, lever, age));
      break;
    case 6:
      static_cast<void>(filter.update_velocity_world(v, sigma, age));
      break;
    case 7:
      static_cast<void>(filter.update_altitude(v[0], v[1], sigma, lever, age));
      break;
    default:
      filter.set_rates(v);
      break;
  }
}

// Any sequence of calls leaves a covariance that is one.
TEST(random_calls_leave_a_sound_covariance) {
  Random random(3);
  for (int run = 0; run < 30; ++run) {
    NavigationFilter filter;
    TimeUs t = 0;
    for (int i = 0; i < 400; ++i) {
      t += random.between(-100'000, 2'000'000);
      filter.predict(t);
      call_anything(filter, random);
      const auto& p = filter.covariance();
      for (std::size_t a = 0; a < kErrorStates; ++a) {
        assert_true(p[a * kErrorStates + a] > 0.0F);
        for (std::size_t b = 0; b < a; ++b) {
          const double ab = static_cast<double>(p[a * kErrorStates + b]);
          assert_true(ab == static_cast<double>(p[b * kErrorStates + a]));
          const double aa = static_cast<double>(p[a * kErrorStates + a]);
          const double bb = static_cast<double>(p[b * kErrorStates + b]);
          assert_true(ab * ab <= aa * bb * (1 + 1e-6));
        }
      }
      assert_int_equal(filter.faults() & kFaultCovariance, 0);
    }
  }
}

// Integers in, bits out: whatever the compiler, its options and the machine, this is the number. The release,
// sanitizer and coverage builds all hold it.
TEST(the_same_bits_everywhere) {
  Random random(20'261'122, 0);
  std::uint64_t hash = 0xCBF29CE484222325U;
  const auto add = [&hash](std::uint64_t value) { hash = (hash ^ value) * 0x100000001B3U; };
  for (int run = 0; run < 10; ++run) {
    NavigationFilter filter;
    TimeUs t = 0;
    for (int i = 0; i < 400; ++i) {
      t += random.between(1'000, 500'000);
      filter.predict(t);
      call_anything(filter, random);
    }
    for (const float value : filter.covariance()) {
      std::uint32_t bits = 0;
      std::memcpy(&bits, &value, sizeof(bits));
      add(bits);
    }
    add(static_cast<std::uint64_t>(filter.position_um(kNorth, 1'000)));
    add(filter.attitude().heading_bam32);
    add(filter.sigma_attitude_urad(0));
  }
  print_message("hash %016llx\n", static_cast<unsigned long long>(hash));
  assert_true(hash == 0x40C3CEECC7056FEBU);
}

}  // namespace
