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
constexpr std::uint32_t kManyCells = 1U << 20U;
// Of may_repeat(): 1.15.
constexpr std::uint32_t kMostSpent_q16 = 75'366;
constexpr std::uint32_t kFewPart = 8;
constexpr TimeUs kQuickFrames = 2;
constexpr std::uint32_t kFirstLoss_q16 = 19'661;
// The estimate follows the last 16 frames.
constexpr unsigned kMostQuestion_log2 = 8;
constexpr std::uint32_t kLossy_q16 = 65'536 / 20;
constexpr unsigned kLossMemory_log2 = 4;
constexpr unsigned kLongMemory_log2 = 6;
// These begin shortly before they wrap, so that no vehicle is the first to see it, after months.
constexpr std::uint32_t kFirstTile = 0U - LinkLedger::kFrameTiles;

}  // namespace

void LinkLedger::reset(TimeUs first_patience_us, std::uint32_t number) {
  first_patience_us_ = first_patience_us;
  for (Frame& each : frames_) {
    each = Frame{};
  }
  first_ = end_ = newest_confirmed_ = answered_ = number;
  tiles_end_ = kFirstTile;
  under_way_ = 0;
  telling_count_ = 0;
  given_up_ = 0;
  round_trip_us_ = report_gap_us_ = frame_us_ = 0;
  waiting_since_us_ = 0;
  last_report_us_ = 0;
  busy_since_us_ = 0;
  sent_cells_ = owed_again_cells_ = under_way_cells_ = 0;
  waiting_ = false;
  timeouts_ = 0;
  loss_q16_ = long_loss_q16_ = kFirstLoss_q16;
  next_loss_us_ = INT64_MAX;
  question_due_us_ = 0;
  unanswered_ = 0;
  loses_ = false;
  heard_ = false;
}

bool LinkLedger::has_room(std::size_t tile_count) {
  const auto fits = [this, tile_count] {
    const std::uint32_t used = end_ == first_ ? 0 : tiles_end_ - frame(first_).first_tile;
    return end_ - first_ < kFrames && used + tile_count <= kFrameTiles;
  };
  while (!fits() && frame(first_).state >= State::kConfirmed) {
    ++first_;
  }
  if (static_cast<std::int32_t>(newest_confirmed_ - first_) < 0) {
    newest_confirmed_ = first_;
  }
  if (static_cast<std::int32_t>(answered_ - first_) < 0) {
    answered_ = first_;
  }
  return fits();
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
  return false;
}

void LinkLedger::sent(const FrameTile* tiles, std::size_t tile_count, TimeUs through_us,
                      TimeUs frame_us) {
  frame_us_ = frame_us;
  for (std::size_t i = 0; i < tile_count; ++i) {
    tiles_[(tiles_end_ + i) % kFrameTiles] = tiles[i];
  }
  frame(end_) =
      Frame{through_us, tiles_end_, static_cast<std::uint8_t>(tile_count), State::kUnderWay};
  busy_since_us_ = under_way_ == 0 ? through_us : busy_since_us_;
  sent_cells_ += cells_of(end_);
  under_way_cells_ += cells_of(end_);
  if (sent_cells_ > kManyCells) {
    sent_cells_ /= 2;
    owed_again_cells_ /= 2;
  }
  if (!waiting_) {
    waiting_ = true;
    waiting_since_us_ = through_us;
  }
  // On a line that loses the report of the last frame is asked for at once, on another when it is overdue.
  question_due_us_ = loss_q16_ > kLossy_q16 ? 0 : through_us + named_us();
  unanswered_ = 0;
  ++end_;
  tiles_end_ += static_cast<std::uint32_t>(tile_count);
  ++under_way_;
}

void LinkLedger::resolve(std::uint32_t number, State state) {
  Frame& resolved = frame(number);
  --under_way_;
  under_way_cells_ -= cells_of(number);
  resolved.state = state;
}

// Whoever reports may have waited before it did: the shortest counts, but a line that became slower is believed soon.
void LinkLedger::learn_round_trip(TimeUs measured_us) {
  const bool shorter = round_trip_us_ == 0 || measured_us < round_trip_us_;
  round_trip_us_ = shorter ? measured_us : round_trip_us_ + (measured_us - round_trip_us_) / 4;
}

void LinkLedger::learn_loss(bool lost) {
  const auto learn = [lost](std::uint32_t& loss_q16, unsigned memory_log2) {
    loss_q16 += lost ? (65'536U - loss_q16) >> memory_log2 : 0U - (loss_q16 >> memory_log2);
  };
  learn(loss_q16_, kLossMemory_log2);
  learn(long_loss_q16_, kLongMemory_log2);
}

// A report that comes so long after a frame is through has it, or it was lost.
TimeUs LinkLedger::named_us() const {
  return round_trip_us_ == 0 ? first_patience_us_
                             : round_trip_us_ + max_of(round_trip_us_ / 2, kLeastSlack_us);
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

std::uint32_t LinkLedger::cells_of(std::uint32_t number) const {
  const Frame& each = frame(number);
  std::uint32_t cells = 0;
  for (std::uint32_t i = 0; i < each.tile_count; ++i) {
    cells += static_cast<std::uint32_t>(tiles_[(each.first_tile + i) % kFrameTiles].cells.count());
  }
  return cells;
}

// A line that has nothing else to carry may as well carry again what nobody has spoken of, while all that was sent
// stays within what such a line takes for as many cells, and a little on top.
bool LinkLedger::may_repeat(std::uint32_t number) const {
  const std::uint64_t once = sent_cells_ - owed_again_cells_;
  const std::uint64_t spent = std::uint64_t{sent_cells_} + cells_of(number);
  return spent * (65'536U - long_loss_q16_) <= once * kMostSpent_q16;
}

// How long a frame waits for a word. Where a frame takes longer than the word, a question goes before it is repeated; where
// round trips are long, a line that loses and has nothing else to carry may as well carry it again when it is about due.
TimeUs LinkLedger::silence_us(std::uint32_t number, bool idle) const {
  // Before anything is known of it, a line is one that loses.
  const bool loses = loses_ || round_trip_us_ == 0;
  const bool quick = named_us() < kQuickFrames * frame_us_;
  if (!idle) {
    return 3 * patience_us();
  }
  if (!loses || !may_repeat(number)) {
    return patience_us();
  }
  if (quick) {
    return named_us() + frame_us_ / 4;
  }
  // Of the last few the bytes are little and the round trips all.
  const bool few = under_way_cells_ * kFewPart < sent_cells_ - owed_again_cells_;
  return few ? named_us() / 4 : named_us() * 3 / 4;
}

void LinkLedger::note_rest() {
  if (under_way_ == 0) {
    sent_cells_ = owed_again_cells_ = 0;
  }
}

void LinkLedger::note_report(TimeUs now_us) {
  if (waiting_ && heard_) {
    const TimeUs gap_us = max_of<TimeUs>(now_us - max_of(last_report_us_, busy_since_us_), 0);
    report_gap_us_ = report_gap_us_ == 0 ? gap_us : report_gap_us_ + (gap_us - report_gap_us_) / 4;
  }
  heard_ = true;
  timeouts_ = 0;
  last_report_us_ = now_us;
  unanswered_ = 0;
  waiting_ = under_way_ > 0;
  waiting_since_us_ = now_us;
}

// The frame in the ring whose number ends so.
bool LinkLedger::find(std::uint16_t number16, std::uint32_t& number) const {
  const std::uint32_t back = (end_ - 1 - number16) & UINT16_MAX;
  number = end_ - 1 - back;
  return back < end_ - first_;
}

void LinkLedger::answered(std::uint16_t number16) {
  std::uint32_t number = 0;
  if (find(number16, number) && static_cast<std::int32_t>(number + 1 - answered_) > 0) {
    answered_ = number + 1;
  }
}

bool LinkLedger::question_due(TimeUs now_us) const {
  return heard_ && under_way_ > 0 && now_us >= question_due_us_;
}

void LinkLedger::asked(TimeUs through_us) {
  question_due_us_ = through_us + (named_us() << min_of(unanswered_ / 4, kMostQuestion_log2));
  ++unanswered_;
}

LinkLedger::Word LinkLedger::confirm(std::uint16_t number16, TimeUs now_us) {
  std::uint32_t number = 0;
  if (!find(number16, number)) {
    return Word::kNone;
  }
  Frame& each = frame(number);
  if (each.state == State::kConfirmed) {
    return Word::kNone;
  }
  const bool late = each.state > State::kConfirmed;
  if (late) {
    each.state = State::kConfirmed;
  } else {
    resolve(number, State::kConfirmed);
  }
  if (static_cast<std::int32_t>(number + 1 - newest_confirmed_) > 0) {
    newest_confirmed_ = number + 1;
    // A frame that others overtook, or that is reported again, says nothing of the round trip.
    learn_round_trip(max_of<TimeUs>(now_us - each.through_us, 1));
  }
  learn_loss(false);
  telling_ = each.first_tile;
  telling_count_ = each.tile_count;
  return late ? Word::kCameLate : Word::kCame;
}

bool LinkLedger::next_confirmed(FrameTile& tile) {
  if (telling_count_ == 0) {
    return false;
  }
  tile = tiles_[telling_ % kFrameTiles];
  ++telling_;
  --telling_count_;
  return true;
}

void LinkLedger::cover(const FrameTile& came) {
  for (std::uint32_t number = first_; number != end_; ++number) {
    const Frame& each = frame(number);
    for (std::uint32_t i = 0; i < each.tile_count && each.state < State::kConfirmed; ++i) {
      FrameTile& other = tiles_[(each.first_tile + i) % kFrameTiles];
      if (other.coarse || other.tile != came.tile || other.epoch != came.epoch ||
          other.version != came.version) {
        continue;
      }
      under_way_cells_ -= static_cast<std::uint32_t>(other.cells.count());
      for (int row = 0; row < proto::kTileSide_cells; ++row) {
        other.cells.rows[row] =
            static_cast<std::uint16_t>(other.cells.rows[row] & ~came.cells.rows[row]);
      }
      under_way_cells_ += static_cast<std::uint32_t>(other.cells.count());
    }
  }
}

// What is to be told of a frame now: kLost or kRepeated; else its state.
LinkLedger::State LinkLedger::judge(std::uint32_t number, TimeUs now_us, bool idle) {
  Frame& each = frame(number);
  if (each.state == State::kConfirmed || each.state == State::kLost) {
    return State::kConfirmed;
  }
  const bool overtaken = static_cast<std::int32_t>(newest_confirmed_ - 1 - number) >=
                         static_cast<std::int32_t>(kOvertaken);
  const bool passed_over =
      round_trip_us_ != 0 && last_report_us_ - followed_us(number) >= named_us();
  const bool missed = static_cast<std::int32_t>(answered_ - 1 - number) >= 0;
  const bool lost = overtaken || passed_over || missed;
  if (lost) {
    loses_ = true;
    learn_loss(true);
  }
  if (each.state == State::kRepeated) {
    each.state = lost ? State::kLost : State::kRepeated;
    return State::kConfirmed;
  }
  if (lost) {
    return State::kLost;
  }
  const TimeUs due_us = each.through_us + silence_us(number, idle);
  if (now_us < due_us) {
    next_loss_us_ = min_of(next_loss_us_, due_us);
    return State::kUnderWay;
  }
  return State::kRepeated;
}

// Patience that ended without a word counts once, however many frames it cost.
void LinkLedger::count_silence(TimeUs now_us) {
  if (waiting_ && now_us - waiting_since_us_ >= patience_us()) {
    waiting_since_us_ = now_us;
    ++timeouts_;
  }
  if (timeouts_ == kMostTimeouts) {  // nobody listens: what was learned of the line is old
    heard_ = false;
    waiting_ = false;
    timeouts_ = 0;
    round_trip_us_ = report_gap_us_ = 0;
    loss_q16_ = long_loss_q16_ = kFirstLoss_q16;
  }
}

bool LinkLedger::next_lost(TimeUs now_us, bool idle, FrameTile& tile) {
  if (telling_count_ == 0) {
    if (!heard_) {
      return false;
    }
    // What a report could have named and did not was lost. Without a report nothing is known: reports are lost,
    // too.
    next_loss_us_ = INT64_MAX;
    for (std::uint32_t number = first_; number != end_ && telling_count_ == 0; ++number) {
      const State fate = judge(number, now_us, idle);
      if (fate <= State::kConfirmed) {
        continue;
      }
      const Frame& each = frame(number);
      resolve(number, fate);
      owed_again_cells_ += cells_of(number);
      telling_ = each.first_tile;
      telling_count_ = each.tile_count;
    }
  }
  if (telling_count_ == 0) {
    count_silence(now_us);
    return false;
  }
  tile = tiles_[telling_ % kFrameTiles];
  ++telling_;
  --telling_count_;
  return true;
}

}  // namespace leadline::firmware
