#include <cmath>
#include <string>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/store/merge.hpp"
#include "host_tools/store/store_command.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::align_maps;
using leadline::host::AlignedMap;
using leadline::host::CodedMap;
using leadline::host::difference_of;
using leadline::host::HostError;
using leadline::host::kNoValue;
using leadline::host::make_raster;
using leadline::host::MapDifference;
using leadline::host::MapSource;
using leadline::host::merge_maps;
using leadline::host::MergedMap;
using leadline::host::Raster;
using leadline::test::Random;

// A slope of 20 m depth, a metre down per ten metres east.
MapSource slope_map(const std::string& name, int columns, int rows, double west_m, double south_m,
                    double sigma_m) {
  MapSource map;
  map.origin = name;
  map.elevation = make_raster(columns, rows, west_m, south_m, 0.5);
  map.sigma = make_raster(columns, rows, west_m, south_m, 0.5, sigma_m);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      map.elevation.at(row, column) = -20.0 - 0.1 * map.elevation.east_of_column_m(column);
    }
  }
  return map;
}

std::string complaint(const std::vector<MapSource>& maps) {
  try {
    (void)align_maps(maps);
  } catch (const HostError& error) {
    return error.what();
  }
  return "";
}

void assert_says(const std::string& text, const std::string& part) {
  if (text.find(part) == std::string::npos) {
    fail_msg("\"%s\" does not say \"%s\"", text.c_str(), part.c_str());
  }
}

TEST(maps_beside_each_other_share_one_grid) {
  const std::vector<AlignedMap> maps =
      align_maps({slope_map("a", 20, 10, 0.0, 0.0, 0.1), slope_map("b", 20, 10, 5.0, -2.5, 0.1)});
  const Raster& grid = maps[0].elevation;
  assert_int_equal(grid.columns, 30);
  assert_int_equal(grid.rows, 15);
  assert_near(grid.west_m, 0.0, 1e-12);
  assert_near(grid.south_m, -2.5, 1e-12);
  assert_near(maps[1].shift_cells, 0.0, 0.0);
  // The north-west cell is a's, the south-east one b's, the middle both.
  assert_false(std::isnan(maps[0].elevation.at(0, 0)));
  assert_true(std::isnan(maps[1].elevation.at(0, 0)));
  assert_true(std::isnan(maps[0].elevation.at(14, 29)));
  assert_near(maps[1].elevation.at(14, 29), -20.0 - 0.1 * 14.75, 1e-12);
  assert_near(maps[1].elevation.at(5, 15), maps[0].elevation.at(5, 15), 1e-12);
}

TEST(cells_between_cells_are_interpolated) {
  // On a plane interpolation is exact, whatever the shift.
  for (const double shift_m : {0.1, 0.25, 0.49, -0.2}) {
    const std::vector<AlignedMap> maps = align_maps(
        {slope_map("a", 20, 10, 0.0, 0.0, 0.1), slope_map("b", 20, 10, shift_m, shift_m, 0.2)});
    assert_true(maps[1].shift_cells > 0.02);
    std::size_t known = 0;
    const Raster& grid = maps[1].elevation;
    for (int row = 0; row < grid.rows; ++row) {
      for (int column = 0; column < grid.columns; ++column) {
        if (!std::isnan(grid.at(row, column))) {
          assert_near(grid.at(row, column), -20.0 - 0.1 * grid.east_of_column_m(column), 1e-9);
          assert_near(maps[1].sigma.at(row, column), 0.2, 1e-9);
          ++known;
        }
      }
    }
    assert_int_equal(known, 19 * 9);
  }
}

TEST(origins_on_earth_are_brought_together) {
  MapSource a = slope_map("a", 40, 40, 0.0, 0.0, 0.1);
  MapSource b = slope_map("b", 40, 40, 0.0, 0.0, 0.1);
  a.reference.lat_deg = b.reference.lat_deg = 54.0;
  a.reference.lon_deg = 8.0;
  b.reference.lon_deg = 8.0 + 10.0 / 65'578.0;  // ten metres east
  const std::vector<AlignedMap> maps = align_maps({a, b});
  // b's west edge is column 20 of the common grid, but for the length of a degree (known to a millimetre here).
  assert_int_equal(maps[0].elevation.columns, 60);
  assert_true(std::isnan(maps[1].elevation.at(20, 19)));
  assert_near(maps[1].elevation.at(20, 20), -20.025, 1e-3);
  // The same across the antimeridian: 5 m west of it and 5 m east.
  a.reference.lon_deg = 180.0 - 5.0 / 65'578.0;
  b.reference.lon_deg = -180.0 + 5.0 / 65'578.0;
  assert_near(align_maps({a, b})[1].elevation.at(20, 20), -20.025, 1e-3);
  b.reference = {};
  assert_says(complaint({a, b}), "no place on Earth");
  b = slope_map("b", 40, 40, 0.0, 0.0, 0.1);
  b.elevation.cell_m = 1.0;
  a.reference = {};
  assert_says(complaint({a, b}), "b: has");
  b = slope_map("b", 40, 40, 0.0, 0.0, 0.1);
  b.sigma.reset();
  assert_says(complaint({a, b}), "no sigma");
  // Two origins so far apart that north is not north any more.
  b = slope_map("b", 4000, 4000, 0.0, 0.0, 0.1);
  a.reference.lat_deg = b.reference.lat_deg = 70.0;
  a.reference.lon_deg = 8.0;
  b.reference.lon_deg = 8.3;
  assert_says(complaint({a, b}), "turned");
}

template <typename Check>
std::string refusal(Check check) {
  try {
    check();
  } catch (const HostError& error) {
    return error.what();
  }
  return "";
}

TEST(the_evidence_of_one_survey_counts_once) {
  const MapSource a = slope_map("a", 20, 20, 0.0, 0.0, 0.1);
  // A later copy of the same survey: a third of it was seen again since.
  MapSource later = a;
  later.origin = "later";
  for (std::size_t k = 0; k < later.elevation.values.size(); k += 3) {
    later.elevation.values[k] += 0.01;
  }
  MapSource other = slope_map("other", 20, 20, 0.0, 0.0, 0.1);
  for (double& value : other.elevation.values) {
    value += 0.02;
  }
  const auto check = [](const std::vector<MapSource>& maps) {
    return refusal([&maps] { leadline::host::check_evidence(maps, align_maps(maps)); });
  };
  assert_says(check({a, a}), "a: 400 of the 400 cells");
  assert_says(check({a, other, later}), "later: 266 of the 400 cells that it shares with a are");
  assert_true(check({a, other}).empty());
  // Beside each other, and too few in common to tell.
  assert_true(check({a, slope_map("b", 20, 20, 9.5, 8.0, 0.1)}).empty());
}

TEST(depths_that_count_from_another_zero_are_refused) {
  std::vector<MapSource> maps = {slope_map("a", 4, 4, 0.0, 0.0, 0.1),
                                 slope_map("b", 4, 4, 0.0, 0.0, 0.1),
                                 slope_map("c", 4, 4, 0.0, 0.0, 0.1)};
  const auto check = [&maps] {
    return refusal([&maps] { leadline::host::check_datums(maps, " (so it is)"); });
  };
  assert_true(check().empty());
  maps[0].reference.vertical_datum = "LAT";
  maps[2].reference.vertical_datum = "LAT";
  assert_true(check().empty());  // b does not say
  maps[2].reference.vertical_datum = "MSL";
  assert_says(check(), "c: its depths count from \"MSL\", those of a from \"LAT\" (so it is)");
}

TEST(agreeing_surveys_weigh_by_their_variances) {
  MapSource b = slope_map("b", 10, 10, 0.0, 0.0, 0.2);
  for (double& value : b.elevation.values) {
    value += 0.1;
  }
  const std::vector<AlignedMap> maps = align_maps({slope_map("a", 10, 10, 0.0, 0.0, 0.1), b});
  const MergedMap merged = merge_maps(maps);
  assert_int_equal(merged.consistent, 100);
  // 4 : 1
  assert_near(merged.elevation.at(3, 4), -20.0 - 0.1 * 2.25 + 0.02, 1e-9);
  assert_near(merged.sigma.at(3, 4), 0.1 * 0.2 / std::hypot(0.1, 0.2), 1e-9);
  const MergedMap other = merge_maps({maps[1], maps[0]});
  for (std::size_t k = 0; k < 100; ++k) {
    assert_near(other.elevation.values[k], merged.elevation.values[k], 0.0);
  }
}

TEST(contradictions_are_marked_and_kept_shallow) {
  const MapSource a = slope_map("a", 10, 10, 0.0, 0.0, 0.1);
  MapSource b = a;
  MapSource c = a;
  b.elevation.at(5, 5) -= 2.0;
  c.elevation.at(5, 5) = kNoValue;
  c.sigma->at(5, 5) = kNoValue;
  const MergedMap merged = merge_maps(align_maps({a, b, c}));
  assert_int_equal(merged.disputes, 1);
  assert_int_equal(merged.consistent, 99);
  assert_near(merged.elevation.at(5, 5), a.elevation.at(5, 5), 1e-12);
  assert_near(merged.sigma.at(5, 5), 1.0, 1e-12);
  assert_near(merged.disputed.at(5, 5), 1.0, 0.0);
  assert_true(std::isnan(merged.disputed.at(4, 4)));
  // Into cells of a store and out again: within their own rounding, the mark with them.
  const CodedMap coded =
      leadline::host::code_map(merged.elevation, merged.sigma, merged.disputed, {});
  const Raster depth = coded.map->elevation();
  const Raster sigma = coded.map->sigma();
  std::size_t marks = 0;
  for (const auto& tile : coded.disputed) {
    marks += tile.count();
  }
  assert_int_equal(marks, 1);
  for (std::size_t k = 0; k < depth.values.size(); ++k) {
    assert_near(depth.values[k], merged.elevation.values[k], 0.3 * merged.sigma.values[k] + 1e-3);
    assert_near(sigma.values[k] / merged.sigma.values[k], 1.0, 0.2);
  }
}

// Noise alone: sigmas that are right give as many significant cells as chance does, and merged errors are
// as large as the merged sigma says.
TEST(sigmas_of_merge_and_difference_are_honest) {
  Random random(9);
  MapSource a = slope_map("a", 200, 200, 0.0, 0.0, 0.1);
  MapSource b = slope_map("b", 200, 200, 0.0, 0.0, 0.2);
  const MapSource truth = a;
  for (std::size_t k = 0; k < a.elevation.values.size(); ++k) {
    a.elevation.values[k] += 0.1 * random.normal();
    b.elevation.values[k] += 0.2 * random.normal();
  }
  const std::vector<AlignedMap> maps = align_maps({a, b});
  const MergedMap merged = merge_maps(maps);
  double sum = 0.0;
  std::size_t within = 0;
  for (std::size_t k = 0; k < truth.elevation.values.size(); ++k) {
    if (!std::isnan(merged.disputed.values[k])) {
      continue;
    }
    const double error = merged.elevation.values[k] - truth.elevation.values[k];
    sum += error * error;
    within += std::fabs(error) <= merged.sigma.values[k] ? 1U : 0U;
  }
  assert_near(std::sqrt(sum / 40'000.0), 0.0894, 0.001);
  assert_near(static_cast<double>(within) / 40'000.0, 0.683, 0.01);
  const MapDifference difference = difference_of(maps[0], maps[1], 3.0, false);
  assert_int_equal(difference.compared, 40'000);
  assert_near(difference.expected_by_chance, 108.0, 0.1);
  assert_near(static_cast<double>(difference.significant), 108.0, 4.0 * std::sqrt(108.0));
  assert_int_equal(difference.areas.size(), 0);
  assert_near(static_cast<double>(merged.disputes), 108.0, 4.0 * std::sqrt(108.0));
}

TEST(a_scour_is_found_and_a_tide_is_none) {
  MapSource a = slope_map("a", 60, 60, 0.0, 0.0, 0.1);
  MapSource b = slope_map("b", 60, 60, 0.0, 0.0, 0.1);
  for (int row = 0; row < 60; ++row) {
    for (int column = 0; column < 60; ++column) {
      b.elevation.at(row, column) += 1.0;  // another tide
      if (row >= 10 && row < 20 && column >= 30 && column < 50) {
        b.elevation.at(row, column) -= 0.8;
      }
    }
  }
  const std::vector<AlignedMap> maps = align_maps({a, b});
  assert_int_equal(difference_of(maps[0], maps[1], 3.0, false).significant, 3600 - 200);
  const MapDifference difference = difference_of(maps[0], maps[1], 3.0, true);
  assert_near(difference.removed_offset_m, -1.0, 1e-9);
  assert_int_equal(difference.areas.size(), 1);
  assert_int_equal(difference.areas[0].cells, 200);
  assert_near(difference.areas[0].mean_m, 0.8, 1e-9);
  assert_near(difference.areas[0].volume_m3, 0.8 * 50.0, 1e-6);
  assert_near(difference.areas[0].east_m, 20.0, 1e-9);
  assert_near(difference.areas[0].north_m, 22.5, 1e-9);
  assert_near(difference.areas[0].peak_sigmas, 0.8 / std::hypot(0.1, 0.1), 1e-6);
  // 200 cells of 0.25 m2, each wrong by 0.1 sqrt 2; the median of 3,600 such is sqrt(pi / 2) / 60 of one.
  const double one_m = 0.1 * std::sqrt(2.0);
  assert_near(difference.removed_offset_sigma_m, 1.2533141 * one_m / 60.0, 1e-8);
  assert_near(difference.areas[0].volume_sigma_m3,
              0.25 * std::hypot(std::sqrt(200.0) * one_m, 200.0 * 1.2533141 * one_m / 60.0), 1e-6);
  assert_near(difference.areas[0].volume_sigma_common_m3, 50.0 * one_m, 1e-9);
}

// By hand: four cells of 4 m2, 1 m deeper, sigmas 0.1, 0.2, 0.3, 0.4 against 0.
TEST(a_volume_has_a_sigma) {
  MapSource a;
  a.origin = "a";
  a.elevation = make_raster(2, 2, 0.0, 0.0, 2.0, -10.0);
  a.sigma = make_raster(2, 2, 0.0, 0.0, 2.0, 0.0);
  MapSource b = a;
  b.origin = "b";
  for (std::size_t k = 0; k < 4; ++k) {
    b.elevation.values[k] -= 1.0;
    b.sigma->values[k] = 0.1 * static_cast<double>(k + 1);
  }
  const std::vector<AlignedMap> maps = align_maps({a, b});
  const MapDifference difference = difference_of(maps[0], maps[1], 2.0, false);
  assert_int_equal(difference.areas.size(), 1);
  assert_near(difference.areas[0].volume_m3, 16.0, 1e-9);
  assert_near(difference.areas[0].volume_sigma_m3, 4.0 * std::sqrt(0.01 + 0.04 + 0.09 + 0.16),
              1e-9);
  assert_near(difference.areas[0].volume_sigma_common_m3, 4.0 * 1.0, 1e-9);
  assert_near(difference.removed_offset_sigma_m, 0.0, 0.0);
}

// The same change measured 300 times: its volume scatters as the sigma says, with and without a median removed. As much
// rises as falls, so that the median is of what stayed.
TEST(sigmas_of_volumes_are_honest) {
  Random random(11);
  for (const bool level : {false, true}) {
    double squares = 0.0;
    double said = 0.0;
    for (int trial = 0; trial < 300; ++trial) {
      MapSource a = slope_map("a", 20, 20, 0.0, 0.0, 0.05);
      MapSource b = slope_map("b", 20, 20, 0.0, 0.0, 0.1);
      for (int row = 0; row < 20; ++row) {
        for (int column = 0; column < 20; ++column) {
          a.elevation.at(row, column) += 0.05 * random.normal();
          b.elevation.at(row, column) += 0.1 * random.normal();
          // So much that the areas are these whatever the noise.
          b.elevation.at(row, column) -= row < 4 && column < 8 ? 2.0 : 0.0;
          b.elevation.at(row, column) += row >= 16 && column >= 12 ? 2.0 : 0.0;
        }
      }
      const std::vector<AlignedMap> maps = align_maps({a, b});
      const MapDifference difference = difference_of(maps[0], maps[1], 8.0, level);
      assert_int_equal(difference.areas.size(), 2);
      for (const auto& area : difference.areas) {
        assert_int_equal(area.cells, 32);
        const double error_m3 = std::fabs(area.volume_m3) - 2.0 * 32 * 0.25;
        squares += error_m3 * error_m3;
        said += area.volume_sigma_m3 * area.volume_sigma_m3;
      }
    }
    assert_near(std::sqrt(squares / said), 1.0, 0.1);
  }
}

}  // namespace
