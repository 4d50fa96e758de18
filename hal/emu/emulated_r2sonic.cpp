#include "hal/emu/emulated_r2sonic.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace leadline::emu {
namespace {

/// Appends big-endian numbers.
class Writer {
 public:
  explicit Writer(Bytes& out) : out_(out) {}
  void u16(unsigned value) {
    out_.push_back(static_cast<std::uint8_t>(value >> 8U));
    out_.push_back(static_cast<std::uint8_t>(value));
  }
  void u32(std::uint32_t value) {
    u16(value >> 16U);
    u16(value & 0xFFFFU);
  }
  void f32(float value) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    u32(bits);
  }
  void zeros(std::size_t count) { out_.insert(out_.end(), count, 0); }
  void text(const char* letters) {
    for (; *letters != '\0'; ++letters) {
      out_.push_back(static_cast<std::uint8_t>(*letters));
    }
  }
  void section(const char* name, std::size_t size_bytes) {
    text(name);
    u16(static_cast<unsigned>(size_bytes));
  }
  void words(const std::vector<std::uint16_t>& values) {
    for (const std::uint16_t value : values) {
      u16(value);
    }
  }
  void pad() { zeros((4 - out_.size() % 4) % 4); }

 private:
  Bytes& out_;
};

void write_header(const R2SonicPacket& packet, Writer& to) {
  to.section("H0", 116);
  to.text("2026");
  to.zeros(8);
  to.text("100000");
  to.zeros(6);
  to.u32(packet.seconds);
  to.u32(packet.nanoseconds);
  to.u32(packet.ping_number);
  to.f32(0.05F);
  to.f32(packet.sound_speed_m_s);
  to.f32(400'000.0F);
  to.f32(200.0F);
  to.f32(3e-5F);
  to.zeros(126 - 72);
  to.u16(static_cast<unsigned>(packet.ranges.size()));
}

void write_angles(const R2SonicPacket& packet, Writer& to) {
  to.section(packet.equidistant ? "A2" : "A0", 36 + 2 * packet.steps.size());
  to.f32(packet.first_angle_rad);
  to.f32(packet.equidistant ? packet.step_scale_rad : packet.last_angle_rad);
  to.zeros(24);
  to.words(packet.steps);
  to.pad();
}

void write_flags(const R2SonicPacket& packet, Writer& to) {
  to.section("Q0", 4 + 4 * ((packet.flags.size() + 7) / 8));
  for (std::size_t begin = 0; begin < packet.flags.size(); begin += 8) {
    std::uint32_t word = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      const std::size_t at = begin + i;
      word = (word << 4U) | (at < packet.flags.size() ? packet.flags[at] & 0xFU : 0U);
    }
    to.u32(word);
  }
}

}  // namespace

Bytes write_r2sonic_packet(const R2SonicPacket& packet) {
  Bytes bytes;
  Writer to(bytes);
  to.text("BTH0");
  to.u32(0);
  to.u32(0);
  write_header(packet, to);
  to.section("R0", 8 + 2 * packet.ranges.size());
  to.f32(packet.range_scale_s);
  to.words(packet.ranges);
  to.pad();
  write_angles(packet, to);
  if (!packet.intensities.empty()) {
    to.section("I1", 8 + 2 * packet.intensities.size());
    to.f32(1.0F);
    to.words(packet.intensities);
    to.pad();
  }
  to.section("G0", 16);
  to.zeros(12);
  if (!packet.flags.empty()) {
    write_flags(packet, to);
  }
  Bytes size;
  Writer(size).u32(static_cast<std::uint32_t>(bytes.size()));
  std::copy(size.begin(), size.end(), bytes.begin() + 4);
  return bytes;
}

EmulatedR2Sonic::EmulatedR2Sonic(EmulatedR2SonicSettings settings)
    : settings_(std::move(settings)) {}

void EmulatedR2Sonic::take(base::TimeUs /*now_us*/, const std::uint8_t* /*data*/,
                           std::size_t /*size_bytes*/) {}

Bytes EmulatedR2Sonic::ping_at(base::TimeUs t_us) {
  R2SonicPacket packet;
  const std::int64_t clock_us = t_us + settings_.clock_offset_us;
  packet.seconds = static_cast<std::uint32_t>(clock_us / 1'000'000);
  packet.nanoseconds = static_cast<std::uint32_t>(clock_us % 1'000'000) * 1000U;
  packet.ping_number = ping_number_++;
  packet.sound_speed_m_s = settings_.sound_speed_m_s;
  packet.first_angle_rad = -0.5F * settings_.opening_rad;
  packet.last_angle_rad = 0.5F * settings_.opening_rad;
  std::vector<double> times_s(settings_.beams);
  double longest_s = 1e-3;
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    const double share =
        static_cast<double>(i) / static_cast<double>(std::max<std::size_t>(times_s.size() - 1, 1));
    times_s[i] =
        settings_.two_way_s(t_us, (share - 0.5) * static_cast<double>(settings_.opening_rad));
    longest_s = std::max(longest_s, times_s[i]);
  }
  packet.range_scale_s = static_cast<float>(longest_s / 65'000.0);
  for (const double time_s : times_s) {
    const double count = std::floor(time_s / static_cast<double>(packet.range_scale_s) + 0.5);
    packet.ranges.push_back(static_cast<std::uint16_t>(count));
    packet.flags.push_back(time_s > 0 ? 11 : 0);
    packet.intensities.push_back(time_s > 0 ? 200 : 0);
  }
  return write_r2sonic_packet(packet);
}

void EmulatedR2Sonic::advance(base::TimeUs now_us, Bytes& out) {
  while (next_ping_us_ <= now_us) {
    const Bytes packet = ping_at(next_ping_us_);
    out.insert(out.end(), packet.begin(), packet.end());
    next_ping_us_ += settings_.period_us;
  }
}

}  // namespace leadline::emu
