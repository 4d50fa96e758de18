#include "host_tools/table/table_io.hpp"

#include <cmath>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/table/table_math.hpp"

namespace leadline::host {
namespace {

using model::LocalizationTable;

constexpr double kQ24 = 0x1.0p24;
constexpr double kQ30 = 0x1.0p30;

__attribute__((format(printf, 1, 2))) std::string print(const char* format, ...) {
  char text[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof(text), format, arguments);
  va_end(arguments);
  return text;
}

const char* kind_name(model::BeamKind kind) {
  switch (kind) {
    case model::BeamKind::kCone:
      return "cone";
    case model::BeamKind::kPiston:
      return "piston";
    case model::BeamKind::kRectangle:
      return "rectangle";
    case model::BeamKind::kMeasured:
      return "measured";
  }
  return "unknown";
}

/// The table's numbers in the units that people use.
struct Reading {
  double envelope_deg[2];
  double sigma_beam_deg[2];
  double sigma_pointing_deg;
  double detection_fraction;
  double discarded_percent;
  double excess_error;
  double profile_error;
  double kernel_error;
  double kernel_moment_cells;
};

Reading read(const LocalizationTable& table) {
  const auto degrees = [](double tangent) {
    return exact::atan2(tangent, 1.0) * exact::kDegPerRad;
  };
  const auto sigma_deg = [&](std::uint32_t variance_q30) {
    return degrees(std::sqrt(variance_q30 / kQ30));
  };
  return {
      {degrees(table.tan_envelope_along_q24 / kQ24), degrees(table.tan_envelope_across_q24 / kQ24)},
      {sigma_deg(table.beam_variance_along_q30), sigma_deg(table.beam_variance_across_q30)},
      sigma_deg(table.pointing_variance_q30),
      table.detection_fraction_q16 / 65536.0,
      table.discarded_energy_ppm / 1e4,
      table.error_excess_q30 / kQ30,
      table.error_profile_q15 / 32767.0,
      table.error_kernel_q15 / static_cast<double>(model::kKernelSum),
      table.error_kernel_moment_q15 / static_cast<double>(model::kKernelSum)};
}

}  // namespace

std::string table_to_text(const LocalizationTable& table) {
  const Reading r = read(table);
  const bool two_axis = table.two_axis != 0;
  std::string text = print("Beam: %s, %s\n", kind_name(table.beam_kind),
                           two_axis ? "different along and across" : "axisymmetric");
  if (two_axis) {
    text += print("Envelope half-angle: %.4f deg along, %.4f deg across\n", r.envelope_deg[0],
                  r.envelope_deg[1]);
    text += print("Two-way beam sigma: %.4f deg along, %.4f deg across\n", r.sigma_beam_deg[0],
                  r.sigma_beam_deg[1]);
  } else {
    text += print("Envelope half-angle: %.4f deg\n", r.envelope_deg[0]);
    text += print("Two-way beam sigma: %.4f deg per axis\n", r.sigma_beam_deg[0]);
  }
  text += print("Energy discarded outside the envelope: %.4f %%\n", r.discarded_percent);
  text += print("Pointing sigma: %.4f deg per axis; range sigma: %.3f mm\n", r.sigma_pointing_deg,
                table.sigma_range_um / 1000.0);
  text += print("Detection at %.4f of the echo's energy\n", r.detection_fraction);
  text += print("Worst errors of the stored integers, between entries too:\n");
  text += print("  first return    %.2e of the range\n", r.excess_error);
  text += print("  lateral profile %.2e of the peak\n", r.profile_error);
  text += print(
      "  range kernel    %.2e of a row's sum (%d phases for a continuous one), first moment "
      "%.2e cells\n",
      r.kernel_error, model::kKernelPhases, r.kernel_moment_cells);
  text += print("Table: version %u, %u bytes, CRC-32C 0x%08x", unsigned{table.version},
                table.size_bytes, table.crc32c);
  return text;
}

std::string table_to_json(const LocalizationTable& table) {
  const Reading r = read(table);
  return print("{\"beam\": \"%s\", \"two_axis\": %s, ", kind_name(table.beam_kind),
               table.two_axis != 0 ? "true" : "false") +
         print("\"envelope_deg\": [%.6f, %.6f], \"sigma_beam_deg\": [%.6f, %.6f], ",
               r.envelope_deg[0], r.envelope_deg[1], r.sigma_beam_deg[0], r.sigma_beam_deg[1]) +
         print("\"discarded_energy_percent\": %.4f, \"sigma_pointing_deg\": %.6f, ",
               r.discarded_percent, r.sigma_pointing_deg) +
         print("\"sigma_range_mm\": %.3f, \"detection_fraction\": %.6f, ",
               table.sigma_range_um / 1000.0, r.detection_fraction) +
         print("\"error_first_return\": %.6e, \"error_profile\": %.6e, ", r.excess_error,
               r.profile_error) +
         print("\"error_kernel\": %.6e, \"error_kernel_moment_cells\": %.6e, ", r.kernel_error,
               r.kernel_moment_cells) +
         print("\"version\": %u, \"size_bytes\": %u, \"table_crc\": \"0x%08x\"}",
               unsigned{table.version}, table.size_bytes, table.crc32c);
}

void save_table(const std::string& path, const LocalizationTable& table) {
  write_file_whole(path, std::string_view(reinterpret_cast<const char*>(&table), sizeof(table)));
}

}  // namespace leadline::host
