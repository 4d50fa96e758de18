// Which frames are under way, and what became of them: the topside reports the frames that came, and what
// later ones overtook, or nobody confirmed in time, was lost.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/units.hpp"
#include "model/capacity.hpp"
#include "model/grid.hpp"
#include "proto/tile_coder.hpp"

namespace leadline::firmware {

/// What a frame carried of a tile.
struct FrameTile {
  model::TileId tile;    ///< coarse: the coarse tile
  std::uint8_t epoch;    ///< LinkMap::epoch() when it left
  std::uint8_t version;  ///< LinkMap::version() then
  proto::CellMask cells;
  bool coarse = false;  ///< coarse cells (coarse_first.hpp)
};

/// A ring of the last frames with their tiles, in the order in which they left: one number after the other. 90 KB, 4 KB
/// with a map of less than 64 tiles. Static storage, not thread-safe; time is the vehicle's own and never goes back.
class LinkLedger {
 public:
  /// Powers of two; fewer on a target with a small map.
  static constexpr std::uint32_t kFrames = model::kTileCapacity >= 64 ? 256 : 64;
  static constexpr std::uint32_t kFrameTiles = model::kTileCapacity >= 512  ? 2048
                                               : model::kTileCapacity >= 64 ? 512
                                                                            : 64;

  LinkLedger() = default;
  LinkLedger(const LinkLedger&) = delete;
  LinkLedger& operator=(const LinkLedger&) = delete;

  /// Forgets all. first_patience_us: how long a report may take before one told. The next frame's number is
  /// `number`. O(kFrames).
  void reset(base::TimeUs first_patience_us, std::uint32_t number = 1);
  /// Of the frame that sent() will speak of: goes up by one a frame, modulo 2^32.
  [[nodiscard]] std::uint32_t next_number() const { return end_; }

  /// Whether a frame of `tile_count` tiles can be noted without giving up one that is under way; the oldest of those
  /// whose fate is known make room.
  [[nodiscard]] bool has_room(std::size_t tile_count);
  /// Gives up the oldest frame that is under way, and tells its tiles one by one: false when it has no more
  /// (it is out then). Only while under_way_frames() > 0.
  [[nodiscard]] bool give_up_oldest(FrameTile& tile);
  /// A frame leaves; has_room(tile_count) holds. through_us: when its last byte will be through the line; it takes
  /// frame_us of that.
  void sent(const FrameTile* tiles, std::size_t tile_count, base::TimeUs through_us,
            base::TimeUs frame_us);

  /// A report that came at `now_us` names a frame (its number modulo 2^16). While next_confirmed() gives tiles, they
  /// came: kCame, and those of kCameLate after next_lost() had told them. O(1).
  enum class Word : std::uint8_t { kNone, kCame, kCameLate };
  [[nodiscard]] Word confirm(std::uint16_t number16, base::TimeUs now_us);
  [[nodiscard]] bool next_confirmed(FrameTile& tile);
  /// A report that answers a question: what it did not name of the frames up to that number was lost.
  void answered(std::uint16_t number16);
  /// Whether to ask for a report, when there is nothing else to send; and that this was done.
  [[nodiscard]] bool question_due(base::TimeUs now_us) const;
  void asked(base::TimeUs through_us);
  /// These cells came, as they still are: frames under way that carry them too need not. O(kFrameTiles).
  void cover(const FrameTile& came);
  /// One tile after the other of frames that are lost by now: overtaken by kOvertaken later frames, passed
  /// over by a report that could have named them, or not confirmed for long (patience_us(), sooner when the
  /// link is `idle`). False when there is none (more).
  /// O(kFrames) in all.
  [[nodiscard]] bool next_lost(base::TimeUs now_us, bool idle, FrameTile& tile);
  /// When next_lost() has something to tell at the earliest if nothing else happens (as it found when it had told all),
  /// or question_due() becomes true.
  [[nodiscard]] base::TimeUs next_loss_us() const {
    const bool asks = under_way_ > 0 && question_due_us_ > 0 && question_due_us_ < next_loss_us_;
    return asks ? question_due_us_ : next_loss_us_;
  }

  /// Nothing is owed at the moment. Where nothing is under way either, what comes next is another matter.
  void note_rest();

  /// Whether somebody reports: a report came, and since then fewer than kMostTimeouts patiences in a row
  /// ended without one. Who does not report is not waited for.
  [[nodiscard]] bool heard() const { return heard_; }
  /// A report came then, with or without news.
  void note_report(base::TimeUs now_us);

  /// Frames that are neither confirmed nor lost.
  [[nodiscard]] std::uint32_t under_way_frames() const { return under_way_; }
  /// How long a frame may stay unconfirmed.
  [[nodiscard]] base::TimeUs patience_us() const;
  /// Share of frames that were lost lately, 1/65536: assumed to be 3/10 before anything is known.
  [[nodiscard]] std::uint32_t loss_q16() const { return loss_q16_; }

 private:
  /// kRepeated: for all that is known under way, and its cells go again.
  enum class State : std::uint8_t { kUnderWay, kConfirmed, kRepeated, kLost };
  struct Frame {
    base::TimeUs through_us;
    std::uint32_t first_tile;  ///< place in tiles_, modulo kFrameTiles
    std::uint8_t tile_count;
    State state;
  };

  static constexpr std::uint32_t kOvertaken = 3;
  static constexpr int kMostTimeouts = 9;

  [[nodiscard]] Frame& frame(std::uint32_t number) { return frames_[number % kFrames]; }
  [[nodiscard]] const Frame& frame(std::uint32_t number) const { return frames_[number % kFrames]; }
  void resolve(std::uint32_t number, State state);
  [[nodiscard]] std::uint32_t cells_of(std::uint32_t number) const;
  [[nodiscard]] bool find(std::uint16_t number16, std::uint32_t& number) const;
  [[nodiscard]] bool may_repeat(std::uint32_t number) const;
  [[nodiscard]] base::TimeUs named_us() const;
  [[nodiscard]] base::TimeUs silence_us(std::uint32_t number, bool idle) const;
  [[nodiscard]] base::TimeUs followed_us(std::uint32_t number) const;
  [[nodiscard]] State judge(std::uint32_t number, base::TimeUs now_us, bool idle);
  void count_silence(base::TimeUs now_us);
  void learn_loss(bool lost);
  void learn_round_trip(base::TimeUs measured_us);

  std::array<Frame, kFrames> frames_{};
  std::array<FrameTile, kFrameTiles> tiles_{};
  // Numbers of frames and of tiles count on modulo 2^32.
  std::uint32_t first_ = 0;  ///< the oldest in the ring
  std::uint32_t end_ = 0;    ///< behind the newest
  std::uint32_t tiles_end_ = 0;
  std::uint32_t newest_confirmed_ = 0;  ///< + 1; first_ where there is none
  std::uint32_t answered_ = 0;          ///< what is older and was not named was lost
  std::uint32_t under_way_ = 0;
  // Tiles being told by next_...().
  std::uint32_t telling_ = 0;  ///< place in tiles_
  std::uint8_t telling_count_ = 0;
  std::uint8_t given_up_ = 0;  ///< tiles of the oldest frame that give_up_oldest() has told
  base::TimeUs first_patience_us_ = 0;
  base::TimeUs round_trip_us_ = 0;
  base::TimeUs frame_us_ = 0;       ///< of the newest
  base::TimeUs report_gap_us_ = 0;  ///< between two reports while frames are under way
  base::TimeUs waiting_since_us_ = 0;
  base::TimeUs last_report_us_ = 0;
  bool waiting_ = false;            ///< frames left since the last report, or were under way then
  int timeouts_ = 0;                ///< in a row
  base::TimeUs busy_since_us_ = 0;  ///< since there was nothing under way
  // Since note_rest(); halved where they grow large.
  std::uint32_t sent_cells_ = 0;
  std::uint32_t under_way_cells_ =
      0;  ///< of these, whose fate is not known, nor that of the same cells in another frame
  std::uint32_t owed_again_cells_ = 0;  ///< of these, once more
  std::uint32_t loss_q16_ = 0;
  std::uint32_t long_loss_q16_ = 0;  ///< over more frames
  base::TimeUs next_loss_us_ = INT64_MAX;
  base::TimeUs question_due_us_ = 0;
  unsigned unanswered_ = 0;  ///< questions
  bool heard_ = false;
  bool loses_ = false;  ///< a report told of a loss
};

}  // namespace leadline::firmware
