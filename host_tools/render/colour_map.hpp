// Colour maps of the pictures. All are our own: curves drawn in OKLab (B. Ottosson, 2020), a space in
// which equal distances look equal, walked at constant speed. Lightness is strictly monotone (for the
// diverging map: on both sides of the middle), so that they survive a grey print and every common kind
// of colour blindness.
#pragma once

#include <array>
#include <cstddef>

namespace leadline::host::render {

/// sRGB, gamma-encoded, 0 .. 1 each.
struct Colour {
  double red;
  double green;
  double blue;
};

/// Coordinates in OKLab: lightness 0 .. 1, two opponent axes.
struct OkLab {
  double lightness;
  double a;
  double b;
};

[[nodiscard]] OkLab to_oklab(const Colour& colour);
/// Clamped into the gamut of sRGB.
[[nodiscard]] Colour from_oklab(const OkLab& lab);
/// sRGB with its light multiplied by `factor` >= 0 (as a shadow or more light would), clamped.
[[nodiscard]] Colour lit(const Colour& colour, double factor);

class ColourMap {
 public:
  static constexpr std::size_t kSteps = 256;

  /// Colour at `position`, clamped to 0 .. 1; NaN gives position 0.
  [[nodiscard]] Colour at(double position) const;
  [[nodiscard]] const std::array<Colour, kSteps>& table() const { return table_; }

  /// Depth: pale sand (0, shallow) over teal to dark indigo (1, deep).
  static const ColourMap& depth();
  /// Uncertainty: near white (0, sure) over orange to dark plum (1, unsure).
  static const ColourMap& uncertainty();
  /// Signed quantities: brown-red (0) over near white (0.5) to blue (1).
  static const ColourMap& diverging();

 private:
  struct Anchor {
    double lightness;
    double chroma;
    double hue_deg;
  };
  template <std::size_t N>
  explicit ColourMap(const std::array<Anchor, N>& anchors);

  std::array<Colour, kSteps> table_;
};

}  // namespace leadline::host::render
