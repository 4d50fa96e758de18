#include "firmware/config/toml_reader.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <sstream>
#include <utility>

#include "firmware/config/exit_codes.hpp"
#include "firmware/config/input_file.hpp"
#include "firmware/config/text.hpp"

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

constexpr std::uint32_t kNoLine = std::numeric_limits<std::uint32_t>::max();

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

constexpr std::size_t kLongestPath_bytes = 4095;  // Linux takes no longer one

std::string value_text(const toml::node& node) {
  if (const auto* const text = node.as_string()) {
    return "\"" + printable(from_ascii(text->get()), 60) + "\"";
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

/// The first line after which the parser asserts.
std::size_t line_of_assertion(std::string_view text) {
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

toml::table parse_toml(std::string_view text, const std::string& name) {
  if (text.substr(0, 3) == "\xEF\xBB\xBF") {
    text.remove_prefix(3);
  }
  const auto refuse = [&](std::size_t line, const std::string& why) -> HostError {
    return {ExitCode::kUsage, name + ":" + std::to_string(line) + ": " + why};
  };
  if (const std::size_t valid = valid_utf8_bytes(text); valid != text.size()) {
    const auto lines =
        std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(valid), '\n');
    throw refuse(1 + static_cast<std::size_t>(lines), "not valid TOML: not UTF-8 text");
  }
  if (const std::size_t line = line_of_escaped_tilde(text); line != 0) {
    throw refuse(line, "write ~ itself, not its escape");
  }
  try {
    return toml::parse(to_ascii(text), std::string_view(name));
  } catch (const toml::parse_error& error) {
    throw refuse(error.source().begin.line,
                 "not valid TOML: " + printable(error.description(), 200));
  } catch (const TomlAssertion&) {
    throw refuse(line_of_assertion(text), "not valid TOML: a character where none can be");
  }
}

const toml::table* as_table(const void* table) { return static_cast<const toml::table*>(table); }
const toml::node* as_node(const void* node) { return static_cast<const toml::node*>(node); }

std::string element_name(const char* key, std::size_t axis) {
  return std::string(key) + "[" + std::to_string(axis) + "]";
}

bool has_control_characters(const std::string& text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) < 0x20U || c == 0x7F; });
}

bool knows(const KnownTable& table, const std::string& key) {
  return std::find(table.keys.begin(), table.keys.end(), key) != table.keys.end();
}

std::string header_of(const KnownTable& table) {
  return table.repeated ? "[[" + table.name + "]]" : "[" + table.name + "]";
}

}  // namespace

struct TomlReader::Document {
  toml::table root;
};

// ---- Limits -------------------------------------------------------------------------------------

std::string Limits::text() const {
  // 1000000 reads better than 1e+06.
  const auto plain = [](double value) {
    return std::trunc(value) == value ? std::to_string(static_cast<std::int64_t>(value))
                                      : json_number(value);
  };
  return std::string(low_excluded_ ? "over " : "") + plain(low_) +
         (high_excluded_ ? " to below " : " to ") + plain(high_);
}

// ---- Section: keys ------------------------------------------------------------------------------

const void* TomlSection::get(const char* key) const {
  return table_ == nullptr ? nullptr : as_table(table_)->get(key);
}

bool TomlSection::has(const char* key) const { return get(key) != nullptr; }

std::string TomlSection::shown(const std::string& key) const {
  return label_.empty() ? key : label_ + " " + key;
}

void TomlSection::refuse_node(const void* node, const std::string& key,
                              const std::string& why) const {
  reader_->find_at(as_node(node)->source().begin.line,
                   shown(key) + " = " + value_text(*as_node(node)) + ": " + why);
}

void TomlSection::refuse(const char* key, const std::string& why) const {
  refuse_node(get(key), key, why);
}

std::uint32_t TomlSection::line(const char* key) const {
  const toml::node* const node = as_node(get(key));
  return node != nullptr ? node->source().begin.line : 0;
}

void TomlSection::find(const char* key, const std::string& what) const {
  reader_->find_at(line(key), shown(what));
}

void TomlSection::find_missing(const std::string& what) const {
  if (repeated_) {
    reader_->find_at(as_table(table_)->source().begin.line, shown(what));
    return;
  }
  reader_->find_missing(shown(what));
}

// ---- Section: values ----------------------------------------------------------------------------

bool TomlSection::number_of(const void* node, const std::string& key, const Limits& limits,
                            double* value) const {
  double number = 0;
  if (const auto* const integer = as_node(node)->as_integer()) {
    number = static_cast<double>(integer->get());
  } else if (const auto* const decimal = as_node(node)->as_floating_point()) {
    number = decimal->get();
  } else {
    refuse_node(node, key, "has to be a number, " + limits.text());
    return false;
  }
  if (!limits.contain(number)) {
    refuse_node(node, key, "has to be " + limits.text());
    return false;
  }
  *value = number + 0.0;  // -0 becomes 0
  return true;
}

bool TomlSection::integer_of(const void* node, const std::string& key, const Limits& limits,
                             std::int64_t* value) const {
  std::int64_t number = 0;
  if (const auto* const integer = as_node(node)->as_integer()) {
    number = integer->get();
  } else if (const auto* const decimal = as_node(node)->as_floating_point()) {
    const double real = decimal->get();
    // Limits of integer keys are below 2^53, where every whole double is exact.
    if (limits.contain(real) && !(std::trunc(real) == real)) {
      refuse_node(node, key, "has to be a whole number, " + limits.text());
      return false;
    }
    if (!limits.contain(real)) {
      refuse_node(node, key, "has to be " + limits.text());
      return false;
    }
    number = static_cast<std::int64_t>(real);
  } else {
    refuse_node(node, key, "has to be a whole number, " + limits.text());
    return false;
  }
  if (!limits.contain(static_cast<double>(number))) {
    refuse_node(node, key, "has to be " + limits.text());
    return false;
  }
  *value = number;
  return true;
}

bool TomlSection::read_number(const char* key, const Limits& limits, double* value) const {
  const void* const node = get(key);
  return node != nullptr && number_of(node, key, limits, value);
}

bool TomlSection::read_integer(const char* key, const Limits& limits, std::int64_t* value) const {
  const void* const node = get(key);
  return node != nullptr && integer_of(node, key, limits, value);
}

const void* TomlSection::triple(const char* key, const char* hint) const {
  const void* const node = get(key);
  if (node == nullptr) {
    return nullptr;
  }
  const toml::array* const array = as_node(node)->as_array();
  if (array == nullptr || array->size() != 3) {
    refuse_node(node, key, std::string("has to be an array of three: ") + hint);
    return nullptr;
  }
  return array;
}

bool TomlSection::read_integers(const char* key, const Limits (&limits)[3],
                                std::int64_t (&values)[3], const char* hint) const {
  const auto* const array = static_cast<const toml::array*>(triple(key, hint));
  bool good = array != nullptr;
  for (std::size_t axis = 0; array != nullptr && axis < 3; ++axis) {
    const toml::node& node = (*array)[axis];
    good = integer_of(&node, element_name(key, axis), limits[axis], &values[axis]) && good;
  }
  return good;
}

bool TomlSection::read_numbers(const char* key, const Limits& limits, double (&values)[3],
                               const char* hint) const {
  const auto* const array = static_cast<const toml::array*>(triple(key, hint));
  bool good = array != nullptr;
  for (std::size_t axis = 0; array != nullptr && axis < 3; ++axis) {
    const toml::node& node = (*array)[axis];
    good = number_of(&node, element_name(key, axis), limits, &values[axis]) && good;
  }
  return good;
}

bool TomlSection::read_bool(const char* key, bool* value) const {
  const void* const node = get(key);
  if (node == nullptr) {
    return false;
  }
  const auto* const boolean = as_node(node)->as_boolean();
  if (boolean == nullptr) {
    refuse_node(node, key, "has to be true or false");
    return false;
  }
  *value = boolean->get();
  return true;
}

std::size_t TomlSection::choose(const char* key, const char* const* names, std::size_t count,
                                std::size_t fallback) const {
  const void* const node = get(key);
  if (node == nullptr) {
    return fallback;
  }
  const auto* const text = as_node(node)->as_string();
  std::string choices;
  for (std::size_t i = 0; i < count; ++i) {
    if (text != nullptr && text->get() == names[i]) {
      return i;
    }
    choices += (i == 0 ? "\"" : ", \"") + std::string(names[i]) + "\"";
  }
  refuse_node(node, key, "has to be one of " + choices);
  return fallback;
}

bool TomlSection::read_text(const char* key, std::size_t max_bytes, std::string* value) const {
  const void* const node = get(key);
  if (node == nullptr) {
    return false;
  }
  const auto* const string = as_node(node)->as_string();
  const std::string text = string != nullptr ? from_ascii(string->get()) : "\n";
  if (text.size() > max_bytes || has_control_characters(text)) {
    refuse_node(node, key,
                "has to be a text of at most " + std::to_string(max_bytes) +
                    " bytes, without control characters");
    return false;
  }
  *value = text;
  return true;
}

bool TomlSection::read_path(const char* key, const std::string& base_dir,
                            std::string* value) const {
  const void* const node = get(key);
  if (node == nullptr) {
    return false;
  }
  const auto* const string = as_node(node)->as_string();
  const std::string text = string != nullptr ? from_ascii(string->get()) : "";
  if (text.empty() || text.size() > kLongestPath_bytes || has_control_characters(text)) {
    refuse_node(node, key,
                "has to be the name of a file, at most " + std::to_string(kLongestPath_bytes) +
                    " bytes, without control characters");
    return false;
  }
  const std::filesystem::path file(text);
  *value = file.is_absolute() || base_dir.empty()
               ? text
               : (std::filesystem::path(base_dir) / file).string();
  return true;
}

// ---- Reader -------------------------------------------------------------------------------------

TomlReader::TomlReader(std::string_view text, std::string name, std::vector<KnownTable> known)
    : name_(std::move(name)),
      known_(std::move(known)),
      document_(std::make_unique<Document>(Document{parse_toml(text, name_)})) {
  check_keys();
}

TomlReader::~TomlReader() = default;

TomlSection TomlReader::root() { return {this, &document_->root, "", false}; }

TomlSection TomlReader::section(const char* name) {
  const toml::node* const node = document_->root.get(name);
  return {this, node == nullptr ? nullptr : node->as_table(), "[" + std::string(name) + "]", false};
}

std::vector<TomlSection> TomlReader::sections(const char* name) {
  std::vector<TomlSection> result;
  const toml::node* const node = document_->root.get(name);
  const toml::array* const array = node == nullptr ? nullptr : node->as_array();
  for (std::size_t i = 0; array != nullptr && i < array->size(); ++i) {
    if (const toml::table* const table = (*array)[i].as_table()) {
      result.push_back({this, table, "[[" + std::string(name) + "]]", true});
    }
  }
  return result;
}

void TomlReader::read_schema_version(std::int64_t version) {
  const toml::node* const node = document_->root.get("schema_version");
  if (node == nullptr) {
    return;
  }
  const auto* const integer = node->as_integer();
  if (integer == nullptr || integer->get() != version) {
    root().refuse("schema_version", "this program reads schema version " + std::to_string(version));
  }
}

void TomlReader::find_at(std::uint32_t line, const std::string& what) {
  findings_.emplace_back(line, name_ + ":" + std::to_string(line) + ": " + what);
}

/// What is not there has no line: after everything that has one.
void TomlReader::find_missing(const std::string& what) {
  findings_.emplace_back(kNoLine, name_ + ": " + what);
}

void TomlReader::finish() const {
  if (findings_.empty()) {
    return;
  }
  auto sorted = findings_;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string message;
  for (const auto& finding : sorted) {
    message += (message.empty() ? "" : "\n") + finding.second;
  }
  throw HostError(ExitCode::kUsage, message);
}

void TomlReader::check_keys() {
  for (const KnownTable& known : known_) {
    if (known.name.empty()) {
      check_table(&document_->root, known);
      continue;
    }
    const toml::node* const node = document_->root.get(known.name);
    if (node == nullptr) {
      continue;
    }
    const auto refuse = [&](const toml::node& wrong) {
      find_at(wrong.source().begin.line, known.name + ": has to be a table: " + header_of(known));
    };
    if (!known.repeated) {
      node->is_table() ? check_table(node->as_table(), known) : refuse(*node);
      continue;
    }
    const toml::array* const array = node->as_array();
    if (array == nullptr) {
      refuse(*node);
      continue;
    }
    for (const toml::node& element : *array) {
      element.is_table() ? check_table(element.as_table(), known) : refuse(element);
    }
  }
}

void TomlReader::check_table(const void* table, const KnownTable& known) {
  for (const auto& [key, node] : *as_table(table)) {
    const std::string name = from_ascii(key.str());
    if (knows(known, name)) {
      continue;
    }
    const std::string label = known.name.empty() ? "" : header_of(known) + " ";
    find_at(key.source().begin.line,
            label + printable(name) + ": unknown key" + hint_for(known, name));
  }
}

std::string TomlReader::hint_for(const KnownTable& known, const std::string& name) const {
  for (auto other = known_.rbegin(); other != known_.rend(); ++other) {
    if (!other->name.empty() && knows(*other, name)) {
      return "; it belongs to " + header_of(*other);
    }
  }
  if (const std::string near = closest_name(name, known.keys); !near.empty()) {
    return "; did you mean \"" + near + "\"?";
  }
  for (const KnownTable& other : known_) {
    if (const std::string near = closest_name(name, other.keys); !near.empty()) {
      return "; did you mean \"" + near + "\"" +
             (other.name.empty() ? std::string("?") : " of " + header_of(other) + "?");
    }
  }
  std::string hint = "; known are:";
  for (const std::string& candidate : known.keys) {
    hint += " " + candidate;
  }
  return hint;
}

// ---- Files --------------------------------------------------------------------------------------

std::string read_config_text(const std::string& path) { return read_input(path, ExitCode::kUsage); }

std::string entries_to_toml(const std::vector<ConfigEntry>& entries) {
  std::string text;
  std::string table;
  int element = -1;
  for (const ConfigEntry& entry : entries) {
    if (table != entry.table || element != entry.element) {
      table = entry.table;
      element = entry.element;
      text += element < 0 ? "\n[" + table + "]\n" : "\n[[" + table + "]]\n";
    }
    text += entry.key + " = " + entry.value + "\n";
  }
  return text;
}

std::string entries_to_json(const std::vector<ConfigEntry>& entries) {
  std::string text = "{";
  const ConfigEntry* last = nullptr;
  for (const ConfigEntry& entry : entries) {
    const bool same_table = last != nullptr && last->table == entry.table;
    const bool same_object = same_table && last->element == entry.element;
    if (last != nullptr && !same_object && !last->table.empty()) {
      text += last->element >= 0 && !same_table ? "}]" : "}";
    }
    text += last == nullptr ? "" : ", ";
    if (!same_object && !entry.table.empty()) {
      text += same_table ? "{" : json_string(entry.table) + (entry.element >= 0 ? ": [{" : ": {");
    }
    text += json_string(entry.key) + ": " + entry.value;
    last = &entry;
  }
  if (last != nullptr && !last->table.empty()) {
    text += last->element >= 0 ? "}]" : "}";
  }
  return text + "}";
}

}  // namespace leadline::host
