#include "host_tools/topside/receive_command.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>

#include "host_tools/exit_codes.hpp"
#include "host_tools/export/map_source.hpp"
#include "host_tools/stop_signals.hpp"
#include "host_tools/store/live_store.hpp"
#include "host_tools/text.hpp"
#include "host_tools/topside/flight_log.hpp"
#include "host_tools/topside/link_reader.hpp"
#include "host_tools/topside/live_line.hpp"
#include "host_tools/topside/live_output.hpp"
#include "host_tools/topside/silence_watch.hpp"

namespace leadline::host {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kShowEvery_s = 0.5;

double now_s() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

std::string fixed_text(double value, int digits) {
  std::string text;
  append_fixed(&text, value, digits);
  return text;
}

class Session {
 public:
  explicit Session(const ReceiveOptions& options)
      : options_(options),
        receiver_(options.survey_id),
        link_(options.link_uri, "receive"),
        output_(options.out_dir, [this](const std::string& text) { say(text); }) {
    if (link_.local_port() != 0) {
      std::cerr << "receive: listening at port " << link_.local_port() << "\n";
    }
    if (!options.share_path.empty()) {
      link_.share(options.share_path);
    }
    if (!options.store_path.empty()) {
      store_.emplace(options.store_path, [this](const std::string& text) { say(text); });
    }
    receiver_.on_begun = [this](TileStore& begun) {
      if (store_) {
        store_->begin(&begun, [this] { link_.hold(now_s()); });
      }
    };
    receiver_.on_replaced = [this](const TileStore& ended) {
      if (store_) {
        store_->end(ended);
      }
      output_.write_ended(ended, summary());
    };
  }

  int run() {
    begin_s_ = last_byte_s_ = shown_s_ = written_s_ = now_s();
    bool more = true;
    while (more && !StopSignals::stopped()) {
      more = round();
    }
    // What the kernel still holds was sent before the order to stop; a sender that never pauses must not
    // keep us.
    constexpr int kMostReads = 1024;
    for (int i = 0; i < kMostReads && link_.read_some(&receiver_, now_s()) > 0; ++i) {
    }
    say_notices();
    line_.wipe();
    return finish();
  }

 private:
  /// One look at the port. False: it is over.
  bool round() {
    const std::size_t got = link_.read_some(&receiver_, now_s());
    const double now = now_s();
    say_port();
    say_notices();
    const auto silence = silence_.follow(got > 0, now);
    if (silence && !link_.is_file()) {
      say(severity_word(silence->severity) + silence->text);
    }
    if (got > 0) {
      last_byte_s_ = now;
    }
    if (now - shown_s_ >= kShowEvery_s) {
      show(now);
    }
    if (store_ && receiver_.store() != nullptr) {
      store_->follow(*receiver_.store(), now);
    }
    const bool due = options_.every_s > 0.0 && now - written_s_ >= options_.every_s;
    if (StopSignals::take_wish() || due) {
      written_s_ = now;
      write();
    }
    if (!options_.no_resend) {
      link_.ask_again(&receiver_, now);
    }
    if (got > 0) {
      return true;
    }
    if (link_.at_end()) {
      return false;
    }
    const double silent_s = now - last_byte_s_;
    const bool came = receiver_.counters().bytes > 0;
    if ((came && options_.idle_s > 0.0 && silent_s >= options_.idle_s) ||
        (!came && options_.wait_s > 0.0 && silent_s >= options_.wait_s)) {
      return false;
    }
    link_.wait(kUplinkPoll_us / 1000);
    return true;
  }

  void say(const std::string& text) {
    line_.wipe();
    std::cerr << "receive: " << text << "\n";
  }

  void say_port() {
    const std::string change = link_.port_change();
    if (!change.empty()) {
      say(change);
    }
  }

  void say_notices() {
    for (const ReceiverNotice& notice : receiver_.take_notices()) {
      say(severity_word(notice.severity) + printable(notice.text, 300));
    }
  }

  void show(double now) {
    const std::uint64_t bytes = receiver_.counters().bytes;
    line_.show(live_text(receiver_, static_cast<double>(bytes - shown_bytes_) / (now - shown_s_)));
    shown_s_ = now;
    shown_bytes_ = bytes;
  }

  void write() {
    if (receiver_.store() != nullptr) {
      output_.write(*receiver_.store(), summary());
    }
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
    if (store_) {
      store_->keep(*store);
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
    output_.require_whole();
    if (store_) {
      store_->require_whole();
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
              << fixed_text(receiver_.bytes_per_changed_cell_all(), 2) << " with all else\n";
    if (const auto work = receiver_.work_share()) {
      std::cout << "largest cycle " << receiver_.status()->work_max_voxels << " voxels, "
                << fixed_text(100.0 * *work, 1) << " % of the bound of "
                << receiver_.status()->work_bound_voxels << "\n";
    }
    std::cout << "cells_hash=" << hex_text(store.cells_hash(), 16);
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
  std::optional<LiveStore> store_;
  LinkReader link_;
  LiveOutput output_;
  SilenceWatch silence_;
  LiveLine line_;
  std::optional<std::uint64_t> vehicle_cells_hash_;
  double begin_s_ = 0.0;
  double last_byte_s_ = 0.0;
  double shown_s_ = 0.0;
  std::uint64_t shown_bytes_ = 0;
  double written_s_ = 0.0;
};

std::string frame_json(const proto::Hello& hello) {
  const GeoReference reference = hello_reference(hello);
  std::string text;
  if (reference.lat_deg) {
    text += "\"lat\": " + json_number(*reference.lat_deg) +
            ", \"lon\": " + json_number(*reference.lon_deg);
  }
  const auto add = [&text](const char* key, const std::string& value) {
    text += (text.empty() ? "\"" : ", \"") + std::string(key) + "\": " + value;
  };
  if (reference.epsg) {
    add("epsg", std::to_string(*reference.epsg));
  }
  if (reference.vertical_datum) {
    add("vertical_datum", json_string(*reference.vertical_datum));
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
    if (const auto name = hello_reference(store->hello()).survey_name) {
      add("survey_name", json_string(*name));
    }
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
  add("coarse_deltas", std::to_string(counters.coarse_deltas));
  add("delta_bytes", std::to_string(counters.delta_bytes));
  add("delta_cells", std::to_string(counters.delta_cells));
  add("repeated_cells", std::to_string(counters.repeated_cells));
  add("bytes_per_changed_cell", json_number(receiver.bytes_per_changed_cell()));
  add("bytes_per_changed_cell_all", json_number(receiver.bytes_per_changed_cell_all()));
  if (receiver.status()) {
    add("pings", std::to_string(receiver.status()->pings[proto::kPingFused]));
    add("work_last_voxels", std::to_string(receiver.status()->work_last_voxels));
    add("work_max_voxels", std::to_string(receiver.status()->work_max_voxels));
    add("work_bound_voxels", std::to_string(receiver.status()->work_bound_voxels));
    add("alarms", json_string(alarm_text(receiver.status()->alarms)));
  }
  return text + "\n}\n";
}

int run_receive(const ReceiveOptions& options) {
  const StopSignals signals;
  return Session(options).run();
}

}  // namespace leadline::host
