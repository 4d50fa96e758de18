#include "host_tools/render/figure.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "host_tools/options.hpp"
#include "host_tools/render/surface.hpp"

namespace leadline::host::render {
Layout lay_out(int page_width_px, double map_width, double map_height) {
  Layout layout;
  layout.width_px = page_width_px;
  layout.scale = page_width_px / 1600.0;
  const double s = layout.scale;
  const double left = 150.0 * s;
  const double right = 245.0 * s;
  const double top = 125.0 * s;
  const double bottom = 130.0 * s;
  // A tall map gets a narrower frame, a very wide one keeps room for the bar's labels.
  const double room = page_width_px - left - right;
  const double ratio = std::clamp(map_height / map_width, 0.02, 50.0);
  const double tallest = 1.25 * room;
  double width = room;
  double height = room * ratio;
  if (height > tallest) {
    height = tallest;
    width = height / ratio;
  }
  width = std::max(width, 40.0 * s);
  height = std::max(height, 40.0 * s);
  layout.frame = {std::round(left + 0.5 * (room - width)), std::round(top), std::round(width),
                  std::round(height)};
  const double page = std::max(height, 330.0 * s) + top + bottom;
  layout.height_px = static_cast<int>(std::lround(page));
  // The north arrow stands above the bar.
  const double bar_top = layout.frame.y + 130.0 * s;
  const double bar_height = std::max(layout.frame.height, 330.0 * s) - 130.0 * s;
  layout.bar = {std::round(layout.frame.right() + 42.0 * s), std::round(bar_top),
                std::round(34.0 * s), std::round(bar_height)};
  return layout;
}

void check_options(const PictureOptions& options) {
  check_limits("--width", options.width_px, {320, 8000});
  if (options.sun_azimuth_deg.has_value()) {
    check_limits("--sun-azimuth", *options.sun_azimuth_deg, {-360, 360});
  }
  check_limits("--median", options.median_radius_cells, {0, 10});
  check_limits("--dilate", options.dilation_passes, {0, 100});
  check_limits("--view-azimuth", options.view_azimuth_deg, {-360, 360});
  check_limits("--view-elevation", options.view_elevation_deg, {10, 80});
  if (options.exaggeration.has_value()) {
    check_limits("--exaggeration", *options.exaggeration, {0.01, 1000});
  }
  if (options.contour_interval_m.has_value()) {
    check_limits("--contours", *options.contour_interval_m, {0, 1e6});
  }
  for (const auto& [name, value] :
       {std::pair{"--low", options.low_m}, std::pair{"--high", options.high_m}}) {
    if (value.has_value()) {
      check_limits(name, *value, {-1e6, 1e6});
    }
  }
  if (options.low_m.has_value() && options.high_m.has_value() &&
      !(*options.low_m < *options.high_m)) {
    usage_error("--low has to be under --high");
  }
}

Raster filtered(const Raster& raster, const PictureOptions& options) {
  return display_dilation(display_median(raster, options.median_radius_cells),
                          options.dilation_passes);
}

double quantile(const Raster& raster, double share) {
  std::vector<double> known;
  known.reserve(raster.values.size());
  for (const double value : raster.values) {
    if (!std::isnan(value)) {
      known.push_back(value);
    }
  }
  if (known.empty()) {
    return kNoValue;
  }
  const auto rank =
      static_cast<std::ptrdiff_t>(share * static_cast<double>(known.size() - 1) + 0.5);
  std::nth_element(known.begin(), known.begin() + rank, known.end());
  return known[static_cast<std::size_t>(rank)];
}

std::string figure_text(double value, double span) {
  const double step = span > 0.0 && std::isfinite(span) ? span / 200.0 : 1e-3;
  const int decimals = std::clamp(-static_cast<int>(std::floor(std::log10(step))), 0, 6);
  const double rounded = std::round(value * std::pow(10.0, decimals)) == 0.0 ? 0.0 : value;
  return tick_label(rounded, decimals);
}

std::string raster_caption(const Raster& raster, const PictureOptions& options) {
  std::string text = std::to_string(raster.columns) + " \u00D7 " + std::to_string(raster.rows) +
                     " cells of " + length_label(raster.cell_m);
  if (options.median_radius_cells > 0) {
    const std::string side = std::to_string(2 * options.median_radius_cells + 1);
    text += "  \u00B7  median " + side + " \u00D7 " + side;
  }
  if (options.dilation_passes > 0) {
    text += "  \u00B7  gaps filled by " + std::to_string(options.dilation_passes) +
            (options.dilation_passes == 1 ? " cell" : " cells");
  }
  return text;
}

std::pair<double, double> colour_range(const Raster& raster, const PictureOptions& options) {
  double low = options.low_m.value_or(quantile(raster, 0.005));
  double high = options.high_m.value_or(quantile(raster, 0.995));
  if (!(high > low)) {
    const double widen = std::max(1e-3, 1e-3 * std::fabs(low));
    if (!options.low_m.has_value()) {
      low = std::min(low, high) - widen;
    }
    if (!(high > low)) {
      high = low + 2.0 * widen;
    }
  }
  return {low, high};
}

DepthScale depth_scale(const Raster& elevation, const PictureOptions& options) {
  DepthScale scale;
  scale.shown = elevation;
  // A bottom that nowhere lies under zero is land, or a height above a chart datum: called so.
  scale.is_depth = !(quantile(elevation, 0.0) >= 0.0) || quantile(elevation, 1.0) <= 0.0;
  if (scale.is_depth) {
    for (double& value : scale.shown.values) {
      value = 0.0 - value;
    }
  }
  const auto [low, high] = colour_range(scale.shown, options);
  scale.shallow = scale.is_depth ? low : high;
  scale.deep = scale.is_depth ? high : low;
  return scale;
}

std::string known_caption(const Raster& raster) {
  const std::size_t known = raster.known_count();
  if (known == raster.values.size()) {
    return "";
  }
  const double percent =
      100.0 * static_cast<double>(known) / static_cast<double>(raster.values.size());
  char text[48];
  // 99.996 must not read as 100.
  std::snprintf(text, sizeof text,
                percent > 99.9 ? "  \u00B7  %.3f %% known" : "  \u00B7  %.1f %% known",
                std::min(percent, 99.999));
  return text;
}

std::string factor_text(double factor) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", factor);
  return text;
}

void paint_raster(Canvas* canvas, const Layout& layout, const Raster& raster,
                  const Painting& painting, const std::vector<float>* light) {
  const int columns = static_cast<int>(layout.frame.width);
  const int rows = static_cast<int>(layout.frame.height);
  canvas->hatch(layout.frame, 14.0 * layout.scale);
  const SmoothSurface surface(raster);
  std::vector<std::uint32_t> pixels(
      static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 0U);
  for (int row = 0; row < rows; ++row) {
    const double y = (row + 0.5) * raster.rows / rows;
    for (int column = 0; column < columns; ++column) {
      const double x = (column + 0.5) * raster.columns / columns;
      const double value = painting.smooth
                               ? surface.at(x, y)
                               : raster.at(std::min(static_cast<int>(y), raster.rows - 1),
                                           std::min(static_cast<int>(x), raster.columns - 1));
      if (std::isnan(value)) {
        continue;
      }
      Colour colour = painting.map->at((value - painting.low) / (painting.high - painting.low));
      const std::size_t index = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                                static_cast<std::size_t>(column);
      if (light != nullptr && !std::isnan((*light)[index])) {
        colour = lit(colour, static_cast<double>((*light)[index]));
      }
      pixels[index] = pixel_of(colour);
    }
  }
  canvas->image(pixels, columns, rows, static_cast<int>(layout.frame.x),
                static_cast<int>(layout.frame.y));
}

void draw_titles(Canvas* canvas, const Layout& layout, const std::string& title,
                 const std::string& subtitle) {
  const double s = layout.scale;
  const double room = layout.width_px - 2.0 * 40.0 * s;
  // Above the frame where both fit there, else from the page's margin.
  const double title_size = 32.0 * s;
  const double subtitle_size = 19.0 * s;
  const double widest = std::max(canvas->text_width(title, title_size, true),
                                 canvas->text_width(subtitle, subtitle_size));
  const double x = layout.frame.x + widest <= 40.0 * s + room ? layout.frame.x : 40.0 * s;
  const double shrink = std::min(1.0, room / std::max(widest, 1.0));
  canvas->set_colour(kInkColour);
  canvas->text(title, x, 52.0 * s, title_size * shrink, Align::kLeft, true);
  canvas->set_colour(kSoftInkColour);
  canvas->text(subtitle, x, 86.0 * s, subtitle_size * shrink);
  canvas->set_colour(kInkColour);
}

void draw_map_furniture(Canvas* canvas, const Layout& layout, const Raster& raster) {
  const double s = layout.scale;
  draw_axes(canvas, layout.frame, {raster.west_m, raster.east_m(), "East (m)"},
            {raster.south_m, raster.north_m(), "North (m)"}, s);
  draw_north_arrow(canvas, layout.bar.x + 0.5 * layout.bar.width + 22.0 * s,
                   layout.frame.y + 48.0 * s, 96.0 * s);
  const double px_per_m = layout.frame.width / (raster.east_m() - raster.west_m);
  draw_scale_bar(canvas, layout.frame.right(), layout.frame.bottom() + 72.0 * s,
                 0.22 * layout.frame.width, px_per_m, s);
}

void draw_nothing_known(Canvas* canvas, const Layout& layout) {
  canvas->hatch(layout.frame, 14.0 * layout.scale);
  canvas->set_colour(kInkColour);
  canvas->text("no cell has a value", layout.frame.x + 0.5 * layout.frame.width,
               layout.frame.y + 0.5 * layout.frame.height, 26.0 * layout.scale, Align::kCentre);
}

}  // namespace leadline::host::render
