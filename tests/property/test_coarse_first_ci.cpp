// Coarse first: where a map would have to wait long for the link, the topside sees a coarse one much sooner, and ends
// with the same. Simulated time, fixed seeds.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "host_tools/topside/link_trial.hpp"
#include "proto/coarse.hpp"
#include "proto/messages.hpp"
#include "tests/support/bad_tether.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::CycleOutput;
using leadline::firmware::InputChunk;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::host::LinkTrialOptions;
using leadline::host::LinkTrialResult;
using leadline::host::Receiver;
using leadline::host::run_link_trial;
using leadline::host::settle_vehicle;
using leadline::proto::MessageType;
using leadline::test::bad_line;
using leadline::test::Recording;

Vehicle vehicle;

/// The rig with a fan, which maps most of the grid within a minute.
VehicleConfig fan_config() {
  VehicleConfig config = leadline::test::rig_config();
  config.ports[leadline::test::kRigSonar].driver = leadline::firmware::Driver::kDeltat83p;
  config.cycle_tile_budget = 64;
  config.extract_interval_us = 1'500'000;
  return config;
}

/// Its flight, recorded once.
const Recording& flight() {
  static const Recording recording = [] {
    leadline::test::configure_rig(vehicle, fan_config());
    leadline::test::RigOptions options;
    options.seconds = 60;
    options.speed_m_s = 3.0;
    options.fan_beams = 24;
    return leadline::test::fly(vehicle, options);
  }();
  return recording;
}

/// A vehicle that flew, drained. Coarse cells go where tiles wait longer than `coarse_wait_us`.
TimeUs flown(double bytes_per_s, std::uint32_t coarse_wait_us, std::uint16_t mtu_bytes = 256) {
  const Recording& recording = flight();
  VehicleConfig config = fan_config();
  config.link.coarse_wait_us = coarse_wait_us;
  return leadline::test::fly_and_settle(&vehicle, config, recording, bytes_per_s, mtu_bytes);
}

/// Depth of a cell as the receiver would show it, cells; NaN: it shows none.
double shown(const Receiver& receiver, std::uint32_t tile, int cell) {
  const auto view = receiver.store()->tile(tile);
  if (view && leadline::proto::cell_known(view->cells[cell])) {
    return leadline::proto::cell_depth_q8(view->cells[cell]) / 256.0;
  }
  const auto* const coarse = receiver.coarse().tile(tile);
  if (coarse == nullptr) {
    return NAN;
  }
  const leadline::proto::CodedCell over =
      (*coarse)[static_cast<std::size_t>(cell / 64 * 4 + cell % 16 / 4)];
  return leadline::proto::cell_known(over) ? leadline::proto::cell_depth_q8(over) / 256.0 : NAN;
}

/// Mean over the vehicle's known cells of what the receiver shows wrong of them, as a share of the first error; a cell
/// that it does not show counts with the mean depth.
class Error {
 public:
  Error() {
    const std::uint32_t tiles = vehicle.model().grid().tile_count();
    double sum = 0.0;
    for (std::uint32_t tile = 0; tile < tiles; ++tile) {
      for (int cell = 0; cell < 256; ++cell) {
        const leadline::proto::CodedCell told = vehicle.link_cells(tile)[cell];
        if (leadline::proto::cell_known(told)) {
          cells_.push_back({tile, cell, leadline::proto::cell_depth_q8(told) / 256.0});
          sum += cells_.back().depth;
        }
      }
    }
    mean_ = sum / static_cast<double>(cells_.size());
    first_ = of([](std::uint32_t, int) { return NAN; });
  }
  [[nodiscard]] double share(const Receiver& receiver) const {
    return of([&](std::uint32_t tile, int cell) { return shown(receiver, tile, cell); }) / first_;
  }

 private:
  struct Cell {
    std::uint32_t tile;
    int cell;
    double depth;
  };
  template <typename Shown>
  [[nodiscard]] double of(const Shown& shows) const {
    double squares = 0.0;
    for (const Cell& cell : cells_) {
      const double depth = shows(cell.tile, cell.cell);
      squares += std::pow((std::isnan(depth) ? mean_ : depth) - cell.depth, 2);
    }
    return std::sqrt(squares / static_cast<double>(cells_.size()));
  }
  std::vector<Cell> cells_;
  double mean_ = 0.0;
  double first_ = 1.0;
};

struct Run {
  LinkTrialResult result;
  double early_error = 0.0;  ///< mean over the first `early_s` seconds
  double at_end_s = 0.0;
};

Run run(TimeUs* t_us, const LinkTrialOptions& options, double early_s) {
  const Error error;
  Run run;
  double since_s = 0.0;
  double share = 1.0;
  const auto until = [&](double now_s) {
    run.early_error += share * std::max(0.0, std::min(now_s, early_s) - since_s) / early_s;
    since_s = std::min(now_s, early_s);
  };
  run.result = run_link_trial(&vehicle, t_us, options, [&](TimeUs t, const Receiver& receiver) {
    until(1e-6 * static_cast<double>(t));
    share = receiver.store() != nullptr && since_s < early_s ? error.share(receiver) : share;
    // What is whole is not shown coarse.
    if (receiver.store() != nullptr && receiver.agreed()) {
      assert_int_equal(receiver.coarse().tiles(), 0);
    }
  });
  until(early_s);
  settle_vehicle(&vehicle, t_us, 20'000);
  return run;
}

TEST(early_on_the_error_is_much_smaller_with_coarse_cells) {
  std::printf("baud   seed  early error without with  seconds without with  bytes without with\n");
  for (const auto& [baud, wait_us] : {std::pair<double, std::uint32_t>{1200.0, 5'000'000},
                                      std::pair<double, std::uint32_t>{9600.0, 1'000'000}}) {
    const double bytes_per_s = baud / 10.0;
    // Half of what a line needs that loses nothing.
    const double early_s = 0.5 * 2900.0 / bytes_per_s;
    std::vector<Run> runs[2];
    for (const bool coarse : {false, true}) {
      TimeUs t_us = flown(bytes_per_s, coarse ? wait_us : 0);
      for (std::uint64_t seed = 1; seed <= 3; ++seed) {
        runs[coarse ? 1 : 0].push_back(run(&t_us, bad_line(bytes_per_s, seed), early_s));
        const LinkTrialResult& result = runs[coarse ? 1 : 0].back().result;
        assert_true(result.converged && result.hash_equal);
        assert_true((result.coarse_bytes > 0) == coarse);
      }
    }
    double sum[2] = {};
    double bytes[2] = {};
    for (std::size_t k = 0; k < runs[0].size(); ++k) {
      for (const std::size_t with : {0, 1}) {
        sum[with] += runs[with][k].early_error;
        bytes[with] += static_cast<double>(runs[with][k].result.bytes_down);
      }
      std::printf("%-6.0f %4zu %20.2f %4.2f %15.1f %5.1f %14llu %llu\n", baud, k + 1,
                  runs[0][k].early_error, runs[1][k].early_error, runs[0][k].result.seconds,
                  runs[1][k].result.seconds,
                  static_cast<unsigned long long>(runs[0][k].result.bytes_down),
                  static_cast<unsigned long long>(runs[1][k].result.bytes_down));
      // In every run, and by much on the whole.
      assert_true(runs[1][k].early_error < runs[0][k].early_error);
    }
    assert_true(sum[1] < 0.75 * sum[0]);
    // Luck of the line moves the bytes of a run by more than what coarse cells take.
    assert_true(bytes[1] < 1.3 * bytes[0]);
  }
}

TEST(a_line_that_is_fast_enough_carries_no_coarse_cells) {
  // 30 tiles of about 96 bytes: 3 s.
  TimeUs t_us = flown(960.0, 5'000'000);
  const Run fast = run(&t_us, bad_line(960.0, 1), 1.0);
  assert_true(fast.result.converged && fast.result.coarse_bytes == 0);
  assert_int_equal(vehicle.counters().coarse_deltas, 0);  // nor did the flight
}

/// Of a frame of cells.
std::uint16_t number_of(const leadline::proto::FrameView& frame) {
  const bool coarse = frame.payload[0] == static_cast<std::uint8_t>(MessageType::kCoarseDelta);
  leadline::proto::TilePacketDecoder packet;
  assert_int_equal(
      packet.open(frame.payload, frame.payload_bytes,
                  coarse ? leadline::proto::TileScale::kCoarse : leadline::proto::TileScale::kFine),
      leadline::base::Status::kOk);
  leadline::proto::TileDelta delta;
  assert_true(packet.next(delta));
  return static_cast<std::uint16_t>(delta.generation);
}

/// Cycles from the freeze on, in which frames of the kinds that `reports` tells come and are reported, until
/// no tile waits. Returns the coarse packets.
std::vector<std::vector<std::uint8_t>> listen(TimeUs t_us, bool (*reports)(std::uint8_t type)) {
  vehicle.restart_link();
  const std::uint16_t tag =
      leadline::proto::survey_tag(vehicle.config().survey_id, vehicle.config().session);
  leadline::proto::FrameDecoderBuffer<> decoder;
  std::vector<std::vector<std::uint8_t>> coarse;
  std::vector<std::uint8_t> uplink;
  for (int cycle = 0; cycle < 20'000; ++cycle) {
    t_us += 20'000;
    const InputChunk chunk{t_us, uplink.data(), static_cast<std::uint16_t>(uplink.size()),
                           leadline::firmware::kUplinkPort};
    CycleOutput output{};
    vehicle.cycle({t_us, &chunk, uplink.empty() ? 0U : 1U, 100'000}, output);
    uplink.clear();
    for (std::size_t i = 0; i < output.downlink.size_bytes; ++i) {
      leadline::proto::FrameView frame{};
      if (!decoder.decoder().feed(output.downlink.data[i], frame)) {
        continue;
      }
      if (frame.payload[0] == static_cast<std::uint8_t>(MessageType::kCoarseDelta)) {
        coarse.emplace_back(frame.payload, frame.payload + frame.payload_bytes);
      }
      const bool cells = frame.payload[0] == static_cast<std::uint8_t>(MessageType::kCoarseDelta) ||
                         frame.payload[0] == static_cast<std::uint8_t>(MessageType::kTileDelta);
      if (cells && reports(frame.payload[0])) {
        leadline::proto::Report report{};
        report.survey_tag = tag;
        report.newest = number_of(frame);
        report.mask_bytes = 1;
        report.mask[0] = 1;
        std::uint8_t payload[64];
        const auto size = leadline::proto::encode_report(report, payload, sizeof payload);
        std::uint8_t framed[96];
        const auto bytes =
            leadline::proto::encode_frame(payload, size.value(), framed, sizeof framed);
        uplink.insert(uplink.end(), framed, framed + bytes.value());
      }
    }
    if (vehicle.drained()) {
      return coarse;
    }
  }
  fail_msg("the vehicle never came to an end");
  return coarse;
}

/// How often each coarse cell was said.
std::vector<int> times_said(const std::vector<std::vector<std::uint8_t>>& packets) {
  std::vector<int> times(std::size_t{16} * 256, 0);
  for (const auto& payload : packets) {
    leadline::proto::TilePacketDecoder packet;
    assert_int_equal(
        packet.open(payload.data(), payload.size(), leadline::proto::TileScale::kCoarse),
        leadline::base::Status::kOk);
    leadline::proto::TileDelta coarse;
    while (packet.next(coarse)) {
      for (int cell = 0; cell < 256; ++cell) {
        times.at(coarse.tile * std::size_t{256} + static_cast<std::size_t>(cell)) +=
            coarse.changed.test(cell) ? 1 : 0;
      }
    }
    assert_int_equal(packet.status(), leadline::base::Status::kOk);
  }
  return times;
}

TEST(coarse_cells_go_once_to_who_says_nothing_and_seldom_to_who_does_not_understand_them) {
  const TimeUs t_us = flown(120.0, 5'000'000);
  const auto nobody = [](std::uint8_t) { return false; };
  const std::vector<int> once = times_said(listen(t_us, nobody));
  assert_int_equal(*std::max_element(once.begin(), once.end()), 1);
  const auto all_but_coarse = [](std::uint8_t type) {
    return type != static_cast<std::uint8_t>(MessageType::kCoarseDelta);
  };
  const std::vector<int> deaf = times_said(listen(t_us + 1'000'000'000, all_but_coarse));
  const int most = *std::max_element(deaf.begin(), deaf.end());
  assert_in_range(most, 2, 3);
  const auto all = [](std::uint8_t) { return true; };
  const std::vector<int> heard = times_said(listen(t_us + 2'000'000'000, all));
  assert_int_equal(*std::max_element(heard.begin(), heard.end()), 1);
  // What was said is the mean of the cells below.
  const auto& grid = vehicle.model().grid();
  for (std::uint32_t tile = 0; tile < grid.tile_count(); ++tile) {
    const auto place = leadline::proto::coarse_place(tile, grid.east_cells());
    for (int index = 0; index < 16; ++index) {
      bool known = false;
      for (int k = 0; k < 16; ++k) {
        known = known || leadline::proto::cell_known(vehicle.link_cells(
                             tile)[(index / 4 * 4 + k / 4) * 16 + index % 4 * 4 + k % 4]);
      }
      const int said =
          once[place.tile * std::size_t{256} + static_cast<std::size_t>(place.cell(index))];
      assert_true(known || said == 0);
    }
  }
}

TEST(the_shortest_frames_carry_coarse_cells_as_well) {
  for (const std::uint16_t mtu_bytes : {std::uint16_t{128}, std::uint16_t{1400}}) {
    TimeUs t_us = flown(120.0, 5'000'000, mtu_bytes);
    const Run run_there = run(&t_us, bad_line(120.0, 2), 10.0);
    assert_true(run_there.result.converged && run_there.result.coarse_bytes > 0);
    assert_true(run_there.early_error < 0.9);
  }
}

}  // namespace
