// Pictures of the voxels themselves: slices and the histogram of their probabilities.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "host_tools/exit_codes.hpp"
#include "host_tools/render/figure.hpp"

namespace leadline::host::render {
namespace {

/// Water is blue, what is undecided pale, what is there brown.
Colour colour_of_probability(double probability) {
  return ColourMap::diverging().at(1.0 - probability);
}

void check_voxels(const VoxelField& voxels) {
  if (voxels.size[0] < 1 || voxels.size[1] < 1 || voxels.size[2] < 1 || !(voxels.cell_m > 0.0) ||
      !voxels.probability) {
    throw HostError(ExitCode::kUsage, "no voxels to draw: give a result folder of `leadline map`");
  }
}

/// The map's surface where a vertical slice cuts it, as a line over the cells of the slice; broken at
/// columns without a depth.
void draw_surface_line(Canvas* canvas, const Layout& layout, const std::vector<double>& depth_m,
                       double top_depth_m, double bottom_depth_m) {
  cairo_t* cairo = canvas->cairo();
  const double step = layout.frame.width / static_cast<double>(depth_m.size());
  cairo_save(cairo);
  cairo_rectangle(cairo, layout.frame.x, layout.frame.y, layout.frame.width, layout.frame.height);
  cairo_clip(cairo);
  cairo_set_line_join(cairo, CAIRO_LINE_JOIN_ROUND);
  cairo_set_line_cap(cairo, CAIRO_LINE_CAP_ROUND);
  for (const bool halo : {true, false}) {
    cairo_new_path(cairo);
    bool pen_down = false;
    for (std::size_t i = 0; i < depth_m.size(); ++i) {
      if (std::isnan(depth_m[i])) {
        pen_down = false;
        continue;
      }
      const double x = layout.frame.x + (static_cast<double>(i) + 0.5) * step;
      const double y = layout.frame.y + layout.frame.height * (depth_m[i] - top_depth_m) /
                                            (bottom_depth_m - top_depth_m);
      if (pen_down) {
        cairo_line_to(cairo, x, y);
      } else {
        cairo_move_to(cairo, x, y);
        cairo_line_to(cairo, x, y);  // a lone column shows as a dot
      }
      pen_down = true;
    }
    if (halo) {
      canvas->set_colour({1.0, 1.0, 1.0}, 0.85);
      cairo_set_line_width(cairo, 5.5 * layout.scale);
    } else {
      canvas->set_colour(kInkColour);
      cairo_set_line_width(cairo, 2.4 * layout.scale);
    }
    cairo_stroke(cairo);
  }
  cairo_restore(cairo);
}

}  // namespace

std::string slice_png(const VoxelField& voxels, VoxelAxis axis, int index, const Raster* elevation,
                      const PictureOptions& options) {
  check_options(options);
  check_voxels(voxels);
  const auto fixed = static_cast<std::size_t>(axis);
  if (index < 0 || index >= voxels.size[fixed]) {
    throw HostError(ExitCode::kUsage, "slice " + std::to_string(index) + " is outside 0 .. " +
                                          std::to_string(voxels.size[fixed] - 1));
  }
  // x runs east, or north in a slice that is fixed in east; y runs down, or north in a level slice.
  const std::size_t across = axis == VoxelAxis::kEast ? 0 : 1;
  const std::size_t up = axis == VoxelAxis::kDown ? 0 : 2;
  Raster slice = make_raster(voxels.size[across], voxels.size[up], voxels.origin_m[across],
                             voxels.origin_m[up], voxels.cell_m);
  for (int row = 0; row < slice.rows; ++row) {
    for (int column = 0; column < slice.columns; ++column) {
      std::array<int, 3> at = {0, 0, 0};
      at[fixed] = index;
      at[across] = column;
      // Rows run from the top: north first, or the shallowest first.
      at[up] = axis == VoxelAxis::kDown ? slice.rows - 1 - row : row;
      slice.at(row, column) = voxels.probability(at[0], at[1], at[2]);
    }
  }
  const Layout layout = lay_out(options.width_px, slice.columns, slice.rows);
  Canvas canvas(layout.width_px, layout.height_px);
  // The diverging map's blue end is 1: probability 0 sits there.
  paint_raster(&canvas, layout, slice, {&ColourMap::diverging(), 1.0, 0.0, false}, nullptr);

  static constexpr const char* kAxisNames[3] = {"North (m)", "East (m)", "Depth (m)"};
  const double low = voxels.origin_m[up];
  const double high = low + slice.rows * voxels.cell_m;
  std::string subtitle;
  bool has_line = false;
  if (axis == VoxelAxis::kDown) {
    draw_map_furniture(&canvas, layout, slice);
  } else {
    if (elevation != nullptr && elevation->columns == voxels.size[1] &&
        elevation->rows == voxels.size[0]) {
      std::vector<double> depth_m;
      for (int i = 0; i < slice.columns; ++i) {
        const int north = axis == VoxelAxis::kNorth ? index : i;
        const int east = axis == VoxelAxis::kNorth ? i : index;
        depth_m.push_back(-elevation->at(elevation->rows - 1 - north, east));
      }
      draw_surface_line(&canvas, layout, depth_m, low, high);
      has_line = true;
    }
    draw_axes(&canvas, layout.frame, {slice.west_m, slice.east_m(), kAxisNames[across]},
              {high, low, kAxisNames[2]}, layout.scale);
    draw_scale_bar(&canvas, layout.frame.right(), layout.frame.bottom() + 72.0 * layout.scale,
                   0.22 * layout.frame.width, layout.frame.width / (slice.east_m() - slice.west_m),
                   layout.scale);
  }
  Rectangle bar = layout.bar;
  if (axis != VoxelAxis::kDown) {  // no north arrow above it
    bar.height += bar.y - layout.frame.y;
    bar.y = layout.frame.y;
  }
  draw_colour_bar(&canvas, bar, 0.0, 1.0, "Probability", colour_of_probability, layout.scale);
  static constexpr const char* kPlaces[3] = {"north", "east", "depth"};
  const double at_m = voxels.origin_m[fixed] + (index + 0.5) * voxels.cell_m;
  const double unknown_share =
      1.0 - static_cast<double>(slice.known_count()) / static_cast<double>(slice.values.size());
  subtitle = raster_caption(slice, PictureOptions()) + "  \u00B7  " +
             figure_text(100.0 * unknown_share, 100.0) + " % unknown (hatched)";
  if (has_line) {
    subtitle += "  \u00B7  line: extracted depth";
  }
  const std::string title = "Voxels at " + std::string(kPlaces[fixed]) + " " +
                            figure_text(at_m, 100.0 * voxels.cell_m) + " m";
  draw_titles(&canvas, layout, options.title.empty() ? title : options.title, subtitle);
  return canvas.png();
}

std::string histogram_png(const VoxelField& voxels, const PictureOptions& options) {
  check_options(options);
  check_voxels(voxels);
  constexpr int kBins = 50;
  std::array<double, kBins> count = {};
  double known = 0.0;
  double entropy_bits = 0.0;
  for (int n = 0; n < voxels.size[0]; ++n) {
    for (int e = 0; e < voxels.size[1]; ++e) {
      for (int d = 0; d < voxels.size[2]; ++d) {
        const double p = voxels.probability(n, e, d);
        if (std::isnan(p)) {
          continue;
        }
        const int bin = std::clamp(static_cast<int>(p * kBins), 0, kBins - 1);
        count[static_cast<std::size_t>(bin)] += 1.0;
        known += 1.0;
        for (const double q : {p, 1.0 - p}) {
          entropy_bits -= q > 0.0 ? q * std::log2(q) : 0.0;
        }
      }
    }
  }
  const double total = static_cast<double>(voxels.size[0]) * voxels.size[1] * voxels.size[2];

  Layout layout;
  layout.width_px = options.width_px;
  layout.scale = options.width_px / 1600.0;
  const double s = layout.scale;
  layout.height_px = static_cast<int>(std::lround(900.0 * s));
  layout.frame = {std::round(150.0 * s), std::round(125.0 * s), std::round(1390.0 * s),
                  std::round(645.0 * s)};
  Canvas canvas(layout.width_px, layout.height_px);
  const Rectangle& frame = layout.frame;
  const double largest = *std::max_element(count.begin(), count.end());
  const double decades = std::max(1.0, std::ceil(std::log10(std::max(1.0, largest)) + 0.05));
  // One voxel is a bar of visible height: the axis starts at 0.5.
  const double bottom = std::log10(0.5);
  const auto y_of = [&](double value) {
    return frame.bottom() - frame.height * (std::log10(value) - bottom) / (decades - bottom);
  };
  canvas.set_colour({0.86, 0.87, 0.88});
  for (double decade = 0.0; decade <= decades; decade += 1.0) {
    const double y = y_of(std::pow(10.0, decade));
    canvas.line(frame.x, y, frame.right(), y, 1.2 * s);
  }
  const double width = frame.width / kBins;
  for (int bin = 0; bin < kBins; ++bin) {
    const double value = count[static_cast<std::size_t>(bin)];
    if (value <= 0.0) {
      continue;
    }
    const Rectangle bar = {frame.x + bin * width + 0.07 * width, y_of(value), 0.86 * width,
                           frame.bottom() - y_of(value)};
    canvas.set_colour(colour_of_probability((bin + 0.5) / kBins));
    canvas.fill_rectangle(bar);
    canvas.set_colour(kInkColour, 0.45);
    canvas.stroke_rectangle(bar, 0.9 * s);
  }
  canvas.set_colour(kInkColour);
  canvas.stroke_rectangle(frame, 1.4 * s);
  const double size = 19.0 * s;
  for (double decade = 0.0; decade <= decades; decade += 1.0) {
    const double value = std::pow(10.0, decade);
    canvas.text(tick_label(value, 0), frame.x - 12.0 * s, y_of(value) + 0.36 * size, size,
                Align::kRight);
  }
  for (int tick = 0; tick <= 10; ++tick) {
    const double x = frame.x + frame.width * tick / 10.0;
    canvas.line(x, frame.bottom(), x, frame.bottom() + 8.0 * s, 1.4 * s);
    canvas.text(tick_label(tick / 10.0, 1), x, frame.bottom() + 8.0 * s + 1.15 * size, size,
                Align::kCentre);
  }
  const double title_size = 21.0 * s;
  canvas.text("Probability that the voxel is occupied", frame.x + 0.5 * frame.width,
              frame.bottom() + 8.0 * s + 1.3 * size + 1.5 * title_size, title_size, Align::kCentre);
  canvas.turned_text("Voxels", 34.0 * s, frame.y + 0.5 * frame.height, title_size,
                     -1.5707963267948966);
  canvas.set_colour(kSoftInkColour);
  canvas.text("empty", frame.x + 12.0 * s, frame.y + 30.0 * s, size);
  canvas.text("occupied", frame.right() - 12.0 * s, frame.y + 30.0 * s, size, Align::kRight);
  std::string subtitle = tick_label(known, 0) + " of " + tick_label(total, 0) + " voxels known (" +
                         figure_text(100.0 * known / total, 100.0) + " %)";
  if (known > 0.0) {
    subtitle += "  \u00B7  mean entropy " + figure_text(entropy_bits / known, 1.0) +
                " bits per known voxel";
  }
  draw_titles(&canvas, layout,
              options.title.empty() ? "Histogram of voxel probability" : options.title, subtitle);
  return canvas.png();
}

}  // namespace leadline::host::render
