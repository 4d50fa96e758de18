#include "hal/attitude/mavlink_frame.hpp"

#include "hal/checksums.hpp"
#include "hal/wire.hpp"

namespace leadline::hal {

namespace {

constexpr std::size_t kHeader1_bytes = 6;
constexpr std::size_t kHeader2_bytes = 10;
constexpr std::uint8_t kSignedFlag = 1;

struct Extra {
  std::uint16_t id;
  std::uint8_t extra;
};

/// What an autopilot sends: those that matter here and those beside them, which are then known, checked
/// and passed over as a whole.
constexpr Extra kExtras[]{
    {0, 50},      {1, 124},    {2, 137},   {4, 237},   {21, 159},  {22, 220},  {24, 24},
    {27, 144},    {29, 115},   {30, 39},   {31, 246},  {32, 185},  {33, 104},  {36, 222},
    {42, 28},     {43, 132},   {44, 221},  {47, 153},  {49, 39},   {62, 183},  {65, 118},
    {66, 148},    {69, 243},   {74, 20},   {76, 152},  {77, 143},  {101, 102}, {102, 158},
    {111, 34},    {116, 76},   {125, 203}, {132, 85},  {137, 195}, {143, 131}, {147, 154},
    {148, 178},   {150, 134},  {152, 208}, {158, 134}, {163, 127}, {165, 21},  {173, 83},
    {178, 47},    {193, 71},   {232, 151}, {241, 90},  {242, 104}, {251, 170}, {253, 83},
    {261, 179},   {270, 59},   {321, 88},  {322, 243}, {330, 23},  {331, 91},  {11011, 106},
    {11037, 130}, {11038, 47},
};

}  // namespace

bool mavlink_crc_extra(std::uint32_t id, std::uint8_t& extra) {
  for (const Extra& row : kExtras) {
    if (row.id == id) {
      extra = row.extra;
      return true;
    }
  }
  return false;
}

bool read_mavlink_header(const std::uint8_t* bytes, std::size_t available, MavlinkHeader& header) {
  if (bytes[0] == kMavlink1Start && available >= kHeader1_bytes) {
    header = {bytes[5], bytes[2], bytes[3], bytes[4], bytes[1], kHeader1_bytes, 0};
    header.frame_bytes = static_cast<std::uint16_t>(kHeader1_bytes + bytes[1] + 2);
    return true;
  }
  if (bytes[0] == kMavlink2Start && available >= kHeader2_bytes) {
    const std::uint32_t id = bytes[7] | (static_cast<std::uint32_t>(read_u16_le(bytes + 8)) << 8U);
    header = {id, bytes[4], bytes[5], bytes[6], bytes[1], kHeader2_bytes, 0};
    const std::size_t tail = (bytes[2] & kSignedFlag) != 0 ? kMavlinkSignature_bytes : 0;
    header.frame_bytes = static_cast<std::uint16_t>(kHeader2_bytes + bytes[1] + 2 + tail);
    return true;
  }
  return false;
}

Judgement judge_mavlink(const std::uint8_t* bytes, std::size_t available) {
  const bool second = bytes[0] == kMavlink2Start;
  if (!second && bytes[0] != kMavlink1Start) {
    return {FrameVerdict::kNoStart, 0};
  }
  // A receiver must not take a frame with an incompatible flag that it does not know.
  if (second && available > 2 && (bytes[2] & ~kSignedFlag) != 0) {
    return {FrameVerdict::kBadValues, 0};
  }
  MavlinkHeader header{};
  if (!read_mavlink_header(bytes, available, header)) {
    return {FrameVerdict::kMore, 0};
  }
  std::uint8_t extra = 0;
  if (!mavlink_crc_extra(header.id, extra)) {
    return {FrameVerdict::kUnknownId, 0};
  }
  // The CRC as soon as it is here: a signature that was lost does not hold up what follows it.
  const std::size_t crc_at = std::size_t{header.payload_offset} + header.payload_bytes;
  if (available < crc_at + 2) {
    return {FrameVerdict::kMore, 0};
  }
  const std::uint16_t crc = crc16_mcrf4xx(&extra, 1, crc16_mcrf4xx(bytes + 1, crc_at - 1));
  if (crc != read_u16_le(bytes + crc_at)) {
    return {FrameVerdict::kBadChecksum, 0};
  }
  if (available < header.frame_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  return {FrameVerdict::kFrame, header.frame_bytes};
}

}  // namespace leadline::hal
