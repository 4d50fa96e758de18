// A small log of a vehicle, harmed at every byte: what the reader still knows of the flight.
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "firmware/pipeline/session_log.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/topside/flight_log.hpp"
#include "proto/framing.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::Status;
using leadline::firmware::CycleInput;
using leadline::firmware::CycleOutput;
using leadline::firmware::InputChunk;
using leadline::firmware::TableBlock;
using leadline::host::FlightCycle;
using leadline::host::FlightLog;
using leadline::host::HostError;
using leadline::proto::LogWriter;

constexpr std::uint32_t kCycles = 4;

/// Three chunks a cycle, a downlink frame each, and a table that nobody flies with.
std::string small_log() {
  const std::vector<std::uint8_t> table_bytes(300, 0x5A);
  const TableBlock table = {table_bytes.data(), table_bytes.size()};
  std::vector<std::uint8_t> buffer(100'000);
  LogWriter writer(buffer.data(), buffer.size());
  const auto config = leadline::test::rig_config();
  for (int copy = 0; copy < leadline::firmware::kLogPreambleCopies; ++copy) {
    assert_int_equal(leadline::firmware::log_begin(writer, config, &table, 1, 0, 0), Status::kOk);
  }
  for (std::uint32_t cycle = 0; cycle < kCycles; ++cycle) {
    const leadline::base::TimeUs t_us = 20'000 * leadline::base::TimeUs{cycle};
    const std::vector<std::uint8_t> bytes(20 + cycle, 0x00);
    const InputChunk chunk = {t_us, bytes.data(), static_cast<std::uint16_t>(bytes.size()), 0};
    const InputChunk chunks[] = {chunk, chunk, chunk};
    std::uint8_t frame[64];
    const std::size_t frame_bytes =
        leadline::proto::encode_frame(bytes.data(), bytes.size(), frame, sizeof frame).value();
    CycleOutput output{};
    output.downlink = {frame, frame_bytes};
    const CycleInput input{t_us, chunks, 3, 1000};
    assert_int_equal(leadline::firmware::log_cycle(writer, cycle, input, output), Status::kOk);
  }
  leadline::proto::LogEnd end{};
  end.cycle_count = kCycles;
  assert_int_equal(writer.end(end), Status::kOk);
  return {reinterpret_cast<const char*>(writer.data()), writer.size_bytes()};
}

struct Read {
  std::vector<std::uint8_t> table;
  std::uint64_t survey_id = 0;
  std::vector<std::uint32_t> whole_cycles;
  bool has_end = false;
  leadline::firmware::LogFindings counters{};
};

/// Null when it was refused.
std::unique_ptr<Read> read(const std::string& bytes) {
  static const std::string kPath = leadline::test::scratch_directory() + "/flight.lll";
  std::ofstream(kPath, std::ios::binary | std::ios::trunc) << bytes;
  try {
    FlightLog log(kPath);
    auto out = std::make_unique<Read>();
    out->table = log.tables().at(0);
    out->survey_id = log.config().survey_id;
    FlightCycle cycle;
    while (log.next(&cycle)) {
      if (cycle.whole) {
        out->whole_cycles.push_back(cycle.number);
      }
    }
    out->has_end = log.end().has_value();
    out->counters = log.findings();
    return out;
  } catch (const HostError&) {
    return nullptr;
  }
}

TEST(any_one_byte_costs_one_record_at_most) {
  const std::string log = small_log();
  const auto good = read(log);
  assert_non_null(good.get());
  assert_int_equal(good->whole_cycles.size(), kCycles);
  assert_true(good->has_end && good->counters.complete());
  for (std::size_t at = 0; at < log.size(); ++at) {
    for (const int value : {static_cast<int>(static_cast<unsigned char>(log[at])) ^ 0x10, 0}) {
      std::string damaged = log;
      damaged[at] = static_cast<char>(value);
      const auto harmed = read(damaged);
      assert_non_null(harmed.get());
      assert_true(harmed->table == good->table);
      assert_true(harmed->survey_id == good->survey_id);
      // One record: a chunk or a cycle costs its cycle, of which the next may hold chunks; or the end.
      const std::size_t lost = kCycles - harmed->whole_cycles.size();
      assert_true(lost <= 2 && lost + (harmed->has_end ? 0 : 1) <= 2);
      assert_true(harmed->counters.records + 1 >= good->counters.records);
    }
  }
}

TEST(a_cut_at_any_byte_costs_the_last_record_at_most) {
  const std::string log = small_log();
  const std::size_t second = log.find(log.substr(0, 60), 60);
  assert_true(second != std::string::npos);
  std::size_t cycles = 0;
  std::uint64_t records = 0;
  for (std::size_t size = 0; size <= log.size(); ++size) {
    const auto cut = read(log.substr(0, size));
    // The first copy is enough.
    assert_int_equal(cut != nullptr, size >= second);
    if (cut == nullptr) {
      continue;
    }
    assert_true(cut->whole_cycles.size() >= cycles && cut->counters.records >= records);
    assert_int_equal(cut->counters.missing_cycles + cut->counters.broken_cycles, 0);
    cycles = cut->whole_cycles.size();
    records = cut->counters.records;
  }
  assert_int_equal(cycles, kCycles);
}

}  // namespace
