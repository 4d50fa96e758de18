// Byte ports of Linux: serial, pty, UDP, TCP, file. Made from a URI at start-up; after that nothing here
// allocates, resolves names or blocks.
//
// A port that goes away (unplugged, peer gone, file not there yet) is kClosed and tries again from
// service(): at once, then after 0.1 s, doubling up to 1.6 s. Its counters go on.
//
// Streams (serial, TCP, files) queue what the kernel does not take at once, up to kQueue_bytes; a
// datagram is sent whole or dropped. One read() makes at most two system calls and returns at most what
// the caller has room for: a flood waits in the kernel (where it is dropped and, for UDP, counted), and
// no other port starves.
#pragma once

#include <array>
#include <memory>
#include <string>

#include "hal/linux/uri.hpp"
#include "hal/ports.hpp"

namespace leadline::hal {

class LinuxPort : public BytePort {
 public:
  static constexpr std::size_t kQueue_bytes = 16'384;
  static constexpr base::TimeUs kFirstRetry_us = 100'000;
  static constexpr base::TimeUs kLongestRetry_us = 1'600'000;

  /// Room of write(): what would be taken now without a drop. 0 when closed. Datagram ports: the
  /// largest datagram.
  [[nodiscard]] virtual std::size_t write_room() const = 0;
  /// Bytes queued but not yet taken by the kernel: 0 for datagram ports.
  [[nodiscard]] virtual std::size_t pending_out_bytes() const = 0;
  /// Descriptor that poll() can wait for, -1 when there is none: closed, or a file (always ready).
  [[nodiscard]] virtual int poll_fd() const = 0;
  /// Events to wait for: POLLIN, and POLLOUT while bytes are pending or a connection is under way.
  [[nodiscard]] virtual short poll_events() const = 0;
  /// A file whose end was reached by the last read(). Others: never.
  /// Bytes that have arrived and that read() gives at once, without poll_fd() saying so: the rest of a datagram.
  [[nodiscard]] virtual std::size_t held_bytes() const { return 0; }
  [[nodiscard]] virtual bool at_end() const { return false; }
  /// errno of the last call that failed, 0 when none did.
  [[nodiscard]] virtual int last_errno() const = 0;
  /// Datagrams that the kernel dropped because nobody took them in time (SO_RXQ_OVFL).
  [[nodiscard]] virtual std::uint32_t kernel_drops() const { return 0; }
  /// Whether each read() and write() is one datagram, lost whole or cut where there is no room for it.
  [[nodiscard]] virtual bool datagrams() const { return false; }
  /// Port that a listening socket got; 0 for others.
  [[nodiscard]] virtual std::uint16_t local_port() const { return 0; }
};

/// What a file: is for. Other schemes go both ways.
enum class FileUse : std::uint8_t { kRead, kWrite };

/// Why a path can never be the device that its URI says, or (unless `may_be_missing`) is not there: a sentence
/// that names the URI, to be said when a program starts. Empty: nothing to say, and always so of sockets.
/// A file to be written may be missing, its folder may not.
[[nodiscard]] std::string device_problem(const UriSpec& spec, FileUse use, bool may_be_missing);

/// A port, or why there is none.
struct PortResult {
  std::unique_ptr<LinuxPort> port;
  std::string error;  ///< empty: port is there
};

/// Resolves a host name (this may block) and makes the port; the first service() opens it. A device
/// that is not there is no error: it may come. Errors: a host name without address, an address
/// to listen on that is taken.
[[nodiscard]] PortResult make_port(const UriSpec& spec, FileUse file_use = FileUse::kRead);

}  // namespace leadline::hal
