// The whole vehicle in a process: the same bytes give the same map and the same frames, the link's budget holds,
// and what a receiver has is what the vehicle believes it has.
#include <cmath>
#include <deque>
#include <memory>

#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::CycleOutput;
using leadline::firmware::PingLoss;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::firmware::VehicleCounters;
using leadline::model::TileId;
using leadline::proto::survey_tag;
using leadline::test::configure_rig;
using leadline::test::drain;
using leadline::test::fly;
using leadline::test::kRigNavigation;
using leadline::test::kRigSonar;
using leadline::test::Random;
using leadline::test::RecordedChunk;
using leadline::test::RecordedCycle;
using leadline::test::Recording;
using leadline::test::rig_bottom_m;
using leadline::test::rig_config;
using leadline::test::RigOptions;
using leadline::test::RigReceiver;
using leadline::test::run_cycle;
using leadline::test::run_recording;

Vehicle vehicle;
Vehicle other;

std::uint64_t lost(const Vehicle& of) {
  std::uint64_t sum = 0;
  for (const std::uint64_t count : of.counters().pings_lost) {
    sum += count;
  }
  return sum;
}

// Nothing gets lost without a counter.
void assert_accounts(const Vehicle& of) {
  const VehicleCounters& counters = of.counters();
  assert_int_equal(counters.pings_in, counters.pings_pending + lost(of) + counters.pings_mapped);
  std::uint64_t model_pings = 0;
  for (const std::uint64_t count : of.model().counters().pings) {
    model_pings += count;
  }
  assert_int_equal(counters.pings_mapped, model_pings);
}

RigReceiver receiver_of(const VehicleConfig& config) {
  return RigReceiver(survey_tag(config.survey_id, config.session));
}

// Returns how many tiles were extracted.
std::uint64_t assert_receiver_has_the_map(const VehicleConfig& config) {
  configure_rig(vehicle, config);
  RigReceiver receiver(survey_tag(config.survey_id, config.session));
  const auto sink = [&](const RecordedCycle&, const CycleOutput& output) {
    receiver.take(output.downlink.data, output.downlink.size_bytes);
  };
  const Recording recording = fly(vehicle, RigOptions{}, sink);
  assert_true(vehicle.counters().pings_mapped > 300);
  assert_true(lost(vehicle) < 20);
  TimeUs t_us = recording.back().t_us;
  assert_true(drain(vehicle, t_us, 2000, sink));
  assert_accounts(vehicle);

  const std::uint32_t tiles = vehicle.model().grid().tile_count();
  assert_int_equal(receiver.bad, 0);
  assert_true(receiver.hash(tiles) == vehicle.cells_hash());
  assert_true(receiver.hellos >= 4 && receiver.statuses >= 40 && receiver.deltas > 10);
  assert_true(receiver.longest_frame <= config.link.mtu_bytes);

  // And it is the map of the model as a whole extraction sees it, of the bottom that is there.
  vehicle.model().extract();
  int cells = 0;
  double squares = 0;
  for (std::int32_t n = 0; n < config.model.size[0]; ++n) {
    for (std::int32_t e = 0; e < config.model.size[1]; ++e) {
      const auto& result = vehicle.model().result(n, e);
      const auto id = static_cast<TileId>(n / 16 * vehicle.model().grid().tiles_east() + e / 16);
      const auto* const tile = receiver.tile(id);
      const auto cell = tile == nullptr ? leadline::proto::kUnknownCell
                                        : (*tile)[static_cast<std::size_t>(n % 16 * 16 + e % 16)];
      const std::int32_t coded = leadline::proto::cell_depth_q8(cell);
      assert_true((coded == leadline::model::kUnknownDepth) ==
                  (result.depth_q8 == leadline::model::kUnknownDepth));
      if (coded == leadline::model::kUnknownDepth) {
        continue;
      }
      const double sigma = std::max(result.sigma_q12 / 16.0, 1.0);
      assert_near(coded, result.depth_q8, 1.0 * sigma + 1.0);
      const double truth = rig_bottom_m(0.5 * (n + 0.5) - 24.0, 0.5 * (e + 0.5) - 24.0);
      const double error = 5.0 + 0.5 * result.depth_q8 / 256.0 - truth;
      squares += error * error;
      ++cells;
    }
  }
  assert_true(cells > 500);
  assert_true(std::sqrt(squares / cells) < 0.35);
  return vehicle.counters().tiles_extracted;
}

TEST(the_chain_maps_the_bottom_and_the_receiver_has_the_map) {
  VehicleConfig config = rig_config();
  const std::uint64_t each_cycle = assert_receiver_has_the_map(config);
  // The same in passes, also where one takes several cycles.
  config.extract_interval_us = 1'500'000;
  config.cycle_tile_budget = 1;
  const std::uint64_t in_passes = assert_receiver_has_the_map(config);
  assert_true(in_passes > 0 && in_passes * 4 < each_cycle);
}

TEST(passes_replay_to_the_same_frames) {
  VehicleConfig config = rig_config();
  config.extract_interval_us = 700'000;
  config.cycle_tile_budget = 1;
  configure_rig(vehicle, config);
  const Recording recording = fly(vehicle, RigOptions{});
  // Whatever the other has seen before.
  configure_rig(other, config);
  run_recording(other, recording);
  configure_rig(other, config);
  run_recording(other, recording);
  assert_true(vehicle.counters().tiles_extracted > 0);
  assert_true(vehicle.map_hash() == other.map_hash());
  assert_true(vehicle.link_hash() == other.link_hash());
}

TEST(the_same_bytes_give_the_same_map_and_the_same_frames) {
  configure_rig(vehicle, rig_config());
  const Recording recording = fly(vehicle, RigOptions{});
  configure_rig(other, rig_config());
  run_recording(other, recording);
  assert_true(vehicle.map_hash() == other.map_hash());
  assert_true(vehicle.link_hash() == other.link_hash());
  assert_true(vehicle.cells_hash() == other.cells_hash());
  // And one byte less does not.
  Recording damaged = recording;
  bool changed = false;
  for (RecordedCycle& cycle : damaged) {
    for (RecordedChunk& chunk : cycle.chunks) {
      if (cycle.t_us > 20'000'000 && chunk.port == kRigSonar) {
        chunk.bytes.pop_back();
        changed = true;
        break;
      }
    }
    if (changed) {
      break;
    }
  }
  configure_rig(other, rig_config());
  run_recording(other, damaged);
  assert_true(vehicle.map_hash() != other.map_hash());
}

TEST(where_chunks_are_cut_does_not_matter) {
  RigOptions options;
  options.seconds = 20;
  configure_rig(vehicle, rig_config());
  const Recording recording = fly(vehicle, options);
  Random random(5);
  Recording cut = recording;
  for (RecordedCycle& cycle : cut) {
    std::vector<RecordedChunk> pieces;
    for (const RecordedChunk& chunk : cycle.chunks) {
      std::size_t start = 0;
      while (start < chunk.bytes.size()) {
        const auto size = static_cast<std::size_t>(
            random.between(1, static_cast<std::int64_t>(chunk.bytes.size() - start)));
        const auto first = chunk.bytes.begin() + static_cast<std::ptrdiff_t>(start);
        pieces.push_back(RecordedChunk{
            chunk.port, chunk.t_arrival_us, {first, first + static_cast<std::ptrdiff_t>(size)}});
        start += size;
      }
    }
    cycle.chunks = pieces;
  }
  configure_rig(other, rig_config());
  run_recording(other, cut);
  assert_true(vehicle.map_hash() == other.map_hash());
  assert_true(vehicle.link_hash() == other.link_hash());
}

TEST(the_byte_budget_holds_in_every_span_of_time) {
  for (const std::uint32_t rate : {200U, 300U, 1'000U, 6'000U}) {
    VehicleConfig config = rig_config();
    config.link.rate_bytes_s = rate;
    config.link.mtu_bytes = 200;
    config.link.max_tile_age_us = 0;  // as much to say as can be
    configure_rig(vehicle, config);
    const double burst = std::max(200.0, rate / 8.0) + rate / 16.0;
    std::deque<std::pair<TimeUs, std::size_t>> sent;
    std::size_t total = 0;
    RigOptions options;
    options.seconds = 30;
    fly(vehicle, options, [&](const RecordedCycle& cycle, const CycleOutput& output) {
      assert_true(output.downlink.size_bytes <= cycle.room_bytes);
      sent.emplace_back(cycle.t_us, output.downlink.size_bytes);
      total += output.downlink.size_bytes;
      // Every span that ends here.
      double bytes = 0;
      for (auto it = sent.rbegin(); it != sent.rend(); ++it) {
        bytes += static_cast<double>(it->second);
        const double span_s = static_cast<double>(cycle.t_us - it->first) * 1e-6;
        if (bytes > burst + rate * span_s + 1e-6) {
          fail_msg("%g bytes in %g s at %u bytes/s", bytes, span_s, rate);
        }
      }
    });
    // What is allowed is also used while there is something to say: at the lowest rate, always.
    assert_true(rate != 200U || static_cast<double>(total) > 0.9 * rate * 30.0);
  }
}

TEST(without_room_nothing_is_sent_and_tiles_stay_dirty) {
  const VehicleConfig config = rig_config();
  configure_rig(vehicle, config);
  RigReceiver receiver(survey_tag(config.survey_id, config.session));
  std::size_t bytes = 0;
  RigOptions options;
  options.seconds = 40;
  options.room_bytes = 0;
  const Recording recording =
      fly(vehicle, options, [&](const RecordedCycle&, const CycleOutput& output) {
        bytes += output.downlink.size_bytes;
      });
  assert_int_equal(bytes, 0);
  assert_true(vehicle.counters().tiles_unsent > 5);
  assert_int_equal(vehicle.counters().cells_sent, 0);
  TimeUs t_us = recording.back().t_us;
  assert_true(drain(vehicle, t_us, 3000, [&](const RecordedCycle&, const CycleOutput& output) {
    receiver.take(output.downlink.data, output.downlink.size_bytes);
  }));
  assert_true(receiver.hash(vehicle.model().grid().tile_count()) == vehicle.cells_hash());
  assert_int_equal(receiver.bad, 0);
  assert_true(vehicle.counters().cells_sent > 200);
}

TEST(what_the_link_loses_comes_again_on_request) {
  const VehicleConfig config = rig_config();
  const std::uint16_t tag = survey_tag(config.survey_id, config.session);
  configure_rig(vehicle, config);
  RigReceiver receiver(tag);
  Random random(6);
  RigOptions options;
  options.seconds = 20;
  const Recording recording =
      fly(vehicle, options, [&](const RecordedCycle&, const CycleOutput& output) {
        if (random.between(0, 2) != 0) {  // every third cycle's frames get lost
          receiver.take(output.downlink.data, output.downlink.size_bytes);
        }
      });
  TimeUs t_us = recording.back().t_us;
  assert_true(drain(vehicle, t_us, 2000));
  const std::uint32_t tiles = vehicle.model().grid().tile_count();
  assert_true(receiver.hash(tiles) != vehicle.cells_hash());

  // Requests of another survey, of no tile, and one cut short: nothing is dirty after them.
  const auto ask = [&](std::uint16_t with_tag, std::uint32_t first, std::uint32_t count,
                       std::size_t cut) {
    leadline::proto::ResendRequest request{};
    request.survey_tag = with_tag;
    request.range_count = 1;
    request.ranges[0] = {first, count};
    std::uint8_t payload[leadline::proto::kMaxResendRequest_bytes];
    const auto size = leadline::proto::encode_resend_request(request, payload, sizeof(payload));
    assert_true(size.ok());
    std::vector<std::uint8_t> bytes(leadline::proto::frame_bound_bytes(size.value()));
    const auto framed =
        leadline::proto::encode_frame(payload, size.value() - cut, bytes.data(), bytes.size());
    assert_true(framed.ok());
    bytes.resize(framed.value());
    t_us += 20'000;
    const RecordedCycle cycle{
        t_us, 100'000, {RecordedChunk{leadline::firmware::kUplinkPort, t_us, bytes}}};
    const CycleOutput output = run_cycle(vehicle, cycle);
    receiver.take(output.downlink.data, output.downlink.size_bytes);
  };
  ask(static_cast<std::uint16_t>(tag + 1), 0, tiles, 0);
  ask(tag, tiles, 5, 0);
  ask(tag, 0, tiles, 1);
  assert_true(vehicle.drained());
  assert_int_equal(vehicle.counters().uplink_rejected, 2);
  assert_int_equal(vehicle.counters().resend_requests, 1);

  ask(tag, 0, tiles + 100, 0);
  assert_true(drain(vehicle, t_us, 3000, [&](const RecordedCycle&, const CycleOutput& output) {
    receiver.take(output.downlink.data, output.downlink.size_bytes);
  }));
  assert_true(receiver.hash(tiles) == vehicle.cells_hash());
}

TEST(garbage_on_every_port_costs_frames_and_nothing_else) {
  configure_rig(vehicle, rig_config());
  Random random(7);
  RigOptions options;
  options.seconds = 25;
  options.tamper = [&](RecordedCycle& cycle) {
    for (const std::uint8_t port : {kRigSonar, kRigNavigation, leadline::firmware::kUplinkPort,
                                    static_cast<std::uint8_t>(9)}) {
      if (random.between(0, 9) == 0) {
        RecordedChunk noise{port, cycle.t_us, {}};
        for (std::int64_t i = random.between(0, 60); i >= 0; --i) {
          noise.bytes.push_back(static_cast<std::uint8_t>(random.next()));
        }
        cycle.chunks.push_back(noise);
      }
    }
    for (RecordedChunk& chunk : cycle.chunks) {
      if (random.between(0, 30) == 0) {
        chunk.bytes[static_cast<std::size_t>(
            random.between(0, static_cast<std::int64_t>(chunk.bytes.size()) - 1))] ^= 0x20U;
      }
    }
  };
  const Recording recording = fly(vehicle, options);
  assert_accounts(vehicle);
  assert_true(vehicle.counters().pings_mapped > 100);
  assert_true(vehicle.counters().ports[kRigNavigation].rejected > 0);
  assert_true(vehicle.counters().ports[kRigSonar].rejected > 0);
  assert_true(vehicle.counters().uplink_rejected > 0);
  assert_true(vehicle.counters().chunks_ignored > 0);
  configure_rig(other, rig_config());
  run_recording(other, recording);
  assert_true(vehicle.map_hash() == other.map_hash());
  assert_true(vehicle.link_hash() == other.link_hash());
}

TEST(bytes_that_came_before_the_first_cycle_are_no_step_of_the_clock) {
  configure_rig(vehicle, rig_config());
  RigOptions options;
  options.seconds = 5;
  bool first = true;
  options.tamper = [&](RecordedCycle& cycle) {
    if (first) {
      cycle.chunks.insert(cycle.chunks.begin(), {kRigNavigation, cycle.t_us - 15'000, {'$'}});
    }
    first = false;
  };
  fly(vehicle, options);
  assert_false(first);
  assert_int_equal(vehicle.counters().chunk_time_clamped, 0);
  assert_int_equal(vehicle.counters().cycle_time_clamped, 0);
}

TEST(time_that_goes_back_is_clamped_and_counted) {
  configure_rig(vehicle, rig_config());
  RigOptions options;
  options.seconds = 20;
  options.tamper = [](RecordedCycle& cycle) {
    if (cycle.t_us == 10'000'000) {
      cycle.t_us -= 3'000'000;
      for (RecordedChunk& chunk : cycle.chunks) {
        chunk.t_arrival_us -= 3'000'000;
      }
    }
  };
  RigReceiver receiver = receiver_of(rig_config());
  fly(vehicle, options, [&](const RecordedCycle&, const CycleOutput& output) {
    receiver.take(output.downlink.data, output.downlink.size_bytes);
  });
  assert_int_equal(vehicle.counters().cycle_time_clamped, 1);
  assert_true(vehicle.counters().chunk_time_clamped > 0);
  assert_true((receiver.alarms_seen & leadline::proto::kAlarmTimeStepped) != 0);
  assert_int_equal(receiver.last_alarms & leadline::proto::kAlarmTimeStepped, 0);
  assert_true(vehicle.counters().pings_mapped > 150);
  assert_accounts(vehicle);
}

TEST(pings_without_a_pose_wait_and_are_lost_with_an_alarm) {
  configure_rig(vehicle, rig_config());
  RigOptions options;
  options.seconds = 20;
  options.attitude_until_s = 10.0;
  RigReceiver receiver = receiver_of(rig_config());
  const Recording recording =
      fly(vehicle, options, [&](const RecordedCycle&, const CycleOutput& output) {
        receiver.take(output.downlink.data, output.downlink.size_bytes);
      });
  const VehicleCounters& counters = vehicle.counters();
  // 10 Hz for ten seconds, less the half second that those at the end wait.
  const std::uint64_t poseless = counters.pings_lost[static_cast<int>(PingLoss::kNoPose)] +
                                 counters.pings_lost[static_cast<int>(PingLoss::kPoseGap)];
  const std::uint64_t invalid =
      vehicle.model().counters().pings[static_cast<int>(leadline::model::PingResult::kPoseInvalid)];
  assert_true(poseless + invalid > 60);
  assert_true((receiver.last_alarms & leadline::proto::kAlarmNoPose) != 0);
  assert_true(receiver.texts > 0);
  TimeUs t_us = recording.back().t_us;
  assert_true(drain(vehicle, t_us, 3000));
  assert_accounts(vehicle);
}

TEST(a_gap_in_the_fixes_widens_and_then_pauses_the_map) {
  VehicleConfig config = rig_config();
  config.navigation.acceleration_mm_s2 = 300;
  configure_rig(vehicle, config);
  RigOptions options;
  options.seconds = 60;
  options.fix_until_s = 15.0;
  RigReceiver receiver = receiver_of(config);
  fly(vehicle, options, [&](const RecordedCycle&, const CycleOutput& output) {
    receiver.take(output.downlink.data, output.downlink.size_bytes);
  });
  // Mapped on for a while, on ever wider footprints; then not at all, and said so.
  assert_true(vehicle.counters().pings_mapped > 200);
  assert_true(vehicle.counters().pings_lost[static_cast<int>(PingLoss::kPaused)] > 50);
  assert_true((receiver.last_alarms & leadline::proto::kAlarmMappingPaused) != 0);
  assert_true(vehicle.latest_pose().covariance.sigma_position_mm[0] > 5'000);
  assert_accounts(vehicle);
}

TEST(a_jump_of_navigation_begins_an_epoch_and_is_said) {
  configure_rig(vehicle, rig_config());
  RigOptions options;
  options.seconds = 20;
  options.jump_at_s = 10.0;
  RigReceiver receiver = receiver_of(rig_config());
  fly(vehicle, options, [&](const RecordedCycle&, const CycleOutput& output) {
    receiver.take(output.downlink.data, output.downlink.size_bytes);
  });
  assert_true(vehicle.latest_pose().epoch >= 1);
  assert_true((receiver.alarms_seen & leadline::proto::kAlarmPoseEpoch) != 0);
  assert_true(vehicle.latest_pose().position_um[0] > 30'000'000);
  assert_accounts(vehicle);
}

TEST(a_flood_sheds_the_oldest_pings_and_counts_them) {
  VehicleConfig config = rig_config();
  config.cycle_voxel_budget = 1;  // one ping a cycle
  config.ports[kRigSonar].ping_interval_us = 20'000;
  configure_rig(vehicle, config);
  RigOptions options;
  options.seconds = 30;
  options.cycle_us = 100'000;
  options.tamper = [](RecordedCycle& cycle) {
    // Every answer many times over, each with another number: pings that no head makes so fast.
    static std::uint32_t number = 1'000'000;
    std::vector<RecordedChunk> flood;
    for (const RecordedChunk& chunk : cycle.chunks) {
      if (chunk.port != kRigSonar || chunk.bytes.size() != 34 || chunk.bytes[4] != 0xBC ||
          chunk.bytes[5] != 0x04) {
        continue;
      }
      for (int i = 0; i < 400; ++i) {
        RecordedChunk copy = chunk;
        std::uint32_t sum = 0;
        ++number;
        for (std::size_t b = 0; b < 4; ++b) {
          copy.bytes[8 + 8 + b] = static_cast<std::uint8_t>(number >> (8 * b));
        }
        for (std::size_t b = 0; b < 32; ++b) {
          sum += copy.bytes[b];
        }
        copy.bytes[32] = static_cast<std::uint8_t>(sum);
        copy.bytes[33] = static_cast<std::uint8_t>(sum >> 8U);
        flood.push_back(copy);
      }
    }
    cycle.chunks.insert(cycle.chunks.end(), flood.begin(), flood.end());
  };
  RigReceiver receiver = receiver_of(config);
  fly(vehicle, options, [&](const RecordedCycle&, const CycleOutput& output) {
    receiver.take(output.downlink.data, output.downlink.size_bytes);
  });
  assert_accounts(vehicle);
  assert_true(vehicle.counters().pings_lost[static_cast<int>(PingLoss::kShed)] > 100);
  assert_true((receiver.alarms_seen & leadline::proto::kAlarmShed) != 0);
  // Sheds, but goes on: about one ping a cycle.
  assert_true(vehicle.counters().pings_mapped > 100);
}

TEST(profiles_become_ranges_on_the_vehicle) {
  VehicleConfig config = rig_config();
  config.ports[kRigSonar].profile = 1;
  configure_rig(vehicle, config);
  RigOptions options;
  options.roll_deg = 1.0;
  options.echo_until_s = 35.0;
  const Recording recording = fly(vehicle, options);
  assert_true(vehicle.counters().profiles_detected > 250);
  // Five seconds of noise, the last ping or two pending.
  assert_in_range(vehicle.counters().profiles_undetected, 45, 51);
  const auto silent = static_cast<int>(leadline::model::PingResult::kNoReturn);
  // One may still wait for its pose.
  const std::uint64_t empty = vehicle.model().counters().pings[silent];
  assert_in_range(vehicle.counters().profiles_undetected - empty, 0, 1);
  vehicle.model().extract();
  int cells = 0;
  double sum = 0;
  for (std::int32_t n = 0; n < config.model.size[0]; ++n) {
    for (std::int32_t e = 0; e < config.model.size[1]; ++e) {
      const auto& result = vehicle.model().result(n, e);
      if (result.depth_q8 != leadline::model::kUnknownDepth) {
        sum += 5.0 + 0.5 * result.depth_q8 / 256.0 -
               rig_bottom_m(0.5 * (n + 0.5) - 24.0, 0.5 * (e + 0.5) - 24.0);
        ++cells;
      }
    }
  }
  assert_true(cells > 500);
  // Bins of 0.2 m (40 m in 200 samples), three of them lit from the one of the bottom on.
  assert_near(sum / cells, 0.0, 0.2);
  assert_accounts(vehicle);
}

}  // namespace
