// Ten times the pings that a vehicle may map: what is too much is shed, oldest first, and counted, and those
// that are mapped wait no longer in the end than in the beginning. 40 s of the vehicle's time;
// LEADLINE_OVERLOAD_S=600: ten minutes (toolchain/soak.sh).
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "firmware/pipeline/ping_queue.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::CycleOutput;
using leadline::firmware::PingLoss;
using leadline::firmware::PingQueue;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::test::RecordedChunk;
using leadline::test::RecordedCycle;
using leadline::test::RigOptions;

// As on a vehicle: one static object.
Vehicle vehicle;

constexpr std::uint32_t kTooFast = 10;

void put_le(std::vector<std::uint8_t>& out, std::uint32_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) {
    out.push_back(static_cast<std::uint8_t>(value >> static_cast<unsigned>(8 * i)));
  }
}

/// A Ping1D's distance, message 1212 of the Ping protocol, that nobody asked for.
void put_distance(std::vector<std::uint8_t>& out, std::uint32_t number, std::uint32_t distance_mm) {
  const std::size_t begin = out.size();
  put_le(out, 0x5242, 2);  // "BR"
  put_le(out, 24, 2);
  put_le(out, 1212, 2);
  put_le(out, 1, 2);  // from device 1 to the host
  put_le(out, distance_mm, 4);
  put_le(out, 100, 2);
  put_le(out, 100, 2);
  put_le(out, number, 4);
  put_le(out, 500, 4);
  put_le(out, 39'500, 4);
  put_le(out, 1, 4);
  std::uint32_t sum = 0;
  for (std::size_t i = begin; i < out.size(); ++i) {
    sum += out[i];
  }
  put_le(out, sum, 2);
}

TEST(what_is_too_much_is_shed_and_the_rest_waits_no_longer) {
  const char* const text = std::getenv("LEADLINE_OVERLOAD_S");
  RigOptions options;
  options.seconds = text != nullptr ? std::strtod(text, nullptr) : 40.0;
  // A lawn mower of 40 m legs has to stay in the grid.
  options.speed_m_s = std::min(1.5, 12 * 40.0 / options.seconds);
  VehicleConfig config = leadline::test::rig_config();
  config.cycle_voxel_budget =
      1;  // one ping a cycle goes through whatever the budget is: 50 a second
  leadline::test::configure_rig(vehicle, config);
  std::uint32_t number = 0;
  options.tamper = [&number](RecordedCycle& cycle) {
    RecordedChunk chunk{leadline::test::kRigSonar, cycle.t_us, {}};
    for (std::uint32_t i = 0; i < kTooFast; ++i) {
      ++number;
      put_distance(chunk.bytes, number, 15'000 + number % 97);
    }
    cycle.chunks.push_back(chunk);
  };
  // Of each tenth of the flight: the longest that a mapped ping had waited.
  constexpr std::size_t kTenths = 10;
  std::vector<TimeUs> longest_us(kTenths, 0);
  std::uint64_t mapped = 0;
  const double total_us = options.seconds * 1e6;
  TimeUs start_us = -1;
  (void)leadline::test::fly(vehicle, options, [&](const RecordedCycle& cycle, const CycleOutput&) {
    start_us = start_us < 0 ? cycle.t_us : start_us;
    const auto tenth = std::min(
        kTenths - 1,
        static_cast<std::size_t>(static_cast<double>(cycle.t_us - start_us) / total_us * kTenths));
    for (std::size_t i = 0; i < vehicle.mapped_count(); ++i) {
      longest_us[tenth] =
          std::max(longest_us[tenth], cycle.t_us - vehicle.mapped()[i].ping.t_transmit_us);
    }
    mapped += vehicle.mapped_count();
    assert_true(vehicle.counters().pings_pending <= PingQueue::kCapacity_count);
    assert_true(vehicle.mapped_count() <= 1);
  });
  const auto& counters = vehicle.counters();
  std::uint64_t lost = 0;
  for (const std::uint64_t count : counters.pings_lost) {
    lost += count;
  }
  const std::uint64_t shed = counters.pings_lost[static_cast<int>(PingLoss::kShed)];
  std::printf(
      "overload: %.0f s, %llu pings in = %llu mapped + %llu shed + %llu lost otherwise + %u "
      "waiting\n",
      options.seconds, static_cast<unsigned long long>(counters.pings_in),
      static_cast<unsigned long long>(counters.pings_mapped), static_cast<unsigned long long>(shed),
      static_cast<unsigned long long>(lost - shed), counters.pings_pending);
  std::printf("longest wait of a mapped ping by tenths of the flight, ms:");
  for (const TimeUs wait_us : longest_us) {
    std::printf(" %lld", static_cast<long long>(wait_us / 1000));
  }
  std::printf("\n");
  assert_true(counters.pings_in >= number);
  assert_true(counters.pings_in == counters.pings_mapped + lost + counters.pings_pending);
  assert_true(mapped == counters.pings_mapped);
  // Nine of ten cannot be mapped; nearly every cycle maps one once there are poses.
  assert_true(shed > counters.pings_in / 10 * 8);
  assert_true(counters.pings_mapped > counters.pings_in / kTooFast / 2);
  // Flat: what a ping may wait, or the queue's length over the rate at which pings come where that is less, and
  // the ping's own listening and a cycle.
  const TimeUs queue_us = std::min<TimeUs>(
      config.navigation.max_wait_us + leadline::firmware::kLongestQueue_us,
      static_cast<TimeUs>(PingQueue::kCapacity_count / kTooFast + 1) * options.cycle_us);
  for (std::size_t i = 1; i < kTenths; ++i) {
    assert_true(longest_us[i] > 0);
    assert_true(longest_us[i] <= queue_us + 100'000);
    assert_true(longest_us[i] <= longest_us[1] + options.cycle_us);
  }
}

}  // namespace
