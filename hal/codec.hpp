// What the codecs of all devices share: counters, and the search for frames in a stream of bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "model/base/units.hpp"

namespace leadline::hal {

/// What a codec has seen since it was made. Never decremented; wraps at 2^32. A codec leaves what its
/// protocol does not know at 0.
struct CodecCounters {
  std::uint32_t frames;         ///< intact, understood or not
  std::uint32_t records;        ///< delivered
  std::uint32_t ignored;        ///< intact frames that are none of the codec's business
  std::uint32_t no_data;        ///< intact, but the device says that it knows nothing
  std::uint32_t repeats;        ///< the same measurement sent again: dropped
  std::uint32_t skipped_bytes;  ///< belong to no intact frame
  // Rejected, by reason.
  std::uint32_t bad_checksum;
  std::uint32_t bad_length;    ///< length, terminator or count that the frame cannot have
  std::uint32_t bad_values;    ///< intact, but with a field that the device never sends
  std::uint32_t unknown_id;    ///< looks like a frame, but of a kind that the device does not have
  std::uint32_t wrong_device;  ///< another address, device id or device type
  std::uint32_t unfinished;    ///< the line fell silent, or a new frame began, inside a frame
  // Conversation, for devices that are asked.
  std::uint32_t nacks;             ///< refused by the device
  std::uint32_t timeouts;          ///< requests without an answer
  std::uint32_t refused_settings;  ///< settings that read back otherwise after all tries
  std::uint32_t restarts;          ///< start-up sequences after the first (silence, reboot)
};

/// Frames and records dropped for what was in them. O(1).
[[nodiscard]] constexpr std::uint32_t rejected(const CodecCounters& counters) {
  return counters.bad_checksum + counters.bad_length + counters.bad_values + counters.unknown_id +
         counters.wrong_device + counters.unfinished;
}

/// What a protocol's rules say of the bytes at a place where a frame may start.
enum class FrameVerdict : std::uint8_t {
  kMore,         ///< a beginning; too short to tell
  kFrame,        ///< intact; `size_bytes` of it
  kNoStart,      ///< nothing begins here (not counted but as a skipped byte)
  kBadChecksum,  ///< the following are counted, each under its name
  kBadLength,
  kBadValues,
  kUnknownId,
  kWrongDevice,
};

struct Judgement {
  FrameVerdict verdict;
  std::size_t size_bytes;  ///< kFrame: 1 .. available; otherwise 0
};

/// A frame inside the framer's buffer: valid until the next call of feed(), next() or reset().
struct FrameBytes {
  const std::uint8_t* data;
  std::size_t size_bytes;
  base::TimeUs t_first_us;    ///< arrival of its first byte
  base::TimeUs t_arrival_us;  ///< arrival of its last byte
};

/// Bytes of a frame, in its owner's buffer. None: there is no frame.
struct FrameView {
  const std::uint8_t* data;
  std::size_t size_bytes;
};

/// When the first bit of a frame left the sensor: the arrival of its last byte less its transmission at
/// `byte_time_ns` a byte (0: not known, or part of the port's latency).
[[nodiscard]] constexpr base::TimeUs sent_us(const FrameBytes& frame, std::int64_t byte_time_ns) {
  return frame.t_arrival_us - static_cast<std::int64_t>(frame.size_bytes) * byte_time_ns / 1000;
}

/// Finds frames in a stream that may lose, repeat or change any byte. A start that turns out wrong
/// costs one byte: the search goes on behind it over what is already there, so a damaged frame takes
/// no intact one with it. A frame found late keeps the arrival time of its own bytes.
///
/// Use: feed() a byte, then take frames with next(rules, ...) until it returns false. `rules` is the
/// protocol: a callable `Judgement(const std::uint8_t* bytes, std::size_t available)`, available >= 1,
/// which must reject (never answer kMore to) a start that would outgrow kCapacity_bytes, and looks at
/// no byte behind `available`.
///
/// At any time bytes fed = bytes of frames + skipped_bytes + buffered_bytes(). O(1) per byte for a clean
/// stream; a wrong start costs what the rules cost. Copyable; not reentrant; no heap; about 5
/// kCapacity_bytes.
template <std::size_t kCapacity_bytes>
class Framer {
 public:
  static constexpr std::size_t kCapacity = kCapacity_bytes;

  /// A pause longer than `max_gap_us` inside a frame ends it: nothing reaches across.
  explicit Framer(base::TimeUs max_gap_us) : max_gap_us_(max_gap_us) {}

  /// Takes one byte. Arrival times should not go back; where they do, a frame found late may carry a
  /// wrong one, nothing else. When the caller has let the buffer fill up without asking next(), the
  /// oldest byte is skipped.
  void feed(std::uint8_t byte, base::TimeUs t_arrival_us, CodecCounters& counters) {
    last_bytes_ = 0;
    if (begin_ == end_) {
      begin_ = 0;
      end_ = 0;
      pause_at_ = 0;
    } else if (t_arrival_us - last_arrival_us_ > max_gap_us_) {
      pause_at_ = end_;
    }
    make_room(counters);
    bytes_[end_] = byte;
    arrival_low_us_[end_] = static_cast<std::uint32_t>(t_arrival_us);
    ++end_;
    last_arrival_us_ = t_arrival_us;
  }

  /// The next intact frame, if there is one; `frame` is left alone otherwise.
  template <class Rules>
  [[nodiscard]] bool next(const Rules& rules, CodecCounters& counters, FrameBytes& frame) {
    last_bytes_ = 0;
    while (begin_ < end_) {
      const bool paused = pause_at_ > begin_;
      const std::size_t available = (paused ? pause_at_ : end_) - begin_;
      const Judgement judgement = rules(bytes_.data() + begin_, available);
      if (judgement.verdict == FrameVerdict::kMore && !paused) {
        return false;
      }
      if (judgement.verdict == FrameVerdict::kFrame) {
        deliver(judgement.size_bytes, frame);
        ++counters.frames;
        return true;
      }
      count(judgement.verdict, available, counters);
      skip(1, counters);
    }
    return false;
  }

  /// Frames to `take`, a callable bool(const FrameBytes&), until it says that one became a record; false: none
  /// did. What a codec's next() does.
  template <class Rules, class Take>
  [[nodiscard]] bool take_next(const Rules& rules, CodecCounters& counters, const Take& take) {
    FrameBytes frame{};
    while (next(rules, counters, frame)) {
      if (take(frame)) {
        return true;
      }
    }
    return false;
  }

  /// The frame that next() delivered last; valid as long, and of no bytes behind that. O(1).
  [[nodiscard]] FrameView last_frame() const {
    return {bytes_.data() + (begin_ - last_bytes_), last_bytes_};
  }

  /// The other end is known to have stopped sending: what is buffered gets no more, and nothing reaches
  /// across. Takes effect with the next call of next().
  void pause() { pause_at_ = begin_ == end_ ? pause_at_ : end_; }

  /// Forgets what is buffered (port closed and opened again); counted as skipped.
  void reset(CodecCounters& counters) {
    skip(end_ - begin_, counters);
    begin_ = 0;
    end_ = 0;
    pause_at_ = 0;
    last_bytes_ = 0;
  }

  [[nodiscard]] std::size_t buffered_bytes() const { return end_ - begin_; }

 private:
  void deliver(std::size_t size_bytes, FrameBytes& frame) {
    frame.data = bytes_.data() + begin_;
    frame.size_bytes = size_bytes;
    frame.t_first_us = arrival_of(begin_);
    begin_ += size_bytes;
    last_bytes_ = size_bytes;
    frame.t_arrival_us = arrival_of(begin_ - 1);
  }

  static void count(FrameVerdict verdict, std::size_t available, CodecCounters& counters) {
    switch (verdict) {
      case FrameVerdict::kMore:
        // A lone byte that could have begun something is noise, not a frame.
        counters.unfinished += available > 1 ? 1U : 0U;
        break;
      case FrameVerdict::kBadChecksum:
        ++counters.bad_checksum;
        break;
      case FrameVerdict::kBadLength:
        ++counters.bad_length;
        break;
      case FrameVerdict::kBadValues:
        ++counters.bad_values;
        break;
      case FrameVerdict::kUnknownId:
        ++counters.unknown_id;
        break;
      case FrameVerdict::kWrongDevice:
        ++counters.wrong_device;
        break;
      case FrameVerdict::kFrame:
      case FrameVerdict::kNoStart:
        break;
    }
  }

  [[nodiscard]] base::TimeUs arrival_of(std::size_t index) const {
    const std::uint32_t age_us =
        static_cast<std::uint32_t>(last_arrival_us_) - arrival_low_us_[index];
    return last_arrival_us_ - static_cast<base::TimeUs>(age_us);
  }

  void skip(std::size_t byte_count, CodecCounters& counters) {
    begin_ += byte_count;
    counters.skipped_bytes += static_cast<std::uint32_t>(byte_count);
  }

  // No frame outgrows the buffer, so what is in front of it is what makes the buffer full.
  void make_room(CodecCounters& counters) {
    if (end_ < kCapacity_bytes) {
      return;
    }
    if (begin_ == 0) {
      skip(1, counters);
    }
    const std::size_t kept = end_ - begin_;
    std::memmove(bytes_.data(), bytes_.data() + begin_, kept);
    std::memmove(arrival_low_us_.data(), arrival_low_us_.data() + begin_,
                 kept * sizeof(arrival_low_us_[0]));
    pause_at_ = pause_at_ > begin_ ? pause_at_ - begin_ : 0;
    begin_ = 0;
    end_ = kept;
  }

  base::TimeUs max_gap_us_;
  std::array<std::uint8_t, kCapacity_bytes> bytes_{};
  std::array<std::uint32_t, kCapacity_bytes> arrival_low_us_{};  ///< modulo 2^32
  base::TimeUs last_arrival_us_ = 0;
  std::size_t begin_ = 0;  ///< first byte not yet delivered or skipped
  std::size_t end_ = 0;
  std::size_t last_bytes_ = 0;  ///< of the frame that ends at begin_
  std::size_t pause_at_ = 0;    ///< the line was silent before this byte: no frame reaches across
};

}  // namespace leadline::hal
