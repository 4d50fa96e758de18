// CMocka for C++: the one header a test includes.
//
//   #include "tests/support/test.hpp"
//
//   TEST(crc_of_the_check_string) { assert_int_equal(crc32c("123456789", 9), 0xE3069283U); }
//
// A test registers itself; main() comes with the library leadline_test_support and understands
//   <program> [--list] [--seed N] [PATTERN]        (PATTERN: * and ? as in the shell)
// Exit code: 0 passed, 77 every test was skipped (ctest reports "Skipped"), otherwise failed.
//
// CMocka ends a failed test with longjmp. Destructors of objects that live in the test body do not
// run then: fine for memory, so keep nothing else (no files that must vanish, no threads) across an
// assertion. An exception that escapes a test body fails that test.
#pragma once

// cmocka.h wants these before it and has no C++ guards of its own.
#include <csetjmp>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
extern "C" {
#include <cmocka.h>
}
// CMocka's macros cast in C style.
#pragma GCC diagnostic ignored "-Wold-style-cast"
// fail() would also rewrite std::ifstream::fail(); fail_msg stays, without it.
#undef fail
#undef fail_msg
// A common name of members; here a test is skipped by skip_test().
#undef skip
#define fail_msg(...) \
  (print_error("ERROR: " __VA_ARGS__), print_error("\n"), _fail(__FILE__, __LINE__))

#include <cmath>
#include <string>

namespace leadline::test {

using Body = void (*)();

/// Puts a test on the program's list; used by TEST only.
struct Registration {
  Registration(const char* name, Body body);
};

/// Ends the running test as skipped, by an exception, and prints *skipped* with the reason.
[[noreturn]] void skip_test(const std::string& reason);

/// Folder of the shared data: $LEADLINE_DATA, by default ../shared/data beside the project.
std::string data_directory();

/// Full path of `relative` in data_directory(); skips the running test when it is not there.
std::string require_data(const std::string& relative);

/// Project root, for files that a test reads from the checkout.
std::string source_directory();

/// A fresh empty folder, removed when the program ends.
std::string scratch_directory();

/// Seed of every random choice: fixed, or --seed N, and printed when a test fails.
std::uint64_t seed();

/// SplitMix64: 64 random bits per call, the same on every machine (the standard distributions are
/// not). Copyable; no heap.
class Random {
 public:
  explicit Random(std::uint64_t stream = 0) : state_(seed() + stream * 0x9E3779B97F4A7C15U) {}
  explicit constexpr Random(std::uint64_t fixed_seed, int) : state_(fixed_seed) {}

  constexpr std::uint64_t next() {
    state_ += 0x9E3779B97F4A7C15U;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31U);
  }
  /// Uniform in [low, high], both inclusive (bias below 2^-32 for spans under 2^32).
  constexpr std::int64_t between(std::int64_t low, std::int64_t high) {
    const std::uint64_t span =
        static_cast<std::uint64_t>(high) - static_cast<std::uint64_t>(low) + 1;
    const std::uint64_t offset = span == 0 ? next() : next() % span;
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(low) + offset);
  }
  /// Uniform in [0, 1).
  constexpr double uniform() { return static_cast<double>(next() >> 11U) * 0x1.0p-53; }
  /// Standard normal (Box-Muller).
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return radius * std::cos(6.283185307179586 * uniform());
  }

 private:
  std::uint64_t state_;
};

void assert_near_impl(double actual, double expected, double tolerance, const char* expression,
                      const char* file, int line);

}  // namespace leadline::test

/// |actual - expected| <= tolerance; fails on NaN.
#define assert_near(actual, expected, tolerance)                                                 \
  ::leadline::test::assert_near_impl(static_cast<double>(actual), static_cast<double>(expected), \
                                     static_cast<double>(tolerance), #actual, __FILE__, __LINE__)

#define LEADLINE_TEST_NAME_(name) leadline_test_##name
#define TEST(name)                                                        \
  static void LEADLINE_TEST_NAME_(name)();                                \
  static const ::leadline::test::Registration leadline_test_entry_##name( \
      #name, &LEADLINE_TEST_NAME_(name));                                 \
  static void LEADLINE_TEST_NAME_(name)()
