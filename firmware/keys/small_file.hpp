// Small files that have to be whole after any cut of power: read at once, written to a file beside and renamed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace leadline::host {

/// A file of at most kMost_bytes, read when made; longer ones are read as empty.
class SmallFile {
 public:
  static constexpr std::size_t kMost_bytes = 4096;

  explicit SmallFile(const std::string& path);

  /// errno of what went wrong, 0: nothing.
  [[nodiscard]] int problem() const { return problem_; }
  [[nodiscard]] bool regular() const { return regular_; }
  /// Permission bits.
  [[nodiscard]] unsigned mode() const { return mode_; }
  /// Without their ends; nothing behind the last one's end.
  [[nodiscard]] const std::vector<std::string>& lines() const { return lines_; }

 private:
  int problem_ = 0;
  bool regular_ = false;
  unsigned mode_ = 0;
  std::vector<std::string> lines_;
};

/// Creates the file for its owner alone, on the disk when it returns. errno, 0: done. EEXIST: it is there, untouched.
[[nodiscard]] int write_new_file(const std::string& path, const std::string& text);
/// The file is the old one or the new one, whatever happens; the new one, on the disk, when this returns 0. Else errno.
[[nodiscard]] int replace_file(const std::string& path, const std::string& text);

/// Digits of `base` (10 or 16) and nothing else, at most `most`.
[[nodiscard]] bool read_number(const std::string& text, int base, std::uint64_t most,
                               std::uint64_t* value);
/// Eight digits.
[[nodiscard]] std::string hex_of(std::uint32_t value);
[[nodiscard]] std::string octal_text(unsigned mode);

}  // namespace leadline::host
