// Who may talk to the monitor's page. A page of somewhere else, open in the same browser, must not read the map:
// neither by asking this machine directly (Origin) nor under a name of its own that it lets point here (Host:
// DNS rebinding).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace leadline::host {

/// Where the page is served.
struct WebAddress {
  std::string host;  ///< an IP address, without brackets
  std::uint16_t port = 0;
};

/// "127.0.0.1:8080", "[::1]:8080", "localhost:8080" (127.0.0.1), ":8080" (127.0.0.1). Throws HostError kUsage.
[[nodiscard]] WebAddress parse_web_address(const std::string& text);

/// As in a URL: brackets about an IPv6 address.
[[nodiscard]] std::string web_authority(const WebAddress& address);

/// Whether a request with this Host header is for us: an IP address or "localhost", with our port. A name can
/// be made to point at this machine by whoever owns it; an address cannot.
[[nodiscard]] bool host_allowed(std::string_view host, std::uint16_t port);

/// Whether a WebSocket may be opened from a page of this origin: ours, that is http:// and the Host header. No
/// Origin: no browser, and so no page that could be tricked.
[[nodiscard]] bool origin_allowed(std::string_view origin, std::string_view host);

}  // namespace leadline::host
