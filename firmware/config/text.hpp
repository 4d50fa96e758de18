// Small text helpers for messages: quoting what came from a file, guessing what was meant, JSON.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace leadline::host {

/// `text` fit for a message: control characters and bytes outside ASCII as \xNN, `"` and `\` escaped,
/// at most `max_bytes` of the input, then "...". No quotes around it.
[[nodiscard]] std::string printable(std::string_view text, std::size_t max_bytes = 40);

/// Edits (insert, delete, replace, swap of neighbours) that turn `a` into `b`, case ignored.
/// O(|a| |b|) time; texts over 128 bytes count as unrelated (the longer one's length).
[[nodiscard]] std::size_t edit_distance(std::string_view a, std::string_view b);

/// The candidate that `name` was most likely meant to be, "" when none is near: one that starts with
/// `name` (3 letters or more), contains it or is contained in it (4 or more), or lies within a third
/// of its length in edits (at least one).
[[nodiscard]] std::string closest_name(std::string_view name,
                                       const std::vector<std::string>& candidates);

/// Bytes at the start of `text` that are whole, valid UTF-8 characters: its size when all are.
[[nodiscard]] std::size_t valid_utf8_bytes(std::string_view text);

/// `text` as a JSON string literal with its quotes. Bytes that are not valid UTF-8 become U+FFFD.
[[nodiscard]] std::string json_string(std::string_view text);
/// "0x" and at least `digits` lower-case hexadecimal digits.
[[nodiscard]] std::string hex_text(std::uint64_t value, int digits);
/// Appends `value` with `digits` after the point, 0 .. 20; never "-0".
void append_fixed(std::string* text, double value, int digits);
/// Shortest decimal that reads back as the same double; "null" for NaN and infinities.
[[nodiscard]] std::string json_number(double value);

}  // namespace leadline::host
