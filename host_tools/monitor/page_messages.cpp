#include "host_tools/monitor/page_messages.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <nlohmann/json.hpp>

#include "host_tools/render/colour_map.hpp"

namespace leadline::host {
namespace {

enum class Kind : std::uint8_t { kTiles = 1, kTrack = 2, kComplete = 3, kCoarseTiles = 4 };

void put_u32(std::vector<std::uint8_t>* out, std::uint32_t value) {
  for (unsigned shift = 0; shift < 32; shift += 8) {
    out->push_back(static_cast<std::uint8_t>(value >> shift));
  }
}

void put_f32(std::vector<std::uint8_t>* out, float value) {
  std::uint32_t bits = 0;
  static_assert(sizeof bits == sizeof value);
  std::memcpy(&bits, &value, sizeof bits);
  put_u32(out, bits);
}

PageMessage begin(Kind kind, std::size_t count, std::uint32_t epoch) {
  PageMessage message;
  message.bytes = {static_cast<std::uint8_t>(kind), 0, static_cast<std::uint8_t>(count & 255U),
                   static_cast<std::uint8_t>(count >> 8U)};
  put_u32(&message.bytes, epoch);
  return message;
}

PageMessage state_message(const PageContent& content, PageCursor* cursor) {
  cursor->state = content.state_number;
  return {true, {content.state_json->begin(), content.state_json->end()}};
}

PageMessage track_message(const Track& track, PageCursor* cursor) {
  const std::size_t first = cursor->track_points;
  const std::size_t count = std::min(track.points().size() - first, kMaxPointsPerMessage);
  PageMessage message = begin(Kind::kTrack, count, cursor->epoch);
  put_u32(&message.bytes, static_cast<std::uint32_t>(first));
  for (std::size_t k = first; k < first + count; ++k) {
    const TrackPoint& point = track.points()[k];
    for (const float value : {point.north_m, point.east_m, point.down_m, point.t_s}) {
      put_f32(&message.bytes, value);
    }
  }
  cursor->track_points = first + count;
  return message;
}

bool has_coarse(const LiveTile& tile) {
  return std::any_of(tile.coarse.begin(), tile.coarse.end(),
                     [](proto::CodedCell cell) { return proto::cell_known(cell); });
}

// As many of the tiles, in their order, as are of one kind.
PageMessage tiles_message(const LiveMap& map, std::vector<std::uint32_t> tiles,
                          PageCursor* cursor) {
  const bool coarse = has_coarse(*map.tile(tiles.front()));
  tiles.erase(std::find_if(tiles.begin(), tiles.end(),
                           [&](std::uint32_t id) { return has_coarse(*map.tile(id)) != coarse; }),
              tiles.end());
  if (coarse && tiles.size() > kMaxCoarseTilesPerMessage) {
    tiles.resize(kMaxCoarseTilesPerMessage);
  }
  PageMessage message =
      begin(coarse ? Kind::kCoarseTiles : Kind::kTiles, tiles.size(), cursor->epoch);
  message.bytes.reserve(kTileHeader_bytes +
                        tiles.size() * (coarse ? kCoarsePageTile_bytes : kPageTile_bytes));
  for (const std::uint32_t id : tiles) {
    const LiveTile& tile = *map.tile(id);
    put_u32(&message.bytes, id);
    for (const proto::CodedCell cell : tile.cells) {
      put_u32(&message.bytes, cell);
    }
    for (const std::uint32_t time_ds : tile.time_ds) {
      put_u32(&message.bytes, time_ds);
    }
    for (std::size_t k = 0; coarse && k < tile.coarse.size(); ++k) {
      put_u32(&message.bytes, tile.coarse[k]);
    }
    cursor->change = tile.change;
  }
  return message;
}

}  // namespace

std::string palettes_json() {
  nlohmann::ordered_json json;
  json["type"] = "palettes";
  const auto add = [&json](const char* name, const render::ColourMap& map) {
    for (const render::Colour& colour : map.table()) {
      for (const double part : {colour.red, colour.green, colour.blue}) {
        json[name].push_back(static_cast<int>(std::lround(part * 255.0)));
      }
    }
  };
  add("depth", render::ColourMap::depth());
  add("uncertainty", render::ColourMap::uncertainty());
  return json.dump();
}

std::optional<PageMessage> next_page_message(const PageContent& content, PageCursor* cursor) {
  const LiveMap& map = *content.map;
  const Track& track = *content.track;
  if (!cursor->palettes) {
    cursor->palettes = true;
    return PageMessage{true, {content.palettes_json->begin(), content.palettes_json->end()}};
  }
  if (cursor->state != content.state_number) {
    return state_message(content, cursor);
  }
  if (cursor->state == 0 || !content.settled || !map.hello()) {
    return std::nullopt;
  }
  if (cursor->epoch != map.epoch()) {
    *cursor = PageCursor{map.epoch(), 0, track.revision(), 0, cursor->state, true, false};
  }
  if (cursor->track_revision != track.revision()) {
    cursor->track_revision = track.revision();
    cursor->track_points = 0;
  }
  if (cursor->track_points < track.points().size()) {
    return track_message(track, cursor);
  }
  const std::vector<std::uint32_t> tiles = map.changed_after(cursor->change, kMaxTilesPerMessage);
  if (!tiles.empty()) {
    return tiles_message(map, tiles, cursor);
  }
  if (!cursor->complete) {
    cursor->complete = true;
    return begin(Kind::kComplete, 0, cursor->epoch);
  }
  return std::nullopt;
}

std::optional<PageRequest> parse_page_request(std::string_view text) {
  if (text.size() > kMaxRequest_bytes) {
    return std::nullopt;
  }
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("type") || !json["type"].is_string()) {
    return std::nullopt;
  }
  const auto number = [&json](const char* key) {
    return json.contains(key) && json[key].is_number() ? json[key].get<double>() : std::nan("");
  };
  const std::string type = json["type"].get<std::string>();
  PageRequest request;
  if (type == "seek") {
    request.kind = PageRequest::Kind::kSeek;
    request.t_s = number("t_s");
    // 1e9 s: thirty years; beyond it no time in microseconds is in danger.
    const bool good = request.t_s >= 0.0 && request.t_s <= 1e9;
    return good ? std::optional<PageRequest>(request) : std::nullopt;
  }
  if (type == "play") {
    request.kind = PageRequest::Kind::kPlay;
    request.speed = number("speed");
    const bool good = request.speed >= 0.1 && request.speed <= 1000.0;
    return good ? std::optional<PageRequest>(request) : std::nullopt;
  }
  return type == "pause" ? std::optional<PageRequest>(request) : std::nullopt;
}

}  // namespace leadline::host
