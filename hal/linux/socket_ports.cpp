#include "hal/linux/socket_ports.hpp"

#include <array>
#include <cerrno>
#include <cstring>

#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <unistd.h>

#include "hal/linux/local_socket.hpp"

namespace leadline::hal {
namespace {

constexpr int kFlags = SOCK_NONBLOCK | SOCK_CLOEXEC;
constexpr int kSilence_ms = 10'000;  ///< unacknowledged for that long: the peer is gone
constexpr int kReceiveBuffer_bytes = 1 << 20;

void set_option(int fd, int level, int name, int value) {
  // Only tuning: a kernel that does not know an option serves all the same.
  (void)::setsockopt(fd, level, name, &value, sizeof value);
}

void tune_tcp(int fd) {
  set_option(fd, IPPROTO_TCP, TCP_NODELAY, 1);
  set_option(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
  set_option(fd, IPPROTO_TCP, TCP_KEEPIDLE, 5);
  set_option(fd, IPPROTO_TCP, TCP_KEEPINTVL, 2);
  set_option(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, kSilence_ms);
}

std::uint16_t port_of(int fd) {
  SocketAddress address;
  address.size = sizeof address.storage;
  if (fd < 0 || ::getsockname(fd, address.get(), &address.size) != 0) {
    return 0;
  }
  if (address.storage.ss_family == AF_INET6) {
    sockaddr_in6 v6{};
    std::memcpy(&v6, &address.storage, sizeof v6);
    return ntohs(v6.sin6_port);
  }
  sockaddr_in v4{};
  std::memcpy(&v4, &address.storage, sizeof v4);
  return ntohs(v4.sin_port);
}

bool would_block(int number) { return number == EAGAIN || number == EINTR; }

}  // namespace

std::string resolve(const UriSpec& spec, SocketAddress* address) {
  addrinfo hints{};
  hints.ai_socktype = spec.scheme == UriScheme::kUdp ? SOCK_DGRAM : SOCK_STREAM;
  // Listening everywhere means everywhere that IPv4 reaches: what the vehicle's networks speak.
  hints.ai_family = spec.host.empty() ? AF_INET : AF_UNSPEC;
  hints.ai_flags = AI_NUMERICSERV | (spec.listen ? AI_PASSIVE : 0);
  addrinfo* found = nullptr;
  const int result = ::getaddrinfo(spec.host.empty() ? nullptr : spec.host.c_str(),
                                   std::to_string(spec.port).c_str(), &hints, &found);
  if (result != 0) {
    return "\"" + uri_text(spec) + "\": no address for host \"" + spec.host +
           "\": " + ::gai_strerror(result);
  }
  std::memcpy(&address->storage, found->ai_addr, found->ai_addrlen);
  address->size = found->ai_addrlen;
  ::freeaddrinfo(found);
  return "";
}

// ---- UDP ----------------------------------------------------------------------------------------

UdpPort::UdpPort(const SocketAddress& address, bool listen)
    : address_(address), listen_(listen), has_peer_(!listen), held_(kLargest_bytes) {}

void UdpPort::note_error(int number) {
  errno_ = number;
  counters_.errors += 1;
}

bool UdpPort::open_now() {
  fd_ = ::socket(address_.storage.ss_family, SOCK_DGRAM | kFlags, 0);
  if (fd_ < 0) {
    return false;
  }
  set_option(fd_, SOL_SOCKET, SO_RXQ_OVFL, 1);
  set_option(fd_, SOL_SOCKET, SO_RCVBUF, kReceiveBuffer_bytes);
  const int result = listen_ ? ::bind(fd_, address_.get(), address_.size)
                             : ::connect(fd_, address_.get(), address_.size);
  if (result != 0) {
    const int number = errno;
    ::close(fd_);
    fd_ = -1;
    errno = number;
    return false;
  }
  counters_.opens += 1;
  backoff_.succeeded();
  return true;
}

void UdpPort::service(base::TimeUs now_us) {
  if (fd_ < 0 && backoff_.due(now_us) && !open_now()) {
    errno_ = errno;
    backoff_.failed(now_us);
  }
}

long UdpPort::receive() {
  SocketAddress from;
  iovec piece{held_.data(), held_.size()};
  alignas(cmsghdr) std::array<std::uint8_t, 64> control{};
  msghdr message{};
  message.msg_name = &from.storage;
  message.msg_namelen = sizeof from.storage;
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t size = ::recvmsg(fd_, &message, MSG_TRUNC);
  if (size < 0) {
    return size;
  }
  for (cmsghdr* part = CMSG_FIRSTHDR(&message); part != nullptr;
       part = CMSG_NXTHDR(&message, part)) {
    if (part->cmsg_level == SOL_SOCKET && part->cmsg_type == SO_RXQ_OVFL) {
      std::memcpy(&kernel_drops_, CMSG_DATA(part), sizeof kernel_drops_);
    }
  }
  if (listen_) {
    peer_ = from;
    peer_.size = message.msg_namelen;
    has_peer_ = true;
  }
  return size;
}

std::size_t UdpPort::take_held(std::uint8_t* out, std::size_t capacity) {
  const std::size_t taken = held_bytes() < capacity ? held_bytes() : capacity;
  std::memcpy(out, held_.data() + held_begin_, taken);
  held_begin_ += taken;
  counters_.bytes_in += taken;
  return taken;
}

// A datagram may be larger than what its reader has room for in one go (an image of 34 KB, and a cycle's share): the
// rest comes with the next reads.
std::size_t UdpPort::read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                          base::TimeUs& t_arrival_us) {
  if (fd_ < 0 || capacity == 0) {
    return 0;
  }
  // Twice: an empty datagram and a report of a refusal are nothing, and hide what is behind them.
  for (int attempt = 0; attempt < 2 && held_bytes() == 0; ++attempt) {
    const long size = receive();
    if (size > 0) {
      const auto whole = static_cast<std::size_t>(size);
      held_begin_ = 0;
      held_end_ = whole < held_.size() ? whole : held_.size();
      counters_.bytes_dropped_in += whole - held_end_;
    } else if (size < 0 && would_block(errno)) {
      return 0;
    } else if (size < 0) {
      note_error(errno);
    }
  }
  if (held_bytes() == 0) {
    return 0;
  }
  t_arrival_us = now_us;
  return take_held(out, capacity);
}

std::size_t UdpPort::write_room() const { return fd_ >= 0 && has_peer_ ? kLargest_bytes : 0; }

std::size_t UdpPort::write(const std::uint8_t* data, std::size_t size) {
  if (fd_ >= 0 && has_peer_) {
    ssize_t sent = -1;
    // A refusal that an earlier datagram met is reported on this one, which was not even tried.
    for (int attempt = 0; attempt < 2 && sent < 0; ++attempt) {
      sent = listen_ ? ::sendto(fd_, data, size, MSG_NOSIGNAL, peer_.get(), peer_.size)
                     : ::send(fd_, data, size, MSG_NOSIGNAL);
      if (sent < 0 && !would_block(errno)) {
        note_error(errno);
      }
    }
    if (sent >= 0) {
      counters_.bytes_out += static_cast<std::uint64_t>(sent);
      return static_cast<std::size_t>(sent);
    }
  }
  counters_.bytes_dropped_out += size;
  return 0;
}

std::uint16_t UdpPort::local_port() const { return port_of(fd_); }

// ---- TCP ----------------------------------------------------------------------------------------

StreamPort::OpenResult TcpClientPort::open_now() {
  const int fd = ::socket(address_.storage.ss_family, SOCK_STREAM | kFlags, 0);
  if (fd < 0) {
    return OpenResult::kFailed;
  }
  adopt(fd);
  tune_tcp(fd);
  started_us_ = now_us_;
  if (::connect(fd, address_.get(), address_.size) == 0) {
    return OpenResult::kOpen;
  }
  return errno == EINPROGRESS ? OpenResult::kPending : OpenResult::kFailed;
}

StreamPort::OpenResult TcpClientPort::check_pending(base::TimeUs now_us) {
  pollfd wait{fd_, POLLOUT, 0};
  if (::poll(&wait, 1, 0) <= 0) {
    errno = ETIMEDOUT;
    return now_us - started_us_ > kConnect_us ? OpenResult::kFailed : OpenResult::kPending;
  }
  int number = 0;
  socklen_t size = sizeof number;
  (void)::getsockopt(fd_, SOL_SOCKET, SO_ERROR, &number, &size);
  errno = number;
  return number == 0 ? OpenResult::kOpen : OpenResult::kFailed;
}

long TcpClientPort::write_some(const std::uint8_t* data, std::size_t size) {
  return ::send(fd_, data, size, MSG_NOSIGNAL);
}

StreamPort::OpenResult LocalPort::open_now() {
  const int fd = connect_local(path_);
  adopt(fd);
  return fd >= 0 ? OpenResult::kOpen : OpenResult::kFailed;
}

long LocalPort::write_some(const std::uint8_t* data, std::size_t size) {
  return ::send(fd_, data, size, MSG_NOSIGNAL);
}

TcpServerPort::~TcpServerPort() {
  if (listen_fd_ >= 0) {
    ::close(listen_fd_);
  }
}

int TcpServerPort::listen_now() {
  listen_fd_ = ::socket(address_.storage.ss_family, SOCK_STREAM | kFlags, 0);
  if (listen_fd_ < 0) {
    return errno;
  }
  set_option(listen_fd_, SOL_SOCKET, SO_REUSEADDR, 1);
  if (::bind(listen_fd_, address_.get(), address_.size) != 0 || ::listen(listen_fd_, 4) != 0) {
    return errno;
  }
  return 0;
}

void TcpServerPort::service(base::TimeUs now_us) {
  now_us_ = now_us;
  const int fd = ::accept4(listen_fd_, nullptr, nullptr, kFlags);
  if (fd >= 0) {
    tune_tcp(fd);
    if (state_ == PortState::kOpen) {
      lose();
    }
    adopt(fd);
    mark_open();
  }
  if (state_ == PortState::kOpen) {
    StreamPort::service(now_us);
  }
}

StreamPort::OpenResult TcpServerPort::open_now() {
  errno = ENOTCONN;  // service() accepts
  return OpenResult::kFailed;
}

long TcpServerPort::write_some(const std::uint8_t* data, std::size_t size) {
  return ::send(fd_, data, size, MSG_NOSIGNAL);
}

short TcpServerPort::poll_events() const {
  return fd_ >= 0 ? StreamPort::poll_events() : static_cast<short>(POLLIN);
}

std::uint16_t TcpServerPort::local_port() const { return port_of(listen_fd_); }

}  // namespace leadline::hal
