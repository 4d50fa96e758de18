// What a vehicle refuses to be, and what it does before it is anything.
#include <cstring>

#include "model/base/angle.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::Status;
using leadline::firmware::CycleInput;
using leadline::firmware::CycleOutput;
using leadline::firmware::Driver;
using leadline::firmware::InputChunk;
using leadline::firmware::kMaxCycleBytes;
using leadline::firmware::kNoMount;
using leadline::firmware::kNoTable;
using leadline::firmware::ping_loss_name;
using leadline::firmware::PingLoss;
using leadline::firmware::TableBlock;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::model::LocalizationTable;
using leadline::test::configure_rig;
using leadline::test::rig_config;
using leadline::test::rig_table;

Vehicle vehicle;

template <typename Change>
Status configured(Change change) {
  VehicleConfig config = rig_config();
  change(config);
  const TableBlock block{&rig_table(), sizeof(LocalizationTable)};
  return vehicle.configure(config, &block, 1);
}

TEST(an_unconfigured_vehicle_does_nothing) {
  assert_int_equal(configured([](VehicleConfig& c) { c.schema_version = 99; }),
                   Status::kBadVersion);
  CycleOutput output{};
  output.downlink.size_bytes = 7;
  const std::uint8_t bytes[] = {1, 2, 3};
  const InputChunk chunk{0, bytes, 3, 0};
  vehicle.cycle(CycleInput{0, &chunk, 1, 1000}, output);
  assert_int_equal(output.downlink.size_bytes, 0);
  assert_int_equal(vehicle.counters().cycles, 0);
}

TEST(codecs_share_their_room_and_more_than_there_is_is_refused) {
  const auto with = [](Driver driver, int count) {
    return configured([&](VehicleConfig& c) {
      c.port_count = 8;
      for (int i = 0; i < 8; ++i) {
        c.ports[i] = c.ports[i < 2 ? i : 1];
        if (i >= 2 && i < 2 + count) {
          c.ports[i] = c.ports[0];
          c.ports[i].driver = driver;
        }
      }
    });
  };
  assert_int_equal(with(Driver::kKongsberg, 4), Status::kOk);
  assert_int_equal(with(Driver::kKongsberg, 5), Status::kFull);
  assert_int_equal(with(Driver::kWl3d, 6), Status::kOk);
  assert_int_equal(with(Driver::kR2sonic, 6), Status::kOk);
}

TEST(values_out_of_range_are_refused) {
  const auto out_of_range = [](auto change) { return configured(change) == Status::kOutOfRange; };
  assert_true(out_of_range([](VehicleConfig& c) { c.port_count = 9; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.mount_count = 9; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.table_count = 0; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.table_count = 9; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.cycle_tile_budget = 0; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.extract_interval_us = 60'000'001; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.sound_speed_mm_s = 0; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.link.rate_bytes_s = 0; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.link.mtu_bytes = 63; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.link.mtu_bytes = 1401; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.link.status_interval_us = 0; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.link.hello_interval_us = 0; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.link.max_tile_age_us = 60'000'001; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.link.coarse_wait_us = 3'600'000'001; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.navigation.max_wait_us = -1; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.navigation.sigma_fix_mm = 0; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.ports[0].driver = static_cast<Driver>(200); }));
  assert_true(out_of_range([](VehicleConfig& c) { c.ports[0].latency_us = 20'000'000; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.ports[0].mount = 1; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.ports[0].mount = kNoMount; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.ports[1].mount = 1; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.ports[0].max_range_um = 0; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.ports[0].ping_interval_us = -1; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.mounts[0].lever_arm_mm[1] = 2'000'000; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.model.cell_mm = 0; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.water.tide_count = 65; }));
  assert_true(out_of_range([](VehicleConfig& c) { c.water.point_count = 33; }));
}

TEST(tables_must_be_there_whole_and_the_first) {
  assert_int_equal(configured([](VehicleConfig& c) { c.table_count = 2; }),
                   Status::kInvalidArgument);
  assert_int_equal(configured([](VehicleConfig& c) { c.mounts[0].table = 1; }),
                   Status::kInvalidArgument);
  const VehicleConfig config = rig_config();
  LocalizationTable wrong = rig_table();
  wrong.crc32c ^= 1U;
  TableBlock block{&wrong, sizeof(wrong)};
  assert_int_equal(vehicle.configure(config, &block, 1), Status::kBadChecksum);
  block = TableBlock{&rig_table(), sizeof(LocalizationTable) - 1};
  assert_int_equal(vehicle.configure(config, &block, 1), Status::kTruncated);
  // The second of two is looked at as well, though nothing uses it yet.
  VehicleConfig two = config;
  two.table_count = 2;
  const TableBlock blocks[2] = {{&rig_table(), sizeof(LocalizationTable)}, {&wrong, sizeof(wrong)}};
  assert_int_equal(vehicle.configure(two, blocks, 2), Status::kBadChecksum);
}

TEST(a_head_needs_a_table_and_a_sensor_does_not) {
  assert_int_equal(configured([](VehicleConfig& c) { c.mounts[0].table = kNoTable; }),
                   Status::kInvalidArgument);
  assert_int_equal(configured([](VehicleConfig& c) {
                     c.mount_count = 2;
                     c.mounts[1].table = kNoTable;
                     c.ports[1].mount = 1;
                   }),
                   Status::kOk);
}

// Antenna, compass and pressure sensor two metres ahead and half a metre above the reference point.
TEST(a_sensor_s_mount_moves_the_vehicle_behind_it) {
  leadline::test::RigOptions options;
  options.seconds = 8;
  configure_rig(vehicle, rig_config());
  static_cast<void>(leadline::test::fly(vehicle, options));
  const leadline::base::Pose at_sensor = vehicle.latest_pose();
  VehicleConfig config = rig_config();
  config.mount_count = 2;
  config.mounts[1].lever_arm_mm[0] = 2'000;
  config.mounts[1].lever_arm_mm[2] = -500;
  config.mounts[1].table = kNoTable;
  config.ports[1].mount = 1;
  configure_rig(vehicle, config);
  static_cast<void>(leadline::test::fly(vehicle, options));
  const leadline::base::Pose at_vehicle = vehicle.latest_pose();
  assert_true(at_sensor.validity == leadline::base::kPoseAll);
  const leadline::base::Rotation attitude = leadline::base::rotation_of(at_vehicle.attitude);
  const leadline::base::Vector3 body = leadline::base::rotated_back(
      attitude, {at_vehicle.position_um[0] - at_sensor.position_um[0],
                 at_vehicle.position_um[1] - at_sensor.position_um[1],
                 at_vehicle.position_um[2] - at_sensor.position_um[2]});
  assert_in_range(body[0] + 2'100'000, 0, 200'000);  // -2 m ahead, within 0.1 m
  assert_in_range(body[1] + 100'000, 0, 200'000);
  assert_in_range(body[2] - 400'000, 0, 200'000);  // 0.5 m below
}

TEST(configuring_again_forgets_everything) {
  configure_rig(vehicle, rig_config());
  const std::uint64_t empty_map = vehicle.map_hash();
  const std::uint64_t empty_link = vehicle.link_hash();
  const std::uint64_t empty_cells = vehicle.cells_hash();
  leadline::test::RigOptions options;
  options.seconds = 8;
  static_cast<void>(leadline::test::fly(vehicle, options));
  assert_true(vehicle.map_hash() != empty_map);
  configure_rig(vehicle, rig_config());
  assert_true(vehicle.map_hash() == empty_map);
  assert_true(vehicle.link_hash() == empty_link);
  assert_true(vehicle.cells_hash() == empty_cells);
  assert_int_equal(vehicle.counters().pings_in, 0);
  assert_int_equal(vehicle.latest_pose().validity, 0);
  assert_true(vehicle.drained());
}

TEST(bytes_beyond_the_limit_of_a_cycle_are_dropped_and_said) {
  configure_rig(vehicle, rig_config());
  static std::uint8_t bytes[40'000];
  std::memset(bytes, 'x', sizeof(bytes));
  const InputChunk chunks[3] = {{0, bytes, 40'000, 0}, {0, bytes, 40'000, 1}, {0, nullptr, 5, 1}};
  CycleOutput output{};
  vehicle.cycle(CycleInput{0, chunks, 3, 10'000}, output);
  assert_int_equal(vehicle.counters().bytes_over_limit, 80'005 - kMaxCycleBytes);
  assert_int_equal(vehicle.counters().chunks_ignored, 1);
  assert_int_equal(vehicle.counters().ports[0].bytes + vehicle.counters().ports[1].bytes,
                   kMaxCycleBytes);
  assert_true((vehicle.counters().alarms & leadline::proto::kAlarmInputDropped) != 0);
}

TEST(a_cycle_s_work_is_bounded_with_and_without_a_budget) {
  VehicleConfig config = rig_config();
  configure_rig(vehicle, config);
  const std::uint32_t ping = vehicle.model().bound().total_voxels;
  assert_true(ping > 0);
  assert_int_equal(vehicle.cycle_bound_voxels(),
                   leadline::firmware::PingQueue::kCapacity_count * ping);
  config.cycle_voxel_budget = 3 * ping + 1;
  configure_rig(vehicle, config);
  assert_int_equal(vehicle.cycle_bound_voxels(), 3 * ping + 1);
  // One ping goes through whatever the budget is.
  config.cycle_voxel_budget = 1;
  configure_rig(vehicle, config);
  assert_int_equal(vehicle.cycle_bound_voxels(), ping);
}

TEST(losses_have_names) {
  for (int i = 0; i < static_cast<int>(PingLoss::kCount); ++i) {
    assert_true(std::strcmp(ping_loss_name(static_cast<PingLoss>(i)), "unknown") != 0);
  }
  assert_string_equal(ping_loss_name(PingLoss::kCount), "unknown");
}

}  // namespace
