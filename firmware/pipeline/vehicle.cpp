// Vehicle: configuration, the cycle's steps in their order, pings into the map. What comes in: vehicle_input.cpp;
// what goes to the link: vehicle_link.cpp.
#include "firmware/pipeline/vehicle.hpp"

#include <algorithm>

#include "firmware/pipeline/config_codec.hpp"
#include "firmware/pipeline/intensity.hpp"
#include "firmware/pipeline/mount_pose.hpp"
#include "firmware/pipeline/water_level.hpp"
#include "model/base/crc32c.hpp"
#include "model/base/fixed.hpp"
#include "model/base/within.hpp"

namespace leadline::firmware {
namespace {

using base::max_of;
using base::min_of;
using base::Ping;
using base::Pose;
using base::ReturnKind;
using base::Status;
using base::TimeUs;
using base::within;
using model::Model;
using model::TileId;

// Of sensors that state a speed; NavigationConfig has no key for it.
constexpr std::int32_t kSigmaVelocity_mm_s = 50;
constexpr std::int32_t kLongestLever_mm = 1'000'000;
constexpr std::int32_t kLargestStep_mdb = 6000;
constexpr std::uint16_t kLeastMtu_bytes = 128;
static_assert(proto::kLeastHello_bytes + 4 * kMaxTables <=
                  proto::max_payload_bytes(kLeastMtu_bytes),
              "every hello, without its texts, fits every link");
constexpr std::uint16_t kMostMtu_bytes = 1400;
constexpr std::uint32_t kLongestTileAge_us = 60'000'000;
constexpr std::uint32_t kLongestCoarseWait_us = 3'600'000'000;
constexpr std::int32_t kSlowestSound_mm_s = 200'000;
constexpr std::int32_t kFastestSound_mm_s = 6'000'000;
// Columns that one tile of the budget pays for: it reads, smooths and assesses its own, and one more share
// for what it brings up to date around it.
constexpr std::uint32_t kColumnsPerTile = 4 * proto::kTileArea_cells;
// A ping waits so long for its voxels.
constexpr TimeUs kMostHold_us = 1'000'000;
// A long pause between two cycles is forgotten within some of these.
constexpr TimeUs kPauseMemory_us = 1'000'000;
// Where the vehicle will be so much later decides which tiles come early; its speed is that of the last step.
constexpr std::int32_t kLookAhead_s = 10;
constexpr TimeUs kTrackStep_us = 1'000'000;
// Weights of the extraction: a tile that pings wrote into, and those that only look at it.
constexpr std::uint32_t kTouchedWeight = 64;
constexpr std::uint32_t kNearWeight = 16;
constexpr std::uint32_t kFarWeight = 1;

constexpr std::int32_t kLineRoles = 3;

hal::LineRole line_role(const PortConfig& port) { return line_config(port, DeviceSetup{}).role; }

bool port_sound(const PortConfig& port, std::uint16_t mount_count) {
  if ((port.driver != Driver::kNone && !driver_enabled(port.driver)) ||
      !within(port.latency_us, -10'000'000, 10'000'000) ||
      !within(port.byte_time_ns, 0, 100'000'000) ||
      !within(port.intensity_step_mdb, 0, kLargestStep_mdb) ||
      !within(port.max_returns, 0, model::kMaxReturns) ||
      !within(port.quality_weight_percent, 0, 100)) {
    return false;
  }
  if (port.driver == Driver::kLine && !within(port.variant_plus_1, 0, kLineRoles)) {
    return false;
  }
  if (!is_head(port.driver)) {
    const bool syncs = port.driver == Driver::kLine && line_role(port) == hal::LineRole::kPingSync;
    return port.mount < mount_count || (port.mount == kNoMount && !syncs);
  }
  return (port.mount < mount_count && port.min_range_um >= 0 &&
          port.max_range_um > port.min_range_um && port.max_range_um <= base::kMaxRange_um &&
          port.ping_interval_us >= 0);
}

bool link_sound(const LinkConfig& link) {
  return link.rate_bytes_s > 0 && within(link.mtu_bytes, kLeastMtu_bytes, kMostMtu_bytes) &&
         link.status_interval_us > 0 && link.hello_interval_us > 0 &&
         link.max_tile_age_us <= kLongestTileAge_us && link.coarse_wait_us <= kLongestCoarseWait_us;
}

bool mount_sound(const MountConfig& mount) {
  return std::all_of(
      std::begin(mount.lever_arm_mm), std::end(mount.lever_arm_mm),
      [](std::int32_t arm_mm) { return within(arm_mm, -kLongestLever_mm, kLongestLever_mm); });
}

// Share of its evidence that a ping of this quality keeps.
std::uint32_t quality_share_q8(std::uint8_t quality, std::int32_t percent) {
  const std::int32_t lost_q8 = (255 - std::int32_t{quality}) * percent * 256 / 25'500;
  return static_cast<std::uint32_t>(256 - lost_q8);
}

}  // namespace

const char* ping_loss_name(PingLoss loss) {
  switch (loss) {
    case PingLoss::kShed:
      return "shed";
    case PingLoss::kNoPose:
      return "no_pose";
    case PingLoss::kPoseGap:
      return "pose_gap";
    case PingLoss::kPoseEpoch:
      return "pose_epoch";
    case PingLoss::kPaused:
      return "paused";
    case PingLoss::kBad:
      return "bad";
    case PingLoss::kNoPath:
      return "no_path";
    case PingLoss::kAbsentTile:
      return "absent_tile";
    case PingLoss::kStopped:
      return "stopped";
    case PingLoss::kCount:
      break;
  }
  return "unknown";
}

Status Vehicle::check(const VehicleConfig& config, std::size_t table_count) {
  if (!within(config.schema_version, 1, kVehicleConfigSchemaVersion)) {
    return Status::kBadVersion;
  }
  if (config.port_count > kMaxPorts || config.mount_count > kMaxMounts || config.table_count < 1 ||
      config.table_count > kMaxTables || config.cycle_tile_budget < 1 ||
      config.extract_interval_us > kLongestTileAge_us ||
      !within(config.sound_speed_mm_s, kSlowestSound_mm_s, kFastestSound_mm_s) ||
      (config.has_store != 0 && config.model.resident_tiles == 0) || !tide_sound(config.water) ||
      !link_sound(config.link) || config.navigation.max_wait_us < 0) {
    return Status::kOutOfRange;
  }
  if (table_count != config.table_count) {
    return Status::kInvalidArgument;
  }
  std::size_t codec_bytes = 0;
  for (int port = 0; port < config.port_count; ++port) {
    const PortConfig& each = config.ports[port];
    const DeviceCodec* const codec = device_codec(each.driver);
    codec_bytes += codec != nullptr ? CodecArena::rounded(codec->size_bytes) : 0;
    if (!port_sound(each, config.mount_count)) {
      return Status::kOutOfRange;
    }
    if (is_head(each.driver) && config.mounts[each.mount].table == kNoTable) {
      return Status::kInvalidArgument;
    }
  }
  if (codec_bytes > kCodecArena_bytes) {
    return Status::kFull;
  }
  for (int mount = 0; mount < config.mount_count; ++mount) {
    if (!mount_sound(config.mounts[mount])) {
      return Status::kOutOfRange;
    }
    const std::uint8_t table = config.mounts[mount].table;
    if (table >= config.table_count && table != kNoTable) {
      return Status::kInvalidArgument;
    }
  }
  return Status::kOk;
}

estimator::NavigatorConfig Vehicle::navigator_config() const {
  const NavigationConfig& from = config_.navigation;
  estimator::NavigatorConfig to{};
  to.has_origin = from.has_origin != 0;
  to.origin = {from.origin_latitude_e9deg, from.origin_longitude_e9deg};
  to.magnetic_variation_bam32 = from.magnetic_variation_bam32;
  to.surface_pressure_pa = from.surface_pressure_pa;
  to.water_density_g_m3 = from.water_density_g_m3;
  to.gravity_um_s2 = from.gravity_um_s2;
  to.sigma_fix_mm = from.sigma_fix_mm;
  to.sigma_depth_mm = from.sigma_depth_mm;
  to.sigma_attitude_urad = from.sigma_attitude_urad;
  to.sigma_heading_urad = from.sigma_heading_urad;
  to.sigma_velocity_mm_s = kSigmaVelocity_mm_s;
  to.acceleration_mm_s2 = from.acceleration_mm_s2;
  to.angular_acceleration_urad_s2 = from.angular_acceleration_urad_s2;
  to.max_gap_us = from.max_gap_us;
  return to;
}

Status Vehicle::configure(const VehicleConfig& config, const TableBlock* tables,
                          std::size_t table_count) {
  configured_ = false;
  Status status = check(config, table_count);
  if (status != Status::kOk) {
    return status;
  }
  config_ = config;
  status = navigator_.configure(navigator_config());
  if (status != Status::kOk) {
    return status;
  }
  status = sound_path_.configure(config_);
  if (status != Status::kOk) {
    return status;
  }
  model::SensorConfig sensors[model::kMaxSensors] = {};
  for (std::size_t i = 0; i < table_count; ++i) {
    sensors[i] = {tables[i].bytes, tables[i].size_bytes, config.model.min_range_um,
                  config.model.max_range_um, config.model.detect_range_um};
  }
  status = model_.configure_sensors(config.model, sensors, table_count);
  if (status != Status::kOk) {
    return status;
  }
  for (std::size_t i = 0; i < table_count; ++i) {
    table_crc_[i] = base::crc32c(tables[i].bytes, tables[i].size_bytes);
  }
  const base::Result<std::size_t> blob = encode_config(config_, payload_.data(), payload_.size());
  config_crc_ = base::crc32c(payload_.data(), blob.value());
  survey_tag_ = proto::survey_tag(config_.survey_id, config_.session);
  counters_ = VehicleCounters{};
  watch_ = Watch{};
  host_ = HostReport{};
  first_cycle_ = true;
  tick_ = 0;
  pending_.clear();
  has_ready_ = false;
  held_head_ = Pose{};
  autopilot_.configure(config_);
  commands_ = Commands{};
  newest_beams_ = MappedBeams{};
  downlink_.configure(config_.link.rate_bytes_s, config_.link.mtu_bytes);
  reset_map_state();
  uplink_.decoder().reset();
  uplink_bad_ = uplink_errors();
  alarms_said_ = 0;
  texts_due_ = 0;
  configure_ports();
  configured_ = true;
  return Status::kOk;
}

// Everything that speaks of tiles: none is known, none is owed.
void Vehicle::reset_map_state() {
  const TileId tile_count = model_.grid().tile_count();
  stale_.reset(tile_count);
  unsent_.reset(tile_count);
  pass_.reset();
  pass_due_us_ = -estimator::kMaxTime_us;  // at once
  link_map_.reset(tile_count);
  coarse_.reset(tile_count);
  ledger_.reset(first_patience_us());
  looked_at_ = LookedAt{};
  vehicle_tile_known_ = false;
  digest_asked_ = proto::TileRange{};
  commands_.slice.row_count = 0;
  if (model_.grid().windowed()) {
    const std::int64_t reach_cells =
        config_.model.max_range_um / (static_cast<std::int64_t>(config_.model.cell_mm) * 1000);
    pager_.configure(
        model_.grid(),
        static_cast<std::int32_t>(min_of<std::int64_t>(reach_cells, model::kMaxRangeCells)) +
            model::kMaxFootprintCells,
        config_.has_store != 0);
  }
  holding_ = false;
  hold_again_us_ = -estimator::kMaxTime_us;  // at once
  wanted_tiles_ = model::TileBox{0, -1, 0, -1};
  returns_done_ = 0;
  has_track_ = false;
}

bool Vehicle::has_role(std::size_t port, hal::LineRole role) const {
  return config_.ports[port].driver == Driver::kLine && line_role(config_.ports[port]) == role;
}

void Vehicle::configure_ports() {
  ping_bound_ = model_.bound().total_voxels;
  codecs_.clear();
  has_pps_ = false;
  utc_clock_ = estimator::UtcClock{};
  for (estimator::PingSync& sync : ping_sync_) {
    sync.restart();
  }
  for (int i = 0; i < kMaxPorts; ++i) {
    PortConfig port = config_.ports[i];
    if (i >= config_.port_count) {
      port.driver = Driver::kNone;
    }
    ports_[i].configure(port, DeviceSetup{config_.sound_speed_mm_s}, codecs_);
    clocks_[i] = estimator::ClockSync{};
    stuck_[i].restart();
    surface_[i].restart();
    wet_[i] = false;
    has_pps_ = has_pps_ || (port.driver == Driver::kLine && line_role(port) == hal::LineRole::kPps);
    if (!is_head(port.driver)) {
      continue;  // and may have no mount
    }
    const model::LocalizationTable& table = model_.table(config_.mounts[port.mount].table);
    // A surface of 45 degrees fills the beam from its first return to tan(envelope) of the range behind it.
    const std::uint32_t envelope_q24 =
        max_of(table.tan_envelope_along_q24, table.tan_envelope_across_q24);
    detector_[i] = model::EchoDetectorConfig{
        table.detection_fraction_q16, port.min_range_um, port.max_range_um,
        static_cast<std::uint8_t>(max_of(port.max_returns, 1)), envelope_q24 >> 8U};
    const std::uint32_t later = detector_[i].max_returns - 1U;
    ping_bound_ =
        max_of(ping_bound_, model_.bound().total_voxels + later * model_.bound().behind_voxels);
  }
}

void Vehicle::cycle(const CycleInput& input, CycleOutput& output) {
  output = CycleOutput{};
  if (!configured_) {
    return;
  }
  begin_cycle(input.t_us);
  downlink_.begin_cycle(link_elapsed_us_, input.downlink_room_bytes);
  take_chunks(input);
  navigator_.tick(now_us_);
  map_pings();
  note_touched_tiles();
  if (config_.extract_interval_us == 0) {
    extract_tiles();
  } else {
    extract_in_passes();
  }
  update_alarms();
  frame_waits_ = false;
  settle_lost_frames();
  send_hello();
  send_status();
  send_command_answer();
  send_texts();
  send_refusal_text();
  send_digest();
  send_slice();
  send_coarse();
  send_deltas();
  send_question();
  output.downlink = OutputSpan{downlink_.data(), downlink_.size_bytes()};
  output.wish_us = ledger_.heard() && unsent_.size() == 0 && ledger_.next_loss_us() != INT64_MAX
                       ? max_of(ledger_.next_loss_us() - link_us_, base::TimeUs{1})
                       : 0;
  for (int port = 0; port < config_.port_count; ++port) {
    auto& bytes = requests_[port];
    std::size_t size = ports_[port].request(now_us_, bytes.data(), bytes.size());
    size += autopilot_.send(static_cast<std::size_t>(port), now_us_, bytes.data() + size,
                            bytes.size() - size);
    output.device_requests[port] = OutputSpan{requests_[port].data(), size};
  }
  page_tiles(output.store);
  count_levels();
}

// A clock that went back stands still, but for the link.
void Vehicle::begin_cycle(TimeUs t_us) {
  ++counters_.cycles;
  const TimeUs limited = base::clamp(t_us, -estimator::kMaxTime_us, estimator::kMaxTime_us);
  if (first_cycle_) {
    first_cycle_ = false;
    now_us_ = limited;
    before_us_ = -estimator::kMaxTime_us;  // what waited for the first cycle came when it says
    for (TimeUs& heard_us : watch_.last_record_us) {
      heard_us = limited;
    }
    watch_.status_due_us = limited;
    watch_.hello_due_us = limited;
    watch_.hello_through_us = limited;
    clock_us_ = link_us_ = limited;
    link_elapsed_us_ = link_pause_us_ = 0;
    return;
  }
  link_elapsed_us_ = max_of<TimeUs>(limited - clock_us_, 0);
  clock_us_ = limited;
  link_us_ += link_elapsed_us_;
  const TimeUs pause_us = min_of(link_elapsed_us_, kPauseMemory_us);
  link_pause_us_ = max_of(pause_us, link_pause_us_ - link_pause_us_ * pause_us / kPauseMemory_us);
  // Ages count in 32.768 ms, whatever the rate of the cycles.
  tick_ = static_cast<std::uint32_t>(static_cast<std::uint64_t>(link_us_) >> 15U);
  before_us_ = now_us_;
  if (limited < now_us_) {
    ++counters_.cycle_time_clamped;
    return;
  }
  now_us_ = limited;
}

void Vehicle::lose(PingLoss loss) { ++counters_.pings_lost[static_cast<int>(loss)]; }

// The port whose head sits on the mount.
std::size_t Vehicle::port_of_head(std::uint16_t mount) const {
  std::size_t port = 0;
  while (port + 1 < static_cast<std::size_t>(config_.port_count) &&
         !(is_head(config_.ports[port].driver) && config_.ports[port].mount == mount)) {
    ++port;
  }
  return port;
}

// The oldest pending ping with its echo found: once, however long it waits.
void Vehicle::make_ready() {
  if (has_ready_) {
    return;
  }
  has_ready_ = true;
  ready_ = pending_.front();
  behind_count_ = 0;
  clear_um_ = base::kMaxRange_um;
  sync_ready();
  if (ready_.kind == ReturnKind::kProfile) {
    find_echo();
  }
  autopilot_.take(ready_);
}

// The profile of the ready ping becomes its first return, or none; what is behind it is kept.
void Vehicle::find_echo() {
  const std::size_t port = port_of_head(ready_.mount);
  base::RangeProfile profile = ready_.profile;
  if (profile.intensity != nullptr) {
    energies_of(profile, config_.ports[port].intensity_scale,
                config_.ports[port].intensity_step_mdb, energies_.data());
    profile.intensity = energies_.data();
  }
  const model::EchoDetection echo = model::detect_echo(profile, detector_[port]);
  ready_.profile = base::RangeProfile{};
  if (!echo.found) {
    ++counters_.profiles_undetected;
    ready_.kind = ReturnKind::kNoReturn;
    return;
  }
  ++counters_.profiles_detected;
  ready_.kind = ReturnKind::kRange;
  ready_.range_um = echo.range_um;
  ready_.quality = echo.quality;
  behind_count_ = echo.behind_count;
  clear_um_ = detector_[port].max_returns > 1 ? echo.clear_um : base::kMaxRange_um;
  std::copy(std::begin(echo.behind), std::end(echo.behind), std::begin(behind_));
  // Two ways at the speed of sound: um / (mm/s) = ms.
  const TimeUs travel_us = 2 * echo.range_um * 1000 / config_.sound_speed_mm_s;
  ready_.t_receive_us = ready_.t_transmit_us + max_of<TimeUs>(travel_us, 0);
}

// Pose of the ping's head. False: `wait` for a later pose, or lost for the reason in `loss`.
bool Vehicle::pose_for(const Ping& ping, Pose& pose, PingLoss& loss, bool& wait) const {
  const estimator::PoseHistory& history = navigator_.history();
  const base::Result<Pose> transmit = history.at(ping.t_transmit_us);
  const base::Result<Pose> receive = history.at(ping.t_receive_us);
  wait = false;
  for (const base::Result<Pose>& result : {transmit, receive}) {
    const Status status = result.status();
    if (status == Status::kNotReady || status == Status::kEmpty) {
      wait = now_us_ - ping.t_receive_us <= config_.navigation.max_wait_us;
      loss = PingLoss::kNoPose;
      return false;
    }
    if (status != Status::kOk) {
      loss = status == Status::kOutOfRange      ? PingLoss::kPoseGap
             : status == Status::kEpochMismatch ? PingLoss::kPoseEpoch
                                                : PingLoss::kNoPose;
      return false;
    }
  }
  if (transmit.value().epoch != receive.value().epoch) {
    loss = PingLoss::kPoseEpoch;
    return false;
  }
  const Pose between = middle(transmit.value(), receive.value());
  if (!certain_enough(between)) {
    loss = PingLoss::kPaused;
    return false;
  }
  pose = pose_of_mount(between, config_.mounts[ping.mount]);
  return true;
}

// The ready ping along the straight line to where its sound went.
bool Vehicle::straightened(const Pose& head, PingLoss& loss) {
  loss = PingLoss::kNoPath;
  const Driver driver = config_.ports[port_of_head(ready_.mount)].driver;
  Pose below_surface = head;
  below_surface.position_um[base::kDown] += water_level_um(config_.water, head.t_us);
  return sound_path_.straighten(ready_, below_surface, array_face(driver));
}

// A footprint of kMaxFootprintCells holds 2.2 sigma: what is less certain than that would be cut, and said
// to lie where nobody knows that it does.
bool Vehicle::certain_enough(const Pose& pose) const {
  const std::int64_t limit_mm =
      static_cast<std::int64_t>(model::kMaxFootprintCells) * config_.model.cell_mm * 10 / 22;
  return pose.covariance.sigma_position_mm[base::kNorth] <= limit_mm &&
         pose.covariance.sigma_position_mm[base::kEast] <= limit_mm;
}

void Vehicle::keep_mapped(const Pose& pose) {
  if (mapped_count_ == kMappedKept_count) {
    return;
  }
  mapped_[mapped_count_] = MappedPing{ready_, pose};
  mapped_[mapped_count_].ping.profile = base::RangeProfile{};
  ++mapped_count_;
}

// The first and the last beam of the newest transmission.
void Vehicle::note_beam(const Pose& head) {
  if (ready_.kind != ReturnKind::kRange) {
    return;
  }
  newest_beams_.last = {head.attitude, ready_.azimuth_bam32, ready_.elevation_bam32,
                        ready_.range_um};
  if (newest_beams_.count == 0 || newest_beams_.t_transmit_us != ready_.t_transmit_us) {
    newest_beams_.first = newest_beams_.last;
    newest_beams_.t_transmit_us = ready_.t_transmit_us;
    newest_beams_.count = 1;
  } else {
    newest_beams_.count = 2;
  }
}

std::uint32_t Vehicle::cycle_bound_voxels() const {
  if (config_.cycle_voxel_budget != 0) {
    return max_of(config_.cycle_voxel_budget, ping_bound_);
  }
  const std::uint64_t queue = std::uint64_t{ping_bound_} * PingQueue::kCapacity_count;
  return static_cast<std::uint32_t>(min_of<std::uint64_t>(queue, UINT32_MAX));
}

// The ready ping with all its returns, seen from `head`. Each return goes its own way through the water. False: tiles
// are not there; called again, it goes on where it stopped.
bool Vehicle::map_ready(const Pose& head, std::uint32_t& written) {
  const std::uint8_t sensor = config_.mounts[ready_.mount].table;
  const std::int32_t percent = config_.ports[port_of_head(ready_.mount)].quality_weight_percent;
  if (returns_done_ == 0) {
    const model::PingResult result = model_.integrate(
        ready_, head, sensor, {quality_share_q8(ready_.quality, percent), clear_um_});
    if (result == model::PingResult::kAbsentTile) {
      return false;
    }
    written += model_.counters().last_voxels_per_ping;
    keep_mapped(head);
    note_beam(head);
    returns_done_ = 1;
  }
  for (; returns_done_ <= behind_count_; ++returns_done_) {
    const model::LaterReturn& later = behind_[returns_done_ - 1];
    PingLoss ignored{};
    ready_ = unbent_;
    ready_.range_um = later.range_um;
    if (!straightened(head, ignored)) {
      continue;
    }
    if (model_.integrate_behind(ready_, head, sensor, {quality_share_q8(later.quality, percent)}) ==
        model::PingResult::kAbsentTile) {
      return false;
    }
    written += model_.counters().last_voxels_per_ping;
  }
  return true;
}

// The oldest ping goes: lost, unless its first return is in the map already.
void Vehicle::drop_front(PingLoss loss) {
  if (returns_done_ > 0) {
    ++counters_.pings_mapped;
    counters_.returns_lost += static_cast<std::uint64_t>(behind_count_ + 1 - returns_done_);
  } else {
    lose(loss);
  }
  pop_front();
}

void Vehicle::pop_front() {
  pending_.pop();
  has_ready_ = false;
  holding_ = false;
  returns_done_ = 0;
}

void Vehicle::lose_pending(PingLoss loss) {
  while (!pending_.empty()) {
    drop_front(loss);
  }
}

void Vehicle::map_pings() {
  std::uint32_t written = 0;
  bool any = false;
  mapped_count_ = 0;
  wanted_tiles_ = model::TileBox{0, -1, 0, -1};
  if (commands_.stopped) {
    lose_pending(PingLoss::kStopped);
  }
  // What the budget kept waiting for too long gives way, or a deep queue would show the pilot the past.
  const TimeUs longest_us = config_.navigation.max_wait_us + kLongestQueue_us;
  while (!pending_.empty()) {
    if (now_us_ - pending_.front_since_us() > longest_us) {
      drop_front(PingLoss::kShed);
      continue;
    }
    // One ping goes through whatever the budget is, or nothing ever would.
    if (any && config_.cycle_voxel_budget != 0 &&
        static_cast<std::uint64_t>(written) + ping_bound_ > config_.cycle_voxel_budget) {
      break;
    }
    make_ready();
    Pose pose{};
    PingLoss loss = PingLoss::kNoPose;
    bool wait = false;
    unbent_ = ready_;
    const bool resumed = returns_done_ > 0;
    if (resumed || (pose_for(ready_, pose, loss, wait) && straightened(pose, loss))) {
      held_head_ = resumed ? held_head_ : pose;
      if (!map_ready(held_head_, written)) {
        if (hold_ping()) {
          break;
        }
        drop_front(PingLoss::kAbsentTile);
        continue;
      }
      ++counters_.pings_mapped;
      any = true;
      watch_.paused = false;
    } else if (wait) {
      break;
    } else {
      lose(loss);
      watch_.paused = loss == PingLoss::kPaused || watch_.paused;
    }
    pop_front();
  }
  counters_.work_last_voxels = written;
  counters_.work_max_voxels = max_of(counters_.work_max_voxels, written);
}

// A ping whose tiles are not in memory stays the first, and comes again with the next cycle. False: it has
// waited long enough, there will never be room for its tiles, or another one has just waited in vain: those behind it,
// whose tiles are there, get as long as that one took.
bool Vehicle::hold_ping() {
  ready_ = unbent_;
  if (!TilePager::fits(model_.wanted_tiles(), model_.grid())) {
    return false;
  }
  wanted_tiles_ = model_.wanted_tiles();
  if (!holding_ && now_us_ < hold_again_us_) {
    return false;
  }
  held_since_us_ = holding_ ? held_since_us_ : now_us_;
  holding_ = now_us_ - held_since_us_ < kMostHold_us;
  hold_again_us_ = holding_ ? hold_again_us_ : now_us_ + kMostHold_us;
  counters_.cycles_held += holding_ ? 1U : 0U;
  return holding_;
}

// Which tiles are wanted in memory: those that a ping waits for, here, and ahead by the speed of the last
// second.
void Vehicle::page_tiles(StoreOutput& output) {
  model::Grid& grid = model_.grid();
  if (!grid.windowed()) {
    return;
  }
  const Pose& pose = navigator_.latest();
  PagerSituation situation{};
  situation.placed = (pose.validity & base::kPoseHorizontal) != 0;
  situation.wanted = wanted_tiles_;
  if (situation.placed) {
    std::int32_t here[2] = {};
    for (int axis = 0; axis < 2; ++axis) {
      const std::int64_t offset_um = pose.position_um[axis] - config_.model.origin_mm[axis] * 1000;
      constexpr std::int64_t kFar_cells = std::int64_t{4} * model::kMaxSideCells;
      here[axis] = static_cast<std::int32_t>(base::clamp<std::int64_t>(
          offset_um / (static_cast<std::int64_t>(config_.model.cell_mm) * 1000), -kFar_cells,
          kFar_cells));
    }
    const TimeUs elapsed_us = now_us_ - track_us_;
    if (!has_track_ || elapsed_us >= kTrackStep_us) {
      for (int axis = 0; axis < 2; ++axis) {
        const std::int64_t moved_q8 = static_cast<std::int64_t>(here[axis] - track_[axis]) * 256;
        speed_q8_[axis] = has_track_ ? static_cast<std::int32_t>(base::clamp<std::int64_t>(
                                           moved_q8 * 1'000'000 / elapsed_us, -(1 << 20), 1 << 20))
                                     : 0;
        track_[axis] = here[axis];
      }
      has_track_ = true;
      track_us_ = now_us_;
    }
    situation.north_cells = here[0];
    situation.east_cells = here[1];
    situation.ahead_north_cells = here[0] + speed_q8_[0] * kLookAhead_s / 256;
    situation.ahead_east_cells = here[1] + speed_q8_[1] * kLookAhead_s / 256;
  }
  pager_.cycle(situation, grid, output);
  if (output.read) {
    model_.read_touched_tile(output.read_tile);
  }
}

// What pings touched is stale, and what looks that far.
void Vehicle::note_touched_tiles() {
  const model::Grid& grid = model_.grid();
  constexpr std::int32_t kReach = Model::kInfluenceTiles;
  TileId tile = 0;
  while (model_.take_touched_tile(tile)) {
    const auto row = static_cast<std::int32_t>(tile) / grid.tiles_east();
    const auto column = static_cast<std::int32_t>(tile) % grid.tiles_east();
    const std::int32_t row1 = min_of(row + kReach, grid.tiles_north() - 1);
    const std::int32_t column1 = min_of(column + kReach, grid.tiles_east() - 1);
    for (std::int32_t n = max_of(row - kReach, 0); n <= row1; ++n) {
      for (std::int32_t e = max_of(column - kReach, 0); e <= column1; ++e) {
        const auto other = static_cast<TileId>(n * grid.tiles_east() + e);
        const model::TileRecord& record = grid.tile(other);
        if (record.generation == 0) {
          continue;  // never touched: nothing in it can be known
        }
        const bool near = within(n - row, -1, 1) && within(e - column, -1, 1);
        std::uint32_t weight = near ? kNearWeight : kFarWeight;
        if (other == tile) {
          weight = kTouchedWeight + (record.generation - record.generation_read);
        }
        stale_.add(other, weight, tick_);
      }
    }
  }
}

std::uint64_t Vehicle::extract_budget_columns() const {
  return static_cast<std::uint64_t>(config_.cycle_tile_budget) * kColumnsPerTile;
}

void Vehicle::extract_tiles() {
  const std::uint64_t budget = extract_budget_columns();
  std::uint64_t columns = 0;
  TileId tile = 0;
  for (std::uint32_t done = 0; done < config_.cycle_tile_budget && columns < budget; ++done) {
    if (!stale_.best(tick_, tile)) {
      return;
    }
    stale_.remove(tile);
    const model::TileWork work = model_.extract_tile(tile);
    columns += work.columns_read + work.columns_smoothed + work.columns_assessed;
    ++counters_.tiles_extracted;
    compare_tile(tile);
  }
}

void Vehicle::extract_in_passes() {
  if (pass_.size() == 0) {
    if (stale_.size() == 0 || link_us_ < pass_due_us_) {
      return;
    }
    pass_.begin(stale_);
    pass_due_us_ = link_us_ + config_.extract_interval_us;
  }
  const std::uint64_t budget = extract_budget_columns();
  std::uint64_t columns = 0;
  while (pass_.size() > 0 && columns < budget) {
    const ExtractionPass::Step step = pass_.step(model_);
    columns += step.columns;
    if (step.finished) {
      ++counters_.tiles_extracted;
      compare_tile(step.tile);
    }
  }
}

// Whether the link is owed anything of the tile.
void Vehicle::compare_tile(TileId tile) {
  TileCells present;
  link_map_.present(model_, tile, present);
  const int owed = link_map_.owed(tile, present).count();
  if (owed > 0) {
    unsent_.add(tile, static_cast<std::uint32_t>(owed), tick_);
  } else {
    unsent_.remove(tile);
  }
}

void Vehicle::count_levels() {
  counters_.pings_pending = static_cast<std::uint32_t>(pending_.size());
  counters_.tiles_stale = static_cast<std::uint32_t>(stale_.size() + pass_.size());
  counters_.tiles_unsent = static_cast<std::uint32_t>(unsent_.size());
  counters_.autopilot_frames = autopilot_.frames();
  counters_.downlink_bytes = downlink_.total_bytes();
  counters_.downlink_frames = downlink_.total_frames();
}

}  // namespace leadline::firmware
