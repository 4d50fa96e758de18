// Any configuration blob, and a flight of any bytes in it. What must hold: what decode_config() accepts is encoded to the
// same bytes; configure() refuses or takes it; no cycle passes the link's room or the bound of its work; every ping is
// accounted for; and the log of it flies again to the same end. A block (LLB1) is read or refused.
//
// Input: size of the blob (u16), the blob, then port, size and bytes of a chunk, or 0xF0 and the milliseconds to the next
// cycle. Sizes and checksums inside blob and block are put right first: a fuzzer does not find a CRC by itself.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "firmware/pipeline/config_block.hpp"
#include "firmware/pipeline/config_codec.hpp"
#include "firmware/pipeline/log_player.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "host_tools/table/generator.hpp"
#include "model/base/crc32c.hpp"
#include "model/localization_table.hpp"
#include "proto/log.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using namespace leadline::firmware;  // NOLINT: its names are what is under test
using leadline::base::Status;
using leadline::base::TimeUs;
using leadline::fuzz::require;
using Bytes = std::vector<std::uint8_t>;

constexpr std::int64_t kMostVoxels = 1 << 18;  // of one flight, for the fuzzer's speed
constexpr std::uint32_t kMostCycles = 64;
constexpr std::uint8_t kCycleMark = 0xF0;

void put_u32(Bytes* bytes, std::size_t at, std::uint32_t value) {
  for (std::size_t i = 0; i < 4; ++i) {
    (*bytes)[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
  }
}

/// Size at 8, CRC at 12 of what is behind 16: blob and block have both there.
Bytes put_right(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, data + size);
  put_u32(&bytes, 8, static_cast<std::uint32_t>(size));
  put_u32(&bytes, 12, leadline::base::crc32c(bytes.data() + 16, size - 16));
  return bytes;
}

const leadline::model::LocalizationTable& table() {
  static const leadline::model::LocalizationTable made =
      leadline::host::generate_table(leadline::host::BeamDescription{}).table;
  return made;
}

void read_block(const std::uint8_t* data, std::size_t size) {
  const Bytes bytes = put_right(data, size);
  std::vector<std::uint64_t> aligned(size / 8 + 1);
  std::memcpy(aligned.data(), bytes.data(), size);
  ConfigBlock block{};
  if (read_config_block(reinterpret_cast<const std::uint8_t*>(aligned.data()), size, block) ==
      Status::kOk) {
    require(block.table_count <= kMaxTables, "tables of a block");
    require(block.cycle_us >= 1000 && block.cycle_us <= 1'000'000, "cycle of a block");
  }
}

struct Flight {
  VehicleConfig config;
  std::vector<TableBlock> tables;
};

std::unique_ptr<Vehicle> the_vehicle = std::make_unique<Vehicle>();
LogPlayer player;

void check_cycle(const Vehicle& vehicle, const CycleInput& input, const CycleOutput& output) {
  require(output.downlink.size_bytes <= input.downlink_room_bytes, "the link's room");
  const VehicleCounters& seen = vehicle.counters();
  require(seen.work_last_voxels <= vehicle.cycle_bound_voxels(), "the bound of a cycle's work");
  std::uint64_t accounted = seen.pings_pending + seen.pings_mapped;
  for (const std::uint64_t lost : seen.pings_lost) {
    accounted += lost;
  }
  require(seen.pings_in == accounted, "every ping is pending, lost or mapped");
}

void keep(const leadline::proto::LogWriter& writer, const Bytes& room, Bytes* log) {
  log->insert(log->end(), room.begin(),
              room.begin() + static_cast<std::ptrdiff_t>(writer.size_bytes()));
}

/// Flies the script, and returns its log.
Bytes fly(const Flight& flight, const std::uint8_t* script, std::size_t size) {
  Bytes log;
  Bytes room(1U << 20U);
  leadline::proto::LogWriter begin(room.data(), room.size());
  require(log_begin(begin, the_vehicle->config(), flight.tables.data(), flight.tables.size(), 0,
                    0) == Status::kOk,
          "the log begins");
  keep(begin, room, &log);
  TimeUs t_us = 0;
  std::vector<InputChunk> chunks;
  std::uint32_t cycles = 0;
  for (std::size_t at = 0; at + 1 < size && cycles < kMostCycles;) {
    if (script[at] != kCycleMark) {
      const std::size_t chunk = std::min<std::size_t>(script[at + 1], size - at - 2);
      if (chunks.size() < kMaxCycleChunks) {
        chunks.push_back({t_us, script + at + 2, static_cast<std::uint16_t>(chunk), script[at]});
      }
      at += 2 + chunk;
      continue;
    }
    t_us += TimeUs{script[at + 1]} * 1000;
    at += 2;
    const CycleInput input{t_us, chunks.data(), chunks.size(), 4000};
    CycleOutput output{};
    the_vehicle->cycle(input, output);
    check_cycle(*the_vehicle, input, output);
    leadline::proto::LogWriter writer(room.data(), room.size());
    require(log_cycle(writer, cycles, input, output) == Status::kOk, "a cycle is logged");
    keep(writer, room, &log);
    chunks.clear();
    ++cycles;
  }
  leadline::proto::LogWriter end(room.data(), room.size());
  require(end.end(log_end_of(*the_vehicle, t_us)) == Status::kOk, "the log ends");
  keep(end, room, &log);
  return log;
}

/// The log alone is enough to fly again.
void fly_again(const Bytes& log) {
  const auto act = [](LogEvent event) {
    require(event != LogEvent::kRefused, "a log of one's own is read");
    if (event == LogEvent::kConfigured) {
      require(the_vehicle->configure(player.config(), player.tables(), player.table_count()) ==
                  Status::kOk,
              "what flew is accepted again");
    } else if (event == LogEvent::kCycle) {
      CycleOutput output{};
      the_vehicle->cycle(player.input(), output);
    }
  };
  player.begin();
  for (std::size_t at = 0; at < log.size();) {
    std::size_t used = 0;
    const LogEvent event = player.feed(log.data() + at, log.size() - at, used);
    at += used;
    act(event);
  }
  act(player.finish());
  require(player.findings().complete() && player.end().has_value(), "a log without gaps");
  require(same_results(*player.end(), log_end_of(*the_vehicle, player.t_us())),
          "a replay is the flight");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size >= 16 && std::memcmp(data, "LLB1", 4) == 0) {
    read_block(data, size);
    return 0;
  }
  if (size < 2) {
    return 0;
  }
  const std::size_t blob_size = data[0] + 256U * data[1];
  if (blob_size < 16 || blob_size > size - 2) {
    return 0;
  }
  const Bytes blob = put_right(data + 2, blob_size);
  const auto decoded = decode_config(blob.data(), blob.size());
  if (!decoded.ok()) {
    return 0;
  }
  Flight flight{decoded.value(), {}};
  Bytes again(kMaxConfigBlob_bytes);
  const auto encoded = encode_config(flight.config, again.data(), again.size());
  require(encoded.ok(), "what was read is written");
  const auto back = decode_config(again.data(), encoded.value());
  require(back.ok(), "what was written is read");
  const auto& grid = flight.config.model.size;
  std::int64_t voxels = 1;
  for (const std::int32_t cells : grid) {
    if (cells > 1024 || (voxels *= std::max(cells, 1)) > kMostVoxels) {
      return 0;
    }
  }
  flight.tables.assign(std::min<std::size_t>(flight.config.table_count, kMaxTables),
                       {&table(), sizeof table()});
  if (the_vehicle->configure(flight.config, flight.tables.data(), flight.tables.size()) !=
      Status::kOk) {
    return 0;
  }
  fly_again(fly(flight, data + 2 + blob_size, size - 2 - blob_size));
  return 0;
}
