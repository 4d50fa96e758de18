// A map to export or draw, wherever it comes from: the folder of `map`, `receive` or `replay`, one raster,
// a vehicle's log (its downlink frames), or a survey of a store (FILE.lls, FILE.lls#N).
#pragma once

#include <optional>
#include <string>
#include <vector>

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
  std::vector<std::string>
      surveys;  ///< survey_label() of all that are in it, where the source says
};

/// Whether the path names a log or a store: maps that are neither folder nor raster.
[[nodiscard]] bool is_log_or_store(const std::string& path);

/// Errors: HostError kInput naming the file.
[[nodiscard]] MapSource load_map_source(const std::string& path);

/// "survey 7, session 1796051367": which flight of which vehicle.
[[nodiscard]] std::string survey_label(const proto::Hello& hello);

/// What a hello says of the place, and the survey's name.
[[nodiscard]] GeoReference hello_reference(const proto::Hello& hello);

}  // namespace leadline::host
