// The files that every command which ends with a map leaves, so that `render`, `compare` and `export` work
// on each of their folders.
#pragma once

#include "host_tools/geotiff.hpp"
#include "host_tools/map_config.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/raster.hpp"

namespace leadline::host {

/// What a map's configuration says of its place and its name.
[[nodiscard]] GeoReference map_reference(const MapConfig& config);

/// Stages depth.asc and sigma.asc (elevation and one sigma, metres), depth.tif (both, georeferenced where
/// the reference names a place) and depth.png. The caller commits. Throws HostError kOutput.
void stage_map(OutputDir* output, const Raster& elevation, const Raster& sigma,
               const GeoReference& reference);

}  // namespace leadline::host
