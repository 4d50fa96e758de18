// A survey's map on the host: the vehicle's model, driven by rows of a CSV file instead of a sensor.
// Everything that decides about the result (tables, integration, extraction) is the vehicle's code;
// here are only the conversions from and to files.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "host_tools/map_config.hpp"
#include "host_tools/ping_csv.hpp"
#include "host_tools/raster.hpp"
#include "model/base/ping.hpp"
#include "model/base/pose.hpp"
#include "model/model.hpp"

namespace leadline::host {

/// What the model counted. Names are the keys of stats.json.
struct SurveyMapCounters {
  std::uint64_t voxel_updates = 0;        ///< voxels written, over all pings
  std::uint64_t max_voxels_per_ping = 0;  ///< largest of any ping
  std::uint64_t work_bound = 0;           ///< W(config): what no ping can exceed
  double bytes_per_voxel = 0;
  double entropy_bits = 0;    ///< per known voxel
  double known_fraction = 0;  ///< voxels that any ping said something about
  std::uint32_t table_crc = 0;
  std::uint64_t map_hash = 0;  ///< of the voxels, whatever the host
};

class SurveyMap {
 public:
  /// Computes the table and configures the model. Only one SurveyMap may exist at a time. Throws
  /// HostError kUsage, `config_name` in front: grid over the compiled-in capacity, work bound over
  /// `work_budget_voxels` (0 = no budget), both with the numbers; a pattern file that cannot be used.
  explicit SurveyMap(const MapConfig& config, const std::string& config_name,
                     std::uint32_t work_budget_voxels = 0);
  ~SurveyMap();
  SurveyMap(const SurveyMap&) = delete;
  SurveyMap& operator=(const SurveyMap&) = delete;

  /// One row. Null when the model took it (no return included), else why not: a reason for
  /// MapStats::rejected such as range_below_min, range_above_max, too_far_from_grid.
  [[nodiscard]] const char* integrate(const PingRow& row);
  /// Depth and sigma of every column. Call once after the last row.
  void extract();

  /// Elevation (minus depth) and sigma in metres; columns without a depth have no value.
  [[nodiscard]] const Raster& elevation() const;
  [[nodiscard]] const Raster& sigma() const;
  [[nodiscard]] SurveyMapCounters counters() const;
  /// The saved model (model.llm).
  [[nodiscard]] std::string save() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Depth and sigma of every column as of the model's last extract(): elevation (minus depth) and sigma in
/// metres; columns without a depth have no value.
struct ModelRasters {
  Raster elevation;
  Raster sigma;
};
[[nodiscard]] ModelRasters model_rasters(const model::Model& model);
[[nodiscard]] SurveyMapCounters model_counters(const model::Model& model);
/// The saved model (model.llm). `config` describes the same grid.
[[nodiscard]] std::string save_model(const model::Model& model, const MapConfig& config);

/// The two records that the vehicle would have had for this row: transmit and receive time, beam and
/// range; position with the configured sigma, attitude, one epoch.
void row_to_records(const PingRow& row, const MapConfig& config, base::Ping* ping,
                    base::Pose* pose);

}  // namespace leadline::host
