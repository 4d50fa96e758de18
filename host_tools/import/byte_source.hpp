// A file, or standard input, read forwards with a look ahead.
#pragma once

#include <cstddef>
#include <cstdint>
#include <istream>
#include <memory>
#include <string>
#include <vector>

namespace leadline::host {

class ByteSource {
 public:
  /// "-" is standard input. Throws HostError kInput where it cannot be opened.
  explicit ByteSource(const std::string& path);
  /// From memory, for tests and fuzzing.
  ByteSource(const std::uint8_t* data, std::size_t size);

  /// Of a file; empty for standard input and memory.
  [[nodiscard]] const std::string& path() const { return path_; }

  /// Makes `size` bytes available if there are as many; returns how many there are, at most `size`.
  /// They stay valid until the next call. Throws HostError kInput on a read error.
  std::size_t peek(std::size_t size);
  /// The bytes that peek() found.
  [[nodiscard]] const std::uint8_t* data() const { return buffer_.data() + begin_; }
  /// Passes over bytes that peek() found; `size` at most as many.
  void skip(std::size_t size);
  /// One line without its end (LF or CR LF), at most `max_bytes` of it, the rest passed over. False at the
  /// end.
  bool line(std::string* text, std::size_t max_bytes);

 private:
  std::string path_;
  std::string name_;
  std::unique_ptr<std::istream> owned_;
  std::istream* stream_ = nullptr;
  std::vector<std::uint8_t> buffer_;
  std::size_t begin_ = 0;
};

}  // namespace leadline::host
