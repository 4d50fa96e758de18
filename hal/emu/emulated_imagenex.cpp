#include "hal/emu/emulated_imagenex.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace leadline::emu {

namespace {

constexpr std::size_t kCommand_bytes = 27;

void put_packed(Bytes& out, std::size_t at, unsigned value) {
  out.at(at) = static_cast<std::uint8_t>(value & 0x7FU);
  out.at(at + 1) = static_cast<std::uint8_t>((value >> 7U) & 0x7FU);
}

void put_angle(Bytes& out, std::size_t at, double degrees) {
  const auto value = static_cast<unsigned>(std::lround(degrees / 0.025)) & 0x3FFFU;
  out.at(at) = static_cast<std::uint8_t>(value & 0xFFU);
  out.at(at + 1) = static_cast<std::uint8_t>((value >> 8U) | 0x80U);  // new
}

}  // namespace

EmulatedImagenex::EmulatedImagenex(const EmulatedImagenexConfig& config, Measure measure)
    : config_(config), measure_(std::move(measure)), line_(config.byte_time_ns) {}

void EmulatedImagenex::take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) {
  for (std::size_t i = 0; i < size_bytes; ++i) {
    inbox_.push_back(data[i]);
    if (inbox_.size() == 1 && inbox_[0] != 0xFE) {
      inbox_.clear();
    } else if (inbox_.size() == 2 && inbox_[1] != 0x44) {
      inbox_.clear();
    } else if (data[i] == 0xFD || inbox_.size() == kCommand_bytes) {
      // The end, wherever it comes.
      command(now_us);
      inbox_.clear();
    }
  }
}

void EmulatedImagenex::advance(base::TimeUs now_us, Bytes& out) {
  Bytes sent;
  line_.take_until(now_us, sent);
  if (!silent_) {
    out.insert(out.end(), sent.begin(), sent.end());
  }
}

double EmulatedImagenex::range_of(unsigned code) const {
  static const std::vector<unsigned> k852{5, 10, 20, 30, 40, 50};
  static const std::vector<unsigned> k881{1, 2, 3, 4, 5, 10, 20, 30, 40, 50, 60, 80, 100};
  static const std::vector<std::pair<unsigned, double>> k831{
      {2, 0.125}, {4, 0.25}, {6, 0.5}, {8, 0.75}, {10, 1},
      {20, 2},    {30, 3},   {40, 4},  {50, 5},   {60, 6}};
  if (config_.head == ImagenexHead::k831l) {
    const auto hit = std::find_if(k831.begin(), k831.end(),
                                  [code](const auto& entry) { return entry.first == code; });
    return hit == k831.end() ? 0 : hit->second;
  }
  const auto& codes = config_.head == ImagenexHead::k881a ? k881 : k852;
  return std::count(codes.begin(), codes.end(), code) > 0 ? code : 0;
}

void EmulatedImagenex::command(base::TimeUs now_us) {
  const bool long_header = config_.head == ImagenexHead::k831l;
  if (inbox_.size() != kCommand_bytes || inbox_.back() != 0xFD || now_us < t_free_us_ ||
      range_of(inbox_[3]) == 0) {
    ++refused_;
    return;
  }
  const double range_m = range_of(inbox_[3]);
  const bool many = inbox_[19] == 50 && !long_header;
  const bool profile = inbox_[22] == 1;
  int points = long_header ? 250 : 252;
  points = many ? 500 : points;
  points = profile ? 0 : points;
  const ImagenexEcho echo = measure_({now_us, angle_deg_, range_m, points});
  ++shots_;
  const std::size_t header = long_header ? 32 : 12;
  Bytes reply(header + static_cast<std::size_t>(points) + 1, 0);
  reply[0] = 'I';
  reply[1] = profile ? 'P' : 'M';
  reply[1] = many && !profile ? 'G' : reply[1];
  reply[2] = 'X';
  reply[3] = inbox_[2];
  reply[4] = config_.head == ImagenexHead::k831l ? 0x80 : 0x40;
  if (config_.head != ImagenexHead::kSounder852) {
    put_packed(reply, 5, packed_position());
  }
  reply[7] = inbox_[3];
  double unit_m = 0.01;
  if (config_.head == ImagenexHead::k881a && range_m < 5) {
    unit_m = 0.002;
  }
  put_packed(reply, 8, static_cast<unsigned>(std::lround(echo.found_m / unit_m)));
  put_packed(reply, 10, static_cast<unsigned>(points));
  if (long_header) {
    put_angle(reply, 16, echo.roll_deg);
    put_angle(reply, 18, echo.pitch_deg);
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(points) && i < echo.intensity.size(); ++i) {
    reply[header + i] = echo.intensity[i];
  }
  reply.back() = 0xFC;
  const base::TimeUs t_us = now_us + static_cast<std::int64_t>(2e6 * range_m / 1500) +
                            (long_header ? 0 : inbox_[24] * std::int64_t{2000});
  line_.send(t_us, reply);
  t_free_us_ = t_us;
  step(inbox_);
}

/// One step on, to and fro in the sector.
void EmulatedImagenex::step(const Bytes& command) {
  if (config_.head == ImagenexHead::kSounder852) {
    return;
  }
  double step_deg = command[13] * 0.3;
  double train_deg = command[11] * 3.0;
  if (config_.head == ImagenexHead::kScanner852) {
    step_deg = command[13] * 3.0;
    train_deg -= 210;
  } else if (config_.head == ImagenexHead::k881a) {
    train_deg -= 180;
  }
  const double half = command[12] * 1.5;
  double next = angle_deg_ + direction_ * step_deg;
  if (next > train_deg + half || next < train_deg - half) {
    direction_ = -direction_;
    next = std::clamp(angle_deg_, train_deg - half, train_deg + half);
  }
  angle_deg_ = next;
}

unsigned EmulatedImagenex::packed_position() const {
  const long position = config_.head == ImagenexHead::kScanner852
                            ? std::lround(angle_deg_ / 0.15) + 1400
                            : std::lround(angle_deg_ / 0.3) + 600;
  return static_cast<unsigned>(position) | (direction_ > 0 ? 0x2000U : 0U);
}

}  // namespace leadline::emu
