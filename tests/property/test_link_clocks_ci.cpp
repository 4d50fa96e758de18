// The vehicle's link and the topside's receiver over a bad line when one of them starts over, its clock steps, or
// a counter wraps; and what goes first where the line is slow. Simulated time.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "host_tools/sim/random.hpp"
#include "host_tools/topside/receiver.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::CycleOutput;
using leadline::firmware::InputChunk;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::host::Random;
using leadline::host::Receiver;
using leadline::proto::MessageType;
using leadline::test::Recording;
using Bytes = std::vector<std::uint8_t>;

constexpr TimeUs kCycle_us = 20'000;
constexpr TimeUs kSecond_us = 1'000'000;
constexpr TimeUs kHour_us = 3600 * kSecond_us;
constexpr TimeUs kYear_us = 365 * 24 * kHour_us;

Vehicle vehicle;

VehicleConfig slow_config(std::uint32_t rate_bytes_s, std::uint32_t session = 7) {
  VehicleConfig config = leadline::test::rig_config();
  config.link.rate_bytes_s = rate_bytes_s;
  config.link.mtu_bytes = 256;
  config.session = session;
  return config;
}

const Recording& flight() {
  static const Recording recording = [] {
    leadline::test::configure_rig(vehicle, leadline::test::rig_config());
    leadline::test::RigOptions options;
    options.seconds = 50;
    options.speed_m_s = 3.0;
    return leadline::test::fly(vehicle, options);
  }();
  return recording;
}

/// One way: loses 30 %, puts 5 % behind the next, doubles 5 %. What is sent arrives a cycle later.
class Way {
 public:
  explicit Way(std::uint64_t seed, bool bad) : random_(seed), bad_(bad) {}
  void send(Bytes frame) {
    const bool lost = random_.uniform() < 0.30;
    const bool late = random_.uniform() < 0.05;
    const bool twice = random_.uniform() < 0.05;
    if (bad_ && lost) {
      return;
    }
    if (bad_ && twice) {
      on_it_.push_back(frame);
    }
    on_it_.push_back(std::move(frame));
    if (bad_ && late_) {
      std::swap(on_it_.back(), on_it_[on_it_.size() > 1 ? on_it_.size() - 2 : 0]);
    }
    late_ = late;
  }
  std::vector<Bytes> receive() { return std::exchange(on_it_, {}); }

 private:
  Random random_;
  bool bad_;
  bool late_ = false;
  std::vector<Bytes> on_it_;
};

/// Both ends, each with a clock of its own.
class Tether {
 public:
  explicit Tether(std::uint64_t seed, bool bad = true)
      : receiver(std::make_unique<Receiver>()), down_(seed, bad), up_(seed + 1000, bad) {}

  /// One cycle of the vehicle, with the devices' words if there are any.
  void step(const leadline::test::RecordedCycle* recorded = nullptr, TimeUs shift_us = 0) {
    real_us += kCycle_us;
    for (const Bytes& frame : down_.receive()) {
      receiver->feed(frame.data(), frame.size());
    }
    const std::vector<Bytes> arrived = up_.receive();
    for (Bytes frame = receiver->uplink(real_us + topside_ahead_us); !frame.empty();
         frame = receiver->uplink(real_us + topside_ahead_us)) {
      up_.send(frame);
    }
    vehicle_us = recorded != nullptr ? recorded->t_us + shift_us : vehicle_us + kCycle_us;
    std::vector<InputChunk> chunks;
    if (recorded != nullptr) {
      for (const auto& chunk : recorded->chunks) {
        chunks.push_back({chunk.t_arrival_us + shift_us, chunk.bytes.data(),
                          static_cast<std::uint16_t>(chunk.bytes.size()), chunk.port});
      }
    }
    for (const Bytes& frame : arrived) {
      chunks.push_back({vehicle_us, frame.data(), static_cast<std::uint16_t>(frame.size()),
                        leadline::firmware::kUplinkPort});
    }
    CycleOutput output{};
    vehicle.cycle({vehicle_us, chunks.data(), chunks.size(), 100'000}, output);
    for (std::size_t i = 0, begin = 0; i < output.downlink.size_bytes; ++i) {
      if (i > begin + 1 && output.downlink.data[i] == leadline::proto::kDelimiter) {
        sent.emplace_back(output.downlink.data + begin, output.downlink.data + i + 1);
        down_.send(sent.back());
        begin = i + 1;
      }
    }
  }
  void fly(const Recording& recording, TimeUs shift_us = 0) {
    for (const auto& cycle : recording) {
      step(&cycle, shift_us);
    }
  }
  [[nodiscard]] bool equal() const {
    return receiver->store() != nullptr && vehicle.drained() &&
           receiver->store()->cells_hash() == vehicle.cells_hash();
  }
  /// Seconds until both hold one map; fails after `most_s`.
  double settle(double most_s) {
    const TimeUs begin_us = real_us;
    while (!equal()) {
      assert_true(1e-6 * static_cast<double>(real_us - begin_us) < most_s);
      for (int i = 0; i < 10; ++i) {  // hashes cost more than cycles
        step();
      }
    }
    return 1e-6 * static_cast<double>(real_us - begin_us);
  }

  std::unique_ptr<Receiver> receiver;
  TimeUs real_us = 0;
  TimeUs vehicle_us = 0;
  TimeUs topside_ahead_us = 0;
  std::vector<Bytes> sent;  ///< frames of the vehicle

 private:
  Way down_;
  Way up_;
};

/// A vehicle that flew, with nobody at the link.
TimeUs flown(std::uint32_t rate_bytes_s, std::uint32_t session = 7) {
  const Recording& recording = flight();
  leadline::test::configure_rig(vehicle, slow_config(rate_bytes_s, session));
  leadline::test::run_recording(vehicle, recording);
  return recording.back().t_us;
}

/// In the middle of the transfer: some tiles came, others did not.
void half_way(Tether* tether) {
  vehicle.restart_link();
  while (tether->receiver->counters().deltas < 6) {
    tether->step();
    assert_true(tether->real_us < kHour_us);
  }
  assert_true(!tether->equal());
}

TEST(a_vehicle_that_starts_over_in_mid_transfer_begins_a_new_map) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    Tether tether(seed);
    tether.vehicle_us = flown(200);
    half_way(&tether);
    int replaced = 0;
    tether.receiver->on_replaced = [&replaced](const auto&) { ++replaced; };
    tether.vehicle_us = flown(200, 8);
    tether.settle(300);
    assert_int_equal(tether.receiver->store()->hello().session, 8);
    assert_int_equal(replaced, 1);
  }
}

TEST(a_clock_of_either_end_that_steps_costs_time_and_no_cell) {
  for (const TimeUs step_us : {kSecond_us, -kSecond_us, kHour_us, -kHour_us, -kYear_us}) {
    for (const bool of_vehicle : {true, false}) {
      Tether tether(static_cast<std::uint64_t>(step_us + 2 * kYear_us));
      tether.real_us = 2 * kYear_us;
      static_cast<void>(flown(200));
      tether.vehicle_us = 2 * kYear_us;
      vehicle.restart_link();
      const TimeUs begin_us = tether.real_us;
      while (tether.receiver->counters().deltas < 6) {
        tether.step();
        assert_true(tether.real_us - begin_us < kHour_us);
      }
      assert_true(!tether.equal());
      const auto clamped = vehicle.counters().cycle_time_clamped;
      (of_vehicle ? tether.vehicle_us : tether.topside_ahead_us) += step_us;
      // The mapping of a vehicle whose clock went back stands still until it is where it was; its link does not.
      const double took_s = tether.settle(120.0);
      std::printf("%s %+.0f s: equal after %.1f s\n", of_vehicle ? "vehicle" : "topside",
                  1e-6 * static_cast<double>(step_us), took_s);
      assert_true((vehicle.counters().cycle_time_clamped > clamped) == (of_vehicle && step_us < 0));
    }
  }
}

/// Cycles of the vehicle that nobody hears, and in which it hears nobody.
void cut(Tether* tether, int cycles) {
  for (int i = 0; i < cycles; ++i) {
    tether->real_us += kCycle_us;
    tether->vehicle_us += kCycle_us;
    CycleOutput output{};
    vehicle.cycle({tether->vehicle_us, nullptr, 0, 100'000}, output);
  }
}

TEST(a_vehicle_that_starts_over_twice_behind_a_cut_tether_begins_one_map) {
  Tether tether(3);
  tether.vehicle_us = flown(400);
  half_way(&tether);
  int replaced = 0;
  tether.receiver->on_replaced = [&replaced](const auto&) { ++replaced; };
  tether.vehicle_us = flown(400, 8);
  cut(&tether, 20);
  tether.vehicle_us = flown(400, 9);
  cut(&tether, 10);
  tether.settle(120);
  assert_int_equal(tether.receiver->store()->hello().session, 9);
  assert_int_equal(replaced, 1);
  assert_int_equal(tether.receiver->counters().other_surveys, 0);
}

// A topside that fails at each hello costs what the hellos cost; the first that lives has the map.
TEST(a_topside_that_starts_over_at_each_hello_does_no_harm) {
  Tether tether(4);
  tether.vehicle_us = flown(400);
  vehicle.restart_link();
  int started = 0;
  while (tether.real_us < 30 * kSecond_us) {
    tether.step();
    if (tether.receiver->counters().hellos > 0) {
      tether.receiver = std::make_unique<Receiver>();
      ++started;
    }
  }
  std::size_t hello_bytes = 0;
  for (const Bytes& frame : tether.sent) {
    hello_bytes += frame[2] == static_cast<std::uint8_t>(MessageType::kHello) ? frame.size() : 0;
  }
  std::printf("started %d times, %zu bytes of hellos in 30 s\n", started, hello_bytes);
  assert_true(started > 10);
  assert_true(hello_bytes < 30 * 400 / 2 + 250);
  tether.settle(120);
}

// Two topsides hear one vehicle, each with losses of its own. Both report, and both have the map; or one is mute, and
// has of it what came once a hello did.
TEST(two_topsides_of_one_vehicle_do_not_stand_in_each_others_way) {
  for (const bool mute : {true, false}) {
    Tether tether(5);
    tether.vehicle_us = flown(400);
    Receiver other;
    Way down(77, true);
    Way up(78, true);
    vehicle.restart_link();
    std::size_t heard = 0;
    const auto equal = [&] {
      return other.store() != nullptr && other.store()->cells_hash() == vehicle.cells_hash();
    };
    while (!tether.equal() || other.store() == nullptr || (!mute && !equal())) {
      assert_true(tether.real_us < 300 * kSecond_us);
      for (int i = 0; i < 10; ++i) {
        for (; heard < tether.sent.size(); ++heard) {
          down.send(tether.sent[heard]);
        }
        for (const Bytes& frame : down.receive()) {
          other.feed(frame.data(), frame.size());
        }
        for (Bytes frame = other.uplink(tether.real_us); !mute && !frame.empty();
             frame = other.uplink(tether.real_us)) {
          up.send(frame);
        }
        leadline::test::RecordedCycle cycle{tether.vehicle_us + kCycle_us, 100'000, {}};
        for (Bytes& frame : up.receive()) {
          cycle.chunks.push_back({leadline::firmware::kUplinkPort, cycle.t_us, std::move(frame)});
        }
        tether.step(&cycle);
      }
    }
    std::printf("%s: equal after %.1f s; the other has %u of %u tiles, %u not whole\n",
                mute ? "one is mute" : "both report", 1e-6 * static_cast<double>(tether.real_us),
                other.store()->known_tiles(), tether.receiver->store()->known_tiles(),
                other.store()->tiles_incomplete());
    assert_true(other.store()->known_tiles() >= tether.receiver->store()->known_tiles() / 2);
  }
}

// t_ms of the brief wraps after 49 days; the ages of tiles after 4.4 years; both while the map grows.
TEST(times_that_wrap_in_a_flight_change_no_cell) {
  std::uint64_t hash = 0;
  for (const TimeUs wrap_us :
       {TimeUs{0}, (TimeUs{1} << 32) * 1000, TimeUs{1} << 47, (TimeUs{1} << 47) * 3}) {
    Tether tether(5);
    leadline::test::configure_rig(vehicle, slow_config(960));
    const Recording& recording = flight();
    const TimeUs shift_us = wrap_us == 0 ? 0 : wrap_us - recording.back().t_us / 2;
    tether.fly(recording, shift_us);
    assert_true(wrap_us == 0 || (recording.front().t_us + shift_us < wrap_us &&
                                 recording.back().t_us + shift_us > wrap_us));
    tether.settle(120);
    assert_true(tether.receiver->counters().deltas > 50);
    hash = hash == 0 ? vehicle.map_hash() : hash;
    assert_true(vehicle.map_hash() == hash);
  }
}

// Epochs of tiles count modulo 256; the ledger's frames and tiles go round many times.
TEST(a_link_that_is_restarted_300_times_still_converges) {
  Tether tether(9);
  tether.vehicle_us = flown(4000);
  for (int k = 0; k < 300; ++k) {
    vehicle.restart_link();
    for (int i = 0; i < 10; ++i) {
      tether.step();
    }
  }
  assert_true(tether.sent.size() > 4 * leadline::firmware::LinkLedger::kFrames);
  tether.receiver = std::make_unique<Receiver>();
  vehicle.restart_link();
  tether.settle(120);
}

TEST(generations_that_wrap_are_newer_than_those_before) {
  Tether tether(11, false);
  tether.vehicle_us = flown(4000);
  vehicle.restart_link();
  tether.settle(60);
  leadline::host::TileStore store(tether.receiver->store()->hello());
  std::int32_t depth_q8 = 1024;
  for (const std::uint32_t generation : {UINT32_MAX - 1, UINT32_MAX, 0U, 1U}) {
    leadline::proto::TileDelta delta{};
    delta.tile = 3;
    delta.generation = generation;
    delta.changed.set(5);
    delta.cell_count = 1;
    depth_q8 += 256;
    delta.cells[5] = leadline::proto::code_cell(depth_q8, 1024, 0);
    static_cast<void>(store.apply(delta));
    assert_int_equal(store.tile(3)->cells[5], delta.cells[5]);
    assert_int_equal(store.tile(3)->generation, generation);
    // One from before, late: it changes nothing.
    leadline::proto::TileDelta late = delta;
    late.generation = generation - 1;
    late.cells[5] = leadline::proto::code_cell(512, 1024, 0);
    static_cast<void>(store.apply(late));
    assert_int_equal(store.tile(3)->cells[5], delta.cells[5]);
    assert_int_equal(store.tile(3)->generation, generation);
  }
}

TEST(an_uplink_of_unknown_type_or_without_sense_is_counted) {
  const TimeUs t_us = flown(4000);
  const Bytes payloads[] = {{0x7F}, {0x3F, 1, 2}, {0x42}, {0x44, 0, 0, 0, 0}};
  for (const Bytes& payload : payloads) {
    std::uint8_t frame[32];
    const auto size =
        leadline::proto::encode_frame(payload.data(), payload.size(), frame, sizeof frame);
    const InputChunk chunk{t_us, frame, static_cast<std::uint16_t>(size.value()),
                           leadline::firmware::kUplinkPort};
    const auto before = vehicle.counters();
    CycleOutput output{};
    vehicle.cycle({t_us, &chunk, 1, 100'000}, output);
    assert_int_equal(vehicle.counters().uplink_rejected, before.uplink_rejected + 1);
    assert_int_equal(vehicle.counters().uplink_frames, before.uplink_frames + 1);
  }
}

TEST(a_topside_of_another_major_is_refused_and_spoken_of) {
  Tether tether(1, false);
  tether.vehicle_us = flown(4000);
  tether.settle(60);
  // A second after a hello that nobody asked for: the next of these is due in nine.
  const auto type_of = [](const Bytes& frame) { return static_cast<MessageType>(frame[2]); };
  while (tether.real_us < 20 * kSecond_us || type_of(tether.sent.back()) != MessageType::kHello) {
    tether.step();
    assert_true(tether.real_us < 60 * kSecond_us);
  }
  for (int i = 0; i < 55; ++i) {
    tether.step();
  }
  struct Heard {
    int hellos;
    bool alarm;
    std::string texts;
  };
  const auto after = [&](const Bytes& payload, TimeUs for_us) {
    std::uint8_t frame[32];
    const auto size =
        leadline::proto::encode_frame(payload.data(), payload.size(), frame, sizeof frame);
    leadline::test::RecordedCycle asked{tether.vehicle_us + kCycle_us, 100'000, {}};
    asked.chunks.push_back(
        {leadline::firmware::kUplinkPort, asked.t_us, Bytes(frame, frame + size.value())});
    tether.sent.clear();
    tether.step(&asked);
    const TimeUs until_us = tether.real_us + for_us;
    while (tether.real_us < until_us) {
      tether.step();
    }
    Heard heard{0, (vehicle.counters().alarms & leadline::proto::kAlarmForeignTopside) != 0, ""};
    for (const Bytes& each : tether.sent) {
      heard.hellos += type_of(each) == MessageType::kHello ? 1 : 0;
    }
    for (const auto& notice : tether.receiver->take_notices()) {
      heard.texts += notice.text;
    }
    return heard;
  };
  static_cast<void>(tether.receiver->take_notices());
  const auto before = vehicle.counters();
  const Heard foreign = after({0x41, 2, 0}, kSecond_us);
  assert_int_equal(foreign.hellos, 0);
  assert_true(foreign.alarm);
  assert_true(foreign.texts.find("another major version") != std::string::npos);
  // What else it may say lacks the survey's tag.
  const Heard request = after({0x40, 0, 0, 1, 0, 5}, kSecond_us);
  assert_int_equal(vehicle.counters().uplink_foreign, before.uplink_foreign + 1);
  assert_int_equal(vehicle.counters().uplink_rejected, before.uplink_rejected + 2);
  assert_int_equal(vehicle.counters().resend_requests, before.resend_requests);
  assert_true(request.alarm && request.texts.empty());
  // Others go on meanwhile: of this version, of 1.0, of a later minor.
  for (const Bytes& ours : {Bytes{0x41, 1, 1}, Bytes{0x41}, Bytes{0x41, 1, 9, 7}}) {
    assert_int_equal(after(ours, 2 * kSecond_us).hellos, 1);
  }
  assert_true(tether.equal());
  assert_false(after({0x41, 1, 1}, 60 * kSecond_us).alarm);
  assert_int_equal(vehicle.counters().uplink_foreign, before.uplink_foreign + 1);
}

/// When each tile came first, seconds since the vehicle owed all.
std::map<std::uint32_t, double> arrivals(std::uint32_t look_tile, std::uint8_t radius_tiles,
                                         Tether* tether) {
  std::map<std::uint32_t, double> came_s;
  vehicle.restart_link();
  // The hello first, and the topside's word of where it looks.
  while (tether->receiver->store() == nullptr) {
    tether->step();
    assert_true(tether->real_us < 600 * kSecond_us);
  }
  tether->receiver->look(look_tile, radius_tiles);
  for (int i = 0; i < 50; ++i) {
    tether->step();
  }
  const TimeUs begin_us = tether->real_us;
  vehicle.restart_link();
  const std::uint64_t seen = tether->receiver->store()->sequence();
  while (!tether->equal()) {
    assert_true(tether->real_us - begin_us < kHour_us);
    tether->step();
    for (const std::uint32_t tile : tether->receiver->store()->changed_since(seen)) {
      came_s.emplace(tile, 1e-6 * static_cast<double>(tether->real_us - begin_us));
    }
  }
  return came_s;
}

double mean_within(const std::map<std::uint32_t, double>& came_s, std::int32_t row,
                   std::int32_t column, std::int32_t radius_tiles) {
  double sum_s = 0.0;
  int count = 0;
  for (const auto& [tile, at_s] : came_s) {
    const std::int32_t rows = std::abs(static_cast<std::int32_t>(tile) / 6 - row);
    const std::int32_t columns = std::abs(static_cast<std::int32_t>(tile) % 6 - column);
    if (std::max(rows, columns) <= radius_tiles) {
      sum_s += at_s;
      ++count;
    }
  }
  assert_true(count >= 2);
  return sum_s / count;
}

TEST(tiles_that_are_looked_at_come_first_where_the_line_is_slow) {
  Tether plain(1, false);
  plain.vehicle_us = flown(60);
  const auto without = arrivals(0, 0, &plain);
  assert_true(without.size() >= 10);
  // The one that came last, and its neighbours.
  const auto last = std::max_element(without.begin(), without.end(), [](auto& a, auto& b) {
                      return a.second < b.second;
                    })->first;
  const auto last_row = static_cast<std::int32_t>(last) / 6;
  const auto last_column = static_cast<std::int32_t>(last) % 6;
  Tether looking(1, false);
  looking.vehicle_us = flown(60);
  const auto with = arrivals(last, 1, &looking);
  const double looked_s = mean_within(with, last_row, last_column, 1);
  const double before_s = mean_within(without, last_row, last_column, 1);
  std::printf("looked at: after %.1f s, else %.1f s\n", looked_s, before_s);
  assert_true(looked_s < 0.8 * before_s);
}

/// Tiles in the order in which the vehicle first sent of them, and how many cells of each.
struct SentTiles {
  std::vector<std::uint32_t> order;
  std::map<std::uint32_t, int> cells;
};

SentTiles tiles_of(const std::vector<Bytes>& frames) {
  SentTiles tiles;
  leadline::proto::FrameDecoderBuffer<> decoder;
  for (const Bytes& frame : frames) {
    std::size_t used = 0;
    leadline::proto::FrameView view{};
    assert_true(decoder.decoder().feed(frame.data(), frame.size(), used, view));
    leadline::proto::TilePacketDecoder packet;
    if (packet.open(view.payload, view.payload_bytes) != leadline::base::Status::kOk) {
      continue;
    }
    leadline::proto::TileDelta delta{};
    while (packet.next(delta)) {
      if (tiles.cells.count(delta.tile) == 0) {
        tiles.order.push_back(delta.tile);
      }
      tiles.cells[delta.tile] += delta.cell_count;
    }
  }
  return tiles;
}

/// Rings of tiles between one of the rig's and the one that the vehicle believes to be over.
std::int32_t rings_to_vehicle(std::uint32_t tile, const leadline::base::Pose& pose) {
  const VehicleConfig config = leadline::test::rig_config();
  const auto tile_of = [&](int axis) {
    const std::int64_t offset_mm = pose.position_um[axis] / 1000 - config.model.origin_mm[axis];
    return static_cast<std::int32_t>(offset_mm / (16 * config.model.cell_mm));
  };
  return std::max(std::abs(static_cast<std::int32_t>(tile) / 6 - tile_of(0)),
                  std::abs(static_cast<std::int32_t>(tile) % 6 - tile_of(1)));
}

/// To half a tile.
bool knows_place() {
  const auto& pose = vehicle.latest_pose();
  return std::max(pose.covariance.sigma_position_mm[0], pose.covariance.sigma_position_mm[1]) <=
         4000;
}

// Of tiles that have waited and changed alike the nearer goes first; long after the last fix, nearer to where the
// vehicle was last known to be: dead reckoning has left the map by then.
TEST(near_tiles_come_first_with_and_without_fixes) {
  Tether tether(1, false);
  tether.vehicle_us = flown(4000);
  tether.settle(60);
  for (const bool known : {true, false}) {
    leadline::base::Pose place = vehicle.latest_pose();
    const TimeUs until_us = tether.real_us + (known ? 0 : 60 * kSecond_us);
    while (tether.real_us < until_us) {
      place = knows_place() ? vehicle.latest_pose() : place;
      tether.step();
    }
    assert_true(knows_place() == known);
    // Nothing of the map is near where dead reckoning is by now.
    assert_true(known || rings_to_vehicle(0, vehicle.latest_pose()) > 12);
    tether.sent.clear();
    vehicle.restart_link();
    tether.settle(60);
    const std::vector<std::uint32_t> order = tiles_of(tether.sent).order;
    assert_true(order.size() >= 10);
    std::vector<std::int32_t> rings;
    for (const std::uint32_t tile : order) {
      rings.push_back(rings_to_vehicle(tile, place));
    }
    assert_true(std::is_sorted(rings.begin(), rings.end()));
    assert_true(rings.back() < 8 && rings.back() - rings.front() >= 3);
  }
}

// Those that changed while the line took nothing: of two, the one with more new cells goes first, where the
// difference is larger than what nearness (12 a ring) and age (one in 33 ms) can make of it.
TEST(tiles_that_changed_most_come_first) {
  VehicleConfig config = slow_config(4000);
  config.ports[leadline::test::kRigSonar].driver = leadline::firmware::Driver::kDeltat83p;
  config.cycle_tile_budget = 64;
  leadline::test::configure_rig(vehicle, config);
  leadline::test::RigOptions options;
  options.fan_beams = 120;
  options.seconds = 8.0;
  options.speed_m_s = 3.0;
  options.room_bytes = 0;
  // A second of soundings, then nothing until all of it is due.
  options.tamper = [](leadline::test::RecordedCycle& cycle) {
    const auto of_sonar = [](const auto& chunk) { return chunk.port == leadline::test::kRigSonar; };
    if (cycle.t_us < 4 * kSecond_us || cycle.t_us > 5 * kSecond_us) {
      cycle.chunks.erase(std::remove_if(cycle.chunks.begin(), cycle.chunks.end(), of_sonar),
                         cycle.chunks.end());
    }
  };
  const Recording recording = leadline::test::fly(vehicle, options);
  const leadline::base::Pose place = vehicle.latest_pose();
  Tether tether(1, false);
  tether.vehicle_us = recording.back().t_us;
  tether.settle(60);
  const SentTiles tiles = tiles_of(tether.sent);
  assert_true(tiles.order.size() >= 5);
  constexpr std::int32_t kAges_ticks = 40;
  int pairs = 0;
  for (auto later = tiles.order.begin(); later != tiles.order.end(); ++later) {
    for (auto first = tiles.order.begin(); first != later; ++first) {
      const int more = tiles.cells.at(*later) - tiles.cells.at(*first);
      const int rings = rings_to_vehicle(*later, place) - rings_to_vehicle(*first, place);
      assert_true(more <= 12 * std::max(rings, 0) + kAges_ticks);
      pairs += -more > 12 * std::max(-rings, 0) + kAges_ticks ? 1 : 0;
    }
  }
  // So many could have come the wrong way round.
  std::printf("%zu tiles, %d pairs far apart\n", tiles.order.size(), pairs);
  assert_true(pairs >= 6);
}

TEST(statuses_go_before_tiles_and_none_waits_for_them) {
  Tether tether(1, false);
  tether.vehicle_us = flown(60);
  vehicle.restart_link();
  tether.sent.clear();
  std::vector<TimeUs> said_us;
  std::size_t seen = 0;
  std::size_t longest = 0;
  int deltas = 0;
  while (!tether.equal()) {
    tether.step();
    assert_true(tether.real_us < kHour_us);
    bool delta_first = false;
    for (; seen < tether.sent.size(); ++seen) {
      const auto type = static_cast<MessageType>(tether.sent[seen][2]);
      if (type == MessageType::kTileDelta) {
        delta_first = true;
        ++deltas;
      } else if (type == MessageType::kStatus || type == MessageType::kBrief) {
        assert_true(!delta_first);
        longest = std::max(longest, tether.sent[seen].size());
        said_us.push_back(tether.real_us);
      }
    }
  }
  std::printf("%d frames of cells, %zu statuses\n", deltas, said_us.size());
  assert_true(deltas >= 5 && said_us.size() >= 3);
  // Their share of the line (a sixteenth), and what the frames under way need.
  const double most_s = (16.0 * static_cast<double>(longest) + 2.0 * 256.0) / 60.0;
  for (std::size_t i = 1; i < said_us.size(); ++i) {
    assert_true(1e-6 * static_cast<double>(said_us[i] - said_us[i - 1]) <= most_s);
  }
}

}  // namespace
