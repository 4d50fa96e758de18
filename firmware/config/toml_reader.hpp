// Reading a TOML file so that one run shows all that is wrong with it: unknown keys with a suggestion,
// values outside their limits, each finding as `FILE:LINE: [table] key = value: reason`. Integers are
// accepted for decimals, whole decimals (1000.0) for integers.
//
//   TomlReader reader(text, "vehicle.toml", known_tables);      // throws when it is not TOML
//   const TomlSection grid = reader.section("grid");
//   grid.read_integer("cell_mm", {1, 1'000'000}, &cell_mm);
//   for (const TomlSection& port : reader.sections("port")) ...
//   reader.finish();                                            // throws when anything was found
//
// toml++ stays inside the .cpp: it is compiled there, once, with an assertion that throws.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace leadline::host {

/// Limits of one number, below 2^53. The lower one may be excluded ("over 0"), the upper one too. Those of integer keys
/// are whole numbers.
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
  [[nodiscard]] std::string text() const;

 private:
  double low_;
  double high_;
  bool low_excluded_;
  bool high_excluded_;
};

/// A table that may occur, and every key that it may have: what is not here is an error.
struct KnownTable {
  std::string name;  ///< "" for the top level, whose keys include the names of the tables
  std::vector<std::string> keys;
  bool repeated = false;  ///< written [[name]]
};

class TomlReader;

/// One [table], or one element of [[table]]; absent ones have no keys. Reading a key that is not there
/// leaves the value as it was; what is there and wrong leaves a finding as well. The bool returned
/// tells whether a good value was read. A view: valid as long as its reader.
class TomlSection {
 public:
  [[nodiscard]] bool exists() const { return table_ != nullptr; }
  [[nodiscard]] bool has(const char* key) const;
  /// Where it stands in the file, from 1; 0: it does not.
  [[nodiscard]] std::uint32_t line(const char* key) const;

  bool read_number(const char* key, const Limits& limits, double* value) const;
  bool read_integer(const char* key, const Limits& limits, std::int64_t* value) const;
  /// Arrays of three. `hint` says what they are, for the message: "[north, east, down]".
  bool read_numbers(const char* key, const Limits& limits, double (&values)[3],
                    const char* hint = kAxes) const;
  bool read_integers(const char* key, const Limits (&limits)[3], std::int64_t (&values)[3],
                     const char* hint = kAxes) const;
  bool read_bool(const char* key, bool* value) const;
  /// Index of a name among `names`, or `fallback`.
  template <std::size_t N>
  [[nodiscard]] std::size_t read_choice(const char* key, const std::array<const char*, N>& names,
                                        std::size_t fallback) const {
    return choose(key, names.data(), N, fallback);
  }
  [[nodiscard]] std::size_t read_choice(const char* key, const char* const* names,
                                        std::size_t count, std::size_t fallback) const {
    return choose(key, names, count, fallback);
  }
  /// UTF-8 text of at most `max_bytes` without control characters.
  bool read_text(const char* key, std::size_t max_bytes, std::string* value) const;
  /// Name of a file, not empty, of at most 4095 bytes without control characters; a relative one is relative to `base_dir` ("" leaves it as it is).
  bool read_path(const char* key, const std::string& base_dir, std::string* value) const;

  /// A finding at the line of `key`, which must be there: "[table] key = value: why".
  void refuse(const char* key, const std::string& why) const;
  /// A finding at the line of `key`, which must be there: "[table] what".
  void find(const char* key, const std::string& what) const;
  /// A finding about what is not there: "[table] what", at the line of a [[table]]'s header, for
  /// others behind everything that has a line.
  void find_missing(const std::string& what) const;

  static constexpr const char* kAxes = "[north, east, down]";

 private:
  friend class TomlReader;
  TomlSection(TomlReader* reader, const void* table, std::string label, bool repeated)
      : reader_(reader), table_(table), label_(std::move(label)), repeated_(repeated) {}

  [[nodiscard]] const void* get(const char* key) const;
  [[nodiscard]] std::size_t choose(const char* key, const char* const* names, std::size_t count,
                                   std::size_t fallback) const;
  [[nodiscard]] std::string shown(const std::string& key) const;
  void refuse_node(const void* node, const std::string& key, const std::string& why) const;
  bool number_of(const void* node, const std::string& key, const Limits& limits,
                 double* value) const;
  bool integer_of(const void* node, const std::string& key, const Limits& limits,
                  std::int64_t* value) const;
  [[nodiscard]] const void* triple(const char* key, const char* hint) const;

  TomlReader* reader_;
  const void* table_;
  std::string label_;  ///< "[grid]", "[[port]]", "" for the top level
  bool repeated_;
};

/// Host code. Every error is a HostError kUsage.
class TomlReader {
 public:
  /// Parses, and checks every key against `known`. `name` stands for the file in messages. Throws
  /// when the text is not TOML or not UTF-8.
  TomlReader(std::string_view text, std::string name, std::vector<KnownTable> known);
  ~TomlReader();
  TomlReader(const TomlReader&) = delete;
  TomlReader& operator=(const TomlReader&) = delete;

  [[nodiscard]] TomlSection root();
  [[nodiscard]] TomlSection section(const char* name);
  /// Elements of [[name]], in the order of the file.
  [[nodiscard]] std::vector<TomlSection> sections(const char* name);
  /// Key schema_version, optional: anything but `version` is a finding.
  void read_schema_version(std::int64_t version);
  /// A finding without a line: behind those that have one.
  void find_missing(const std::string& what);
  /// Throws what was found, a line each in the order of the file; returns when there is nothing.
  void finish() const;

 private:
  friend class TomlSection;
  struct Document;

  void find_at(std::uint32_t line, const std::string& what);
  void check_keys();
  void check_table(const void* table, const KnownTable& known);
  [[nodiscard]] std::string hint_for(const KnownTable& known, const std::string& name) const;

  std::string name_;
  std::vector<KnownTable> known_;
  std::unique_ptr<Document> document_;
  std::vector<std::pair<std::uint32_t, std::string>> findings_;  ///< line, whole message
};

/// The bytes of a text file. Throws HostError kUsage: a directory, cannot be read.
[[nodiscard]] std::string read_config_text(const std::string& path);

/// `key = value` pairs in the order of a schema: the resolved configuration, for both writers.
struct ConfigEntry {
  std::string table;  ///< "" for the top level
  std::string key;
  std::string value;  ///< as TOML and as JSON
  int element = -1;   ///< number in a [[table]], -1 for a [table]
};
[[nodiscard]] std::string entries_to_toml(const std::vector<ConfigEntry>& entries);
/// One JSON object: tables are objects, [[tables]] arrays of objects.
[[nodiscard]] std::string entries_to_json(const std::vector<ConfigEntry>& entries);

}  // namespace leadline::host
