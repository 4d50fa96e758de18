// Files that a program reads: what stands against it is said once, in the same words everywhere. Host code.
#pragma once

#include <fstream>
#include <string>

#include "firmware/config/exit_codes.hpp"

namespace leadline::host {

/// Opened for reading, binary. Throws HostError `code` naming path and reason: a folder, not there, not permitted.
[[nodiscard]] std::ifstream open_input(const std::string& path, ExitCode code = ExitCode::kInput);

/// All of it. Throws as open_input() does, and when it cannot be read to its end.
[[nodiscard]] std::string read_input(const std::string& path, ExitCode code = ExitCode::kInput);

}  // namespace leadline::host
