#include "hal/linux/local_socket.hpp"

#include <cerrno>
#include <cstring>

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

namespace leadline::hal {
namespace {

constexpr int kFlags = SOCK_NONBLOCK | SOCK_CLOEXEC;
constexpr mode_t kOwnerOnly = 0600;
constexpr int kBacklog = 4;

bool socket_name(const std::string& path, sockaddr_un* name) {
  if (path.empty() || path.size() >= sizeof name->sun_path) {
    errno = ENAMETOOLONG;
    return false;
  }
  name->sun_family = AF_UNIX;
  std::memcpy(name->sun_path, path.c_str(), path.size() + 1);
  return true;
}

const sockaddr* generic(const sockaddr_un* name) {
  return reinterpret_cast<const sockaddr*>(name);  // how the sockets API wants it
}

int open_socket() { return ::socket(AF_UNIX, SOCK_STREAM | kFlags, 0); }

/// A socket that nobody listens at: what a program left that was killed. errno stays.
bool is_stale_socket(const std::string& path, const sockaddr_un& name) {
  const int number = errno;
  struct stat info {};
  bool stale = false;
  const int probe = open_socket();
  if (probe >= 0 && ::lstat(path.c_str(), &info) == 0 && S_ISSOCK(info.st_mode)) {
    stale = ::connect(probe, generic(&name), sizeof name) != 0 && errno == ECONNREFUSED;
  }
  if (probe >= 0) {
    ::close(probe);
  }
  errno = number;
  return stale;
}

}  // namespace

int connect_local(const std::string& path) {
  sockaddr_un name{};
  if (!socket_name(path, &name)) {
    return -1;
  }
  const int fd = open_socket();
  if (fd >= 0 && ::connect(fd, generic(&name), sizeof name) != 0) {
    const int number = errno;
    ::close(fd);
    errno = number;
    return -1;
  }
  return fd;
}

std::string local_socket_error(int number) {
  return number == ENAMETOOLONG ? "the name of a local socket has 1 to " +
                                      std::to_string(sizeof(sockaddr_un::sun_path) - 1) + " bytes"
                                : std::strerror(number);
}

LocalListener::~LocalListener() {
  if (fd_ < 0) {
    return;
  }
  ::close(fd_);
  // Only what listen() made: somebody may have put something else there since.
  struct stat info {};
  const bool ours = ::lstat(path_.c_str(), &info) == 0 && S_ISSOCK(info.st_mode) &&
                    info.st_dev == device_ && info.st_ino == inode_;
  if (ours) {
    (void)::unlink(path_.c_str());  // one that stays is stale: the next listen() replaces it
  }
}

std::string LocalListener::listen(const std::string& path) {
  sockaddr_un name{};
  const auto failed = [&path](int fd) {
    std::string why = "\"" + path + "\": cannot listen: " + local_socket_error(errno);
    if (fd >= 0) {
      ::close(fd);
    }
    return why;
  };
  if (!socket_name(path, &name)) {
    return failed(-1);
  }
  const int fd = open_socket();
  // Before bind(): the file is never there with other rights.
  if (fd < 0 || ::fchmod(fd, kOwnerOnly) != 0) {
    return failed(fd);
  }
  bool bound = ::bind(fd, generic(&name), sizeof name) == 0;
  if (!bound && errno == EADDRINUSE && is_stale_socket(path, name)) {
    bound = ::unlink(path.c_str()) == 0 && ::bind(fd, generic(&name), sizeof name) == 0;
  }
  struct stat info {};
  if (!bound || ::listen(fd, kBacklog) != 0 || ::lstat(path.c_str(), &info) != 0) {
    return failed(fd);
  }
  device_ = info.st_dev;
  inode_ = info.st_ino;
  fd_ = fd;
  path_ = path;
  return "";
}

int LocalListener::accept() const { return ::accept4(fd_, nullptr, nullptr, kFlags); }

}  // namespace leadline::hal
