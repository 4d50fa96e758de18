// Writes the flights whose pings leadline-m7-cost measures (firmware/m7/cost_file.hpp): FOLDER/NAME.cost each.
//
//   cost_jobs FOLDER
//
//   job      the pings of bench.job's kind: 3 degrees, 20 cells, straight down, 128 x 128 x 32 cells of 1 m
//   ping1d   25 degrees wide, 25 m, 128 x 128 x 128 cells of 0.25 m
//   fan16    16 beams of 3 degrees over 60 degrees, up to 30 m, the same cells
//   wide     24 degrees wide, 80 m, 128 x 128 x 128 cells of 1 m
//
// All are seeded; each prints its map's hash, which the target has to come to as well.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "firmware/m7/cost_file.hpp"
#include "host_tools/sim/random.hpp"
#include "host_tools/table/generator.hpp"
#include "model/model.hpp"

namespace {

namespace base = leadline::base;
namespace cost = leadline::firmware::m7;
namespace host = leadline::host;
namespace model = leadline::model;

constexpr double kPi = 3.14159265358979323846;
constexpr int kPings = 400;

// As on a vehicle: one static object.
model::Model the_model;

struct Flight {
  std::string name;
  double cell_m;
  double half_angle_deg;
  double range_cells;
  double max_range_cells;
  std::int32_t depth_cells;
  double sigma_pointing_deg;
  double sigma_range_m;
  int beams;
};

base::Bam32 bam(double deg) {
  return static_cast<base::Bam32>(
      std::llround(std::fmod(deg + 720.0, 360.0) / 360.0 * 4294967296.0));
}

template <typename T>
void put(std::ofstream& out, const T& record) {
  out.write(reinterpret_cast<const char*>(&record), sizeof record);
}

std::vector<cost::CostPing> pings_of(const Flight& flight) {
  constexpr double kSpread_deg = 60;
  host::Random random(11);
  const double side = 128;
  const double bottom = flight.depth_cells - 8;
  std::vector<cost::CostPing> pings;
  for (int i = 0; i < kPings; ++i) {
    const int transmission = i / flight.beams;
    const double beam_deg =
        flight.beams > 1 ? -kSpread_deg / 2 + kSpread_deg * (i % flight.beams) / (flight.beams - 1)
                         : 0;
    // Along the middle of the grid, half a cell from ping to ping.
    const double north = 20 + std::fmod(0.5 * transmission, side - 40);
    const double east = side / 2;
    const double ground = bottom + 2 * std::sin(north / 15) * std::sin(east / 19);
    const double altitude =
        flight.range_cells * std::cos(kSpread_deg / 2 * kPi / 180 * (flight.beams > 1));
    const double range = std::min(altitude / std::cos(beam_deg * kPi / 180) +
                                      random.normal() * flight.sigma_range_m / flight.cell_m,
                                  flight.max_range_cells);
    cost::CostPing ping{};
    ping.kind = static_cast<std::uint32_t>(base::ReturnKind::kRange);
    ping.t_transmit_us = transmission * 50'000;
    ping.range_um = std::llround(range * flight.cell_m * 1e6);
    ping.elevation_bam32 = bam(90 - std::fabs(beam_deg));
    ping.azimuth_bam32 = bam(beam_deg < 0 ? 270 : 90);
    ping.pose.position_um[0] = std::llround(north * flight.cell_m * 1e6);
    ping.pose.position_um[1] = std::llround(east * flight.cell_m * 1e6);
    ping.pose.position_um[2] = std::llround((ground - altitude) * flight.cell_m * 1e6);
    const double roll_deg = random.normal();
    const double pitch_deg = random.normal();
    const double heading_deg = flight.beams > 1 ? random.normal() : random.uniform(0, 360);
    ping.pose.attitude = {bam(roll_deg), bam(pitch_deg), bam(heading_deg)};
    ping.pose.validity = base::kPoseAll;
    pings.push_back(ping);
  }
  return pings;
}

void write(const Flight& flight, const std::string& folder) {
  host::BeamDescription beam;
  beam.half_angle_deg = flight.half_angle_deg;
  beam.sigma_pointing_deg = flight.sigma_pointing_deg;
  beam.sigma_range_mm = flight.sigma_range_m * 1000;
  const host::GeneratedTable generated = host::generate_table(beam);
  model::ModelConfig config{};
  config.schema_version = model::kConfigSchemaVersion;
  config.rule = model::Rule::kLogOdds;
  config.cell_mm = static_cast<std::int32_t>(std::lround(flight.cell_m * 1000));
  config.size[0] = config.size[1] = 128;
  config.size[2] = flight.depth_cells;
  config.min_range_um = config.cell_mm * std::int64_t{500};
  config.max_range_um = std::llround(flight.max_range_cells * flight.cell_m * 1e6);
  if (the_model.configure(config, &generated.table, sizeof generated.table) != base::Status::kOk) {
    throw std::runtime_error(flight.name + ": the model refuses the configuration");
  }
  const std::vector<cost::CostPing> pings = pings_of(flight);
  const std::string path = folder + "/" + flight.name + ".cost";
  std::ofstream out(path, std::ios::binary);
  cost::CostHeader header{};
  header.magic = cost::kCostMagic;
  std::copy(std::begin(cost::kCostSizes), std::end(cost::kCostSizes), header.sizes);
  header.pings = static_cast<std::uint32_t>(pings.size());
  put(out, header);
  put(out, config);
  put(out, generated.table);
  for (const cost::CostPing& ping : pings) {
    (void)the_model.integrate(cost::ping_of(ping), ping.pose);
    put(out, ping);
  }
  if (!out.flush()) {
    throw std::runtime_error("cannot write " + path);
  }
  std::printf("%s map_hash %llu\n", flight.name.c_str(),
              static_cast<unsigned long long>(the_model.grid().map_hash()));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: cost_jobs FOLDER\n", stderr);
    return 2;
  }
  try {
    for (const Flight& flight : {Flight{"job", 1, 3, 20, 40, 32, 1, 1, 1},
                                 Flight{"ping1d", 0.25, 12.5, 100, 120, 128, 1, 0.05, 1},
                                 Flight{"fan16", 0.25, 1.5, 115, 120, 128, 0.5, 0.05, 16},
                                 Flight{"wide", 1, 12, 80, 100, 128, 1, 1, 1}}) {
      write(flight, argv[1]);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cost_jobs: error: %s\n", error.what());
    return 1;
  }
  return 0;
}
