#include "hal/linux/uri.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "hal/linux/uri_parts.hpp"

namespace leadline::hal {
namespace {

constexpr std::size_t kLongest_bytes = 512;
constexpr std::array<std::pair<std::string_view, UriScheme>, 9> kSchemes = {{
    {"serial", UriScheme::kSerial},
    {"udp", UriScheme::kUdp},
    {"tcp", UriScheme::kTcp},
    {"unix", UriScheme::kUnix},
    {"file", UriScheme::kFile},
    {"can", UriScheme::kCan},
    {"modbus-rtu", UriScheme::kModbusRtu},
    {"modbus-tcp", UriScheme::kModbusTcp},
    {"gpio", UriScheme::kGpio},
}};
/// Rates that termios has a constant for, from the slowest that anything here makes sense at.
constexpr std::array<std::uint32_t, 22> kBauds = {
    1200,      1800,      2400,      4800,      9600,      19'200,   38'400,    57'600,
    115'200,   230'400,   460'800,   500'000,   576'000,   921'600,  1'000'000, 1'152'000,
    1'500'000, 2'000'000, 2'500'000, 3'000'000, 3'500'000, 4'000'000};

std::string baud_list() {
  std::string list;
  for (const std::uint32_t baud : kBauds) {
    list += (list.empty() ? "" : " ") + std::to_string(baud);
  }
  return list;
}

}  // namespace

UriResult parse_serial(std::string_view text, std::string_view rest) {
  UriResult result;
  result.spec.scheme = UriScheme::kSerial;
  const std::size_t colon = rest.rfind(':');
  if (colon != std::string_view::npos && all_digits(rest.substr(colon + 1))) {
    result.spec.baud = number_of(rest.substr(colon + 1), 0);
    rest = rest.substr(0, colon);
    if (std::find(kBauds.begin(), kBauds.end(), result.spec.baud) == kBauds.end()) {
      return refuse_uri(text, "the rate has to be one of " + baud_list());
    }
  }
  if (rest.empty()) {
    return refuse_uri(text, "needs a device: serial:/dev/ttyUSB0:115200");
  }
  result.spec.path = rest;
  return result;
}

UriResult parse_socket(std::string_view text, std::string_view rest, UriScheme scheme) {
  const std::string name = scheme == UriScheme::kUdp ? "udp:" : "tcp:";
  const std::string forms =
      name + "HOST:PORT to send, " + name + "@:PORT or " + name + "@HOST:PORT to listen";
  UriResult result;
  result.spec.scheme = scheme;
  result.spec.listen = !rest.empty() && rest.front() == '@';
  rest.remove_prefix(result.spec.listen ? 1 : 0);
  const std::size_t colon = rest.rfind(':');
  if (colon == std::string_view::npos) {
    return refuse_uri(text, "needs a port: " + forms);
  }
  constexpr std::uint32_t kNone = 65'536;
  const std::uint32_t port = number_of(rest.substr(colon + 1), kNone);
  if (port >= kNone || (port == 0 && !result.spec.listen)) {
    return refuse_uri(text, "the port has to be 1 to 65535: " + forms);
  }
  result.spec.port = static_cast<std::uint16_t>(port);
  std::string_view host = rest.substr(0, colon);
  const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
  if (bracketed) {
    host = host.substr(1, host.size() - 2);
  }
  if (!bracketed && host.find_first_of(":[]") != std::string_view::npos) {
    return refuse_uri(text, "an IPv6 address goes into brackets: " + name + "[::1]:9100");
  }
  if (host.find_first_of(" /@[]") != std::string_view::npos) {
    return refuse_uri(text, "\"" + std::string(host) + "\" is not a host: " + forms);
  }
  if (host.empty() && !result.spec.listen) {
    return refuse_uri(text, "needs a host: " + forms);
  }
  result.spec.host = host;
  return result;
}

UriResult parse_uri(std::string_view text) {
  if (text.size() > kLongest_bytes) {
    return refuse_uri(text.substr(0, 40),
                      "longer than " + std::to_string(kLongest_bytes) + " bytes");
  }
  const bool printable = std::all_of(text.begin(), text.end(), [](char c) {
    return static_cast<unsigned char>(c) >= 0x20U && c != 0x7F;
  });
  if (!printable) {
    return refuse_uri("?", "holds control characters");
  }
  const std::size_t colon = text.find(':');
  const std::string_view name = text.substr(0, colon);
  const auto* const scheme = std::find_if(kSchemes.begin(), kSchemes.end(),
                                          [&](const auto& known) { return known.first == name; });
  if (colon == std::string_view::npos || scheme == kSchemes.end()) {
    return refuse_uri(
        text,
        "has to begin with serial:, udp:, tcp:, can:, modbus-rtu:, modbus-tcp:, gpio:, unix: or "
        "file: (serial:/dev/ttyUSB0:115200, udp:192.168.2.2:9090, udp:@:9100, can:can0, "
        "modbus-rtu:/dev/ttyUSB0:19200:8N1@1, modbus-tcp:HOST:502@1, gpio:gpiochip0:17, "
        "file:PATH)");
  }
  const std::string_view rest = text.substr(colon + 1);
  switch (scheme->second) {
    case UriScheme::kSerial:
      return parse_serial(text, rest);
    case UriScheme::kUdp:
    case UriScheme::kTcp:
      return parse_socket(text, rest, scheme->second);
    case UriScheme::kCan:
    case UriScheme::kModbusRtu:
    case UriScheme::kModbusTcp:
    case UriScheme::kGpio:
      return parse_bus(text, rest, scheme->second);
    case UriScheme::kUnix:
    case UriScheme::kFile:
      break;
  }
  if (rest.empty()) {
    return refuse_uri(text, "needs a name: " + std::string(name) + ":PATH");
  }
  UriResult result;
  result.spec.scheme = scheme->second;
  result.spec.path = rest;
  return result;
}

std::string uri_text(const UriSpec& spec) {
  switch (spec.scheme) {
    case UriScheme::kSerial:
      return "serial:" + spec.path + ":" + std::to_string(spec.baud);
    case UriScheme::kUdp:
    case UriScheme::kTcp: {
      const bool brackets = spec.host.find(':') != std::string::npos;
      return std::string(spec.scheme == UriScheme::kUdp ? "udp:" : "tcp:") +
             (spec.listen ? "@" : "") + (brackets ? "[" + spec.host + "]" : spec.host) + ":" +
             std::to_string(spec.port);
    }
    case UriScheme::kCan:
    case UriScheme::kModbusRtu:
    case UriScheme::kModbusTcp:
    case UriScheme::kGpio:
      return bus_text(spec);
    case UriScheme::kUnix:
      return "unix:" + spec.path;
    case UriScheme::kFile:
      break;
  }
  return "file:" + spec.path;
}

}  // namespace leadline::hal
