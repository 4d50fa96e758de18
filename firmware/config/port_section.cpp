#include "firmware/config/port_section.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "firmware/config/text.hpp"
#include "firmware/pipeline/driver_codecs.hpp"
#include "model/echo_detector.hpp"

namespace leadline::host {
namespace {

using firmware::Driver;
using firmware::driver_name;
using firmware::IntensityScale;
using firmware::PortConfig;

// ---- Drivers ------------------------------------------------------------------------------------

constexpr std::size_t enabled_count() {
  std::size_t count = 0;
  for (const firmware::DriverInfo& info : firmware::kDrivers) {
    count += firmware::driver_enabled(info.driver) ? 1U : 0U;
  }
  return count;
}

/// Those that this program carries.
constexpr std::array<firmware::DriverInfo, enabled_count()> enabled_drivers() {
  std::array<firmware::DriverInfo, enabled_count()> enabled{};
  std::size_t count = 0;
  for (const firmware::DriverInfo& info : firmware::kDrivers) {
    if (firmware::driver_enabled(info.driver)) {
      enabled[count] = info;
      ++count;
    }
  }
  return enabled;
}
constexpr auto kEnabledDrivers = enabled_drivers();

constexpr std::array<const char*, kEnabledDrivers.size()> enabled_names() {
  std::array<const char*, kEnabledDrivers.size()> names{};
  for (std::size_t i = 0; i < names.size(); ++i) {
    names[i] = kEnabledDrivers[i].name;
  }
  return names;
}
constexpr auto kDriverNames = enabled_names();

/// A set of drivers: bit n = driver n.
using DriverSet = std::uint32_t;
static_assert(firmware::kLastDriver < 32, "a set has a bit for every driver");

template <class... Drivers>
constexpr DriverSet of(Drivers... drivers) {
  return ((DriverSet{1} << static_cast<unsigned>(drivers)) | ...);
}
constexpr bool contains(DriverSet set, Driver driver) { return (set & of(driver)) != 0; }

constexpr DriverSet all_heads() {
  DriverSet set = 0;
  for (const firmware::DriverInfo& info : firmware::kDrivers) {
    set |= info.kind == firmware::DriverKind::kHead ? of(info.driver) : 0U;
  }
  return set;
}
constexpr DriverSet kHeads = all_heads();
/// Heads that are asked for pings; the others talk by themselves.
constexpr DriverSet kAsked =
    of(Driver::kPing1d, Driver::kPing360, Driver::kCerulean, Driver::kImagenex, Driver::kTritech);
/// The same for all devices.
constexpr DriverSet kSilent = kAsked | of(Driver::kKeller, Driver::kTrax);
/// Heads that send intensities.
constexpr DriverSet kProfiles = kAsked;
constexpr DriverSet kScanners = of(Driver::kPing360, Driver::kImagenex, Driver::kTritech);
constexpr DriverSet kEvery = ~DriverSet{0};

// ---- Keys: one line each, with the drivers that have it -----------------------------------------

/// An integer of the configuration; the file's unit is `scale` of it.
struct NumberKey {
  const char* key;
  std::int32_t PortConfig::*field;
  double least;
  double most;
  double scale;
  std::int32_t
      offset;  ///< stored value of the file's 0; 1: stored 0 is "not given", and not written
  DriverSet drivers;
};

constexpr std::array<NumberKey, 17> kNumberKeys{{
    {"latency_ms", &PortConfig::latency_us, -1000, 10'000, 1e3, 0, kEvery},
    {"byte_time_ns", &PortConfig::byte_time_ns, 0, 100'000'000, 1, 0, kEvery},
    {"interval_ms", &PortConfig::ping_interval_us, 0, 60'000, 1e3, 0, kSilent},
    {"scan_first_grad", &PortConfig::scan_first_grad, 0, 399, 1, 0, kScanners},
    {"scan_last_grad", &PortConfig::scan_last_grad, 0, 399, 1, 0, kScanners},
    {"scan_step_grad", &PortConfig::scan_step_grad, 1, 10, 1, 0, kScanners},
    {"gain", &PortConfig::gain_plus_1, 0, 6, 1, 1, of(Driver::kPing1d)},
    {"gain", &PortConfig::gain_plus_1, 0, 2, 1, 1, of(Driver::kPing360)},
    {"gain", &PortConfig::gain_plus_1, 0, 100, 1, 1, of(Driver::kCerulean)},
    {"gain", &PortConfig::gain_plus_1, 0, 40, 1, 1, of(Driver::kImagenex)},
    {"gain", &PortConfig::gain_plus_1, 0, 210, 1, 1, of(Driver::kTritech)},
    {"frequency_khz", &PortConfig::frequency_khz, 200, 2000, 1, 0, of(Driver::kTritech)},
    {"frequency_khz", &PortConfig::frequency_khz, 500, 1000, 1, 0, of(Driver::kPing360)},
    {"address", &PortConfig::address, 0, 255, 1, 0,
     kAsked | of(Driver::kKeller, Driver::kNmea2000, Driver::kMavlink)},
    {"intensity_step_db", &PortConfig::intensity_step_mdb, 0.001, 6, 1e3, 0, kProfiles},
    {"max_returns", &PortConfig::max_returns, 1, model::kMaxReturns, 1, 0, kProfiles},
    {"quality_weight_percent", &PortConfig::quality_weight_percent, 0, 100, 1, 0, kHeads},
}};

/// A bit of PortConfig::switches.
struct SwitchKey {
  const char* key;
  std::uint16_t bit;
  bool when_clear;  ///< what the key says while the bit is not set: its default
  DriverSet drivers;
};

constexpr std::array<SwitchKey, 27> kSwitchKeys{{
    {"clockwise", firmware::kPortOtherSense, true, kScanners},
    {"positive_to_port", firmware::kPortOtherSense, true, of(Driver::kCerulean)},
    {"positive_to_starboard", firmware::kPortOtherSense, true, of(Driver::kDeltat83p)},
    {"columns_to_the_right", firmware::kPortOtherSense, true, of(Driver::kWl3d)},
    {"rows_upwards", firmware::kPortOtherPitch, true, of(Driver::kWl3d)},
    {"a2_inclusive", firmware::kPortOtherSense, true, of(Driver::kR2sonic)},
    {"heave_up", firmware::kPortOtherSense, true, of(Driver::kNmea2000)},
    {"velocity_of_bottom", firmware::kPortOtherSense, true, of(Driver::kPd0)},
    {"roll_positive", firmware::kPortOtherRoll, true, of(Driver::kImagenex, Driver::kDeltat83p)},
    {"pitch_positive", firmware::kPortOtherPitch, true,
     of(Driver::kCerulean, Driver::kImagenex, Driver::kDeltat83p)},
    {"use_variation", firmware::kPortUseVariation, false, of(Driver::kNmea, Driver::kNmea2000)},
    {"prdid_true", firmware::kPortOtherNorth, false, of(Driver::kNmea)},
    {"true_heading", firmware::kPortOtherNorth, false,
     of(Driver::kDeltat83p, Driver::kVectornav, Driver::kXsens, Driver::kTrax, Driver::kPd0,
        Driver::kNmea2000)},
    {"true_heading", firmware::kPortOtherNorth, true, of(Driver::kMavlink)},
    {"gauge_pressure", firmware::kPortGaugePressure, false, of(Driver::kNmea, Driver::kKeller)},
    {"pressure_only", firmware::kPortPressureOnly, false, of(Driver::kKeller)},
    {"use_pressure", firmware::kPortUsePressure, false, of(Driver::kXsens)},
    {"require_checksum", firmware::kPortAcceptUnchecked, true,
     of(Driver::kNmea, Driver::kVectornav, Driver::kWldvl)},
    {"euler_angles", firmware::kPortEulerAngles, false, of(Driver::kTss1, Driver::kPd0)},
    {"other_axes", firmware::kPortOtherAxes, false, of(Driver::kXsens, Driver::kWldvl)},
    {"check_status", firmware::kPortIgnoreStatus, true, of(Driver::kXsens, Driver::kTrax)},
    {"use_device_clock", firmware::kPortDeviceClock, false,
     of(Driver::kVectornav, Driver::kXsens, Driver::kWldvl, Driver::kMavlink, Driver::kR2sonic,
        Driver::kKongsberg)},
    {"zero_at_surface", firmware::kPortZeroAtSurface, false,
     of(Driver::kNmea, Driver::kKeller, Driver::kXsens, Driver::kNmea2000, Driver::kMavlink)},
    {"rising", firmware::kPortOtherSense, true, of(Driver::kLine)},
    {"watch_stuck", firmware::kPortWatchStuck, false, kEvery & ~kHeads},
    {"send", firmware::kPortSend, false, of(Driver::kMavlink)},
    {"profile", 0, false, of(Driver::kPing1d, Driver::kCerulean, Driver::kImagenex)},
}};

/// Which of a driver's devices, or of its ways to talk. The first is the default.
struct VariantKey {
  Driver driver;
  const char* key;
  std::array<const char*, 6> names;  ///< in the order of the codec's own enumerators; then nulls
};

constexpr std::array<VariantKey, 5> kVariantKeys{{
    {Driver::kCerulean, "model", {"listen", "surveyor", "omniscan3d", "omniscan450", "s500"}},
    {Driver::kImagenex, "model", {"auto", "852_sounder", "852_scanner", "881a", "831l"}},
    {Driver::kTritech, "model", {"listen", "imaging", "profiler"}},
    {Driver::kKeller, "bus", {"modbus", "keller"}},
    {Driver::kLine, "role", {"pps", "ping_sync", "leak"}},
}};

constexpr std::array<const char*, 3> kScaleNames = {"energy", "amplitude", "decibel"};
/// Steps of a Ping360's intensities: their spread is the same at every level, so they are logarithmic;
/// nothing says of which step. With this one its 8 bits span 76 dB.
constexpr std::int32_t kUsualStep_mdb = 300;

constexpr std::array<std::pair<const char*, DriverSet>, 7> kOtherKeys{{
    {"uri", kEvery},
    {"optional", kEvery},
    {"driver", kEvery},
    {"mount", kEvery},
    {"min_range_mm", kHeads},
    {"max_range_mm", kHeads},
    {"intensity", kProfiles},
}};

/// Every key, with the drivers that know it, as often as it stands in the tables.
std::vector<std::pair<const char*, DriverSet>> keys_with_drivers() {
  std::vector<std::pair<const char*, DriverSet>> keys(kOtherKeys.begin(), kOtherKeys.end());
  for (const NumberKey& each : kNumberKeys) {
    keys.emplace_back(each.key, each.drivers);
  }
  for (const SwitchKey& each : kSwitchKeys) {
    keys.emplace_back(each.key, each.drivers);
  }
  for (const VariantKey& each : kVariantKeys) {
    keys.emplace_back(each.key, of(each.driver));
  }
  return keys;
}

// ---- Reading ------------------------------------------------------------------------------------

void read_port_mount(const TomlSection& section, const std::vector<std::string>& names,
                     PortConfig* port) {
  if (!section.has("mount")) {
    const bool line = port->driver == Driver::kLine;
    const bool syncs = line && firmware::line_config(*port, {}).role == hal::LineRole::kPingSync;
    if (!firmware::is_head(port->driver) && !syncs) {
      port->mount = firmware::kNoMount;
    } else if (names.size() > 1) {
      section.find_missing("mount is missing: which of them carries this head");
    }
    return;
  }
  std::string name;
  if (!section.read_text("mount", 32, &name)) {
    return;
  }
  const auto known = std::find(names.begin(), names.end(), name);
  if (known == names.end()) {
    const std::string near = closest_name(name, names);
    section.refuse("mount", "there is no [[mount]] of that name" +
                                (near.empty() ? "" : "; did you mean \"" + near + "\"?"));
    return;
  }
  port->mount = static_cast<std::uint8_t>(known - names.begin());
}

void read_port_range(const TomlSection& section, const SonarRanges& ranges, PortConfig* port) {
  constexpr std::int64_t kLongest_mm = base::kMaxRange_um / 1000;
  constexpr auto kRange_mm = static_cast<double>(kLongest_mm);
  std::int64_t min_mm = ranges.min_range_mm;
  std::int64_t max_mm = ranges.max_range_mm;
  section.read_integer("min_range_mm", {0, kRange_mm}, &min_mm);
  section.read_integer("max_range_mm", {1, kRange_mm}, &max_mm);
  if (min_mm >= max_mm && (section.has("min_range_mm") || section.has("max_range_mm"))) {
    section.find(section.has("min_range_mm") ? "min_range_mm" : "max_range_mm",
                 "min_range_mm = " + std::to_string(min_mm) +
                     " has to be below max_range_mm = " + std::to_string(max_mm));
  }
  port->min_range_um = min_mm * 1000;
  port->max_range_um = max_mm * 1000;
}

/// Keys that say nothing to this driver are mistakes of whoever wrote them.
void refuse_foreign_keys(const TomlSection& section, Driver driver) {
  const auto keys = keys_with_drivers();
  std::vector<std::string> refused;
  for (const auto& [key, drivers] : keys) {
    const std::string name = key;
    const bool has = std::any_of(keys.begin(), keys.end(), [&](const auto& each) {
      return name == each.first && contains(each.second, driver);
    });
    const bool said = std::find(refused.begin(), refused.end(), name) != refused.end();
    if (!has && !said && section.has(key)) {
      section.refuse(key, std::string("driver \"") + driver_name(driver) + "\" has no such key");
      refused.push_back(name);
    }
  }
}

void set_port_defaults(const hal::UriSpec& uri, PortConfig* port) {
  if (uri.scheme == hal::UriScheme::kSerial) {
    // Start bit, eight, stop bit.
    port->byte_time_ns = static_cast<std::int32_t>(10'000'000'000 / std::max(uri.baud, 1U));
  }
  port->ping_interval_us = contains(kAsked, port->driver) ? 100'000 : 0;
  port->intensity_step_mdb = contains(kProfiles, port->driver) ? kUsualStep_mdb : 0;
  port->max_returns = contains(kProfiles, port->driver) ? 1 : 0;
  if (contains(kScanners, port->driver)) {
    port->ping_interval_us = 0;
    port->scan_last_grad = 399;
    port->scan_step_grad = 1;
    port->profile = 1;
  }
  if (port->driver == Driver::kPing1d) {
    port->gain_plus_1 = hal::Ping1dConfig{}.gain_setting + 1;
  } else if (port->driver == Driver::kPing360) {
    port->gain_plus_1 = hal::Ping360Config{}.gain_setting + 1;
    port->frequency_khz = hal::Ping360Config{}.frequency_khz;
    port->intensity_scale = IntensityScale::kDecibel;
  } else if (port->driver == Driver::kCerulean) {
    port->profile = 1;
    port->intensity_scale = IntensityScale::kAmplitude;  // the codec's own work
  } else if (port->driver == Driver::kImagenex) {
    port->gain_plus_1 = hal::ImagenexConfig{}.gain_db + 1;
  } else if (port->driver == Driver::kTritech) {
    port->gain_plus_1 = hal::TritechConfig{}.gain + 1;
    port->frequency_khz = hal::TritechConfig{}.frequency_hz / 1000;
    port->intensity_scale = IntensityScale::kDecibel;
    port->intensity_step_mdb = 314;  // 80 dB over 8 bits
  } else if (port->driver == Driver::kTrax) {
    port->ping_interval_us = static_cast<std::int32_t>(hal::TraxConfig{}.interval_us);
  } else if (port->driver == Driver::kKeller) {
    port->address = hal::KellerConfig{}.address;
    port->ping_interval_us = hal::KellerConfig{}.poll_interval_us;
  }
}

void read_switches(const TomlSection& section, PortConfig* port) {
  for (const SwitchKey& each : kSwitchKeys) {
    bool value = each.when_clear;
    if (!contains(each.drivers, port->driver) || !section.read_bool(each.key, &value)) {
      continue;
    }
    if (each.bit == 0) {
      port->profile = value ? 1 : 0;
    } else if (value != each.when_clear) {
      port->switches = static_cast<std::uint16_t>(port->switches | each.bit);
    }
  }
}

void read_numbers(const TomlSection& section, PortConfig* port) {
  for (const NumberKey& each : kNumberKeys) {
    if (!contains(each.drivers, port->driver) || !section.has(each.key)) {
      continue;
    }
    const Limits limits = {each.least, each.most};
    std::int32_t value = port->*each.field - each.offset;
    if (each.scale > 1) {
      read_scaled(section, each.key, limits, each.scale, &value);
    } else {
      read_whole(section, each.key, limits, &value);
    }
    port->*each.field = value + each.offset;
  }
}

std::size_t variant_count(const VariantKey& variant) {
  return static_cast<std::size_t>(std::find(variant.names.begin(), variant.names.end(), nullptr) -
                                  variant.names.begin());
}

void read_variant(const TomlSection& section, PortConfig* port) {
  for (const VariantKey& each : kVariantKeys) {
    if (each.driver == port->driver && section.has(each.key)) {
      const std::size_t count = variant_count(each);
      const std::size_t chosen =
          section.read_choice(each.key, each.names.data(), count, std::size_t{0});
      port->variant_plus_1 = static_cast<std::int32_t>(chosen) + 1;
    }
  }
}

void read_head(const TomlSection& section, const PortContext& context, PortConfig* port) {
  read_port_range(section, context.ranges, port);
  if (!contains(kProfiles, port->driver)) {
    return;
  }
  port->intensity_scale = static_cast<IntensityScale>(section.read_choice(
      "intensity", kScaleNames, static_cast<std::size_t>(port->intensity_scale)));
}

}  // namespace

PortConfig default_port(Driver driver, const hal::UriSpec& uri) {
  PortConfig port{};
  port.driver = driver;
  set_port_defaults(uri, &port);
  return port;
}

std::vector<std::string> variant_names(Driver driver) {
  for (const VariantKey& each : kVariantKeys) {
    if (each.driver == driver) {
      return {each.names.begin(), each.names.begin() + variant_count(each)};
    }
  }
  return {};
}

bool silent_unless_asked(Driver driver) { return contains(kSilent, driver); }

std::vector<std::string> port_keys() {
  std::vector<std::string> keys;
  for (const auto& [key, drivers] : keys_with_drivers()) {
    if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
      keys.emplace_back(key);
    }
  }
  return keys;
}

bool read_uri(const TomlSection& section, hal::UriSpec* spec) {
  std::string text;
  if (!section.has("uri")) {
    section.find_missing("uri is missing");
    return false;
  }
  if (!section.read_text("uri", 512, &text)) {
    return false;
  }
  hal::UriResult result = hal::parse_uri(text);
  if (!result.ok()) {
    section.find("uri", "uri = " + result.error);
    return false;
  }
  *spec = std::move(result.spec);
  return true;
}

PortSection read_port(const TomlSection& section, const PortContext& context) {
  PortSection result;
  PortConfig& port = result.config;
  read_uri(section, &result.uri);
  section.read_bool("optional", &result.optional);
  if (!section.has("driver")) {
    section.find_missing(R"(driver is missing: "ping1d", "nmea", ...)");
  }
  const std::size_t driver = section.read_choice("driver", kDriverNames, kDriverNames.size());
  if (driver == kDriverNames.size()) {
    return result;
  }
  port.driver = kEnabledDrivers[driver].driver;
  refuse_foreign_keys(section, port.driver);
  set_port_defaults(result.uri, &port);
  read_numbers(section, &port);
  read_switches(section, &port);
  read_variant(section, &port);
  read_port_mount(section, context.mount_names, &port);
  if (firmware::is_head(port.driver)) {
    read_head(section, context, &port);
  }
  return result;
}

void add_port(const PortSection& port, const std::vector<std::string>& mount_names,
              EntryList* list) {
  const PortConfig& config = port.config;
  list->text("uri", hal::uri_text(port.uri));
  list->flag("optional", port.optional);
  list->text("driver", driver_name(config.driver));
  if (config.mount != firmware::kNoMount) {
    list->text("mount", mount_names[config.mount]);
  }
  if (firmware::is_head(config.driver)) {
    list->integer("min_range_mm", config.min_range_um / 1000);
    list->integer("max_range_mm", config.max_range_um / 1000);
  }
  if (contains(kProfiles, config.driver)) {
    list->text("intensity", kScaleNames[static_cast<std::size_t>(config.intensity_scale)]);
  }
  for (const NumberKey& each : kNumberKeys) {
    const std::int32_t value = config.*each.field - each.offset;
    // 0 outside of the limits, or -1: not given, the driver knows better.
    const bool given = value >= 0 || each.offset == 0;
    const bool shown = value != 0 || each.least <= 0;
    if (contains(each.drivers, config.driver) && given && shown) {
      list->scaled(each.key, value, each.scale);
    }
  }
  for (const SwitchKey& each : kSwitchKeys) {
    const bool set = each.bit == 0 ? config.profile != 0 : (config.switches & each.bit) != 0;
    if (contains(each.drivers, config.driver)) {
      list->flag(each.key, set != each.when_clear);
    }
  }
  for (const VariantKey& each : kVariantKeys) {
    if (each.driver == config.driver) {
      const std::int32_t chosen = std::max(config.variant_plus_1 - 1, 0);
      list->text(each.key, each.names[static_cast<std::size_t>(chosen)]);
    }
  }
}

}  // namespace leadline::host
