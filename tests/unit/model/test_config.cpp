// Every bad value of a configuration is refused, and by its own status.
#include <functional>

#include "model/capacity.hpp"
#include "model/config.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using leadline::base::Status;
using leadline::test::plain_config;

Status check_changed(const std::function<void(ModelConfig*)>& change) {
  ModelConfig config = plain_config(64, 64, 32);
  change(&config);
  const Status status = check_config(config);
  return status != Status::kOk ? status
                               : check_ranges(config, config.min_range_um, config.max_range_um,
                                              config.detect_range_um);
}

#define assert_status(status, statement) \
  assert_int_equal(check_changed([](ModelConfig* c) { statement; }), Status::status)

TEST(a_plain_configuration_passes) {
  assert_status(kOk, (void)c);
  assert_status(kOk, c->rule = Rule::kWeightedMean);
  assert_status(kOk, c->no_return = NoReturnPolicy::kEmpty);
}

TEST(another_schema_is_refused_before_anything_else) {
  assert_status(kBadVersion, c->schema_version = 0);
  assert_status(kBadVersion, (c->schema_version = 2, c->cell_mm = 0));
}

TEST(enumerations) {
  assert_status(kOutOfRange, c->rule = static_cast<Rule>(4));
  assert_status(kOutOfRange, c->rule = static_cast<Rule>(255));
  assert_status(kOutOfRange, c->no_return = static_cast<NoReturnPolicy>(2));
}

TEST(gain_of_the_pulling_rules) {
  for (const Rule rule : {Rule::kCertaintyFactor, Rule::kRecursive}) {
    ModelConfig config = plain_config(64, 64, 32);
    config.rule = rule;
    config.k_p_q16 = 0;
    assert_int_equal(check_config(config), Status::kOutOfRange);
    config.k_p_q16 = 65537;
    assert_int_equal(check_config(config), Status::kOutOfRange);
    config.k_p_q16 = 65536;
    assert_int_equal(check_config(config), Status::kOk);
    config.k_p_q16 = 1;
    assert_int_equal(check_config(config), Status::kOk);
  }
  // The others do not read it.
  assert_status(kOk, c->k_p_q16 = 70000);
}

TEST(cell_size) {
  assert_status(kOutOfRange, c->cell_mm = 0);
  assert_status(kOutOfRange, c->cell_mm = -1000);
  assert_status(kOutOfRange, c->cell_mm = INT32_MIN);
  assert_status(kOutOfRange, c->cell_mm = 1'000'001);
  assert_status(kOk, c->cell_mm = 1'000'000);
  assert_status(kOk, (c->cell_mm = 1, c->max_range_um = 8'000'000));
}

TEST(grid_size) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const std::int32_t bad : {0, -1, INT32_MIN, kMaxSideCells + 1, INT32_MAX}) {
      ModelConfig config = plain_config(64, 64, 32);
      config.size[axis] = bad;
      assert_int_equal(check_config(config), Status::kOutOfRange);
    }
  }
  assert_status(kOutOfRange, c->size[2] = kMaxDepthCells + 1);
  assert_status(kOk, (c->size[0] = c->size[1] = kTileCells, c->size[2] = kMaxDepthCells));
  assert_status(kOk, (c->size[0] = kMaxSideCells, c->size[1] = 1));
}

TEST(capacity) {
  // Every side is allowed, their product is not.
  assert_status(kOverCapacity, (c->size[0] = kMaxSideCells, c->size[1] = kMaxSideCells));
  assert_status(kOverCapacity, (c->size[0] = kMaxSideCells, c->size[1] = kMaxSideCells,
                                c->size[2] = kMaxDepthCells));
#ifdef __linux__
  static_assert(kVoxelCapacity >= 8U << 20U, "at least 8 Mi voxels on Linux");
#endif
  const std::int32_t side = leadline::test::widest_side_cells();
  const std::int32_t depth = leadline::test::deepest_cells(side, side);
  assert_int_equal(check_config(plain_config(side, side, depth)), Status::kOk);
  assert_int_equal(check_config(plain_config(side, side, depth + 1)), Status::kOverCapacity);
}

TEST(origin) {
  for (int axis = 0; axis < 3; ++axis) {
    const std::int64_t farthest_mm = axis == 2 ? 20'000'000 : 2'000'000'000;
    for (const std::int64_t sign : {-1, 1}) {
      ModelConfig config = plain_config(64, 64, 32);
      config.origin_mm[axis] = sign * farthest_mm;
      assert_int_equal(check_config(config), Status::kOk);
      config.origin_mm[axis] = sign * (farthest_mm + 1);
      assert_int_equal(check_config(config), Status::kOutOfRange);
    }
    ModelConfig config = plain_config(64, 64, 32);
    config.origin_mm[axis] = INT64_MIN;
    assert_int_equal(check_config(config), Status::kOutOfRange);
  }
}

TEST(sigmas) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const std::int64_t bad :
         {std::int64_t{-1}, std::int64_t{100'000'001}, INT64_MAX, INT64_MIN}) {
      ModelConfig config = plain_config(64, 64, 32);
      config.sigma_position_mm[axis] = bad;
      assert_int_equal(check_config(config), Status::kOutOfRange);
      config = plain_config(64, 64, 32);
      config.sigma_correlated_mm[axis] = bad;
      assert_int_equal(check_config(config), Status::kOutOfRange);
    }
    ModelConfig config = plain_config(64, 64, 32);
    config.sigma_position_mm[axis] = 100'000'000;
    config.sigma_correlated_mm[axis] = 100'000'000;
    assert_int_equal(check_config(config), Status::kOk);
  }
}

TEST(ranges) {
  assert_status(kOutOfRange, c->min_range_um = -1);
  assert_status(kOutOfRange, c->max_range_um = c->min_range_um);
  assert_status(kOutOfRange, c->max_range_um = -5);
  assert_status(kOk, c->min_range_um = 0);
  // The longest in cells, and the longest at all.
  assert_status(kOk, c->max_range_um = 8'000'000'000);
  assert_status(kOutOfRange, c->max_range_um = 8'000'000'001);
  assert_status(kOk, (c->cell_mm = 100'000, c->max_range_um = 20'000'000'000));
  assert_status(kOutOfRange, (c->cell_mm = 100'000, c->max_range_um = 20'000'000'001));
}

TEST(detect_range_matters_only_where_silence_is_evidence) {
  assert_status(kOk, c->detect_range_um = 0);
  assert_status(kOutOfRange, (c->no_return = NoReturnPolicy::kEmpty, c->detect_range_um = 0));
  assert_status(kOutOfRange, (c->no_return = NoReturnPolicy::kEmpty, c->detect_range_um = -1));
  assert_status(kOutOfRange,
                (c->no_return = NoReturnPolicy::kEmpty, c->detect_range_um = c->max_range_um + 1));
  assert_status(kOk, (c->no_return = NoReturnPolicy::kEmpty, c->detect_range_um = c->max_range_um));
}

}  // namespace
