// The topside's end of a link: a port of this machine that feeds a receiver, and asks the vehicle for what is
// missing. For commands that watch a link (receive, monitor); the receiver itself has neither port nor clock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hal/linux/linux_port.hpp"
#include "hal/linux/port_watch.hpp"
#include "host_tools/topside/link_share.hpp"
#include "host_tools/topside/receiver.hpp"

namespace leadline::host {

class LinkReader {
 public:
  /// Opens what `uri` names (hal/linux/uri.hpp). `command` stands in front of messages. Throws HostError:
  /// kUsage (the URI, an address that is taken), kInput (no such device, a file that cannot be read).
  LinkReader(const std::string& uri, const std::string& command);

  /// Lends the link to others of this user from now on (LinkShare), in read_some(). Throws HostError: kOutput; kUsage
  /// for a file.
  void share(const std::string& socket_path);

  /// Feeds bytes that read_bytes() gave; passes on what Receiver::feed throws: the vehicle is told first.
  void feed(Receiver* receiver, const std::uint8_t* data, std::size_t size_bytes);
  /// Feeds what has come, at most so much that a flood lets the caller look at its clock in between.
  /// Returns the bytes. Passes on what Receiver::feed throws: the vehicle is told first which version is spoken here.
  std::size_t read_some(Receiver* receiver, double now_s);
  /// The same for whoever takes bytes.
  std::size_t read_bytes(double now_s,
                         const std::function<void(const std::uint8_t*, std::size_t)>& take);
  /// For work that takes longer than the port's own room lasts, inside of read_some() too: what has come is kept, up to
  /// kMaxHeld_bytes, and is the first that the next read gives. Nothing for a file, which waits.
  void hold(double now_s);
  static constexpr std::size_t kMaxHeld_bytes = 8 * 1024 * 1024;
  /// Sends a whole frame. False: no room now.
  bool send(const std::vector<std::uint8_t>& frame);
  /// Sends what the receiver has to say up (Receiver::uplink), as the port has room for it.
  void ask_again(Receiver* receiver, double now_s);
  /// Waits for bytes, at most so long.
  void wait(int timeout_ms) const;

  /// What became of the port since the last call: "open", "lost: ..."; empty: nothing new, or a listening port,
  /// whose number was said when it opened.
  [[nodiscard]] std::string port_change();
  [[nodiscard]] bool is_file() const { return is_file_; }
  [[nodiscard]] bool at_end() const { return port_->at_end(); }
  /// Port that a listening link got; 0 for others.
  [[nodiscard]] std::uint16_t local_port() const { return port_->local_port(); }

 private:
  std::string uri_;
  bool is_file_ = false;
  std::unique_ptr<hal::LinuxPort> port_;
  hal::PortWatch watch_;
  std::unique_ptr<LinkShare> share_;
  std::vector<std::uint8_t> buffer_;
  std::vector<std::uint8_t> held_;
};

/// "warning: ", "error: ", or nothing.
[[nodiscard]] const char* severity_word(proto::Severity severity);

}  // namespace leadline::host
