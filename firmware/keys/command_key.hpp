// The key of commands (proto/SPEC.md, "Command"): its file, and tags made and checked with it by libsodium.
//
// A key file is text, readable for its owner alone; both ends have a copy of the same:
//   leadline-key 1
//   vehicle 1
//   id 7B712541
//   key 000102030405060708090A0B0C0D0E0F101112131415161718191A1B1C1D1E1F
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "firmware/pipeline/command_gate.hpp"
#include "proto/commands.hpp"

namespace leadline::host {

class CommandKey {
 public:
  static constexpr std::size_t kKey_bytes = 32;

  CommandKey(const std::array<std::uint8_t, kKey_bytes>& bytes, std::uint16_t vehicle);
  /// Overwrites the key.
  ~CommandKey();
  CommandKey(const CommandKey& other) = default;
  CommandKey& operator=(const CommandKey&) = delete;

  /// A new one, from the system's random numbers.
  [[nodiscard]] static CommandKey random(std::uint16_t vehicle);

  [[nodiscard]] std::uint32_t id() const { return id_; }
  [[nodiscard]] std::uint16_t vehicle() const { return vehicle_; }
  [[nodiscard]] const std::array<std::uint8_t, kKey_bytes>& bytes() const { return bytes_; }

  /// Tag of a command's covered bytes.
  void tag(const std::uint8_t* covered, std::size_t covered_bytes,
           std::uint8_t (&out)[proto::kCommandTag_bytes]) const;
  /// Whether it is; in constant time.
  [[nodiscard]] bool right(const std::uint8_t* covered, std::size_t covered_bytes,
                           const std::uint8_t* tag) const;
  void answer_tag(std::uint64_t counter, proto::CommandResult result,
                  std::uint8_t (&out)[proto::kAnswerTag_bytes]) const;
  /// Of this key, and its tag is right; in constant time.
  [[nodiscard]] bool right(const proto::CommandAnswer& answer) const;
  /// For CommandGate::judge; as long as the key lives.
  [[nodiscard]] firmware::CommandAuthenticator authenticator() const;

 private:
  std::array<std::uint8_t, kKey_bytes> bytes_;
  std::uint16_t vehicle_;
  std::uint32_t id_ = 0;
};

/// Reads a key file. Throws HostError kUsage: it is not there, no file, others may read it, or it is no key, with what
/// to do.
[[nodiscard]] CommandKey load_command_key(const std::string& path);
/// Writes a new file, for its owner alone. Throws HostError kOutput: there is one already, or it cannot be written.
void write_command_key(const std::string& path, const CommandKey& key);

}  // namespace leadline::host
