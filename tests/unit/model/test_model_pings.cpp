// One ping in the model: where its evidence goes, and where not.
#include <algorithm>
#include <array>
#include <set>
#include <utility>
#include <vector>

#include "model/base/fixed.hpp"
#include "model/model.hpp"
#include "tests/support/model_check.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using namespace leadline::test;   // NOLINT
using leadline::base::Attitude;
using leadline::base::Bam32;
using leadline::base::Ping;
using leadline::base::Pose;
using leadline::base::ReturnKind;

// Tens of megabytes each: static.
Model model;
Model other;

PlainBeam thin_beam() {
  PlainBeam beam;
  beam.half_angle_along_rad = 0.001;
  beam.sigma_pointing_rad = 0.0;
  beam.sigma_range_um = 300'000;
  return beam;
}

/// Cells that the segment crosses, by sorting its crossings of all grid planes; any cell, in or out of
/// the grid.
std::set<std::array<std::int32_t, 3>> crossed_cells(const Vector& from, const Vector& u,
                                                    double length) {
  std::vector<double> cuts = {0.0, length};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (std::fabs(u[axis]) < 1e-12) {
      continue;
    }
    const double end = from[axis] + u[axis] * length;
    for (double plane = std::ceil(std::min(from[axis], end)); plane <= std::max(from[axis], end);
         plane += 1.0) {
      cuts.push_back((plane - from[axis]) / u[axis]);
    }
  }
  std::sort(cuts.begin(), cuts.end());
  std::set<std::array<std::int32_t, 3>> cells;
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
    if (cuts[i + 1] - cuts[i] < 1e-9) {
      continue;
    }
    const double t = 0.5 * (cuts[i] + cuts[i + 1]);
    std::array<std::int32_t, 3> cell{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      cell[axis] = static_cast<std::int32_t>(std::floor(from[axis] + u[axis] * t));
    }
    cells.insert(cell);
  }
  return cells;
}

Sighting sighting_of(const Pose& pose, const Ping& ping) {
  Sighting sighting{};
  for (int axis = 0; axis < 3; ++axis) {
    sighting.origin_q16[axis] =
        static_cast<std::int32_t>((pose.position_um[axis] << 16) / 1'000'000);
  }
  sighting.range_q16 = static_cast<std::int32_t>((ping.range_um << 16) / 1'000'000);
  return sighting;
}

// ------------------------------------------------------------------------------------- geometry

TEST(hits_stand_where_the_beam_ends) {
  configure(model, plain_config(96, 96, 48), plain_table(PlainBeam{}));
  // North is the first axis, east the second, down the third; see test_event.cpp for the signs.
  Pose pose = pose_at(48, 48, 2);
  struct Case {
    double roll, pitch, heading, az, el;
  };
  for (const Case c :
       {Case{0, 0, 0, 0, 90}, Case{0, 20, 0, 0, 90}, Case{20, 0, 0, 0, 90}, Case{0, 20, 90, 0, 90},
        Case{20, 0, 90, 0, 90}, Case{0, 0, 45, 90, 60}, Case{0, 0, 45, -90, 60},
        Case{5, -8, 200, 30, 70}, Case{-10, 12, 310, 180, 65}}) {
    configure(model, plain_config(96, 96, 48), plain_table(PlainBeam{}));
    pose.attitude = Attitude{bam(c.roll), bam(c.pitch), bam(c.heading)};
    const Ping ping = ping_along(c.az, c.el, 30.0);
    assert_int_equal(model.integrate(ping, pose), PingResult::kFused);
    const Blob blob = blob_of_hits(model);
    const Vector u = beam_vector(pose, ping);
    assert_true(blob.mass > 1000);
    assert_near(blob.centre[0], 48 + 30 * u[0], 0.1);
    assert_near(blob.centre[1], 48 + 30 * u[1], 0.1);
    assert_near(blob.centre[2], 2 + 30 * u[2], 0.1);
  }
}

TEST(the_grids_origin_and_cell_size_place_the_voxels) {
  ModelConfig config = plain_config(40, 40, 40);
  config.cell_mm = 250;
  config.origin_mm[0] = -1'000'000;
  config.origin_mm[1] = 2'000'000;
  config.origin_mm[2] = -3'000;
  configure(model, config, plain_table(PlainBeam{}));
  // 4 m below the top, 5 m into the grid: cells 20, 20 and, with 3 m of range, 16 + 12.
  assert_int_equal(model.integrate(ping_along(0, 90, 3.0), pose_at(-995.0, 2005.0, 1.0)),
                   PingResult::kFused);
  const Blob blob = blob_of_hits(model);
  assert_near(blob.centre[0], 20, 0.1);
  assert_near(blob.centre[1], 20, 0.1);
  assert_near(blob.centre[2], 28, 0.1);
}

TEST(a_thin_beam_touches_every_voxel_that_it_crosses) {
  ModelConfig config = plain_config(48, 48, 48);
  const LocalizationTable table = plain_table(thin_beam());
  Random random(1);
  int crossed = 0;
  int missed = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    config.rule = trial % 2 == 0 ? Rule::kLogOdds : Rule::kWeightedMean;
    configure(model, config, table);
    Pose pose = pose_at(48 * random.uniform(), 48 * random.uniform(), 10 * random.uniform());
    pose.attitude.heading_bam32 = static_cast<Bam32>(random.next());
    // Every tenth beam is exactly vertical or horizontal.
    const double elevation =
        trial % 20 == 0 ? 90.0 : (trial % 20 == 10 ? 0.0 : -20.0 + 110.0 * random.uniform());
    const Ping ping = ping_along(0, elevation, 3.0 + 35.0 * random.uniform());
    assert_int_equal(model.integrate(ping, pose), PingResult::kFused);

    const double range = static_cast<double>(ping.range_um) * 1e-6;
    const Vector from = metres(pose);
    const Vector u = beam_vector(pose, ping);
    const BeamFrame frame = beam_frame(pose.attitude, ping.azimuth_bam32, ping.elevation_bam32, 0);
    const ShellEvent shell =
        make_shell(model.scale(), table, frame, sighting_of(pose, ping), Slope{0, 0});
    const double reach = kernel_reach_q16(shell.level) / 65536.0;
    const double empty_to = shell.empty_range_q10 / 1024.0;
    for (const auto& cell : crossed_cells(from, u, range)) {
      const Vector centre = {cell[0] + 0.5, cell[1] + 0.5, cell[2] + 0.5};
      const double slant = (centre[0] - from[0]) * u[0] + (centre[1] - from[1]) * u[1] +
                           (centre[2] - from[2]) * u[2];
      // Before the shell: nearer than its plane by the kernel's reach, or than the wall's blur; and not
      // behind the transducer, which stands inside its own voxel.
      const bool before = slant > 0.01 && slant < empty_to - 0.01 &&
                          (shell.wall || centre[2] < from[2] + range * u[2] - reach - 0.51);
      const bool inside = cell[0] >= 0 && cell[1] >= 0 && cell[2] >= 0 && cell[0] < 48 &&
                          cell[1] < 48 && cell[2] < 48;
      if (!before || !inside) {
        continue;
      }
      ++crossed;
      const Voxel& voxel =
          model.grid().column_voxels(model.grid().column_index(cell[0], cell[1]))[cell[2]];
      if (voxel.hit == 0 && voxel.miss == 0) {
        ++missed;
        const double off2 = (centre[0] - from[0]) * (centre[0] - from[0]) +
                            (centre[1] - from[1]) * (centre[1] - from[1]) +
                            (centre[2] - from[2]) * (centre[2] - from[2]) - slant * slant;
        // Crossed at its very corner, where the thickened cone's weight runs out.
        if (off2 < 0.83 * 0.83) {
          fail_msg(
              "trial %d, elevation %g: voxel (%d, %d, %d) was crossed %g cells off its centre at "
              "%g of %g and not touched",
              trial, elevation, cell[0], cell[1], cell[2], std::sqrt(off2), slant, range);
        }
      }
    }
  }
  print_message("%d voxels crossed before the shell, %d of them at a corner and not touched\n",
                crossed, missed);
  assert_true(crossed > 30'000);
  assert_true(missed * 1000 < crossed);
}

TEST(nothing_behind_the_shell_is_written) {
  ModelConfig config = plain_config(64, 64, 40);
  Random random(2);
  int written = 0;
  for (int trial = 0; trial < 600; ++trial) {
    PlainBeam beam;
    beam.half_angle_along_rad = 0.002 + 0.3 * random.uniform();
    beam.sigma_pointing_rad = 0.02 * random.uniform();
    beam.sigma_range_um = static_cast<std::uint32_t>(random.between(50'000, 1'500'000));
    const LocalizationTable table = plain_table(beam);
    config.rule = trial % 2 == 0 ? Rule::kLogOdds : Rule::kWeightedMean;
    configure(model, config, table);
    Pose pose = pose_at(64 * random.uniform(), 64 * random.uniform(), 8 * random.uniform());
    pose.attitude = Attitude{bam(8 * random.normal()), bam(8 * random.normal()),
                             static_cast<Bam32>(random.next())};
    const double elevation =
        trial % 3 == 0 ? 30.0 * random.uniform() - 20.0 : 30.0 + 60.0 * random.uniform();
    const Ping ping =
        ping_along(360.0 * random.uniform(), elevation, 4.0 + 30.0 * random.uniform());
    assert_int_equal(model.integrate(ping, pose), PingResult::kFused);

    const double range = static_cast<double>(ping.range_um) * 1e-6;
    const Vector from = metres(pose);
    const Vector u = beam_vector(pose, ping);
    const BeamFrame frame = beam_frame(pose.attitude, ping.azimuth_bam32, ping.elevation_bam32, 0);
    const ShellEvent shell =
        make_shell(model.scale(), table, frame, sighting_of(pose, ping), Slope{0, 0});
    const double reach = kernel_reach_q16(shell.level) / 65536.0;
    for (const Touched& at : touched(model)) {
      ++written;
      const Vector centre = {at.n + 0.5, at.e + 0.5, at.k + 0.5};
      if (!shell.wall) {
        // The plain table's plane is at the end of the axis, level without a slope. A sixteenth of a
        // cell is what the kernel's phases leave.
        const double plane = from[2] + range * u[2];
        assert_true(centre[2] <= plane + reach + 0.1);
        // Evidence for a surface only around the plane, evidence against only before it.
        if (config.rule == Rule::kLogOdds) {
          assert_true(at.voxel.hit == 0 || centre[2] >= plane - reach - 0.1);
          assert_true(at.voxel.miss == 0 || centre[2] <= plane - reach + 0.1);
        }
        continue;
      }
      const double slant = (centre[0] - from[0]) * u[0] + (centre[1] - from[1]) * u[1] +
                           (centre[2] - from[2]) * u[2];
      const double sigma = std::hypot(beam.sigma_range_um * 1e-6, std::sqrt(0.5));
      // Cut of the radial blur, and the vertical kernel tilted against the beam.
      const double limit = range + 2.2 * sigma + 0.9 + reach * std::fabs(u[2]);
      assert_true(slant <= limit);
      if (config.rule == Rule::kLogOdds && at.voxel.miss != 0) {
        assert_true(slant <= range + 0.6);
      }
    }
  }
  print_message("%d voxels written\n", written);
  assert_true(written > 100'000);
}

TEST(a_grid_that_is_part_of_another_gets_its_part) {
  // The same ping into a grid and into a window of it: the window's voxels agree, wherever the event or
  // the vehicle is, inside or outside. Dither follows the place in the grid, so that each half may
  // round differently: one unit. Empty evidence has one weight per run of voxels, and runs begin at the
  // grid's edge: there only what is touched and the sum can agree.
  const ModelConfig whole = plain_config(64, 64, 40);
  ModelConfig part = plain_config(24, 20, 16);
  constexpr std::int32_t kNorth = 20;
  constexpr std::int32_t kEast = 22;
  constexpr std::int32_t kDown = 14;
  part.origin_mm[0] = kNorth * 1000;
  part.origin_mm[1] = kEast * 1000;
  part.origin_mm[2] = kDown * 1000;
  const LocalizationTable table = plain_table(PlainBeam{});
  Random random(3);
  int compared = 0;
  int outside = 0;
  double worst_ratio = 1.0;
  for (int trial = 0; trial < 400; ++trial) {
    configure(model, whole, table);
    configure(other, part, table);
    const Pose pose =
        pose_at(84 * random.uniform() - 10, 84 * random.uniform() - 10, 50 * random.uniform() - 5);
    // Towards a point in the window or somewhat beside it.
    const Vector from = metres(pose);
    const double dn = kNorth - 3 + 30 * random.uniform() - from[0];
    const double de = kEast - 3 + 26 * random.uniform() - from[1];
    const double dd = kDown - 3 + 22 * random.uniform() - from[2];
    const double level = std::hypot(dn, de);
    const double degrees = 180.0 / 3.14159265358979323846;
    const Ping ping = ping_along(std::atan2(de, dn) * degrees, std::atan2(dd, level) * degrees,
                                 std::hypot(level, dd) * (0.7 + 0.6 * random.uniform()) + 0.2);
    assert_int_equal(model.integrate(ping, pose), PingResult::kFused);
    assert_int_equal(other.integrate(ping, pose), PingResult::kFused);
    const bool vehicle_outside =
        pose.position_um[0] < kNorth * 1'000'000 || pose.position_um[2] < kDown * 1'000'000;
    double miss_whole = 0.0;
    double miss_part = 0.0;
    bool any = false;
    for (std::int32_t n = 0; n < 24; ++n) {
      for (std::int32_t e = 0; e < 20; ++e) {
        const Voxel* const a =
            model.grid().column_voxels(model.grid().column_index(n + kNorth, e + kEast)) + kDown;
        const Voxel* const b = other.grid().column_voxels(other.grid().column_index(n, e));
        for (std::int32_t k = 0; k < 16; ++k) {
          const bool hits_agree = std::abs(a[k].hit - b[k].hit) <= 1;
          // Weights of whole units are written whatever the dither.
          const bool touch_agrees =
              (a[k].miss < 40 || b[k].miss > 0) && (b[k].miss < 40 || a[k].miss > 0);
          if (!hits_agree || !touch_agrees) {
            fail_msg("trial %d (%d %d %d): %d/%d in the whole, %d/%d in the part", trial, n, e, k,
                     a[k].hit, a[k].miss, b[k].hit, b[k].miss);
          }
          miss_whole += a[k].miss;
          miss_part += b[k].miss;
          any = any || b[k].hit != 0 || b[k].miss != 0;
          compared += a[k].hit != 0 || a[k].miss != 0 ? 1 : 0;
        }
      }
    }
    outside += any && vehicle_outside ? 1 : 0;
    if (miss_whole > 2000) {
      worst_ratio = std::max(
          worst_ratio, std::max(miss_part / miss_whole, miss_whole / std::max(miss_part, 1.0)));
    }
  }
  print_message(
      "%d voxels compared, sums of miss within a factor %.2f; %d vehicles outside mapped into the "
      "part\n",
      compared, worst_ratio, outside);
  assert_true(worst_ratio < 1.5);
  assert_true(compared > 20'000);
  assert_true(outside > 100);
}

TEST(a_vehicle_far_outside_maps_into_the_grid) {
  ModelConfig config = plain_config(40, 40, 40);
  configure(model, config, plain_table(PlainBeam{}));
  // 60 m south, 80 m above the bottom, looking obliquely down: the end lies at (20, 20, 20).
  Pose pose = pose_at(-40.0, 20.0, -60.0);
  const double range = 100.0;
  const Ping ping = ping_along(0, 53.13010235415598, range);
  assert_int_equal(model.integrate(ping, pose), PingResult::kFused);
  const Blob blob = blob_of_hits(model);
  assert_near(blob.centre[0], 20, 0.3);
  assert_near(blob.centre[1], 20, 0.3);
  assert_near(blob.centre[2], 20, 0.1);
  // And past it: the cone alone crosses the grid, nothing is hit.
  configure(model, config, plain_table(PlainBeam{}));
  assert_int_equal(model.integrate(ping_along(0, 53.13010235415598, 250.0), pose),
                   PingResult::kFused);
  assert_near(blob_of_hits(model).mass, 0, 0);
  assert_true(touched(model).size() > 300);
  // Looking away: nothing at all.
  configure(model, config, plain_table(PlainBeam{}));
  const std::uint64_t empty = model.grid().map_hash();
  assert_int_equal(model.integrate(ping_along(180, 53.13, range), pose), PingResult::kFused);
  assert_true(model.grid().map_hash() == empty);
  assert_int_equal(model.counters().last_voxels_per_ping, 0);
}

TEST(beams_above_or_below_the_grid_ask_no_column) {
  // A grid, and one with as many layers again above and below, which sees what the first leaves out.
  constexpr std::int32_t kSide = 24;
  constexpr std::int32_t kLayers = 20;
  ModelConfig config = plain_config(kSide, kSide, kLayers);
  config.no_return = NoReturnPolicy::kEmpty;
  config.detect_range_um = 30'000'000;
  config.origin_mm[2] = kLayers * 1000;
  ModelConfig tall = config;
  tall.size[2] = 3 * kLayers;
  tall.origin_mm[2] = 0;
  Random random(21);
  const auto any = [&random](double low, double high) {
    return low + (high - low) * random.uniform();
  };
  int passed = 0;
  int written = 0;
  for (int trial = 0; trial < 120; ++trial) {
    PlainBeam beam = thin_beam();
    beam.half_angle_along_rad = trial % 2 == 0 ? 0.001 : 0.15;
    Ping silent = ping_along(any(0, 360), any(-90, 90), 0);
    silent.kind = ReturnKind::kNoReturn;
    const Pose pose = pose_at(any(-5, kSide + 5), any(-5, kSide + 5), any(0, 3 * kLayers));
    configure(model, config, plain_table(beam));
    assert_int_equal(model.integrate(silent, pose), PingResult::kNoReturn);
    configure(other, tall, plain_table(beam));
    assert_int_equal(other.integrate(silent, pose), PingResult::kNoReturn);
    int inside = 0;
    for (const Touched& at : touched(other)) {
      inside += at.k >= kLayers && at.k < 2 * kLayers ? 1 : 0;
    }
    const PingWork& work = model.last_work();
    if (work.cone_rows == 0) {
      assert_int_equal(inside, 0);
      passed += other.last_work().cone_voxels > 0 ? 1 : 0;
    }
    assert_true(inside == 0 || work.cone_voxels > 0);
    written += inside > 0 ? 1 : 0;
  }
  assert_true(passed > 15);
  assert_true(written > 15);
}

TEST(silence_is_ignored_or_empty_by_policy) {
  ModelConfig config = plain_config(32, 32, 60);
  Ping silent = ping_along(0, 90, 0);
  silent.kind = ReturnKind::kNoReturn;
  configure(model, config, plain_table(PlainBeam{}));
  assert_int_equal(model.integrate(silent, pose_at(16, 16, 5)), PingResult::kNoReturn);
  assert_true(touched(model).empty());

  for (const Rule rule : kRules) {
    config.rule = rule;
    config.no_return = NoReturnPolicy::kEmpty;
    config.detect_range_um = 30'000'000;
    configure(model, config, plain_table(PlainBeam{}));
    assert_int_equal(model.integrate(silent, pose_at(16, 16, 5)), PingResult::kNoReturn);
    const std::vector<Touched> list = touched(model);
    std::int32_t deepest = 0;
    std::int32_t highest = 1000;
    for (const Touched& at : list) {
      deepest = std::max(deepest, at.k);
      highest = std::min(highest, at.k);
      assert_true(at.voxel.miss >= at.voxel.hit);
      assert_true(rule == Rule::kWeightedMean || rule == Rule::kRecursive || at.voxel.hit == 0);
    }
    // Voxel centres between the transducer, 5, and the range at which a target would have been heard.
    assert_int_equal(highest, 5);
    assert_int_equal(deepest, 34);
    // Listened to 30 m, tan 0.05: the last slice alone is several voxels wide.
    assert_true(list.size() > 60);
    model.extract();
    assert_int_equal(model.result(16, 16).depth_q8, kUnknownDepth);
  }
}

TEST(empty_evidence_fades_with_range) {
  // Confidence of "empty" falls as the square root of range does, to nothing at the maximum range.
  ModelConfig config = plain_config(32, 32, 200);
  config.max_range_um = 200'000'000;
  // The pulling rules end at the signal itself, however little of it each ping says.
  for (const Rule rule : {Rule::kLogOdds, Rule::kWeightedMean}) {
    config.rule = rule;
    configure(model, config, plain_table(thin_beam()));
    for (int ping = 0; ping < 64; ++ping) {
      assert_int_equal(model.integrate(ping_along(0, 90, 195), pose_at(16.5, 16.5, 0)),
                       PingResult::kFused);
    }
    const Voxel* const axis = model.grid().column_voxels(model.grid().column_index(16, 16));
    const auto net = [axis](std::int32_t k) { return axis[k].miss - axis[k].hit; };
    assert_true(net(8) > 0);
    // In steps longer than the runs of voxels that share one weight.
    for (std::int32_t k = 40; k < 192; k += 32) {
      assert_true(net(k) < net(k - 32));
    }
    // Near the maximum range: hardly any.
    assert_true(net(190) < net(8) / 10);
  }
}

TEST(a_pings_own_position_error_widens_its_event) {
  configure(model, plain_config(64, 64, 32), plain_table(PlainBeam{}));
  Pose pose = pose_at(32, 32, 2);
  assert_int_equal(model.integrate(ping_along(0, 90, 20), pose), PingResult::kFused);
  const Blob sharp = blob_of_hits(model);
  ModelConfig config = plain_config(64, 64, 32);
  config.sigma_position_mm[0] = 3000;  // what the footprint is dimensioned for
  configure(model, config, plain_table(PlainBeam{}));
  pose.covariance.sigma_position_mm[0] = 3000;
  assert_int_equal(model.integrate(ping_along(0, 90, 20), pose), PingResult::kFused);
  const Blob north = blob_of_hits(model);
  // Half of 3^2 cells^2 (the ping's own displacement is the other half), less the cut at 2.2 sigma.
  assert_near(north.variance[0] - sharp.variance[0], 0.5 * 9.0 * 0.74, 0.6);
  assert_near(north.variance[1], sharp.variance[1], 0.1);
  configure(model, plain_config(64, 64, 32), plain_table(PlainBeam{}));
  pose.covariance.sigma_position_mm[0] = 0;
  pose.covariance.sigma_position_mm[2] = 1500;
  assert_int_equal(model.integrate(ping_along(0, 90, 20), pose), PingResult::kFused);
  const Blob vertical = blob_of_hits(model);
  assert_true(vertical.variance[2] > sharp.variance[2] + 1.0);
  assert_near(vertical.variance[0], sharp.variance[0], 0.2);
  // An absurd sigma is limited, not an overflow.
  pose.covariance.sigma_position_mm[0] = UINT32_MAX;
  pose.covariance.sigma_position_mm[1] = UINT32_MAX;
  pose.covariance.sigma_position_mm[2] = UINT32_MAX;
  assert_int_equal(model.integrate(ping_along(0, 90, 20), pose), PingResult::kFused);
}

TEST(a_two_axis_table_writes_an_elongated_footprint) {
  PlainBeam beam;
  beam.two_axis = true;
  beam.half_angle_along_rad = 0.01;
  beam.half_angle_across_rad = 0.25;
  beam.sigma_pointing_rad = 0.002;
  for (const Rule rule : kRules) {
    ModelConfig config = plain_config(64, 64, 40);
    config.rule = rule;
    config.max_range_um = 60'000'000;
    configure(model, config, plain_table(beam));
    Pose pose = pose_at(32, 32, 2);
    assert_int_equal(model.integrate(ping_along(0, 90, 30), pose), PingResult::kFused);
    const Blob level = blob_of_hits(model);
    assert_true(level.variance[1] > 4.0 * level.variance[0]);
    // Cone and shell alike: no empty evidence outside the narrow axis' thickened fan.
    for (const Touched& at : touched(model)) {
      if (at.k < 25) {
        assert_true(std::fabs(at.n + 0.5 - 32) < 0.9 + 0.012 * 30);
      }
    }
    // Seen obliquely, from a turned and rotated head, the same fan.
    configure(model, config, plain_table(beam));
    pose.attitude.heading_bam32 = bam(90);
    Ping ping = ping_along(0, 90, 30);
    assert_int_equal(model.integrate(ping, pose), PingResult::kFused);
    const Blob headed = blob_of_hits(model);
    assert_true(headed.variance[0] > 4.0 * headed.variance[1]);
    configure(model, config, plain_table(beam));
    ping = ping_along(90, 60, 30);
    ping.rotation_bam32 = bam(90);
    assert_int_equal(model.integrate(ping, pose), PingResult::kFused);
    assert_true(blob_of_hits(model).mass > 100);
  }
}

TEST(walls_are_written_upright) {
  configure(model, plain_config(64, 64, 40), plain_table(PlainBeam{}));
  // Looking north, level, at something 30 cells away.
  assert_int_equal(model.integrate(ping_along(0, 0, 30), pose_at(10, 32, 20)), PingResult::kFused);
  const Blob blob = blob_of_hits(model);
  assert_true(blob.mass > 100);
  assert_near(blob.centre[0], 40, 0.3);
  assert_near(blob.centre[1], 32, 0.3);
  assert_near(blob.centre[2], 20, 0.3);
  // Lateral spread across and down, radial blur along the beam.
  assert_true(blob.variance[1] > 0.4 && blob.variance[2] > 0.2);
  // Before it: empty, to within half a radial sigma.
  const Voxel* const before = model.grid().column_voxels(model.grid().column_index(30, 32));
  assert_true(before[20].miss > 0 && before[20].hit == 0);
  // Straight up (the surface, or ice).
  configure(model, plain_config(64, 64, 40), plain_table(PlainBeam{}));
  assert_int_equal(model.integrate(ping_along(0, -90, 20), pose_at(32, 32, 35)),
                   PingResult::kFused);
  assert_near(blob_of_hits(model).centre[2], 15, 0.5);
  const Voxel* const above = model.grid().column_voxels(model.grid().column_index(32, 32));
  assert_true(above[25].miss > 0);
}

// ------------------------------------------------------------------------------ whole surveys

TEST(a_later_return_says_nothing_of_the_way_to_it) {
  configure(model, plain_config(20, 20, 32), plain_table(PlainBeam{}));
  const Pose pose = pose_at(10, 10, 1);
  // A fish at 8 cells, the bottom at 20: what lies between them stays unknown, and nothing is behind.
  assert_int_equal(model.integrate(ping_along(0, 90, 8), pose), PingResult::kFused);
  const std::vector<Touched> before = touched(model);
  assert_int_equal(model.integrate_behind(ping_along(0, 90, 20), pose), PingResult::kFused);
  assert_true(model.counters().pings[static_cast<int>(PingResult::kFused)] == 1);
  assert_true(model.counters().behind_fused == 1);
  const Voxel* const column = model.grid().column_voxels(model.grid().column_index(10, 10));
  assert_true(column[4].miss > 0);
  assert_true(column[9].hit > 0);
  assert_true(column[21].hit > 0);
  for (std::int32_t k = 13; k < 18; ++k) {
    assert_int_equal(column[k].hit, 0);
    assert_int_equal(column[k].miss, 0);
  }
  for (std::int32_t k = 25; k < 32; ++k) {
    assert_int_equal(column[k].hit + column[k].miss, 0);
  }
  for (const Touched& at : touched(model)) {
    const bool new_one = std::none_of(before.begin(), before.end(), [&at](const Touched& old) {
      return old.n == at.n && old.e == at.e && old.k == at.k;
    });
    assert_true(!new_one || (at.voxel.miss == 0 && at.voxel.hit > 0));
  }
  // What cannot be used wrote nothing.
  const std::uint64_t updates = model.counters().voxel_updates;
  assert_int_equal(model.integrate_behind(ping_along(0, 90, 5000), pose),
                   PingResult::kRangeTooLong);
  assert_int_equal(model.integrate_behind(ping_along(0, 90, 20), pose, 3),
                   PingResult::kNotConfigured);
  assert_true(model.counters().voxel_updates == updates);
  assert_int_equal(model.counters().last_voxels_per_ping, 0);
}

std::uint32_t sum_of(const Model& of, std::uint16_t Voxel::*half) {
  std::uint32_t sum = 0;
  for (std::int32_t n = 0; n < 20; ++n) {
    for (std::int32_t e = 0; e < 20; ++e) {
      const Voxel* const voxels = of.grid().column_voxels(of.grid().column_index(n, e));
      for (std::int32_t k = 0; k < 32; ++k) {
        sum += voxels[k].*half;
      }
    }
  }
  return sum;
}

TEST(quality_scales_evidence_and_what_was_heard_ends_the_free_way) {
  const Pose pose = pose_at(10, 10, 1);
  const auto sums = [&pose](const ReturnDetail& detail) {
    configure(model, plain_config(20, 20, 32), plain_table(PlainBeam{}));
    assert_int_equal(model.integrate(ping_along(0, 90, 20), pose, 0, detail), PingResult::kFused);
    return std::pair<double, double>(sum_of(model, &Voxel::hit), sum_of(model, &Voxel::miss));
  };
  const auto whole = sums({});
  const auto half = sums({128});
  assert_near(half.first / whole.first, 0.5, 0.05);
  assert_near(half.second / whole.second, 0.5, 0.05);
  const auto none = sums({0});
  assert_near(none.first + none.second, 0.0, 0.0);
  // Something faint at 8 cells: the shell is the same, and nothing is said of the way behind 8.
  const auto faint = sums({kWholeShare_q8, 8'000'000});
  assert_near(faint.first, whole.first, 0.0);
  assert_true(faint.second < 0.6 * whole.second);
  const Voxel* const column = model.grid().column_voxels(model.grid().column_index(10, 10));
  assert_true(column[5].miss > 0);
  for (std::int32_t k = 10; k < 17; ++k) {
    assert_int_equal(column[k].miss, 0);
  }
}

}  // namespace
