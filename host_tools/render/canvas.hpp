// Drawing on cairo: a page with text, and the parts that every picture shares (axes, colour bar, north
// arrow, scale bar). Lengths are pixels, y down, unless a name says otherwise.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <cairo.h>

#include "host_tools/render/colour_map.hpp"

namespace leadline::host::render {

/// Text and lines; text of the second rank.
inline constexpr Colour kInkColour = {0.13, 0.15, 0.18};
inline constexpr Colour kSoftInkColour = {0.40, 0.43, 0.47};

struct Rectangle {
  double x = 0.0;
  double y = 0.0;
  double width = 0.0;
  double height = 0.0;

  [[nodiscard]] double right() const { return x + width; }
  [[nodiscard]] double bottom() const { return y + height; }
};

enum class Align { kLeft, kCentre, kRight };

/// A picture in memory, white at first. Throws HostError kOutput when cairo has no memory for it.
class Canvas {
 public:
  Canvas(int width_px, int height_px);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  [[nodiscard]] cairo_t* cairo() const { return cairo_; }
  [[nodiscard]] int width() const { return width_px_; }
  [[nodiscard]] int height() const { return height_px_; }

  void set_colour(const Colour& colour, double alpha = 1.0);
  void line(double x1, double y1, double x2, double y2, double line_width);
  void fill_rectangle(const Rectangle& rectangle);
  void stroke_rectangle(const Rectangle& rectangle, double line_width);

  /// Text with its baseline at y; DejaVu Sans.
  void text(const std::string& text, double x, double y, double size, Align align = Align::kLeft,
            bool bold = false);
  /// Text turned by `angle_rad` (clockwise on the page) about (x, y), which is its centre.
  void turned_text(const std::string& text, double x, double y, double size, double angle_rad);
  /// Centred text on a soft light or dark rim, readable on any ground.
  void haloed_text(const std::string& text, double x, double y, double size, double angle_rad,
                   const Colour& ink, const Colour& halo);
  [[nodiscard]] double text_width(const std::string& text, double size, bool bold = false);

  /// Copies pixels (0xAARRGGBB, premultiplied) with their corner at a whole pixel.
  void image(const std::vector<std::uint32_t>& pixels, int columns, int rows, int x, int y);
  /// Grey diagonal lines on light grey: "unknown".
  void hatch(const Rectangle& rectangle, double spacing);

  /// The picture as a PNG file's bytes.
  [[nodiscard]] std::string png() const;

 private:
  void choose_font(double size, bool bold);

  int width_px_;
  int height_px_;
  cairo_surface_t* surface_;
  cairo_t* cairo_;
};

[[nodiscard]] std::uint32_t pixel_of(const Colour& colour);

/// Round steps for an axis: multiples of `step` (1, 2 or 5 times a power of ten) in low .. high, about
/// `wanted` of them.
struct Ticks {
  double step = 1.0;
  int decimals = 0;
  std::vector<double> values;
};
[[nodiscard]] Ticks make_ticks(double low, double high, int wanted);
/// `value` with the decimals of the ticks, digits in groups of three from 10 000 on, a true minus sign.
[[nodiscard]] std::string tick_label(double value, int decimals);
/// A round length (1, 2 or 5 times a power of ten) not over `longest`.
[[nodiscard]] double round_length_below(double longest);
/// "250 m", "2 km", "40 cm".
[[nodiscard]] std::string length_label(double length_m);

/// A linear axis: `low` at the start (left or bottom) of its side of the frame, `high` at the end;
/// low > high is allowed (depth downwards).
struct Axis {
  double low = 0.0;
  double high = 1.0;
  std::string title;
};

/// Frame with ticks outside, labels and axis titles; x below, y to the left. `scale` multiplies every
/// length (1 for a page 1600 px wide).
void draw_axes(Canvas* canvas, const Rectangle& frame, const Axis& x_axis, const Axis& y_axis,
               double scale);

/// Vertical colour bar: `low` at the bottom of `bar`, `high` at the top. `colour_of` gets the value.
void draw_colour_bar(Canvas* canvas, const Rectangle& bar, double low, double high,
                     const std::string& title, const std::function<Colour(double)>& colour_of,
                     double scale);

/// Arrow with "N", pointing `angle_rad` clockwise from up; centred at (x, y), `size` high.
void draw_north_arrow(Canvas* canvas, double x, double y, double size, double angle_rad = 0.0);

/// Bar of a round length, at most `longest_px`; its right end at `right`, its base at y.
void draw_scale_bar(Canvas* canvas, double right, double y, double longest_px, double px_per_m,
                    double scale);

}  // namespace leadline::host::render
