// What a viewer of the live map is sent, without a network.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "host_tools/exit_codes.hpp"
#include "host_tools/monitor/live_map.hpp"
#include "host_tools/monitor/page_messages.hpp"
#include "host_tools/monitor/page_state.hpp"
#include "host_tools/monitor/player.hpp"
#include "host_tools/monitor/rate_window.hpp"
#include "host_tools/monitor/track.hpp"
#include "host_tools/topside/receiver.hpp"
#include "model/base/pose.hpp"
#include "tests/support/proto_samples.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::kDisputedCell;
using leadline::host::kPageTile_bytes;
using leadline::host::kTileHeader_bytes;
using leadline::host::LiveMap;
using leadline::host::LiveTile;
using leadline::host::next_page_message;
using leadline::host::OpenedSurvey;
using leadline::host::PageContent;
using leadline::host::PageCursor;
using leadline::host::PageMessage;
using leadline::host::PageRequest;
using leadline::host::PageState;
using leadline::host::PageSurroundings;
using leadline::host::parse_page_request;
using leadline::host::RateWindow;
using leadline::host::TileStore;
using leadline::host::Track;
using leadline::host::TrackPoint;
using leadline::proto::CodedCell;
using leadline::proto::Hello;
using leadline::proto::kTileArea_cells;
using leadline::proto::TileDelta;

Hello square_grid(std::int32_t side_cells, std::uint32_t session = 1) {
  Hello hello = leadline::test::grid_hello(side_cells, side_cells);
  hello.session = session;
  return hello;
}

/// One cell of a tile changes.
TileDelta change(std::uint32_t tile, std::uint32_t generation, int cell, std::int32_t depth_q8) {
  TileDelta delta{};
  delta.tile = tile;
  delta.generation = generation;
  delta.changed.set(cell);
  delta.cell_count = 1;
  delta.cells[cell] = leadline::proto::code_cell(depth_q8, 1024, 0);
  return delta;
}

std::uint32_t word(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  return std::uint32_t{bytes[at]} | std::uint32_t{bytes[at + 1]} << 8U |
         std::uint32_t{bytes[at + 2]} << 16U | std::uint32_t{bytes[at + 3]} << 24U;
}

/// A page: what it makes of the messages.
struct Viewer {
  PageCursor cursor;
  std::map<std::uint32_t, std::vector<std::uint32_t>> tiles;
  std::vector<std::string> texts;
  std::size_t track_points = 0;
  std::size_t tile_messages = 0;
  std::size_t bytes = 0;
  int complete = 0;

  void take(const PageMessage& message) {
    bytes += message.bytes.size();
    if (message.text) {
      texts.emplace_back(message.bytes.begin(), message.bytes.end());
      return;
    }
    const std::size_t count = message.bytes[2] + 256U * message.bytes[3];
    if (message.bytes[0] == 1) {
      assert_int_equal(message.bytes.size(), kTileHeader_bytes + count * kPageTile_bytes);
      tile_messages += 1;
      for (std::size_t k = 0; k < count; ++k) {
        const std::size_t at = kTileHeader_bytes + k * kPageTile_bytes;
        std::vector<std::uint32_t>& tile = tiles[word(message.bytes, at)];
        tile.clear();
        for (std::size_t i = 0; i < 2 * std::size_t{kTileArea_cells}; ++i) {
          tile.push_back(word(message.bytes, at + 4 + 4 * i));
        }
      }
    } else if (message.bytes[0] == 2) {
      track_points = word(message.bytes, 8) + count;
    } else {
      assert_int_equal(message.bytes[0], 3);
      complete += 1;
    }
  }
};

struct Stage {
  std::string palettes = leadline::host::palettes_json();
  std::string state = R"({"type": "state"})";
  LiveMap map;
  Track track;
  std::uint64_t state_number = 1;
  bool settled = true;

  [[nodiscard]] PageContent content() const {
    return {&palettes, &map, &track, state_number, &state, settled};
  }
  /// Sends all that there is; returns the messages.
  std::size_t serve(Viewer* viewer) const {
    std::size_t count = 0;
    while (const auto message = next_page_message(content(), &viewer->cursor)) {
      viewer->take(*message);
      count += 1;
      assert_true(count < 10'000);
    }
    return count;
  }
};

void assert_same_map(const Viewer& viewer, const TileStore& store) {
  std::size_t known = 0;
  for (std::uint32_t id = 0; id < store.tile_count(); ++id) {
    const auto view = store.tile(id);
    if (!view) {
      continue;
    }
    known += 1;
    const auto found = viewer.tiles.find(id);
    assert_true(found != viewer.tiles.end());
    for (std::size_t k = 0; k < kTileArea_cells; ++k) {
      assert_int_equal(found->second[k], view->cells[k]);
    }
  }
  assert_int_equal(viewer.tiles.size(), known);
}

TEST(a_stored_survey_is_described_as_one_and_its_disputed_cells_are_marked) {
  OpenedSurvey opened;
  opened.map = std::make_unique<TileStore>(square_grid(32));
  (void)opened.map->apply(change(2, 1, 7, 2000));
  opened.survey.number = 4;
  opened.survey.kind = "merged";
  opened.survey.name = "both days";
  opened.disputed.resize(4);
  opened.disputed[2].set(7);
  opened.disputed[3].set(0);  // of a tile that never came

  LiveMap map;
  map.follow(*opened.map, 0);
  map.mark_disputed(opened.disputed);
  const LiveTile& tile = *map.tile(2);
  assert_int_equal(tile.cells[7], opened.map->tile(2)->cells[7] | kDisputedCell);
  assert_int_equal(tile.cells[8], opened.map->tile(2)->cells[8]);
  assert_null(map.tile(3));

  PageSurroundings around;
  around.stored = &opened;
  around.stored_path = "a.lls#4";
  const auto json =
      nlohmann::json::parse(PageState().json(leadline::host::Receiver{}, around, 0.0));
  assert_string_equal(json["map"]["name"].get<std::string>().c_str(), "both days");
  assert_int_equal(json["map"]["known_cells"].get<int>(), opened.map->known_cells());
  assert_int_equal(json["stored"]["number"].get<int>(), 4);
  assert_int_equal(json["stored"]["disputed_cells"].get<int>(), 2);
  assert_true(json["vehicle"].is_null() && json["player"].is_null());
}

TEST(who_comes_late_gets_everything_once_then_changes_only) {
  Stage stage;
  TileStore store(square_grid(160));  // 100 tiles
  for (std::uint32_t tile = 0; tile < 100; ++tile) {
    (void)store.apply(change(tile, 1, 3, 2000 + static_cast<std::int32_t>(tile) * 16));
  }
  stage.map.follow(store, 5'000'000);
  Viewer viewer;
  (void)stage.serve(&viewer);
  assert_same_map(viewer, store);
  assert_int_equal(viewer.texts.size(), 2);  // palettes, state
  assert_int_equal(viewer.tile_messages, 4);
  assert_int_equal(viewer.complete, 1);
  assert_int_equal(stage.serve(&viewer), 0);

  (void)store.apply(change(42, 2, 7, 3000));
  stage.map.follow(store, 6'000'000);
  const std::size_t before = viewer.bytes;
  assert_int_equal(stage.serve(&viewer), 1);
  assert_int_equal(viewer.bytes - before, kTileHeader_bytes + kPageTile_bytes);
  assert_same_map(viewer, store);
  // Times: the cell that changed later is younger.
  assert_int_equal(viewer.tiles[42][kTileArea_cells + 3], 50);
  assert_int_equal(viewer.tiles[42][kTileArea_cells + 7], 60);
}

TEST(random_changes_reach_viewers_of_any_pace) {
  leadline::test::Random random(11);
  Stage stage;
  TileStore store(square_grid(96));  // 36 tiles
  std::vector<std::uint32_t> generations(36, 0);
  Viewer eager;
  Viewer lazy;
  for (int round = 0; round < 500; ++round) {
    const auto changes = random.between(0, 12);
    for (std::int64_t k = 0; k < changes; ++k) {
      const auto tile = static_cast<std::uint32_t>(random.between(0, 35));
      (void)store.apply(change(tile, ++generations[tile], static_cast<int>(random.between(0, 255)),
                               static_cast<std::int32_t>(random.between(0, 16'000))));
    }
    stage.map.follow(store, round * 100'000);
    (void)stage.serve(&eager);
    assert_same_map(eager, store);
    if (random.between(0, 39) == 0) {  // one message now and then
      if (const auto message = next_page_message(stage.content(), &lazy.cursor)) {
        lazy.take(*message);
      }
    }
  }
  (void)stage.serve(&lazy);
  assert_same_map(lazy, store);
  // What changed again while he was away came once.
  assert_true(lazy.bytes < eager.bytes / 4);
}

TEST(another_map_begins_a_new_epoch_and_a_seek_holds_tiles_back) {
  Stage stage;
  TileStore first(square_grid(64));
  (void)first.apply(change(3, 1, 0, 1000));
  stage.map.follow(first, 0);
  Viewer viewer;
  (void)stage.serve(&viewer);
  assert_int_equal(viewer.cursor.epoch, 1);

  stage.map.restart();
  assert_int_equal(stage.serve(&viewer), 0);  // nothing to show yet
  TileStore second(square_grid(64, 2));
  (void)second.apply(change(5, 1, 0, 1000));
  stage.map.follow(second, 0);
  stage.settled = false;
  assert_int_equal(stage.serve(&viewer), 0);
  stage.settled = true;
  viewer.tiles.clear();
  (void)stage.serve(&viewer);
  assert_int_equal(viewer.cursor.epoch, 2);
  assert_same_map(viewer, second);
  assert_int_equal(viewer.complete, 2);
}

TEST(a_state_never_waits_behind_more_than_one_message_of_tiles) {
  Stage stage;
  TileStore store(square_grid(320));  // 400 tiles
  for (std::uint32_t tile = 0; tile < 400; ++tile) {
    (void)store.apply(change(tile, 1, 0, 1000));
  }
  stage.map.follow(store, 0);
  Viewer viewer;
  for (int k = 0; k < 3; ++k) {  // palettes, state, tiles
    viewer.take(*next_page_message(stage.content(), &viewer.cursor));
  }
  assert_int_equal(viewer.tile_messages, 1);
  assert_true(viewer.bytes < 80'000);
  stage.state_number += 1;
  const auto message = next_page_message(stage.content(), &viewer.cursor);
  assert_true(message && message->text);
}

TEST(the_cost_of_an_update_does_not_grow_with_the_map) {
  std::vector<std::size_t> bytes;
  for (const std::int32_t side : {64, 256, 1024, 2048}) {
    Stage stage;
    TileStore store(square_grid(side));
    for (std::uint32_t tile = 0; tile < store.tile_count(); ++tile) {
      (void)store.apply(change(tile, 1, 0, 1000));
    }
    stage.map.follow(store, 0);
    Viewer viewer;
    (void)stage.serve(&viewer);
    const std::size_t before = viewer.bytes;
    for (std::uint32_t k = 0; k < 8; ++k) {
      (void)store.apply(change(k, 2, 1, 1000));
    }
    stage.map.follow(store, 100'000);
    assert_int_equal(stage.serve(&viewer), 1);
    bytes.push_back(viewer.bytes - before);
  }
  for (const std::size_t one : bytes) {
    assert_int_equal(one, kTileHeader_bytes + 8 * kPageTile_bytes);
  }
}

TEST(a_track_is_bounded_and_keeps_its_gaps) {
  Track track;
  const std::uint32_t revision = track.revision();
  track.add({0, 0, 0, 0}, 1.0);
  track.add({0.5F, 0, 0, 1}, 1.0);  // too near
  track.add({1.5F, 0, 0, 2}, 1.0);
  assert_int_equal(track.points().size(), 2);
  track.interrupt();
  track.interrupt();
  track.add({1.6F, 0, 0, 3}, 1.0);
  assert_int_equal(track.points().size(), 4);
  assert_true(std::isnan(track.points()[2].north_m));
  for (int k = 0; k < 200'000; ++k) {
    track.add({static_cast<float>(k) * 2.0F, 0, 0, static_cast<float>(k)}, 1.0);
    assert_true(track.points().size() <= Track::kMaxPoints);
  }
  assert_true(track.revision() != revision);
  assert_true(track.points().size() > Track::kMaxPoints / 8);
  // Nothing but gaps is bounded as well.
  for (int k = 0; k < 60'000; ++k) {
    track.interrupt();
    track.add({static_cast<float>(k), 0, 0, static_cast<float>(k)}, 1.0);
    assert_true(track.points().size() <= Track::kMaxPoints);
  }
}

std::size_t gaps_of(const Track& track) {
  return static_cast<std::size_t>(
      std::count_if(track.points().begin(), track.points().end(),
                    [](const TrackPoint& point) { return std::isnan(point.north_m); }));
}

TEST(a_track_is_not_drawn_over_what_nobody_saw) {
  Track track;
  leadline::proto::Status status{};
  const auto go = [&](std::int64_t t_s, std::int32_t north_m, std::uint16_t epoch,
                      std::uint32_t alarms, bool valid) {
    status.t_us = t_s * 1'000'000;
    status.position_mm[0] = north_m * 1000;
    status.pose_epoch = epoch;
    status.alarms = alarms;
    status.pose_validity = valid ? leadline::base::kPoseHorizontal : 0;
    track.follow(status, 0.1);
  };
  go(1, 0, 3, 0, true);
  go(2, 1, 3, 0, true);
  assert_int_equal(gaps_of(track), 0);
  go(3, 40, 4, 0, true);  // navigation jumped
  assert_int_equal(gaps_of(track), 1);
  go(4, 80, 4, leadline::proto::kAlarmPoseEpoch, true);  // and again, by a brief
  assert_int_equal(gaps_of(track), 2);
  go(5, 81, 4, leadline::proto::kAlarmPoseEpoch, true);  // still said
  assert_int_equal(gaps_of(track), 2);
  go(25, 82, 4, 0, true);
  assert_int_equal(gaps_of(track), 2);
  go(46, 90, 4, 0, true);  // a minute's silence
  assert_int_equal(gaps_of(track), 3);
  go(47, 90, 4, 0, false);
  go(48, 95, 4, 0, true);  // no position between
  assert_int_equal(gaps_of(track), 4);
  go(1, 96, 4, 0, true);  // its clock stepped back
  assert_int_equal(gaps_of(track), 5);
}

TEST(a_viewer_gets_a_thinned_track_anew) {
  Stage stage;
  TileStore store(square_grid(64));
  stage.map.follow(store, 0);
  Viewer viewer;
  for (int k = 0; k < 40'000; ++k) {
    stage.track.add({static_cast<float>(k) * 2.0F, 0, 0, 0}, 1.0);
    if (k % 100 == 0) {
      (void)stage.serve(&viewer);
      assert_int_equal(viewer.track_points, stage.track.points().size());
    }
  }
}

/// Frames of a flight: a status and a cell each second.
std::string recording(int seconds) {
  std::vector<std::uint8_t> payload(leadline::proto::kMaxPayload_bytes);
  std::string bytes;
  const auto add = [&](std::size_t size) {
    std::vector<std::uint8_t> frame(leadline::proto::frame_bound_bytes(size));
    frame.resize(
        leadline::proto::encode_frame(payload.data(), size, frame.data(), frame.size()).value());
    bytes.append(frame.begin(), frame.end());
  };
  add(leadline::proto::encode_hello(square_grid(64), payload.data(), payload.size()).value());
  for (int second = 0; second < seconds; ++second) {
    leadline::proto::Status status{};
    status.t_us = 50'000'000 + second * 1'000'000;
    add(leadline::proto::encode_status(status, payload.data(), payload.size()).value());
    CodedCell cells[kTileArea_cells] = {};
    cells[second] = leadline::proto::code_cell(1000 + second, 1024, 0);
    leadline::proto::CellMask changed{};
    changed.set(second);
    leadline::proto::CellMask taken{};
    add(leadline::proto::encode_tile({static_cast<std::uint32_t>(second % 16),
                                      static_cast<std::uint32_t>(second) + 1, cells, changed},
                                     leadline::proto::survey_tag(7, 1), payload.data(),
                                     payload.size(), taken)
            .value());
  }
  return bytes;
}

TEST(a_recording_is_moved_to_any_moment) {
  const std::string path = leadline::test::scratch_directory() + "/link.bin";
  // What was cut off at the end of a recording harms nothing.
  std::ofstream(path, std::ios::binary) << recording(101) << "\x05torn";
  leadline::host::Player player(path, 0.0);
  assert_float_equal(player.length_s(), 100.0, 1e-6);
  auto receiver = std::make_unique<leadline::host::Receiver>();
  int restarts = 0;
  double now_s = 7.0;
  const auto settle = [&](double elapsed_s) {
    now_s += elapsed_s;
    do {
      player.step(now_s, {[&] {
                            receiver = std::make_unique<leadline::host::Receiver>();
                            restarts += 1;
                          },
                          [&](const std::uint8_t* data, std::size_t size, leadline::base::TimeUs) {
                            receiver->feed(data, size);
                          }});
    } while (player.seeking());
    return receiver->store() == nullptr ? 0 : receiver->store()->known_cells();
  };
  const auto seek = [&](double t_s) {
    PageRequest request;
    request.kind = PageRequest::Kind::kSeek;
    request.t_s = t_s;
    player.take(request);
  };
  assert_int_equal(settle(0.0), 101);  // stands at the end
  const std::uint64_t whole = receiver->store()->cells_hash();
  seek(40.0);
  assert_int_equal(settle(0.0), 41);
  assert_int_equal(restarts, 1);
  seek(60.5);
  assert_int_equal(settle(0.0), 61);
  assert_int_equal(restarts, 1);  // ahead needs none
  seek(0.0);
  assert_int_equal(settle(0.0), 1);
  PageRequest play;
  play.kind = PageRequest::Kind::kPlay;
  play.speed = 10.0;
  player.take(play);
  assert_int_equal(settle(2.0), 21);
  player.take(PageRequest{});  // pause
  assert_int_equal(settle(100.0), 21);
  player.take(play);
  assert_int_equal(settle(1000.0), 101);
  assert_false(player.playing());
  assert_true(receiver->store()->cells_hash() == whole);
  player.take(play);  // from the beginning again
  assert_int_equal(settle(1.0), 1);
  assert_int_equal(settle(1.0), 11);
  seek(1e9);
  assert_int_equal(settle(0.0), 101);
  assert_true(receiver->store()->cells_hash() == whole);
  const std::string none = leadline::test::scratch_directory() + "/none.bin";
  std::ofstream(none) << "no frames here";
  try {
    const leadline::host::Player nothing(none, 0.0);
    fail_msg("a file without a frame was taken");
  } catch (const leadline::host::HostError& error) {
    assert_true(std::string(error.what()).find("holds no frame") != std::string::npos);
  }
}

TEST(rates_count_over_their_window_and_through_a_wrap) {
  RateWindow rate(10.0);
  assert_float_equal(rate.per_second(0.0), 0.0, 0.0);
  std::uint32_t count = 0xFFFFFF00U;
  for (int k = 0; k <= 300; ++k) {
    rate.add(0.1 * k, count);
    count += 10;  // 100 a second
  }
  assert_float_equal(rate.per_second(30.0), 100.0, 1.0);
  assert_float_equal(rate.per_second(35.0), 50.0, 8.0);  // it stopped at 30
  assert_float_equal(rate.per_second(60.0), 0.0, 35.0);
  rate.add(1.0, 5);  // time went back
  assert_float_equal(rate.per_second(1.0), 0.0, 0.0);
}

TEST(requests_of_a_page_are_read_and_all_else_refused) {
  const auto seek = parse_page_request(R"({"type": "seek", "t_s": 12.5})");
  assert_true(seek && seek->kind == PageRequest::Kind::kSeek);
  assert_float_equal(seek->t_s, 12.5, 0.0);
  const auto play = parse_page_request(R"({"type":"play","speed":10})");
  assert_true(play && play->kind == PageRequest::Kind::kPlay);
  assert_true(parse_page_request(R"({"type":"pause"})").has_value());
  const char* const bad[] = {"",
                             "{",
                             "[]",
                             "null",
                             "42",
                             "\"seek\"",
                             "{}",
                             R"({"type":1})",
                             R"({"type":"seek"})",
                             R"({"type":"seek","t_s":"1"})",
                             R"({"type":"seek","t_s":-1})",
                             R"({"type":"seek","t_s":1e300})",
                             R"({"type":"seek","t_s":1e999})",
                             R"({"type":"seek","t_s":null})",
                             R"({"type":"play","speed":0})",
                             R"({"type":"play","speed":1e9})",
                             R"({"type":"play"})",
                             R"({"type":"format_disk"})",
                             "\xff\xfe{}",
                             "{\"type\":\"pause\"} x"};
  for (const char* const text : bad) {
    assert_false(parse_page_request(text).has_value());
  }
  assert_false(parse_page_request(std::string(100'000, '[')).has_value());
  assert_false(parse_page_request(std::string(1000, '[')).has_value());
}

TEST(palettes_are_those_of_the_pictures) {
  const auto json = nlohmann::json::parse(leadline::host::palettes_json());
  assert_int_equal(json["depth"].size(), 3 * 256);
  assert_int_equal(json["uncertainty"].size(), 3 * 256);
  assert_true(json["depth"][0].get<int>() > 200);        // pale: shallow
  assert_true(json["depth"][3 * 255].get<int>() < 100);  // dark: deep
}

}  // namespace
