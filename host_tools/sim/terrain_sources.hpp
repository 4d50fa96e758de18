// Where simulated seafloors come from: invented, planar, or any raster that GDAL reads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "host_tools/raster.hpp"
#include "host_tools/sim/terrain.hpp"

namespace leadline::host {

/// An invented seafloor: a gentle slope with fractal roughness, a seamount with a crater, a fault
/// scarp, a field of sand ripples and a wreck-like block. Places, directions and roughness follow from
/// the seed; the sizes follow the extent, so any number of cells shows all of them.
struct ProceduralOptions {
  std::uint64_t seed = 1;
  std::size_t north_count = 128;     ///< at least 16
  std::size_t east_count = 128;      ///< at least 16
  double cell_m = 0.5;               ///< over 0
  double shallowest_depth_m = 10.0;  ///< of the highest point
  double relief_cells = 22.0;        ///< highest to lowest point, in cells; over 0
};

/// The same values on every host for the same options: exact arithmetic (exact_math.hpp), depths
/// rounded to 1/1024 m. Throws std::invalid_argument naming the value.
[[nodiscard]] Terrain make_procedural_terrain(const ProceduralOptions& options);

/// A plane, deepening by tan(slope) towards `dip_azimuth_deg` (clockwise from north).
struct PlaneOptions {
  std::size_t north_count = 64;
  std::size_t east_count = 64;
  double cell_m = 1.0;
  double shallowest_depth_m = 20.0;  ///< of the shallowest cell centre
  double slope_deg = 0.0;            ///< 0 .. below 80
  double dip_azimuth_deg = 0.0;
};
[[nodiscard]] Terrain make_plane_terrain(const PlaneOptions& options);

/// How a raster of elevations becomes a terrain.
struct RasterTerrainOptions {
  /// Part of the raster, counted from its north-west corner. All four 0 = the largest central part of
  /// the terrain's shape (the whole raster if the counts below are 0 too).
  std::size_t first_row = 0;
  std::size_t first_column = 0;
  std::size_t rows = 0;
  std::size_t columns = 0;
  /// Cells of the terrain; 0 = as the part. The part is stretched over them: averaged where it is
  /// coarsened, bilinear where it is refined.
  std::size_t north_count = 0;
  std::size_t east_count = 0;
  /// Edge of a cell; 0 = extent of the part (north-south) over the cells.
  double cell_m = 0.0;
  /// Heights are scaled to this many cells between highest and lowest point; 0 = left as they are.
  double relief_cells = 0.0;
  /// Depth of the highest point; unset = minus its elevation. A survey needs water above the ground:
  /// set it for land.
  std::optional<double> shallowest_depth_m;
};

/// `name` stands for the raster in messages. Elevations up become depths down, row 0 (north) the last
/// row north. Cells without a value are filled from their neighbours outwards-in, up to a quarter of
/// the part; more is an error. Throws HostError kInput (the raster has too little) or
/// std::invalid_argument (an option, named).
[[nodiscard]] Terrain make_raster_terrain(const Raster& raster, const std::string& name,
                                          const RasterTerrainOptions& options);

/// read_raster() and the above.
[[nodiscard]] Terrain load_raster_terrain(const std::string& path,
                                          const RasterTerrainOptions& options);

/// The terrain as a raster of elevations (metres up), for truth.asc.
[[nodiscard]] Raster terrain_elevation(const Terrain& terrain);

}  // namespace leadline::host
