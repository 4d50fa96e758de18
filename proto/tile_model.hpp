// What the tile coder expects: its bit models and where they start. Frozen in proto/SPEC.md.
#pragma once

#include <cstdint>

#include "proto/range_coder.hpp"

namespace leadline::proto {

struct TileModel {
  BitModel bits[512];
};

}  // namespace leadline::proto
