#include "host_tools/calibrate_command.hpp"

#include <algorithm>
#include <iostream>
#include <memory>
#include <optional>

#include "host_tools/calibrate_sources.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

std::string fixed_text(double value, int digits) {
  std::string text;
  append_fixed(&text, value, digits);
  return text;
}

/// Digits behind the point that a value of this sigma deserves.
int digits_for(double sigma) {
  int digits = 0;
  for (double unit = 1.0; digits < 5 && sigma < 2.0 * unit; unit *= 0.1) {
    ++digits;
  }
  return digits;
}

/// What the parameters start from.
Alignment given_by(const SurveyGeometry& geometry) {
  return {geometry.boresight.roll_deg,
          geometry.boresight.pitch_deg,
          geometry.boresight.heading_deg,
          1e-3 * static_cast<double>(geometry.attitude_delay_us),
          geometry.lever_arm_m.x,
          geometry.lever_arm_m.y,
          1e-3 * static_cast<double>(geometry.position_delay_us)};
}

/// The source and everything that it refers to.
struct Input {
  SurveyInput survey;
  std::unique_ptr<AlignedSoundings> source;
};

void read_input(const CalibrateOptions& options, Input* input) {
  const std::vector<std::string>& paths = options.survey.paths;
  const auto csv_count = std::count_if(paths.begin(), paths.end(), is_pings_path);
  if (csv_count == 0) {
    read_survey(options.survey, "calibrate", &input->survey);
    input->source = std::make_unique<RecordedSoundings>(input->survey.lines, input->survey.plane,
                                                        input->survey.geometry);
  } else if (csv_count == static_cast<std::ptrdiff_t>(paths.size())) {
    auto pings = std::make_unique<PingSoundings>(options.survey.geometry);
    PingCsvOptions reading;
    reading.message = [](const std::string& text) {
      std::cerr << "leadline: calibrate: " << text << "\n";
    };
    for (const std::string& path : paths) {
      pings->add_line(read_ping_csv(path, reading, nullptr));
    }
    input->source = std::move(pings);
  } else {
    throw HostError(ExitCode::kUsage,
                    "pings (.csv) and recordings cannot be calibrated together: make pings of the "
                    "recordings (`leadline survey`)");
  }
  if (input->source->blocks().empty()) {
    throw HostError(ExitCode::kInput, paths.front() + ": no sounding in it");
  }
}

/// One fit, or why there is none.
struct Attempt {
  std::optional<Calibration> calibration;
  std::string error;
};

Attempt attempt(const AlignedSoundings& source, const CalibrationSettings& settings,
                SignFlip flip) {
  Attempt result;
  try {
    result.calibration = calibrate(source, settings, flip);
  } catch (const HostError& error) {
    result.error = error.what();
  }
  return result;
}

/// Throws when the given signs lead nowhere, or another one leads to a smaller spread.
void check_signs_of(const AlignedSoundings& source, const CalibrationSettings& settings,
                    const Attempt& given) {
  struct Turn {
    SignFlip flip;
    const char* name;
  };
  constexpr Turn kTurns[] = {{SignFlip::kRoll, "roll"}, {SignFlip::kPitch, "pitch"}};
  std::string better;
  for (const Turn& turn : kTurns) {
    const Attempt turned = attempt(source, settings, turn.flip);
    if (!turned.calibration) {
      continue;
    }
    const double spread_m = turned.calibration->spread_after_m;
    if (!given.calibration ||
        spread_m < (1.0 - kWrongCalibrationShare) * given.calibration->spread_after_m) {
      better += std::string(better.empty() ? "" : "; ") + fixed_text(100.0 * spread_m, 2) +
                " cm with " + turn.name + " flipped";
    }
  }
  if (better.empty() && given.calibration) {
    return;
  }
  if (better.empty()) {
    throw HostError(ExitCode::kInput, given.error);
  }
  throw HostError(
      ExitCode::kInput,
      "a sign looks wrong: " +
          (given.calibration ? "soundings of one cell lie " +
                                   fixed_text(100.0 * given.calibration->spread_after_m, 2) +
                                   " cm apart at best as given"
                             : given.error) +
          ", but " + better + "; turn it round (--flip)");
}

void print_text(const Calibration& result, const Alignment& given) {
  std::cout << "soundings      " << result.soundings << " in " << result.cells
            << " cells, of which " << result.shared_cells
            << " of two passes or more\nspread         "
            << fixed_text(100.0 * result.spread_before_m, 2)
            << " cm about the cells' planes as given, "
            << fixed_text(100.0 * result.spread_after_m, 2) << " cm with what was found\n";
  Alignment total = given;
  for (std::size_t p = 0; p < kAlignmentParameters; ++p) {
    const CalibratedParameter& parameter = result.parameters[p];
    const AlignmentTraits& traits = kAlignmentTraits[p];
    if (!parameter.fitted) {
      continue;
    }
    std::string name = traits.name;
    name.resize(17, ' ');
    if (!parameter.observable) {
      std::cout << name << "not observable: " << parameter.why_not << "\n";
      continue;
    }
    total[p] += parameter.value;
    const int digits = digits_for(parameter.sigma);
    std::cout << name << fixed_text(total[p], digits) << " +- "
              << fixed_text(parameter.sigma, digits) << " " << traits.unit << "   ("
              << fixed_text(parameter.value, digits) << " from what was given)\n";
  }
  std::cout << "options        --boresight";
  for (std::size_t p = 0; p < 3; ++p) {
    std::cout << " " << fixed_text(total[p], 3);
  }
  std::cout << " --attitude-delay " << fixed_text(total[3], 1) << " --lever-arm "
            << fixed_text(total[4], 3) << " " << fixed_text(total[5], 3) << " DOWN\n";
}

void print_json(const Calibration& result, const Alignment& given) {
  std::cout << "{\n  \"soundings\": " << result.soundings << ",\n  \"cells\": " << result.cells
            << ",\n  \"shared_cells\": " << result.shared_cells
            << ",\n  \"steps\": " << result.steps
            << ",\n  \"spread_before_m\": " << json_number(result.spread_before_m)
            << ",\n  \"spread_after_m\": " << json_number(result.spread_after_m)
            << ",\n  \"parameters\": {";
  bool first = true;
  for (std::size_t p = 0; p < kAlignmentParameters; ++p) {
    const CalibratedParameter& parameter = result.parameters[p];
    const AlignmentTraits& traits = kAlignmentTraits[p];
    if (!parameter.fitted) {
      continue;
    }
    const std::string unit = std::string("_") + traits.unit;
    std::cout << (first ? "" : ",") << "\n    " << json_string(traits.name)
              << ": {\"observable\": " << (parameter.observable ? "true" : "false");
    if (parameter.observable) {
      std::cout << ", \"value" << unit << "\": " << json_number(given[p] + parameter.value)
                << ", \"change" << unit << "\": " << json_number(parameter.value) << ", \"sigma"
                << unit << "\": " << json_number(parameter.sigma) << "}";
    } else {
      std::cout << ", \"why_not\": " << json_string(parameter.why_not) << "}";
    }
    first = false;
  }
  std::cout << "\n  }\n}\n";
}

}  // namespace

bool is_pings_path(const std::string& path) {
  return path.size() >= 4 && path.compare(path.size() - 4, 4, ".csv") == 0;
}

int run_calibrate(const CalibrateOptions& options) {
  Input input;
  read_input(options, &input);
  const Attempt given = attempt(*input.source, options.settings, SignFlip::kNone);
  if (!options.no_check) {
    check_signs_of(*input.source, options.settings, given);
  }
  if (!given.calibration) {
    throw HostError(ExitCode::kInput, given.error);
  }
  const Alignment start = given_by(options.survey.geometry);
  if (options.json) {
    print_json(*given.calibration, start);
  } else {
    print_text(*given.calibration, start);
  }
  const auto& parameters = given.calibration->parameters;
  const bool any = std::any_of(parameters.begin(), parameters.end(),
                               [](const CalibratedParameter& p) { return p.observable; });
  return static_cast<int>(any ? ExitCode::kOk : ExitCode::kInput);
}

}  // namespace leadline::host
