// The image that replays: logs of the host's through the same vehicle, and what they cost in instructions.
//
//   qemu-system-arm ... -icount shift=7,sleep=off -semihosting-config ...,arg=replay,arg=LOG
//   ... arg=replay,arg=@LIST   the logs that stand in this file, one a line
//
// Prints for each `map_hash=... link_hash=... cells_hash=... same_as_flight=... instructions_total=...`. Instructions
// are those of Vehicle::cycle(); of a ping those of Model::integrate(), which the linker leads through here
// (--wrap). Exit status as of leadline-replay: 0, 2 usage, 3 a log cannot be replayed, 5 another result; the highest
// of all logs.
#include <array>
#include <cstdint>
#include <cstring>

#include "firmware/m7/entry_points.hpp"
#include "firmware/m7/say.hpp"
#include "firmware/pipeline/log_player.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "hal/m7/clock.hpp"
#include "hal/m7/semihost.hpp"

namespace leadline::firmware::m7 {
extern Vehicle the_vehicle;
}

namespace {

using leadline::firmware::LogEvent;
using leadline::firmware::LogPlayer;
using leadline::firmware::m7::say_number;
using leadline::firmware::m7::the_vehicle;
using leadline::hal::m7::InstructionCounter;
using leadline::hal::m7::say;
using leadline::model::Model;
using leadline::model::PingResult;

constexpr std::uint32_t kOk = 0;
constexpr std::uint32_t kUsage = 2;
constexpr std::uint32_t kInput = 3;
constexpr std::uint32_t kDiffers = 5;

[[gnu::section(".bss.leadline.tools")]] LogPlayer player;
[[gnu::section(".bss.leadline.tools")]] std::uint8_t buffer[65536];
constexpr std::size_t kMaxPath_bytes = 512;
InstructionCounter counter;

/// Ticks, exact; printed as instructions.
struct Costs {
  std::uint64_t cycles_ticks = 0;
  std::uint32_t worst_cycle_ticks = 0;
  std::uint64_t pings_ticks = 0;
  std::uint64_t pings = 0;
  std::uint32_t worst_ping_ticks = 0;
  std::uint32_t worst_ping_voxels = 0;
  std::uint64_t worst_ping_number = 0;
};
Costs costs;

void complain(const char* path, const char* what, const char* more = "") {
  say(path);
  say(": replay: error: ");
  say(what);
  say(more);
  say("\n");
}

/// What is done with everything that the player finds. False: the log is of no use.
bool act(const char* path, LogEvent event) {
  using leadline::base::Status;
  if (event == LogEvent::kConfigured) {
    const Status status =
        the_vehicle.configure(player.config(), player.tables(), player.table_count());
    if (status != Status::kOk) {
      complain(path,
               "the vehicle refuses this configuration: ", leadline::base::status_text(status));
    }
    return status == Status::kOk;
  }
  if (event == LogEvent::kCycle) {
    leadline::firmware::CycleOutput output{};
    const std::uint32_t begin = counter.ticks();
    the_vehicle.cycle(player.input(), output);
    const std::uint32_t ticks = counter.ticks() - begin;
    costs.cycles_ticks += ticks;
    costs.worst_cycle_ticks = ticks > costs.worst_cycle_ticks ? ticks : costs.worst_cycle_ticks;
  } else if (event == LogEvent::kRefused) {
    complain(path, leadline::firmware::log_refusal_text(player.refusal()));
    return false;
  }
  return true;
}

bool play(const char* path) {
  leadline::hal::m7::HostFile file;
  if (!file.open(path, leadline::hal::m7::OpenMode::kReadBytes)) {
    complain(path, "the log cannot be read");
    return false;
  }
  player.begin();
  for (std::size_t size = file.read(buffer, sizeof buffer); size > 0;
       size = file.read(buffer, sizeof buffer)) {
    std::size_t at = 0;
    while (at < size) {
      std::size_t used = 0;
      const LogEvent event = player.feed(buffer + at, size - at, used);
      at += used;
      if (!act(path, event)) {
        file.close();
        return false;
      }
    }
  }
  file.close();
  return act(path, player.finish());
}

void say_findings(const char* path) {
  leadline::firmware::FindingText texts[leadline::firmware::kMaxFindingTexts];
  const std::size_t count =
      leadline::firmware::finding_texts(player.findings(), player.end().has_value(), texts);
  for (std::size_t i = 0; i < count; ++i) {
    say(path);
    say(": replay: gap: ");
    if (texts[i].count > 0) {
      say_number("", texts[i].count);
      say(" ");
    }
    say(texts[i].text);
    say("\n");
  }
}

std::uint32_t result() {
  const auto& flown = player.end();
  const leadline::proto::LogEnd now = leadline::firmware::log_end_of(the_vehicle, player.t_us());
  const leadline::proto::LogEnd* const then = flown ? &*flown : nullptr;
  char line[leadline::firmware::kHashLine_bytes];
  (void)leadline::firmware::hash_line(now, line);
  say(line);
  say(" same_as_flight=");
  say(leadline::firmware::same_as_flight_text(now, then));
  say_number(" instructions_total=", InstructionCounter::instructions(costs.cycles_ticks));
  say_number(" instructions_worst_cycle=",
             InstructionCounter::instructions(costs.worst_cycle_ticks));
  say_number(" instructions_worst_ping=", InstructionCounter::instructions(costs.worst_ping_ticks));
  say_number(" worst_ping_voxels=", costs.worst_ping_voxels);
  say_number(" worst_ping_number=", costs.worst_ping_number);
  say_number(" instructions_pings=", InstructionCounter::instructions(costs.pings_ticks));
  say_number(" pings=", costs.pings);
  say_number(" cycles=", the_vehicle.counters().cycles);
  say("\n");
  return then != nullptr && !leadline::firmware::same_results(now, *then) ? kDiffers : kOk;
}

std::uint32_t replay(const char* path) {
  costs = Costs{};
  if (!play(path)) {
    return kInput;
  }
  say_findings(path);
  return result();
}

/// All logs of a list. A line is a path, whatever is in it.
std::uint32_t replay_list(const char* list) {
  leadline::hal::m7::HostFile file;
  if (!file.open(list, leadline::hal::m7::OpenMode::kReadBytes)) {
    complain(list, "the list cannot be read");
    return kInput;
  }
  static std::uint8_t piece[1024];
  static char path[kMaxPath_bytes];
  std::size_t length = 0;
  std::uint32_t worst = kOk;
  for (std::size_t size = file.read(piece, sizeof piece); size > 0;
       size = file.read(piece, sizeof piece)) {
    for (std::size_t at = 0; at < size; ++at) {
      if (piece[at] != '\n') {
        path[length] = static_cast<char>(piece[at]);
        ++length;
        if (length == sizeof path) {
          complain(list, "a path is too long");
          return kInput;
        }
        continue;
      }
      path[length] = '\0';
      length = 0;
      const std::uint32_t one = replay(path);
      worst = one > worst ? one : worst;
    }
  }
  return worst;
}

}  // namespace

// Model::integrate() by the names that the compiler gives to it and to its wrapper. A change of its parameters
// shows: nothing would be counted, and tests/cli/test_m7_ci.sh asks for more.
// NOLINTBEGIN(*-reserved-identifier,cert-dcl*,readability-identifier-naming): the linker makes these names
extern "C" {
PingResult
__real__ZN8leadline5model5Model9integrateERKNS_4base4PingERKNS2_4PoseEjRKNS0_12ReturnDetailE(
    Model* model, const leadline::base::Ping& ping, const leadline::base::Pose& pose,
    std::size_t sensor, const leadline::model::ReturnDetail& detail);
PingResult
__wrap__ZN8leadline5model5Model9integrateERKNS_4base4PingERKNS2_4PoseEjRKNS0_12ReturnDetailE(
    Model* model, const leadline::base::Ping& ping, const leadline::base::Pose& pose,
    std::size_t sensor, const leadline::model::ReturnDetail& detail);

PingResult
__wrap__ZN8leadline5model5Model9integrateERKNS_4base4PingERKNS2_4PoseEjRKNS0_12ReturnDetailE(
    Model* model, const leadline::base::Ping& ping, const leadline::base::Pose& pose,
    std::size_t sensor, const leadline::model::ReturnDetail& detail) {
  const std::uint32_t begin = counter.ticks();
  const PingResult outcome =
      __real__ZN8leadline5model5Model9integrateERKNS_4base4PingERKNS2_4PoseEjRKNS0_12ReturnDetailE(
          model, ping, pose, sensor, detail);
  const std::uint32_t ticks = counter.ticks() - begin;
  ++costs.pings;
  costs.pings_ticks += ticks;
  if (ticks > costs.worst_ping_ticks) {
    costs.worst_ping_ticks = ticks;
    costs.worst_ping_voxels = model->counters().last_voxels_per_ping;
    costs.worst_ping_number = costs.pings;
  }
  return outcome;
}

}  // extern "C"
// NOLINTEND(*-reserved-identifier,cert-dcl*,readability-identifier-naming)

void leadline_main() {
  leadline::firmware::m7::end_after_fault(kInput);
  counter.start();
  const char* const path = leadline::firmware::m7::command_argument();
  if (path == nullptr) {
    say("replay: error: no log on the command line\n");
    leadline::hal::m7::exit(kUsage);
  }
  leadline::hal::m7::exit(path[0] == '@' ? replay_list(path + 1) : replay(path));
}
