#include "host_tools/ping_csv.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

using base::Bam32;
__extension__ typedef unsigned __int128 UInt128;  // NOLINT: a typedef takes the extension mark

constexpr std::size_t kBuffer_bytes = std::size_t{1} << 20U;

constexpr std::array<std::uint64_t, 19> kPow10 = [] {
  std::array<std::uint64_t, 19> table{};
  std::uint64_t power = 1;
  for (std::uint64_t& entry : table) {
    entry = power;
    power *= 10;
  }
  return table;
}();

bool is_blank(char c) { return c == ' ' || c == '\t'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) {
    text.remove_prefix(1);
  }
  while (!text.empty() && (is_blank(text.back()) || text.back() == '\r')) {
    text.remove_suffix(1);
  }
  return text;
}

// ---- Decimals, any length -----------------------------------------------------------------------

/// A decimal number as written: 0.d[0]d[1]... * 10^point, first digit not zero; zero has no digits.
struct Decimal {
  bool negative = false;
  std::string digits;
  std::int64_t point = 0;

  /// Digit with the weight 10^(point - 1 - index); zeros go on for ever on both sides.
  [[nodiscard]] unsigned digit(std::int64_t index) const {
    if (index < 0 || index >= static_cast<std::int64_t>(digits.size())) {
      return 0;
    }
    return static_cast<unsigned>(digits[static_cast<std::size_t>(index)] - '0');
  }
};

/// Larger exponents count as this one: far beyond any length of text, so the results (zero, too
/// large, an angle modulo a turn) are the same, and far from overflow.
constexpr std::int64_t kMaxExponent = 10'000'000'000'000'000;

bool equals_ignoring_case(std::string_view text, std::string_view lower_case) {
  return text.size() == lower_case.size() &&
         std::equal(text.begin(), text.end(), lower_case.begin(), [](char a, char b) {
           return a == b || (a >= 'A' && a <= 'Z' && a - 'A' + 'a' == b);
         });
}

bool is_not_finite(std::string_view unsigned_text) {
  static constexpr std::array<std::string_view, 7> kSpellings = {
      "nan", "inf", "infinity", "nan(ind)", "1.#inf", "1.#qnan", "1.#ind"};
  return std::any_of(kSpellings.begin(), kSpellings.end(), [&](std::string_view spelling) {
    return equals_ignoring_case(unsigned_text, spelling);
  });
}

/// Reads the exponent after `e`; false when it is not one.
bool parse_exponent(std::string_view text, std::int64_t* exponent) {
  bool negative = false;
  if (!text.empty() && (text.front() == '+' || text.front() == '-')) {
    negative = text.front() == '-';
    text.remove_prefix(1);
  }
  if (text.empty()) {
    return false;
  }
  std::int64_t value = 0;
  for (const char c : text) {
    if (!is_digit(c)) {
      return false;
    }
    value = std::min(value * 10 + (c - '0'), kMaxExponent);
  }
  *exponent = negative ? -value : value;
  return true;
}

DecimalStatus parse_decimal(std::string_view text, Decimal* decimal) {
  text = trimmed(text);
  if (text.empty()) {
    return DecimalStatus::kEmpty;
  }
  *decimal = Decimal{};
  if (text.front() == '+' || text.front() == '-') {
    decimal->negative = text.front() == '-';
    text.remove_prefix(1);
  }
  if (is_not_finite(text)) {
    return DecimalStatus::kNotFinite;
  }
  bool any_digit = false;
  bool after_point = false;
  while (!text.empty() && (is_digit(text.front()) || (text.front() == '.' && !after_point))) {
    const char c = text.front();
    text.remove_prefix(1);
    if (c == '.') {
      after_point = true;
      continue;
    }
    any_digit = true;
    if (c != '0' || !decimal->digits.empty()) {
      decimal->digits.push_back(c);
      decimal->point += after_point ? 0 : 1;
    } else {
      decimal->point -= after_point ? 1 : 0;
    }
  }
  if (!any_digit) {
    return DecimalStatus::kMalformed;
  }
  if (!text.empty()) {
    std::int64_t exponent = 0;
    if ((text.front() != 'e' && text.front() != 'E') ||
        !parse_exponent(text.substr(1), &exponent)) {
      return DecimalStatus::kMalformed;
    }
    decimal->point += exponent;
  }
  return DecimalStatus::kOk;
}

// ---- Decimals as they usually are ---------------------------------------------------------------

/// Up to 18 digits with a point among them; what the fast path understands.
struct ShortDecimal {
  std::uint64_t mantissa;
  unsigned digit_count;
  unsigned fraction_count;
  bool negative;
};

/// Scans a plain decimal at `p`; the text has to end with a character that is neither a digit nor a
/// point (the line end). Returns where it stopped; digit_count is 0 when there was no number and over
/// 18 when it is too long for `mantissa`.
const char* scan_short(const char* p, ShortDecimal* out) {
  out->negative = *p == '-';
  p += out->negative ? 1 : 0;
  std::uint64_t mantissa = 0;
  const char* const first = p;
  while (is_digit(*p)) {
    mantissa = mantissa * 10 + static_cast<unsigned>(*p - '0');
    ++p;
  }
  auto digit_count = static_cast<std::size_t>(p - first);
  std::size_t fraction_count = 0;
  if (*p == '.') {
    const char* const fraction = ++p;
    while (is_digit(*p)) {
      mantissa = mantissa * 10 + static_cast<unsigned>(*p - '0');
      ++p;
    }
    fraction_count = static_cast<std::size_t>(p - fraction);
    digit_count += fraction_count;
  }
  out->mantissa = mantissa;
  out->digit_count = static_cast<unsigned>(digit_count);
  out->fraction_count = static_cast<unsigned>(fraction_count);
  return p;
}

bool short_to_time(const ShortDecimal& decimal, std::int64_t* time_us) {
  if (decimal.fraction_count != 0 || decimal.digit_count == 0 || decimal.digit_count > 18) {
    return false;
  }
  const auto value = static_cast<std::int64_t>(decimal.mantissa);
  *time_us = decimal.negative ? -value : value;
  return true;
}

bool short_to_um(const ShortDecimal& decimal, std::int64_t* value_um) {
  // 12 digits * 10^6 stays below 2^63; more are rare enough for the exact path.
  if (decimal.fraction_count > 6 || decimal.digit_count == 0 || decimal.digit_count > 12) {
    return false;
  }
  const auto value =
      static_cast<std::int64_t>(decimal.mantissa * kPow10[6 - decimal.fraction_count]);
  *value_um = decimal.negative ? -value : value;
  return true;
}

bool short_to_bam32(const ShortDecimal& decimal, Bam32* angle) {
  // 9 digits are below 2^30, so mantissa * 2^32 + half a divisor stays below 2^63.
  if (decimal.digit_count == 0 || decimal.digit_count > 9) {
    return false;
  }
  const std::uint64_t half_divisor = 180 * kPow10[decimal.fraction_count];
  const std::uint64_t turns = ((decimal.mantissa << 32U) + half_divisor) / (2 * half_divisor);
  const auto magnitude = static_cast<Bam32>(turns);
  *angle = decimal.negative ? 0U - magnitude : magnitude;
  return true;
}

// ---- Columns ------------------------------------------------------------------------------------

enum Column : std::size_t {
  kTime,
  kX,
  kY,
  kZ,
  kRoll,
  kPitch,
  kHeading,
  kAzimuth,
  kElevation,
  kRange,
  kColumnCount,
  kIgnored = kColumnCount
};

constexpr std::array<const char*, kColumnCount> kColumnNames = {
    "time_us",   "x_m",         "y_m",         "z_m",         "roll_deg",
    "pitch_deg", "heading_deg", "beam_az_deg", "beam_el_deg", "range_m"};

/// Every value of a row in the reader's units, indexed by Column.
struct Values {
  std::array<std::int64_t, kColumnCount> number{};  ///< time and lengths
  std::array<Bam32, kColumnCount> angle{};          ///< angles
  bool has_range = true;
};

bool is_angle(std::size_t column) { return column >= kRoll && column <= kElevation; }

bool is_horizontally_far(const Values& values) {
  return std::abs(values.number[kX]) > base::kMaxHorizontal_um ||
         std::abs(values.number[kY]) > base::kMaxHorizontal_um;
}

/// Whether a parsed value is absurd, and then why.
const char* absurd_reason(std::size_t column, std::int64_t value) {
  switch (column) {
    case kTime:
      return std::abs(value) > kMaxTime_us ? "over 4e18 microseconds" : nullptr;
    case kX:
    case kY:
      return std::abs(value) > kMaxEarth_um
                 ? "over 25,000 km from the origin, not a place on Earth (positions are metres "
                   "from "
                   "a local origin; re-origin the survey if its frame is to blame)"
                 : nullptr;
    case kZ:
      return std::abs(value) > base::kMaxVertical_um ? "over 20 km up or down" : nullptr;
    case kRange:
      if (value < 0) {
        return "a range cannot be negative";
      }
      return value > kMaxCsvRange_um ? "over 1,000 km" : nullptr;
    default:
      return nullptr;
  }
}

std::string counted(std::uint64_t count, const char* singular, const char* plural) {
  return std::to_string(count) + " " + (count == 1 ? singular : plural);
}

}  // namespace

DecimalStatus decimal_to_scaled(std::string_view text, int scale_digits, bool whole,
                                std::int64_t* value) {
  Decimal decimal;
  const DecimalStatus status = parse_decimal(text, &decimal);
  if (status != DecimalStatus::kOk) {
    return status;
  }
  if (decimal.digits.empty()) {
    *value = 0;
    return DecimalStatus::kOk;
  }
  const std::int64_t integer_digits = decimal.point + scale_digits;
  if (integer_digits > 19) {
    return DecimalStatus::kTooLarge;
  }
  std::uint64_t magnitude = 0;
  for (std::int64_t i = 0; i < integer_digits; ++i) {
    magnitude = magnitude * 10 + decimal.digit(i);
  }
  if (whole) {
    const auto first_dropped = static_cast<std::size_t>(std::max<std::int64_t>(integer_digits, 0));
    if (decimal.digits.find_first_not_of('0', std::min(first_dropped, decimal.digits.size())) !=
        std::string::npos) {
      return DecimalStatus::kInexact;
    }
  } else if (integer_digits >= 0 && decimal.digit(integer_digits) >= 5) {
    // With halves away from zero the first dropped digit decides alone.
    magnitude += 1;
  }
  if (magnitude > 9'200'000'000'000'000'000U) {
    return DecimalStatus::kTooLarge;
  }
  const auto result = static_cast<std::int64_t>(magnitude);
  *value = decimal.negative ? -result : result;
  return DecimalStatus::kOk;
}

DecimalStatus degrees_to_bam32(std::string_view text, Bam32* angle) {
  Decimal decimal;
  const DecimalStatus status = parse_decimal(text, &decimal);
  if (status != DecimalStatus::kOk) {
    return status;
  }
  // Whole degrees modulo a turn, over the digits that are there; the zeros after them multiply by
  // powers of ten, which modulo 360 are 1, 10, 100 and then 280 for ever.
  const auto digit_count = static_cast<std::int64_t>(decimal.digits.size());
  std::uint64_t degrees = 0;
  for (std::int64_t i = 0; i < std::min(decimal.point, digit_count); ++i) {
    degrees = (degrees * 10 + decimal.digit(i)) % 360;
  }
  static constexpr std::array<std::uint64_t, 4> kPow10Mod360 = {1, 10, 100, 280};
  if (decimal.point > digit_count) {
    degrees = degrees *
              kPow10Mod360[std::min<std::size_t>(
                  static_cast<std::size_t>(decimal.point - digit_count), 3)] %
              360;
  }
  // Eighteen digits of the fraction: degrees * 10^18 + fraction < 2^69, times 2^32 < 2^101.
  std::uint64_t fraction = 0;
  for (std::int64_t i = 0; i < 18; ++i) {
    fraction = fraction * 10 + decimal.digit(decimal.point + i);
  }
  const UInt128 scaled = static_cast<UInt128>(degrees) * kPow10[18] + fraction;
  const UInt128 half_divisor = static_cast<UInt128>(180) * kPow10[18];
  const UInt128 numerator = (scaled << 32U) + half_divisor;
  UInt128 turns = numerator / (2 * half_divisor);
  // The digits beyond are worth less than one unit of `scaled`, that is 2^32 of the numerator: they
  // matter only when the next multiple of the divisor is that near. Compare them, digit by digit,
  // with the distance (a multiple of 2^-32 units, so it has at most 32 decimals).
  const UInt128 distance = (turns + 1) * (2 * half_divisor) - numerator;
  if (distance < (static_cast<UInt128>(1) << 32U)) {
    auto remainder = static_cast<std::uint64_t>(distance);
    bool reached = true;
    for (std::int64_t i = 18; i < 18 + 32; ++i) {
      remainder *= 10;
      const auto needed = static_cast<unsigned>(remainder >> 32U);
      remainder &= 0xFFFFFFFFU;
      const unsigned have = decimal.digit(decimal.point + i);
      if (have != needed) {
        reached = have > needed;
        break;
      }
    }
    turns += reached ? 1 : 0;
  }
  const auto magnitude = static_cast<Bam32>(turns);
  *angle = decimal.negative ? 0U - magnitude : magnitude;
  return DecimalStatus::kOk;
}

// ---- The reader ---------------------------------------------------------------------------------

struct PingCsvReader::Impl {
  Impl(std::string file_name, const PingCsvOptions& reader_options, std::size_t wanted_bytes)
      : name(std::move(file_name)),
        options(reader_options),
        buffer(std::clamp<std::size_t>(wanted_bytes, 1, kBuffer_bytes) + 1) {}
  ~Impl() {
    if (fd > STDIN_FILENO) {
      ::close(fd);
    }
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  std::string name;
  PingCsvOptions options;
  PingCsvStats stats;

  int fd = -1;            ///< -1: `text` is the source
  std::string_view text;  ///< what is left of a source in memory
  /// As long as the source or longer than kMaxLine_bytes, so that it is never full of one line that
  /// could still be good; and one byte longer than is ever filled: room for a line end.
  std::vector<char> buffer;
  std::size_t begin = 0;  ///< first byte not yet taken
  std::size_t end = 0;    ///< one past the last byte read
  bool at_end = false;
  std::uint64_t bytes_read = 0;
  std::uint64_t bytes_total = 0;

  std::uint64_t line = 0;              ///< number of the line taken last
  std::vector<std::size_t> column_of;  ///< Column per header position
  std::vector<std::string> header_names;
  bool has_last_time = false;
  std::int64_t last_time_us = 0;
  std::uint64_t last_time_line = 0;
  bool last_line_unended = false;
  std::string first_rejection;
  std::vector<std::string_view> fields;  ///< of the line in work, slow path only
  std::map<std::string, std::uint64_t> messages_given;

  enum class Line : std::uint8_t { kEnd, kText, kTooLong };

  void open(const std::string& path);
  void refill();
  Line take_line(std::string_view* out);
  void read_header();
  void adopt_header(std::string_view header);
  bool parse_fast(std::string_view row, Values* values) const;
  bool parse_slow(std::string_view row, Values* values);
  bool split(std::string_view row);
  bool accept(const Values& values, PingRow* row);
  void say(const std::string& message) const {
    if (options.message) {
      options.message(message);
    }
  }
  void reject(const std::string& reason, const std::string& message);
  void reject_value(const std::string& reason, std::size_t position, std::string_view value,
                    const std::string& why);
  [[noreturn]] void fail(const std::string& message) const {
    throw HostError(ExitCode::kInput, message);
  }
  [[nodiscard]] std::string place() const { return name + ":" + std::to_string(line); }
  void finish();
};

void PingCsvReader::Impl::open(const std::string& path) {
  if (path == "-") {
    fd = STDIN_FILENO;
    name = "<standard input>";
    return;
  }
  fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) {
    fail(path + ": cannot open: " + std::strerror(errno));
  }
  struct stat info {};
  if (::fstat(fd, &info) == 0) {
    if (S_ISDIR(info.st_mode)) {
      fail(path + ": is a directory, a CSV file is needed");
    }
    bytes_total = S_ISREG(info.st_mode) ? static_cast<std::uint64_t>(info.st_size) : 0;
  }
}

/// Moves what is left to the front and adds what the source gives; sets at_end.
void PingCsvReader::Impl::refill() {
  std::memmove(buffer.data(), buffer.data() + begin, end - begin);
  end -= begin;
  begin = 0;
  std::size_t count = 0;
  if (fd < 0) {
    count = std::min(buffer.size() - 1 - end, text.size());
    std::copy_n(text.data(), count, buffer.data() + end);
    text.remove_prefix(count);
  } else {
    ssize_t result = 0;
    do {
      result = ::read(fd, buffer.data() + end, buffer.size() - 1 - end);
    } while (result < 0 && errno == EINTR);
    if (result < 0) {
      fail(name + ": cannot read: " + std::strerror(errno));
    }
    count = static_cast<std::size_t>(result);
  }
  at_end = count == 0;
  end += count;
  bytes_read += count;
}

/// The next line without its end. The byte after it may be read and is never part of a number.
PingCsvReader::Impl::Line PingCsvReader::Impl::take_line(std::string_view* out) {
  bool too_long = false;
  std::size_t searched = 0;
  for (;;) {
    const char* const start = buffer.data() + begin;
    const std::size_t available = end - begin;
    const void* const found =
        available > searched ? std::memchr(start + searched, '\n', available - searched) : nullptr;
    if (found == nullptr && !at_end) {
      searched = available;
      if (available > kMaxLine_bytes + 1) {
        too_long = true;
        begin = end;  // the head of a line that is thrown away
        searched = 0;
      }
      refill();
      continue;
    }
    if (found == nullptr && available == 0 && !too_long) {
      return Line::kEnd;
    }
    std::size_t length = available;
    if (found != nullptr) {
      length = static_cast<std::size_t>(static_cast<const char*>(found) - start);
      begin += length + 1;
    } else {
      buffer[end] = '\n';
      begin = end;
      last_line_unended = true;
    }
    line += 1;
    if (length > 0 && start[length - 1] == '\r') {
      length -= 1;
    }
    *out = std::string_view(start, length);
    return too_long || length > kMaxLine_bytes ? Line::kTooLong : Line::kText;
  }
}

void PingCsvReader::Impl::read_header() {
  std::string_view text_line;
  for (;;) {
    const Line kind = take_line(&text_line);
    if (kind == Line::kEnd) {
      fail(bytes_read == 0 ? name + ": is empty; a header line and pings are needed"
                           : name +
                                 ": has no header line; the columns have to be named: "
                                 "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,"
                                 "beam_el_deg,range_m");
    }
    if (kind == Line::kTooLong) {
      fail(place() + ": header longer than " + std::to_string(kMaxLine_bytes) +
           " bytes: is this a text file with line ends?");
    }
    if (line == 1 && text_line.substr(0, 3) == "\xEF\xBB\xBF") {
      text_line.remove_prefix(3);
    }
    if (line == 1 &&
        (text_line.substr(0, 2) == "\xFF\xFE" || text_line.substr(0, 2) == "\xFE\xFF")) {
      fail(place() + ": is UTF-16 text; save it as UTF-8 or ASCII");
    }
    const std::string_view content = trimmed(text_line);
    if (!content.empty() && content.front() != '#') {
      adopt_header(content);
      return;
    }
  }
}

void PingCsvReader::Impl::adopt_header(std::string_view header) {
  if (header.find('\r') != std::string_view::npos) {
    fail(place() + ": lines end in a bare carriage return; convert the file (tr '\\r' '\\n')");
  }
  if (!split(header)) {
    fail(place() + ": header: broken quote");
  }
  std::array<bool, kColumnCount> seen{};
  for (const std::string_view field : fields) {
    const auto* const found = std::find(kColumnNames.begin(), kColumnNames.end(), field);
    const auto column = static_cast<std::size_t>(found - kColumnNames.begin());
    header_names.emplace_back(field);
    column_of.push_back(column);
    if (column == kIgnored) {
      stats.ignored_columns.emplace_back(field);
      continue;
    }
    if (seen[column]) {
      fail(place() + ": header: column " + kColumnNames[column] + " is named twice");
    }
    seen[column] = true;
  }
  for (std::size_t column = 0; column < kColumnCount; ++column) {
    if (seen[column]) {
      continue;
    }
    std::string message = place() + ": header: column " + kColumnNames[column] + " is missing";
    const std::string near = closest_name(kColumnNames[column], stats.ignored_columns);
    std::int64_t number = 0;
    if (fields.size() == 1) {
      message += "; only one column was found: values have to be separated by commas";
    } else if (!near.empty()) {
      message += "; is it the column named \"" + printable(near) + "\"?";
    } else if (decimal_to_scaled(fields.front(), 0, false, &number) == DecimalStatus::kOk) {
      message += "; the first line has to name the columns, this one holds numbers";
    } else {
      message += " (found: \"" + printable(header, 160) + "\")";
    }
    fail(message);
  }
  if (!stats.ignored_columns.empty()) {
    std::string message =
        name + ": ignored " +
        (stats.ignored_columns.size() == 1 ? "an extra column:" : "extra columns:");
    for (const std::string& column : stats.ignored_columns) {
      message += " \"" + printable(column) + "\"";
    }
    say(message);
  }
}

/// Splits at commas outside quotes into `fields`, blanks and quotes taken off; false when a quote is
/// not closed or is followed by anything but a comma.
bool PingCsvReader::Impl::split(std::string_view row) {
  fields.clear();
  for (;;) {
    std::string_view rest = row;
    while (!rest.empty() && is_blank(rest.front())) {
      rest.remove_prefix(1);
    }
    std::size_t stop = 0;
    if (!rest.empty() && rest.front() == '"') {
      std::size_t close = 1;
      while (close < rest.size() &&
             (rest[close] != '"' || (close + 1 < rest.size() && rest[close + 1] == '"'))) {
        close += rest[close] == '"' ? 2U : 1U;
      }
      if (close >= rest.size()) {
        return false;
      }
      fields.push_back(trimmed(rest.substr(1, close - 1)));
      rest.remove_prefix(close + 1);
      stop = std::min(rest.find(','), rest.size());
      if (!trimmed(rest.substr(0, stop)).empty()) {
        return false;
      }
    } else {
      stop = std::min(rest.find(','), rest.size());
      fields.push_back(trimmed(rest.substr(0, stop)));
    }
    if (stop == rest.size()) {
      return true;
    }
    row = rest.substr(stop + 1);
  }
}

/// Rows as loggers write them: no blanks, no quotes, no exponents, few digits. False means "ask
/// parse_slow", never "this row is bad".
bool PingCsvReader::Impl::parse_fast(std::string_view row, Values* values) const {
  const char* p = row.data();
  const char* const stop = p + row.size();
  if (p == stop || *p == '#' || is_blank(*p)) {
    return false;  // a comment, whatever the first column holds
  }
  const std::size_t column_count = column_of.size();
  for (std::size_t position = 0; position < column_count; ++position) {
    const std::size_t column = column_of[position];
    if (column == kIgnored) {
      while (p != stop && *p != ',' && *p != '"') {
        ++p;
      }
    } else if (column == kRange && (p == stop || *p == ',')) {
      values->has_range = false;
      values->number[kRange] = 0;
    } else {
      ShortDecimal decimal;
      p = scan_short(p, &decimal);
      bool good = false;
      if (is_angle(column)) {
        good = short_to_bam32(decimal, &values->angle[column]);
      } else if (column == kTime) {
        good = short_to_time(decimal, &values->number[kTime]);
      } else {
        good = short_to_um(decimal, &values->number[column]) &&
               absurd_reason(column, values->number[column]) == nullptr;
      }
      if (!good) {
        return false;
      }
    }
    if (position + 1 == column_count) {
      return p == stop;
    }
    if (p == stop || *p != ',') {
      return false;
    }
    ++p;
  }
  return false;
}

void PingCsvReader::Impl::reject(const std::string& reason, const std::string& message) {
  stats.rejected[reason] += 1;
  if (first_rejection.empty()) {
    first_rejection = message;
  }
  if (options.strict) {
    fail(message + " (--strict)");
  }
  const std::uint64_t given = messages_given[reason]++;
  if (given < options.max_messages_per_reason) {
    say(message);
  } else if (given == options.max_messages_per_reason) {
    say(name + ": further rows that are " + reason + " are only counted");
  }
}

void PingCsvReader::Impl::reject_value(const std::string& reason, std::size_t position,
                                       std::string_view value, const std::string& why) {
  reject(reason, place() + ": column " + printable(header_names[position]) + ": value \"" +
                     printable(value) + "\": " + why);
}

/// The whole contract. False when the row was rejected (and counted).
bool PingCsvReader::Impl::parse_slow(std::string_view row, Values* values) {
  *values = Values{};
  if (!split(row)) {
    reject("malformed", place() + ": value \"" + printable(row) + "\": broken quote");
    return false;
  }
  const std::string has = "the row has " + counted(fields.size(), "value", "values") +
                          ", the header names " + std::to_string(column_of.size());
  if (fields.size() < column_of.size()) {
    reject_value("missing", fields.size(), "", has);
    return false;
  }
  if (fields.size() > column_of.size()) {
    reject_value("malformed", column_of.size() - 1, fields[column_of.size()], has);
    return false;
  }
  for (std::size_t position = 0; position < column_of.size(); ++position) {
    const std::size_t column = column_of[position];
    const std::string_view field = fields[position];
    if (column == kIgnored) {
      continue;
    }
    if (column == kRange && field.empty()) {
      values->has_range = false;
      continue;
    }
    const bool angle = is_angle(column);
    const DecimalStatus status = angle
                                     ? degrees_to_bam32(field, &values->angle[column])
                                     : decimal_to_scaled(field, column == kTime ? 0 : 6,
                                                         column == kTime, &values->number[column]);
    switch (status) {
      case DecimalStatus::kOk:
        break;
      case DecimalStatus::kEmpty:
        reject_value("missing", position, field, "a value is needed");
        return false;
      case DecimalStatus::kMalformed:
        reject_value("malformed", position, field, "not a decimal number");
        return false;
      case DecimalStatus::kNotFinite:
        reject_value("not_finite", position, field, "not a finite number");
        return false;
      case DecimalStatus::kInexact:
        reject_value("malformed", position, field, "not a whole number of microseconds");
        return false;
      case DecimalStatus::kTooLarge:
        values->number[column] = field.front() == '-' ? INT64_MIN + 1 : INT64_MAX;
        break;
    }
    const char* const absurd = absurd_reason(column, values->number[column]);
    if (absurd != nullptr) {
      reject_value("out_of_range", position, field, absurd);
      return false;
    }
  }
  return true;
}

/// The checks between rows, then the record. False when the row was rejected.
bool PingCsvReader::Impl::accept(const Values& values, PingRow* row) {
  if (is_horizontally_far(values)) {
    const std::size_t column = std::abs(values.number[kX]) > base::kMaxHorizontal_um ? kX : kY;
    fail(place() + ": column " + kColumnNames[column] + ": value " +
         std::to_string(values.number[column] / 1'000'000) +
         " m is over 2,000 km from the origin: re-origin the survey (subtract a nearby origin from "
         "x_m and y_m and set [frame] to it)");
  }
  const std::int64_t time_us = values.number[kTime];
  if (has_last_time && time_us < last_time_us) {
    reject("time_backwards", place() + ": column time_us: value \"" + std::to_string(time_us) +
                                 "\": time goes backwards, line " + std::to_string(last_time_line) +
                                 " has " + std::to_string(last_time_us));
    return false;
  }
  has_last_time = true;
  last_time_us = time_us;
  last_time_line = line;
  row->t_us = time_us;
  row->position_um[base::kNorth] = values.number[kX];
  row->position_um[base::kEast] = values.number[kY];
  row->position_um[base::kDown] = values.number[kZ];
  row->attitude.roll_bam32 = values.angle[kRoll];
  row->attitude.pitch_bam32 = values.angle[kPitch];
  row->attitude.heading_bam32 = values.angle[kHeading];
  row->azimuth_bam32 = values.angle[kAzimuth];
  row->elevation_bam32 = values.angle[kElevation];
  row->range_um = values.has_range ? values.number[kRange] : 0;
  row->has_range = values.has_range;
  row->line = line;
  stats.accepted += 1;
  stats.no_return += values.has_range ? 0 : 1;
  return true;
}

/// At the end of the file: nothing usable is an error, a cut last line worth a word.
void PingCsvReader::Impl::finish() {
  if (stats.rows == 0) {
    fail(name + ": no row after the header");
  }
  if (stats.accepted == 0) {
    std::string reasons;
    for (const auto& [reason, count] : stats.rejected) {
      reasons += (reasons.empty() ? "" : ", ") + reason + " " + std::to_string(count);
    }
    fail(name + ": no usable row among " + std::to_string(stats.rows) + " (" + reasons +
         "); the first:\n" + first_rejection);
  }
  if (last_line_unended) {
    say(name + ": the last line has no line end: the file may have been cut");
    last_line_unended = false;
  }
}

PingCsvReader::PingCsvReader(const std::string& path, const PingCsvOptions& options)
    : impl_(std::make_unique<Impl>(path, options, kBuffer_bytes)) {
  impl_->open(path);
  impl_->read_header();
}

PingCsvReader::PingCsvReader(const std::string& name, std::string_view text,
                             const PingCsvOptions& options)
    : impl_(std::make_unique<Impl>(name, options, text.size())) {
  impl_->text = text;
  impl_->bytes_total = text.size();
  impl_->read_header();
}

PingCsvReader::~PingCsvReader() = default;

bool PingCsvReader::next(PingRow* row) {
  Impl& impl = *impl_;
  std::string_view text_line;
  for (;;) {
    const Impl::Line kind = impl.take_line(&text_line);
    if (kind == Impl::Line::kEnd) {
      impl.finish();
      return false;
    }
    if (kind == Impl::Line::kTooLong) {
      impl.stats.rows += 1;
      impl.reject("line_too_long",
                  impl.place() + ": line longer than " + std::to_string(kMaxLine_bytes) + " bytes");
      continue;
    }
    Values values;
    if (!impl.parse_fast(text_line, &values)) {
      const std::string_view content = trimmed(text_line);
      if (content.empty() || content.front() == '#') {
        continue;
      }
      impl.stats.rows += 1;
      if (!impl.parse_slow(content, &values)) {
        continue;
      }
    } else {
      impl.stats.rows += 1;
    }
    if (impl.accept(values, row)) {
      return true;
    }
  }
}

const PingCsvStats& PingCsvReader::stats() const { return impl_->stats; }
std::uint64_t PingCsvReader::bytes_read() const { return impl_->bytes_read; }
std::uint64_t PingCsvReader::bytes_total() const { return impl_->bytes_total; }

std::vector<PingRow> read_ping_csv(const std::string& path, const PingCsvOptions& options,
                                   PingCsvStats* stats) {
  PingCsvReader reader(path, options);
  std::vector<PingRow> rows;
  PingRow row{};
  while (reader.next(&row)) {
    rows.push_back(row);
  }
  if (stats != nullptr) {
    *stats = reader.stats();
  }
  return rows;
}

}  // namespace leadline::host
