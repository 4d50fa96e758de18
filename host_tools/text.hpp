// Text helpers, shared with the vehicle's program: they live where both may include them.
#pragma once

#include "firmware/config/text.hpp"  // IWYU pragma: export
