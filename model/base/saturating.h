// The integer kernels under the voxels, in the part of C that C++ shares: the one source of both, and the
// form in which toolchain/prove.sh has Frama-C prove, for every input that a contract admits, that nothing
// overflows, divides by zero, shifts too far or leaves its stated range. The contracts are the comments
// that begin with an at sign (ACSL); what they do not say is in toolchain/prove.sh --help.
//
// All are total within their contract, O(1), and free of state. C++ finds them in leadline::base.
#ifndef LEADLINE_MODEL_BASE_SATURATING_H
#define LEADLINE_MODEL_BASE_SATURATING_H

#ifdef __cplusplus
#include <cstdint>
#define LEADLINE_KERNEL [[nodiscard]] constexpr
#define LEADLINE_CAST(type, value) static_cast<type>(value)
namespace leadline::base {
using std::int32_t;
using std::int64_t;
using std::uint16_t;
using std::uint32_t;
using std::uint64_t;
#else
#include <stdint.h>
#define LEADLINE_KERNEL static inline
#define LEADLINE_CAST(type, value) ((type)(value))
#endif

// ----------------------------------------------------------------------------------------------------
// Evidence of a voxel: two halves of 16 bits that saturate

/// Saturating sum of half a voxel and an increment.
/*@ requires value <= 0xFFFF;
    requires increment <= 0xFFFF0000;
    assigns \nothing;
    ensures value + increment <= 0xFFFF ==> \result == value + increment;
    ensures value + increment > 0xFFFF ==> \result == 0xFFFF; */
LEADLINE_KERNEL uint16_t saturated_sum(uint32_t value, uint32_t increment) {
  const uint32_t sum = value + increment;
  return LEADLINE_CAST(uint16_t, sum > 0xFFFFU ? 0xFFFFU : sum);
}

/// Units of evidence of one voxel: the product of a tap of a kernel and a weight (at most 255 units), both
/// with their dither. A tap of 32768 is the whole weight.
/*@ requires tap_q15 <= 32768;
    requires weight_q7 <= 32640;
    requires dither_q22 <= 0x3FFFC0;
    assigns \nothing;
    ensures \result <= 255;
    ensures \result == (tap_q15 * weight_q7 + dither_q22) >> 22; */
LEADLINE_KERNEL uint32_t rounded_units(uint32_t tap_q15, uint32_t weight_q7, uint32_t dither_q22) {
  //@ assert tap_q15 * weight_q7 <= 32768 * 32640;
  return (tap_q15 * weight_q7 + dither_q22) >> 22U;
}

/// Half a voxel pulled towards `target` by a share of the way, rounded by the dither: never beyond.
/*@ requires 0 <= target <= 65535;
    requires 0 <= share_q15 <= 32768;
    requires 0 <= dither_q15 <= 32767;
    assigns \nothing;
    ensures half <= target ==> half <= \result <= target;
    ensures half >= target ==> target <= \result <= half; */
LEADLINE_KERNEL uint16_t pulled_half(uint16_t half, uint32_t target, uint32_t share_q15,
                                     uint32_t dither_q15) {
  // As a mean of the two with weights that sum to one: nothing negative is ever shifted.
  const uint32_t kept_q15 = 32768U - share_q15;
  //@ assert half <= target ==> half * kept_q15 + target * share_q15 <= target * 32768;
  //@ assert half <= target ==> half * kept_q15 + target * share_q15 >= half * 32768;
  //@ assert half >= target ==> half * kept_q15 + target * share_q15 <= half * 32768;
  //@ assert half >= target ==> half * kept_q15 + target * share_q15 >= target * 32768;
  return LEADLINE_CAST(uint16_t, (half * kept_q15 + target * share_q15 + dither_q15) / 32768U);
}

/// The certainty factor x, hit less miss, after an event of `signal_q16` (0 .. 65535: against .. for) with
/// a share of a voxel; see Rule::kCertaintyFactor.
/*@ requires -65535 <= x <= 65535;
    requires 0 <= signal_q16 <= 65535;
    requires 0 <= share_q15 <= 32768;
    requires 0 <= dither_q15 <= 32767;
    assigns \nothing;
    ensures -65535 <= \result <= 65535; */
LEADLINE_KERNEL int32_t pulled_certainty(int32_t x, int32_t signal_q16, int32_t share_q15,
                                         int32_t dither_q15) {
  const int64_t lean = 2 * signal_q16 - 65535;
  //@ assert -65535 <= lean <= 65535;
  const int64_t y_q31 = lean * share_q15;
  //@ assert -65535 * 32768 <= y_q31 <= 65535 * 32768;
  const int64_t size = x < 0 ? -x : x;
  const int64_t room_q16 = (x > 0 && y_q31 > 0) || (x < 0 && y_q31 < 0) ? 65535 - size : 65535;
  //@ assert 0 <= room_q16 <= 65535;
  //@ assert -65535 * 32768 * 65535 <= y_q31 * room_q16 <= 65535 * 32768 * 65535;
  // Shifted up by 2^17 units for the division, so that it rounds down on either side of zero.
  const int64_t above_q15 = y_q31 * room_q16 / 65535 + dither_q15 + 0x100000000;
  const int64_t sum = x + above_q15 / 32768 - 0x20000;
  return LEADLINE_CAST(int32_t, sum > 65535 ? 65535 : (sum < -65535 ? -65535 : sum));
}

// ----------------------------------------------------------------------------------------------------
// Fixed point

/// Product of two fixed-point numbers, shifted down, rounded towards minus infinity. That the product fits
/// is the caller's to see to; each use states its ranges.
/*@ requires -0x8000000000000000 <= a * b <= 0x7FFFFFFFFFFFFFFF;
    requires 0 <= shift <= 63;
    assigns \nothing;
    ensures \result == (a * b) >> shift; */
LEADLINE_KERNEL int64_t mul_shift(int64_t a, int64_t b, int shift) { return (a * b) >> shift; }

/// Newton's step of a square root of 32 bits whose first bit or second is set, from a start within the
/// upper half of 16 bits; the result has 16.
/*@ requires square >= 0x40000000;
    requires 0x8000 <= start <= 0xFFFF;
    assigns \nothing;
    ensures 0x4000 <= \result <= 0xFFFF; */
LEADLINE_KERNEL uint32_t root_step(uint32_t square, uint32_t start) {
  //@ assert 0x40000000 / 0xFFFF <= square / start <= 0xFFFFFFFF / 0x8000;
  const uint32_t root = (start + square / start) >> 1U;
  return root > 0xFFFFU ? 0xFFFFU : root;
}

#ifdef __cplusplus
}  // namespace leadline::base
#endif

#endif
