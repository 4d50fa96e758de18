#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/export/export.hpp"

namespace leadline::host {

void add_export_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<ExportOptions>();
  CLI::App* const command =
      app->add_subcommand("export", "Write a map in the formats of other programs");
  command
      ->add_option(
          "map", options->input_path,
          "Folder of `map`, `receive` or `replay`, a raster, a vehicle's log, or a store of\n"
          "surveys (FILE.lls: the one saved last; FILE.lls#N: survey N)")
      ->type_name("PATH")
      ->required();
  command->add_option("--out", options->out_path, "File to write (- is standard output)")
      ->type_name("FILE")
      ->required();
  command
      ->add_option(
          "--format", options->format,
          "geotiff, asc, xyz162, xyz168, ply, las, geojson or kml (default: by the file's ending)")
      ->type_name("NAME");
  command
      ->add_option("--vertical", options->vertical,
                   "elevation (up) or depth (down); default elevation, for xyz162 depth")
      ->type_name("SIGN");
  command->add_option("--datum", options->datum, "Vertical datum to state in the file")
      ->type_name("TEXT");
  command
      ->add_option("--layer", options->layer,
                   "map, sigma (asc), voxels (ply, las: the occupied ones), contours or coverage\n"
                   "(geojson, kml: one without the other); default map")
      ->type_name("NAME");
  command
      ->add_option("--contours", options->contour_interval_m,
                   "geojson, kml: metres between contours, 0 for none (default: a round step)")
      ->type_name("M");
  command
      ->add_option(
          "--frame", options->frame,
          "xyz, las, geojson: local metres or lonlat (default: lonlat where the map has a\n"
          "place, las in the --epsg system where there is one);\n"
          "asc: local keeps the map's metres in spite of --epsg")
      ->type_name("NAME");
  command->add_option("--lat", options->lat_deg, "Latitude of the map's origin, instead of its own")
      ->type_name("DEG");
  command->add_option("--lon", options->lon_deg, "Longitude of the map's origin")->type_name("DEG");
  command
      ->add_option(
          "--epsg", options->epsg,
          "Projected system in metres: of the map's coordinates, or, where an origin is known\n"
          "(--lat and --lon, or the map's own), to express the map in: turned by the grid\n"
          "convergence and scaled. A GeoTIFF holds that grid, asc only where north stays up")
      ->type_name("CODE");
  command->footer(
      "xyz162 and xyz168 are MB-System's ASCII XYZ formats: longitude latitude depth (down) or\n"
      "elevation (up), and sigma. A map without a place is exported in local metres, and says "
      "so.\n\n"
      "Examples:\n"
      "  leadline export map --out depth.tif --datum MSL\n"
      "  leadline export surveys.lls#2 --out chart.geojson\n"
      "  leadline export map --out soundings.xyz --lat 54.18 --lon 7.89\n"
      "  leadline export out/demo/survey.lll --out seafloor.ply --vertical elevation\n"
      "  leadline export map --out chart.kml --vertical depth --contours 2 --lat 54.18 --lon 7.89");
  command->callback([options, run] { *run = [options] { return run_export(*options); }; });
}

}  // namespace leadline::host
