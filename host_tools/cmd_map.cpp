#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/map_command.hpp"

namespace leadline::host {

void add_map_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<MapOptions>();
  CLI::App* const command =
      app->add_subcommand("map", "Turn pings into a voxel model and a depth map");
  command->add_option("--pings", options->pings_path, "Pings, CSV; - is standard input")
      ->type_name("FILE")
      ->required();
  command->add_option("--config", options->config_path, "Grid, sonar and navigation, TOML")
      ->type_name("FILE")
      ->required();
  command->add_option("--out", options->out_dir, "Folder for the results, created when needed")
      ->type_name("DIR")
      ->required();
  command->add_flag("--strict", options->strict, "Stop at the first row that cannot be used");
  command
      ->add_option("--work-budget", options->work_budget_voxels,
                   "Refuse a configuration in which one ping can touch more voxels than this")
      ->type_name("VOXELS");
  command->add_flag("--json", options->json, "Print stats.json instead of a summary");
  command->footer(
      "DIR receives model.llm (the voxels, for `render` and `query`), depth.asc and sigma.asc\n"
      "(elevation up and one standard deviation, metres, ESRI ASCII), depth.png and stats.json: "
      "all\n"
      "of them or none. Earlier results in it are replaced.\n\n"
      "CSV: a header names the columns, in any order; others are ignored.\n"
      "  time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n"
      "  x y z is the transducer, NED, from the survey's origin. Azimuth and elevation point the "
      "beam\n"
      "  in the body's frame (forward, right, down): 0 90 is straight down. Pitch nose up, roll\n"
      "  starboard down, heading from north. An empty range is a beam that heard nothing.\n\n"
      "TOML: [grid] and one description of the beam are needed, the rest has defaults.\n"
      "  [grid]\n"
      "  cell_mm = 1000\n"
      "  size = [128, 128, 32]           # cells north, east, down\n"
      "  origin_mm = [0, 0, 56000]       # the lowest corner\n"
      "  [sonar]\n"
      "  beam_half_angle_deg = 3         # or piston_diameter_mm and frequency_hz,\n"
      "                                  # or aperture_along_mm, aperture_across_mm and "
      "frequency_hz,\n"
      "                                  # or pattern_file\n"
      "  max_half_angle_deg = 20         # cap of the beam, optional\n"
      "  sigma_pointing_deg = 1          # sigmas: one standard deviation, default 0\n"
      "  sigma_range_mm = 50\n"
      "  min_range_mm = 500              # ranges outside are rejected\n"
      "  max_range_mm = 80000\n"
      "  no_return = \"ignore\"            # or \"empty\", with detect_range_mm\n"
      "  sound_speed_mm_s = 1500000\n"
      "  detection_fraction = 0.1        # of the echo that has arrived when the head detects\n"
      "  [navigation]\n"
      "  sigma_position_mm = [200, 200, 100]    # per row, north, east, down\n"
      "  sigma_correlated_mm = [0, 0, 0]        # a floor that averaging does not lower\n"
      "  [model]\n"
      "  rule = \"log_odds\"               # or \"weighted_mean\", \"certainty_factor\", "
      "\"recursive\"\n"
      "  [frame]                         # where the origin lies, optional\n"
      "  lat = 46.2\n"
      "  lon = -122.2\n"
      "  epsg = 32610\n"
      "  vertical_datum = \"MLLW\"\n"
      "  [survey]                        # optional\n"
      "  name = \"Spirit Lake\"\n\n"
      "Examples:\n"
      "  leadline map --pings pings.csv --config map.toml --out map\n"
      "  zcat pings.csv.gz | leadline map --pings - --config map.toml --out map --json");
  command->callback([options, run] { *run = [options] { return run_map(*options); }; });
}

}  // namespace leadline::host
