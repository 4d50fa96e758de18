// What fuzz targets promise, and how a broken promise becomes a finding.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

namespace leadline::fuzz {

/// Aborts, which is what the fuzzer looks for, and says `what` if there is something to say.
inline void require(bool condition, const char* what = nullptr) {
  if (condition) {
    return;
  }
  if (what != nullptr) {
    std::fprintf(stderr, "broken promise: %s\n", what);
  }
  std::abort();
}

/// A message that a reader may see: of that file, and nothing in it that a terminal would obey.
inline void require_message(std::string_view message, std::string_view file) {
  require(message.substr(0, file.size()) == file, "messages name the file");
  for (const char c : message) {
    require(c == '\n' || (c >= 0x20 && c < 0x7F), "messages are printable");
  }
}

}  // namespace leadline::fuzz
