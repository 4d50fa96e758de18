// Exit codes and HostError, shared with the vehicle's program: they live where both may include them.
#pragma once

#include "firmware/config/exit_codes.hpp"  // IWYU pragma: export
