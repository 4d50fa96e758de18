// Special functions of the table generator, the same bits on every host: + - * / and sqrt only,
// fixed iteration orders, on top of host_tools/sim/exact_math.hpp. Compile with -ffp-contract=off.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "host_tools/sim/exact_math.hpp"

namespace leadline::host::exact {

/// Second positive zero of J1: where the piston's first sidelobe ends.
inline constexpr double kJ1SecondZero = 7.015586669815619;

/// Bessel function J1(x), 0 <= x <= 1e4; absolute error below 1e-13.
[[nodiscard]] double bessel_j1(double x);

/// e^-x I0(x) and e^-x I1(x), x >= 0; relative error below 1e-12.
[[nodiscard]] double bessel_i0e(double x);
[[nodiscard]] double bessel_i1e(double x);

/// arccos of `x`, arguments outside [-1, 1] (rounding) count as the nearer end; error below 1e-14
/// plus that of the argument.
[[nodiscard]] double acos(double x);
/// Arc sine likewise.
[[nodiscard]] double asin(double x);

/// e^x for -700 <= x <= 700, faster than exp(); relative error below 1e-14. 0 below -700.
[[nodiscard]] double exp_fast(double x);

/// Nearest integer, halves upwards; |x| < 2^52.
[[nodiscard]] std::int64_t round_to_integer(double x);

/// One node of a quadrature rule.
struct Node {
  double x;
  double weight;
};

/// Gauss-Legendre nodes over [from, to], cut into `panels` equal parts of 8 nodes each: exact for
/// polynomials of degree 15 in each part.
[[nodiscard]] std::vector<Node> gauss_nodes(double from, double to, std::size_t panels);

}  // namespace leadline::host::exact
