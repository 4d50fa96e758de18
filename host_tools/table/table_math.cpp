#include "host_tools/table/table_math.hpp"

#include <array>
#include <cmath>

namespace leadline::host::exact {
namespace {

// Power series: the largest term at x = 8 is about 60, so that 15 digits less two remain.
double j1_series(double x) {
  const double y = -0.25 * x * x;
  double term = 0.5 * x;
  double sum = term;
  for (int k = 1; k <= 40; ++k) {
    term *= y / (static_cast<double>(k) * (k + 1));
    sum += term;
  }
  return sum;
}

// Miller's backward recurrence, normalized by J0 + 2 (J2 + J4 + ...) = 1; for x up to 25.
double j1_recurrence(double x) {
  double above = 0.0;
  double here = 1e-300;
  double even_sum = 0.0;
  double j1 = 0.0;
  for (int n = 80; n >= 1; --n) {
    if (n % 2 == 0) {
      even_sum += here;
    }
    if (n == 1) {
      j1 = here;
    }
    const double below = 2.0 * n / x * here - above;
    above = here;
    here = below;
  }
  return j1 / (here + 2.0 * even_sum);
}

// Hankel's asymptotic series; the smallest term at x = 25 is below 1e-21.
double j1_asymptotic(double x) {
  const double mu = 4.0;
  double p = 1.0;
  double q = 0.0;
  double term = 1.0;
  for (int k = 1; k <= 24; ++k) {
    const double odd = 2.0 * k - 1.0;
    term *= (mu - odd * odd) / (8.0 * k * x);
    switch (k % 4) {
      case 1:
        q += term;
        break;
      case 2:
        p -= term;
        break;
      case 3:
        q -= term;
        break;
      default:
        p += term;
        break;
    }
  }
  const SinCos phase = sin_cos(x - 0.75 * kPi);
  return std::sqrt(2.0 / (kPi * x)) * (p * phase.cos - q * phase.sin);
}

// e^-x I_order(x), order 0 or 1. All terms of the power series are positive: no cancellation.
double bessel_ie(int order, double x) {
  if (x < 25.0) {
    const double y = 0.25 * x * x;
    double term = order == 0 ? 1.0 : 0.5 * x;
    double sum = term;
    for (int k = 1; k <= 70; ++k) {
      term *= y / (static_cast<double>(k) * (k + order));
      sum += term;
    }
    return sum * exp_fast(-x);
  }
  const double mu = 4.0 * order;
  double term = 1.0;
  double sum = 1.0;
  for (int k = 1; k <= 20; ++k) {
    const double odd = 2.0 * k - 1.0;
    term *= -(mu - odd * odd) / (8.0 * k * x);
    sum += term;
  }
  return sum / std::sqrt(2.0 * kPi * x);
}

// I0e and I1e are needed some hundred thousand times per table: sampled once over z = x / (x + 4),
// multiplied by std::sqrt(1 + x), where they are smooth up to z = 1 (x infinite), and interpolated
// with four points (error 3e-13).
class ScaledBesselTable {
 public:
  explicit ScaledBesselTable(int order) {
    for (int i = 0; i < kSize; ++i) {
      const double z = static_cast<double>(i - 1) / kSteps;
      // One step before 0 the function goes on smoothly (I0e(x) = I0(x) e^-x for negative x, too).
      const double x = 4.0 * z / (1.0 - z);
      if (i - 1 >= kSteps) {
        values_[static_cast<std::size_t>(i)] = 0.0;
        continue;
      }
      const double magnitude = x < 0.0 ? -x : x;
      double value = bessel_ie(order, magnitude);
      if (x < 0.0) {
        value *= exp_fast(2.0 * magnitude) * (order == 1 ? -1.0 : 1.0);
      }
      values_[static_cast<std::size_t>(i)] = value * std::sqrt(1.0 + x);
    }
    // z = 1 and one step beyond it: the limit and the polynomial through the last points.
    const std::size_t end = kSteps + 1;
    values_[end] = 1.0 / std::sqrt(2.0 * kPi);
    values_[end + 1] =
        4.0 * values_[end] - 6.0 * values_[end - 1] + 4.0 * values_[end - 2] - values_[end - 3];
  }

  double operator()(double x) const {
    const double position = x / (x + 4.0) * kSteps;
    const int cell = position >= kSteps - 1 ? kSteps - 1 : static_cast<int>(position);
    const double f = position - cell;
    const double* const v = &values_[static_cast<std::size_t>(cell)];  // v[1] lies at f = 0
    const double value = v[0] * (-f * (f - 1.0) * (f - 2.0) / 6.0) +
                         v[1] * ((f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0) +
                         v[2] * (-(f + 1.0) * f * (f - 2.0) / 2.0) +
                         v[3] * ((f + 1.0) * f * (f - 1.0) / 6.0);
    return value / std::sqrt(1.0 + x);
  }

 private:
  static constexpr int kSteps = 2048;
  static constexpr int kSize = kSteps + 3;
  std::array<double, kSize> values_{};
};

constexpr std::size_t kGaussOrder = 8;

// Nodes and weights over [-1, 1]: Newton's iteration on the Legendre polynomial.
std::array<Node, kGaussOrder> make_gauss() {
  std::array<Node, kGaussOrder> nodes{};
  const int n = static_cast<int>(kGaussOrder);
  for (int i = 0; i < n; ++i) {
    double x = -cos(kPi * (i + 0.75) / (n + 0.5));
    double derivative = 0.0;
    for (int iteration = 0; iteration < 8; ++iteration) {
      double before = 1.0;
      double here = x;
      for (int k = 2; k <= n; ++k) {
        const double next = ((2.0 * k - 1.0) * x * here - (k - 1.0) * before) / k;
        before = here;
        here = next;
      }
      derivative = n * (x * here - before) / (x * x - 1.0);
      x -= here / derivative;
    }
    nodes[static_cast<std::size_t>(i)] = {x, 2.0 / ((1.0 - x * x) * derivative * derivative)};
  }
  return nodes;
}

}  // namespace

double bessel_j1(double x) {
  if (x < 8.0) {
    return j1_series(x);
  }
  return x < 25.0 ? j1_recurrence(x) : j1_asymptotic(x);
}

double bessel_i0e(double x) {
  static const ScaledBesselTable table(0);
  return table(x);
}

double bessel_i1e(double x) {
  static const ScaledBesselTable table(1);
  return table(x);
}

double acos(double x) {
  const double rest = (1.0 - x) * (1.0 + x);
  return atan2(rest > 0.0 ? std::sqrt(rest) : 0.0, x);
}

double asin(double x) {
  const double rest = (1.0 - x) * (1.0 + x);
  return atan2(x, rest > 0.0 ? std::sqrt(rest) : 0.0);
}

double exp_fast(double x) {
  if (x < -700.0) {
    return 0.0;
  }
  constexpr double kLn2High = 6.93147180369123816490e-01;
  constexpr double kLn2Low = 1.90821492927058770002e-10;
  constexpr std::array<double, 14> kInverseFactorial = {1.0,
                                                        1.0,
                                                        1.0 / 2.0,
                                                        1.0 / 6.0,
                                                        1.0 / 24.0,
                                                        1.0 / 120.0,
                                                        1.0 / 720.0,
                                                        1.0 / 5040.0,
                                                        1.0 / 40320.0,
                                                        1.0 / 362880.0,
                                                        1.0 / 3628800.0,
                                                        1.0 / 39916800.0,
                                                        1.0 / 479001600.0,
                                                        1.0 / 6227020800.0};
  const double k = std::floor(x * 1.44269504088896340736 + 0.5);
  const double r = (x - k * kLn2High) - k * kLn2Low;
  double sum = kInverseFactorial[13];
  for (int n = 12; n >= 0; --n) {
    sum = sum * r + kInverseFactorial[static_cast<std::size_t>(n)];
  }
  return std::ldexp(sum, static_cast<int>(k));
}

std::int64_t round_to_integer(double x) { return static_cast<std::int64_t>(std::floor(x + 0.5)); }

std::vector<Node> gauss_nodes(double from, double to, std::size_t panels) {
  static const std::array<Node, kGaussOrder> unit = make_gauss();
  const double half = 0.5 * (to - from) / static_cast<double>(panels);
  std::vector<Node> nodes;
  nodes.reserve(panels * kGaussOrder);
  for (std::size_t panel = 0; panel < panels; ++panel) {
    const double centre = from + half * (2.0 * static_cast<double>(panel) + 1.0);
    for (const Node& node : unit) {
      nodes.push_back({centre + half * node.x, half * node.weight});
    }
  }
  return nodes;
}

}  // namespace leadline::host::exact
