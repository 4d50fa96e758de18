#include "host_tools/export/outline.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

namespace leadline::host {
namespace {

/// Directions of a walk along the edges of cells, counter-clockwise with north up.
enum Heading : std::uint8_t { kEast = 0, kNorth = 1, kWest = 2, kSouth = 3 };
constexpr std::array<GridCorner, 4> kStep = {{{1, 0}, {0, -1}, {-1, 0}, {0, 1}}};

class OutlineTracer {
 public:
  explicit OutlineTracer(const Raster& raster)
      : raster_(raster),
        label_(raster.values.size(), -1),
        walked_(static_cast<std::size_t>(raster.rows + 1) *
                static_cast<std::size_t>(raster.columns + 1)) {}

  std::vector<CoveredArea> trace() {
    label_areas();
    for (int row = 0; row < raster_.rows; ++row) {
      for (int column = 0; column < raster_.columns; ++column) {
        if (!known(row, column)) {
          continue;
        }
        // The area's first cell has its north edge on the outer ring; every hole has a highest gap, whose
        // north edge is the south edge of a known cell.
        if (!known(row - 1, column) && !walked(column + 1, row, kWest)) {
          add_ring(row, column, walk({column + 1, row}, kWest));
        }
        if (!known(row + 1, column) && !walked(column, row + 1, kEast)) {
          add_ring(row, column, walk({column, row + 1}, kEast));
        }
      }
    }
    return std::move(areas_);
  }

 private:
  [[nodiscard]] bool known(int row, int column) const {
    return raster_.contains(row, column) && !std::isnan(raster_.at(row, column));
  }

  void label_areas() {
    std::vector<std::pair<int, int>> open;
    for (int row = 0; row < raster_.rows; ++row) {
      for (int column = 0; column < raster_.columns; ++column) {
        if (!known(row, column) || label_[raster_.index(row, column)] >= 0) {
          continue;
        }
        const auto label = static_cast<std::int32_t>(areas_.size());
        areas_.emplace_back();
        label_[raster_.index(row, column)] = label;
        open.emplace_back(row, column);
        while (!open.empty()) {
          const auto [r, c] = open.back();
          open.pop_back();
          areas_.back().cells += 1;
          for (const GridCorner& step : kStep) {
            const int next_row = r + step.row;
            const int next_column = c + step.column;
            if (known(next_row, next_column) && label_[raster_.index(next_row, next_column)] < 0) {
              label_[raster_.index(next_row, next_column)] = label;
              open.emplace_back(next_row, next_column);
            }
          }
        }
      }
    }
  }

  [[nodiscard]] std::size_t corner(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(raster_.columns + 1) +
           static_cast<std::size_t>(column);
  }
  [[nodiscard]] bool walked(int column, int row, Heading heading) const {
    return (walked_[corner(column, row)] >> heading & 1U) != 0;
  }

  /// Whether the edge from `at` along `heading` has a known cell on its left and none on its right.
  [[nodiscard]] bool is_border(GridCorner at, Heading heading) const {
    // Cells round a corner: north-west is (row - 1, column - 1).
    const bool north_west = known(at.row - 1, at.column - 1);
    const bool north_east = known(at.row - 1, at.column);
    const bool south_west = known(at.row, at.column - 1);
    const bool south_east = known(at.row, at.column);
    switch (heading) {
      case kEast:
        return north_east && !south_east;
      case kNorth:
        return north_west && !north_east;
      case kWest:
        return south_west && !north_west;
      case kSouth:
        break;
    }
    return south_east && !south_west;
  }

  /// The ring that leaves `start` along `heading`, known cells on the left.
  std::vector<GridCorner> walk(const GridCorner start, const Heading heading) {
    std::vector<GridCorner> ring;
    GridCorner at = start;
    Heading along = heading;
    do {
      walked_[corner(at.column, at.row)] |= static_cast<std::uint8_t>(1U << along);
      at = {at.column + kStep[along].column, at.row + kStep[along].row};
      // Left first: where two cells touch in a corner, the walk stays with its own.
      const Heading before = along;
      for (const unsigned turn : {1U, 0U, 3U}) {
        along = static_cast<Heading>((before + turn) & 3U);
        if (is_border(at, along)) {
          break;
        }
      }
      if (along != before) {
        ring.push_back(at);
      }
    } while (at.column != start.column || at.row != start.row || along != heading);
    return ring;
  }

  void add_ring(int row, int column, std::vector<GridCorner> ring) {
    CoveredArea& area = areas_[static_cast<std::size_t>(label_[raster_.index(row, column)])];
    std::int64_t doubled_area = 0;
    for (std::size_t k = 0; k < ring.size(); ++k) {
      const GridCorner& a = ring[k];
      const GridCorner& b = ring[(k + 1) % ring.size()];
      // Rows count downwards: the sign is turned.
      doubled_area += std::int64_t{b.column} * a.row - std::int64_t{a.column} * b.row;
    }
    if (doubled_area > 0) {
      area.outer = std::move(ring);
    } else {
      area.holes.push_back(std::move(ring));
    }
  }

  const Raster& raster_;
  std::vector<std::int32_t> label_;   ///< area of each cell, -1 = none
  std::vector<std::uint8_t> walked_;  ///< per corner: headings that a ring left it along
  std::vector<CoveredArea> areas_;
};

}  // namespace

std::vector<CoveredArea> covered_areas(const Raster& raster) {
  return OutlineTracer(raster).trace();
}

}  // namespace leadline::host
