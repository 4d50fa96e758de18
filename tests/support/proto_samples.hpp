// One of each message, with the bytes that proto/SPEC.md states for it, for the tests of proto.
#pragma once

#include <array>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "proto/log.hpp"
#include "proto/messages.hpp"
#include "proto/tile_coder.hpp"
#include "tests/support/test.hpp"

namespace leadline::test {

using Bytes = std::vector<std::uint8_t>;
using Tile = std::array<proto::CodedCell, proto::kTileArea_cells>;

/// "0A FF" as bytes.
inline Bytes from_hex(const std::string& text) {
  Bytes bytes;
  for (std::size_t at = 0; at + 1 < text.size(); at += 3) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(at, 2), nullptr, 16)));
  }
  return bytes;
}

/// The fenced block that follows `mark` in proto/SPEC.md, as it stands there.
inline std::string spec_block(const std::string& mark) {
  std::ifstream file(source_directory() + "/proto/SPEC.md", std::ios::binary);
  const std::string spec((std::istreambuf_iterator<char>(file)), {});
  const std::size_t at = spec.find(mark);
  const std::size_t begin = spec.find("```\n", at == std::string::npos ? 0 : at);
  const std::size_t end = spec.find("```", begin + 4);
  if (at == std::string::npos || end == std::string::npos) {
    return "";
  }
  return spec.substr(begin + 4, end - begin - 4);
}
/// The same, read as bytes.
inline Bytes spec_bytes(const std::string& mark) { return from_hex(spec_block(mark)); }

inline proto::Hello sample_hello() {
  proto::Hello hello{};
  hello.protocol_major = 1;
  hello.protocol_minor = 1;
  hello.tile_side_cells = 16;
  hello.table_count = 2;
  hello.schema_hash = proto::schema_hash();
  hello.survey_id = 0x1122334455667788;
  hello.session = 3;
  hello.config_crc = 0xA1B2C3D4;
  hello.cell_mm = 250;
  hello.size_cells[0] = 128;
  hello.size_cells[1] = 96;
  hello.size_cells[2] = 30;
  hello.origin_mm[0] = -1000;
  hello.origin_mm[2] = 11000;
  hello.has_geodetic_origin = 1;
  hello.latitude_e9deg = 54'305'000'000;
  hello.longitude_e9deg = -10'125'000'000;
  hello.epsg = 32632;
  hello.table_crc[0] = 1;
  hello.table_crc[1] = 0xFFFFFFFF;
  proto::name_survey(hello, "Kieler F\xC3\xB6rde", "NHN", proto::kMaxHello_bytes);
  hello.link_rate_bytes_s = 4000;
  return hello;
}

/// Of a vehicle of this version whose map begins at 0; cells of 0.5 m, 64 of them down.
inline proto::Hello grid_hello(std::int32_t north_cells, std::int32_t east_cells) {
  proto::Hello hello{};
  hello.protocol_major = proto::kProtocolMajor;
  hello.protocol_minor = proto::kProtocolMinor;
  hello.tile_side_cells = proto::kTileSide_cells;
  hello.schema_hash = proto::schema_hash();
  hello.survey_id = 7;
  hello.session = 1;
  hello.cell_mm = 500;
  hello.size_cells[0] = north_cells;
  hello.size_cells[1] = east_cells;
  hello.size_cells[2] = 64;
  return hello;
}

inline proto::Status sample_status() {
  proto::Status status{};
  status.t_us = 1'000'000;
  status.cycle = 100;
  status.alarms = proto::kAlarmMappingPaused | proto::kAlarmShed;
  status.pose_t_us = 990'000;
  status.pose_validity = 7;
  status.pose_epoch = 1;
  status.position_mm[0] = 12345;
  status.position_mm[1] = -1;
  status.position_mm[2] = 5000;
  status.roll_bam16 = 182;
  status.pitch_bam16 = 0xFF4A;
  status.heading_bam16 = 0x4000;
  for (std::uint16_t i = 0; i < 3; ++i) {
    status.sigma_position_cm[i] = static_cast<std::uint16_t>(8 + i);
    status.sigma_attitude_urad16[i] = static_cast<std::uint16_t>(100 + i);
  }
  status.work_last_voxels = 1000;
  status.work_max_voxels = 70'000;
  status.work_bound_voxels = 1'000'000;
  status.cycle_last_us = 127;
  status.cycle_max_us = 128;
  for (std::uint32_t i = 0; i < proto::kPingOutcomes; ++i) {
    status.pings[i] = i * i;
  }
  status.pings_pending = 5;
  status.nav_fused = 300;
  status.nav_rejected = 1;
  status.tiles_known = 48;
  status.tiles_dirty = 3;
  status.cells_sent = 20'000;
  status.link_bytes = 12'000;
  status.uplink_frames = 2;
  status.recorder_lost = 0xFFFFFFFF;
  status.port_count = 2;
  status.ports[0] = {1, 123'456, 789, 1, 0};
  status.swath = {2, {{0x40, 40, 123}, {0xC0, 41, 130}}};
  return status;
}

inline proto::Text sample_text() {
  return proto::make_text(5, proto::Severity::kWarning,
                          "Tauchtiefe 12 m \xC3\xBC"
                          "ber Grund");
}

inline proto::ResendRequest sample_resend_request() {
  proto::ResendRequest request{};
  request.survey_tag = 0x1234;
  request.range_count = 3;
  request.ranges[0] = {0, 1};
  request.ranges[1] = {2, 10};
  request.ranges[2] = {1000, 1};
  return request;
}

/// The tile of the SPEC's vectors.
inline Tile sample_tile() {
  Tile cells{};
  for (int i = 0; i < proto::kTileArea_cells; ++i) {
    cells[static_cast<std::size_t>(i)] =
        proto::code_cell(1000 + 10 * (i / 16) + 7 * (i % 16) + 37 * i % 13,
                         static_cast<std::uint32_t>(900 + 53 * i % 300), i % 16 == 3 ? 1 : 0);
  }
  cells[100] = proto::kUnknownCell;
  return cells;
}

inline proto::CellMask all_cells() {
  proto::CellMask mask{};
  for (auto& row : mask.rows) {
    row = 0xFFFF;
  }
  return mask;
}

inline proto::LogHeader sample_log_header() {
  proto::LogHeader header{};
  header.format = 1;
  header.protocol_major = 1;
  header.schema_hash = proto::schema_hash();
  header.survey_id = 0x1122334455667788;
  header.session = 3;
  header.utc_us = 1'700'000'000'000'000;
  header.config = {0x01020304, 3};
  header.table_count = 1;
  header.tables[0] = {0x05060708, 5};
  return header;
}

}  // namespace leadline::test
