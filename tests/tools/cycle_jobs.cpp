// Writes logs of flights whose whole cycles are measured on the Cortex-M7 (toolchain/timing.sh): FOLDER/NAME.lll.
//
//   cycle_jobs FOLDER
//
//   ping1d   a Ping1D at 20 Hz, 25 degrees wide
//   fan16    16 beams of 3 degrees over 60 degrees at 10 Hz
//   *-pass   the same, extracted in passes 1.5 s apart with a tile budget of 1
//
// Both over a bottom in 25 m, ranges to 30 m, 128 x 128 x 128 cells of 0.25 m, cycles of 50 ms; budgets as
// firmware/vehicle.example.toml has them. Everything by the heads' and sensors' own bytes.
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

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

constexpr double kSeconds = 60;
constexpr leadline::base::TimeUs kCycle_us = 50'000;

// As on a vehicle: one static object.
firmware::Vehicle vehicle;
std::vector<std::uint8_t> batch(1U << 20U);

struct Flight {
  std::string name;
  int fan_beams;
  double half_angle_deg;
  std::uint32_t tile_budget;
  std::uint32_t extract_interval_us;
};

firmware::VehicleConfig config_of(const Flight& flight) {
  firmware::VehicleConfig config = leadline::test::rig_config();
  config.model.cell_mm = 250;
  for (int axis = 0; axis < 3; ++axis) {
    config.model.size[axis] = 128;
  }
  config.model.origin_mm[0] = config.model.origin_mm[1] = -16'000;
  config.model.origin_mm[2] = 5'000;
  config.model.max_range_um = 30'000'000;
  firmware::PortConfig& sonar = config.ports[leadline::test::kRigSonar];
  sonar.driver = flight.fan_beams > 0 ? firmware::Driver::kDeltat83p : firmware::Driver::kPing1d;
  sonar.max_range_um = 30'000'000;
  sonar.ping_interval_us = 50'000;
  config.cycle_tile_budget = flight.tile_budget;
  config.extract_interval_us = flight.extract_interval_us;
  config.link.rate_bytes_s = 12'000;
  config.link.mtu_bytes = 1'200;
  return config;
}

void check(Status status, const char* what) {
  if (status != Status::kOk) {
    throw std::runtime_error(std::string(what) + ": " + leadline::base::status_text(status));
  }
}

void write(const Flight& flight, const std::string& folder) {
  host::BeamDescription beam;
  beam.half_angle_deg = flight.half_angle_deg;
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
  options.seconds = kSeconds;
  options.cycle_us = kCycle_us;
  options.deeper_m = 9;
  options.fan_beams = flight.fan_beams;
  (void)leadline::test::fly(
      vehicle, options, [&](const RecordedCycle& cycle, const firmware::CycleOutput& output) {
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
  std::printf("%s seconds %.0f pings %llu mapped %llu bytes %llu\n", flight.name.c_str(), kSeconds,
              static_cast<unsigned long long>(counters.pings_in),
              static_cast<unsigned long long>(counters.pings_mapped),
              static_cast<unsigned long long>(firmware::log_end_of(vehicle, 0).downlink_bytes));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: cycle_jobs FOLDER\n", stderr);
    return 2;
  }
  try {
    for (const Flight& flight : {Flight{"ping1d", 0, 12.5, 16, 0}, Flight{"fan16", 16, 1.5, 16, 0},
                                 Flight{"ping1d-pass", 0, 12.5, 1, 1'500'000},
                                 Flight{"fan16-pass", 16, 1.5, 1, 1'500'000}}) {
      write(flight, argv[1]);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cycle_jobs: error: %s\n", error.what());
    return 1;
  }
  return 0;
}
