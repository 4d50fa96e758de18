#include "host_tools/import/can_text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include "host_tools/import/calendar.hpp"

namespace leadline::host {
namespace {

constexpr std::size_t kMaxFastPacket_bytes = 223;
constexpr std::uint32_t kMaxStandardId = 0x7FFU;
// canboat files notes of its own under numbers beyond those of the bus.
constexpr std::uint32_t kMaxPgn = 0x3FFFFU;
constexpr std::uint32_t kMaxNotePgn = 0xFFFFFFU;
constexpr std::uint32_t kMaxExtendedId = 0x1FFFFFFFU;
// The flag candump writes into the identifier of an error frame.
constexpr std::uint32_t kCandumpError = 0x20000000U;
constexpr std::size_t kMaxCanFd_bytes = 64;

std::vector<std::string_view> split(std::string_view text, std::string_view separators) {
  std::vector<std::string_view> parts;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of(separators), text.size());
    if (end > 0) {
      parts.push_back(text.substr(0, end));
    }
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return parts;
}

template <typename Value>
std::optional<Value> whole_number(std::string_view text, int base) {
  Value value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  const bool good = error == std::errc() && end == text.data() + text.size() && !text.empty();
  return good ? std::optional<Value>(value) : std::nullopt;
}

/// "ss.ffffff" to microseconds, exactly; at most twelve digits in front of the point.
std::optional<base::TimeUs> seconds_us(std::string_view text) {
  const std::size_t point = std::min(text.find('.'), text.size());
  const auto seconds = whole_number<std::uint64_t>(text.substr(0, point), 10);
  if (!seconds || point > 12) {
    return std::nullopt;
  }
  base::TimeUs fraction_us = 0;
  base::TimeUs unit_us = 100'000;
  for (const char c : text.substr(std::min(point + 1, text.size()))) {
    if (c < '0' || c > '9') {
      return std::nullopt;
    }
    fraction_us += unit_us * (c - '0');
    unit_us /= 10;
  }
  return static_cast<base::TimeUs>(*seconds) * 1'000'000 + fraction_us;
}

/// "2016-02-28T19:57:02.364Z", with 'T', 'Z', '-' or a blank between date and time.
std::optional<base::TimeUs> date_time_us(std::string_view text) {
  if (text.size() < 19 || text[4] != '-' || text[7] != '-' || text[13] != ':' || text[16] != ':' ||
      std::string_view("TZ- ").find(text[10]) == std::string_view::npos) {
    return std::nullopt;
  }
  if (text.back() == 'Z') {
    text.remove_suffix(1);
  }
  const auto field = [&text](std::size_t at, std::size_t size) {
    return whole_number<std::uint16_t>(text.substr(at, size), 10);
  };
  const auto year = field(0, 4);
  const auto month = field(5, 2);
  const auto day = field(8, 2);
  const auto hour = field(11, 2);
  const auto minute = field(14, 2);
  const auto second_us = seconds_us(text.substr(17));
  if (!year || !month || !day || !hour || !minute || !second_us || *second_us >= 61'000'000) {
    return std::nullopt;
  }
  const CalendarTime minute_begin = {*year, *month, *day, *hour, *minute, 0};
  if (!is_calendar_time(minute_begin)) {
    return std::nullopt;
  }
  return unix_us(minute_begin) + *second_us;
}

std::optional<base::TimeUs> any_time_us(std::string_view text) {
  const std::optional<base::TimeUs> dated = date_time_us(text);
  return dated ? dated : seconds_us(text);
}

/// Three digits: 11 bits; eight: 29 bits, or candump's error frame.
std::optional<std::uint32_t> identifier(std::string_view text) {
  const auto value = whole_number<std::uint32_t>(text, 16);
  if (!value || (text.size() != 3 && text.size() != 8)) {
    return std::nullopt;
  }
  if (text.size() == 3) {
    return *value <= kMaxStandardId ? value : std::nullopt;
  }
  if ((*value & kCandumpError) != 0) {
    return (*value & kMaxExtendedId) | hal::kCanError;
  }
  return *value <= kMaxExtendedId ? std::optional<std::uint32_t>(*value | hal::kCanExtended)
                                  : std::nullopt;
}

/// A frame of either kind of CAN.
struct TextFrame {
  hal::CanFrame frame{};
  std::size_t size_bytes = 0;  ///< more than eight: CAN FD, and `frame` has the first eight
};

/// Whether a frame of either kind can be so long.
bool is_length(std::size_t size_bytes) {
  constexpr std::array<std::size_t, 7> kLong = {12, 16, 20, 24, 32, 48, kMaxCanFd_bytes};
  return size_bytes <= hal::kMaxCanData_bytes ||
         std::find(kLong.begin(), kLong.end(), size_bytes) != kLong.end();
}

/// Adds the two digits as one byte; false where they are none or the frame is full.
bool append_byte(std::string_view digits, std::size_t capacity_bytes, TextFrame* text) {
  const auto value = whole_number<std::uint8_t>(digits, 16);
  if (!value || digits.size() != 2 || text->size_bytes >= capacity_bytes) {
    return false;
  }
  if (text->size_bytes++ < hal::kMaxCanData_bytes) {
    text->frame.data[text->frame.length_bytes++] = *value;
  }
  return true;
}

/// "09F112CC#FF725A", "123#R", CAN FD with its flags "09F112CC##1FF725A"; "_E" behind eight bytes is the length
/// code that said more.
std::optional<TextFrame> compact_frame(std::string_view text) {
  const std::size_t hash = text.find('#');
  const auto id = identifier(text.substr(0, hash));
  std::string_view digits = text.substr(hash + 1);
  if (!id) {
    return std::nullopt;
  }
  TextFrame result;
  result.frame.id = *id;
  if (!digits.empty() && digits[0] == 'R') {
    result.frame.id |= hal::kCanRemote;
    return result;
  }
  std::size_t capacity_bytes = hal::kMaxCanData_bytes;
  if (!digits.empty() && digits[0] == '#') {
    if (!whole_number<std::uint8_t>(digits.substr(1, 1), 16)) {
      return std::nullopt;
    }
    capacity_bytes = kMaxCanFd_bytes;
    digits.remove_prefix(2);
  }
  for (; !digits.empty(); digits.remove_prefix(std::min<std::size_t>(2, digits.size()))) {
    if (digits[0] == '.') {  // candump may separate bytes
      digits.remove_prefix(1);
    }
    if (digits.size() == 2 && digits[0] == '_' && result.size_bytes == hal::kMaxCanData_bytes) {
      break;
    }
    if (!append_byte(digits.substr(0, 2), capacity_bytes, &result)) {
      return std::nullopt;
    }
  }
  return is_length(result.size_bytes) ? std::optional(result) : std::nullopt;
}

/// What "[8]" says, CAN FD's "[64]", or the length code "{E}" of eight bytes.
std::optional<std::size_t> stated_length(std::string_view word) {
  if (word.size() < 3) {
    return std::nullopt;
  }
  const std::string_view inside = word.substr(1, word.size() - 2);
  if (word.front() == '{' && word.back() == '}') {
    const auto code = whole_number<std::uint8_t>(inside, 16);
    return code && *code > hal::kMaxCanData_bytes && *code < 16
               ? std::optional<std::size_t>(hal::kMaxCanData_bytes)
               : std::nullopt;
  }
  const auto length = whole_number<std::uint8_t>(inside, 10);
  return word.back() == ']' && length && is_length(*length) ? std::optional<std::size_t>(*length)
                                                            : std::nullopt;
}

/// "can0 [RX - -] 09F112CC [8] FF 72 ...": the words behind the time. Without a length every word behind the
/// identifier has to be a byte of a message with a 29-bit identifier.
std::optional<TextFrame> spaced_frame(const std::vector<std::string_view>& words) {
  std::size_t bracket = 0;
  while (bracket < words.size() && words[bracket].front() != '[' && words[bracket].front() != '{') {
    ++bracket;
  }
  const bool stated = bracket < words.size();
  if (bracket < 1 || (!stated && (words.size() < 3 || words[1].size() != 8))) {
    return std::nullopt;
  }
  const auto length = stated ? stated_length(words[bracket]) : words.size() - 2;
  std::string_view name = stated ? words[bracket - 1] : words[1];
  if (name.size() > 4 && name.substr(0, 3) == "<0x" && name.back() == '>') {
    name = name.substr(3, name.size() - 4);
  }
  const auto id = identifier(name);
  if (!length || !id) {
    return std::nullopt;
  }
  TextFrame result;
  result.frame.id = *id;
  const std::size_t first = stated ? bracket + 1 : 2;
  if (first < words.size() && words[first] == "remote") {
    result.frame.id |= hal::kCanRemote;
    return result;
  }
  const std::size_t capacity_bytes = stated ? kMaxCanFd_bytes : hal::kMaxCanData_bytes;
  for (std::size_t i = 0; i < *length; ++i) {
    if (first + i >= words.size() || !append_byte(words[first + i], capacity_bytes, &result)) {
      return std::nullopt;
    }
  }
  return result;
}

/// "hh:mm:ss.mmm R 09F112CC FF 72 ...": one frame, R received or T sent, at a time of day.
bool parse_gateway(const std::vector<std::string_view>& words, CanLine* result) {
  if (words.size() < 3 || (words[1] != "R" && words[1] != "T") || words[2].size() != 8 ||
      words[0].size() < 8 || words[0][2] != ':' || words[0][5] != ':') {
    return false;
  }
  const auto hour = whole_number<std::uint16_t>(words[0].substr(0, 2), 10);
  const auto minute = whole_number<std::uint16_t>(words[0].substr(3, 2), 10);
  const auto second_us = seconds_us(words[0].substr(6));
  const auto id = identifier(words[2]);
  if (!hour || *hour > 23 || !minute || *minute > 59 || !second_us || *second_us >= 61'000'000 ||
      !id) {
    return false;
  }
  TextFrame text;
  text.frame.id = *id;
  for (std::size_t i = 3; i < words.size(); ++i) {
    if (!append_byte(words[i], hal::kMaxCanData_bytes, &text)) {
      return false;
    }
  }
  result->kind = CanLineKind::kFrames;
  result->t_us = (*hour * 60 + *minute) * base::TimeUs{60'000'000} + *second_us;
  result->frames.push_back(text.frame);
  return true;
}

/// Takes "(time)" off the front, if it is there. False: brackets, but no time in them.
bool take_time(std::string_view* line, std::optional<base::TimeUs>* t_us) {
  if (line->empty() || line->front() != '(') {
    return true;
  }
  const std::size_t end = line->find(')');
  if (end == std::string_view::npos) {
    return false;
  }
  std::string_view text = line->substr(1, end - 1);
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  *t_us = any_time_us(text);
  line->remove_prefix(end + 1);
  return t_us->has_value();
}

CanLine parse_candump(std::string_view line) {
  CanLine result;
  if (!take_time(&line, &result.t_us)) {
    return result;
  }
  const std::vector<std::string_view> words = split(line, " \t");
  std::optional<TextFrame> text;
  if (words.size() >= 2 && words[1].find('#') != std::string_view::npos) {
    text = compact_frame(words[1]);
  } else if (!result.t_us && parse_gateway(words, &result)) {
    return result;
  } else if (words.size() >= 2) {
    text = spaced_frame(words);
  }
  if (text && text->size_bytes > hal::kMaxCanData_bytes) {
    result.kind = CanLineKind::kLong;
  } else if (text) {
    result.kind = CanLineKind::kFrames;
    result.frames.push_back(text->frame);
  }
  return result;
}

std::uint32_t n2k_identifier(std::uint32_t priority, std::uint32_t pgn, std::uint32_t source,
                             std::uint32_t destination) {
  const bool broadcast = ((pgn >> 8U) & 0xFFU) >= 240;
  const std::uint32_t low = broadcast ? 0U : destination << 8U;
  return (priority << 26U) | (pgn << 8U) | low | source | hal::kCanExtended;
}

/// A message of up to 223 bytes in the frames of a fast packet.
void split_fast_packet(std::uint32_t id, const std::vector<std::uint8_t>& message,
                       std::uint8_t sequence, std::vector<hal::CanFrame>* frames) {
  std::size_t taken = 0;
  for (std::uint8_t part = 0; taken < message.size(); ++part) {
    hal::CanFrame frame{};
    frame.id = id;
    frame.length_bytes = hal::kMaxCanData_bytes;
    frame.data.fill(0xFF);
    frame.data[0] = static_cast<std::uint8_t>((sequence << 5U) | part);
    std::size_t at = 1;
    if (part == 0) {
      frame.data[1] = static_cast<std::uint8_t>(message.size());
      at = 2;
    }
    for (; at < frame.data.size() && taken < message.size(); ++at, ++taken) {
      frame.data[at] = message[taken];
    }
    frames->push_back(frame);
  }
}

/// "time,priority,PGN,": canboat copies the time as it came, so it may be of any kind, but not half a date.
bool is_canboat(std::string_view line) {
  const std::size_t time_end = std::min(line.find(','), line.size());
  if (date_time_us(line.substr(0, time_end))) {
    return line.size() > 20;
  }
  const std::vector<std::string_view> fields = split(line.substr(time_end), ", ");
  constexpr std::size_t kShortestDate = 19;
  return time_end < kShortestDate && fields.size() > 5 && fields[0].size() == 1 &&
         whole_number<std::uint32_t>(fields[1], 10) && whole_number<std::uint32_t>(fields[4], 10);
}

}  // namespace

bool looks_like_can_text(std::string_view line) {
  const CanLineKind kind = CanTextReader().parse(line).kind;
  return kind == CanLineKind::kFrames || kind == CanLineKind::kLong;
}

CanLine CanTextReader::parse(std::string_view line) {
  const bool indented = !line.empty() && line.front() == '\t';
  line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  CanLine result;
  if (line.empty() || line.front() == '#') {
    result.kind = CanLineKind::kComment;
    return result;
  }
  if (!is_canboat(line)) {
    result = parse_candump(line);
    if (result.kind == CanLineKind::kBad && indented) {
      result.kind = CanLineKind::kComment;  // candump -e: what an error frame means
    }
    return result;
  }
  const std::string_view time_text = line.substr(0, line.find(','));
  const std::vector<std::string_view> fields = split(line.substr(time_text.size()), ", ");
  std::array<std::uint32_t, 5> numbers{};  // priority, PGN, source, destination, length
  constexpr std::array<std::uint32_t, 5> kLimits = {7, kMaxNotePgn, 255, 255, kMaxFastPacket_bytes};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto number =
        i < fields.size() ? whole_number<std::uint32_t>(fields[i], 10) : std::nullopt;
    if (!number || *number > kLimits[i]) {
      return result;
    }
    numbers[i] = *number;
  }
  std::vector<std::uint8_t> message;
  for (std::size_t i = numbers.size(); i < fields.size(); ++i) {
    const auto byte = whole_number<std::uint8_t>(fields[i], 16);
    if (!byte) {
      return result;
    }
    message.push_back(*byte);
  }
  if (message.size() != numbers[4] || message.empty()) {
    return result;
  }
  if (numbers[1] > kMaxPgn) {
    result.kind = CanLineKind::kComment;
    return result;
  }
  result.kind = CanLineKind::kFrames;
  result.t_us = any_time_us(time_text);
  const std::uint32_t id = n2k_identifier(numbers[0], numbers[1], numbers[2], numbers[3]);
  if (message.size() > hal::kMaxCanData_bytes) {
    split_fast_packet(id, message, sequence_, &result.frames);
    sequence_ = static_cast<std::uint8_t>((sequence_ + 1U) & 7U);
    return result;
  }
  hal::CanFrame frame{};
  frame.id = id;
  frame.length_bytes = static_cast<std::uint8_t>(message.size());
  std::copy(message.begin(), message.end(), frame.data.begin());
  result.frames.push_back(frame);
  return result;
}

}  // namespace leadline::host
