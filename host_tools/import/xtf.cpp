#include "host_tools/import/xtf.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

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

XtfReader::XtfReader(const std::string& path) : path_(path), file_(path, std::ios::binary) {
  if (!file_) {
    throw HostError(ExitCode::kInput, path + ": cannot be opened");
  }
  std::vector<std::uint8_t> header(kFileHeader_bytes);
  file_.read(reinterpret_cast<char*>(header.data()), kFileHeader_bytes);
  if (static_cast<std::size_t>(file_.gcount()) != kFileHeader_bytes) {
    throw HostError(ExitCode::kInput, path + ": shorter than the header of an XTF file (" +
                                          std::to_string(file_.gcount()) + " of 1024 bytes)");
  }
  if (header[0] != kFileMark) {
    throw HostError(ExitCode::kInput, path + ": not an XTF file: byte 0 is " +
                                          std::to_string(header[0]) + ", expected 123");
  }
  const auto* const name = reinterpret_cast<const char*>(header.data() + 2);
  recorder_.assign(name, strnlen(name, 8));
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
    file_.seekg(static_cast<std::streamoff>(kFileHeader_bytes * (1 + more)));
  }
}

/// Moves the file to the next 0xFACE; false at the end.
bool XtfReader::find_start() {
  int previous = -1;
  for (int byte = file_.get(); byte != std::char_traits<char>::eof(); byte = file_.get()) {
    if (previous == 0xCE && byte == 0xFA) {
      file_.seekg(-2, std::ios::cur);
      stats_.skipped_bytes -= 1;  // the 0xCE was counted
      return true;
    }
    previous = byte;
    stats_.skipped_bytes += 1;
  }
  return false;
}

/// Fills packet_ with the next whole packet.
bool XtfReader::read_packet() {
  for (;;) {
    packet_.resize(kPacketHeader_bytes);
    file_.read(reinterpret_cast<char*>(packet_.data()), kPacketHeader_bytes);
    const auto got = static_cast<std::size_t>(file_.gcount());
    if (file_.bad()) {
      throw HostError(ExitCode::kInput, path_ + ": cannot be read");
    }
    if (got < kPacketHeader_bytes) {
      stats_.cut = got != 0;
      return false;
    }
    const std::uint32_t size_bytes = read_u32_le(packet_.data() + 10);
    const bool start = packet_[0] == 0xCE && packet_[1] == 0xFA;
    if (!start || size_bytes < kPacketHeader_bytes || size_bytes > kMaxXtfPacket_bytes) {
      file_.seekg(1 - static_cast<std::streamoff>(kPacketHeader_bytes), std::ios::cur);
      stats_.skipped_bytes += 1;
      if (!find_start()) {
        return false;
      }
      continue;
    }
    packet_.resize(size_bytes);
    const auto rest = static_cast<std::streamsize>(size_bytes - kPacketHeader_bytes);
    file_.read(reinterpret_cast<char*>(packet_.data() + kPacketHeader_bytes), rest);
    if (file_.gcount() != rest) {
      stats_.cut = true;
      return false;
    }
    return true;
  }
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
