#include "host_tools/output_dir.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host_tools/exit_codes.hpp"

namespace leadline::host {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBuffer_bytes = std::size_t{1} << 18U;
constexpr const char* kStagingPrefix = ".leadline-staging-";

[[noreturn]] void fail(const std::string& what, int error_number) {
  throw HostError(ExitCode::kOutput, what + ": " + std::strerror(error_number));
}

/// Flushes a file or directory that is not open. File systems without fsync (EINVAL) are let pass.
void sync_path(const std::string& path, int flags) {
  const int fd = ::open(path.c_str(), flags | O_CLOEXEC);
  if (fd < 0) {
    fail("cannot flush " + path, errno);
  }
  const int result = ::fsync(fd);
  const int error_number = errno;
  ::close(fd);
  if (result != 0 && error_number != EINVAL && error_number != EROFS) {
    fail("cannot flush " + path, error_number);
  }
}

/// Removes what runs that were killed left behind: nobody holds their lock any more.
void remove_stale_staging(const std::string& directory) {
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(kStagingPrefix, 0) != 0 || !entry.is_directory(ignored)) {
      continue;
    }
    const int fd = ::open(entry.path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) {
      continue;
    }
    if (::flock(fd, LOCK_EX | LOCK_NB) == 0) {
      fs::remove_all(entry.path(), ignored);
    }
    ::close(fd);
  }
}

}  // namespace

OutputFile::OutputFile(const std::string& path, const std::string& shown_name)
    : shown_name_(shown_name.empty() ? path : shown_name),
      fd_(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)) {
  if (fd_ < 0) {
    fail("cannot write " + shown_name_, errno);
  }
  buffer_.reserve(kBuffer_bytes);
}

OutputFile::OutputFile(int fd, const std::string& shown_name) : shown_name_(shown_name), fd_(fd) {
  if (fd_ < 0) {
    fail("cannot write " + shown_name_, EBADF);
  }
  buffer_.reserve(kBuffer_bytes);
}

OutputFile::~OutputFile() {
  if (fd_ >= 0) {
    ::close(fd_);
  }
}

void OutputFile::write(std::string_view bytes) {
  while (!bytes.empty()) {
    const std::size_t count = std::min(bytes.size(), kBuffer_bytes - buffer_.size());
    buffer_.append(bytes.substr(0, count));
    bytes.remove_prefix(count);
    if (buffer_.size() == kBuffer_bytes) {
      flush();
    }
  }
}

void OutputFile::flush() {
  std::string_view rest = buffer_;
  while (!rest.empty()) {
    const ssize_t count = ::write(fd_, rest.data(), rest.size());
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count < 0) {
      fail("cannot write " + shown_name_, errno);
    }
    rest.remove_prefix(static_cast<std::size_t>(count));
  }
  buffer_.clear();
}

void OutputFile::close() {
  flush();
  // A device or pipe has nothing to flush (EINVAL); everything else has to reach the disk.
  if (::fsync(fd_) != 0 && errno != EINVAL && errno != EROFS) {
    fail("cannot write " + shown_name_, errno);
  }
  const int fd = fd_;
  fd_ = -1;
  if (::close(fd) != 0) {
    fail("cannot write " + shown_name_, errno);
  }
}

void write_file_whole(const std::string& path, std::string_view bytes) {
  if (path == "-") {
    OutputFile file(::dup(STDOUT_FILENO), "<standard output>");
    file.write(bytes);
    file.close();
    return;
  }
  std::error_code ignored;
  const fs::path real = fs::canonical(path, ignored);
  const std::string target = real.empty() ? path : real.string();
  const fs::file_status status = fs::status(target, ignored);
  if (fs::is_directory(status)) {
    fail("cannot write " + path, EISDIR);
  }
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    OutputFile file(target, path);
    file.write(bytes);
    file.close();
    return;
  }
  const std::string temporary = target + ".leadline-" + std::to_string(::getpid());
  try {
    OutputFile file(temporary, path);
    file.write(bytes);
    file.close();
    if (::rename(temporary.c_str(), target.c_str()) != 0) {
      fail("cannot write " + path, errno);
    }
  } catch (const HostError&) {
    ::unlink(temporary.c_str());
    throw;
  }
}

OutputDir::OutputDir(const std::string& path) : path_(path.empty() ? "." : path), lock_fd_(-1) {
  std::error_code error;
  fs::create_directories(path_, error);
  if (error && !fs::is_directory(path_)) {
    fail("cannot create the directory " + path_, error.value());
  }
  if (!fs::is_directory(path_, error)) {
    fail("cannot write into " + path_, ENOTDIR);
  }
  remove_stale_staging(path_);
  std::string name = (fs::path(path_) / (std::string(kStagingPrefix) + "XXXXXX")).string();
  if (::mkdtemp(name.data()) == nullptr) {
    fail("cannot write into " + path_, errno);
  }
  staging_path_ = name;
  lock_fd_ = ::open(name.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (lock_fd_ >= 0) {
    // Where locks do not work no other run can take it either, so nothing is removed there.
    (void)::flock(lock_fd_, LOCK_EX | LOCK_NB);
  }
}

OutputDir::~OutputDir() { discard(); }

void OutputDir::discard() {
  if (!staging_path_.empty()) {
    std::error_code ignored;
    fs::remove_all(staging_path_, ignored);
    staging_path_.clear();
  }
  if (lock_fd_ >= 0) {
    ::close(lock_fd_);
    lock_fd_ = -1;
  }
}

std::string OutputDir::stage(const std::string& name) {
  const std::string final_path = (fs::path(path_) / name).string();
  std::error_code ignored;
  if (fs::is_directory(final_path, ignored)) {
    fail("cannot write " + final_path, EISDIR);
  }
  if (std::find(names_.begin(), names_.end(), name) == names_.end()) {
    names_.push_back(name);
  }
  return (fs::path(staging_path_) / name).string();
}

void OutputDir::write(const std::string& name, std::string_view bytes) {
  const std::string staged = stage(name);
  OutputFile file(staged, (fs::path(path_) / name).string());
  file.write(bytes);
  file.close();
}

void OutputDir::commit() {
  for (const std::string& name : names_) {
    sync_path((fs::path(staging_path_) / name).string(), O_RDONLY);
  }
  for (const std::string& name : names_) {
    const std::string final_path = (fs::path(path_) / name).string();
    if (::rename((fs::path(staging_path_) / name).c_str(), final_path.c_str()) != 0) {
      fail("cannot write " + final_path, errno);
    }
  }
  names_.clear();
  discard();
  sync_path(path_, O_RDONLY | O_DIRECTORY);
}

}  // namespace leadline::host
