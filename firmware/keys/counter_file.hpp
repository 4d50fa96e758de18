// Counters of commands where a power cut does not reach them: of the last one that a vehicle took, or that a sender
// used. A file belongs to one key:
//   leadline-counter 1
//   key 7B712541
//   counter 12
//   tag 00112233445566778899AABBCCDDEEFF      of a vehicle; a sender's is 0
#pragma once

#include <cstdint>
#include <string>

#include "firmware/pipeline/command_gate.hpp"

namespace leadline::host {

class CounterFile {
 public:
  CounterFile(std::string path, std::uint32_t key_id) : path_(std::move(path)), key_id_(key_id) {}

  /// What it says; counter 0 where there is no file. Throws HostError kUsage: it cannot be read, is damaged, or of another
  /// key.
  [[nodiscard]] firmware::CommandMark load() const;
  /// On the disk when it returns 0; else errno, and what was there stays.
  [[nodiscard]] int save(const firmware::CommandMark& mark) const;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
  std::uint32_t key_id_;
};

/// The next counter of a sender, on the disk before it is used; `more` above the last one. Two programs with one key file
/// never get the same. Throws HostError kUsage (as load(), and when the counters are used up: make a new key), kOutput.
[[nodiscard]] std::uint64_t take_counter(const std::string& key_path, std::uint32_t key_id,
                                         std::uint64_t more = 1);

}  // namespace leadline::host
