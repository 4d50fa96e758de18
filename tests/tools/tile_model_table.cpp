// Makes the table that the tile model starts from (proto/tile_model_table.inc, proto/SPEC.md "Tile model"):
// for each bit model, how often its bit was 1 over simulated surveys and a terrain.
//
//   LEADLINE_DATA=... tile_model_table > proto/tile_model_table.inc
//
// None of its surveys is one that tests/bench/link.cpp reports. The table is frozen: a new one would be a new
// message type. The program stands here to say where the numbers come from.
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <vector>

#include "host_tools/raster.hpp"
#include "proto/tile_walk.hpp"
#include "tests/tools/link_survey.hpp"

namespace {

using leadline::host::SimulateOptions;
using leadline::proto::BitModel;
using leadline::proto::kTileModels;
using leadline::proto::TileModel;
using leadline::test::MapChange;

struct Tally {
  double zeros = 0;
  double ones = 0;
};
using Tallies = std::array<Tally, kTileModels>;

/// Counts bits instead of coding them.
struct Counter {
  TileModel& model;
  Tallies& tallies;
  bool bit(BitModel& bits, bool value) {
    const auto index = &bits - reinterpret_cast<BitModel*>(&model);
    (value ? tallies[static_cast<std::size_t>(index)].ones
           : tallies[static_cast<std::size_t>(index)].zeros) += 1;
    return value;
  }
  static std::uint32_t raw(std::uint32_t value, unsigned) { return value; }
};

void count(const MapChange& change, Tallies& tallies) {
  TileModel model{};
  Counter counter{model, tallies};
  leadline::proto::PacketMemory memory;
  int tiles = 0;
  for (std::size_t i = 0; i < change.after.size(); ++i) {
    auto changed = leadline::proto::changed_cells(change.before[i].data(), change.after[i].data());
    if (changed.count() == 0) {
      continue;
    }
    // About as many tiles as a packet holds begin together.
    if (tiles++ % 8 == 0) {
      memory = leadline::proto::PacketMemory{};
    }
    leadline::proto::TileWalk<Counter> walk(counter, model, memory);
    walk.mask(changed, changed.count());
    for (int cell = 0; cell < leadline::proto::kTileArea_cells; ++cell) {
      auto own = change.after[i][static_cast<std::size_t>(cell)];
      if (changed.test(cell) && !walk.cell(changed, cell, own, change.after[i].data())) {
        std::abort();
      }
    }
  }
}

void count_survey(const SimulateOptions& options, Tallies& tallies) {
  const auto states =
      leadline::test::coded_survey(options, {0.3, 0.305, 0.31, 0.33, 0.6, 0.605, 0.61, 0.63, 1.0});
  for (std::size_t i = 0; i < states.size(); ++i) {
    count(leadline::test::whole_map(states[i]), tallies);
    if (i > 0) {
      count({states[i - 1], states[i]}, tallies);
    }
  }
  std::fprintf(stderr, "counted %s %s\n", options.preset.c_str(), options.terrain.c_str());
}

/// What the surveys cannot teach: they have no second surfaces, and no cell that is forgotten.
int fixed_start_q8(int index) {
  const int unknown = leadline::proto::kMaskDensities * leadline::proto::kMaskPatterns;
  constexpr std::array<int, 7> kStart_q8 = {2, 64, 192, 4, 64, 160, 1};
  const int at = index - unknown;
  return at >= 0 && at < static_cast<int>(kStart_q8.size())
             ? kStart_q8[static_cast<std::size_t>(at)]
             : 0;
}

void run() {
  const char* const data = std::getenv("LEADLINE_DATA");
  const std::string folder = data == nullptr ? "../shared/data" : data;
  const std::string jd211 = folder + "/bag_navo_jd211/jd211_crop512_2m_elev.asc";
  const std::string whau = folder + "/dem_maunga_whau/maunga_whau_10m.asc";
  Tallies tallies{};
  SimulateOptions options;
  options.preset = "demo";
  options.seed = 11;
  options.settings = {"terrain_seed=77"};
  count_survey(options, tallies);
  options = SimulateOptions{};
  options.preset = "helens_rolling_fan";
  options.seed = 5;
  options.terrain = jd211;
  count_survey(options, tallies);
  options.preset = "monterey_fan";
  options.seed = 6;
  options.terrain = whau;
  count_survey(options, tallies);
  options.preset = "helens_low";
  options.seed = 7;
  options.terrain = jd211;
  count_survey(options, tallies);
  count(leadline::test::whole_map(
            leadline::test::code_terrain(leadline::host::read_esri_ascii(whau), 0.2)),
        tallies);
  for (int i = 0; i < kTileModels; ++i) {
    const Tally& tally = tallies[static_cast<std::size_t>(i)];
    const double share = (tally.ones + 0.5) / (tally.ones + tally.zeros + 1.0);
    int start_q8 = fixed_start_q8(i);
    if (start_q8 == 0) {
      start_q8 = std::clamp(static_cast<int>(std::lround(256.0 * share)), 1, 255);
    }
    std::printf("%d,%s", start_q8, i % 16 == 15 || i + 1 == kTileModels ? "\n" : " ");
  }
}

}  // namespace

int main() {
  try {
    run();
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
