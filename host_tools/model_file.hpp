// The saved model, `model.llm`: what `leadline map` leaves for `render` and `query`. It holds the voxels
// (everything that a depth is made of), the table and the configuration that they were made with.
//
// Layout, version 1, all numbers little-endian:
//   offset size
//        0    4  magic "LLM1"
//        4    2  version (1)
//        6    2  zero
//        8    8  bytes in the file
//       16    4  CRC-32C of everything from offset 24 on
//       20    4  zero
//       24    8  map_hash of the voxels
//       32    4  bytes of the configuration (C)
//       36    4  bytes of the localization table (T)
//       40    8  number of voxels (V)
//       48    C  resolved configuration: TOML, as map_config_to_toml() writes it
//     48+C    T  localization table, see model/localization_table.hpp
//   48+C+T   4V  voxels in (north, east, down) order, down fastest: hit, miss, 16 bits each
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/map_config.hpp"
#include "host_tools/query.hpp"
#include "host_tools/render/render.hpp"
#include "model/grid.hpp"
#include "model/localization_table.hpp"

namespace leadline::host {

struct SavedModel {
  MapConfig config;
  model::LocalizationTable table{};
  std::uint64_t map_hash = 0;
  std::vector<model::Voxel> voxels;  ///< (north, east, down) order, down fastest

  [[nodiscard]] const model::Voxel& voxel(std::int64_t north, std::int64_t east,
                                          std::int64_t down) const {
    const auto* const size = config.grid.size;
    return voxels[static_cast<std::size_t>((north * size[1] + east) * size[2] + down)];
  }
};

/// The file's bytes. `voxels` has config.grid.voxel_count() entries in the file's order.
[[nodiscard]] std::string format_model_file(const SavedModel& saved);

/// Reads and checks all of it: lengths, version, checksum, configuration, table, voxel count, hash.
/// `name` stands for the file in messages. Throws HostError kInput with what is wrong and what to do.
[[nodiscard]] SavedModel parse_model_file(std::string_view bytes, const std::string& name);

/// The same from a file, or from the model.llm of a folder that `leadline map` wrote.
[[nodiscard]] SavedModel load_model_file(const std::string& path);

/// Evidence (hit + miss, event units: 255 is the centre of one sharp event) below which nothing is
/// claimed about a voxel.
inline constexpr unsigned kStateEvidence = 8;

/// Signal S of a voxel: share of its evidence that speaks for a surface, 0 .. 1; NaN when unknown.
[[nodiscard]] double voxel_signal(const model::Voxel& voxel);

/// What a pilot may rely on. Occupied: at least as much evidence for a surface as against it (S >= 0.5;
/// the blur of range and position makes that a band about the surface). Free: at least four times as
/// much against it (S <= 0.2). Unknown: anything between, and less evidence than kStateEvidence.
[[nodiscard]] VoxelState voxel_state(const model::Voxel& voxel);

/// `saved` must outlive what these return.
[[nodiscard]] VoxelStates voxel_states(const SavedModel& saved);
[[nodiscard]] render::VoxelField voxel_field(const SavedModel& saved);

}  // namespace leadline::host
