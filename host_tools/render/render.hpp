// `leadline render`: pictures of a map, as PNG. Depth with shaded relief and labelled contours,
// uncertainty, differences, an oblique view, slices through the voxels and their histogram.
//
// Every picture has axes in metres (north, east; depth downwards), a colour bar with its unit, a
// north arrow and a scale bar where they mean something, a title, and under it what was done to the
// data for display. Cells without a value are hatched. Same input, same bytes (with one version of
// cairo and the fonts).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "host_tools/raster.hpp"

namespace leadline::host::render {

struct PictureOptions {
  std::string title;    ///< "" = the picture's own
  int width_px = 1600;  ///< 320 .. 8000; the height follows from the data
  /// Ends of the colour bar in metres: depth (positive down), sigma or |difference|. Unset: from the
  /// data, without the outermost 0.5 % at each end.
  std::optional<double> low_m;
  std::optional<double> high_m;
  /// Depth picture: distance of contours in metres, 0 for none. Unset: a round step, about twelve.
  std::optional<double> contour_interval_m;
  bool shaded_relief = true;
  /// Where the light comes from, clockwise from north. Unset: 315 on maps, from the viewer's left in
  /// the oblique view.
  std::optional<double> sun_azimuth_deg;
  /// Heights times this for shading (and, in the oblique view, for shape). Unset: chosen so that the
  /// relief can be seen; the subtitle states it.
  std::optional<double> exaggeration;
  int median_radius_cells = 0;  ///< median filter for display, 0 .. 10
  int dilation_passes = 0;      ///< gaps filled from their edges for display, 0 .. 100
  /// Oblique view: where the viewer stands, clockwise from north, and how high above the horizon.
  double view_azimuth_deg = 200.0;
  double view_elevation_deg = 34.0;  ///< 10 .. 80
};

/// Elevation raster (metres up) as a depth map. With no known cell the picture says so. All the
/// following throw HostError kUsage for options outside their range, kOutput when cairo fails, and
/// return the file's bytes.
[[nodiscard]] std::string depth_png(const Raster& elevation, const PictureOptions& options);
/// One standard deviation, metres.
[[nodiscard]] std::string uncertainty_png(const Raster& sigma, const PictureOptions& options);
/// Signed difference of depths, metres, deeper positive; the colour bar is symmetric about zero.
[[nodiscard]] std::string difference_png(const Raster& difference, const PictureOptions& options);
/// The seafloor as a solid, seen from the side.
[[nodiscard]] std::string oblique_png(const Raster& elevation, const PictureOptions& options);

/// Axes of a voxel grid, in the order of size[] and origin_m[].
enum class VoxelAxis : std::uint8_t { kNorth = 0, kEast = 1, kDown = 2 };

/// A voxel model as the pictures see it.
struct VoxelField {
  int size[3] = {0, 0, 0};  ///< cells north, east, down
  double cell_m = 1.0;
  double origin_m[3] = {0, 0, 0};  ///< lowest corner: north, east, down
  /// Probability (0 empty .. 1 occupied) of voxel (north, east, down), each inside size; NaN = never
  /// observed.
  std::function<double(int, int, int)> probability;
};

/// Probability in the plane of voxels with index `index` along `axis` (HostError kUsage when outside).
/// A vertical slice has depth downwards and, unless `elevation` is null, the map's surface as a line:
/// a raster of the same columns.
[[nodiscard]] std::string slice_png(const VoxelField& voxels, VoxelAxis axis, int index,
                                    const Raster* elevation, const PictureOptions& options);
/// How many voxels hold which probability (logarithmic), known voxels only; the subtitle counts the
/// unknown ones.
[[nodiscard]] std::string histogram_png(const VoxelField& voxels, const PictureOptions& options);

enum class View : std::uint8_t { kDepth, kOblique, kUncertainty, kDifference, kSlice, kHistogram };

/// "depth", "oblique", "uncertainty", "difference", "slice", "histogram".
[[nodiscard]] const char* view_name(View view);

struct RenderOptions {
  /// Unset: every picture that the input allows, into the folder out_path, as depth.png, oblique.png,
  /// uncertainty.png, slice_north.png, slice_east.png, slice_down.png, histogram.png and (with a
  /// reference) difference.png.
  std::optional<View> view;
  /// Result folder of `leadline map` (depth.asc, sigma.asc), a vehicle's log, a survey of a store, or one
  /// raster (ESRI ASCII or anything GDAL reads): elevation, or sigma for kUncertainty.
  std::string input_path;
  std::string reference_path;  ///< kDifference: elevation raster that counts as the truth
  std::string mask_path;       ///< kDifference: cells that count hold 1; "" = all
  std::string out_path;        ///< PNG file ("-" = standard output), or the folder (no view)
  VoxelAxis slice_axis = VoxelAxis::kNorth;
  /// kSlice: where along the axis, metres in the map's frame; unset = the middle of the grid.
  std::optional<double> slice_at_m;
  /// kSlice, kHistogram: the saved model, loaded by the caller.
  std::optional<VoxelField> voxels;
  /// Without a view, its title, low_m and high_m are left out: they cannot fit all pictures.
  PictureOptions picture;
};

/// The command; returns 0. Throws HostError: kUsage (options that do not fit the view), kInput, kOutput.
int run_render(const RenderOptions& options);

}  // namespace leadline::host::render
