// The whole model, ping by ping: what is written, what is not, what is refused.
#include <algorithm>
#include <array>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "model/base/fixed.hpp"
#include "model/model.hpp"
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
using leadline::base::Status;

// Tens of megabytes each: static.
Model model;
Model other;

using Vector = std::array<double, 3>;

constexpr Rule kRules[] = {Rule::kLogOdds, Rule::kWeightedMean, Rule::kCertaintyFactor,
                           Rule::kRecursive};

void configure(Model& which, const ModelConfig& config, const LocalizationTable& table) {
  assert_int_equal(which.configure(config, &table, sizeof(table)), Status::kOk);
}

struct Touched {
  std::int32_t n, e, k;
  Voxel voxel;
};

/// Every voxel with evidence.
std::vector<Touched> touched(const Model& which) {
  std::vector<Touched> list;
  const Grid& grid = which.grid();
  for (std::int32_t n = 0; n < grid.north_cells(); ++n) {
    for (std::int32_t e = 0; e < grid.east_cells(); ++e) {
      const Voxel* const voxels = grid.column_voxels(grid.column_index(n, e));
      for (std::int32_t k = 0; k < grid.depth_cells(); ++k) {
        if (voxels[k].hit != 0 || voxels[k].miss != 0) {
          list.push_back({n, e, k, voxels[k]});
        }
      }
    }
  }
  return list;
}

/// Weighted centre of the hits, and their variance per axis, cells.
struct Blob {
  Vector centre{};
  Vector variance{};
  double mass = 0.0;
};

Blob blob_of_hits(const Model& which) {
  Blob blob;
  const std::vector<Touched> list = touched(which);
  for (int pass = 0; pass < 2; ++pass) {
    for (const Touched& at : list) {
      const Vector position = {at.n + 0.5, at.e + 0.5, at.k + 0.5};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (pass == 0) {
          blob.centre[axis] += at.voxel.hit * position[axis];
        } else {
          const double apart = position[axis] - blob.centre[axis];
          blob.variance[axis] += at.voxel.hit * apart * apart / blob.mass;
        }
      }
      blob.mass += pass == 0 ? at.voxel.hit : 0.0;
    }
    for (double& centre : blob.centre) {
      centre /= pass == 0 ? std::max(blob.mass, 1.0) : 1.0;
    }
  }
  return blob;
}

/// Position of the transducer, metres.
Vector metres(const Pose& pose) {
  Vector position{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    position[axis] = static_cast<double>(pose.position_um[axis]) * 1e-6;
  }
  return position;
}

/// Unit vector of the beam, from the very formula of the contract.
Vector beam_vector(const Pose& pose, const Ping& ping) {
  const auto rad = [](Bam32 angle) { return angle * (6.283185307179586 / 4294967296.0); };
  const double az = rad(ping.azimuth_bam32);
  const double el = rad(ping.elevation_bam32);
  const double r = rad(pose.attitude.roll_bam32);
  const double p = rad(pose.attitude.pitch_bam32);
  const double h = rad(pose.attitude.heading_bam32);
  const Vector v = {std::cos(el) * std::cos(az), std::cos(el) * std::sin(az), std::sin(el)};
  const double y = std::cos(r) * v[1] - std::sin(r) * v[2];
  const double z = std::sin(r) * v[1] + std::cos(r) * v[2];
  const double x = std::cos(p) * v[0] + std::sin(p) * z;
  return {std::cos(h) * x - std::sin(h) * y, std::sin(h) * x + std::cos(h) * y,
          std::cos(p) * z - std::sin(p) * v[0]};
}

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

// ------------------------------------------------------------------------------------- refusals

TEST(configuring_refuses_bad_tables_and_budgets) {
  const LocalizationTable table = plain_table(PlainBeam{});
  ModelConfig config = plain_config(32, 32, 32);
  assert_int_equal(model.configure(config, nullptr, 0), Status::kInvalidArgument);
  assert_int_equal(model.configure(config, &table, sizeof(table) - 1), Status::kTruncated);
  LocalizationTable damaged = table;
  damaged.profile_q15[0][0][5] ^= 1U;
  assert_int_equal(model.configure(config, &damaged, sizeof(damaged)), Status::kBadChecksum);
  damaged = table;
  damaged.version = 9;
  assert_int_equal(model.configure(config, &damaged, sizeof(damaged)), Status::kBadVersion);
  config.cell_mm = 0;
  assert_int_equal(model.configure(config, &table, sizeof(table)), Status::kOutOfRange);
  // After a refusal nothing is accepted.
  assert_int_equal(model.integrate(ping_along(0, 90, 5), pose_at(16, 16, 0)),
                   PingResult::kNotConfigured);
  model.extract();

  config = plain_config(32, 32, 32);
  config.work_budget_voxels = 1;
  assert_int_equal(model.configure(config, &table, sizeof(table)), Status::kOverBudget);
  // The numbers that the refusal is about.
  const WorkBound bound = model.bound();
  assert_true(bound.total_voxels > 1);
  assert_int_equal(bound.total_voxels, bound.shell_voxels + bound.cone_voxels);
  config.work_budget_voxels = bound.total_voxels - 1;
  assert_int_equal(model.configure(config, &table, sizeof(table)), Status::kOverBudget);
  config.work_budget_voxels = bound.total_voxels;
  assert_int_equal(model.configure(config, &table, sizeof(table)), Status::kOk);
  // Within the voxels but, with the padding of its tiles, over the storage.
  config = plain_config(16000, 1, 1024);
  assert_int_equal(model.configure(config, &table, sizeof(table)), Status::kOverCapacity);
  assert_int_equal(model.integrate(ping_along(0, 90, 5), pose_at(16, 16, 0)),
                   PingResult::kNotConfigured);
}

TEST(unusable_pings_are_counted_by_reason_and_carve_nothing) {
  ModelConfig config = plain_config(32, 32, 32);
  config.min_range_um = 2'000'000;
  config.max_range_um = 20'000'000;
  configure(model, config, plain_table(PlainBeam{}));
  const std::uint64_t empty = model.grid().map_hash();
  const Pose pose = pose_at(16, 16, 0);

  const auto refuse = [&](const Ping& ping, const Pose& at, PingResult reason) {
    const std::uint64_t before = model.counters().pings[static_cast<int>(reason)];
    assert_int_equal(model.integrate(ping, at), reason);
    assert_int_equal(model.counters().pings[static_cast<int>(reason)], before + 1);
    assert_int_equal(model.counters().voxel_updates, 0);
    assert_true(model.grid().map_hash() == empty);
  };
  refuse(ping_along(0, 90, 1.999999), pose, PingResult::kRangeTooShort);
  refuse(ping_along(0, 90, 0.0), pose, PingResult::kRangeTooShort);
  refuse(ping_along(0, 90, -3.0), pose, PingResult::kRangeTooShort);
  refuse(ping_along(0, 90, 20.000001), pose, PingResult::kRangeTooLong);
  Ping extreme = ping_along(0, 90, 5);
  extreme.range_um = INT64_MAX;
  refuse(extreme, pose, PingResult::kRangeTooLong);
  extreme.range_um = INT64_MIN;
  refuse(extreme, pose, PingResult::kRangeTooShort);
  Ping profile = ping_along(0, 90, 5);
  profile.kind = ReturnKind::kProfile;
  refuse(profile, pose, PingResult::kProfile);
  Ping silent = ping_along(0, 90, 5);
  silent.kind = ReturnKind::kNoReturn;
  refuse(silent, pose, PingResult::kNoReturn);
  for (const unsigned bit : {0U, 1U, 2U}) {
    Pose invalid = pose;
    invalid.validity = static_cast<std::uint8_t>(leadline::base::kPoseAll & ~(1U << bit));
    refuse(ping_along(0, 90, 5), invalid, PingResult::kPoseInvalid);
  }
  for (int axis = 0; axis < 3; ++axis) {
    for (const std::int64_t far_um : {16'000'000'001LL, -16'000'000'001LL, 2'000'000'000'000LL}) {
      Pose far = pose;
      far.position_um[axis] = far_um;
      refuse(ping_along(0, 90, 5), far, PingResult::kTooFar);
    }
  }
  // The limits themselves, and unknown validity bits, are accepted.
  Pose extra = pose;
  extra.validity = 0xFF;
  assert_int_equal(model.integrate(ping_along(0, 90, 2.0), extra), PingResult::kFused);
  assert_int_equal(model.integrate(ping_along(0, 90, 20.0), extra), PingResult::kFused);
  assert_true(model.grid().map_hash() != empty);
  std::uint64_t total = 0;
  for (const std::uint64_t count : model.counters().pings) {
    total += count;
  }
  assert_int_equal(total, 8 + 3 + 9 + 2);
}

TEST(a_minimum_range_of_zero_still_refuses_zero) {
  ModelConfig config = plain_config(16, 16, 16);
  config.min_range_um = 0;
  configure(model, config, plain_table(PlainBeam{}));
  assert_int_equal(model.integrate(ping_along(0, 90, 0), pose_at(8, 8, 0)),
                   PingResult::kRangeTooShort);
}

TEST(every_result_has_its_own_name) {
  std::set<std::string> names;
  for (int i = 0; i <= static_cast<int>(PingResult::kCount); ++i) {
    names.insert(ping_result_name(static_cast<PingResult>(i)));
  }
  assert_int_equal(names.size(), static_cast<int>(PingResult::kCount) + 1);
  assert_string_equal(ping_result_name(static_cast<PingResult>(200)), "unknown");
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

struct Survey {
  std::vector<Ping> pings;
  std::vector<Pose> poses;
};

/// Random near-vertical pings over a tilted, rippled bottom.
Survey survey(std::uint64_t stream, int count, double north, double east) {
  Random random(stream);
  Survey result;
  for (int i = 0; i < count; ++i) {
    Pose pose = pose_at(north * random.uniform(), east * random.uniform(), 0.5);
    pose.t_us = i * 100'000LL;
    pose.attitude = Attitude{bam(3 * random.normal()), bam(3 * random.normal()),
                             static_cast<Bam32>(random.next())};
    Ping ping = ping_along(0, 90, 0);
    const Vector u = beam_vector(pose, ping);
    // Intersection with the bottom along the axis, by iteration.
    double range = 18.0;
    for (int step = 0; step < 30; ++step) {
      const double n = metres(pose)[0] + range * u[0];
      const double e = metres(pose)[1] + range * u[1];
      const double bottom = 18.0 + 0.1 * n + 1.5 * std::sin(e / 5.0);
      range += (bottom - 0.5 - range * u[2]) / u[2];
    }
    ping = ping_along(0, 90, range + 0.3 * random.normal());
    ping.t_transmit_us = pose.t_us;
    result.pings.push_back(ping);
    result.poses.push_back(pose);
  }
  return result;
}

void run(Model& which, const Survey& data) {
  for (std::size_t i = 0; i < data.pings.size(); ++i) {
    assert_int_equal(which.integrate(data.pings[i], data.poses[i]), PingResult::kFused);
  }
}

TEST(the_same_input_gives_the_same_map) {
  const Survey data = survey(1, 4000, 40, 40);
  const LocalizationTable table = plain_table(PlainBeam{});
  for (const Rule rule : kRules) {
    ModelConfig config = plain_config(40, 40, 32);
    config.rule = rule;
    configure(model, config, table);
    configure(other, config, table);
    run(model, data);
    // Extracting in between, by any method, is looking, not touching.
    for (std::size_t i = 0; i < data.pings.size(); ++i) {
      static_cast<void>(other.integrate(data.pings[i], data.poses[i]));
      if (i % 500 == 7) {
        const std::uint64_t before = other.grid().map_hash();
        other.extract(static_cast<DepthMethod>(i / 500 % 3));
        assert_true(other.grid().map_hash() == before);
      }
    }
    assert_true(model.grid().map_hash() == other.grid().map_hash());
    // Again, from the start, in the same object.
    const std::uint64_t first = model.grid().map_hash();
    configure(model, config, table);
    assert_true(model.grid().map_hash() != first);
    run(model, data);
    assert_true(model.grid().map_hash() == first);
    assert_int_equal(model.counters().pings[static_cast<int>(PingResult::kFused)], 4000);
  }
}

TEST(the_map_does_not_depend_on_where_pages_lie) {
  // Pages are exchanged before the first ping, as a pager that reuses storage would leave them.
  const Survey data = survey(2, 1500, 60, 60);
  const LocalizationTable table = plain_table(PlainBeam{});
  const ModelConfig config = plain_config(60, 60, 32);
  configure(model, config, table);
  configure(other, config, table);
  for (TileId id = 0; id + 1 < other.grid().tile_count(); id += 2) {
    std::swap(other.grid().tile(id).page, other.grid().tile(id + 1).page);
  }
  run(model, data);
  run(other, data);
  assert_true(model.grid().map_hash() == other.grid().map_hash());
}

TEST(depth_comes_from_the_voxels_alone) {
  const Survey data = survey(3, 6000, 40, 40);
  const LocalizationTable table = plain_table(PlainBeam{});
  for (const Rule rule : kRules) {
    ModelConfig config = plain_config(40, 40, 32);
    config.rule = rule;
    configure(model, config, table);
    run(model, data);
    // A second model gets the voxels, and side records full of noise.
    configure(other, config, table);
    Random random(4);
    for (std::uint32_t column = 0; column < model.grid().column_count(); ++column) {
      std::copy_n(model.grid().column_voxels(column), 32, other.grid().column_voxels(column));
      ColumnRecord& record = other.grid().column(column);
      record.depth_q8 = static_cast<std::int32_t>(random.between(0, 8192));
      record.mass = static_cast<std::uint32_t>(random.between(0, 100000));
      record.gain = static_cast<std::uint32_t>(random.between(0, 100000));
      record.blur_q8 = static_cast<std::uint16_t>(random.between(0, 65535));
      record.flags = static_cast<std::uint8_t>(random.between(0, 15));
    }
    assert_true(model.grid().map_hash() == other.grid().map_hash());
    model.extract();
    other.extract();
    for (std::int32_t n = 0; n < 40; ++n) {
      for (std::int32_t e = 0; e < 40; ++e) {
        if (model.result(n, e).depth_q8 != other.result(n, e).depth_q8) {
          fail_msg("column (%d, %d): depth %d from the survey's own records, %d from others", n, e,
                   model.result(n, e).depth_q8, other.result(n, e).depth_q8);
        }
        assert_int_equal(model.result(n, e).raw_q8, other.result(n, e).raw_q8);
        assert_true(model.multi_surface(n, e) == other.multi_surface(n, e));
      }
    }
  }
}

TEST(a_survey_reads_its_bottom) {
  const Survey data = survey(5, 12'000, 40, 40);
  const LocalizationTable table = plain_table(PlainBeam{});
  for (const Rule rule : kRules) {
    ModelConfig config = plain_config(40, 40, 32);
    config.rule = rule;
    configure(model, config, table);
    run(model, data);
    for (const DepthMethod method :
         {DepthMethod::kRobustMoment, DepthMethod::kFirstMoment, DepthMethod::kUpperCrossing}) {
      model.extract(method);
      double squares = 0.0;
      int known = 0;
      for (std::int32_t n = 0; n < 40; ++n) {
        for (std::int32_t e = 0; e < 40; ++e) {
          const ColumnResult& result = model.result(n, e);
          if (result.depth_q8 == kUnknownDepth) {
            continue;
          }
          assert_true(result.sigma_q12 > 0);
          assert_in_range(result.depth_q8, 0, 256 * 32);
          const double truth = 18.0 + 0.1 * (n + 0.5) + 1.5 * std::sin((e + 0.5) / 5.0);
          squares += (result.depth_q8 / 256.0 - truth) * (result.depth_q8 / 256.0 - truth);
          ++known;
        }
      }
      const double rmse = std::sqrt(squares / std::max(known, 1));
      print_message("rule %d, method %d: %d of 1600 columns, rmse %.3f cells\n",
                    static_cast<int>(rule), static_cast<int>(method), known, rmse);
      assert_true(method != DepthMethod::kRobustMoment || (rmse < 0.25 && known == 1600));
    }
  }
}

TEST(sensors_have_their_own_tables_and_ranges) {
  const LocalizationTable sharp = plain_table(PlainBeam{});
  PlainBeam vague_beam;
  vague_beam.half_angle_along_rad = 0.2;
  vague_beam.half_angle_across_rad = 0.2;
  vague_beam.sigma_range_um = 2'000'000;
  const LocalizationTable vague = plain_table(vague_beam);
  const ModelConfig config = plain_config(40, 40, 32);
  const SensorConfig sensors[] = {
      {&sharp, sizeof(sharp), 1'000'000, 50'000'000, 0},
      {&vague, sizeof(vague), 5'000'000, 20'000'000, 0},
  };
  assert_int_equal(model.configure_sensors(config, sensors, 2), Status::kOk);
  assert_int_equal(model.sensor_count(), 2);
  assert_int_equal(model.table(1).crc32c, vague.crc32c);
  assert_true(model.scale(1).footprint_cells > model.scale(0).footprint_cells);
  // One unit of evidence, that of the sharper one; the bound is that of the vaguer.
  assert_true(model.scale(0).min_variance_q12 == model.scale(1).min_variance_q12);
  const std::uint32_t bound = model.bound().total_voxels;
  assert_int_equal(other.configure_sensors(config, &sensors[1], 1), Status::kOk);
  assert_int_equal(bound, other.bound().total_voxels);

  const Pose pose = pose_at(20.5, 20.5, 2);
  assert_int_equal(model.integrate(ping_along(0, 90, 3), pose, 0), PingResult::kFused);
  assert_int_equal(model.integrate(ping_along(0, 90, 3), pose, 1), PingResult::kRangeTooShort);
  assert_int_equal(model.integrate(ping_along(0, 90, 25), pose, 0), PingResult::kFused);
  assert_int_equal(model.integrate(ping_along(0, 90, 25), pose, 1), PingResult::kRangeTooLong);
  assert_int_equal(model.integrate(ping_along(0, 90, 15), pose, 2), PingResult::kNotConfigured);

  // Alone in a model of two, the sharp sensor leaves what it leaves in a model of its own.
  const Survey data = survey(8, 800, 40, 40);
  assert_int_equal(model.configure_sensors(config, sensors, 2), Status::kOk);
  assert_int_equal(other.configure_sensors(config, sensors, 1), Status::kOk);
  run(model, data);
  run(other, data);
  assert_true(model.grid().map_hash() == other.grid().map_hash());
  // The vague one says less, in more places.
  assert_int_equal(model.configure_sensors(config, sensors, 2), Status::kOk);
  assert_int_equal(model.integrate(ping_along(0, 90, 15), pose, 0), PingResult::kFused);
  const Blob narrow = blob_of_hits(model);
  assert_int_equal(model.configure_sensors(config, sensors, 2), Status::kOk);
  assert_int_equal(model.integrate(ping_along(0, 90, 15), pose, 1), PingResult::kFused);
  const Blob wide = blob_of_hits(model);
  assert_true(wide.variance[0] > 2.0 * narrow.variance[0]);
  assert_true(wide.variance[2] > 2.0 * narrow.variance[2]);

  SensorConfig bad = sensors[0];
  bad.table = nullptr;
  assert_int_equal(model.configure_sensors(config, &bad, 1), Status::kInvalidArgument);
  assert_int_equal(model.configure_sensors(config, sensors, 0), Status::kInvalidArgument);
  assert_int_equal(model.configure_sensors(config, nullptr, 1), Status::kInvalidArgument);
  const std::vector<SensorConfig> many(kMaxSensors + 1, sensors[0]);
  assert_int_equal(model.configure_sensors(config, many.data(), many.size()),
                   Status::kOverCapacity);
  bad = sensors[0];
  bad.max_range_um = bad.min_range_um;
  assert_int_equal(model.configure_sensors(config, &bad, 1), Status::kOutOfRange);
  assert_int_equal(model.integrate(ping_along(0, 90, 15), pose), PingResult::kNotConfigured);
}

TEST(work_stays_within_the_bound_and_is_counted) {
  const Survey data = survey(6, 3000, 60, 60);
  configure(model, plain_config(40, 40, 32), plain_table(PlainBeam{}));
  run(model, data);
  const ModelCounters& counters = model.counters();
  assert_true(counters.max_voxels_per_ping > 0);
  assert_true(counters.max_voxels_per_ping <= model.bound().total_voxels);
  assert_true(counters.last_voxels_per_ping <= counters.max_voxels_per_ping);
  assert_true(counters.voxel_updates >= counters.max_voxels_per_ping);
  assert_true(counters.columns_updated > 3000);
  assert_true(counters.column_extractions > 0);
  // Reading columns again only once their evidence has doubled: far fewer than nine per ping.
  assert_true(counters.column_extractions < 3000 * Model::kSlopeColumns / 3);
}

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

TEST(columns_near_saturation_are_rescaled_and_keep_their_depth) {
  configure(model, plain_config(20, 20, 32), plain_table(PlainBeam{}));
  Random random(7);
  for (int i = 0; i < 40'000; ++i) {
    const Pose pose = pose_at(9.0 + 2.0 * random.uniform(), 9.0 + 2.0 * random.uniform(), 1.0);
    assert_int_equal(model.integrate(ping_along(0, 90, 20.25 + 0.5 * random.normal()), pose),
                     PingResult::kFused);
  }
  assert_true(model.counters().columns_rescaled > 0);
  model.extract();
  assert_near(model.result(10, 10).depth_q8 / 256.0, 21.25, 0.05);
  // Halved in good time: nothing at the bottom ever stood at the end of its range.
  for (const Touched& at : touched(model)) {
    assert_true(at.voxel.hit < 65535);
  }
}

TEST(tiles_count_the_pings_that_touched_them) {
  configure(model, plain_config(40, 40, 32), plain_table(PlainBeam{}));
  for (int i = 0; i < 5; ++i) {
    assert_int_equal(model.integrate(ping_along(0, 90, 20), pose_at(8, 8, 1)), PingResult::kFused);
  }
  const Grid& grid = model.grid();
  assert_int_equal(grid.tile(grid.tile_of(8, 8)).generation, 5);
  assert_int_equal(grid.tile(grid.tile_of(30, 30)).generation, 0);
}

TEST(columns_remember_when_they_were_touched) {
  configure(model, plain_config(20, 20, 32), plain_table(PlainBeam{}));
  Ping ping = ping_along(0, 90, 20);
  ping.t_transmit_us = 123'456'789'000;
  assert_int_equal(model.integrate(ping, pose_at(10, 10, 1)), PingResult::kFused);
  const ColumnRecord& record = model.grid().column(model.grid().column_index(10, 10));
  assert_int_equal(record.last_touch_ds, 1'234'567);
  assert_true((record.flags & kColumnTouched) != 0);
  assert_true((record.flags & kColumnDirty) != 0);
  model.extract();
  assert_true((record.flags & kColumnDirty) == 0);
  assert_true((record.flags & kColumnTouched) != 0);
}

TEST(two_surfaces_in_a_column_are_flagged) {
  configure(model, plain_config(32, 32, 40), plain_table(PlainBeam{}));
  for (int i = 0; i < 200; ++i) {
    // A deck seen from above and, from below it, the bottom: the second pings start under the deck.
    assert_int_equal(model.integrate(ping_along(0, 90, 10), pose_at(16, 16, 1)),
                     PingResult::kFused);
    assert_int_equal(model.integrate(ping_along(0, 90, 15), pose_at(16, 16, 18)),
                     PingResult::kFused);
  }
  model.extract();
  assert_true(model.multi_surface(16, 16));
  assert_true(!model.multi_surface(2, 2));
}

TEST(correlated_sigma_is_a_floor_that_is_not_averaged) {
  const Survey data = survey(8, 8000, 40, 40);
  ModelConfig config = plain_config(40, 40, 32);
  const LocalizationTable table = plain_table(PlainBeam{});
  configure(model, config, table);
  run(model, data);
  model.extract();
  config.sigma_correlated_mm[2] = 400;
  configure(other, config, table);
  run(other, data);
  other.extract();
  for (std::int32_t n = 4; n < 36; ++n) {
    for (std::int32_t e = 4; e < 36; ++e) {
      const double plain = model.result(n, e).sigma_q12 / 4096.0;
      const double with = other.result(n, e).sigma_q12 / 4096.0;
      assert_near(with, std::hypot(plain, 0.4), 0.01);
      // Depths and voxels do not change.
      assert_int_equal(model.result(n, e).depth_q8, other.result(n, e).depth_q8);
    }
  }
  // Horizontally it counts with the slope: 0.1 northwards, up to 0.3 eastwards.
  config.sigma_correlated_mm[2] = 0;
  config.sigma_correlated_mm[1] = 5000;
  configure(other, config, table);
  run(other, data);
  other.extract();
  double most = 0.0;
  for (std::int32_t e = 4; e < 36; ++e) {
    const double plain = model.result(20, e).sigma_q12 / 4096.0;
    const double with = other.result(20, e).sigma_q12 / 4096.0;
    most = std::max(most, std::sqrt(std::max(0.0, with * with - plain * plain)));
  }
  assert_near(most, 0.3 * 5.0, 0.35);
}

TEST(a_correlated_sigma_on_a_cliff_grows_to_its_limit_and_never_wraps) {
  // A plane that falls by fifteen cells a cell, as it would stand in the voxels.
  constexpr std::int32_t kFall_cells = 15;
  const LocalizationTable table = plain_table(PlainBeam{});
  const auto sigma_cells = [&table](std::int64_t correlated_mm) {
    ModelConfig config = plain_config(12, 12, 200);
    config.sigma_correlated_mm[0] = correlated_mm;
    configure(model, config, table);
    for (std::int32_t n = 0; n < 12; ++n) {
      for (std::int32_t e = 0; e < 12; ++e) {
        model.grid().column_voxels(model.grid().column_index(n, e))[10 + kFall_cells * n].hit =
            20'000;
      }
    }
    model.extract();
    const std::int32_t fall_q8 = model.result(8, 6).depth_q8 - model.result(4, 6).depth_q8;
    assert_near(fall_q8 / 256.0, 4.0 * kFall_cells, 0.1);
    return model.result(6, 6).sigma_q12 / 4096.0;
  };
  const double own = sigma_cells(1);
  // Exact up to eight cells, with fewer bits beyond, cut at 512.
  for (const std::int64_t cells : {1, 4, 8, 9, 60, 511, 512, 600, 2'000, 100'000}) {
    const double expected =
        std::hypot(own, kFall_cells * std::min(512.0, static_cast<double>(cells)));
    assert_near(sigma_cells(cells * 1000), expected, 0.002 * expected);
  }
}

TEST(odd_grids_are_no_special_case) {
  // Lines, single columns, single layers: pings over them fuse, extraction stands.
  const LocalizationTable table = plain_table(PlainBeam{});
  const Survey data = survey(9, 300, 20, 20);
  for (const auto& size :
       {std::array<std::int32_t, 3>{1, 1, 40}, std::array<std::int32_t, 3>{1, 20, 40},
        std::array<std::int32_t, 3>{20, 1, 40}, std::array<std::int32_t, 3>{20, 20, 1},
        std::array<std::int32_t, 3>{1, 1, 1}, std::array<std::int32_t, 3>{2, 3, 1024}}) {
    ModelConfig config = plain_config(size[0], size[1], size[2]);
    configure(model, config, table);
    run(model, data);
    model.extract();
    for (std::int32_t n = 0; n < size[0]; ++n) {
      for (std::int32_t e = 0; e < size[1]; ++e) {
        const std::int32_t depth = model.result(n, e).depth_q8;
        assert_true(depth == kUnknownDepth || (depth >= 0 && depth <= 256 * size[2]));
      }
    }
  }
}

TEST(random_pings_of_any_kind_break_nothing) {
  // Whatever the records hold, the model stays within its bound, its grid and its arithmetic (the
  // sanitizer builds watch).
  Random random(10);
  for (int round = 0; round < 12; ++round) {
    PlainBeam beam;
    beam.half_angle_along_rad = 0.0005 + 0.8 * random.uniform() * random.uniform();
    beam.half_angle_across_rad = 0.0005 + 0.8 * random.uniform() * random.uniform();
    beam.two_axis = random.between(0, 1) == 1;
    beam.sigma_pointing_rad = 0.1 * random.uniform();
    beam.sigma_range_um = static_cast<std::uint32_t>(random.between(0, 3'000'000));
    ModelConfig config = plain_config(static_cast<std::int32_t>(random.between(1, 70)),
                                      static_cast<std::int32_t>(random.between(1, 70)),
                                      static_cast<std::int32_t>(random.between(1, 60)));
    config.rule = kRules[random.between(0, 3)];
    config.no_return = random.between(0, 1) == 1 ? NoReturnPolicy::kIgnore : NoReturnPolicy::kEmpty;
    config.cell_mm = static_cast<std::int32_t>(random.between(100, 20'000));
    config.max_range_um = 100LL * config.cell_mm * 1000;
    config.min_range_um = 0;
    config.detect_range_um = random.between(1, config.max_range_um);
    configure(model, config, plain_table(beam));
    for (int i = 0; i < 1500; ++i) {
      Pose pose = pose_at(0, 0, 0);
      for (std::int64_t& position : pose.position_um) {
        position = random.between(-20LL * config.cell_mm * 1000, 80LL * config.cell_mm * 1000);
      }
      pose.attitude = Attitude{static_cast<Bam32>(random.next()), static_cast<Bam32>(random.next()),
                               static_cast<Bam32>(random.next())};
      for (std::uint32_t& sigma : pose.covariance.sigma_position_mm) {
        sigma = static_cast<std::uint32_t>(random.next() >>
                                           static_cast<unsigned>(random.between(40, 63)));
      }
      Ping ping{};
      ping.azimuth_bam32 = static_cast<Bam32>(random.next());
      ping.elevation_bam32 = static_cast<Bam32>(random.next());
      ping.rotation_bam32 = static_cast<Bam32>(random.next());
      ping.kind = static_cast<ReturnKind>(random.between(0, 2));
      ping.range_um = random.between(-10, config.max_range_um + 10);
      static_cast<void>(model.integrate(ping, pose));
      assert_true(model.counters().last_voxels_per_ping <= model.bound().total_voxels);
    }
    model.extract();
  }
}

}  // namespace
