// Surveys as the link sees them: coded maps at a row of moments, for the bench of the link and for the
// maker of the tile model's table. Header only, as octomap_survey.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "host_tools/map_config.hpp"
#include "host_tools/ping_csv.hpp"
#include "host_tools/raster.hpp"
#include "host_tools/sim/scenario.hpp"
#include "host_tools/sim/simulator.hpp"
#include "host_tools/survey_map.hpp"
#include "proto/tile_coder.hpp"

namespace leadline::test {

using CodedTile = std::array<proto::CodedCell, proto::kTileArea_cells>;
/// All tiles of a grid, row-major, north first (south-west tile first: north grows).
using CodedMap = std::vector<CodedTile>;

/// Elevation and sigma in metres as coded cells; `before` (may be null) is what the receiver has.
inline CodedMap code_raster(const host::Raster& elevation, const host::Raster& sigma,
                            double top_elevation_m, const CodedMap* before) {
  constexpr int kSide = proto::kTileSide_cells;
  const int tiles_east = (elevation.columns + kSide - 1) / kSide;
  const int tiles_north = (elevation.rows + kSide - 1) / kSide;
  CodedMap map(static_cast<std::size_t>(tiles_east) * static_cast<std::size_t>(tiles_north));
  for (int n = 0; n < elevation.rows; ++n) {
    for (int e = 0; e < elevation.columns; ++e) {
      const int row = elevation.rows - 1 - n;
      const double up_m = elevation.at(row, e);
      const double sigma_m = sigma.at(row, e);
      const bool known = !std::isnan(up_m);
      const auto depth_q8 = known ? static_cast<std::int32_t>(std::lround((top_elevation_m - up_m) /
                                                                          elevation.cell_m * 256.0))
                                  : proto::kUnknownDepth_q8;
      const auto sigma_q12 =
          known ? static_cast<std::uint32_t>(std::lround(sigma_m / elevation.cell_m * 4096.0)) : 0;
      const auto tile = static_cast<std::size_t>((n / kSide) * tiles_east + e / kSide);
      const auto cell = static_cast<std::size_t>((n % kSide) * kSide + e % kSide);
      map[tile][cell] = before == nullptr
                            ? proto::code_cell(depth_q8, sigma_q12, 0)
                            : proto::code_cell_near((*before)[tile][cell], depth_q8, sigma_q12, 0);
    }
  }
  return map;
}

/// A raster of heights with one sigma everywhere, given in cells.
inline CodedMap code_terrain(const host::Raster& elevation, double sigma_cells) {
  host::Raster sigma = elevation;
  double top_m = -1e9;
  for (std::size_t i = 0; i < sigma.values.size(); ++i) {
    sigma.values[i] = sigma_cells * elevation.cell_m;
    if (!std::isnan(elevation.values[i])) {
      top_m = std::max(top_m, elevation.values[i]);
    }
  }
  return code_raster(elevation, sigma, top_m, nullptr);
}

/// Maps pings (the texts of pings.csv and map.toml) with the vehicle's model; the coded map, as a vehicle that
/// sends every change keeps it, after each of `fractions` (ascending, 0 .. 1) of the pings.
inline std::vector<CodedMap> coded_pings(const std::string& pings, const std::string& map_toml,
                                         const std::vector<double>& fractions) {
  const host::MapConfig config = host::parse_map_config(map_toml, "map.toml", "");
  const double top_m = -static_cast<double>(config.grid.origin_mm[2]) * 1e-3;
  host::SurveyMap map(config, "map.toml");
  std::vector<host::PingRow> rows;
  host::PingCsvReader reader("pings.csv", pings, {});
  for (host::PingRow row{}; reader.next(&row);) {
    rows.push_back(row);
  }
  std::vector<CodedMap> states;
  std::size_t taken = 0;
  for (const double fraction : fractions) {
    const auto until =
        static_cast<std::size_t>(std::floor(fraction * static_cast<double>(rows.size())));
    for (; taken < until; ++taken) {
      static_cast<void>(map.integrate(rows[taken]));
    }
    map.extract();
    states.push_back(code_raster(map.elevation(), map.sigma(), top_m,
                                 states.empty() ? nullptr : &states.back()));
  }
  return states;
}

/// Flies `options` (preset, terrain, seed, settings) first.
inline std::vector<CodedMap> coded_survey(const host::SimulateOptions& options,
                                          const std::vector<double>& fractions) {
  const host::Scenario scenario = host::resolve_scenario(options);
  const host::Terrain terrain = host::build_terrain(scenario);
  const host::Survey survey = host::simulate(terrain, scenario.scene);
  return coded_pings(host::format_pings_csv(survey), host::format_map_toml(terrain, scenario.scene),
                     fractions);
}

/// Two states of a map that follow each other.
struct MapChange {
  CodedMap before;  ///< all unknown for a map sent whole
  CodedMap after;
};

inline MapChange whole_map(const CodedMap& map) { return {CodedMap(map.size()), map}; }

}  // namespace leadline::test
