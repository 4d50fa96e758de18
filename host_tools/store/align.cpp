#include "host_tools/store/align.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <ogr_srs_api.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

/// Cells that lie closer than this are the same.
constexpr double kSame_cells = 0.01;
constexpr double kMostTurn_cells = 0.25;

struct Offset {
  double east_m = 0.0;
  double north_m = 0.0;
};

[[noreturn]] void refuse(const MapSource& map, const std::string& reason) {
  throw HostError(ExitCode::kInput, map.origin + ": " + reason);
}

/// A point of another map's frame in the frame of the first.
class FrameShift {
 public:
  FrameShift(const GeoReference& first, const GeoReference& other) {
    const bool same = first.lat_deg == other.lat_deg && first.lon_deg == other.lon_deg &&
                      (first.lat_deg.has_value() || first.epsg == other.epsg);
    if (!same) {
      from_ = std::make_unique<GeographicFrame>(other);
      to_ = std::make_unique<GeographicFrame>(first);
    }
  }

  /// Where `point` of the other frame lies in the first: inverted by iteration, since both frames are close
  /// to the plane they touch.
  [[nodiscard]] Offset at(Offset point) const {
    if (!from_) {
      return point;
    }
    const GeographicPoint wanted = from_->at(point.east_m, point.north_m);
    Offset found = point;
    // Degrees to metres by the frame's own slopes; each round gains some six digits.
    for (int round = 0; round < 4; ++round) {
      constexpr double kStep_m = 10.0;
      const GeographicPoint here = to_->at(found.east_m, found.north_m);
      const GeographicPoint east = to_->at(found.east_m + kStep_m, found.north_m);
      const GeographicPoint north = to_->at(found.east_m, found.north_m + kStep_m);
      const double a = (east.longitude_deg - here.longitude_deg) / kStep_m;
      const double b = (north.longitude_deg - here.longitude_deg) / kStep_m;
      const double c = (east.latitude_deg - here.latitude_deg) / kStep_m;
      const double d = (north.latitude_deg - here.latitude_deg) / kStep_m;
      const double lon = wanted.longitude_deg - here.longitude_deg;
      const double lat = wanted.latitude_deg - here.latitude_deg;
      const double determinant = a * d - b * c;
      found.east_m += (lon * d - lat * b) / determinant;
      found.north_m += (lat * a - lon * c) / determinant;
    }
    return found;
  }

 private:
  std::unique_ptr<GeographicFrame> from_;
  std::unique_ptr<GeographicFrame> to_;
};

/// How far the map's frame is moved, and that it is hardly turned.
Offset shift_of(const MapSource& first, const MapSource& map) {
  const bool first_placed = GeographicFrame::has_place(first.reference);
  const bool placed = GeographicFrame::has_place(map.reference);
  if (first_placed != placed) {
    refuse(map, std::string(placed ? "has a place on Earth, " : "has no place on Earth, ") +
                    first.origin + (placed ? " has none" : " has one"));
  }
  if (!placed) {
    return {};
  }
  const FrameShift frame(first.reference, map.reference);
  const Raster& raster = map.elevation;
  const Offset middle = {0.5 * (raster.west_m + raster.east_m()),
                         0.5 * (raster.south_m + raster.north_m())};
  const Offset there = frame.at(middle);
  const Offset shift = {there.east_m - middle.east_m, there.north_m - middle.north_m};
  for (const double east_m : {raster.west_m, raster.east_m()}) {
    for (const double north_m : {raster.south_m, raster.north_m()}) {
      const Offset corner = frame.at({east_m, north_m});
      const double off_cells = std::hypot(corner.east_m - east_m - shift.east_m,
                                          corner.north_m - north_m - shift.north_m) /
                               raster.cell_m;
      // Asked positively, so that a NaN is refused.
      if (!(off_cells <= kMostTurn_cells)) {
        refuse(map, "its north is not that of " + first.origin +
                        ": turned against it by more than 1/4 cell over the map");
      }
    }
  }
  return shift;
}

/// Cells between the edges of two grids of one cell size: fractions of a cell remain.
double cells_between(double a_m, double b_m, double cell_m) { return (a_m - b_m) / cell_m; }

/// A raster of the common grid with the values of `raster`, whose corner lies `column`, `row` cells from the
/// common one's north-west.
Raster resampled(const Raster& raster, const Raster& grid, double column, double row) {
  Raster result = grid;
  std::fill(result.values.begin(), result.values.end(), kNoValue);
  const auto whole_column = static_cast<int>(std::floor(column + kSame_cells));
  const auto whole_row = static_cast<int>(std::floor(row + kSame_cells));
  const double right = std::max(0.0, column - whole_column);
  const double down = std::max(0.0, row - whole_row);
  const bool same = right <= kSame_cells && down <= kSame_cells;
  for (int r = 0; r < grid.rows; ++r) {
    for (int c = 0; c < grid.columns; ++c) {
      // The common cell lies between source cells (sr - 1, sc - 1) and (sr, sc).
      const int sr = r - whole_row;
      const int sc = c - whole_column;
      if (same) {
        if (raster.contains(sr, sc)) {
          result.at(r, c) = raster.at(sr, sc);
        }
        continue;
      }
      double sum = 0.0;
      for (const int up : {0, 1}) {
        for (const int left : {0, 1}) {
          const double weight = (up == 1 ? down : 1.0 - down) * (left == 1 ? right : 1.0 - right);
          if (weight > 0.0) {
            sum += weight *
                   (raster.contains(sr - up, sc - left) ? raster.at(sr - up, sc - left) : kNoValue);
          }
        }
      }
      result.at(r, c) = sum;
    }
  }
  return result;
}

}  // namespace

std::vector<AlignedMap> align_maps(const std::vector<MapSource>& maps) {
  const Raster& first = maps.front().elevation;
  const double cell_m = first.cell_m;
  std::vector<Offset> shifts;
  // Edges of the common grid, in cells from the first map's corner: whole ones.
  int west = 0;
  int south = 0;
  int east = first.columns;
  int north = first.rows;
  for (const MapSource& map : maps) {
    if (!map.sigma) {
      refuse(map, "has no sigma: without one there is neither a weight nor a significance");
    }
    if (std::fabs(map.elevation.cell_m / cell_m - 1.0) > 1e-6) {
      refuse(map, "has " + describe_geometry(map.elevation) + ", " + maps.front().origin + " has " +
                      describe_geometry(first));
    }
    const Offset shift = shift_of(maps.front(), map);
    shifts.push_back(shift);
    const double west_cells =
        cells_between(map.elevation.west_m + shift.east_m, first.west_m, cell_m);
    const double south_cells =
        cells_between(map.elevation.south_m + shift.north_m, first.south_m, cell_m);
    constexpr double kFarthest_cells = 1e8;
    if (!(std::fabs(west_cells) < kFarthest_cells && std::fabs(south_cells) < kFarthest_cells)) {
      refuse(map, "is too far from " + maps.front().origin + " for one grid");
    }
    west = std::min(west, static_cast<int>(std::floor(west_cells + kSame_cells)));
    south = std::min(south, static_cast<int>(std::floor(south_cells + kSame_cells)));
    east = std::max(east,
                    static_cast<int>(std::ceil(west_cells - kSame_cells)) + map.elevation.columns);
    north = std::max(north,
                     static_cast<int>(std::ceil(south_cells - kSame_cells)) + map.elevation.rows);
  }
  const double cells = static_cast<double>(east - west) * static_cast<double>(north - south);
  if (cells > static_cast<double>(kMaxRasterCells)) {
    refuse(maps.back(), "is too far from " + maps.front().origin + " for one grid");
  }
  const Raster grid = make_raster(east - west, north - south, first.west_m + west * cell_m,
                                  first.south_m + south * cell_m, cell_m);
  std::vector<AlignedMap> aligned;
  for (std::size_t k = 0; k < maps.size(); ++k) {
    const Raster& raster = maps[k].elevation;
    const double column = cells_between(raster.west_m + shifts[k].east_m, grid.west_m, cell_m);
    const double row = cells_between(grid.north_m(), raster.north_m() + shifts[k].north_m, cell_m);
    const double off_column = column - std::round(column);
    const double off_row = row - std::round(row);
    const double off = std::hypot(off_column, off_row);
    aligned.push_back({resampled(raster, grid, column, row),
                       resampled(*maps[k].sigma, grid, column, row),
                       off <= kSame_cells ? 0.0 : off});
  }
  return aligned;
}

void check_datums(const std::vector<MapSource>& maps, const std::string& hint) {
  const MapSource* first = nullptr;
  for (const MapSource& map : maps) {
    const std::string datum = map.reference.vertical_datum.value_or("");
    if (datum.empty()) {
      continue;
    }
    if (first != nullptr && datum != *first->reference.vertical_datum) {
      refuse(map, "its depths count from \"" + printable(datum, 64) + "\", those of " +
                      first->origin + " from \"" + printable(*first->reference.vertical_datum, 64) +
                      "\"" + hint);
    }
    first = first == nullptr ? &map : first;
  }
}

void check_evidence(const std::vector<MapSource>& maps, const std::vector<AlignedMap>& aligned) {
  constexpr std::size_t kLeastCommon_cells = 16;  // fewer may agree by chance
  for (std::size_t a = 0; a < aligned.size(); ++a) {
    for (std::size_t b = a + 1; b < aligned.size(); ++b) {
      std::size_t common = 0;
      std::size_t same = 0;
      for (std::size_t k = 0; k < aligned[a].elevation.values.size(); ++k) {
        const double elevation = aligned[a].elevation.values[k];
        const bool both = !std::isnan(elevation) && !std::isnan(aligned[b].elevation.values[k]);
        common += both ? 1 : 0;
        same += both && elevation == aligned[b].elevation.values[k] &&
                        aligned[a].sigma.values[k] == aligned[b].sigma.values[k]
                    ? 1
                    : 0;
      }
      if (common >= kLeastCommon_cells && 2 * same >= common) {
        refuse(maps[b], std::to_string(same) + " of the " + std::to_string(common) +
                            " cells that it shares with " + maps[a].origin +
                            " are the very same: one survey, whose evidence would count twice");
      }
    }
  }
}

}  // namespace leadline::host
