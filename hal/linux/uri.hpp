// One option names every byte port:
//
//   serial:PATH[:BAUD]   a tty or pty, raw, 8N1; default 115200 baud. A pty ignores the rate
//   udp:HOST:PORT        sends to HOST:PORT, takes what comes back from there to the same socket
//   udp:@[HOST]:PORT     listens there (HOST: one of this machine's addresses, default every one),
//                        answers whoever sent last
//   tcp:HOST:PORT        connects, again and again, backed off
//   tcp:@[HOST]:PORT     listens there; one peer, the newest wins (the one before may be long dead)
//   file:PATH            where the caller reads: from the beginning, and on as the file grows; where
//                        it writes: creates the file or adds to its end
//
// Senders connect, receivers listen: `leadline-vehicle --link udp:10.0.0.7:9100`, and on 10.0.0.7
// `leadline receive udp:@:9100`. HOST is a name, an IPv4 address or an IPv6 address in brackets. A PATH
// may hold colons: what stands behind the last one is a rate only when it is all digits.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace leadline::hal {

enum class UriScheme : std::uint8_t { kSerial, kUdp, kTcp, kFile };

struct UriSpec {
  UriScheme scheme = UriScheme::kFile;
  bool listen = false;           ///< kUdp, kTcp: '@'
  std::string path;              ///< kSerial, kFile
  std::uint32_t baud = 115'200;  ///< kSerial: one of the rates termios knows, 1200 .. 4,000,000
  std::string host;        ///< kUdp, kTcp: without brackets; empty (listening only): every address
  std::uint16_t port = 0;  ///< kUdp, kTcp: 1 .. 65535, listening also 0: any free one
};

/// A specification, or what is wrong with the text: a sentence that quotes it and says what is needed.
struct UriResult {
  UriSpec spec;
  std::string error;  ///< empty: spec is good

  [[nodiscard]] bool ok() const { return error.empty(); }
};

/// Pure text: nothing is opened nor resolved. At most 512 bytes, no control characters.
[[nodiscard]] UriResult parse_uri(std::string_view text);
/// The text that parse_uri reads back to the same.
[[nodiscard]] std::string uri_text(const UriSpec& spec);

}  // namespace leadline::hal
