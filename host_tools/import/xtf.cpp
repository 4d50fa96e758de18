#include "host_tools/import/xtf.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "hal/wire.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/import/calendar.hpp"

namespace leadline::host {
namespace {

using hal::read_u16_le;
using hal::read_u32_le;
using hal::read_u64_le;

constexpr std::size_t kFileHeader_bytes = 1024;
constexpr std::size_t kPacketHeader_bytes = 14;
constexpr std::uint8_t kFileMark = 123;
constexpr std::size_t kChannelsInHeader = 6;
constexpr std::size_t kChannel_bytes = 128;
constexpr std::size_t kFirstChannel = 256;
constexpr std::uint8_t kBathymetryChannel = 3;
constexpr std::size_t kHeadHeader_bytes = 256;

enum PacketType : std::uint8_t { kAttitudePacket = 3, kR2SonicPacket = 65, kPositionPacket = 107 };

double f32_at(const std::uint8_t* bytes) {
  const std::uint32_t bits = read_u32_le(bytes);
  float value = 0;
  std::memcpy(&value, &bits, sizeof value);
  return static_cast<double>(value);
}

double f64_at(const std::uint8_t* bytes) {
  const std::uint64_t bits = read_u64_le(bytes);
  double value = 0;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

/// Of the packet whose header is there; 0: none begins here.
std::size_t packet_bytes(const std::uint8_t* header) {
  const std::uint32_t size_bytes = read_u32_le(header + 10);
  const bool mark = header[0] == 0xCE && header[1] == 0xFA;
  return mark && size_bytes >= kPacketHeader_bytes && size_bytes <= kMaxXtfPacket_bytes ? size_bytes
                                                                                        : 0;
}

/// A packet, and behind it another one or the end of what is there.
bool chained(const std::uint8_t* bytes, std::size_t available) {
  const std::size_t size_bytes = available >= kPacketHeader_bytes ? packet_bytes(bytes) : 0;
  return size_bytes != 0 &&
         (size_bytes == available ||
          (size_bytes + kPacketHeader_bytes <= available && packet_bytes(bytes + size_bytes) != 0));
}

/// Where, behind the first byte, a packet begins whose end is not in sight or is another's beginning; 0: nowhere.
std::size_t chain_inside(const std::uint8_t* bytes, std::size_t available) {
  for (std::size_t at = 1; at + kPacketHeader_bytes <= available; ++at) {
    const std::size_t size_bytes = packet_bytes(bytes + at);
    if (size_bytes != 0 && (at + size_bytes + kPacketHeader_bytes > available ||
                            chained(bytes + at, available - at))) {
      return at;
    }
  }
  return 0;
}

/// False also for NaN.
bool within(double value, double limit) { return value >= -limit && value <= limit; }

base::Bam32 bam_of_deg(double degrees) {
  return static_cast<base::Bam32>(
      static_cast<std::int64_t>(std::floor(degrees / 360.0 * 4294967296.0 + 0.5)));
}

/// Year u16, month, day, hour, minute, second u8; false for a date that is none.
bool read_time(const std::uint8_t* bytes, base::TimeUs fraction_us, base::TimeUs* t_us) {
  const CalendarTime time{read_u16_le(bytes), bytes[2], bytes[3], bytes[4], bytes[5], bytes[6]};
  if (!is_calendar_time(time)) {
    return false;
  }
  *t_us = unix_us(time) + fraction_us;
  return true;
}

}  // namespace

XtfReader::XtfReader(ByteSource source, const std::string& name) : source_(std::move(source)) {
  const std::size_t there = source_.peek(kFileHeader_bytes);
  if (there != kFileHeader_bytes) {
    throw HostError(ExitCode::kInput, name + ": shorter than the header of an XTF file (" +
                                          std::to_string(there) + " of 1024 bytes)");
  }
  const std::vector<std::uint8_t> header(source_.data(), source_.data() + kFileHeader_bytes);
  source_.skip(kFileHeader_bytes);
  if (header[0] != kFileMark) {
    throw HostError(ExitCode::kInput, name + ": not an XTF file: byte 0 is " +
                                          std::to_string(header[0]) + ", expected 123");
  }
  const auto* const recorder = reinterpret_cast<const char*>(header.data() + 2);
  recorder_.assign(recorder, strnlen(recorder, 8));
  const std::size_t channels =
      static_cast<std::size_t>(read_u16_le(header.data() + 166)) + read_u16_le(header.data() + 168);
  for (std::size_t i = 0; i < std::min(channels, kChannelsInHeader); ++i) {
    const std::uint8_t* const channel = header.data() + kFirstChannel + i * kChannel_bytes;
    if (channel[0] != kBathymetryChannel) {
      continue;
    }
    mounting_.starboard_m = f32_at(channel + 48);
    mounting_.forward_m = f32_at(channel + 52);
    mounting_.down_m = f32_at(channel + 56);
    mounting_.heading_deg = f32_at(channel + 60);
    mounting_.pitch_deg = f32_at(channel + 64);
    mounting_.roll_deg = f32_at(channel + 68);
    for (const double value : {mounting_.starboard_m, mounting_.forward_m, mounting_.down_m,
                               mounting_.heading_deg, mounting_.pitch_deg, mounting_.roll_deg}) {
      mounting_.stated = mounting_.stated || value != 0.0;
    }
    break;
  }
  if (channels > kChannelsInHeader) {
    const std::size_t more = (channels - kChannelsInHeader + 7) / 8;
    source_.skip(source_.peek(kFileHeader_bytes * more));
  }
}

/// Fills packet_ with the next whole packet.
bool XtfReader::read_packet() {
  for (;;) {
    const std::size_t there = source_.peek(kPacketHeader_bytes);
    if (there < kPacketHeader_bytes) {
      stats_.cut = stats_.cut || there != 0;
      return false;
    }
    const std::size_t size_bytes = packet_bytes(source_.data());
    if (size_bytes == 0) {
      pass(1);
      continue;
    }
    const std::size_t available = source_.peek(size_bytes + kPacketHeader_bytes);
    if (!chained(source_.data(), available)) {
      // Junk behind it, the file's cut end, or a size that is wrong: then packets begin inside.
      const std::size_t inside = chain_inside(source_.data(), available);
      if (inside != 0) {
        pass(inside);
        continue;
      }
      if (available < size_bytes) {
        stats_.cut = true;
        return false;
      }
    }
    packet_.assign(source_.data(), source_.data() + size_bytes);
    source_.skip(size_bytes);
    return true;
  }
}

void XtfReader::pass(std::size_t byte_count) {
  source_.skip(byte_count);
  stats_.skipped_bytes += byte_count;
}

bool XtfReader::take_attitude(XtfItem* item) const {
  if (packet_.size() < 63) {
    return false;
  }
  const std::uint8_t* const bytes = packet_.data();
  const double pitch_deg = f32_at(bytes + 30);
  const double roll_deg = f32_at(bytes + 34);
  const double heave_m = f32_at(bytes + 38);
  const double heading_deg = f32_at(bytes + 50);
  const unsigned millisecond = read_u16_le(bytes + 61);
  if (!within(pitch_deg, 90) || !within(roll_deg, 180) || !within(heave_m, 100) ||
      !within(heading_deg, 360) || millisecond > 999 ||
      !read_time(bytes + 54, millisecond * 1000, &item->t_us)) {
    return false;
  }
  base::NavSample& sample = item->sample;
  sample.kind = base::NavKind::kAttitude;
  sample.fields = base::kNavRollPitch | base::kNavHeading | base::kNavHeave;
  sample.attitude = {bam_of_deg(roll_deg), bam_of_deg(pitch_deg), bam_of_deg(heading_deg)};
  sample.heave_um = -std::llround(heave_m * 1e6);
  return true;
}

bool XtfReader::take_position(XtfItem* item) const {
  if (packet_.size() < 47) {
    return false;
  }
  const std::uint8_t* const bytes = packet_.data();
  const unsigned tenth_ms = read_u16_le(bytes + 21);
  const double latitude_deg = f64_at(bytes + 23);
  const double longitude_deg = f64_at(bytes + 31);
  const double height_m = f64_at(bytes + 39);
  if (!within(latitude_deg, 90) || !within(longitude_deg, 180) || tenth_ms > 9999 ||
      !read_time(bytes + 14, tenth_ms * 100, &item->t_us)) {
    return false;
  }
  base::NavSample& sample = item->sample;
  sample.kind = base::NavKind::kPosition;
  sample.fields = base::kNavGeodetic;
  sample.latitude_e9deg = std::llround(latitude_deg * 1e9);
  sample.longitude_e9deg = std::llround(longitude_deg * 1e9);
  item->height_m = within(height_m, 10'000) ? height_m : 0.0;
  return true;
}

bool XtfReader::take_head(XtfItem* item) const {
  if (packet_.size() <= kHeadHeader_bytes || packet_[20] > 59 || packet_[21] > 99 ||
      !read_time(packet_.data() + 14, packet_[21] * 10'000, &item->t_us)) {
    return false;
  }
  item->kind = XtfItemKind::kR2Sonic;
  item->bytes = packet_.data() + kHeadHeader_bytes;
  item->size_bytes = packet_.size() - kHeadHeader_bytes;
  return true;
}

bool XtfReader::next(XtfItem* item) {
  while (read_packet()) {
    *item = XtfItem{};
    item->kind = XtfItemKind::kSample;
    stats_.packets += 1;
    bool usable = false;
    switch (packet_[2]) {
      case kAttitudePacket:
        usable = take_attitude(item);
        stats_.attitudes += usable ? 1 : 0;
        break;
      case kPositionPacket:
        usable = take_position(item);
        stats_.positions += usable ? 1 : 0;
        break;
      case kR2SonicPacket:
        usable = take_head(item);
        stats_.heads += usable ? 1 : 0;
        break;
      default:
        stats_.ignored += 1;
        continue;
    }
    if (!usable) {
      stats_.unusable += 1;
      continue;
    }
    item->sample.t_us = item->t_us;
    item->sample.utc_us = item->t_us;
    item->sample.quality = 255;
    return true;
  }
  return false;
}

}  // namespace leadline::host
