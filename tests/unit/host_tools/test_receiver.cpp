#include <algorithm>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/topside/receiver.hpp"
#include "proto/framing.hpp"
#include "proto/log.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::Receiver;
using leadline::host::ReceiverNotice;
using leadline::host::TileStore;
using leadline::proto::CellMask;
using leadline::proto::code_cell;
using leadline::proto::CodedCell;
using leadline::proto::Hello;
using leadline::proto::kTileArea_cells;
using leadline::test::Random;

using Bytes = std::vector<std::uint8_t>;

Bytes frame(const std::uint8_t* payload, std::size_t size) {
  Bytes bytes(leadline::proto::frame_bound_bytes(size));
  const auto written = leadline::proto::encode_frame(payload, size, bytes.data(), bytes.size());
  assert_true(written.ok());
  bytes.resize(written.value());
  return bytes;
}

Hello grid_hello(std::uint64_t survey = 11, std::uint32_t session = 1) {
  Hello hello{};
  hello.protocol_major = leadline::proto::kProtocolMajor;
  hello.protocol_minor = 0;  // of minor 1: property/test_link_trial
  hello.tile_side_cells = leadline::proto::kTileSide_cells;
  hello.schema_hash = leadline::proto::schema_hash();
  hello.survey_id = survey;
  hello.session = session;
  hello.cell_mm = 1000;
  hello.size_cells[0] = hello.size_cells[1] = 64;
  hello.size_cells[2] = 32;
  return hello;
}

Bytes hello_frame(const Hello& hello) {
  std::uint8_t payload[leadline::proto::kMaxHello_bytes];
  const auto size = encode_hello(hello, payload, sizeof payload);
  assert_true(size.ok());
  return frame(payload, size.value());
}

/// A vehicle's map that changes and tells it, a packet per change.
class Speaker {
 public:
  explicit Speaker(const Hello& hello)
      : tag_(leadline::proto::survey_tag(hello.survey_id, hello.session)), tiles_(16) {}

  Bytes change(std::uint32_t tile, Random* random) {
    Tile& mine = tiles_[tile];
    leadline::proto::TileUpdate update{};
    for (int k = 0; k < 20; ++k) {
      const int cell = static_cast<int>(random->between(0, kTileArea_cells - 1));
      mine.cells[cell] = code_cell(static_cast<std::int32_t>(random->between(100, 8000)), 1024, 0);
      update.changed.set(cell);
    }
    mine.generation += 1;
    return say(tile, update.changed);
  }
  /// All of a tile, as after a resend request.
  Bytes repeat(std::uint32_t tile) {
    CellMask all{};
    for (int k = 0; k < kTileArea_cells; ++k) {
      if (tiles_[tile].cells[k] != 0) {
        all.set(k);
      }
    }
    return say(tile, all);
  }
  [[nodiscard]] std::uint64_t hash() const {
    std::uint64_t hash = leadline::proto::kFnvOffset;
    for (const Tile& tile : tiles_) {
      hash = leadline::proto::add_tile_hash(hash, leadline::proto::tile_hash(tile.cells));
    }
    return hash;
  }

 private:
  struct Tile {
    std::uint32_t generation = 0;
    CodedCell cells[kTileArea_cells] = {};
  };

  Bytes say(std::uint32_t tile, const CellMask& changed) {
    std::uint8_t payload[1400];
    CellMask taken{};
    const auto size =
        leadline::proto::encode_tile({tile, tiles_[tile].generation, tiles_[tile].cells, changed},
                                     tag_, payload, sizeof payload, taken);
    assert_true(size.ok());
    return frame(payload, size.value());
  }

  std::uint16_t tag_;
  std::vector<Tile> tiles_;
};

void feed(Receiver* receiver, const Bytes& bytes) { receiver->feed(bytes.data(), bytes.size()); }

std::string notices(Receiver* receiver) {
  std::string text;
  for (const ReceiverNotice& notice : receiver->take_notices()) {
    text += notice.text + "\n";
  }
  return text;
}

TEST(a_clean_link_gives_the_vehicles_map) {
  Random random;
  Receiver receiver;
  Speaker vehicle(grid_hello());
  assert_true(receiver.store() == nullptr);
  feed(&receiver, hello_frame(grid_hello()));
  std::size_t bytes = 0;
  for (int k = 0; k < 100; ++k) {
    const Bytes packet = vehicle.change(static_cast<std::uint32_t>(random.between(0, 15)), &random);
    bytes += packet.size();
    // In pieces: a serial line knows no frames.
    const auto cut = static_cast<std::ptrdiff_t>(random.between(0, 20));
    const auto middle =
        packet.begin() + std::min<std::ptrdiff_t>(cut, static_cast<std::ptrdiff_t>(packet.size()));
    feed(&receiver, Bytes(packet.begin(), middle));
    feed(&receiver, Bytes(middle, packet.end()));
  }
  assert_true(receiver.store()->cells_hash() == vehicle.hash());
  assert_int_equal(receiver.store()->tiles_incomplete(), 0);
  assert_int_equal(receiver.counters().deltas, 100);
  assert_int_equal(receiver.counters().delta_bytes, bytes);
  assert_near(receiver.bytes_per_changed_cell(),
              static_cast<double>(bytes) / static_cast<double>(receiver.counters().delta_cells),
              1e-12);
}

// Frames lost, repeated, swapped, with bytes changed: nothing wrong gets in, and what is missing is asked
// for.
TEST(a_bad_link_never_gives_a_wrong_cell_and_heals_on_request) {
  Random random;
  Receiver receiver;
  Speaker vehicle(grid_hello());
  feed(&receiver, hello_frame(grid_hello()));
  std::vector<Bytes> packets;
  for (int k = 0; k < 400; ++k) {
    packets.push_back(vehicle.change(static_cast<std::uint32_t>(random.between(0, 15)), &random));
  }
  for (std::size_t k = 0; k < packets.size(); ++k) {
    const std::int64_t fate = random.between(0, 9);
    if (fate == 0) {
      continue;
    }
    if (fate == 1 && k > 0) {
      feed(&receiver, packets[k - 1]);
    }
    if (fate == 2 && k + 1 < packets.size()) {
      std::swap(packets[k], packets[k + 1]);
    }
    if (fate == 3) {
      Bytes broken = packets[k];
      broken[static_cast<std::size_t>(
          random.between(0, static_cast<std::int64_t>(broken.size()) - 1))] ^=
          static_cast<std::uint8_t>(random.between(1, 255));
      feed(&receiver, broken);
      continue;
    }
    if (fate == 4) {
      feed(&receiver, Bytes(packets[k].begin(), packets[k].begin() + 5));
      continue;
    }
    feed(&receiver, packets[k]);
  }
  assert_true(receiver.counters().damaged_frames > 0);
  assert_true(receiver.store()->tiles_incomplete() > 0);
  // Ask, and answer, until there is nothing to ask for.
  for (int round = 0; round < 20 && !receiver.resend_request().empty(); ++round) {
    for (std::uint32_t tile = 0; tile < 16; ++tile) {
      feed(&receiver, vehicle.repeat(tile));
    }
  }
  assert_int_equal(receiver.store()->tiles_incomplete(), 0);
  // Tiles whose last packets were all lost look complete: a whole repetition brings them too.
  for (std::uint32_t tile = 0; tile < 16; ++tile) {
    feed(&receiver, vehicle.repeat(tile));
  }
  assert_true(receiver.store()->cells_hash() == vehicle.hash());
}

TEST(a_resend_request_names_the_tiles) {
  Random random;
  Receiver receiver;
  Speaker vehicle(grid_hello());
  feed(&receiver, hello_frame(grid_hello()));
  (void)vehicle.change(9, &random);
  feed(&receiver, vehicle.change(9, &random));
  const Bytes request = receiver.resend_request();
  leadline::proto::FrameDecoderBuffer<> buffer;
  leadline::proto::FrameView view{};
  std::size_t used = 0;
  assert_true(buffer.decoder().feed(request.data(), request.size(), used, view));
  const auto decoded = leadline::proto::decode_resend_request(view.payload, view.payload_bytes);
  assert_true(decoded.ok());
  assert_int_equal(decoded.value().range_count, 1);
  assert_int_equal(decoded.value().ranges[0].first, 9);
}

Bytes status_frame(std::uint32_t tiles_known, std::uint32_t tiles_dirty, std::uint64_t cells_sent) {
  leadline::proto::Status status{};
  status.tiles_known = tiles_known;
  status.tiles_dirty = tiles_dirty;
  status.cells_sent = static_cast<std::uint32_t>(cells_sent);
  std::uint8_t payload[leadline::proto::kMaxStatus_bytes];
  const auto size = encode_status(status, payload, sizeof payload);
  assert_true(size.ok());
  return frame(payload, size.value());
}

std::vector<leadline::proto::TileRange> asked_for(Receiver* receiver) {
  const Bytes request = receiver->resend_request();
  leadline::proto::FrameDecoderBuffer<> buffer;
  leadline::proto::FrameView view{};
  std::size_t used = 0;
  if (request.empty() || !buffer.decoder().feed(request.data(), request.size(), used, view)) {
    return {};
  }
  const auto decoded = leadline::proto::decode_resend_request(view.payload, view.payload_bytes);
  assert_true(decoded.ok());
  return {decoded.value().ranges, decoded.value().ranges + decoded.value().range_count};
}

TEST(who_joins_late_asks_for_what_never_came_once_the_vehicle_is_quiet) {
  Random random;
  Receiver receiver;
  Speaker vehicle(grid_hello());
  (void)vehicle.change(2, &random);
  (void)vehicle.change(3, &random);
  feed(&receiver, hello_frame(grid_hello()));
  feed(&receiver, vehicle.change(5, &random));
  feed(&receiver, status_frame(3, 1, 500));
  assert_true(asked_for(&receiver).empty());  // more is coming by itself
  feed(&receiver, status_frame(3, 0, 500));
  const auto ranges = asked_for(&receiver);
  assert_int_equal(ranges.size(), 2);
  assert_int_equal(ranges[0].first, 0);
  assert_int_equal(ranges[0].count, 5);
  assert_int_equal(ranges[1].first, 6);
  const std::uint64_t before = receiver.counters().delta_cells;
  feed(&receiver, vehicle.repeat(2));
  feed(&receiver, vehicle.repeat(3));
  feed(&receiver, status_frame(3, 0, 500 + receiver.counters().delta_cells - before));
  assert_true(asked_for(&receiver).empty());
  assert_true(receiver.store()->cells_hash() == vehicle.hash());
}

TEST(a_lost_last_word_is_found_by_counting_cells) {
  Random random;
  Receiver receiver;
  Speaker vehicle(grid_hello());
  feed(&receiver, hello_frame(grid_hello()));
  feed(&receiver, status_frame(0, 0, 0));
  feed(&receiver, vehicle.change(5, &random));
  (void)vehicle.change(5, &random);  // lost, and nothing follows: every tile looks complete
  const std::uint64_t came = receiver.counters().delta_cells;
  feed(&receiver, status_frame(1, 0, came + 17));
  assert_int_equal(receiver.store()->tiles_incomplete(), 0);
  assert_true(receiver.store()->cells_hash() != vehicle.hash());
  const auto ranges = asked_for(&receiver);
  assert_int_equal(ranges.size(), 1);
  assert_int_equal(ranges[0].count, 16);
  feed(&receiver, vehicle.repeat(5));
  const std::uint64_t again = receiver.counters().delta_cells - came;
  feed(&receiver, status_frame(1, 0, came + 17 + again));
  assert_true(asked_for(&receiver).empty());
  assert_true(receiver.store()->cells_hash() == vehicle.hash());
  // Once is enough.
  feed(&receiver, status_frame(1, 0, came + 17 + again));
  assert_true(asked_for(&receiver).empty());
}

TEST(briefs_count_as_statuses) {
  Random random;
  Receiver receiver;
  Speaker vehicle(grid_hello());
  const auto brief_frame = [](std::uint32_t tiles_dirty, std::uint64_t cells_sent) {
    leadline::proto::Brief brief{};
    brief.alarms = leadline::proto::kAlarmNoPose;
    brief.tiles_known = 1;
    brief.tiles_dirty = tiles_dirty;
    brief.cells_sent = static_cast<std::uint32_t>(cells_sent);
    brief.pings_fused = 77;
    std::uint8_t payload[leadline::proto::kMaxBrief_bytes];
    return frame(payload, encode_brief(brief, payload, sizeof payload).value());
  };
  feed(&receiver, hello_frame(grid_hello()));
  feed(&receiver, brief_frame(0, 0));
  feed(&receiver, vehicle.change(5, &random));
  (void)vehicle.change(5, &random);  // lost
  const std::uint64_t came = receiver.counters().delta_cells;
  feed(&receiver, brief_frame(1, came + 17));
  assert_true(asked_for(&receiver).empty());
  feed(&receiver, brief_frame(0, came + 17));
  assert_int_equal(asked_for(&receiver).size(), 1);
  assert_int_equal(receiver.counters().statuses, 3);
  assert_int_equal(receiver.status()->alarms, leadline::proto::kAlarmNoPose);
  assert_int_equal(receiver.status()->pings[leadline::proto::kPingFused], 77);
  const Bytes cut = {0x05, 1, 2};
  feed(&receiver, frame(cut.data(), cut.size()));
  assert_int_equal(receiver.counters().malformed, 1);
  // Everything that came is a byte of the link.
  assert_int_equal(receiver.counters().link_bytes, receiver.counters().bytes);
  assert_true(receiver.bytes_per_changed_cell_all() > receiver.bytes_per_changed_cell());
}

TEST(who_hears_frames_and_no_hello_asks_for_one) {
  Random random;
  Receiver receiver;
  Speaker vehicle(grid_hello());
  assert_true(receiver.resend_request().empty());  // silence is no vehicle
  feed(&receiver, vehicle.change(1, &random));
  const Bytes request = receiver.resend_request();
  leadline::proto::FrameDecoderBuffer<> buffer;
  leadline::proto::FrameView view{};
  std::size_t used = 0;
  assert_true(buffer.decoder().feed(request.data(), request.size(), used, view));
  assert_true(leadline::proto::decode_hello_request(view.payload, view.payload_bytes).ok());
  feed(&receiver, request);  // its echo is no hello
  assert_false(receiver.resend_request().empty());
  feed(&receiver, hello_frame(grid_hello()));
  assert_true(receiver.resend_request().empty());
}

TEST(who_joins_late_keeps_what_comes_before_the_hello) {
  Random random;
  Receiver receiver;
  Speaker vehicle(grid_hello());
  for (int k = 0; k < 50; ++k) {
    feed(&receiver, vehicle.change(static_cast<std::uint32_t>(k % 16), &random));
  }
  assert_true(receiver.store() == nullptr);
  feed(&receiver, hello_frame(grid_hello()));
  assert_true(receiver.store()->cells_hash() == vehicle.hash());
  assert_int_equal(receiver.counters().before_hello, 0);
}

bool asks_for_hello(Receiver* receiver, std::int64_t now_us) {
  const Bytes request = receiver->uplink(now_us);
  return request.size() > 2 &&
         request[2] == static_cast<std::uint8_t>(leadline::proto::MessageType::kHelloRequest);
}

// A lost question, or a lost hello: asked again soon where much came without it, later where nothing does; and a line
// that was seen to be fast is asked soon also when it falls silent.
TEST(the_question_for_a_hello_goes_by_what_comes_without_it) {
  Random random;
  Receiver receiver;
  Speaker vehicle(grid_hello());
  std::int64_t now_us = 5'000'000;
  assert_false(asks_for_hello(&receiver, now_us));  // silence is no vehicle
  feed(&receiver, vehicle.change(1, &random));
  assert_true(asks_for_hello(&receiver, now_us));
  assert_false(asks_for_hello(&receiver, now_us));
  // Silence: 0.2 s, then half as much more each time, up to 2 s.
  std::vector<std::int64_t> asked_us = {now_us};
  while (asked_us.size() < 12) {
    now_us += 5'000;
    if (asks_for_hello(&receiver, now_us)) {
      asked_us.push_back(now_us);
    }
  }
  assert_true(asked_us[1] - asked_us[0] == 200'000);
  assert_true(asked_us[2] - asked_us[1] == 300'000);
  assert_true(asked_us[11] - asked_us[10] == 2'000'000);
  // Frames without it: 500 bytes.
  std::uint64_t bytes = receiver.counters().link_bytes;
  now_us += 30'000;
  while (receiver.counters().link_bytes - bytes < 500) {
    assert_false(asks_for_hello(&receiver, now_us));
    feed(&receiver, vehicle.change(1, &random));
  }
  assert_true(asks_for_hello(&receiver, now_us));
  // But none before it can have come.
  bytes = receiver.counters().link_bytes;
  while (receiver.counters().link_bytes - bytes < 2000) {
    feed(&receiver, vehicle.change(1, &random));
  }
  assert_false(asks_for_hello(&receiver, now_us + 15'000));
  assert_true(asks_for_hello(&receiver, now_us + 20'000));
  feed(&receiver, hello_frame(grid_hello()));
  assert_true(receiver.uplink(now_us + 10'000'000).empty());
  assert_true(receiver.store()->cells_hash() == vehicle.hash());
}

TEST(a_line_that_was_fast_is_asked_soon_when_it_falls_silent) {
  Random random;
  Receiver receiver;
  Speaker vehicle(grid_hello());
  feed(&receiver, vehicle.change(1, &random));
  assert_true(asks_for_hello(&receiver, 1'000'000));
  while (receiver.counters().link_bytes < 1000) {
    feed(&receiver, vehicle.change(1, &random));
  }
  assert_true(asks_for_hello(&receiver, 1'030'000));
  assert_false(asks_for_hello(&receiver, 1'085'000));
  assert_true(asks_for_hello(&receiver, 1'090'000));
}

// The hello of a new session is lost: what comes of it is kept, the hello asked for, the old map stays until then.
TEST(a_new_session_whose_hello_is_lost_is_asked_for_it_and_loses_nothing) {
  Random random;
  Receiver receiver;
  Speaker first(grid_hello(11, 1));
  feed(&receiver, hello_frame(grid_hello(11, 1)));
  feed(&receiver, first.change(0, &random));
  assert_false(asks_for_hello(&receiver, 1'000'000));
  Speaker second(grid_hello(11, 2));
  feed(&receiver, second.change(3, &random));
  feed(&receiver, second.change(4, &random));
  feed(&receiver, first.change(1, &random));  // late, of the map that there is
  assert_true(asks_for_hello(&receiver, 1'000'000));
  assert_false(asks_for_hello(&receiver, 1'100'000));
  assert_true(asks_for_hello(&receiver, 1'200'000));
  assert_true(receiver.store()->cells_hash() == first.hash());
  feed(&receiver, hello_frame(grid_hello(11, 1)));  // late, too: it explains nothing
  assert_true(asks_for_hello(&receiver, 1'500'000));
  feed(&receiver, hello_frame(grid_hello(11, 2)));
  assert_true(receiver.store()->cells_hash() == second.hash());
  assert_int_equal(receiver.counters().other_surveys, 0);
  assert_false(asks_for_hello(&receiver, 9'000'000));
}

// Of two sessions the hellos come in the wrong order: what waits for the second is not lost by the first.
TEST(what_waits_for_a_hello_waits_for_its_own) {
  Random random;
  Receiver receiver;
  Speaker second(grid_hello(11, 2));
  feed(&receiver, second.change(3, &random));
  feed(&receiver, hello_frame(grid_hello(11, 1)));
  assert_int_equal(receiver.store()->known_cells(), 0);
  assert_true(asks_for_hello(&receiver, 1'000'000));
  feed(&receiver, hello_frame(grid_hello(11, 2)));
  assert_true(receiver.store()->cells_hash() == second.hash());
}

// Of two vehicles on one line only one hears us: the other is not asked for ever, which the one that hears would pay for.
TEST(a_stranger_that_never_says_hello_is_given_up) {
  Random random;
  Receiver receiver;
  Speaker ours(grid_hello(11, 1));
  Speaker stranger(grid_hello(12, 1));
  feed(&receiver, hello_frame(grid_hello(11, 1)));
  int asked = 0;
  for (std::int64_t now_us = 0; now_us < 120'000'000; now_us += 50'000) {
    feed(&receiver, stranger.change(2, &random));
    feed(&receiver, ours.change(2, &random));
    asked += asks_for_hello(&receiver, now_us) ? 1 : 0;
    if (asked > 0 && now_us % 1'000'000 == 0) {
      feed(&receiver, hello_frame(grid_hello(11, 1)));
    }
  }
  assert_int_equal(asked, 8);
  assert_true(receiver.store()->cells_hash() == ours.hash());
  assert_int_equal(receiver.counters().before_hello + receiver.counters().other_surveys, 2400);
  assert_true(receiver.counters().before_hello > 8);
}

TEST(what_a_status_said_before_the_first_hello_counts_and_one_of_the_session_before_does_not) {
  Receiver receiver;
  feed(&receiver, status_frame(3, 0, 500));
  feed(&receiver, hello_frame(grid_hello(11, 1)));
  assert_int_equal(receiver.status()->tiles_known, 3);
  assert_int_equal(asked_for(&receiver).size(), 1);  // the vehicle rests, and all is missing
  feed(&receiver, hello_frame(grid_hello(11, 2)));
  assert_false(receiver.status().has_value());
}

TEST(another_major_version_is_refused_with_advice) {
  Bytes payload(200, 0);
  payload[0] = static_cast<std::uint8_t>(leadline::proto::MessageType::kHello);
  payload[1] = leadline::proto::kProtocolMajor + 1;
  Receiver receiver;
  try {
    feed(&receiver, frame(payload.data(), payload.size()));
    fail_msg("taken");
  } catch (const HostError& error) {
    assert_int_equal(static_cast<int>(error.code()), static_cast<int>(ExitCode::kInput));
    const std::string text = error.what();
    assert_true(text.find("version 2") != std::string::npos);
    assert_true(text.find("use the leadline") != std::string::npos);
  }
}

TEST(a_new_session_begins_a_new_map_and_hands_over_the_old) {
  Random random;
  Receiver receiver;
  std::uint64_t ended_cells = 0;
  receiver.on_replaced = [&](const TileStore& ended) { ended_cells = ended.known_cells(); };
  Speaker first(grid_hello(11, 1));
  feed(&receiver, hello_frame(grid_hello(11, 1)));
  feed(&receiver, first.change(0, &random));
  const std::uint64_t known = receiver.store()->known_cells();
  assert_true(known > 0);
  feed(&receiver, hello_frame(grid_hello(11, 1)));
  assert_int_equal(ended_cells, 0);
  feed(&receiver, hello_frame(grid_hello(11, 2)));
  assert_int_equal(ended_cells, known);
  assert_int_equal(receiver.store()->known_cells(), 0);
  assert_true(notices(&receiver).find("a new map begins") != std::string::npos);
  // Stragglers of the session before.
  feed(&receiver, first.change(1, &random));
  assert_int_equal(receiver.counters().other_surveys, 1);
  assert_int_equal(receiver.store()->known_cells(), 0);
}

TEST(a_later_hello_tells_where_the_map_lies_and_keeps_its_cells) {
  Random random;
  Receiver receiver;
  Speaker speaker(grid_hello());
  feed(&receiver, hello_frame(grid_hello()));
  feed(&receiver, speaker.change(0, &random));
  const std::uint64_t known = receiver.store()->known_cells();
  Hello placed = grid_hello();
  placed.has_geodetic_origin = 1;
  placed.latitude_e9deg = 54'305'000'000;
  placed.longitude_e9deg = -10'125'000'000;
  feed(&receiver, hello_frame(placed));
  feed(&receiver, hello_frame(grid_hello()));  // an older one that was overtaken
  assert_int_equal(receiver.store()->hello().has_geodetic_origin, 1);
  assert_true(receiver.store()->hello().latitude_e9deg == 54'305'000'000);
  assert_true(receiver.store()->hello().longitude_e9deg == -10'125'000'000);
  assert_true(known > 0 && receiver.store()->known_cells() == known);
}

TEST(a_survey_that_was_not_asked_for_is_passed_over) {
  Random random;
  Receiver receiver(std::uint64_t{42});
  feed(&receiver, hello_frame(grid_hello(11, 1)));
  feed(&receiver, hello_frame(grid_hello(11, 1)));
  assert_true(receiver.store() == nullptr);
  const std::string said = notices(&receiver);
  assert_true(said.find("passed over") != std::string::npos);
  assert_true(said.find("passed over") == said.rfind("passed over"));  // once
  feed(&receiver, hello_frame(grid_hello(42, 1)));
  assert_true(receiver.store() != nullptr);
  Speaker foreign(grid_hello(11, 1));
  feed(&receiver, foreign.change(0, &random));
  assert_int_equal(receiver.counters().other_surveys, 1);
}

// Of a vehicle of minor 1, which takes reports and digest requests.

Hello reporting_hello(std::uint32_t session = 1) {
  Hello hello = grid_hello(11, session);
  hello.protocol_minor = leadline::proto::kProtocolMinor;
  hello.link_rate_bytes_s = 11'520;
  return hello;
}

/// Payloads that go up now.
std::vector<Bytes> sent_up(Receiver* receiver, std::int64_t now_us) {
  std::vector<Bytes> payloads;
  leadline::proto::FrameDecoderBuffer<> buffer;
  for (Bytes up = receiver->uplink(now_us); !up.empty(); up = receiver->uplink(now_us)) {
    leadline::proto::FrameView view{};
    std::size_t used = 0;
    assert_true(buffer.decoder().feed(up.data(), up.size(), used, view));
    payloads.emplace_back(view.payload, view.payload + view.payload_bytes);
  }
  return payloads;
}

/// The tiles of the requests among them.
std::vector<std::uint32_t> tiles_asked_for(const std::vector<Bytes>& payloads) {
  std::vector<std::uint32_t> tiles;
  for (const Bytes& payload : payloads) {
    const auto request = leadline::proto::decode_resend_request(payload.data(), payload.size());
    for (int i = 0; request.ok() && i < request.value().range_count; ++i) {
      for (std::uint32_t k = 0; k < request.value().ranges[i].count; ++k) {
        tiles.push_back(request.value().ranges[i].first + k);
      }
    }
  }
  return tiles;
}

Bytes digest_frame(const leadline::proto::Digest& digest) {
  std::uint8_t payload[leadline::proto::kMaxDigest_bytes];
  return frame(payload, encode_digest(digest, payload, sizeof payload).value());
}

/// Hashes of single tiles from `first` on, or one over all.
leadline::proto::Digest digest_of(const Receiver& receiver, std::uint32_t first, int count) {
  leadline::proto::Digest digest{};
  digest.survey_tag = receiver.store()->tag();
  digest.first = first;
  digest.hash_count = static_cast<std::uint8_t>(count);
  if (count == 0) {
    digest.tiles_log2 = leadline::proto::kMaxDigestLog2;
    digest.hash_count = 1;
    std::uint64_t hash = leadline::proto::kFnvOffset;
    for (std::uint32_t tile = 0; tile < 16; ++tile) {
      hash = leadline::proto::add_digest_tile(hash, receiver.store()->hash32(tile));
    }
    digest.hashes[0] = leadline::proto::fold_hash(hash);
  }
  for (std::uint32_t k = 0; k < static_cast<std::uint32_t>(count); ++k) {
    digest.hashes[k] = receiver.store()->hash32(first + k);
  }
  return digest;
}

// Who comes when all has been told and the vehicle rests: nothing is on its way, so it asks at once for all that never
// came, and again where none of it comes.
TEST(tiles_that_the_vehicle_knows_and_does_not_owe_are_asked_for) {
  Random random;
  Receiver receiver;
  Speaker vehicle(reporting_hello());
  feed(&receiver, hello_frame(reporting_hello()));
  feed(&receiver, vehicle.change(5, &random));
  feed(&receiver, status_frame(3, 2, 500));  // two are on their way
  std::int64_t now_us = 1'000'000;
  assert_true(tiles_asked_for(sent_up(&receiver, now_us)).empty());
  feed(&receiver, status_frame(3, 0, 500));
  now_us += 5'000;
  const auto asked = tiles_asked_for(sent_up(&receiver, now_us));
  assert_int_equal(asked.size(), 15);
  assert_true(std::find(asked.begin(), asked.end(), 5U) == asked.end());
  std::vector<std::int64_t> again_us;
  const std::int64_t begin_us = now_us;
  while (now_us < begin_us + 20'000'000) {
    now_us += 5'000;
    if (!tiles_asked_for(sent_up(&receiver, now_us)).empty()) {
      again_us.push_back(now_us - begin_us);
    }
  }
  assert_int_equal(again_us.size(), 3);  // after 2 s, 4 s more, 8 s more
  assert_in_range(again_us[0], 2'000'000, 2'500'000);
  assert_in_range(again_us[2], 14'000'000, 16'000'000);
  // What the vehicle knows is there: no more questions.
  (void)vehicle.change(2, &random);
  (void)vehicle.change(3, &random);
  feed(&receiver, vehicle.repeat(2));
  feed(&receiver, vehicle.repeat(3));
  for (int k = 0; k < 4000; ++k) {
    now_us += 5'000;
    assert_true(tiles_asked_for(sent_up(&receiver, now_us)).empty());
  }
}

// Of the session before nothing is wanted any more, and its agreement is none of the new one's.
TEST(a_new_session_forgets_what_the_last_one_wanted) {
  Random random;
  Receiver receiver;
  Speaker vehicle(reporting_hello());
  feed(&receiver, hello_frame(reporting_hello()));
  feed(&receiver, vehicle.change(5, &random));
  assert_false(receiver.agreed());
  feed(&receiver, digest_frame(digest_of(receiver, 0, 0)));
  assert_true(receiver.agreed());
  leadline::proto::Digest whole = digest_of(receiver, 0, 0);
  whole.hashes[0] ^= 1U;
  feed(&receiver, digest_frame(whole));
  leadline::proto::Digest digest = digest_of(receiver, 3, 4);
  digest.hashes[2] ^= 1U;  // of tile 5
  feed(&receiver, digest_frame(digest));
  receiver.look(7, 2);
  feed(&receiver, hello_frame(reporting_hello(2)));
  assert_false(receiver.agreed());
  feed(&receiver, digest_frame(digest));  // late: a word about the map that was
  for (std::int64_t now_us = 1'000'000; now_us < 8'000'000; now_us += 5'000) {
    for (const Bytes& payload : sent_up(&receiver, now_us)) {
      assert_true(payload[0] == static_cast<std::uint8_t>(leadline::proto::MessageType::kReport));
    }
  }
}

TEST(the_agreement_on_one_map_is_none_on_the_next) {
  Receiver receiver;
  feed(&receiver, hello_frame(reporting_hello()));
  feed(&receiver, digest_frame(digest_of(receiver, 0, 0)));
  assert_true(receiver.agreed());
  feed(&receiver, hello_frame(reporting_hello(2)));
  assert_false(receiver.agreed());
}

/// Numbers of frames that reports among these name, each once; `asked`: whether one answers a question.
std::set<int> frames_named(const std::vector<Bytes>& payloads, bool* asked = nullptr) {
  std::set<int> numbers;
  for (const Bytes& payload : payloads) {
    const auto report = leadline::proto::decode_report(payload.data(), payload.size());
    for (int i = 0; report.ok() && i < 8 * report.value().mask_bytes; ++i) {
      if (report.value().came(static_cast<std::uint32_t>(i))) {
        numbers.insert(report.value().newest - i);
      }
    }
    if (asked != nullptr && report.ok()) {
      *asked = *asked || report.value().asked;
    }
  }
  return numbers;
}

/// All that goes up in the next five seconds.
std::vector<Bytes> sent_up_from(Receiver* receiver, std::int64_t from_us) {
  std::vector<Bytes> all;
  for (std::int64_t now_us = from_us; now_us < from_us + 5'000'000; now_us += 5'000) {
    for (Bytes& payload : sent_up(receiver, now_us)) {
      all.push_back(std::move(payload));
    }
  }
  return all;
}

// A name of the session before would confirm a frame of this one that was lost.
TEST(reports_name_frames_of_this_session_only) {
  Random random;
  Receiver receiver;
  Speaker first(reporting_hello(1));
  feed(&receiver, hello_frame(reporting_hello(1)));
  for (int k = 0; k < 9; ++k) {
    feed(&receiver, first.change(0, &random));
  }
  std::uint8_t payload[leadline::proto::kQuestion_bytes];
  const leadline::proto::Question question{receiver.store()->tag(), 9};
  const Bytes question_frame =
      frame(payload, encode_question(question, payload, sizeof payload).value());
  feed(&receiver, question_frame);
  Speaker second(reporting_hello(2));
  (void)second.change(0, &random);  // is lost
  feed(&receiver, second.change(0, &random));
  feed(&receiver, hello_frame(reporting_hello(2)));
  feed(&receiver, question_frame);  // late
  bool asked = false;
  assert_true(frames_named(sent_up_from(&receiver, 1'000'000), &asked) == std::set<int>{2});
  assert_false(asked);
  const std::uint64_t others = receiver.counters().other_surveys;
  assert_int_equal(others, 1);
}

// A packet that says more than its cells, with a right CRC: what was in it did not come.
TEST(a_packet_that_cannot_be_read_is_not_named) {
  Random random;
  Receiver receiver;
  Speaker vehicle(reporting_hello());
  feed(&receiver, hello_frame(reporting_hello()));
  feed(&receiver, vehicle.change(0, &random));
  const Bytes packet = vehicle.change(0, &random);
  leadline::proto::FrameDecoderBuffer<> buffer;
  leadline::proto::FrameView view{};
  std::size_t used = 0;
  assert_true(buffer.decoder().feed(packet.data(), packet.size(), used, view));
  Bytes longer(view.payload, view.payload + view.payload_bytes);
  longer.insert(longer.end(), 40, 0x55);
  feed(&receiver, frame(longer.data(), longer.size()));
  assert_int_equal(receiver.counters().malformed, 1);
  assert_true(frames_named(sent_up_from(&receiver, 1'000'000)) == std::set<int>{1});
}

// One hash differs: that tile is asked for, alone, and once for each time that it is said.
TEST(a_tile_whose_hash_differs_is_asked_for) {
  Random random;
  Receiver receiver;
  Speaker vehicle(reporting_hello());
  feed(&receiver, hello_frame(reporting_hello()));
  feed(&receiver, vehicle.change(5, &random));
  leadline::proto::Digest digest = digest_of(receiver, 3, 4);
  feed(&receiver, digest_frame(digest));
  assert_true(tiles_asked_for(sent_up(&receiver, 1'000'000)).empty());
  digest.hashes[2] ^= 1U;
  feed(&receiver, digest_frame(digest));
  const auto asked = tiles_asked_for(sent_up(&receiver, 1'010'000));
  assert_int_equal(asked.size(), 1);
  assert_int_equal(asked[0], 5);
  assert_true(tiles_asked_for(sent_up(&receiver, 1'020'000)).empty());
  // A word over everything that differs: the vehicle is asked for finer hashes, again after 4 s, 8 s .., five times.
  leadline::proto::Digest whole = digest_of(receiver, 0, 0);
  whole.hashes[0] ^= 1U;
  feed(&receiver, digest_frame(whole));
  std::vector<std::int64_t> asked_us;
  for (std::int64_t now_us = 1'030'000; now_us < 200'000'000; now_us += 5'000) {
    for (const Bytes& payload : sent_up(&receiver, now_us)) {
      const auto finer = leadline::proto::decode_digest_request(payload.data(), payload.size());
      if (finer.ok()) {
        assert_int_equal(finer.value().range.first, 0);
        assert_int_equal(finer.value().range.count, 16);
        asked_us.push_back(now_us);
      }
    }
  }
  assert_int_equal(asked_us.size(), 5);
  assert_in_range(asked_us[1] - asked_us[0], 4'000'000, 4'100'000);
  assert_in_range(asked_us[4] - asked_us[3], 32'000'000, 32'100'000);
  assert_false(receiver.agreed());
}

// As long as much is on its way, hashes differ for that reason. And the newest word over everything counts: what an
// earlier one found is settled by one that agrees.
TEST(hashes_are_asked_about_once_little_is_left_and_the_last_word_counts) {
  Receiver receiver;
  feed(&receiver, hello_frame(reporting_hello()));
  const auto asks_finer = [&receiver](std::int64_t now_us) {
    const auto payloads = sent_up(&receiver, now_us);
    return std::any_of(payloads.begin(), payloads.end(), [](const Bytes& payload) {
      return leadline::proto::decode_digest_request(payload.data(), payload.size()).ok();
    });
  };
  leadline::proto::Digest whole = digest_of(receiver, 0, 0);
  whole.hashes[0] ^= 1U;
  feed(&receiver, status_frame(0, 9, 0));
  feed(&receiver, digest_frame(whole));
  assert_false(asks_finer(1'000'000));
  feed(&receiver, status_frame(0, 8, 0));
  assert_true(asks_finer(1'100'000));
  leadline::proto::Digest part = digest_of(receiver, 3, 4);
  part.hashes[2] ^= 1U;
  feed(&receiver, digest_frame(part));
  whole.hashes[0] ^= 1U;
  feed(&receiver, digest_frame(whole));
  assert_true(receiver.agreed());
  for (std::int64_t now_us = 1'200'000; now_us < 30'000'000; now_us += 5'000) {
    for (const Bytes& payload : sent_up(&receiver, now_us)) {
      assert_true(payload[0] == static_cast<std::uint8_t>(leadline::proto::MessageType::kReport));
    }
  }
}

// Fifteen tiles in steps of two: the last step is a tile alone, and its hash that of a step.
TEST(a_step_that_the_grid_cuts_hashes_as_the_vehicle_does_it) {
  Random random;
  Hello hello = reporting_hello();
  hello.size_cells[0] = 80;
  hello.size_cells[1] = 48;
  Receiver receiver;
  Speaker vehicle(hello);
  feed(&receiver, hello_frame(hello));
  feed(&receiver, vehicle.change(14, &random));
  assert_int_equal(receiver.store()->tile_count(), 15);
  leadline::proto::Digest digest{};
  digest.survey_tag = receiver.store()->tag();
  digest.tiles_log2 = 1;
  digest.hash_count = 8;
  for (std::uint32_t k = 0; k < 8; ++k) {
    std::uint64_t hash = leadline::proto::kFnvOffset;
    for (std::uint32_t tile = 2 * k; tile < std::min(2 * k + 2, 15U); ++tile) {
      hash = leadline::proto::add_digest_tile(hash, receiver.store()->hash32(tile));
    }
    digest.hashes[k] = leadline::proto::fold_hash(hash);
  }
  const auto range_asked = [&receiver](std::int64_t now_us) {
    leadline::proto::TileRange range{};
    for (const Bytes& payload : sent_up(&receiver, now_us)) {
      const auto finer = leadline::proto::decode_digest_request(payload.data(), payload.size());
      range = finer.ok() ? finer.value().range : range;
    }
    return range;
  };
  feed(&receiver, digest_frame(digest));
  assert_int_equal(range_asked(1'000'000).count, 0);
  digest.hashes[7] ^= 1U;
  feed(&receiver, digest_frame(digest));
  const auto range = range_asked(1'100'000);
  assert_int_equal(range.first, 14);
  assert_int_equal(range.count, 1);
}

TEST(where_the_topside_looks_is_said_again_and_its_end_once) {
  Receiver receiver;
  feed(&receiver, hello_frame(reporting_hello()));
  std::vector<std::int64_t> said_us;
  std::uint8_t radius_tiles = 0;
  const auto listen = [&](std::int64_t from_us, std::int64_t until_us) {
    said_us.clear();
    for (std::int64_t now_us = from_us; now_us < until_us; now_us += 20'000) {
      if (now_us % 500'000 == 0) {  // what comes pays for what goes
        feed(&receiver, status_frame(0, 0, static_cast<std::uint64_t>(now_us / 500'000)));
      }
      for (const Bytes& payload : sent_up(&receiver, now_us)) {
        const auto look = leadline::proto::decode_look(payload.data(), payload.size());
        if (look.ok()) {
          assert_int_equal(look.value().tile, 7);
          radius_tiles = look.value().radius_tiles;
          said_us.push_back(now_us - from_us);
        }
      }
    }
  };
  receiver.look(7, 2);
  listen(1'000'000, 51'000'000);
  assert_int_equal(said_us.size(), 3);
  assert_in_range(said_us[0], 0, 500'000);
  assert_in_range(said_us[1] - said_us[0], 20'000'000, 21'000'000);
  assert_int_equal(radius_tiles, 2);
  receiver.look(7, 0);
  listen(51'000'000, 120'000'000);
  assert_int_equal(said_us.size(), 1);
  assert_int_equal(radius_tiles, 0);
}

TEST(what_a_log_said_of_its_map_is_not_said_of_the_next) {
  Receiver receiver;
  feed(&receiver, hello_frame(grid_hello(11, 1)));
  leadline::proto::LogEnd end{};
  end.cells_hash = 77;
  std::uint8_t payload[leadline::proto::kMaxPayload_bytes];
  feed(&receiver, frame(payload, encode_log_end(end, payload, sizeof payload).value()));
  assert_true(receiver.vehicle_cells_hash() == std::optional<std::uint64_t>(77));
  feed(&receiver, hello_frame(grid_hello(11, 2)));
  assert_false(receiver.vehicle_cells_hash().has_value());
}

TEST(the_same_survey_in_another_place_is_another_map) {
  Receiver receiver;
  int replaced = 0;
  receiver.on_replaced = [&replaced](const TileStore&) { ++replaced; };
  Hello hello = grid_hello();
  for (int change = 0; change < 3; ++change) {
    feed(&receiver, hello_frame(hello));
    feed(&receiver, hello_frame(hello));
    assert_int_equal(replaced, change);
    if (change == 0) {
      hello.origin_mm[1] += 1000;
    } else {
      hello.size_cells[2] += 1;
    }
  }
}

// A hello that never comes does not fill the memory, and the echo of our own word is none of the vehicle's.
TEST(what_waits_for_a_hello_is_bounded_and_an_echo_counts_for_nothing) {
  Random random;
  Receiver receiver;
  Speaker vehicle(grid_hello());
  const Bytes packet = vehicle.change(3, &random);
  for (int k = 0; k < 4100; ++k) {
    feed(&receiver, packet);
  }
  assert_int_equal(receiver.counters().before_hello, 4);
  const std::uint64_t bytes = receiver.counters().link_bytes;
  assert_int_equal(bytes, 4100 * packet.size());
  feed(&receiver, leadline::host::hello_request_frame());
  assert_int_equal(receiver.counters().link_bytes, bytes);
  feed(&receiver, hello_frame(grid_hello()));
  assert_int_equal(receiver.counters().deltas, 4096);
}

TEST(garbage_is_counted_and_nothing_else) {
  Random random;
  Receiver receiver;
  Bytes noise(100'000);
  for (std::uint8_t& byte : noise) {
    byte = static_cast<std::uint8_t>(random.between(0, 255));
  }
  feed(&receiver, noise);
  assert_true(receiver.store() == nullptr);
  assert_int_equal(receiver.counters().bytes, 100'000);
  assert_true(receiver.counters().damaged_frames > 100);
  // Right frames, senseless payloads.
  for (int type = 0; type < 256; ++type) {
    const std::uint8_t payload[3] = {static_cast<std::uint8_t>(type), 1, 0};
    try {
      feed(&receiver, frame(payload, sizeof payload));
    } catch (const HostError&) {
      fail_msg("type %d", type);
    }
  }
  assert_true(receiver.store() == nullptr);
  assert_true(receiver.counters().unknown_types > 200);
  assert_true(receiver.counters().malformed >= 3);
}

TEST(texts_and_alarms_come_in_words) {
  Receiver receiver;
  const auto text = leadline::proto::make_text(5, leadline::proto::Severity::kWarning, "No pose");
  std::uint8_t payload[300];
  const auto size = encode_text(text, payload, sizeof payload);
  feed(&receiver, frame(payload, size.value()));
  const auto said = receiver.take_notices();
  assert_int_equal(said.size(), 1);
  assert_true(said[0].text == "No pose");
  assert_true(said[0].severity == leadline::proto::Severity::kWarning);
  assert_true(receiver.take_notices().empty());
  assert_true(leadline::host::alarm_text(0).empty());
  assert_true(leadline::host::alarm_text(leadline::proto::kAlarmMappingPaused |
                                         leadline::proto::kAlarmNoPose) ==
              "mapping paused, no pose");
  assert_true(leadline::host::alarm_text(1U << 30U) == "alarm 30");
}

}  // namespace
