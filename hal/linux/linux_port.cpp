#include "hal/linux/linux_port.hpp"

#include <cerrno>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>

#include "hal/linux/bus_ports.hpp"
#include "hal/linux/serial_port.hpp"
#include "hal/linux/socket_ports.hpp"
#include "hal/linux/stream_port.hpp"

namespace leadline::hal {
namespace {

/// A file (or FIFO) in one direction.
class FilePort final : public StreamPort {
 public:
  FilePort(std::string path, FileUse use) : path_(std::move(path)), use_(use) {}

  std::size_t read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                   base::TimeUs& t_arrival_us) override {
    if (use_ == FileUse::kWrite) {
      return 0;
    }
    at_end_ = false;
    return StreamPort::read(now_us, out, capacity, t_arrival_us);
  }
  std::size_t write(const std::uint8_t* data, std::size_t size) override {
    if (use_ == FileUse::kRead) {
      return 0;  // there is nobody to answer
    }
    return StreamPort::write(data, size);
  }
  [[nodiscard]] std::size_t write_room() const override {
    return use_ == FileUse::kRead ? 0 : StreamPort::write_room();
  }
  /// poll() calls a regular file ready at any time: waiting for it would be a busy loop.
  [[nodiscard]] int poll_fd() const override { return regular_ ? -1 : StreamPort::poll_fd(); }
  [[nodiscard]] bool at_end() const override { return at_end_; }

 private:
  OpenResult open_now() override {
    const int flags = use_ == FileUse::kRead ? O_RDONLY : O_WRONLY | O_CREAT | O_APPEND;
    const int fd = ::open(path_.c_str(), flags | O_NONBLOCK | O_CLOEXEC, 0644);
    if (fd < 0) {
      return OpenResult::kFailed;
    }
    adopt(fd);
    struct stat info {};
    if (::fstat(fd, &info) != 0) {
      return OpenResult::kFailed;
    }
    if (S_ISDIR(info.st_mode)) {
      errno = EISDIR;
      return OpenResult::kFailed;
    }
    regular_ = S_ISREG(info.st_mode);
    at_end_ = false;
    return OpenResult::kOpen;
  }
  bool end_is_loss() override {
    at_end_ = true;
    return false;
  }
  /// A full disk: the bytes stay queued, what does not fit is dropped and counted.
  [[nodiscard]] bool error_is_loss() const override { return false; }

  std::string path_;
  FileUse use_;
  bool regular_ = true;
  bool at_end_ = false;
};

std::string parent_of(const std::string& path) {
  const std::size_t slash = path.find_last_of('/');
  return slash == std::string::npos ? "." : path.substr(0, slash + 1);
}

PortResult refuse(const std::string& why) { return {nullptr, why}; }

PortResult make_socket_port(const UriSpec& spec) {
  SocketAddress address;
  if (const std::string error = resolve(spec, &address); !error.empty()) {
    return refuse(error);
  }
  if (spec.scheme == UriScheme::kTcp && !spec.listen) {
    return {std::make_unique<TcpClientPort>(address), ""};
  }
  if (spec.scheme == UriScheme::kUdp && !spec.listen) {
    return {std::make_unique<UdpPort>(address, false), ""};
  }
  // An address to listen on that is taken stays taken: an error now, not a retry for ever.
  int number = 0;
  PortResult result;
  if (spec.scheme == UriScheme::kTcp) {
    auto port = std::make_unique<TcpServerPort>(address);
    number = port->listen_now();
    result.port = std::move(port);
  } else {
    result.port = std::make_unique<UdpPort>(address, true);
    result.port->service(0);
    number = result.port->state() == PortState::kOpen ? 0 : result.port->last_errno();
  }
  if (number != 0) {
    return refuse("\"" + uri_text(spec) + "\": cannot listen: " + std::strerror(number));
  }
  return result;
}

}  // namespace

std::string device_problem(const UriSpec& spec, FileUse use, bool may_be_missing) {
  const bool serial = spec.scheme == UriScheme::kSerial;
  if (!serial && spec.scheme != UriScheme::kFile) {
    return "";
  }
  const std::string quoted = "\"" + uri_text(spec) + "\": ";
  struct stat info {};
  if (::stat(spec.path.c_str(), &info) != 0) {
    const bool missing = errno == ENOENT || errno == ENOTDIR;
    std::string why = quoted + std::strerror(errno);
    if (!missing) {
      return why;
    }
    if (!serial && use == FileUse::kWrite) {
      const std::string folder = parent_of(spec.path);
      const bool there = ::stat(folder.c_str(), &info) == 0 && S_ISDIR(info.st_mode);
      return there ? "" : quoted + "there is no folder " + folder;
    }
    return may_be_missing ? "" : why;
  }
  if (S_ISDIR(info.st_mode)) {
    return quoted + "is a folder";
  }
  return serial && !S_ISCHR(info.st_mode) ? quoted + "is no serial device" : "";
}

PortResult make_port(const UriSpec& spec, FileUse file_use) {
  PortResult result;
  switch (spec.scheme) {
    case UriScheme::kSerial:
      result.port = std::make_unique<SerialPort>(spec);
      break;
    case UriScheme::kFile:
      result.port = std::make_unique<FilePort>(spec.path, file_use);
      break;
    case UriScheme::kUdp:
    case UriScheme::kTcp:
      result = make_socket_port(spec);
      break;
    case UriScheme::kUnix:
      result.port = std::make_unique<LocalPort>(spec.path);
      break;
    case UriScheme::kCan:
    case UriScheme::kModbusRtu:
    case UriScheme::kModbusTcp:
    case UriScheme::kGpio:
      result = make_bus_port(spec);
      break;
  }
  return result;
}

}  // namespace leadline::hal
