#include <vector>

#include "model/base/crc32c.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::crc32c;
using leadline::test::Random;

/// Bit by bit, from the polynomial as written.
std::uint32_t reference(const std::vector<std::uint8_t>& data) {
  std::uint32_t state = 0xFFFFFFFFU;
  for (const std::uint8_t byte : data) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      const bool out = ((state ^ (static_cast<std::uint32_t>(byte) >> bit)) & 1U) != 0;
      state >>= 1U;
      if (out) {
        state ^= 0x82F63B78U;
      }
    }
  }
  return ~state;
}

/// RFC 3720, appendix B.4, and the check value of the catalogues.
TEST(published_vectors) {
  assert_int_equal(crc32c("123456789", 9), 0xE3069283U);
  assert_int_equal(crc32c(nullptr, 0), 0);
  const std::vector<std::uint8_t> zeros(32, 0x00);
  assert_int_equal(crc32c(zeros.data(), zeros.size()), 0x8A9136AAU);
  const std::vector<std::uint8_t> ones(32, 0xFF);
  assert_int_equal(crc32c(ones.data(), ones.size()), 0x62A8AB43U);
  std::vector<std::uint8_t> rising(32);
  for (std::size_t i = 0; i < rising.size(); ++i) {
    rising[i] = static_cast<std::uint8_t>(i);
  }
  assert_int_equal(crc32c(rising.data(), rising.size()), 0x46DD794EU);
}

TEST(equals_the_bitwise_definition_whole_and_in_two_parts) {
  Random random(1);
  for (std::size_t size = 0; size < 300; ++size) {
    std::vector<std::uint8_t> data(size);
    for (auto& byte : data) {
      byte = static_cast<std::uint8_t>(random.next());
    }
    const std::uint32_t expected = reference(data);
    assert_int_equal(crc32c(data.data(), size), expected);
    const auto cut = static_cast<std::size_t>(random.between(0, static_cast<std::int64_t>(size)));
    assert_int_equal(crc32c(data.data() + cut, size - cut, crc32c(data.data(), cut)), expected);
  }
}

}  // namespace
