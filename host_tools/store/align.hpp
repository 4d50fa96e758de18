// Maps of several surveys on one grid.
#pragma once

#include <vector>

#include "host_tools/export/map_source.hpp"

namespace leadline::host {

/// A map on the common grid.
struct AlignedMap {
  Raster elevation;  ///< metres up
  Raster sigma;      ///< metres
  /// How far the map's own cells were from those of the common grid, in cells, before it was brought there:
  /// 0 = the very cells.
  double shift_cells = 0.0;
};

/// All maps on the grid of the first, made large enough for all. Between maps with a place on Earth the
/// difference of their origins counts; without any, local metres are taken to be the same.
///
/// Cells that lie within 1/100 cell of the common ones are taken as they are; others are interpolated
/// bilinearly between four known cells (sigma likewise: neighbours share their errors, so that nothing is
/// averaged down), and are unknown where one of the four is.
///
/// HostError kInput naming the map: no sigma; cells of another size; one with and one without a place;
/// frames that are turned against each other by more than 1/4 cell over the map.
[[nodiscard]] std::vector<AlignedMap> align_maps(const std::vector<MapSource>& maps);

/// HostError kInput naming a map whose depths count from another zero than those of one before it, as far as both say
/// what it is; `hint` ends the message.
void check_datums(const std::vector<MapSource>& maps, const std::string& hint);

/// HostError kInput naming a map that has half of the cells it shares with another one in the very depth and sigma of
/// that: it is the same survey, whose evidence would count twice. O(maps^2 * cells).
void check_evidence(const std::vector<MapSource>& maps, const std::vector<AlignedMap>& aligned);

}  // namespace leadline::host
