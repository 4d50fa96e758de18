#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/raster.hpp"
#include "host_tools/sim/exact_math.hpp"
#include "host_tools/sim/terrain.hpp"
#include "host_tools/sim/terrain_sources.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::HostError;
using leadline::host::make_plane_terrain;
using leadline::host::make_procedural_terrain;
using leadline::host::make_raster;
using leadline::host::make_raster_terrain;
using leadline::host::normalized;
using leadline::host::PlaneOptions;
using leadline::host::ProceduralOptions;
using leadline::host::Raster;
using leadline::host::RasterTerrainOptions;
using leadline::host::Terrain;
using leadline::host::Vec3;

// What an exception said, "" if there was none.
template <typename Action>
std::string complaint(Action action) {
  try {
    action();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

void assert_says(const std::string& text, const std::string& part) {
  if (text.find(part) == std::string::npos) {
    fail_msg("\"%s\" does not say \"%s\"", text.c_str(), part.c_str());
  }
}

Terrain random_terrain(leadline::test::Random* random, std::size_t north_count,
                       std::size_t east_count, double cell_m, double relief_m) {
  std::vector<double> depth_m(north_count * east_count);
  for (double& value : depth_m) {
    value = 20.0 + relief_m * random->uniform();
  }
  return Terrain(north_count, east_count, cell_m, -3.0, 7.0, depth_m);
}

// Slow and obviously right: small steps until the ray is below the surface, then bisection.
std::optional<double> march(const Terrain& terrain, Vec3 origin, Vec3 direction, double max_m) {
  const double step_m = 0.002 * terrain.cell_m();
  const auto below = [&](double s) {
    const Vec3 p = origin + s * direction;
    return p.z >= terrain.depth_m(p.x, p.y);
  };
  const auto inside = [&](double s) {
    const Vec3 p = origin + s * direction;
    return terrain.contains(p.x, p.y);
  };
  for (double s = step_m; s <= max_m; s += step_m) {
    if (!inside(s)) {
      if (inside(s - step_m)) {
        return std::nullopt;
      }
      continue;
    }
    if (below(s)) {
      double low = s - step_m;
      double high = s;
      for (int k = 0; k < 50; ++k) {
        const double middle = 0.5 * (low + high);
        (below(middle) ? high : low) = middle;
      }
      return high;
    }
  }
  return std::nullopt;
}

TEST(surface_is_bilinear_between_cell_centres) {
  // Rows south to north: south row 1 2, north row 3 8.
  const Terrain terrain(2, 2, 10.0, 100.0, 200.0, {1.0, 2.0, 3.0, 8.0});
  assert_near(terrain.depth_m(105.0, 205.0), 1.0, 1e-12);
  assert_near(terrain.depth_m(105.0, 215.0), 2.0, 1e-12);
  assert_near(terrain.depth_m(115.0, 205.0), 3.0, 1e-12);
  assert_near(terrain.depth_m(115.0, 215.0), 8.0, 1e-12);
  assert_near(terrain.depth_m(110.0, 210.0), 3.5, 1e-12);
  assert_near(terrain.depth_m(110.0, 205.0), 2.0, 1e-12);
  // Clamped outside.
  assert_near(terrain.depth_m(0.0, 0.0), 1.0, 1e-12);
  assert_true(terrain.contains(105.0, 205.0));
  assert_false(terrain.contains(104.9, 205.0));
  assert_false(terrain.contains(105.0, 215.1));
  assert_near(terrain.shallowest_m(), 1.0, 0.0);
  assert_near(terrain.deepest_m(), 8.0, 0.0);
}

TEST(rays_meet_planes_where_algebra_says) {
  leadline::test::Random random(1);
  for (int slope_deg = 0; slope_deg <= 60; slope_deg += 15) {
    PlaneOptions options;
    options.north_count = 100;
    options.east_count = 80;
    options.cell_m = 0.7;
    options.shallowest_depth_m = 30.0;
    options.slope_deg = slope_deg;
    options.dip_azimuth_deg = 33.0;
    const Terrain terrain = make_plane_terrain(options);
    const double fall = std::tan(slope_deg * leadline::host::exact::kRadPerDeg);
    const double dip_rad = 33.0 * leadline::host::exact::kRadPerDeg;
    const Vec3 normal{-fall * std::cos(dip_rad), -fall * std::sin(dip_rad), 1.0};
    const double at_corner_m = terrain.depth_at_cell_m(0, 0);
    int hit_count = 0;
    for (int k = 0; k < 2000; ++k) {
      const double x = 70.0 * random.uniform();
      const double y = 56.0 * random.uniform();
      const Vec3 origin{x, y, terrain.depth_m(x, y) - 0.5 - 25.0 * random.uniform()};
      const Vec3 direction = normalized({random.normal(), random.normal(), 2.0 * random.normal()});
      const double closing = dot(direction, normal);
      const double above_m =
          at_corner_m + fall * (std::cos(dip_rad) * (x - 0.35) + std::sin(dip_rad) * (y - 0.35)) -
          origin.z;
      const std::optional<double> hit = terrain.intersect(origin, direction, 500.0);
      const double expected_m = closing > 0.0 ? above_m / closing : HUGE_VAL;
      const Vec3 end = origin + expected_m * direction;
      const bool expected_hit = closing > 0.0 && expected_m < 499.0 && end.x > 0.36 &&
                                end.x < 69.64 && end.y > 0.36 && end.y < 55.64 &&
                                terrain.contains(x, y);
      if (expected_hit) {
        assert_true(hit.has_value());
        assert_near(*hit, expected_m, 1e-8 * (1.0 + expected_m));
        ++hit_count;
      } else if (closing <= 0.0) {
        assert_false(hit.has_value());
      }
    }
    assert_true(hit_count > 300);
  }
}

TEST(rays_meet_rough_ground_where_small_steps_do) {
  leadline::test::Random random(2);
  int hit_count = 0;
  int miss_count = 0;
  for (int k = 0; k < 400; ++k) {
    const std::size_t north_count = static_cast<std::size_t>(random.between(2, 21));
    const std::size_t east_count = static_cast<std::size_t>(random.between(2, 21));
    const Terrain terrain = random_terrain(&random, north_count, east_count, 1.3, 4.0);
    const double x = -3.0 + 1.3 * static_cast<double>(north_count) * random.uniform();
    const double y = 7.0 + 1.3 * static_cast<double>(east_count) * random.uniform();
    const Vec3 origin{x, y, terrain.depth_m(x, y) - 6.0 * random.uniform() - 0.01};
    // Mostly shallow looks: they cross many cells and graze crests.
    const Vec3 direction =
        normalized({random.normal(), random.normal(), 0.6 * random.normal() + 0.4});
    if (!terrain.contains(x, y)) {
      continue;
    }
    const std::optional<double> expected = march(terrain, origin, direction, 60.0);
    const std::optional<double> hit = terrain.intersect(origin, direction, 60.0);
    if (expected.has_value()) {
      assert_true(hit.has_value());
      // Steps may jump over a grazed crest: then the exact answer is the nearer one.
      assert_true(*hit <= *expected + 1e-6);
      const Vec3 p = origin + *hit * direction;
      assert_near(p.z, terrain.depth_m(p.x, p.y), 1e-6);
      ++hit_count;
    } else if (hit.has_value()) {
      const Vec3 p = origin + *hit * direction;
      assert_near(p.z, terrain.depth_m(p.x, p.y), 1e-6);
    } else {
      ++miss_count;
    }
  }
  assert_true(hit_count > 100 && miss_count > 50);
}

// A ray that runs exactly along the lines between cells, in any direction, ends in finite time.
TEST(rays_along_cell_borders_end) {
  leadline::test::Random random(3);
  const Terrain terrain = random_terrain(&random, 17, 17, 1.0, 2.0);
  for (int i = 0; i < 17; ++i) {
    const double x = terrain.south_m() + i;
    for (const double sideways : {0.0, 1e-17, -1e-17, 1e-12, -1e-12}) {
      for (const double down : {0.0, 0.05, 0.3, 1.0}) {
        const Vec3 origin{x, terrain.west_m(), 15.0};
        const std::optional<double> hit =
            terrain.intersect(origin, normalized({sideways, 1.0, down}), 1000.0);
        if (down >= 1.0) {
          assert_true(hit.has_value() || i == 0 || i == 16);
        }
        const std::optional<double> straight_down =
            terrain.intersect({x, terrain.west_m() + i, 15.0}, {sideways, -sideways, 1.0}, 1000.0);
        if (i > 0 && i < 16) {
          assert_true(straight_down.has_value());
          assert_near(*straight_down, terrain.depth_m(x, terrain.west_m() + i) - 15.0, 1e-9);
        }
      }
    }
  }
}

TEST(rays_that_cannot_see_the_surface_return_nothing) {
  const Terrain terrain(3, 3, 1.0, 0.0, 0.0, std::vector<double>(9, 10.0));
  assert_false(terrain.intersect({1.5, 1.5, 5.0}, {0.0, 0.0, -1.0}, 100.0).has_value());  // up
  assert_false(terrain.intersect({1.5, 1.5, 11.0}, {0.0, 0.0, 1.0}, 100.0).has_value());  // below
  assert_false(terrain.intersect({1.5, 1.5, 5.0}, {0.0, 0.0, 1.0}, 4.9).has_value());     // too far
  assert_false(terrain.intersect({9.0, 9.0, 5.0}, {0.0, 0.0, 1.0}, 100.0).has_value());   // beside
  // From outside through the side into the block of ground: no surface is met.
  assert_false(terrain.intersect({-5.0, 1.5, 10.5}, {1.0, 0.0, 0.0}, 100.0).has_value());
  // From outside over the edge onto the ground.
  const std::optional<double> hit =
      terrain.intersect({-8.5, 1.5, 0.0}, normalized({1.0, 0.0, 1.0}), 100.0);
  assert_true(hit.has_value());
  assert_near(*hit, 10.0 * std::sqrt(2.0), 1e-9);
}

TEST(terrain_rejects_what_is_no_terrain) {
  const std::vector<double> four(4, 1.0);
  assert_says(complaint([&] { Terrain(1, 4, 1.0, 0.0, 0.0, four); }), "2 x 2 cells, got 1 x 4");
  assert_says(complaint([&] { Terrain(2, 2, 0.0, 0.0, 0.0, four); }), "cell size");
  assert_says(complaint([&] { Terrain(2, 3, 1.0, 0.0, 0.0, four); }), "4 depths for 2 x 3");
  assert_says(complaint([&] { Terrain(2, 2, 1.0, std::nan(""), 0.0, four); }), "origin");
  std::vector<double> hole = four;
  hole[3] = std::nan("");
  assert_says(complaint([&] { Terrain(2, 2, 1.0, 0.0, 0.0, hole); }), "cell (1, 1)");
}

std::uint64_t hash_of(const std::vector<double>& values) {
  std::uint64_t hash = 0xCBF29CE484222325ULL;
  for (const double value : values) {
    // Depths are multiples of 1/1024 m, so this is exact.
    hash = (hash ^ static_cast<std::uint64_t>(std::llround(value * 1024.0))) * 0x100000001B3ULL;
  }
  return hash;
}

// The seafloor that ships with the product: the same on every host. A change here changes every
// figure that was quoted for the demo.
TEST(procedural_terrain_is_the_same_everywhere) {
  ProceduralOptions options;
  const Terrain terrain = make_procedural_terrain(options);
  assert_true(hash_of(terrain.depths_m()) == 0xB5A4981B9D116849ULL);
  for (const double depth_m : terrain.depths_m()) {
    assert_near(depth_m * 1024.0, std::round(depth_m * 1024.0), 0.0);
  }
  options.seed = 2;
  assert_true(hash_of(make_procedural_terrain(options).depths_m()) != hash_of(terrain.depths_m()));
}

TEST(procedural_terrain_has_the_size_and_relief_asked_for) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    ProceduralOptions options;
    options.seed = seed;
    options.north_count = 40 + 30 * static_cast<std::size_t>(seed);
    options.east_count = 100;
    options.cell_m = 0.25;
    options.shallowest_depth_m = 8.0;
    options.relief_cells = 20.0;
    const Terrain terrain = make_procedural_terrain(options);
    assert_int_equal(terrain.north_count(), options.north_count);
    assert_int_equal(terrain.east_count(), 100);
    assert_near(terrain.shallowest_m(), 8.0, 1e-3);
    assert_near(terrain.deepest_m(), 13.0, 1e-3);
  }
}

TEST(procedural_and_plane_options_are_checked) {
  ProceduralOptions options;
  options.north_count = 4;
  assert_says(complaint([&] { (void)make_procedural_terrain(options); }), "north_count");
  options = ProceduralOptions{};
  options.cell_m = -1.0;
  assert_says(complaint([&] { (void)make_procedural_terrain(options); }), "cell_m");
  options = ProceduralOptions{};
  options.relief_cells = 0.0;
  assert_says(complaint([&] { (void)make_procedural_terrain(options); }), "relief_cells");
  PlaneOptions plane;
  plane.slope_deg = 90.0;
  assert_says(complaint([&] { (void)make_plane_terrain(plane); }), "slope_deg");
  plane = PlaneOptions{};
  plane.east_count = 0;
  assert_says(complaint([&] { (void)make_plane_terrain(plane); }), "east_count");
}

// 4 rows x 6 columns; value = 10 * row from the north + column.
Raster numbered_raster() {
  Raster raster = make_raster(6, 4, 1000.0, 2000.0, 30.0);
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 6; ++column) {
      raster.at(row, column) = 10.0 * row + column;
    }
  }
  return raster;
}

TEST(raster_rows_run_from_north_and_elevation_is_up) {
  const Terrain terrain = make_raster_terrain(numbered_raster(), "numbered", {});
  assert_int_equal(terrain.north_count(), 4);
  assert_int_equal(terrain.east_count(), 6);
  assert_near(terrain.cell_m(), 30.0, 1e-12);
  assert_near(terrain.depth_at_cell_m(3, 0), 0.0, 1e-12);  // north-west
  assert_near(terrain.depth_at_cell_m(3, 5), -5.0, 1e-12);
  assert_near(terrain.depth_at_cell_m(0, 5), -35.0, 1e-12);  // south-east, the highest
  // And back.
  const Raster elevation = leadline::host::terrain_elevation(terrain);
  assert_near(elevation.at(0, 5), 5.0, 1e-12);
  assert_near(elevation.at(3, 0), 30.0, 1e-12);
}

TEST(raster_part_is_averaged_or_interpolated_to_the_cells) {
  RasterTerrainOptions options;
  options.first_row = 1;
  options.first_column = 2;
  options.rows = 2;
  options.columns = 4;
  options.north_count = 2;
  options.east_count = 2;
  const Terrain coarse = make_raster_terrain(numbered_raster(), "numbered", options);
  assert_near(-coarse.depth_at_cell_m(1, 0), 12.5, 1e-12);
  assert_near(-coarse.depth_at_cell_m(0, 1), 24.5, 1e-12);
  options.east_count = 8;
  const Terrain fine = make_raster_terrain(numbered_raster(), "numbered", options);
  assert_near(-fine.depth_at_cell_m(1, 0), 12.0, 1e-12);  // clamped at the border
  assert_near(-fine.depth_at_cell_m(1, 1), 12.25, 1e-12);
  assert_near(-fine.depth_at_cell_m(1, 2), 12.75, 1e-12);
  assert_near(-fine.depth_at_cell_m(1, 7), 15.0, 1e-12);
  // A ratio that is no whole number keeps the mean.
  options = RasterTerrainOptions{};
  options.north_count = 4;
  options.east_count = 4;
  options.rows = 4;
  options.columns = 6;
  const Terrain odd = make_raster_terrain(numbered_raster(), "numbered", options);
  double mean = 0.0;
  for (const double depth_m : odd.depths_m()) {
    mean -= depth_m / 16.0;
  }
  assert_near(mean, 17.5, 1e-12);
}

TEST(raster_heights_are_scaled_to_the_relief) {
  RasterTerrainOptions options;
  options.cell_m = 2.0;
  options.relief_cells = 24.0;
  options.shallowest_depth_m = 60.0;
  const Terrain terrain = make_raster_terrain(numbered_raster(), "numbered", options);
  assert_near(terrain.shallowest_m(), 60.0, 1e-9);
  assert_near(terrain.deepest_m(), 108.0, 1e-9);
  assert_near(terrain.depth_at_cell_m(0, 5), 60.0, 1e-9);
}

TEST(raster_without_a_part_uses_the_largest_central_one) {
  RasterTerrainOptions options;
  options.north_count = 4;
  options.east_count = 4;
  const Terrain terrain = make_raster_terrain(numbered_raster(), "numbered", options);
  assert_near(-terrain.depth_at_cell_m(3, 0), 1.0, 1e-12);  // columns 1 .. 4 of 6
  assert_near(-terrain.depth_at_cell_m(0, 3), 34.0, 1e-12);
}

TEST(raster_holes_are_filled_from_their_neighbours) {
  Raster raster = numbered_raster();
  raster.at(1, 1) = std::numeric_limits<double>::quiet_NaN();
  raster.at(0, 5) = std::numeric_limits<double>::quiet_NaN();
  const Terrain terrain = make_raster_terrain(raster, "holed", {});
  assert_near(-terrain.depth_at_cell_m(2, 1), 11.0, 1e-12);
  assert_near(-terrain.depth_at_cell_m(3, 5), (4.0 + 14.0 + 15.0) / 3.0, 1e-12);
  for (int column = 0; column < 6; ++column) {
    raster.at(2, column) = std::numeric_limits<double>::quiet_NaN();
  }
  assert_says(complaint([&] { (void)make_raster_terrain(raster, "holed", {}); }),
              "holed: 8 of 24 cells have no elevation");
}

TEST(raster_options_are_checked) {
  RasterTerrainOptions options;
  options.rows = 3;
  options.columns = 3;
  options.first_row = 2;
  assert_says(
      complaint([&] { (void)make_raster_terrain(numbered_raster(), "r.tif", options); }),
      "3 rows from row 2 and 3 columns from column 0 is not inside r.tif (4 rows, 6 columns)");
  options = RasterTerrainOptions{};
  options.first_column = 2;
  assert_says(complaint([&] { (void)make_raster_terrain(numbered_raster(), "r.tif", options); }),
              "first_column");
  options = RasterTerrainOptions{};
  options.east_count = 1;
  assert_says(complaint([&] { (void)make_raster_terrain(numbered_raster(), "r.tif", options); }),
              "east_count");
  options = RasterTerrainOptions{};
  options.relief_cells = 10.0;
  assert_says(complaint([&] {
                (void)make_raster_terrain(make_raster(4, 4, 0.0, 0.0, 1.0, 7.0), "flat.tif",
                                          options);
              }),
              "flat.tif: is flat");
}

TEST(raster_files_are_read) {
  const std::string path = leadline::test::scratch_directory() + "/terrain.asc";
  std::ofstream(path) << "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 5\n"
                         "NODATA_value -9999\n-10 -11\n-12 -13\n";
  const Terrain terrain = leadline::host::load_raster_terrain(path, {});
  assert_near(terrain.depth_at_cell_m(1, 0), 10.0, 1e-12);
  assert_near(terrain.depth_at_cell_m(0, 1), 13.0, 1e-12);
  assert_says(complaint([&] { (void)leadline::host::load_raster_terrain(path + ".tif", {}); }),
              ".asc.tif");
}

}  // namespace
