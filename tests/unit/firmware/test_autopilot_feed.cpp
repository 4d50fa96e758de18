// What an autopilot hears of the pings, decoded from the bytes that it gets.
#include <map>
#include <vector>

#include "firmware/pipeline/autopilot_feed.hpp"
#include "hal/attitude/mavlink.hpp"
#include "hal/wire.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::NavSample;
using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::base::TimeUs;
using leadline::firmware::AutopilotFeed;
using leadline::firmware::Driver;
using leadline::firmware::kPortSend;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::hal::kMavDistanceSensor;
using leadline::hal::kMavHeartbeat;
using leadline::hal::kMavNoDistance_cm;
using leadline::hal::kMavObstacleDistance;
using leadline::test::bam;
using leadline::test::ping_along;
using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kAutopilot = 2;

VehicleConfig feed_config() {
  VehicleConfig config = leadline::test::rig_config();
  config.port_count = 3;
  config.ports[kAutopilot] = {};
  config.ports[kAutopilot].driver = Driver::kMavlink;
  config.ports[kAutopilot].mount = leadline::firmware::kNoMount;
  config.ports[kAutopilot].switches = kPortSend;
  return config;
}

AutopilotFeed feed_of(const VehicleConfig& config) {
  AutopilotFeed feed;
  feed.configure(config);
  return feed;
}

Bytes sent(AutopilotFeed& feed, TimeUs now_us, std::size_t port = kAutopilot,
           std::size_t capacity_bytes = 256) {
  Bytes bytes(256);
  bytes.resize(feed.send(port, now_us, bytes.data(), capacity_bytes));
  return bytes;
}

struct Frame {
  leadline::hal::MavlinkHeader header;
  Bytes bytes;
  [[nodiscard]] std::uint16_t u16(std::size_t at) const {
    return leadline::hal::read_u16_le(bytes.data() + header.payload_offset + at);
  }
};

/// Every frame of `bytes`; all have to be whole, with a good CRC.
std::vector<Frame> frames_of(const Bytes& bytes) {
  std::vector<Frame> frames;
  std::size_t at = 0;
  while (at < bytes.size()) {
    Frame frame{};
    assert_true(leadline::hal::read_mavlink_header(&bytes[at], bytes.size() - at, frame.header));
    const auto judged = leadline::hal::judge_mavlink(&bytes[at], bytes.size() - at);
    assert_true(judged.verdict == leadline::hal::FrameVerdict::kFrame);
    frame.bytes.assign(&bytes[at], &bytes[at] + frame.header.frame_bytes);
    at += frame.header.frame_bytes;
    frames.push_back(frame);
  }
  return frames;
}

const Frame* find(const std::vector<Frame>& frames, std::uint32_t id) {
  for (const Frame& frame : frames) {
    if (frame.header.id == id) {
      return &frame;
    }
  }
  return nullptr;
}

Ping at_time(Ping ping, TimeUs t_us) {
  ping.t_transmit_us = t_us;
  ping.t_receive_us = t_us + 10'000;
  return ping;
}

/// Altitude that an autopilot's own decoder reads; -1: none.
std::int64_t altitude_um(const Bytes& bytes) {
  leadline::hal::MavlinkCodec codec({});
  std::int64_t altitude_um = -1;
  for (const std::uint8_t byte : bytes) {
    NavSample sample{};
    for (bool got = codec.feed(byte, 0, sample); got; got = codec.next(sample)) {
      if ((sample.fields & leadline::base::kNavAltitude) != 0) {
        altitude_um = sample.altitude_um;
      }
    }
  }
  return altitude_um;
}

TEST(heartbeats_come_every_second_and_only_where_asked_for) {
  AutopilotFeed feed = feed_of(feed_config());
  assert_int_equal(sent(feed, 0, 0).size(), 0);
  int beats = 0;
  std::uint8_t sequence = 0;
  for (TimeUs t_us = 0; t_us < 10'000'000; t_us += 20'000) {
    for (const Frame& frame : frames_of(sent(feed, t_us))) {
      assert_int_equal(frame.header.id, kMavHeartbeat);
      assert_int_equal(frame.header.sequence, sequence++);
      assert_int_equal(frame.header.system, 1);
      ++beats;
    }
  }
  assert_int_equal(beats, 10);
  assert_int_equal(feed.frames(), 10);
  VehicleConfig silent = feed_config();
  silent.ports[kAutopilot].switches = 0;
  AutopilotFeed none = feed_of(silent);
  assert_int_equal(sent(none, 0).size(), 0);
  VehicleConfig other = feed_config();
  other.ports[kAutopilot].address = 42;
  AutopilotFeed named = feed_of(other);
  assert_int_equal(frames_of(sent(named, 0))[0].header.system, 42);
}

TEST(the_distance_below_is_along_the_down_axis_from_the_reference_point) {
  VehicleConfig config = feed_config();
  config.mounts[0].lever_arm_mm[2] = 500;
  AutopilotFeed feed = feed_of(config);
  feed.take(at_time(ping_along(0, 90, 12.34), 1'000'000));
  Bytes bytes = sent(feed, 1'020'000);
  assert_int_equal(altitude_um(bytes), 12'840'000);
  const auto frames = frames_of(bytes);
  const Frame* distance = find(frames, kMavDistanceSensor);
  assert_int_equal(distance->u16(4), 50);  // least and most of the model's ranges
  assert_int_equal(distance->u16(6), 6000);
  assert_int_equal(leadline::hal::read_u32_le(&distance->bytes[10]), 1000);
  // Said once.
  assert_int_equal(altitude_um(sent(feed, 1'200'000)), -1);
  // Of a fan the beam next to the axis; one 14 degrees off counts when it is alone, at its cosine.
  for (const double angle_deg : {76.0, 89.0, 95.0}) {
    feed.take(at_time(ping_along(90, angle_deg, 20.0), 2'000'000));
  }
  assert_in_range(altitude_um(sent(feed, 2'020'000)), 20'490'000, 20'500'000);
  feed.take(at_time(ping_along(90, 76, 20.0), 3'000'000));
  assert_in_range(altitude_um(sent(feed, 3'020'000)), 19'900'000, 19'910'000);
  // 16 degrees off is not below; no echo is nothing; an old one is no news.
  feed.take(at_time(ping_along(90, 74, 20.0), 4'000'000));
  Ping silent = at_time(ping_along(0, 90, 20.0), 4'000'000);
  silent.kind = ReturnKind::kNoReturn;
  feed.take(silent);
  assert_int_equal(altitude_um(sent(feed, 4'020'000)), -1);
  feed.take(at_time(ping_along(0, 90, 20.0), 4'500'000));
  assert_int_equal(altitude_um(sent(feed, 6'000'000)), -1);
  // A range that no head has is not passed on.
  feed.take(at_time(ping_along(0, 90, -3.0), 7'000'000));
  assert_int_equal(altitude_um(sent(feed, 7'020'000)), -1);
}

TEST(a_head_that_is_mounted_askew_looks_where_the_body_does) {
  VehicleConfig config = feed_config();
  config.mounts[0].boresight = {0, bam(-90), 0};  // its forward is the body's down
  AutopilotFeed feed = feed_of(config);
  feed.take(at_time(ping_along(0, 0, 7.0), 1'000'000));
  assert_int_equal(altitude_um(sent(feed, 1'000'000)), 7'000'000);
}

TEST(distances_go_out_ten_times_a_second_at_most) {
  AutopilotFeed feed = feed_of(feed_config());
  int distances = 0;
  for (TimeUs t_us = 0; t_us < 2'000'000; t_us += 20'000) {
    feed.take(at_time(ping_along(0, 90, 5.0), t_us));
    distances += altitude_um(sent(feed, t_us)) > 0 ? 1 : 0;
  }
  assert_int_equal(distances, 20);
}

std::uint16_t direction_cm(AutopilotFeed& feed, TimeUs now_us, std::size_t number) {
  const auto frames = frames_of(sent(feed, now_us));
  const Frame* obstacles = find(frames, kMavObstacleDistance);
  assert_non_null(obstacles);
  return obstacles->u16(8 + 2 * number);
}

TEST(a_scanner_tells_the_nearest_obstacle_in_each_direction) {
  VehicleConfig config = feed_config();
  config.mounts[0].lever_arm_mm[0] = 1000;
  AutopilotFeed feed = feed_of(config);
  // Half a turn of a scanner, 2 degrees a step: 10 m away, but for something near at 90 degrees.
  TimeUs t_us = 1'000'000;
  for (int angle = 0; angle <= 180; angle += 2) {
    feed.take(at_time(ping_along(angle, 0, angle == 90 ? 4.0 : 10.0), t_us));
    t_us += 10'000;
  }
  const auto frames = frames_of(sent(feed, t_us));
  const Frame* obstacles = find(frames, kMavObstacleDistance);
  assert_int_equal(obstacles->u16(8), 1100);          // ahead, from the reference point
  assert_int_equal(obstacles->u16(8 + 2 * 36), 900);  // astern
  assert_int_equal(obstacles->u16(8 + 2 * 50), kMavNoDistance_cm);
  // 4 m to starboard of a head that sits 1 m ahead: 76 degrees, 4.12 m.
  assert_int_equal(obstacles->u16(8 + 2 * 15), 412);
  assert_int_equal(obstacles->u16(152), 50);
  assert_int_equal(obstacles->u16(154), 6000);
  assert_int_equal(obstacles->bytes[obstacles->header.payload_offset + 157], 5);
  assert_int_equal(obstacles->bytes[obstacles->header.payload_offset + 166], 12);
  // It has gone away: the next look at that direction says so, the others stay.
  feed.take(at_time(ping_along(74, 0, 10.0), t_us + 1'000'000));
  feed.take(at_time(ping_along(80, 0, 10.0), t_us + 1'010'000));
  assert_in_range(direction_cm(feed, t_us + 1'100'000, 14), 1000, 1060);
  assert_in_range(direction_cm(feed, t_us + 1'300'000, 15), 1000, 1060);
  assert_int_equal(direction_cm(feed, t_us + 1'500'000, 0), 1100);
  // A look without an echo is not an obstacle, nor is one out of reach, nor what is a minute old.
  Ping silent = at_time(ping_along(0, 0, 1.0), t_us + 2'000'000);
  silent.kind = ReturnKind::kNoReturn;
  feed.take(silent);
  assert_int_equal(direction_cm(feed, t_us + 2'000'000, 0), kMavNoDistance_cm);
  feed.take(at_time(ping_along(180, 0, 80.0), t_us + 2'100'000));
  assert_int_equal(direction_cm(feed, t_us + 2'300'000, 36), kMavNoDistance_cm);
  assert_null(find(frames_of(sent(feed, t_us + 70'000'000)), kMavObstacleDistance));
  // What looks down 16 degrees is not around.
  feed.take(at_time(ping_along(120, 16, 5.0), t_us + 70'000'000));
  assert_null(find(frames_of(sent(feed, t_us + 70'100'000)), kMavObstacleDistance));
}

TEST(what_finds_no_room_waits) {
  AutopilotFeed feed = feed_of(feed_config());
  feed.take(at_time(ping_along(0, 90, 5.0), 0));
  feed.take(at_time(ping_along(90, 0, 6.0), 0));
  assert_int_equal(sent(feed, 0, kAutopilot, 10).size(), 0);
  assert_int_equal(feed.frames(), 0);
  assert_int_equal(frames_of(sent(feed, 20'000, kAutopilot, 80)).size(), 2);
  assert_int_equal(frames_of(sent(feed, 40'000)).size(), 1);
  // And 256 bytes hold all three.
  feed.take(at_time(ping_along(0, 90, 5.0), 1'900'000));
  assert_int_equal(frames_of(sent(feed, 2'000'000)).size(), 3);
}

// ---- The whole vehicle -----------------------------------------------------------------------------

Vehicle vehicle;

TEST(a_vehicle_tells_its_autopilot_and_a_replay_tells_the_same) {
  const VehicleConfig config = feed_config();
  leadline::test::configure_rig(vehicle, config);
  leadline::test::RigOptions options;
  options.seconds = 10;
  Bytes told;
  const auto recording = leadline::test::fly(
      vehicle, options,
      [&](const leadline::test::RecordedCycle&, const leadline::firmware::CycleOutput& output) {
        const auto& span = output.device_requests[kAutopilot];
        told.insert(told.end(), span.data, span.data + span.size_bytes);
      });
  std::map<std::uint32_t, int> counts;
  for (const Frame& frame : frames_of(told)) {
    ++counts[frame.header.id];
  }
  assert_int_equal(counts[kMavHeartbeat], 10);
  assert_in_range(counts[kMavDistanceSensor], 70, 100);  // of a head that pings at 10 Hz
  assert_true(vehicle.counters().autopilot_frames ==
              static_cast<std::uint64_t>(counts[kMavHeartbeat] + counts[kMavDistanceSensor]));
  assert_in_range(altitude_um(told), 13'000'000, 19'000'000);

  leadline::test::configure_rig(vehicle, config);
  Bytes again;
  for (const auto& cycle : recording) {
    const auto output = leadline::test::run_cycle(vehicle, cycle);
    const auto& span = output.device_requests[kAutopilot];
    again.insert(again.end(), span.data, span.data + span.size_bytes);
  }
  assert_true(again == told);
}

}  // namespace
