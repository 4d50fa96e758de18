#include "hal/emu/emulated_tritech.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace leadline::emu {

namespace {

unsigned u16_at(const Bytes& bytes, std::size_t at) {
  return bytes.at(at) + 256U * bytes.at(at + 1);
}

void put_u16(Bytes& out, unsigned value) {
  out.push_back(static_cast<std::uint8_t>(value & 0xFFU));
  out.push_back(static_cast<std::uint8_t>((value >> 8U) & 0xFFU));
}

}  // namespace

EmulatedTritech::EmulatedTritech(const EmulatedTritechConfig& config, Image image, Range range)
    : config_(config),
      image_(std::move(image)),
      range_(std::move(range)),
      line_(config.byte_time_ns),
      t_centred_us_(config.centring_us) {}

void EmulatedTritech::reboot(base::TimeUs now_us) {
  line_.clear();
  inbox_.clear();
  parameters_.clear();
  bearing_ = 3200;
  t_alive_us_ = now_us + 500'000;
  t_centred_us_ = now_us + config_.centring_us;
}

void EmulatedTritech::take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) {
  inbox_.insert(inbox_.end(), data, data + size_bytes);
  for (;;) {
    const auto start = std::find(inbox_.begin(), inbox_.end(), std::uint8_t{'@'});
    inbox_.erase(inbox_.begin(), start);
    if (inbox_.size() < 7) {
      return;
    }
    const std::size_t size = u16_at(inbox_, 5) + 6;
    char text[5] = {};
    std::snprintf(text, sizeof text, "%04X", static_cast<unsigned>(size - 6) & 0xFFFFU);
    if (size > 100 || !std::equal(text, text + 4, inbox_.begin() + 1)) {
      inbox_.erase(inbox_.begin());
      ++refused_;
      continue;
    }
    if (inbox_.size() < size) {
      return;
    }
    const Bytes frame(inbox_.begin(), inbox_.begin() + static_cast<std::ptrdiff_t>(size));
    if (frame.back() != 0x0A || frame[8] != node()) {
      inbox_.erase(inbox_.begin());
      ++refused_;
      continue;
    }
    inbox_.erase(inbox_.begin(), inbox_.begin() + static_cast<std::ptrdiff_t>(size));
    command(now_us, frame);
  }
}

void EmulatedTritech::command(base::TimeUs now_us, const Bytes& frame) {
  switch (frame[10]) {
    case 23: {
      Bytes version{7, 0, 0x34, 0x12};
      version.resize(11, 0);
      send(now_us, 1, version);
      return;
    }
    case 19:
      // 82 bytes with the block of the second channel, 66 without.
      if (frame.size() == (frame[13] == 0x1D ? 82U : 66U)) {
        parameters_ = frame;
        bearing_ = static_cast<int>(u16_at(frame, 37));
      } else {
        ++refused_;
      }
      return;
    case 25:
      if (parameters_.empty() || now_us < t_centred_us_ || now_us < t_free_us_) {
        ++refused_;
      } else if (config_.profiler) {
        send_sweep(now_us);
      } else {
        send_data(now_us);
      }
      return;
    default:
      ++refused_;
  }
}

void EmulatedTritech::send_data(base::TimeUs now_us) {
  const bool wide = (parameters_[14] & 1U) != 0;
  const unsigned bins = u16_at(parameters_, 53);
  const unsigned interval = u16_at(parameters_, 51);
  for (int i = 0; i < config_.frames_per_request; ++i) {
    const double bin_s = interval * 640e-9;
    Bytes image = image_({now_us, (bearing_ - 3200) * 360.0 / 6400, u16_at(parameters_, 35) / 10.0,
                          static_cast<int>(bins), bin_s});
    image.resize(bins, 0);
    if (!wide) {
      Bytes half((bins + 1) / 2, 0);
      for (std::size_t k = 0; k < bins; ++k) {
        const unsigned four = image[k] >> 4U;
        half[k / 2] = static_cast<std::uint8_t>(half[k / 2] | (k % 2 == 0 ? four << 4U : four));
      }
      image = half;
    }
    Bytes out;
    put_u16(out, static_cast<unsigned>(31 + image.size()));
    out.push_back(0x11);
    out.push_back(wide ? 0x10 : 0);
    out.push_back(0);
    out.insert(out.end(), {parameters_[14], parameters_[15], parameters_[35], parameters_[36]});
    out.insert(out.end(), parameters_.begin() + 17, parameters_.begin() + 21);
    out.insert(out.end(), {parameters_[43], 125, 0, parameters_[41], parameters_[42], 0, 0});
    put_u16(out, interval);
    out.insert(out.end(), parameters_.begin() + 37, parameters_.begin() + 41);
    out.push_back(parameters_[50]);
    put_u16(out, static_cast<unsigned>(bearing_));
    put_u16(out, static_cast<unsigned>(image.size()));
    out.insert(out.end(), image.begin(), image.end());
    t_free_us_ = std::max(t_free_us_, now_us) + static_cast<std::int64_t>(bins * bin_s * 1e6);
    send(t_free_us_, 2, out, false);
    bearing_ = (bearing_ + parameters_[50]) % 6400;
  }
}

void EmulatedTritech::send_sweep(base::TimeUs now_us) {
  const bool right = (parameters_[14] & 4U) != 0;
  const int left_limit = static_cast<int>(u16_at(parameters_, 37));
  const int right_limit = static_cast<int>(u16_at(parameters_, 39));
  const int step = parameters_[50];
  std::vector<unsigned> list;
  const int count = (right_limit - left_limit) / step + 1;
  for (int i = 0; i < count; ++i) {
    // In the order of the motion: to the right it ends at the right limit.
    const int bearing = right ? right_limit - (count - 1 - i) * step : right_limit - i * step;
    const double two_way_s =
        range_({now_us, (bearing - 3200) * 360.0 / 6400, u16_at(parameters_, 35) / 10.0, 0, 0});
    list.push_back(static_cast<unsigned>(std::lround(two_way_s * 1e6)));
  }
  const std::int64_t sweep_us = count * std::int64_t{20'000};
  Bytes out;
  put_u16(out, static_cast<unsigned>(37 + 2 * list.size()));
  out.insert(out.end(),
             {5, 0x10, 0, parameters_[14], parameters_[15], parameters_[35], parameters_[36]});
  out.insert(out.end(), parameters_.begin() + 17, parameters_.begin() + 21);
  out.insert(out.end(), {0, 125, 0, parameters_[41], parameters_[42]});
  out.insert(out.end(), parameters_.begin() + 37, parameters_.begin() + 41);
  out.push_back(parameters_[50]);
  put_u16(out, static_cast<unsigned>(sweep_us / 100));
  put_u16(out, static_cast<unsigned>(list.size()));
  for (const unsigned value : list) {
    put_u16(out, value);
  }
  out.insert(out.end(), {1, 2, 0x0A, 0x40, 5, 6, 7, 8, 9, 10});
  t_free_us_ = now_us + sweep_us;
  send(t_free_us_, 2, out, false);
}

void EmulatedTritech::send(base::TimeUs t_us, unsigned type, const Bytes& payload, bool counted) {
  const auto length = static_cast<unsigned>(payload.size() + 8);
  char head[16];
  std::snprintf(head, sizeof head, "@%04X", length);
  Bytes out(head, head + 5);
  put_u16(out, length);
  const auto byte = [](unsigned value) { return static_cast<std::uint8_t>(value); };
  out.insert(out.end(),
             {byte(node()), 0xFF, byte(counted ? length - 5 : 0), byte(type), 0x80, byte(node())});
  out.insert(out.end(), payload.begin(), payload.end());
  out.push_back(0x0A);
  line_.send(t_us, out);
}

void EmulatedTritech::advance(base::TimeUs now_us, Bytes& out) {
  while (t_alive_us_ <= now_us) {
    Bytes alive{static_cast<std::uint8_t>(parameters_.empty() ? 0x80 : 0), 1, 2, 3, 4};
    put_u16(alive, static_cast<unsigned>(bearing_));
    const bool centring = t_alive_us_ < t_centred_us_;
    unsigned info = parameters_.empty() ? 0x4A : 0x8A;
    info = centring ? 0x5D : info;
    alive.push_back(static_cast<std::uint8_t>(info));
    send(t_alive_us_, 4, alive);
    t_alive_us_ += 1'000'000;
  }
  Bytes sent;
  line_.take_until(now_us, sent);
  if (!silent_) {
    out.insert(out.end(), sent.begin(), sent.end());
  }
}

base::TimeUs EmulatedTritech::next_event_us() const {
  return std::min(line_.next_us(), t_alive_us_);
}

}  // namespace leadline::emu
