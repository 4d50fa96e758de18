// The tide under a vehicle.
#include "firmware/pipeline/water_level.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::firmware::tide_sound;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::firmware::water_level_um;
using leadline::firmware::WaterConfig;

WaterConfig tide_of_two() {
  WaterConfig water{};
  water.tide_count = 2;
  water.tide[0] = {1'000'000, -500};
  water.tide[1] = {3'601'000'000, 700};
  return water;
}

TEST(the_level_is_linear_between_the_points_and_stays_beyond) {
  const WaterConfig water = tide_of_two();
  assert_int_equal(water_level_um(water, -5), -500'000);
  assert_int_equal(water_level_um(water, 1'000'000), -500'000);
  assert_int_equal(water_level_um(water, 1'801'000'000), 100'000);
  assert_int_equal(water_level_um(water, 901'000'000), -200'000);
  assert_int_equal(water_level_um(water, 3'601'000'000), 700'000);
  assert_int_equal(water_level_um(water, INT64_MAX), 700'000);
  assert_int_equal(water_level_um(WaterConfig{}, 77), 0);
  // The longest gap and the highest rise: nothing overflows.
  WaterConfig most = water;
  most.tide[0] = {0, -100'000};
  most.tide[1] = {31LL * 86'400 * 1'000'000, 100'000};
  assert_true(tide_sound(most));
  assert_in_range(water_level_um(most, most.tide[1].t_us - 1) - 99'999'000, 0, 1'000);
}

TEST(a_tide_that_cannot_be_is_refused) {
  assert_true(tide_sound(tide_of_two()));
  const auto refused = [](auto change) {
    WaterConfig water = tide_of_two();
    change(water);
    return !tide_sound(water);
  };
  assert_true(refused([](WaterConfig& w) { w.tide_count = 65; }));
  assert_true(refused([](WaterConfig& w) { w.tide[1].t_us = w.tide[0].t_us; }));
  assert_true(refused([](WaterConfig& w) { w.tide[1].t_us = 32LL * 86'400 * 1'000'000; }));
  assert_true(refused([](WaterConfig& w) { w.tide[1].t_us = INT64_MAX; }));
  assert_true(refused([](WaterConfig& w) { w.tide[0].t_us = INT64_MIN; }));
  assert_true(refused([](WaterConfig& w) { w.tide[0].height_mm = -100'001; }));
  assert_true(refused([](WaterConfig& w) { w.tide[0].height_mm = 100'001; }));
}

Vehicle vehicle;

/// How deep the vehicle takes itself to be, below the zero, after a flight at 2 m below the surface.
std::int64_t down_um(const WaterConfig& water) {
  VehicleConfig config = leadline::test::rig_config();
  config.water = water;
  leadline::test::configure_rig(vehicle, config);
  leadline::test::RigOptions options;
  options.seconds = 10;
  options.roll_deg = 0;
  static_cast<void>(leadline::test::fly(vehicle, options));
  return vehicle.latest_pose().position_um[2];
}

TEST(high_water_lifts_the_vehicle_over_the_zero_of_depth) {
  const std::int64_t plain_um = down_um(WaterConfig{});
  assert_in_range(plain_um, 1'980'000, 2'020'000);
  WaterConfig high{};
  high.tide_count = 1;
  high.tide[0] = {0, 1'500};
  assert_in_range(down_um(high) - plain_um + 1'500'000, 0, 2'000);
  // One that rises 0.1 m/s: at the end of the flight the level is that of the newest samples.
  WaterConfig rising = high;
  rising.tide_count = 2;
  rising.tide[0] = {0, 0};
  rising.tide[1] = {10'000'000, 1'000};
  assert_in_range(down_um(rising) - plain_um + 1'100'000, 0, 200'000);
}

}  // namespace
