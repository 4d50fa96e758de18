#include "host_tools/render/render.hpp"

#include <array>
#include <cmath>
#include <filesystem>
#include <utility>

#include "host_tools/compare.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/export/map_source.hpp"
#include "host_tools/geotiff.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/progress.hpp"

namespace leadline::host::render {
namespace {

constexpr std::array<std::pair<View, const char*>, 6> kViews = {
    {{View::kDepth, "depth"},
     {View::kOblique, "oblique"},
     {View::kUncertainty, "uncertainty"},
     {View::kDifference, "difference"},
     {View::kSlice, "slice"},
     {View::kHistogram, "histogram"}}};

bool is_folder(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_directory(path, ignored);
}

enum class Layer : std::uint8_t { kElevation, kSigma };

/// One raster of the input: a file of a result folder, a layer of a log's or a store's map, or the input
/// itself.
Raster read_input(const std::string& path, Layer layer) {
  if (is_folder(path)) {
    return read_raster(path + (layer == Layer::kSigma ? "/sigma.asc" : "/depth.asc"));
  }
  if (is_log_or_store(path)) {
    MapSource source = load_map_source(path);
    return layer == Layer::kSigma ? std::move(*source.sigma) : std::move(source.elevation);
  }
  return read_raster(path);
}

int slice_index(const RenderOptions& options, const VoxelField& voxels) {
  const auto axis = static_cast<std::size_t>(options.slice_axis);
  if (!options.slice_at_m.has_value()) {
    return voxels.size[axis] / 2;
  }
  const double index = std::floor((*options.slice_at_m - voxels.origin_m[axis]) / voxels.cell_m);
  if (!(index >= 0.0 && index < voxels.size[axis])) {
    throw HostError(ExitCode::kUsage,
                    "--at " + std::to_string(*options.slice_at_m) + ": the voxels reach from " +
                        std::to_string(voxels.origin_m[axis]) + " to " +
                        std::to_string(voxels.origin_m[axis] + voxels.size[axis] * voxels.cell_m) +
                        " m on that axis");
  }
  return static_cast<int>(index);
}

std::string picture(const RenderOptions& options, View view) {
  switch (view) {
    case View::kDepth:
      return depth_png(read_input(options.input_path, Layer::kElevation), options.picture);
    case View::kOblique:
      return oblique_png(read_input(options.input_path, Layer::kElevation), options.picture);
    case View::kUncertainty:
      return uncertainty_png(read_input(options.input_path, Layer::kSigma), options.picture);
    case View::kDifference: {
      if (options.reference_path.empty()) {
        throw HostError(ExitCode::kUsage, "the difference picture needs --reference FILE");
      }
      const Raster reference = read_raster(options.reference_path);
      std::optional<Raster> mask;
      if (!options.mask_path.empty()) {
        mask = read_raster(options.mask_path);
      }
      return difference_png(depth_difference(read_input(options.input_path, Layer::kElevation),
                                             reference, mask.has_value() ? &*mask : nullptr),
                            options.picture);
    }
    case View::kSlice:
    case View::kHistogram:
      break;
  }
  if (!options.voxels.has_value()) {
    throw HostError(ExitCode::kUsage,
                    std::string("the ") + view_name(view) +
                        " picture needs a result folder of `leadline map` with its "
                        "saved model");
  }
  const VoxelField& voxels = *options.voxels;
  if (view == View::kHistogram) {
    return histogram_png(voxels, options.picture);
  }
  std::optional<Raster> elevation;
  std::error_code ignored;
  if (is_folder(options.input_path) &&
      std::filesystem::exists(options.input_path + "/depth.asc", ignored)) {
    elevation = read_raster(options.input_path + "/depth.asc");
  }
  return slice_png(voxels, options.slice_axis, slice_index(options, voxels),
                   elevation.has_value() ? &*elevation : nullptr, options.picture);
}

/// Every picture that the input allows, into a folder.
void draw_all(const RenderOptions& given) {
  RenderOptions options = given;
  options.picture.title.clear();
  options.picture.low_m.reset();
  options.picture.high_m.reset();
  OutputDir out(options.out_path);
  Progress progress("drawing", 8);
  std::uint64_t drawn = 0;
  const auto draw = [&](const std::string& name, View view) {
    out.write(name + ".png", picture(options, view));
    progress.update_now(++drawn);
  };
  draw("depth", View::kDepth);
  draw("oblique", View::kOblique);
  std::error_code ignored;
  if (std::filesystem::exists(options.input_path + "/sigma.asc", ignored) ||
      is_log_or_store(options.input_path)) {
    draw("uncertainty", View::kUncertainty);
  }
  if (!options.reference_path.empty()) {
    draw("difference", View::kDifference);
  }
  if (options.voxels.has_value()) {
    for (const auto& [axis, name] :
         {std::pair{VoxelAxis::kNorth, "slice_north"}, std::pair{VoxelAxis::kEast, "slice_east"},
          std::pair{VoxelAxis::kDown, "slice_down"}}) {
      const bool chosen = axis == given.slice_axis;
      options.slice_axis = axis;
      options.slice_at_m = chosen ? given.slice_at_m : std::nullopt;
      draw(name, View::kSlice);
    }
    draw("histogram", View::kHistogram);
  }
  out.commit();
}

}  // namespace

const char* view_name(View view) {
  for (const auto& [known, name] : kViews) {
    if (view == known) {
      return name;
    }
  }
  return "unknown";
}

int run_render(const RenderOptions& options) {
  if (options.view.has_value()) {
    write_file_whole(options.out_path, picture(options, *options.view));
  } else {
    draw_all(options);
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host::render
