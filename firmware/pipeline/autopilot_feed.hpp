// What pings tell an autopilot in MAVLink (hal/attitude/mavlink_out.hpp), at ports of the mavlink driver that
// have kPortSend: the distance below, obstacles around, and that we are there.
//
// | message | from | when |
// |---|---|---|
// | HEARTBEAT | - | every second |
// | DISTANCE_SENSOR, downwards | the newest transmission with an echo within 15 degrees of the body's down axis, of a fan the beam nearest to it: how far down that axis the echo lies below the reference point | with each such transmission, every 100 ms at most |
// | OBSTACLE_DISTANCE | beams within 15 degrees of the body's level plane: level distance of the echo from the reference point, the nearest in each 5 degrees | every 200 ms while anything is known |
//
// A direction is looked at anew whenever a beam comes back to it, and forgotten after a minute; a look that
// brought no echo says "not known". Body axes only: no pose is needed, and none is used. Ranges are the
// head's own (sound_path.hpp comes later).
//
// Bytes depend on pings and cycle times alone, so a replay makes the same. No heap, no clock. About 1.2 KiB.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "hal/attitude/mavlink_out.hpp"
#include "model/base/angle.hpp"
#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::firmware {

class AutopilotFeed {
 public:
  /// Forgets everything; the configuration has been checked.
  void configure(const VehicleConfig& config);
  /// A ping with its echo found or not; its mount exists. O(1).
  void take(const base::Ping& ping);
  /// Writes the frames that `port` is owed at `now_us` to `out`; returns their bytes. What finds no room
  /// waits. 256 bytes hold everything. O(bytes).
  [[nodiscard]] std::size_t send(std::size_t port, base::TimeUs now_us, std::uint8_t* out,
                                 std::size_t capacity_bytes);
  /// Frames written since configure(), all ports.
  [[nodiscard]] std::uint64_t frames() const { return frames_; }

 private:
  static constexpr std::size_t kDirections = hal::MavlinkObstacles::kDirections;

  struct Mount {
    base::Rotation turned;  ///< mount's axes in the body's
    base::Vector3 lever_um;
  };
  struct Below {
    base::TimeUs t_transmit_us;
    std::int32_t cosine_q30;  ///< of the beam from the down axis
    std::uint16_t distance_cm;
    std::uint8_t quality_percent;
    std::uint32_t count;  ///< transmissions
  };
  struct Direction {
    base::TimeUs t_transmit_us;
    std::uint16_t distance_cm;
    bool seen;
  };
  struct Line {
    bool sends;
    bool begun;
    hal::MavlinkSender sender;
    base::TimeUs heartbeat_due_us;
    base::TimeUs distance_due_us;
    base::TimeUs obstacles_due_us;
    std::uint32_t below_sent;  ///< Below::count of the newest that went out
  };

  void take_below(const base::Ping& ping, const base::Vector3& beam_q30, std::int64_t down_um);
  void take_around(const base::Ping& ping, const base::Vector3& beam_q30,
                   const base::Vector3& echo_um);
  [[nodiscard]] std::size_t send_heartbeat(Line& line, base::TimeUs now_us, std::uint8_t* out,
                                           std::size_t capacity_bytes);
  [[nodiscard]] std::size_t send_distance(Line& line, base::TimeUs now_us, std::uint8_t* out,
                                          std::size_t capacity_bytes);
  [[nodiscard]] std::size_t send_obstacles(Line& line, base::TimeUs now_us, std::uint8_t* out,
                                           std::size_t capacity_bytes);

  std::array<Mount, kMaxMounts> mounts_{};
  std::array<Line, kMaxPorts> lines_{};
  Below below_{};
  std::array<Direction, kDirections> around_{};
  std::size_t looking_at_ = kDirections;  ///< direction of the newest beam around
  std::uint16_t min_cm_ = 0;
  std::uint16_t max_cm_ = 0;
  std::uint64_t frames_ = 0;
};

}  // namespace leadline::firmware
