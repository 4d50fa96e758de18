// Decoded records as JSON objects, for `leadline decode` and whoever reads it. Every key ends in its unit.
//
// ping     t_us, then either
//            range_mm, angle_deg, azimuth_deg, elevation_deg, quality: one entry a beam, range_mm null
//            where nothing came back; or, for a head that gives intensities,
//            samples (one intensity a bin), first_sample_mm and sample_mm (centre of the first, and length
//            of a bin), angle_deg, azimuth_deg, elevation_deg: numbers
//          sound_speed_m_s: that the lengths were made with; null: 1500 m/s
// others   t_us, valid, then what such a record can hold, null where it is not known; and whatever else this
//          one holds. `valid` is false where the record's own measure is not known.
//
// depth    of a pressure sensor or vehicle: depth_m, below the surface. Of an echo sounder on NMEA 0183 or NMEA
//          2000 (DBT, DPT, 128267): depth_below_transducer_m and the same as altitude_m, no depth_m
//
// What a device states beside that (variation, offsets, accelerations, beams, settings) follows: frame_values.hpp.
//
// azimuth and elevation are in the mount's frame: azimuth from forward to the right, elevation positive down.
// angle_deg is the device's own angle: of a scanning head the turn of its transducer, 0 .. 360, of a fan the
// angle across the track from straight below, starboard positive.
#pragma once

#include <optional>
#include <vector>

#include <nlohmann/json.hpp>

#include "firmware/pipeline/drivers.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

/// `t_us`: null where nobody knows it.
[[nodiscard]] nlohmann::ordered_json sample_json(const base::NavSample& sample,
                                                 firmware::Driver driver,
                                                 std::optional<base::TimeUs> t_us);

/// Beams of one transmission, in their order; kRange and kNoReturn, at least one.
[[nodiscard]] nlohmann::ordered_json beams_json(const std::vector<base::Ping>& beams,
                                                firmware::Driver driver,
                                                std::optional<base::TimeUs> t_us);

/// A kProfile record, while its intensities are valid.
[[nodiscard]] nlohmann::ordered_json profile_json(const base::Ping& ping, firmware::Driver driver,
                                                  std::optional<base::TimeUs> t_us);

/// The same record as one line of text: name, time, "key value" pairs without what is not known.
[[nodiscard]] std::string record_text(const nlohmann::ordered_json& record);

}  // namespace leadline::host
