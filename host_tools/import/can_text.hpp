// CAN frames written as text, one a line:
//
//   candump -l, -L    (1502984866.421964) can0 09F112CC#FF725AFF7FFF7FFD
//   candump           can0  09F112CC   [8]  FF 72 5A FF 7F FF 7F FD      with or without a time in front, and
//                                                                       the length
//   candump, old      <0x09f112cc> [8] ff 72 5a ff 7f ff 7f fd            likewise
//   canboat           2016-02-28T19:57:02.364Z,2,127250,7,255,8,ff,10,3b,ff,7f,ce,f5,fc
//   gateways (YDWG)   00:17:55.475 R 0DF50B23 FF FF FF FF FF 00 00 FF      time of day
//
// canboat's lines carry whole NMEA 2000 messages; those of more than eight bytes come back as the
// fast-packet frames that they travelled in (with sequence numbers of their own). A CAN FD frame ("##", "[08]") of
// up to eight bytes counts as one of CAN; a longer one is no frame of these buses.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "hal/can_frame.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

enum class CanLineKind : std::uint8_t {
  kFrames,  ///< at least one frame
  kComment,  ///< blank, begins with '#', a note of canboat's own (PGN beyond 0x3FFFF), or indented text that
             ///< candump explains an error frame with
  kLong,  ///< an intact CAN FD frame of more than eight bytes; nothing of it is used
  kBad,   ///< neither; nothing of it is used
};

struct CanLine {
  CanLineKind kind = CanLineKind::kBad;
  std::optional<base::TimeUs> t_us;  ///< as written; since 1970 where the line has a date
  std::vector<hal::CanFrame> frames;
};

class CanTextReader {
 public:
  /// O(line).
  [[nodiscard]] CanLine parse(std::string_view line);

 private:
  std::uint8_t sequence_ = 0;  ///< of the next fast packet, 0 .. 7
};

/// Whether a line looks like one of these: for telling text from bytes.
[[nodiscard]] bool looks_like_can_text(std::string_view line);

}  // namespace leadline::host
