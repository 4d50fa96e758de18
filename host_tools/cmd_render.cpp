#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/model_file.hpp"
#include "host_tools/options.hpp"
#include "host_tools/render/render.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr render::View kViews[] = {render::View::kDepth,       render::View::kOblique,
                                   render::View::kUncertainty, render::View::kDifference,
                                   render::View::kSlice,       render::View::kHistogram};

struct RenderArguments {
  render::RenderOptions options;
  std::string view_name;
  std::string axis_name;
  bool no_relief = false;
};

/// The index of `given` among `names`; HostError kUsage with a suggestion when it is none of them.
std::size_t choice(const char* option, const std::string& given,
                   const std::vector<std::string>& names) {
  std::string list;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == given) {
      return i;
    }
    list += (i == 0 ? " " : ", ") + names[i];
  }
  const std::string near = closest_name(given, names);
  throw HostError(ExitCode::kUsage, std::string(option) + " " + printable(given) +
                                        ": has to be one of" + list +
                                        (near.empty() ? "" : "; did you mean \"" + near + "\"?"));
}

/// What only one picture has use for.
struct ViewOption {
  const char* option;
  render::View view;
};
constexpr ViewOption kViewOptions[] = {
    {"--reference", render::View::kDifference}, {"--mask", render::View::kDifference},
    {"--axis", render::View::kSlice},           {"--at", render::View::kSlice},
    {"--view-azimuth", render::View::kOblique}, {"--view-elevation", render::View::kOblique}};

int run(const RenderArguments& arguments, const CLI::App& command) {
  render::RenderOptions options = arguments.options;
  options.picture.shaded_relief = !arguments.no_relief;
  if (!arguments.view_name.empty()) {
    std::vector<std::string> names;
    for (const render::View view : kViews) {
      names.emplace_back(render::view_name(view));
    }
    options.view = kViews[choice("--view", arguments.view_name, names)];
  }
  for (const ViewOption& each : kViewOptions) {
    if (options.view && *options.view != each.view && command.count(each.option) > 0) {
      usage_error(std::string(each.option) + ": goes with --view " + render::view_name(each.view));
    }
  }
  if (!arguments.axis_name.empty()) {
    options.slice_axis = static_cast<render::VoxelAxis>(
        choice("--axis", arguments.axis_name, {"north", "east", "down"}));
  }
  // The voxels, where there are any: pictures of a single raster do not need them.
  const bool wants_voxels = !options.view || *options.view == render::View::kSlice ||
                            *options.view == render::View::kHistogram;
  std::error_code ignored;
  std::optional<SavedModel> saved;
  if (wants_voxels && std::filesystem::exists(options.input_path + "/model.llm", ignored)) {
    saved = load_model_file(options.input_path);
    options.voxels = voxel_field(*saved);
  }
  return render::run_render(options);
}

}  // namespace

void add_render_command(CLI::App* app, CommandRun* run_later) {
  const auto arguments = std::make_shared<RenderArguments>();
  render::RenderOptions& options = arguments->options;
  render::PictureOptions& picture = options.picture;
  CLI::App* const command = app->add_subcommand("render", "Draw pictures of a map, as PNG");
  command
      ->add_option(
          "map", options.input_path,
          "Folder of `map`, `receive` or `replay`, a log, a store (FILE.lls, FILE.lls#N), or one\n"
          "raster that GDAL reads")
      ->type_name("PATH")
      ->required();
  command
      ->add_option("--out", options.out_path,
                   "PNG file (- is standard output); without --view a folder")
      ->type_name("PATH")
      ->required();
  command
      ->add_option("--view", arguments->view_name,
                   "depth, oblique, uncertainty, difference, slice or histogram "
                   "(default: every picture that the input allows)")
      ->type_name("NAME");
  command
      ->add_option("--reference", options.reference_path, "difference: the true elevation raster")
      ->type_name("FILE");
  command
      ->add_option("--mask", options.mask_path, "difference: raster that is 1 where a cell counts")
      ->type_name("FILE");
  command
      ->add_option("--axis", arguments->axis_name,
                   "slice: plane across north, east or down (default: north)")
      ->type_name("NAME");
  command
      ->add_option("--at", options.slice_at_m,
                   "slice: where along the axis, metres (default: the middle)")
      ->type_name("M");

  const std::string looks = "Looks";
  command->add_option("--title", picture.title, "Title of the picture")
      ->type_name("TEXT")
      ->group(looks);
  command->add_option("--width", picture.width_px, "Width in pixels, 320 to 8000")
      ->type_name("PX")
      ->group(looks);
  command->add_option("--low", picture.low_m, "Lower end of the colour bar, metres")
      ->type_name("M")
      ->group(looks);
  command->add_option("--high", picture.high_m, "Upper end of the colour bar, metres")
      ->type_name("M")
      ->group(looks);
  command
      ->add_option("--contours", picture.contour_interval_m, "Metres between contours, 0 for none")
      ->type_name("M")
      ->group(looks);
  command->add_flag("--no-relief", arguments->no_relief, "Leave the shading out")->group(looks);
  command
      ->add_option("--sun-azimuth", picture.sun_azimuth_deg, "Where the light comes from, degrees")
      ->type_name("DEG")
      ->group(looks);
  command
      ->add_option("--exaggeration", picture.exaggeration,
                   "Heights times this, for shading and shape")
      ->type_name("FACTOR")
      ->group(looks);
  command
      ->add_option("--view-azimuth", picture.view_azimuth_deg,
                   "oblique: where the viewer stands, degrees")
      ->type_name("DEG")
      ->group(looks);
  command
      ->add_option("--view-elevation", picture.view_elevation_deg,
                   "oblique: how high, 10 to 80 degrees")
      ->type_name("DEG")
      ->group(looks);
  command
      ->add_option("--median", picture.median_radius_cells,
                   "Median filter for display, radius in cells")
      ->type_name("CELLS")
      ->group(looks);
  command
      ->add_option("--dilate", picture.dilation_passes,
                   "Passes that fill gaps from their edges, for display")
      ->type_name("N")
      ->group(looks);
  command->footer(
      "Median and dilation change the picture only, and the picture says so.\n\n"
      "Examples:\n"
      "  leadline render map --out pictures\n"
      "  leadline render map --view depth --contours 5 --out depth.png\n"
      "  leadline render map --view slice --axis north --at 64 --out slice.png\n"
      "  leadline render map --view difference --reference truth.asc --out difference.png");
  command->callback([arguments, command, run_later] {
    *run_later = [arguments, command] { return run(*arguments, *command); };
  });
}

}  // namespace leadline::host
