#include "firmware/pipeline/surface_reference.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::SurfaceReference;
using leadline::test::Random;

constexpr std::int64_t kConfigured_pa = 101'325;

/// Readings every 100 ms for `seconds`; how many could be used.
int feed(SurfaceReference& surface, TimeUs from_us, double seconds, std::int64_t pressure_pa,
         std::int64_t wave_pa = 0) {
  Random random(3);
  int usable = 0;
  for (TimeUs t = from_us; t < from_us + static_cast<TimeUs>(seconds * 1e6); t += 100'000) {
    std::int64_t reading = pressure_pa + random.between(-wave_pa, wave_pa);
    usable += surface.refer(t, kConfigured_pa, reading) ? 1 : 0;
  }
  return usable;
}

TEST(the_first_seconds_are_the_surface_and_what_follows_is_below_it) {
  SurfaceReference surface;
  assert_int_equal(feed(surface, 0, 6.0, 99'000, 2'000), 10);
  assert_int_equal(surface.state(), SurfaceReference::State::kKnown);
  assert_near(static_cast<double>(surface.offset_pa()), 99'000 - kConfigured_pa, 400);
  std::int64_t deep_pa = 99'000 + 100'000;
  assert_true(surface.refer(7'000'000, kConfigured_pa, deep_pa));
  assert_near(static_cast<double>(deep_pa), kConfigured_pa + 100'000, 400);
  surface.restart();
  assert_int_equal(surface.state(), SurfaceReference::State::kWaiting);
}

TEST(what_is_not_the_surface_is_refused_and_the_configured_pressure_counts) {
  SurfaceReference under_water;
  feed(under_water, 0, 6.0, kConfigured_pa + 30'000);
  assert_int_equal(under_water.state(), SurfaceReference::State::kRefused);
  std::int64_t pressure_pa = 150'000;
  assert_true(under_water.refer(7'000'000, kConfigured_pa, pressure_pa));
  assert_int_equal(pressure_pa, 150'000);
  SurfaceReference diving;  // readings about a mean that could be, but farther apart than waves
  for (TimeUs t = 0; t <= 5'000'000; t += 100'000) {
    std::int64_t reading = kConfigured_pa - 8'000 + t / 300;
    static_cast<void>(diving.refer(t, kConfigured_pa, reading));
  }
  assert_int_equal(diving.state(), SurfaceReference::State::kRefused);
}

TEST(few_readings_do_not_make_a_surface) {
  SurfaceReference surface;
  std::int64_t pressure_pa = 100'000;
  for (int i = 0; i + 1 < SurfaceReference::kLeastSamples; ++i) {
    assert_false(surface.refer(i * TimeUs{10'000'000}, kConfigured_pa, pressure_pa));
  }
  assert_true(surface.refer(50'000'000, kConfigured_pa, pressure_pa));
  assert_int_equal(pressure_pa, kConfigured_pa);
}

}  // namespace
