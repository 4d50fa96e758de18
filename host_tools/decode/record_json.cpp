#include "host_tools/decode/record_json.hpp"

#include <array>
#include <cmath>
#include <string>

#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

using base::NavField;
using base::NavKind;
using base::NavSample;
using base::Ping;
using firmware::Driver;
using nlohmann::ordered_json;

constexpr double kDegreesPerBam = 360.0 / 4294967296.0;
constexpr double kDegreesPerRadian = 57.295779513082320877;

/// Without the noise of binary fractions: ten decimals are finer than any unit here.
double tidy(double value) { return std::round(value * 1e10) / 1e10; }

/// A step of a binary angle is 8e-8 degrees: six decimals.
double tidy_angle(double degrees) { return std::round(degrees * 1e6) / 1e6; }

double signed_degrees(base::Bam32 angle) {
  return tidy_angle(static_cast<double>(static_cast<std::int32_t>(angle)) * kDegreesPerBam);
}
double turn_degrees(base::Bam32 angle) {
  return tidy_angle(static_cast<double>(angle) * kDegreesPerBam);
}
double scaled(std::int64_t value, double per_unit) {
  return tidy(static_cast<double>(value) / per_unit);
}

ordered_json time_json(std::optional<base::TimeUs> t_us) {
  return t_us ? ordered_json(*t_us) : ordered_json(nullptr);
}

/// What a key is filled from, and which kinds always have it.
struct NavColumn {
  const char* key;
  std::uint32_t fields;  ///< any of these bits
  std::uint32_t kinds;   ///< bits of NavKind: these show it even when null
  ordered_json (*value)(const NavSample& sample);
};

constexpr std::uint32_t kind(NavKind of) { return 1U << static_cast<unsigned>(of); }

constexpr std::uint32_t kVelocities =
    base::kNavVelocityBody | base::kNavVelocityWorld | base::kNavVelocityWater;
constexpr std::uint32_t kHeadings = base::kNavHeading | base::kNavHeadingMagnetic;

ordered_json three(const std::int64_t (&values)[3], double per_unit) {
  return {scaled(values[0], per_unit), scaled(values[1], per_unit), scaled(values[2], per_unit)};
}

const char* velocity_frame(std::uint32_t fields) {
  if ((fields & base::kNavVelocityWorld) != 0) {
    return "north_east_down";
  }
  return "forward_right_down";
}

constexpr std::uint32_t kAttitudes = kind(NavKind::kAttitude);
constexpr std::uint32_t kWithHeading = kAttitudes | kind(NavKind::kHeading);

const std::array<NavColumn, 25> kColumns = {{
    {"roll_deg", base::kNavRollPitch, kAttitudes,
     [](const NavSample& s) { return ordered_json(signed_degrees(s.attitude.roll_bam32)); }},
    {"pitch_deg", base::kNavRollPitch, kAttitudes,
     [](const NavSample& s) { return ordered_json(signed_degrees(s.attitude.pitch_bam32)); }},
    {"yaw_deg", kHeadings, kAttitudes,
     [](const NavSample& s) { return ordered_json(signed_degrees(s.attitude.heading_bam32)); }},
    {"heading_deg", kHeadings, kWithHeading,
     [](const NavSample& s) { return ordered_json(turn_degrees(s.attitude.heading_bam32)); }},
    {"heading_north", kHeadings, kWithHeading,
     [](const NavSample& s) {
       return ordered_json((s.fields & base::kNavHeading) != 0 ? "true" : "magnetic");
     }},
    {"latitude_deg", base::kNavGeodetic, kind(NavKind::kPosition),
     [](const NavSample& s) { return ordered_json(scaled(s.latitude_e9deg, 1e9)); }},
    {"longitude_deg", base::kNavGeodetic, kind(NavKind::kPosition),
     [](const NavSample& s) { return ordered_json(scaled(s.longitude_e9deg, 1e9)); }},
    {"position_north_east_down_m", base::kNavPositionLocal, 0,
     [](const NavSample& s) { return three(s.position_um, 1e6); }},
    {"depth_m", base::kNavDepth, kind(NavKind::kDepth),
     [](const NavSample& s) { return ordered_json(scaled(s.depth_um, 1e6)); }},
    {"pressure_pa", base::kNavPressure, kind(NavKind::kPressure),
     [](const NavSample& s) { return ordered_json(s.pressure_pa); }},
    {"velocity_m_s", kVelocities, kind(NavKind::kVelocity),
     [](const NavSample& s) { return three(s.velocity_um_s, 1e6); }},
    {"velocity_frame", kVelocities, kind(NavKind::kVelocity),
     [](const NavSample& s) { return ordered_json(velocity_frame(s.fields)); }},
    {"velocity_over", kVelocities, kind(NavKind::kVelocity),
     [](const NavSample& s) {
       return ordered_json((s.fields & base::kNavVelocityWater) != 0 ? "water" : "ground");
     }},
    {"altitude_m", base::kNavAltitude, kind(NavKind::kAltitude),
     [](const NavSample& s) { return ordered_json(scaled(s.altitude_um, 1e6)); }},
    {"roll_rate_deg_s", base::kNavRates, 0,
     [](const NavSample& s) {
       return ordered_json(tidy(static_cast<double>(s.rate_urad_s[0]) * 1e-6 * kDegreesPerRadian));
     }},
    {"pitch_rate_deg_s", base::kNavRates, 0,
     [](const NavSample& s) {
       return ordered_json(tidy(static_cast<double>(s.rate_urad_s[1]) * 1e-6 * kDegreesPerRadian));
     }},
    {"yaw_rate_deg_s", base::kNavRates | base::kNavYawRate, kind(NavKind::kRates),
     [](const NavSample& s) {
       return ordered_json(tidy(static_cast<double>(s.rate_urad_s[2]) * 1e-6 * kDegreesPerRadian));
     }},
    {"heave_down_m", base::kNavHeave, kind(NavKind::kHeave),
     [](const NavSample& s) { return ordered_json(scaled(s.heave_um, 1e6)); }},
    {"utc_us", base::kNavUtc, kind(NavKind::kTime),
     [](const NavSample& s) { return ordered_json(s.utc_us); }},
    {"pulse", base::kNavPulse, 0, [](const NavSample&) { return ordered_json(true); }},
    {"leak", base::kNavLeak, 0, [](const NavSample& s) { return ordered_json(s.leak != 0); }},
    {"sound_speed_m_s", base::kNavSoundSpeed, kind(NavKind::kWater),
     [](const NavSample& s) { return ordered_json(scaled(s.sound_speed_mm_s, 1e3)); }},
    {"temperature_degc", base::kNavTemperature, kind(NavKind::kWater),
     [](const NavSample& s) { return ordered_json(scaled(s.temperature_mdegc, 1e3)); }},
    {"velocity_sigma_m_s", kVelocities, 0,
     [](const NavSample& s) {
       return s.sigma_velocity_um_s != 0 ? ordered_json(scaled(s.sigma_velocity_um_s, 1e6))
                                         : ordered_json(nullptr);
     }},
    {"quality", ~0U, 0, [](const NavSample& s) { return ordered_json(s.quality); }},
}};

struct KindName {
  const char* name;
  std::uint32_t fields;  ///< one of them makes the record valid
};

/// In the order of NavKind.
constexpr std::array<KindName, 13> kKinds = {{
    {"other", ~0U},
    {"attitude", base::kNavRollPitch},
    {"heading", kHeadings},
    {"position", base::kNavGeodetic | base::kNavPositionLocal},
    {"depth", base::kNavDepth},
    {"pressure", base::kNavPressure},
    {"velocity", kVelocities},
    {"altitude", base::kNavAltitude},
    {"rates", base::kNavRates | base::kNavYawRate},
    {"heave", base::kNavHeave},
    {"time", base::kNavUtc},
    {"water", base::kNavSoundSpeed | base::kNavTemperature},
    {"line", base::kNavPulse | base::kNavLeak},
}};

/// One sigma where the sensor states it.
struct SigmaColumn {
  const char* key;
  std::uint32_t fields;  ///< any of these bits
  double (*value)(const NavSample& sample);
};

double sigma_degrees(std::uint32_t sigma_urad) {
  return tidy_angle(sigma_urad * 1e-6 * kDegreesPerRadian);
}

constexpr std::array<SigmaColumn, 5> kSigmas = {{
    {"roll_sigma_deg", base::kNavRollPitch,
     [](const NavSample& s) { return sigma_degrees(s.sigma_attitude_urad[0]); }},
    {"pitch_sigma_deg", base::kNavRollPitch,
     [](const NavSample& s) { return sigma_degrees(s.sigma_attitude_urad[1]); }},
    {"heading_sigma_deg", kHeadings,
     [](const NavSample& s) { return sigma_degrees(s.sigma_attitude_urad[2]); }},
    {"position_sigma_m", base::kNavGeodetic | base::kNavPositionLocal,
     [](const NavSample& s) { return scaled(s.sigma_position_mm, 1e3); }},
    {"vertical_sigma_m", base::kNavDepth | base::kNavPositionLocal,
     [](const NavSample& s) { return scaled(s.sigma_vertical_mm, 1e3); }},
}};

/// Down positive is how samples count; these devices' own numbers count up.
bool heave_counts_up(Driver driver) {
  return driver == Driver::kTss1 || driver == Driver::kNmea2000;
}

/// What a record is about whose codec does not say.
NavKind kind_of(const NavSample& sample) {
  if (sample.kind != NavKind::kOther) {
    return sample.kind;
  }
  for (std::size_t number = 1; number < kKinds.size(); ++number) {
    if ((sample.fields & kKinds[number].fields) != 0) {
      return static_cast<NavKind>(number);
    }
  }
  return NavKind::kOther;
}

/// Echo sounders on a ship's bus send "depth", and mean the water below their transducer: DBT, DPT,
/// PGN 128267. An altimeter of a vehicle (PRVAT) knows its own depth as well.
bool is_depth_of_water(const NavSample& sample, Driver driver) {
  const bool bus = driver == Driver::kNmea || driver == Driver::kNmea2000;
  return bus && kind_of(sample) == NavKind::kAltitude &&
         (sample.fields & (base::kNavPressure | base::kNavDepth)) == 0;
}

enum class AngleKind : std::uint8_t { kTransducer, kTransducerFromAft, kFan };

AngleKind angle_kind(Driver driver) {
  switch (driver) {
    // These count from the side away from where the mount's forward axis looks.
    case Driver::kPing360:
    case Driver::kTritech:
      return AngleKind::kTransducerFromAft;
    case Driver::kImagenex:
      return AngleKind::kTransducer;
    default:
      return AngleKind::kFan;
  }
}

double device_angle_deg(const Ping& ping, Driver driver) {
  switch (angle_kind(driver)) {
    case AngleKind::kTransducer:
      return turn_degrees(ping.azimuth_bam32);
    case AngleKind::kTransducerFromAft:
      return turn_degrees(ping.azimuth_bam32 + base::kBam32HalfTurn);
    case AngleKind::kFan:
      break;
  }
  const double azimuth_rad = signed_degrees(ping.azimuth_bam32) / kDegreesPerRadian;
  const double elevation_rad = signed_degrees(ping.elevation_bam32) / kDegreesPerRadian;
  const double angle_rad =
      std::atan2(std::cos(elevation_rad) * std::sin(azimuth_rad), std::sin(elevation_rad));
  return tidy_angle(angle_rad * kDegreesPerRadian);
}

ordered_json sound_speed_json(const Ping& ping) {
  return ping.sound_speed_mm_s != 0 ? ordered_json(scaled(ping.sound_speed_mm_s, 1e3))
                                    : ordered_json(nullptr);
}

ordered_json ping_json(std::optional<base::TimeUs> t_us) {
  ordered_json json;
  json["record"] = "ping";
  json["t_us"] = time_json(t_us);
  return json;
}

/// A value of a record in few characters: a long list by its length and its ends.
std::string short_text(const ordered_json& value) {
  if (value.is_string()) {
    return printable(value.get<std::string>());
  }
  if (!value.is_array() || value.size() <= 3) {
    return value.dump();
  }
  return "[" + value.front().dump() + " .. " + value.back().dump() + "](" +
         std::to_string(value.size()) + ")";
}

}  // namespace

ordered_json sample_json(const NavSample& sample, Driver driver, std::optional<base::TimeUs> t_us) {
  const NavKind about = kind_of(sample);
  const KindName& name = kKinds[static_cast<std::size_t>(about)];
  const std::uint32_t fields = sample.fields;
  const bool sounder = is_depth_of_water(sample, driver);
  ordered_json json;
  json["record"] = sounder ? "depth" : name.name;
  json["t_us"] = time_json(t_us);
  json["valid"] = (fields & name.fields) != 0;
  if (sounder) {
    json["depth_below_transducer_m"] = (fields & base::kNavAltitude) != 0
                                           ? ordered_json(scaled(sample.altitude_um, 1e6))
                                           : ordered_json(nullptr);
  }
  for (const NavColumn& column : kColumns) {
    if ((fields & column.fields) != 0) {
      json[column.key] = column.value(sample);
    } else if ((column.kinds & kind(about)) != 0) {
      json[column.key] = nullptr;
    }
  }
  for (const SigmaColumn& sigma : kSigmas) {
    if ((fields & sigma.fields) != 0 && sigma.value(sample) > 0) {
      json[sigma.key] = sigma.value(sample);
    }
  }
  if (json.contains("heave_down_m")) {
    const ordered_json& down = json["heave_down_m"];
    const double sign = heave_counts_up(driver) ? -1 : 1;
    json["heave_m"] = down.is_null() ? down : ordered_json(sign * down.get<double>() + 0.0);
  }
  return json;
}

ordered_json beams_json(const std::vector<Ping>& beams, Driver driver,
                        std::optional<base::TimeUs> t_us) {
  ordered_json json = ping_json(t_us);
  for (const char* const key :
       {"range_mm", "angle_deg", "azimuth_deg", "elevation_deg", "quality"}) {
    json[key] = ordered_json::array();
  }
  for (const Ping& beam : beams) {
    const bool heard = beam.kind == base::ReturnKind::kRange;
    json["range_mm"].push_back(heard ? ordered_json(scaled(beam.range_um, 1e3))
                                     : ordered_json(nullptr));
    json["angle_deg"].push_back(device_angle_deg(beam, driver));
    json["azimuth_deg"].push_back(signed_degrees(beam.azimuth_bam32));
    json["elevation_deg"].push_back(signed_degrees(beam.elevation_bam32));
    json["quality"].push_back(beam.quality);
  }
  json["sound_speed_m_s"] = sound_speed_json(beams.front());
  return json;
}

ordered_json profile_json(const Ping& ping, Driver driver, std::optional<base::TimeUs> t_us) {
  ordered_json json = ping_json(t_us);
  json["angle_deg"] = device_angle_deg(ping, driver);
  json["azimuth_deg"] = signed_degrees(ping.azimuth_bam32);
  json["elevation_deg"] = signed_degrees(ping.elevation_bam32);
  json["first_sample_mm"] = scaled(ping.profile.first_bin_um, 1e3);
  json["sample_mm"] = scaled(ping.profile.bin_um, 1e3);
  json["sound_speed_m_s"] = sound_speed_json(ping);
  json["samples"] = std::vector<std::uint16_t>(ping.profile.intensity,
                                               ping.profile.intensity + ping.profile.bin_count);
  return json;
}

std::string record_text(const ordered_json& record) {
  std::string text = record["record"].get<std::string>();
  text.resize(std::max<std::size_t>(text.size() + 1, 10), ' ');
  const ordered_json& t_us = record["t_us"];
  if (t_us.is_null()) {
    text += "-";
  } else {
    append_fixed(&text, t_us.get<double>() / 1e6, 6);
  }
  for (const auto& [key, value] : record.items()) {
    if (key != "record" && key != "t_us" && !value.is_null() && !(key == "valid" && value)) {
      text += "  " + key + " " + short_text(value);
    }
  }
  return text;
}

}  // namespace leadline::host
