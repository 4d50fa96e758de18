// The cone of one ping as rows and columns of the grid see it: which of them it may cross. No voxel here.
#pragma once

#include <cstdint>

#include "model/cone_column.hpp"
#include "model/event.hpp"
#include "model/localization_table.hpp"

namespace leadline::model {

/// The cone of one ping with what its rows and columns have in common.
struct Frustum {
  Cone cone;
  std::int32_t origin_q10[3];  // transducer, from the grid's corner
  std::int32_t tip_q10[2];     // far end of the axis, from the transducer
  std::int32_t reach_q10;      // how far the cone extends along its heading
  bool two_axis;
  std::int32_t grow_along_q20;  // openings, two-axis tables only
  std::int32_t grow_across_q20;
  // Seen from above the cone is a band |y| <= radius: a row cuts it between (he dn +- radius) / hn.
  bool banded;
  std::int32_t band_slope_q20;  // below 2^24
  std::int32_t band_half_q10;   // limited to 2^30
  // And within lines, where they cut much off: two that leave a point behind the transducer, of a long cone that
  // holds no vertical, and one at the far end. In the row dn they lie at start + slope dn; of one that is almost a
  // row, start + slope dn >= 0 says which rows it leaves (kRow).
  struct Edge {
    enum class Side : std::uint8_t { kNone, kWest, kEast, kRow } side;
    std::int32_t start_q10;
    std::int32_t slope_q20;
  } edges[3];
  // And, if it is almost upright, within a circle about its far end; 0: it is not.
  std::int32_t disc_q10;
};

/// Frustum of `range_q10` cells along the beam's axis; 0 < range_q10.
[[nodiscard]] Frustum make_frustum(const Scale& scale, const LocalizationTable& table,
                                   const BeamFrame& frame, const Sighting& sighting,
                                   std::int32_t range_q10);

/// Rows of [0, cells) that the cone may cross.
[[nodiscard]] CellRange frustum_rows(const Frustum& frustum, std::int32_t cells);

/// Columns of [0, cells) that it may cross in the row `dn` north of the transducer: all in the box in which
/// cone_span() finds a depth, and few others.
[[nodiscard]] CellRange frustum_row(const Frustum& frustum, std::int32_t dn, std::int32_t cells);

/// Where a column stands from the transducer, Q10: north and east, and along the heading and across it.
struct ColumnOffset {
  std::int32_t dn;
  std::int32_t de;
  std::int32_t x;
  std::int32_t y;
};

[[nodiscard]] inline ColumnOffset column_offset(const Frustum& frustum, std::int32_t dn,
                                                std::int32_t de) {
  const std::int64_t hn = frustum.cone.heading_north_q20;
  const std::int64_t he = frustum.cone.heading_east_q20;
  return ColumnOffset{dn, de, static_cast<std::int32_t>((hn * dn + he * de) >> 20),
                      static_cast<std::int32_t>((hn * de - he * dn) >> 20)};
}

/// Whether it stands within the box along the heading that the cone lies in; nothing outside of it is written.
[[nodiscard]] inline bool in_box(const Frustum& frustum, std::int32_t x, std::int32_t y) {
  const std::int32_t radius = frustum.cone.radius_q10;
  // What is too small is larger than all that is not negative.
  return static_cast<std::uint32_t>(y + radius) <= static_cast<std::uint32_t>(2 * radius) &&
         static_cast<std::uint32_t>(x + radius) <=
             static_cast<std::uint32_t>(frustum.reach_q10 + radius);
}

}  // namespace leadline::model
