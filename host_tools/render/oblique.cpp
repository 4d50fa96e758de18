// The seafloor as a solid seen from the side: a small software renderer (perspective, depth buffer,
// colours interpolated between vertices), then axes drawn on top.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/render/figure.hpp"
#include "host_tools/render/surface.hpp"

namespace leadline::host::render {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kRadPerDeg = kPi / 180.0;

struct Point3 {
  double east_m, north_m, up_m;
};

/// On the page; `near` grows towards the viewer.
struct Projected {
  double x, y, near;
};

/// Perspective from a point on a sphere around the middle of the scene.
class Camera {
 public:
  Camera(const Point3& centre, double azimuth_deg, double elevation_deg, double distance_m)
      : centre_(centre),
        sin_a_(std::sin(azimuth_deg * kRadPerDeg)),
        cos_a_(std::cos(azimuth_deg * kRadPerDeg)),
        sin_e_(std::sin(elevation_deg * kRadPerDeg)),
        cos_e_(std::cos(elevation_deg * kRadPerDeg)),
        distance_m_(distance_m) {}

  /// Maps the box that holds all of `points` into `frame`, proportions kept. Returns the part used.
  Rectangle fit(const std::vector<Point3>& points, const Rectangle& frame) {
    scale_ = 1.0;
    offset_x_ = 0.0;
    offset_y_ = 0.0;
    double left = HUGE_VAL, right = -HUGE_VAL, top = HUGE_VAL, bottom = -HUGE_VAL;
    for (const Point3& point : points) {
      const Projected p = project(point);
      left = std::min(left, p.x);
      right = std::max(right, p.x);
      top = std::min(top, p.y);
      bottom = std::max(bottom, p.y);
    }
    scale_ = std::min(frame.width / (right - left), frame.height / (bottom - top));
    offset_x_ = frame.x + 0.5 * (frame.width - scale_ * (right - left)) - scale_ * left;
    offset_y_ = frame.y + 0.5 * (frame.height - scale_ * (bottom - top)) - scale_ * top;
    return {scale_ * left + offset_x_, scale_ * top + offset_y_, scale_ * (right - left),
            scale_ * (bottom - top)};
  }

  [[nodiscard]] Projected project(const Point3& point) const {
    const double e = point.east_m - centre_.east_m;
    const double n = point.north_m - centre_.north_m;
    const double u = point.up_m - centre_.up_m;
    // The viewer stands at azimuth a; to his right lies azimuth a - 90 degrees.
    const double towards = e * sin_a_ + n * cos_a_;
    const double right = -e * cos_a_ + n * sin_a_;
    const double near = towards * cos_e_ + u * sin_e_;
    const double up = u * cos_e_ - towards * sin_e_;
    const double shrink = distance_m_ / (distance_m_ - near);
    return {offset_x_ + scale_ * right * shrink, offset_y_ - scale_ * up * shrink, near};
  }

 private:
  Point3 centre_;
  double sin_a_, cos_a_, sin_e_, cos_e_, distance_m_;
  double scale_ = 1.0;
  double offset_x_ = 0.0;
  double offset_y_ = 0.0;
};

struct Vertex {
  Projected at;
  Colour colour;
  float shown;  ///< depth or elevation, for contours; NaN where none belong
};

/// What the renderer paints into: `samples` x `samples` points per pixel of the page.
class Film {
 public:
  Film(int width_px, int height_px, int samples)
      : samples_(samples),
        columns_(width_px * samples),
        rows_(height_px * samples),
        near_(count(), -std::numeric_limits<float>::infinity()),
        pixel_(count(), 0U),
        shown_(count(), std::numeric_limits<float>::quiet_NaN()) {}

  void triangle(const Vertex& a, const Vertex& b, const Vertex& c) {
    const double x[3] = {a.at.x * samples_, b.at.x * samples_, c.at.x * samples_};
    const double y[3] = {a.at.y * samples_, b.at.y * samples_, c.at.y * samples_};
    const double area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    if (area == 0.0) {
      return;
    }
    const int left = std::max(0, static_cast<int>(std::floor(std::min({x[0], x[1], x[2]}) - 0.5)));
    const int right =
        std::min(columns_ - 1, static_cast<int>(std::ceil(std::max({x[0], x[1], x[2]}) - 0.5)));
    const int top = std::max(0, static_cast<int>(std::floor(std::min({y[0], y[1], y[2]}) - 0.5)));
    const int bottom =
        std::min(rows_ - 1, static_cast<int>(std::ceil(std::max({y[0], y[1], y[2]}) - 0.5)));
    for (int row = top; row <= bottom; ++row) {
      for (int column = left; column <= right; ++column) {
        const double px = column + 0.5;
        const double py = row + 0.5;
        const double wb = ((px - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (py - y[0])) / area;
        const double wc = ((x[1] - x[0]) * (py - y[0]) - (px - x[0]) * (y[1] - y[0])) / area;
        const double wa = 1.0 - wb - wc;
        // A hair of overlap: no background shines through the seams.
        constexpr double kOverlap = -1e-6;
        if (wa < kOverlap || wb < kOverlap || wc < kOverlap) {
          continue;
        }
        const auto near = static_cast<float>(wa * a.at.near + wb * b.at.near + wc * c.at.near);
        const std::size_t i = index(row, column);
        if (near <= near_[i]) {
          continue;
        }
        near_[i] = near;
        pixel_[i] = pixel_of({wa * a.colour.red + wb * b.colour.red + wc * c.colour.red,
                              wa * a.colour.green + wb * b.colour.green + wc * c.colour.green,
                              wa * a.colour.blue + wb * b.colour.blue + wc * c.colour.blue});
        shown_[i] = static_cast<float>(wa * static_cast<double>(a.shown) +
                                       wb * static_cast<double>(b.shown) +
                                       wc * static_cast<double>(c.shown));
      }
    }
  }

  /// Darkens the samples where the surface crosses a multiple of the interval.
  void draw_contours(double interval, int index_every) {
    std::vector<float> strength(count(), 0.0F);
    for (int row = 0; row + 1 < rows_; ++row) {
      for (int column = 0; column + 1 < columns_; ++column) {
        const std::size_t i = index(row, column);
        const float here = shown_[i];
        if (std::isnan(here)) {
          continue;
        }
        for (const std::size_t other : {index(row, column + 1), index(row + 1, column)}) {
          const float there = shown_[other];
          // Across a silhouette the surface jumps: no contour there.
          const bool same_sheet = std::fabs(near_[i] - near_[other]) < sheet_gap_;
          if (std::isnan(there) || !same_sheet) {
            continue;
          }
          const double low = std::floor(static_cast<double>(std::min(here, there)) / interval);
          const double high = std::floor(static_cast<double>(std::max(here, there)) / interval);
          if (low == high) {
            continue;
          }
          const bool is_index = std::llround(high) % index_every == 0;
          strength[i] = std::max(strength[i], is_index ? 0.62F : 0.30F);
          if (is_index && samples_ > 1) {
            strength[other] = std::max(strength[other], 0.62F);
          }
        }
      }
    }
    for (std::size_t i = 0; i < strength.size(); ++i) {
      if (strength[i] <= 0.0F) {
        continue;
      }
      const std::uint32_t p = pixel_[i];
      const Colour ground = {static_cast<double>(p >> 16U & 255U) / 255.0,
                             static_cast<double>(p >> 8U & 255U) / 255.0,
                             static_cast<double>(p & 255U) / 255.0};
      const bool on_dark = to_oklab(ground).lightness < 0.45;
      const Colour ink = on_dark ? Colour{1.0, 1.0, 1.0} : Colour{0.03, 0.07, 0.12};
      const double t = static_cast<double>(strength[i]) * (on_dark ? 0.7 : 1.0);
      pixel_[i] = pixel_of({ground.red + t * (ink.red - ground.red),
                            ground.green + t * (ink.green - ground.green),
                            ground.blue + t * (ink.blue - ground.blue)});
    }
  }

  /// Greatest step of `near` between two samples of one sheet of surface.
  void set_sheet_gap(double gap) { sheet_gap_ = static_cast<float>(gap); }

  /// Averaged to page pixels, with what was not painted left transparent.
  [[nodiscard]] std::vector<std::uint32_t> developed() const {
    const int width = columns_ / samples_;
    const int height = rows_ / samples_;
    std::vector<std::uint32_t> page;
    page.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    const auto all = static_cast<std::uint32_t>(samples_ * samples_);
    for (int row = 0; row < height; ++row) {
      for (int column = 0; column < width; ++column) {
        std::array<std::uint32_t, 4> sum = {};
        for (int j = 0; j < samples_; ++j) {
          for (int i = 0; i < samples_; ++i) {
            const std::uint32_t p = pixel_[index(row * samples_ + j, column * samples_ + i)];
            for (unsigned k = 0; k < 4; ++k) {
              sum[k] += p >> (8U * k) & 255U;
            }
          }
        }
        std::uint32_t value = 0;
        for (unsigned k = 0; k < 4; ++k) {
          value |= (sum[k] + all / 2) / all << (8U * k);
        }
        page.push_back(value);
      }
    }
    return page;
  }

 private:
  [[nodiscard]] std::size_t count() const {
    return static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  }
  [[nodiscard]] std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  int samples_;
  int columns_;
  int rows_;
  std::vector<float> near_;
  std::vector<std::uint32_t> pixel_;
  std::vector<float> shown_;
  float sheet_gap_ = std::numeric_limits<float>::infinity();
};

/// The scene: surface lattice, walls, floor.
struct Scene {
  Lattice height;  ///< elevation, metres up
  double west_m, south_m, east_m, north_m;
  double exaggeration;
  double floor_up_m;  ///< of the solid's underside, exaggerated

  [[nodiscard]] Point3 point(int row, int column, double up_m) const {
    // The outermost samples lie half a step inside; stretched to the edge.
    const double fx = static_cast<double>(column) / (height.columns - 1);
    const double fy = static_cast<double>(row) / (height.rows - 1);
    return {west_m + fx * (east_m - west_m), north_m - fy * (north_m - south_m), up_m};
  }
  [[nodiscard]] double up_m(int row, int column) const {
    return static_cast<double>(height.at(row, column)) * exaggeration;
  }
};

/// Which squares of the lattice (named by their north-west sample) carry surface, and which lie in the
/// open: without surface and joined to the outside of the raster.
class Squares {
 public:
  explicit Squares(const Lattice& height)
      : columns_(height.columns - 1),
        rows_(height.rows - 1),
        kind_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), Kind::kGap) {
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        const bool known =
            !std::isnan(height.at(row, column)) && !std::isnan(height.at(row, column + 1)) &&
            !std::isnan(height.at(row + 1, column)) && !std::isnan(height.at(row + 1, column + 1));
        if (known) {
          kind_[index(row, column)] = Kind::kSurface;
        }
      }
    }
    std::vector<std::pair<int, int>> front;
    const auto open = [&](int row, int column) {
      if (row >= 0 && row < rows_ && column >= 0 && column < columns_ &&
          kind_[index(row, column)] == Kind::kGap) {
        kind_[index(row, column)] = Kind::kOpen;
        front.emplace_back(row, column);
      }
    };
    for (int row = 0; row < rows_; ++row) {
      open(row, 0);
      open(row, columns_ - 1);
    }
    for (int column = 0; column < columns_; ++column) {
      open(0, column);
      open(rows_ - 1, column);
    }
    while (!front.empty()) {
      const auto [row, column] = front.back();
      front.pop_back();
      open(row - 1, column);
      open(row + 1, column);
      open(row, column - 1);
      open(row, column + 1);
    }
  }

  [[nodiscard]] bool is_surface(int row, int column) const {
    return contains(row, column) && kind_[index(row, column)] == Kind::kSurface;
  }
  /// Outside of the raster or in the open.
  [[nodiscard]] bool is_open(int row, int column) const {
    return !contains(row, column) || kind_[index(row, column)] == Kind::kOpen;
  }

 private:
  enum class Kind : unsigned char { kSurface, kGap, kOpen };

  [[nodiscard]] bool contains(int row, int column) const {
    return row >= 0 && row < rows_ && column >= 0 && column < columns_;
  }
  [[nodiscard]] std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  int columns_;
  int rows_;
  std::vector<Kind> kind_;
};

/// The solid's side below one edge of the surface.
void add_wall(Film* film, const Scene& scene, const Camera& camera, std::pair<int, int> from,
              std::pair<int, int> to, double shade) {
  const Colour top = lit({0.66, 0.63, 0.58}, shade);
  const Colour foot = lit({0.40, 0.38, 0.36}, shade);
  const auto vertex = [&](std::pair<int, int> at, bool upper) {
    const double up_m = upper ? scene.up_m(at.first, at.second) : scene.floor_up_m;
    return Vertex{camera.project(scene.point(at.first, at.second, up_m)), upper ? top : foot,
                  std::numeric_limits<float>::quiet_NaN()};
  };
  const Vertex a = vertex(from, true);
  const Vertex b = vertex(to, true);
  const Vertex c = vertex(from, false);
  const Vertex d = vertex(to, false);
  film->triangle(a, b, c);
  film->triangle(b, d, c);
}

/// Ticks, labels and a title along the foot of one side of the solid.
void draw_foot_axis(Canvas* canvas, const Camera& camera, const Point3& from, const Point3& to,
                    double low, double high, const std::string& title, const Projected& middle,
                    double scale) {
  const Projected a = camera.project(from);
  const Projected b = camera.project(to);
  const double length = std::hypot(b.x - a.x, b.y - a.y);
  if (length < 60.0 * scale) {
    return;
  }
  // Outwards: away from the middle of the floor, at right angles to the edge.
  double out_x = (b.y - a.y) / length;
  double out_y = -(b.x - a.x) / length;
  if ((0.5 * (a.x + b.x) - middle.x) * out_x + (0.5 * (a.y + b.y) - middle.y) * out_y < 0.0) {
    out_x = -out_x;
    out_y = -out_y;
  }
  canvas->set_colour(kInkColour);
  const double size = 18.0 * scale;
  const Ticks ticks =
      make_ticks(low, high, std::max(2, static_cast<int>(length / (120.0 * scale))));
  double widest = 0.0;
  for (const double value : ticks.values) {
    const double t = (value - low) / (high - low);
    const Projected p = camera.project({from.east_m + t * (to.east_m - from.east_m),
                                        from.north_m + t * (to.north_m - from.north_m), from.up_m});
    canvas->line(p.x, p.y, p.x + 9.0 * scale * out_x, p.y + 9.0 * scale * out_y, 1.4 * scale);
    const std::string label = tick_label(value, ticks.decimals);
    const double half = 0.5 * canvas->text_width(label, size);
    widest = std::max(widest, half);
    // The label's box touches the tick's end whatever the edge's direction.
    const double reach = 14.0 * scale + half * std::fabs(out_x) + 0.36 * size * std::fabs(out_y);
    canvas->text(label, p.x + reach * out_x, p.y + reach * out_y + 0.36 * size, size,
                 Align::kCentre);
  }
  double angle = std::atan2(b.y - a.y, b.x - a.x);
  if (angle > 0.5 * kPi) {
    angle -= kPi;
  }
  if (angle < -0.5 * kPi) {
    angle += kPi;
  }
  const double reach =
      14.0 * scale + 2.0 * widest * std::fabs(out_x) + size * std::fabs(out_y) + 24.0 * scale;
  const Projected centre = camera.project(
      {0.5 * (from.east_m + to.east_m), 0.5 * (from.north_m + to.north_m), from.up_m});
  canvas->turned_text(title, centre.x + reach * out_x, centre.y + reach * out_y, 20.0 * scale,
                      angle);
}

}  // namespace

std::string oblique_png(const Raster& elevation_as_given, const PictureOptions& options) {
  check_options(options);
  const Raster elevation = filtered(elevation_as_given, options);
  Layout layout;
  layout.width_px = options.width_px;
  layout.scale = options.width_px / 1600.0;
  const double s = layout.scale;
  layout.height_px = static_cast<int>(std::lround(1080.0 * s));
  layout.frame = {95.0 * s, 118.0 * s, options.width_px - 340.0 * s, layout.height_px - 210.0 * s};
  layout.bar = {std::round(options.width_px - 190.0 * s), std::round(250.0 * s),
                std::round(34.0 * s), std::round(layout.height_px - 345.0 * s)};
  Canvas canvas(layout.width_px, layout.height_px);
  std::string subtitle = raster_caption(elevation, options);
  if (elevation.known_count() == 0) {
    draw_nothing_known(&canvas, layout);
    draw_titles(&canvas, layout, options.title.empty() ? "Depth" : options.title, subtitle);
    return canvas.png();
  }

  const DepthScale scale = depth_scale(elevation, options);
  const double extent_m = std::max(elevation.columns, elevation.rows) * elevation.cell_m;
  const double low_m = quantile(elevation, 0.0);
  const double high_m = quantile(elevation, 1.0);
  const double relief_m = high_m - low_m;
  double exaggeration = 1.0;
  if (options.exaggeration.has_value()) {
    exaggeration = *options.exaggeration;
  } else if (relief_m > 0.0) {
    // A solid about a fifth as high as it is wide shows its shape; heights are never reduced.
    for (const double step :
         {1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0, 70.0, 100.0}) {
      if (step * relief_m <= 0.22 * extent_m) {
        exaggeration = step;
      }
    }
  }

  Scene scene;
  scene.west_m = elevation.west_m;
  scene.east_m = elevation.east_m();
  scene.south_m = elevation.south_m;
  scene.north_m = elevation.north_m();
  scene.exaggeration = exaggeration;
  scene.floor_up_m = low_m * exaggeration - 0.05 * extent_m;
  const double longest = std::max(elevation.columns, elevation.rows);
  const double per_cell = std::clamp(720.0 * std::max(1.0, s) / longest, 1.0, 8.0);
  scene.height =
      sample_surface(elevation, std::max(2, static_cast<int>(elevation.columns * per_cell)),
                     std::max(2, static_cast<int>(elevation.rows * per_cell)));
  const double sun_azimuth_deg = options.sun_azimuth_deg.value_or(options.view_azimuth_deg + 72.0);
  const std::vector<float> light =
      relief_light(scene.height, scene.height.step_cells * elevation.cell_m, exaggeration,
                   {sun_azimuth_deg, 42.0});
  const Raster sky = sky_share(elevation, exaggeration, 60);
  const SmoothSurface smooth_sky(sky);

  const Point3 centre = {0.5 * (scene.west_m + scene.east_m), 0.5 * (scene.south_m + scene.north_m),
                         0.5 * (scene.floor_up_m + high_m * exaggeration)};
  Camera camera(centre, options.view_azimuth_deg, options.view_elevation_deg, 3.4 * extent_m);
  std::vector<Point3> outline;
  for (int row = 0; row < scene.height.rows; ++row) {
    for (int column = 0; column < scene.height.columns; ++column) {
      const double up_m = scene.up_m(row, column);
      if (!std::isnan(up_m)) {
        outline.push_back(scene.point(row, column, up_m));
      }
    }
  }
  const std::array<Point3, 4> foot = {{{scene.west_m, scene.south_m, scene.floor_up_m},
                                       {scene.east_m, scene.south_m, scene.floor_up_m},
                                       {scene.east_m, scene.north_m, scene.floor_up_m},
                                       {scene.west_m, scene.north_m, scene.floor_up_m}}};
  outline.insert(outline.end(), foot.begin(), foot.end());
  camera.fit(outline, layout.frame);

  const int samples = options.width_px <= 3200 ? 2 : 1;
  Film film(layout.width_px, layout.height_px, samples);
  film.set_sheet_gap(0.02 * extent_m);
  std::vector<Vertex> vertices;
  vertices.reserve(scene.height.values.size());
  for (int row = 0; row < scene.height.rows; ++row) {
    for (int column = 0; column < scene.height.columns; ++column) {
      Vertex vertex{{0.0, 0.0, 0.0}, {1.0, 1.0, 1.0}, 0.0F};
      const double up_m = scene.up_m(row, column);
      if (!std::isnan(up_m)) {
        vertex.at = camera.project(scene.point(row, column, up_m));
        const double elevation_m = static_cast<double>(scene.height.at(row, column));
        vertex.shown = static_cast<float>(scale.is_depth ? -elevation_m : elevation_m);
        const double share =
            smooth_sky.at((column + 0.5) * elevation.columns / scene.height.columns,
                          (row + 0.5) * elevation.rows / scene.height.rows);
        const double brightness =
            static_cast<double>(light[scene.height.index(row, column)]) * (0.35 + 0.65 * share);
        vertex.colour =
            lit(ColourMap::depth().at(scale.position(static_cast<double>(vertex.shown))),
                std::pow(brightness, 0.9));
      }
      vertices.push_back(vertex);
    }
  }
  // Seen through gaps: the floor, pale, which reads as "nothing known".
  const auto floor_vertex = [&](std::size_t i) {
    return Vertex{
        camera.project(foot[i]), {0.90, 0.905, 0.91}, std::numeric_limits<float>::quiet_NaN()};
  };
  film.triangle(floor_vertex(0), floor_vertex(1), floor_vertex(2));
  film.triangle(floor_vertex(0), floor_vertex(2), floor_vertex(3));
  const double view = options.view_azimuth_deg * kRadPerDeg;
  const double viewer_east = std::sin(view);
  const double viewer_north = std::cos(view);
  // A side that faces the lamp is the brighter one.
  const double lamp_east = std::sin(sun_azimuth_deg * kRadPerDeg);
  const double lamp_north = std::cos(sun_azimuth_deg * kRadPerDeg);
  const auto wall_shade = [](double towards_lamp) { return 0.80 + 0.28 * towards_lamp; };
  const Squares squares(scene.height);
  for (int row = 0; row + 1 < scene.height.rows; ++row) {
    for (int column = 0; column + 1 < scene.height.columns; ++column) {
      if (!squares.is_surface(row, column)) {
        continue;
      }
      const Vertex& a = vertices[scene.height.index(row, column)];
      const Vertex& b = vertices[scene.height.index(row, column + 1)];
      const Vertex& c = vertices[scene.height.index(row + 1, column)];
      const Vertex& d = vertices[scene.height.index(row + 1, column + 1)];
      film.triangle(a, b, c);
      film.triangle(b, d, c);
      if (viewer_north < 0.0 && squares.is_open(row + 1, column)) {
        add_wall(&film, scene, camera, {row + 1, column}, {row + 1, column + 1},
                 wall_shade(-lamp_north));
      }
      if (viewer_north > 0.0 && squares.is_open(row - 1, column)) {
        add_wall(&film, scene, camera, {row, column}, {row, column + 1}, wall_shade(lamp_north));
      }
      if (viewer_east < 0.0 && squares.is_open(row, column - 1)) {
        add_wall(&film, scene, camera, {row, column}, {row + 1, column}, wall_shade(-lamp_east));
      }
      if (viewer_east > 0.0 && squares.is_open(row, column + 1)) {
        add_wall(&film, scene, camera, {row, column + 1}, {row + 1, column + 1},
                 wall_shade(lamp_east));
      }
    }
  }
  double interval_m =
      options.contour_interval_m.value_or(make_ticks(scale.shallow, scale.deep, 20).step);
  if (interval_m > 0.0 && std::fabs(scale.deep - scale.shallow) / interval_m > 200.0) {
    interval_m = 0.0;
  }
  if (interval_m > 0.0) {
    film.draw_contours(interval_m, 5);
  }
  canvas.image(film.developed(), layout.width_px, layout.height_px, 0, 0);

  const Projected middle = camera.project({centre.east_m, centre.north_m, scene.floor_up_m});
  const bool south_in_front = viewer_north < 0.0;
  const bool west_in_front = viewer_east < 0.0;
  draw_foot_axis(&canvas, camera, south_in_front ? foot[0] : foot[3],
                 south_in_front ? foot[1] : foot[2], scene.west_m, scene.east_m, "East (m)", middle,
                 s);
  draw_foot_axis(&canvas, camera, west_in_front ? foot[0] : foot[1],
                 west_in_front ? foot[3] : foot[2], scene.south_m, scene.north_m, "North (m)",
                 middle, s);
  draw_colour_bar(
      &canvas, layout.bar, scale.deep, scale.shallow, scale.bar_title(),
      [&](double value) { return ColourMap::depth().at(scale.position(value)); }, s);
  const Projected north_tip =
      camera.project({centre.east_m, centre.north_m + 0.1 * extent_m, centre.up_m});
  const Projected north_foot = camera.project(centre);
  draw_north_arrow(&canvas, layout.bar.x + 0.5 * layout.bar.width + 22.0 * s, 170.0 * s, 96.0 * s,
                   std::atan2(north_tip.x - north_foot.x, north_foot.y - north_tip.y));

  const double least = quantile(scale.shown, 0.0);
  const double most = quantile(scale.shown, 1.0);
  subtitle += "  \u00B7  " + figure_text(least, most - least) + " to " +
              figure_text(most, most - least) + (scale.is_depth ? " m deep" : " m high");
  subtitle += known_caption(elevation);
  if (interval_m > 0.0) {
    subtitle += "  \u00B7  contours every " + length_label(interval_m);
  }
  subtitle += exaggeration == 1.0 ? "  \u00B7  true proportions"
                                  : "  \u00B7  heights \u00D7" + factor_text(exaggeration);
  draw_titles(&canvas, layout, options.title.empty() ? scale.title() : options.title, subtitle);
  return canvas.png();
}

}  // namespace leadline::host::render
