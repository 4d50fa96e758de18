#include "host_tools/monitor/web_access.hpp"

#include <algorithm>
#include <charconv>
#include <optional>

#include <arpa/inet.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

struct HostPort {
  std::string host;
  std::optional<std::uint16_t> port;
};

/// "host", "host:port", "[v6]:port"; nothing when it is none of these.
std::optional<HostPort> split(std::string_view text) {
  HostPort parts;
  std::string_view port;
  if (!text.empty() && text.front() == '[') {
    const std::size_t end = text.find(']');
    if (end == std::string_view::npos) {
      return std::nullopt;
    }
    parts.host = text.substr(1, end - 1);
    port = text.substr(end + 1);
  } else {
    const std::size_t colon = text.find(':');
    parts.host = text.substr(0, colon);
    port = colon == std::string_view::npos ? "" : text.substr(colon);
  }
  if (port.empty()) {
    return parts;
  }
  std::uint16_t number = 0;
  const char* const end = port.data() + port.size();
  const auto result = std::from_chars(port.data() + 1, end, number);
  if (port.front() != ':' || result.ec != std::errc() || result.ptr != end) {
    return std::nullopt;
  }
  parts.port = number;
  return parts;
}

bool is_v4(const std::string& host) {
  in_addr address{};
  return inet_pton(AF_INET, host.c_str(), &address) == 1;
}

bool is_v6(const std::string& host) {
  in6_addr address{};
  return inet_pton(AF_INET6, host.c_str(), &address) == 1;
}

bool is_localhost(std::string_view host) {
  constexpr std::string_view kName = "localhost";
  return host.size() == kName.size() && std::equal(host.begin(), host.end(), kName.begin(),
                                                   [](char a, char b) { return (a | 0x20) == b; });
}

}  // namespace

WebAddress parse_web_address(const std::string& text) {
  const std::optional<HostPort> parts = split(text);
  const bool good = parts && parts->port &&
                    (parts->host.empty() || is_localhost(parts->host) || is_v4(parts->host) ||
                     is_v6(parts->host));
  if (!good) {
    throw HostError(ExitCode::kUsage, "monitor: --http: \"" + printable(text) +
                                          "\" is no ADDRESS:PORT such as 127.0.0.1:8080 or "
                                          "[::1]:8080 (port 0: any free one)");
  }
  const bool local = parts->host.empty() || is_localhost(parts->host);
  return {local ? "127.0.0.1" : parts->host, *parts->port};
}

std::string web_authority(const WebAddress& address) {
  const std::string host = is_v6(address.host) ? "[" + address.host + "]" : address.host;
  return host + ":" + std::to_string(address.port);
}

bool host_allowed(std::string_view host, std::uint16_t port) {
  const std::optional<HostPort> parts = split(host);
  return parts && parts->port.value_or(80) == port &&
         (is_localhost(parts->host) || is_v4(parts->host) || is_v6(parts->host));
}

bool origin_allowed(std::string_view origin, std::string_view host) {
  constexpr std::string_view kScheme = "http://";
  return origin.empty() ||
         (origin.substr(0, kScheme.size()) == kScheme && origin.substr(kScheme.size()) == host);
}

}  // namespace leadline::host
