// Refraction on the way from a codec to the model, against rays that were followed in small steps.
#include <cmath>
#include <vector>

#include "firmware/pipeline/sound_path.hpp"
#include "hal/emu/emulated_r2sonic.hpp"
#include "hal/heads/beam_angles.hpp"
#include "model/base/angle.hpp"
#include "model/event.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::Pose;
using leadline::base::ReturnKind;
using leadline::base::Status;
using leadline::firmware::ArrayFace;
using leadline::firmware::PingLoss;
using leadline::firmware::SoundPath;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::test::bam;
using leadline::test::pose_at;
using leadline::test::Random;

constexpr double kRad = 3.14159265358979323846 / 180.0;
constexpr double kHead_m = 2.0;
constexpr double kBottom_m = 22.0;
constexpr double kTop_m_s = 1500.0;

/// Speed grows by `gradient` (1/s) from the surface to 40 m.
double speed_at(double depth_m, double gradient) {
  return kTop_m_s + gradient * std::min(std::max(depth_m, 0.0), 40.0);
}

VehicleConfig water_of(double gradient) {
  VehicleConfig config{};
  config.sound_speed_mm_s = 1'500'000;
  config.water.point_count = 2;
  config.water.points[0] = {0, 1'500'000};
  config.water.points[1] = {40'000, static_cast<std::int32_t>(1e3 * speed_at(40.0, gradient))};
  return config;
}

SoundPath path_of(const VehicleConfig& config) {
  SoundPath path;
  assert_int_equal(path.configure(config), Status::kOk);
  return path;
}

struct Echo {
  double across_m;
  double two_way_s;
};

/// The ray that leaves the head at `sine` of its angle from the vertical, down to the flat bottom: small
/// steps of depth, the middle of each.
Echo echo_of(double sine, double gradient) {
  const double slowness = sine / speed_at(kHead_m, gradient);
  constexpr int kSteps = 20'000;
  const double step_m = (kBottom_m - kHead_m) / kSteps;
  Echo echo{0, 0};
  for (int i = 0; i < kSteps; ++i) {
    const double speed = speed_at(kHead_m + (i + 0.5) * step_m, gradient);
    const double s = slowness * speed;
    const double c = std::sqrt(1.0 - s * s);
    echo.across_m += step_m * s / c;
    echo.two_way_s += 2.0 * step_m / (speed * c);
  }
  return echo;
}

/// What an array reports that reckons with `told_m_s`: its phases are those of a beam at `angle_deg`.
Ping fan_ping(double angle_deg, double two_way_s, double told_m_s) {
  Ping ping{};
  ping.kind = ReturnKind::kRange;
  ping.quality = 255;
  ping.range_um = std::llround(0.5e6 * two_way_s * told_m_s);
  ping.sound_speed_mm_s = static_cast<std::int32_t>(std::lround(1e3 * told_m_s));
  leadline::hal::set_fan_beam(ping, bam(angle_deg));
  return ping;
}

struct Point {
  double north_m;
  double east_m;
  double depth_m;
};

Point end_of(const Ping& ping, const Pose& pose) {
  const auto axis = leadline::model::beam_frame(pose.attitude, ping.azimuth_bam32,
                                                ping.elevation_bam32, ping.rotation_bam32)
                        .axis;
  const double range_m = 1e-6 * static_cast<double>(ping.range_um);
  const auto part = [&](int i) {
    return 1e-6 * static_cast<double>(pose.position_um[i]) + range_m * axis.q30[i] / 1073741824.0;
  };
  return {part(0), part(1), part(2)};
}

/// Error of the bottom's depth at `angle_deg`, mapped with a profile of `believed` gradient in water of
/// `true_gradient`; not a number where there is no path.
double depth_error_m(double angle_deg, double true_gradient, double believed) {
  const Echo echo = echo_of(std::sin(angle_deg * kRad), true_gradient);
  Ping ping = fan_ping(angle_deg, echo.two_way_s, speed_at(kHead_m, true_gradient));
  const Pose pose = pose_at(0, 0, kHead_m);
  assert_true(path_of(water_of(believed)).straighten(ping, pose, ArrayFace::kDown));
  return end_of(ping, pose).depth_m - kBottom_m;
}

TEST(a_flat_bottom_under_a_ramp_of_sound_speed_is_flat) {
  for (const double gradient : {-1.0, 0.8}) {
    for (double angle_deg = -66; angle_deg <= 66; angle_deg += 6) {
      const Echo echo = echo_of(std::sin(angle_deg * kRad), gradient);
      Ping ping = fan_ping(angle_deg, echo.two_way_s, speed_at(kHead_m, gradient));
      const Pose pose = pose_at(10, 20, kHead_m);
      assert_true(path_of(water_of(gradient)).straighten(ping, pose, ArrayFace::kDown));
      const Point end = end_of(ping, pose);
      assert_true(std::fabs(end.depth_m - kBottom_m) < 0.002);
      assert_true(std::fabs(end.east_m - 20 - echo.across_m) < 0.002);
      assert_true(std::fabs(end.north_m - 10) < 0.002);
    }
  }
}

TEST(without_the_profile_outer_beams_curl_and_the_wrong_sign_is_worse) {
  const double nadir_m = depth_error_m(0, 1.0, 0.0);
  const double left_m = depth_error_m(-66, 1.0, 0.0);
  const double right_m = depth_error_m(66, 1.0, 0.0);
  assert_true(std::fabs(left_m - right_m) < 1e-4);
  assert_true(std::fabs(right_m - nadir_m) > 0.2);
  // The other way round they curl the other way.
  const double other_m = depth_error_m(66, -1.0, 0.0) - depth_error_m(0, -1.0, 0.0);
  assert_true(other_m * (right_m - nadir_m) < 0);
  // The mirrored gradient doubles what the right one takes away.
  const double wrong_m = depth_error_m(66, 1.0, -1.0);
  assert_true(std::fabs(wrong_m) > 1.5 * std::fabs(right_m));
  assert_true(std::fabs(depth_error_m(66, 1.0, 1.0)) < 0.002);
}

TEST(the_ray_bends_in_its_vertical_plane_whatever_the_attitude) {
  Pose pose = pose_at(-5, 7, kHead_m);
  pose.attitude = {bam(25), bam(-12), bam(130)};
  for (double angle_deg = -40; angle_deg <= 40; angle_deg += 8) {
    Ping ping = fan_ping(angle_deg, 0.03, kTop_m_s);
    ping.sound_speed_mm_s = 0;
    const auto before = leadline::model::beam_frame(pose.attitude, ping.azimuth_bam32,
                                                    ping.elevation_bam32, ping.rotation_bam32);
    // The head of this water points at what it says: no array.
    const double horizontal = std::hypot(before.axis.q30[0], before.axis.q30[1]) / 1073741824.0;
    const Echo echo = echo_of(horizontal, -1.0);
    ping.range_um = std::llround(0.5e6 * echo.two_way_s * kTop_m_s);
    assert_true(path_of(water_of(-1.0)).straighten(ping, pose, ArrayFace::kNone));
    const Point end = end_of(ping, pose);
    const double scale = echo.across_m / horizontal / 1073741824.0;
    assert_true(std::fabs(end.depth_m - kBottom_m) < 0.002);
    assert_true(std::fabs(end.north_m + 5 - scale * before.axis.q30[0]) < 0.002);
    assert_true(std::fabs(end.east_m - 7 - scale * before.axis.q30[1]) < 0.002);
    // The footprint's axis is where it was, but for the turn of the beam itself.
    const auto after = leadline::model::beam_frame(pose.attitude, ping.azimuth_bam32,
                                                   ping.elevation_bam32, ping.rotation_bam32);
    double same = 0;
    for (int i = 0; i < 3; ++i) {
      same += after.along.q30[i] / 1073741824.0 * (before.along.q30[i] / 1073741824.0);
    }
    assert_true(same > 0.999);
  }
}

TEST(an_array_that_reckons_with_a_wrong_speed_is_steered_right) {
  // The profile says 1500 at the head, the head reckons with 1450: its beam of sine s looks at s 1500/1450.
  const double told_m_s = 1450.0;
  for (double angle_deg = -60; angle_deg <= 60; angle_deg += 12) {
    const double sine = std::sin(angle_deg * kRad) * kTop_m_s / told_m_s;
    const Echo echo = echo_of(sine, 0.0);
    for (const bool layered : {false, true}) {
      VehicleConfig config = water_of(0.0);
      config.water.point_count = layered ? 2 : 0;
      config.water.speed_known = 1;
      Ping ping = fan_ping(angle_deg, echo.two_way_s, told_m_s);
      const Pose pose = pose_at(0, 0, kHead_m);
      assert_true(path_of(config).straighten(ping, pose, ArrayFace::kDown));
      const Point end = end_of(ping, pose);
      assert_true(std::fabs(end.depth_m - kBottom_m) < 0.001);
      assert_true(std::fabs(end.east_m - echo.across_m) < 0.001);
      // A head that points by a motor looks where it says; its range alone is made anew.
      Ping plain = fan_ping(angle_deg, echo.two_way_s, told_m_s);
      assert_true(path_of(config).straighten(plain, pose, ArrayFace::kNone));
      assert_true(std::llabs(plain.range_um - ping.range_um) < 50);
      const double plain_m = 1e-6 * static_cast<double>(plain.range_um);
      assert_true(std::fabs(end_of(plain, pose).east_m - plain_m * std::sin(angle_deg * kRad)) <
                  0.001);
    }
  }
}

TEST(a_face_that_looks_ahead_keeps_its_normal) {
  VehicleConfig config = water_of(0.0);
  config.water.point_count = 0;
  config.water.speed_known = 1;
  Ping ping{};
  ping.kind = ReturnKind::kRange;
  ping.range_um = 3'000'000;
  ping.sound_speed_mm_s = 1'400'000;
  ping.azimuth_bam32 = bam(30);
  ping.elevation_bam32 = bam(-20);
  const double y = std::sin(30 * kRad) * std::cos(20 * kRad) * 1500 / 1400;
  const double z = -std::sin(20 * kRad) * 1500 / 1400;
  assert_true(path_of(config).straighten(ping, pose_at(0, 0, 5), ArrayFace::kForward));
  const Point end = end_of(ping, pose_at(0, 0, 0));
  const double range_m = 3.0 * 1500 / 1400;
  assert_true(std::fabs(end.east_m - range_m * y) < 1e-4);
  assert_true(std::fabs(end.depth_m - range_m * z) < 1e-4);
  assert_true(end.north_m > 0);
}

bool same(const Ping& a, const Ping& b) {
  return a.azimuth_bam32 == b.azimuth_bam32 && a.elevation_bam32 == b.elevation_bam32 &&
         a.rotation_bam32 == b.rotation_bam32 && a.range_um == b.range_um &&
         a.sound_speed_mm_s == b.sound_speed_mm_s && a.kind == b.kind;
}

TEST(without_anything_known_no_bit_changes) {
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    Ping ping{};
    ping.kind = i % 3 == 0 ? ReturnKind::kNoReturn : ReturnKind::kRange;
    ping.azimuth_bam32 = static_cast<leadline::base::Bam32>(random.next());
    ping.elevation_bam32 = static_cast<leadline::base::Bam32>(random.next());
    ping.rotation_bam32 = static_cast<leadline::base::Bam32>(random.next());
    ping.range_um = random.between(-5, leadline::base::kMaxRange_um + 5);
    ping.sound_speed_mm_s = static_cast<std::int32_t>(random.between(-1, 1'600'000));
    VehicleConfig config = water_of(0.0);
    config.water.point_count = 0;
    config.water.speed_known = static_cast<std::uint16_t>(i % 2);
    if (i % 2 != 0) {
      ping.sound_speed_mm_s = i % 4 == 1 ? 0 : 1'500'000;
    }
    const Ping before = ping;
    assert_true(path_of(config).straighten(ping, pose_at(0, 0, 5), ArrayFace::kDown));
    assert_true(same(ping, before));
  }
}

TEST(flat_upward_and_turned_beams) {
  const Pose pose = pose_at(0, 0, 20);
  const SoundPath path = path_of(water_of(-1.0));
  const double here_m_s = speed_at(20, -1.0);
  // Level: straight, at the speed of the head's depth.
  Ping level{};
  level.kind = ReturnKind::kRange;
  level.range_um = 30'000'000;
  const Ping before = level;
  assert_true(path.straighten(level, pose, ArrayFace::kNone));
  assert_int_equal(level.elevation_bam32, before.elevation_bam32);
  assert_true(std::llabs(level.range_um - std::llround(30e6 * here_m_s / kTop_m_s)) <= 1);
  // Up: as much as the same water upside down bends a beam that goes down.
  Ping up = fan_ping(120, 0.02, kTop_m_s);
  assert_true(path.straighten(up, pose, ArrayFace::kNone));
  assert_true(end_of(up, pose).depth_m < 20);
  VehicleConfig mirrored = water_of(1.0);
  mirrored.water.points[0].speed_mm_s = static_cast<std::int32_t>(1e3 * speed_at(40, -1.0));
  mirrored.water.points[1].speed_mm_s = 1'500'000;
  Ping down = fan_ping(60, 0.02, kTop_m_s);
  assert_true(path_of(mirrored).straighten(down, pose, ArrayFace::kNone));
  assert_true(std::fabs(end_of(down, pose).depth_m - 20 - (20 - end_of(up, pose).depth_m)) < 1e-3);
  assert_true(std::fabs(end_of(down, pose).east_m - end_of(up, pose).east_m) < 1e-3);
  // 80 degrees in water that gets faster fast: turned back before it comes anywhere.
  Ping turned = fan_ping(80, 0.5, kTop_m_s);
  assert_false(path_of(water_of(4.0)).straighten(turned, pose_at(0, 0, 0), ArrayFace::kNone));
  // An array whose phases fit no beam at all at the speed that the water has.
  Ping beyond = fan_ping(80, 0.01, 1400.0);
  assert_false(path_of(water_of(0.0)).straighten(beyond, pose, ArrayFace::kDown));
}

TEST(beams_without_an_echo_are_turned_and_keep_their_range) {
  Ping ping = fan_ping(30, 0.01, 1450.0);
  ping.kind = ReturnKind::kNoReturn;
  const std::int64_t range_um = ping.range_um;
  assert_true(path_of(water_of(0.0)).straighten(ping, pose_at(0, 0, 5), ArrayFace::kDown));
  assert_int_equal(ping.range_um, range_um);
  const Point end = end_of(ping, pose_at(0, 0, 0));
  assert_true(std::fabs(end.east_m / (1e-6 * static_cast<double>(range_um)) - 0.5 * 1500 / 1450) <
              1e-5);
}

TEST(impossible_water_and_pings_are_refused) {
  SoundPath path;
  VehicleConfig config = water_of(-1.0);
  config.water.points[1].depth_mm = 0;
  assert_int_equal(path.configure(config), Status::kInvalidArgument);
  config = water_of(-1.0);
  config.water.points[1].speed_mm_s = 900'000;
  assert_int_equal(path.configure(config), Status::kOutOfRange);
  config = water_of(-1.0);
  config.water.point_count = leadline::firmware::kMaxSoundSpeedPoints + 1;
  assert_int_equal(path.configure(config), Status::kOutOfRange);
  const SoundPath good = path_of(water_of(-1.0));
  const Pose pose = pose_at(0, 0, 5);
  Ping ping = fan_ping(10, 0.01, 1450.0);
  ping.range_um = -1;
  assert_false(good.straighten(ping, pose, ArrayFace::kDown));
  ping.range_um = leadline::base::kMaxRange_um + 1;
  assert_false(good.straighten(ping, pose, ArrayFace::kDown));
  ping = fan_ping(10, 0.01, 1450.0);
  ping.sound_speed_mm_s = 1;
  assert_false(good.straighten(ping, pose, ArrayFace::kDown));
}

// ---- The whole vehicle -----------------------------------------------------------------------------

Vehicle vehicle;

struct Bottom {
  double inner_m = 0;  ///< sums of depths below the head
  double outer_m = 0;
  int inner_count = 0;
  int outer_count = 0;
};

/// Lets a survey multibeam look at a flat bottom in water of `true_gradient`.
Bottom mapped_bottom(VehicleConfig config, double true_gradient) {
  config.ports[leadline::test::kRigSonar].driver = leadline::firmware::Driver::kR2sonic;
  leadline::test::configure_rig(vehicle, config);
  leadline::emu::EmulatedR2SonicSettings settings;
  settings.beams = 32;
  settings.period_us = 200'000;
  settings.sound_speed_m_s = static_cast<float>(speed_at(kHead_m, true_gradient));
  settings.two_way_s = [&](leadline::base::TimeUs, double angle_rad) {
    return echo_of(std::sin(angle_rad), true_gradient).two_way_s;
  };
  leadline::emu::EmulatedR2Sonic head(settings);
  leadline::test::RigOptions options;
  options.seconds = 4;
  options.roll_deg = 0;
  options.tamper = [&](leadline::test::RecordedCycle& cycle) {
    auto& chunks = cycle.chunks;
    for (std::size_t i = chunks.size(); i > 0; --i) {
      if (chunks[i - 1].port == leadline::test::kRigSonar) {
        chunks.erase(chunks.begin() + static_cast<std::ptrdiff_t>(i - 1));
      }
    }
    leadline::emu::Bytes bytes;
    head.advance(cycle.t_us, bytes);
    if (!bytes.empty()) {
      chunks.push_back({leadline::test::kRigSonar, cycle.t_us, bytes});
    }
  };
  Bottom bottom;
  static_cast<void>(leadline::test::fly(
      vehicle, options,
      [&](const leadline::test::RecordedCycle&, const leadline::firmware::CycleOutput&) {
        for (std::size_t i = 0; i < vehicle.mapped_count(); ++i) {
          const auto& mapped = vehicle.mapped()[i];
          const Point end = end_of(mapped.ping, mapped.pose);
          const double east_m = 1e-6 * static_cast<double>(mapped.pose.position_um[1]);
          const double north_m = 1e-6 * static_cast<double>(mapped.pose.position_um[0]);
          const double across_m = std::hypot(end.north_m - north_m, end.east_m - east_m);
          const double below_m =
              end.depth_m - 1e-6 * static_cast<double>(mapped.pose.position_um[2]);
          if (across_m > 25.0) {
            bottom.outer_m += below_m;
            ++bottom.outer_count;
          } else if (across_m < 5.0) {
            bottom.inner_m += below_m;
            ++bottom.inner_count;
          }
        }
      }));
  return bottom;
}

/// Mean depth at the outer beams less that below the head, metres.
double curl_m(const VehicleConfig& config, double true_gradient) {
  const Bottom bottom = mapped_bottom(config, true_gradient);
  assert_true(bottom.outer_count > 20);
  assert_true(bottom.inner_count > 20);
  return bottom.outer_m / bottom.outer_count - bottom.inner_m / bottom.inner_count;
}

TEST(the_vehicle_maps_a_flat_bottom_through_its_profile) {
  const double plain_m = curl_m(leadline::test::rig_config(), -1.0);
  VehicleConfig config = leadline::test::rig_config();
  config.water = water_of(-1.0).water;
  const double right_m = curl_m(config, -1.0);
  config.water = water_of(1.0).water;
  const double wrong_m = curl_m(config, -1.0);
  print_message(
      "curl of the outer beams: %.3f m without, %.3f m with, %.3f m with the wrong sign\n", plain_m,
      right_m, wrong_m);
  assert_true(std::fabs(plain_m) > 0.1);
  assert_true(std::fabs(right_m) < 0.01);
  assert_true(std::fabs(wrong_m) > 1.5 * std::fabs(plain_m));
}

TEST(a_known_speed_that_the_head_shares_changes_no_bit_of_the_map) {
  leadline::test::RigOptions options;
  options.seconds = 6;
  leadline::test::configure_rig(vehicle, leadline::test::rig_config());
  static_cast<void>(leadline::test::fly(vehicle, options));
  const std::uint64_t hash = vehicle.map_hash();
  assert_true(vehicle.counters().pings_mapped > 20);
  VehicleConfig config = leadline::test::rig_config();
  config.water.speed_known = 1;
  leadline::test::configure_rig(vehicle, config);
  static_cast<void>(leadline::test::fly(vehicle, options));
  assert_true(vehicle.map_hash() == hash);
}

TEST(beams_that_the_water_turns_back_are_counted) {
  VehicleConfig config = leadline::test::rig_config();
  config.water.point_count = 2;
  config.water.points[0] = {0, 1'300'000};
  config.water.points[1] = {30'000, 1'700'000};
  config.ports[leadline::test::kRigSonar].driver = leadline::firmware::Driver::kR2sonic;
  const auto lost = [] {
    return vehicle.counters().pings_lost[static_cast<int>(PingLoss::kNoPath)];
  };
  static_cast<void>(mapped_bottom(leadline::test::rig_config(), 0.0));
  assert_int_equal(lost(), 0);
  static_cast<void>(mapped_bottom(config, 0.0));
  assert_true(lost() > 20);
  const auto& counters = vehicle.counters();
  std::uint64_t all = counters.pings_pending + counters.pings_mapped;
  for (const std::uint64_t each : counters.pings_lost) {
    all += each;
  }
  assert_true(all == counters.pings_in);
}

}  // namespace
