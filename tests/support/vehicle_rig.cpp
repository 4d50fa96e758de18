#include "tests/support/vehicle_rig.hpp"

#include <cmath>

#include "hal/emu/emulated_deltat.hpp"
#include "hal/emu/emulated_ping1d.hpp"
#include "hal/emu/nmea_talker.hpp"
#include "proto/messages.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace leadline::test {
namespace {

using base::TimeUs;
using firmware::CycleInput;
using firmware::CycleOutput;
using firmware::InputChunk;
using firmware::Vehicle;

constexpr double kPi = 3.14159265358979323846;
constexpr double kLatitude_deg = 47.5;
constexpr double kLongitude_deg = 9.25;
constexpr double kSound_m_s = 1500.0;
constexpr double kDepth_m = 2.0;  // of the vehicle

double metres_per_degree_north() {
  return 111132.954 - 559.822 * std::cos(2.0 * kLatitude_deg * kPi / 180.0) +
         1.175 * std::cos(4.0 * kLatitude_deg * kPi / 180.0);
}
double metres_per_degree_east() {
  return 111412.84 * std::cos(kLatitude_deg * kPi / 180.0) -
         93.5 * std::cos(3.0 * kLatitude_deg * kPi / 180.0);
}

struct Place {
  double north;
  double east;
};

// Legs north and south, 40 m long, 3 m apart, centred on the grid; corners cut.
Place place_at(double t_s, double speed_m_s) {
  const double way = speed_m_s * t_s;
  const double leg = 40.0;
  const auto number = static_cast<int>(way / leg);
  const double along = way - number * leg;
  return Place{number % 2 == 0 ? along - leg / 2 : leg / 2 - along, -12.0 + 3.0 * number};
}

emu::NmeaTruth truth_at(TimeUs t_us, const RigOptions& options) {
  const double t = static_cast<double>(t_us) * 1e-6;
  const Place place = place_at(t, options.speed_m_s);
  emu::NmeaTruth truth;
  truth.roll_deg = options.roll_deg * std::sin(2.0 * kPi * t / 5.0);
  truth.pitch_deg = 0.5 * options.roll_deg * std::sin(2.0 * kPi * t / 7.0);
  truth.heading_deg = 10.0;
  const double jump = t >= options.jump_at_s ? options.jump_m : 0.0;
  truth.latitude_deg = kLatitude_deg + (place.north + jump) / metres_per_degree_north();
  truth.longitude_deg = kLongitude_deg + place.east / metres_per_degree_east();
  truth.pressure_pa = 101325.0 + 1029.0 * 9.80665 * kDepth_m;
  truth.time_of_day_s = 36000.0 + t;
  return truth;
}

double altitude_at(const Place& place, const RigOptions& options) {
  return rig_bottom_m(place.north, place.east) + options.deeper_m - kDepth_m;
}

emu::DeltatEcho fan_at(const emu::DeltatShot& shot, const RigOptions& options) {
  const double t = static_cast<double>(shot.t_transmit_us) * 1e-6;
  const emu::NmeaTruth truth = truth_at(shot.t_transmit_us, options);
  emu::DeltatEcho echo;
  echo.has_attitude = false;
  for (int beam = 0; beam < shot.beams; ++beam) {
    const double down_deg = shot.start_deg + beam * shot.increment_deg + truth.roll_deg;
    const double tilt = std::cos(down_deg * kPi / 180.0) * std::cos(truth.pitch_deg * kPi / 180.0);
    const double range = altitude_at(place_at(t, options.speed_m_s), options) / tilt;
    echo.range_m.push_back(range < shot.range_m ? range : 0.0);
  }
  return echo;
}

emu::Ping1dEcho echo_at(const emu::Ping1dShot& shot, const RigOptions& options) {
  const double t = static_cast<double>(shot.t_transmit_us) * 1e-6;
  const Place place = place_at(t, options.speed_m_s);
  const emu::NmeaTruth truth = truth_at(shot.t_transmit_us, options);
  const double tilt =
      std::cos(truth.roll_deg * kPi / 180.0) * std::cos(truth.pitch_deg * kPi / 180.0);
  const double range = altitude_at(place, options) / tilt;
  emu::Ping1dEcho echo;
  echo.two_way_ns = static_cast<std::int64_t>(2e9 * range / kSound_m_s);
  echo.confidence_percent = 95;
  const bool silent = t > options.echo_until_s;
  if (silent) {
    echo.two_way_ns = 0;
    echo.confidence_percent = 0;
  }
  if (shot.samples > 0) {
    echo.intensity.assign(static_cast<std::size_t>(shot.samples), 3);
    const double per_sample =
        static_cast<double>(shot.listen_to_ns - shot.listen_from_ns) / shot.samples;
    const auto bin = static_cast<std::int64_t>(
        (static_cast<double>(echo.two_way_ns - shot.listen_from_ns)) / per_sample);
    for (std::int64_t i = bin; i < bin + 3; ++i) {
      if (!silent && i >= 0 && i < shot.samples) {
        echo.intensity[static_cast<std::size_t>(i)] = 120;
      }
    }
  }
  return echo;
}

emu::NmeaTalkerConfig talker_config() {
  emu::NmeaTalkerConfig config;
  config.schedule = {{emu::NmeaKind::kPashr, 50'000, 3'000},
                     {emu::NmeaKind::kGga, 200'000, 11'000},
                     {emu::NmeaKind::kPrvatPressure, 100'000, 17'000}};
  return config;
}

emu::NmeaTalkerConfig silent_config(bool attitude) {
  emu::NmeaTalkerConfig config = talker_config();
  config.schedule.erase(config.schedule.begin() + (attitude ? 0 : 1));
  return config;
}

// Everything that leaves a device until `until`, each burst with its own time.
void collect(emu::EmulatedDevice& device, std::uint8_t port, TimeUs until,
             std::vector<RecordedChunk>& chunks) {
  while (device.next_event_us() <= until) {
    const TimeUs t_us = device.next_event_us();
    emu::Bytes bytes;
    device.advance(t_us, bytes);
    if (!bytes.empty()) {
      chunks.push_back(RecordedChunk{port, t_us, bytes});
    }
  }
  emu::Bytes bytes;
  device.advance(until, bytes);
  if (!bytes.empty()) {
    chunks.push_back(RecordedChunk{port, until, bytes});
  }
}

}  // namespace

double rig_bottom_m(double north_m, double east_m) {
  return 18.0 + 0.05 * north_m + 0.8 * std::sin(east_m / 4.0);
}

const model::LocalizationTable& rig_table() {
  static const model::LocalizationTable table = [] {
    PlainBeam beam;
    beam.sigma_range_um = 50'000;
    return plain_table(beam);
  }();
  return table;
}

firmware::VehicleConfig rig_config() {
  firmware::VehicleConfig config{};
  config.schema_version = firmware::kVehicleConfigSchemaVersion;
  config.port_count = 2;
  config.mount_count = 1;
  config.table_count = 1;
  config.survey_id = 0x1234567890ABCDEF;
  config.session = 7;
  config.model = plain_config(96, 96, 64);
  config.model.cell_mm = 500;
  config.model.origin_mm[0] = -24'000;
  config.model.origin_mm[1] = -24'000;
  config.model.origin_mm[2] = 5'000;
  config.model.min_range_um = 500'000;
  config.model.max_range_um = 60'000'000;
  config.sound_speed_mm_s = 1'500'000;
  config.cycle_tile_budget = 4;
  firmware::PortConfig& sonar = config.ports[kRigSonar];
  sonar.driver = firmware::Driver::kPing1d;
  sonar.min_range_um = 500'000;
  sonar.max_range_um = 40'000'000;
  sonar.ping_interval_us = 100'000;
  config.ports[kRigNavigation].driver = firmware::Driver::kNmea;
  config.ports[kRigNavigation].mount = firmware::kNoMount;
  firmware::NavigationConfig& navigation = config.navigation;
  navigation.has_origin = 1;
  navigation.origin_latitude_e9deg = 47'500'000'000;
  navigation.origin_longitude_e9deg = 9'250'000'000;
  navigation.surface_pressure_pa = 101'325;
  navigation.water_density_g_m3 = 1'029'000;
  navigation.gravity_um_s2 = 9'806'650;
  navigation.sigma_fix_mm = 200;
  navigation.sigma_depth_mm = 50;
  navigation.sigma_attitude_urad = 3'500;
  navigation.sigma_heading_urad = 10'000;
  navigation.acceleration_mm_s2 = 100;
  navigation.angular_acceleration_urad_s2 = 100'000;
  navigation.max_gap_us = 300'000;
  navigation.max_wait_us = 500'000;
  config.link.rate_bytes_s = 4'000;
  config.link.mtu_bytes = 400;
  config.link.status_interval_us = 1'000'000;
  config.link.hello_interval_us = 10'000'000;
  config.link.max_tile_age_us = 1'000'000;
  return config;
}

void configure_rig(Vehicle& vehicle, const firmware::VehicleConfig& config) {
  const firmware::TableBlock block{&rig_table(), sizeof(model::LocalizationTable)};
  assert_int_equal(vehicle.configure(config, &block, 1), base::Status::kOk);
}

CycleOutput run_cycle(Vehicle& vehicle, const RecordedCycle& cycle) {
  std::vector<InputChunk> chunks;
  for (const RecordedChunk& chunk : cycle.chunks) {
    chunks.push_back(InputChunk{chunk.t_arrival_us, chunk.bytes.data(),
                                static_cast<std::uint16_t>(chunk.bytes.size()), chunk.port});
  }
  CycleOutput output{};
  vehicle.cycle(CycleInput{cycle.t_us, chunks.data(), chunks.size(), cycle.room_bytes}, output);
  return output;
}

void run_recording(Vehicle& vehicle, const Recording& recording) {
  for (const RecordedCycle& cycle : recording) {
    static_cast<void>(run_cycle(vehicle, cycle));
  }
}

Recording fly(Vehicle& vehicle, const RigOptions& options, const Sink& sink) {
  emu::EmulatedPing1dConfig head;
  head.answer_delay_us = 2'000;
  emu::EmulatedPing1d altimeter(
      head, [&](const emu::Ping1dShot& shot) { return echo_at(shot, options); });
  emu::EmulatedDeltatConfig many;
  many.beams = options.fan_beams;
  many.sector_deg = 60;
  many.range_m = 30;
  emu::EmulatedDeltat fan(many, [&](const emu::DeltatShot& shot) { return fan_at(shot, options); });
  emu::EmulatedDevice& sonar = options.fan_beams > 0 ? static_cast<emu::EmulatedDevice&>(fan)
                                                     : static_cast<emu::EmulatedDevice&>(altimeter);
  const auto measure = [&](TimeUs t_us) { return truth_at(t_us, options); };
  emu::NmeaTalker all(talker_config(), measure);
  emu::NmeaTalker without_attitude(silent_config(true), measure);
  emu::NmeaTalker without_fix(silent_config(false), measure);
  const auto end_us = static_cast<TimeUs>(options.seconds * 1e6);
  Recording recording;
  for (TimeUs t_us = options.cycle_us; t_us <= end_us; t_us += options.cycle_us) {
    RecordedCycle cycle{t_us, options.room_bytes, {}};
    collect(sonar, kRigSonar, t_us, cycle.chunks);
    const double t = static_cast<double>(t_us) * 1e-6;
    emu::NmeaTalker* const talkers[] = {&all, &without_attitude, &without_fix};
    const std::size_t speaks = t > options.attitude_until_s ? 1 : (t > options.fix_until_s ? 2 : 0);
    for (std::size_t i = 0; i < 3; ++i) {
      std::vector<RecordedChunk> unheard;
      collect(*talkers[i], kRigNavigation, t_us, i == speaks ? cycle.chunks : unheard);
    }
    if (options.tamper) {
      options.tamper(cycle);
    }
    const CycleOutput output = run_cycle(vehicle, cycle);
    if (sink) {
      sink(cycle, output);
    }
    const firmware::OutputSpan& request = output.device_requests[kRigSonar];
    if (request.size_bytes != 0) {
      sonar.take(t_us, request.data, request.size_bytes);
    }
    recording.push_back(std::move(cycle));
  }
  return recording;
}

bool drain(Vehicle& vehicle, TimeUs& t_us, int most, const Sink& sink) {
  for (int i = 0; i < most && !vehicle.drained(); ++i) {
    t_us += 20'000;
    const RecordedCycle cycle{t_us, 100'000, {}};
    const CycleOutput output = run_cycle(vehicle, cycle);
    if (sink) {
      sink(cycle, output);
    }
  }
  return vehicle.drained();
}

void RigReceiver::take(const std::uint8_t* data, std::size_t size_bytes) {
  while (size_bytes > 0) {
    std::size_t used = 0;
    proto::FrameView frame{};
    if (decoder_.decoder().feed(data, size_bytes, used, frame)) {
      take_frame(frame);
    }
    longest_frame = std::max(longest_frame, used);
    data += used;
    size_bytes -= used;
  }
  const proto::FrameCounters& counters = decoder_.decoder().counters();
  bad += counters.dropped_bytes != 0 ? 1U : 0U;
}

void RigReceiver::take_frame(const proto::FrameView& frame) {
  proto::MessageType type{};
  if (!proto::message_type(frame.payload, frame.payload_bytes, type)) {
    ++bad;
    return;
  }
  if (type == proto::MessageType::kHello) {
    bad += proto::decode_hello(frame.payload, frame.payload_bytes).ok() ? 0U : 1U;
    ++hellos;
  } else if (type == proto::MessageType::kStatus) {
    const auto status = proto::decode_status(frame.payload, frame.payload_bytes);
    bad += status.ok() ? 0U : 1U;
    alarms_seen |= status.value().alarms;
    last_alarms = status.value().alarms;
    ++statuses;
  } else if (type == proto::MessageType::kBrief) {
    const auto brief = proto::decode_brief(frame.payload, frame.payload_bytes);
    bad += brief.ok() ? 0U : 1U;
    alarms_seen |= brief.value().alarms;
    last_alarms = brief.value().alarms;
    ++statuses;
  } else if (type == proto::MessageType::kText) {
    bad += proto::decode_text(frame.payload, frame.payload_bytes).ok() ? 0U : 1U;
    ++texts;
  } else if (type == proto::MessageType::kTileDelta) {
    proto::TilePacketDecoder packet;
    proto::TileDelta delta{};
    const bool opened = packet.open(frame.payload, frame.payload_bytes) == base::Status::kOk &&
                        packet.survey_tag() == survey_tag_;
    while (opened && packet.next(delta)) {
      auto& cells = tiles_[delta.tile];
      cells.resize(proto::kTileArea_cells, proto::kUnknownCell);
      proto::apply_delta(delta, cells.data());
    }
    bad += opened && packet.status() == base::Status::kOk ? 0U : 1U;
    ++deltas;
  } else {
    ++bad;
  }
}

std::uint64_t RigReceiver::hash(std::uint32_t tile_count) const {
  const std::vector<proto::CodedCell> unknown(proto::kTileArea_cells, proto::kUnknownCell);
  std::uint64_t hash = proto::kFnvOffset;
  for (std::uint32_t id = 0; id < tile_count; ++id) {
    const auto* const cells = tile(id);
    hash =
        proto::add_tile_hash(hash, proto::tile_hash((cells != nullptr ? *cells : unknown).data()));
  }
  return hash;
}

const std::vector<proto::CodedCell>* RigReceiver::tile(std::uint32_t id) const {
  const auto found = tiles_.find(id);
  return found == tiles_.end() ? nullptr : &found->second;
}

}  // namespace leadline::test
