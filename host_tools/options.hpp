// What a command line may not say. Every refusal ends the command: HostError kUsage.
#pragma once

#include <string>

#include "firmware/config/toml_reader.hpp"

namespace leadline::host {

[[noreturn]] void usage_error(const std::string& message);

/// "OPTION VALUE: has to be LIMITS, MEANING" unless the value lies within the limits; NaN never does.
void check_limits(const char* option, double value, const Limits& limits,
                  const std::string& meaning = "");

}  // namespace leadline::host
