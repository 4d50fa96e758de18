#include "host_tools/monitor/monitor_command.hpp"

#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <utility>

#include "hal/linux/uri.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/monitor/live_map.hpp"
#include "host_tools/monitor/page_messages.hpp"
#include "host_tools/monitor/page_state.hpp"
#include "host_tools/monitor/player.hpp"
#include "host_tools/monitor/track.hpp"
#include "host_tools/monitor/web_access.hpp"
#include "host_tools/monitor/web_server.hpp"
#include "host_tools/stop_signals.hpp"
#include "host_tools/store/live_store.hpp"
#include "host_tools/store/survey_store.hpp"
#include "host_tools/text.hpp"
#include "host_tools/topside/link_reader.hpp"
#include "host_tools/topside/live_line.hpp"
#include "host_tools/topside/live_output.hpp"
#include "host_tools/topside/receive_command.hpp"
#include "host_tools/topside/receiver.hpp"
#include "host_tools/topside/silence_watch.hpp"

namespace leadline::host {
namespace {

using Clock = std::chrono::steady_clock;

// The link is looked at this often; between, the page is served.
constexpr int kRound_ms = 20;
constexpr double kStateEvery_s = 0.25;
constexpr double kShowEvery_s = 0.5;

double now_s() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

/// Path of a recording or of a stored survey; nothing for a link that is live (a named pipe is).
std::optional<std::string> file_path(const MonitorOptions& options) {
  if (options.link_uri.empty() == options.map_path.empty()) {
    throw HostError(
        ExitCode::kUsage,
        "monitor: give --link URI for a vehicle, or the FILE of a recording or a store");
  }
  if (!options.map_path.empty()) {
    return options.map_path;
  }
  const hal::UriResult parsed = hal::parse_uri(options.link_uri);
  std::error_code error;
  if (!parsed.ok() || parsed.spec.scheme != hal::UriScheme::kFile ||
      !(std::filesystem::is_regular_file(parsed.spec.path, error) ||
        is_store_path(parsed.spec.path))) {
    return std::nullopt;
  }
  return parsed.spec.path;
}

/// A file is looked at: what is said of a link, or keeps what it brings, has no meaning then.
void refuse_link_options(const MonitorOptions& options, const std::string& path, bool stored) {
  const auto refuse = [&path](bool given, const char* option, const std::string& why) {
    if (given) {
      throw HostError(ExitCode::kUsage, std::string(option) + ": " + path + why);
    }
  };
  refuse(!options.share_path.empty(), "--share", " is no link to share");
  if (!stored) {
    refuse(!options.store_path.empty(), "--store",
           " is played; receive brings a recording into a store");
    return;
  }
  refuse(!options.store_path.empty(), "--store", " is a stored survey already");
  refuse(!options.out_dir.empty(), "--out", " is a stored survey: store export writes it out");
  refuse(options.speed > 0.0, "--speed", " is a stored survey: it has no time");
  refuse(options.budget_bytes_s > 0.0, "--budget", " is a stored survey and no link");
}

class Monitor {
 public:
  explicit Monitor(const MonitorOptions& options) : options_(options) {
    const WebAddress address = parse_web_address(options.http);
    if (const std::optional<std::string> path = file_path(options)) {
      refuse_link_options(options, *path, is_store_path(*path));
      if (is_store_path(*path)) {
        show_stored(*path);
      } else {
        player_.emplace(*path, options.speed);
      }
    } else {
      link_.emplace(options.link_uri, "monitor");
      if (!options.share_path.empty()) {
        link_->share(options.share_path);
      }
      if (!options.store_path.empty()) {
        store_.emplace(options.store_path, [this](const std::string& text) { say(text); });
      }
    }
    output_.emplace(options.out_dir, [this](const std::string& text) { say(text); });
    begin_receiver();
    server_.emplace(address,
                    WebServer::Handlers{[this] { return content(); },
                                        [this](const PageRequest& request) { take(request); }});
    if (link_ && link_->local_port() != 0) {
      std::cerr << "monitor: listening at port " + std::to_string(link_->local_port()) + "\n";
    }
    std::cerr << "monitor: the page is at http://" << web_authority({address.host, server_->port()})
              << "/\n";
  }

  int run() {
    begin_s_ = shown_s_ = now_s();
    while (!StopSignals::stopped()) {
      round(now_s());
      server_->wake();
      const bool more = player_ ? player_->seeking() : flooded_;
      server_->run_for(more ? 0 : kRound_ms);
    }
    line_.wipe();
    if (store_ && receiver_->store() != nullptr) {
      store_->keep(*receiver_->store());
    }
    write();
    output_->require_whole();
    if (store_) {
      store_->require_whole();
    }
    return static_cast<int>(ExitCode::kOk);
  }

 private:
  /// Read-only, and once: what another program saves meanwhile is in the next one that is started.
  void show_stored(const std::string& path) {
    stored_.emplace(open_survey(path));
    stored_path_ = path;
    if (stored_->load.damaged_tiles > 0) {
      say("warning: " + path + ": " + std::to_string(stored_->load.damaged_tiles) +
          " damaged tiles are left out");
    }
    map_.follow(*stored_->map, 0);
    map_.mark_disputed(stored_->disputed);
  }

  void begin_receiver() {
    receiver_ = std::make_unique<Receiver>();
    receiver_->on_begun = [this](TileStore& begun) {
      if (store_) {
        store_->begin(&begun, [this] {
          link_->hold(now_s());
          server_->run_for(0);
        });
      }
    };
    receiver_->on_replaced = [this](const TileStore& ended) {
      if (store_) {
        store_->end(ended);
      }
      if (!player_) {
        output_->write_ended(ended, summary());
      }
      begin_map();
    };
  }

  void begin_map() {
    map_.restart();
    track_.clear();
    state_.restart();
  }

  void round(double now) {
    if (player_) {
      play(now);
    } else if (link_) {
      listen(now);
    }
    for (const ReceiverNotice& notice : receiver_->take_notices()) {
      tell(notice, now);
    }
    // A map is sent only behind the state that describes it: that one does not wait.
    wanted_ = wanted_ || state_epoch_ != map_.epoch();
    if (state_number_ == 0 || now - state_s_ >= kStateEvery_s || wanted_) {
      state_s_ = now;
      state_epoch_ = map_.epoch();
      wanted_ = false;
      state_number_ += 1;
      state_json_ = state_.json(*receiver_, surroundings(now), clock_s(now));
    }
    if (StopSignals::take_wish()) {
      write();
    }
    if (now - shown_s_ >= kShowEvery_s) {
      shown_s_ = now;
      line_.show(status_line(now));
    }
  }

  [[nodiscard]] std::string status_line(double now) const {
    const std::size_t count = server_->viewers();
    const std::string viewers =
        ", " + std::to_string(count) + (count == 1 ? " viewer" : " viewers");
    if (stored_) {
      return "stored survey " + std::to_string(stored_->survey.number) + ", " +
             std::to_string(stored_->map->known_cells()) + " cells, " +
             std::to_string(stored_->map->known_tiles()) + " tiles" + viewers;
    }
    const double silent_s = silence_.silent_s(now);
    const bool silent = silent_s >= SilenceWatch::kSilence_s;
    return (silent ? "silent for " + std::to_string(std::lround(silent_s)) + " s, " : "") +
           live_text(*receiver_, state_.bytes_per_second(now)) + viewers;
  }

  void listen(double now) {
    const std::uint64_t before = received_frames_ + receiver_->counters().frames;
    // All that has come, unless it is a flood: the page is served in between.
    const double until_s = now + kRound_ms * 1e-3;
    flooded_ = true;
    try {
      while (flooded_ && now_s() < until_s) {
        flooded_ = link_->read_some(receiver_.get(), now) > 0;
      }
    } catch (const HostError& error) {
      refuse(error.what());
    }
    const bool heard = received_frames_ + receiver_->counters().frames != before;
    if (const auto notice = silence_.follow(heard, now)) {
      tell(*notice, now);
    }
    const std::string change = link_->port_change();
    if (!change.empty()) {
      port_state_ = change;
      say(change);
    }
    if (!options_.no_resend) {
      link_->ask_again(receiver_.get(), now);
    }
    follow();
    state_.follow(*receiver_, now);
    if (store_ && receiver_->store() != nullptr) {
      store_->follow(*receiver_->store(), now);
    }
  }

  void play(double now) {
    player_->step(now, {[this] {
                          begin_receiver();
                          begin_map();
                        },
                        [this](const std::uint8_t* data, std::size_t size_bytes, base::TimeUs) {
                          try {
                            receiver_->feed(data, size_bytes);
                          } catch (const HostError& error) {
                            refuse(error.what());
                          }
                          follow();
                          state_.follow(*receiver_, vehicle_s());
                        }});
  }

  /// What the state's rates and ages go by: of a recording, its own time.
  [[nodiscard]] double clock_s(double now) const { return player_ ? vehicle_s() : now; }

  [[nodiscard]] double vehicle_s() const {
    return receiver_->status() ? static_cast<double>(receiver_->status()->t_us) * 1e-6 : 0.0;
  }

  /// A vehicle that this program cannot understand: what it says is not read, and the page tells why.
  void refuse(const std::string& why) {
    if (refused_ != why) {
      say("error: " + why);
    }
    refused_ = why;
    received_frames_ += receiver_->counters().frames;
    begin_receiver();
    begin_map();
  }

  void follow() {
    const TileStore* const store = receiver_->store();
    if (store == nullptr) {
      return;
    }
    refused_.clear();
    const std::optional<proto::Status>& status = receiver_->status();
    map_.follow(*store, status ? status->t_us : 0, &receiver_->coarse());
    if (status) {
      track_.follow(*status, store->hello().cell_mm / 2000.0);
    }
  }

  [[nodiscard]] PageContent content() const {
    const bool settled = !player_ || !player_->seeking();
    return {&palettes_,    &map_,        &track_,
            state_number_, &state_json_, settled && state_epoch_ == map_.epoch()};
  }

  [[nodiscard]] PageSurroundings surroundings(double now) const {
    PageSurroundings around;
    around.link_uri = options_.link_uri;
    around.port_state = port_state_;
    around.refused = refused_;
    around.silent_s = silence_.silent_s(now);
    around.budget_bytes_s = options_.budget_bytes_s;
    around.viewers = server_->viewers();
    around.epoch = map_.epoch();
    around.player = player_ ? &*player_ : nullptr;
    around.stored = stored_ ? &*stored_ : nullptr;
    around.stored_path = stored_path_;
    return around;
  }

  void take(const PageRequest& request) {
    if (player_) {
      player_->take(request);
      wanted_ = true;
    }
  }

  void tell(const ReceiverNotice& notice, double now) {
    say(severity_word(notice.severity) + printable(notice.text, 300));
    state_.add_notice(notice, clock_s(now));
  }

  void say(const std::string& text) {
    line_.wipe();
    std::cerr << "monitor: " << text << "\n";
  }

  [[nodiscard]] std::string summary() const {
    return receive_summary_json(*receiver_, receiver_->vehicle_cells_hash(), now_s() - begin_s_);
  }

  void write() {
    if (receiver_->store() != nullptr) {
      output_->write(*receiver_->store(), summary());
    }
  }

  const MonitorOptions& options_;
  std::optional<Player> player_;
  std::optional<OpenedSurvey> stored_;
  std::string stored_path_;
  std::optional<LinkReader> link_;
  std::optional<LiveStore> store_;
  std::optional<LiveOutput> output_;
  std::unique_ptr<Receiver> receiver_;
  const std::string palettes_ = palettes_json();
  LiveMap map_;
  Track track_;
  PageState state_;
  std::string state_json_;
  std::uint64_t state_number_ = 0;
  std::uint32_t state_epoch_ = 0;
  double state_s_ = 0.0;
  bool wanted_ = false;  ///< a page asked for something: the state that answers does not wait
  std::string port_state_;
  std::string refused_;
  std::uint64_t received_frames_ = 0;  ///< whole ones, by receivers that are no more
  SilenceWatch silence_;               ///< of whole frames
  bool flooded_ = false;               ///< more comes than one round takes
  double begin_s_ = 0.0;
  double shown_s_ = 0.0;
  LiveLine line_;
  std::optional<WebServer> server_;
};

}  // namespace

int run_monitor(const MonitorOptions& options) {
  const StopSignals signals;
  return Monitor(options).run();
}

}  // namespace leadline::host
