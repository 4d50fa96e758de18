#include "hal/heads/ping_protocol.hpp"

#include <cstring>

#include "hal/wire.hpp"

namespace leadline::hal {

namespace {

constexpr std::uint16_t kMaxText_bytes = 256;

// common.json
constexpr std::array<PingMessage, 7> kCommon{{
    {kPingAck, 2, 2, 0},
    {kPingNack, 2, 2 + kMaxText_bytes, 0},
    {kPingAsciiText, 0, kMaxText_bytes, 0},
    {kPingDeviceInformation, 6, 6, 0},
    {kPingProtocolVersion, 4, 4, 0},
    {kPingGeneralRequest, 2, 2, 0},
    {100, 1, 1, 0},  // set_device_id
}};

// ping1d.json
constexpr std::array<PingMessage, 27> kPing1d{{
    {1000, 1, 1, 0},                       // set_device_id
    {1001, 8, 8, 0},                       // set_range
    {1002, 4, 4, 0},                       // set_speed_of_sound
    {1003, 1, 1, 0},                       // set_mode_auto
    {1004, 2, 2, 0},                       // set_ping_interval
    {1005, 1, 1, 0},                       // set_gain_setting
    {1006, 1, 1, 0},                       // set_ping_enable
    {1007, 4, 4, 0},                       // set_oss_profile_configuration
    {1200, 6, 6, 0},                       // firmware_version
    {1201, 1, 1, 0},                       // device_id
    {1202, 2, 2, 0},                       // voltage_5
    {1203, 4, 4, 0},                       // speed_of_sound
    {1204, 8, 8, 0},                       // range
    {1205, 1, 1, 0},                       // mode_auto
    {1206, 2, 2, 0},                       // ping_interval
    {1207, 4, 4, 0},                       // gain_setting
    {1208, 2, 2, 0},                       // transmit_duration
    {1210, 10, 10, 0},                     // general_info
    {1211, 5, 5, 0},                       // distance_simple
    {1212, 24, 24, 0},                     // distance
    {1213, 2, 2, 0},                       // processor_temperature
    {1214, 2, 2, 0},                       // pcb_temperature
    {1215, 1, 1, 0},                       // ping_enable
    {1300, 26, 26 + kMaxPingSamples, 24},  // profile
    {1400, 2, 2, 0},                       // continuous_start
    {1401, 2, 2, 0},                       // continuous_stop
    {1100, 0, 0, 0},                       // goto_bootloader
}};

// ping360.json
constexpr std::array<PingMessage, 7> kPing360{{
    {2000, 2, 2, 0},                       // set_device_id
    {2300, 14, 14 + kMaxPingSamples, 12},  // device_data
    {2301, 20, 20 + kMaxPingSamples, 18},  // auto_device_data
    {2600, 2, 2, 0},                       // reset
    {2601, 14, 14, 0},                     // transducer
    {2602, 16, 16, 0},                     // auto_transmit
    {2903, 0, 0, 0},                       // motor_off
}};

template <std::size_t kCount>
constexpr std::array<PingMessage, kCommon.size() + kCount> with_common(
    const std::array<PingMessage, kCount>& own) {
  std::array<PingMessage, kCommon.size() + kCount> all{};
  for (std::size_t i = 0; i < kCommon.size(); ++i) {
    all[i] = kCommon[i];
  }
  for (std::size_t i = 0; i < kCount; ++i) {
    all[kCommon.size() + i] = own[i];
  }
  return all;
}

template <std::size_t kCount>
constexpr bool all_fit(const std::array<PingMessage, kCount>& messages) {
  for (std::size_t i = 0; i < kCount; ++i) {
    if (messages[i].max_bytes > kMaxPingPayload_bytes) {
      return false;
    }
  }
  return true;
}
static_assert(all_fit(kPing1d) && all_fit(kPing360) && all_fit(kCommon),
              "a frame that outgrows the buffer would never be complete");

constexpr auto kPing1dTable = with_common(kPing1d);
constexpr auto kPing360Table = with_common(kPing360);

}  // namespace

PingTable ping1d_table() { return {kPing1dTable.data(), kPing1dTable.size()}; }
PingTable ping360_table() { return {kPing360Table.data(), kPing360Table.size()}; }

std::uint16_t ping_checksum(const std::uint8_t* bytes, std::size_t size_bytes) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < size_bytes; ++i) {
    sum += bytes[i];
  }
  return static_cast<std::uint16_t>(sum);
}

std::size_t write_ping_frame(std::uint16_t id, std::uint8_t source, std::uint8_t destination,
                             const std::uint8_t* payload, std::size_t payload_bytes,
                             std::uint8_t* out, std::size_t capacity_bytes) {
  if (payload_bytes > kMaxPingPayload_bytes ||
      payload_bytes + kPingOverhead_bytes > capacity_bytes) {
    return 0;
  }
  out[0] = 'B';
  out[1] = 'R';
  write_u16_le(out + 2, static_cast<std::uint16_t>(payload_bytes));
  write_u16_le(out + 4, id);
  out[6] = source;
  out[7] = destination;
  if (payload_bytes > 0) {
    std::memcpy(out + kPingHeader_bytes, payload, payload_bytes);
  }
  const std::size_t checked_bytes = kPingHeader_bytes + payload_bytes;
  write_u16_le(out + checked_bytes, ping_checksum(out, checked_bytes));
  return checked_bytes + 2;
}

bool PingParser::next(PingFrame& frame) {
  FrameBytes found{};
  const auto rules = [this](const std::uint8_t* bytes, std::size_t available) {
    return judge(bytes, available);
  };
  if (!framer_.next(rules, counters_, found)) {
    return false;
  }
  frame.id = read_u16_le(found.data + 4);
  frame.source = found.data[6];
  frame.destination = found.data[7];
  frame.payload = found.data + kPingHeader_bytes;
  frame.payload_bytes = read_u16_le(found.data + 2);
  frame.t_arrival_us = found.t_arrival_us;
  return true;
}

Judgement PingParser::judge(const std::uint8_t* bytes, std::size_t available) const {
  if (bytes[0] != 'B' || (available > 1 && bytes[1] != 'R')) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (available < kPingHeader_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  const PingMessage* message = find(read_u16_le(bytes + 4));
  if (message == nullptr) {
    return {FrameVerdict::kUnknownId, 0};
  }
  const std::size_t payload_bytes = read_u16_le(bytes + 2);
  if (payload_bytes < message->min_bytes || payload_bytes > message->max_bytes) {
    return {FrameVerdict::kBadLength, 0};
  }
  const std::size_t checked_bytes = kPingHeader_bytes + payload_bytes;
  if (available < checked_bytes + 2) {
    return {FrameVerdict::kMore, 0};
  }
  if (ping_checksum(bytes, checked_bytes) != read_u16_le(bytes + checked_bytes)) {
    return {FrameVerdict::kBadChecksum, 0};
  }
  const std::size_t counted_bytes =
      message->count_offset == 0
          ? payload_bytes
          : message->count_offset + 2U +
                read_u16_le(bytes + kPingHeader_bytes + message->count_offset);
  if (counted_bytes != payload_bytes) {
    return {FrameVerdict::kBadLength, 0};
  }
  return {FrameVerdict::kFrame, checked_bytes + 2};
}

const PingMessage* PingParser::find(std::uint16_t id) const {
  for (std::size_t i = 0; i < table_.message_count; ++i) {
    if (table_.messages[i].id == id) {
      return &table_.messages[i];
    }
  }
  return nullptr;
}

}  // namespace leadline::hal
