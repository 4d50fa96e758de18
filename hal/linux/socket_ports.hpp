// UDP, TCP and local sockets as byte ports. Inside of hal/linux; users take linux_port.hpp.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <netinet/in.h>
#include <sys/socket.h>

#include "hal/linux/datagram_port.hpp"
#include "hal/linux/stream_port.hpp"

namespace leadline::hal {

/// A resolved address: nothing is looked up after start-up.
struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t size = 0;

  [[nodiscard]] const sockaddr* get() const {
    return reinterpret_cast<const sockaddr*>(&storage);  // how the sockets API wants it
  }
  [[nodiscard]] sockaddr* get() { return reinterpret_cast<sockaddr*>(&storage); }
};

/// First address of the specification. Returns "" or what is wrong. May block (names).
[[nodiscard]] std::string resolve(const UriSpec& spec, SocketAddress* address);

/// Datagrams: to one peer, or bound and answering whoever sent last. Refusals (nobody listens there
/// yet) are counted as errors, and the port stays open.
class UdpPort final : public DatagramPort {
 public:
  UdpPort(const SocketAddress& address, bool listen);

  std::size_t read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                   base::TimeUs& t_arrival_us) override;
  std::size_t write(const std::uint8_t* data, std::size_t size) override;
  void service(base::TimeUs now_us) override;
  [[nodiscard]] std::size_t write_room() const override;
  [[nodiscard]] std::size_t held_bytes() const override { return held_end_ - held_begin_; }
  [[nodiscard]] std::uint16_t local_port() const override;

 private:
  static constexpr std::size_t kLargest_bytes = 65'507;

  [[nodiscard]] bool open_now();
  void note_error(int number);
  [[nodiscard]] long receive();
  [[nodiscard]] std::size_t take_held(std::uint8_t* out, std::size_t capacity);

  SocketAddress address_;
  bool listen_;
  bool has_peer_;
  SocketAddress peer_;
  std::vector<std::uint8_t> held_;  ///< the newest datagram, of which [begin, end) is not read yet
  std::size_t held_begin_ = 0;
  std::size_t held_end_ = 0;
};

/// One connection, made by this side.
class TcpClientPort final : public StreamPort {
 public:
  explicit TcpClientPort(const SocketAddress& address) : address_(address) {}

 private:
  static constexpr base::TimeUs kConnect_us = 5'000'000;

  OpenResult open_now() override;
  OpenResult check_pending(base::TimeUs now_us) override;
  long write_some(const std::uint8_t* data, std::size_t size) override;

  SocketAddress address_;
  base::TimeUs started_us_ = 0;
};

/// One connection to a local socket, made by this side.
class LocalPort final : public StreamPort {
 public:
  explicit LocalPort(std::string path) : path_(std::move(path)) {}

 private:
  OpenResult open_now() override;
  long write_some(const std::uint8_t* data, std::size_t size) override;

  std::string path_;
};

/// One connection, made by the other side; the newest wins.
class TcpServerPort final : public StreamPort {
 public:
  explicit TcpServerPort(const SocketAddress& address) : address_(address) {}
  ~TcpServerPort() override;

  /// Errno of what keeps it from listening, 0 when it does.
  [[nodiscard]] int listen_now();
  void service(base::TimeUs now_us) override;
  [[nodiscard]] int poll_fd() const override { return fd_ >= 0 ? fd_ : listen_fd_; }
  [[nodiscard]] short poll_events() const override;
  [[nodiscard]] std::uint16_t local_port() const override;

 private:
  OpenResult open_now() override;
  long write_some(const std::uint8_t* data, std::size_t size) override;

  SocketAddress address_;
  int listen_fd_ = -1;
};

}  // namespace leadline::hal
