// Depth, uncertainty and difference: pictures seen from above.
#include <algorithm>
#include <cmath>

#include "host_tools/render/contour.hpp"
#include "host_tools/render/figure.hpp"
#include "host_tools/render/surface.hpp"

namespace leadline::host::render {
namespace {

constexpr double kPi = 3.14159265358979323846;
/// Every fifth contour is an index contour: heavier, and labelled.
constexpr int kIndexEvery = 5;
/// Contours that a picture should have, and the number from which they would be one black mass.
constexpr int kContours = 20;
constexpr double kMostContours = 500.0;

bool is_index(double level, double interval) {
  return std::llround(level / interval) % kIndexEvery == 0;
}

/// Where a label may stand on a contour: the straightest stretch of its width.
struct LabelPlace {
  double x, y, angle_rad;
  double bend;  ///< largest deviation from the chord, pixels
};

/// Places for one contour, in pixels of the page; best first.
std::vector<LabelPlace> label_places(const std::vector<std::pair<double, double>>& line,
                                     bool closed, double width) {
  std::vector<LabelPlace> places;
  std::vector<double> along = {0.0};
  for (std::size_t i = 1; i < line.size(); ++i) {
    along.push_back(along.back() + std::hypot(line[i].first - line[i - 1].first,
                                              line[i].second - line[i - 1].second));
  }
  if (along.back() < width * (closed ? 4.0 : 3.0)) {
    return places;
  }
  std::size_t end = 0;
  for (std::size_t begin = 0; begin < line.size(); ++begin) {
    while (end < line.size() && along[end] - along[begin] < width) {
      ++end;
    }
    if (end >= line.size()) {
      break;
    }
    const auto [x1, y1] = line[begin];
    const auto [x2, y2] = line[end];
    const double chord = std::hypot(x2 - x1, y2 - y1);
    if (chord < 0.8 * width) {
      continue;
    }
    double bend = 0.0;
    for (std::size_t i = begin + 1; i < end; ++i) {
      bend = std::max(
          bend,
          std::fabs((line[i].first - x1) * (y2 - y1) - (line[i].second - y1) * (x2 - x1)) / chord);
    }
    double angle = std::atan2(y2 - y1, x2 - x1);
    if (angle > 0.5 * kPi) {
      angle -= kPi;
    }
    if (angle <= -0.5 * kPi) {
      angle += kPi;
    }
    const std::size_t middle = (begin + end) / 2;
    places.push_back({line[middle].first, line[middle].second, angle, bend});
  }
  std::stable_sort(places.begin(), places.end(), [](const LabelPlace& a, const LabelPlace& b) {
    // Upright labels read better than steep ones: a quarter turn costs as much as a third of a letter.
    return a.bend + 3.0 * std::fabs(a.angle_rad) < b.bend + 3.0 * std::fabs(b.angle_rad);
  });
  return places;
}

/// Contours of depth with labels, drawn into the frame.
void draw_contours(Canvas* canvas, const Layout& layout, const Raster& depth, double interval_m,
                   const Painting& painting) {
  // Fine enough for smooth curves, no finer: a sample every three pixels.
  const int columns =
      std::max(2, static_cast<int>(layout.frame.width / (3.0 * std::max(1.0, layout.scale))));
  const int rows =
      std::max(2, static_cast<int>(layout.frame.height / (3.0 * std::max(1.0, layout.scale))));
  const std::vector<Contour> lines =
      contours(sample_surface(depth, columns, rows), interval_m,
               std::min(painting.low, painting.high), std::max(painting.low, painting.high));
  cairo_t* cairo = canvas->cairo();
  const double s = layout.scale;
  const double size = 17.0 * s;

  struct Label {
    std::string text;
    LabelPlace place;
    bool on_dark;
  };
  std::vector<Label> labels;
  cairo_save(cairo);
  cairo_rectangle(cairo, layout.frame.x, layout.frame.y, layout.frame.width, layout.frame.height);
  cairo_clip(cairo);
  cairo_set_line_join(cairo, CAIRO_LINE_JOIN_ROUND);
  const int decimals = make_ticks(0.0, interval_m * kIndexEvery, kIndexEvery).decimals;
  for (const Contour& contour : lines) {
    std::vector<std::pair<double, double>> line;
    line.reserve(contour.points.size() + 1);
    double length = 0.0;
    for (const PointOnLattice& point : contour.points) {
      line.emplace_back(layout.frame.x + (point.column + 0.5) * layout.frame.width / columns,
                        layout.frame.y + (point.row + 0.5) * layout.frame.height / rows);
      if (line.size() > 1) {
        length += std::hypot(line.back().first - line[line.size() - 2].first,
                             line.back().second - line[line.size() - 2].second);
      }
    }
    if (length < 36.0 * s) {
      continue;  // a speck, not a contour
    }
    cairo_new_path(cairo);
    for (const auto& [x, y] : line) {
      cairo_line_to(cairo, x, y);
    }
    if (contour.closed) {
      cairo_close_path(cairo);
      line.push_back(line.front());
    }
    const Colour ground =
        painting.map->at((contour.level - painting.low) / (painting.high - painting.low));
    const bool on_dark = to_oklab(ground).lightness < 0.56;
    const bool index = is_index(contour.level, interval_m);
    const Colour ink = on_dark ? Colour{1.0, 1.0, 1.0} : Colour{0.05, 0.10, 0.16};
    canvas->set_colour(ink, index ? 0.72 : 0.34);
    cairo_set_line_width(cairo, (index ? 1.9 : 1.1) * s);
    cairo_stroke(cairo);
    if (!index) {
      continue;
    }
    const std::string text = tick_label(contour.level, decimals);
    const double width = canvas->text_width(text, size);
    for (const LabelPlace& place : label_places(line, contour.closed, 1.25 * width)) {
      if (place.bend > 0.30 * size) {
        continue;
      }
      const double margin = 0.7 * width + 4.0 * s;
      const bool inside =
          place.x > layout.frame.x + margin && place.x < layout.frame.right() - margin &&
          place.y > layout.frame.y + margin && place.y < layout.frame.bottom() - margin;
      const bool free = std::none_of(labels.begin(), labels.end(), [&](const Label& other) {
        // Labels of one depth keep more distance than those of different depths.
        const double apart = other.text == text ? 420.0 * s : 3.2 * size;
        return std::hypot(other.place.x - place.x, other.place.y - place.y) < apart;
      });
      if (inside && free) {
        labels.push_back({text, place, on_dark});
      }
    }
  }
  for (const Label& label : labels) {
    const Colour dark = {0.05, 0.09, 0.14};
    const Colour bright = {1.0, 1.0, 1.0};
    canvas->haloed_text(label.text, label.place.x, label.place.y, size, label.place.angle_rad,
                        label.on_dark ? bright : dark,
                        label.on_dark ? Colour{0.12, 0.16, 0.32} : bright);
  }
  cairo_restore(cairo);
}

/// Light and shade per pixel of the frame.
std::vector<float> light_of(const Raster& elevation, const Layout& layout, double exaggeration,
                            double sun_azimuth_deg) {
  const int columns = static_cast<int>(layout.frame.width);
  const int rows = static_cast<int>(layout.frame.height);
  const Lattice height = sample_surface(elevation, columns, rows);
  std::vector<float> light = relief_light(height, height.step_cells * elevation.cell_m,
                                          exaggeration, {sun_azimuth_deg, 45.0});
  const Raster sky = sky_share(elevation, exaggeration, 40);
  const SmoothSurface smooth_sky(sky);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double share = smooth_sky.at((column + 0.5) * elevation.columns / columns,
                                         (row + 0.5) * elevation.rows / rows);
      float& value = light[height.index(row, column)];
      value *= static_cast<float>(0.45 + 0.55 * share);
      // Keep the light's spread moderate: the colour must still tell the depth.
      value = std::pow(value, 0.85F);
    }
  }
  return light;
}

}  // namespace

std::string depth_png(const Raster& elevation_as_given, const PictureOptions& options) {
  check_options(options);
  const Raster elevation = filtered(elevation_as_given, options);
  const Layout layout = lay_out(options.width_px, elevation.columns, elevation.rows);
  Canvas canvas(layout.width_px, layout.height_px);
  std::string subtitle = raster_caption(elevation, options);
  if (elevation.known_count() == 0) {
    draw_nothing_known(&canvas, layout);
    draw_map_furniture(&canvas, layout, elevation);
    draw_titles(&canvas, layout, options.title.empty() ? "Depth" : options.title, subtitle);
    return canvas.png();
  }
  const DepthScale scale = depth_scale(elevation, options);
  const Painting painting = {&ColourMap::depth(), scale.shallow, scale.deep, true};
  std::vector<float> light;
  double exaggeration = 1.0;
  if (options.shaded_relief) {
    exaggeration = options.exaggeration.value_or(readable_exaggeration(elevation));
    light = light_of(elevation, layout, exaggeration, options.sun_azimuth_deg.value_or(315.0));
  }
  paint_raster(&canvas, layout, scale.shown, painting, options.shaded_relief ? &light : nullptr);
  const double interval_m =
      options.contour_interval_m.value_or(make_ticks(scale.shallow, scale.deep, kContours).step);
  const bool too_many =
      interval_m > 0.0 && std::fabs(scale.deep - scale.shallow) / interval_m > kMostContours;
  if (interval_m > 0.0 && !too_many) {
    draw_contours(&canvas, layout, scale.shown, interval_m, painting);
  }
  draw_map_furniture(&canvas, layout, elevation);
  // Shallow on top, as in the water.
  draw_colour_bar(
      &canvas, layout.bar, scale.deep, scale.shallow, scale.bar_title(),
      [&](double value) { return painting.map->at(scale.position(value)); }, layout.scale);
  const double least = quantile(scale.shown, 0.0);
  const double most = quantile(scale.shown, 1.0);
  subtitle += "  \u00B7  " + figure_text(least, most - least) + " to " +
              figure_text(most, most - least) + (scale.is_depth ? " m deep" : " m high");
  subtitle += known_caption(elevation);
  if (too_many) {
    subtitle += "  \u00B7  contours too dense to draw";
  } else if (interval_m > 0.0) {
    subtitle += "  \u00B7  contours every " + length_label(interval_m);
  }
  if (options.shaded_relief && exaggeration != 1.0) {
    subtitle += "  \u00B7  relief \u00D7" + factor_text(exaggeration);
  }
  draw_titles(&canvas, layout, options.title.empty() ? scale.title() : options.title, subtitle);
  return canvas.png();
}

std::string uncertainty_png(const Raster& sigma_as_given, const PictureOptions& options) {
  check_options(options);
  const Raster sigma = filtered(sigma_as_given, options);
  const Layout layout = lay_out(options.width_px, sigma.columns, sigma.rows);
  Canvas canvas(layout.width_px, layout.height_px);
  const std::string title = options.title.empty() ? "Uncertainty of depth" : options.title;
  std::string subtitle = raster_caption(sigma, options);
  if (sigma.known_count() == 0) {
    draw_nothing_known(&canvas, layout);
  } else {
    // From zero, so that twice the uncertainty looks like it, unless that would leave no contrast.
    PictureOptions range = options;
    if (!range.low_m.has_value() && quantile(sigma, 0.005) < 0.5 * quantile(sigma, 0.995)) {
      range.low_m = 0.0;
    }
    const auto [low_m, high_m] = colour_range(sigma, range);
    paint_raster(&canvas, layout, sigma, {&ColourMap::uncertainty(), low_m, high_m, false},
                 nullptr);
    const double low = low_m;
    const double span = high_m - low_m;
    draw_colour_bar(
        &canvas, layout.bar, low_m, high_m, "Standard deviation (m)",
        [&](double value) { return ColourMap::uncertainty().at((value - low) / span); },
        layout.scale);
    subtitle += "  \u00B7  median " + figure_text(quantile(sigma, 0.5), span) +
                " m, 95 % of cells under " + figure_text(quantile(sigma, 0.95), span) + " m" +
                known_caption(sigma);
  }
  draw_map_furniture(&canvas, layout, sigma);
  draw_titles(&canvas, layout, title, subtitle);
  return canvas.png();
}

std::string difference_png(const Raster& difference_as_given, const PictureOptions& options) {
  check_options(options);
  const Raster difference = filtered(difference_as_given, options);
  const Layout layout = lay_out(options.width_px, difference.columns, difference.rows);
  Canvas canvas(layout.width_px, layout.height_px);
  const std::string title = options.title.empty() ? "Difference of depth" : options.title;
  std::string subtitle = raster_caption(difference, options);
  if (difference.known_count() == 0) {
    draw_nothing_known(&canvas, layout);
  } else {
    double sum = 0.0;
    double sum2 = 0.0;
    for (const double value : difference.values) {
      if (!std::isnan(value)) {
        sum += value;
        sum2 += value * value;
      }
    }
    const auto count = static_cast<double>(difference.known_count());
    const double rms = std::sqrt(sum2 / count);
    // The 98th percentile of the magnitude: a few wild cells must not wash out all others.
    Raster magnitude = difference;
    for (double& value : magnitude.values) {
      value = std::fabs(value);
    }
    double limit = options.high_m.value_or(quantile(magnitude, 0.98));
    if (!(limit > 0.0)) {
      limit = 1e-3;
    }
    paint_raster(&canvas, layout, difference, {&ColourMap::diverging(), -limit, limit, false},
                 nullptr);
    draw_colour_bar(
        &canvas, layout.bar, limit, -limit,
        "Deeper (+, blue) or shallower (\u2212, red) than the reference (m)",
        [&](double value) { return ColourMap::diverging().at(0.5 + 0.5 * value / limit); },
        layout.scale);
    const double span = 0.2 * limit;  // three digits
    subtitle += "  \u00B7  rms " + figure_text(rms, span) + " m, mean " +
                figure_text(sum / count, span) + " m, largest " +
                figure_text(quantile(magnitude, 1.0), span) + " m" + known_caption(difference);
  }
  draw_map_furniture(&canvas, layout, difference);
  draw_titles(&canvas, layout, title, subtitle);
  return canvas.png();
}

}  // namespace leadline::host::render
