// What the monitor and its page say to each other over the WebSocket; in words in host_tools/DESIGN.md, "The
// page's messages". Pure: no I/O, no clock.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/monitor/live_map.hpp"
#include "host_tools/monitor/track.hpp"

namespace leadline::host {

inline constexpr std::size_t kTileHeader_bytes = 8;
inline constexpr std::size_t kPageTile_bytes = 4 + 2 * 4 * proto::kTileArea_cells;
/// One with coarse cells that stand in for some.
inline constexpr std::size_t kCoarsePageTile_bytes =
    kPageTile_bytes + 4 * proto::kCoarseOfTile_cells;
/// Tiles of one message: below 64 KiB, so that a state never waits behind more.
inline constexpr std::size_t kMaxTilesPerMessage = 31;
inline constexpr std::size_t kMaxCoarseTilesPerMessage = 30;
inline constexpr std::size_t kMaxPointsPerMessage = 2048;
/// Longest message that a page may send.
inline constexpr std::size_t kMaxRequest_bytes = 1024;

/// One message to a page.
struct PageMessage {
  bool text = false;
  std::vector<std::uint8_t> bytes;
};

/// What a viewer has got. All that the monitor keeps for him, besides one message under way.
struct PageCursor {
  std::uint32_t epoch = 0;
  std::uint64_t change = 0;  ///< of the map
  std::uint32_t track_revision = 0;
  std::size_t track_points = 0;
  std::uint64_t state = 0;  ///< number of the last state sent
  bool palettes = false;
  bool complete = false;  ///< was told that he has everything
};

/// What there is to be seen.
struct PageContent {
  const std::string* palettes_json;  ///< palettes_json(), once for every viewer
  const LiveMap* map;
  const Track* track;
  std::uint64_t state_number;  ///< goes up with each state; 0: none yet
  const std::string* state_json;
  bool
      settled;  ///< the map is as it should be shown: no seek is under way, and the state describes it
};

/// The colours of render/colour_map.hpp, so that a page and a picture of one map look the same.
[[nodiscard]] std::string palettes_json();

/// The next message for a viewer, and his cursor behind it; nothing while he has everything. State before
/// track before tiles. O(message).
[[nodiscard]] std::optional<PageMessage> next_page_message(const PageContent& content,
                                                           PageCursor* cursor);

/// What a page asks of the player.
struct PageRequest {
  enum class Kind : std::uint8_t { kSeek, kPlay, kPause };
  Kind kind = Kind::kPause;
  double t_s = 0.0;    ///< kSeek: since the recording's first moment, finite, not negative
  double speed = 1.0;  ///< kPlay: 0.1 .. 1000
};

/// Nothing: not one of the above.
[[nodiscard]] std::optional<PageRequest> parse_page_request(std::string_view text);

}  // namespace leadline::host
