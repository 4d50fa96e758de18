#include "host_tools/map_config.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <sstream>
#include <utility>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

// toml++ 3.3 asserts on some malformed input ("[[[" is one) before it would report it: an abort in a
// debug build, an assumption that clang optimizes by in a release. Hence the parser is compiled here,
// with an assertion that throws; it only takes ours without NDEBUG.
namespace {
struct TomlAssertion {};
[[noreturn]] void refuse_toml() { throw TomlAssertion{}; }
}  // namespace
#undef NDEBUG
#undef TOML_SHARED_LIB
#undef TOML_HEADER_ONLY
#define TOML_HEADER_ONLY 1
#define TOML_ASSERT(expr) ((expr) ? static_cast<void>(0) : refuse_toml())
#include <toml++/toml.h>

namespace leadline::host {
namespace {

constexpr std::array<const char*, 2> kRuleNames = {"weighted_mean", "log_odds"};
constexpr std::array<const char*, 2> kNoReturnNames = {"ignore", "empty"};
constexpr std::array<const char*, 4> kBeamKindNames = {"cone", "piston", "aperture", "pattern"};

struct TableKeys {
  const char* table;  ///< "" for the top level
  std::vector<std::string> keys;
};

/// Every key there is: what is not here is an error.
const std::vector<TableKeys>& known_tables() {
  static const std::vector<TableKeys> kTables = {
      {"", {"schema_version", "grid", "sonar", "navigation", "model", "frame"}},
      {"grid", {"cell_mm", "size", "origin_mm"}},
      {"sonar",
       {"beam_half_angle_deg", "piston_diameter_mm", "frequency_hz", "aperture_along_mm",
        "aperture_across_mm", "pattern_file", "max_half_angle_deg", "sigma_pointing_deg",
        "sigma_range_mm", "min_range_mm", "max_range_mm", "no_return", "detect_range_mm",
        "sound_speed_mm_s", "detection_fraction"}},
      {"navigation", {"sigma_position_mm", "sigma_correlated_mm"}},
      {"model", {"rule", "k_p"}},
      {"frame", {"lat", "lon", "epsg", "vertical_datum"}},
  };
  return kTables;
}

/// Limits of one number. The lower one may be excluded ("over 0"), the upper one too.
class Limits {
 public:
  Limits(double lowest, double highest, bool without_lowest = false, bool without_highest = false)
      : low_(lowest),
        high_(highest),
        low_excluded_(without_lowest),
        high_excluded_(without_highest) {}

  [[nodiscard]] bool contain(double value) const {
    const bool above = low_excluded_ ? value > low_ : value >= low_;
    const bool below = high_excluded_ ? value < high_ : value <= high_;
    return above && below;  // positive tests: NaN is nowhere
  }
  [[nodiscard]] std::string text() const {
    return std::string(low_excluded_ ? "over " : "") + plain(low_) +
           (high_excluded_ ? " to below " : " to ") + plain(high_);
  }

 private:
  /// Every limit is a whole number: 1000000 reads better than 1e+06.
  static std::string plain(double value) {
    return std::to_string(static_cast<std::int64_t>(value));
  }

  double low_;
  double high_;
  bool low_excluded_;
  bool high_excluded_;
};

// toml++ 3.3 has undefined behaviour in its tables of Unicode blanks, which it asks about almost any
// character outside ASCII. So it is never shown one: every such byte goes in as ~xx, and so does ~
// itself, and every text that comes out is turned back. Outside strings and comments ~ is as much of
// an error as the character would have been.

std::string to_ascii(std::string_view text) {
  static constexpr std::string_view kDigits = "0123456789abcdef";
  std::string result;
  result.reserve(text.size());
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80U && c != '~') {
      result.push_back(c);
      continue;
    }
    result.push_back('~');
    result.push_back(kDigits[byte >> 4U]);
    result.push_back(kDigits[byte & 15U]);
  }
  return result;
}

std::string from_ascii(std::string_view text) {
  const auto digit = [](char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '~' && i + 2 < text.size()) {
      result.push_back(static_cast<char>(digit(text[i + 1]) * 16 + digit(text[i + 2])));
      i += 2;
      continue;
    }
    result.push_back(text[i]);
  }
  return result;
}

/// Line of the first ~ that is written as an escape (from_ascii could not tell it from ours), or 0.
std::size_t line_of_escaped_tilde(std::string_view text) {
  std::size_t line = 1;
  for (std::size_t i = 0; i < text.size(); ++i) {
    line += text[i] == '\n' ? 1 : 0;
    for (const std::string_view escape : {"\\u007e", "\\u007E", "\\U0000007e", "\\U0000007E"}) {
      if (text.substr(i, escape.size()) == escape) {
        return line;
      }
    }
  }
  return 0;
}

std::string value_text(const toml::node& node) {
  if (const auto* const text = node.as_string()) {
    return printable(from_ascii(text->get()), 60);
  }
  if (const auto* const decimal = node.as_floating_point()) {
    const double value = decimal->get();
    return std::isnan(value)   ? "nan"
           : std::isinf(value) ? (value < 0 ? "-inf" : "inf")
                               : json_number(value);
  }
  std::ostringstream stream;
  node.visit([&](const auto& value) { stream << value; });
  return printable(from_ascii(stream.str()), 60);
}

/// Collects every finding before it gives up, so that one run shows all that is wrong.
class ConfigReader {
 public:
  ConfigReader(const std::string& name, const std::string& base_dir)
      : name_(name), base_dir_(base_dir) {}

  MapConfig read(std::string_view text) {
    const toml::table root = parse(text);
    check_keys(root);
    read_schema_version(root);
    read_grid(root);
    read_sonar(root);
    read_navigation(root);
    read_model(root);
    read_frame(root);
    if (!findings_.empty()) {
      std::stable_sort(findings_.begin(), findings_.end(),
                       [](const Finding& a, const Finding& b) { return a.first < b.first; });
      std::string message;
      for (const Finding& finding : findings_) {
        message += (message.empty() ? "" : "\n") + finding.second;
      }
      throw HostError(ExitCode::kUsage, message);
    }
    return config_;
  }

 private:
  toml::table parse(std::string_view text) const {
    if (text.substr(0, 3) == "\xEF\xBB\xBF") {
      text.remove_prefix(3);
    }
    if (const std::size_t valid = valid_utf8_bytes(text); valid != text.size()) {
      const auto line =
          1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(valid), '\n');
      throw HostError(ExitCode::kUsage,
                      name_ + ":" + std::to_string(line) + ": not valid TOML: not UTF-8 text");
    }
    if (const std::size_t line = line_of_escaped_tilde(text); line != 0) {
      throw HostError(ExitCode::kUsage,
                      name_ + ":" + std::to_string(line) + ": write ~ itself, not its escape");
    }
    try {
      return toml::parse(to_ascii(text), std::string_view(name_));
    } catch (const toml::parse_error& error) {
      throw HostError(ExitCode::kUsage,
                      name_ + ":" + std::to_string(error.source().begin.line) +
                          ": not valid TOML: " + printable(error.description(), 200));
    } catch (const TomlAssertion&) {
      throw HostError(ExitCode::kUsage, name_ + ":" + std::to_string(line_of_assertion(text)) +
                                            ": not valid TOML: a character where none can be");
    }
  }

  /// The first line after which the parser asserts.
  static std::size_t line_of_assertion(std::string_view text) {
    std::size_t line = 1;
    for (std::size_t at = text.find('\n'); at < text.size(); at = text.find('\n', at + 1)) {
      try {
        (void)toml::parse(to_ascii(text.substr(0, at)));
      } catch (const toml::parse_error&) {  // cut in the middle of something
      } catch (const TomlAssertion&) {
        break;
      }
      line += 1;
    }
    return line;
  }

  // ---- Findings ----

  [[nodiscard]] static std::string shown(const char* table, const std::string& key) {
    return *table == '\0' ? key : std::string("[") + table + "] " + key;
  }

  void find_at(const toml::source_position& place, const std::string& what) {
    findings_.emplace_back(place.line, name_ + ":" + std::to_string(place.line) + ": " + what);
  }
  void find(const toml::node& node, const std::string& what) { find_at(node.source().begin, what); }

  void find_value(const toml::node& node, const char* table, const std::string& key,
                  const std::string& why) {
    find(node, shown(table, key) + " = " + value_text(node) + ": " + why);
  }

  /// What is not there has no line: after everything that has one.
  void find_missing(const std::string& what) {
    findings_.emplace_back(std::numeric_limits<toml::source_index>::max(), name_ + ": " + what);
  }

  // ---- Keys ----

  void check_keys(const toml::table& root) {
    for (const TableKeys& known : known_tables()) {
      const toml::table* table = &root;
      if (*known.table != '\0') {
        const toml::node* const node = root.get(known.table);
        if (node == nullptr) {
          continue;
        }
        table = node->as_table();
        if (table == nullptr) {
          find(*node, std::string(known.table) + ": has to be a table: [" + known.table + "]");
          continue;
        }
      }
      for (const auto& [key, node] : *table) {
        const std::string name = from_ascii(key.str());
        if (std::find(known.keys.begin(), known.keys.end(), name) == known.keys.end()) {
          find_unknown(key, known, name);
        }
      }
    }
  }

  void find_unknown(const toml::key& key, const TableKeys& known, const std::string& name) {
    std::string hint;
    for (const TableKeys& other : known_tables()) {
      const bool here = std::find(other.keys.begin(), other.keys.end(), name) != other.keys.end();
      if (here && *other.table != '\0') {
        hint = std::string("; it belongs to [") + other.table + "]";
      }
    }
    if (hint.empty()) {
      const std::string near = closest_name(name, known.keys);
      hint = near.empty() ? "" : "; did you mean \"" + near + "\"?";
    }
    for (const TableKeys& other : known_tables()) {
      const std::string near = hint.empty() ? closest_name(name, other.keys) : "";
      if (!near.empty()) {
        hint =
            "; did you mean \"" + near + "\"" +
            (*other.table == '\0' ? std::string("?") : std::string(" of [") + other.table + "]?");
      }
    }
    if (hint.empty()) {
      hint = "; known are:";
      for (const std::string& candidate : known.keys) {
        hint += " " + candidate;
      }
    }
    find_at(key.source().begin, shown(known.table, printable(name)) + ": unknown key" + hint);
  }

  /// The node of a key, null when it is not there.
  [[nodiscard]] static const toml::node* get(const toml::table& root, const char* table,
                                             const char* key) {
    const toml::node* const node = root.get(table);
    const toml::table* const inner = node == nullptr ? nullptr : node->as_table();
    return inner == nullptr ? nullptr : inner->get(key);
  }

  // ---- Values ----

  /// A finite number within limits; false leaves a finding and `value` as it was.
  bool number_of(const toml::node& node, const char* table, const std::string& key,
                 const Limits& limits, double* value) {
    double number = 0;
    if (const auto* const integer = node.as_integer()) {
      number = static_cast<double>(integer->get());
    } else if (const auto* const decimal = node.as_floating_point()) {
      number = decimal->get();
    } else {
      find_value(node, table, key, "has to be a number, " + limits.text());
      return false;
    }
    if (!limits.contain(number)) {
      find_value(node, table, key, "has to be " + limits.text());
      return false;
    }
    *value = number + 0.0;  // -0 becomes 0
    return true;
  }

  bool integer_of(const toml::node& node, const char* table, const std::string& key,
                  const Limits& limits, std::int64_t* value) {
    std::int64_t number = 0;
    if (const auto* const integer = node.as_integer()) {
      number = integer->get();
    } else if (const auto* const decimal = node.as_floating_point()) {
      const double real = decimal->get();
      // Limits of integer keys are below 2^53, where every whole double is exact.
      if (limits.contain(real) && !(std::trunc(real) == real)) {
        find_value(node, table, key, "has to be a whole number, " + limits.text());
        return false;
      }
      if (!limits.contain(real)) {
        find_value(node, table, key, "has to be " + limits.text());
        return false;
      }
      number = static_cast<std::int64_t>(real);
    } else {
      find_value(node, table, key, "has to be a whole number, " + limits.text());
      return false;
    }
    if (!limits.contain(static_cast<double>(number))) {
      find_value(node, table, key, "has to be " + limits.text());
      return false;
    }
    *value = number;
    return true;
  }

  bool read_number(const toml::table& root, const char* table, const char* key,
                   const Limits& limits, double* value) {
    const toml::node* const node = get(root, table, key);
    return node != nullptr && number_of(*node, table, key, limits, value);
  }

  bool read_integer(const toml::table& root, const char* table, const char* key,
                    const Limits& limits, std::int64_t* value) {
    const toml::node* const node = get(root, table, key);
    return node != nullptr && integer_of(*node, table, key, limits, value);
  }

  /// The three values north, east, down; null (with a finding) when it is not an array of three.
  const toml::array* triple(const toml::node& node, const char* table, const char* key) {
    const toml::array* const array = node.as_array();
    if (array == nullptr || array->size() != 3) {
      find_value(node, table, key, "has to be an array of three: [north, east, down]");
      return nullptr;
    }
    return array;
  }

  static std::string element(const char* key, std::size_t axis) {
    return std::string(key) + "[" + std::to_string(axis) + "]";
  }

  bool read_integers(const toml::table& root, const char* table, const char* key,
                     const Limits (&limits)[3], std::int64_t (&values)[3]) {
    const toml::node* const node = get(root, table, key);
    const toml::array* const array = node == nullptr ? nullptr : triple(*node, table, key);
    bool good = array != nullptr;
    for (std::size_t axis = 0; array != nullptr && axis < 3; ++axis) {
      good = integer_of((*array)[axis], table, element(key, axis), limits[axis], &values[axis]) &&
             good;
    }
    return good;
  }

  void read_numbers(const toml::table& root, const char* table, const char* key,
                    const Limits& limits, double (&values)[3]) {
    const toml::node* const node = get(root, table, key);
    const toml::array* const array = node == nullptr ? nullptr : triple(*node, table, key);
    for (std::size_t axis = 0; array != nullptr && axis < 3; ++axis) {
      number_of((*array)[axis], table, element(key, axis), limits, &values[axis]);
    }
  }

  /// The index of a name among `names`, or `fallback`.
  template <std::size_t N>
  std::size_t read_choice(const toml::table& root, const char* table, const char* key,
                          const std::array<const char*, N>& names, std::size_t fallback) {
    const toml::node* const node = get(root, table, key);
    if (node == nullptr) {
      return fallback;
    }
    const auto* const text = node->as_string();
    std::string choices;
    for (std::size_t i = 0; i < N; ++i) {
      if (text != nullptr && text->get() == names[i]) {
        return i;
      }
      choices += (i == 0 ? "\"" : ", \"") + std::string(names[i]) + "\"";
    }
    find_value(*node, table, key, "has to be one of " + choices);
    return fallback;
  }

  // ---- Tables ----

  void read_schema_version(const toml::table& root) {
    const toml::node* const node = root.get("schema_version");
    if (node == nullptr) {
      return;
    }
    const auto* const integer = node->as_integer();
    if (integer == nullptr || integer->get() != kSchemaVersion) {
      find_value(*node, "", "schema_version",
                 "this program reads schema version " + std::to_string(kSchemaVersion));
    }
  }

  void read_grid(const toml::table& root) {
    if (root.get("grid") == nullptr) {
      find_missing("the table [grid] with cell_mm, size and origin_mm is missing");
      return;
    }
    for (const char* const key : {"cell_mm", "size", "origin_mm"}) {
      if (root.get("grid")->is_table() && get(root, "grid", key) == nullptr) {
        find_missing(std::string("[grid] ") + key + " is missing");
      }
    }
    GridConfig& grid = config_.grid;
    std::int64_t cell_mm = 0;
    const bool cell_good = read_integer(root, "grid", "cell_mm", {1, 1'000'000}, &cell_mm);
    grid.cell_mm = static_cast<std::int32_t>(cell_mm);

    const Limits cells = {1, 1'048'576};
    std::int64_t size[3] = {0, 0, 0};
    const bool size_good = read_integers(root, "grid", "size", {cells, cells, cells}, size);

    constexpr std::int64_t kHorizontal_mm = base::kMaxHorizontal_um / 1000;
    constexpr std::int64_t kVertical_mm = base::kMaxVertical_um / 1000;
    const Limits horizontal = {static_cast<double>(-kHorizontal_mm),
                               static_cast<double>(kHorizontal_mm)};
    const Limits vertical = {static_cast<double>(-kVertical_mm), static_cast<double>(kVertical_mm)};
    const bool origin_good = read_integers(root, "grid", "origin_mm",
                                           {horizontal, horizontal, vertical}, grid.origin_mm);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      grid.size[axis] = static_cast<std::int32_t>(size[axis]);
      const std::int64_t far_mm = grid.origin_mm[axis] + size[axis] * cell_mm;
      const std::int64_t limit_mm = axis == base::kDown ? kVertical_mm : kHorizontal_mm;
      if (cell_good && size_good && origin_good && far_mm > limit_mm) {
        static constexpr std::array<const char*, 3> kAxisNames = {"north", "east", "down"};
        find(*get(root, "grid", "size"),
             std::string("[grid] the grid ends ") + std::to_string(far_mm) + " mm " +
                 kAxisNames[axis] + ": it has to end within " + std::to_string(limit_mm) +
                 " mm (re-origin the survey or take fewer or smaller cells)");
      }
    }
  }

  void read_beam(const toml::table& root) {
    SonarConfig& sonar = config_.sonar;
    const Limits half_angle = {0, 90, true};
    const Limits length_mm = {1, 10'000};
    const bool has_frequency = get(root, "sonar", "frequency_hz") != nullptr;
    read_number(root, "sonar", "frequency_hz", {100, 1e8}, &sonar.frequency_hz);
    read_number(root, "sonar", "beam_half_angle_deg", half_angle, &sonar.beam_half_angle_deg);
    read_number(root, "sonar", "piston_diameter_mm", length_mm, &sonar.piston_diameter_mm);
    read_number(root, "sonar", "aperture_along_mm", length_mm, &sonar.aperture_along_mm);
    read_number(root, "sonar", "aperture_across_mm", length_mm, &sonar.aperture_across_mm);
    read_pattern_file(root);

    static constexpr std::array<const char*, 5> kMarks = {"beam_half_angle_deg",
                                                          "piston_diameter_mm", "aperture_along_mm",
                                                          "aperture_across_mm", "pattern_file"};
    static constexpr std::array<BeamKind, 5> kKinds = {BeamKind::kCone, BeamKind::kPiston,
                                                       BeamKind::kAperture, BeamKind::kAperture,
                                                       BeamKind::kPattern};
    const toml::node* last = nullptr;
    std::vector<std::string> given;
    bool mixed = false;
    for (std::size_t i = 0; i < kMarks.size(); ++i) {
      const toml::node* const node = get(root, "sonar", kMarks[i]);
      if (node == nullptr) {
        continue;
      }
      mixed = mixed || (last != nullptr && sonar.beam != kKinds[i]);
      sonar.beam = kKinds[i];
      last = node;
      given.emplace_back(kMarks[i]);
    }
    if (given.empty()) {
      find_missing(
          "[sonar] needs one beam description: beam_half_angle_deg, or piston_diameter_mm and "
          "frequency_hz, or aperture_along_mm, aperture_across_mm and frequency_hz, or "
          "pattern_file");
      return;
    }
    if (mixed) {
      std::string names;
      for (const std::string& name : given) {
        names += (names.empty() ? "" : ", ") + name;
      }
      find(*last, "[sonar] more than one beam description (" + names + "): give exactly one");
      return;
    }
    const bool acoustic = sonar.beam == BeamKind::kPiston || sonar.beam == BeamKind::kAperture;
    if (acoustic && !has_frequency) {
      find(*last, "[sonar] " + given.back() + " needs frequency_hz as well");
    }
    if (sonar.beam == BeamKind::kAperture && given.size() == 1) {
      find(*last, "[sonar] an aperture needs both aperture_along_mm and aperture_across_mm");
    }
  }

  void read_pattern_file(const toml::table& root) {
    const toml::node* const node = get(root, "sonar", "pattern_file");
    if (node == nullptr) {
      return;
    }
    const std::string text = node->is_string() ? from_ascii(node->as_string()->get()) : "";
    if (text.empty() || text.find('\0') != std::string::npos) {
      find_value(*node, "sonar", "pattern_file", "has to be the name of a file");
      return;
    }
    const std::filesystem::path file(text);
    config_.sonar.pattern_file = file.is_absolute() || base_dir_.empty()
                                     ? text
                                     : (std::filesystem::path(base_dir_) / file).string();
  }

  void read_sonar(const toml::table& root) {
    SonarConfig& sonar = config_.sonar;
    const toml::node* const node = root.get("sonar");
    if (node != nullptr && !node->is_table()) {
      return;  // found by check_keys
    }
    read_beam(root);
    double cap_deg = 0;
    if (read_number(root, "sonar", "max_half_angle_deg", {0, 90, true}, &cap_deg)) {
      sonar.max_half_angle_deg = cap_deg;
    }
    read_number(root, "sonar", "sigma_pointing_deg", {0, 45}, &sonar.sigma_pointing_deg);
    read_number(root, "sonar", "sigma_range_mm", {0, 1e6}, &sonar.sigma_range_mm);
    constexpr auto kRange_mm = static_cast<double>(base::kMaxRange_um / 1000);
    read_integer(root, "sonar", "min_range_mm", {0, kRange_mm}, &sonar.min_range_mm);
    read_integer(root, "sonar", "max_range_mm", {1, kRange_mm}, &sonar.max_range_mm);
    if (get(root, "sonar", "max_range_mm") == nullptr) {
      sonar.max_range_mm = default_max_range_mm(config_.grid);
    }
    const toml::node* const min_range = get(root, "sonar", "min_range_mm");
    if (min_range != nullptr && sonar.max_range_mm > 0 &&
        sonar.min_range_mm >= sonar.max_range_mm) {
      find(*min_range,
           "[sonar] min_range_mm = " + std::to_string(sonar.min_range_mm) +
               ": has to be below max_range_mm = " + std::to_string(sonar.max_range_mm));
    }
    sonar.no_return = static_cast<NoReturn>(read_choice(root, "sonar", "no_return", kNoReturnNames,
                                                        static_cast<std::size_t>(sonar.no_return)));
    std::int64_t detect_mm = 0;
    const bool has_detect = get(root, "sonar", "detect_range_mm") != nullptr;
    if (read_integer(root, "sonar", "detect_range_mm", {1, kRange_mm}, &detect_mm)) {
      sonar.detect_range_mm = detect_mm;
      if (sonar.max_range_mm > 0 && detect_mm > sonar.max_range_mm) {
        find(*get(root, "sonar", "detect_range_mm"),
             "[sonar] detect_range_mm = " + std::to_string(detect_mm) +
                 ": has to be at most max_range_mm = " + std::to_string(sonar.max_range_mm));
      }
    }
    if (sonar.no_return == NoReturn::kEmpty && !has_detect) {
      find(*get(root, "sonar", "no_return"),
           "[sonar] no_return = empty: needs detect_range_mm, the range up to which a target would "
           "have been heard");
    }
    read_integer(root, "sonar", "sound_speed_mm_s", {200'000, 6'000'000}, &sonar.sound_speed_mm_s);
    read_number(root, "sonar", "detection_fraction", {0, 1, true, true}, &sonar.detection_fraction);
  }

  void read_navigation(const toml::table& root) {
    NavigationConfig& navigation = config_.navigation;
    const Limits sigma_mm = {0, 1e6};
    read_numbers(root, "navigation", "sigma_position_mm", sigma_mm, navigation.sigma_position_mm);
    read_numbers(root, "navigation", "sigma_correlated_mm", sigma_mm,
                 navigation.sigma_correlated_mm);
  }

  void read_model(const toml::table& root) {
    ModelConfig& model = config_.model;
    model.rule = static_cast<Rule>(
        read_choice(root, "model", "rule", kRuleNames, static_cast<std::size_t>(model.rule)));
    read_number(root, "model", "k_p", {0, 1, true}, &model.k_p);
  }

  void read_frame(const toml::table& root) {
    FrameConfig& frame = config_.frame;
    const toml::node* const lat = get(root, "frame", "lat");
    const toml::node* const lon = get(root, "frame", "lon");
    double degrees = 0;
    if (lat != nullptr && number_of(*lat, "frame", "lat", {-90, 90}, &degrees)) {
      frame.lat_deg = degrees;
    }
    if (lon != nullptr && number_of(*lon, "frame", "lon", {-180, 360}, &degrees)) {
      frame.lon_deg = degrees;
    }
    if ((lat == nullptr) != (lon == nullptr)) {
      find(lat == nullptr ? *lon : *lat, "[frame] lat and lon have to be given together");
    }
    std::int64_t epsg = 0;
    if (read_integer(root, "frame", "epsg", {1, 999'999}, &epsg)) {
      frame.epsg = static_cast<std::int32_t>(epsg);
    }
    const toml::node* const datum = get(root, "frame", "vertical_datum");
    if (datum == nullptr) {
      return;
    }
    const std::string text = datum->is_string() ? from_ascii(datum->as_string()->get()) : "\n";
    const bool good = text.size() <= 64 && std::none_of(text.begin(), text.end(), [](char c) {
                        return static_cast<unsigned char>(c) < 0x20U || c == 0x7F;
                      });
    if (!good) {
      find_value(*datum, "frame", "vertical_datum", "has to be a text of at most 64 bytes");
      return;
    }
    frame.vertical_datum = text;
  }

  std::string name_;
  std::string base_dir_;
  using Finding = std::pair<toml::source_index, std::string>;  ///< line, whole message
  std::vector<Finding> findings_;
  MapConfig config_;
};

// ---- Writing ------------------------------------------------------------------------------------

/// Collects `key, value` pairs per table in the order of the schema; both writers print it.
struct Entry {
  const char* table;
  const char* key;
  std::string value;
};

template <typename T>
std::string array_text(const T (&values)[3]) {
  std::string text = "[";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    text += axis == 0 ? "" : ", ";
    if constexpr (std::is_floating_point_v<T>) {
      text += json_number(values[axis]);
    } else {
      text += std::to_string(values[axis]);
    }
  }
  return text + "]";
}

std::vector<Entry> entries_of(const MapConfig& config) {
  std::vector<Entry> entries;
  const auto add = [&](const char* table, const char* key, std::string value) {
    entries.push_back({table, key, std::move(value)});
  };
  add("", "schema_version", std::to_string(config.schema_version));
  add("grid", "cell_mm", std::to_string(config.grid.cell_mm));
  add("grid", "size", array_text(config.grid.size));
  add("grid", "origin_mm", array_text(config.grid.origin_mm));
  const SonarConfig& sonar = config.sonar;
  switch (sonar.beam) {
    case BeamKind::kCone:
      add("sonar", "beam_half_angle_deg", json_number(sonar.beam_half_angle_deg));
      break;
    case BeamKind::kPiston:
      add("sonar", "piston_diameter_mm", json_number(sonar.piston_diameter_mm));
      break;
    case BeamKind::kAperture:
      add("sonar", "aperture_along_mm", json_number(sonar.aperture_along_mm));
      add("sonar", "aperture_across_mm", json_number(sonar.aperture_across_mm));
      break;
    case BeamKind::kPattern:
      add("sonar", "pattern_file", json_string(sonar.pattern_file));
      break;
  }
  if (sonar.frequency_hz > 0) {
    add("sonar", "frequency_hz", json_number(sonar.frequency_hz));
  }
  if (sonar.max_half_angle_deg) {
    add("sonar", "max_half_angle_deg", json_number(*sonar.max_half_angle_deg));
  }
  add("sonar", "sigma_pointing_deg", json_number(sonar.sigma_pointing_deg));
  add("sonar", "sigma_range_mm", json_number(sonar.sigma_range_mm));
  add("sonar", "min_range_mm", std::to_string(sonar.min_range_mm));
  add("sonar", "max_range_mm", std::to_string(sonar.max_range_mm));
  add("sonar", "no_return", json_string(no_return_name(sonar.no_return)));
  if (sonar.detect_range_mm) {
    add("sonar", "detect_range_mm", std::to_string(*sonar.detect_range_mm));
  }
  add("sonar", "sound_speed_mm_s", std::to_string(sonar.sound_speed_mm_s));
  add("sonar", "detection_fraction", json_number(sonar.detection_fraction));
  add("navigation", "sigma_position_mm", array_text(config.navigation.sigma_position_mm));
  add("navigation", "sigma_correlated_mm", array_text(config.navigation.sigma_correlated_mm));
  add("model", "rule", json_string(rule_name(config.model.rule)));
  add("model", "k_p", json_number(config.model.k_p));
  const FrameConfig& frame = config.frame;
  if (frame.lat_deg) {
    add("frame", "lat", json_number(*frame.lat_deg));
  }
  if (frame.lon_deg) {
    add("frame", "lon", json_number(*frame.lon_deg));
  }
  if (frame.epsg) {
    add("frame", "epsg", std::to_string(*frame.epsg));
  }
  if (frame.vertical_datum) {
    add("frame", "vertical_datum", json_string(*frame.vertical_datum));
  }
  return entries;
}

}  // namespace

const char* rule_name(Rule rule) { return kRuleNames[static_cast<std::size_t>(rule)]; }
const char* beam_kind_name(BeamKind kind) { return kBeamKindNames[static_cast<std::size_t>(kind)]; }
const char* no_return_name(NoReturn policy) {
  return kNoReturnNames[static_cast<std::size_t>(policy)];
}

std::int64_t default_max_range_mm(const GridConfig& grid) {
  double square_mm2 = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double low_mm = static_cast<double>(grid.origin_mm[axis]);
    const double high_mm = low_mm + static_cast<double>(grid.size[axis]) * grid.cell_mm;
    const double side_mm =
        axis == base::kDown ? std::max(high_mm, 0.0) - std::min(low_mm, 0.0) : high_mm - low_mm;
    square_mm2 += side_mm * side_mm;
  }
  constexpr auto kLongest_mm = static_cast<double>(base::kMaxRange_um / 1000);
  return static_cast<std::int64_t>(std::min(std::ceil(std::sqrt(square_mm2)), kLongest_mm));
}

MapConfig parse_map_config(std::string_view text, const std::string& name,
                           const std::string& base_dir) {
  return ConfigReader(name, base_dir).read(text);
}

MapConfig load_map_config(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    throw HostError(ExitCode::kUsage, path + ": is a directory, a TOML file is needed");
  }
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::string text;
  if (file) {
    text.assign(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  if (!file || file.bad()) {
    throw HostError(ExitCode::kUsage,
                    path + ": cannot read: " + std::strerror(errno != 0 ? errno : EIO));
  }
  return parse_map_config(text, path, std::filesystem::path(path).parent_path().string());
}

std::string map_config_to_toml(const MapConfig& config) {
  std::string text;
  std::string table;
  for (const Entry& entry : entries_of(config)) {
    if (table != entry.table) {
      table = entry.table;
      text += "\n[" + table + "]\n";
    }
    text += std::string(entry.key) + " = " + entry.value + "\n";
  }
  return text;
}

std::string map_config_to_json(const MapConfig& config) {
  std::string text = "{";
  std::string table;
  bool first = true;
  for (const Entry& entry : entries_of(config)) {
    if (table != entry.table) {
      text += table.empty() ? "" : "}";
      table = entry.table;
      text += ", " + json_string(table) + ": {";
      first = true;
    }
    text += (first ? "" : ", ") + json_string(entry.key) + ": " + entry.value;
    first = false;
  }
  return text + (table.empty() ? "}" : "}}");
}

}  // namespace leadline::host
