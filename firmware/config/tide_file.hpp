// A tide's CSV: time, height in metres over the survey's zero of depth. A time is UTC, as
// 2026-11-22T23:00:00Z or as seconds since 1970; lines in order of time; '#' begins a comment; one line of
// column names may stand first.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "firmware/config/vehicle_file.hpp"

namespace leadline::host {

/// Puts the tide of `text` into `water`, in vehicle time: UTC less `utc_less_vehicle_us`. Of more than
/// firmware::kMaxTidePoints those from the last one before `now_us` (vehicle time) on. Throws HostError
/// kInput: `NAME:LINE: reason`.
void parse_tide(std::string_view text, const std::string& name, std::int64_t utc_less_vehicle_us,
                std::int64_t now_us, firmware::WaterConfig* water);

/// The same with the file that [navigation] tide_file names; nothing without it.
void load_tide(VehicleFile* file, std::int64_t utc_less_vehicle_us, std::int64_t now_us);

}  // namespace leadline::host
