#include "hal/heads/wl3d.hpp"

#include <cstring>

#include "hal/heads/float_fields.hpp"
#include "hal/heads/protobuf_fields.hpp"
#include "hal/heads/snappy.hpp"
#include "hal/wire.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

constexpr base::TimeUs kMaxGap_us = 500'000;
constexpr std::size_t kHead_bytes = 8;
constexpr std::size_t kOverhead_bytes = 12;
constexpr std::int64_t kBamPerDegree = 11'930'465;
constexpr std::int64_t kFarthest_um = 200'000'000;
constexpr char kRangeImage[] = "waterlinked.sonar.protocol.RangeImage";

/// CRC-32 of zlib and Ethernet, four bits at a time.
std::uint32_t crc32(const std::uint8_t* data, std::size_t size_bytes) {
  constexpr std::array<std::uint32_t, 16> kNibbles{0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC,
                                                   0x76DC4190, 0x6B6B51F4, 0x4DB26158, 0x5005713C,
                                                   0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C,
                                                   0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C};
  std::uint32_t crc = 0xFFFFFFFFU;
  for (std::size_t i = 0; i < size_bytes; ++i) {
    crc ^= data[i];
    crc = kNibbles[crc & 0xFU] ^ (crc >> 4U);
    crc = kNibbles[crc & 0xFU] ^ (crc >> 4U);
  }
  return ~crc;
}

Judgement judge(const std::uint8_t* bytes, std::size_t available) {
  constexpr std::uint8_t kStart[] = {'R', 'I', 'P'};
  for (std::size_t i = 0; i < sizeof kStart && i < available; ++i) {
    if (bytes[i] != kStart[i]) {
      return {FrameVerdict::kNoStart, 0};
    }
  }
  if (available > 3 && bytes[3] != '1' && bytes[3] != '2') {
    return {FrameVerdict::kNoStart, 0};
  }
  if (available < kHead_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  const std::uint32_t size = read_u32_le(bytes + 4);
  if (size < kOverhead_bytes || size > kMaxWl3dPacket_bytes) {
    return {FrameVerdict::kBadLength, 0};
  }
  if (available < size) {
    return {FrameVerdict::kMore, 0};
  }
  const bool good = crc32(bytes, size - 4) == read_u32_le(bytes + size - 4);
  return good ? Judgement{FrameVerdict::kFrame, size} : Judgement{FrameVerdict::kBadChecksum, 0};
}

/// The type's name, behind whatever prefix its URL has.
bool is_range_image(const std::uint8_t* url, std::size_t url_bytes) {
  constexpr std::size_t kName_bytes = sizeof kRangeImage - 1;
  return url_bytes >= kName_bytes &&
         std::memcmp(url + url_bytes - kName_bytes, kRangeImage, kName_bytes) == 0 &&
         (url_bytes == kName_bytes || url[url_bytes - kName_bytes - 1] == '/');
}

/// The first field of this number that holds bytes; false when there is none, or when what is in front of
/// it is no message.
bool find_bytes(const std::uint8_t* data, std::size_t size_bytes, std::uint32_t number,
                ProtobufField& field) {
  ProtobufReader reader(data, size_bytes);
  while (reader.next(field)) {
    if (field.number == number && field.wire == ProtobufWire::kBytes) {
      return true;
    }
  }
  return false;
}

/// position / (count - 1) - 1/2 of a field of view, rounded down; count >= 2.
std::int64_t part_of(std::int64_t view_bam, std::uint64_t position, std::uint64_t count) {
  const auto last = static_cast<std::int64_t>(count - 1);
  return view_bam * (2 * static_cast<std::int64_t>(position) - last) / (2 * last);
}

base::Bam32 bam_of(std::int64_t angle, bool positive) {
  return static_cast<base::Bam32>(static_cast<std::uint64_t>(positive ? angle : -angle));
}

}  // namespace

Wl3dCodec::Wl3dCodec(const Wl3dConfig& config) : config_(config), framer_(kMaxGap_us) {}

bool Wl3dCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(ping);
}

bool Wl3dCodec::next(base::Ping& ping) {
  if (deliver(ping)) {
    return true;
  }
  FrameBytes frame{};
  while (framer_.next(judge, counters_, frame)) {
    take(frame);
    if (deliver(ping)) {
      return true;
    }
  }
  return false;
}

void Wl3dCodec::restart() {
  framer_.reset(counters_);
  image_ = Image{};
  ++counters_.restarts;
}

void Wl3dCodec::take(const FrameBytes& frame) {
  image_ = Image{};
  const std::uint8_t* payload = frame.data + kHead_bytes;
  const std::size_t payload_bytes = frame.size_bytes - kOverhead_bytes;
  std::size_t size = payload_bytes;
  if (frame.data[3] == '2') {
    if (!snappy_uncompress(payload, payload_bytes, message_.data(), message_.size(), size)) {
      ++counters_.bad_values;
      return;
    }
  } else if (payload_bytes > message_.size()) {
    ++counters_.bad_length;
    return;
  } else {
    std::memcpy(message_.data(), payload, payload_bytes);
  }
  // Packet { Any msg = 1 }, Any { string type_url = 1; bytes value = 2 }
  ProtobufField any{};
  ProtobufField url{};
  ProtobufField value{};
  if (!find_bytes(message_.data(), size, 1, any) || !find_bytes(any.data, any.size_bytes, 1, url) ||
      !find_bytes(any.data, any.size_bytes, 2, value)) {
    ++counters_.bad_values;
    return;
  }
  if (!is_range_image(url.data, url.size_bytes)) {
    ++counters_.ignored;
    return;
  }
  if (!take_image(value.data, value.size_bytes)) {
    image_ = Image{};
    ++counters_.bad_values;
    return;
  }
  image_.t_transmit_us = frame.t_arrival_us - 2000 * image_.range_um / image_.sound_speed_mm_s;
}

/// One number of a RangeImage; false when no sonar of this kind would send it.
bool Wl3dCodec::take_field(std::uint32_t number, std::uint64_t value, bool is_float) {
  const auto bits = static_cast<std::uint32_t>(value);
  std::int64_t speed = 0;
  if (is_float != (number == 2 || number == 3 || (number >= 7 && number <= 9))) {
    return number > 10;  // a field of a later version, in whatever form
  }
  switch (number) {
    case 2:
      if (!f32_within(bits, 1000, 1'300'000, 1'700'000, speed)) {
        return false;
      }
      image_.sound_speed_mm_s = static_cast<std::int32_t>(speed);
      return true;
    case 3:
      return f32_within(bits, 1'000'000, 1, kFarthest_um, image_.range_um);
    case 5:
      image_.width = value;
      return value >= 2 && value <= kMaxWl3dPixels;
    case 6:
      image_.height = value;
      return value >= 2 && value <= kMaxWl3dPixels;
    case 7:
      return f32_within(bits, kBamPerDegree, 1, 180 * kBamPerDegree, image_.fov_horizontal_bam);
    case 8:
      return f32_within(bits, kBamPerDegree, 1, 180 * kBamPerDegree, image_.fov_vertical_bam);
    case 9:
      // Up to a centimetre a count.
      return f32_within(bits, 1'000'000'000, 1, 10'000'000, image_.scale_q38m) &&
             f32_bits_to_integer(bits, kMaxFloatScale, image_.scale_q38m);
    default:
      return true;
  }
}

bool Wl3dCodec::take_image(const std::uint8_t* data, std::size_t size_bytes) {
  ProtobufReader reader(data, size_bytes);
  ProtobufField field{};
  while (reader.next(field)) {
    if (field.wire != ProtobufWire::kBytes) {
      if (!take_field(field.number, field.value, field.wire == ProtobufWire::kFixed32)) {
        return false;
      }
    } else if (field.number == 10) {
      if (image_.pixels_end != 0) {
        return false;  // in pieces: never seen
      }
      image_.pixels_at = static_cast<std::size_t>(field.data - message_.data());
      image_.pixels_end = image_.pixels_at + field.size_bytes;
    } else if (field.number == 1) {
      ProtobufReader header(field.data, field.size_bytes);
      ProtobufField part{};
      while (header.next(part)) {
        if (part.number == 2 && part.wire == ProtobufWire::kVarint) {
          image_.sequence_id = static_cast<std::uint32_t>(part.value);
        }
      }
    }
  }
  return reader.ok() && image_.sound_speed_mm_s > 0 && image_.range_um > 0 && image_.width > 0 &&
         image_.height > 0 && image_.width * image_.height <= kMaxWl3dPixels &&
         image_.fov_horizontal_bam > 0 && image_.fov_vertical_bam > 0 && image_.scale_q38m > 0 &&
         pixels_plausible();
}

/// As many as the image has, of 16 bits, none much farther than the sonar listened.
bool Wl3dCodec::pixels_plausible() const {
  std::size_t at = image_.pixels_at;
  std::uint64_t count = 0;
  while (at < image_.pixels_end) {
    std::uint64_t counts = 0;
    if (!read_varint(message_.data(), image_.pixels_end, at, counts) || counts > 0xFFFFU ||
        range_um_of(counts) > image_.range_um + image_.range_um / 8) {
      return false;
    }
    ++count;
  }
  return count == image_.width * image_.height;
}

std::int64_t Wl3dCodec::range_um_of(std::uint64_t counts) const {
  // Scale in units of 2^-38 m: below 2^32; counts below 2^16; times 1e6 / 2^6 = 15625.
  const std::int64_t q38 = static_cast<std::int64_t>(counts) * image_.scale_q38m;
  return ((q38 >> 16) * 15'625 + (std::int64_t{1} << 15U)) >> 16;
}

bool Wl3dCodec::deliver(base::Ping& ping) {
  while (image_.pixels_at < image_.pixels_end) {
    std::uint64_t counts = 0;
    static_cast<void>(read_varint(message_.data(), image_.pixels_end, image_.pixels_at, counts));
    const std::uint64_t column = image_.pixel % image_.width;
    const std::uint64_t row = image_.pixel / image_.width;
    ++image_.pixel;
    const std::int64_t range_um = range_um_of(counts);
    if (range_um == 0) {
      continue;
    }
    const std::int64_t yaw = part_of(image_.fov_horizontal_bam, column, image_.width);
    const std::int64_t pitch = part_of(image_.fov_vertical_bam, row, image_.height);
    ping = base::Ping{};
    ping.t_transmit_us = image_.t_transmit_us;
    ping.t_receive_us = image_.t_transmit_us + 2000 * range_um / image_.sound_speed_mm_s;
    ping.azimuth_bam32 = bam_of(yaw, config_.columns_to_the_right);
    // Elevation of a ping is positive downwards.
    ping.elevation_bam32 = bam_of(-pitch, config_.rows_upwards);
    ping.mount = config_.mount;
    ping.kind = base::ReturnKind::kRange;
    ping.quality = 255;
    ping.range_um = range_um;
    ping.sound_speed_mm_s = image_.sound_speed_mm_s;
    ++counters_.records;
    return true;
  }
  return false;
}

}  // namespace leadline::hal
