#include "hal/emu/talker.hpp"

#include <algorithm>
#include <utility>

namespace leadline::emu {

Talker::Talker(const TalkerConfig& config, std::vector<TalkerRow> rows)
    : config_(config), rows_(std::move(rows)), line_(config.byte_time_ns) {}

void Talker::take(base::TimeUs /*now_us*/, const std::uint8_t* /*data*/,
                  std::size_t /*size_bytes*/) {}

std::size_t Talker::earliest() const {
  const auto sooner = [](const TalkerRow& a, const TalkerRow& b) {
    return a.first_us < b.first_us;
  };
  return static_cast<std::size_t>(std::min_element(rows_.begin(), rows_.end(), sooner) -
                                  rows_.begin());
}

void Talker::advance(base::TimeUs now_us, Bytes& out) {
  while (!rows_.empty() && rows_[earliest()].first_us <= now_us) {
    TalkerRow& row = rows_[earliest()];
    line_.send(row.first_us + config_.latency_us, row.message(row.first_us));
    row.first_us += std::max<std::int64_t>(row.interval_us, 1);
  }
  Bytes unheard;
  line_.take_until(now_us, silent_ ? unheard : out);
}

base::TimeUs Talker::next_event_us() const {
  return std::min(line_.next_us(), rows_.empty() ? kNever_us : rows_[earliest()].first_us);
}

}  // namespace leadline::emu
