// The model as a whole: what it refuses, what it counts, and that the same input gives the same map.
#include <array>
#include <set>
#include <string>
#include <utility>

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
using leadline::base::Status;

// Tens of megabytes each: static.
Model model;
Model other;

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

// ------------------------------------------------------------------------------ whole surveys

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
