// A vehicle's log as a file that a host reads: firmware/pipeline/log_player with a path, errors that name it, and
// a length.
#pragma once

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/pipeline/config.hpp"
#include "firmware/pipeline/log_player.hpp"
#include "proto/log.hpp"

namespace leadline::host {

/// One cycle as recorded. `input` points into the log's reader: valid until the next cycle is asked for.
struct FlightCycle {
  std::uint32_t number = 0;
  firmware::CycleInput input{};
  bool whole = true;  ///< every chunk that the cycle had is here
};

class FlightLog {
 public:
  /// Opens the file and reads on to the first cycle. Throws HostError kInput: cannot be read, is no
  /// log, another version, or both copies of header, configuration or a table are damaged (a log
  /// replays from these).
  explicit FlightLog(const std::string& path);

  [[nodiscard]] const proto::LogHeader& header() const { return player_->header(); }
  [[nodiscard]] const firmware::VehicleConfig& config() const { return player_->config(); }
  [[nodiscard]] const std::vector<std::vector<std::uint8_t>>& tables() const { return tables_; }

  /// The next cycle; false at the end.
  [[nodiscard]] bool next(FlightCycle* cycle);
  /// Of the newest cycle, the header's before there is one.
  [[nodiscard]] base::TimeUs t_us() const { return player_->t_us(); }
  /// Set once the end record has been read.
  [[nodiscard]] const std::optional<proto::LogEnd>& end() const { return player_->end(); }
  [[nodiscard]] const firmware::LogFindings& findings() const { return player_->findings(); }
  [[nodiscard]] std::uint64_t size_bytes() const { return size_bytes_; }
  [[nodiscard]] std::uint64_t read_bytes() const { return read_bytes_; }

 private:
  /// kMore only at the end of the file.
  [[nodiscard]] firmware::LogEvent next_event();
  [[noreturn]] void refuse() const;

  std::string path_;
  std::ifstream file_;
  std::uint64_t size_bytes_ = 0;
  std::uint64_t read_bytes_ = 0;
  std::vector<char> buffer_;
  std::size_t begin_ = 0;
  std::size_t filled_ = 0;
  std::unique_ptr<firmware::LogPlayer> player_;
  std::vector<std::vector<std::uint8_t>> tables_;
};

}  // namespace leadline::host
