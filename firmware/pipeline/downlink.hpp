// Frames of one cycle, within the bytes that the link may carry.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/units.hpp"
#include "proto/framing.hpp"

namespace leadline::firmware {

/// Most bytes of frames that one cycle makes.
inline constexpr std::size_t kDownlinkCapacity_bytes = 16384;

/// Any link lets frames of so many bytes pass, however slow it is.
inline constexpr std::size_t kLeastBurst_bytes = 192;

/// A token bucket in front of a buffer. In any span of T seconds no more than rate * T + burst_bytes() leave
/// it, exactly: tokens are counted in millionths of a byte. Static storage, not thread-safe.
class Downlink {
 public:
  Downlink() = default;
  Downlink(const Downlink&) = delete;
  Downlink& operator=(const Downlink&) = delete;

  /// Starts over with a full bucket. mtu_bytes: largest frame.
  void configure(std::uint32_t rate_bytes_s, std::size_t mtu_bytes);
  /// Another rate from now on; what was saved up stays, as far as the new burst goes.
  void set_rate(std::uint32_t rate_bytes_s);
  /// Empties the buffer and adds the tokens of `elapsed_us` >= 0. `room_bytes`: what the transmitter takes.
  void begin_cycle(base::TimeUs elapsed_us, std::uint32_t room_bytes);

  /// What frames of this cycle may still take: least of tokens, room and buffer.
  [[nodiscard]] std::size_t free_bytes() const;
  /// What left and is not through a line of the configured rate yet, if nothing else delays it.
  [[nodiscard]] std::size_t backlog_bytes() const {
    return burst_bytes_ - static_cast<std::size_t>(tokens_ub_ / kByte_ub);
  }
  /// Largest payload that put() takes now whatever its bytes are.
  [[nodiscard]] std::size_t free_payload_bytes() const;
  /// Frames a payload. False, and nothing done, when the frame is longer than the MTU or free_bytes().
  [[nodiscard]] bool put(const std::uint8_t* payload, std::size_t payload_bytes);

  /// Largest saved-up budget: an eighth of a second or an MTU, whichever is more, but never more than a second;
  /// kLeastBurst_bytes at least; and a sixteenth of a second on top.
  [[nodiscard]] std::size_t burst_bytes() const { return burst_bytes_; }
  /// Frames up to this length leave sooner or later: at most the MTU, on a slow link less.
  [[nodiscard]] std::size_t longest_frame_bytes() const {
    return mtu_bytes_ < longest_frame_bytes_ ? mtu_bytes_ : longest_frame_bytes_;
  }
  [[nodiscard]] const std::uint8_t* data() const { return buffer_.data(); }
  [[nodiscard]] std::size_t size_bytes() const { return size_bytes_; }
  /// Of all bytes since configure(): 64-bit FNV-1a, counts.
  [[nodiscard]] std::uint64_t hash() const { return hash_; }
  [[nodiscard]] std::uint64_t total_bytes() const { return total_bytes_; }
  [[nodiscard]] std::uint64_t total_frames() const { return total_frames_; }

 private:
  static constexpr std::int64_t kByte_ub = 1'000'000;

  std::array<std::uint8_t, kDownlinkCapacity_bytes> buffer_{};
  std::size_t size_bytes_ = 0;
  std::uint32_t room_bytes_ = 0;
  std::uint32_t rate_bytes_s_ = 0;
  std::size_t mtu_bytes_ = 0;
  std::size_t burst_bytes_ = 0;
  std::size_t longest_frame_bytes_ = 0;
  std::int64_t tokens_ub_ = 0;  ///< millionths of a byte
  std::uint64_t hash_ = 0;
  std::uint64_t total_bytes_ = 0;
  std::uint64_t total_frames_ = 0;
};

}  // namespace leadline::firmware
