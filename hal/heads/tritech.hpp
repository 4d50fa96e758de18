// Tritech SeaNet heads: Micron DST and SeaKing imaging (node 2), SeaKing profiler (node 20), RS-232 or RS-485.
//
// Frame: '@', length L as four hex digits, L again as u16, sender, receiver, count, type, sequence, node,
// payload, 0x0A; L is the frame less 6 bytes. There is no checksum, and 0x0A occurs inside: both lengths,
// the last byte, both node bytes, the count, and what the type says of its length must agree, and every
// field of mtHeadData must be one that a head can have. Commands of the host, echoed by a half-duplex line,
// are intact frames and ignored.
//
// Direction. Bearings are sixteenths of a gradian, 6400 a turn, 3200 ahead and growing to the right; as with
// the Ping360 the beam turns in the plane of the mount's forward and right axes (`clockwise`: an option for
// a head that hangs upside down).
//
// Records of the imaging head: kProfile, 8-bit intensities, or 4-bit ones, two to a byte: which of them
// comes first is an option (sources conflict; two of three say the high one). Bin i is centred
// (i + 1/2) AD intervals of 640 ns behind the transmission. One mtSendData may bring two mtHeadData.
// Records of the profiler: one per range of a sweep, kRange, or kNoReturn for 0. Ranges are two-way
// microseconds; the list ends at the right limit when the head scans right and begins there when it scans
// left. Ten bytes behind the list are unexplained and left alone.
//
// Time. Imaging: t_transmit = arrival - transmission of the frame - bins * interval. Profiler: the sweep of
// n ranges took scan_time (100 us units, UNSURE) and ended at the arrival; range i began at its share.
//
// Conversation. mtSendVersion until it is answered (an mtAlive makes it due at once), then mtHeadCommand
// when the head has finished centring, then, when mtAlive shows that it has its parameters, one mtSendData
// after the other. Five without an answer, a head that says it has no parameters (power was gone) or lost
// its motor's place: mtHeadCommand again. Centring may take 30 s.
//
// Facts: rock-drivers/drivers-sonar_tritech SeaNet*; McGill ros-tritech-micron; MicronCore.h by F. Le Bars.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "hal/heads/exchange.hpp"
#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

inline constexpr std::int32_t kSeanetTurn = 6400;    ///< sixteenths of a gradian
inline constexpr std::size_t kMaxSeanetBins = 1500;  ///< 8-bit; 4-bit: in half the bytes
inline constexpr std::size_t kMaxSeanetRanges = 800;
inline constexpr std::size_t kMaxSeanetFrame_bytes = 51 + 2 * kMaxSeanetRanges;

/// Which head is asked. kListen: none; both are decoded in any case.
enum class TritechHead : std::uint8_t { kListen = 0, kImaging = 1, kProfiler = 2 };

struct TritechConfig {
  TritechHead head = TritechHead::kListen;
  std::uint16_t mount = 0;
  bool clockwise = true;
  bool high_nibble_first = true;
  bool eight_bits = true;     ///< asked for; frames say themselves what they hold
  bool two_channels = false;  ///< the long mtHeadCommand (SeaKing); always for the profiler
  std::int32_t left = 0;      ///< limits of the scan, 0 .. 6399; left 0, right 6399: all around
  std::int32_t right = 6399;
  std::int32_t step = 16;   ///< 1 .. 255 sixteenths of a gradian
  std::int32_t bins = 200;  ///< asked for, 1 .. 1500
  std::uint8_t gain = 73;   ///< 0 .. 210 for 0 .. 80 dB
  std::int64_t max_range_um = 20'000'000;
  std::int32_t frequency_hz = 675'000;
  std::int32_t sound_speed_mm_s = 1'500'000;  ///< of the water, 1'300'000 .. 1'700'000
  std::int32_t byte_time_ns = 0;  ///< per byte on the line (115200 baud: 86806); 0: in the latency
};

/// What the head said last.
struct TritechState {
  std::uint8_t head_info;  ///< of mtAlive
  std::uint16_t motor_position;
  std::uint16_t serial_number;  ///< 0 until mtVersionData
  std::uint8_t software;
};

/// Bytes to pings, and the requests that keep a head going. One object per port; not reentrant. No heap,
/// no clock. O(1) per byte, O(bins) per frame. About 14 KiB.
class TritechCodec {
 public:
  static constexpr std::size_t kMaxRequest_bytes = 82;

  /// Values outside their range are limited to it.
  explicit TritechCodec(const TritechConfig& config);

  /// The further ranges of a sweep come from next(), which may be left undrained without losing any.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping);
  [[nodiscard]] bool next(base::Ping& ping);
  [[nodiscard]] std::size_t request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);
  /// The port was closed and opened again: forgets half a frame and starts over.
  void restart();

  [[nodiscard]] bool running() const { return step_ == Step::kRun; }
  [[nodiscard]] const TritechState& state() const { return state_; }
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  enum class Step : std::uint8_t { kVersion, kCentre, kConfigure, kRun };

  [[nodiscard]] bool take(const FrameBytes& frame, base::Ping& ping);
  [[nodiscard]] bool take_imaging(const FrameBytes& frame, base::Ping& ping);
  void take_sweep(const FrameBytes& frame);
  void take_alive(const std::uint8_t* bytes);
  void take_status(std::uint8_t head_status);
  [[nodiscard]] bool deliver(base::Ping& ping);
  void advance(Step step);
  [[nodiscard]] std::uint8_t node() const;
  [[nodiscard]] std::size_t write_head_command(std::uint8_t* out) const;

  TritechConfig config_;
  CodecCounters counters_{};
  Framer<kMaxSeanetFrame_bytes> framer_;
  PingExchange exchange_;
  TritechState state_{};
  Step step_ = Step::kVersion;
  bool ready_ = false;  ///< mtAlive: centred and with parameters
  bool centred_ = false;
  std::uint8_t silences_ = 0;
  std::array<std::uint16_t, kMaxSeanetBins> intensity_{};
  // A sweep under way to the caller.
  std::array<std::uint16_t, kMaxSeanetRanges> two_way_us_{};
  std::size_t sweep_count_ = 0;
  std::size_t sweep_next_ = 0;
  std::int32_t sweep_first_ = 0;  ///< bearing of range 0
  std::int32_t sweep_step_ = 0;   ///< signed
  std::int64_t sweep_us_ = 0;
  base::TimeUs t_sweep_end_us_ = 0;
};

}  // namespace leadline::hal
