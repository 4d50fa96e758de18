// Elementary functions that give the same bits on every host.
//
// A simulated survey is named by its seed, and results measured on it are quoted in READMEs, so the
// simulator must not depend on which libm it was linked with: the last bit of sin() or log() differs
// between C libraries, and a range that sits on a bin edge would turn that bit into an eighth of a
// cell. Only + - * / sqrt, floor, frexp and ldexp are used here; IEEE 754 defines each exactly. The
// compiler must not fuse multiply and add (-ffp-contract=off, the default for x86-64 without FMA).
//
// Accuracy: absolute error below 1e-14 in the domains given, tested against libm.
#pragma once

#include <cmath>

namespace leadline::host::exact {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kRadPerDeg = kPi / 180.0;
inline constexpr double kDegPerRad = 180.0 / kPi;

struct SinCos {
  double sin;
  double cos;
};

// Sine and cosine of `angle_rad`, |angle_rad| <= 1e6.
inline SinCos sin_cos(double angle_rad) {
  // pi/2 split in two so that the product with a quadrant number up to 2^20 is exact in the high part.
  constexpr double kHalfPiHigh = 1.57079632673412561417e+00;
  constexpr double kHalfPiLow = 6.07710050650619224932e-11;
  const double quadrant = std::floor(angle_rad * (2.0 / kPi) + 0.5);
  const double r = (angle_rad - quadrant * kHalfPiHigh) - quadrant * kHalfPiLow;
  const double r2 = r * r;
  // Taylor series: |r| <= pi/4, so the first omitted terms are below 1e-16.
  double sine = 1.0;
  for (int n = 16; n >= 2; n -= 2) {
    sine = 1.0 - sine * r2 / (n * (n + 1.0));
  }
  sine *= r;
  double cosine = 1.0;
  for (int n = 17; n >= 1; n -= 2) {
    cosine = 1.0 - cosine * r2 / (n * (n + 1.0));
  }
  const int turn = static_cast<int>(quadrant - 4.0 * std::floor(quadrant / 4.0));
  switch (turn) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

inline double sin(double angle_rad) { return sin_cos(angle_rad).sin; }
inline double cos(double angle_rad) { return sin_cos(angle_rad).cos; }
inline double tan(double angle_rad) {
  const SinCos value = sin_cos(angle_rad);
  return value.sin / value.cos;
}

// Natural logarithm, x > 0 and normal.
inline double log(double x) {
  constexpr double kLn2 = 0.693147180559945309417;
  int exponent = 0;
  double mantissa = std::frexp(x, &exponent);
  if (mantissa < 0.70710678118654752440) {
    mantissa *= 2.0;
    --exponent;
  }
  const double s = (mantissa - 1.0) / (mantissa + 1.0);
  const double s2 = s * s;
  double sum = 0.0;
  for (int n = 23; n >= 1; n -= 2) {
    sum = sum * s2 + 1.0 / n;
  }
  return exponent * kLn2 + 2.0 * s * sum;
}

// e^x, |x| <= 700.
inline double exp(double x) {
  constexpr double kLn2High = 6.93147180369123816490e-01;
  constexpr double kLn2Low = 1.90821492927058770002e-10;
  const double k = std::floor(x / 0.693147180559945309417 + 0.5);
  const double r = (x - k * kLn2High) - k * kLn2Low;
  double sum = 1.0;
  for (int n = 16; n >= 1; --n) {
    sum = 1.0 + sum * r / n;
  }
  return std::ldexp(sum, static_cast<int>(k));
}

// Angle of the vector (x, y) in (-pi, pi]; 0 for the null vector.
inline double atan2(double y, double x) {
  const double ax = std::fabs(x);
  const double ay = std::fabs(y);
  if (ax == 0.0 && ay == 0.0) {
    return 0.0;
  }
  // Two half-angle steps bring the argument under tan(pi/16), where the series is short.
  double t = ay <= ax ? ay / ax : ax / ay;
  t = t / (1.0 + std::sqrt(1.0 + t * t));
  t = t / (1.0 + std::sqrt(1.0 + t * t));
  const double t2 = t * t;
  double sum = 0.0;
  for (int n = 23; n >= 1; n -= 2) {
    sum = 1.0 / n - sum * t2;
  }
  double angle_rad = 4.0 * t * sum;
  if (ay > ax) {
    angle_rad = 0.5 * kPi - angle_rad;
  }
  if (x < 0.0) {
    angle_rad = kPi - angle_rad;
  }
  return y < 0.0 ? -angle_rad : angle_rad;
}

}  // namespace leadline::host::exact
