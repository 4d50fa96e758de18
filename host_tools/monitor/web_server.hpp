// Serves the page and its WebSocket, from the caller's own loop: one thread, nothing blocks.
//
// A viewer costs a cursor and one message under way (64 KiB at most), however slow he is: what he has not taken
// is in the map, and the next message is made when the one before has left. HTTP and WebSocket are Boost.Beast's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include "host_tools/monitor/page_messages.hpp"
#include "host_tools/monitor/web_access.hpp"

namespace leadline::host {

/// Never decremented.
struct WebCounters {
  std::uint64_t requests = 0;
  std::uint64_t refused_hosts =
      0;  ///< Host header of somebody else: DNS rebinding, or a wrong name
  std::uint64_t refused_origins = 0;  ///< WebSocket of a page of somewhere else
  std::uint64_t refused_viewers = 0;  ///< too many
  std::uint64_t bad_messages = 0;     ///< of pages: their connection ends
  std::uint64_t messages = 0;         ///< sent
  std::uint64_t message_bytes = 0;
};

class WebServer {
 public:
  static constexpr std::size_t kMaxViewers = 16;
  /// Connections of all kinds; more wait in the kernel.
  static constexpr std::size_t kMaxConnections = 64;

  /// What the server asks of its owner, from within run_for().
  struct Handlers {
    std::function<PageContent()> content;
    std::function<void(const PageRequest&)> request;
  };

  /// Listens. Throws HostError kUsage: the address is not of this machine, or taken.
  WebServer(const WebAddress& address, Handlers handlers);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  /// The port that is listened at, where 0 was asked for.
  [[nodiscard]] std::uint16_t port() const;
  /// Works for so long; 0: what can be done at once.
  void run_for(int milliseconds);
  /// There may be something new: viewers who wait get it with the next run_for().
  void wake();
  [[nodiscard]] std::size_t viewers() const;
  [[nodiscard]] const WebCounters& counters() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace leadline::host
