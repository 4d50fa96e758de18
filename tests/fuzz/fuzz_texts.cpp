// Any bytes as one of the small texts: a port's URI, a tide, a vehicle.toml to migrate, a key, its counter (first byte).
// What must hold: only HostError with a message free of control characters comes out; a URI that is accepted reads back
// from its own text; tide points ascend; a configuration that was migrated is of the newest version, with nothing left
// to change.
#include <cstdint>
#include <string>
#include <string_view>

#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "firmware/config/exit_codes.hpp"
#include "firmware/config/migrate.hpp"
#include "firmware/config/tide_file.hpp"
#include "firmware/config/vehicle_file.hpp"
#include "firmware/keys/command_key.hpp"
#include "firmware/keys/counter_file.hpp"
#include "hal/linux/uri.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::fuzz::require;
using leadline::host::HostError;

/// Names of files may be in any script: what is above ASCII passes.
void require_no_controls(std::string_view message) {
  require(!message.empty(), "a refusal says why");
  for (const char c : message) {
    const auto byte = static_cast<unsigned char>(c);
    require((byte >= 0x20 && byte != 0x7F) || c == '\n', "messages have no control characters");
  }
}

void check_uri(std::string_view text) {
  const leadline::hal::UriResult result = leadline::hal::parse_uri(text);
  if (!result.ok()) {
    require_no_controls(result.error);
    return;
  }
  const std::string again = leadline::hal::uri_text(result.spec);
  const leadline::hal::UriResult second = leadline::hal::parse_uri(again);
  require(second.ok(), "a URI's own text is accepted");
  require(leadline::hal::uri_text(second.spec) == again, "and means the same");
}

void check_tide(std::string_view text) {
  leadline::firmware::WaterConfig water{};
  leadline::host::parse_tide(text, "t.csv", 1'700'000'000'000'000, 0, &water);
  require(water.tide_count <= leadline::firmware::kMaxTidePoints, "room for the points");
  for (int i = 1; i < water.tide_count; ++i) {
    require(water.tide[i].t_us > water.tide[i - 1].t_us, "tide points ascend");
  }
}

void check_migrate(std::string_view text) {
  const auto& steps = leadline::host::vehicle_schema_steps();
  const std::int64_t oldest = steps.front().version;
  const std::int64_t newest = steps.back().version + 1;
  const auto once = leadline::host::migrate_toml(text, "v.toml", oldest, steps);
  require(once.from >= oldest && once.from <= newest, "a known version");
  try {
    (void)leadline::host::parse_vehicle_file(once.text, "v.toml", "");
  } catch (const HostError&) {
    return;  // no configuration before, none now
  }
  const auto twice = leadline::host::migrate_toml(once.text, "v.toml", oldest, steps);
  require(twice.from == newest, "the newest version comes out");
  require(twice.changes.empty() && twice.text == once.text, "and nothing is left to change");
}

/// Its bytes are the fuzzer's; a key is a file of its owner alone.
std::string file_of(std::string_view bytes) {
  static const int fd = memfd_create("texts", MFD_CLOEXEC);
  require(fd >= 0 && fchmod(fd, 0600) == 0 && ftruncate(fd, 0) == 0, "a file in memory");
  require(pwrite(fd, bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size()),
          "that holds the bytes");
  return "/proc/self/fd/" + std::to_string(fd);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    switch (data[0] % 5) {
      case 0:
        check_uri(text);
        break;
      case 1:
        check_tide(text);
        break;
      case 2:
        check_migrate(text);
        break;
      case 3:
        (void)leadline::host::load_command_key(file_of(text));
        break;
      default:
        (void)leadline::host::CounterFile(file_of(text), 0x7B712541).load();
        break;
    }
  } catch (const HostError& error) {
    require_no_controls(error.what());
  }
  return 0;
}
