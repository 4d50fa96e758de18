// SonTek RiverSurveyor summaries (`.sum`): a sample a line, fields between commas by the names of the heading,
// lines ending in CR, LF or both. Depths are of the vertical beam (VB) and of the four bottom-track beams,
// which look 25 degrees from the vertical at 45, 135, 225 and 315 degrees from the bow.
//
// Which of the four is where: 1 at 315, 2 at 225, 3 at 135, 4 at 45 (found by comparing crossings of a real
// survey; the maker's own drawing was not at hand: UNSURE).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace leadline::host {

struct SumSample {
  std::int64_t t_us;  ///< the file's local clock, counted as if it were UTC
  std::int64_t latitude_e9deg;
  std::int64_t longitude_e9deg;
  double heading_deg;
  double pitch_deg;
  double roll_deg;
  double depth_m[5];  ///< vertical, beams 1 .. 4; NaN: none (empty, or 0)
};

struct SumFile {
  std::vector<SumSample> samples;
  std::uint64_t bad_lines = 0;  ///< lines without a readable time, position or heading
};

/// Throws HostError kInput naming the file and the column where the heading lacks one.
[[nodiscard]] SumFile parse_sum(std::string_view text, const std::string& name);

/// Rows of pings.csv (host_tools/ping_csv.hpp), heading included: x north and y east of the origin on the
/// plane of estimator/geodesy.hpp, z 0 (depths count from the surface). `tilt`: with the file's roll and
/// pitch; otherwise 0, since the file's depths are not ranges any more. Samples beyond the plane's reach are
/// left out and counted in `*out_of_reach`.
[[nodiscard]] std::string sum_pings_csv(const std::vector<SumSample>& samples,
                                        std::int64_t latitude_e9deg, std::int64_t longitude_e9deg,
                                        bool tilt, std::uint64_t* out_of_reach);

}  // namespace leadline::host
