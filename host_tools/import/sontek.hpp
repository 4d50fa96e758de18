// SonTek RiverSurveyor M9 / S5 summaries (.sum): one line of text a ping, with one vertical and four slanted
// depths. Comma separated, lines may end in a bare carriage return, positions in degrees, minutes and seconds
// with Latin-1 degree signs.
//
// Columns by name; needed: Date/Time, Latitude (deg), Longitude (deg), Heading (deg), Pitch (deg), Roll (deg),
// VB Depth (m), BT Beam1 Depth (m) .. BT Beam4 Depth (m). A depth that is empty or not over 0 is a beam that
// found nothing. Times are the recorder's local clock, taken as it is.
//
// Beams: 0 straight down; 1 .. 4 slanted by kSonTekSlant_deg, at kSonTekAzimuth_deg from forward to
// starboard. Depths are vertical below the instrument in its own frame: range = depth / cos(slant).
#pragma once

#include <string>

#include "host_tools/import/survey.hpp"

namespace leadline::host {

inline constexpr double kSonTekSlant_deg = 25.0;
inline constexpr double kSonTekAzimuth_deg[4] = {315.0, 225.0, 135.0, 45.0};
/// That the instrument is told by default; the file does not say. Ranges are the file's own.
inline constexpr std::int32_t kSonTekSpeed_mm_s = 1'500'000;

/// Throws HostError kInput: cannot be read, a column is missing, no usable line. Lines that cannot be used are
/// counted into `notice`.
[[nodiscard]] SurveyLine read_sontek_line(const std::string& path, std::string* notice);

/// `52° 20' 34.77"` to degrees times 1e9; the sign may be in front. False for anything else.
[[nodiscard]] bool parse_dms(std::string_view text, std::int64_t* angle_e9deg);

}  // namespace leadline::host
