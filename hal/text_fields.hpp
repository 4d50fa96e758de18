// Text of sensors, taken apart without copies, heap or floating point. Vehicle code.
//
// A field is a piece of the caller's buffer: it lives as long as that does. No text ends in a zero byte.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace leadline::hal {

/// Part of a text, without the spaces around it when it comes from split().
struct TextField {
  const char* text = nullptr;
  std::size_t size = 0;

  [[nodiscard]] constexpr bool empty() const { return size == 0; }
};

/// Fields of one line, in order; the first is number 0.
template <std::size_t kMaxFields>
struct TextFields {
  std::array<TextField, kMaxFields> fields{};
  std::size_t count = 0;

  /// Field `index`; beyond the last an empty one.
  [[nodiscard]] constexpr TextField at(std::size_t index) const {
    return index < count && index < kMaxFields ? fields[index] : TextField{};
  }
};

/// The bytes of a frame as text.
[[nodiscard]] inline const char* as_text(const std::uint8_t* bytes) {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): char may look at anything
  return reinterpret_cast<const char*>(bytes);
}

[[nodiscard]] constexpr char upper(char c) {
  return c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c;
}

[[nodiscard]] constexpr bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Value of a hex digit of either case; -1: none.
[[nodiscard]] constexpr int hex_digit(char c) {
  if (is_digit(c)) {
    return c - '0';
  }
  const char letter = upper(c);
  return letter >= 'A' && letter <= 'F' ? letter - 'A' + 10 : -1;
}

/// `digits` (1 .. 8) hex digits to a number; false when one is none.
[[nodiscard]] constexpr bool parse_hex(const char* text, std::size_t digits, std::uint32_t& value) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < digits; ++i) {
    const int digit = hex_digit(text[i]);
    if (digit < 0) {
      return false;
    }
    sum = (sum << 4U) | static_cast<std::uint32_t>(digit);
  }
  value = sum;
  return true;
}

/// Equal but for the case of letters; `word` ends in a zero byte.
[[nodiscard]] constexpr bool is(const TextField& field, const char* word) {
  for (std::size_t i = 0; i < field.size; ++i) {
    if (upper(field.text[i]) != upper(word[i])) {
      return false;  // also where the word ends first
    }
  }
  return word[field.size] == '\0';
}

[[nodiscard]] constexpr TextField trimmed(const char* text, std::size_t size) {
  while (size > 0 && text[0] == ' ') {
    ++text;
    --size;
  }
  while (size > 0 && text[size - 1] == ' ') {
    --size;
  }
  return {text, size};
}

/// `size` characters cut at every `separator`; what is behind the last field that fits is left. No
/// text at all is one empty field. O(size).
template <std::size_t kMaxFields>
[[nodiscard]] constexpr TextFields<kMaxFields> split(const char* text, std::size_t size,
                                                     char separator = ',') {
  TextFields<kMaxFields> line;
  std::size_t start = 0;
  for (std::size_t i = 0; i <= size && line.count < kMaxFields; ++i) {
    if (i < size && text[i] != separator) {
      continue;
    }
    line.fields[line.count] = trimmed(text + start, i - start);
    ++line.count;
    start = i + 1;
  }
  return line;
}

enum class LineState : std::uint8_t {
  kMore,    ///< a beginning
  kWhole,   ///< ended by CR LF, LF, or CR and something else
  kBroken,  ///< a byte that no text has, the start of another line inside, or too long
};

struct TextLine {
  LineState state;
  std::size_t text_bytes;  ///< kWhole: without the end
  std::size_t size_bytes;  ///< kWhole: with the end
};

/// The line that begins at `bytes` with one of its own `start` characters (0: any, and it may come again).
/// At most `max_bytes` without the end. The first `seen` bytes (at least 1) are known to be text of this
/// line. O(available - seen).
[[nodiscard]] constexpr TextLine find_line(const std::uint8_t* bytes, std::size_t available,
                                           std::uint8_t start, std::size_t max_bytes,
                                           std::size_t seen = 1) {
  for (std::size_t i = seen; i < available; ++i) {
    const std::uint8_t byte = bytes[i];
    if (byte == '\n') {
      return {LineState::kWhole, i, i + 1};
    }
    if (byte == '\r') {
      if (i + 1 == available) {
        return {LineState::kMore, 0, 0};
      }
      return {LineState::kWhole, i, bytes[i + 1] == '\n' ? i + 2 : i + 1};
    }
    if (byte < 0x20 || byte > 0x7E || byte == start || i >= max_bytes) {
      return {LineState::kBroken, 0, 0};
    }
  }
  return {LineState::kMore, 0, 0};
}

/// Magnitudes that parse_decimal() delivers stay below this.
inline constexpr std::int64_t kDecimalLimit = 1'000'000'000'000'000'000;
/// Most characters of a number, exponent included.
inline constexpr std::size_t kMaxDecimal_chars = 64;

/// A number's digits: value = magnitude * 10^exponent.
struct Decimal {
  std::uint64_t magnitude = 0;  ///< at most 19 digits; what was behind them is cut off
  std::int32_t exponent = 0;
  bool negative = false;
};

/// Sign, digits, point, digits, from `text` on. Returns the characters taken; 0: no number there.
[[nodiscard]] constexpr std::size_t take_digits(const TextField& field, Decimal& decimal) {
  std::size_t i = 0;
  decimal.negative = field.size > 0 && field.text[0] == '-';
  if (decimal.negative || (field.size > 0 && field.text[0] == '+')) {
    ++i;
  }
  bool point = false;
  bool digits = false;
  for (; i < field.size && i < kMaxDecimal_chars; ++i) {
    const char c = field.text[i];
    if (c == '.' && !point) {
      point = true;
      continue;
    }
    if (!is_digit(c)) {
      break;
    }
    digits = true;
    if (decimal.magnitude < static_cast<std::uint64_t>(kDecimalLimit)) {
      decimal.magnitude = decimal.magnitude * 10 + static_cast<std::uint64_t>(c - '0');
      decimal.exponent -= point ? 1 : 0;
    } else {
      decimal.exponent += point ? 0 : 1;
    }
  }
  return digits ? i : 0;
}

/// 'e' or 'E', sign, one to four digits, to the end of the field; added to the exponent.
[[nodiscard]] constexpr bool take_exponent(const TextField& field, std::size_t i,
                                           Decimal& decimal) {
  if (upper(field.text[i]) != 'E') {
    return false;
  }
  ++i;
  const bool negative = i < field.size && field.text[i] == '-';
  if (negative || (i < field.size && field.text[i] == '+')) {
    ++i;
  }
  if (i >= field.size || field.size - i > 4) {
    return false;
  }
  std::int32_t exponent = 0;
  for (; i < field.size; ++i) {
    if (!is_digit(field.text[i])) {
      return false;
    }
    exponent = exponent * 10 + (field.text[i] - '0');
  }
  decimal.exponent += negative ? -exponent : exponent;
  return true;
}

/// `decimal` * 10^decimals to the nearest integer, halves away from zero. False when it does not stay
/// below kDecimalLimit.
[[nodiscard]] constexpr bool scale_decimal(const Decimal& decimal, int decimals,
                                           std::int64_t& value) {
  std::uint64_t magnitude = decimal.magnitude;
  std::int32_t shift = decimal.exponent + decimals;
  const auto limit = static_cast<std::uint64_t>(kDecimalLimit);
  for (; shift > 0 && magnitude != 0; --shift) {
    if (magnitude >= limit / 10) {
      return false;
    }
    magnitude *= 10;
  }
  for (; shift < -1 && magnitude != 0; ++shift) {
    magnitude /= 10;
  }
  if (shift == -1) {
    magnitude = (magnitude + 5) / 10;
  }
  if (magnitude >= limit) {
    return false;
  }
  value = decimal.negative ? -static_cast<std::int64_t>(magnitude)
                           : static_cast<std::int64_t>(magnitude);
  return true;
}

/// Decimal text (sign, digits, one point, no exponent) times 10^decimals to the nearest integer, halves
/// away from zero. False, and `value` left alone, for anything else in the field, and for what does
/// not stay below kDecimalLimit. O(size).
[[nodiscard]] constexpr bool parse_decimal(const TextField& field, int decimals,
                                           std::int64_t& value) {
  Decimal decimal;
  const std::size_t taken = take_digits(field, decimal);
  return taken > 0 && taken == field.size && scale_decimal(decimal, decimals, value);
}

/// The same with an exponent allowed: "1e-07", "-1.5E+3" (JSON, printf's %g).
[[nodiscard]] constexpr bool parse_number(const TextField& field, int decimals,
                                          std::int64_t& value) {
  Decimal decimal;
  const std::size_t taken = take_digits(field, decimal);
  return taken > 0 && (taken == field.size || take_exponent(field, taken, decimal)) &&
         scale_decimal(decimal, decimals, value);
}

/// parse_decimal() with the result limited: false outside of [low, high], which carry the scale.
[[nodiscard]] constexpr bool parse_within(const TextField& field, int decimals, std::int64_t low,
                                          std::int64_t high, std::int64_t& value) {
  return parse_decimal(field, decimals, value) && value >= low && value <= high;
}

}  // namespace leadline::hal
