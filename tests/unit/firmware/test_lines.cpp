// Single lines at a vehicle: pulses that tie its clock to UTC, edges that say when a head transmitted, a leak;
// heads' own clocks; a pressure sensor that is zeroed at the surface; heads of many beams.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "hal/emu/emulated_r2sonic.hpp"
#include "hal/emu/nmea_talker.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::Status;
using leadline::base::TimeUs;
using leadline::emu::nmea_frame;
using leadline::firmware::CycleOutput;
using leadline::firmware::Driver;
using leadline::firmware::InputChunk;
using leadline::firmware::PingLoss;
using leadline::firmware::PortConfig;
using leadline::firmware::SurfaceReference;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::hal::LineRole;
using leadline::test::kRigNavigation;
using leadline::test::kRigSonar;

Vehicle vehicle;

constexpr std::uint8_t kLinePort = 2;
constexpr TimeUs kCycle_us = 20'000;
constexpr std::int64_t kNoon_us = 1'795'305'600'000'000;  // 2026-11-22 00:00 UTC

VehicleConfig with_line(LineRole role, bool rising = true) {
  VehicleConfig config = leadline::test::rig_config();
  config.port_count = 3;
  PortConfig& line = config.ports[kLinePort];
  line.driver = Driver::kLine;
  line.variant_plus_1 = static_cast<std::int32_t>(role) + 1;
  line.mount = role == LineRole::kPingSync ? 0 : leadline::firmware::kNoMount;
  line.switches = rising ? 0 : static_cast<std::uint16_t>(leadline::firmware::kPortOtherSense);
  return config;
}

struct Arrival {
  TimeUs t_us;
  std::uint8_t port;
  std::string bytes;
};

/// Cycles up to `to_us`, each with what arrived in it, in the order given.
class Flight {
 public:
  explicit Flight(const VehicleConfig& config) { leadline::test::configure_rig(vehicle, config); }
  void add(TimeUs t_us, std::uint8_t port, const std::string& bytes) {
    arrivals_.push_back({t_us, port, bytes});
  }
  void run(TimeUs to_us) {
    while (now_us_ < to_us) {
      now_us_ += kCycle_us;
      std::vector<InputChunk> chunks;
      for (const Arrival& each : arrivals_) {
        if (each.t_us > now_us_ - kCycle_us && each.t_us <= now_us_) {
          chunks.push_back({each.t_us, reinterpret_cast<const std::uint8_t*>(each.bytes.data()),
                            static_cast<std::uint16_t>(each.bytes.size()), each.port});
        }
      }
      CycleOutput output{};
      vehicle.cycle({now_us_, chunks.data(), chunks.size(), 100'000}, output);
      receiver_.take(output.downlink.data, output.downlink.size_bytes);
    }
  }
  leadline::test::RigReceiver& receiver() { return receiver_; }

 private:
  std::vector<Arrival> arrivals_;
  TimeUs now_us_ = 0;
  leadline::test::RigReceiver receiver_{leadline::proto::survey_tag(0x1234567890ABCDEF, 7)};
};

std::string zda(std::int64_t second) {
  char text[64];
  std::snprintf(text, sizeof text, "GPZDA,%02d%02d%02d.00,22,11,2026,00,00",
                static_cast<int>(second / 3600), static_cast<int>(second / 60 % 60),
                static_cast<int>(second % 60));
  return nmea_frame(text);
}

/// A vehicle whose clock runs 200 ppm fast: second `second` of UTC.
TimeUs edge_us(std::int64_t second) { return 3'000'017 + second * 1'000'200; }

void add_seconds(Flight& flight, std::int64_t from, std::int64_t to, TimeUs latency_us) {
  for (std::int64_t second = from; second < to; ++second) {
    // In the order of the ports: where both fall into one cycle the message is handed over first.
    flight.add(edge_us(second) + latency_us, kRigNavigation, zda(second));
    flight.add(edge_us(second), kLinePort, "R");
    flight.add(edge_us(second) + 100'000, kLinePort, "F");
  }
}

TEST(pulses_and_messages_tie_the_clock_to_utc) {
  for (const TimeUs latency_us : {TimeUs{9'000}, TimeUs{420'000}}) {
    Flight flight(with_line(LineRole::kPps));
    add_seconds(flight, 0, 40, latency_us);
    // A line that rings: none of these is a second after another.
    for (int i = 0; i < 30; ++i) {
      flight.add(edge_us(10 + i % 20) + 333'000 + 10'000 * i, kLinePort, "R");
    }
    flight.run(edge_us(39) + 500'000);
    const auto& clock = vehicle.utc_clock();
    assert_true(clock.sure());
    const auto reading = clock.utc_at(edge_us(39));
    assert_true(reading.sure);
    assert_true(std::llabs(reading.utc_us - (kNoon_us + 39'000'000)) <= 3);
    assert_true(reading.error_us <= 10);
    assert_near(static_cast<double>(clock.drift_ppb()), 200'000, 1'000);
    assert_int_equal(clock.counters().pulses_refused, 2 + 30);
    assert_int_equal(clock.counters().mislabelled, 0);
    assert_int_equal(flight.receiver().bad, 0);
  }
}

TEST(a_leak_is_an_alarm_and_a_text_while_it_lasts_also_when_it_was_there_before) {
  for (const bool rising : {true, false}) {
    Flight flight(with_line(LineRole::kLeak, rising));
    const std::string dry = rising ? "L" : "H";
    flight.add(50'000, kLinePort, dry);
    flight.add(7'000'000, kLinePort, rising ? "R" : "F");
    flight.add(12'000'000, kLinePort, rising ? "F" : "R");
    flight.run(6'900'000);
    assert_int_equal(vehicle.counters().alarms & leadline::proto::kAlarmLeak, 0);
    const auto texts = flight.receiver().texts;
    flight.run(9'000'000);
    assert_true((vehicle.counters().alarms & leadline::proto::kAlarmLeak) != 0);
    assert_true((flight.receiver().last_alarms & leadline::proto::kAlarmLeak) != 0);
    assert_int_equal(flight.receiver().texts, texts + 1);
    flight.run(14'000'000);
    assert_int_equal(vehicle.counters().alarms & leadline::proto::kAlarmLeak, 0);
    assert_int_equal(flight.receiver().texts, texts + 2);
    Flight wet(with_line(LineRole::kLeak, rising));
    wet.add(50'000, kLinePort, rising ? "H" : "L");
    wet.run(100'000);
    assert_true((vehicle.counters().alarms & leadline::proto::kAlarmLeak) != 0);
  }
  // A switch that says nothing is dry, not silent: here only the two other ports are.
  VehicleConfig config = with_line(LineRole::kLeak);
  config.ports[0] = config.ports[kLinePort];
  config.ports[1] = config.ports[kLinePort];
  Flight quiet(config);
  quiet.run(7'000'000);
  assert_int_equal(vehicle.counters().alarms & leadline::proto::kAlarmPortSilent, 0);
}

TEST(a_line_that_cannot_be_is_refused) {
  const auto refused = [](const VehicleConfig& config) {
    const leadline::firmware::TableBlock block{&leadline::test::rig_table(),
                                               sizeof(leadline::model::LocalizationTable)};
    return vehicle.configure(config, &block, 1) != Status::kOk;
  };
  VehicleConfig config = with_line(LineRole::kPingSync);
  assert_false(refused(config));
  config.ports[kLinePort].mount = leadline::firmware::kNoMount;
  assert_true(refused(config));
  config = with_line(LineRole::kPps);
  config.ports[kLinePort].variant_plus_1 = 4;
  assert_true(refused(config));
}

// ---- Heads --------------------------------------------------------------------------------------

constexpr TimeUs kTwoWay_us = 29'600;  // of the outermost beam over 12 m, at 1 rad

/// Attitude at 50 Hz, fixes and depths at 5 Hz; what a pose needs.
void add_poses(Flight& flight, TimeUs to_us, TimeUs late_us = 0) {
  for (TimeUs t = 400'000; t < to_us; t += 20'000) {
    flight.add(t + late_us, kRigNavigation,
               nmea_frame("PASHR,000000.00,90.00,T,0.00,0.00,0.00,0.1,0.1,0.1,1,1"));
    if (t % 200'000 == 100'000) {
      flight.add(t + 1, kRigNavigation,
                 nmea_frame("GPGGA,000000,4730.0,N,00915.0,E,4,12,0.5,,M,,M,,"));
      flight.add(t + 2, kRigNavigation, nmea_frame("PRVAT,00.000,M,0010.132,dBar"));
    }
  }
}

/// A packet over a flat bottom 12 m below, stamped with the UTC of vehicle time `t_us`.
std::string packet_of(TimeUs t_us, std::size_t beams) {
  leadline::emu::R2SonicPacket packet;
  const auto utc_us =
      kNoon_us + static_cast<TimeUs>(static_cast<double>(t_us - 3'000'017) / 1.0002);
  packet.seconds = static_cast<std::uint32_t>(utc_us / 1'000'000);
  packet.nanoseconds = static_cast<std::uint32_t>(utc_us % 1'000'000 * 1000);
  for (std::size_t i = 0; i < beams; ++i) {
    const double angle_rad = -1.0 + 2.0 * static_cast<double>(i) / static_cast<double>(beams - 1);
    packet.ranges.push_back(static_cast<std::uint16_t>(2e6 * 12.0 / 1500.0 / std::cos(angle_rad)));
  }
  const auto bytes = leadline::emu::write_r2sonic_packet(packet);
  return {bytes.begin(), bytes.end()};
}

VehicleConfig with_multibeam(VehicleConfig config) {
  config.ports[kRigSonar].driver = Driver::kR2sonic;
  return config;
}

/// Pings at `ping_us`, each as late as `latency_us` says; the errors of their time, of mapped pings.
struct Errors {
  TimeUs least_us = INT64_MAX;
  TimeUs most_us = INT64_MIN;
};
Errors time_errors(Flight& flight, TimeUs from_us, TimeUs to_us, TimeUs interval_us) {
  Errors errors;
  flight.run(from_us);
  for (TimeUs t = from_us; t < to_us; t += kCycle_us) {
    flight.run(t + kCycle_us);
    for (std::size_t i = 0; i < vehicle.mapped_count(); ++i) {
      const TimeUs off_us = vehicle.mapped()[i].ping.t_transmit_us % interval_us;
      errors.least_us = std::min(errors.least_us, off_us);
      errors.most_us = std::max(errors.most_us, off_us);
    }
  }
  assert_true(errors.least_us <= errors.most_us);
  return errors;
}

constexpr TimeUs kInterval_us = 200'000;

/// Latencies of 6 to 46 ms.
void add_pings(Flight& flight, TimeUs to_us, std::size_t beams, bool edges) {
  leadline::test::Random random(5);
  for (TimeUs t = 1'000'000; t < to_us; t += kInterval_us) {
    const bool late = random.between(0, 4) == 0;
    const TimeUs latency_us = 6'000 + random.between(0, late ? 40'000 : 2'000);
    flight.add(t + kTwoWay_us + latency_us, kRigSonar, packet_of(t, beams));
    if (edges) {
      flight.add(t, kLinePort, "R");
    }
  }
}

TEST(an_edge_says_when_a_head_transmitted) {
  Flight without(with_multibeam(with_line(LineRole::kPingSync)));
  add_poses(without, 8'000'000);
  add_pings(without, 8'000'000, 16, false);
  const Errors late = time_errors(without, 2'000'000, 8'000'000, kInterval_us);
  assert_true(late.least_us >= 5'900 && late.most_us > 40'000);
  assert_int_equal(vehicle.counters().pings_synced, 0);
  Flight with(with_multibeam(with_line(LineRole::kPingSync)));
  add_poses(with, 8'000'000);
  add_pings(with, 8'000'000, 16, true);
  const Errors errors = time_errors(with, 2'000'000, 8'000'000, kInterval_us);
  assert_int_equal(errors.least_us, 0);
  assert_int_equal(errors.most_us, 0);
  assert_true(vehicle.counters().pings_synced > 400);
}

TEST(a_head_s_own_clock_takes_the_jitter_and_a_shared_pulse_the_latency) {
  VehicleConfig config = with_multibeam(with_line(LineRole::kPps));
  config.ports[kRigSonar].switches = leadline::firmware::kPortDeviceClock;
  const TimeUs end_us = 40'000'000;
  Flight own(config);
  add_poses(own, end_us);
  add_pings(own, end_us, 16, false);
  const Errors jitter = time_errors(own, 30'000'000, end_us, kInterval_us);
  std::printf("own clock: %lld .. %lld us\n", static_cast<long long>(jitter.least_us),
              static_cast<long long>(jitter.most_us));
  assert_true(jitter.least_us > 4'000 && jitter.most_us < 10'000);
  Flight shared(config);
  add_poses(shared, end_us);
  add_pings(shared, end_us, 16, false);
  add_seconds(shared, 0, 36, 300'000);
  const Errors errors = time_errors(shared, 30'000'000, end_us, kInterval_us);
  // A stamp of a microsecond early would be that of the interval before.
  const TimeUs worst_us = std::max(std::min(errors.most_us, kInterval_us - errors.least_us),
                                   std::min(errors.least_us, kInterval_us - errors.most_us));
  std::printf("shared pulse: %lld .. %lld us\n", static_cast<long long>(errors.least_us),
              static_cast<long long>(errors.most_us));
  assert_true(worst_us <= 20 || errors.most_us <= 20);
}

TEST(a_head_of_1024_beams_sheds_none_of_its_own) {
  VehicleConfig config = with_multibeam(leadline::test::rig_config());
  config.cycle_voxel_budget = 0;
  Flight flight(config);
  add_poses(flight, 4'000'000, 150'000);  // poses come late: pings wait for them
  add_pings(flight, 4'000'000, 1024, false);
  flight.run(4'500'000);
  const auto& counters = vehicle.counters();
  assert_int_equal(counters.pings_in, 15 * 1024);
  assert_int_equal(counters.pings_lost[static_cast<int>(PingLoss::kShed)], 0);
  assert_true(counters.pings_mapped >= 14 * 1024);
  assert_int_equal(counters.alarms & leadline::proto::kAlarmQueueFull, 0);
}

TEST(pressure_is_zeroed_at_the_surface_by_option) {
  for (const bool zeroed : {false, true}) {
    VehicleConfig config = leadline::test::rig_config();
    config.ports[kRigNavigation].switches =
        zeroed ? static_cast<std::uint16_t>(leadline::firmware::kPortZeroAtSurface) : 0;
    Flight flight(config);
    // Air of 985 hPa, then 10 m of water.
    for (TimeUs t = 100'000; t < 20'000'000; t += 100'000) {
      const double dbar = 9.85 + (t > 8'000'000 ? 1.029 * 0.980665 * 10.0 : 0.0);
      char text[48];
      std::snprintf(text, sizeof text, "PRVAT,00.000,M,%08.4f,dBar", dbar);
      flight.add(t, kRigNavigation, nmea_frame(text));
    }
    flight.run(7'500'000);
    const auto depth_m = [] {
      return 1e-6 * static_cast<double>(vehicle.latest_pose().position_um[2]);
    };
    assert_near(depth_m(), zeroed ? 0.0 : -0.28, 0.02);
    assert_int_equal(vehicle.counters().nav_zeroing > 0, zeroed);
    assert_int_equal(vehicle.surface(kRigNavigation).state(),
                     zeroed ? SurfaceReference::State::kKnown : SurfaceReference::State::kWaiting);
  }
}

}  // namespace
