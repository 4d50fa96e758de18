// Any bytes as a CSV of pings. What must hold: only HostError kInput comes out; every row that comes
// out is inside the limits that the header promises and in order of time; nothing is lost from the
// counts; `strict` stops exactly where the first rejection is; and the accepted rows do not depend on
// whether the short way or the full way parsed them (quoting a value takes the full one).
#include <algorithm>
#include <cctype>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/ping_csv.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::fuzz::require;
using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::PingCsvOptions;
using leadline::host::PingCsvReader;
using leadline::host::PingCsvStats;
using leadline::host::PingRow;

constexpr std::string_view kHeader =
    "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n";

struct Outcome {
  std::vector<PingRow> rows;
  PingCsvStats stats;
  std::string error;
  bool opened = false;
  std::size_t messages = 0;
};

bool within(std::int64_t value, std::int64_t limit) { return value >= -limit && value <= limit; }

Outcome read(std::string_view text, bool strict) {
  Outcome outcome;
  PingCsvOptions options;
  options.strict = strict;
  options.message = [&](const std::string& message) {
    outcome.messages += 1;
    for (const char c : message) {
      require(c >= 0x20 && c < 0x7F, "messages are printable");
    }
  };
  try {
    PingCsvReader reader("f.csv", text, options);
    outcome.opened = true;
    PingRow row{};
    try {
      while (reader.next(&row)) {
        outcome.rows.push_back(row);
      }
    } catch (const HostError&) {
      outcome.stats = reader.stats();
      throw;
    }
    outcome.stats = reader.stats();
    require(outcome.stats.accepted > 0, "a file without a usable row is an error");
  } catch (const HostError& error) {
    require(error.code() == ExitCode::kInput, "only input errors");
    require(*error.what() != '\0', "errors say something");
    outcome.error = error.what();
  }
  return outcome;
}

void check(const Outcome& outcome, bool strict) {
  std::uint64_t rejected = 0;
  for (const auto& [reason, count] : outcome.stats.rejected) {
    require(count > 0, "only reasons that occurred");
    rejected += count;
  }
  const std::uint64_t unaccounted = outcome.stats.rows - outcome.stats.accepted - rejected;
  // The row that stops the reading for a re-origin is seen and neither accepted nor rejected.
  require(unaccounted == 0 || (unaccounted == 1 && !outcome.error.empty()),
          "every row is accounted for");
  require(outcome.stats.accepted == outcome.rows.size(), "accepted rows come out");
  require(!strict || rejected <= 1, "strict stops at the first rejection");
  require(!strict || rejected == 0 || !outcome.error.empty(), "strict stops with an error");
  std::uint64_t no_return = 0;
  const PingRow* previous = nullptr;
  for (const PingRow& row : outcome.rows) {
    require(within(row.t_us, leadline::host::kMaxTime_us), "time within its limit");
    require(previous == nullptr || row.t_us >= previous->t_us, "time never goes backwards");
    require(previous == nullptr || row.line > previous->line, "lines grow");
    require(within(row.position_um[0], leadline::base::kMaxHorizontal_um),
            "north within its limit");
    require(within(row.position_um[1], leadline::base::kMaxHorizontal_um), "east within its limit");
    require(within(row.position_um[2], leadline::base::kMaxVertical_um), "down within its limit");
    require(row.range_um >= 0 && row.range_um <= leadline::host::kMaxCsvRange_um,
            "range within its limit");
    require(row.has_range || row.range_um == 0, "no return, no range");
    no_return += row.has_range ? 0 : 1;
    previous = &row;
  }
  require(no_return == outcome.stats.no_return, "no-returns are counted");
}

bool same(const PingRow& a, const PingRow& b) {
  return a.t_us == b.t_us && a.position_um[0] == b.position_um[0] &&
         a.position_um[1] == b.position_um[1] && a.position_um[2] == b.position_um[2] &&
         a.attitude.roll_bam32 == b.attitude.roll_bam32 &&
         a.attitude.pitch_bam32 == b.attitude.pitch_bam32 &&
         a.attitude.heading_bam32 == b.attitude.heading_bam32 &&
         a.azimuth_bam32 == b.azimuth_bam32 && a.elevation_bam32 == b.elevation_bam32 &&
         a.range_um == b.range_um && a.has_range == b.has_range && a.line == b.line;
}

/// The text with the first value of every line in quotes, where that changes nothing else.
std::string quoted(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    const std::size_t comma = line.find(',');
    const bool plain = comma != std::string_view::npos &&
                       line.find('"') == std::string_view::npos &&
                       (std::isalnum(static_cast<unsigned char>(line.front())) != 0 ||
                        line.front() == '-' || line.front() == '.') &&
                       line.size() + 2 <= leadline::host::kMaxLine_bytes;
    if (plain) {
      result += '"';
      result += line.substr(0, comma);
      result += '"';
      result += line.substr(comma);
    } else {
      result += line;
    }
    text.remove_prefix(end);
    if (!text.empty()) {
      result += '\n';
      text.remove_prefix(1);
    }
  }
  return result;
}

void fuzz(std::string_view text) {
  const Outcome outcome = read(text, false);
  check(outcome, false);

  const Outcome strict = read(text, true);
  check(strict, true);
  if (outcome.stats.rejected.empty() && outcome.error.empty()) {
    require(strict.error.empty() && strict.rows.size() == outcome.rows.size(),
            "strict changes nothing when nothing is wrong");
  }
  for (std::size_t i = 0; i < strict.rows.size(); ++i) {
    require(i < outcome.rows.size() && same(strict.rows[i], outcome.rows[i]),
            "strict rows are the first rows");
  }

  const Outcome full = read(quoted(text), false);
  require(full.rows.size() == outcome.rows.size(), "both ways accept the same rows");
  for (std::size_t i = 0; i < full.rows.size(); ++i) {
    require(same(full.rows[i], outcome.rows[i]), "both ways read the same values");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  fuzz(text);
  // Most inputs die at the header: the same bytes as rows under a good one.
  fuzz(std::string(kHeader) + std::string(text));
  return 0;
}
