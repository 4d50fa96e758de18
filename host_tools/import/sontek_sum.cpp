#include "host_tools/import/sontek_sum.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <utility>

#include "estimator/geodesy.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kSlantCosine = 0.90630778703664996;  // of 25 degrees
constexpr double kSlantElevation_deg = 65.0;
constexpr std::array<double, 5> kAzimuth_deg = {0.0, 315.0, 225.0, 135.0, 45.0};

enum Column : std::size_t {
  kTime,
  kLatitude,
  kLongitude,
  kHeading,
  kPitch,
  kRoll,
  kVertical,
  kBeam1,
  kBeam2,
  kBeam3,
  kBeam4,
  kColumnCount,
};
constexpr std::array<const char*, kColumnCount> kNames = {
    "Date/Time",          "Latitude (deg)",     "Longitude (deg)",   "Heading (deg)",
    "Pitch (deg)",        "Roll (deg)",         "VB Depth (m)",      "BT Beam1 Depth (m)",
    "BT Beam2 Depth (m)", "BT Beam3 Depth (m)", "BT Beam4 Depth (m)"};

std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  while (true) {
    const std::size_t comma = line.find(',');
    fields.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) {
      return fields;
    }
    line.remove_prefix(comma + 1);
  }
}

std::optional<double> number(std::string_view text) {
  const std::string copy(text);
  double value = 0.0;
  char rest = 0;
  // One number and nothing behind it; the locale is the C one in this program.
  if (std::sscanf(copy.c_str(), " %lf %c", &value, &rest) != 1 || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

/// " 52° 20' 32.05\"", the degree sign in any encoding; south and west have a minus.
std::optional<std::int64_t> angle_e9deg(std::string_view text) {
  std::string plain;
  for (const char c : text) {
    const bool part = (c >= '0' && c <= '9') || c == '.' || c == '-';
    plain.push_back(part ? c : ' ');
  }
  double degrees = 0.0;
  double minutes = 0.0;
  double seconds = 0.0;
  char rest = 0;
  if (std::sscanf(plain.c_str(), " %lf %lf %lf %c", &degrees, &minutes, &seconds, &rest) != 3 ||
      !(minutes >= 0.0 && minutes < 60.0) || !(seconds >= 0.0 && seconds <= 60.0)) {
    return std::nullopt;
  }
  const bool negative = plain.find('-') != std::string::npos;
  const double size_deg = std::fabs(degrees) + minutes / 60.0 + seconds / 3600.0;
  return std::llround((negative ? -size_deg : size_deg) * 1e9);
}

std::int64_t days_since_1970(int year, int month, int day) {
  const int y = year - (month <= 2 ? 1 : 0);
  const int day_of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
  return 365LL * y + y / 4 - y / 100 + y / 400 + day_of_year - 719468;
}

/// "1/17/2025 4:14:08 PM".
std::optional<std::int64_t> time_us(std::string_view text) {
  const std::string copy(text);
  int month = 0;
  int day = 0;
  int year = 0;
  int hour = 0;
  int minute = 0;
  int second = 0;
  char half = 0;
  if (std::sscanf(copy.c_str(), " %2d/%2d/%4d %2d:%2d:%2d %c", &month, &day, &year, &hour, &minute,
                  &second, &half) != 7) {
    return std::nullopt;
  }
  const bool good = month >= 1 && month <= 12 && day >= 1 && day <= 31 && year >= 1970 &&
                    hour >= 1 && hour <= 12 && minute >= 0 && minute < 60 && second >= 0 &&
                    second < 60 && (half == 'A' || half == 'P');
  if (!good) {
    return std::nullopt;
  }
  hour = hour % 12 + (half == 'P' ? 12 : 0);
  const std::int64_t seconds =
      days_since_1970(year, month, day) * 86'400 + hour * 3'600 + minute * 60 + second;
  return seconds * 1'000'000;
}

using Columns = std::array<std::size_t, kColumnCount>;

Columns find_columns(std::string_view heading, const std::string& name) {
  const std::vector<std::string_view> titles = fields_of(heading);
  Columns columns{};
  for (std::size_t wanted = 0; wanted < kNames.size(); ++wanted) {
    std::size_t at = 0;
    while (at < titles.size() && titles[at] != kNames[wanted]) {
      ++at;
    }
    if (at == titles.size()) {
      throw HostError(ExitCode::kInput,
                      name + ":1: no column \"" + kNames[wanted] + "\": not a SonTek summary");
    }
    columns[wanted] = at;
  }
  return columns;
}

std::optional<SumSample> sample_of(std::string_view line, const Columns& columns) {
  const std::vector<std::string_view> fields = fields_of(line);
  for (const std::size_t column : columns) {
    if (column >= fields.size()) {
      return std::nullopt;
    }
  }
  const auto field = [&](Column column) { return fields[columns[column]]; };
  const auto t_us = time_us(field(kTime));
  const auto latitude = angle_e9deg(field(kLatitude));
  const auto longitude = angle_e9deg(field(kLongitude));
  const auto heading = number(field(kHeading));
  if (!t_us || !latitude || !longitude || !heading) {
    return std::nullopt;
  }
  SumSample sample{};
  sample.t_us = *t_us;
  sample.latitude_e9deg = *latitude;
  sample.longitude_e9deg = *longitude;
  sample.heading_deg = *heading;
  sample.pitch_deg = number(field(kPitch)).value_or(0.0);
  sample.roll_deg = number(field(kRoll)).value_or(0.0);
  for (std::size_t beam = 0; beam < kAzimuth_deg.size(); ++beam) {
    const auto depth_m = number(field(static_cast<Column>(kVertical + beam)));
    sample.depth_m[beam] = depth_m && *depth_m > 0.0 ? *depth_m : kNaN;
  }
  return sample;
}

}  // namespace

SumFile parse_sum(std::string_view text, const std::string& name) {
  SumFile file;
  Columns columns{};
  bool heading = true;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of("\r\n"), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.empty()) {
      continue;
    }
    if (heading) {
      columns = find_columns(line, name);
      heading = false;
      continue;
    }
    const std::optional<SumSample> sample = sample_of(line, columns);
    if (sample) {
      file.samples.push_back(*sample);
    } else {
      ++file.bad_lines;
    }
  }
  if (heading) {
    throw HostError(ExitCode::kInput, name + ": is empty");
  }
  return file;
}

std::string sum_pings_csv(const std::vector<SumSample>& samples, std::int64_t latitude_e9deg,
                          std::int64_t longitude_e9deg, bool tilt, std::uint64_t* out_of_reach) {
  estimator::LocalPlane plane;
  if (plane.configure({latitude_e9deg, longitude_e9deg}) != base::Status::kOk) {
    throw HostError(ExitCode::kUsage, "import: the origin's latitude is beyond 85 degrees");
  }
  std::string csv =
      "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n";
  for (const SumSample& sample : samples) {
    const auto point = plane.to_plane({sample.latitude_e9deg, sample.longitude_e9deg});
    if (!point.ok()) {
      ++*out_of_reach;
      continue;
    }
    for (std::size_t beam = 0; beam < kAzimuth_deg.size(); ++beam) {
      const double depth_m = sample.depth_m[beam];
      if (std::isnan(depth_m)) {
        continue;
      }
      csv += std::to_string(sample.t_us);
      const bool slanted = beam > 0;
      const std::pair<double, int> columns[] = {
          {static_cast<double>(point.value().north_um) * 1e-6, 3},
          {static_cast<double>(point.value().east_um) * 1e-6, 3},
          {0.0, 1},
          {tilt ? sample.roll_deg : 0.0, 1},
          {tilt ? sample.pitch_deg : 0.0, 1},
          {sample.heading_deg, 1},
          {kAzimuth_deg[beam], 0},
          {slanted ? kSlantElevation_deg : 90.0, 0},
          {slanted ? depth_m / kSlantCosine : depth_m, 4}};
      for (const auto& [value, digits] : columns) {
        csv += ",";
        append_fixed(&csv, value, digits);
      }
      csv += "\n";
    }
  }
  return csv;
}

}  // namespace leadline::host
