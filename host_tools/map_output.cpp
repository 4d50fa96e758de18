#include "host_tools/map_output.hpp"

#include "host_tools/render/render.hpp"

namespace leadline::host {

GeoReference map_reference(const MapConfig& config) {
  const FrameConfig& frame = config.frame;
  return {frame.lat_deg, frame.lon_deg, frame.epsg, frame.vertical_datum, config.survey_name};
}

void stage_map(OutputDir* output, const Raster& elevation, const Raster& sigma,
               const GeoReference& reference) {
  const int digits = raster_decimals(elevation.cell_m);
  output->write("depth.asc", format_esri_ascii(elevation, digits));
  output->write("sigma.asc", format_esri_ascii(sigma, digits));
  // A map so wide that no straight grid follows the wanted projection is written in the plane that it was
  // made in; the file says which.
  GeoReference placed = reference;
  if (place_raster(reference, elevation).error_cells > kMaxPlacementError_cells) {
    placed.epsg.reset();
  }
  write_geotiff(output->stage("depth.tif"), elevation, &sigma, placed, VerticalSign::kElevation,
                output->path() + "/depth.tif");
  output->write("depth.png", render::depth_png(elevation, render::PictureOptions{}));
}

}  // namespace leadline::host
