#include "firmware/config/text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>

namespace leadline::host {
namespace {

constexpr std::size_t kMaxCompared_bytes = 128;

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

std::string lowered(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(), lower);
  return result;
}

void append_hex(std::string* out, unsigned char byte) {
  static constexpr std::string_view kDigits = "0123456789abcdef";
  out->push_back(kDigits[byte >> 4U]);
  out->push_back(kDigits[byte & 15U]);
}

/// Length of the valid UTF-8 sequence at the start of `text`, 0 when there is none.
std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const auto follows = [&](std::size_t i) { return i < text.size() && (byte(i) & 0xC0U) == 0x80U; };
  if (byte(0) < 0x80U) {
    return 1;
  }
  if (byte(0) >= 0xC2U && byte(0) < 0xE0U) {
    return follows(1) ? 2 : 0;
  }
  if (byte(0) >= 0xE0U && byte(0) < 0xF0U) {
    if (!follows(1) || !follows(2)) {
      return 0;
    }
    const bool overlong = byte(0) == 0xE0U && byte(1) < 0xA0U;
    const bool surrogate = byte(0) == 0xEDU && byte(1) >= 0xA0U;
    return overlong || surrogate ? 0 : 3;
  }
  if (byte(0) >= 0xF0U && byte(0) < 0xF5U) {
    if (!follows(1) || !follows(2) || !follows(3)) {
      return 0;
    }
    const bool overlong = byte(0) == 0xF0U && byte(1) < 0x90U;
    const bool beyond = byte(0) == 0xF4U && byte(1) >= 0x90U;
    return overlong || beyond ? 0 : 4;
  }
  return 0;
}

}  // namespace

std::string printable(std::string_view text, std::size_t max_bytes) {
  std::string result;
  for (const char c : text.substr(0, max_bytes)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20U || byte >= 0x7FU) {
      result += "\\x";
      append_hex(&result, byte);
      continue;
    }
    if (c == '"' || c == '\\') {
      result.push_back('\\');
    }
    result.push_back(c);
  }
  if (text.size() > max_bytes) {
    result += "...";
  }
  return result;
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  if (a.size() > kMaxCompared_bytes || b.size() > kMaxCompared_bytes) {
    return std::max(a.size(), b.size());
  }
  // Optimal string alignment; three rolling rows, the oldest for the swap of neighbours.
  using Row = std::array<std::size_t, kMaxCompared_bytes + 1>;
  Row older{};
  Row previous{};
  Row current{};
  for (std::size_t j = 0; j <= b.size(); ++j) {
    previous[j] = j;
  }
  for (std::size_t i = 1; i <= a.size(); ++i) {
    current[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const bool same = lower(a[i - 1]) == lower(b[j - 1]);
      current[j] =
          std::min({previous[j] + 1, current[j - 1] + 1, previous[j - 1] + (same ? 0U : 1U)});
      const bool swapped = i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) &&
                           lower(a[i - 2]) == lower(b[j - 1]);
      if (swapped) {
        current[j] = std::min(current[j], older[j - 2] + 1);
      }
    }
    older = previous;
    previous = current;
  }
  return previous[b.size()];
}

std::string closest_name(std::string_view name, const std::vector<std::string>& candidates) {
  const std::string wanted = lowered(name);
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(1, wanted.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    std::size_t distance = edit_distance(wanted, candidate);
    // A unit left out or a word too many is likelier than a typing error in another name.
    const std::string other = lowered(candidate);
    const bool start = wanted.size() >= 3 && other.rfind(wanted, 0) == 0;
    const bool part = wanted.size() >= 4 && other.find(wanted) != std::string::npos;
    const bool whole = other.size() >= 4 && wanted.find(other) != std::string::npos;
    if (start || part || whole) {
      distance = std::min<std::size_t>(distance, 1);
    }
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

std::size_t valid_utf8_bytes(std::string_view text) {
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t length = utf8_length(text.substr(at));
    if (length == 0) {
      break;
    }
    at += length;
  }
  return at;
}

std::string json_string(std::string_view text) {
  std::string result = "\"";
  while (!text.empty()) {
    const char c = text.front();
    const auto byte = static_cast<unsigned char>(c);
    const std::size_t length = utf8_length(text);
    if (length == 0) {
      result += "\\ufffd";
      text.remove_prefix(1);
      continue;
    }
    if (c == '"' || c == '\\') {
      result.push_back('\\');
      result.push_back(c);
    } else if (byte < 0x20U || byte == 0x7FU) {
      result += "\\u00";
      append_hex(&result, byte);
    } else {
      result += text.substr(0, length);
    }
    text.remove_prefix(length);
  }
  result.push_back('"');
  return result;
}

std::string hex_text(std::uint64_t value, int digits) {
  std::array<char, 16> raw{};
  const auto end = std::to_chars(raw.data(), raw.data() + raw.size(), value, 16);
  const std::string plain(raw.data(), end.ptr);
  const auto missing = static_cast<std::ptrdiff_t>(digits) - (end.ptr - raw.data());
  return "0x" + std::string(missing > 0 ? static_cast<std::size_t>(missing) : 0, '0') + plain;
}

void append_fixed(std::string* text, double value, int digits) {
  // 309 digits before the point at the most.
  std::array<char, 400> buffer{};
  double half = 0.5;
  for (int k = 0; k < digits; ++k) {
    half /= 10.0;
  }
  const double shown = std::fabs(value) < half ? 0.0 : value;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), shown,
                                 std::chars_format::fixed, digits);
  text->append(buffer.data(), end.ptr);
}

std::string json_number(double value) {
  if (!std::isfinite(value)) {
    return "null";
  }
  std::array<char, 64> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), end.ptr};
}

}  // namespace leadline::host
