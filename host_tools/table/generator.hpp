// From a beam's physical description to the localization table that the vehicle loads.
//
//   const BeamDescription beam = beam_description(config.sonar);   // or filled in by hand
//   const GeneratedTable generated = generate_table(beam);
//   save_table("beam.llt", generated.table);                       // table_io.hpp
//
// Byte-identical on every host and at every optimization level: see table_math.hpp. Takes 0.1 to
// 0.3 s.
#pragma once

#include <string>

#include "host_tools/table/beam_pattern.hpp"
#include "model/localization_table.hpp"

namespace leadline::host {

/// What the table does not carry, for reports. Errors are against the functions in double
/// precision, over the whole domain, between entries too.
struct TableFacts {
  double envelope_deg[2] = {0.0, 0.0};
  BeamCut cut[2] = {BeamCut::kConeEdge, BeamCut::kConeEdge};
  double discarded_fraction = 0.0;
  double sigma_beam_deg[2] = {0.0, 0.0};  ///< arc tangent of the table's beam sigma
  double worst_excess_error = 0.0;        ///< of cos + excess, a fraction of the range
  /// The same up to 75 degrees of incidence: beyond, pointing error meets grazing rays, the
  /// function bends sharply, and the last entries carry nearly all of the error.
  double worst_excess_error_to_75deg = 0.0;
  double worst_profile_error = 0.0;  ///< of the peak
  double worst_kernel_error = 0.0;   ///< of the row's sum, 16 phases for a continuous one included
  double worst_kernel_moment_cells = 0.0;
};

struct GeneratedTable {
  model::LocalizationTable table{};
  TableFacts facts;
  std::string report;  ///< facts as text, several lines
};

/// Throws HostError kUsage for a description that is outside its limits.
[[nodiscard]] GeneratedTable generate_table(const BeamDescription& beam);

}  // namespace leadline::host
