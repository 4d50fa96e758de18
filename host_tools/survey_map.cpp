#include "host_tools/survey_map.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "host_tools/exit_codes.hpp"
#include "host_tools/model_file.hpp"
#include "host_tools/table/beam_pattern.hpp"
#include "host_tools/table/generator.hpp"
#include "model/base/status.hpp"
#include "model/model.hpp"

namespace leadline::host {
namespace {

// As on the vehicle: one large static object, no heap. Hence one SurveyMap at a time.
model::Model the_model;
bool model_taken = false;

/// Bits that one voxel still leaves open: 1 for an unknown one.
double entropy_of(double signal) {
  const double rest = 1.0 - signal;
  const double first = signal > 0.0 ? signal * std::log2(signal) : 0.0;
  const double second = rest > 0.0 ? rest * std::log2(rest) : 0.0;
  return -(first + second);
}

}  // namespace

struct SurveyMap::Impl {
  MapConfig config;
  Raster elevation;
  Raster sigma;
};

SurveyMap::SurveyMap(const MapConfig& config, const std::string& config_name,
                     std::uint32_t work_budget_voxels)
    : impl_(std::make_unique<Impl>()) {
  if (model_taken) {
    throw std::logic_error("one SurveyMap at a time: the model is a static object");
  }
  impl_->config = config;
  model::ModelConfig model_config =
      to_model_config(config.grid, config.sonar, config.navigation, config.model, config_name);
  model_config.work_budget_voxels = work_budget_voxels;
  const GeneratedTable generated = generate_table(beam_description(config.sonar));
  const base::Status status =
      the_model.configure(model_config, &generated.table, sizeof generated.table);
  if (status == base::Status::kOverBudget) {
    refuse_work_bound(the_model.bound(), work_budget_voxels, config_name);
  }
  if (status != base::Status::kOk) {
    throw HostError(ExitCode::kUsage, config_name + ": the model refuses this configuration: " +
                                          base::status_text(status));
  }
  model_taken = true;
}

SurveyMap::~SurveyMap() { model_taken = false; }

const char* SurveyMap::integrate(const PingRow& row) {
  base::Ping ping{};
  base::Pose pose{};
  row_to_records(row, impl_->config, &ping, &pose);
  const model::PingResult result = the_model.integrate(ping, pose);
  const bool fused = result == model::PingResult::kFused || result == model::PingResult::kNoReturn;
  return fused ? nullptr : model::ping_result_name(result);
}

void SurveyMap::extract() {
  the_model.extract();
  const ModelRasters rasters = model_rasters(the_model);
  impl_->elevation = rasters.elevation;
  impl_->sigma = rasters.sigma;
}

const Raster& SurveyMap::elevation() const { return impl_->elevation; }
const Raster& SurveyMap::sigma() const { return impl_->sigma; }

SurveyMapCounters SurveyMap::counters() const { return model_counters(the_model); }

std::string SurveyMap::save() const { return save_model(the_model, impl_->config); }

ModelRasters model_rasters(const model::Model& model) {
  const model::ModelConfig& config = model.config();
  ModelRasters rasters;
  rasters.elevation =
      make_raster(config.size[1], config.size[0], static_cast<double>(config.origin_mm[1]) / 1000.0,
                  static_cast<double>(config.origin_mm[0]) / 1000.0, config.cell_mm / 1000.0);
  rasters.sigma = rasters.elevation;
  for (std::int32_t n = 0; n < config.size[0]; ++n) {
    const int row = config.size[0] - 1 - n;
    for (std::int32_t e = 0; e < config.size[1]; ++e) {
      const model::ColumnResult& column = model.result(n, e);
      if (column.depth_q8 == model::kUnknownDepth) {
        continue;
      }
      // Exact in double: below 2^53 in units of 1/256 mm. One division, so one rounding.
      const double depth_256th_mm = static_cast<double>(config.origin_mm[2]) * 256.0 +
                                    static_cast<double>(column.depth_q8) * config.cell_mm;
      rasters.elevation.at(row, e) = -depth_256th_mm / 256'000.0;
      rasters.sigma.at(row, e) =
          static_cast<double>(column.sigma_q12) * config.cell_mm / 4'096'000.0;
    }
  }
  return rasters;
}

SurveyMapCounters model_counters(const model::Model& model) {
  const model::ModelCounters& from = model.counters();
  SurveyMapCounters counters;
  counters.voxel_updates = from.voxel_updates;
  counters.max_voxels_per_ping = from.max_voxels_per_ping;
  counters.work_bound = model.bound().total_voxels;
  counters.bytes_per_voxel = sizeof(model::Voxel);
  counters.table_crc = model.table().crc32c;
  counters.map_hash = model.grid().map_hash();
  const model::Grid& grid = model.grid();
  std::uint64_t known = 0;
  std::uint64_t all = 0;
  double bits = 0;
  for (std::int32_t n = 0; n < grid.north_cells(); ++n) {
    for (std::int32_t e = 0; e < grid.east_cells(); ++e) {
      const model::Voxel* const voxels = grid.column_voxels(grid.column_index(n, e));
      for (std::int32_t k = 0; k < grid.depth_cells(); ++k) {
        const bool unknown = voxels[k].hit == 0 && voxels[k].miss == 0;
        all += 1;
        known += unknown ? 0 : 1;
        bits += unknown ? 1.0 : entropy_of(voxel_signal(voxels[k]));
      }
    }
  }
  counters.entropy_bits = bits;
  counters.known_fraction = static_cast<double>(known) / static_cast<double>(all);
  return counters;
}

std::string save_model(const model::Model& model, const MapConfig& config) {
  SavedModel saved;
  saved.config = config;
  saved.table = model.table();
  saved.map_hash = model.grid().map_hash();
  const model::Grid& grid = model.grid();
  saved.voxels.reserve(config.grid.voxel_count());
  for (std::int32_t n = 0; n < grid.north_cells(); ++n) {
    for (std::int32_t e = 0; e < grid.east_cells(); ++e) {
      const model::Voxel* const voxels = grid.column_voxels(grid.column_index(n, e));
      saved.voxels.insert(saved.voxels.end(), voxels, voxels + grid.depth_cells());
    }
  }
  return format_model_file(saved);
}

void row_to_records(const PingRow& row, const MapConfig& config, base::Ping* ping,
                    base::Pose* pose) {
  *ping = base::Ping{};
  ping->t_transmit_us = row.t_us;
  // There and back, in whole microseconds: 2 * range / c.
  ping->t_receive_us = row.t_us + row.range_um * 2000 / config.sonar.sound_speed_mm_s;
  ping->azimuth_bam32 = row.azimuth_bam32;
  ping->elevation_bam32 = row.elevation_bam32;
  ping->kind = row.has_range ? base::ReturnKind::kRange : base::ReturnKind::kNoReturn;
  ping->quality = UINT8_MAX;
  ping->range_um = row.range_um;
  *pose = base::Pose{};
  pose->t_us = row.t_us;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    pose->position_um[axis] = row.position_um[axis];
    pose->covariance.sigma_position_mm[axis] =
        static_cast<std::uint32_t>(std::llround(config.navigation.sigma_position_mm[axis]));
  }
  pose->attitude = row.attitude;
  pose->validity = base::kPoseAll;
}

}  // namespace leadline::host
