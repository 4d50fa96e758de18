#include "firmware/pipeline/ping_queue.hpp"

#include <cstring>

namespace leadline::firmware {

using base::Ping;
using base::ReturnKind;
using base::Status;

void PingQueue::clear() {
  first_ = 0;
  count_ = 0;
  bin_first_ = 0;
  bin_end_ = 0;
  profiles_ = 0;
}

Status PingQueue::push(const Ping& ping, base::TimeUs now_us) {
  const std::size_t bins = ping.kind == ReturnKind::kProfile ? ping.profile.bin_count : 0;
  if (ping.kind == ReturnKind::kProfile &&
      (bins == 0 || ping.profile.intensity == nullptr || bins > kBinCapacity_count)) {
    return Status::kOutOfRange;
  }
  if (count_ == kCapacity_count) {
    return Status::kFull;
  }
  Ping copy = ping;
  copy.profile.intensity = nullptr;
  if (bins != 0) {
    if (profiles_ == 0) {
      bin_first_ = 0;
      bin_end_ = 0;
    }
    const bool wrapped = profiles_ != 0 && bin_end_ <= bin_first_;
    const std::size_t limit = wrapped ? bin_first_ : kBinCapacity_count;
    std::size_t start = bin_end_;
    if (start + bins > limit) {
      // Not behind the newest: at the front, where nothing older lies there.
      if (wrapped || bins > bin_first_) {
        return Status::kFull;
      }
      start = 0;
    }
    std::memcpy(&bins_[start], ping.profile.intensity, bins * sizeof(std::uint16_t));
    copy.profile.intensity = &bins_[start];
    bin_end_ = start + bins;
    ++profiles_;
  }
  const std::size_t place = (first_ + count_) % kCapacity_count;
  pings_[place] = copy;
  since_us_[place] = now_us;
  ++count_;
  return Status::kOk;
}

void PingQueue::pop() {
  if (count_ == 0) {
    return;
  }
  const Ping& oldest = pings_[first_];
  if (oldest.kind == ReturnKind::kProfile) {
    bin_first_ = static_cast<std::size_t>(oldest.profile.intensity - bins_.data()) +
                 oldest.profile.bin_count;
    --profiles_;
  }
  first_ = (first_ + 1) % kCapacity_count;
  --count_;
}

}  // namespace leadline::firmware
