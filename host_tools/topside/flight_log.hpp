// A vehicle's log as a host reads it: what the flight was configured with, then cycle by cycle what came in
// and what went out. Damage costs records, never the reading: every gap is reported.
#pragma once

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "firmware/pipeline/config.hpp"
#include "proto/log.hpp"

namespace leadline::host {

/// One cycle as recorded.
struct FlightCycle {
  struct Chunk {
    std::uint8_t port;
    base::TimeUs t_arrival_us;
    std::vector<std::uint8_t> bytes;
  };
  std::uint32_t number = 0;
  base::TimeUs t_us = 0;
  std::uint32_t downlink_room_bytes = 0;
  std::vector<Chunk> chunks;
  bool whole = true;  ///< every chunk that the cycle had is here
};

/// What is missing or wrong. Never decremented.
struct FlightLogCounters {
  std::uint64_t bytes = 0;
  std::uint64_t records = 0;
  std::uint64_t damaged_places = 0;   ///< frames that could not be read
  std::uint64_t missing_cycles = 0;   ///< numbers that were passed over
  std::uint64_t broken_cycles = 0;    ///< chunks are missing
  std::uint64_t recorder_gaps = 0;    ///< marked by the recorder itself
  std::uint64_t recorder_lost = 0;    ///< records in them
  std::uint64_t unknown_records = 0;  ///< of a newer minor version
  bool cut = false;                   ///< ends in the middle of a record

  [[nodiscard]] bool complete() const {
    return damaged_places == 0 && missing_cycles == 0 && broken_cycles == 0 && recorder_gaps == 0;
  }
};

class FlightLog {
 public:
  /// Opens the file and reads on to the first cycle. Throws HostError kInput: cannot be read, is no
  /// log, another version, or both copies of header, configuration or a table are damaged (a log
  /// replays from these).
  explicit FlightLog(const std::string& path);

  [[nodiscard]] const proto::LogHeader& header() const { return header_; }
  [[nodiscard]] const firmware::VehicleConfig& config() const { return config_; }
  [[nodiscard]] const std::vector<std::vector<std::uint8_t>>& tables() const { return tables_; }

  /// The next cycle; false at the end.
  [[nodiscard]] bool next(FlightCycle* cycle);
  /// Set once the end record has been read.
  [[nodiscard]] const std::optional<proto::LogEnd>& end() const { return end_; }
  [[nodiscard]] const FlightLogCounters& counters() const { return counters_; }
  [[nodiscard]] std::uint64_t size_bytes() const { return size_bytes_; }

 private:
  [[nodiscard]] bool next_record(proto::LogRecord* record);
  void read_preamble();
  void take_header(const proto::LogRecord& record);
  void take_piece(const proto::LogRecord& record);
  void check_preamble();
  [[nodiscard]] bool take_cycle(const proto::LogRecord& record, FlightCycle* cycle);
  void take_other(const proto::LogRecord& record);

  std::string path_;
  std::ifstream file_;
  std::uint64_t size_bytes_ = 0;
  std::vector<char> buffer_;
  std::size_t begin_ = 0;
  std::size_t filled_ = 0;
  proto::LogReader reader_;
  std::optional<proto::LogRecord> ahead_;  ///< read, not yet used
  proto::LogHeader header_{};
  firmware::VehicleConfig config_{};
  std::vector<std::uint8_t> config_blob_;
  std::vector<std::vector<std::uint8_t>> tables_;
  std::vector<FlightCycle::Chunk> chunks_;
  std::optional<std::uint32_t> last_cycle_;
  std::optional<proto::LogEnd> end_;
  FlightLogCounters counters_;
};

}  // namespace leadline::host
