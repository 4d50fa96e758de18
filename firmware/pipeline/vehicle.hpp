// The whole vehicle between its ports: device bytes in, link frames out. See firmware/README.md.
//
// A Vehicle is a large static object (model/capacity.hpp): define it at namespace scope, never on a stack.
// It allocates nothing, reads no clock, does no I/O; what it does depends on the configuration, the tables
// and the sequence of its inputs alone. Not thread-safe: one owner.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/clock_sync.hpp"
#include "estimator/navigator.hpp"
#include "estimator/stuck_watch.hpp"
#include "estimator/utc_clock.hpp"
#include "firmware/pipeline/autopilot_feed.hpp"
#include "firmware/pipeline/coarse_first.hpp"
#include "firmware/pipeline/command_event.hpp"
#include "firmware/pipeline/config.hpp"
#include "firmware/pipeline/device_port.hpp"
#include "firmware/pipeline/downlink.hpp"
#include "firmware/pipeline/extraction_pass.hpp"
#include "firmware/pipeline/host_report.hpp"
#include "firmware/pipeline/link_ledger.hpp"
#include "firmware/pipeline/link_map.hpp"
#include "firmware/pipeline/ping_queue.hpp"
#include "firmware/pipeline/sound_path.hpp"
#include "firmware/pipeline/surface_reference.hpp"
#include "firmware/pipeline/tile_pager.hpp"
#include "firmware/pipeline/tile_set.hpp"
#include "model/base/pose.hpp"
#include "model/base/status.hpp"
#include "model/base/units.hpp"
#include "model/echo_detector.hpp"
#include "model/model.hpp"
#include "proto/cell.hpp"
#include "proto/commands.hpp"
#include "proto/framing.hpp"
#include "proto/messages.hpp"
#include "proto/tile_coder.hpp"

namespace leadline::firmware {

/// Port number of the link's uplink in InputChunk::port; device ports are 0 .. port_count - 1.
inline constexpr std::uint8_t kUplinkPort = 255;

/// Port number of the store's answers (tile_pager.hpp).
inline constexpr std::uint8_t kStorePort = 253;

/// Most bytes that one cycle takes from all its chunks together; what is beyond is dropped and counted.
/// Whoever reads the ports offers no more.
inline constexpr std::size_t kMaxCycleBytes = 65536;
/// Most bytes that a device is owed in one cycle.
inline constexpr std::size_t kRequestCapacity_bytes = 256;

/// Bytes of one port that arrived together.
struct InputChunk {
  base::TimeUs t_arrival_us;  ///< of the last byte
  const std::uint8_t* data;
  std::uint16_t size_bytes;
  std::uint8_t port;
};

/// Cycles run once a period; one more where something came up the link meanwhile or CycleOutput::wish_us says so, so
/// that what was lost goes again soon: this long after the cycle before at the earliest.
constexpr base::TimeUs least_cycle_us(base::TimeUs period_us) { return period_us / 8; }

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

/// No member has an initializer: the Cortex-M7 keeps one in memory that starts as zeros.
struct CycleOutput {
  OutputSpan downlink;                    ///< whole frames, back to back
  OutputSpan device_requests[kMaxPorts];  ///< bytes that each device is owed; size 0: none
  StoreOutput store;                      ///< pages to be saved and loaded
  base::TimeUs wish_us;  ///< so long after this one the link would like a cycle; 0: it can wait
};

/// One localization table as read from disk: exactly the block.
struct TableBlock {
  const void* bytes;
  std::size_t size_bytes;
};

/// A ping waits no longer for its turn, beyond what it may wait for its pose.
inline constexpr base::TimeUs kLongestQueue_us = 2'000'000;

/// Why a ping that a codec delivered did not reach the model.
enum class PingLoss : std::uint8_t {
  kShed =
      0,  ///< the oldest of a full queue, or it waited for longer than max_wait_us and kLongestQueue_us
  kNoPose = 1,     ///< no pose came within max_wait_us, or the ping is older than all poses
  kPoseGap = 2,    ///< poses on its two sides are too far apart
  kPoseEpoch = 3,  ///< navigation jumped during the ping
  kPaused = 4,     ///< position less certain than any footprint is wide (kPauseSigma)
  kBad = 5,        ///< fields out of range
  kNoPath = 6,     ///< the water lets no such beam come back (sound_path.hpp)
  kAbsentTile =
      7,  ///< voxels that it needs did not come into memory in time (within a second), or never can together
  kStopped = 8,  ///< the survey was stopped by a command
  kCount = 9,
};
/// Short name for statistics (`shed`, ...).
[[nodiscard]] const char* ping_loss_name(PingLoss loss);

/// Of one device port. Never decremented.
struct PortTally {
  std::uint64_t bytes;     ///< given to the codec
  std::uint64_t records;   ///< pings or samples that came out
  std::uint64_t rejected;  ///< frames that the codec dropped, for any reason
};

/// What the vehicle has seen since configure(). Never decremented but where stated. Every ping that came in
/// is pending, lost or mapped: pings_in = pings_pending + sum(pings_lost) + pings_mapped.
struct VehicleCounters {
  std::uint64_t cycles;
  std::uint64_t chunks_ignored;      ///< unknown port, or no data
  std::uint64_t bytes_over_limit;    ///< beyond kMaxCycleBytes
  std::uint64_t cycle_time_clamped;  ///< t_us of a cycle went back
  std::uint64_t chunk_time_clamped;  ///< arrival before the cycle before, or behind its own cycle
  std::uint64_t pings_in;            ///< records of sonar codecs
  std::uint64_t pings_mapped;  ///< handed to the model, whose counters say what became of them
  std::uint64_t pings_lost[static_cast<int>(PingLoss::kCount)];
  std::uint64_t cycles_held;   ///< in which a ping waited for voxels
  std::uint64_t returns_lost;  ///< later returns of mapped pings whose voxels did not come in time
  std::uint64_t profiles_detected;    ///< profiles with an echo
  std::uint64_t profiles_undetected;  ///< without: mapped as no return
  std::uint64_t pings_synced;         ///< transmitted at a line's edge (role "ping_sync")
  std::uint64_t line_records;         ///< edges and levels of single lines
  std::uint64_t nav_samples;
  std::uint64_t
      nav_zeroing;          ///< of these, pressures of the surface (kPortZeroAtSurface): not fused
  std::uint64_t nav_stuck;  ///< of these, not fused: as a hundred before them (kPortWatchStuck)
  std::uint64_t autopilot_frames;  ///< of autopilot_feed.hpp, in device_requests
  std::uint64_t tiles_extracted;
  std::uint64_t tile_deltas;    ///< frames of tile deltas
  std::uint64_t delta_bytes;    ///< in them, framing included
  std::uint64_t coarse_deltas;  ///< frames of coarse tiles, before tiles that had to wait
  std::uint64_t cells_sent;     ///< cells in them, those of resends included
  std::uint64_t cells_changed;  ///< of these, cells whose coded value had changed
  std::uint64_t cell_wait_ms;   ///< sum over cells_changed: how long the cell's tile had waited
  std::uint64_t downlink_frames;
  std::uint64_t downlink_bytes;  ///< all frames, framing included
  std::uint64_t uplink_frames;
  std::uint64_t uplink_rejected;  ///< bad frames, malformed or unknown messages, another survey's
  std::uint64_t uplink_foreign;   ///< of these, hello requests of another major
  std::uint64_t resend_requests;
  std::uint64_t reports;     ///< of the topside
  std::uint64_t tiles_lost;  ///< tiles in frames that were taken for lost: their cells went again
  std::uint64_t commands_done;     ///< authenticated, and carried out
  std::uint64_t commands_refused;  ///< authenticated, and answered with why not
  std::uint64_t commands_dropped;  ///< not authenticated, for any reason, or no key is there
  PortTally ports[kMaxPorts];
  // Levels, not counts: as of the last cycle.
  std::uint32_t pings_pending;
  std::uint32_t tiles_stale;       ///< to be extracted
  std::uint32_t tiles_unsent;      ///< extracted, with cells that the link does not have
  std::uint32_t work_last_voxels;  ///< written in the last cycle
  std::uint32_t work_max_voxels;   ///< most in any cycle
  std::uint32_t alarms;            ///< proto::Alarm bits
};

/// A ping as it went to the model, and the pose that its transducer had.
struct MappedPing {
  base::Ping ping;  ///< no profile: its echo was detected
  base::Pose pose;
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
  /// * kInvalidArgument: table_count is not config.table_count, or a mount asks for a table beyond it
  /// * kFull: the ports' codecs need more than kCodecArena_bytes
  /// * whatever Model::configure says otherwise
  /// The vehicle does nothing until this has returned kOk.
  [[nodiscard]] base::Status configure(const VehicleConfig& config, const TableBlock* tables,
                                       std::size_t table_count);

  /// One cycle, see firmware/README.md. Never fails: what cannot be used is counted. `output` is always
  /// set; its spans stay valid until the next call. Work: kMaxCycleBytes through the codecs, the voxel
  /// budget (or one ping where that is larger), the tile budget, the downlink buffer.
  void cycle(const CycleInput& input, CycleOutput& output);

  /// The link starts over: nothing is under way, nobody has reported, and every tile that a ping ever touched
  /// is owed whole. O(tiles).
  void restart_link();

  [[nodiscard]] const VehicleConfig& config() const { return config_; }
  [[nodiscard]] const VehicleCounters& counters() const { return counters_; }
  /// The clock of a port's device, 0 <= port < kMaxPorts; knows nothing without kPortDeviceClock.
  [[nodiscard]] const estimator::ClockSync& clock(int port) const { return clocks_[port]; }
  /// UTC, where a port of role "pps" and messages with a date are there.
  [[nodiscard]] const estimator::UtcClock& utc_clock() const { return utc_clock_; }
  /// Of a port with kPortZeroAtSurface, 0 <= port < kMaxPorts.
  [[nodiscard]] const SurfaceReference& surface(int port) const { return surface_[port]; }
  [[nodiscard]] const model::Model& model() const { return model_; }
  /// No cycle writes more voxels: the budget, or one ping's bound where that is larger; without a budget the
  /// bound of as many pings as the queue holds. Saturates. O(1).
  [[nodiscard]] std::uint32_t cycle_bound_voxels() const;
  /// For the host: full extraction after a replay. What the vehicle maps next stays the same.
  [[nodiscard]] model::Model& model() { return model_; }

  /// 64-bit FNV-1a over all voxels (Grid::map_hash): O(grid).
  [[nodiscard]] std::uint64_t map_hash() const { return model_.grid().map_hash(); }
  /// 64-bit FNV-1a over every downlink byte since configure(). O(1).
  [[nodiscard]] std::uint64_t link_hash() const { return downlink_.hash(); }
  /// Hash of the map as the link has it (proto/cell.hpp "cells_hash"): what a receiver that missed nothing
  /// computes from its own tiles. O(grid).
  [[nodiscard]] std::uint64_t cells_hash() const { return link_map_.hash(); }
  /// The 256 cells of a tile as last queued for the link.
  [[nodiscard]] const proto::CodedCell* link_cells(model::TileId tile) const {
    return link_map_.cells(tile);
  }
  /// Nothing left to do without new input: no ping pending, no tile stale or unsent, and nothing that a
  /// topside which reports has not confirmed. Cycles without input lead here.
  [[nodiscard]] bool drained() const {
    return pending_.empty() && stale_.size() == 0 && pass_.size() == 0 && unsent_.size() == 0 &&
           !(ledger_.heard() && ledger_.under_way_frames() > 0);
  }
  [[nodiscard]] const LinkLedger& ledger() const { return ledger_; }
  /// Everything is in the store, as far as there is one. O(tiles).
  [[nodiscard]] bool stored() const {
    return !model_.grid().windowed() || pager_.settled(model_.grid());
  }
  [[nodiscard]] const TilePager& pager() const { return pager_; }
  /// Pings that the last cycle mapped, oldest first; of more than kMappedKept_count the first. For the
  /// host, which writes soundings beside a map.
  static constexpr std::size_t kMappedKept_count = 32;
  [[nodiscard]] const MappedPing* mapped() const { return mapped_.data(); }
  [[nodiscard]] std::size_t mapped_count() const { return mapped_count_; }
  /// Newest pose of the reference point; validity 0 when there is none.
  [[nodiscard]] const base::Pose& latest_pose() const { return navigator_.latest(); }
  [[nodiscard]] const estimator::Navigator& navigator() const { return navigator_; }

 private:
  /// Alarms and their times, for the status message.
  struct Watch {
    base::TimeUs last_record_us[kMaxPorts];
    base::TimeUs status_due_us;
    base::TimeUs hello_due_us;
    base::TimeUs hello_through_us;  ///< when the last one has left a line of the configured rate
    base::TimeUs hello_gap_us;      ///< between the last two and, at least, the next
    base::TimeUs outside_us;        ///< last time outside the grid
    std::uint32_t statuses;         ///< sent
    std::uint64_t shed_at_status;
    std::uint64_t clamped_at_status;
    std::uint64_t over_limit_at_status;
    std::uint16_t epoch_at_status;
    bool outside_said;
    bool origin_said;  ///< a hello has told where NED has its zero
    bool paused;       ///< the last ping was refused for want of a good pose
    base::TimeUs digest_due_us;
    base::TimeUs digest_sent_us;
    base::TimeUs digest_gap_us;
    base::TimeUs foreign_until_us;  ///< a topside of another major is spoken of until then
  };
  /// What a status says of the newest transmission, worked out when it says it.
  struct MappedBeam {
    base::Attitude attitude;  ///< of the head
    base::Bam32 azimuth_bam32;
    base::Bam32 elevation_bam32;
    std::int64_t range_um;
  };
  struct MappedBeams {
    base::TimeUs t_transmit_us;
    int count;  ///< 0: none yet, 2: more than the first
    MappedBeam first;
    MappedBeam last;
  };
  /// Where the topside looks.
  struct LookedAt {
    std::int32_t row;  ///< of tiles, in the middle
    std::int32_t column;
    std::int32_t radius_tiles;  ///< 0: nowhere
    base::TimeUs until_us;
  };

  /// What commands have brought about, and what is owed to who gave them.
  struct Commands {
    proto::CommandAnswer answer;  ///< to the last one; counter 0: there was none
    proto::SlicePart slice;       ///< rows that are still to be sent; row_count 0: none
    base::TimeUs slice_due_us;
    base::TimeUs refusal_due_us;              ///< no text before
    const char* refusal_text;                 ///< null: none is owed
    std::uint32_t refused[kCommandRefusals];  ///< as told last
    bool keyed;                               ///< somebody authenticates commands
    bool answer_due;
    bool stopped;  ///< nothing is mapped
  };

  [[nodiscard]] static base::Status check(const VehicleConfig& config, std::size_t table_count);
  void configure_ports();
  [[nodiscard]] estimator::NavigatorConfig navigator_config() const;
  void begin_cycle(base::TimeUs t_us);
  void take_chunks(const CycleInput& input);
  [[nodiscard]] bool is_line(std::uint8_t port) const;
  void take_host_report(const InputChunk& chunk);
  void restart_line(int port);
  void take_chunk(const InputChunk& chunk, std::size_t size_bytes);
  void take_device_bytes(std::uint8_t port, const std::uint8_t* data, std::size_t size_bytes,
                         base::TimeUs t_us);
  void take_ping(std::uint8_t port, base::Ping& ping);
  void take_line(std::uint8_t port, const base::NavSample& sample);
  void take_utc(std::uint8_t port, const base::NavSample& sample);
  [[nodiscard]] bool has_role(std::size_t port, hal::LineRole role) const;
  [[nodiscard]] bool has_device_clock(std::uint8_t port, base::TimeUs t_device_us) const;
  [[nodiscard]] base::TimeUs by_utc(std::uint8_t port, base::TimeUs t_device_us,
                                    base::TimeUs own_us) const;
  void take_sample(std::uint8_t port, base::NavSample& sample);
  void take_uplink(const InputChunk& chunk, std::size_t size_bytes);
  [[nodiscard]] std::uint32_t uplink_errors();
  void take_message(const proto::FrameView& frame, base::TimeUs came_us);
  void resend(const proto::ResendRequest& request);
  void owe(model::TileId tile);
  void take_report(const proto::Report& report, base::TimeUs came_us);
  void take_came(std::uint16_t number16, base::TimeUs came_us);
  void take_look(const proto::Look& look);
  void take_command_event(const InputChunk& chunk, bool& carried_out);
  void note_unkeyed_command();
  [[nodiscard]] proto::CommandResult carry_out(const CommandEvent& event);
  [[nodiscard]] proto::CommandResult start_survey(const proto::HelloText& name);
  [[nodiscard]] proto::CommandResult move_origin(const proto::Command& command);
  [[nodiscard]] proto::CommandResult begin_map(const std::int64_t (&origin_mm)[3]);
  [[nodiscard]] proto::CommandResult set_parameter(proto::CommandParameter parameter,
                                                   std::int32_t value);
  [[nodiscard]] proto::CommandResult set_min_range(std::int64_t min_range_um);
  [[nodiscard]] proto::CommandResult owe_tiles(const proto::TileRange& tiles);
  [[nodiscard]] proto::CommandResult begin_slice(std::uint64_t counter, const proto::SliceBox& box);
  void send_command_answer();
  void send_refusal_text();
  void send_slice();
  void reset_map_state();
  void lose_pending(PingLoss loss);
  void drop_front(PingLoss loss);
  void pop_front();
  void map_pings();
  [[nodiscard]] bool hold_ping();
  void page_tiles(StoreOutput& output);
  void make_ready();
  void find_echo();
  /// False: voxels that it needs are not in memory.
  [[nodiscard]] bool map_ready(const base::Pose& head, std::uint32_t& written);
  void sync_ready();
  [[nodiscard]] bool pose_for(const base::Ping& ping, base::Pose& pose, PingLoss& loss,
                              bool& wait) const;
  [[nodiscard]] bool straightened(const base::Pose& head, PingLoss& loss);
  [[nodiscard]] std::size_t port_of_head(std::uint16_t mount) const;
  [[nodiscard]] bool certain_enough(const base::Pose& pose) const;
  void lose(PingLoss loss);
  void keep_mapped(const base::Pose& pose);
  void note_beam(const base::Pose& head);
  [[nodiscard]] proto::Swath swath_now() const;
  void note_touched_tiles();
  void extract_tiles();
  void extract_in_passes();
  [[nodiscard]] std::uint64_t extract_budget_columns() const;
  void compare_tile(model::TileId tile);
  void send_hello();
  void answer_hello_request();
  [[nodiscard]] bool put(const base::Result<std::size_t>& payload_bytes);
  [[nodiscard]] bool put_frame(std::size_t payload_bytes, std::size_t tile_count);
  void settle_lost_frames();
  void owe_lost(const FrameTile& lost);
  [[nodiscard]] base::TimeUs line_time_us(std::size_t bytes) const;
  [[nodiscard]] base::TimeUs first_patience_us() const;
  void send_digest();
  void fill_digest(const proto::TileRange& range, proto::Digest& digest) const;
  [[nodiscard]] std::size_t frame_limit_bytes() const;
  [[nodiscard]] bool line_is_busy() const;
  [[nodiscard]] bool frame_may_begin() const;
  [[nodiscard]] bool wait_is_long(std::size_t tiles) const;
  [[nodiscard]] std::uint32_t favour(model::TileId tile) const;
  void send_status();
  [[nodiscard]] base::Result<std::size_t> encode_full_status(proto::Status& status);
  void send_texts();
  void send_coarse();
  void send_deltas();
  void send_question();
  [[nodiscard]] std::uint32_t max_age_ticks() const;
  [[nodiscard]] bool fill_packet(proto::TilePacketEncoder& packet, model::TileId tile,
                                 std::size_t& tile_count);
  void note_vehicle_tile();
  void fill_status(proto::Status& status) const;
  [[nodiscard]] std::uint32_t alarms_now() const;
  [[nodiscard]] std::uint64_t pings_shed() const {
    return counters_.pings_lost[static_cast<int>(PingLoss::kShed)] +
           counters_.pings_lost[static_cast<int>(PingLoss::kAbsentTile)];
  }
  void update_alarms();
  void count_levels();

  VehicleConfig config_{};
  base::TimeUs now_us_ = 0;
  base::TimeUs before_us_ = 0;  ///< of the cycle before
  // The link's own time: where the host's clock goes back it goes on, and nothing is silent until then.
  base::TimeUs clock_us_ = 0;  ///< what the host's clock said in the cycle before
  base::TimeUs link_us_ = 0;
  base::TimeUs link_elapsed_us_ = 0;  ///< since the cycle before
  base::TimeUs link_pause_us_ = 0;    ///< the longest between two cycles lately
  std::uint32_t tick_ = 0;            ///< link_us_ >> 15: the clock of ages
  VehicleCounters counters_{};
  model::Model model_;
  std::uint32_t table_crc_[proto::kMaxHelloTables] = {};
  std::uint32_t config_crc_ = 0;
  std::uint16_t survey_tag_ = 0;
  model::EchoDetectorConfig detector_[kMaxPorts] = {};
  alignas(kCodecStorage_alignment) std::array<std::uint8_t, kCodecArena_bytes> codec_bytes_{};
  CodecArena codecs_{codec_bytes_.data(), codec_bytes_.size()};
  PortCodec ports_[kMaxPorts];
  estimator::Navigator navigator_;
  SoundPath sound_path_;
  AutopilotFeed autopilot_;
  PingQueue pending_;
  base::Ping ready_{};   ///< the oldest pending ping, its echo detected
  base::Ping unbent_{};  ///< the same before its way through the water was made straight
  model::LaterReturn behind_[model::kMaxReturns - 1] = {};  ///< its returns behind the first
  std::int64_t clear_um_ = base::kMaxRange_um;  ///< up to where the ready ping heard nothing
  // A map larger than memory.
  TilePager pager_;
  base::TimeUs held_since_us_ = 0;
  base::TimeUs hold_again_us_ = 0;             ///< none waits before
  model::TileBox wanted_tiles_{0, -1, 0, -1};  ///< of the ping that waits, or was shed for them
  base::Pose held_head_{};         ///< of the ready ping, while later returns of it wait
  int returns_done_ = 0;           ///< of the ready ping, in the map already
  base::TimeUs track_us_ = 0;      ///< when the vehicle was at track_
  std::int32_t track_[2] = {};     ///< north, east in cells
  std::int32_t speed_q8_[2] = {};  ///< cells a second
  std::uint32_t ping_bound_ = 0;   ///< voxels of one ping with all its returns
  int behind_count_ = 0;           ///< of behind_
  std::array<std::uint16_t, model::kMaxProfileBins> energies_{};  ///< of the profile looked at
  std::array<MappedPing, kMappedKept_count> mapped_{};
  std::size_t mapped_count_ = 0;
  estimator::ClockSync clocks_[kMaxPorts];  ///< of ports with kPortDeviceClock
  estimator::StuckWatch stuck_[kMaxPorts];  ///< of ports with kPortWatchStuck
  SurfaceReference surface_[kMaxPorts];     ///< of ports with kPortZeroAtSurface
  estimator::UtcClock utc_clock_;
  estimator::PingSync ping_sync_[kMaxMounts];
  TileSet stale_;
  TileSet unsent_;
  ExtractionPass pass_;
  base::TimeUs pass_due_us_ = 0;  ///< of link_us_: when the next may begin
  LinkMap link_map_;
  CoarseFirst coarse_;
  LinkLedger ledger_;
  std::array<FrameTile, proto::kMaxPacketTiles> frame_tiles_{};  ///< of the frame being filled
  LookedAt looked_at_{};
  std::int32_t vehicle_row_ =
      0;  ///< of the tile that it was last known to be over, perhaps outside the grid
  std::int32_t vehicle_column_ = 0;
  proto::TileRange digest_asked_{};  ///< count 0: none
  Downlink downlink_;
  proto::FrameDecoderBuffer<proto::kMaxResendRequest_bytes> uplink_;
  std::uint32_t uplink_bad_ = 0;  ///< frames that its decoder had dropped when last looked at
  Watch watch_{};
  Commands commands_{};
  MappedBeams newest_beams_{};
  HostReport host_{};              ///< the newest; port_count 0 while there is none
  std::uint32_t alarms_said_ = 0;  ///< bits that a text has reported
  std::uint64_t texts_due_ = 0;    ///< bits that a text is owed for; from 32 on: that it ended
  std::array<std::uint8_t, proto::kMaxPayload_bytes> payload_{};
  std::array<std::uint8_t, kRequestCapacity_bytes> requests_[kMaxPorts] = {};
  // Together, so that they pad nothing.
  bool wet_[kMaxPorts] = {};  ///< leak switches
  bool configured_ = false;
  bool first_cycle_ = true;
  bool has_ready_ = false;           ///< ready_ holds a ping
  bool holding_ = false;             ///< the ready ping waits for voxels
  bool has_track_ = false;           ///< track_ holds a place
  bool has_pps_ = false;             ///< a port of role "pps" is there
  bool vehicle_tile_known_ = false;  ///< vehicle_row_ and vehicle_column_ hold a tile
  bool frame_waits_ = false;         ///< hello, status or text found no room in this cycle
};

}  // namespace leadline::firmware
