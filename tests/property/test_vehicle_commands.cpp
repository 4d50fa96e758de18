// What commands bring about in a vehicle once they are authenticated, what it answers, and that a log of it replays.
#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "firmware/pipeline/command_event.hpp"
#include "proto/commands.hpp"
#include "proto/messages.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::CommandEvent;
using leadline::firmware::CommandEventKind;
using leadline::firmware::CommandRefusal;
using leadline::firmware::CycleOutput;
using leadline::firmware::kCommandPort;
using leadline::firmware::kUplinkPort;
using leadline::firmware::PingLoss;
using leadline::firmware::Vehicle;
using leadline::proto::Command;
using leadline::proto::CommandKind;
using leadline::proto::CommandParameter;
using leadline::proto::CommandResult;
using leadline::proto::MessageType;
using leadline::test::configure_rig;
using leadline::test::drain;
using leadline::test::fly;
using leadline::test::RecordedCycle;
using leadline::test::Recording;
using leadline::test::rig_config;
using leadline::test::RigOptions;

Vehicle vehicle;
using Bytes = std::vector<std::uint8_t>;

constexpr std::uint32_t kKey = 77;

/// The event of an authenticated command; the tag of result r is r, r, ...
Bytes event_of(CommandEventKind kind, std::uint64_t counter, const Bytes& body = {}) {
  CommandEvent event{};
  event.kind = kind;
  event.key_id = kKey;
  event.counter = counter;
  for (std::size_t result = 0; result < leadline::proto::kCommandResults; ++result) {
    std::memset(event.answer_tags[result], static_cast<int>(result),
                sizeof event.answer_tags[result]);
  }
  event.body = body.data();
  event.body_bytes = body.size();
  Bytes bytes(leadline::firmware::kMaxCommandEvent_bytes);
  bytes.resize(encode_command_event(event, bytes.data(), bytes.size()));
  assert_true(!bytes.empty());
  return bytes;
}

Bytes body_of(const Command& command) {
  Bytes bytes(leadline::proto::kMaxCommandBody_bytes);
  bytes.resize(encode_command_body(command, bytes.data(), bytes.size()).value());
  return bytes;
}

Command of_kind(CommandKind kind) {
  Command command{};
  command.kind = kind;
  return command;
}

Command set_of(CommandParameter parameter, std::int32_t value) {
  Command command = of_kind(CommandKind::kSet);
  command.parameter = parameter;
  command.value = value;
  return command;
}

/// Everything that went down.
class Listener {
 public:
  void take(const CycleOutput& output) {
    for (std::size_t i = 0; i < output.downlink.size_bytes; ++i) {
      leadline::proto::FrameView frame{};
      if (decoder_.decoder().feed(output.downlink.data[i], frame)) {
        heard_.emplace_back(frame.payload, frame.payload + frame.payload_bytes);
      }
    }
  }
  [[nodiscard]] std::vector<Bytes> of(MessageType type) const {
    std::vector<Bytes> found;
    for (const Bytes& heard : heard_) {
      if (heard[0] == static_cast<std::uint8_t>(type)) {
        found.push_back(heard);
      }
    }
    return found;
  }
  [[nodiscard]] std::vector<std::string> texts() const {
    std::vector<std::string> found;
    for (const Bytes& payload : of(MessageType::kText)) {
      const auto text = leadline::proto::decode_text(payload.data(), payload.size());
      found.emplace_back(text.value().text, text.value().size_bytes);
    }
    return found;
  }
  [[nodiscard]] bool said(const std::string& text) const {
    bool found = false;
    for (const std::string& each : texts()) {
      found = found || each == text;
    }
    return found;
  }

 private:
  leadline::proto::FrameDecoderBuffer<> decoder_;
  std::vector<Bytes> heard_;
};

/// A configured vehicle at rest, told one thing a cycle.
class Rest {
 public:
  Rest() { configure_rig(vehicle, rig_config()); }
  explicit Rest(const leadline::firmware::VehicleConfig& config) { configure_rig(vehicle, config); }

  void cycle(std::uint8_t port = 0, const Bytes& bytes = {}) {
    t_us_ += 20'000;
    RecordedCycle cycle{t_us_, 100'000, {}};
    if (!bytes.empty()) {
      cycle.chunks.push_back({port, t_us_, bytes});
    }
    recording_.push_back(cycle);
    listener_.take(run_cycle(vehicle, recording_.back()));
  }
  void cycles(int count) {
    for (int i = 0; i < count; ++i) {
      cycle();
    }
  }
  /// The answer to a command, which has to come within a second.
  CommandResult order(const Command& command) { return order(body_of(command)); }
  CommandResult order(const Bytes& body) {
    ++counter_;
    return answer_to(event_of(CommandEventKind::kCommand, counter_, body));
  }
  CommandResult answer_to(const Bytes& event) {
    const std::size_t before = listener_.of(MessageType::kCommandAnswer).size();
    cycle(kCommandPort, event);
    for (int i = 0; i < 50 && listener_.of(MessageType::kCommandAnswer).size() == before; ++i) {
      cycle();
    }
    const std::vector<Bytes> answers = listener_.of(MessageType::kCommandAnswer);
    assert_int_equal(answers.size(), before + 1);
    const auto answer =
        leadline::proto::decode_command_answer(answers.back().data(), answers.back().size());
    assert_true(answer.ok());
    assert_int_equal(answer.value().key_id, kKey);
    assert_true(answer.value().counter == counter_);
    assert_int_equal(answer.value().tag[0], static_cast<int>(answer.value().result));
    assert_int_equal(answer.value().tag[7], static_cast<int>(answer.value().result));
    return answer.value().result;
  }

  std::uint64_t counter_ = 0;
  Listener listener_;
  Recording recording_;

 private:
  TimeUs t_us_ = 0;
};

void expect(CommandResult is, CommandResult should_be) {
  assert_int_equal(static_cast<int>(is), static_cast<int>(should_be));
}

TEST(parameters_change_within_their_ranges_and_nowhere_else) {
  Rest rest;
  struct Case {
    CommandParameter parameter;
    std::int32_t good;
    std::int32_t low;   // just below what may be
    std::int32_t high;  // just above
  };
  const Case cases[] = {
      {CommandParameter::kLinkRate, 9600, 9, 125'000'001},
      {CommandParameter::kMaxTileAge, 700, -1, 60'001},
      {CommandParameter::kStatusInterval, 500, 0, 3'600'001},
      {CommandParameter::kHelloInterval, 5000, 0, 3'600'001},
      {CommandParameter::kSoundSpeed, 1'480'000, 1'299'999, 1'700'001},
      {CommandParameter::kVoxelBudget, 50'000, -1, 16'777'217},
      {CommandParameter::kTileBudget, 7, 0, 4097},
      {CommandParameter::kMaxWait, 250, -1, 10'001},
      {CommandParameter::kQualityWeight, 60, -1, 101},
      {CommandParameter::kMinRange, 800, -1, 1'000'000},
  };
  assert_int_equal(sizeof cases / sizeof cases[0], leadline::proto::kCommandParameters);
  for (const Case& each : cases) {
    expect(rest.order(set_of(each.parameter, each.low)), CommandResult::kOutOfRange);
    expect(rest.order(set_of(each.parameter, each.high)), CommandResult::kOutOfRange);
    expect(rest.order(set_of(each.parameter, INT32_MIN)), CommandResult::kOutOfRange);
    expect(rest.order(set_of(each.parameter, each.good)), CommandResult::kDone);
  }
  const leadline::firmware::VehicleConfig& config = vehicle.config();
  assert_int_equal(config.link.rate_bytes_s, 9600);
  assert_int_equal(config.link.max_tile_age_us, 700'000);
  assert_int_equal(config.link.status_interval_us, 500'000);
  assert_int_equal(config.link.hello_interval_us, 5'000'000);
  assert_int_equal(config.cycle_voxel_budget, 50'000);
  assert_int_equal(config.cycle_tile_budget, 7);
  assert_int_equal(config.navigation.max_wait_us, 250'000);
  assert_int_equal(config.ports[0].quality_weight_percent, 60);
  assert_int_equal(vehicle.counters().commands_done, leadline::proto::kCommandParameters);
  assert_int_equal(vehicle.counters().commands_refused, 3 * leadline::proto::kCommandParameters);
}

TEST(what_this_vehicle_cannot_do_is_refused_with_the_reason) {
  leadline::firmware::VehicleConfig config = rig_config();
  config.water.speed_known = 1;
  config.water.point_count = 1;
  config.water.points[0] = {0, 1'500'000};
  Rest rest(config);
  expect(rest.order(of_kind(CommandKind::kSave)), CommandResult::kNotHere);
  expect(rest.order(set_of(CommandParameter::kSoundSpeed, 1'480'000)), CommandResult::kNotHere);
  Command here = of_kind(CommandKind::kOrigin);
  here.centred = 1;
  expect(rest.order(here), CommandResult::kNoPosition);
  Command far = of_kind(CommandKind::kOrigin);
  far.origin_mm[0] = std::int64_t{1} << 40U;
  expect(rest.order(far), CommandResult::kOutOfRange);
  Command tiles = of_kind(CommandKind::kTiles);
  tiles.tiles = {1'000'000, 1};
  expect(rest.order(tiles), CommandResult::kOutsideGrid);
  Command slice = of_kind(CommandKind::kSlice);
  slice.slice = {leadline::proto::SlicePlane::kNorth, {90, 0, 0}, 10, 7};
  expect(rest.order(slice), CommandResult::kOutsideGrid);
  expect(rest.order(Bytes{99}), CommandResult::kUnknown);
  expect(rest.order(Bytes{2, 0}), CommandResult::kUnknown);  // more behind it than is known
  assert_int_equal(vehicle.counters().commands_done, 0);
  // One slice at a time: on a slow line it waits for its bytes.
  expect(rest.order(set_of(CommandParameter::kLinkRate, 60)), CommandResult::kDone);
  slice.slice.columns = 6;
  expect(rest.order(slice), CommandResult::kDone);
  expect(rest.order(slice), CommandResult::kBusy);
  rest.cycles(500);
  expect(rest.order(slice), CommandResult::kDone);
}

TEST(a_repeated_command_is_answered_again_and_not_done_again) {
  Rest rest;
  expect(rest.order(of_kind(CommandKind::kStop)), CommandResult::kDone);
  expect(rest.answer_to(event_of(CommandEventKind::kRepeated, rest.counter_)),
         CommandResult::kDone);
  assert_int_equal(vehicle.counters().commands_done, 1);
  // Of a life before this one: nobody knows what became of it.
  rest.counter_ = 99;
  expect(rest.answer_to(event_of(CommandEventKind::kRepeated, 99)), CommandResult::kInterrupted);
  expect(rest.answer_to(event_of(CommandEventKind::kRepeated, 99)), CommandResult::kInterrupted);
  assert_int_equal(vehicle.counters().commands_done, 1);
}

TEST(one_command_a_cycle_and_garbage_is_counted) {
  Rest rest;
  RecordedCycle cycle{10'000'000, 100'000, {}};
  for (std::uint64_t counter = 1; counter <= 3; ++counter) {
    cycle.chunks.push_back(
        {kCommandPort, 10'000'000, event_of(CommandEventKind::kCommand, counter, Bytes{2})});
  }
  cycle.chunks.push_back({kCommandPort, 10'000'000, Bytes{1, 2, 3}});
  cycle.chunks.push_back({kCommandPort, 10'000'000, Bytes{}});
  run_cycle(vehicle, cycle);
  assert_int_equal(vehicle.counters().commands_done, 1);
  assert_int_equal(vehicle.counters().chunks_ignored, 4);
}

TEST(without_a_key_every_command_is_refused_and_said_so) {
  Rest rest;
  std::uint8_t payload[leadline::proto::kMaxCommand_bytes] = {};
  const auto size = leadline::proto::encode_command({1, 1, 1}, of_kind(CommandKind::kStop), payload,
                                                    sizeof payload);
  Bytes frame(200);
  frame.resize(leadline::proto::encode_frame(payload, size.value() + 16, frame.data(), frame.size())
                   .value());
  for (int i = 0; i < 100; ++i) {
    rest.cycle(kUplinkPort, frame);
  }
  assert_int_equal(vehicle.counters().commands_dropped, 100);
  assert_int_equal(vehicle.counters().commands_done, 0);
  assert_int_equal(vehicle.counters().uplink_rejected, 0);
  assert_true(rest.listener_.said("Command refused: this vehicle has no key"));
  assert_int_equal(rest.listener_.texts().size(), 2);  // one more: no pose
  assert_true(rest.listener_.of(MessageType::kCommandAnswer).empty());
  // With one, what is not authentic comes as a tally, and is told with the reason.
  CommandEvent tally{};
  tally.kind = CommandEventKind::kTally;
  tally.refused[static_cast<int>(CommandRefusal::kTag)] = 5;
  Bytes bytes(leadline::firmware::kMaxCommandEvent_bytes);
  bytes.resize(encode_command_event(tally, bytes.data(), bytes.size()));
  rest.cycle(kCommandPort, bytes);
  rest.cycle(kUplinkPort, frame);
  assert_int_equal(vehicle.counters().commands_dropped, 105);
  rest.cycles(600);
  assert_true(rest.listener_.said("Command refused: not authentic"));
}

/// A flight that is given `orders`, by seconds; the answers' results in their order.
struct Flight {
  struct Order {
    double at_s;
    Command command;
  };
  std::vector<Order> orders;
  Listener listener;
  Recording recording;

  void run(double seconds) {
    configure_rig(vehicle, rig_config());
    RigOptions options;
    options.seconds = seconds;
    std::size_t next = 0;
    options.tamper = [&](RecordedCycle& cycle) {
      if (next < orders.size() && static_cast<double>(cycle.t_us) >= 1e6 * orders[next].at_s) {
        const Bytes event =
            event_of(CommandEventKind::kCommand, next + 1, body_of(orders[next].command));
        cycle.chunks.push_back({kCommandPort, cycle.t_us, event});
        ++next;
      }
    };
    recording =
        fly(vehicle, options, [this](const RecordedCycle& /*cycle*/, const CycleOutput& output) {
          listener.take(output);
        });
    assert_int_equal(next, orders.size());
  }
  [[nodiscard]] std::vector<CommandResult> results() const {
    std::vector<CommandResult> found;
    for (const Bytes& answer : listener.of(MessageType::kCommandAnswer)) {
      found.push_back(
          leadline::proto::decode_command_answer(answer.data(), answer.size()).value().result);
    }
    return found;
  }
};

TEST(a_stopped_survey_maps_nothing_until_it_goes_on) {
  Flight flight;
  flight.orders = {{10, of_kind(CommandKind::kStop)}, {20, of_kind(CommandKind::kStart)}};
  flight.run(30);
  const auto& counters = vehicle.counters();
  const auto stopped = counters.pings_lost[static_cast<int>(PingLoss::kStopped)];
  assert_in_range(stopped, 80, 110);  // ten seconds at 10 Hz
  std::uint64_t all = counters.pings_mapped + counters.pings_pending;
  for (const std::uint64_t lost : counters.pings_lost) {
    all += lost;
  }
  assert_true(counters.pings_in == all);
  assert_true(flight.listener.said("Survey stopped: nothing is mapped"));
  assert_true(flight.listener.said("Survey goes on"));
}

TEST(a_new_origin_begins_an_empty_map_that_is_never_mixed_with_the_old) {
  Flight flight;
  Command here = of_kind(CommandKind::kOrigin);
  here.centred = 1;
  Command named = of_kind(CommandKind::kStart);
  named.name.size_bytes = 4;
  std::memcpy(named.name.text, "East", 4);
  flight.orders = {{15, here}, {28, named}};
  flight.run(40);
  assert_true(
      (flight.results() == std::vector<CommandResult>{CommandResult::kDone, CommandResult::kDone}));
  assert_int_equal(vehicle.config().session, rig_config().session + 2);
  // Every map has its hello, and deltas of no other tag come behind it.
  std::vector<std::uint16_t> tags;
  for (std::uint32_t i = 0; i < 3; ++i) {
    tags.push_back(leadline::proto::survey_tag(rig_config().survey_id, rig_config().session + i));
  }
  const std::vector<Bytes> hellos = flight.listener.of(MessageType::kHello);
  std::vector<std::uint32_t> sessions;
  std::int64_t origin_mm = 0;
  std::string name;
  for (const Bytes& payload : hellos) {
    const auto hello = leadline::proto::decode_hello(payload.data(), payload.size());
    if (sessions.empty() || sessions.back() != hello.value().session) {
      sessions.push_back(hello.value().session);
    }
    origin_mm = hello.value().origin_mm[0];
    name.assign(hello.value().survey_name.text, hello.value().survey_name.size_bytes);
  }
  assert_int_equal(sessions.size(), 3);
  assert_true(origin_mm != rig_config().model.origin_mm[0]);
  assert_true(origin_mm == vehicle.config().model.origin_mm[0]);
  assert_string_equal(name.c_str(), "East");
  std::size_t at = 0;
  for (const Bytes& payload : flight.listener.of(MessageType::kTileDelta)) {
    const auto tag = static_cast<std::uint16_t>(payload[1] | payload[2] << 8U);
    while (at < tags.size() && tags[at] != tag) {
      ++at;
    }
    assert_true(at < tags.size());  // never back to an older one
  }
  assert_int_equal(at, 2);
  // The map is what the pings since then make of it: as of a vehicle that was so from the start.
  const std::uint64_t map_hash = vehicle.map_hash();
  const std::uint64_t link_hash = vehicle.link_hash();
  const std::uint64_t cells_hash = vehicle.cells_hash();
  assert_true(vehicle.model().grid().tile(0).generation + cells_hash != 0);
  configure_rig(vehicle, rig_config());
  run_recording(vehicle, flight.recording);
  assert_true(vehicle.map_hash() == map_hash);
  assert_true(vehicle.link_hash() == link_hash);
  assert_true(vehicle.cells_hash() == cells_hash);
}

TEST(a_slice_is_what_the_voxels_are) {
  // Where the fullest voxel is.
  Flight before;
  before.orders = {{30, of_kind(CommandKind::kStop)}};
  before.run(31);
  std::uint32_t at[3] = {};
  std::uint16_t most = 0;
  for (std::int32_t n = 0; n < 96; ++n) {
    for (std::int32_t e = 0; e < 96; ++e) {
      const auto& grid = vehicle.model().grid();
      for (std::int32_t d = 0; d < 64; ++d) {
        const std::uint16_t hit = grid.column_voxels(grid.column_index(n, e))[d].hit;
        if (hit > most) {
          most = hit;
          at[0] = static_cast<std::uint32_t>(n);
          at[1] = static_cast<std::uint32_t>(e);
          at[2] = static_cast<std::uint32_t>(d);
        }
      }
    }
  }
  Flight flight;
  Command slice = of_kind(CommandKind::kSlice);
  slice.slice = {leadline::proto::SlicePlane::kNorth, {std::min(at[0], 32U), at[1], 0}, 64, 64};
  Command second = of_kind(CommandKind::kSlice);
  second.slice = {leadline::proto::SlicePlane::kHorizontal,
                  {std::min(at[0], 32U), std::min(at[1], 32U), at[2]},
                  64,
                  64};
  flight.orders = {{30, of_kind(CommandKind::kStop)}, {31, slice}, {33, second}};
  flight.run(36);
  for (const CommandResult result : flight.results()) {
    expect(result, CommandResult::kDone);
  }
  std::uint8_t levels[64 * 64];
  int rows[2] = {0, 0};
  bool surface = false;
  for (const Bytes& payload : flight.listener.of(MessageType::kSlice)) {
    const auto part = leadline::proto::decode_slice(payload.data(), payload.size(), levels);
    assert_true(part.ok());
    assert_true(part.value().request == 2 || part.value().request == 3);
    for (std::uint32_t row = 0; row < part.value().row_count; ++row) {
      for (std::uint32_t column = 0; column < 64; ++column) {
        const auto cell =
            leadline::proto::slice_cell(part.value().box, part.value().first_row + row, column);
        const auto& grid = vehicle.model().grid();
        const auto& voxel =
            grid.column_voxels(grid.column_index(static_cast<std::int32_t>(cell.north),
                                                 static_cast<std::int32_t>(cell.east)))[cell.down];
        const std::uint8_t level = levels[row * 64 + column];
        assert_int_equal(level, leadline::proto::slice_level(voxel.hit, voxel.miss));
        surface = surface || level > 8;
      }
    }
    rows[part.value().request == 2 ? 0 : 1] += part.value().row_count;
  }
  assert_int_equal(rows[0], 64);
  assert_int_equal(rows[1], 64);
  assert_true(surface);
}

TEST(the_link_keeps_to_a_rate_that_changed) {
  Flight flight;
  flight.orders = {{15, set_of(CommandParameter::kLinkRate, 200)}};
  configure_rig(vehicle, rig_config());
  flight.run(40);
  Bytes all;
  configure_rig(vehicle, rig_config());
  std::uint64_t at_20_s = 0;
  for (const RecordedCycle& cycle : flight.recording) {
    run_cycle(vehicle, cycle);
    at_20_s = cycle.t_us <= 20'000'000 ? vehicle.counters().downlink_bytes : at_20_s;
  }
  assert_in_range(vehicle.counters().downlink_bytes - at_20_s, 1000, 20 * 200 + 200);
}

TEST(tiles_that_are_asked_for_come_whole) {
  Command tiles = of_kind(CommandKind::kTiles);
  tiles.tiles = {0, 36};
  std::uint64_t cells_sent[2] = {};
  for (const bool asked : {false, true}) {
    Flight flight;
    flight.orders = {{20, of_kind(CommandKind::kStop)}};
    if (asked) {
      flight.orders.push_back({30, tiles});
    }
    flight.run(31);
    TimeUs t_us = flight.recording.back().t_us;
    assert_true(drain(vehicle, t_us, 3000));
    cells_sent[asked ? 1 : 0] = vehicle.counters().cells_sent;
  }
  std::uint64_t known = 0;
  for (std::uint32_t tile = 0; tile < vehicle.model().grid().tile_count(); ++tile) {
    for (int i = 0; i < leadline::proto::kTileArea_cells; ++i) {
      known += vehicle.link_cells(tile)[i] != leadline::proto::kUnknownCell ? 1U : 0U;
    }
  }
  assert_true(known > 200);
  assert_true(cells_sent[1] >= cells_sent[0] + known);
}

}  // namespace
