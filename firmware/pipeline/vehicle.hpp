// The whole vehicle between its ports: device bytes in, link frames out. See firmware/README.md.
//
// A Vehicle is a large static object (model/capacity.hpp): define it at namespace scope, never on a stack.
// It allocates nothing, reads no clock, does no I/O; what it does depends on the configuration, the tables
// and the sequence of its inputs alone. Not thread-safe: one owner.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "model/base/pose.hpp"
#include "model/base/status.hpp"
#include "model/base/units.hpp"
#include "model/model.hpp"

namespace leadline::firmware {

/// Port number of the link's uplink in InputChunk::port; device ports are 0 .. port_count - 1.
inline constexpr std::uint8_t kUplinkPort = 255;

/// Most bytes that one cycle takes from all its chunks together; what is beyond is dropped and counted.
/// Whoever reads the ports offers no more.
inline constexpr std::size_t kMaxCycleBytes = 65536;
/// Most bytes of frames that one cycle makes.
inline constexpr std::size_t kDownlinkCapacity_bytes = 16384;
/// Most bytes that a device is owed in one cycle.
inline constexpr std::size_t kRequestCapacity_bytes = 256;

/// Bytes of one port that arrived together.
struct InputChunk {
  base::TimeUs t_arrival_us;  ///< of the last byte
  const std::uint8_t* data;
  std::uint16_t size_bytes;
  std::uint8_t port;
};

struct CycleInput {
  base::TimeUs t_us;
  const InputChunk* chunks;
  std::size_t chunk_count;
  /// Bytes that the link can take now (queue room of the transmitter); the configured rate holds
  /// besides.
  std::uint32_t downlink_room_bytes;
};

/// Spans into the vehicle, valid until the next cycle.
struct OutputSpan {
  const std::uint8_t* data;
  std::size_t size_bytes;
};

struct CycleOutput {
  OutputSpan downlink;                    ///< whole frames, back to back
  OutputSpan device_requests[kMaxPorts];  ///< bytes that each device is owed; size 0: none
};

/// One localization table as read from disk: exactly the block.
struct TableBlock {
  const void* bytes;
  std::size_t size_bytes;
};

/// Bits of VehicleCounters::alarms and of the status message: what is wrong now.
enum Alarm : std::uint32_t {
  kAlarmMappingPaused = 1U << 0U,   ///< pings arrive, none of the last second's was mapped
  kAlarmNoPose = 1U << 1U,          ///< no pose within max_gap_us
  kAlarmShedding = 1U << 2U,        ///< the ping queue overflowed within the last second
  kAlarmNavigationJump = 1U << 3U,  ///< the epoch changed within the last 10 s
  kAlarmLinkBehind = 1U << 4U,      ///< tiles wait for the link longer than 10 s
  kAlarmClock = 1U << 5U,           ///< the time of a cycle or chunk broke its contract, last 10 s
};

/// Why a ping that a codec delivered did not reach the model.
enum class PingLoss : std::uint8_t {
  kShed = 0,          ///< the queue was full: the oldest gave way
  kNoPoseBefore = 1,  ///< older than the pose history
  kPoseGap = 2,       ///< poses on its two sides are too far apart
  kPoseEpoch = 3,     ///< navigation jumped during the ping
  kPoseLate = 4,      ///< no pose came within max_wait_us
  kPoseInvalid = 5,   ///< a validity bit is missing
  kTooLong = 6,       ///< more profile bins than there is room for
  kNoEcho = 7,  ///< profile without a detectable echo: goes to the model as no return, not lost
  kCount = 8,
};
[[nodiscard]] const char* ping_loss_name(PingLoss loss);

/// Of one device port. Never decremented.
struct PortTally {
  std::uint64_t bytes;     ///< given to the codec
  std::uint64_t records;   ///< pings or samples that came out
  std::uint64_t rejected;  ///< frames that the codec dropped, for any reason
};

/// What the vehicle has seen since configure(). Never decremented but where stated.
struct VehicleCounters {
  std::uint64_t cycles;
  std::uint64_t chunks_ignored;      ///< unknown port, or no data
  std::uint64_t bytes_over_limit;    ///< beyond kMaxCycleBytes
  std::uint64_t cycle_time_clamped;  ///< t_us of a cycle went back
  std::uint64_t chunk_time_clamped;  ///< arrival before the cycle before, or behind its own cycle
  std::uint64_t pings_in;            ///< records of sonar codecs
  std::uint64_t pings_mapped;        ///< handed to the model (its counters say what became of them)
  std::uint64_t pings_lost[static_cast<int>(PingLoss::kCount)];
  std::uint64_t nav_samples;
  std::uint64_t tiles_extracted;
  std::uint64_t tile_deltas;     ///< delta frames queued
  std::uint64_t cells_sent;      ///< cells in them
  std::uint64_t downlink_bytes;  ///< all frames, framing included
  std::uint64_t downlink_frames;
  std::uint64_t delta_bytes;  ///< frames of tile deltas, framing included
  std::uint64_t uplink_frames;
  std::uint64_t uplink_rejected;  ///< unknown or malformed messages, bad frames
  std::uint64_t resend_requests;
  PortTally ports[kMaxPorts];
  // Levels, not counts: as of the last cycle.
  std::uint32_t pings_pending;
  std::uint32_t tiles_stale;   ///< to be extracted
  std::uint32_t tiles_unsent;  ///< extracted, with cells that the link does not have
  std::uint32_t alarms;        ///< Alarm bits
};

// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): configure() writes everything that is read.
class Vehicle {
 public:
  Vehicle() = default;
  Vehicle(const Vehicle&) = delete;
  Vehicle& operator=(const Vehicle&) = delete;

  /// Checks and adopts a configuration and its tables (all copied); forgets everything before. O(grid).
  /// * kBadVersion: schema of the configuration or of a table
  /// * kOutOfRange: a count, driver, mount index, rate or limit outside its range
  /// * kInvalidArgument: table_count is not config.table_count, or a mount asks for a table other than 0
  ///   (one table per model for now)
  /// * whatever Model::configure says otherwise
  /// The vehicle does nothing until this has returned kOk.
  [[nodiscard]] base::Status configure(const VehicleConfig& config, const TableBlock* tables,
                                       std::size_t table_count);

  /// One cycle, see firmware/README.md. Never fails: what cannot be used is counted. `output` is always
  /// set; its spans stay valid until the next call. Work: kMaxCycleBytes through the codecs, the voxel
  /// budget (or one ping where that is larger), the tile budget, the downlink buffer.
  void cycle(const CycleInput& input, CycleOutput& output);

  [[nodiscard]] const VehicleConfig& config() const { return config_; }
  [[nodiscard]] const VehicleCounters& counters() const { return counters_; }
  [[nodiscard]] const model::Model& model() const { return model_; }
  /// For the host: full extraction after a replay. What the vehicle does next stays the same.
  [[nodiscard]] model::Model& model() { return model_; }

  /// 64-bit FNV-1a over all voxels (Grid::map_hash): O(grid).
  [[nodiscard]] std::uint64_t map_hash() const { return model_.grid().map_hash(); }
  /// 64-bit FNV-1a over every downlink byte since configure(). O(1).
  [[nodiscard]] std::uint64_t link_hash() const { return link_hash_; }
  /// Nothing left to do without new input: no ping pending, no tile stale or unsent. Cycles without
  /// input lead here.
  [[nodiscard]] bool drained() const;
  /// Newest pose of the reference point; validity 0 when there is none.
  [[nodiscard]] const base::Pose& latest_pose() const { return latest_pose_; }

 private:
  VehicleConfig config_{};
  VehicleCounters counters_{};
  model::Model model_;
  base::Pose latest_pose_{};
  std::uint64_t link_hash_ = 0;
};

}  // namespace leadline::firmware
