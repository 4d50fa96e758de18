#include "host_tools/probe/probe.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <iostream>
#include <memory>

#include <poll.h>

#include "firmware/config/port_section.hpp"
#include "hal/linux/linux_port.hpp"
#include "host_tools/decode/decoder.hpp"
#include "host_tools/decode/record_json.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/options.hpp"
#include "host_tools/stop_signals.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

using firmware::Driver;
using nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kRead_bytes = 65'536;
constexpr std::size_t kRequest_bytes = 512;
constexpr int kWait_ms = 10;
constexpr std::int32_t kSoundSpeed_mm_s = 1'500'000;
constexpr std::int64_t kNearest_um = 500'000;
// How long a device has for its first record: settings, a ping, its answer.
constexpr base::TimeUs kTurn_us = 2'000'000;
// Scanners find their zero first, and a profiler sends whole sweeps.
constexpr base::TimeUs kScannerTurn_us = 15'000'000;

struct Question {
  Driver driver;
  std::int32_t variant_plus_1;
  std::string name;  ///< for people
};

/// Where its device's protocol is the only one, or none.
bool may_be_at(Driver driver, hal::UriScheme scheme, bool chosen) {
  switch (scheme) {
    case hal::UriScheme::kCan:
      return driver == Driver::kNmea2000;
    case hal::UriScheme::kModbusRtu:
    case hal::UriScheme::kModbusTcp:
      return driver == Driver::kKeller;
    case hal::UriScheme::kGpio:
      return driver == Driver::kLine;
    default:
      // CAN frames and a line's letters have no mark of their own: any bytes could be some.
      return (driver != Driver::kNmea2000 && driver != Driver::kLine) || chosen;
  }
}

std::vector<Driver> candidates(const ProbeOptions& options, const hal::UriSpec& uri) {
  const bool chosen = !options.driver.empty();
  const Driver only = chosen ? driver_named(options.driver, "probe: --driver") : Driver::kNone;
  std::vector<Driver> found;
  for (const firmware::DriverInfo& info : firmware::kDrivers) {
    const bool wanted = !chosen || info.driver == only;
    if (wanted && firmware::driver_enabled(info.driver) &&
        may_be_at(info.driver, uri.scheme, chosen)) {
      found.push_back(info.driver);
    }
  }
  if (found.empty()) {
    usage_error(options.driver + " does not talk at " + hal::uri_text(uri));
  }
  return found;
}

std::vector<Question> questions(const std::vector<Driver>& drivers, const hal::UriSpec& uri,
                                const std::string& model) {
  const bool modbus =
      uri.scheme == hal::UriScheme::kModbusRtu || uri.scheme == hal::UriScheme::kModbusTcp;
  std::vector<Question> all;
  for (const Driver driver : drivers) {
    if (!silent_unless_asked(driver)) {
      continue;
    }
    const std::vector<std::string> names = variant_names(driver);
    const std::string name = firmware::driver_name(driver);
    if (names.empty() || (driver == Driver::kKeller && modbus)) {
      all.push_back({driver, 0, name});
      continue;
    }
    // The first of a head's models is to listen, or to find out; both buses of a Keller are asked.
    for (std::size_t i = driver == Driver::kKeller ? 0 : 1; i < names.size(); ++i) {
      if (model.empty() || model == names[i]) {
        all.push_back({driver, static_cast<std::int32_t>(i) + 1, name + " " + names[i]});
      }
    }
  }
  return all;
}

base::TimeUs turn_us(Driver driver) {
  return driver == Driver::kPing360 || driver == Driver::kTritech ? kScannerTurn_us : kTurn_us;
}

hal::UriSpec uri_of(const ProbeOptions& options) {
  const hal::UriResult parsed = hal::parse_uri(options.uri);
  if (!parsed.ok()) {
    usage_error(parsed.error);
  }
  const hal::UriSpec& spec = parsed.spec;
  if (spec.scheme == hal::UriScheme::kGpio && spec.output) {
    usage_error(options.uri + ": nothing comes from an output");
  }
  const bool modbus =
      spec.scheme == hal::UriScheme::kModbusRtu || spec.scheme == hal::UriScheme::kModbusTcp;
  if (modbus && !options.ask) {
    usage_error(options.uri + ": a Modbus device says nothing unless asked: --ask");
  }
  if (options.ask && spec.scheme == hal::UriScheme::kFile) {
    usage_error("--ask: a file does not answer");
  }
  const std::string problem = hal::device_problem(spec, hal::FileUse::kRead, false);
  if (!problem.empty()) {
    throw HostError(ExitCode::kInput, "probe: " + problem);
  }
  return spec;
}

class Probe {
 public:
  explicit Probe(const ProbeOptions& options)
      : options_(options),
        uri_(uri_of(options)),
        start_(Clock::now()),
        // As recordings have it, and steady.
        start_us_(std::chrono::duration_cast<std::chrono::microseconds>(
                      std::chrono::system_clock::now().time_since_epoch())
                      .count()) {
    const std::vector<Driver> drivers = candidates(options, uri_);
    questions_ = options.ask ? questions(drivers, uri_, options.model) : std::vector<Question>{};
    if (options.ask && questions_.empty()) {
      usage_error("--ask: there is nobody to be asked" +
                  (options.model.empty() ? ": " + options.driver + " talks by itself"
                                         : " of model " + printable(options.model)));
    }
    for (const Driver driver : drivers) {
      listeners_.push_back(std::make_unique<Decoder>(driver, [this, driver](const auto& record) {
        // Who is asked says it with the device's settings.
        if (asked_ == nullptr || asked_->driver() != driver) {
          print(driver, record);
        }
      }));
    }
    hal::PortResult made = hal::make_port(uri_, hal::FileUse::kRead);
    if (!made.port) {
      throw HostError(ExitCode::kInput, "probe: " + options.uri + ": " + made.error);
    }
    port_ = std::move(made.port);
    if (port_->local_port() != 0) {
      std::cerr << "probe: listening at port " << port_->local_port() << std::endl;
    }
  }

  void run() {
    for (std::size_t i = 0; i < questions_.size() && !over() && !answered(); ++i) {
      ask(questions_[i]);
    }
    if (!answered()) {
      asked_.reset();
    }
    listen(static_cast<base::TimeUs>(options_.seconds * 1e6), options_.seconds == 0.0);
    if (port_->at_end()) {
      for (const auto& listener : listeners_) {
        listener->finish();
      }
    }
  }

  /// False: nobody found an intact frame.
  [[nodiscard]] bool report() const {
    bool found = false;
    for (const auto& listener : listeners_) {
      const bool replaced = asked_ != nullptr && asked_->driver() == listener->driver();
      found = report_one(replaced ? *asked_ : *listener) || found;
    }
    return found;
  }

  [[nodiscard]] std::uint64_t bytes_in() const { return port_->counters().bytes_in; }
  [[nodiscard]] bool opened() const { return port_->counters().opens > 0; }

 private:
  [[nodiscard]] base::TimeUs now_us() const {
    return start_us_ +
           std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - start_).count();
  }
  [[nodiscard]] bool over() const { return StopSignals::stopped() || port_->at_end(); }
  [[nodiscard]] bool answered() const { return asked_ != nullptr && asked_->records() > 0; }

  void print(Driver driver, const ordered_json& record) const {
    const char* const name = firmware::driver_name(driver);
    if (!options_.json) {
      std::cout << name << ": " << record_text(record) << '\n';
      return;
    }
    ordered_json line;
    line["driver"] = name;
    line.update(record);
    std::cout << line.dump() << '\n';
  }

  void ask(const Question& question) {
    firmware::PortConfig config = default_port(question.driver, uri_);
    config.variant_plus_1 = question.variant_plus_1;
    config.min_range_um = kNearest_um;
    config.max_range_um = static_cast<std::int64_t>(std::llround(options_.max_range_m * 1e6));
    asked_ = std::make_unique<Decoder>(
        config, firmware::DeviceSetup{kSoundSpeed_mm_s},
        [this, driver = question.driver](const auto& record) { print(driver, record); });
    std::cerr << "probe: asking " << question.name << std::endl;
    const base::TimeUs until_us = now_us() + turn_us(question.driver);
    while (!over() && !answered() && now_us() < until_us) {
      round();
    }
  }

  void listen(base::TimeUs duration_us, bool forever) {
    const base::TimeUs until_us = now_us() + duration_us;
    while (!over() && (forever || now_us() < until_us)) {
      round();
    }
  }

  /// One look at the port.
  void round() {
    port_->service(now_us());
    send_request();
    base::TimeUs t_arrival_us = 0;
    const std::size_t got = port_->read(now_us(), buffer_.data(), buffer_.size(), t_arrival_us);
    if (got == 0) {
      wait();
      return;
    }
    for (const auto& listener : listeners_) {
      listener->feed(buffer_.data(), got, t_arrival_us);
    }
    if (asked_ != nullptr) {
      asked_->feed(buffer_.data(), got, t_arrival_us);
    }
    std::cout.flush();
  }

  void send_request() {
    if (asked_ == nullptr || port_->state() != hal::PortState::kOpen) {
      return;
    }
    std::array<std::uint8_t, kRequest_bytes> request{};
    const std::size_t size = asked_->request(now_us(), request.data(), request.size());
    if (size > 0) {
      (void)port_->write(request.data(), size);
    }
  }

  void wait() const {
    pollfd wanted{port_->poll_fd(), port_->poll_events(), 0};
    (void)poll(&wanted, wanted.fd >= 0 ? 1 : 0, kWait_ms);
  }

  /// False, and nothing said, of those that found no intact frame, or one or two without a value among bytes
  /// of something else: short checksums agree with anything now and then.
  [[nodiscard]] bool report_one(const Decoder& decoder) const {
    const ordered_json summary = decoder.summary(nullptr);
    const bool strange = summary["skipped_bytes"].get<std::uint64_t>() >
                         summary["bytes"].get<std::uint64_t>() / 10 * 9;
    if (decoder.records() == 0 && (summary["frames"] == 0 || strange)) {
      return false;
    }
    if (options_.json) {
      std::cout << summary.dump() << '\n';
    } else {
      std::cout << firmware::driver_name(decoder.driver()) << ": " << summary["frames"]
                << " intact frames, " << decoder.records() << " records; rejected "
                << summary["rejected"].dump() << ", skipped " << summary["skipped_bytes"] << " of "
                << summary["bytes"] << " bytes\n";
    }
    return true;
  }

  const ProbeOptions& options_;
  hal::UriSpec uri_;
  Clock::time_point start_;
  base::TimeUs start_us_;
  std::vector<Question> questions_;
  std::vector<std::unique_ptr<Decoder>> listeners_;
  std::unique_ptr<Decoder> asked_;
  std::unique_ptr<hal::LinuxPort> port_;
  std::array<std::uint8_t, kRead_bytes> buffer_{};
};

/// What to try next.
std::string advice(const ProbeOptions& options, const Probe& probe) {
  if (!probe.opened()) {
    return "the port did not open";
  }
  const std::string bytes = std::to_string(probe.bytes_in()) + " bytes came";
  if (probe.bytes_in() > 0) {
    return bytes + ": another rate, or a device without a driver?";
  }
  return bytes + (options.ask ? "" : "; a device that waits to be asked needs --ask");
}

}  // namespace

int run_probe(const ProbeOptions& options) {
  check_limits("--seconds", options.seconds, {0, 1e6}, "0 = no end");
  check_limits("--max-range", options.max_range_m, {1, 300}, "metres");
  const StopSignals signals;
  const auto probe = std::make_unique<Probe>(options);
  probe->run();
  if (!probe->report()) {
    throw HostError(ExitCode::kInput, "probe: " + printable(options.uri) +
                                          ": nothing recognised; " + advice(options, *probe));
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
