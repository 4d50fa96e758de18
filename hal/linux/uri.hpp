// One option names every byte port:
//
//   serial:PATH[:BAUD]   a tty or pty, raw, 8N1; default 115200 baud. A pty ignores the rate
//   udp:HOST:PORT        sends to HOST:PORT, takes what comes back from there to the same socket
//   udp:@[HOST]:PORT     listens there (HOST: one of this machine's addresses, default every one),
//                        answers whoever sent last
//   tcp:HOST:PORT        connects, again and again, backed off
//   tcp:@[HOST]:PORT     listens there; one peer, the newest wins (the one before may be long dead)
//   unix:PATH            connects to a local socket there (leadline receive --share), again and again
//   file:PATH            where the caller reads: from the beginning, and on as the file grows; where
//                        it writes: creates the file or adds to its end
//
//   can:IFACE[:ID/MASK,...]
//                        a CAN interface that is up (`ip link`, `slcand` for serial adapters): frames of
//                        hal/can_frame.hpp. Filters in hex, up to three digits for 11 bits, more for 29
//   modbus-rtu:PATH:BAUD:8N1@ADDR
//                        Modbus master of slave ADDR (1 .. 247) on a serial line; one RTU frame, with its
//                        CRC, per write and per read
//   modbus-tcp:HOST:PORT@ADDR
//                        the same bytes over TCP
//   gpio:CHIP:LINE[:out] edges of a line, 'R' and 'F' at the time that the kernel saw them; with :out a
//                        line that is set by writing the same letters
//
// Senders connect, receivers listen: `leadline-vehicle --link udp:10.0.0.7:9100`, and on 10.0.0.7
// `leadline receive udp:@:9100`. HOST is a name, an IPv4 address or an IPv6 address in brackets. A PATH
// may hold colons: what stands behind the last one is a rate only when it is all digits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace leadline::hal {

enum class UriScheme : std::uint8_t {
  kSerial,
  kUdp,
  kTcp,
  kUnix,
  kFile,
  kCan,
  kModbusRtu,
  kModbusTcp,
  kGpio
};

inline constexpr std::size_t kMaxCanFilters = 32;

/// Takes a frame whose identifier equals `id` where `mask` has ones.
struct CanFilter {
  std::uint32_t id = 0;  ///< bit 31: of 29 bits, otherwise of 11
  std::uint32_t mask = 0;
};

/// Eight data bits.
struct SerialFraming {
  char parity = 'N';  ///< N, E, O
  std::uint8_t stop_bits = 1;
};

struct UriSpec {
  UriScheme scheme = UriScheme::kFile;
  bool listen = false;  ///< kUdp, kTcp: '@'
  std::string path;     ///< kSerial, kModbusRtu, kUnix, kFile; kCan: interface; kGpio: chip
  std::uint32_t baud =
      115'200;  ///< kSerial, kModbusRtu: one of the rates termios knows, 1200 .. 4,000,000
  std::string
      host;  ///< kUdp, kTcp, kModbusTcp: without brackets; empty (listening only): every address
  std::uint16_t port = 0;  ///< kUdp, kTcp, kModbusTcp: 1 .. 65535, listening also 0: any free one
  std::vector<CanFilter> can_filters;  ///< kCan: none: everything
  SerialFraming framing;               ///< kModbusRtu
  std::uint8_t unit = 0;               ///< kModbusRtu, kModbusTcp: 1 .. 247
  std::uint32_t line = 0;              ///< kGpio
  bool output = false;                 ///< kGpio
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
