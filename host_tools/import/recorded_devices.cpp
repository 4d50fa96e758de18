#include "host_tools/import/recorded_devices.hpp"

#include <algorithm>
#include <utility>

namespace leadline::host {
namespace {

// Untimed bytes come in pieces of this size: a few milliseconds of a serial line.
constexpr std::size_t kUntimedPiece_bytes = 64;
// The vehicle's last cycle comes after the last byte.
constexpr base::TimeUs kTail_us = 1'000'000;

}  // namespace

RecordedDevices::RecordedDevices(std::vector<PortRecording> recordings, std::size_t port_count,
                                 std::int64_t bytes_per_s)
    : port_count_(port_count) {
  std::vector<Piece> timed;
  std::vector<Piece> untimed;
  for (PortRecording& recording : recordings) {
    read(&recording, bytes_per_s, &timed, &untimed);
  }
  for (const Piece& piece : timed) {
    const bool first = &piece == timed.data();
    t_origin_us_ = first ? piece.t_us : std::min(t_origin_us_, piece.t_us);
  }
  for (Piece& piece : timed) {
    piece.t_us -= t_origin_us_;
  }
  pieces_ = std::move(timed);
  std::move(untimed.begin(), untimed.end(), std::back_inserter(pieces_));
  std::stable_sort(pieces_.begin(), pieces_.end(),
                   [](const Piece& a, const Piece& b) { return a.t_us < b.t_us; });
}

void RecordedDevices::read(PortRecording* source, std::int64_t bytes_per_s,
                           std::vector<Piece>* timed, std::vector<Piece>* untimed) {
  RecordedBytes piece;
  base::TimeUs last_us = 0;
  bool any = false;
  std::int64_t untimed_bytes = 0;
  while (source->recording->next(&piece)) {
    bytes_ += piece.bytes.size();
    if (piece.t_us) {
      const base::TimeUs t_us = *piece.t_us + source->shift_us;
      steps_back_ += any && t_us < last_us ? 1U : 0U;
      last_us = any ? std::max(last_us, t_us) : t_us;
      any = true;
      timed->push_back({last_us, source->port, std::move(piece.bytes)});
      continue;
    }
    for (std::size_t at = 0; at < piece.bytes.size(); at += kUntimedPiece_bytes) {
      const std::size_t end = std::min(at + kUntimedPiece_bytes, piece.bytes.size());
      untimed_bytes += static_cast<std::int64_t>(end - at);
      untimed->push_back({source->shift_us + untimed_bytes * 1'000'000 / bytes_per_s,
                          source->port,
                          {piece.bytes.begin() + static_cast<std::ptrdiff_t>(at),
                           piece.bytes.begin() + static_cast<std::ptrdiff_t>(end)}});
    }
  }
}

base::TimeUs RecordedDevices::t_end_us() const {
  return (pieces_.empty() ? 0 : std::max<base::TimeUs>(0, pieces_.back().t_us)) + kTail_us;
}

base::TimeUs RecordedDevices::next_us(base::TimeUs now_us) const {
  return next_ < pieces_.size() ? std::max(pieces_[next_].t_us, now_us + 1) : t_end_us();
}

void RecordedDevices::advance(base::TimeUs now_us, std::vector<emu::Bytes>* bytes) {
  for (; next_ < pieces_.size() && pieces_[next_].t_us <= now_us; ++next_) {
    const Piece& piece = pieces_[next_];
    emu::Bytes& port = (*bytes)[piece.port];
    port.insert(port.end(), piece.bytes.begin(), piece.bytes.end());
  }
}

void RecordedDevices::take(std::size_t /*port*/, base::TimeUs /*now_us*/,
                           const std::uint8_t* /*data*/, std::size_t /*size_bytes*/) {
  // Nobody is there; the answers are in the recording.
}

}  // namespace leadline::host
