#include "model/base/decibel.hpp"

#include <array>
#include <cstddef>

namespace leadline::base {
namespace {

/// 2^(-2^-i) in Q30, i = 1 .. 16.
constexpr std::array<std::int64_t, 16> kRoots_q30{
    759'250'125,   902'905'651,   984'625'594,   1'028'218'693, 1'050'733'751, 1'062'175'491,
    1'067'942'999, 1'070'838'486, 1'072'289'173, 1'073'015'252, 1'073'378'477, 1'073'560'135,
    1'073'650'976, 1'073'696'399, 1'073'719'111, 1'073'730'468};

}  // namespace

std::uint16_t amplitude_of_attenuation(std::int64_t attenuation_mdb) {
  constexpr std::int64_t kSilence_mdb = 120'000;
  if (attenuation_mdb <= 0) {
    return 65535;
  }
  if (attenuation_mdb >= kSilence_mdb) {
    return 0;
  }
  // log2(10) / 20 octaves a decibel.
  const std::int64_t octaves_q16 = (attenuation_mdb * 713'379) >> 16;
  const std::int64_t whole = octaves_q16 >> 16;
  std::int64_t value_q30 = std::int64_t{1} << 30U;
  for (std::size_t i = 0; i < kRoots_q30.size(); ++i) {
    if ((octaves_q16 & (std::int64_t{0x8000} >> i)) != 0) {
      value_q30 = (value_q30 * kRoots_q30[i]) >> 30;
    }
  }
  const std::int64_t scaled = (value_q30 * 65535) >> whole;
  return static_cast<std::uint16_t>((scaled + (std::int64_t{1} << 29U)) >> 30);
}

}  // namespace leadline::base
