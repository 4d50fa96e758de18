// A flight's log back into a vehicle, in pieces of any size, one log behind the other, damaged and wrong ones.
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "firmware/pipeline/host_report.hpp"
#include "firmware/pipeline/log_player.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "model/base/crc32c.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::Status;
using leadline::firmware::CycleInput;
using leadline::firmware::CycleOutput;
using leadline::firmware::InputChunk;
using leadline::firmware::kMaxCycleBytes;
using leadline::firmware::kMaxCycleChunks;
using leadline::firmware::LogEvent;
using leadline::firmware::LogFindings;
using leadline::firmware::LogPlayer;
using leadline::firmware::LogRefusal;
using leadline::firmware::TableBlock;
using leadline::firmware::Vehicle;
using leadline::proto::LogEnd;
using leadline::proto::LogWriter;
using leadline::test::RecordedCycle;

using Bytes = std::vector<std::uint8_t>;

Vehicle vehicle;
LogPlayer player;

TableBlock rig_block() {
  return {&leadline::test::rig_table(), sizeof(leadline::model::LocalizationTable)};
}

/// Of one cycle, or of the tables twice.
constexpr std::size_t kLongestRecords_bytes = 1U << 18U;

/// A log under construction, as the vehicle's program writes it.
class Log {
 public:
  explicit Log(const leadline::firmware::VehicleConfig& config) : buffer_(kLongestRecords_bytes) {
    leadline::test::configure_rig(vehicle, config);
    const TableBlock table = rig_block();
    LogWriter writer(buffer_.data(), buffer_.size());
    for (int copy = 0; copy < leadline::firmware::kLogPreambleCopies; ++copy) {
      assert_int_equal(leadline::firmware::log_begin(writer, vehicle.config(), &table, 1, 0, 0),
                       Status::kOk);
    }
    keep(writer);
  }

  void cycle(const CycleInput& input, const CycleOutput& output) {
    LogWriter writer(buffer_.data(), buffer_.size());
    assert_int_equal(leadline::firmware::log_cycle(writer, cycles_, input, output), Status::kOk);
    keep(writer);
    cycles_ += 1;
    t_us_ = input.t_us;
  }

  /// Runs the vehicle itself.
  void run(const CycleInput& input) {
    CycleOutput output{};
    vehicle.cycle(input, output);
    cycle(input, output);
  }

  void close() {
    end = leadline::firmware::log_end_of(vehicle, t_us_);
    LogWriter writer(buffer_.data(), buffer_.size());
    assert_int_equal(writer.end(end), Status::kOk);
    keep(writer);
  }

  Bytes bytes;
  LogEnd end{};

 private:
  void keep(const LogWriter& writer) {
    bytes.insert(bytes.end(), writer.data(), writer.data() + writer.size_bytes());
  }

  Bytes buffer_;
  std::uint32_t cycles_ = 0;
  leadline::base::TimeUs t_us_ = 0;
};

CycleInput input_of(const RecordedCycle& cycle, std::vector<InputChunk>* chunks) {
  chunks->clear();
  for (const auto& chunk : cycle.chunks) {
    chunks->push_back({chunk.t_arrival_us, chunk.bytes.data(),
                       static_cast<std::uint16_t>(chunk.bytes.size()), chunk.port});
  }
  return {cycle.t_us, chunks->data(), chunks->size(), cycle.room_bytes};
}

const Log& flight() {
  static const std::unique_ptr<Log> kLog = [] {
    auto log = std::make_unique<Log>(leadline::test::rig_config());
    leadline::test::RigOptions options;
    options.seconds = 12;
    leadline::test::fly(vehicle, options,
                        [&log](const RecordedCycle& cycle, const CycleOutput& output) {
                          std::vector<InputChunk> chunks;
                          log->cycle(input_of(cycle, &chunks), output);
                        });
    log->close();
    return log;
  }();
  return *kLog;
}

struct Played {
  LogEvent last = LogEvent::kMore;
  std::size_t cycles = 0;
  std::size_t configured = 0;
  LogEnd now{};
};

/// Plays `bytes` in pieces of `piece` bytes.
Played play(const Bytes& bytes, std::size_t piece = 65536) {
  player.begin();
  Played played;
  const auto act = [&played](LogEvent event) {
    played.last = event;
    if (event == LogEvent::kConfigured) {
      played.configured += 1;
      assert_int_equal(vehicle.configure(player.config(), player.tables(), player.table_count()),
                       Status::kOk);
    } else if (event == LogEvent::kCycle) {
      played.cycles += 1;
      CycleOutput output{};
      vehicle.cycle(player.input(), output);
    }
  };
  for (std::size_t at = 0; at < bytes.size() && played.last != LogEvent::kRefused;) {
    const std::size_t size = std::min(piece, bytes.size() - at);
    std::size_t used = 0;
    act(player.feed(bytes.data() + at, size, used));
    assert_true(used <= size);
    at += used;
  }
  act(player.finish());
  if (played.last != LogEvent::kRefused && played.configured > 0) {
    played.now = leadline::firmware::log_end_of(vehicle, player.t_us());
  }
  return played;
}

void expect_flight(const Played& played, const Log& log) {
  assert_true(player.end().has_value());
  assert_true(leadline::firmware::same_results(played.now, *player.end()));
  assert_true(leadline::firmware::same_results(played.now, log.end));
  assert_int_equal(played.now.pings_in, log.end.pings_in);
  assert_int_equal(played.now.downlink_bytes, log.end.downlink_bytes);
  assert_int_equal(played.now.t_us, log.end.t_us);
  assert_int_equal(played.configured, 1);
  assert_true(player.findings().complete());
  assert_false(player.findings().cut);
}

TEST(pieces_of_any_size_play_to_the_same_bits) {
  const Log& log = flight();
  assert_true(log.end.pings_fused > 50);
  assert_true(log.end.downlink_bytes > 1000);
  for (const std::size_t piece :
       {std::size_t{1}, std::size_t{7}, std::size_t{4096}, log.bytes.size()}) {
    expect_flight(play(log.bytes, piece), log);
  }
}

TEST(a_log_that_ends_with_its_first_record_behind_the_tables_is_played) {
  Log none(leadline::test::rig_config());
  none.close();
  for (const std::size_t piece : {std::size_t{1}, none.bytes.size()}) {
    expect_flight(play(none.bytes, piece), none);
  }
  Log one(leadline::test::rig_config());
  one.run({0, nullptr, 0, 0});  // no room for a frame behind the cycle
  assert_int_equal(play(one.bytes).cycles, 1);
}

TEST(one_log_behind_another_leaves_no_trace) {
  const Log& log = flight();
  auto other = leadline::test::rig_config();
  other.model.cell_mm = 1000;
  other.survey_id = 77;
  Log second(other);
  second.run({0, nullptr, 0, 100'000});
  second.run({20'000, nullptr, 0, 100'000});
  second.close();
  expect_flight(play(second.bytes), second);
  expect_flight(play(log.bytes), log);
  // Behind one that broke off in the middle of a record.
  const Bytes cut(log.bytes.begin(), log.bytes.end() - 100'000);
  (void)play(cut);
  assert_true(player.findings().cut);
  expect_flight(play(second.bytes), second);
  expect_flight(play(log.bytes), log);
}

TEST(what_the_vehicle_did_not_take_is_replayed_as_such) {
  // More bytes than a cycle takes, a report of the program behind them, empty chunks, unknown ports.
  Log log(leadline::test::rig_config());
  const Bytes noise(leadline::firmware::kMaxChunk_bytes, 0xA5);
  std::vector<InputChunk> chunks;
  for (int i = 0; i < 20; ++i) {
    chunks.push_back({0, noise.data(), static_cast<std::uint16_t>(noise.size()),
                      static_cast<std::uint8_t>(i % 3)});
  }
  leadline::firmware::HostReport report{};
  report.port_count = 2;
  std::uint8_t report_bytes[256];
  const std::size_t report_size =
      leadline::firmware::encode_host_report(report, report_bytes, sizeof report_bytes);
  chunks.push_back(
      {0, report_bytes, static_cast<std::uint16_t>(report_size), leadline::firmware::kHostPort});
  chunks.push_back({0, noise.data(), 0, 0});
  assert_true(20 * noise.size() > kMaxCycleBytes);
  log.run({0, chunks.data(), chunks.size(), 100'000});
  for (int k = 1; k < 200; ++k) {
    log.run({20'000 * leadline::base::TimeUs{k}, nullptr, 0, 100'000});
  }
  const std::uint64_t over_limit = vehicle.counters().bytes_over_limit;
  assert_int_equal(over_limit, 20 * noise.size() - kMaxCycleBytes);
  log.close();
  expect_flight(play(log.bytes), log);
  assert_int_equal(vehicle.counters().bytes_over_limit, over_limit);
}

TEST(an_edge_behind_more_bytes_than_a_cycle_takes_is_replayed) {
  leadline::firmware::VehicleConfig config = leadline::test::rig_config();
  constexpr std::uint8_t kLinePort = 2;
  config.port_count = 3;
  config.ports[kLinePort].driver = leadline::firmware::Driver::kLine;
  config.ports[kLinePort].variant_plus_1 = static_cast<int>(leadline::hal::LineRole::kLeak) + 1;
  config.ports[kLinePort].mount = leadline::firmware::kNoMount;
  Log log(config);
  const Bytes noise(leadline::firmware::kMaxChunk_bytes, 0xA5);
  std::vector<InputChunk> chunks(
      20, InputChunk{0, noise.data(), static_cast<std::uint16_t>(noise.size()), 0});
  const std::uint8_t wet = leadline::hal::kLineRising;
  chunks.push_back({0, &wet, 1, kLinePort});
  assert_true(20 * noise.size() > kMaxCycleBytes);
  log.run({0, chunks.data(), chunks.size(), 100'000});
  log.run({20'000, nullptr, 0, 100'000});
  assert_true((vehicle.counters().alarms & leadline::proto::kAlarmLeak) != 0);
  log.close();
  expect_flight(play(log.bytes), log);
  assert_true((vehicle.counters().alarms & leadline::proto::kAlarmLeak) != 0);
}

TEST(a_cycle_of_as_many_chunks_as_a_log_takes) {
  Log log(leadline::test::rig_config());
  const std::uint8_t byte = 0x42;
  const std::vector<InputChunk> chunks(kMaxCycleChunks, InputChunk{0, &byte, 1, 0});
  log.run({0, chunks.data(), chunks.size(), 100'000});
  log.close();
  expect_flight(play(log.bytes), log);
  assert_int_equal(vehicle.counters().ports[0].bytes, kMaxCycleChunks);
  // One more is no record of a log, and where cycle records are lost, the cycle is told as broken.
  const std::vector<InputChunk> more(kMaxCycleChunks + 1, InputChunk{0, &byte, 1, 0});
  Bytes room(1U << 20U);
  LogWriter writer(room.data(), room.size());
  const CycleInput input{0, more.data(), more.size(), 0};
  assert_int_equal(leadline::firmware::log_cycle(writer, 0, input, CycleOutput{}),
                   Status::kOutOfRange);
  assert_int_equal(writer.size_bytes(), 0);
}

TEST(chunks_beyond_all_room_break_the_cycle_and_nothing_else) {
  // As after a lost cycle record: the chunks of two cycles before one record.
  Log log(leadline::test::rig_config());
  const std::uint8_t byte = 0x42;
  Bytes room(1U << 20U);
  LogWriter writer(room.data(), room.size());
  for (std::size_t i = 0; i < kMaxCycleChunks + 5; ++i) {
    assert_int_equal(writer.chunk({0, 0, 0, {&byte, 1}}), Status::kOk);
  }
  assert_int_equal(writer.cycle({1, 0, 100'000, 5, 0}), Status::kOk);
  Bytes bytes = log.bytes;
  bytes.insert(bytes.end(), room.begin(),
               room.begin() + static_cast<std::ptrdiff_t>(writer.size_bytes()));
  const Played played = play(bytes);
  assert_int_equal(played.cycles, 1);
  assert_false(player.cycle_whole());
  assert_int_equal(player.findings().broken_cycles, 1);
  assert_int_equal(player.findings().missing_cycles, 1);
  assert_false(player.end().has_value());
}

/// A header frame, changed, before everything else of the flight's log.
LogRefusal refusal_of(const std::function<void(leadline::proto::LogHeader*)>& change) {
  leadline::proto::LogHeader header{};
  {
    leadline::proto::LogReader reader;
    leadline::proto::LogRecord record{};
    std::size_t used = 0;
    const Bytes& bytes = flight().bytes;
    assert_true(reader.next(bytes.data(), bytes.size(), used, record));
    header = leadline::proto::decode_log_header(record.payload, record.payload_bytes).value();
  }
  change(&header);
  Bytes room(65536);
  LogWriter writer(room.data(), room.size());
  assert_int_equal(writer.header(header), Status::kOk);
  Bytes bytes(room.begin(), room.begin() + static_cast<std::ptrdiff_t>(writer.size_bytes()));
  bytes.insert(bytes.end(), flight().bytes.begin(), flight().bytes.end());
  const Played played = play(bytes);
  assert_true((played.last == LogEvent::kRefused) == (player.refusal() != LogRefusal::kNone));
  assert_true(std::strlen(leadline::firmware::log_refusal_text(player.refusal())) > 5);
  return player.refusal();
}

TEST(what_is_wrong_with_a_log_has_a_name) {
  using leadline::proto::LogHeader;
  assert_int_equal(refusal_of([](LogHeader* /*header*/) {}), LogRefusal::kNone);
  assert_int_equal(refusal_of([](LogHeader* header) { header->protocol_major += 1; }),
                   LogRefusal::kVersion);
  assert_int_equal(refusal_of([](LogHeader* header) { header->config.size_bytes = 1U << 20U; }),
                   LogRefusal::kTooLong);
  assert_int_equal(
      refusal_of([](LogHeader* header) { header->tables[0].size_bytes = 0xFFFFFFFFU; }),
      LogRefusal::kTooLong);
  assert_int_equal(refusal_of([](LogHeader* header) { header->table_count = 0; }),
                   LogRefusal::kPiece);
  assert_int_equal(refusal_of([](LogHeader* header) { header->config.size_bytes -= 1; }),
                   LogRefusal::kPiece);
  assert_int_equal(refusal_of([](LogHeader* header) { header->config.crc ^= 1U; }),
                   LogRefusal::kConfigDamaged);
  assert_int_equal(refusal_of([](LogHeader* header) { header->tables[0].crc ^= 1U; }),
                   LogRefusal::kTableDamaged);
  assert_int_equal(player.refused_table(), 0);
}

TEST(no_log_is_refused_and_stays_refused) {
  assert_int_equal(play({}).last, LogEvent::kRefused);
  assert_int_equal(player.refusal(), LogRefusal::kNoHeader);
  const std::string text = "north,east\n1,2\n";
  assert_int_equal(play(Bytes(text.begin(), text.end())).last, LogEvent::kRefused);
  std::size_t used = 0;
  const Bytes& good = flight().bytes;
  assert_int_equal(player.feed(good.data(), good.size(), used), LogEvent::kRefused);
  assert_int_equal(used, good.size());
  expect_flight(play(good), flight());
}

TEST(a_log_of_a_flight_that_never_began) {
  const Log log(leadline::test::rig_config());
  const Played played = play(log.bytes, 100);
  assert_int_equal(played.configured, 1);
  assert_int_equal(played.cycles, 0);
  assert_int_equal(played.now.pings_in, 0);
  assert_true(player.findings().complete());
}

TEST(the_line_of_results) {
  LogEnd end{};
  end.map_hash = 0x0123456789abcdefU;
  end.link_hash = 1;
  end.cells_hash = 0xffffffffffffffffU;
  char line[leadline::firmware::kHashLine_bytes];
  const std::size_t size = leadline::firmware::hash_line(end, line);
  assert_string_equal(line,
                      "map_hash=0x0123456789abcdef link_hash=0x0000000000000001 "
                      "cells_hash=0xffffffffffffffff");
  assert_int_equal(size, std::strlen(line));
  assert_true(size < sizeof line);
  LogEnd other = end;
  assert_string_equal(leadline::firmware::same_as_flight_text(end, &other), "true");
  other.link_hash = 2;
  assert_string_equal(leadline::firmware::same_as_flight_text(end, &other), "false");
  assert_string_equal(leadline::firmware::same_as_flight_text(end, nullptr), "unknown");
}

TEST(findings_in_words) {
  LogFindings findings{};
  leadline::firmware::FindingText texts[leadline::firmware::kMaxFindingTexts];
  assert_int_equal(leadline::firmware::finding_texts(findings, true, texts), 0);
  findings = {1, 2, 3, 4, 5, 6, 7, true};
  assert_false(findings.complete());
  assert_int_equal(leadline::firmware::finding_texts(findings, false, texts), 6);
  assert_int_equal(texts[1].count, 3);
  assert_string_equal(texts[1].text, "cycles are missing");
  assert_int_equal(texts[5].count, 0);
  assert_string_equal(texts[5].text, "the log ends in the middle of a record");
}

}  // namespace
