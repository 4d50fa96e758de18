#include "host_tools/topside/command_command.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <memory>
#include <vector>

#include "firmware/keys/command_key.hpp"
#include "firmware/keys/counter_file.hpp"
#include "firmware/keys/small_file.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/stop_signals.hpp"
#include "host_tools/text.hpp"
#include "host_tools/topside/command_sender.hpp"
#include "host_tools/topside/link_reader.hpp"
#include "host_tools/topside/receiver.hpp"
#include "proto/framing.hpp"

namespace leadline::host {
namespace {

using proto::CommandParameter;
using proto::CommandResult;

constexpr int kPoll_ms = 20;
// Rows of a slice that did not come are asked for again after so long without any.
constexpr double kSliceQuiet_s = 5.0;
constexpr double kBusyPause_s = 2.0;

struct Parameter {
  const char* name;
  CommandParameter parameter;
  std::int32_t low;
  std::int32_t high;
};
constexpr std::array<Parameter, proto::kCommandParameters> kParameters = {{
    {"link_rate_bytes_s", CommandParameter::kLinkRate, 10, 125'000'000},
    {"max_tile_age_ms", CommandParameter::kMaxTileAge, 0, 60'000},
    {"status_interval_ms", CommandParameter::kStatusInterval, 1, 3'600'000},
    {"hello_interval_ms", CommandParameter::kHelloInterval, 1, 3'600'000},
    {"sound_speed_mm_s", CommandParameter::kSoundSpeed, 1'300'000, 1'700'000},
    {"voxel_budget", CommandParameter::kVoxelBudget, 0, 16'777'216},
    {"tile_budget", CommandParameter::kTileBudget, 1, 4096},
    {"max_wait_ms", CommandParameter::kMaxWait, 0, 10'000},
    {"quality_weight_percent", CommandParameter::kQualityWeight, 0, 100},
    {"min_range_mm", CommandParameter::kMinRange, 0, INT32_MAX},
}};

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

base::TimeUs to_us(double seconds) { return static_cast<base::TimeUs>(seconds * 1e6); }

class Session {
 public:
  explicit Session(const CommandOptions& options)
      : options_(options),
        key_(load_command_key(options.key_path)),
        command_(options.command),
        link_(options.link_uri, "command") {
    if (link_.is_file()) {
      throw HostError(ExitCode::kUsage, options.link_uri + ": nobody in a file does what one says");
    }
  }

  int run() {
    begin_s_ = now_s();
    const bool slice = command_.kind == proto::CommandKind::kSlice;
    if (slice && !find_place()) {
      return finish();
    }
    for (;;) {
      if (!order()) {
        break;
      }
      if (!slice || (result_ != CommandResult::kDone && result_ != CommandResult::kBusy)) {
        break;
      }
      if (result_ == CommandResult::kBusy) {
        wait_until(now_s() + kBusyPause_s, [] { return false; });
      } else {
        gather_rows();
      }
      if (rows_->complete() || over()) {
        break;
      }
      command_.slice = rows_->missing();
    }
    return finish();
  }

 private:
  [[nodiscard]] bool over() const {
    return StopSignals::stopped() || now_s() - begin_s_ >= options_.timeout_s;
  }

  /// Looks at the link until `done`, `end_s`, or all of it is over.
  template <typename Done>
  void wait_until(double end_s, Done done) {
    while (!over() && now_s() < end_s && !done()) {
      if (look() == 0) {
        link_.wait(kPoll_ms);
      }
    }
  }

  std::size_t look() {
    const std::size_t got =
        link_.read_bytes(now_s(), [this](const std::uint8_t* data, std::size_t size_bytes) {
          link_.feed(&receiver_, data, size_bytes);
          while (size_bytes > 0) {
            std::size_t used = 0;
            proto::FrameView frame{};
            if (decoder_.decoder().feed(data, size_bytes, used, frame)) {
              take(frame);
            }
            data += used;
            size_bytes -= used;
          }
        });
    for (const ReceiverNotice& notice : receiver_.take_notices()) {
      const bool told = notice.severity != proto::Severity::kInfo;
      std::cerr << (told ? "command: the vehicle says: " + printable(notice.text, 300) + "\n" : "");
    }
    return got;
  }

  void take(const proto::FrameView& frame) {
    if (sender_) {
      sender_->take(frame.payload, frame.payload_bytes);
    }
    if (rows_ && rows_->take(frame.payload, frame.payload_bytes)) {
      last_row_s_ = now_s();
    }
  }

  /// Sends until it is answered. False: it was not.
  bool order() {
    sender_.emplace(key_, command_, take_counter(options_.key_path, key_.id()));
    result_.reset();
    wait_until(begin_s_ + options_.timeout_s, [this] {
      // A listening end has no room until it knows who is there.
      if (sender_->due(to_us(now_s())) && link_.send(sender_->frame())) {
        sender_->note_sent(to_us(now_s()));
      }
      return sender_->result().has_value();
    });
    times_sent_ += sender_->times_sent();
    result_ = sender_->result();
    return result_.has_value();
  }

  /// Where the slice lies, by the vehicle's own grid. False: the vehicle did not say in time.
  bool find_place() {
    double ask_s = 0;
    wait_until(begin_s_ + options_.timeout_s, [&] {
      if (receiver_.store() == nullptr && now_s() >= ask_s) {
        // Also what makes us known to a vehicle that listens.
        (void)link_.send(hello_request_frame());
        ask_s = now_s() + 1.0;
      }
      return receiver_.store() != nullptr && (options_.slice_at_m || receiver_.status());
    });
    if (receiver_.store() == nullptr || (!options_.slice_at_m && !receiver_.status())) {
      std::cerr << "command: the vehicle has not said where its grid lies\n";
      return false;
    }
    const proto::Hello& hello = receiver_.store()->hello();
    proto::SliceBox& box = command_.slice;
    const bool flat = box.plane == proto::SlicePlane::kHorizontal;
    const std::array<std::int64_t, 3> side = {
        flat ? box.rows : (box.plane == proto::SlicePlane::kNorth ? box.columns : 1),
        flat || box.plane == proto::SlicePlane::kEast ? box.columns : 1, flat ? 1 : box.rows};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double at_mm = options_.slice_at_m
                               ? 1000.0 * (*options_.slice_at_m)[axis]
                               : static_cast<double>(receiver_.status()->position_mm[axis]);
      const auto cell = static_cast<std::int64_t>(
          std::floor((at_mm - static_cast<double>(hello.origin_mm[axis])) / hello.cell_mm));
      const std::int64_t size = hello.size_cells[axis];
      // As a whole inside, where the grid is large enough.
      box.first[axis] = static_cast<std::uint32_t>(std::clamp<std::int64_t>(
          cell - side[axis] / 2, 0, std::max<std::int64_t>(size - side[axis], 0)));
      const std::int64_t left = std::min(side[axis], size);
      const bool is_rows = axis == (flat ? 0U : 2U);
      const bool is_columns = axis == (box.plane == proto::SlicePlane::kNorth ? 0U : 1U);
      if (is_rows) {
        box.rows = static_cast<std::uint8_t>(left);
      } else if (is_columns) {
        box.columns = static_cast<std::uint8_t>(left);
      }
    }
    rows_.emplace(box);
    return true;
  }

  void gather_rows() {
    last_row_s_ = now_s();
    wait_until(begin_s_ + options_.timeout_s,
               [this] { return rows_->complete() || now_s() - last_row_s_ >= kSliceQuiet_s; });
  }

  int finish() {
    const bool whole = !rows_ || rows_->complete();
    const bool answered = result_.has_value();
    const ExitCode code = !answered                          ? ExitCode::kNoAnswer
                          : *result_ != CommandResult::kDone ? ExitCode::kRefused
                          : whole                            ? ExitCode::kOk
                                                             : ExitCode::kNoAnswer;
    options_.json ? print_json() : print_text(code);
    return static_cast<int>(code);
  }

  void print_text(ExitCode code) const {
    if (result_) {
      std::ostream& out = code == ExitCode::kOk ? std::cout : std::cerr;
      out << (code == ExitCode::kOk ? "" : "command: ") << options_.name << ": "
          << (code == ExitCode::kNoAnswer ? "rows of the slice did not come"
                                          : command_result_text(*result_))
          << "\n";
    } else {
      std::cerr << "command: " << options_.name << ": no answer of the vehicle"
                << (times_sent_ == 0 ? ", and nobody to say it to" : "")
                << "; perhaps it is done all the same\n";
    }
    if (sender_ && sender_->forged_answers() > 0) {
      std::cerr << "command: " << sender_->forged_answers()
                << " answers were not the vehicle's: another key, or somebody forges them\n";
    }
    if (rows_ && result_ == CommandResult::kDone) {
      print_slice();
    }
  }

  void print_slice() const {
    const proto::SliceBox& box = rows_->box();
    std::cout << "rows "
              << (box.plane == proto::SlicePlane::kHorizontal ? "northwards" : "downwards")
              << ", columns "
              << (box.plane == proto::SlicePlane::kNorth ? "northwards" : "eastwards")
              << ", from cell " << box.first[0] << " " << box.first[1] << " " << box.first[2]
              << "; . never observed, 1 empty .. F surface\n";
    for (std::size_t row = 0; row < box.rows; ++row) {
      std::string line;
      for (std::size_t column = 0; column < box.columns; ++column) {
        line += ".123456789ABCDEF"[rows_->levels()[row * box.columns + column]];
      }
      std::cout << line << "\n";
    }
  }

  void print_json() const {
    std::cout << "{\"command\": " << json_string(options_.name)
              << ", \"answered\": " << (result_ ? "true" : "false")
              << ", \"result\": " << (result_ ? json_string(command_result_name(*result_)) : "null")
              << ", \"counter\": " << (sender_ ? std::to_string(sender_->counter()) : "null")
              << ", \"sent\": " << times_sent_
              << ", \"seconds\": " << json_number(std::round((now_s() - begin_s_) * 1e3) / 1e3);
    if (rows_) {
      const proto::SliceBox& box = rows_->box();
      std::cout << ", \"slice\": {\"plane\": " << static_cast<int>(box.plane) << ", \"first\": ["
                << box.first[0] << ", " << box.first[1] << ", " << box.first[2]
                << "], \"rows\": " << int{box.rows} << ", \"columns\": " << int{box.columns}
                << ", \"complete\": " << (rows_->complete() ? "true" : "false")
                << ", \"levels\": [";
      for (std::size_t i = 0; i < rows_->levels().size(); ++i) {
        std::cout << (i > 0 ? ", " : "") << int{rows_->levels()[i]};
      }
      std::cout << "]}";
    }
    std::cout << "}\n";
  }

  const CommandOptions& options_;
  CommandKey key_;
  proto::Command command_;
  LinkReader link_;
  Receiver receiver_{std::nullopt};
  proto::FrameDecoderBuffer<> decoder_;
  std::optional<CommandSender> sender_;
  std::optional<SliceCollector> rows_;
  std::optional<CommandResult> result_;
  int times_sent_ = 0;
  double begin_s_ = 0;
  double last_row_s_ = 0;
};

}  // namespace

std::string settings_help() {
  std::string text = "Parameters:\n";
  for (const Parameter& each : kParameters) {
    text += std::string("  ") + each.name + "  " + std::to_string(each.low) + " .. " +
            std::to_string(each.high) + "\n";
  }
  return text;
}

void read_setting(const std::string& text, proto::Command* command) {
  const std::size_t equals = text.find('=');
  const std::string name = text.substr(0, equals);
  const auto* const found =
      std::find_if(kParameters.begin(), kParameters.end(),
                   [&name](const Parameter& each) { return each.name == name; });
  if (equals == std::string::npos || found == kParameters.end()) {
    throw HostError(ExitCode::kUsage, "command: set " + printable(text, 100) +
                                          ": has to be NAME=VALUE. " + settings_help());
  }
  std::uint64_t value = 0;
  if (!read_number(text.substr(equals + 1), 10, static_cast<std::uint64_t>(found->high), &value) ||
      static_cast<std::int64_t>(value) < found->low) {
    throw HostError(ExitCode::kUsage, "command: set " + printable(text, 100) + ": has to be " +
                                          std::to_string(found->low) + " to " +
                                          std::to_string(found->high));
  }
  command->parameter = found->parameter;
  command->value = static_cast<std::int32_t>(value);
}

int run_command(const CommandOptions& options) {
  const StopSignals signals;
  return std::make_unique<Session>(options)->run();
}

int run_key_new(const KeyOptions& options) {
  const CommandKey key = CommandKey::random(options.vehicle);
  write_command_key(options.path, key);
  std::cout
      << options.path << ": key " << hex_of(key.id()) << " for vehicle " << options.vehicle
      << "\nCopy it to the vehicle, readable for the service alone, over a way that you trust:\n"
         "  install -m 600 -o leadline "
      << options.path
      << " /etc/leadline/command.key\nand say there in vehicle.toml:\n"
         "  [commands]\n"
         "  key = \"/etc/leadline/command.key\"\n"
         "  counter = \"/var/lib/leadline/command.taken\"\n"
         "  vehicle = "
      << options.vehicle << "\nWho has this file commands the vehicle.\n";
  return static_cast<int>(ExitCode::kOk);
}

int run_key_advance(const KeyOptions& options) {
  const CommandKey key = load_command_key(options.path);
  std::cout << options.path << ": the next command is number "
            << take_counter(options.path, key.id(), options.more) + 1 << "\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
