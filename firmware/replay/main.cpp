// `leadline-replay`: logs of a vehicle through the vehicle's own code, on whatever machine it was built for. Vehicle
// libraries and libc only; `leadline replay` is the same on a desk, with maps and pictures.
#include <cstdint>
#include <cstdio>
#include <cstring>

#include "firmware/pipeline/log_player.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "model/base/status.hpp"

namespace {

using leadline::base::Status;
using leadline::firmware::CycleOutput;
using leadline::firmware::LogEvent;
using leadline::firmware::LogFindings;
using leadline::firmware::LogPlayer;
using leadline::firmware::Vehicle;
using leadline::proto::LogEnd;

// As the other programs' (firmware/config/exit_codes.hpp).
constexpr int kOk = 0;
constexpr int kUsage = 2;
constexpr int kInput = 3;
constexpr int kOutput = 4;
constexpr int kDiffers = 5;

constexpr const char* kHelp =
    "usage: leadline-replay LOG...\n"
    "Runs the vehicle's code over what it recorded (- is standard input). Prints a line for each "
    "log:\n"
    "  map_hash=0x... link_hash=0x... cells_hash=0x... same_as_flight=true|false|unknown\n"
    "unknown: the log has no end record. Gaps and errors go to standard error.\n"
    "Exit status: 0 done, 2 usage, 3 a log cannot be read or replayed, 4 output, 5 a flight ended "
    "with\n"
    "another result; the highest of all logs.\n";

// Large static objects, as on every target.
Vehicle the_vehicle;
LogPlayer the_player;
std::uint8_t buffer[65536];

void complain(const char* path, const char* what, const char* more = "") {
  std::fprintf(stderr, "leadline-replay: error: %s: %s%s%s\n", path, what,
               *more == '\0' ? "" : ": ", more);
}

/// What is done with everything that the player finds. False: the log is of no use.
bool act(const char* path, LogEvent event) {
  if (event == LogEvent::kConfigured) {
    const Status status =
        the_vehicle.configure(the_player.config(), the_player.tables(), the_player.table_count());
    if (status != Status::kOk) {
      complain(path, "the vehicle refuses this configuration", leadline::base::status_text(status));
    }
    return status == Status::kOk;
  }
  if (event == LogEvent::kCycle) {
    CycleOutput output{};
    the_vehicle.cycle(the_player.input(), output);
  } else if (event == LogEvent::kRefused) {
    const Status status = the_player.refusal_status();
    complain(path, leadline::firmware::log_refusal_text(the_player.refusal()),
             status == Status::kOk ? "" : leadline::base::status_text(status));
    return false;
  }
  return true;
}

bool play(const char* path, std::FILE* file) {
  the_player.begin();
  for (;;) {
    const std::size_t size = std::fread(buffer, 1, sizeof buffer, file);
    if (size == 0) {
      break;
    }
    std::size_t at = 0;
    while (at < size) {
      std::size_t used = 0;
      const LogEvent event = the_player.feed(buffer + at, size - at, used);
      at += used;
      if (!act(path, event)) {
        return false;
      }
    }
  }
  if (std::ferror(file) != 0) {
    complain(path, "cannot be read to its end");
    return false;
  }
  return act(path, the_player.finish());
}

void say_findings(const char* path, const LogFindings& findings, bool has_end) {
  leadline::firmware::FindingText texts[leadline::firmware::kMaxFindingTexts];
  const std::size_t count = leadline::firmware::finding_texts(findings, has_end, texts);
  for (std::size_t i = 0; i < count; ++i) {
    if (texts[i].count > 0) {
      std::fprintf(stderr, "%s: gap: %llu %s\n", path,
                   static_cast<unsigned long long>(texts[i].count), texts[i].text);
    } else {
      std::fprintf(stderr, "%s: %s\n", path, texts[i].text);
    }
  }
}

int replay(const char* path) {
  const bool standard_input = std::strcmp(path, "-") == 0;
  std::FILE* const file = standard_input ? stdin : std::fopen(path, "rb");
  if (file == nullptr) {
    complain(path, "cannot be read");
    return kInput;
  }
  const bool played = play(path, file);
  if (!standard_input) {
    (void)std::fclose(file);
  }
  if (!played) {
    return kInput;
  }
  const auto& flown = the_player.end();
  say_findings(path, the_player.findings(), flown.has_value());
  const LogEnd now = leadline::firmware::log_end_of(the_vehicle, the_player.t_us());
  const LogEnd* const then = flown ? &*flown : nullptr;
  char line[leadline::firmware::kHashLine_bytes];
  (void)leadline::firmware::hash_line(now, line);
  std::printf("%s same_as_flight=%s\n", line, leadline::firmware::same_as_flight_text(now, then));
  if (then != nullptr && !leadline::firmware::same_results(now, *then)) {
    (void)leadline::firmware::hash_line(*then, line);
    complain(path, "the flight ended with", line);
    return kDiffers;
  }
  return kOk;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fputs(kHelp, stderr);
    return kUsage;
  }
  if (std::strcmp(argv[1], "--help") == 0 || std::strcmp(argv[1], "-h") == 0) {
    std::fputs(kHelp, stdout);
    return std::fflush(stdout) == 0 ? kOk : kOutput;
  }
  int result = kOk;
  for (int i = 1; i < argc; ++i) {
    const int one = replay(argv[i]);
    result = one > result ? one : result;
  }
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    std::fputs("leadline-replay: error: standard output cannot be written\n", stderr);
    return kOutput;
  }
  return result;
}
