// Everything a vehicle is configured with: plain integers, made by firmware/config from vehicle.toml, or
// read back from a log. See firmware/README.md.
#pragma once

#include <cstdint>

#include "firmware/pipeline/drivers.hpp"
#include "model/base/pose.hpp"
#include "model/base/units.hpp"
#include "model/capacity.hpp"
#include "model/config.hpp"

namespace leadline::firmware {

inline constexpr std::uint16_t kVehicleConfigSchemaVersion = 2;
inline constexpr int kMaxPorts = 8;   ///< device ports, the link not counted
inline constexpr int kMaxMounts = 8;  ///< of sonar heads and sensors
/// PortConfig::mount of a sensor at the reference point, in the body's axes.
inline constexpr std::uint8_t kNoMount = 255;
/// MountConfig::table of a mount that carries no sonar head.
inline constexpr std::uint8_t kNoTable = 255;
/// Localization tables: one per kind of head.
inline constexpr std::size_t kMaxTables = model::kMaxSensors;

/// Bits of PortConfig::switches: what differs from a driver's habit. 0 is every driver's default.
enum PortSwitch : std::uint16_t {
  kPortUseVariation = 1U << 0U,     ///< apply the variation that comes with a magnetic heading
  kPortOtherNorth = 1U << 1U,       ///< heading is of the other north than the driver takes it for
  kPortGaugePressure = 1U << 2U,    ///< the air's pressure has been taken off
  kPortAcceptUnchecked = 1U << 3U,  ///< take messages without a checksum
  kPortOtherSense = 1U << 4U,       ///< a scanner turns, or a sensor counts, the other way
  kPortPressureOnly = 1U << 5U,     ///< ask for pressure alone
  kPortOtherRoll = 1U << 6U,        ///< roll counts the other way
  kPortOtherPitch = 1U << 7U,       ///< pitch counts the other way
  kPortEulerAngles = 1U << 8U,      ///< roll or pitch is the Euler angle, not the level's
  kPortOtherAxes = 1U << 9U,        ///< the sensor's axes are not those of its habit
  kPortIgnoreStatus = 1U << 10U,    ///< take what the sensor calls not valid
  kPortUsePressure = 1U << 11U,     ///< the pressure is that of the water
  kPortDeviceClock = 1U << 12U,     ///< samples count at the sensor's own clock, once that is sure
  kPortWatchStuck = 1U << 13U,      ///< of equal samples in a row the 100th and on are not fused
  kPortZeroAtSurface = 1U << 14U,   ///< the pressure of the first seconds is that of the surface
  kPortSend = 1U << 15U,            ///< tell the autopilot what is below and around
};

/// What a head's intensities are. The echo detector compares energies.
enum class IntensityScale : std::uint8_t {
  kEnergy = 0,     ///< proportional to energy
  kAmplitude = 1,  ///< proportional to amplitude: energy is the square
  kDecibel = 2,    ///< each step is intensity_step_mdb more
};

struct PortConfig {
  Driver driver;
  std::uint8_t mount;      ///< index into mounts; sensors: or kNoMount
  std::uint16_t switches;  ///< PortSwitch
  std::int32_t
      latency_us;  ///< from the measured instant to the arrival of the last byte, excess over
                   ///< what the codec itself accounts for
  /// Sonar heads: what to ask of the device.
  std::int64_t min_range_um;
  std::int64_t max_range_um;
  std::int32_t ping_interval_us;  ///< poll period; 0 = the device runs free
  std::int32_t scan_first_grad;   ///< Ping360: first and last angle, 400 gradians a turn
  std::int32_t scan_last_grad;
  std::int32_t scan_step_grad;
  std::int32_t
      profile;  ///< 1: ask for intensities and detect on the vehicle; 0: the head's own range
  std::int32_t gain_plus_1;    ///< 0: the driver's default; otherwise the head's gain setting + 1
  std::int32_t frequency_khz;  ///< 0: the driver's default
  std::int32_t address;        ///< id or bus address of the device; 0: the driver's default, or any
  std::int32_t
      variant_plus_1;  ///< which of a driver's devices, or of its ways to talk; 0: the default
  std::int32_t byte_time_ns;  ///< of one byte on the line, 0 .. 100'000'000; 0: in the latency
  IntensityScale intensity_scale;
  std::int32_t intensity_step_mdb;  ///< kDecibel: 1 .. 6000
  /// From schema version 2 on. Returns of one profile that are mapped, up to model::kMaxReturns; 0 is 1: the
  /// first.
  std::int32_t max_returns;
  /// How much the evidence of a ping goes with its quality: 0 not at all, 100 in proportion.
  std::int32_t quality_weight_percent;
};

/// Where a head or sensor sits and how it looks: body frame FRD from the reference point.
struct MountConfig {
  std::int32_t lever_arm_mm[3];
  base::Attitude boresight;  ///< rotates the mount's frame into the body's
  std::uint8_t table;        ///< localization table of the head, or kNoTable
  std::uint8_t reserved[3];
};

/// Initial and process noise of navigation, and what sensors do not state themselves. One sigma.
struct NavigationConfig {
  std::int64_t origin_latitude_e9deg;  ///< NED origin; 0,0 with has_origin 0: first fix
  std::int64_t origin_longitude_e9deg;
  std::int32_t has_origin;
  std::int32_t magnetic_variation_bam32;  ///< true = magnetic + variation
  std::int64_t surface_pressure_pa;
  std::int32_t water_density_g_m3;  ///< 1029000
  std::int32_t gravity_um_s2;       ///< 9806650
  std::int32_t sigma_fix_mm;        ///< horizontal fix
  std::int32_t sigma_depth_mm;
  std::int32_t sigma_attitude_urad;
  std::int32_t sigma_heading_urad;
  std::int32_t acceleration_mm_s2;            ///< process noise, horizontal and vertical
  std::int32_t angular_acceleration_urad_s2;  ///< process noise, attitude
  std::int32_t max_gap_us;                    ///< poses farther apart are not interpolated
  std::int32_t max_wait_us;                   ///< a ping waits this long for a pose behind it
};

inline constexpr int kMaxSoundSpeedPoints = 32;

struct SoundSpeedEntry {
  std::int32_t depth_mm;  ///< below the surface, strictly increasing
  std::int32_t speed_mm_s;
};

inline constexpr int kMaxTidePoints = 64;

struct TidePoint {
  base::TimeUs t_us;  ///< of the vehicle
  std::int32_t height_mm;
};

/// What is known of the water (sound_path.hpp, water_level.hpp).
struct WaterConfig {
  /// 1: VehicleConfig::sound_speed_mm_s is that of the water, and lengths that a head made with another
  /// speed are made anew; 0: it is a default, and a head that states a speed knows better.
  std::uint16_t speed_known;
  std::uint16_t point_count;  ///< 0: the same speed everywhere
  SoundSpeedEntry points[kMaxSoundSpeedPoints];
  std::uint16_t tide_count;  ///< 0: the zero of depth is the surface
  TidePoint tide[kMaxTidePoints];
};

struct LinkConfig {
  std::uint32_t rate_bytes_s;  ///< budget, framing included
  std::uint16_t mtu_bytes;     ///< largest frame on the wire, 128 .. 1400
  std::uint16_t reserved;
  std::uint32_t status_interval_us;  ///< shortest; longer where the link is slow
  std::uint32_t hello_interval_us;   ///< longest; shorter while the vehicle is new
  /// A changed tile waits this long for more changes, so that a packet has cells enough for its headers;
  /// 0 = not at all.
  std::uint32_t max_tile_age_us;
  /// Where tiles of which the topside knows nothing would have to wait longer than this for the link, coarse ones
  /// go before them; 0 = never.
  std::uint32_t coarse_wait_us;
};

/// Bytes of UTF-8, zeros behind them.
inline constexpr std::size_t kMaxConfigText_bytes = 64;

struct VehicleConfig {
  std::uint16_t schema_version;  ///< kVehicleConfigSchemaVersion
  std::uint16_t port_count;
  std::uint16_t mount_count;
  std::uint16_t table_count;
  std::uint64_t survey_id;
  model::ModelConfig model;
  std::int32_t epsg;  ///< 0 = none; informative, for the topside
  std::int32_t sound_speed_mm_s;
  /// Voxels written per cycle; 0 = none but what the queue of pings holds (Vehicle::cycle_bound_voxels).
  std::uint32_t cycle_voxel_budget;
  std::uint32_t cycle_tile_budget;  ///< tiles extracted per cycle, or their columns' worth
  PortConfig ports[kMaxPorts];
  MountConfig mounts[kMaxMounts];
  NavigationConfig navigation;
  WaterConfig water;
  LinkConfig link;
  /// Differs whenever the vehicle starts over with an empty map: the program takes it from the clock of the
  /// day or a counter. Part of every frame's tag, and of the log.
  std::uint32_t session;
  /// From schema version 2 on, as is model.resident_tiles. 1: a store holds the map's pages (tile_pager.hpp),
  /// and answers on kStorePort.
  std::uint16_t has_store;
  /// From schema version 2 on, and in a blob only where it is not 0: passes of extraction begin this far apart
  /// (extraction_pass.hpp); 0: no passes, the dirtiest tiles each cycle.
  std::uint32_t extract_interval_us;
  char survey_name[kMaxConfigText_bytes];
  char vertical_datum[kMaxConfigText_bytes];  ///< what depth 0 means; informative
};

}  // namespace leadline::firmware
