// Parameters of what is simulated, checked where they are used.
#pragma once

#include <stdexcept>
#include <string>

#include "host_tools/settings.hpp"

namespace leadline::host {

/// Throws std::invalid_argument "FIELD must be RANGE, got VALUE" unless `ok`.
inline void require(bool ok, const std::string& field, double value, const char* range) {
  if (!ok) {
    throw std::invalid_argument(field + " must be " + range + ", got " + number_text(value));
  }
}

}  // namespace leadline::host
