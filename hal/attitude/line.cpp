#include "hal/attitude/line.hpp"

namespace leadline::hal {

bool LineCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample) {
  const bool edge = byte == kLineRising || byte == kLineFalling;
  const bool high = byte == kLineRising || byte == kLineHigh;
  if (!edge && byte != kLineHigh && byte != kLineLow) {
    ++counters_.skipped_bytes;
    return false;
  }
  ++counters_.frames;
  const bool counts = high == config_.rising;
  const bool leak = config_.role == LineRole::kLeak;
  if (!leak && (!edge || !counts)) {
    ++counters_.ignored;
    return false;
  }
  ++counters_.records;
  sample = base::NavSample{};
  sample.t_us = t_arrival_us;
  sample.quality = 255;
  sample.kind = base::NavKind::kLine;
  sample.fields = leak ? base::kNavLeak : base::kNavPulse;
  sample.leak = leak && counts ? 1 : 0;
  return true;
}

}  // namespace leadline::hal
