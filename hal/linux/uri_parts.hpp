// Pieces of URIs' text. Inside of hal/linux.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>

#include "hal/linux/uri.hpp"

namespace leadline::hal {

inline bool all_digits(std::string_view text) {
  return !text.empty() &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// A number of at most nine digits, or `otherwise`.
inline std::uint32_t number_of(std::string_view text, std::uint32_t otherwise) {
  if (!all_digits(text) || text.size() > 9) {
    return otherwise;
  }
  std::uint32_t value = 0;
  for (const char c : text) {
    value = value * 10 + static_cast<std::uint32_t>(c - '0');
  }
  return value;
}

inline UriResult refuse_uri(std::string_view text, const std::string& why) {
  UriResult result;
  result.error = "\"" + std::string(text) + "\": " + why;
  return result;
}

/// serial:, and tcp: or udp:, behind their colon; `text` is the whole for error messages.
[[nodiscard]] UriResult parse_serial(std::string_view text, std::string_view rest);
[[nodiscard]] UriResult parse_socket(std::string_view text, std::string_view rest,
                                     UriScheme scheme);

/// can:, modbus-rtu:, modbus-tcp:, gpio: behind their colon.
[[nodiscard]] UriResult parse_bus(std::string_view text, std::string_view rest, UriScheme scheme);
[[nodiscard]] std::string bus_text(const UriSpec& spec);

}  // namespace leadline::hal
