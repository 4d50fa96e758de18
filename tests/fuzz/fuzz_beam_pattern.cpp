// Any bytes as a measured beam pattern. What must hold: only HostError kUsage with a printable
// message that names the file comes out; rows that are accepted are in order and within their
// limits; and they make a beam, or are refused by it in the same way.
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/table/beam_pattern.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::fuzz::require;
using leadline::host::BeamDescription;
using leadline::host::BeamPattern;
using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::PatternRow;

void require_printable(const HostError& error) {
  require(error.code() == ExitCode::kUsage, "only configuration errors");
  for (const char* c = error.what(); *c != '\0'; ++c) {
    require(*c >= 0x20 && *c < 0x7F, "messages are printable");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  BeamDescription beam;
  beam.kind = leadline::model::BeamKind::kMeasured;
  try {
    beam.rows = leadline::host::parse_pattern(text, "p.txt");
  } catch (const HostError& error) {
    require_printable(error);
    require(std::string_view(error.what()).substr(0, 6) == "p.txt:", "messages name the file");
    return 0;
  }
  require(beam.rows.size() >= 2 && beam.rows[0].off_axis_deg == 0.0,
          "a pattern starts on the axis");
  double before_deg = -1.0;
  for (const PatternRow& row : beam.rows) {
    require(row.off_axis_deg > before_deg && row.off_axis_deg <= 90.0, "angles ascend up to 90");
    require(row.two_way_db <= 0.0 && row.two_way_db >= -300.0, "levels are below the axis");
    before_deg = row.off_axis_deg;
  }
  try {
    const BeamPattern pattern(beam);
    require(pattern.envelope_rad(0) > 0.0 && pattern.envelope_rad(0) < 1.4, "an envelope");
    require(pattern.discarded_fraction() >= 0.0 && pattern.discarded_fraction() <= 1.0, "a share");
    require(pattern.variance(0) > 0.0, "a width");
  } catch (const HostError& error) {
    require_printable(error);
  }
  return 0;
}
