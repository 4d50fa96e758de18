// What a topside makes of the bytes of a link: frames, messages, the map, and counts of everything that
// was wrong. No I/O and no clock: bytes and time come in, so that a test can do to the bytes what it
// likes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "host_tools/topside/coarse_map.hpp"
#include "host_tools/topside/tile_store.hpp"
#include "host_tools/topside/uplink_planner.hpp"
#include "proto/framing.hpp"
#include "proto/messages.hpp"

namespace leadline::host {

/// Never decremented.
struct ReceiverCounters {
  std::uint64_t bytes = 0;
  std::uint64_t frames = 0;          ///< whole ones, CRC right
  std::uint64_t damaged_frames = 0;  ///< dropped by the framing, all reasons
  std::uint64_t link_bytes =
      0;  ///< of all frames of the downlink, framing included; no log records
  std::uint64_t hellos = 0;
  std::uint64_t deltas = 0;          ///< tiles in tile delta packets
  std::uint64_t delta_bytes = 0;     ///< of their frames, framing included
  std::uint64_t delta_cells = 0;     ///< cells that they carried
  std::uint64_t repeated_cells = 0;  ///< of these: known already, or older than what is known
  std::uint64_t coarse_deltas = 0;   ///< coarse tiles
  std::uint64_t statuses = 0;        ///< full ones and briefs
  std::uint64_t texts = 0;
  std::uint64_t digests = 0;
  std::uint64_t log_records = 0;    ///< records of a vehicle's log between the frames (file:)
  std::uint64_t unknown_types = 0;  ///< messages of a newer minor
  std::uint64_t malformed = 0;      ///< right CRC, but no message: a foreign sender
  std::uint64_t other_surveys = 0;  ///< packets of deltas of another survey or session
  std::uint64_t before_hello = 0;   ///< packets of deltas given up because no hello explained them
  std::uint64_t outside_grid = 0;
};

/// A line for the user.
struct ReceiverNotice {
  proto::Severity severity = proto::Severity::kInfo;
  std::string text;
};

/// How often a receiver is asked what to send up when nothing comes; a fast link waits for that.
inline constexpr base::TimeUs kUplinkPoll_us = 5'000;

/// The frame by which a topside asks for a hello, and says which version it speaks.
[[nodiscard]] std::vector<std::uint8_t> hello_request_frame();

class Receiver {
 public:
  /// `survey_id`: take this survey only and count all others; unset: the first that speaks, and then
  /// whichever says hello.
  explicit Receiver(std::optional<std::uint64_t> survey_id = std::nullopt);
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  /// Called when another survey or session begins, with the map of the one before.
  std::function<void(const TileStore& ended)> on_replaced;
  /// Called when a map begins, before anything is applied to it: to restore() what is known of it.
  std::function<void(TileStore& begun)> on_begun;

  /// Takes bytes of a stream, in pieces of any size. Throws HostError kInput when the vehicle speaks
  /// another major version of the protocol.
  void feed(const std::uint8_t* data, std::size_t size_bytes);

  /// The map; null before the first hello.
  [[nodiscard]] const TileStore* store() const { return store_.get(); }
  /// Coarse cells where the map knows nothing yet.
  [[nodiscard]] const CoarseMap& coarse() const { return coarse_; }
  [[nodiscard]] const std::optional<proto::Status>& status() const { return status_; }
  [[nodiscard]] const ReceiverCounters& counters() const { return counters_; }
  /// Bytes of tile deltas per cell that they carried; 0 when there is none.
  [[nodiscard]] double bytes_per_changed_cell() const;
  /// Bytes of everything that the link carried down, per the same.
  [[nodiscard]] double bytes_per_changed_cell_all() const;
  /// The most work of any cycle against what no cycle passes; none before a status has said the bound (a brief
  /// does not).
  [[nodiscard]] std::optional<double> work_share() const;
  /// What the end record of a log said of the vehicle's map, where one was read.
  [[nodiscard]] const std::optional<std::uint64_t>& vehicle_cells_hash() const {
    return vehicle_cells_hash_;
  }

  /// Texts of the vehicle and findings of the receiver since the last call.
  [[nodiscard]] std::vector<ReceiverNotice> take_notices();
  /// What to send up now, framed; empty: nothing. To be called when something came and every kUplinkPoll_us besides,
  /// with a clock that does not go back. Paces itself: a tenth of what the vehicle sends at most. A vehicle of minor 1 is told which
  /// frames came, and asked where its map differs; an older one is asked every 2 s for what is missing. While
  /// deltas come that no hello explains: the question for one, at first every 0.2 s or for every 500 bytes that come
  /// without it, then for every half as much again.
  [[nodiscard]] std::vector<std::uint8_t> uplink(base::TimeUs now_us);
  /// The topside looks at these tiles: they go before others. Radius 0: at nothing any more.
  void look(std::uint32_t tile, std::uint8_t radius_tiles) { planner_.look(tile, radius_tiles); }
  /// Whether the vehicle's last word over its whole map (a digest) was this map's own.
  [[nodiscard]] bool agreed() const { return planner_.agreed(); }
  /// For vehicles of minor 0. The request frame for what is missing, empty when nothing is; goes round from
  /// call to call.
  /// Missing are tiles whose hash says so; and, once a status tells that the vehicle has nothing more to
  /// send, tiles that it knows and that never came (who joins late), and everything, when it has sent
  /// more cells than came (the last word about a tile was lost: no hash tells). While frames come and no
  /// hello: the request for one.
  [[nodiscard]] std::vector<std::uint8_t> resend_request();

 private:
  void take(const proto::FrameView& frame);
  void take_hello(const proto::FrameView& frame);
  void take_delta(const std::uint8_t* payload, std::size_t size_bytes, std::size_t wire_bytes);
  void take_coarse(const std::uint8_t* payload, std::size_t size_bytes, std::size_t wire_bytes);
  void take_question(const proto::FrameView& frame);
  void take_status(const proto::FrameView& frame);
  void take_brief(const proto::FrameView& frame);
  void compare_sent(bool first);
  void take_text(const proto::FrameView& frame);
  void take_digest(const proto::FrameView& frame);
  void take_end(const proto::FrameView& frame);
  void notice(proto::Severity severity, std::string text);
  [[nodiscard]] proto::ResendRequest wanted();
  [[nodiscard]] bool of_this_map(std::uint16_t tag, const std::uint8_t* payload,
                                 std::size_t size_bytes, std::size_t wire_bytes);
  void explain(std::uint16_t tag);
  void take_early();
  void give_up_early(std::uint16_t tag);
  [[nodiscard]] bool hello_is_asked(base::TimeUs now_us);

  std::optional<std::uint64_t> wanted_survey_;
  proto::FrameDecoderBuffer<> buffer_;
  std::unique_ptr<TileStore> store_;
  CoarseMap coarse_;
  std::optional<proto::Status> status_;
  std::optional<std::uint64_t> vehicle_cells_hash_;
  ReceiverCounters counters_;
  std::vector<ReceiverNotice> notices_;
  /// Tile and coarse deltas that came before the hello that explains them. They are reported as come.
  struct EarlyPacket {
    std::uint16_t tag;
    std::vector<std::uint8_t> payload;
    std::size_t wire_bytes;
  };
  std::vector<EarlyPacket> early_;
  // Tags whose hello came, or was asked for in vain; and the question for the hello of others.
  std::set<std::uint16_t> explained_;
  struct HelloQuestion {
    bool wanted = false;
    std::optional<std::uint16_t> tag;  ///< of the deltas for which it is wanted
    int asked = 0;
    int after_bytes = 0;  ///< of these, because enough had come without it
    base::TimeUs asked_us = 0;
    std::uint64_t asked_bytes = 0;          ///< ReceiverCounters::link_bytes then
    std::optional<base::TimeUs> pace_us{};  ///< that the first such bytes took
  };
  HelloQuestion question_;
  std::size_t wire_bytes_ = 0;  ///< of the frame under way
  std::uint32_t resend_after_ = 0;
  // Cells that the vehicle sent less those that came, by its last status; what of it is made up for; and
  // what it was when everything was asked for.
  std::uint64_t map_cells_ = 0;  ///< cells that came for this map
  std::uint32_t cells_lost_ = 0;
  std::uint32_t cells_made_up_ = 0;
  std::optional<std::uint32_t> cells_lost_when_asked_;
  bool foreign_noticed_ = false;
  UplinkPlanner planner_;
  std::optional<base::TimeUs> asked_us_;  ///< resend_request(), last time
};

/// "mapping paused, no pose", "" for none. Bits that are not known are named by number.
[[nodiscard]] std::string alarm_text(std::uint32_t alarms);

}  // namespace leadline::host
