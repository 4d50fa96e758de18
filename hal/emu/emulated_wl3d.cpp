#include "hal/emu/emulated_wl3d.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace leadline::emu {

namespace {

constexpr double kScale_m = 1.0 / 1310.72;

void put_u32(Bytes& out, std::uint32_t value) {
  for (unsigned shift = 0; shift < 32; shift += 8) {
    out.push_back(static_cast<std::uint8_t>((value >> shift) & 0xFFU));
  }
}

void put_varint(Bytes& out, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7U) {
    out.push_back(static_cast<std::uint8_t>((value & 0x7FU) | 0x80U));
  }
  out.push_back(static_cast<std::uint8_t>(value));
}

void put_number(Bytes& out, unsigned field, std::uint64_t value) {
  put_varint(out, field * 8U);
  put_varint(out, value);
}

void put_float(Bytes& out, unsigned field, double value) {
  const auto narrow = static_cast<float>(value);
  std::uint32_t bits = 0;
  std::memcpy(&bits, &narrow, sizeof bits);
  put_varint(out, field * 8U + 5U);
  put_u32(out, bits);
}

void put_bytes(Bytes& out, unsigned field, const Bytes& value) {
  put_varint(out, field * 8U + 2U);
  put_varint(out, value.size());
  out.insert(out.end(), value.begin(), value.end());
}

std::uint32_t crc_of(const Bytes& bytes) {
  std::uint32_t crc = 0xFFFFFFFFU;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc & 1U) != 0 ? (crc >> 1U) ^ 0xEDB88320U : crc >> 1U;
    }
  }
  return ~crc;
}

void put_literal(Bytes& out, const Bytes& in, std::size_t from, std::size_t to) {
  while (from < to) {
    const std::size_t size = std::min<std::size_t>(to - from, 300);
    if (size <= 60) {
      out.push_back(static_cast<std::uint8_t>((size - 1) << 2U));
    } else if (size <= 256) {
      out.push_back(60U << 2U);
      out.push_back(static_cast<std::uint8_t>(size - 1));
    } else {
      out.push_back(61U << 2U);
      out.push_back(static_cast<std::uint8_t>((size - 1) & 0xFFU));
      out.push_back(static_cast<std::uint8_t>((size - 1) >> 8U));
    }
    out.insert(out.end(), in.begin() + static_cast<std::ptrdiff_t>(from),
               in.begin() + static_cast<std::ptrdiff_t>(from + size));
    from += size;
  }
}

/// How far the bytes at `at` are those that lie `offset` in front of them, 64 at most.
std::size_t match_at(const Bytes& in, std::size_t at, std::size_t offset) {
  std::size_t length = 0;
  while (offset <= at && length < 64 && at + length < in.size() &&
         in[at + length] == in[at + length - offset]) {
    ++length;
  }
  return length;
}

/// A raw Snappy block: literals, and copies from one, two or three bytes back (runs of pixels), or from a
/// row back. Every kind of element occurs.
Bytes compress(const Bytes& in) {
  Bytes out;
  put_varint(out, in.size());
  std::size_t literal = 0;
  std::size_t at = 0;
  while (at < in.size()) {
    std::size_t best = 0;
    std::size_t back = 0;
    for (const std::size_t offset : {1U, 2U, 3U, 256U, 512U, 2500U}) {
      const std::size_t length = match_at(in, at, offset);
      if (length > best) {
        best = length;
        back = offset;
      }
    }
    if (best < 6) {
      ++at;
      continue;
    }
    put_literal(out, in, literal, at);
    if (best <= 11 && back < 2048) {
      out.push_back(static_cast<std::uint8_t>(1U | ((best - 4) << 2U) | ((back >> 8U) << 5U)));
      out.push_back(static_cast<std::uint8_t>(back & 0xFFU));
    } else if (best % 2 == 0) {
      out.push_back(static_cast<std::uint8_t>(2U | ((best - 1) << 2U)));
      out.push_back(static_cast<std::uint8_t>(back & 0xFFU));
      out.push_back(static_cast<std::uint8_t>(back >> 8U));
    } else {
      out.push_back(static_cast<std::uint8_t>(3U | ((best - 1) << 2U)));
      put_u32(out, static_cast<std::uint32_t>(back));
    }
    at += best;
    literal = at;
  }
  put_literal(out, in, literal, in.size());
  return out;
}

}  // namespace

Bytes wl3d_packet(const std::string& type, const Bytes& message, bool compressed) {
  const std::string url = "type.googleapis.com/waterlinked.sonar.protocol." + type;
  Bytes any;
  put_bytes(any, 1, Bytes(url.begin(), url.end()));
  put_bytes(any, 2, message);
  Bytes packet;
  put_bytes(packet, 1, any);
  const Bytes payload = compressed ? compress(packet) : packet;
  Bytes out{'R', 'I', 'P', static_cast<std::uint8_t>(compressed ? '2' : '1')};
  put_u32(out, static_cast<std::uint32_t>(payload.size() + 12));
  out.insert(out.end(), payload.begin(), payload.end());
  put_u32(out, crc_of(out));
  return out;
}

Bytes wl3d_range_image(const EmulatedWl3dConfig& config, std::uint32_t sequence_id,
                       const std::vector<std::uint32_t>& pixels, double scale_m) {
  Bytes stamp;
  put_number(stamp, 1, 1'700'000'000);
  put_number(stamp, 2, 123'456'789);
  Bytes header;
  put_bytes(header, 1, stamp);
  put_number(header, 2, sequence_id);
  Bytes packed;
  for (const std::uint32_t pixel : pixels) {
    put_varint(packed, pixel);
  }
  Bytes out;
  put_bytes(out, 1, header);
  put_float(out, 2, config.sound_speed_m_s);
  put_float(out, 3, config.range_m);
  put_number(out, 4, 1'200'000);
  put_number(out, 5, static_cast<std::uint64_t>(config.width));
  put_number(out, 6, static_cast<std::uint64_t>(config.height));
  put_float(out, 7, config.fov_horizontal_deg);
  put_float(out, 8, config.fov_vertical_deg);
  put_float(out, 9, scale_m);
  put_bytes(out, 10, packed);
  return out;
}

EmulatedWl3d::EmulatedWl3d(const EmulatedWl3dConfig& config, Range range)
    : FreeRunningHead(config.interval_us), config_(config), range_(std::move(range)) {}

void EmulatedWl3d::ping(base::TimeUs t_ping_us) {
  std::vector<std::uint32_t> pixels;
  Bytes grey;
  for (int row = 0; row < config_.height; ++row) {
    for (int column = 0; column < config_.width; ++column) {
      const double yaw =
          (static_cast<double>(column) / (config_.width - 1) - 0.5) * config_.fov_horizontal_deg;
      const double pitch =
          (static_cast<double>(row) / (config_.height - 1) - 0.5) * config_.fov_vertical_deg;
      const double range = range_({t_ping_us, yaw, pitch});
      pixels.push_back(
          range <= config_.range_m ? static_cast<std::uint32_t>(std::lround(range / kScale_m)) : 0);
      grey.push_back(static_cast<std::uint8_t>(pixels.back() > 0 ? 100 : 0));
    }
  }
  const base::TimeUs t_us =
      t_ping_us + static_cast<std::int64_t>(2e6 * config_.range_m / config_.sound_speed_m_s);
  send(t_us, wl3d_packet("RangeImage", wl3d_range_image(config_, sequence_id_, pixels, kScale_m),
                         config_.compressed));
  Bytes image;
  put_bytes(image, 10, grey);
  send(t_us, wl3d_packet("BitmapImageGreyscale8", image, config_.compressed));
  ++sequence_id_;
}

}  // namespace leadline::emu
