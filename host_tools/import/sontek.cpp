#include "host_tools/import/sontek.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "firmware/config/input_file.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/import/calendar.hpp"
#include "host_tools/ping_csv.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr std::size_t kBeams = 5;

enum Column : std::size_t {
  kTime,
  kLatitude,
  kLongitude,
  kHeading,
  kPitch,
  kRoll,
  kFirstDepth,
  kColumnCount = kFirstDepth + kBeams
};

constexpr std::array<const char*, kColumnCount> kNames = {
    "Date/Time",          "Latitude (deg)",     "Longitude (deg)",   "Heading (deg)",
    "Pitch (deg)",        "Roll (deg)",         "VB Depth (m)",      "BT Beam1 Depth (m)",
    "BT Beam2 Depth (m)", "BT Beam3 Depth (m)", "BT Beam4 Depth (m)"};

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> fields;
  for (;;) {
    const std::size_t comma = line.find(',');
    std::string_view field = line.substr(0, comma);
    while (!field.empty() && field.front() == ' ') {
      field.remove_prefix(1);
    }
    while (!field.empty() && field.back() == ' ') {
      field.remove_suffix(1);
    }
    fields.push_back(field);
    if (comma == std::string_view::npos) {
      return fields;
    }
    line.remove_prefix(comma + 1);
  }
}

/// "1/22/2025 12:21:10 PM", or without AM and PM.
bool parse_time(std::string_view text, base::TimeUs* t_us) {
  const std::string copy(text.substr(0, 40));
  CalendarTime time{};
  char half[3] = "";
  const int fields =
      std::sscanf(copy.c_str(), "%2u/%2u/%4u %2u:%2u:%2u %2s", &time.month, &time.day, &time.year,
                  &time.hour, &time.minute, &time.second, half);
  if (fields < 6) {
    return false;
  }
  if (fields == 7) {
    const bool noon = time.hour == 12;
    const bool after = half[0] == 'P' || half[0] == 'p';
    time.hour = (noon ? 0 : time.hour) + (after ? 12U : 0U);
  }
  if (!is_calendar_time(time)) {
    return false;
  }
  *t_us = unix_us(time);
  return true;
}

bool parse_angle(std::string_view text, double limit_deg, base::Bam32* angle) {
  std::int64_t microdegrees = 0;
  if (decimal_to_scaled(text, 6, false, &microdegrees) != DecimalStatus::kOk ||
      static_cast<double>(microdegrees) > limit_deg * 1e6 ||
      static_cast<double>(microdegrees) < -limit_deg * 1e6) {
    return false;
  }
  return degrees_to_bam32(text, angle) == DecimalStatus::kOk;
}

/// One line's values; false when any but a depth is missing or wrong.
bool parse_line(const std::vector<std::string_view>& fields,
                const std::array<std::size_t, kColumnCount>& column_of, SurveyLine* line) {
  base::NavSample sample{};
  if (fields.size() <= *std::max_element(column_of.begin(), column_of.end()) ||
      !parse_time(fields[column_of[kTime]], &sample.t_us) ||
      !parse_dms(fields[column_of[kLatitude]], &sample.latitude_e9deg) ||
      !parse_dms(fields[column_of[kLongitude]], &sample.longitude_e9deg) ||
      !parse_angle(fields[column_of[kHeading]], 360, &sample.attitude.heading_bam32) ||
      !parse_angle(fields[column_of[kPitch]], 90, &sample.attitude.pitch_bam32) ||
      !parse_angle(fields[column_of[kRoll]], 180, &sample.attitude.roll_bam32)) {
    return false;
  }
  // 0, 0 is "no fix" in this format; and a clock that stands or goes back cannot be mapped.
  if ((sample.latitude_e9deg == 0 && sample.longitude_e9deg == 0) ||
      (!line->positions.empty() && sample.t_us <= line->positions.back().t_us)) {
    return false;
  }
  sample.quality = 255;
  sample.kind = base::NavKind::kPosition;
  sample.fields = base::kNavGeodetic | base::kNavRollPitch | base::kNavHeading;
  line->positions.push_back(sample);
  line->heights_m.push_back(0.0);
  line->attitudes.push_back(sample);
  for (std::size_t i = 0; i < kBeams; ++i) {
    std::int64_t depth_um = 0;
    if (decimal_to_scaled(fields[column_of[kFirstDepth + i]], 6, false, &depth_um) !=
            DecimalStatus::kOk ||
        depth_um <= 0 || depth_um > base::kMaxRange_um / 2) {
      continue;
    }
    SurveyBeam beam{};
    beam.t_transmit_us = sample.t_us;
    beam.t_receive_us = sample.t_us;
    const double slant_deg = i == 0 ? 0.0 : kSonTekSlant_deg;
    beam.direction =
        vehicle_direction({i == 0 ? 0.0 : kSonTekAzimuth_deg[i - 1], 90.0 - slant_deg});
    beam.range_m = 1e-6 * static_cast<double>(depth_um) / exact::cos(slant_deg * exact::kRadPerDeg);
    beam.told_speed_mm_s = kSonTekSpeed_mm_s;
    beam.beam = static_cast<std::uint16_t>(i);
    beam.quality = 255;
    line->beams.push_back(beam);
  }
  return true;
}

std::array<std::size_t, kColumnCount> find_columns(const std::vector<std::string_view>& header,
                                                   const std::string& path) {
  std::array<std::size_t, kColumnCount> column_of{};
  for (std::size_t i = 0; i < kColumnCount; ++i) {
    const auto found = std::find(header.begin(), header.end(), kNames[i]);
    if (found == header.end()) {
      throw HostError(ExitCode::kInput, path + ":1: column \"" + kNames[i] +
                                            "\" is missing: is this a SonTek summary (.sum)?");
    }
    column_of[i] = static_cast<std::size_t>(found - header.begin());
  }
  return column_of;
}

}  // namespace

bool parse_dms(std::string_view text, std::int64_t* angle_e9deg) {
  // Whatever is no part of a number separates: the degree sign has had several encodings.
  std::array<std::int64_t, 3> parts_e9{};
  std::size_t count = 0;
  const bool negative = !text.empty() && text.front() == '-';
  const auto is_number = [](char c) { return (c >= '0' && c <= '9') || c == '.'; };
  std::size_t at = negative ? 1 : 0;
  while (at < text.size()) {
    if (!is_number(text[at])) {
      ++at;
      continue;
    }
    std::size_t end = at;
    while (end < text.size() && is_number(text[end])) {
      ++end;
    }
    if (count == parts_e9.size() || decimal_to_scaled(text.substr(at, end - at), 9, false,
                                                      &parts_e9[count]) != DecimalStatus::kOk) {
      return false;
    }
    ++count;
    at = end;
  }
  constexpr std::int64_t kE9 = 1'000'000'000;
  if (count != 3 || parts_e9[0] > 180 * kE9 || parts_e9[1] >= 60 * kE9 || parts_e9[2] > 60 * kE9) {
    return false;
  }
  const std::int64_t angle = parts_e9[0] + (parts_e9[1] * 60 + parts_e9[2] + 1800) / 3600;
  *angle_e9deg = negative ? -angle : angle;
  return true;
}

SurveyLine read_sontek_line(const std::string& path, std::string* notice) {
  const std::string text = read_input(path);
  SurveyLine line;
  line.name = path;
  std::array<std::size_t, kColumnCount> column_of{};
  bool has_header = false;
  std::uint64_t rows = 0;
  std::uint64_t unusable = 0;
  std::string_view rest(text);
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find_first_of("\r\n"), rest.size());
    const std::string_view row = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (row.empty()) {
      continue;
    }
    if (!has_header) {
      column_of = find_columns(split(row), path);
      has_header = true;
      continue;
    }
    rows += 1;
    unusable += parse_line(split(row), column_of, &line) ? 0 : 1;
  }
  if (line.beams.empty()) {
    throw HostError(ExitCode::kInput, path + ": no usable line among " + std::to_string(rows));
  }
  if (unusable != 0) {
    *notice = std::to_string(unusable) + " of " + std::to_string(rows) + " lines cannot be used";
  }
  return line;
}

}  // namespace leadline::host
