// Small flights that nobody would plan: random heads and sensors of all drivers over lines that lose and change
// bytes, random grids, rules, tables, water and links, an uplink that asks for random things, times that go back. Each
// is logged as a vehicle logs, and its log replays to the same bits.
//
// LEADLINE_RANDOM_LOGS=DIR leaves the logs there (0000.lll ...), LEADLINE_RANDOM_LOG_COUNT says how many: so that other
// targets can be compared (tests/cli/test_same_bits_ci.py, toolchain/soak.sh --targets). --seed N makes others.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "firmware/config/port_section.hpp"
#include "firmware/pipeline/host_report.hpp"
#include "firmware/pipeline/log_player.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "hal/emu/faulty_stream.hpp"
#include "hal/emu/talker.hpp"
#include "host_tools/emulate/lone_devices.hpp"
#include "host_tools/table/generator.hpp"
#include "proto/framing.hpp"
#include "proto/messages.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::Status;
using leadline::base::TimeUs;
using leadline::emu::Bytes;
using leadline::emu::FaultConfig;
using leadline::emu::FaultyStream;
using leadline::firmware::CycleInput;
using leadline::firmware::CycleOutput;
using leadline::firmware::Driver;
using leadline::firmware::InputChunk;
using leadline::firmware::kNoMount;
using leadline::firmware::LogEvent;
using leadline::firmware::LogPlayer;
using leadline::firmware::TableBlock;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::host::DeviceScene;
using leadline::model::LocalizationTable;
using leadline::proto::LogEnd;
using leadline::proto::LogWriter;
using leadline::test::Random;
using leadline::test::RecordedChunk;
using leadline::test::RecordedCycle;

// What the smallest target with room for a demo survey takes (preset cortex-m7): logs are for all targets.
constexpr std::int32_t kMostSide_cells = 64;
constexpr std::size_t kMostTables = 3;
// A flight ends when so many pings came, or are in the map: what dense heads would add is more of the same.
constexpr std::uint64_t kEnoughPings = 4'000;
constexpr std::uint64_t kEnoughMapped = 1'500;
// Smallest sensor set with poses is rare by chance alone: this one says all that a pose needs.
constexpr Driver kWholeNavigation = Driver::kNmea;

Vehicle vehicle;
LogPlayer player;

bool chance(Random& random, int percent) { return random.between(1, 100) <= percent; }

template <typename T>
T number(Random& random, std::int64_t low, std::int64_t high) {
  return static_cast<T>(random.between(low, high));
}

// --- The other end of a port

/// Recorded datagrams of a head without an emulated side, over and over.
class Recorded final : public leadline::emu::EmulatedDevice {
 public:
  explicit Recorded(std::vector<Bytes> messages) : messages_(std::move(messages)) {}
  void take(TimeUs /*now_us*/, const std::uint8_t* /*data*/, std::size_t /*size*/) override {}
  void advance(TimeUs now_us, Bytes& out) override {
    for (; next_us_ <= now_us; next_us_ += kInterval_us) {
      const Bytes& message = messages_[next_++ % messages_.size()];
      out.insert(out.end(), message.begin(), message.end());
    }
  }
  [[nodiscard]] TimeUs next_event_us() const override { return next_us_; }

 private:
  static constexpr TimeUs kInterval_us = 150'000;
  std::vector<Bytes> messages_;
  std::size_t next_ = 0;
  TimeUs next_us_ = kInterval_us;
};

std::vector<Bytes> kongsberg_messages() {
  std::vector<std::filesystem::path> paths;
  const std::string folder =
      leadline::test::source_directory() + "/tests/fuzz/corpus/fuzz_kongsberg";
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  std::vector<Bytes> messages;
  for (const auto& path : paths) {
    std::ifstream file(path, std::ios::binary);
    messages.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  assert_false(messages.empty());
  return messages;
}

struct Line {
  std::unique_ptr<leadline::emu::EmulatedDevice> device;
  std::unique_ptr<FaultyStream> to_vehicle;
};

/// An edge five times a second.
std::unique_ptr<leadline::emu::EmulatedDevice> make_line() {
  const auto edge = [](std::uint8_t letter, leadline::base::TimeUs first_us) {
    return leadline::emu::TalkerRow{
        [letter](leadline::base::TimeUs) { return leadline::emu::Bytes{letter}; }, 200'000,
        first_us};
  };
  return std::make_unique<leadline::emu::Talker>(
      leadline::emu::TalkerConfig{},
      std::vector<leadline::emu::TalkerRow>{edge('R', 1'000), edge('F', 51'000)});
}

std::unique_ptr<leadline::emu::EmulatedDevice> make_device(Driver driver, std::size_t variant,
                                                           const DeviceScene& scene) {
  if (driver == Driver::kKongsberg) {
    return std::make_unique<Recorded>(kongsberg_messages());
  }
  if (driver == Driver::kLine) {
    return make_line();
  }
  return leadline::host::make_lone_device(driver, variant, scene);
}

// --- A vehicle nobody would build

/// Forward axis down, or down axis down: as make_lone_device() has its heads.
bool looks_ahead(Driver driver) {
  return driver == Driver::kPing360 || driver == Driver::kImagenex || driver == Driver::kTritech ||
         driver == Driver::kWl3d;
}

const std::vector<LocalizationTable>& generated_tables() {
  static const std::vector<LocalizationTable> kTables = [] {
    std::vector<LocalizationTable> tables;
    for (const double half_angle_deg : {1.0, 6.0, 12.5}) {
      leadline::host::BeamDescription beam;
      beam.half_angle_deg = half_angle_deg;
      beam.sigma_pointing_deg = 0.5;
      beam.sigma_range_mm = 50;
      tables.push_back(leadline::host::generate_table(beam).table);
    }
    return tables;
  }();
  return kTables;
}

LocalizationTable random_table(Random& random) {
  if (chance(random, 60)) {
    return generated_tables()[number<std::size_t>(random, 0, 2)];
  }
  leadline::test::PlainBeam beam;
  beam.half_angle_along_rad = 0.01 + 0.2 * random.uniform();
  beam.two_axis = chance(random, 30);
  beam.half_angle_across_rad = 0.01 + 0.2 * random.uniform();
  beam.sigma_pointing_rad = 0.002 + 0.02 * random.uniform();
  beam.sigma_range_um = number<std::uint32_t>(random, 20'000, 800'000);
  return leadline::test::plain_table(beam);
}

void random_model(Random& random, leadline::model::ModelConfig* model) {
  model->rule = static_cast<leadline::model::Rule>(random.between(0, 3));
  model->k_p_q16 = number<std::uint32_t>(random, 1, 65'536);
  model->no_return = static_cast<leadline::model::NoReturnPolicy>(random.between(0, 1));
  model->cell_mm = number<std::int32_t>(random, 100, 1'200);
  for (int axis = 0; axis < 3; ++axis) {
    model->size[axis] = number<std::int32_t>(random, axis == 2 ? 16 : 8, kMostSide_cells);
    model->sigma_position_mm[axis] = number<std::int64_t>(random, 0, 400);
    model->sigma_correlated_mm[axis] = number<std::int64_t>(random, 0, 300);
  }
  // About where the emulated vehicles are: near the origin, over a bottom some metres down.
  for (int axis = 0; axis < 2; ++axis) {
    model->origin_mm[axis] =
        -std::int64_t{model->cell_mm} * model->size[axis] / 2 + random.between(-2'000, 2'000);
  }
  model->origin_mm[2] = random.between(0, 3'000);
  model->min_range_um = random.between(0, 500'000);
  model->max_range_um = random.between(10'000'000, 60'000'000);
  model->detect_range_um = random.between(5'000'000, 9'000'000);
}

void random_water(Random& random, leadline::firmware::WaterConfig* water) {
  water->speed_known = number<std::uint16_t>(random, 0, 1);
  if (chance(random, 40)) {
    water->point_count = number<std::uint16_t>(random, 2, leadline::firmware::kMaxSoundSpeedPoints);
    std::int32_t depth_mm = 0;
    std::int32_t speed_mm_s = number<std::int32_t>(random, 1'430'000, 1'540'000);
    for (int i = 0; i < water->point_count; ++i) {
      water->points[i] = {depth_mm, speed_mm_s};
      depth_mm += number<std::int32_t>(random, 200, 4'000);
      speed_mm_s += number<std::int32_t>(random, -3'000, 3'000);
    }
  }
  if (chance(random, 30)) {
    water->tide_count = 3;
    for (int i = 0; i < 3; ++i) {
      water->tide[i] = {i * TimeUs{4'000'000}, number<std::int32_t>(random, -1'500, 1'500)};
    }
  }
}

leadline::firmware::PortConfig random_port(Random& random, Driver driver) {
  leadline::firmware::PortConfig port{};
  port.driver = driver;
  port.mount = number<std::uint8_t>(random, 0, 2);
  if (!leadline::firmware::is_head(driver) && chance(random, 60)) {
    port.mount = kNoMount;
  }
  if (chance(random, 30)) {
    port.switches = number<std::uint16_t>(random, 0, 0x7FFF);
  } else if (chance(random, 40)) {
    port.switches = leadline::firmware::kPortDeviceClock | leadline::firmware::kPortWatchStuck;
  }
  port.latency_us = chance(random, 50) ? number<std::int32_t>(random, 0, 200'000) : 0;
  port.min_range_um = random.between(200'000, 900'000);
  port.max_range_um = random.between(12'000'000, 50'000'000);
  port.ping_interval_us = number<std::int32_t>(random, 30'000, 200'000);
  port.scan_last_grad = 399;
  port.scan_step_grad = number<std::int32_t>(random, 1, 20);
  if (chance(random, 50)) {  // a sector about the axis
    port.scan_first_grad = number<std::int32_t>(random, 120, 190);
    port.scan_last_grad = number<std::int32_t>(random, 210, 280);
  }
  port.profile = number<std::int32_t>(random, 0, 1);
  // The first variant is no device: the codec listens, or finds out.
  const auto variants = leadline::host::variant_names(driver).size();
  if (variants > 1) {
    port.variant_plus_1 = number<std::int32_t>(random, 2, static_cast<std::int64_t>(variants));
  }
  if (driver == Driver::kLine && port.mount == leadline::firmware::kNoMount) {
    port.mount = 0;  // of a head that says when it transmits
  }
  port.byte_time_ns = chance(random, 30) ? number<std::int32_t>(random, 0, 90'000) : 0;
  port.intensity_scale = static_cast<leadline::firmware::IntensityScale>(random.between(0, 2));
  port.intensity_step_mdb = number<std::int32_t>(random, 100, 900);
  return port;
}

VehicleConfig random_config(Random& random) {
  VehicleConfig config = leadline::test::rig_config();
  config.survey_id = random.next();
  config.session = number<std::uint32_t>(random, 1, 1'000'000);
  config.table_count = number<std::uint16_t>(random, 1, kMostTables);
  random_model(random, &config.model);
  config.sound_speed_mm_s = number<std::int32_t>(random, 1'420'000, 1'560'000);
  config.cycle_voxel_budget =
      chance(random, 50) ? number<std::uint32_t>(random, 2'000, 200'000) : 0;
  config.cycle_tile_budget = number<std::uint32_t>(random, 1, 16);
  config.port_count = number<std::uint16_t>(random, 2, leadline::firmware::kMaxPorts);
  config.mount_count = 3;
  for (int i = 0; i < config.mount_count; ++i) {
    for (std::int32_t& lever_mm : config.mounts[i].lever_arm_mm) {
      lever_mm = number<std::int32_t>(random, -1'500, 1'500);
    }
    config.mounts[i].table = number<std::uint8_t>(random, 0, config.table_count - 1);
  }
  int larges = 0;
  for (int i = 0; i < config.port_count; ++i) {
    // More than three of the largest codecs may find no room (LEADLINE_CODEC_BYTES).
    const auto drawn = static_cast<Driver>(random.between(1, leadline::firmware::kLastDriver));
    const bool large = drawn == Driver::kKongsberg || drawn == Driver::kWl3d;
    larges += large ? 1 : 0;
    const Driver any = large && larges > 3 ? Driver::kNmea : drawn;
    config.ports[i] = random_port(random, i == 0 && chance(random, 85) ? kWholeNavigation : any);
    if (i == 0) {
      config.ports[i].switches = 0;
    }
  }
  // Heads of one mount look one way: the last one's.
  for (int i = 0; i < config.port_count; ++i) {
    if (leadline::firmware::is_head(config.ports[i].driver)) {
      auto& boresight = config.mounts[config.ports[i].mount].boresight;
      boresight.roll_bam32 = leadline::test::bam(4.0 * random.normal());
      boresight.pitch_bam32 = leadline::test::bam(4.0 * random.normal() -
                                                  (looks_ahead(config.ports[i].driver) ? 90 : 0));
      boresight.heading_bam32 = leadline::test::bam(360.0 * random.uniform());
    }
  }
  auto& navigation = config.navigation;
  navigation.has_origin = number<std::int32_t>(random, 0, 1);
  navigation.origin_latitude_e9deg = 54'300'000'000 + random.between(-20'000, 20'000);
  navigation.origin_longitude_e9deg = 10'200'000'000 + random.between(-20'000, 20'000);
  navigation.magnetic_variation_bam32 = number<std::int32_t>(random, -200'000'000, 200'000'000);
  navigation.acceleration_mm_s2 = number<std::int32_t>(random, 20, 600);
  navigation.max_gap_us = number<std::int32_t>(random, 100'000, 2'000'000);
  navigation.max_wait_us = number<std::int32_t>(random, 50'000, 900'000);
  random_water(random, &config.water);
  config.link.rate_bytes_s = number<std::uint32_t>(random, 100, 20'000);
  config.link.mtu_bytes = number<std::uint16_t>(random, 128, 1'400);
  config.link.max_tile_age_us = number<std::uint32_t>(random, 0, 3'000'000);
  config.link.coarse_wait_us =
      chance(random, 50) ? number<std::uint32_t>(random, 1, 10'000'000) : 0;
  config.extract_interval_us = chance(random, 30) ? number<std::uint32_t>(random, 1, 3'000'000) : 0;
  return config;
}

// --- A flight

class Flight {
 public:
  /// Null when the vehicle refuses what was drawn.
  static std::unique_ptr<Flight> begin(Random& random) {
    std::unique_ptr<Flight> flight(new Flight(random));
    return flight->configured_ ? std::move(flight) : nullptr;
  }

  void fly() {
    const auto cycle_us = random_.between(5'000, 60'000);
    // A Tritech head centres itself for four seconds before it pings.
    const bool slow = has(Driver::kTritech);
    const TimeUs end_us = random_.between(2'000'000, 6'000'000) + (slow ? 4'000'000 : 0);
    // A camera says more in one second than the others together in ten: enough is enough.
    const auto& counters = vehicle.counters();
    while (now_us_ < end_us && counters.pings_in < kEnoughPings &&
           counters.pings_mapped < kEnoughMapped) {
      now_us_ += chance(random_, 99) ? cycle_us : random_.between(0, 400'000);
      cycle();
    }
    for (int i = 0; i < 100 && !vehicle.drained(); ++i) {  // as far as the link's rate allows
      now_us_ += cycle_us;
      run({said_us(), number<std::uint32_t>(random_, 0, 4'000), {}});
    }
    end = leadline::firmware::log_end_of(vehicle, last_us_);
    keep([this](LogWriter& writer) { return writer.end(end); });
  }

  [[nodiscard]] const VehicleConfig& config() const { return config_; }
  [[nodiscard]] bool has(Driver driver) const {
    return std::any_of(config_.ports, config_.ports + config_.port_count,
                       [driver](const auto& port) { return port.driver == driver; });
  }

  Bytes log;
  LogEnd end{};

 private:
  explicit Flight(Random& random) : random_(random), config_(random_config(random)) {
    for (int i = 0; i < config_.table_count; ++i) {
      tables_.push_back(random_table(random_));
    }
    std::vector<TableBlock> blocks;
    for (const LocalizationTable& table : tables_) {
      blocks.push_back({&table, sizeof table});
    }
    if (vehicle.configure(config_, blocks.data(), blocks.size()) != Status::kOk) {
      return;
    }
    configured_ = true;
    DeviceScene scene;
    scene.bottom_m = 3.0 + 12.0 * random_.uniform();
    scene.depth_m = 4.0 * random_.uniform();
    scene.attitude.heading_deg = 360.0 * random_.uniform();
    scene.swing_deg = 8.0 * random_.uniform();
    scene.speed_m_s = 2.0 * random_.uniform();
    // Full pictures of a camera are 16,384 pings each.
    scene.beams_share = chance(random_, 10) ? 1.0 : 0.08 + 0.3 * random_.uniform();
    for (int i = 0; i < config_.port_count; ++i) {
      const auto& port = config_.ports[i];
      // Position in variant_names(); devices of one kind ignore it.
      const auto variant = static_cast<std::size_t>(std::max(port.variant_plus_1 - 1, 0));
      lines_.push_back({make_device(port.driver, variant, scene), make_stream()});
      assert_non_null(lines_.back().device.get());
    }
    for (int copy = 0; copy < leadline::firmware::kLogPreambleCopies; ++copy) {
      keep([&](LogWriter& writer) {
        return leadline::firmware::log_begin(writer, vehicle.config(), blocks.data(), blocks.size(),
                                             0, 0);
      });
    }
  }

  std::unique_ptr<FaultyStream> make_stream() {
    FaultConfig faults;
    faults.seed = random_.next();
    if (chance(random_, 60)) {
      faults.drop_ppm = number<std::uint32_t>(random_, 0, 500);
      faults.corrupt_ppm = number<std::uint32_t>(random_, 0, 1'000);
      faults.repeat_ppm = number<std::uint32_t>(random_, 0, 500);
      faults.truncate_ppm = number<std::uint32_t>(random_, 0, 100);
      faults.delay_ppm = number<std::uint32_t>(random_, 0, 200);
      faults.delay_us = random_.between(1'000, 300'000);
    }
    return std::make_unique<FaultyStream>(faults);
  }

  template <typename Write>
  void keep(Write write) {
    static Bytes buffer(4U << 20U);
    LogWriter writer(buffer.data(), buffer.size());
    assert_int_equal(write(writer), Status::kOk);
    log.insert(log.end(), writer.data(), writer.data() + writer.size_bytes());
  }

  /// The cycle's time as it is said: it may go back, which the vehicle counts.
  TimeUs said_us() {
    return chance(random_, 99) ? now_us_ : now_us_ - random_.between(0, 2'000'000);
  }

  void cycle() {
    RecordedCycle cycle{said_us(), 100'000, {}};
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      Bytes sent;
      lines_[i].device->advance(now_us_, sent);
      Bytes arrived;
      lines_[i].to_vehicle->pass(now_us_, sent, arrived);
      for (std::size_t at = 0; at < arrived.size();) {
        const auto most = static_cast<std::int64_t>(
            std::min(arrived.size() - at, leadline::firmware::kMaxChunk_bytes));
        const auto size = chance(random_, 80) ? most : random_.between(1, most);
        const auto first = arrived.begin() + static_cast<std::ptrdiff_t>(at);
        const TimeUs late_us = chance(random_, 95) ? 0 : random_.between(-5'000, 100'000);
        cycle.chunks.push_back(
            {static_cast<std::uint8_t>(i), now_us_ - late_us, {first, first + size}});
        at += static_cast<std::size_t>(size);
      }
    }
    if (chance(random_, 3)) {
      cycle.chunks.push_back({leadline::firmware::kUplinkPort, now_us_, uplink()});
    }
    if (chance(random_, 2)) {
      cycle.chunks.push_back({leadline::firmware::kHostPort, now_us_, host_report()});
    }
    if (chance(random_, 1)) {  // bytes that mean nothing, to any port or none
      Bytes noise(number<std::size_t>(random_, 0, 300));
      for (std::uint8_t& byte : noise) {
        byte = number<std::uint8_t>(random_, 0, 255);
      }
      cycle.chunks.push_back({number<std::uint8_t>(random_, 0, 255), now_us_, noise});
    }
    cycle.room_bytes = chance(random_, 90) ? 100'000 : number<std::uint32_t>(random_, 0, 600);
    run(cycle);
  }

  Bytes uplink() {
    std::array<std::uint8_t, leadline::proto::kMaxPayload_bytes> payload{};
    leadline::proto::ResendRequest request{};
    request.survey_tag = leadline::proto::survey_tag(config_.survey_id, config_.session);
    request.range_count = 1;
    request.ranges[0] = {number<std::uint32_t>(random_, 0, 8),
                         number<std::uint32_t>(random_, 1, 8)};
    const auto size =
        leadline::proto::encode_resend_request(request, payload.data(), payload.size());
    assert_true(size.ok());
    Bytes frame(payload.size());
    frame.resize(
        leadline::proto::encode_frame(payload.data(), size.value(), frame.data(), frame.size())
            .value());
    if (chance(random_, 20)) {
      frame[number<std::size_t>(random_, 0, static_cast<std::int64_t>(frame.size()) - 1)] ^= 1;
    }
    return frame;
  }

  Bytes host_report() {
    leadline::firmware::HostReport report{};
    report.cycle_last_us = number<std::uint32_t>(random_, 0, 100'000);
    report.cycle_max_us = 100'000;
    report.port_count = static_cast<std::uint8_t>(config_.port_count);
    for (int i = 0; i < config_.port_count; ++i) {
      report.port_open[i] = number<std::uint8_t>(random_, 0, 1);
      report.opens[i] = number<std::uint16_t>(random_, 0, 3);
    }
    Bytes bytes(leadline::firmware::kMaxHostReport_bytes);
    bytes.resize(leadline::firmware::encode_host_report(report, bytes.data(), bytes.size()));
    return bytes;
  }

  void run(const RecordedCycle& cycle) {
    std::vector<InputChunk> chunks;
    for (const RecordedChunk& chunk : cycle.chunks) {
      chunks.push_back({chunk.t_arrival_us, chunk.bytes.data(),
                        static_cast<std::uint16_t>(chunk.bytes.size()), chunk.port});
    }
    const CycleInput input{cycle.t_us, chunks.data(), chunks.size(), cycle.room_bytes};
    CycleOutput output{};
    vehicle.cycle(input, output);
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      const auto& request = output.device_requests[i];
      if (request.size_bytes > 0) {
        lines_[i].device->take(now_us_, request.data, request.size_bytes);
      }
    }
    keep([&](LogWriter& writer) {
      return leadline::firmware::log_cycle(writer, cycles_, input, output);
    });
    cycles_ += 1;
    last_us_ = cycle.t_us;
  }

  Random& random_;
  VehicleConfig config_;
  std::vector<LocalizationTable> tables_;
  std::vector<Line> lines_;
  bool configured_ = false;
  TimeUs now_us_ = 0;
  TimeUs last_us_ = 0;
  std::uint32_t cycles_ = 0;
};

/// What a flight's log comes to when it is replayed.
LogEnd replayed(const Bytes& log) {
  player.begin();
  for (std::size_t at = 0; at < log.size();) {
    std::size_t used = 0;
    const LogEvent event = player.feed(log.data() + at, log.size() - at, used);
    at += used;
    assert_true(event != LogEvent::kRefused);
    if (event == LogEvent::kConfigured) {
      assert_int_equal(vehicle.configure(player.config(), player.tables(), player.table_count()),
                       Status::kOk);
    } else if (event == LogEvent::kCycle) {
      CycleOutput output{};
      vehicle.cycle(player.input(), output);
    }
  }
  assert_true(player.findings().complete());
  return leadline::firmware::log_end_of(vehicle, player.t_us());
}

int wanted_logs() {
  const char* const said = std::getenv("LEADLINE_RANDOM_LOG_COUNT");
  return said != nullptr ? std::atoi(said) : 12;
}

struct Flown {
  Bytes log;
  LogEnd end{};
};

/// Each is replayed behind another flight than it was flown behind: what a configuration leaves of the one before would
/// show. The first time there is none.
void expect_replay(int k, const Flown& flown) {
  if (flown.log.empty()) {
    return;
  }
  const LogEnd now = replayed(flown.log);
  if (!leadline::firmware::same_results(now, flown.end)) {
    std::printf("log %d of seed %llu replays to something else\n", k,
                static_cast<unsigned long long>(leadline::test::seed()));
  }
  assert_true(leadline::firmware::same_results(now, flown.end));
  assert_int_equal(now.pings_in, flown.end.pings_in);
}

TEST(what_was_flown_is_replayed) {
  const char* const folder = std::getenv("LEADLINE_RANDOM_LOGS");
  const int count = wanted_logs();
  assert_true(count > 0);
  struct Sum {
    std::uint64_t ports = 0;
    std::uint64_t bytes = 0;
    std::uint64_t records = 0;
  };
  std::array<Sum, leadline::firmware::kLastDriver + 1> drivers{};
  std::uint64_t fused = 0;
  std::uint64_t bytes = 0;
  std::uint64_t downlink = 0;
  int refused = 0;
  Flown before;
  for (int k = 0; k < count;) {
    // One stream of chance for each, which is the same however many logs are made.
    const Random streams(static_cast<std::uint64_t>(k) +
                         1'000'000 * static_cast<std::uint64_t>(refused));
    Random random(Random(streams).next(), 0);
    auto flight = Flight::begin(random);
    if (flight == nullptr) {
      refused += 1;
      assert_true(refused < 10 * count);
      continue;
    }
    flight->fly();
    for (int i = 0; i < flight->config().port_count; ++i) {
      Sum& sum = drivers[static_cast<std::size_t>(flight->config().ports[i].driver)];
      sum.ports += 1;
      sum.bytes += vehicle.counters().ports[i].bytes;
      sum.records += vehicle.counters().ports[i].records;
    }
    if (folder != nullptr) {
      char name[64];
      std::snprintf(name, sizeof name, "/%04d.lll", k);
      std::ofstream file(folder + std::string(name), std::ios::binary);
      file.write(reinterpret_cast<const char*>(flight->log.data()),
                 static_cast<std::streamsize>(flight->log.size()));
      assert_true(file.good());
    }
    fused += flight->end.pings_fused;
    bytes += flight->log.size();
    downlink += flight->end.downlink_bytes;
    expect_replay(k - 1, before);
    before = {std::move(flight->log), flight->end};
    k += 1;
  }
  expect_replay(count - 1, before);
  for (std::size_t i = 1; i < drivers.size(); ++i) {
    std::printf("  %-10s %4llu ports %10llu bytes %9llu records\n",
                leadline::firmware::driver_name(static_cast<Driver>(i)),
                static_cast<unsigned long long>(drivers[i].ports),
                static_cast<unsigned long long>(drivers[i].bytes),
                static_cast<unsigned long long>(drivers[i].records));
  }
  std::printf("  %d logs (%d refused), %llu bytes, %llu pings in maps, %llu bytes on links\n",
              count, refused, static_cast<unsigned long long>(bytes),
              static_cast<unsigned long long>(fused), static_cast<unsigned long long>(downlink));
  // Flights that map nothing would be the same everywhere.
  assert_true(fused > 20 * static_cast<std::uint64_t>(count));
  if (count >= 100) {
    for (std::size_t i = 1; i < drivers.size(); ++i) {
      assert_true(drivers[i].records > 0);
    }
  }
}

}  // namespace
