#include "firmware/config/migrate.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>

#include "firmware/config/exit_codes.hpp"
#include "firmware/config/text.hpp"
#include "firmware/config/vehicle_file.hpp"

namespace leadline::host {
namespace {

constexpr std::string_view kBlank = " \t\r";
constexpr const char* kVersionKey = "schema_version";

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) {
    return {};
  }
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

/// Follows strings and brackets over the lines of a value: whether the next line begins outside of both.
class ValueScan {
 public:
  [[nodiscard]] bool open() const { return depth_ > 0 || !quote_.empty(); }

  void line(std::string_view text) {
    for (std::size_t at = 0; at < text.size(); ++at) {
      if (!quote_.empty()) {
        if (quote_.front() == '"' && text[at] == '\\') {
          ++at;
        } else if (text.substr(at, quote_.size()) == quote_) {
          at += quote_.size() - 1;
          quote_.clear();
        }
      } else if (text[at] == '#') {
        break;
      } else if (text[at] == '"' || text[at] == '\'') {
        const std::string three(3, text[at]);
        quote_ = text.substr(at, 3) == three ? three : three.substr(0, 1);
        at += quote_.size() - 1;
      } else if (text[at] == '[' || text[at] == '{') {
        ++depth_;
      } else if (text[at] == ']' || text[at] == '}') {
        --depth_;
      }
    }
    if (quote_.size() == 1) {
      quote_.clear();  // such a string ends with its line
    }
  }

 private:
  int depth_ = 0;
  std::string quote_;
};

/// A line of the file: the table that it is in, and the key that it sets.
struct Line {
  std::string text;  ///< without its line break
  std::string table;
  int element = 0;  ///< counts the headers of that name
  std::string key;  ///< "" where none begins here
  std::size_t key_at = 0;
  bool header = false;
  std::vector<std::string> changes;  ///< to this line
};

std::vector<Line> lines_of(std::string_view text) {
  std::vector<Line> lines;
  std::string table;
  int element = 0;
  ValueScan value;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    Line line;
    line.text = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    const bool inside = value.open();
    const std::string_view code = trimmed(line.text);
    if (!inside && !code.empty() && code.front() == '[') {
      const std::size_t first = code.find_first_not_of("[ \t");
      const std::size_t last = code.find_first_of("] \t", std::min(first, code.size()));
      table = first < last ? code.substr(first, last - first) : code;
      element += 1;
      line.header = true;
    } else if (!inside && !code.empty() && code.front() != '#') {
      const std::size_t equals = line.text.find('=');
      std::string_view key = trimmed(std::string_view(line.text).substr(0, equals));
      line.key_at = line.text.find_first_not_of(kBlank);
      if (key.size() >= 2 && (key.front() == '"' || key.front() == '\'')) {
        key = key.substr(1, key.size() - 2);
        line.key_at += 1;
      }
      line.key = key;
      value.line(std::string_view(line.text).substr(equals == std::string::npos ? 0 : equals + 1));
    } else if (inside) {
      value.line(line.text);
    }
    line.table = table;
    line.element = element;
    lines.push_back(std::move(line));
  }
  return lines;
}

/// A file under change.
class Editor {
 public:
  Editor(std::string_view text, std::string name)
      : name_(std::move(name)),
        lines_(lines_of(text)),
        ends_(text.empty() || text.back() == '\n') {}

  [[nodiscard]] std::int64_t version(std::int64_t unsaid) const {
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      if (lines_[i].table.empty() && lines_[i].key == kVersionKey) {
        const std::string_view said = value_of(lines_[i]);
        std::int64_t number = 0;
        const auto parsed = std::from_chars(said.data(), said.data() + said.size(), number);
        if (parsed.ec != std::errc{} || parsed.ptr != said.data() + said.size()) {
          refuse(i, std::string(kVersionKey) + " = " + printable(said) + ": has to be a number");
        }
        return number;
      }
    }
    return unsaid;
  }

  void apply(const SchemaEdit& edit) {
    if (edit.kind == SchemaEdit::Kind::kRename) {
      rename(edit);
    } else {
      keep_default(edit);
    }
  }

  void set_version(std::int64_t version) {
    const std::string number = std::to_string(version);
    for (Line& line : lines_) {
      if (line.table.empty() && line.key == kVersionKey) {
        const std::size_t at = static_cast<std::size_t>(value_of(line).data() - line.text.data());
        const std::string before(value_of(line));
        line.text.replace(at, before.size(), number);
        if (before != number) {
          line.changes.push_back(std::string(kVersionKey) + " = " + number + ": was " + before);
        }
        return;
      }
    }
    // Before the first that is no comment: a key of the top level stands above all tables.
    std::size_t at = 0;
    while (at < lines_.size() && lines_[at].key.empty() && !lines_[at].header) {
      ++at;
    }
    insert(at, std::string(kVersionKey) + " = " + number, "");
    say(at, lines_[at].text + ": said from now on");
    if (at + 1 < lines_.size()) {
      insert(at + 1, "", "");
    }
  }

  [[nodiscard]] std::string text() const {
    std::string text;
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      text += lines_[i].text;
      text += i + 1 < lines_.size() || ends_ ? "\n" : "";
    }
    return text;
  }
  /// In the order of the lines, each with the number of its line in text().
  [[nodiscard]] std::vector<std::string> changes() const {
    std::vector<std::string> changes;
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      for (const std::string& what : lines_[i].changes) {
        changes.push_back(std::to_string(i + 1) + ": " + what);
      }
    }
    return changes;
  }

 private:
  [[noreturn]] void refuse(std::size_t at, const std::string& why) const {
    throw HostError(ExitCode::kUsage, name_ + ":" + std::to_string(at + 1) + ": " + why);
  }

  /// The value as far as it stands in this line, without a comment. A view of the line.
  [[nodiscard]] static std::string_view value_of(const Line& line) {
    const std::string_view text = line.text;
    const std::size_t equals = text.find('=');
    const std::string_view rest =
        equals == std::string_view::npos ? std::string_view() : text.substr(equals + 1);
    return trimmed(rest.substr(0, rest.find('#')));
  }

  void say(std::size_t at, const std::string& what) { lines_[at].changes.push_back(what); }

  void insert(std::size_t at, std::string text, const std::string& table) {
    Line line;
    line.text = std::move(text);
    line.table = table;
    line.element = at > 0 ? lines_[at - 1].element : 0;
    const std::size_t equals = line.text.find(" =");
    line.key = equals == std::string::npos ? "" : line.text.substr(0, equals);
    lines_.insert(lines_.begin() + static_cast<std::ptrdiff_t>(at), std::move(line));
  }

  void rename(const SchemaEdit& edit) {
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      Line& line = lines_[i];
      if (line.table != edit.table || line.key != edit.key) {
        continue;
      }
      const bool twice = std::any_of(lines_.begin(), lines_.end(), [&](const Line& other) {
        return other.table == line.table && other.element == line.element && other.key == edit.to;
      });
      if (twice) {
        refuse(i, "[" + line.table + "] " + line.key + " is now called " + edit.to +
                      ", which is there as well: keep one");
      }
      line.text.replace(line.key_at, line.key.size(), edit.to);
      say(i, "[" + line.table + "] " + line.key + " is now called " + edit.to);
      line.key = edit.to;
    }
  }

  void keep_default(const SchemaEdit& edit) {
    const std::string text = std::string(edit.key) + " = " + edit.to;
    const std::string why = "[" + std::string(edit.table) + "] " + text + ": the default until now";
    bool exists = false;
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      if (!lines_[i].header || lines_[i].table != edit.table) {
        continue;
      }
      exists = true;
      const bool said = std::any_of(lines_.begin(), lines_.end(), [&](const Line& other) {
        return other.table == edit.table && other.element == lines_[i].element &&
               other.key == edit.key;
      });
      if (!said) {
        insert(i + 1, text, edit.table);
        say(i + 1, why);
      }
    }
    if (!exists) {
      insert(lines_.size(), "", edit.table);
      insert(lines_.size(), "[" + std::string(edit.table) + "]", edit.table);
      lines_.back().header = true;
      lines_.back().key.clear();
      lines_.back().element += 1;
      insert(lines_.size(), text, edit.table);
      say(lines_.size() - 1, why);
    }
  }

  std::string name_;
  std::vector<Line> lines_;
  bool ends_;  ///< the last line has its break
};

}  // namespace

const std::vector<SchemaStep>& vehicle_schema_steps() {
  // 0: files from before the default of voxel_budget followed from the worst ping: their cycles had none.
  static const std::vector<SchemaStep> kSteps = {
      {0, {{SchemaEdit::Kind::kKeepDefault, "cycle", "voxel_budget", "0"}}},
  };
  return kSteps;
}

Migrated migrate_toml(std::string_view text, const std::string& name, std::int64_t unsaid,
                      const std::vector<SchemaStep>& steps) {
  Editor editor(text, name);
  const std::int64_t oldest = steps.front().version;
  const std::int64_t newest = steps.back().version + 1;
  const std::int64_t version = editor.version(unsaid);
  if (version < oldest || version > newest) {
    throw HostError(ExitCode::kUsage, name + ": schema version " + std::to_string(version) +
                                          " is none that this program knows: " +
                                          std::to_string(oldest) + " to " + std::to_string(newest));
  }
  for (const SchemaStep& step : steps) {
    if (step.version >= version) {
      for (const SchemaEdit& edit : step.edits) {
        editor.apply(edit);
      }
    }
  }
  editor.set_version(newest);
  return {editor.text(), version, editor.changes()};
}

}  // namespace leadline::host
