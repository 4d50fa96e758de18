#include "model/base/angle.hpp"

#include <array>

#include "model/base/fixed.hpp"

namespace leadline::base {
namespace {

// atan(2^-i) in units of 2^-40 turn, i = 0 .. 31.
constexpr std::array<std::int64_t, 32> kArc_q40 = {
    137438953472, 81134951838, 42869480287, 21761217566, 10922836750, 5466743129, 2734038620,
    1367102738,   683561799,   341782203,   170891265,   85445653,    42722829,   21361415,
    10680707,     5340354,     2670177,     1335088,     667544,      333772,     166886,
    83443,        41722,       20861,       10430,       5215,        2608,       1304,
    652,          326,         163,         81,
};

constexpr int kWorking_bits = 58;  // the length grows by 1.65 * sqrt(2): below 2^60

}  // namespace

Bam32 atan2_bam32(std::int64_t y, std::int64_t x) {
  if (x == 0 && y == 0) {
    return 0;
  }
  // Into the right half plane, where the steps converge.
  const bool behind = x < 0;
  std::int64_t u = behind ? -x : x;
  std::int64_t v = behind ? -y : y;
  const std::int64_t v_size = v < 0 ? -v : v;
  const std::int64_t longer = u > v_size ? u : v_size;
  const int shift = kWorking_bits - (64 - leading_zeros64(static_cast<std::uint64_t>(longer)));
  if (shift >= 0) {
    u *= std::int64_t{1} << shift;
    v *= std::int64_t{1} << shift;
  } else {
    u >>= -shift;
    v >>= -shift;
  }
  std::int64_t angle_q40 = 0;
  for (std::size_t i = 0; i < kArc_q40.size(); ++i) {
    const std::int64_t u_part = u >> i;
    const std::int64_t v_part = v >> i;
    if (v > 0) {
      u += v_part;
      v -= u_part;
      angle_q40 += kArc_q40[i];
    } else {
      u -= v_part;
      v += u_part;
      angle_q40 -= kArc_q40[i];
    }
  }
  const std::int64_t rounded = (angle_q40 + 128) >> 8;
  return static_cast<Bam32>(static_cast<std::uint64_t>(rounded)) +
         (behind ? kBam32HalfTurn : Bam32{0});
}

}  // namespace leadline::base
