// Pseudo-random numbers that are the same on every host and standard library: std::mt19937 is
// portable, but std::normal_distribution and std::uniform_real_distribution are not.
#pragma once

#include <cmath>
#include <cstdint>

#include "host_tools/sim/exact_math.hpp"

namespace leadline::host {

/// xoshiro256** by Blackman and Vigna (public domain algorithm), seeded through splitmix64.
/// Copyable; a copy continues the same sequence. Not thread safe.
class Random {
 public:
  /// Streams with one seed and different `stream` numbers are independent: the survey plan, the range
  /// noise, the drift... each own one, so that switching one error off leaves the others unchanged.
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0) {
    std::uint64_t mix = seed ^ (stream * 0xD1B54A32D192ED03ULL);
    for (std::uint64_t& word : state_) {
      mix += 0x9E3779B97F4A7C15ULL;
      std::uint64_t z = mix;
      z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
      z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
      word = z ^ (z >> 31);
    }
  }

  std::uint64_t next_u64() {
    const std::uint64_t result = rotate_left(state_[1] * 5, 7) * 9;
    const std::uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = rotate_left(state_[3], 45);
    return result;
  }

  /// Uniform in [0, 1), 53 bits.
  double uniform() { return static_cast<double>(next_u64() >> 11) * 0x1.0p-53; }

  /// Uniform in [low, high).
  double uniform(double low, double high) { return low + (high - low) * uniform(); }

  /// Standard normal (Box-Muller; the second value of each pair is kept for the next call).
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * exact::log(1.0 - uniform()));
    const exact::SinCos turn = exact::sin_cos(2.0 * exact::kPi * uniform());
    spare_ = radius * turn.sin;
    has_spare_ = true;
    return radius * turn.cos;
  }

 private:
  static std::uint64_t rotate_left(std::uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }

  std::uint64_t state_[4] = {};
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace leadline::host
