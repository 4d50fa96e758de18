// Vehicle: what comes in, from the ports' chunks to samples in the navigator and pings in the queue.
#include "firmware/pipeline/vehicle.hpp"
#include "firmware/pipeline/water_level.hpp"
#include "model/base/fixed.hpp"
#include "model/base/within.hpp"

namespace leadline::firmware {
namespace {

using base::min_of;
using base::Ping;
using base::Status;
using base::TimeUs;
using base::within;

// A device that keeps UTC by the same pulse as the vehicle differs from it by what its line delays.
constexpr TimeUs kSharedPulse_us = 20'000;
// Edges are read this late at most.
constexpr TimeUs kLateEdge_us = 1'000'000;

// Fields that the rest relies on; codecs are trusted with the rest.
bool ping_sound(const Ping& ping, std::uint16_t mount_count) {
  return ping.mount < mount_count &&
         within(ping.t_transmit_us, -estimator::kMaxTime_us, estimator::kMaxTime_us) &&
         ping.t_receive_us >= ping.t_transmit_us &&
         ping.t_receive_us - ping.t_transmit_us <= 60'000'000;
}

void move_to(TimeUs t_transmit_us, Ping& ping) {
  ping.t_receive_us += t_transmit_us - ping.t_transmit_us;
  ping.t_transmit_us = t_transmit_us;
}

// Beams of one transmission come in any order: unlike with ClockSync::stamp, one that goes back counts.
TimeUs beam_stamp(estimator::ClockSync& clock, TimeUs t_device_us, TimeUs t_us) {
  static_cast<void>(clock.add(t_device_us, t_us));
  const estimator::ClockReading reading = clock.at(t_device_us);
  return reading.sure ? min_of(reading.t_us, t_us) : t_us;
}

// What a head says of its own attitude is as mounted as its beams are.
estimator::SensorMount sensor_mount(const VehicleConfig& config, std::uint8_t port) {
  const std::uint8_t index = config.ports[port].mount;
  if (index == kNoMount) {
    return {};
  }
  const MountConfig& mount = config.mounts[index];
  return {{mount.lever_arm_mm[0], mount.lever_arm_mm[1], mount.lever_arm_mm[2]}, mount.boresight};
}

}  // namespace

// What the host knows goes first: a port that was opened again has its codec start over before new bytes
// come from it; then a command. Edges go next: a message names the pulse in front of it.
void Vehicle::take_chunks(const CycleInput& input) {
  std::size_t room = kMaxCycleBytes;
  bool carried_out = false;
  for (std::size_t i = 0; i < input.chunk_count; ++i) {
    if (input.chunks[i].port == kHostPort) {
      take_host_report(input.chunks[i]);
    } else if (input.chunks[i].port == kCommandPort) {
      take_command_event(input.chunks[i], carried_out);
    }
  }
  for (const bool lines : {true, false}) {
    for (std::size_t i = 0; i < input.chunk_count; ++i) {
      const InputChunk& chunk = input.chunks[i];
      if (chunk.port == kHostPort || chunk.port == kCommandPort || is_line(chunk.port) != lines) {
        continue;
      }
      const std::size_t size = min_of<std::size_t>(chunk.size_bytes, room);
      counters_.bytes_over_limit += chunk.size_bytes - size;
      room -= size;
      if (chunk.port == kStorePort && chunk.data != nullptr && model_.grid().windowed()) {
        pager_.take(chunk.data, size, model_.grid());
        continue;
      }
      take_chunk(chunk, size);
    }
  }
}

bool Vehicle::is_line(std::uint8_t port) const {
  return port < config_.port_count && config_.ports[port].driver == Driver::kLine;
}

void Vehicle::take_host_report(const InputChunk& chunk) {
  const HostReport before = host_;
  if (chunk.data == nullptr || !decode_host_report(chunk.data, chunk.size_bytes, host_)) {
    ++counters_.chunks_ignored;
    return;
  }
  for (int port = 0; port < config_.port_count; ++port) {
    if (reopened(before, host_, port)) {
      ports_[port].restart();
      clocks_[port].restart();
      stuck_[port].restart();
      restart_line(port);
    }
  }
}

// What was missed while the port was closed. A leak stays one until the line says otherwise.
void Vehicle::restart_line(int port) {
  const auto index = static_cast<std::size_t>(port);
  if (has_role(index, hal::LineRole::kPps)) {
    utc_clock_.restart_pulse();
  } else if (has_role(index, hal::LineRole::kPingSync)) {
    ping_sync_[config_.ports[port].mount].restart();
  }
}

void Vehicle::take_chunk(const InputChunk& chunk, std::size_t size_bytes) {
  if (chunk.data == nullptr || (chunk.port >= config_.port_count && chunk.port != kUplinkPort)) {
    ++counters_.chunks_ignored;
    return;
  }
  if (chunk.port == kUplinkPort) {
    take_uplink(chunk, size_bytes);
    return;
  }
  // The kernel's time of an edge that came while the cycle before was under way lies before that cycle.
  const TimeUs oldest_us = is_line(chunk.port) ? before_us_ - kLateEdge_us : before_us_;
  const TimeUs t_us = base::clamp(chunk.t_arrival_us, oldest_us, now_us_);
  counters_.chunk_time_clamped += t_us != chunk.t_arrival_us ? 1U : 0U;
  take_device_bytes(chunk.port, chunk.data, size_bytes,
                    t_us - config_.ports[chunk.port].latency_us);
}

void Vehicle::take_device_bytes(std::uint8_t port, const std::uint8_t* data, std::size_t size_bytes,
                                TimeUs t_us) {
  PortCodec& device = ports_[port];
  PortTally& tally = counters_.ports[port];
  tally.bytes += size_bytes;
  DeviceRecord record{};
  for (std::size_t i = 0; i < size_bytes; ++i) {
    for (RecordKind kind = device.feed(data[i], t_us, record); kind != RecordKind::kNone;
         kind = device.next(record)) {
      if (kind == RecordKind::kSample && record.sample.fields == 0) {
        continue;  // the sensor says that it knows nothing
      }
      ++tally.records;
      watch_.last_record_us[port] = now_us_;
      if (kind == RecordKind::kPing) {
        take_ping(port, record.ping);
      } else {
        take_sample(port, record.sample);
      }
    }
  }
  tally.rejected = device.rejected();
}

void Vehicle::take_line(std::uint8_t port, const base::NavSample& sample) {
  ++counters_.line_records;
  if ((sample.fields & base::kNavLeak) != 0) {
    wet_[port] = sample.leak != 0;
  } else if (has_role(port, hal::LineRole::kPps)) {
    (void)utc_clock_.add_pulse(sample.t_us);
  } else if (has_role(port, hal::LineRole::kPingSync)) {
    ping_sync_[config_.ports[port].mount].add(sample.t_us);
  }
}

// A message says which second a pulse was by when it came: the port's latency is of what it measured.
void Vehicle::take_utc(std::uint8_t port, const base::NavSample& sample) {
  if (has_pps_ && (sample.fields & base::kNavUtc) != 0) {
    (void)utc_clock_.add_utc(sample.utc_us, sample.t_us + config_.ports[port].latency_us);
  }
}

bool Vehicle::has_device_clock(std::uint8_t port, TimeUs t_device_us) const {
  return (config_.ports[port].switches & kPortDeviceClock) != 0 && t_device_us != 0;
}

// A device that keeps UTC by the pulse that the vehicle knows as well: its stamp without what its line delays
// at least.
TimeUs Vehicle::by_utc(std::uint8_t port, TimeUs t_device_us, TimeUs own_us) const {
  const estimator::ClockReading utc = utc_clock_.at(t_device_us);
  const TimeUs over_us = own_us - utc.t_us;
  const bool shared =
      utc.sure && clocks_[port].sure() && within(over_us, -2 * utc.error_us, kSharedPulse_us);
  return shared ? min_of(utc.t_us, own_us) : own_us;
}

void Vehicle::take_sample(std::uint8_t port, base::NavSample& sample) {
  if (is_line(port)) {
    take_line(port, sample);
    return;
  }
  take_utc(port, sample);
  ++counters_.nav_samples;
  const std::uint16_t switches = config_.ports[port].switches;
  if ((switches & kPortWatchStuck) != 0 && stuck_[port].stuck(sample)) {
    ++counters_.nav_stuck;
    return;
  }
  if (has_device_clock(port, sample.t_device_us)) {
    const TimeUs own_us = clocks_[port].stamp(sample.t_device_us, sample.t_us);
    sample.t_us = by_utc(port, sample.t_device_us, own_us);
  }
  if ((switches & kPortZeroAtSurface) != 0 && (sample.fields & base::kNavPressure) != 0 &&
      !surface_[port].refer(sample.t_us, config_.navigation.surface_pressure_pa,
                            sample.pressure_pa)) {
    ++counters_.nav_zeroing;
    sample.fields &= ~std::uint32_t{base::kNavPressure};
    if (sample.fields == 0) {
      return;
    }
  }
  navigator_.set_water_level(water_level_um(config_.water, sample.t_us));
  navigator_.take(sample, sensor_mount(config_, port));
}

void Vehicle::take_ping(std::uint8_t port, Ping& ping) {
  ++counters_.pings_in;
  if (!ping_sound(ping, config_.mount_count)) {
    lose(PingLoss::kBad);
    return;
  }
  if (has_device_clock(port, ping.t_device_us)) {
    const TimeUs own_us = beam_stamp(clocks_[port], ping.t_device_us, ping.t_transmit_us);
    move_to(by_utc(port, ping.t_device_us, own_us), ping);
  }
  Status status = pending_.push(ping, now_us_);
  // The oldest give way: a map of where the vehicle is beats one of where it was.
  while (status == Status::kFull) {
    drop_front(PingLoss::kShed);
    status = pending_.push(ping, now_us_);
  }
  if (status != Status::kOk) {
    lose(PingLoss::kBad);
  }
}

// The head's own word for when it transmitted, where a line brings that.
void Vehicle::sync_ready() {
  TimeUs edge_us = 0;
  if (!ping_sync_[ready_.mount].edge_of(ready_.t_transmit_us, edge_us)) {
    return;
  }
  move_to(edge_us, ready_);
  ++counters_.pings_synced;
}

}  // namespace leadline::firmware
