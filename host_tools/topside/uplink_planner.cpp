#include "host_tools/topside/uplink_planner.hpp"

#include <algorithm>

#include "proto/cell.hpp"
#include "proto/framing.hpp"

namespace leadline::host {
namespace {

// Bytes up for bytes that were sent down; while nothing comes and something is missing, this share of what the link
// could carry meanwhile, up to a report. The first are on credit, which part of that share pays back: else they would make
// a small map's way up more than a tenth.
constexpr double kShare = 0.095;
constexpr double kRepay = 0.03;
constexpr double kMostSentOfCame = 1.7;
constexpr double kTimeShare = 0.01;
constexpr double kReport_bytes = 15.0;
constexpr double kMost_bytes = 256.0;
constexpr double kRich_bytes = 40.0;
constexpr double kMostDebt_bytes = 32.0;
constexpr double kAnswerDebt_bytes = 12.0;
constexpr double kPausedDebt_bytes = 0.0;
// A report may be lost itself: every frame stands in so many.
constexpr int kReports = 4;
constexpr int kFramesPerReport = 2;
constexpr std::size_t kMostHeard = 256;
constexpr std::int32_t kLongPast = 4096;
// An answer reaches back so far at least.
constexpr std::uint32_t kAnswerReach = 32;
// Between two frames with news, before that was measured: what such a frame takes.
constexpr double kTypicalNews_bytes = 160.0;
constexpr base::TimeUs kLeastGap_us = 2'500;
constexpr base::TimeUs kMostGap_us = 10'000'000;
constexpr base::TimeUs kKeepAlive_us = 5'000'000;
constexpr base::TimeUs kAskAgain_us = 300'000;
constexpr base::TimeUs kFirstAsk_us = 2'000'000;
constexpr base::TimeUs kMostAsk_us = 60'000'000;
constexpr int kMostDigestTries = 5;
constexpr std::uint32_t kFewTiles = 8;
constexpr base::TimeUs kLookAgain_us = 20'000'000;
// A frame around a payload of at most 253 bytes.
constexpr double kFraming_bytes = 7.0;

std::uint32_t own_hash(const TileStore& store, std::uint32_t first, std::uint32_t count) {
  if (count == 1) {
    return store.hash32(first);
  }
  std::uint64_t hash = proto::kFnvOffset;
  for (std::uint32_t tile = first; tile < first + count; ++tile) {
    hash = proto::add_digest_tile(hash, store.hash32(tile));
  }
  return proto::fold_hash(hash);
}

}  // namespace

void UplinkPlanner::restart() {
  wanted_.clear();
  differing_.clear();
  digest_tries_ = 0;
  known_tiles_ = 0;
  ask_gap_us_ = 0;
  joined_ = false;
  begun_us_ = 0;
  agreed_ = false;
  heard_.clear();
  news_since_report_ = 0;
  asked_.reset();
  look_.reset();
}

// Numbers modulo 2^32: those that are newer or not long past belong to the same row.
void UplinkPlanner::note_cells(std::uint32_t number, std::size_t wire_bytes) {
  const auto ahead = static_cast<std::int32_t>(number - newest_);
  if (heard_.empty() || ahead > 0 || ahead < -kLongPast) {
    if (ahead < -kLongPast) {
      heard_.clear();  // the vehicle counts anew
    }
    newest_ = number;
  }
  if (std::any_of(heard_.begin(), heard_.end(),
                  [number](const Heard& each) { return each.number == number; })) {
    payable_bytes_ -= kShare * sent_of_came() * static_cast<double>(wire_bytes);
    return;
  }
  heard_.push_back({number, kReports});
  while (heard_.size() > kMostHeard) {
    heard_.pop_front();
  }
  news_since_report_ += 1;
  news_count_ += 1;
}

void UplinkPlanner::note_question(const proto::Question& question) { asked_ = question.newest; }

void UplinkPlanner::note_digest(const proto::Digest& digest, const TileStore& store) {
  const std::uint32_t tiles = store.tile_count();
  const std::uint64_t step = std::uint64_t{1} << digest.tiles_log2;
  const bool whole = digest.first == 0 && step >= tiles;
  if (whole) {
    differing_.clear();
    wanted_.clear();
    digest_tries_ = 0;
    asked_digest_us_ = 0;
  } else {
    const auto answered = std::remove_if(
        differing_.begin(), differing_.end(),
        [&digest](const proto::TileRange& range) { return range.first == digest.first; });
    differing_.erase(answered, differing_.end());
    digest_tries_ = 0;
    asked_digest_us_ = 0;
  }
  for (std::size_t k = 0; k < digest.hash_count; ++k) {
    const std::uint64_t first = digest.first + k * step;
    if (first >= tiles) {
      break;
    }
    const auto begin = static_cast<std::uint32_t>(first);
    const auto count = static_cast<std::uint32_t>(std::min<std::uint64_t>(step, tiles - first));
    // Of a range of several steps that the grid cuts to one tile, the hash is that of the range.
    const std::uint32_t own = step == 1 ? store.hash32(begin)
                                        : (count == 1 ? proto::fold_hash(proto::add_digest_tile(
                                                            proto::kFnvOffset, store.hash32(begin)))
                                                      : own_hash(store, begin, count));
    const bool same = own == digest.hashes[k];
    agreed_ = whole ? same : agreed_;
    if (same) {
      continue;
    }
    if (step == 1) {
      wanted_.insert(begin);
    } else if (!differing_.empty() && differing_.back().first + differing_.back().count == begin) {
      differing_.back().count += count;
    } else {
      differing_.push_back({begin, count});
    }
  }
}

void UplinkPlanner::look(std::uint32_t tile, std::uint8_t radius_tiles) {
  look_ = proto::Look{0, tile, radius_tiles};
  look_us_ = 0;
}

std::vector<std::uint8_t> UplinkPlanner::paid(const std::uint8_t* payload,
                                              const base::Result<std::size_t>& size,
                                              double debt_bytes) {
  if (!size.ok()) {
    return {};
  }
  const double cost = static_cast<double>(size.value()) + kFraming_bytes;
  if (payable_bytes_ + debt_bytes < cost) {
    return {};
  }
  payable_bytes_ -= cost;
  sent_bytes_ += size.value();
  return {payload, payload + size.value()};
}

// Bytes that were lost were sent, too: of the last frames' numbers some are missing.
double UplinkPlanner::sent_of_came() const {
  std::uint32_t span = 1;
  for (const Heard& each : heard_) {
    span = std::max(span, newest_ - each.number + 1);
  }
  constexpr double kFew = 8.0;
  return std::min((span + kFew) / (static_cast<double>(heard_.size()) + kFew), kMostSentOfCame);
}

void UplinkPlanner::note_bytes(std::size_t wire_bytes) {
  const double sent_bytes = sent_of_came() * static_cast<double>(wire_bytes);
  const double repaid_bytes = std::min(credit_bytes_, kRepay * sent_bytes);
  credit_bytes_ -= repaid_bytes;
  payable_bytes_ = std::min(payable_bytes_ + kShare * sent_bytes - repaid_bytes, kMost_bytes);
}

// Where nothing comes, a report now and then.
void UplinkPlanner::earn(base::TimeUs now_us, const TileStore& store, bool unfinished) {
  const double seconds = earned_us_ == 0 ? 0.0 : 1e-6 * static_cast<double>(now_us - earned_us_);
  earned_us_ = now_us;
  if (unfinished && payable_bytes_ < kReport_bytes) {
    const double rate_bytes_s = static_cast<double>(store.hello().link_rate_bytes_s);
    payable_bytes_ = std::min(payable_bytes_ + kTimeShare * rate_bytes_s * seconds, kReport_bytes);
  }
}

// Newest first; what stood in enough reports is dropped.
std::vector<std::uint8_t> UplinkPlanner::report(base::TimeUs now_us, const TileStore& store,
                                                bool unfinished) {
  if (news_count_ != news_seen_) {
    if (news_seen_ > 0) {
      const base::TimeUs new_gap_us =
          (now_us - news_us_) / static_cast<base::TimeUs>(news_count_ - news_seen_);
      news_gap_us_ =
          std::clamp(news_gap_us_ == 0 ? new_gap_us : (3 * news_gap_us_ + new_gap_us) / 4,
                     kLeastGap_us, kMostGap_us);
    }
    news_seen_ = news_count_;
    news_us_ = now_us;
  }
  const bool owed = std::any_of(heard_.begin(), heard_.end(),
                                [](const Heard& each) { return each.reports_left > 0; });
  const auto typical_us = static_cast<base::TimeUs>(1e6 * kTypicalNews_bytes /
                                                    std::max(1U, store.hello().link_rate_bytes_s));
  const base::TimeUs gap_us = news_gap_us_ == 0 ? std::min(typical_us, kMostGap_us) : news_gap_us_;
  const base::TimeUs pause_us = std::max(gap_us + gap_us / 2, 2 * kLeastGap_us);
  const bool paused = now_us - news_us_ > pause_us && now_us - reported_us_ > pause_us;
  const base::TimeUs alive_us = unfinished ? std::max(pause_us, kAskAgain_us) : kKeepAlive_us;
  const bool silent = now_us - reported_us_ > alive_us;
  // A few frames in a report: its own frame costs as much as six more names.
  const bool enough = news_since_report_ >= kFramesPerReport ||
                      (news_since_report_ > 0 &&
                       (now_us - reported_us_ > pause_us || payable_bytes_ > kRich_bytes));
  // Who joins says so with the first frames that it can name, or where none come.
  begun_us_ = begun_us_ == 0 ? now_us : begun_us_;
  const bool joins = !joined_ && (news_since_report_ > 0 || now_us - begun_us_ > kAskAgain_us);
  if (!joins && !asked_ && !(joined_ && (enough || (owed && paused) || silent))) {
    return {};
  }
  proto::Report report{};
  report.survey_tag = store.tag();
  report.asked = asked_.has_value();
  std::uint32_t newest = newest_;
  if (asked_) {
    const auto behind = static_cast<std::uint16_t>(*asked_ - newest_);
    newest += heard_.empty() || behind < kLongPast ? behind : 0U;
  }
  report.newest = static_cast<std::uint16_t>(newest);
  // Back to the oldest that has not stood in enough reports.
  for (const Heard& each : heard_) {
    const std::uint32_t before = newest - each.number;
    if (before >= 8U * proto::kMaxReportMask_bytes) {
      continue;
    }
    const std::uint32_t at = before / 8;
    report.mask[at] = static_cast<std::uint8_t>(report.mask[at] | 1U << (before % 8));
    if (each.reports_left > 0 || (report.asked && before < kAnswerReach)) {
      report.mask_bytes =
          static_cast<std::uint8_t>(std::max<std::uint32_t>(report.mask_bytes, at + 1));
    }
  }
  std::uint8_t payload[proto::kMaxReport_bytes];
  std::vector<std::uint8_t> bytes =
      paid(payload, encode_report(report, payload, sizeof payload),
           asked_ ? kAnswerDebt_bytes : (paused ? kPausedDebt_bytes : 0.0));
  if (bytes.empty()) {
    return bytes;
  }
  for (Heard& each : heard_) {
    each.reports_left -= each.reports_left > 0 ? 1 : 0;
  }
  asked_.reset();
  news_since_report_ = 0;
  joined_ = true;
  reported_us_ = now_us;
  return bytes;
}

std::vector<std::uint8_t> UplinkPlanner::wanted_tiles(const TileStore& store) {
  if (wanted_.empty()) {
    return {};
  }
  proto::ResendRequest request{};
  request.survey_tag = store.tag();
  auto last = wanted_.begin();
  for (; last != wanted_.end(); ++last) {
    proto::TileRange* const range =
        request.range_count > 0 ? &request.ranges[request.range_count - 1] : nullptr;
    if (range != nullptr && range->first + range->count == *last) {
      range->count += 1;
    } else if (request.range_count < proto::kMaxResendRanges) {
      request.ranges[request.range_count] = {*last, 1};
      request.range_count += 1;
    } else {
      break;
    }
  }
  std::uint8_t payload[proto::kMaxResendRequest_bytes];
  std::vector<std::uint8_t> bytes =
      paid(payload, encode_resend_request(request, payload, sizeof payload), kMost_bytes);
  if (!bytes.empty()) {
    wanted_.erase(wanted_.begin(), last);
  }
  return bytes;
}

std::vector<std::uint8_t> UplinkPlanner::finer_digest(base::TimeUs now_us, const TileStore& store) {
  if (differing_.empty()) {
    return {};
  }
  const base::TimeUs again_us = kFirstAsk_us << static_cast<unsigned>(digest_tries_);
  if (asked_digest_us_ != 0 && now_us - asked_digest_us_ < again_us) {
    return {};
  }
  if (digest_tries_ == kMostDigestTries) {
    differing_.clear();  // the vehicle's next word over everything begins anew
    return {};
  }
  std::uint8_t payload[proto::kMaxDigestRequest_bytes];
  std::vector<std::uint8_t> bytes =
      paid(payload,
           proto::encode_digest_request({store.tag(), differing_.front()}, payload, sizeof payload),
           kMostDebt_bytes);
  if (!bytes.empty()) {
    asked_digest_us_ = now_us;
    digest_tries_ += 1;
  }
  return bytes;
}

// A status knows of more tiles than the vehicle still has to send: whoever joins asks at once for all that never
// came, then whenever no new one came for a while.
std::vector<std::uint8_t> UplinkPlanner::unseen_tiles(base::TimeUs now_us, const TileStore& store,
                                                      const std::optional<proto::Status>& status) {
  if (!status || store.known_tiles() >= status->tiles_known) {
    return {};
  }
  const bool first = ask_gap_us_ == 0;
  if (!first && store.known_tiles() != known_tiles_) {
    known_tiles_ = store.known_tiles();
    ask_gap_us_ = kFirstAsk_us;
    ask_unseen_us_ = now_us + ask_gap_us_;
  }
  const bool comes_by_itself = 4 * status->tiles_dirty >= status->tiles_known - store.known_tiles();
  const base::TimeUs patience_us = comes_by_itself ? kMostAsk_us : 8 * news_gap_us_;
  if ((first && comes_by_itself) || (!first && now_us < ask_unseen_us_ + patience_us)) {
    return {};
  }
  const proto::ResendRequest request = store.unseen(0);
  if (request.range_count == 0) {
    return {};
  }
  std::uint8_t payload[proto::kMaxResendRequest_bytes];
  std::vector<std::uint8_t> bytes =
      paid(payload, encode_resend_request(request, payload, sizeof payload), kMostDebt_bytes);
  if (!bytes.empty()) {
    known_tiles_ = store.known_tiles();
    ask_gap_us_ = first ? kFirstAsk_us : std::min(2 * ask_gap_us_, kMostAsk_us);
    ask_unseen_us_ = now_us + ask_gap_us_;
  }
  return bytes;
}

std::vector<std::uint8_t> UplinkPlanner::look_again(base::TimeUs now_us, const TileStore& store) {
  if (!look_ || (look_us_ != 0 && now_us - look_us_ < kLookAgain_us)) {
    return {};
  }
  look_->survey_tag = store.tag();
  std::uint8_t payload[proto::kMaxLook_bytes];
  std::vector<std::uint8_t> bytes =
      paid(payload, encode_look(*look_, payload, sizeof payload), 0.0);
  if (!bytes.empty()) {
    look_us_ = now_us;
    if (look_->radius_tiles == 0) {
      look_.reset();
    }
  }
  return bytes;
}

std::vector<std::uint8_t> UplinkPlanner::next(base::TimeUs now_us, const TileStore& store,
                                              const std::optional<proto::Status>& status) {
  const bool unfinished =
      !status || store.known_tiles() < status->tiles_known || !wanted_.empty() || !agreed_;
  earn(now_us, store, unfinished);
  std::vector<std::uint8_t> bytes = report(now_us, store, unfinished);
  if (bytes.empty()) {
    bytes = wanted_tiles(store);
  }
  // While much is still to come, maps differ for that reason.
  const bool settled = !status || status->tiles_dirty <= kFewTiles;
  if (bytes.empty() && settled) {
    bytes = finer_digest(now_us, store);
  }
  if (bytes.empty()) {
    bytes = unseen_tiles(now_us, store, status);
  }
  if (bytes.empty()) {
    bytes = look_again(now_us, store);
  }
  return bytes;
}

}  // namespace leadline::host
