// Reading and writing the keys of a configuration: units of the file to units of the vehicle and back.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "firmware/config/text.hpp"
#include "firmware/config/toml_reader.hpp"

namespace leadline::host {

/// A decimal in the file's unit, `scale` integer units each.
template <typename T>
void read_scaled(const TomlSection& section, const char* key, const Limits& limits, double scale,
                 T* value) {
  double number = 0;
  if (section.read_number(key, limits, &number)) {
    *value = static_cast<T>(std::llround(number * scale));
  }
}

template <typename T>
void read_whole(const TomlSection& section, const char* key, const Limits& limits, T* value) {
  std::int64_t number = 0;
  if (section.read_integer(key, limits, &number)) {
    *value = static_cast<T>(number);
  }
}

/// The number of fewest decimals near `value` that still `is_same`: 0.15 rather than 0.15000035.
template <typename IsSame>
[[nodiscard]] double shortest_number(double value, const IsSame& is_same) {
  double power = 1;
  for (int digits = 0; digits <= 15; ++digits) {
    const double candidate = std::round(value * power) / power;
    if (is_same(candidate)) {
      return candidate;
    }
    power *= 10;
  }
  return value;
}

/// The resolved configuration as the entries of both writers.
class EntryList {
 public:
  void in(const std::string& table, int element = -1) {
    table_ = table;
    element_ = element;
  }
  void text(const char* key, const std::string& value) { raw(key, json_string(value)); }
  void integer(const char* key, std::int64_t value) { raw(key, std::to_string(value)); }
  void flag(const char* key, bool value) { raw(key, value ? "true" : "false"); }
  void number(const char* key, double value) { raw(key, json_number(value)); }
  /// `value` integer units, `scale` of which are one of the file's: reads back to the same.
  void scaled(const char* key, std::int64_t value, double scale) {
    number(key, shortest_number(static_cast<double>(value) / scale, [&](double candidate) {
             return std::llround(candidate * scale) == value;
           }));
  }
  void raw(const char* key, const std::string& value) {
    entries_.push_back({table_, key, value, element_});
  }
  [[nodiscard]] const std::vector<ConfigEntry>& entries() const { return entries_; }

 private:
  std::string table_;
  int element_ = -1;
  std::vector<ConfigEntry> entries_;
};

}  // namespace leadline::host
