#include <cstdio>
#include <fstream>
#include <string>

#include "firmware/config/exit_codes.hpp"
#include "firmware/config/tide_file.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::firmware::kMaxTidePoints;
using leadline::firmware::WaterConfig;
using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::load_tide;
using leadline::host::parse_tide;
using leadline::host::VehicleFile;

// 2026-11-22T23:00:00Z
constexpr std::int64_t kEvening_us = 1'795'388'400'000'000;

WaterConfig tide_of(const std::string& text, std::int64_t now_us = 0) {
  WaterConfig water{};
  parse_tide(text, "tide.csv", kEvening_us, now_us, &water);
  return water;
}

std::string error_of(const std::string& text) {
  try {
    (void)tide_of(text);
  } catch (const HostError& error) {
    assert_true(error.code() == ExitCode::kInput);
    return error.what();
  }
  fail_msg("accepted: %s", text.c_str());
  return "";
}

TEST(both_forms_of_time_become_the_vehicle_s) {
  const WaterConfig water = tide_of(
      "# gauge at the pier\ntime,height\n2026-11-22T22:50:00Z, -0.25\r\n\n"
      "1795388400, 0.1 # now\n2026-11-22T23:10:00Z,1\n");
  assert_int_equal(water.tide_count, 3);
  assert_int_equal(water.tide[0].t_us, -600'000'000);
  assert_int_equal(water.tide[0].height_mm, -250);
  assert_int_equal(water.tide[1].t_us, 0);
  assert_int_equal(water.tide[1].height_mm, 100);
  assert_int_equal(water.tide[2].t_us, 600'000'000);
  assert_int_equal(water.tide[2].height_mm, 1000);
}

TEST(of_a_long_tide_the_part_that_is_to_come_is_kept) {
  std::string text;
  for (int i = 0; i < 200; ++i) {
    text += std::to_string(1'795'388'400 + 600 * i) + "," + std::to_string(0.01 * i) + "\n";
  }
  WaterConfig water = tide_of(text, 50 * 600'000'000LL + 1);
  assert_int_equal(water.tide_count, kMaxTidePoints);
  assert_int_equal(water.tide[0].height_mm, 500);
  // Before it all, and at its end.
  assert_int_equal(tide_of(text, -1).tide[0].height_mm, 0);
  water = tide_of(text, 190 * 600'000'000LL);
  assert_int_equal(water.tide_count, kMaxTidePoints);
  assert_int_equal(water.tide[kMaxTidePoints - 1].height_mm, 1990);
}

TEST(mistakes_are_named_with_their_line) {
  assert_int_equal(error_of("t,h\n2026-11-22T23:00:00Z\n").rfind("tide.csv:2: has to be UTC", 0),
                   0);
  assert_int_equal(error_of("1,1\nx,1\n").rfind("tide.csv:2: has to be UTC", 0), 0);
  assert_int_equal(error_of("1,1e3\n").rfind("tide.csv:1: has to be UTC", 0), 0);
  assert_int_equal(error_of("1,nan\n").rfind("tide.csv:1: has to be UTC", 0), 0);
  assert_int_equal(error_of("1e300,1\n").rfind("tide.csv:1: has to be UTC", 0), 0);
  assert_int_equal(error_of("5,1\n5,1\n").rfind("tide.csv:2: has to be later", 0), 0);
  assert_int_equal(error_of("0,1\n9000000,1\n").rfind("tide.csv:2: has to be later", 0), 0);
  assert_int_equal(error_of("# nothing\n").rfind("tide.csv:1: no tide", 0), 0);
}

TEST(the_file_that_is_named_is_read) {
  VehicleFile file;
  load_tide(&file, 0, 0);
  assert_int_equal(file.config.water.tide_count, 0);
  file.tide_path = "no-such-tide.csv";
  bool refused = false;
  try {
    load_tide(&file, 0, 0);
  } catch (const HostError& error) {
    refused = error.code() == ExitCode::kInput;
  }
  assert_true(refused);
  file.tide_path = "test_tide_file.csv";
  std::ofstream(file.tide_path) << "100,0.5\n";
  load_tide(&file, 99'000'000, 0);
  std::remove(file.tide_path.c_str());
  assert_int_equal(file.config.water.tide_count, 1);
  assert_int_equal(file.config.water.tide[0].t_us, 1'000'000);
}

}  // namespace
