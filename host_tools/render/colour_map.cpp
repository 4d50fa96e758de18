#include "host_tools/render/colour_map.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace leadline::host::render {
namespace {

constexpr double kRadPerDeg = 3.14159265358979323846 / 180.0;

double to_linear(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

double to_encoded(double linear) {
  const double clamped = std::clamp(linear, 0.0, 1.0);
  return clamped <= 0.0031308 ? clamped * 12.92 : 1.055 * std::pow(clamped, 1.0 / 2.4) - 0.055;
}

double distance(const OkLab& p, const OkLab& q) {
  return std::sqrt((p.lightness - q.lightness) * (p.lightness - q.lightness) +
                   (p.a - q.a) * (p.a - q.a) + (p.b - q.b) * (p.b - q.b));
}

/// Uniform Catmull-Rom through four points, between p1 (t = 0) and p2 (t = 1).
double spline(double p0, double p1, double p2, double p3, double t) {
  return 0.5 * (2.0 * p1 + (p2 - p0) * t + (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3) * t * t +
                (3.0 * p1 - 3.0 * p2 + p3 - p0) * t * t * t);
}

}  // namespace

OkLab to_oklab(const Colour& colour) {
  const double r = to_linear(colour.red);
  const double g = to_linear(colour.green);
  const double b = to_linear(colour.blue);
  const double l = std::cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
  const double m = std::cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
  const double s = std::cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
  return {0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s,
          1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s,
          0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s};
}

Colour from_oklab(const OkLab& lab) {
  const double l = std::pow(lab.lightness + 0.3963377774 * lab.a + 0.2158037573 * lab.b, 3.0);
  const double m = std::pow(lab.lightness - 0.1055613458 * lab.a - 0.0638541728 * lab.b, 3.0);
  const double s = std::pow(lab.lightness - 0.0894841775 * lab.a - 1.2914855480 * lab.b, 3.0);
  return {to_encoded(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
          to_encoded(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
          to_encoded(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s)};
}

Colour lit(const Colour& colour, double factor) {
  return {to_encoded(to_linear(colour.red) * factor), to_encoded(to_linear(colour.green) * factor),
          to_encoded(to_linear(colour.blue) * factor)};
}

template <std::size_t N>
ColourMap::ColourMap(const std::array<Anchor, N>& anchors) : table_() {
  std::vector<OkLab> points;
  for (const Anchor& anchor : anchors) {
    const double hue = anchor.hue_deg * kRadPerDeg;
    points.push_back(
        {anchor.lightness, anchor.chroma * std::cos(hue), anchor.chroma * std::sin(hue)});
  }
  // A fine curve through the anchors, of colours as the screen can show them, then equal steps along
  // its length.
  constexpr int kFine = 4096;
  const int segments = static_cast<int>(N) - 1;
  std::vector<OkLab> curve;
  std::vector<double> length;
  for (int i = 0; i <= kFine; ++i) {
    const double position = static_cast<double>(i) * segments / kFine;
    const int segment = std::min(static_cast<int>(position), segments - 1);
    const double t = position - segment;
    const auto point = [&](int k) -> const OkLab& {
      return points[static_cast<std::size_t>(std::clamp(segment + k, 0, segments))];
    };
    const OkLab wanted = {
        spline(point(-1).lightness, point(0).lightness, point(1).lightness, point(2).lightness, t),
        spline(point(-1).a, point(0).a, point(1).a, point(2).a, t),
        spline(point(-1).b, point(0).b, point(1).b, point(2).b, t)};
    curve.push_back(to_oklab(from_oklab(wanted)));
    length.push_back(i == 0 ? 0.0
                            : length.back() + distance(curve[curve.size() - 2], curve.back()));
  }
  for (std::size_t step = 0; step < kSteps; ++step) {
    const double target = length.back() * static_cast<double>(step) / (kSteps - 1);
    const auto above = std::lower_bound(length.begin(), length.end(), target);
    const auto index =
        static_cast<std::size_t>(std::min<std::ptrdiff_t>(above - length.begin(), kFine));
    table_[step] = from_oklab(curve[index]);
  }
}

Colour ColourMap::at(double position) const {
  // The comparison is false for NaN too.
  const double clamped = position > 0.0 ? std::min(position, 1.0) : 0.0;
  const double scaled = clamped * (kSteps - 1);
  const std::size_t index = std::min(static_cast<std::size_t>(scaled), kSteps - 2);
  const double t = scaled - static_cast<double>(index);
  const Colour& low = table_[index];
  const Colour& high = table_[index + 1];
  return {low.red + (high.red - low.red) * t, low.green + (high.green - low.green) * t,
          low.blue + (high.blue - low.blue) * t};
}

const ColourMap& ColourMap::depth() {
  static const ColourMap map(std::array<Anchor, 7>{{{0.965, 0.060, 104.0},
                                                    {0.870, 0.095, 138.0},
                                                    {0.765, 0.100, 170.0},
                                                    {0.650, 0.098, 210.0},
                                                    {0.535, 0.105, 245.0},
                                                    {0.420, 0.115, 274.0},
                                                    {0.310, 0.090, 290.0}}});
  return map;
}

const ColourMap& ColourMap::uncertainty() {
  static const ColourMap map(std::array<Anchor, 6>{{{0.980, 0.018, 95.0},
                                                    {0.880, 0.090, 80.0},
                                                    {0.760, 0.130, 58.0},
                                                    {0.620, 0.145, 35.0},
                                                    {0.460, 0.125, 10.0},
                                                    {0.300, 0.085, 340.0}}});
  return map;
}

const ColourMap& ColourMap::diverging() {
  // Both halves mirror each other in lightness and chroma, so that +x and -x weigh the same.
  static const ColourMap map(std::array<Anchor, 7>{{{0.380, 0.110, 38.0},
                                                    {0.600, 0.125, 44.0},
                                                    {0.820, 0.075, 60.0},
                                                    {0.975, 0.000, 0.0},
                                                    {0.820, 0.075, 235.0},
                                                    {0.600, 0.125, 250.0},
                                                    {0.380, 0.110, 262.0}}});
  return map;
}

}  // namespace leadline::host::render
