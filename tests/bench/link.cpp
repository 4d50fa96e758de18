// What the link costs.
//
// First a table: bytes per changed cell, framing included, of our tile packets beside simpler codings of the
// same cells in packets of the same kind (self-contained, several tiles, the same headers):
//   int16     depth as 16 bits, sigma code and flags as 8, a mask of 32 bytes where not all cells changed
//   zstd      the same bytes through zstd -19, packet by packet
//   runs      mask and sigma as run lengths, depth as the difference to the cell before, in steps, varint
//   one zstd  the int16 bytes of everything that was sent in one zstd -19 frame: no packets, no framing
// "whole": every known cell of the final map. "live N": the survey in N equal parts, each part's changes sent
// when it is over. Surveys of LEADLINE_DATA are left out where it is absent. Then where the bytes of a packet
// go, how long the frames of the demo's flight are by message, and Google Benchmark's times.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <zstd.h>

#include "firmware/config/vehicle_file.hpp"
#include "host_tools/emulate/simulate_flight.hpp"
#include "host_tools/raster.hpp"
#include "host_tools/topside/host_vehicle.hpp"
#include "proto/framing.hpp"
#include "proto/messages.hpp"
#include "proto/tile_coder.hpp"
#include "proto/tile_walk.hpp"
#include "tests/tools/link_survey.hpp"

namespace {

using leadline::proto::encode_frame;
using leadline::proto::frame_bound_bytes;
using leadline::proto::FrameDecoderBuffer;
using leadline::proto::FrameView;

/// A payload with a zero every 32 bytes or so, as small integers in records have.
std::vector<std::uint8_t> payload_of(std::size_t size) {
  std::vector<std::uint8_t> payload(size);
  std::uint32_t state = 1;
  for (auto& byte : payload) {
    state = state * 1664525U + 1013904223U;
    byte = static_cast<std::uint8_t>((state >> 24U) < 8U ? 0U : state >> 24U);
  }
  return payload;
}

void encode(benchmark::State& state) {
  const auto payload = payload_of(static_cast<std::size_t>(state.range(0)));
  std::vector<std::uint8_t> frame(frame_bound_bytes(payload.size()));
  for (auto step : state) {
    static_cast<void>(step);
    auto size = encode_frame(payload.data(), payload.size(), frame.data(), frame.size());
    benchmark::DoNotOptimize(size);
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(state.iterations() * state.range(0));
}
BENCHMARK(encode)->Arg(64)->Arg(1024)->Arg(4096);

void decode(benchmark::State& state) {
  const auto payload = payload_of(static_cast<std::size_t>(state.range(0)));
  std::vector<std::uint8_t> frame(frame_bound_bytes(payload.size()));
  const auto size = encode_frame(payload.data(), payload.size(), frame.data(), frame.size());
  FrameDecoderBuffer<> buffer;
  for (auto step : state) {
    static_cast<void>(step);
    FrameView view{};
    std::size_t used = 0;
    bool complete = buffer.decoder().feed(frame.data(), size.value(), used, view);
    benchmark::DoNotOptimize(complete);
  }
  if (buffer.decoder().counters().frames != static_cast<std::uint32_t>(state.iterations())) {
    state.SkipWithError("a frame was not decoded");
  }
  state.SetBytesProcessed(state.iterations() * state.range(0));
}
BENCHMARK(decode)->Arg(64)->Arg(1024)->Arg(4096);

// --- Bytes per changed cell

using Bytes = std::vector<std::uint8_t>;
using leadline::proto::CellMask;
using leadline::proto::CodedCell;
using leadline::proto::kTileArea_cells;
using leadline::proto::TileUpdate;
using leadline::test::CodedMap;
using leadline::test::MapChange;

constexpr std::uint16_t kTag = 0x1234;

/// Length of the frame of a payload.
std::size_t framed(const Bytes& payload) {
  Bytes frame(frame_bound_bytes(payload.size()));
  return encode_frame(payload.data(), payload.size(), frame.data(), frame.size()).value();
}

void put_varint(Bytes& out, std::uint32_t value) {
  for (; value >= 0x80U; value >>= 7U) {
    out.push_back(static_cast<std::uint8_t>(value | 0x80U));
  }
  out.push_back(static_cast<std::uint8_t>(value));
}

/// What all codings say of a tile: number (with its neighbour before it one byte), generation, hash, count.
void put_tile_header(Bytes& out, int count) {
  out.insert(out.end(), {2, 0xAC, 0x02, 1, 2, 3, 4, static_cast<std::uint8_t>(count - 1)});
}

void put_int16(Bytes& out, const TileUpdate& update) {
  if (update.changed.count() < kTileArea_cells) {
    for (const std::uint16_t row : update.changed.rows) {
      out.push_back(static_cast<std::uint8_t>(row & 0xFFU));
      out.push_back(static_cast<std::uint8_t>(row >> 8U));
    }
  }
  // Planes, low bytes first: what helps zstd most.
  for (const unsigned shift : {8U, 16U, 0U}) {
    for (int cell = 0; cell < kTileArea_cells; ++cell) {
      if (update.changed.test(cell)) {
        out.push_back(static_cast<std::uint8_t>((update.cells[cell] >> shift) & 0xFFU));
      }
    }
  }
}

void put_runs(Bytes& out, const TileUpdate& update) {
  std::uint32_t run = 0;
  bool inside = true;
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    if (update.changed.test(cell) != inside) {
      put_varint(out, run);
      run = 0;
      inside = !inside;
    }
    ++run;
  }
  put_varint(out, run);
  run = 0;
  std::uint32_t code = 256;
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    if (!update.changed.test(cell)) {
      continue;
    }
    if ((update.cells[cell] & 0xFFU) != code) {
      if (run > 0) {
        put_varint(out, run);
      }
      code = update.cells[cell] & 0xFFU;
      out.push_back(static_cast<std::uint8_t>(code));
      run = 0;
    }
    ++run;
  }
  put_varint(out, run);
  std::int32_t before = 0;
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    if (!update.changed.test(cell) || !leadline::proto::cell_known(update.cells[cell])) {
      continue;
    }
    const int shift =
        leadline::proto::depth_step_shift(leadline::proto::cell_sigma_code(update.cells[cell]));
    const std::int32_t depth_q8 = leadline::proto::cell_depth_q8(update.cells[cell]);
    const std::int32_t steps = (depth_q8 >> shift) - (before >> shift);
    put_varint(out,
               (static_cast<std::uint32_t>(steps) << 1U) ^ static_cast<std::uint32_t>(steps >> 31));
    before = depth_q8;
  }
}

Bytes zstd(const Bytes& bytes) {
  Bytes out(ZSTD_compressBound(bytes.size()));
  out.resize(ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 19));
  return out;
}

std::vector<TileUpdate> updates_of(const MapChange& change) {
  std::vector<TileUpdate> updates;
  for (std::size_t tile = 0; tile < change.after.size(); ++tile) {
    TileUpdate update{};
    update.tile = static_cast<std::uint32_t>(tile);
    update.generation = 300;
    update.cells = change.after[tile].data();
    update.changed = leadline::proto::changed_cells(change.before[tile].data(), update.cells);
    if (update.changed.count() > 0) {
      updates.push_back(update);
    }
  }
  return updates;
}

std::size_t our_bytes(const std::vector<TileUpdate>& updates, std::size_t mtu) {
  Bytes payload(leadline::proto::max_payload_bytes(mtu));
  const std::size_t capacity = payload.size();
  std::size_t sum = 0;
  std::size_t next = 0;
  CellMask left = updates.empty() ? CellMask{} : updates[0].changed;
  while (next < updates.size()) {
    payload.resize(capacity);
    leadline::proto::TilePacketEncoder packet(payload.data(), capacity, kTag);
    bool room = true;
    while (room && next < updates.size()) {
      TileUpdate update = updates[next];
      update.changed = left;
      CellMask taken{};
      room = packet.add(update, taken).ok();
      if (!room) {
        break;
      }
      for (std::size_t row = 0; row < 16; ++row) {
        left.rows[row] = static_cast<std::uint16_t>(left.rows[row] & ~taken.rows[row]);
      }
      room = left.count() == 0;
      next += room ? 1 : 0;
      if (room && next < updates.size()) {
        left = updates[next].changed;
      }
    }
    payload.resize(packet.finish());
    sum += framed(payload);
  }
  return sum;
}

/// Packets of a coding that appends whole tiles: as many as fit, one at least.
template <typename Put, typename Pack>
std::size_t other_bytes(const std::vector<TileUpdate>& updates, std::size_t mtu, Put put,
                        Pack pack) {
  const std::size_t room = leadline::proto::max_payload_bytes(mtu);
  std::size_t sum = 0;
  Bytes body;
  Bytes packed;
  for (const TileUpdate& update : updates) {
    Bytes longer = body;
    put_tile_header(longer, update.changed.count());
    put(longer, update);
    Bytes longer_packed = pack(longer);
    if (!body.empty() && longer_packed.size() + 4 > room) {
      packed.insert(packed.begin(), {2, 0x34, 0x12, 1});
      sum += framed(packed);
      longer.clear();
      put_tile_header(longer, update.changed.count());
      put(longer, update);
      longer_packed = pack(longer);
    }
    body = std::move(longer);
    packed = std::move(longer_packed);
  }
  if (!body.empty()) {
    packed.insert(packed.begin(), {2, 0x34, 0x12, 1});
    sum += framed(packed);
  }
  return sum;
}

/// Coder that only adds up what bits cost, by the part of the model that they fall to.
struct Cost {
  leadline::proto::TileModel& model;
  std::array<double, 6> bits{};  ///< mask, unknown, flags, sigma, depth, raw
  bool bit(leadline::proto::BitModel& used, bool value) {
    const auto within = [&used](auto& part) {
      const auto* first = reinterpret_cast<const leadline::proto::BitModel*>(&part);
      return &used >= first && &used < first + sizeof part / sizeof used;
    };
    const double one = static_cast<double>((used.fast_q15 + used.slow_q15) / 2) / 32768.0;
    const std::size_t part =
        within(model.mask)                                                               ? 0
        : within(model.unknown)                                                          ? 1
        : within(model.multi_surface) || within(model.other_flags)                       ? 2
        : within(model.sigma_same) || within(model.sigma_up) || within(model.sigma_more) ? 3
                                                                                         : 4;
    bits[part] -= std::log2(value ? one : 1.0 - one);
    std::uint8_t unused[8];
    leadline::proto::RangeEncoder coder;  // for the learning of the model
    coder.start(unused, sizeof unused);
    coder.put(used, value);
    return value;
  }
  std::uint32_t raw(std::uint32_t value, unsigned count) {
    bits[5] += count;
    return value;
  }
};

struct Sums {
  double cells = 0;
  double ours = 0;
  double ours_256 = 0;
  double int16 = 0;
  double zstd = 0;
  double runs = 0;
  Bytes all;
};

void add(Sums& sums, const MapChange& change) {
  const auto updates = updates_of(change);
  const auto as_is = [](const Bytes& bytes) { return bytes; };
  for (const TileUpdate& update : updates) {
    sums.cells += update.changed.count();
    put_int16(sums.all, update);
  }
  sums.ours += static_cast<double>(our_bytes(updates, 1200));
  sums.ours_256 += static_cast<double>(our_bytes(updates, 256));
  sums.int16 += static_cast<double>(other_bytes(updates, 1200, put_int16, as_is));
  sums.zstd += static_cast<double>(other_bytes(updates, 1200, put_int16, zstd));
  sums.runs += static_cast<double>(other_bytes(updates, 1200, put_runs, as_is));
}

void print_row(const std::string& name, const Sums& sums) {
  std::printf("| %-30s | %8.0f | %5.3f | %5.3f | %5.3f | %5.3f | %5.3f | %5.3f |\n", name.c_str(),
              sums.cells, sums.ours / sums.cells, sums.ours_256 / sums.cells,
              sums.int16 / sums.cells, sums.runs / sums.cells, sums.zstd / sums.cells,
              static_cast<double>(zstd(sums.all).size()) / sums.cells);
}

/// Rows of one survey; `map` computes its states at given fractions of the pings.
template <typename States>
void print_survey(const std::string& name, States states_at) {
  for (const int parts : {20, 200}) {
    std::vector<double> fractions;
    for (int i = 1; i <= parts; ++i) {
      fractions.push_back(static_cast<double>(i) / parts);
    }
    const std::vector<CodedMap> states = states_at(fractions);
    if (parts == 20) {
      Sums whole;
      add(whole, leadline::test::whole_map(states.back()));
      print_row(name + ", whole", whole);
    }
    Sums live;
    CodedMap before(states[0].size());
    for (const CodedMap& after : states) {
      add(live, {before, after});
      before = after;
    }
    print_row(name + ", live " + std::to_string(parts), live);
  }
}

/// Where the bytes of one packet with one whole tile go.
void print_packet(const CodedMap& map) {
  // The middle tile of the map.
  const auto& cells = map[map.size() / 2 + 4];
  TileUpdate update{};
  update.tile = static_cast<std::uint32_t>(map.size() / 2 + 4);
  update.generation = 300;
  update.cells = cells.data();
  for (auto& row : update.changed.rows) {
    row = 0xFFFF;
  }
  Bytes payload(leadline::proto::kMaxPayload_bytes);
  CellMask taken{};
  payload.resize(
      leadline::proto::encode_tile(update, kTag, payload.data(), payload.size(), taken).value());
  leadline::proto::TileModel model{};
  leadline::proto::start_tile_model(model);
  leadline::proto::PacketMemory memory;
  Cost cost{model, {}};
  leadline::proto::TileWalk<Cost> walk(cost, model, memory);
  walk.mask(taken, taken.count());
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    CodedCell own = cells[static_cast<std::size_t>(cell)];
    static_cast<void>(walk.cell(taken, cell, own, cells.data()));
  }
  const std::size_t frame = framed(payload);
  std::printf("\none whole tile: payload %zu bytes, frame %zu\n", payload.size(), frame);
  std::printf(
      "framing %zu, packet header 4, tile header 8 (number 1, generation 2, hash 4, count 1)\n",
      frame - payload.size());
  std::printf(
      "body, bits: mask %.1f, unknown %.1f, flags %.1f, sigma %.1f, depth %.1f, raw %.1f\n\n",
      cost.bits[0], cost.bits[1], cost.bits[2], cost.bits[3], cost.bits[4], cost.bits[5]);
}

/// Frames of the demo's flight, as `leadline simulate` flies it, by message.
void print_messages() {
  const leadline::host::Mission mission = leadline::host::resolve_mission({});
  leadline::host::Fleet fleet(mission);
  leadline::host::MissionLinks links;
  for (const std::string& name : fleet_ports(mission)) {
    links.port_uris.push_back("serial:" + name + ":115200");
  }
  links.link_uri = "udp:127.0.0.1:9100";
  const auto file = leadline::host::parse_vehicle_file(
      mission_vehicle_toml(mission, fleet.ground(), links), "vehicle.toml", "");
  const auto tables = leadline::host::table_bytes(mission_tables(mission));
  const leadline::host::HostVehicle vehicle(file.config, tables, "vehicle.toml");
  struct Kind {
    std::size_t count = 0;
    std::size_t bytes = 0;
    std::size_t longest_bytes = 0;
  };
  std::map<std::uint8_t, Kind> kinds;
  std::size_t sum_bytes = 0;
  FrameDecoderBuffer<> buffer;
  leadline::host::FlightSinks sinks;
  sinks.log = [](const std::uint8_t*, std::size_t) {};
  sinks.downlink = [&](const std::uint8_t* data, std::size_t size_bytes) {
    while (size_bytes > 0) {
      std::size_t used = 0;
      FrameView view{};
      if (buffer.decoder().feed(data, size_bytes, used, view)) {
        const std::size_t frame_bytes = framed({view.payload, view.payload + view.payload_bytes});
        Kind& kind = kinds[view.payload[0]];
        kind.count += 1;
        kind.bytes += frame_bytes;
        kind.longest_bytes = std::max(kind.longest_bytes, frame_bytes);
        sum_bytes += frame_bytes;
      }
      data += used;
      size_bytes -= used;
    }
  };
  static_cast<void>(fly_in_process(&fleet, &*vehicle, tables, file.cycle_us, sinks, nullptr));
  std::printf(
      "the demo's flight, %zu bytes:\n| message | frames | bytes a frame: mean | longest | of all "
      "|\n",
      sum_bytes);
  const std::map<leadline::proto::MessageType, const char*> names = {
      {leadline::proto::MessageType::kHello, "hello"},
      {leadline::proto::MessageType::kTileDelta, "tile delta"},
      {leadline::proto::MessageType::kStatus, "full status"},
      {leadline::proto::MessageType::kText, "text"},
      {leadline::proto::MessageType::kBrief, "brief"}};
  for (const auto& [type, kind] : kinds) {
    const auto name = names.find(static_cast<leadline::proto::MessageType>(type));
    std::printf("| %-11s | %6zu | %6.1f | %5zu | %4.1f %% |\n",
                name == names.end() ? "other" : name->second, kind.count,
                static_cast<double>(kind.bytes) / static_cast<double>(kind.count),
                kind.longest_bytes,
                100.0 * static_cast<double>(kind.bytes) / static_cast<double>(sum_bytes));
  }
  std::printf("\n");
}

std::string text_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void print_tables() {
  const char* const variable = std::getenv("LEADLINE_DATA");
  const std::string data = variable == nullptr ? "../shared/data" : variable;
  std::printf(
      "| %-30s |    cells | ours  | MTU256| int16 | runs  | zstd  |one zstd|\n"
      "|--------------------------------|----------|-------|-------|-------|-------|-------|-------"
      "|\n",
      "bytes per changed cell");
  CodedMap demo;
  print_survey("demo", [&demo](const std::vector<double>& fractions) {
    auto states = leadline::test::coded_survey({}, fractions);
    demo = states.back();
    return states;
  });
  for (const char* scene : {"monterey_fan", "helens_rolling_fan", "helens_altimeter"}) {
    const std::string folder = data + "/scenes/" + scene;
    const std::string pings = text_of(folder + "/pings.csv");
    const std::string toml = text_of(folder + "/map.toml");
    if (!pings.empty()) {
      print_survey(scene, [&](const std::vector<double>& fractions) {
        return leadline::test::coded_pings(pings, toml, fractions);
      });
    }
  }
  const std::string helens = data + "/dem_mt_st_helens/st_helens_30m.asc";
  if (std::ifstream(helens).good()) {
    const auto raster = leadline::host::read_esri_ascii(helens);
    for (const double sigma : {0.15, 0.3}) {
      Sums whole;
      add(whole, leadline::test::whole_map(leadline::test::code_terrain(raster, sigma)));
      print_row("St. Helens DEM, sigma " + std::to_string(sigma).substr(0, 4), whole);
    }
  }
  print_packet(demo);
  print_messages();
}

// --- Times

/// Rolling terrain with noise and changing sigma.
std::array<CodedCell, kTileArea_cells> terrain_tile() {
  std::array<CodedCell, kTileArea_cells> cells{};
  std::uint32_t state = 7;
  for (int i = 0; i < kTileArea_cells; ++i) {
    state = state * 1664525U + 1013904223U;
    const int n = i / 16;
    const int e = i % 16;
    const auto depth_q8 =
        4000 + 40 * n - 25 * e + 3 * n * e + static_cast<int>((state >> 24U) / 8U);
    cells[static_cast<std::size_t>(i)] =
        leadline::proto::code_cell(depth_q8, 700 + (state >> 16U) % 400, 0);
  }
  return cells;
}

void encode_whole_tile(benchmark::State& state) {
  const auto cells = terrain_tile();
  TileUpdate update{};
  update.cells = cells.data();
  for (auto& row : update.changed.rows) {
    row = 0xFFFF;
  }
  Bytes payload(1189);
  for (auto step : state) {
    static_cast<void>(step);
    CellMask taken{};
    auto size = leadline::proto::encode_tile(update, kTag, payload.data(), payload.size(), taken);
    benchmark::DoNotOptimize(size);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kTileArea_cells);
}
BENCHMARK(encode_whole_tile);

void decode_whole_tile(benchmark::State& state) {
  const auto cells = terrain_tile();
  TileUpdate update{};
  update.cells = cells.data();
  for (auto& row : update.changed.rows) {
    row = 0xFFFF;
  }
  Bytes payload(1189);
  CellMask taken{};
  const auto size =
      leadline::proto::encode_tile(update, kTag, payload.data(), payload.size(), taken);
  leadline::proto::TilePacketDecoder packet;
  leadline::proto::TileDelta delta;
  for (auto step : state) {
    static_cast<void>(step);
    auto status = packet.open(payload.data(), size.value());
    bool whole = packet.next(delta);
    benchmark::DoNotOptimize(status);
    benchmark::DoNotOptimize(whole);
  }
  if (delta.cell_count != kTileArea_cells) {
    state.SkipWithError("a tile was not decoded");
  }
  state.SetItemsProcessed(state.iterations() * kTileArea_cells);
}
BENCHMARK(decode_whole_tile);

void hash_tile(benchmark::State& state) {
  const auto cells = terrain_tile();
  for (auto step : state) {
    static_cast<void>(step);
    auto hash = leadline::proto::tile_hash(cells.data());
    benchmark::DoNotOptimize(hash);
  }
  state.SetItemsProcessed(state.iterations() * kTileArea_cells);
}
BENCHMARK(hash_tile);

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  try {
    print_tables();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
