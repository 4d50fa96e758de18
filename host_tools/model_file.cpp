#include "host_tools/model_file.hpp"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <utility>

#include "firmware/config/input_file.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/table/table_io.hpp"
#include "host_tools/text.hpp"
#include "model/base/crc32c.hpp"
#include "model/capacity.hpp"

namespace leadline::host {
namespace {

constexpr std::string_view kMagic = "LLM1";
constexpr std::uint16_t kVersion = 1;
constexpr std::size_t kHeader_bytes = 48;
constexpr std::size_t kChecked_from = 24;
constexpr std::uint64_t kVoxel_bytes = 4;

void put(std::string* out, std::uint64_t value, std::size_t size_bytes) {
  for (std::size_t i = 0; i < size_bytes; ++i) {
    out->push_back(static_cast<char>((value >> (8 * i)) & 0xFFU));
  }
}

std::uint64_t take(std::string_view bytes, std::size_t offset, std::size_t size_bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size_bytes; ++i) {
    value |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[offset + i])) << (8 * i);
  }
  return value;
}

[[noreturn]] void fail(const std::string& name, const std::string& what) {
  throw HostError(ExitCode::kInput, name + ": " + what);
}

/// FNV-1a as Grid::map_hash(), over the file's order, which is the same.
std::uint64_t hash_of(const std::vector<model::Voxel>& voxels) {
  std::uint64_t hash = 0xCBF29CE484222325ULL;
  for (const model::Voxel& voxel : voxels) {
    const std::uint32_t word = voxel.hit | (static_cast<std::uint32_t>(voxel.miss) << 16U);
    hash = (hash ^ word) * 0x100000001B3ULL;
  }
  return hash;
}

MapConfig saved_config(std::string_view text, const std::string& name) {
  try {
    return parse_map_config(text, name + " (configuration)", "");
  } catch (const HostError& error) {
    throw HostError(ExitCode::kInput, error.what());
  }
}

}  // namespace

std::string format_model_file(const SavedModel& saved) {
  const std::string config = map_config_to_toml(saved.config);
  const std::uint64_t size_bytes = kHeader_bytes + config.size() + sizeof saved.table +
                                   kVoxel_bytes * static_cast<std::uint64_t>(saved.voxels.size());
  std::string out;
  out.reserve(size_bytes);
  out += kMagic;
  put(&out, kVersion, 2);
  put(&out, 0, 2);
  put(&out, size_bytes, 8);
  put(&out, 0, 4);  // the checksum, below
  put(&out, 0, 4);
  put(&out, saved.map_hash, 8);
  put(&out, config.size(), 4);
  put(&out, sizeof saved.table, 4);
  put(&out, saved.voxels.size(), 8);
  out += config;
  out.append(reinterpret_cast<const char*>(&saved.table), sizeof saved.table);
  for (const model::Voxel& voxel : saved.voxels) {
    put(&out, voxel.hit, 2);
    put(&out, voxel.miss, 2);
  }
  const std::uint32_t crc = base::crc32c(out.data() + kChecked_from, out.size() - kChecked_from);
  std::string crc_bytes;
  put(&crc_bytes, crc, 4);
  return out.replace(16, 4, crc_bytes);
}

SavedModel parse_model_file(std::string_view bytes, const std::string& name) {
  if (bytes.substr(0, 4) != kMagic.substr(0, std::min<std::size_t>(4, bytes.size())) ||
      bytes.empty()) {
    fail(name, "is not a saved model (model.llm of `leadline map`)");
  }
  if (bytes.size() < kHeader_bytes) {
    fail(name, "is cut: " + std::to_string(bytes.size()) + " bytes, the header alone has " +
                   std::to_string(kHeader_bytes));
  }
  const std::uint64_t version = take(bytes, 4, 2);
  if (version != kVersion) {
    fail(name, "is a saved model of version " + std::to_string(version) +
                   ", this program reads version " + std::to_string(kVersion) +
                   "; map the pings again");
  }
  const std::uint64_t size_bytes = take(bytes, 8, 8);
  if (size_bytes != bytes.size()) {
    fail(name, std::string(size_bytes > bytes.size() ? "is cut: " : "has bytes after its end: ") +
                   std::to_string(bytes.size()) + " bytes instead of " +
                   std::to_string(size_bytes));
  }
  if (take(bytes, 16, 4) !=
      base::crc32c(bytes.data() + kChecked_from, bytes.size() - kChecked_from)) {
    fail(name, "is damaged: its checksum does not match; map the pings again");
  }
  const std::uint64_t config_bytes = take(bytes, 32, 4);
  const std::uint64_t table_bytes = take(bytes, 36, 4);
  const std::uint64_t voxel_count = take(bytes, 40, 8);
  if (voxel_count > size_bytes / kVoxel_bytes ||
      kHeader_bytes + config_bytes + table_bytes + kVoxel_bytes * voxel_count != size_bytes) {
    fail(name, "is inconsistent: its parts do not add up to its size");
  }
  SavedModel saved;
  saved.config = saved_config(bytes.substr(kHeader_bytes, config_bytes), name);
  saved.table =
      parse_table(bytes.substr(kHeader_bytes + config_bytes, table_bytes), name + " (table)");
  if (saved.config.grid.voxel_count() != voxel_count) {
    fail(name, "is inconsistent: " + std::to_string(voxel_count) + " voxels for a grid of " +
                   std::to_string(saved.config.grid.voxel_count()));
  }
  saved.map_hash = take(bytes, 24, 8);
  saved.voxels.resize(voxel_count);
  std::size_t offset = kHeader_bytes + config_bytes + table_bytes;
  for (model::Voxel& voxel : saved.voxels) {
    voxel.hit = static_cast<std::uint16_t>(take(bytes, offset, 2));
    voxel.miss = static_cast<std::uint16_t>(take(bytes, offset + 2, 2));
    offset += kVoxel_bytes;
  }
  if (hash_of(saved.voxels) != saved.map_hash) {
    fail(name, "is inconsistent: its voxels do not have its map_hash");
  }
  return saved;
}

SavedModel load_model_file(const std::string& path) {
  std::error_code ignored;
  const std::string file_path = std::filesystem::is_directory(path, ignored)
                                    ? (std::filesystem::path(path) / "model.llm").string()
                                    : path;
  return parse_model_file(read_input(file_path), file_path);
}

double voxel_signal(const model::Voxel& voxel) {
  const unsigned total = static_cast<unsigned>(voxel.hit) + voxel.miss;
  return total == 0 ? std::numeric_limits<double>::quiet_NaN()
                    : static_cast<double>(voxel.hit) / static_cast<double>(total);
}

VoxelState voxel_state(const model::Voxel& voxel) {
  const unsigned hit = voxel.hit;
  const unsigned miss = voxel.miss;
  if (hit + miss < kStateEvidence) {
    return VoxelState::kUnknown;
  }
  if (hit >= miss) {
    return VoxelState::kOccupied;
  }
  return miss >= 4 * hit ? VoxelState::kFree : VoxelState::kUnknown;
}

VoxelStates voxel_states(const SavedModel& saved) {
  const GridConfig& grid = saved.config.grid;
  return {{{grid.origin_mm[0], grid.origin_mm[1], grid.origin_mm[2]}, grid.cell_mm},
          {grid.size[0], grid.size[1], grid.size[2]},
          [&saved](const CellIndex& cell) {
            return voxel_state(saved.voxel(cell[0], cell[1], cell[2]));
          }};
}

render::VoxelField voxel_field(const SavedModel& saved) {
  const GridConfig& grid = saved.config.grid;
  render::VoxelField field;
  field.cell_m = grid.cell_mm / 1000.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    field.size[axis] = grid.size[axis];
    field.origin_m[axis] = static_cast<double>(grid.origin_mm[axis]) / 1000.0;
  }
  field.probability = [&saved](int north, int east, int down) {
    return voxel_signal(saved.voxel(north, east, down));
  };
  return field;
}

}  // namespace leadline::host
