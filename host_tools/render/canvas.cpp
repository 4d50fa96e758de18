#include "host_tools/render/canvas.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "host_tools/exit_codes.hpp"

#if defined(__SANITIZE_ADDRESS__)
#define LEADLINE_LEAK_CHECK 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define LEADLINE_LEAK_CHECK 1
#endif
#endif

#ifdef LEADLINE_LEAK_CHECK
#include <cstdlib>

#include <fontconfig/fontconfig.h>
#endif

namespace leadline::host::render {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr const char* kFontFamily = "DejaVu Sans";

cairo_status_t append_bytes(void* closure, const unsigned char* data, unsigned int length) {
  static_cast<std::string*>(closure)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

/// Cairo and fontconfig keep their fonts until the process ends, in structures whose pointers are offsets: the leak
/// check takes a kilobyte of them for lost, in every program that draws text. There they are freed at the end, before
/// it looks. (A suppression by the library's name missed those whose call stack it could not follow so far.)
void free_fonts_at_exit() {
#ifdef LEADLINE_LEAK_CHECK
  static const int registered = std::atexit([] {
    cairo_debug_reset_static_data();
    FcFini();
  });
  static_cast<void>(registered);
#endif
}

}  // namespace

Canvas::Canvas(int width_px, int height_px)
    : width_px_(width_px),
      height_px_(height_px),
      surface_(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width_px, height_px)),
      cairo_(cairo_create(surface_)) {
  if (cairo_status(cairo_) != CAIRO_STATUS_SUCCESS) {
    const std::string reason = cairo_status_to_string(cairo_status(cairo_));
    cairo_destroy(cairo_);
    cairo_surface_destroy(surface_);
    throw HostError(ExitCode::kOutput, "a picture of " + std::to_string(width_px) + " x " +
                                           std::to_string(height_px) + " pixels: " + reason);
  }
  set_colour({1.0, 1.0, 1.0});
  cairo_paint(cairo_);
  set_colour(kInkColour);
}

Canvas::~Canvas() {
  cairo_destroy(cairo_);
  cairo_surface_destroy(surface_);
}

void Canvas::set_colour(const Colour& colour, double alpha) {
  cairo_set_source_rgba(cairo_, colour.red, colour.green, colour.blue, alpha);
}

void Canvas::line(double x1, double y1, double x2, double y2, double line_width) {
  cairo_set_line_width(cairo_, line_width);
  cairo_move_to(cairo_, x1, y1);
  cairo_line_to(cairo_, x2, y2);
  cairo_stroke(cairo_);
}

void Canvas::fill_rectangle(const Rectangle& rectangle) {
  cairo_rectangle(cairo_, rectangle.x, rectangle.y, rectangle.width, rectangle.height);
  cairo_fill(cairo_);
}

void Canvas::stroke_rectangle(const Rectangle& rectangle, double line_width) {
  cairo_set_line_width(cairo_, line_width);
  cairo_rectangle(cairo_, rectangle.x, rectangle.y, rectangle.width, rectangle.height);
  cairo_stroke(cairo_);
}

void Canvas::choose_font(double size, bool bold) {
  free_fonts_at_exit();
  cairo_select_font_face(cairo_, kFontFamily, CAIRO_FONT_SLANT_NORMAL,
                         bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(cairo_, size);
}

double Canvas::text_width(const std::string& text, double size, bool bold) {
  choose_font(size, bold);
  cairo_text_extents_t extents;
  cairo_text_extents(cairo_, text.c_str(), &extents);
  return extents.x_advance;
}

void Canvas::text(const std::string& text, double x, double y, double size, Align align,
                  bool bold) {
  const double width = text_width(text, size, bold);
  const double left = align == Align::kLeft    ? x
                      : align == Align::kRight ? x - width
                                               : x - 0.5 * width;
  cairo_move_to(cairo_, left, y);
  cairo_show_text(cairo_, text.c_str());
}

void Canvas::turned_text(const std::string& text, double x, double y, double size,
                         double angle_rad) {
  const double width = text_width(text, size);
  cairo_save(cairo_);
  cairo_translate(cairo_, x, y);
  cairo_rotate(cairo_, angle_rad);
  cairo_move_to(cairo_, -0.5 * width, 0.36 * size);
  cairo_show_text(cairo_, text.c_str());
  cairo_restore(cairo_);
}

void Canvas::haloed_text(const std::string& text, double x, double y, double size, double angle_rad,
                         const Colour& ink, const Colour& halo) {
  const double width = text_width(text, size);
  cairo_save(cairo_);
  cairo_translate(cairo_, x, y);
  cairo_rotate(cairo_, angle_rad);
  cairo_move_to(cairo_, -0.5 * width, 0.36 * size);
  cairo_text_path(cairo_, text.c_str());
  cairo_set_line_join(cairo_, CAIRO_LINE_JOIN_ROUND);
  cairo_set_line_width(cairo_, 0.30 * size);
  set_colour(halo, 0.80);
  cairo_stroke_preserve(cairo_);
  set_colour(ink);
  cairo_fill(cairo_);
  cairo_restore(cairo_);
}

void Canvas::image(const std::vector<std::uint32_t>& pixels, int columns, int rows, int x, int y) {
  if (columns <= 0 || rows <= 0) {
    return;
  }
  cairo_surface_t* surface = cairo_image_surface_create(CAIRO_FORMAT_ARGB32, columns, rows);
  if (cairo_surface_status(surface) == CAIRO_STATUS_SUCCESS) {
    unsigned char* data = cairo_image_surface_get_data(surface);
    const int stride = cairo_image_surface_get_stride(surface);
    for (int row = 0; row < rows; ++row) {
      const std::uint32_t* source =
          pixels.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(columns);
      std::copy(source, source + columns,
                reinterpret_cast<std::uint32_t*>(
                    static_cast<void*>(data + static_cast<std::ptrdiff_t>(row) * stride)));
    }
    cairo_surface_mark_dirty(surface);
    cairo_set_source_surface(cairo_, surface, x, y);
    cairo_paint(cairo_);
  }
  cairo_surface_destroy(surface);
  set_colour(kInkColour);
}

void Canvas::hatch(const Rectangle& rectangle, double spacing) {
  cairo_save(cairo_);
  cairo_rectangle(cairo_, rectangle.x, rectangle.y, rectangle.width, rectangle.height);
  cairo_clip(cairo_);
  set_colour({0.89, 0.895, 0.90});
  cairo_paint(cairo_);
  set_colour({0.74, 0.75, 0.765});
  cairo_set_line_width(cairo_, 0.12 * spacing);
  const double reach = rectangle.height;
  for (double x = rectangle.x - reach; x < rectangle.right(); x += spacing) {
    cairo_move_to(cairo_, x, rectangle.bottom());
    cairo_line_to(cairo_, x + reach, rectangle.y);
  }
  cairo_stroke(cairo_);
  cairo_restore(cairo_);
}

std::string Canvas::png() const {
  std::string bytes;
  cairo_surface_flush(surface_);
  const cairo_status_t status = cairo_surface_write_to_png_stream(surface_, append_bytes, &bytes);
  if (status != CAIRO_STATUS_SUCCESS) {
    throw HostError(ExitCode::kOutput, std::string("PNG: ") + cairo_status_to_string(status));
  }
  return bytes;
}

std::uint32_t pixel_of(const Colour& colour) {
  const auto channel = [](double value) {
    return static_cast<std::uint32_t>(std::lround(std::clamp(value, 0.0, 1.0) * 255.0));
  };
  return 0xFF000000U | channel(colour.red) << 16U | channel(colour.green) << 8U |
         channel(colour.blue);
}

double round_length_below(double longest) {
  if (!(longest > 0.0) || !std::isfinite(longest)) {
    return 1.0;
  }
  const double decade = std::pow(10.0, std::floor(std::log10(longest)));
  for (const double step : {5.0, 2.0, 1.0}) {
    if (step * decade <= longest * (1.0 + 1e-9)) {
      return step * decade;
    }
  }
  return decade;
}

Ticks make_ticks(double low, double high, int wanted) {
  Ticks ticks;
  const double first = std::min(low, high);
  const double last = std::max(low, high);
  const double span = last - first;
  if (!(span > 0.0) || !std::isfinite(span)) {
    ticks.values.push_back(first);
    return ticks;
  }
  // The round step that gives the number of ticks nearest to the wanted one.
  const double ideal = span / std::max(1, wanted);
  const double below = round_length_below(ideal);
  const double decade = std::pow(10.0, std::floor(std::log10(below) + 1e-9));
  const double leading = below / decade;
  const double above = leading < 1.5 ? 2.0 * decade : leading < 3.0 ? 5.0 * decade : 10.0 * decade;
  ticks.step = ideal / below < above / ideal ? below : above;
  ticks.decimals = std::max(0, -static_cast<int>(std::floor(std::log10(ticks.step) + 1e-9)));
  const double begin = std::ceil(first / ticks.step - 1e-9);
  const double end = std::floor(last / ticks.step + 1e-9);
  for (double k = begin; k <= end && ticks.values.size() < 1000; k += 1.0) {
    ticks.values.push_back(k == 0.0 ? 0.0 : k * ticks.step);
  }
  return ticks;
}

std::string tick_label(double value, int decimals) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, "%.*f", decimals, std::fabs(value));
  std::string digits = buffer;
  const std::size_t point = std::min(digits.find('.'), digits.size());
  if (point > 4) {
    for (std::size_t i = point - 3;; i -= 3) {
      digits.insert(i, "\u2009");  // thin space
      if (i <= 3) {
        break;
      }
    }
  }
  return value < 0.0 ? "\u2212" + digits : digits;
}

std::string length_label(double length_m) {
  char buffer[32];
  if (length_m >= 1000.0) {
    std::snprintf(buffer, sizeof buffer, "%g km", length_m / 1000.0);
  } else if (length_m >= 1.0) {
    std::snprintf(buffer, sizeof buffer, "%g m", length_m);
  } else if (length_m >= 0.01) {
    std::snprintf(buffer, sizeof buffer, "%g cm", length_m * 100.0);
  } else {
    std::snprintf(buffer, sizeof buffer, "%g mm", length_m * 1000.0);
  }
  return buffer;
}

void draw_axes(Canvas* canvas, const Rectangle& frame, const Axis& x_axis, const Axis& y_axis,
               double scale) {
  canvas->set_colour(kInkColour);
  canvas->stroke_rectangle(frame, 1.4 * scale);
  const double tick = 8.0 * scale;
  const double size = 19.0 * scale;
  const Ticks x_ticks = make_ticks(x_axis.low, x_axis.high,
                                   std::max(2, static_cast<int>(frame.width / (150.0 * scale))));
  for (const double value : x_ticks.values) {
    const double x = frame.x + frame.width * (value - x_axis.low) / (x_axis.high - x_axis.low);
    canvas->line(x, frame.bottom(), x, frame.bottom() + tick, 1.4 * scale);
    canvas->text(tick_label(value, x_ticks.decimals), x, frame.bottom() + tick + 1.15 * size, size,
                 Align::kCentre);
  }
  const Ticks y_ticks = make_ticks(y_axis.low, y_axis.high,
                                   std::max(4, static_cast<int>(frame.height / (120.0 * scale))));
  double widest = 0.0;
  for (const double value : y_ticks.values) {
    const double y =
        frame.bottom() - frame.height * (value - y_axis.low) / (y_axis.high - y_axis.low);
    canvas->line(frame.x, y, frame.x - tick, y, 1.4 * scale);
    const std::string label = tick_label(value, y_ticks.decimals);
    canvas->text(label, frame.x - tick - 5.0 * scale, y + 0.36 * size, size, Align::kRight);
    widest = std::max(widest, canvas->text_width(label, size));
  }
  const double title_size = 21.0 * scale;
  canvas->text(x_axis.title, frame.x + 0.5 * frame.width,
               frame.bottom() + tick + 1.3 * size + 1.5 * title_size, title_size, Align::kCentre);
  canvas->turned_text(y_axis.title, frame.x - tick - widest - 13.0 * scale - 0.5 * title_size,
                      frame.y + 0.5 * frame.height, title_size, -0.5 * kPi);
}

void draw_colour_bar(Canvas* canvas, const Rectangle& bar, double low, double high,
                     const std::string& title, const std::function<Colour(double)>& colour_of,
                     double scale) {
  const int rows = std::max(1, static_cast<int>(std::lround(bar.height)));
  const int columns = std::max(1, static_cast<int>(std::lround(bar.width)));
  std::vector<std::uint32_t> pixels;
  pixels.reserve(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns));
  for (int row = 0; row < rows; ++row) {
    const double value = high + (low - high) * (row + 0.5) / rows;
    pixels.insert(pixels.end(), static_cast<std::size_t>(columns), pixel_of(colour_of(value)));
  }
  const int x = static_cast<int>(std::lround(bar.x));
  const int y = static_cast<int>(std::lround(bar.y));
  canvas->image(pixels, columns, rows, x, y);
  canvas->set_colour(kInkColour);
  canvas->stroke_rectangle({static_cast<double>(x), static_cast<double>(y),
                            static_cast<double>(columns), static_cast<double>(rows)},
                           1.2 * scale);
  const double size = 19.0 * scale;
  const Ticks ticks =
      make_ticks(low, high, std::max(3, static_cast<int>(bar.height / (75.0 * scale))));
  double widest = 0.0;
  for (const double value : ticks.values) {
    const double tick_y = bar.bottom() - bar.height * (value - low) / (high - low);
    canvas->line(bar.right(), tick_y, bar.right() + 7.0 * scale, tick_y, 1.4 * scale);
    const std::string label = tick_label(value, ticks.decimals);
    canvas->text(label, bar.right() + 12.0 * scale, tick_y + 0.36 * size, size);
    widest = std::max(widest, canvas->text_width(label, size));
  }
  const double title_size = 21.0 * scale;
  canvas->turned_text(title, bar.right() + 12.0 * scale + widest + 10.0 * scale + 0.5 * title_size,
                      bar.y + 0.5 * bar.height, title_size, -0.5 * kPi);
}

void draw_north_arrow(Canvas* canvas, double x, double y, double size, double angle_rad) {
  cairo_t* cairo = canvas->cairo();
  cairo_save(cairo);
  cairo_translate(cairo, x, y);
  cairo_rotate(cairo, angle_rad);
  const double half = 0.5 * size;
  const double wing = 0.22 * size;
  canvas->set_colour(kInkColour);
  cairo_set_line_join(cairo, CAIRO_LINE_JOIN_ROUND);
  cairo_set_line_width(cairo, 0.022 * size);
  // Left half dark, right half light.
  cairo_move_to(cairo, 0.0, -half * 0.55);
  cairo_line_to(cairo, -wing, half);
  cairo_line_to(cairo, 0.0, half * 0.62);
  cairo_close_path(cairo);
  cairo_fill_preserve(cairo);
  cairo_stroke(cairo);
  cairo_move_to(cairo, 0.0, -half * 0.55);
  cairo_line_to(cairo, wing, half);
  cairo_line_to(cairo, 0.0, half * 0.62);
  cairo_close_path(cairo);
  canvas->set_colour({1.0, 1.0, 1.0});
  cairo_fill_preserve(cairo);
  canvas->set_colour(kInkColour);
  cairo_stroke(cairo);
  cairo_restore(cairo);
  canvas->set_colour(kInkColour);
  const double letter = 0.86 * half;
  canvas->text("N", x + letter * std::sin(angle_rad),
               y - letter * std::cos(angle_rad) + 0.10 * size, 0.30 * size, Align::kCentre, true);
}

void draw_scale_bar(Canvas* canvas, double right, double y, double longest_px, double px_per_m,
                    double scale) {
  const double length_m = round_length_below(longest_px / px_per_m);
  const double length_px = length_m * px_per_m;
  const double left = right - length_px;
  const double height = 8.0 * scale;
  // Four fields, alternately filled.
  canvas->set_colour(kInkColour);
  for (int i = 0; i < 4; i += 2) {
    canvas->fill_rectangle({left + length_px * i / 4.0, y - height, length_px / 4.0, height});
  }
  canvas->stroke_rectangle({left, y - height, length_px, height}, 1.4 * scale);
  canvas->text(length_label(length_m), left + 0.5 * length_px, y + 22.0 * scale, 18.0 * scale,
               Align::kCentre);
}

}  // namespace leadline::host::render
