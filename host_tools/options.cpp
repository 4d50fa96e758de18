#include "host_tools/options.hpp"

#include "host_tools/exit_codes.hpp"
#include "host_tools/settings.hpp"

namespace leadline::host {

void usage_error(const std::string& message) { throw HostError(ExitCode::kUsage, message); }

void check_limits(const char* option, double value, const Limits& limits,
                  const std::string& meaning) {
  if (!limits.contain(value)) {
    usage_error(std::string(option) + " " + number_text(value) + ": has to be " + limits.text() +
                (meaning.empty() ? "" : ", " + meaning));
  }
}

}  // namespace leadline::host
