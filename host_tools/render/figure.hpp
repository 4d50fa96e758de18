// What the pictures of rasters share: page layout, colour range, captions. Internal to render/.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "host_tools/raster.hpp"
#include "host_tools/render/canvas.hpp"
#include "host_tools/render/render.hpp"

namespace leadline::host::render {

/// Page with a frame for a map of the given proportions.
struct Layout {
  int width_px = 0;
  int height_px = 0;
  double scale = 1.0;  ///< 1 for a page 1600 px wide
  Rectangle frame;     ///< whole pixels
  Rectangle bar;       ///< colour bar
};
[[nodiscard]] Layout lay_out(int page_width_px, double map_width, double map_height);

/// Throws HostError kUsage for a value outside its range.
void check_options(const PictureOptions& options);

/// Filters for display that the options ask for.
[[nodiscard]] Raster filtered(const Raster& raster, const PictureOptions& options);

/// Value that `share` (0 .. 1) of the known cells do not exceed; NaN without a known cell.
[[nodiscard]] double quantile(const Raster& raster, double share);

/// Low and high end of the colours: what the options say, else the data without its outermost 0.5 %;
/// never empty.
[[nodiscard]] std::pair<double, double> colour_range(const Raster& raster,
                                                     const PictureOptions& options);

/// Elevations as the numbers that a reader expects: depths, or elevations where the whole raster is
/// at or above zero.
struct DepthScale {
  Raster shown;  ///< depth (positive down) or elevation
  bool is_depth = true;
  double shallow = 0.0;  ///< shown value of the colour map's pale end
  double deep = 1.0;     ///< of its dark end
  [[nodiscard]] const char* title() const { return is_depth ? "Depth" : "Elevation"; }
  [[nodiscard]] const char* bar_title() const { return is_depth ? "Depth (m)" : "Elevation (m)"; }
  [[nodiscard]] double position(double value) const { return (value - shallow) / (deep - shallow); }
};
[[nodiscard]] DepthScale depth_scale(const Raster& elevation, const PictureOptions& options);

/// "  ·  99.8 % known", nothing when all is.
[[nodiscard]] std::string known_caption(const Raster& raster);
/// "1.5", "20".
[[nodiscard]] std::string factor_text(double factor);

/// "12.3", with as many digits as `span` asks for.
[[nodiscard]] std::string figure_text(double value, double span);
/// "128 x 128 cells of 1 m", "median 3 x 3" and "2 passes of gap filling" where they apply.
[[nodiscard]] std::string raster_caption(const Raster& raster, const PictureOptions& options);

/// Colours of a raster's cells with an optional light per pixel, drawn into the frame; unknown cells
/// are hatched. `position_of` maps a value to the colour map.
struct Painting {
  const ColourMap* map = nullptr;
  double low = 0.0;    ///< value of the colour map's 0
  double high = 1.0;   ///< value of its 1; may be under low
  bool smooth = true;  ///< interpolate between cells (else every cell is a square)
};
void paint_raster(Canvas* canvas, const Layout& layout, const Raster& raster,
                  const Painting& painting, const std::vector<float>* light);

/// Title and, smaller and grey, what was done to the data; shrunk to the page where they are long.
void draw_titles(Canvas* canvas, const Layout& layout, const std::string& title,
                 const std::string& subtitle);

/// Axes east and north, north arrow, scale bar.
void draw_map_furniture(Canvas* canvas, const Layout& layout, const Raster& raster);

/// "No cell has a value" across the frame.
void draw_nothing_known(Canvas* canvas, const Layout& layout);

}  // namespace leadline::host::render
