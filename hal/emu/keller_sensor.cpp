#include "hal/emu/keller_sensor.hpp"

#include <algorithm>
#include <utility>

#include "hal/checksums.hpp"
#include "hal/emu/wire_bytes.hpp"

namespace leadline::emu {

namespace {

constexpr std::size_t kLongestHeard = 64;

bool ends_sealed(const Bytes& heard, std::size_t from, bool high_first) {
  const std::size_t size = heard.size() - from;
  const std::uint16_t crc = hal::crc16_modbus(heard.data() + from, size - 2);
  const unsigned first = heard[heard.size() - 2];
  const unsigned second = heard[heard.size() - 1];
  return crc == (high_first ? first << 8U | second : second << 8U | first);
}

}  // namespace

Bytes modbus_sealed(const Bytes& body) {
  const std::uint16_t crc = hal::crc16_modbus(body.data(), body.size());
  ByteWriter frame(ByteOrder::kLittle);
  return frame.append(body).u16(crc).bytes();
}

Bytes keller_sealed(const Bytes& body) {
  const std::uint16_t crc = hal::crc16_modbus(body.data(), body.size());
  ByteWriter frame(ByteOrder::kBig);
  return frame.append(body).u16(crc).bytes();
}

KellerSensor::KellerSensor(const KellerSensorConfig& config, Measure measure)
    : config_(config), measure_(std::move(measure)), line_(config.byte_time_ns) {}

Bytes KellerSensor::answer_modbus(base::TimeUs now_us, std::size_t from) const {
  const Bytes request(heard_.begin() + static_cast<std::ptrdiff_t>(from), heard_.end());
  const unsigned first = request[2] * 256U + request[3];
  const unsigned count = request[4] * 256U + request[5];
  const KellerTruth truth = measure_(now_us);
  ByteWriter body(ByteOrder::kBig);
  body.u8(config_.address);
  ByteWriter values(ByteOrder::kBig);
  if (first == 0x0100) {
    values.f32(truth.pressure_bar).f32(truth.temperature_degc);
  } else if (first == 0x0002) {
    values.f32(truth.pressure_bar);
  } else if (first == 0x0006) {
    values.f32(truth.temperature_degc);
  }
  if (count == 0 || count * 2 > values.bytes().size()) {
    body.u8(0x83).u8(2);  // illegal data address
    return modbus_sealed(body.bytes());
  }
  body.u8(3).u8(count * 2);
  const auto begin = values.bytes().begin();
  body.append(Bytes(begin, begin + static_cast<std::ptrdiff_t>(count * 2)));
  return modbus_sealed(body.bytes());
}

Bytes KellerSensor::answer_keller(base::TimeUs now_us, std::size_t from, std::size_t size) {
  const std::uint8_t function = heard_[from + 1];
  ByteWriter body(ByteOrder::kBig);
  body.u8(config_.address);
  if (function == 48 && size == 4) {
    started_ = true;
    body.u8(48).u8(5).u8(20).u8(13).u8(33).u8(10).u8(1);
    return keller_sealed(body.bytes());
  }
  if (!started_) {
    body.u8(function | 0x80U).u8(32);
    return keller_sealed(body.bytes());
  }
  const unsigned channel = heard_[from + 2];
  const KellerTruth truth = measure_(now_us);
  if (channel != 1 && channel != 4) {
    body.u8(function | 0x80U).u8(2);
    return keller_sealed(body.bytes());
  }
  body.u8(73).f32(channel == 1 ? truth.pressure_bar : truth.temperature_degc).u8(0);
  return keller_sealed(body.bytes());
}

/// To the request that the bytes heard end with; empty when they do not.
Bytes KellerSensor::answer(base::TimeUs now_us) {
  for (const std::size_t size : {std::size_t{8}, std::size_t{5}, std::size_t{4}}) {
    if (heard_.size() < size) {
      continue;
    }
    const std::size_t from = heard_.size() - size;
    if (heard_[from] != config_.address) {
      continue;
    }
    const std::uint8_t function = heard_[from + 1];
    if (size == 8 && function == 3 && ends_sealed(heard_, from, false)) {
      return answer_modbus(now_us, from);
    }
    const bool keller = (size == 5 && function == 73) || (size == 4 && function == 48);
    if (keller && ends_sealed(heard_, from, true)) {
      return answer_keller(now_us, from, size);
    }
  }
  return {};
}

void KellerSensor::take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) {
  for (std::size_t i = 0; i < size_bytes; ++i) {
    heard_.push_back(data[i]);
    if (heard_.size() > kLongestHeard) {
      heard_.erase(heard_.begin());
    }
    const Bytes reply = answer(now_us);
    if (reply.empty() || silent_) {
      continue;
    }
    if (config_.echo) {
      line_.send(now_us, heard_);
    }
    line_.send(now_us + config_.answer_us, reply);
    heard_.clear();
  }
}

void KellerSensor::advance(base::TimeUs now_us, Bytes& out) { line_.take_until(now_us, out); }

}  // namespace leadline::emu
