#include "firmware/keys/small_file.hpp"

#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace leadline::host {
namespace {

constexpr unsigned kOwnerOnly = 0600;

int write_all(int fd, const std::string& text) {
  std::size_t at = 0;
  while (at < text.size()) {
    const ssize_t written = ::write(fd, text.data() + at, text.size() - at);
    if (written < 0 && errno != EINTR) {
      return errno;
    }
    at += written > 0 ? static_cast<std::size_t>(written) : 0;
  }
  return ::fsync(fd) != 0 ? errno : 0;
}

int create(const std::string& path, const std::string& text, int flags) {
  const int fd =
      ::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | flags, kOwnerOnly);
  if (fd < 0) {
    return errno;
  }
  const int problem = write_all(fd, text);
  return ::close(fd) != 0 && problem == 0 ? errno : problem;
}

/// The name is on the disk as well.
int sync_folder(const std::string& path) {
  const std::string parent = std::filesystem::path(path).parent_path().string();
  const int fd = ::open(parent.empty() ? "." : parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) {
    return errno;
  }
  // File systems without it say EINVAL.
  const int problem = ::fsync(fd) != 0 && errno != EINVAL ? errno : 0;
  (void)::close(fd);
  return problem;
}

}  // namespace

SmallFile::SmallFile(const std::string& path) {
  // Not blocking: a pipe in its place has nobody to open it.
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct stat about {};
  if (fd < 0 || ::fstat(fd, &about) != 0) {
    problem_ = errno;
  }
  regular_ = problem_ == 0 && S_ISREG(about.st_mode);
  mode_ = about.st_mode & 07777U;
  std::array<char, kMost_bytes + 1> bytes{};
  std::size_t size = 0;
  while (regular_ && problem_ == 0 && size < bytes.size()) {
    const ssize_t got = ::read(fd, bytes.data() + size, bytes.size() - size);
    if (got < 0 && errno != EINTR) {
      problem_ = errno;
    }
    if (got == 0) {
      break;
    }
    size += got > 0 ? static_cast<std::size_t>(got) : 0;
  }
  if (fd >= 0) {
    (void)::close(fd);
  }
  if (size > kMost_bytes) {
    return;
  }
  const std::string text(bytes.data(), size);
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    lines_.push_back(text.substr(at, end - at));
    at = end == std::string::npos ? text.size() : end + 1;
  }
  explicit_bzero(bytes.data(), bytes.size());
}

int write_new_file(const std::string& path, const std::string& text) {
  const int problem = create(path, text, O_EXCL);
  if (problem != 0 && problem != EEXIST) {
    (void)::unlink(path.c_str());
  }
  return problem != 0 ? problem : sync_folder(path);
}

int replace_file(const std::string& path, const std::string& text) {
  const std::string beside = path + ".new";
  const int problem = create(beside, text, O_TRUNC);
  if (problem != 0) {
    return problem;
  }
  return std::rename(beside.c_str(), path.c_str()) != 0 ? errno : sync_folder(path);
}

bool read_number(const std::string& text, int base, std::uint64_t most, std::uint64_t* value) {
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, *value, base);
  return result.ec == std::errc{} && result.ptr == end && *value <= most;
}

std::string hex_of(std::uint32_t value) {
  std::array<char, 9> digits{};
  std::snprintf(digits.data(), digits.size(), "%08X", value);
  return digits.data();
}

std::string octal_text(unsigned mode) {
  std::array<char, 16> digits{};
  std::snprintf(digits.data(), digits.size(), "%04o", mode);
  return digits.data();
}

}  // namespace leadline::host
