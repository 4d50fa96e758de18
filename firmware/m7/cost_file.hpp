// What the measuring image reads: a configuration, its table, and pings with the state of the map that each
// is to find. Written by the host as plain records; both machines are little-endian and align 64 bits
// alike, and the sizes in the header say so.
#pragma once

#include <cstdint>

#include "model/base/ping.hpp"
#include "model/base/pose.hpp"
#include "model/config.hpp"
#include "model/localization_table.hpp"

namespace leadline::firmware::m7 {

inline constexpr std::uint32_t kCostMagic = 0x314D544CU;  // "LTM1"

/// Prepared columns of a ping at most.
inline constexpr std::uint32_t kMostPreparedColumns = 256;

struct CostHeader {
  std::uint32_t magic;
  std::uint32_t sizes[5];  ///< of the records below, in their order
  std::uint32_t pings;
  std::uint32_t reserved;
};

/// A column whose voxels are replaced before the ping: `hits` at `first` and below it, nothing else.
struct PreparedColumn {
  std::uint16_t north;
  std::uint16_t east;
  std::int16_t first;
  std::uint16_t hits[2];
  std::uint16_t gain;
};

/// base::Ping without its pointer, which is not of one size.
struct CostPing {
  std::int64_t t_transmit_us;
  std::int64_t range_um;
  base::Pose pose;
  base::Bam32 azimuth_bam32;
  base::Bam32 elevation_bam32;
  base::Bam32 rotation_bam32;
  std::uint32_t kind;              ///< base::ReturnKind
  std::uint32_t prepared_columns;  ///< as many PreparedColumn follow
  std::uint32_t reserved;
};

inline base::Ping ping_of(const CostPing& record) {
  base::Ping ping{};
  ping.t_transmit_us = record.t_transmit_us;
  ping.azimuth_bam32 = record.azimuth_bam32;
  ping.elevation_bam32 = record.elevation_bam32;
  ping.rotation_bam32 = record.rotation_bam32;
  ping.kind = static_cast<base::ReturnKind>(record.kind);
  ping.quality = 255;
  ping.range_um = record.range_um;
  return ping;
}

inline constexpr std::uint32_t kCostSizes[5] = {sizeof(CostHeader), sizeof(model::ModelConfig),
                                                sizeof(model::LocalizationTable), sizeof(CostPing),
                                                sizeof(PreparedColumn)};

}  // namespace leadline::firmware::m7
