// URIs of buses and lines: can:, modbus-rtu:, modbus-tcp:, gpio:.
#include <algorithm>
#include <array>

#include "hal/linux/uri_parts.hpp"

namespace leadline::hal {
namespace {

constexpr std::uint32_t kExtended = 0x80000000U;
constexpr std::uint32_t kLongest11 = 0x7FFU;
constexpr std::uint32_t kLongest29 = 0x1FFFFFFFU;
constexpr std::size_t kLongestInterface = 15;  // IFNAMSIZ less its zero

/// Up to eight hex digits. False for anything else.
bool parse_hex(std::string_view text, std::uint32_t* value) {
  if (text.empty() || text.size() > 8) {
    return false;
  }
  std::uint32_t sum = 0;
  for (const char c : text) {
    const bool decimal = c >= '0' && c <= '9';
    const char letter = c >= 'a' && c <= 'f' ? static_cast<char>(c - 32) : c;
    if (!decimal && (letter < 'A' || letter > 'F')) {
      return false;
    }
    sum = sum * 16 + static_cast<std::uint32_t>(decimal ? c - '0' : letter - 'A' + 10);
  }
  *value = sum;
  return true;
}

std::string hex(std::uint32_t value, std::size_t digits) {
  std::string text(digits, '0');
  for (std::size_t i = digits; i > 0; --i, value >>= 4U) {
    text[i - 1] = "0123456789ABCDEF"[value & 0xFU];
  }
  return text;
}

bool parse_filter(std::string_view text, CanFilter* filter) {
  const std::size_t slash = text.find('/');
  const std::string_view id = text.substr(0, slash);
  if (!parse_hex(id, &filter->id)) {
    return false;
  }
  const bool extended = id.size() > 3;
  const std::uint32_t longest = extended ? kLongest29 : kLongest11;
  filter->mask = longest;
  if (slash != std::string_view::npos && !parse_hex(text.substr(slash + 1), &filter->mask)) {
    return false;
  }
  const bool fits = filter->id <= longest && filter->mask <= longest;
  filter->id |= extended ? kExtended : 0U;
  return fits;
}

UriResult parse_can(std::string_view text, std::string_view rest) {
  constexpr const char* kForm = "can:can0, or can:can0:ID/MASK,ID/MASK... in hex";
  UriResult result;
  result.spec.scheme = UriScheme::kCan;
  const std::size_t colon = rest.find(':');
  const std::string_view name = rest.substr(0, colon);
  if (name.empty() || name.size() > kLongestInterface || name.find('/') != name.npos) {
    return refuse_uri(text, std::string("needs an interface of 1 to 15 letters: ") + kForm);
  }
  result.spec.path = name;
  while (colon != rest.npos && rest.size() > name.size()) {
    const std::size_t comma = std::min(rest.find(',', name.size() + 1), rest.size());
    const std::string_view one = rest.substr(name.size() + 1, comma - name.size() - 1);
    CanFilter filter;
    if (!parse_filter(one, &filter)) {
      return refuse_uri(
          text, "\"" + std::string(one) + "\" is no filter (3 digits at most: 11 bits): " + kForm);
    }
    if (result.spec.can_filters.size() == kMaxCanFilters) {
      return refuse_uri(text, "has more than " + std::to_string(kMaxCanFilters) + " filters");
    }
    result.spec.can_filters.push_back(filter);
    rest.remove_prefix(comma - name.size());
  }
  return result;
}

/// Cuts "@ADDR" off; false when it is not there or no address of a slave.
bool take_unit(std::string_view* rest, std::uint8_t* unit) {
  constexpr std::uint32_t kLastUnit = 247;
  const std::size_t at = rest->rfind('@');
  if (at == std::string_view::npos) {
    return false;
  }
  const std::uint32_t number = number_of(rest->substr(at + 1), 0);
  *rest = rest->substr(0, at);
  *unit = static_cast<std::uint8_t>(number);
  return number >= 1 && number <= kLastUnit;
}

/// "8N1": 8 data bits are what Modbus RTU is made of.
bool take_framing(std::string_view* rest, SerialFraming* framing) {
  const std::size_t colon = rest->rfind(':');
  if (colon == std::string_view::npos) {
    return false;
  }
  const std::string_view text = rest->substr(colon + 1);
  const bool good = text.size() == 3 && text[0] == '8' &&
                    (text[1] == 'N' || text[1] == 'E' || text[1] == 'O') &&
                    (text[2] == '1' || text[2] == '2');
  if (!good) {
    return false;
  }
  framing->parity = text[1];
  framing->stop_bits = text[2] == '2' ? 2 : 1;
  *rest = rest->substr(0, colon);
  return true;
}

UriResult parse_modbus(std::string_view text, std::string_view rest, UriScheme scheme) {
  const bool rtu = scheme == UriScheme::kModbusRtu;
  const std::string form = rtu ? "modbus-rtu:/dev/ttyUSB0:19200:8N1@1 (8N1 8N2 8E1 8E2 8O1 8O2)"
                               : "modbus-tcp:HOST:PORT@1";
  std::uint8_t unit = 0;
  if (!take_unit(&rest, &unit)) {
    return refuse_uri(text, "needs the slave's address, 1 to 247: " + form);
  }
  SerialFraming framing;
  if (rtu && !take_framing(&rest, &framing)) {
    return refuse_uri(text, "needs the framing: " + form);
  }
  if (!rtu && !rest.empty() && rest.front() == '@') {
    return refuse_uri(text, "is a master and connects: " + form);
  }
  UriResult result = rtu ? parse_serial(text, rest) : parse_socket(text, rest, UriScheme::kTcp);
  result.spec.scheme = scheme;
  result.spec.unit = unit;
  result.spec.framing = framing;
  return result;
}

UriResult parse_gpio(std::string_view text, std::string_view rest) {
  constexpr const char* kForm = "gpio:gpiochip0:17 (edges), gpio:gpiochip0:17:out (trigger)";
  UriResult result;
  result.spec.scheme = UriScheme::kGpio;
  constexpr std::string_view kOut = ":out";
  if (rest.size() > kOut.size() && rest.substr(rest.size() - kOut.size()) == kOut) {
    result.spec.output = true;
    rest.remove_suffix(kOut.size());
  }
  const std::size_t colon = rest.rfind(':');
  constexpr std::uint32_t kNone = 1'000'000;
  const std::uint32_t line = colon == rest.npos ? kNone : number_of(rest.substr(colon + 1), kNone);
  if (colon == rest.npos || colon == 0 || line >= kNone) {
    return refuse_uri(text, std::string("needs a chip and a line's number: ") + kForm);
  }
  result.spec.path = rest.substr(0, colon);
  result.spec.line = line;
  return result;
}

std::string can_text(const UriSpec& spec) {
  std::string text = "can:" + spec.path;
  char separator = ':';
  for (const CanFilter& filter : spec.can_filters) {
    const std::size_t digits = (filter.id & kExtended) != 0 ? 8 : 3;
    text += separator + hex(filter.id & kLongest29, digits) + "/" + hex(filter.mask, digits);
    separator = ',';
  }
  return text;
}

}  // namespace

UriResult parse_bus(std::string_view text, std::string_view rest, UriScheme scheme) {
  if (scheme == UriScheme::kCan) {
    return parse_can(text, rest);
  }
  if (scheme == UriScheme::kGpio) {
    return parse_gpio(text, rest);
  }
  return parse_modbus(text, rest, scheme);
}

std::string bus_text(const UriSpec& spec) {
  const std::string unit = "@" + std::to_string(spec.unit);
  if (spec.scheme == UriScheme::kCan) {
    return can_text(spec);
  }
  if (spec.scheme == UriScheme::kGpio) {
    return "gpio:" + spec.path + ":" + std::to_string(spec.line) + (spec.output ? ":out" : "");
  }
  if (spec.scheme == UriScheme::kModbusRtu) {
    return "modbus-rtu:" + spec.path + ":" + std::to_string(spec.baud) + ":8" +
           spec.framing.parity + std::to_string(spec.framing.stop_bits) + unit;
  }
  const bool brackets = spec.host.find(':') != std::string::npos;
  return "modbus-tcp:" + (brackets ? "[" + spec.host + "]" : spec.host) + ":" +
         std::to_string(spec.port) + unit;
}

}  // namespace leadline::hal
