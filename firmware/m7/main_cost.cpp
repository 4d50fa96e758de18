// The image that measures: what pings cost in instructions, one by one, and what the parts of a cycle do.
//
//   qemu-system-arm ... -icount shift=7,sleep=off -semihosting-config ...,arg=cost,arg=FILE
//
// FILE is cost_file.hpp's. A line for each ping, then lines of sums: the inner loops beside a loop that only
// loads, adds, saturates and stores; extraction; deltas; the hash of the map. Exit status 0, 2 usage, 3 the file
// is of no use.
#include <cstdint>
#include <cstring>

#include "firmware/m7/entry_points.hpp"
#include "firmware/m7/measure.hpp"
#include "model/base/fixed.hpp"
#include "model/column_kernels.hpp"
#include "proto/framing.hpp"
#include "proto/tile_coder.hpp"

namespace {

namespace base = leadline::base;
namespace firmware = leadline::firmware;
namespace model = leadline::model;
namespace proto = leadline::proto;
using firmware::m7::CostPing;
using firmware::m7::counter;
using firmware::m7::header;
using firmware::m7::link_map;
using firmware::m7::PreparedColumn;
using firmware::m7::say_number;
using firmware::m7::take;
using firmware::m7::the_model;
using leadline::hal::m7::InstructionCounter;
using leadline::hal::m7::say;

[[gnu::section(".bss.leadline.tools")]] PreparedColumn prepared[firmware::m7::kMostPreparedColumns];
[[gnu::section(".bss.leadline.tools")]] model::TileId touched[model::kTileCapacity];
CostPing record;

// What the calls that measure cost by themselves.
std::uint32_t counting_ticks() {
  const std::uint32_t begin = counter.ticks();
  return counter.ticks() - begin;
}

// ---- Pings --------------------------------------------------------------------------------------

void prepare(const PreparedColumn& from) {
  model::Grid& grid = the_model.grid();
  const std::uint32_t index = grid.column_index(from.north, from.east);
  model::Voxel* const voxels = grid.column_voxels(index);
  std::memset(static_cast<void*>(voxels), 0,
              sizeof(model::Voxel) * static_cast<std::size_t>(grid.depth_cells()));
  model::ColumnRecord& column = grid.column(index);
  column.depth_q8 = model::kUnknownDepth;
  column.mass = 0;
  column.gain = from.gain;
  for (std::int32_t i = 0; i < 2; ++i) {
    const std::int32_t k = from.first + i;
    if (k >= 0 && k < grid.depth_cells()) {
      voxels[k].hit = from.hits[i];
    }
  }
}

bool fly(leadline::hal::m7::HostFile& file) {
  const std::uint32_t counting = counting_ticks();
  for (std::uint32_t i = 0; i < header.pings; ++i) {
    if (!take(file, &record) || record.prepared_columns > firmware::m7::kMostPreparedColumns ||
        (record.prepared_columns > 0 && !take(file, prepared, record.prepared_columns))) {
      return false;
    }
    for (std::uint32_t k = 0; k < record.prepared_columns; ++k) {
      prepare(prepared[k]);
    }
    const base::Ping ping = firmware::m7::ping_of(record);
    const std::uint32_t begin = counter.ticks();
    (void)the_model.integrate(ping, record.pose);
    const std::uint32_t ticks = counter.ticks() - begin - counting;
    const model::PingWork& work = the_model.last_work();
    say_number("ping ", i);
    say_number(" instructions ", InstructionCounter::instructions(ticks));
    say_number(" voxels ", the_model.counters().last_voxels_per_ping);
    say_number(" columns_read ", work.columns_read);
    say_number(" shell_rows ", work.shell_rows);
    say_number(" shell_candidates ", work.shell_candidates);
    say_number(" shell_columns ", work.shell_columns);
    say_number(" shell_voxels ", work.shell_voxels);
    say_number(" cone_rows ", work.cone_rows);
    say_number(" cone_candidates ", work.cone_candidates);
    say_number(" cone_columns ", work.cone_columns);
    say_number(" cone_runs ", work.cone_runs);
    say_number(" cone_voxels ", work.cone_voxels);
    say("\n");
  }
  return true;
}

// ---- Extraction and deltas ----------------------------------------------------------------------

/// What `stage` of extraction takes over tiles 0 .. tile_count - 1 of `tiles`, or of the grid (null).
template <typename Stage>
void say_stage(const char* name, const model::TileId* tiles, std::uint32_t tile_count,
               const Stage& stage) {
  const std::uint32_t counting = counting_ticks();
  std::uint64_t ticks = 0;
  std::uint64_t columns = 0;
  for (std::uint32_t i = 0; i < tile_count; ++i) {
    const model::TileId tile = tiles != nullptr ? tiles[i] : i;
    const std::uint32_t begin = counter.ticks();
    columns += stage(tile);
    ticks += counter.ticks() - begin - counting;
  }
  say("extract ");
  say(name);
  say_number(" instructions ", InstructionCounter::instructions(ticks));
  say_number(" columns ", columns);
  say("\n");
}

void extract_and_code() {
  std::uint32_t tiles = 0;
  while (tiles < model::kTileCapacity && the_model.take_touched_tile(touched[tiles])) {
    ++tiles;
  }
  // As a pass does it (pipeline/extraction_pass.hpp).
  say_stage("read", touched, tiles,
            [](model::TileId tile) { return the_model.read_touched_tile(tile); });
  say_stage("smoothed", nullptr, the_model.grid().tile_count(),
            [](model::TileId tile) { return the_model.smooth_changed_tile(tile); });
  say_stage("assessed", touched, tiles,
            [](model::TileId tile) { return the_model.assess_changed_tile(tile); });

  link_map.reset(the_model.grid().tile_count());
  static std::uint8_t packet[proto::kMaxPayload_bytes];
  static firmware::TileCells cells;
  say_stage("compared", touched, tiles, firmware::m7::compare_tile);
  std::uint64_t code_ticks = 0;
  std::uint64_t bytes = 0;
  std::uint64_t coded = 0;
  for (std::uint32_t i = 0; i < tiles; ++i) {
    const std::uint32_t begin = counter.ticks();
    link_map.present(the_model, touched[i], cells);
    const proto::TileUpdate update{touched[i], i + 1, cells.data(),
                                   link_map.owed(touched[i], cells)};
    proto::CellMask taken{};
    const auto size = proto::encode_tile(update, 1, packet, sizeof packet, taken);
    if (size.ok()) {
      coded += static_cast<std::uint64_t>(link_map.sent(touched[i], cells, taken));
      bytes += size.value();
    }
    code_ticks += counter.ticks() - begin;
  }
  say_number("deltas instructions ", InstructionCounter::instructions(code_ticks));
  say_number(" bytes ", bytes);
  say_number(" cells ", coded);
  say("\n");
}

// ---- Inner loops --------------------------------------------------------------------------------

struct Run {
  std::uint32_t first;
  std::int32_t count;
};
constexpr std::uint32_t kRuns = 2048;
[[gnu::section(".bss.leadline.tools")]] Run runs[kRuns];

// Load, add, saturate, store: the least that any such map does to a voxel.
[[gnu::noinline]] void minimal_loop(model::Voxel* voxels, std::uint32_t units) {
  for (const Run& run : runs) {
    model::Voxel* const begin = voxels + run.first;
    for (std::int32_t i = 0; i < run.count; ++i) {
      begin[i].miss = base::saturated_sum(begin[i].miss, units);
    }
  }
}

[[gnu::noinline]] void empty_loop(model::Voxel* voxels, const model::Evidence& evidence) {
  for (const Run& run : runs) {
    model::add_uniform(voxels + run.first, run.count, run.first, evidence, 0x1234U);
  }
}

[[gnu::noinline]] void shell_loop(model::Voxel* voxels, const model::LocalizationTable& taps,
                                  const model::Evidence& evidence) {
  std::uint32_t phase = 0;
  for (const Run& run : runs) {
    model::add_shell_taps(voxels + run.first,
                          taps.kernel_q15[model::kKernelLevels - 1][phase & 15U],
                          model::kKernelTaps - run.count, run.count, 0x1234U, evidence);
    ++phase;
  }
}

void compare_loops() {
  model::Voxel* const voxels = the_model.grid().column_voxels(0);
  const std::uint32_t counting = counting_ticks();
  const auto list = [](std::int32_t longest) {
    std::uint64_t total = 0;
    for (std::uint32_t i = 0; i < kRuns; ++i) {
      const std::uint32_t mixed = base::mix_u32(i + 1);
      runs[i] =
          Run{(mixed >> 8U) % 4096U,
              1 + static_cast<std::int32_t>((mixed & 0xFFU) % static_cast<std::uint32_t>(longest))};
      total += static_cast<std::uint32_t>(runs[i].count);
    }
    return total;
  };
  const auto report = [counting](const char* name, std::uint32_t ours, std::uint32_t minimal,
                                 std::uint64_t total) {
    say("loop ");
    say(name);
    say_number(" instructions ", InstructionCounter::instructions(ours - counting));
    say_number(" minimal ", InstructionCounter::instructions(minimal - counting));
    say_number(" voxels ", total);
    say_number(" runs ", kRuns);
    say("\n");
  };
  // Runs of empty evidence have 24 voxels at most, those of a shell 14.
  std::uint64_t total = list(24);
  std::uint32_t begin = counter.ticks();
  minimal_loop(voxels, 3);
  std::uint32_t minimal = counter.ticks() - begin;
  begin = counter.ticks();
  empty_loop(voxels, model::Evidence{0, 900});
  report("empty", counter.ticks() - begin, minimal, total);
  total = list(14);
  begin = counter.ticks();
  minimal_loop(voxels, 3);
  minimal = counter.ticks() - begin;
  begin = counter.ticks();
  shell_loop(voxels, the_model.table(), model::Evidence{3000, 0});
  report("shell", counter.ticks() - begin, minimal, total);
}

std::uint32_t run(leadline::hal::m7::HostFile& file) {
  if (!fly(file)) {
    firmware::m7::say_error("cost", "the file ends early");
    return firmware::m7::kInput;
  }
  file.close();
  say_number("map_hash ", the_model.grid().map_hash());
  say("\n");
  extract_and_code();
  compare_loops();
  return firmware::m7::kMeasured;
}

}  // namespace

extern "C" void leadline_main() {
  leadline::hal::m7::HostFile file;
  firmware::m7::begin_measuring("cost", file);
  leadline::hal::m7::exit(run(file));
}
