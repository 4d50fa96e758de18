// Many pings in the model: what depth and uncertainty its columns read.
#include <algorithm>
#include <vector>

#include "model/base/fixed.hpp"
#include "model/model.hpp"
#include "tests/support/model_check.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using namespace leadline::test;   // NOLINT
using leadline::base::Pose;
using leadline::base::Status;

// Tens of megabytes each: static.
Model model;
Model other;

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

}  // namespace
