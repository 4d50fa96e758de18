// `leadline calibrate`: the patch test of host_tools/calibrate.hpp over recordings or pings files.
#pragma once

#include <string>
#include <vector>

#include "host_tools/calibrate.hpp"
#include "host_tools/import/survey_command.hpp"

namespace leadline::host {

struct CalibrateOptions {
  /// Paths: all .csv (pings, one line each), or all what `leadline survey` reads. Geometry, origin,
  /// profile: as given so far; what is found is added to it.
  SurveyOptions survey;
  CalibrationSettings settings;
  bool no_check = false;  ///< do not try the signs of roll and pitch turned round
  bool json = false;
};

/// A flipped sign is called right when it takes that share of the spread away, both with the best alignment.
inline constexpr double kWrongCalibrationShare = 0.15;

/// By its ending: pings (.csv), not a recording.
[[nodiscard]] bool is_pings_path(const std::string& path);

/// The command: prints each parameter with its sigma, or why it has none, and the options that say the
/// result to `leadline survey`. Returns 0; kInput when no parameter can be observed. Throws HostError:
/// kInput (files, too few soundings that overlap, no convergence, a sign turned round agrees better),
/// kUsage (pings and recordings mixed; one of lat and lon).
int run_calibrate(const CalibrateOptions& options);

}  // namespace leadline::host
