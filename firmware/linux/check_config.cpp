#include "firmware/linux/check_config.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

#include "firmware/config/exit_codes.hpp"
#include "firmware/linux/chunk_buffer.hpp"
#include "firmware/linux/recorder.hpp"
#include "hal/linux/linux_port.hpp"
#include "model/grid.hpp"

namespace leadline::host {
namespace {

/// A number with its name, in the order of the report.
struct Figure {
  const char* name;
  std::uint64_t value;
  const char* unit;
};

std::vector<Figure> memory_figures(const VehicleFile& file, const firmware::Vehicle& vehicle) {
  const model::Grid& grid = vehicle.model().grid();
  const std::uint64_t columns = grid.column_count();
  // Of a window its pages, and the blank one.
  const std::uint64_t tiles =
      grid.windowed() ? std::uint64_t{grid.page_count()} + 1 : std::uint64_t{grid.tile_count()};
  const std::uint64_t voxels = tiles * grid.tile_voxel_count();
  const std::uint64_t model_used = voxels * sizeof(model::Voxel) +
                                   columns * sizeof(model::ColumnRecord) +
                                   columns * sizeof(model::ColumnResult);
  const std::uint64_t ports = file.port_uris.size() + 1;
  const std::uint64_t input = firmware::kMaxCycleBytes + Recorder::kBatch_bytes;
  return {
      {"vehicle_static", sizeof(firmware::Vehicle), "bytes"},
      {"model_static", sizeof(model::Model), "bytes, part of it"},
      {"pipeline_static", sizeof(firmware::Vehicle) - sizeof(model::Model), "bytes, the rest"},
      {"model_used", model_used, "bytes of the model, by this grid"},
      {"voxels_used", voxels, "voxels, padding of tiles included"},
      {"voxel_capacity", model::kVoxelCapacity, "voxels"},
      {"columns_used", columns, "columns"},
      {"column_capacity", model::kColumnCapacity, "columns"},
      {"recorder", file.log.path.empty() ? 0 : sizeof(Recorder) + Recorder::kRing_bytes, "bytes"},
      {"port_queues", ports * hal::LinuxPort::kQueue_bytes, "bytes"},
      {"cycle_buffers", input, "bytes"},
  };
}

std::vector<Figure> work_figures(const VehicleFile& file, const firmware::Vehicle& vehicle) {
  const model::WorkBound& bound = vehicle.model().bound();
  return {
      {"ping_voxels", bound.total_voxels, "voxels that one ping can write"},
      {"ping_shell_voxels", bound.shell_voxels, "of them in the shell"},
      {"ping_cone_voxels", bound.cone_voxels, "of them in the empty cone"},
      {"behind_voxels", bound.behind_voxels, "that each return behind its first adds at most"},
      {"cycle_voxels", vehicle.cycle_bound_voxels(), "voxels that one cycle can write"},
      {"cycle_tiles", file.config.cycle_tile_budget, "tiles extracted in one cycle"},
      {"cycle_input_bytes", firmware::kMaxCycleBytes, "bytes taken in one cycle"},
      {"cycle_downlink_bytes", firmware::kDownlinkCapacity_bytes, "bytes of frames in one cycle"},
  };
}

std::string text_of(const char* title, const std::vector<Figure>& figures) {
  std::string text = std::string("\n# ") + title + "\n";
  for (const Figure& figure : figures) {
    std::array<char, 160> line{};
    std::snprintf(line.data(), line.size(), "#   %-20s %12llu %s\n", figure.name,
                  static_cast<unsigned long long>(figure.value), figure.unit);
    text += line.data();
  }
  return text;
}

std::string json_of(const std::vector<Figure>& figures) {
  std::string text = "{";
  for (const Figure& figure : figures) {
    text += text.size() == 1 ? "" : ", ";
    text += "\"" + std::string(figure.name) + "\": " + std::to_string(figure.value);
  }
  return text + "}";
}

}  // namespace

void configure_vehicle(const VehicleFile& file, const std::vector<model::LocalizationTable>& tables,
                       firmware::Vehicle& vehicle, const std::string& config_name) {
  std::vector<firmware::TableBlock> blocks;
  for (const model::LocalizationTable& table : tables) {
    blocks.push_back({&table, sizeof table});
  }
  const base::Status status = vehicle.configure(file.config, blocks.data(), blocks.size());
  if (status == base::Status::kOverBudget) {
    refuse_work_bound(vehicle.model().bound(), file.ping_voxel_budget, config_name);
  }
  if (status == base::Status::kFull) {
    throw HostError(
        ExitCode::kUsage,
        config_name + ": the drivers of its ports need more than the " +
            std::to_string(firmware::kCodecArena_bytes) +
            " bytes that this program has for them (built with -DLEADLINE_CODEC_BYTES)");
  }
  if (status != base::Status::kOk) {
    throw HostError(ExitCode::kUsage, config_name + ": the vehicle refuses this configuration: " +
                                          base::status_text(status));
  }
}

std::string window_warning(const model::ModelConfig& model) {
  const std::int64_t range_cells = model.max_range_um / (std::int64_t{model.cell_mm} * 1000);
  // Flat and to north-east, where its box is largest; with its footprint to both sides.
  const std::int64_t side =
      (range_cells * 71 / 100 + 2 * model::kMaxFootprintCells) / model::kTileCells + 2;
  const auto tiles = [&model](int axis) {
    return std::int64_t{(model.size[axis] + model::kTileCells - 1) / model::kTileCells};
  };
  const std::int64_t most = std::min(side, tiles(0)) * std::min(side, tiles(1));
  if (std::int64_t{model.resident_tiles} >= most) {
    return "";
  }
  return "leadline-vehicle: [store] window_tiles = " + std::to_string(model.resident_tiles) +
         ": a flat ping of max_range_mm can need some " + std::to_string(most) +
         " tiles at once; what needs more than the window is shed\n";
}

std::string check_report_text(const VehicleFile& file, const firmware::Vehicle& vehicle) {
  return vehicle_file_to_toml(file) + text_of("memory", memory_figures(file, vehicle)) +
         text_of("work", work_figures(file, vehicle));
}

std::string check_report_json(const VehicleFile& file, const firmware::Vehicle& vehicle) {
  return "{\"config\": " + vehicle_file_to_json(file) +
         ", \"memory\": " + json_of(memory_figures(file, vehicle)) +
         ", \"work\": " + json_of(work_figures(file, vehicle)) + "}\n";
}

}  // namespace leadline::host
