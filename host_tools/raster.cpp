#include "host_tools/raster.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <optional>
#include <system_error>

#include "firmware/config/input_file.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) {
    if (c >= 'A' && c <= 'Z') {
      c = static_cast<char>(c - 'A' + 'a');
    }
  }
  return result;
}

std::string quoted(std::string_view text) { return "\"" + printable(text) + "\""; }

std::string shortest(double value) {
  char buffer[32];
  const auto result = std::to_chars(buffer, buffer + sizeof buffer, value);
  return std::string(buffer, result.ptr);
}

/// Splits text at blanks and remembers where it is, for messages.
class Tokens {
 public:
  Tokens(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  /// The next token; empty at the end of the text.
  std::string_view next() {
    while (position_ < text_.size() && is_blank(text_[position_])) {
      if (text_[position_] == '\n') {
        ++line_;
        field_ = 0;
      }
      ++position_;
    }
    const std::size_t begin = position_;
    while (position_ < text_.size() && !is_blank(text_[position_])) {
      ++position_;
    }
    if (position_ > begin) {
      ++field_;
    }
    return text_.substr(begin, position_ - begin);
  }

  /// Error at the token that next() returned last.
  [[noreturn]] void fail(const std::string& reason) const {
    throw HostError(ExitCode::kInput, name_ + ":" + std::to_string(line_) + ": field " +
                                          std::to_string(field_) + ": " + reason);
  }

  [[nodiscard]] std::size_t bytes_left() const { return text_.size() - position_; }

 private:
  std::string_view text_;
  const std::string& name_;
  std::size_t position_ = 0;
  std::size_t line_ = 1;
  std::size_t field_ = 0;
};

/// The whole token as a number; false when it is not one. Infinities and NaN are numbers here.
bool to_number(std::string_view token, double* value) {
  if (!token.empty() && token.front() == '+') {
    token.remove_prefix(1);  // from_chars knows no plus sign
    if (!token.empty() && (token.front() == '-' || token.front() == '+')) {
      return false;
    }
  }
  const auto result = std::from_chars(token.data(), token.data() + token.size(), *value);
  return result.ec == std::errc() && result.ptr == token.data() + token.size();
}

double header_number(Tokens* tokens, const std::string& key) {
  const std::string_view token = tokens->next();
  double value = 0.0;
  if (token.empty()) {
    tokens->fail("the value of " + key + " is missing");
  }
  if (!to_number(token, &value) || !std::isfinite(value)) {
    tokens->fail(key + " is " + quoted(token) + ", not a finite number");
  }
  return value;
}

int header_count(Tokens* tokens, const std::string& key) {
  const double value = header_number(tokens, key);
  if (value < 1.0 || value > static_cast<double>(kMaxRasterCells) || value != std::floor(value)) {
    tokens->fail(key + " is " + shortest(value) + ", expected a whole number from 1 to " +
                 std::to_string(kMaxRasterCells));
  }
  return static_cast<int>(value);
}

struct Header {
  std::optional<int> columns;
  std::optional<int> rows;
  std::optional<double> west_m;
  std::optional<double> south_m;
  std::optional<double> cell_m;
  std::optional<double> nodata;
  bool west_is_centre = false;
  bool south_is_centre = false;
};

template <typename T>
void set_once(Tokens* tokens, const std::string& key, std::optional<T>* slot, T value) {
  if (slot->has_value()) {
    tokens->fail(key + " is given twice");
  }
  *slot = value;
}

/// Reads keys until the first token that is a value, which is returned.
std::string_view parse_header(Tokens* tokens, Header* header) {
  while (true) {
    const std::string_view token = tokens->next();
    const bool is_key = !token.empty() && ((token.front() >= 'a' && token.front() <= 'z') ||
                                           (token.front() >= 'A' && token.front() <= 'Z'));
    double number = 0.0;
    if (!is_key || to_number(token, &number)) {
      return token;  // "nan" is a value although it starts with a letter
    }
    const std::string key = lower(token);
    if (key == "ncols") {
      set_once(tokens, key, &header->columns, header_count(tokens, key));
    } else if (key == "nrows") {
      set_once(tokens, key, &header->rows, header_count(tokens, key));
    } else if (key == "xllcorner" || key == "xllcenter") {
      set_once(tokens, key, &header->west_m, header_number(tokens, key));
      header->west_is_centre = key == "xllcenter";
    } else if (key == "yllcorner" || key == "yllcenter") {
      set_once(tokens, key, &header->south_m, header_number(tokens, key));
      header->south_is_centre = key == "yllcenter";
    } else if (key == "cellsize") {
      const double value = header_number(tokens, key);
      if (!(value > 0.0)) {
        tokens->fail("cellsize is " + shortest(value) + ", expected a number over zero");
      }
      set_once(tokens, key, &header->cell_m, value);
    } else if (key == "nodata_value") {
      const std::string_view value_token = tokens->next();
      double value = 0.0;
      if (!to_number(value_token, &value)) {
        tokens->fail("NODATA_value is " + quoted(value_token) + ", not a number");
      }
      set_once(tokens, key, &header->nodata, value);
    } else {
      tokens->fail("unknown header key " + quoted(token) +
                   " (known: ncols, nrows, xllcorner, xllcenter, yllcorner, yllcenter, cellsize, "
                   "NODATA_value)");
    }
  }
}

}  // namespace

std::size_t Raster::known_count() const {
  return static_cast<std::size_t>(
      std::count_if(values.begin(), values.end(), [](double value) { return !std::isnan(value); }));
}

Raster make_raster(int columns, int rows, double west_m, double south_m, double cell_m,
                   double fill) {
  Raster raster;
  raster.columns = columns;
  raster.rows = rows;
  raster.west_m = west_m;
  raster.south_m = south_m;
  raster.cell_m = cell_m;
  raster.values.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), fill);
  return raster;
}

Raster negated(const Raster& raster) {
  Raster result = raster;
  for (double& value : result.values) {
    value = -value;
  }
  return result;
}

bool same_geometry(const Raster& a, const Raster& b) {
  const double tolerance_m = 1e-3 * std::min(a.cell_m, b.cell_m);
  // The far edges as well: a small difference of the cell adds up over the raster.
  return a.columns == b.columns && a.rows == b.rows &&
         std::fabs(a.west_m - b.west_m) <= tolerance_m &&
         std::fabs(a.south_m - b.south_m) <= tolerance_m &&
         std::fabs(a.east_m() - b.east_m()) <= tolerance_m &&
         std::fabs(a.north_m() - b.north_m()) <= tolerance_m;
}

std::string describe_geometry(const Raster& raster) {
  return std::to_string(raster.columns) + " x " + std::to_string(raster.rows) + " cells of " +
         shortest(raster.cell_m) + " m from east " + shortest(raster.west_m) + ", north " +
         shortest(raster.south_m);
}

Raster parse_esri_ascii(std::string_view text, const std::string& name) {
  Tokens tokens(text, name);
  Header header;
  std::string_view token = parse_header(&tokens, &header);
  for (const auto& [present, key] :
       {std::pair{header.columns.has_value(), "ncols"}, std::pair{header.rows.has_value(), "nrows"},
        std::pair{header.west_m.has_value(), "xllcorner"},
        std::pair{header.south_m.has_value(), "yllcorner"},
        std::pair{header.cell_m.has_value(), "cellsize"}}) {
    if (!present) {
      tokens.fail(std::string("the header has no ") + key + " (not an ESRI ASCII grid?)");
    }
  }
  const std::size_t count =
      static_cast<std::size_t>(*header.columns) * static_cast<std::size_t>(*header.rows);
  if (count > kMaxRasterCells) {
    tokens.fail("ncols x nrows = " + std::to_string(count) + " cells, the limit is " +
                std::to_string(kMaxRasterCells));
  }
  const double cell_m = *header.cell_m;
  const double west_m = *header.west_m - (header.west_is_centre ? 0.5 * cell_m : 0.0);
  const double south_m = *header.south_m - (header.south_is_centre ? 0.5 * cell_m : 0.0);
  const double nodata = header.nodata.value_or(kRasterNodata);
  Raster raster = make_raster(0, 0, west_m, south_m, cell_m);
  raster.columns = *header.columns;
  raster.rows = *header.rows;
  if (!std::isfinite(raster.east_m()) || !std::isfinite(raster.north_m())) {
    tokens.fail("the raster's far edge is not finite");
  }
  // A value takes a digit and a blank: no more is reserved than the text can hold, whatever the header
  // promises.
  raster.values.reserve(std::min(count, tokens.bytes_left() / 2 + 1));
  for (std::size_t i = 0; i < count; ++i) {
    if (token.empty()) {
      tokens.fail("the file ends after " + std::to_string(i) + " of " + std::to_string(count) +
                  " values");
    }
    double value = 0.0;
    if (!to_number(token, &value)) {
      tokens.fail(quoted(token) + " is not a number");
    }
    const bool is_nodata = value == nodata || (std::isnan(value) && std::isnan(nodata));
    if (!is_nodata && !std::isfinite(value)) {
      tokens.fail(quoted(token) + " is not finite");
    }
    raster.values.push_back(is_nodata ? kNoValue : value);
    token = tokens.next();
  }
  if (!token.empty()) {
    tokens.fail(quoted(token) + " after the last of " + std::to_string(count) + " values");
  }
  return raster;
}

Raster read_esri_ascii(const std::string& path) { return parse_esri_ascii(read_input(path), path); }

std::string format_esri_ascii(const Raster& raster, int decimals) {
  decimals = std::clamp(decimals, 0, 9);
  std::string text = "ncols " + std::to_string(raster.columns) + "\nnrows " +
                     std::to_string(raster.rows) + "\nxllcorner " + shortest(raster.west_m) +
                     "\nyllcorner " + shortest(raster.south_m) + "\ncellsize " +
                     shortest(raster.cell_m) + "\nNODATA_value -9999\n";
  const double step = std::pow(10.0, -decimals);
  text.reserve(text.size() + raster.values.size() * 10);
  char buffer[512];  // the longest double in fixed notation has 309 digits before the point
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      if (column > 0) {
        text += ' ';
      }
      double value = raster.at(row, column);
      if (std::isnan(value)) {
        text += "-9999";
        continue;
      }
      if (std::fabs(value - kRasterNodata) <= 0.5 * step) {
        value = kRasterNodata + step;
      }
      if (std::fabs(value) <= 0.5 * step) {
        value = 0.0;  // no "-0.0000"
      }
      const auto result =
          std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::fixed, decimals);
      text.append(buffer, result.ptr);
    }
    text += '\n';
  }
  return text;
}

int raster_decimals(double cell_m) {
  const double step_m = cell_m / 2560.0;
  return std::clamp(static_cast<int>(std::ceil(-std::log10(step_m))), 3, 9);
}

void write_esri_ascii(const Raster& raster, const std::string& path, int decimals) {
  write_file_whole(path, format_esri_ascii(raster, decimals));
}

}  // namespace leadline::host
