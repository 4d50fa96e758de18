#include "firmware/config/input_file.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

namespace leadline::host {
namespace {

[[noreturn]] void refuse(const std::string& path, ExitCode code, const std::string& why) {
  throw HostError(code, (path.empty() ? "\"\"" : path) + ": " + why);
}

std::string last_error() { return std::strerror(errno != 0 ? errno : EIO); }

}  // namespace

std::ifstream open_input(const std::string& path, ExitCode code) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    errno = EISDIR;  // opens, and fails at the first read only
  } else if (file) {
    return file;
  }
  refuse(path, code, "cannot be read: " + last_error());
}

std::string read_input(const std::string& path, ExitCode code) {
  std::ifstream file = open_input(path, code);
  std::string text;
  std::array<char, 65536> buffer{};
  errno = 0;
  // read() tells of a bad disk by badbit; iterators of the stream would throw past the caller.
  while (file.read(buffer.data(), buffer.size()) || file.gcount() > 0) {
    text.append(buffer.data(), static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) {
    refuse(path, code, "cannot be read to its end: " + last_error());
  }
  return text;
}

}  // namespace leadline::host
