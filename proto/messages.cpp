#include "proto/messages.hpp"

#include <cstring>

#include "model/base/crc32c.hpp"
#include "model/base/fixed.hpp"
#include "proto/tile_coder.hpp"
#include "proto/wire.hpp"

namespace leadline::proto {
namespace {

constexpr std::int64_t kMaxOrigin_mm = std::int64_t{1} << 40U;
constexpr std::int64_t kMaxLatitude_e9deg = 90'000'000'000;
constexpr std::int64_t kMaxLongitude_e9deg = 180'000'000'000;
constexpr std::int32_t kMaxCell_mm = 1'000'000;
constexpr std::int32_t kMaxSide_cells = 16'000;
constexpr std::int32_t kMaxDown_cells = 2048;
constexpr std::int32_t kMaxEpsg = 999'999;

template <typename T>
constexpr bool within(T value, T low, T high) {
  return low <= value && value <= high;
}

/// The type byte, then the fields: false when the payload is of another type.
bool opens_as(ByteReader& fields, MessageType type) {
  return fields.left_bytes() > 0 && fields.u8() == static_cast<std::uint8_t>(type);
}

// --- UTF-8

constexpr std::uint8_t kContinuation = 0x80;

/// What a character's first byte promises: how many bytes, and the least code point that may take so
/// many. 0 bytes: it begins none.
struct Lead {
  std::size_t size_bytes;
  std::uint32_t bits;
  std::uint32_t least;
};

Lead lead_of(std::uint8_t byte) {
  if (byte < 0x80U) {
    return {1, byte, 0};
  }
  if ((byte & 0xE0U) == 0xC0U) {
    return {2, byte & 0x1FU, 0x80};
  }
  if ((byte & 0xF0U) == 0xE0U) {
    return {3, byte & 0x0FU, 0x800};
  }
  if ((byte & 0xF8U) == 0xF0U) {
    return {4, byte & 0x07U, 0x10000};
  }
  return {0, 0, 0};
}

/// Length of the character at `text`, 0 when there is none or it is a control character.
std::size_t character_bytes(const char* text, std::size_t size_bytes) {
  const auto byte_at = [text](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const Lead lead = lead_of(byte_at(0));
  if (lead.size_bytes == 0 || lead.size_bytes > size_bytes) {
    return 0;
  }
  std::uint32_t code_point = lead.bits;
  for (std::size_t i = 1; i < lead.size_bytes; ++i) {
    if ((byte_at(i) & 0xC0U) != kContinuation) {
      return 0;
    }
    code_point = (code_point << 6U) | (byte_at(i) & 0x3FU);
  }
  const bool control = code_point < 0x20U || within(code_point, 0x7FU, 0x9FU);
  const bool surrogate = within(code_point, 0xD800U, 0xDFFFU);
  const bool beyond = code_point > 0x10FFFFU || code_point < lead.least;
  return control || surrogate || beyond ? 0 : lead.size_bytes;
}

/// Bytes of `text` up to the first that is not clean UTF-8.
std::size_t clean_bytes(const char* text, std::size_t size_bytes) {
  std::size_t at = 0;
  while (at < size_bytes) {
    const std::size_t character = character_bytes(text + at, size_bytes - at);
    if (character == 0) {
      break;
    }
    at += character;
  }
  return at;
}

/// Bytes of a text that ends with a zero or after `most_bytes`, up to the first that is not clean UTF-8: a
/// character that `most_bytes` would split is left out. Null has none.
std::size_t fitting_bytes(const char* text, std::size_t most_bytes) {
  if (text == nullptr) {
    return 0;
  }
  std::size_t size = 0;
  while (size < most_bytes && text[size] != '\0') {
    ++size;
  }
  return clean_bytes(text, size);
}

bool text_in_range(const Text& text) {
  return static_cast<std::uint8_t>(text.severity) <= static_cast<std::uint8_t>(Severity::kError) &&
         text.size_bytes <= kMaxText_bytes &&
         clean_bytes(text.text, text.size_bytes) == text.size_bytes;
}

// --- Hello

/// The minor that added names and the link's rate to the hello.
constexpr std::uint8_t kNamesMinor = 1;

bool hello_text_in_range(const HelloText& text) {
  return text.size_bytes <= kMaxHelloText_bytes &&
         clean_bytes(text.text, text.size_bytes) == text.size_bytes;
}

base::Status take_hello_text(ByteReader& fields, HelloText& text) {
  text.size_bytes = fields.u8();
  if (!fields.truncated() && text.size_bytes > kMaxHelloText_bytes) {
    return base::Status::kOutOfRange;
  }
  const std::uint8_t* const bytes = fields.bytes(text.size_bytes);
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  std::memcpy(text.text, bytes, text.size_bytes);
  return hello_text_in_range(text) ? base::Status::kOk : base::Status::kOutOfRange;
}

bool hello_in_range(const Hello& hello) {
  bool good = hello.tile_side_cells == kTileSide_cells && hello.table_count <= kMaxHelloTables &&
              within(hello.cell_mm, 1, kMaxCell_mm) && within(hello.epsg, 0, kMaxEpsg) &&
              hello.has_geodetic_origin <= 1 &&
              within(hello.latitude_e9deg, -kMaxLatitude_e9deg, kMaxLatitude_e9deg) &&
              within(hello.longitude_e9deg, -kMaxLongitude_e9deg, kMaxLongitude_e9deg) &&
              hello_text_in_range(hello.survey_name) && hello_text_in_range(hello.vertical_datum);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int32_t most = axis == base::kDown ? kMaxDown_cells : kMaxSide_cells;
    good = good && within(hello.size_cells[axis], 1, most) &&
           within(hello.origin_mm[axis], -kMaxOrigin_mm, kMaxOrigin_mm);
  }
  return good;
}

// --- Status

constexpr std::int32_t kMaxPosition_cm = INT32_MAX / 10;  // and -INT32_MIN / 10 alike

constexpr int kDown_bam8 = 64;

bool swath_in_range(const Swath& swath) {
  bool good = swath.beam_count <= kMaxSwathBeams;
  for (std::size_t i = 0; good && i < swath.beam_count; ++i) {
    good = within<int>(swath.beams[i].depression_bam8, -kDown_bam8, kDown_bam8);
  }
  return good;
}

/// Nothing where there is none: what stands still costs nothing.
void put_swath(ByteWriter& fields, const Swath& swath) {
  if (swath.beam_count == 0) {
    return;
  }
  fields.u8(swath.beam_count);
  for (std::size_t i = 0; i < swath.beam_count; ++i) {
    fields.u8(swath.beams[i].azimuth_bam8);
    fields.u8(static_cast<std::uint8_t>(swath.beams[i].depression_bam8));
    fields.varint(swath.beams[i].range_dm);
  }
}

/// A message without a swath, and one of minor 0, ends where it would begin.
base::Status take_swath(ByteReader& fields, Swath& swath) {
  if (fields.status() != base::Status::kOk || fields.left_bytes() == 0) {
    return fields.status();
  }
  swath.beam_count = fields.u8();
  if (swath.beam_count > kMaxSwathBeams) {
    return base::Status::kOutOfRange;
  }
  for (std::size_t i = 0; i < swath.beam_count; ++i) {
    swath.beams[i].azimuth_bam8 = fields.u8();
    swath.beams[i].depression_bam8 = static_cast<std::int8_t>(fields.u8());
    const std::uint32_t range_dm = fields.varint();
    if (range_dm > UINT16_MAX) {
      return base::Status::kOutOfRange;
    }
    swath.beams[i].range_dm = static_cast<std::uint16_t>(range_dm);
  }
  return fields.status();
}

bool brief_in_range(const Brief& brief) {
  bool good = brief.pose_validity <= 7 && swath_in_range(brief.swath);
  for (const std::int32_t position : brief.position_cm) {
    good = good && within(position, -kMaxPosition_cm, kMaxPosition_cm);
  }
  return good;
}

bool status_in_range(const Status& status) {
  bool good = status.port_count <= kMaxStatusPorts && status.pose_validity <= 7 &&
              swath_in_range(status.swath);
  for (std::size_t i = 0; good && i < status.port_count; ++i) {
    good = status.ports[i].state <= 1;
  }
  return good;
}

/// The fields that travel as varints, in their order, for both directions: `each(field)`.
template <typename StatusT, typename Each>
void each_status_number(StatusT& status, Each each) {
  each(status.work_last_voxels);
  each(status.work_max_voxels);
  each(status.work_bound_voxels);
  each(status.cycle_last_us);
  each(status.cycle_max_us);
  for (auto& count : status.pings) {
    each(count);
  }
  each(status.pings_pending);
  each(status.nav_fused);
  each(status.nav_rejected);
  each(status.tiles_known);
  each(status.tiles_dirty);
  each(status.cells_sent);
  each(status.link_bytes);
  each(status.queued_bytes);
  each(status.uplink_frames);
  each(status.uplink_bad);
  each(status.recorder_lost);
}

template <typename PortT, typename Each>
void each_port_number(PortT& port, Each each) {
  each(port.bytes_in);
  each(port.records);
  each(port.bad_frames);
  each(port.dropped_bytes);
}

}  // namespace

bool message_type(const std::uint8_t* payload, std::size_t size_bytes, MessageType& type) {
  if (size_bytes == 0) {
    return false;
  }
  switch (static_cast<MessageType>(payload[0])) {
    case MessageType::kHello:
    case MessageType::kTileDelta:
    case MessageType::kStatus:
    case MessageType::kText:
    case MessageType::kBrief:
    case MessageType::kDigest:
    case MessageType::kCommandAnswer:
    case MessageType::kSlice:
    case MessageType::kCoarseDelta:
    case MessageType::kQuestion:
    case MessageType::kResendRequest:
    case MessageType::kHelloRequest:
    case MessageType::kReport:
    case MessageType::kDigestRequest:
    case MessageType::kLook:
    case MessageType::kCommand:
    case MessageType::kLogHeader:
    case MessageType::kLogConfig:
    case MessageType::kLogTable:
    case MessageType::kLogChunk:
    case MessageType::kLogCycle:
    case MessageType::kLogGap:
    case MessageType::kLogEnd:
      type = static_cast<MessageType>(payload[0]);
      return true;
  }
  return false;
}

// --- Hello

std::uint16_t survey_tag(std::uint64_t survey_id, std::uint32_t session) {
  std::uint8_t bytes[12];
  ByteWriter fields(bytes, sizeof bytes);
  fields.u64(survey_id);
  fields.u32(session);
  return static_cast<std::uint16_t>(base::crc32c(bytes, sizeof bytes) & 0xFFFFU);
}

void name_survey(Hello& hello, const char* survey_name, const char* vertical_datum,
                 std::size_t payload_bytes) {
  const std::size_t rest_bytes = kLeastHello_bytes + std::size_t{4} * hello.table_count;
  std::size_t room = payload_bytes - base::min_of(payload_bytes, rest_bytes);
  const auto set = [&room](HelloText& to, const char* from) {
    const std::size_t size = fitting_bytes(from, base::min_of(room, kMaxHelloText_bytes));
    to = HelloText{};
    to.size_bytes = static_cast<std::uint8_t>(size);
    if (size > 0) {
      std::memcpy(to.text, from, size);
    }
    room -= size;
  };
  set(hello.vertical_datum, vertical_datum);
  set(hello.survey_name, survey_name);
}

base::Result<std::size_t> encode_hello(const Hello& hello, std::uint8_t* out,
                                       std::size_t capacity_bytes) {
  if (hello.protocol_major != kProtocolMajor || !hello_in_range(hello)) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kHello));
  fields.u8(hello.protocol_major);
  fields.u8(hello.protocol_minor);
  fields.u8(hello.tile_side_cells);
  fields.u32(hello.schema_hash);
  fields.u64(hello.survey_id);
  fields.u32(hello.session);
  fields.u32(hello.config_crc);
  fields.i32(hello.cell_mm);
  for (const std::int32_t size : hello.size_cells) {
    fields.i32(size);
  }
  for (const std::int64_t origin : hello.origin_mm) {
    fields.i64(origin);
  }
  fields.u8(hello.has_geodetic_origin);
  fields.i64(hello.latitude_e9deg);
  fields.i64(hello.longitude_e9deg);
  fields.i32(hello.epsg);
  fields.u8(hello.table_count);
  for (std::size_t i = 0; i < hello.table_count; ++i) {
    fields.u32(hello.table_crc[i]);
  }
  if (hello.protocol_minor >= kNamesMinor) {
    for (const HelloText* const text : {&hello.survey_name, &hello.vertical_datum}) {
      fields.u8(text->size_bytes);
      fields.bytes(text->text, text->size_bytes);
    }
    fields.u32(hello.link_rate_bytes_s);
  }
  return fields.result();
}

base::Result<Hello> decode_hello(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kHello)) {
    return base::Status::kInvalidArgument;
  }
  Hello hello{};
  hello.protocol_major = fields.u8();
  hello.protocol_minor = fields.u8();
  if (!fields.truncated() && hello.protocol_major != kProtocolMajor) {
    return base::Status::kBadVersion;
  }
  hello.tile_side_cells = fields.u8();
  hello.schema_hash = fields.u32();
  hello.survey_id = fields.u64();
  hello.session = fields.u32();
  hello.config_crc = fields.u32();
  hello.cell_mm = fields.i32();
  for (std::int32_t& size : hello.size_cells) {
    size = fields.i32();
  }
  for (std::int64_t& origin : hello.origin_mm) {
    origin = fields.i64();
  }
  hello.has_geodetic_origin = fields.u8();
  hello.latitude_e9deg = fields.i64();
  hello.longitude_e9deg = fields.i64();
  hello.epsg = fields.i32();
  hello.table_count = fields.u8();
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  if (!hello_in_range(hello)) {
    return base::Status::kOutOfRange;
  }
  for (std::size_t i = 0; i < hello.table_count; ++i) {
    hello.table_crc[i] = fields.u32();
  }
  if (hello.protocol_minor >= kNamesMinor) {
    for (HelloText* const text : {&hello.survey_name, &hello.vertical_datum}) {
      const base::Status status = take_hello_text(fields, *text);
      if (status != base::Status::kOk) {
        return status;
      }
    }
    hello.link_rate_bytes_s = fields.u32();
  }
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  return hello;
}

// --- Status

base::Result<std::size_t> encode_status(const Status& status, std::uint8_t* out,
                                        std::size_t capacity_bytes) {
  if (!status_in_range(status)) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kStatus));
  fields.i64(status.t_us);
  fields.u32(status.cycle);
  fields.u32(status.alarms);
  fields.i64(status.pose_t_us);
  fields.u8(status.pose_validity);
  fields.u16(status.pose_epoch);
  for (const std::int32_t position : status.position_mm) {
    fields.i32(position);
  }
  fields.u16(status.roll_bam16);
  fields.u16(status.pitch_bam16);
  fields.u16(status.heading_bam16);
  for (const std::uint16_t sigma : status.sigma_position_cm) {
    fields.u16(sigma);
  }
  for (const std::uint16_t sigma : status.sigma_attitude_urad16) {
    fields.u16(sigma);
  }
  const auto put = [&fields](std::uint32_t number) { fields.varint(number); };
  each_status_number(status, put);
  fields.u8(status.port_count);
  for (std::size_t i = 0; i < status.port_count; ++i) {
    fields.u8(status.ports[i].state);
    each_port_number(status.ports[i], put);
  }
  put_swath(fields, status.swath);
  return fields.result();
}

base::Result<Status> decode_status(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kStatus)) {
    return base::Status::kInvalidArgument;
  }
  Status status{};
  status.t_us = fields.i64();
  status.cycle = fields.u32();
  status.alarms = fields.u32();
  status.pose_t_us = fields.i64();
  status.pose_validity = fields.u8();
  status.pose_epoch = fields.u16();
  for (std::int32_t& position : status.position_mm) {
    position = fields.i32();
  }
  status.roll_bam16 = fields.u16();
  status.pitch_bam16 = fields.u16();
  status.heading_bam16 = fields.u16();
  for (std::uint16_t& sigma : status.sigma_position_cm) {
    sigma = fields.u16();
  }
  for (std::uint16_t& sigma : status.sigma_attitude_urad16) {
    sigma = fields.u16();
  }
  const auto take = [&fields](std::uint32_t& number) { number = fields.varint(); };
  each_status_number(status, take);
  status.port_count = fields.u8();
  for (std::size_t i = 0; i < status.port_count && i < kMaxStatusPorts; ++i) {
    status.ports[i].state = fields.u8();
    each_port_number(status.ports[i], take);
  }
  if (status.port_count > kMaxStatusPorts) {
    return base::Status::kOutOfRange;
  }
  const base::Status taken = take_swath(fields, status.swath);
  if (taken != base::Status::kOk) {
    return taken;
  }
  if (!status_in_range(status)) {
    return base::Status::kOutOfRange;
  }
  return status;
}

// --- Brief

Brief brief_of(const Status& status) {
  Brief brief{};
  brief.t_ms = static_cast<std::uint32_t>((status.t_us / 1000) & 0xFFFFFFFF);
  brief.alarms = status.alarms;
  brief.pose_validity = status.pose_validity;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    brief.position_cm[axis] = status.position_mm[axis] / 10;
  }
  brief.heading_bam16 = status.heading_bam16;
  brief.sigma_horizontal_cm =
      base::max_of(status.sigma_position_cm[base::kNorth], status.sigma_position_cm[base::kEast]);
  brief.pings_fused = status.pings[kPingFused];
  brief.tiles_known = status.tiles_known;
  brief.tiles_dirty = status.tiles_dirty;
  brief.cells_sent = status.cells_sent;
  brief.swath = status.swath;
  return brief;
}

void apply_brief(const Brief& brief, Status& status) {
  const std::uint32_t ahead_ms = brief.t_ms - brief_of(status).t_ms;
  status.t_us += base::TimeUs{static_cast<std::int32_t>(ahead_ms)} * 1000;
  status.alarms = brief.alarms;
  status.pose_validity = brief.pose_validity;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    status.position_mm[axis] = brief.position_cm[axis] * 10;
  }
  status.heading_bam16 = brief.heading_bam16;
  status.sigma_position_cm[base::kNorth] = brief.sigma_horizontal_cm;
  status.sigma_position_cm[base::kEast] = brief.sigma_horizontal_cm;
  status.pings[kPingFused] = brief.pings_fused;
  status.tiles_known = brief.tiles_known;
  status.tiles_dirty = brief.tiles_dirty;
  status.cells_sent = brief.cells_sent;
  status.swath = brief.swath;
}

base::Result<std::size_t> encode_brief(const Brief& brief, std::uint8_t* out,
                                       std::size_t capacity_bytes) {
  if (!brief_in_range(brief)) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kBrief));
  fields.u32(brief.t_ms);
  fields.varint(brief.alarms);
  fields.u8(brief.pose_validity);
  for (const std::int32_t position : brief.position_cm) {
    fields.zigzag(position);
  }
  fields.u16(brief.heading_bam16);
  fields.u16(brief.sigma_horizontal_cm);
  fields.varint(brief.pings_fused);
  fields.varint(brief.tiles_known);
  fields.varint(brief.tiles_dirty);
  fields.varint(brief.cells_sent);
  put_swath(fields, brief.swath);
  return fields.result();
}

base::Result<Brief> decode_brief(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kBrief)) {
    return base::Status::kInvalidArgument;
  }
  Brief brief{};
  brief.t_ms = fields.u32();
  brief.alarms = fields.varint();
  brief.pose_validity = fields.u8();
  for (std::int32_t& position : brief.position_cm) {
    position = fields.zigzag();
  }
  brief.heading_bam16 = fields.u16();
  brief.sigma_horizontal_cm = fields.u16();
  brief.pings_fused = fields.varint();
  brief.tiles_known = fields.varint();
  brief.tiles_dirty = fields.varint();
  brief.cells_sent = fields.varint();
  const base::Status taken = take_swath(fields, brief.swath);
  if (taken != base::Status::kOk) {
    return taken;
  }
  if (!brief_in_range(brief)) {
    return base::Status::kOutOfRange;
  }
  return brief;
}

// --- Text

Text make_text(base::TimeUs t_us, Severity severity, const char* text) {
  Text message{};
  message.t_us = t_us;
  message.severity = severity;
  const std::size_t size = fitting_bytes(text, kMaxText_bytes);
  message.size_bytes = static_cast<std::uint8_t>(size);
  if (size > 0) {
    std::memcpy(message.text, text, size);
  }
  return message;
}

bool clean_text(const char* text, std::size_t size_bytes) {
  return clean_bytes(text, size_bytes) == size_bytes;
}

base::Result<std::size_t> encode_text(const Text& text, std::uint8_t* out,
                                      std::size_t capacity_bytes) {
  if (!text_in_range(text)) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kText));
  fields.i64(text.t_us);
  fields.u8(static_cast<std::uint8_t>(text.severity));
  fields.u8(text.size_bytes);
  fields.bytes(text.text, text.size_bytes);
  return fields.result();
}

base::Result<Text> decode_text(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kText)) {
    return base::Status::kInvalidArgument;
  }
  Text text{};
  text.t_us = fields.i64();
  text.severity = static_cast<Severity>(fields.u8());
  text.size_bytes = fields.u8();
  if (!fields.truncated() && text.size_bytes > kMaxText_bytes) {
    return base::Status::kOutOfRange;
  }
  const std::uint8_t* const bytes = fields.bytes(text.size_bytes);
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  std::memcpy(text.text, bytes, text.size_bytes);
  if (!text_in_range(text)) {
    return base::Status::kOutOfRange;
  }
  return text;
}

// --- Resend request

base::Result<std::size_t> encode_resend_request(const ResendRequest& request, std::uint8_t* out,
                                                std::size_t capacity_bytes) {
  if (request.range_count > kMaxResendRanges) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kResendRequest));
  fields.u16(request.survey_tag);
  fields.u8(request.range_count);
  std::uint32_t end = 0;  // of the range before, and one: ranges do not touch
  for (std::size_t i = 0; i < request.range_count; ++i) {
    const TileRange& range = request.ranges[i];
    if (range.first < end || range.first >= kMaxTiles || range.count < 1 ||
        range.count > kMaxTiles - range.first) {
      return base::Status::kOutOfRange;
    }
    fields.varint(range.first - end);
    fields.varint(range.count - 1);
    end = range.first + range.count + 1;
  }
  return fields.result();
}

base::Result<ResendRequest> decode_resend_request(const std::uint8_t* payload,
                                                  std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kResendRequest)) {
    return base::Status::kInvalidArgument;
  }
  ResendRequest request{};
  request.survey_tag = fields.u16();
  request.range_count = fields.u8();
  if (!fields.truncated() && request.range_count > kMaxResendRanges) {
    return base::Status::kOutOfRange;
  }
  std::uint64_t end = 0;
  for (std::size_t i = 0; i < request.range_count; ++i) {
    const std::uint64_t first = end + fields.varint();
    const std::uint64_t count = std::uint64_t{1} + fields.varint();
    if (fields.status() != base::Status::kOk) {
      return fields.status();
    }
    if (first + count > kMaxTiles) {
      return base::Status::kOutOfRange;
    }
    request.ranges[i] =
        TileRange{static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(count)};
    end = first + count + 1;
  }
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  return request;
}

// --- Hello request

base::Result<std::size_t> encode_hello_request(std::uint8_t* out, std::size_t capacity_bytes) {
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kHelloRequest));
  fields.u8(kProtocolMajor);
  fields.u8(kProtocolMinor);
  return fields.result();
}

base::Result<HelloRequest> decode_hello_request(const std::uint8_t* payload,
                                                std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kHelloRequest)) {
    return base::Status::kInvalidArgument;
  }
  HelloRequest request{1, 0};
  if (fields.left_bytes() == 0) {
    return request;
  }
  request.protocol_major = fields.u8();
  if (request.protocol_major != kProtocolMajor) {
    return base::Status::kBadVersion;
  }
  request.protocol_minor = fields.u8();
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  return request;
}

// --- Digest

std::uint64_t add_digest_tile(std::uint64_t hash, std::uint32_t tile_hash32) {
  for (unsigned shift = 0; shift < 32; shift += 8) {
    hash = (hash ^ ((tile_hash32 >> shift) & 0xFFU)) * kFnvPrime;
  }
  return hash;
}

base::Result<std::size_t> encode_digest(const Digest& digest, std::uint8_t* out,
                                        std::size_t capacity_bytes) {
  if (digest.first >= kMaxTiles || digest.tiles_log2 > kMaxDigestLog2 ||
      !within<std::uint8_t>(digest.hash_count, 1, kMaxDigestHashes)) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kDigest));
  fields.u16(digest.survey_tag);
  fields.varint(digest.first);
  fields.u8(digest.tiles_log2);
  fields.u8(digest.hash_count);
  for (std::size_t i = 0; i < digest.hash_count; ++i) {
    fields.u32(digest.hashes[i]);
  }
  return fields.result();
}

base::Result<Digest> decode_digest(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kDigest)) {
    return base::Status::kInvalidArgument;
  }
  Digest digest{};
  digest.survey_tag = fields.u16();
  digest.first = fields.varint();
  digest.tiles_log2 = fields.u8();
  digest.hash_count = fields.u8();
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  if (digest.first >= kMaxTiles || digest.tiles_log2 > kMaxDigestLog2 ||
      !within<std::uint8_t>(digest.hash_count, 1, kMaxDigestHashes)) {
    return base::Status::kOutOfRange;
  }
  for (std::size_t i = 0; i < digest.hash_count; ++i) {
    digest.hashes[i] = fields.u32();
  }
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  return digest;
}

// --- Report

namespace {
// Beside the number of bytes in the mask.
constexpr unsigned kReportAsked = 0x80;
}  // namespace

base::Result<std::size_t> encode_report(const Report& report, std::uint8_t* out,
                                        std::size_t capacity_bytes) {
  if (report.mask_bytes > kMaxReportMask_bytes) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kReport));
  fields.u16(report.survey_tag);
  fields.u8(static_cast<std::uint8_t>(report.mask_bytes | (report.asked ? kReportAsked : 0U)));
  fields.u16(report.newest);
  fields.bytes(report.mask, report.mask_bytes);
  return fields.result();
}

base::Result<Report> decode_report(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kReport)) {
    return base::Status::kInvalidArgument;
  }
  Report report{};
  report.survey_tag = fields.u16();
  const unsigned reach = fields.u8();
  report.asked = (reach & kReportAsked) != 0;
  report.mask_bytes = static_cast<std::uint8_t>(reach & ~kReportAsked);
  if (!fields.truncated() && report.mask_bytes > kMaxReportMask_bytes) {
    return base::Status::kOutOfRange;
  }
  report.newest = fields.u16();
  for (std::size_t i = 0; i < report.mask_bytes; ++i) {
    report.mask[i] = fields.u8();
  }
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  return report;
}

// --- Question

base::Result<std::size_t> encode_question(const Question& question, std::uint8_t* out,
                                          std::size_t capacity_bytes) {
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kQuestion));
  fields.u16(question.survey_tag);
  fields.u16(question.newest);
  return fields.result();
}

base::Result<Question> decode_question(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kQuestion)) {
    return base::Status::kInvalidArgument;
  }
  Question question{};
  question.survey_tag = fields.u16();
  question.newest = fields.u16();
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  return question;
}

// --- Digest request

base::Result<std::size_t> encode_digest_request(const DigestRequest& request, std::uint8_t* out,
                                                std::size_t capacity_bytes) {
  if (request.range.first >= kMaxTiles || request.range.count < 1 ||
      request.range.count > kMaxTiles - request.range.first) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kDigestRequest));
  fields.u16(request.survey_tag);
  fields.varint(request.range.first);
  fields.varint(request.range.count - 1);
  return fields.result();
}

base::Result<DigestRequest> decode_digest_request(const std::uint8_t* payload,
                                                  std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kDigestRequest)) {
    return base::Status::kInvalidArgument;
  }
  DigestRequest request{};
  request.survey_tag = fields.u16();
  const std::uint64_t first = fields.varint();
  const std::uint64_t count = std::uint64_t{1} + fields.varint();
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  if (first + count > kMaxTiles) {
    return base::Status::kOutOfRange;
  }
  request.range = {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(count)};
  return request;
}

// --- Look

base::Result<std::size_t> encode_look(const Look& look, std::uint8_t* out,
                                      std::size_t capacity_bytes) {
  if (look.tile >= kMaxTiles) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kLook));
  fields.u16(look.survey_tag);
  fields.varint(look.tile);
  fields.u8(look.radius_tiles);
  return fields.result();
}

base::Result<Look> decode_look(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kLook)) {
    return base::Status::kInvalidArgument;
  }
  Look look{};
  look.survey_tag = fields.u16();
  look.tile = fields.varint();
  look.radius_tiles = fields.u8();
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  if (look.tile >= kMaxTiles) {
    return base::Status::kOutOfRange;
  }
  return look;
}

}  // namespace leadline::proto
