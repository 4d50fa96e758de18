// Any bytes as an ESRI ASCII grid. What must hold: only HostError kInput comes out, with a printable
// message that names the file; a raster that comes out has as many values as its header says, all
// finite or unknown; and it survives being written and read again.
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include "host_tools/exit_codes.hpp"
#include "host_tools/raster.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::fuzz::require;
using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::Raster;

void check(const Raster& raster) {
  require(raster.columns >= 1 && raster.rows >= 1, "a raster has cells");
  require(raster.values.size() ==
              static_cast<std::size_t>(raster.columns) * static_cast<std::size_t>(raster.rows),
          "as many values as the header says");
  require(raster.cell_m > 0.0 && std::isfinite(raster.cell_m), "a cell has a size");
  require(std::isfinite(raster.east_m()) && std::isfinite(raster.north_m()), "edges are finite");
  for (const double value : raster.values) {
    require(std::isnan(value) || std::isfinite(value), "values are finite or unknown");
  }
  constexpr int kDecimals = 6;
  const std::string text = leadline::host::format_esri_ascii(raster, kDecimals);
  const Raster again = leadline::host::parse_esri_ascii(text, "again.asc");
  require(again.columns == raster.columns && again.rows == raster.rows, "same size again");
  require(again.west_m == raster.west_m && again.south_m == raster.south_m &&
              again.cell_m == raster.cell_m,
          "same place again");
  for (std::size_t i = 0; i < raster.values.size(); ++i) {
    require(std::isnan(again.values[i]) == std::isnan(raster.values[i]), "same known cells again");
    const double error = std::fabs(again.values[i] - raster.values[i]);
    // Half a digit, the one digit that keeps a value apart from nodata, and the last bit.
    require(std::isnan(error) || error <= 1.51e-6 + 1e-15 * std::fabs(raster.values[i]),
            "same values again");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  Raster raster;
  try {
    raster = leadline::host::parse_esri_ascii(text, "fuzz.asc");
  } catch (const HostError& error) {
    require(error.code() == ExitCode::kInput, "bad text is an input error");
    const std::string message = error.what();
    require(message.rfind("fuzz.asc:", 0) == 0, "messages name the file");
    require(message.size() < 1000, "messages are short");
    for (const char c : message) {
      require(c >= 0x20 && c < 0x7F, "messages are printable");
    }
    return 0;
  }
  check(raster);
  return 0;
}
