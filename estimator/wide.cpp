#include "estimator/wide.hpp"

namespace leadline::estimator {
namespace {

std::uint64_t magnitude(std::int64_t value) {
  const auto bits = static_cast<std::uint64_t>(value);
  return value < 0 ? 0U - bits : bits;
}

// Magnitude with its sign, limited.
std::int64_t with_sign(std::uint64_t value, bool negative) {
  const std::int64_t limited =
      value > static_cast<std::uint64_t>(INT64_MAX) ? INT64_MAX : static_cast<std::int64_t>(value);
  return negative ? -limited : limited;
}

// floor(product / divisor) and whether the rest is half of the divisor or more; product.high < divisor.
std::uint64_t divide(Wide product, std::uint64_t divisor, bool& round_up) {
  std::uint64_t rest = product.high;
  std::uint64_t low = product.low;
  for (int bit = 0; bit < 64; ++bit) {
    // divisor < 2^63: rest never loses a bit.
    rest = (rest << 1U) | (low >> 63U);
    low <<= 1U;
    if (rest >= divisor) {
      rest -= divisor;
      low |= 1U;
    }
  }
  round_up = rest >= divisor - rest;
  return low;
}

}  // namespace

Wide multiply(std::uint64_t a, std::uint64_t b) {
  constexpr std::uint64_t kLow = 0xFFFFFFFFU;
  const std::uint64_t low = (a & kLow) * (b & kLow);
  const std::uint64_t middle1 = (a >> 32U) * (b & kLow) + (low >> 32U);
  const std::uint64_t middle2 = (a & kLow) * (b >> 32U) + (middle1 & kLow);
  return Wide{(a >> 32U) * (b >> 32U) + (middle1 >> 32U) + (middle2 >> 32U),
              (middle2 << 32U) | (low & kLow)};
}

std::int64_t mul_div(std::int64_t a, std::int64_t b, std::int64_t c) {
  const bool negative = (a < 0) != (b < 0);
  const std::uint64_t divisor = c < 1 ? 1U : static_cast<std::uint64_t>(c);
  const Wide product = multiply(magnitude(a), magnitude(b));
  if (product.high == 0) {
    const std::uint64_t quotient = product.low / divisor;
    const std::uint64_t rest = product.low % divisor;
    return with_sign(quotient + (rest >= divisor - rest ? 1U : 0U), negative);
  }
  if (product.high >= divisor) {
    return with_sign(UINT64_MAX, negative);
  }
  bool round_up = false;
  const std::uint64_t quotient = divide(product, divisor, round_up);
  return with_sign(quotient == UINT64_MAX ? quotient : quotient + (round_up ? 1U : 0U), negative);
}

std::int64_t mul_round(std::int64_t a, std::int64_t b, int shift) {
  const bool negative = (a < 0) != (b < 0);
  Wide product = multiply(magnitude(a), magnitude(b));
  const auto places = static_cast<std::uint32_t>(shift);
  const std::uint64_t half = std::uint64_t{1} << (places - 1U);
  product.high += product.low + half < half ? 1U : 0U;
  product.low += half;
  if ((product.high >> places) != 0) {
    return with_sign(UINT64_MAX, negative);
  }
  return with_sign((product.high << (64U - places)) | (product.low >> places), negative);
}

std::int64_t add_limited(std::int64_t a, std::int64_t b) {
  if (b > 0 && a > INT64_MAX - b) {
    return INT64_MAX;
  }
  if (b < 0 && a < -INT64_MAX - b) {
    return -INT64_MAX;
  }
  return a + b;
}

}  // namespace leadline::estimator
