#include "host_tools/emulate/device_command.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <iostream>
#include <memory>
#include <thread>
#include <vector>

#include "firmware/config/port_section.hpp"
#include "hal/emu/faulty_stream.hpp"
#include "hal/linux/linux_port.hpp"
#include "hal/linux/pty_pair.hpp"
#include "host_tools/decode/decoder.hpp"
#include "host_tools/emulate/lone_devices.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/options.hpp"
#include "host_tools/stop_signals.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

using firmware::Driver;

// Bytes for a stream that its other end does not take; more are lost, as on a line without flow control.
constexpr std::size_t kMostWaiting_bytes = 262'144;
constexpr std::size_t kRead_bytes = 4096;

base::TimeUs monotonic_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

Driver device_named(const std::string& name) {
  const Driver driver = driver_named(name, "emulate: device");
  if (!has_lone_device(driver)) {
    usage_error("device " + name + ": has no emulated side; these have: " + lone_device_names());
  }
  return driver;
}

/// Position in variant_names(). The first of them is no device: the codec listens, or finds out.
std::size_t model_named(Driver driver, const std::string& name) {
  const std::vector<std::string> names = variant_names(driver);
  const bool models = driver != Driver::kKeller && !names.empty();  // of a Keller: its two buses
  if (name.empty()) {
    return 1;
  }
  if (!models) {
    usage_error("--model " + printable(name) + ": there is one kind of " + driver_name(driver));
  }
  const auto found = std::find(names.begin() + 1, names.end(), name);
  if (found == names.end()) {
    std::string all;
    for (std::size_t i = 1; i < names.size(); ++i) {
      all += (i > 1 ? ", " : "") + names[i];
    }
    usage_error("--model " + printable(name) + ": must be one of " + all);
  }
  return static_cast<std::size_t>(found - names.begin());
}

/// The device's end of the line.
class DeviceLine {
 public:
  DeviceLine(const std::string& uri, Driver driver) {
    constexpr const char* kPty = "pty:";
    if (uri.rfind(kPty, 0) == 0) {
      open_pty(uri.substr(4));
      return;
    }
    const hal::UriResult parsed = hal::parse_uri(uri);
    if (!parsed.ok()) {
      usage_error("--port: " + parsed.error + "; or pty:, pty:LINK for a serial line of its own");
    }
    check_scheme(parsed.spec, driver);
    hal::PortResult made = hal::make_port(parsed.spec, hal::FileUse::kWrite);
    if (!made.port) {
      throw HostError(ExitCode::kOutput, "emulate: --port " + printable(uri) + ": " + made.error);
    }
    made_ = std::move(made.port);
    port_ = made_.get();
    where_ = hal::uri_text(parsed.spec);
    if (parsed.spec.listen && port_->local_port() != 0) {
      hal::UriSpec got = parsed.spec;
      got.port = port_->local_port();
      where_ = hal::uri_text(got);
    }
  }

  [[nodiscard]] const std::string& where() const { return where_; }
  [[nodiscard]] std::uint64_t lost_bytes() const { return lost_bytes_; }

  std::size_t read(std::uint8_t* out, std::size_t capacity) {
    base::TimeUs ignored_us = 0;
    return port_->read(monotonic_us(), out, capacity, ignored_us);
  }

  /// Bytes that leave the device together: one datagram, where there are such.
  void send(const emu::Bytes& bytes) {
    if (bytes.empty()) {
      return;
    }
    if (port_->datagrams()) {
      send_datagrams(bytes);
      return;
    }
    if (waiting_.size() + bytes.size() > kMostWaiting_bytes) {
      lost_bytes_ += bytes.size();
      return;
    }
    waiting_.insert(waiting_.end(), bytes.begin(), bytes.end());
    flush();
  }

  void service() {
    port_->service(monotonic_us());
    flush();
  }

  /// Gives the other end a moment to take what was sent.
  void drain() {
    constexpr base::TimeUs kMoment_us = 500'000;
    const base::TimeUs until_us = monotonic_us() + kMoment_us;
    service();
    while (waiting_.size() + port_->pending_out_bytes() > 0 && monotonic_us() < until_us) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      service();
    }
    lost_bytes_ += waiting_.size() + port_->pending_out_bytes();
  }

 private:
  void open_pty(const std::string& link) {
    pty_ = std::make_unique<hal::PtyPair>(link);
    if (!pty_->error().empty()) {
      throw HostError(ExitCode::kOutput, "emulate: --port pty: " + pty_->error());
    }
    port_ = &pty_->port();
    where_ = "serial:" + pty_->path();
  }

  static void check_scheme(const hal::UriSpec& spec, Driver driver) {
    const bool bus =
        spec.scheme == hal::UriScheme::kModbusRtu || spec.scheme == hal::UriScheme::kModbusTcp;
    if (bus) {
      usage_error(
          "--port: a Modbus port is a master's; the device is at the line's other end: "
          "pty: or serial:");
    }
    if (spec.scheme == hal::UriScheme::kGpio) {
      usage_error("--port: no device talks on a gpio line");
    }
    if (spec.scheme == hal::UriScheme::kCan && driver != Driver::kNmea2000) {
      usage_error(std::string("--port: only nmea2000 talks on a CAN bus, not ") +
                  driver_name(driver));
    }
    const std::string problem = hal::device_problem(spec, hal::FileUse::kWrite, true);
    if (!problem.empty()) {
      throw HostError(ExitCode::kOutput, "emulate: --port: " + problem);
    }
  }

  void send_datagrams(const emu::Bytes& bytes) {
    std::size_t at = 0;
    while (at < bytes.size()) {
      const std::size_t size = std::min(bytes.size() - at, port_->write_room());
      if (size == 0) {
        lost_bytes_ += bytes.size() - at;  // nobody there
        return;
      }
      const std::size_t taken = port_->write(bytes.data() + at, size);
      lost_bytes_ += size - taken;
      at += size;
    }
  }

  void flush() {
    const std::size_t size = std::min(waiting_.size(), port_->write_room());
    const std::size_t taken = size > 0 ? port_->write(waiting_.data(), size) : 0;
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(taken));
  }

  std::unique_ptr<hal::PtyPair> pty_;
  std::unique_ptr<hal::LinuxPort> made_;
  hal::LinuxPort* port_ = nullptr;
  std::string where_;
  emu::Bytes waiting_;
  std::uint64_t lost_bytes_ = 0;
};

std::uint32_t share_ppm(double share, const char* option) {
  check_limits(option, share, {0, 1}, "a share of the bytes");
  return static_cast<std::uint32_t>(std::lround(share * 1e6));
}

emu::FaultConfig faults_of(const EmulateDeviceOptions& options) {
  emu::FaultConfig faults;
  faults.seed = options.seed;
  faults.drop_ppm = share_ppm(options.drop, "--drop");
  faults.corrupt_ppm = share_ppm(options.corrupt, "--corrupt");
  return faults;
}

void check(const EmulateDeviceOptions& options) {
  const DeviceScene& scene = options.scene;
  check_limits("--speed", options.speed, {0, 1e4, true});
  check_limits("--seconds", options.seconds, {0, 1e6}, "0 = no end");
  check_limits("--bottom", scene.bottom_m, {0.3, 100}, "metres below the device");
  check_limits("--depth", scene.depth_m, {0, 11'000}, "metres");
  check_limits("--roll", scene.attitude.roll_deg, {-60, 60}, "degrees");
  check_limits("--pitch", scene.attitude.pitch_deg, {-60, 60}, "degrees");
  check_limits("--heading", scene.attitude.heading_deg, {-360, 360}, "degrees");
  check_limits("--swing", scene.swing_deg, {0, 20}, "degrees");
}

class DeviceRun {
 public:
  explicit DeviceRun(const EmulateDeviceOptions& options)
      : options_(options),
        driver_(device_named(options.device)),
        device_(make_lone_device(driver_, model_named(driver_, options.model), options.scene)),
        faults_(faults_of(options)),
        line_(options.port_uri, driver_) {}

  void run() {
    std::cerr << "emulate: " << options_.device << " at " << line_.where()
              << (silent_unless_asked(driver_) ? ", waits to be asked" : "") << std::endl;
    const base::TimeUs begin_us = monotonic_us();
    const auto end_us = static_cast<base::TimeUs>(options_.seconds * 1e6);
    while (!StopSignals::stopped() && (end_us == 0 || now_us_ < end_us)) {
      const auto real_us = static_cast<double>(monotonic_us() - begin_us);
      const auto target_us = static_cast<base::TimeUs>(real_us * options_.speed);
      step(end_us == 0 ? target_us : std::min(target_us, end_us));
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    line_.drain();
  }

  void print_summary() const {
    const emu::FaultCounters& counters = faults_.counters();
    std::string text = options_.device + ": " + std::to_string(counters.bytes_in) + " bytes in ";
    append_fixed(&text, static_cast<double>(now_us_) * 1e-6, 1);
    std::cout << text << " s, " << counters.dropped << " dropped, " << counters.corrupted
              << " corrupted, " << line_.lost_bytes() << " that nobody took\n";
  }

 private:
  void step(base::TimeUs until_us) {
    std::array<std::uint8_t, kRead_bytes> heard{};
    line_.service();
    const std::size_t got = line_.read(heard.data(), heard.size());
    if (got > 0) {
      device_->take(now_us_, heard.data(), got);
    }
    // From one event to the next: what leaves at one instant goes out together.
    while (now_us_ < until_us) {
      now_us_ = std::clamp(device_->next_event_us(), now_us_ + 1, until_us);
      emu::Bytes sent;
      device_->advance(now_us_, sent);
      emu::Bytes arrived;
      faults_.pass(now_us_, sent, arrived);
      line_.send(arrived);
    }
  }

  const EmulateDeviceOptions& options_;
  Driver driver_;
  std::unique_ptr<emu::EmulatedDevice> device_;
  emu::FaultyStream faults_;
  DeviceLine line_;
  base::TimeUs now_us_ = 0;
};

}  // namespace

int run_emulate_device(const EmulateDeviceOptions& options) {
  check(options);
  const StopSignals signals;
  DeviceRun run(options);
  run.run();
  run.print_summary();
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
