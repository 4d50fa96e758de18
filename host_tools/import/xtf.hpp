// XTF recordings (eXtended Triton Format) of a survey multibeam: packets in the file's order, as device bytes
// and navigation samples. The file is read piece by piece; memory does not grow with it.
//
// Little-endian. A file header of 1024 bytes (first byte 123), longer by 1024 for every further six or
// fewer channels over six; then packets, each {0xFACE, type u8, sub-channel u8, channels u16, reserved u32,
// size u32 (all of it)}. Understood, all others are counted and stepped over:
//
//   3    attitude: pitch +30, roll +34, heave +38 (f32, degrees and metres), heading +50, time
//        +54 (year u16, month, day, hour, minute, second u8, millisecond u16). Roll positive
//        starboard down, pitch positive bow up, heave positive up
//   107  raw position: time +14 (as above, then u16 of 0.1 ms), latitude +23, longitude +31,
//        height +39 (f64; degrees, metres)
//   65   R2Sonic bathymetry: 256 bytes of header (position and attitude as the recorder interpolated them;
//        not used), then the head's own packet, which goes out as bytes for hal/heads/r2sonic.hpp
//
// A packet that is damaged (no 0xFACE, a size out of bounds, or one behind which nothing begins while packets begin
// inside of it) is searched past and counted; a cut end is counted. Facts: Triton's format description, checked on one recording.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "host_tools/import/byte_source.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

/// Largest packet taken for one.
inline constexpr std::uint32_t kMaxXtfPacket_bytes = 1U << 22U;

/// Where the file says that the (first bathymetry) head sits, as its recorder was told. Nobody has
/// checked it.
struct XtfMounting {
  bool stated = false;  ///< some of it is not zero
  double forward_m = 0;
  double starboard_m = 0;
  double down_m = 0;
  double heading_deg = 0;
  double pitch_deg = 0;
  double roll_deg = 0;
};

enum class XtfItemKind : std::uint8_t { kR2Sonic, kSample };

/// One packet. `bytes` stay valid until the next call of next().
struct XtfItem {
  XtfItemKind kind;
  base::TimeUs t_us;          ///< since 1970
  const std::uint8_t* bytes;  ///< kR2Sonic
  std::size_t size_bytes;     ///< kR2Sonic
  base::NavSample sample;     ///< kSample
  double height_m;            ///< of a position, above the ellipsoid or whatever the receiver says
};

struct XtfStats {
  std::uint64_t packets = 0;        ///< of any type
  std::uint64_t heads = 0;          ///< type 65
  std::uint64_t attitudes = 0;      ///< type 3
  std::uint64_t positions = 0;      ///< type 107
  std::uint64_t ignored = 0;        ///< other types
  std::uint64_t unusable = 0;       ///< too short for their type, or with a value that cannot be
  std::uint64_t skipped_bytes = 0;  ///< in no packet
  bool cut = false;                 ///< the last packet is not whole
};

class XtfReader {
 public:
  /// Opens and reads the header. Throws HostError kInput: cannot be read, shorter than a header, not XTF.
  explicit XtfReader(const std::string& path) : XtfReader(ByteSource(path), path) {}
  /// The same of bytes from anywhere; `name` for the errors.
  XtfReader(ByteSource source, const std::string& name);

  /// The next item; false at the end. Throws HostError kInput when the file cannot be read.
  [[nodiscard]] bool next(XtfItem* item);

  [[nodiscard]] const XtfStats& stats() const { return stats_; }
  [[nodiscard]] const XtfMounting& mounting() const { return mounting_; }
  [[nodiscard]] const std::string& recorder() const { return recorder_; }

 private:
  [[nodiscard]] bool read_packet();
  void pass(std::size_t byte_count);
  [[nodiscard]] bool take_attitude(XtfItem* item) const;
  [[nodiscard]] bool take_position(XtfItem* item) const;
  [[nodiscard]] bool take_head(XtfItem* item) const;

  ByteSource source_;
  std::vector<std::uint8_t> packet_;
  XtfMounting mounting_;
  std::string recorder_;
  XtfStats stats_;
};

}  // namespace leadline::host
