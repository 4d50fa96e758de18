#include "host_tools/topside/receive_command.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <iostream>
#include <memory>

#include <poll.h>
#include <unistd.h>

#include "hal/linux/linux_port.hpp"
#include "hal/linux/port_watch.hpp"
#include "hal/linux/uri.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/export/map_source.hpp"
#include "host_tools/map_output.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/stop_signals.hpp"
#include "host_tools/text.hpp"
#include "host_tools/topside/flight_log.hpp"

namespace leadline::host {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kPoll_ms = 50;
constexpr double kShowEvery_s = 0.5;
// Tiles that miss something are asked for this often; by then the vehicle's own next word may have come.
constexpr double kResendEvery_s = 2.0;
// A whole read of a socket at a time, and no more of them before the clock is looked at.
constexpr std::size_t kRead_bytes = 65536;
constexpr int kReadsPerRound = 64;
// A link that said something and now nothing is told so after this; a slow one after twice its longest
// pause, so that it is not told so over and over.
constexpr double kSilence_s = 10.0;
constexpr double kLongestSilence_s = 120.0;

double now_s() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

std::string fixed_text(double value, int digits) {
  std::string text;
  append_fixed(&text, value, digits);
  return text;
}

const char* severity_word(proto::Severity severity) {
  switch (severity) {
    case proto::Severity::kInfo:
      return "";
    case proto::Severity::kWarning:
      return "warning: ";
    case proto::Severity::kError:
      return "error: ";
  }
  return "";
}

/// The line that a terminal shows, rewritten in place.
class LiveLine {
 public:
  LiveLine() : enabled_(isatty(STDERR_FILENO) == 1) {}
  ~LiveLine() { wipe(); }
  LiveLine(const LiveLine&) = delete;
  LiveLine& operator=(const LiveLine&) = delete;

  void show(const Receiver& receiver, double bytes_per_s) {
    if (!enabled_) {
      return;
    }
    std::cerr << "\r\033[K" << text(receiver, bytes_per_s) << std::flush;
    drawn_ = true;
  }
  void wipe() {
    if (drawn_) {
      std::cerr << "\r\033[K" << std::flush;
    }
    drawn_ = false;
  }

 private:
  static std::string text(const Receiver& receiver, double bytes_per_s) {
    const TileStore* const store = receiver.store();
    if (store == nullptr) {
      return "waiting for a vehicle's hello, " + std::to_string(receiver.counters().bytes) +
             " bytes";
    }
    const double share = 100.0 * static_cast<double>(store->known_cells()) /
                         static_cast<double>(store->grid_cells());
    std::string line = std::to_string(store->known_cells()) + " cells (" + fixed_text(share, 0) +
                       " %), " + std::to_string(store->known_tiles()) + " tiles";
    if (receiver.status()) {
      line += ", " + std::to_string(receiver.status()->pings[proto::kPingFused]) + " pings";
    }
    line += ", " + fixed_text(bytes_per_s, 0) + " B/s, " +
            fixed_text(receiver.bytes_per_changed_cell(), 2) + " B/cell";
    const std::string alarms = receiver.status() ? alarm_text(receiver.status()->alarms) : "";
    return line + (alarms.empty() ? "" : " | " + alarms);
  }

  bool enabled_;
  bool drawn_ = false;
};

void write_results(const std::string& directory, const TileStore& store,
                   const std::string& summary) {
  OutputDir output(directory);
  stage_map(&output, store.elevation(), store.sigma(), hello_reference(store.hello()));
  output.write("receive.json", summary);
  output.commit();
}

/// Folder for the map of a survey that another one replaced.
std::string earlier_name(const std::string& directory, const proto::Hello& hello) {
  return directory + "/survey-" + std::to_string(hello.survey_id) + "-session-" +
         std::to_string(hello.session);
}

class Session {
 public:
  explicit Session(const ReceiveOptions& options)
      : options_(options), receiver_(options.survey_id) {
    if (!options.out_dir.empty()) {
      // Now, not when the dive is over.
      const OutputDir probe(options.out_dir);
    }
    const hal::UriResult uri = hal::parse_uri(options.link_uri);
    if (!uri.ok()) {
      throw HostError(ExitCode::kUsage, "receive: --link: " + uri.error);
    }
    is_file_ = uri.spec.scheme == hal::UriScheme::kFile;
    const std::string problem =
        is_file_ ? "" : hal::device_problem(uri.spec, hal::FileUse::kRead, true);
    if (!problem.empty()) {
      throw HostError(ExitCode::kInput, "receive: --link: " + problem);
    }
    if (is_file_ && access(uri.spec.path.c_str(), R_OK) != 0) {
      throw HostError(ExitCode::kInput, uri.spec.path + ": cannot be read");
    }
    hal::PortResult made = hal::make_port(uri.spec, hal::FileUse::kRead);
    if (!made.port) {
      throw HostError(ExitCode::kUsage, "receive: " + options.link_uri + ": " + made.error);
    }
    port_ = std::move(made.port);
    if (port_->local_port() != 0) {
      std::cerr << "receive: listening at port " << port_->local_port() << "\n";
    }
    receiver_.on_replaced = [this](const TileStore& ended) {
      if (!options_.out_dir.empty() && ended.known_cells() > 0) {
        write_results(earlier_name(options_.out_dir, ended.hello()), ended, summary());
      }
    };
  }

  int run() {
    begin_s_ = last_byte_s_ = shown_s_ = written_s_ = resend_s_ = now_s();
    bool more = true;
    while (more && !StopSignals::stopped()) {
      more = round();
    }
    // What the kernel still holds was sent before the order to stop; a sender that never pauses must not
    // keep us.
    constexpr int kMostReads = 1024;
    for (int i = 0; i < kMostReads && read_some() > 0; ++i) {
    }
    say_notices();
    line_.wipe();
    return finish();
  }

 private:
  /// One look at the port. False: it is over.
  bool round() {
    const std::size_t got = read_some();
    const double now = now_s();
    say_port();
    say_notices();
    say_silence(got > 0, now);
    if (got > 0) {
      last_byte_s_ = now;
    }
    if (now - shown_s_ >= kShowEvery_s) {
      show(now);
    }
    const bool due = options_.every_s > 0.0 && now - written_s_ >= options_.every_s;
    if (StopSignals::take_wish() || due) {
      written_s_ = now;
      write();
    }
    if (!options_.no_resend && !is_file_ && now - resend_s_ >= kResendEvery_s) {
      resend_s_ = now;
      ask_again();
    }
    if (got > 0) {
      return true;
    }
    if (port_->at_end()) {
      return false;
    }
    const double silent_s = now - last_byte_s_;
    const bool came = receiver_.counters().bytes > 0;
    if ((came && options_.idle_s > 0.0 && silent_s >= options_.idle_s) ||
        (!came && options_.wait_s > 0.0 && silent_s >= options_.wait_s)) {
      return false;
    }
    pollfd wanted{port_->poll_fd(), port_->poll_events(), 0};
    (void)poll(&wanted, wanted.fd >= 0 ? 1 : 0, kPoll_ms);
    return true;
  }

  std::size_t read_some() {
    std::size_t sum = 0;
    const auto now_us = static_cast<base::TimeUs>(now_s() * 1e6);
    port_->service(now_us);
    for (int k = 0; k < kReadsPerRound; ++k) {
      base::TimeUs ignored_us = 0;
      const std::size_t got = port_->read(now_us, buffer_.data(), buffer_.size(), ignored_us);
      if (got == 0) {
        break;
      }
      sum += got;
      receiver_.feed(buffer_.data(), got);
    }
    return sum;
  }

  void say(const std::string& text) {
    line_.wipe();
    std::cerr << "receive: " << text << "\n";
  }

  void say_port() {
    const std::string change = is_file_ ? "" : watch_.change(*port_);
    // Whoever listens said so with the port's number.
    if (!change.empty() && port_->local_port() == 0) {
      say(options_.link_uri + ": " + change);
    }
  }

  void say_silence(bool heard, double now) {
    const double silent_s = now - last_byte_s_;
    if (heard && said_silent_) {
      said_silent_ = false;
      say("heard again, after " + fixed_text(silent_s, 0) + " s");
      silence_s_ = std::clamp(2.0 * silent_s, kSilence_s, kLongestSilence_s);
    }
    if (!heard && !said_silent_ && !is_file_ && receiver_.counters().bytes > 0 &&
        silent_s >= silence_s_) {
      said_silent_ = true;
      say("warning: nothing heard for " + fixed_text(silent_s, 0) + " s");
    }
  }

  void say_notices() {
    for (const ReceiverNotice& notice : receiver_.take_notices()) {
      say(severity_word(notice.severity) + printable(notice.text, 300));
    }
  }

  void show(double now) {
    const std::uint64_t bytes = receiver_.counters().bytes;
    line_.show(receiver_, static_cast<double>(bytes - shown_bytes_) / (now - shown_s_));
    shown_s_ = now;
    shown_bytes_ = bytes;
  }

  void ask_again() {
    const std::vector<std::uint8_t> request = receiver_.resend_request();
    if (!request.empty() && port_->write_room() >= request.size()) {
      (void)port_->write(request.data(), request.size());
    }
  }

  void write() {
    if (options_.out_dir.empty() || receiver_.store() == nullptr) {
      return;
    }
    write_results(options_.out_dir, *receiver_.store(), summary());
  }

  [[nodiscard]] std::string summary() const {
    return receive_summary_json(receiver_, vehicle_cells_hash_, now_s() - begin_s_);
  }

  /// What the map has to be by --compare-log; without it by the log that was received, if it was one.
  [[nodiscard]] std::optional<std::uint64_t> expected_cells_hash() const {
    if (options_.log_path.empty()) {
      return receiver_.vehicle_cells_hash();
    }
    FlightLog log(options_.log_path);
    FlightCycle cycle;
    while (log.next(&cycle)) {
    }
    if (!log.end()) {
      throw HostError(ExitCode::kInput,
                      options_.log_path + ": has no end record to compare the map with");
    }
    return log.end()->cells_hash;
  }

  int finish() {
    const ReceiverCounters& counters = receiver_.counters();
    const TileStore* const store = receiver_.store();
    if (store == nullptr) {
      throw HostError(ExitCode::kInput,
                      options_.link_uri + ": no map came: " + std::to_string(counters.bytes) +
                          " bytes, " + std::to_string(counters.frames) + " whole frames, " +
                          std::to_string(counters.damaged_frames) +
                          " damaged, no hello of a vehicle");
    }
    try {
      vehicle_cells_hash_ = expected_cells_hash();
    } catch (const HostError&) {
      write();  // a log that cannot be read does not cost the map
      throw;
    }
    write();
    if (options_.json) {
      std::cout << summary();
    } else {
      print(*store);
    }
    const bool differs = vehicle_cells_hash_ && *vehicle_cells_hash_ != store->cells_hash();
    if (differs) {
      std::cerr << "leadline: error: the map is not the vehicle's: cells_hash="
                << hex_text(store->cells_hash(), 16) << ", the vehicle has "
                << hex_text(*vehicle_cells_hash_, 16) << "\n";
    }
    return static_cast<int>(differs ? ExitCode::kComparisonFailed : ExitCode::kOk);
  }

  void print(const TileStore& store) const {
    const ReceiverCounters& counters = receiver_.counters();
    std::cout << store.known_cells() << " of " << store.grid_cells() << " cells known, "
              << store.known_tiles() << " tiles (" << store.tiles_incomplete() << " incomplete)\n"
              << counters.bytes << " bytes, " << counters.frames << " frames ("
              << counters.damaged_frames << " damaged), "
              << fixed_text(receiver_.bytes_per_changed_cell(), 2) << " bytes per changed cell, "
              << fixed_text(receiver_.bytes_per_changed_cell_all(), 2) << " with all else\n"
              << "cells_hash=" << hex_text(store.cells_hash(), 16);
    if (vehicle_cells_hash_) {
      std::cout << (*vehicle_cells_hash_ == store.cells_hash() ? ", the vehicle's own"
                                                               : ", not the vehicle's");
    }
    std::cout << "\n";
    if (!options_.out_dir.empty()) {
      std::cout << "written to " << options_.out_dir
                << ": depth.asc, sigma.asc, depth.tif, depth.png, receive.json\n";
    }
  }

  const ReceiveOptions& options_;
  Receiver receiver_;
  bool is_file_ = false;
  std::unique_ptr<hal::LinuxPort> port_;
  hal::PortWatch watch_;
  double silence_s_ = kSilence_s;
  bool said_silent_ = false;
  std::vector<std::uint8_t> buffer_ = std::vector<std::uint8_t>(kRead_bytes);
  LiveLine line_;
  std::optional<std::uint64_t> vehicle_cells_hash_;
  double begin_s_ = 0.0;
  double last_byte_s_ = 0.0;
  double shown_s_ = 0.0;
  std::uint64_t shown_bytes_ = 0;
  double written_s_ = 0.0;
  double resend_s_ = 0.0;
};

std::string frame_json(const proto::Hello& hello) {
  const GeoReference reference = hello_reference(hello);
  std::string text;
  if (reference.lat_deg) {
    text += "\"lat\": " + json_number(*reference.lat_deg) +
            ", \"lon\": " + json_number(*reference.lon_deg);
  }
  if (reference.epsg) {
    text +=
        (text.empty() ? "" : ", ") + std::string("\"epsg\": ") + std::to_string(*reference.epsg);
  }
  return "{" + text + "}";
}

}  // namespace

std::string receive_summary_json(const Receiver& receiver,
                                 const std::optional<std::uint64_t>& vehicle_cells_hash,
                                 double seconds) {
  const ReceiverCounters& counters = receiver.counters();
  const TileStore* const store = receiver.store();
  std::string text = "{\n  \"seconds\": " + json_number(std::round(seconds * 1e3) / 1e3);
  const auto add = [&text](const char* key, const std::string& value) {
    text += std::string(",\n  \"") + key + "\": " + value;
  };
  if (store != nullptr) {
    add("survey_id", std::to_string(store->hello().survey_id));
    add("session", std::to_string(store->hello().session));
    add("cell_m", json_number(store->hello().cell_mm / 1000.0));
    add("cells", std::to_string(store->grid_cells()));
    add("known_cells", std::to_string(store->known_cells()));
    add("known_tiles", std::to_string(store->known_tiles()));
    add("incomplete_tiles", std::to_string(store->tiles_incomplete()));
    add("cells_hash", "\"" + hex_text(store->cells_hash(), 16) + "\"");
    add("topside_equals_vehicle",
        !vehicle_cells_hash ? "null"
                            : (*vehicle_cells_hash == store->cells_hash() ? "true" : "false"));
    add("frame", frame_json(store->hello()));
  }
  add("bytes", std::to_string(counters.bytes));
  add("frames", std::to_string(counters.frames));
  add("damaged_frames", std::to_string(counters.damaged_frames));
  add("malformed", std::to_string(counters.malformed));
  add("unknown_types", std::to_string(counters.unknown_types));
  add("other_surveys", std::to_string(counters.other_surveys));
  add("before_hello", std::to_string(counters.before_hello));
  add("deltas", std::to_string(counters.deltas));
  add("delta_bytes", std::to_string(counters.delta_bytes));
  add("delta_cells", std::to_string(counters.delta_cells));
  add("repeated_cells", std::to_string(counters.repeated_cells));
  add("bytes_per_changed_cell", json_number(receiver.bytes_per_changed_cell()));
  add("bytes_per_changed_cell_all", json_number(receiver.bytes_per_changed_cell_all()));
  if (receiver.status()) {
    add("pings", std::to_string(receiver.status()->pings[proto::kPingFused]));
    add("alarms", json_string(alarm_text(receiver.status()->alarms)));
  }
  return text + "\n}\n";
}

int run_receive(const ReceiveOptions& options) {
  const StopSignals signals;
  return Session(options).run();
}

}  // namespace leadline::host
