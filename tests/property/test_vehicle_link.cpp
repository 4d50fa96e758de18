// What a vehicle says on its link and when: batches of cells, hellos, statuses, texts.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "proto/messages.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::CycleOutput;
using leadline::firmware::Driver;
using leadline::firmware::InputChunk;
using leadline::firmware::kMaxPorts;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::proto::MessageType;
using leadline::test::configure_rig;
using leadline::test::drain;
using leadline::test::fly;
using leadline::test::RecordedCycle;
using leadline::test::rig_bottom_m;
using leadline::test::rig_config;
using leadline::test::RigOptions;
using leadline::test::RigReceiver;

constexpr double kPi = 3.14159265358979323846;

Vehicle vehicle;

/// Every message of a downlink, with the time of its cycle.
class Listener {
 public:
  struct Heard {
    TimeUs t_us;
    std::vector<std::uint8_t> payload;
  };

  void take(TimeUs t_us, const CycleOutput& output) {
    for (std::size_t i = 0; i < output.downlink.size_bytes; ++i) {
      leadline::proto::FrameView frame{};
      if (decoder_.decoder().feed(output.downlink.data[i], frame)) {
        heard_.push_back({t_us, {frame.payload, frame.payload + frame.payload_bytes}});
      }
    }
  }
  [[nodiscard]] std::vector<Heard> of(MessageType type) const {
    std::vector<Heard> found;
    for (const Heard& heard : heard_) {
      if (heard.payload[0] == static_cast<std::uint8_t>(type)) {
        found.push_back(heard);
      }
    }
    return found;
  }

 private:
  leadline::proto::FrameDecoderBuffer<> decoder_;
  std::vector<Heard> heard_;
};

/// Cycles of 20 ms without a device's word.
void idle(Listener* listener, TimeUs* t_us, TimeUs until_us,
          const std::vector<InputChunk>& chunks = {}) {
  bool first = true;
  for (; *t_us < until_us; *t_us += 20'000) {
    CycleOutput output{};
    vehicle.cycle({*t_us, chunks.data(), first ? chunks.size() : 0, 100'000}, output);
    listener->take(*t_us, output);
    first = false;
  }
}

TEST(changes_wait_for_others_and_all_arrive) {
  double bytes_per_cell[2] = {};
  for (const std::uint32_t age_us : {0U, 1'500'000U}) {
    VehicleConfig config = rig_config();
    config.link.max_tile_age_us = age_us;
    configure_rig(vehicle, config);
    RigReceiver receiver(leadline::proto::survey_tag(config.survey_id, config.session));
    const auto sink = [&](const RecordedCycle&, const CycleOutput& output) {
      receiver.take(output.downlink.data, output.downlink.size_bytes);
    };
    TimeUs t_us = fly(vehicle, RigOptions{}, sink).back().t_us;
    assert_true(drain(vehicle, t_us, 500, sink));
    assert_true(receiver.hash(vehicle.model().grid().tile_count()) == vehicle.cells_hash());
    const auto& counters = vehicle.counters();
    const double wait_s = 1e-3 * static_cast<double>(counters.cell_wait_ms) /
                          static_cast<double>(counters.cells_changed);
    // The link is fast: nobody waits for longer than that, but for a tick of ages and a cycle.
    assert_true(wait_s <= 1e-6 * age_us + 0.06);
    assert_true(age_us == 0 || wait_s > 0.5);
    bytes_per_cell[age_us == 0 ? 0 : 1] =
        static_cast<double>(counters.delta_bytes) / static_cast<double>(counters.cells_changed);
  }
  assert_true(bytes_per_cell[1] < 0.6 * bytes_per_cell[0]);
}

TEST(hellos_come_rarer_and_rarer_and_on_request) {
  VehicleConfig config = rig_config();
  config.link.hello_interval_us = 10'000'000;
  configure_rig(vehicle, config);
  Listener listener;
  TimeUs t_us = 0;
  idle(&listener, &t_us, 36'000'000);
  const auto hellos = listener.of(MessageType::kHello);
  const std::vector<TimeUs> due_s = {0, 1, 3, 7, 15, 25, 35};
  assert_int_equal(hellos.size(), due_s.size());
  for (std::size_t i = 0; i < due_s.size(); ++i) {
    assert_true(hellos[i].t_us == due_s[i] * 1'000'000);
  }
  // Three who ask at once get one; for who asks while it is under way (30 ms on this line) it is the answer.
  std::uint8_t frame[8];
  const std::uint8_t request = static_cast<std::uint8_t>(MessageType::kHelloRequest);
  const std::size_t size = leadline::proto::encode_frame(&request, 1, frame, sizeof frame).value();
  const InputChunk asked = {t_us, frame, static_cast<std::uint16_t>(size),
                            leadline::firmware::kUplinkPort};
  idle(&listener, &t_us, 36'040'000, {asked, asked, asked});
  idle(&listener, &t_us, 36'500'000, {asked});
  idle(&listener, &t_us, 38'000'000, {asked});
  const auto after = listener.of(MessageType::kHello);
  assert_int_equal(after.size(), due_s.size() + 2);
  assert_true(after[7].t_us == 36'000'000);
  assert_true(after[8].t_us == 36'500'000);
  assert_int_equal(vehicle.counters().uplink_rejected, 0);
}

// Whoever asks without end, in every cycle: half of the link at most, and yet an answer whenever the one before is lost.
TEST(hellos_on_request_take_half_of_the_link_at_most) {
  for (const std::uint32_t rate_bytes_s : {120U, 960U, 11'520U, 100'000U}) {
    VehicleConfig config = rig_config();
    config.link.rate_bytes_s = rate_bytes_s;
    configure_rig(vehicle, config);
    Listener listener;
    TimeUs t_us = 0;
    std::uint8_t frame[8];
    const std::uint8_t request = static_cast<std::uint8_t>(MessageType::kHelloRequest);
    const std::size_t size =
        leadline::proto::encode_frame(&request, 1, frame, sizeof frame).value();
    const InputChunk asked = {0, frame, static_cast<std::uint16_t>(size),
                              leadline::firmware::kUplinkPort};
    while (t_us < 30'000'000) {
      idle(&listener, &t_us, t_us + 20'000, {asked});
    }
    const auto hellos = listener.of(MessageType::kHello);
    const double hello_bytes = static_cast<double>(hellos[0].payload.size()) + 7.0;
    const double share = static_cast<double>(hellos.size() - 1) * hello_bytes / 30.0 / rate_bytes_s;
    assert_in_range(static_cast<int>(1000.0 * share), 0, 520);
    TimeUs longest_us = 0;
    for (std::size_t k = 1; k < hellos.size(); ++k) {
      longest_us = std::max(longest_us, hellos[k].t_us - hellos[k - 1].t_us);
    }
    // Its own time twice, and that of a status before it.
    assert_in_range(longest_us, 20'000,
                    60'000 + static_cast<TimeUs>(4e6 * hello_bytes) / rate_bytes_s);
  }
}

TEST(a_status_fits_the_mtu_with_as_many_ports_as_it_has_room_for) {
  int most_ports = 0;
  int least_ports = kMaxPorts;
  for (int mtu = 128; mtu <= 256; mtu += 4) {
    VehicleConfig config = rig_config();
    config.link.mtu_bytes = static_cast<std::uint16_t>(mtu);
    config.port_count = kMaxPorts;
    for (int port = 2; port < kMaxPorts; ++port) {
      config.ports[port] = config.ports[leadline::test::kRigNavigation];
    }
    configure_rig(vehicle, config);
    Listener listener;
    TimeUs t_us = 0;
    const std::vector<std::uint8_t> noise(40'000, 'x');
    const InputChunk chunk = {0, noise.data(), 40'000, 3};
    idle(&listener, &t_us, 100'000, {chunk});
    idle(&listener, &t_us, 40'000'000);
    const auto briefs = listener.of(MessageType::kBrief);
    const auto full = listener.of(MessageType::kStatus);
    assert_int_equal(briefs.size() + full.size(), 40);
    assert_int_equal(full.size(), 3);
    for (const auto& heard : full) {
      assert_true(leadline::proto::frame_bound_bytes(heard.payload.size()) <=
                  static_cast<std::size_t>(mtu));
      const auto status =
          leadline::proto::decode_status(heard.payload.data(), heard.payload.size());
      assert_true(status.ok());
      most_ports = std::max<int>(most_ports, status.value().port_count);
      least_ports = std::min<int>(least_ports, status.value().port_count);
    }
  }
  assert_true(least_ports < 6);
  assert_int_equal(most_ports, kMaxPorts);
}

TEST(statuses_take_a_sixteenth_of_a_slow_link_at_most) {
  VehicleConfig config = rig_config();
  config.link.rate_bytes_s = 100;
  configure_rig(vehicle, config);
  Listener listener;
  TimeUs t_us = 0;
  idle(&listener, &t_us, 400'000'000);
  std::size_t bytes = 0;
  for (const MessageType type : {MessageType::kStatus, MessageType::kBrief}) {
    for (const auto& heard : listener.of(type)) {
      bytes += heard.payload.size() + 7;
    }
  }
  assert_true(bytes > 2000 && bytes < 2700);  // 400 s * 100 / 16
}

TEST(a_brief_says_where_the_beam_points_until_nothing_is_mapped) {
  configure_rig(vehicle, rig_config());
  Listener listener;
  RigOptions options;
  options.roll_deg = 20.0;
  options.echo_until_s = 30.0;
  fly(vehicle, options, [&](const RecordedCycle& cycle, const CycleOutput& output) {
    listener.take(cycle.t_us, output);
  });
  int to_port = 0;
  int to_starboard = 0;
  for (const auto& heard : listener.of(MessageType::kBrief)) {
    const auto brief = leadline::proto::decode_brief(heard.payload.data(), heard.payload.size());
    assert_true(brief.ok());
    const double t_s = 1e-6 * static_cast<double>(heard.t_us);
    const leadline::proto::Swath& swath = brief.value().swath;
    if (t_s > 33.0) {
      assert_int_equal(swath.beam_count, 0);
    }
    if (swath.beam_count == 0) {
      assert_true(t_s < 3.0 || t_s > 30.0);
      continue;
    }
    // A single beam; it ends at the bottom, within a step of its angles and of its range.
    assert_int_equal(swath.beam_count, 1);
    const leadline::proto::BeamOfNow& beam = swath.beams[0];
    const double depression = beam.depression_bam8 * 2.0 * kPi / 256.0;
    const double azimuth = beam.azimuth_bam8 * 2.0 * kPi / 256.0;
    const double out_m = 0.1 * beam.range_dm * std::cos(depression);
    const double down_m =
        0.01 * brief.value().position_cm[2] + 0.1 * beam.range_dm * std::sin(depression);
    const double north_m = 0.01 * brief.value().position_cm[0] + out_m * std::cos(azimuth);
    const double east_m = 0.01 * brief.value().position_cm[1] + out_m * std::sin(azimuth);
    assert_true(std::fabs(down_m - rig_bottom_m(north_m, east_m)) < 2.5);
    // Starboard down turns a beam that looks down to port.
    const double roll = std::sin(2.0 * kPi * t_s / 5.0);
    if (std::fabs(roll) > 0.7) {
      const double heading = 10.0 * kPi / 180.0;
      assert_true(std::sin(azimuth - heading) * roll < 0.0);
      ++(roll > 0.0 ? to_port : to_starboard);
    }
  }
  assert_true(to_port > 3 && to_starboard > 3);
}

TEST(leaving_the_grid_at_every_turn_is_said_once) {
  VehicleConfig config = rig_config();
  config.model.origin_mm[0] += 24'000;  // lines lead across the border
  configure_rig(vehicle, config);
  Listener listener;
  RigOptions options;
  options.seconds = 120;
  int outside = 0;
  std::uint32_t before = 0;
  fly(vehicle, options, [&](const RecordedCycle& cycle, const CycleOutput& output) {
    listener.take(cycle.t_us, output);
    const std::uint32_t now = vehicle.counters().alarms & leadline::proto::kAlarmOutsideGrid;
    outside += now != 0 && before == 0 ? 1 : 0;
    before = now;
  });
  assert_true(outside >= 2);
  int said = 0;
  for (const auto& heard : listener.of(MessageType::kText)) {
    const auto text = leadline::proto::decode_text(heard.payload.data(), heard.payload.size());
    assert_true(text.ok());
    said += std::string(text.value().text, text.value().size_bytes) == "Outside the grid" ? 1 : 0;
  }
  assert_int_equal(said, 1);
}

}  // namespace
