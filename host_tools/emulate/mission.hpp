// What is emulated: a seafloor, a vehicle that moves over it, the devices that it carries and what is
// wrong with them. One Mission makes the flight and the vehicle.toml that fits it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "host_tools/emulate/trajectory.hpp"
#include "host_tools/raster.hpp"
#include "host_tools/settings.hpp"
#include "host_tools/sim/echo.hpp"
#include "host_tools/sim/scenario.hpp"
#include "host_tools/sim/vec3.hpp"

namespace leadline::host {

enum class HeadKind : std::uint8_t { kPing1d, kPing360 };

/// A sonar head and where it sits. Its own frame (FRD): a Ping1D looks along its down axis; a Ping360
/// turns its beam from forward to right.
struct HeadSpec {
  std::string name;  ///< of its port and mount: letters, digits, underscore
  HeadKind kind = HeadKind::kPing1d;
  Vec3 lever_arm_m;    ///< from the vehicle's reference point, body frame
  Attitude boresight;  ///< turns the head's frame into the body's
  double beam_half_angle_deg = 12.5;
  double across_half_angle_deg = 0.0;  ///< see EchoSpec
  double min_range_m = 1.5;            ///< the head listens from here on
  double max_range_m = 20.0;
  double interval_s = 0.04;  ///< between pings
};

/// Errors of the sonar heads. Sigmas are one standard deviation.
struct HeadErrors {
  double sigma_range_m = 0.04;
  double outlier_fraction = 0.002;  ///< echoes of something between the head and the ground
  double dropout_fraction = 0.02;   ///< echoes that are not heard
  /// Pings with a fish before the ground that lets the sound through: an echo of a tenth to all of the ground's
  /// energy, uniformly; the ground is heard behind it. A head that detects by itself reports the fish
  /// from half of that energy on.
  double fish_fraction = 0.0;
  double misalignment_deg = 0.15;  ///< of every head about two axes, constant over the survey
};

/// Rates and errors of the navigation sensors.
struct NavigationSpec {
  double attitude_rate_hz = 25.0;
  double fix_rate_hz = 5.0;
  double pressure_rate_hz = 10.0;
  double sigma_attitude_deg = 0.15;
  double sigma_heading_deg = 0.4;
  double heading_drift_deg = 0.3;  ///< slow error, long-run sigma
  double sigma_fix_m = 0.12;
  double fix_drift_m = 0.06;    ///< slow error per axis, long-run sigma
  double drift_time_s = 120.0;  ///< correlation time of both
  double sigma_pressure_pa = 120.0;
  double latitude_deg = 54.18;  ///< of NED's zero
  double longitude_deg = 7.89;
};

/// What happens to the bytes on their way from a device to the vehicle: a chance per byte, from 0.
struct WireFaults {
  double lost_byte = 0.0;
  double flipped_bit = 0.0;
  double repeated_byte = 0.0;
};

struct Mission {
  std::uint64_t seed = 1;
  Scenario ground;  ///< only what describes the terrain counts; cells are those of the map's grid
  /// The ground goes on this far beyond the grid on every side: the vehicle turns there, and beams at
  /// the grid's edge meet ground and not the end of the world.
  std::size_t margin_cells = 24;
  std::size_t down_margin_cells = 4;  ///< of the grid above and below the terrain
  MotionPlan motion;                  ///< its rectangle is set by resolve_mission()
  std::vector<HeadSpec> heads;
  HeadErrors errors;
  NavigationSpec navigation;
  WireFaults faults;
  double sound_speed_m_s = 1500.0;         ///< of the water: the devices believe in their own 1500
  bool profile = false;                    ///< heads send whole echoes, the vehicle detects
  std::size_t max_returns = 1;             ///< of a profile that the vehicle maps; 1 .. 3
  std::size_t quality_weight_percent = 0;  ///< 0 .. 100
  /// The navigation sensors share one line, sentence by sentence, as behind a combiner: a vehicle with few
  /// lines. Their latencies are then those of the attitude.
  bool one_nmea_line = false;
  double start_s = 3.0;    ///< the devices run this long before the vehicle sets out
  double settle_s = 12.0;  ///< after the survey the heads are off and the link catches up
  /// Slower than the map changes: changes wait, and go out many to a packet.
  std::uint32_t link_rate_bytes_s = 200;
  double link_max_tile_age_s = 1.5;
  double link_coarse_wait_s = 5.0;
  /// Depths in passes so far apart, as a Cortex-M7 needs them (firmware/README.md, "Timing"); 0: in every cycle.
  double extract_interval_s = 0.0;
};

/// What `emulate` and `simulate` take alike.
struct MissionOptions {
  /// "" or "procedural": the invented seafloor; "plane"; else a raster that GDAL reads.
  std::string terrain;
  std::uint64_t seed = 1;
  /// "key=value" each, keys as in mission_settings().
  std::vector<std::string> settings;
};

/// The demo's mission: a BlueROV-class vehicle five metres over 32 x 32 m in cells of 0.25 m, with three
/// Ping1D heads: down, tilted to port and to starboard.
[[nodiscard]] Mission default_mission();

/// Every parameter that may be set.
[[nodiscard]] const std::vector<SettingInfo>& mission_settings();

/// The default with terrain, seed and settings applied, checked. Throws HostError kUsage.
[[nodiscard]] Mission resolve_mission(const MissionOptions& options);

/// The ground with its margin; cell (0, 0) of the grid has its lowest corner at NED (0, 0). Throws
/// HostError (kUsage for parameters, kInput for the raster).
[[nodiscard]] Terrain build_ground(const Mission& mission);

/// The grid's part of the ground as elevations (metres up), and of a mask over the ground.
[[nodiscard]] Raster truth_raster(const Mission& mission, const Terrain& ground);
[[nodiscard]] Raster touched_raster(const Mission& mission, const Terrain& ground,
                                    const TouchedMask& touched);

}  // namespace leadline::host
