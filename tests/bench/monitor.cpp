// What an update of the live map costs the monitor, for maps of any size: tiles that changed go from the store
// into the live map and into one viewer's message.
#include <benchmark/benchmark.h>

#include "host_tools/monitor/live_map.hpp"
#include "host_tools/monitor/page_messages.hpp"

namespace {

using leadline::host::LiveMap;
using leadline::host::PageCursor;
using leadline::host::TileStore;
using leadline::host::Track;
using leadline::proto::TileDelta;

constexpr std::uint32_t kTilesPerUpdate = 8;

void change(TileStore* store, std::uint32_t tile, std::uint32_t generation) {
  TileDelta delta{};
  delta.tile = tile;
  delta.generation = generation;
  for (int k = 0; k < 64; ++k) {
    delta.changed.set(k);
    delta.cells[k] =
        leadline::proto::code_cell(static_cast<std::int32_t>(generation * 16 % 16'000), 256, 0);
  }
  delta.cell_count = 64;
  (void)store->apply(delta);
}

void update(benchmark::State& state) {
  const auto side_cells = static_cast<std::int32_t>(state.range(0));
  leadline::proto::Hello hello{};
  hello.protocol_major = leadline::proto::kProtocolMajor;
  hello.tile_side_cells = leadline::proto::kTileSide_cells;
  hello.cell_mm = 500;
  hello.size_cells[0] = hello.size_cells[1] = side_cells;
  hello.size_cells[2] = 64;
  TileStore store(hello);
  LiveMap map;
  const Track track;
  const std::string palettes = "{}";
  const std::string json = "{}";
  PageCursor cursor;
  std::size_t bytes = 0;
  const auto serve = [&] {
    while (const auto message =
               next_page_message({&palettes, &map, &track, 1, &json, true}, &cursor)) {
      bytes += message->bytes.size();
    }
  };
  for (std::uint32_t tile = 0; tile < store.tile_count(); ++tile) {
    change(&store, tile, 1);
  }
  map.follow(store, 0);
  serve();
  const std::size_t whole_bytes = bytes;
  bytes = 0;
  std::uint32_t generation = 1;
  for (auto _ : state) {
    generation += 1;
    for (std::uint32_t k = 0; k < kTilesPerUpdate; ++k) {
      // All over the map: caches help a small one.
      change(&store, (k * 2654435761U + generation * 40503U) % store.tile_count(), generation);
    }
    map.follow(store, generation * 100'000);
    serve();
  }
  state.counters["bytes_per_update"] =
      static_cast<double>(bytes) / static_cast<double>(state.iterations());
  state.counters["bytes_whole_map"] = static_cast<double>(whole_bytes);
}
BENCHMARK(update)->RangeMultiplier(2)->Range(64, 2048)->Unit(benchmark::kMicrosecond);

}  // namespace

BENCHMARK_MAIN();
