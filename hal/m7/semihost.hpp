// The debugger's (here QEMU's) files and console, by ARM semihosting: for images that replay and test, never
// in one that flies. Source: ARM semihosting specification 2.0.
#pragma once

#include <cstddef>
#include <cstdint>

namespace leadline::hal::m7 {

enum class OpenMode : std::uint32_t { kReadBytes = 1, kWriteBytes = 5 };

/// A file of the host. Every call takes as long as the host likes.
class HostFile {
 public:
  /// False: it cannot be opened. ":tt" is the console.
  [[nodiscard]] bool open(const char* path, OpenMode mode);
  /// Bytes read, 0 at the end or on an error.
  std::size_t read(std::uint8_t* out, std::size_t capacity);
  /// False: not all were written.
  bool write(const void* data, std::size_t size_bytes);
  void close();

 private:
  std::int32_t handle_ = -1;
};

/// Writes to the console. `text` ends with a zero.
void say(const char* text);
/// What the program was called with (`-semihosting-config arg=...`), words with blanks between them; zero
/// terminated. False: it does not fit.
[[nodiscard]] bool command_line(char* out, std::size_t capacity);
/// Ends the machine with this status.
[[noreturn]] void exit(std::uint32_t status);

}  // namespace leadline::hal::m7
