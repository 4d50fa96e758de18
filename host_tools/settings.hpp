// Parameters by name, for `--set KEY=VALUE`: one table per command says what exists, explains it, reads
// it from text and shows it. Header only, because a table is made of lambdas over the command's own
// struct.
#pragma once

#include <charconv>
#include <cmath>
#include <cstddef>
#include <functional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {

struct SettingInfo {
  std::string key;   ///< snake_case with its unit, for example "line_spacing_m"
  std::string help;  ///< one line
};

/// Shortest text that reads back as the same number.
[[nodiscard]] inline std::string number_text(double value) {
  char buffer[32];
  return std::string(buffer, std::to_chars(buffer, buffer + sizeof(buffer), value).ptr);
}

/// The parameters of a `Target`. `command` stands in front of messages.
template <typename Target>
class SettingTable {
 public:
  struct Setting {
    SettingInfo info;
    /// Gets the table itself, for parse_decimal(), parse_count() and bad_value().
    std::function<void(const SettingTable&, Target*, const std::string&)> set;
    std::function<std::string(const Target&)> get;
  };

  explicit SettingTable(std::string command) : command_(std::move(command)) {}

  // Each adds one parameter; `field` finds it in a target: [](auto& t) -> auto& { return t.x; }.

  template <typename Field>
  void decimal(const std::string& key, const std::string& help, Field field) {
    add({{key, help},
         [key, field](const SettingTable& table, Target* t, const std::string& v) {
           field(*t) = table.parse_decimal(key, v);
         },
         [field](const Target& t) { return number_text(field(t)); }});
  }
  template <typename Field>
  void count(const std::string& key, const std::string& help, Field field) {
    add({{key, help},
         [key, field](const SettingTable& table, Target* t, const std::string& v) {
           field(*t) = table.template parse_count<std::size_t>(key, v);
         },
         [field](const Target& t) { return std::to_string(field(t)); }});
  }
  template <typename Field>
  void flag(const std::string& key, const std::string& help, Field field) {
    add({{key, help},
         [key, field](const SettingTable& table, Target* t, const std::string& v) {
           if (v != "true" && v != "false") {
             table.bad_value(key, v, "is neither true nor false");
           }
           field(*t) = v == "true";
         },
         [field](const Target& t) { return std::string(field(t) ? "true" : "false"); }});
  }
  /// A parameter with functions of its own.
  void add(Setting setting) { settings_.push_back(std::move(setting)); }

  /// Throws HostError kUsage naming key and value: unknown key (with a suggestion), a value that does
  /// not parse.
  void apply(Target* target, const std::string& key, const std::string& value) const {
    find(key).set(*this, target, value);
  }
  /// The same from "key=value".
  void apply(Target* target, const std::string& assignment) const {
    const std::size_t equals = assignment.find('=');
    if (equals == std::string::npos) {
      fail("\"" + printable(assignment) + "\" is not of the form key=value");
    }
    apply(target, assignment.substr(0, equals), assignment.substr(equals + 1));
  }
  /// The text of a parameter as apply() takes it; "" for an optional one that is unset.
  [[nodiscard]] std::string text(const Target& target, const std::string& key) const {
    return find(key).get(target);
  }
  [[nodiscard]] std::vector<SettingInfo> infos() const {
    std::vector<SettingInfo> infos;
    for (const Setting& setting : settings_) {
      infos.push_back(setting.info);
    }
    return infos;
  }

  [[nodiscard]] double parse_decimal(const std::string& key, const std::string& value) const {
    const double number = parse<double>(key, value, "not a decimal number");
    if (!std::isfinite(number)) {
      bad_value(key, value, "not a finite number");
    }
    return number;
  }
  template <typename Number>
  [[nodiscard]] Number parse_count(const std::string& key, const std::string& value) const {
    return parse<Number>(key, value, "not a whole number from 0");
  }
  [[noreturn]] void bad_value(const std::string& key, const std::string& value,
                              const std::string& expected) const {
    fail(key + "=" + printable(value) + ": " + expected);
  }

 private:
  template <typename Number>
  [[nodiscard]] Number parse(const std::string& key, const std::string& value,
                             const char* expected) const {
    Number number{};
    const char* const end = value.data() + value.size();
    const std::from_chars_result result = std::from_chars(value.data(), end, number);
    if (result.ec != std::errc() || result.ptr != end) {
      bad_value(key, value, expected);
    }
    return number;
  }

  [[nodiscard]] const Setting& find(const std::string& key) const {
    std::vector<std::string> keys;
    for (const Setting& setting : settings_) {
      if (setting.info.key == key) {
        return setting;
      }
      keys.push_back(setting.info.key);
    }
    const std::string near = closest_name(key, keys);
    fail("unknown parameter \"" + printable(key) + "\"" +
         (near.empty() ? "" : "; did you mean " + near + "?"));
  }

  [[noreturn]] void fail(const std::string& message) const {
    throw HostError(ExitCode::kUsage, command_ + ": " + message);
  }

  std::string command_;
  std::vector<Setting> settings_;
};

}  // namespace leadline::host
