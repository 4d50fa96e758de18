// `leadline command` and `leadline key`: orders to a vehicle over its link, and the key that they need.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "proto/commands.hpp"

namespace leadline::host {

struct CommandOptions {
  std::string link_uri;
  std::string key_path;
  double timeout_s = 60;
  bool json = false;
  /// What is ordered. Of a slice only plane, rows and columns: where it lies follows from slice_at.
  proto::Command command{};
  std::string name;                                 ///< of the order, for messages
  std::optional<std::array<double, 3>> slice_at_m;  ///< NED of its middle; none: the vehicle
};

/// Sends the command until it is answered, and of a slice asks for what is missing. Returns the exit status: kOk (done),
/// kRefused, kNoAnswer. Throws HostError: kUsage (key, counter, URI), kInput (link), kOutput (counter).
[[nodiscard]] int run_command(const CommandOptions& options);

/// "NAME=VALUE" into a command. Throws HostError kUsage: with all names and their ranges.
void read_setting(const std::string& text, proto::Command* command);
/// One line for each parameter: name, unit and range.
[[nodiscard]] std::string settings_help();

struct KeyOptions {
  std::string path;
  std::uint16_t vehicle = 1;
  std::uint64_t more = 1'000'000;
};

/// A new key file, and what to do with it.
[[nodiscard]] int run_key_new(const KeyOptions& options);
/// The next counter is so much higher: after the file of counters was lost, or where the key is used from elsewhere.
[[nodiscard]] int run_key_advance(const KeyOptions& options);

}  // namespace leadline::host
