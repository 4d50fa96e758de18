// What may happen to a vehicle's sensors and their lines, one test each: the whole vehicle in a process, its
// devices emulated. The table of all faults and of the tests elsewhere: tests/README.md.
#include <cmath>
#include <cstdio>
#include <limits>

#include "hal/emu/vectornav_sensor.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::Pose;
using leadline::base::TimeUs;
using leadline::emu::Motion;
using leadline::firmware::CycleOutput;
using leadline::firmware::Driver;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::test::configure_rig;
using leadline::test::fly;
using leadline::test::kRigNavigation;
using leadline::test::kRigSonar;
using leadline::test::Random;
using leadline::test::RecordedChunk;
using leadline::test::RecordedCycle;
using leadline::test::rig_bottom_m;
using leadline::test::rig_config;
using leadline::test::RigOptions;

constexpr std::uint8_t kCompass = 2;  // port of a VectorNav, where there is one
constexpr double kPi = 3.14159265358979323846;

Vehicle vehicle;

VehicleConfig with_compass(std::uint16_t switches) {
  VehicleConfig config = rig_config();
  config.port_count = 3;
  config.ports[kCompass].driver = Driver::kVectornav;
  config.ports[kCompass].mount = leadline::firmware::kNoMount;
  config.ports[kCompass].switches = switches;
  return config;
}

double degrees(leadline::base::Bam32 angle) {
  return static_cast<double>(static_cast<std::int32_t>(angle)) * 360.0 / 4294967296.0;
}

// As the rig's own sensors have it.
Motion motion_at(TimeUs t_us) {
  const double t = static_cast<double>(t_us) * 1e-6;
  Motion motion;
  motion.roll_deg = 4.0 * std::sin(2.0 * kPi * t / 5.0);
  motion.pitch_deg = 2.0 * std::sin(2.0 * kPi * t / 7.0);
  motion.heading_deg = 10.0;
  const double roll_rate = 4.0 * 2.0 / 5.0 * kPi * std::cos(2.0 * kPi * t / 5.0);
  const double pitch_rate = 2.0 * 2.0 / 7.0 * kPi * std::cos(2.0 * kPi * t / 7.0);
  const double roll_rad = motion.roll_deg * kPi / 180.0;
  motion.rate_rad_s = {roll_rate * kPi / 180.0, pitch_rate * kPi / 180.0 * std::cos(roll_rad),
                       -pitch_rate * kPi / 180.0 * std::sin(roll_rad)};
  return motion;
}

void drop_navigation(RecordedCycle& cycle) {
  auto& chunks = cycle.chunks;
  for (std::size_t i = chunks.size(); i > 0; --i) {
    if (chunks[i - 1].port == kRigNavigation) {
      chunks.erase(chunks.begin() + static_cast<std::ptrdiff_t>(i - 1));
    }
  }
}

double map_rms_m() {
  vehicle.model().extract();
  int cells = 0;
  double squares = 0;
  for (std::int32_t n = 0; n < 96; ++n) {
    for (std::int32_t e = 0; e < 96; ++e) {
      const auto& result = vehicle.model().result(n, e);
      if (result.depth_q8 != leadline::model::kUnknownDepth) {
        const double truth = rig_bottom_m(0.5 * (n + 0.5) - 24.0, 0.5 * (e + 0.5) - 24.0);
        const double error = 5.0 + 0.5 * result.depth_q8 / 256.0 - truth;
        squares += error * error;
        ++cells;
      }
    }
  }
  assert_true(cells > 300);
  return std::sqrt(squares / cells);
}

void assert_accounts() {
  const auto& counters = vehicle.counters();
  std::uint64_t sum = counters.pings_pending + counters.pings_mapped;
  for (const std::uint64_t lost : counters.pings_lost) {
    sum += lost;
  }
  assert_int_equal(counters.pings_in, sum);
}

// The Ping protocol's sum misses one in sixteen of these; what it misses has to be plausible to do harm.
TEST(corrupt_bytes_two_bits_of_every_third_frame) {
  configure_rig(vehicle, rig_config());
  Random random(11);
  RigOptions options;
  options.seconds = 40;
  options.tamper = [&](RecordedCycle& cycle) {
    for (RecordedChunk& chunk : cycle.chunks) {
      if (random.between(0, 2) != 0) {
        continue;
      }
      for (int flip = 0; flip < 2; ++flip) {
        const auto at = random.between(0, static_cast<std::int64_t>(chunk.bytes.size()) - 1);
        chunk.bytes[static_cast<std::size_t>(at)] ^=
            static_cast<std::uint8_t>(1U << static_cast<unsigned>(random.between(0, 7)));
      }
    }
  };
  fly(vehicle, options);
  const auto& counters = vehicle.counters();
  std::printf("mapped %llu of %llu pings, rejected frames %llu + %llu, map rms %.3f m\n",
              static_cast<unsigned long long>(counters.pings_mapped),
              static_cast<unsigned long long>(counters.pings_in),
              static_cast<unsigned long long>(counters.ports[kRigSonar].rejected),
              static_cast<unsigned long long>(counters.ports[kRigNavigation].rejected),
              map_rms_m());
  assert_true(counters.pings_mapped > 100);
  assert_true(counters.ports[kRigSonar].rejected > 50);
  assert_true(counters.ports[kRigNavigation].rejected > 200);
  assert_true(map_rms_m() < 0.35);
  assert_accounts();
}

TEST(clock_drift_200_ppm_and_a_step_of_a_second) {
  double rms_deg[2] = {0, 0};
  for (const bool use_clock : {false, true}) {
    configure_rig(vehicle, with_compass(use_clock ? leadline::firmware::kPortDeviceClock : 0));
    Random random(12);
    RigOptions options;
    options.seconds = 60;
    options.attitude_until_s = 0;
    TimeUs next_us = 19'000;  // a millisecond before a cycle
    options.tamper = [&](RecordedCycle& cycle) {
      if (random.between(0, 4) != 0) {
        return;  // the line has something else to do
      }
      for (; next_us <= cycle.t_us; next_us += 20'000) {
        Motion motion = motion_at(next_us);
        const double step_s = next_us > 30'000'000 ? 1.0 : 0.0;
        motion.time_s = 1000.0 + step_s + static_cast<double>(next_us) * 1.0002e-6;
        cycle.chunks.push_back(
            RecordedChunk{kCompass, cycle.t_us, leadline::emu::vectornav_common(motion)});
      }
    };
    double squares = 0;
    int count = 0;
    TimeUs seen = 0;
    fly(vehicle, options, [&](const RecordedCycle& cycle, const CycleOutput&) {
      const Pose& pose = vehicle.latest_pose();
      const bool settled =
          cycle.t_us > 12'000'000 && (cycle.t_us < 30'000'000 || cycle.t_us > 45'000'000);
      if (settled && pose.t_us > seen) {
        const double error = degrees(pose.attitude.roll_bam32) - motion_at(pose.t_us).roll_deg;
        squares += error * error;
        ++count;
      }
      seen = pose.t_us;
    });
    assert_true(count > 200);
    rms_deg[use_clock ? 1 : 0] = std::sqrt(squares / count);
    const auto& clock = vehicle.clock(kCompass);
    if (use_clock) {
      std::printf("drift %lld ppb, stated error %lld us\n",
                  static_cast<long long>(clock.drift_ppb()),
                  static_cast<long long>(clock.at(1'061'000'000).error_us));
      assert_true(clock.sure());
      assert_int_equal(clock.counters().steps, 1);
      assert_near(clock.drift_ppb(), -200'000, 50'000);
    } else {
      assert_int_equal(clock.counters().merged, 0);
    }
    assert_accounts();
  }
  std::printf("roll at its stamp: %.3f degrees rms by arrival, %.3f by the device's clock\n",
              rms_deg[0], rms_deg[1]);
  assert_true(rms_deg[1] < 0.6 * rms_deg[0]);
}

TEST(nan_and_infinity_leave_no_trace) {
  constexpr double kBad[] = {std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity(),
                             -std::numeric_limits<double>::infinity(),
                             1e30,
                             -1e30,
                             3.4e38};
  configure_rig(vehicle, with_compass(0));
  RigOptions options;
  options.seconds = 20;
  fly(vehicle, options);
  const std::uint64_t clean = vehicle.map_hash();
  const auto poses = vehicle.counters().nav_samples;
  configure_rig(vehicle, with_compass(0));
  options.tamper = [&](RecordedCycle& cycle) {
    const auto number = static_cast<std::size_t>(cycle.t_us / 20'000);
    Motion motion = motion_at(cycle.t_us);
    const double bad = kBad[number % 6];
    switch (number / 6 % 3) {
      case 0:
        motion.roll_deg = bad;
        break;
      case 1:
        motion.pitch_deg = bad;
        break;
      default:
        motion.rate_rad_s[number % 3] = bad;
    }
    cycle.chunks.push_back(
        RecordedChunk{kCompass, cycle.t_us, leadline::emu::vectornav_common(motion)});
  };
  fly(vehicle, options);
  assert_true(vehicle.counters().ports[kCompass].rejected > 900);
  assert_int_equal(vehicle.counters().nav_samples, poses);
  assert_true(vehicle.map_hash() == clean);
}

TEST(stuck_sensor_is_out_after_a_hundred_samples) {
  configure_rig(vehicle, with_compass(leadline::firmware::kPortWatchStuck));
  RigOptions options;
  options.seconds = 30;
  options.attitude_until_s = 0;
  options.tamper = [&](RecordedCycle& cycle) {
    // Hangs for eight seconds from 10 s on.
    const bool hangs = cycle.t_us >= 10'000'000 && cycle.t_us < 18'000'000;
    Motion motion = motion_at(hangs ? 10'000'000 : cycle.t_us);
    motion.time_s = 1.0 + static_cast<double>(cycle.t_us) * 1e-6;
    cycle.chunks.push_back(
        RecordedChunk{kCompass, cycle.t_us, leadline::emu::vectornav_common(motion)});
  };
  std::uint64_t mapped_at_13_s = 0;
  std::uint64_t mapped_at_18_s = 0;
  fly(vehicle, options, [&](const RecordedCycle& cycle, const CycleOutput&) {
    // 100 samples are two seconds; those before count as poses until then.
    if (cycle.t_us < 12'000'000) {
      assert_in_range(vehicle.counters().nav_stuck, 0, 1);
    }
    mapped_at_13_s = cycle.t_us == 13'000'000 ? vehicle.counters().pings_mapped : mapped_at_13_s;
    mapped_at_18_s = cycle.t_us == 18'000'000 ? vehicle.counters().pings_mapped : mapped_at_18_s;
  });
  // 400 samples, 99 of them taken.
  assert_in_range(vehicle.counters().nav_stuck, 300, 302);
  assert_true(mapped_at_13_s > 50);
  assert_int_equal(mapped_at_18_s, mapped_at_13_s);
  assert_true(vehicle.counters().pings_mapped > mapped_at_18_s + 50);
  assert_accounts();
}

// Rates of nothing beside angles that move: the attitude must not be what the rates make of it.
TEST(stuck_gyro_does_not_lead_the_attitude_away) {
  configure_rig(vehicle, with_compass(0));
  RigOptions options;
  options.seconds = 30;
  options.attitude_until_s = 0;
  options.tamper = [&](RecordedCycle& cycle) {
    Motion motion = motion_at(cycle.t_us);
    motion.rate_rad_s = {};
    cycle.chunks.push_back(
        RecordedChunk{kCompass, cycle.t_us, leadline::emu::vectornav_common(motion)});
  };
  double worst_deg = 0;
  double squares = 0;
  int count = 0;
  fly(vehicle, options, [&](const RecordedCycle& cycle, const CycleOutput&) {
    const Pose& pose = vehicle.latest_pose();
    if (cycle.t_us > 1'000'000) {
      const double error = degrees(pose.attitude.roll_bam32) - motion_at(pose.t_us).roll_deg;
      worst_deg = std::max(worst_deg, std::abs(error));
      squares += error * error;
      ++count;
    }
  });
  std::printf("roll off by %.2f degrees rms, %.2f at most; epochs %d\n", std::sqrt(squares / count),
              worst_deg, vehicle.latest_pose().epoch);
  assert_true(worst_deg < 3.0);
  assert_true(std::sqrt(squares / count) < 1.0);
  assert_true(vehicle.latest_pose().epoch > 0);
}

TEST(navigation_gap_of_0_to_60_s_writes_no_cell) {
  for (const double gap_s : {0.0, 0.2, 1.0, 5.0, 15.0, 26.0, 40.0, 60.0}) {
    VehicleConfig config = rig_config();
    configure_rig(vehicle, config);
    RigOptions options;
    options.speed_m_s = 0.5;
    options.seconds = 15 + gap_s + 6;
    const TimeUs from = 15'000'000;
    const TimeUs to = from + static_cast<TimeUs>(gap_s * 1e6);
    options.tamper = [&](RecordedCycle& cycle) {
      if (cycle.t_us > from && cycle.t_us <= to) {
        drop_navigation(cycle);
      }
    };
    std::uint64_t in_gap = 0;
    std::uint64_t after = 0;
    std::uint64_t updates = 0;
    fly(vehicle, options, [&](const RecordedCycle& cycle, const CycleOutput&) {
      const std::uint64_t now = vehicle.model().counters().voxel_updates;
      const std::uint64_t written = now - updates;
      updates = now;
      // What was pinged before it still waits: max_wait_us.
      in_gap += cycle.t_us > from + 500'000 && cycle.t_us <= to ? written : 0;
      after += cycle.t_us > to && cycle.t_us <= to + 2'000'000 ? written : 0;
    });
    std::printf("gap %4.1f s: %llu voxels in it, %llu in the two seconds after\n", gap_s,
                static_cast<unsigned long long>(in_gap), static_cast<unsigned long long>(after));
    assert_int_equal(in_gap, 0);
    assert_true(after > 0);
    assert_accounts();
  }
}

TEST(position_jump_of_0_1_to_100_m_is_refused_or_a_new_epoch) {
  for (const double jump_m : {0.1, 0.3, 1.0, 2.0, 5.0, 10.0, 30.0, 100.0}) {
    VehicleConfig config = rig_config();
    configure_rig(vehicle, config);
    RigOptions options;
    options.seconds = 25;
    options.jump_at_s = 12.0;
    options.jump_m = jump_m;
    double farthest_m = 0;  // from one pose to the next, of one epoch
    Pose before{};
    fly(vehicle, options, [&](const RecordedCycle& cycle, const CycleOutput&) {
      const Pose& pose = vehicle.latest_pose();
      if (cycle.t_us > 10'000'000 && pose.epoch == before.epoch) {
        const double moved =
            1e-6 * static_cast<double>(pose.position_um[0] - before.position_um[0]);
        const double own = 1.5e-6 * static_cast<double>(pose.t_us - before.t_us);
        farthest_m = std::max(farthest_m, std::abs(moved) - own);
      }
      before = pose;
    });
    std::printf("jump of %5.1f m: epoch %d, poses of one epoch apart by %.2f m at most\n", jump_m,
                vehicle.latest_pose().epoch, farthest_m);
    // What lies within the gate is noise to whoever looks at it: 5 sigmas of 0.2 m.
    assert_true(farthest_m < 1.0);
    assert_true(jump_m < 2.0 || vehicle.latest_pose().epoch > 0);
    assert_accounts();
  }
}

TEST(time_backwards_fuses_no_stale_ping) {
  for (std::uint64_t round = 0; round < 5; ++round) {
    const VehicleConfig config = rig_config();
    configure_rig(vehicle, config);
    Random random(20 + round);
    RigOptions options;
    options.seconds = 20;
    options.tamper = [&](RecordedCycle& cycle) {
      const auto jump = [&] { return random.between(-5'000'000, 5'000'000); };
      if (random.between(0, 20) == 0) {
        cycle.t_us += random.between(0, 1) == 0 ? -random.between(0, 8'000'000) : 0;
      }
      for (RecordedChunk& chunk : cycle.chunks) {
        chunk.t_arrival_us += random.between(0, 20) == 0 ? jump() : 0;
      }
    };
    TimeUs clock = 0;
    fly(vehicle, options, [&](const RecordedCycle& cycle, const CycleOutput&) {
      clock = std::max(clock, cycle.t_us);
      for (std::size_t i = 0; i < vehicle.mapped_count(); ++i) {
        const auto& mapped = vehicle.mapped()[i];
        assert_true(mapped.ping.t_transmit_us <= clock);
        assert_true(mapped.ping.t_transmit_us >= clock - 1'000'000);
        assert_true(mapped.pose.t_us <= clock);
      }
    });
    assert_true(vehicle.counters().cycle_time_clamped > 10);
    assert_true(vehicle.counters().chunk_time_clamped > 10);
    assert_true(vehicle.counters().pings_mapped > 50);
    assert_accounts();
  }
}

}  // namespace
