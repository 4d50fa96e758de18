#include "host_tools/map_output.hpp"

#include "host_tools/render/render.hpp"

namespace leadline::host {

void stage_map(OutputDir* output, const Raster& elevation, const Raster& sigma,
               const GeoReference& reference) {
  const int digits = raster_decimals(elevation.cell_m);
  output->write("depth.asc", format_esri_ascii(elevation, digits));
  output->write("sigma.asc", format_esri_ascii(sigma, digits));
  write_geotiff(output->stage("depth.tif"), elevation, &sigma, reference);
  output->write("depth.png", render::depth_png(elevation, render::PictureOptions{}));
}

}  // namespace leadline::host
