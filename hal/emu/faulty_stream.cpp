#include "hal/emu/faulty_stream.hpp"

#include <algorithm>

namespace leadline::emu {

// SplitMix64: the same numbers on every machine.
std::uint64_t FaultyStream::random() {
  state_ += 0x9E3779B97F4A7C15U;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
  return z ^ (z >> 31U);
}

bool FaultyStream::strikes(std::uint32_t ppm) { return ppm > 0 && random() % 1'000'000 < ppm; }

void FaultyStream::disconnect() {
  connected_ = false;
  ++counters_.disconnects;
  counters_.lost_unplugged += late_.size();
  late_.clear();
}

void FaultyStream::reconnect(std::uint64_t disconnect_at_byte) {
  connected_ = true;
  config_.disconnect_at_byte = disconnect_at_byte;
}

void FaultyStream::carry(std::uint8_t byte) {
  if (strikes(config_.drop_ppm)) {
    ++counters_.dropped;
    return;
  }
  if (strikes(config_.corrupt_ppm)) {
    byte = static_cast<std::uint8_t>(byte ^ (1U + random() % 255U));
    ++counters_.corrupted;
  }
  late_.push_back({t_free_us_, byte});
  if (strikes(config_.repeat_ppm)) {
    late_.push_back({t_free_us_, byte});
    ++counters_.repeated;
  }
}

void FaultyStream::pass(base::TimeUs now_us, const Bytes& in, Bytes& out) {
  t_free_us_ = std::max(t_free_us_, now_us);
  bool cut = false;
  for (const std::uint8_t byte : in) {
    const std::uint64_t number = counters_.bytes_in;
    ++counters_.bytes_in;
    if (connected_ && number >= config_.disconnect_at_byte) {
      disconnect();
    }
    if (!connected_) {
      ++counters_.lost_unplugged;
      continue;
    }
    cut = cut || strikes(config_.truncate_ppm);
    if (cut) {
      ++counters_.truncated;
      continue;
    }
    if (strikes(config_.delay_ppm)) {
      t_free_us_ += config_.delay_us;
      ++counters_.delays;
    }
    carry(byte);
  }
  while (!late_.empty() && late_.front().t_us <= now_us) {
    out.push_back(late_.front().byte);
    late_.pop_front();
    ++counters_.bytes_out;
  }
}

}  // namespace leadline::emu
