// Writes logs of flights whose whole cycles are measured on the Cortex-M7 (toolchain/timing.sh): FOLDER/NAME.lll.
//
//   cycle_jobs FOLDER
//
//   ping1d       a Ping1D at 20 Hz, 25 degrees wide
//   fan16        16 beams of 3 degrees over 60 degrees at 10 Hz
//   *-pass       the same, extracted in passes 1.5 s apart with a tile budget of 1
//   *-whole      these for three minutes and a half, until the map is full, the bottom in 28 m and all water in the grid
//   ping1d-large ping1d-pass over 256 x 256 x 40 cells: 256 tiles
//   *-once       the latter, extracted in every cycle: what delays are reckoned from
//
// The others fly a minute over a bottom in 25 m. Ranges to 30 m, 128 x 128 x 128 cells of 0.25 m, cycles of 50 ms; budgets
// as firmware/vehicle.example.toml has them. Everything by the heads' and sensors' own bytes.
//
// Says of each when cells arrive: from their first depth on a vehicle that extracts in every cycle to a receiver of all
// frames. Pings and voxels are the same with and without passes, so the difference is what passes cost.
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "firmware/config/m7_load.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "host_tools/table/generator.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

namespace firmware = leadline::firmware;
namespace host = leadline::host;
namespace proto = leadline::proto;
using leadline::base::Status;
using leadline::test::RecordedCycle;

constexpr leadline::base::TimeUs kCycle_us = 50'000;

// As on a vehicle: one static object.
firmware::Vehicle vehicle;
std::vector<std::uint8_t> batch(1U << 20U);

enum class Place { kNear, kWhole, kLarge };

struct Flight {
  std::string name;
  int fan_beams;
  Place place;
  bool passes;

  [[nodiscard]] double seconds() const { return place == Place::kWhole ? 210 : 60; }
  [[nodiscard]] double half_angle_deg() const { return fan_beams > 0 ? 1.5 : 12.5; }
};

/// When a column had a depth first, by column; kNever: not within the flight.
using FirstTimes = std::vector<leadline::base::TimeUs>;
constexpr leadline::base::TimeUs kNever = INT64_MAX;

/// Of flights where every cycle extracts: by head and place.
std::map<std::pair<int, Place>, FirstTimes> seen_at_once;

firmware::VehicleConfig config_of(const Flight& flight) {
  firmware::VehicleConfig config = leadline::test::rig_config();
  const bool large = flight.place == Place::kLarge;
  config.model.cell_mm = 250;
  config.model.size[0] = config.model.size[1] = large ? 256 : 128;
  config.model.size[2] = large ? 40 : 128;
  config.model.origin_mm[0] = config.model.origin_mm[1] = -125 * config.model.size[0];
  config.model.origin_mm[2] = large ? 22'000 : (flight.place == Place::kWhole ? 2'000 : 5'000);
  config.model.max_range_um = 30'000'000;
  firmware::PortConfig& sonar = config.ports[leadline::test::kRigSonar];
  sonar.driver = flight.fan_beams > 0 ? firmware::Driver::kDeltat83p : firmware::Driver::kPing1d;
  sonar.max_range_um = 30'000'000;
  sonar.ping_interval_us = 50'000;
  config.cycle_tile_budget = flight.passes ? 1 : 16;
  config.extract_interval_us = flight.passes ? 1'500'000 : 0;
  config.link.rate_bytes_s = 12'000;
  config.link.mtu_bytes = 1'200;
  return config;
}

void check(Status status, const char* what) {
  if (status != Status::kOk) {
    throw std::runtime_error(std::string(what) + ": " + leadline::base::status_text(status));
  }
}

void note_depths(leadline::base::TimeUs t_us, FirstTimes& first) {
  const leadline::model::Grid& grid = vehicle.model().grid();
  for (std::int32_t n = 0; n < grid.north_cells(); ++n) {
    for (std::int32_t e = 0; e < grid.east_cells(); ++e) {
      leadline::base::TimeUs& at_us = first[grid.column_index(n, e)];
      if (at_us == kNever &&
          vehicle.model().result(n, e).depth_q8 != leadline::model::kUnknownDepth) {
        at_us = t_us;
      }
    }
  }
}

void note_arrivals(const leadline::test::RigReceiver& receiver, leadline::base::TimeUs t_us,
                   FirstTimes& first) {
  for (std::size_t column = 0; column < first.size(); ++column) {
    const auto* const cells = receiver.tile(static_cast<std::uint32_t>(column >> 8U));
    if (first[column] == kNever && cells != nullptr &&
        leadline::proto::cell_known((*cells)[column & 255U])) {
      first[column] = t_us;
    }
  }
}

/// From the depth that an extraction in every cycle would have made to the receiver's.
void tell_delays(const Flight& flight, const FirstTimes& arrived) {
  const FirstTimes& seen = seen_at_once.at({flight.fan_beams, flight.place});
  std::vector<double> delays_s;
  double sum_s = 0;
  for (std::size_t column = 0; column < seen.size(); ++column) {
    if (seen[column] != kNever && arrived[column] != kNever) {
      delays_s.push_back(static_cast<double>(arrived[column] - seen[column]) * 1e-6);
      sum_s += delays_s.back();
    }
  }
  std::sort(delays_s.begin(), delays_s.end());
  const auto share = [&delays_s](double part) {
    return delays_s[static_cast<std::size_t>(part * static_cast<double>(delays_s.size() - 1))];
  };
  std::printf("%s delay of %zu cells, s: mean %.2f median %.2f 95 %% %.2f most %.2f\n",
              flight.name.c_str(), delays_s.size(), sum_s / static_cast<double>(delays_s.size()),
              share(0.5), share(0.95), delays_s.back());
}

void write(const Flight& flight, const std::string& folder) {
  host::BeamDescription beam;
  beam.half_angle_deg = flight.half_angle_deg();
  beam.sigma_pointing_deg = flight.fan_beams > 0 ? 0.5 : 1.0;
  beam.sigma_range_mm = 50;
  const host::GeneratedTable generated = host::generate_table(beam);
  const firmware::TableBlock table{&generated.table, sizeof generated.table};
  const firmware::VehicleConfig config = config_of(flight);
  check(vehicle.configure(config, &table, 1), "the vehicle refuses the configuration");
  const std::string path = folder + "/" + flight.name + ".lll";
  std::ofstream out(path, std::ios::binary);
  const auto put = [&out](const proto::LogWriter& writer) {
    out.write(reinterpret_cast<const char*>(writer.data()),
              static_cast<std::streamsize>(writer.size_bytes()));
  };
  proto::LogWriter preamble(batch.data(), batch.size());
  check(firmware::log_begin(preamble, config, &table, 1, kCycle_us, 0), "the log's begin");
  for (int copy = 0; copy < firmware::kLogPreambleCopies; ++copy) {
    put(preamble);
  }
  std::uint32_t cycles = 0;
  leadline::test::RigOptions options;
  options.seconds = flight.seconds();
  options.cycle_us = kCycle_us;
  options.deeper_m = flight.place == Place::kWhole ? 11.5 : 9;
  options.fan_beams = flight.fan_beams;
  const std::size_t columns = vehicle.model().grid().column_count();
  FirstTimes seen(columns, kNever);
  FirstTimes arrived(columns, kNever);
  leadline::test::RigReceiver receiver(proto::survey_tag(config.survey_id, config.session));
  (void)leadline::test::fly(
      vehicle, options, [&](const RecordedCycle& cycle, const firmware::CycleOutput& output) {
        note_depths(cycle.t_us, seen);
        if (output.downlink.size_bytes > 0) {
          receiver.take(output.downlink.data, output.downlink.size_bytes);
          note_arrivals(receiver, cycle.t_us, arrived);
        }
        std::vector<firmware::InputChunk> chunks;
        for (const auto& chunk : cycle.chunks) {
          chunks.push_back({chunk.t_arrival_us, chunk.bytes.data(),
                            static_cast<std::uint16_t>(chunk.bytes.size()), chunk.port});
        }
        proto::LogWriter writer(batch.data(), batch.size());
        check(firmware::log_cycle(writer, cycles,
                                  {cycle.t_us, chunks.data(), chunks.size(), cycle.room_bytes},
                                  output),
              "a cycle's records");
        put(writer);
        ++cycles;
      });
  proto::LogWriter writer(batch.data(), batch.size());
  check(writer.end(
            firmware::log_end_of(vehicle, static_cast<leadline::base::TimeUs>(cycles) * kCycle_us)),
        "the log's end");
  put(writer);
  if (!out.flush()) {
    throw std::runtime_error("cannot write " + path);
  }
  const auto& counters = vehicle.counters();
  std::printf("%s seconds %.0f pings %llu mapped %llu bytes %llu\n", flight.name.c_str(),
              flight.seconds(), static_cast<unsigned long long>(counters.pings_in),
              static_cast<unsigned long long>(counters.pings_mapped),
              static_cast<unsigned long long>(firmware::log_end_of(vehicle, 0).downlink_bytes));
  if (!flight.passes) {
    seen_at_once[{flight.fan_beams, flight.place}] = seen;
  }
  tell_delays(flight, arrived);
  const host::M7Load load = host::m7_load(config, kCycle_us, {generated.table}, flight.fan_beams);
  std::printf("%s %s\n", flight.name.c_str(), host::m7_load_text(load).c_str());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: cycle_jobs FOLDER\n", stderr);
    return 2;
  }
  try {
    for (const Flight& flight :
         {Flight{"ping1d", 0, Place::kNear, false}, Flight{"fan16", 16, Place::kNear, false},
          Flight{"ping1d-pass", 0, Place::kNear, true},
          Flight{"fan16-pass", 16, Place::kNear, true},
          Flight{"ping1d-whole-once", 0, Place::kWhole, false},
          Flight{"ping1d-whole", 0, Place::kWhole, true},
          Flight{"fan16-whole-once", 16, Place::kWhole, false},
          Flight{"fan16-whole", 16, Place::kWhole, true},
          Flight{"ping1d-large-once", 0, Place::kLarge, false},
          Flight{"ping1d-large", 0, Place::kLarge, true}}) {
      write(flight, argv[1]);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cycle_jobs: error: %s\n", error.what());
    return 1;
  }
  return 0;
}
