// A recorded log as the input of a Vehicle again: bytes of the log in, in pieces of any size; configuration,
// tables and cycles out, in their order. The one reader behind `leadline replay`, `leadline-replay` and the
// replay image of the microcontroller. See proto/SPEC.md, "Log".
//
//   while (size > 0) {
//     const LogEvent event = player.feed(data, size, used);
//     data += used; size -= used;
//     if (event == LogEvent::kConfigured) status = vehicle.configure(player.config(), player.tables(), ...);
//     if (event == LogEvent::kCycle) vehicle.cycle(player.input(), output);
//     if (event == LogEvent::kRefused) ...
//   }
//   event = player.finish();  // may still be kConfigured or kRefused
//   now = log_end_of(vehicle, player.t_us());
//
// Damage costs records, never the reading: what is missing is counted. A large object (player capacity
// below): define it at namespace scope or on a host's heap, never on a stack. Not thread-safe: one owner.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "firmware/pipeline/config.hpp"
#include "firmware/pipeline/config_codec.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "model/base/status.hpp"
#include "model/base/units.hpp"
#include "model/capacity.hpp"
#include "model/localization_table.hpp"
#include "proto/log.hpp"

namespace leadline::firmware {

enum class LogEvent : std::uint8_t {
  kMore = 0,        ///< all bytes were taken; nothing to be done before more come
  kConfigured = 1,  ///< header, configuration and tables are whole: configure the vehicle
  kCycle = 2,       ///< input() is the next cycle's
  kRefused = 3,     ///< this log cannot be replayed, refusal() says why; so until begin()
};

/// Why a log cannot be replayed.
enum class LogRefusal : std::uint8_t {
  kNone = 0,
  kNoHeader = 1,  ///< no log of a vehicle, or both headers are damaged
  kVersion = 2,   ///< format or protocol of another version
  kHeader = 3,    ///< header wrong in itself; status() says more
  kTooLong = 4,   ///< configuration or tables longer than any that a vehicle of this build takes
  kPiece = 5,     ///< a piece of configuration or table lies outside of it
  kConfigDamaged = 6,  ///< neither copy whole
  kConfigBad = 7,      ///< whole, but decode_config() refuses it; status() says more
  kTableDamaged = 8,   ///< neither copy of table refused_table() whole
};
/// English, to go behind the name of the log ("its header is wrong"). Never null.
[[nodiscard]] const char* log_refusal_text(LogRefusal refusal);

/// What is missing or wrong. Never decremented but by begin().
struct LogFindings {
  std::uint64_t records;          ///< read
  std::uint64_t damaged_places;   ///< frames that could not be read
  std::uint64_t missing_cycles;   ///< numbers that were passed over
  std::uint64_t broken_cycles;    ///< chunks are missing
  std::uint64_t recorder_gaps;    ///< marked by the recorder itself
  std::uint64_t recorder_lost;    ///< records in them
  std::uint64_t unknown_records;  ///< of a newer minor version
  bool cut;                       ///< ends in the middle of a record (known after finish())

  /// Nothing that a cycle would need is missing.
  [[nodiscard]] bool complete() const {
    return damaged_places == 0 && missing_cycles == 0 && broken_cycles == 0 && recorder_gaps == 0;
  }
};

/// A finding in words: `count` of them ("3 cycles are missing"), or the text alone where count is 0.
struct FindingText {
  std::uint64_t count;
  const char* text;
};
inline constexpr std::size_t kMaxFindingTexts = 6;
/// All there is to say; returns how many. `has_end`: the log has an end record.
std::size_t finding_texts(const LogFindings& findings, bool has_end,
                          FindingText (&out)[kMaxFindingTexts]);

class LogPlayer {
 public:
  LogPlayer() { begin(); }

  /// Forgets everything: the next byte is the first of another log.
  void begin();

  /// Takes bytes until something is to be done or they are used up; `consumed_bytes` tells how many.
  /// What the accessors return is valid until the next call. O(bytes).
  [[nodiscard]] LogEvent feed(const std::uint8_t* data, std::size_t size_bytes,
                              std::size_t& consumed_bytes);
  /// No more bytes come. kConfigured for a log that ends behind its tables, kCycle for one that ends with its first
  /// record behind them, kRefused, or kMore.
  [[nodiscard]] LogEvent finish();

  // From kConfigured on.
  [[nodiscard]] const proto::LogHeader& header() const { return header_; }
  [[nodiscard]] const VehicleConfig& config() const { return config_; }
  [[nodiscard]] const TableBlock* tables() const { return tables_.data(); }
  [[nodiscard]] std::size_t table_count() const { return header_.table_count; }

  // At kCycle.
  [[nodiscard]] const CycleInput& input() const { return input_; }
  [[nodiscard]] std::uint32_t cycle_number() const { return cycle_number_; }
  /// Every chunk that the cycle had is here.
  [[nodiscard]] bool cycle_whole() const { return cycle_whole_; }

  /// Of the newest cycle, the header's before there is one.
  [[nodiscard]] base::TimeUs t_us() const { return t_us_; }
  /// Set once the end record has been read.
  [[nodiscard]] const std::optional<proto::LogEnd>& end() const { return end_; }
  [[nodiscard]] const LogFindings& findings() const { return findings_; }

  [[nodiscard]] LogRefusal refusal() const { return refusal_; }
  [[nodiscard]] base::Status refusal_status() const { return refusal_status_; }
  [[nodiscard]] std::size_t refused_table() const { return refused_table_; }

 private:
  /// Bytes of all tables together, each begun at a multiple of 8.
  static constexpr std::size_t kTables_bytes =
      model::kMaxSensors * ((sizeof(model::LocalizationTable) + 7) / 8 * 8);
  /// What a vehicle takes in one cycle, and a report of its program besides.
  static constexpr std::size_t kChunks_bytes = kMaxCycleBytes + kMaxChunk_bytes;

  [[nodiscard]] LogEvent refuse(LogRefusal refusal, base::Status status, std::size_t table = 0);
  [[nodiscard]] LogEvent take(const proto::LogRecord& record);
  [[nodiscard]] LogEvent take_preamble(const proto::LogRecord& record);
  [[nodiscard]] LogEvent take_header(const proto::LogRecord& record);
  [[nodiscard]] LogEvent take_piece(const proto::LogRecord& record);
  [[nodiscard]] LogEvent check_preamble();
  [[nodiscard]] LogEvent take_flight(const proto::LogRecord& record);
  void take_chunk(const proto::LogChunk& chunk);
  void take_cycle(const proto::LogCycle& cycle);
  void clear_chunks();

  proto::LogReader reader_;
  LogFindings findings_{};
  LogRefusal refusal_ = LogRefusal::kNone;
  base::Status refusal_status_ = base::Status::kOk;
  std::size_t refused_table_ = 0;

  bool has_header_ = false;
  bool configured_ = false;
  proto::LogRecord ahead_{};  ///< the first behind the tables, read while they were checked
  bool has_ahead_ = false;
  proto::LogHeader header_{};
  VehicleConfig config_{};
  std::array<std::uint8_t, kMaxConfigBlob_bytes> config_blob_{};
  std::array<TableBlock, proto::kMaxLogTables> tables_{};
  std::array<std::size_t, proto::kMaxLogTables> table_offset_bytes_{};
  alignas(8) std::array<std::uint8_t, kTables_bytes> table_bytes_{};

  std::array<InputChunk, kMaxCycleChunks> chunks_{};
  std::size_t chunk_count_ = 0;
  std::size_t chunks_dropped_ = 0;
  std::array<std::uint8_t, kChunks_bytes> chunk_bytes_{};
  std::size_t filled_bytes_ = 0;
  std::size_t device_bytes_ = 0;  ///< of these, those that count against kMaxCycleBytes
  bool cycle_given_ = false;      ///< input_ was returned: its chunks are done with

  CycleInput input_{};
  std::uint32_t cycle_number_ = 0;
  bool cycle_whole_ = false;
  bool any_cycle_ = false;
  base::TimeUs t_us_ = 0;
  std::optional<proto::LogEnd> end_;
};

/// Map, link bytes and link cells are the same.
[[nodiscard]] bool same_results(const proto::LogEnd& a, const proto::LogEnd& b);

/// Length of hash_line() with its final zero.
inline constexpr std::size_t kHashLine_bytes = 96;
/// "map_hash=0x... link_hash=0x... cells_hash=0x..." and a zero: what every program that replays prints.
/// Returns the length.
std::size_t hash_line(const proto::LogEnd& end, char (&out)[kHashLine_bytes]);
/// What stands behind it as same_as_flight: "true" or "false", or "unknown" where the log has no end
/// record (`then` null).
[[nodiscard]] const char* same_as_flight_text(const proto::LogEnd& now, const proto::LogEnd* then);

}  // namespace leadline::firmware
