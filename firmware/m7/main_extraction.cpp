// The image that looks for the dearest extraction: columns that cost most to read, to smooth, to assess, by climbing from
// random ones on the board itself, and what the dearest cycle of a pass over maps full of them comes to.
//
//   qemu-system-arm ... -icount shift=7,sleep=off -semihosting-config ...,arg=extraction,arg=FILE
//
// FILE is cost_file.hpp's; only its configuration and table count. A line for each stage and a line for the cycle.
// Seeded: the same lines in every run. Exit status 0, 2 usage, 3 the file is of no use.
#include <cstdint>
#include <cstring>

#include "firmware/m7/entry_points.hpp"
#include "firmware/m7/measure.hpp"
#include "firmware/pipeline/extraction_pass.hpp"
#include "firmware/pipeline/tile_set.hpp"
#include "model/base/fixed.hpp"

namespace {

namespace base = leadline::base;
namespace firmware = leadline::firmware;
namespace model = leadline::model;
using firmware::m7::compare_tile;
using firmware::m7::config;
using firmware::m7::counter;
using firmware::m7::say_number;
using firmware::m7::the_model;
using leadline::hal::m7::InstructionCounter;
using leadline::hal::m7::say;

constexpr std::uint32_t kTileColumns = model::kTileCells * model::kTileCells;
constexpr std::uint32_t kTileBudget = 1;

[[gnu::section(".bss.leadline.tools")]] firmware::ExtractionPass pass;
[[gnu::section(".bss.leadline.tools")]] firmware::TileSet waiting;
std::uint32_t touches = 0;

// xorshift32.
std::uint32_t state = 0x9E3779B9U;
std::uint32_t below(std::uint32_t limit) {
  state ^= state << 13U;
  state ^= state >> 17U;
  state ^= state << 5U;
  return state % limit;
}

// ---- Maps ---------------------------------------------------------------------------------------

/// Some voxels of a column, from the top downwards.
struct Segment {
  std::uint32_t length;
  std::uint32_t hit, miss;
  std::int32_t hit_step;
};
constexpr std::uint32_t kSegments = 12;

/// A map of columns that repeat every kPeriod: what is found of one tile holds for all.
constexpr std::uint32_t kPeriod = 8;
struct Columns {
  /// Read: the same segments in all columns. Otherwise one surface each, by its place in the period.
  bool profiles;
  Segment segments[kSegments];
  /// The surface's first voxel, and what stands there and below it; kNone: no evidence at all.
  struct Surface {
    std::uint8_t first;
    std::uint16_t hits[2];
    std::uint16_t miss;
  } surfaces[kPeriod * kPeriod];
};

Segment random_segment() {
  const auto depth = static_cast<std::uint32_t>(config.size[2]);
  return Segment{1 + below(1 + depth / (1U << below(5))), below(1U << (1 + below(16))),
                 below(3) == 0 ? below(1U << (1 + below(16))) : 0,
                 static_cast<std::int32_t>(below(201)) - 100};
}

Columns::Surface random_surface() {
  Columns::Surface surface{};
  surface.first = static_cast<std::uint8_t>(below(static_cast<std::uint32_t>(config.size[2] - 1)));
  const std::uint32_t kind = below(8);
  if (kind == 0) {
    return surface;  // never observed
  }
  if (kind == 1) {
    surface.miss = 100;  // lit, and nothing there
    return surface;
  }
  const std::uint32_t strength = kind < 5 ? 1 + below(200) : 20'000;  // of one ping, or of many
  surface.hits[0] = static_cast<std::uint16_t>(strength);
  surface.hits[1] = static_cast<std::uint16_t>(below(strength + 1));
  return surface;
}

Columns random_columns(bool profiles) {
  Columns columns{};
  columns.profiles = profiles;
  for (Segment& segment : columns.segments) {
    segment = random_segment();
  }
  // Half of the starts: hills of one height, apart from each other.
  if (below(2) == 0) {
    const std::uint32_t wide = 1 + below(static_cast<std::uint32_t>(config.size[2]) / 3);
    const std::uint32_t high = 20 + below(8000);
    for (std::uint32_t i = 0; i < kSegments; ++i) {
      columns.segments[i] =
          i % 2 == 0 ? Segment{wide, high, below(100), 0} : Segment{2 + below(4), 0, 0, 0};
    }
  }
  for (Columns::Surface& surface : columns.surfaces) {
    surface = random_surface();
  }
  return columns;
}

Columns changed(const Columns& from) {
  Columns columns = from;
  const std::uint32_t changes = 1 + below(3);
  for (std::uint32_t i = 0; i < changes; ++i) {
    if (!columns.profiles) {
      const std::uint32_t place = below(kPeriod * kPeriod);
      columns.surfaces[place] =
          below(2) == 0 ? random_surface() : columns.surfaces[below(kPeriod * kPeriod)];
      continue;
    }
    Segment& segment = columns.segments[below(kSegments)];
    switch (below(5)) {
      case 0:
        segment = random_segment();
        break;
      case 1:
        segment.length = 1 + (segment.length + below(5)) % 64;
        break;
      case 2:
        segment.hit = segment.hit * (50 + below(100)) / 100 + below(3);
        break;
      case 3:
        segment.hit_step += static_cast<std::int32_t>(below(21)) - 10;
        break;
      default:
        segment.miss = below(1U << (1 + below(16)));
        break;
    }
  }
  return columns;
}

void fill_column(const Columns& columns, std::int32_t n, std::int32_t e) {
  model::Grid& grid = the_model.grid();
  model::Voxel* const voxels = grid.column_voxels(grid.column_index(n, e));
  const auto depth = static_cast<std::uint32_t>(grid.depth_cells());
  std::memset(static_cast<void*>(voxels), 0, sizeof(model::Voxel) * depth);
  if (!columns.profiles) {
    const Columns::Surface& surface =
        columns.surfaces[(static_cast<std::uint32_t>(n) % kPeriod) * kPeriod +
                         static_cast<std::uint32_t>(e) % kPeriod];
    for (std::uint32_t i = 0; i < 2; ++i) {
      voxels[surface.first + i].hit = surface.hits[i];
    }
    voxels[surface.first].miss = surface.miss;
    return;
  }
  std::uint32_t k = 0;
  for (const Segment& segment : columns.segments) {
    std::int32_t hit = static_cast<std::int32_t>(segment.hit);
    for (std::uint32_t i = 0; i < segment.length && k < depth; ++i, ++k) {
      voxels[k].hit = static_cast<std::uint16_t>(base::clamp(hit, 0, 65535));
      voxels[k].miss = static_cast<std::uint16_t>(base::min_of(segment.miss, 65535U));
      hit += segment.hit_step;
    }
  }
}

struct Box {
  std::int32_t north0, north1, east0, east1;  // tiles, all inclusive
};

template <typename Act>
void for_tiles(const Box& box, const Act& act) {
  const std::int32_t columns = the_model.grid().tiles_east();
  for (std::int32_t n = box.north0; n <= box.north1; ++n) {
    for (std::int32_t e = box.east0; e <= box.east1; ++e) {
      act(static_cast<model::TileId>(n * columns + e));
    }
  }
}

void fill(const Columns& columns, const Box& box) {
  for (std::int32_t n = box.north0 * model::kTileCells; n < (box.north1 + 1) * model::kTileCells;
       ++n) {
    for (std::int32_t e = box.east0 * model::kTileCells; e < (box.east1 + 1) * model::kTileCells;
         ++e) {
      fill_column(columns, n, e);
    }
  }
  ++touches;
  for_tiles(box, [](model::TileId tile) { the_model.grid().touch(tile, touches); });
}

// Out of date, whatever changed: as after pings that changed all of it.
void outdate(model::TileId tile) {
  model::TileRecord& record = the_model.grid().tile(tile);
  for (std::uint16_t& row : record.unsmoothed) {
    row = UINT16_MAX;
  }
  record.flags |= model::kTileUnsmoothed;
}

// ---- Stages -------------------------------------------------------------------------------------

enum class Stage : std::uint8_t { kRead, kSmooth, kAssess };

constexpr std::int32_t kMiddle = 3;  // of the grid's tiles; sigma looks three tiles far

Box around(std::int32_t reach) {
  return Box{kMiddle - reach, kMiddle + reach, kMiddle - reach, kMiddle + reach};
}

/// Makes the map what `stage` finds, with all before it done.
void prepare(Stage stage, const Columns& columns, const Box& box) {
  fill(columns, box);
  if (stage == Stage::kRead) {
    return;
  }
  for_tiles(box, [](model::TileId tile) { the_model.read_touched_tile(tile); });
  for_tiles(box, outdate);
  if (stage == Stage::kAssess) {
    for_tiles(box, [](model::TileId tile) { the_model.smooth_changed_tile(tile); });
  }
}

std::uint32_t work(Stage stage, model::TileId tile) {
  const std::uint32_t begin = counter.ticks();
  if (stage == Stage::kRead) {
    the_model.read_touched_tile(tile);
  } else if (stage == Stage::kSmooth) {
    the_model.smooth_changed_tile(tile);
  } else {
    the_model.assess_changed_tile(tile);
    compare_tile(tile);
  }
  return counter.ticks() - begin;
}

std::uint32_t cost(Stage stage, const Columns& columns) {
  constexpr std::int32_t kReaches[] = {0, 1, model::Model::kInfluenceTiles};
  prepare(stage, columns, around(kReaches[static_cast<int>(stage)]));
  return work(stage, static_cast<model::TileId>(kMiddle * the_model.grid().tiles_east() + kMiddle));
}

struct Found {
  Columns columns;
  std::uint32_t ticks;
};

/// Climbs from each of several starts; the best of all.
Found search(Stage stage, std::uint32_t starts, std::uint32_t steps) {
  Found best{};
  for (std::uint32_t start = 0; start < starts; ++start) {
    Found here{random_columns(stage == Stage::kRead), 0};
    here.ticks = cost(stage, here.columns);
    for (std::uint32_t step = 0; step < steps; ++step) {
      const Columns next = changed(here.columns);
      const std::uint32_t ticks = cost(stage, next);
      if (ticks >= here.ticks) {
        here = Found{next, ticks};
      }
    }
    best = here.ticks > best.ticks ? here : best;
  }
  return best;
}

// ---- Passes -------------------------------------------------------------------------------------

/// The dearest cycle of a pass with a tile budget of 1 over a map full of these columns, ticks; as
/// Vehicle::extract_in_passes().
std::uint32_t dearest_cycle(const Columns& columns) {
  constexpr std::uint32_t kBudget_columns = kTileBudget * 4 * kTileColumns;
  model::Grid& grid = the_model.grid();
  const Box all{0, grid.tiles_north() - 1, 0, grid.tiles_east() - 1};
  // Twice: the second pass finds a map whose surroundings are known.
  std::uint32_t dearest = 0;
  for (int round = 0; round < 2; ++round) {
    fill(columns, all);
    for_tiles(all, outdate);
    // Of every fifth tile a column less, so that four steps leave one column of the budget, and the fifth is whole.
    for_tiles(all, [](model::TileId tile) {
      the_model.grid().tile(tile).unsmoothed[0] =
          static_cast<std::uint16_t>(tile % 5 == 0 ? UINT16_MAX - 1 : UINT16_MAX);
    });
    waiting.reset(grid.tile_count());
    for_tiles(all, [](model::TileId tile) { waiting.add(tile, 1, 0); });
    bool first = true;
    while (first || pass.size() > 0) {
      const std::uint32_t begin = counter.ticks();
      if (first) {
        pass.begin(waiting);
      }
      first = false;
      std::uint32_t done = 0;
      while (pass.size() > 0 && done < kBudget_columns) {
        const firmware::ExtractionPass::Step step = pass.step(the_model);
        done += step.columns;
        if (step.finished) {
          compare_tile(step.tile);
        }
      }
      dearest = base::max_of(dearest, counter.ticks() - begin);
    }
  }
  return dearest;
}

std::uint32_t run(leadline::hal::m7::HostFile& file) {
  file.close();
  constexpr std::int32_t kLeastTiles = 2 * kMiddle + 1;
  if (the_model.grid().tiles_north() < kLeastTiles || the_model.grid().tiles_east() < kLeastTiles) {
    firmware::m7::say_error("extraction", "fewer than 7 x 7 tiles");
    return firmware::m7::kInput;
  }
  firmware::m7::link_map.reset(the_model.grid().tile_count());
  pass.reset();
  struct Plan {
    const char* name;
    Stage stage;
    std::uint32_t starts, steps;
  };
  for (const Plan& plan :
       {Plan{"read", Stage::kRead, 16, 400}, Plan{"smoothed", Stage::kSmooth, 12, 300},
        Plan{"assessed", Stage::kAssess, 6, 40}}) {
    const Found found = search(plan.stage, plan.starts, plan.steps);
    say("dearest ");
    say(plan.name);
    say_number(" depth_cells ", static_cast<std::uint32_t>(config.size[2]));
    say_number(" maps ", std::uint64_t{plan.starts} * (plan.steps + 1));
    say_number(" instructions_a_column ",
               InstructionCounter::instructions(found.ticks) / kTileColumns);
    say_number(" cycle_instructions ",
               InstructionCounter::instructions(dearest_cycle(found.columns)));
    say("\n");
  }
  return firmware::m7::kMeasured;
}

}  // namespace

extern "C" void leadline_main() {
  leadline::hal::m7::HostFile file;
  firmware::m7::begin_measuring("extraction", file);
  leadline::hal::m7::exit(run(file));
}
