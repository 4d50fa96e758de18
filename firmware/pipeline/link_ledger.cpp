#include "firmware/pipeline/link_ledger.hpp"

#include "model/base/fixed.hpp"

namespace leadline::firmware {
namespace {

using base::max_of;
using base::min_of;
using base::TimeUs;

// Before a round trip was measured. A frame waits at least a few cycles for its report, and never for ever.
constexpr TimeUs kLeastPatience_us = 20'000;
constexpr TimeUs kLeastSlack_us = 10'000;
constexpr TimeUs kMostPatience_us = 60'000'000;
constexpr int kEvenTimeouts = 3;
// A line is fast when all that is under way since it was idle took less than so many round trips.
constexpr TimeUs kFastTrips = 8;
// One frame of so many may go again before anything is known of the first.
constexpr std::uint32_t kFramesPerHasty = 30;
constexpr std::uint32_t kFirstLoss_q16 = 19'661;
// The estimate follows the last 16 frames.
constexpr unsigned kLossMemory_log2 = 4;
// Numbers begin shortly before they wrap, so that no vehicle is the first to see it, after months.
constexpr std::uint32_t kFirstNumber = 0U - 2 * LinkLedger::kFrames;
constexpr std::uint32_t kFirstTile = 0U - LinkLedger::kFrameTiles;

}  // namespace

void LinkLedger::reset(TimeUs first_patience_us) {
  first_patience_us_ = first_patience_us;
  for (Frame& each : frames_) {
    each = Frame{};
  }
  first_ = end_ = newest_confirmed_ = kFirstNumber;
  tiles_end_ = kFirstTile;
  under_way_ = 0;
  telling_count_ = 0;
  given_up_ = 0;
  round_trip_us_ = report_gap_us_ = 0;
  waiting_since_us_ = 0;
  last_report_us_ = 0;
  busy_since_us_ = 0;
  busy_frames_ = hasty_frames_ = 0;
  waiting_ = false;
  timeouts_ = 0;
  loss_q16_ = kFirstLoss_q16;
  loses_ = false;
  heard_ = false;
}

bool LinkLedger::has_room(std::size_t tile_count) const {
  const std::uint32_t used = end_ == first_ ? 0 : tiles_end_ - frame(first_).first_tile;
  return end_ - first_ < kFrames && used + tile_count <= kFrameTiles;
}

// The oldest frames of the ring whose fate is known make room.
void LinkLedger::forget_resolved() {
  while (first_ != end_ && frame(first_).state >= State::kConfirmed) {
    ++first_;
  }
  if (static_cast<std::int32_t>(newest_confirmed_ - first_) < 0) {
    newest_confirmed_ = first_;
  }
}

bool LinkLedger::give_up_oldest(FrameTile& tile) {
  const Frame& oldest = frame(first_);
  if (given_up_ < oldest.tile_count) {
    tile = tiles_[(oldest.first_tile + given_up_) % kFrameTiles];
    ++given_up_;
    return true;
  }
  given_up_ = 0;
  resolve(first_, State::kLost);
  forget_resolved();
  return false;
}

void LinkLedger::sent(std::uint16_t tag, const FrameTile* tiles, std::size_t tile_count,
                      TimeUs through_us) {
  for (std::size_t i = 0; i < tile_count; ++i) {
    tiles_[(tiles_end_ + i) % kFrameTiles] = tiles[i];
  }
  State state = State::kUnderWay;
  for (std::uint32_t back = 1; back < kFrames; ++back) {
    Frame& before = frame(end_ - back);
    if (before.tag == tag && before.tile_count > 0) {
      state = State::kNameless;
      before.state = before.state == State::kUnderWay ? State::kNameless : before.state;
    }
  }
  frame(end_) = Frame{through_us, tiles_end_, tag, static_cast<std::uint8_t>(tile_count), state};
  if (tile_count > 0) {
    if (under_way_ == 0) {
      busy_since_us_ = through_us;
      busy_frames_ = hasty_frames_ = 0;
    }
    ++busy_frames_;
  }
  if (tile_count > 0 && !waiting_) {
    waiting_ = true;
    waiting_since_us_ = through_us;
  }
  ++end_;
  tiles_end_ += static_cast<std::uint32_t>(tile_count);
  under_way_ += tile_count > 0 ? 1U : 0U;
}

void LinkLedger::resolve(std::uint32_t number, State state) {
  Frame& resolved = frame(number);
  under_way_ -= resolved.tile_count > 0 ? 1U : 0U;
  resolved.state = state;
}

// Whoever reports may have waited before it did: the shortest counts, but a line that became slower is believed soon.
void LinkLedger::learn_round_trip(TimeUs measured_us) {
  const bool shorter = round_trip_us_ == 0 || measured_us < round_trip_us_;
  round_trip_us_ = shorter ? measured_us : round_trip_us_ + (measured_us - round_trip_us_) / 4;
}

// A report that comes so long after a frame is through has it, or it was lost.
TimeUs LinkLedger::named_us() const {
  return round_trip_us_ + max_of(round_trip_us_ / 2, kLeastSlack_us);
}

TimeUs LinkLedger::patience_us() const {
  const TimeUs once_us =
      round_trip_us_ == 0 ? first_patience_us_ : named_us() + report_gap_us_ + report_gap_us_ / 2;
  const TimeUs limited_us = base::clamp(once_us, kLeastPatience_us, kMostPatience_us);
  return min_of(limited_us << static_cast<unsigned>(max_of(timeouts_ - kEvenTimeouts, 0)),
                kMostPatience_us);
}

// When those frames are through that may overtake it on the way.
TimeUs LinkLedger::followed_us(std::uint32_t number) const {
  return frame(number + min_of(kOvertaken, end_ - 1 - number)).through_us;
}

// How long a frame waits for a word. A line that loses and has nothing else to carry may as well carry it again: where
// round trips are a large part of the time that all takes, soon, for a few frames; else when the word is overdue.
TimeUs LinkLedger::silence_us(TimeUs now_us, bool idle) const {
  if (!idle || !loses_) {
    return 3 * patience_us();
  }
  const bool fast = now_us - busy_since_us_ < kFastTrips * round_trip_us_;
  const bool affordable = hasty_frames_ * kFramesPerHasty < busy_frames_;
  return fast && affordable ? named_us() / 4 : patience_us();
}

void LinkLedger::note_report(TimeUs now_us) {
  if (waiting_ && heard_) {
    const TimeUs gap_us = max_of<TimeUs>(now_us - max_of(last_report_us_, busy_since_us_), 0);
    report_gap_us_ = report_gap_us_ == 0 ? gap_us : report_gap_us_ + (gap_us - report_gap_us_) / 4;
  }
  heard_ = true;
  timeouts_ = 0;
  last_report_us_ = now_us;
  waiting_ = under_way_ > 0;
  waiting_since_us_ = now_us;
}

void LinkLedger::confirm(std::uint16_t tag, TimeUs now_us) {
  for (std::uint32_t number = first_; number != end_; ++number) {
    Frame& each = frame(number);
    if (each.tag != tag || each.state != State::kUnderWay) {
      continue;
    }
    resolve(number, State::kConfirmed);
    if (static_cast<std::int32_t>(number + 1 - newest_confirmed_) > 0) {
      newest_confirmed_ = number + 1;
      // A frame that others overtook, or that is reported again, says nothing of the round trip; nor
      // does one without cells, which is not reported for its own sake.
      if (each.tile_count > 0) {
        learn_round_trip(max_of<TimeUs>(now_us - each.through_us, 1));
      }
    }
    loss_q16_ -= loss_q16_ >> kLossMemory_log2;
    telling_ = each.first_tile;
    telling_count_ = each.tile_count;
    return;
  }
}

bool LinkLedger::next_confirmed(FrameTile& tile) {
  if (telling_count_ == 0) {
    forget_resolved();
    return false;
  }
  tile = tiles_[telling_ % kFrameTiles];
  ++telling_;
  --telling_count_;
  return true;
}

bool LinkLedger::next_lost(TimeUs now_us, bool idle, FrameTile& tile) {
  if (telling_count_ == 0) {
    if (!heard_) {
      return false;
    }
    // What a report could have named and did not was lost. Without a report nothing is known: reports are lost,
    // too. A line that has nothing else to carry may as well carry it again. Where a queue grows, the newest round
    // trip is the one to go by.
    for (std::uint32_t number = first_; number != end_ && telling_count_ == 0; ++number) {
      Frame& each = frame(number);
      if (each.state >= State::kConfirmed) {
        continue;
      }
      const bool overtaken = static_cast<std::int32_t>(newest_confirmed_ - 1 - number) >=
                             static_cast<std::int32_t>(kOvertaken);
      const bool passed_over =
          round_trip_us_ != 0 && last_report_us_ - followed_us(number) >= named_us();
      if (!overtaken && !passed_over) {
        if (now_us - each.through_us < silence_us(now_us, idle)) {
          continue;
        }
        ++hasty_frames_;
      } else {
        loses_ = true;
      }
      resolve(number, State::kLost);
      loss_q16_ += (65'536U - loss_q16_) >> kLossMemory_log2;
      telling_ = each.first_tile;
      telling_count_ = each.tile_count;
    }
  }
  if (telling_count_ == 0) {
    forget_resolved();
    // Patience that ended without a word counts once, however many frames it cost.
    if (waiting_ && now_us - waiting_since_us_ >= patience_us()) {
      waiting_since_us_ = now_us;
      ++timeouts_;
    }
    if (timeouts_ == kMostTimeouts) {  // nobody listens: what was learned of the line is old
      heard_ = false;
      waiting_ = false;
      timeouts_ = 0;
      round_trip_us_ = report_gap_us_ = 0;
      loss_q16_ = kFirstLoss_q16;
    }
    return false;
  }
  tile = tiles_[telling_ % kFrameTiles];
  ++telling_;
  --telling_count_;
  return true;
}

}  // namespace leadline::firmware
