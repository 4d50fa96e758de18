// Water Linked DVL A50, A100, A125, A250: the serial protocol, PD4, PD6, and the JSON reports of its TCP
// port, told apart by their first bytes.
//
//   w r letter ,fields *xx CR LF     CRC of 8 bits, lower-case hex; serial
//   :BI,... CR LF                    PD6, fixed columns, no checksum
//   0x7D 0x00 u16 size ...           PD4, 47 bytes, little-endian, sum of 16 bits
//   {"type":"velocity",...} LF       JSON, one report a line, no checksum
//
// | report | becomes |
// |---|---|
// | wrz, JSON velocity | velocity over ground and altitude; fields 0 unless valid |
// | wrs of 11 fields (and a wrz of 11), JSON velocity_water | velocity through the water |
// | wrp, JSON position_local | position, roll, pitch; fields 0 when its status is not 0 |
// | wrx | velocity and altitude, until the first wrz: a DVL that sends both says everything twice |
// | :BI, :BD | velocity; altitude |
// | PD4 | velocity and altitude |
//
// The makers' document calls the water track report wrz in its format, wrs in its example, and wrs is an
// answer about time as well: the number of fields decides. The checksum of that example is wrong there.
//
// Axes are forward, starboard, down already. A report states the instants of the reflection and of its
// own transmission by the DVL's clock: their difference (0 .. 1 s) is taken off the arrival, and the
// first becomes t_device_us (it is relative to power-on until the DVL has the time). Per-beam reports (wru,
// wrt), :BS (the same velocity again) and answers are counted as ignored, wrn, wr? and wr! as nacks.
//
// Dead reckoning (wrp, position_local) counts from the last reset, along the axes that the DVL had then:
// x is not north. Its yaw is about the same axes and is left out of the sample.
//
// UNSURE, hence options: what PD4's bottom status means, and PD4's axes.
//
// Facts: waterlinked/docs, docs/dvl (serial protocol 2.7, JSON 3.2, PD formats).
#pragma once

#include <array>
#include <cstdint>

#include "hal/codec.hpp"
#include "hal/text_fields.hpp"
#include "model/base/nav_sample.hpp"

namespace leadline::hal {

struct WlDvlConfig {
  bool require_checksum = true;      ///< serial: false: also take lines that have none
  std::uint8_t pd4_good_status = 0;  ///< PD4's bottom status of a good velocity (0 as with RDI)
  /// wrx beside wrz is a repeat. False for decoding a file: everything in it counts.
  bool drop_repeats = true;
  /// wru and wrt make records, too (kOther, no fields): for decoding a file, which shows them by frame().
  bool every_report = false;
  bool pd4_ship_axes = false;     ///< PD4's x, y, z are starboard, forward, up (as with RDI)
  std::int32_t byte_time_ns = 0;  ///< per byte on the line; 0: in the port's latency
};

/// Bytes to samples. One object per port; not reentrant. No heap, no clock; 16 kB.
class WlDvlCodec {
 public:
  static constexpr std::size_t kMaxReport_bytes = 3072;
  static constexpr std::size_t kMaxLine_bytes = 320;
  static constexpr std::size_t kPd4_bytes = 47;
  static constexpr std::size_t kMaxFields = 16;

  explicit WlDvlCodec(const WlDvlConfig& config) : config_(config) {}

  /// Takes one byte; true when a record is there, further ones through next(). O(1) per byte, O(report)
  /// at its end.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample);
  [[nodiscard]] bool next(base::NavSample& sample);
  /// The port was closed and opened again.
  void restart();
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }
  /// The frame of the last record, until the next byte: for whoever shows what navigation leaves.
  [[nodiscard]] FrameView frame() const { return framer_.last_frame(); }

 private:
  using Fields = TextFields<kMaxFields>;

  /// How far the line at the front has been looked through.
  struct Seen {
    std::uint32_t start;  ///< its place in the stream, modulo 2^32
    std::size_t bytes;
  };

  [[nodiscard]] Judgement judge(const std::uint8_t* bytes, std::size_t available);
  [[nodiscard]] Judgement judge_line(const std::uint8_t* bytes, std::size_t available);
  [[nodiscard]] bool take(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] bool take_serial(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] bool take_velocity_line(const Fields& line, base::NavSample& sample);
  [[nodiscard]] bool take_old_velocity(const Fields& line, base::NavSample& sample);
  [[nodiscard]] bool take_pd6(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] bool take_pd4(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] bool take_json(const FrameBytes& frame, base::NavSample& sample);
  /// Counts what became of a report of ours.
  [[nodiscard]] bool settled(bool good, const base::NavSample& sample);

  WlDvlConfig config_;
  Framer<kMaxReport_bytes> framer_{kMaxGap_us};
  CodecCounters counters_{};
  std::uint32_t fed_bytes_ = 0;
  Seen seen_{};
  bool new_format_ = false;  ///< wrz was seen: wrx is a repeat

  static constexpr base::TimeUs kMaxGap_us = 500'000;
};

}  // namespace leadline::hal
