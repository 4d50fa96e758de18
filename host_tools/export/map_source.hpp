// A map to export or draw, wherever it comes from: the folder of `map`, `receive` or `replay`, one raster,
// or a vehicle's log (its downlink frames).
#pragma once

#include <optional>
#include <string>

#include "host_tools/geotiff.hpp"
#include "host_tools/model_file.hpp"
#include "host_tools/raster.hpp"
#include "host_tools/topside/tile_store.hpp"

namespace leadline::host {

struct MapSource {
  Raster elevation;                 ///< metres up
  std::optional<Raster> sigma;      ///< same geometry
  GeoReference reference;           ///< what the source says of its place
  std::optional<SavedModel> model;  ///< the voxels, where the source has them
  std::string origin;               ///< in words, for headers of files
};

/// Errors: HostError kInput naming the file.
[[nodiscard]] MapSource load_map_source(const std::string& path);

/// What a hello says of the place, and the survey's name.
[[nodiscard]] GeoReference hello_reference(const proto::Hello& hello);

}  // namespace leadline::host
