#include "firmware/config/tide_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <optional>
#include <vector>

#include "firmware/config/exit_codes.hpp"
#include "firmware/config/input_file.hpp"
#include "firmware/pipeline/water_level.hpp"

namespace leadline::host {
namespace {

using firmware::TidePoint;

/// The whole text as a finite number.
std::optional<double> number_of(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  const bool whole =
      end != text.c_str() &&
      text.find_first_not_of(" \t\r", static_cast<std::size_t>(end - text.c_str())) ==
          std::string::npos;
  return whole && std::isfinite(value) ? std::optional<double>(value) : std::nullopt;
}

/// Seconds since 1970.
std::optional<double> utc_of(const std::string& text) {
  std::tm calendar{};
  const char* const end = strptime(text.c_str(), " %Y-%m-%dT%H:%M:%SZ ", &calendar);
  if (end != nullptr && *end == '\0') {
    return static_cast<double>(timegm(&calendar));
  }
  return number_of(text);
}

/// Keeps what fits, from the last point before `now_us` on.
void keep(const std::vector<TidePoint>& points, std::int64_t now_us, firmware::WaterConfig* water) {
  constexpr auto kMost = static_cast<std::size_t>(firmware::kMaxTidePoints);
  std::size_t first = 0;
  while (points.size() - first > kMost && points[first + 1].t_us <= now_us) {
    ++first;
  }
  water->tide_count = 0;
  for (std::size_t i = first; i < points.size() && i - first < kMost; ++i) {
    water->tide[water->tide_count] = points[i];
    ++water->tide_count;
  }
}

}  // namespace

void parse_tide(std::string_view text, const std::string& name, std::int64_t utc_less_vehicle_us,
                std::int64_t now_us, firmware::WaterConfig* water) {
  std::vector<TidePoint> points;
  std::size_t at = 0;
  int number = 0;
  bool first_line = true;
  const auto refuse = [&](const std::string& reason) {
    throw HostError(ExitCode::kInput, name + ":" + std::to_string(number) + ": " + reason);
  };
  while (at < text.size()) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string line(text.substr(at, std::min(end, text.find('#', at)) - at));
    at = end + 1;
    ++number;
    if (line.find_first_not_of(" \t\r") == std::string::npos) {
      continue;
    }
    const std::size_t comma = line.find(',');
    const std::optional<double> utc_s = utc_of(line.substr(0, comma));
    const bool names = first_line && !utc_s;
    first_line = false;
    if (names) {
      continue;
    }
    const std::optional<double> height_m =
        comma != std::string::npos ? number_of(line.substr(comma + 1)) : std::nullopt;
    if (!utc_s || !height_m || std::fabs(*utc_s) > 1e11 || std::fabs(*height_m) > 100) {
      refuse(
          "has to be UTC (2026-11-22T23:00:00Z, or seconds since 1970), a comma, and the height "
          "in metres, -100 to 100");
    }
    points.push_back({std::llround(*utc_s * 1e6) - utc_less_vehicle_us,
                      static_cast<std::int32_t>(std::lround(*height_m * 1e3))});
    firmware::WaterConfig pair{};
    pair.tide_count = static_cast<std::uint16_t>(std::min<std::size_t>(points.size(), 2));
    std::copy(points.end() - pair.tide_count, points.end(), pair.tide);
    if (!firmware::tide_sound(pair)) {
      refuse("has to be later than the line before it, by 31 days at most");
    }
  }
  if (points.empty()) {
    refuse("no tide in it");
  }
  keep(points, now_us, water);
}

void load_tide(VehicleFile* file, std::int64_t utc_less_vehicle_us, std::int64_t now_us) {
  if (file->tide_path.empty()) {
    return;
  }
  parse_tide(read_input(file->tide_path), file->tide_path, utc_less_vehicle_us, now_us,
             &file->config.water);
}

}  // namespace leadline::host
