#include <memory>

#include "host_tools/exit_codes.hpp"
#include "host_tools/map_command.hpp"
#include "host_tools/model_file.hpp"
#include "host_tools/survey_map.hpp"
#include "model/capacity.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::Pose;
using leadline::base::ReturnKind;
using leadline::host::ExitCode;
using leadline::host::format_stats_json;
using leadline::host::HostError;
using leadline::host::MapConfig;
using leadline::host::MapStats;
using leadline::host::parse_map_config;
using leadline::host::parse_model_file;
using leadline::host::PingRow;
using leadline::host::row_to_records;
using leadline::host::SavedModel;
using leadline::host::SurveyMap;
using leadline::host::SurveyMapCounters;
using leadline::test::assert_contains;

MapConfig config_of(const std::string& size = "[16, 12, 8]", const std::string& sonar = "") {
  return parse_map_config(
      "[grid]\ncell_mm = 1000\nsize = " + size +
          "\norigin_mm = [2000, -3500, 10000]\n[sonar]\nbeam_half_angle_deg = 3\n"
          "sigma_pointing_deg = 1\nsigma_range_mm = 200\nmin_range_mm = 500\n"
          "max_range_mm = 60000\n" +
          sonar + "[navigation]\nsigma_position_mm = [100.4, 100.6, 50]\n",
      "c.toml", "");
}

/// Straight down from 2 m depth onto a bottom at 14 m.
PingRow down_at(std::int64_t north_mm, std::int64_t east_mm, std::int64_t range_um = 12'000'000) {
  PingRow row{};
  row.position_um[0] = north_mm * 1000;
  row.position_um[1] = east_mm * 1000;
  row.position_um[2] = 2'000'000;
  row.elevation_bam32 = leadline::base::kBam32QuarterTurn;
  row.range_um = range_um;
  row.has_range = true;
  return row;
}

std::string usage_error(const MapConfig& config, std::uint32_t budget = 0) {
  std::string message;
  ExitCode code = ExitCode::kOk;
  try {
    const SurveyMap map(config, "c.toml", budget);
  } catch (const HostError& error) {
    message = error.what();
    code = error.code();
  }
  assert_int_equal(code, ExitCode::kUsage);
  assert_true(message.find("c.toml:") == 0);
  return message;
}

TEST(a_row_becomes_the_records_of_the_vehicle) {
  PingRow row = down_at(-1500, 2500, 30'000'000);
  row.t_us = 77;
  row.attitude = {1, 2, 3};
  row.azimuth_bam32 = 4;
  Ping ping{};
  Pose pose{};
  row_to_records(row, config_of(), &ping, &pose);
  assert_int_equal(ping.t_transmit_us, 77);
  assert_int_equal(ping.t_receive_us, 77 + 40'000);  // 60 m at 1,500 m/s
  assert_int_equal(ping.azimuth_bam32, 4);
  assert_int_equal(ping.elevation_bam32, leadline::base::kBam32QuarterTurn);
  assert_int_equal(ping.kind, ReturnKind::kRange);
  assert_int_equal(ping.range_um, 30'000'000);
  assert_int_equal(pose.t_us, 77);
  assert_int_equal(pose.position_um[0], -1'500'000);
  assert_int_equal(pose.position_um[1], 2'500'000);
  assert_int_equal(pose.attitude.heading_bam32, 3);
  assert_int_equal(pose.covariance.sigma_position_mm[0], 100);
  assert_int_equal(pose.covariance.sigma_position_mm[1], 101);
  assert_int_equal(pose.validity, leadline::base::kPoseAll);

  row.has_range = false;
  row.range_um = 0;
  row_to_records(row, config_of(), &ping, &pose);
  assert_int_equal(ping.kind, ReturnKind::kNoReturn);
  assert_int_equal(ping.t_receive_us, 77);
}

TEST(depths_land_in_their_cells) {
  SurveyMap map(config_of(), "c.toml");
  // Over the cell north 3..4, east 5..6 of the grid: 5.5 m north, 2.0 m east.
  for (int i = 0; i < 50; ++i) {
    assert_null(map.integrate(down_at(5500, 2000)));
  }
  map.extract();
  const auto& elevation = map.elevation();
  assert_int_equal(elevation.rows, 16);
  assert_int_equal(elevation.columns, 12);
  assert_near(elevation.west_m, -3.5, 0);
  assert_near(elevation.south_m, 2.0, 0);
  assert_near(elevation.at(15 - 3, 5), -14.0, 0.3);
  assert_true(map.sigma().at(15 - 3, 5) > 0);
  assert_true(std::isnan(elevation.at(0, 0)));
  assert_true(std::isnan(map.sigma().at(0, 0)));
}

TEST(rows_that_the_model_refuses_are_named_and_write_nothing) {
  SurveyMap map(config_of(), "c.toml");
  assert_string_equal(map.integrate(down_at(5500, 2000, 499'999)), "range_below_min");
  assert_string_equal(map.integrate(down_at(5500, 2000, 0)), "range_below_min");
  assert_string_equal(map.integrate(down_at(5500, 2000, 60'000'001)), "range_above_max");
  assert_string_equal(map.integrate(down_at(500'000'000, 2000)), "too_far_from_grid");
  assert_int_equal(map.counters().voxel_updates, 0);
  assert_near(map.counters().known_fraction, 0, 0);
  assert_near(map.counters().entropy_bits, 16 * 12 * 8, 0);
  assert_null(map.integrate(down_at(5500, 2000, 500'000)));
}

TEST(the_saved_model_holds_every_voxel) {
  SurveyMap map(config_of("[5, 19, 8]"), "c.toml");  // tiles are padded in both directions
  for (int i = 0; i < 40; ++i) {
    assert_null(map.integrate(down_at(2000 + i * 120, -3000 + i * 400)));
  }
  const SurveyMapCounters counters = map.counters();
  const SavedModel saved = parse_model_file(map.save(), "m.llm");  // recomputes the hash
  assert_int_equal(saved.map_hash, counters.map_hash);
  assert_int_equal(saved.table.crc32c, counters.table_crc);
  std::uint64_t known = 0;
  for (const auto& voxel : saved.voxels) {
    known += voxel.hit != 0 || voxel.miss != 0 ? 1 : 0;
  }
  assert_true(known > 0);
  assert_near(counters.known_fraction, static_cast<double>(known) / (5 * 19 * 8), 1e-15);
  assert_true(counters.max_voxels_per_ping <= counters.work_bound);
  assert_true(counters.entropy_bits < 5 * 19 * 8);
}

TEST(configurations_over_capacity_are_refused_with_the_numbers) {
  assert_contains(usage_error(config_of("[16001, 16, 16]")), "over the capacity of 16000 cells");
  assert_contains(usage_error(config_of("[16, 16, 1025]")), "over the capacity of 1024 cells");
  const std::string message = usage_error(config_of("[2000, 2000, 1000]"));
  assert_contains(message, "4000000000 voxels");
  assert_contains(message,
                  "over the capacity of " + std::to_string(leadline::model::kVoxelCapacity));
  MapConfig far = config_of();
  far.sonar.max_range_mm = 8'000'001;
  assert_contains(usage_error(far), "at most 8000 cells = 8000000 mm");
}

TEST(work_over_the_budget_is_refused_with_the_numbers) {
  std::uint64_t bound = 0;
  {
    const SurveyMap map(config_of(), "c.toml");
    bound = map.counters().work_bound;
  }
  const std::string message = usage_error(config_of(), static_cast<std::uint32_t>(bound - 1));
  assert_contains(message, "up to " + std::to_string(bound) + " voxels");
  assert_contains(message, "the budget is " + std::to_string(bound - 1));
  const SurveyMap fits(config_of(), "c.toml", static_cast<std::uint32_t>(bound));
}

TEST(a_second_map_starts_empty) {
  for (int round = 0; round < 2; ++round) {
    SurveyMap map(config_of(), "c.toml");
    assert_near(map.counters().known_fraction, 0, 0);
    assert_null(map.integrate(down_at(5500, 2000)));
    assert_true(map.counters().known_fraction > 0);
  }
}

TEST(statistics_have_the_keys_of_the_contract_in_order) {
  MapStats stats;
  stats.pings = 5;
  stats.rejected = {{"missing", 1}, {"not_finite", 2}};
  stats.counters.table_crc = 0x1234;
  stats.counters.map_hash = 0xabcdef;
  stats.counters.bytes_per_voxel = 4;
  stats.integrate_seconds = 0.25;
  assert_string_equal(
      format_stats_json(stats).c_str(),
      "{\n  \"pings\": 5,\n  \"rejected\": {\"missing\": 1, \"not_finite\": 2},\n"
      "  \"voxel_updates\": 0,\n  \"max_voxels_per_ping\": 0,\n  \"work_bound\": 0,\n"
      "  \"integrate_seconds\": 0.25,\n  \"extract_seconds\": 0,\n  \"bytes_per_voxel\": 4,\n"
      "  \"entropy_bits\": 0,\n  \"known_fraction\": 0,\n  \"table_crc\": \"0x00001234\",\n"
      "  \"map_hash\": \"0x0000000000abcdef\"\n}\n");
}

}  // namespace
