// What the tile coder expects to see: its bit models, and where they start in every packet. The numbers
// are frozen in proto/SPEC.md ("Tile model"); tests/tools/tile_model_table.cpp made them.
#pragma once

#include <cstdint>

#include "proto/range_coder.hpp"

namespace leadline::proto {

inline constexpr int kMaskDensities = 4;
inline constexpr int kMaskPatterns = 16;
inline constexpr int kNeighbourStates = 3;
inline constexpr int kSigmaContexts = 14;
inline constexpr int kSigmaMagnitudes = 6;
inline constexpr int kActivities = 14;
inline constexpr int kFractions = 4;
inline constexpr int kDepthMagnitudes = 10;
inline constexpr int kExponents = 20;

/// Models of one packet: nothing but BitModels, in the order of the SPEC's table.
struct TileModel {
  BitModel mask[kMaskDensities][kMaskPatterns];
  BitModel unknown[kNeighbourStates];
  BitModel multi_surface[kNeighbourStates];
  BitModel other_flags;
  BitModel sigma_same[kSigmaContexts];
  BitModel sigma_up[kSigmaContexts];
  BitModel sigma_more[kSigmaContexts][kSigmaMagnitudes];
  BitModel depth_same[kActivities][kFractions];
  BitModel depth_toward[kActivities][kFractions];
  BitModel depth_more[kActivities][kDepthMagnitudes];
  BitModel exponent_more[kExponents];
};
inline constexpr int kTileModels = static_cast<int>(sizeof(TileModel) / sizeof(BitModel));
static_assert(kTileModels == 455, "the table of the SPEC has one byte for each");

/// The model as every packet begins with it. O(1) in everything but the copy.
void start_tile_model(TileModel& model);

}  // namespace leadline::proto
