#include "hal/linux/pty_pair.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include "hal/linux/serial_port.hpp"
#include "hal/linux/stream_port.hpp"

namespace leadline::hal {

/// The master's descriptor comes and goes with plug() and unplug(), never by itself.
class PtyPair::MasterPort final : public StreamPort {
 public:
  void plug(int fd) {
    adopt(fd);
    mark_open();
  }
  void unplug() { lose(); }

 private:
  OpenResult open_now() override {
    errno = ENODEV;
    return OpenResult::kFailed;
  }
};

PtyPair::PtyPair(std::string link_path)
    : link_path_(std::move(link_path)), port_(std::make_unique<MasterPort>()) {
  (void)plug();
}

PtyPair::~PtyPair() { unplug(); }

std::string PtyPair::path() const {
  return device_.empty() || link_path_.empty() ? device_ : link_path_;
}

LinuxPort& PtyPair::port() { return *port_; }

void PtyPair::unplug() {
  if (device_.empty()) {
    return;
  }
  if (!link_path_.empty()) {
    // Ours only: another emulator, or somebody's file, may stand there by now.
    std::error_code ignored;
    if (std::filesystem::read_symlink(link_path_, ignored) == device_) {
      std::filesystem::remove(link_path_, ignored);
    }
  }
  device_.clear();
  port_->unplug();
  ::close(slave_fd_);
  slave_fd_ = -1;
}

bool PtyPair::plug() {
  if (!device_.empty()) {
    return true;
  }
  const auto failed = [&](const std::string& what, int number) {
    error_ = what + ": " + std::strerror(number);
    return false;
  };
  const int master = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (master < 0) {
    return failed("cannot make a pty", errno);
  }
  std::array<char, 64> name{};
  int slave = -1;
  if (::grantpt(master) != 0 || ::unlockpt(master) != 0 ||
      ::ptsname_r(master, name.data(), name.size()) != 0 ||
      (slave = ::open(name.data(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) < 0 ||
      !make_raw(slave, 115'200)) {
    const int number = errno;
    ::close(master);
    if (slave >= 0) {
      ::close(slave);
    }
    return failed("cannot open the other end of a pty", number);
  }
  if (!link_path_.empty()) {
    std::error_code problem;
    // Only a link to a pty gives way: a mistyped name must not cost anything else.
    const std::string old = std::filesystem::read_symlink(link_path_, problem).string();
    if (old.rfind("/dev/pts/", 0) == 0) {
      std::filesystem::remove(link_path_, problem);
    }
    std::filesystem::create_symlink(name.data(), link_path_, problem);
    if (problem) {
      ::close(master);
      ::close(slave);
      return failed("cannot make the link " + link_path_, problem.value());
    }
  }
  slave_fd_ = slave;
  device_ = name.data();
  error_.clear();
  port_->plug(master);
  return true;
}

}  // namespace leadline::hal
