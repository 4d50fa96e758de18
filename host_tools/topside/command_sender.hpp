// One command on its way to a vehicle: its frame, when it is to be sent again, and its answer. Neither port nor clock:
// times are given. And the rows of a slice as they come.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "firmware/keys/command_key.hpp"
#include "model/base/units.hpp"
#include "proto/commands.hpp"

namespace leadline::host {

class CommandSender {
 public:
  /// `counter` was never used with the key; `command` is in range (std::invalid_argument).
  CommandSender(const CommandKey& key, const proto::Command& command, std::uint64_t counter);

  /// The frame, the same each time; byte for byte.
  [[nodiscard]] const std::vector<std::uint8_t>& frame() const { return frame_; }
  /// To be sent now: at once, then again after 1 s, and half as long again each time, up to 5 s, until it is answered.
  [[nodiscard]] bool due(base::TimeUs now_us) const { return !result_ && now_us >= due_us_; }
  void note_sent(base::TimeUs now_us);
  /// A payload of the downlink: the answer if it is one to this command, and authentic.
  void take(const std::uint8_t* payload, std::size_t size_bytes);

  [[nodiscard]] std::optional<proto::CommandResult> result() const { return result_; }
  [[nodiscard]] std::uint64_t counter() const { return counter_; }
  [[nodiscard]] int times_sent() const { return times_sent_; }
  /// Answers that named this command and were not the vehicle's.
  [[nodiscard]] int forged_answers() const { return forged_; }

 private:
  const CommandKey& key_;
  std::uint64_t counter_;
  std::vector<std::uint8_t> frame_;
  base::TimeUs due_us_ = INT64_MIN;
  base::TimeUs gap_us_ = 1'000'000;
  int times_sent_ = 0;
  int forged_ = 0;
  std::optional<proto::CommandResult> result_;
};

/// Of an answer, in words.
[[nodiscard]] const char* command_result_text(proto::CommandResult result);
/// The same, for programs.
[[nodiscard]] const char* command_result_name(proto::CommandResult result);

class SliceCollector {
 public:
  explicit SliceCollector(const proto::SliceBox& box);

  /// A payload of the downlink. True: rows that were missing came.
  bool take(const std::uint8_t* payload, std::size_t size_bytes);
  [[nodiscard]] bool complete() const;
  /// From the first row that is missing to the last.
  [[nodiscard]] proto::SliceBox missing() const;
  /// Row by row; rows that are missing are 0.
  [[nodiscard]] const std::vector<std::uint8_t>& levels() const { return levels_; }
  [[nodiscard]] const proto::SliceBox& box() const { return box_; }

 private:
  proto::SliceBox box_;
  std::vector<bool> has_row_;
  std::vector<std::uint8_t> levels_;
};

}  // namespace leadline::host
