// Model::extract: depths and their uncertainty from the voxels (method 1.4; DESIGN.md "Extraction").
#include "model/base/fixed.hpp"
#include "model/model.hpp"

namespace leadline::model {
namespace {

using base::clamp;
using base::max_of;
using base::min_of;
using base::mul_shift;
using base::ratio;

constexpr std::int32_t kReach = 3;  // smoothing window 7 x 7
constexpr int kWindow = (2 * kReach + 1) * (2 * kReach + 1);

// A column without a vote of its own is lit when evidence in it ends no higher than this above its
// neighbours' surface: a cone ends the longest kernel's reach above the bottom, and a voxel or two.
constexpr std::int32_t kLitReach_q8 = (kKernelCentre + 2) * 256;

// Roughness: variance that terrain adds per (distance in cells)^4 when a column speaks for another.
// First pass, and limits of what the residuals of that pass may turn it into.
constexpr std::int32_t kRoughnessStart_q16 = 3277;   // 0.05
constexpr std::int64_t kRoughnessLeast_q16 = 328;    // 0.005
constexpr std::int64_t kRoughnessMost_q16 = 655360;  // 10
constexpr std::int64_t kRoughnessGain = 4;

// Noise of a column's depth at most, 1024 cells^2.
constexpr std::int64_t kMostNoise_q16 = 1 << 26;
// A neighbourhood's depths spread at least this much (median from the median): 3/4 cell.
constexpr std::int32_t kLeastSpread_q8 = 192;
// A depth that fewer pings than this stand for may be a false echo.
constexpr std::int64_t kLonePings = 2;

// Variance budget of a depth, Q8 factors (DESIGN.md "Sigma").
constexpr std::int64_t kNoiseFactor_q8 = 387;
constexpr std::int64_t kBlurFactor_q8 = 264;
constexpr std::int64_t kReliefFactor_q8 = 129;
constexpr std::int64_t kRegistrationFactor_q8 = 182;
constexpr std::int64_t kFloor_q16 = 662;  // a tenth of a cell: what a cell cannot say about itself

// Weighted least squares plane over a window; coordinates relative to its centre. Weights at most 2^14, |n|, |e|
// <= 3, |z| <= 2^15, kWindow columns at most: what has no z in it stays below 2^23, the others below 2^37.
struct PlaneSums {
  std::int32_t s, sn, se, snn, sne, see;
  std::int64_t sz, snz, sez;
};

struct Plane {
  std::int32_t centre_q8;  // at the window's centre
  std::int32_t north_q8;   // per cell
  std::int32_t east_q8;
};

// Products in 32 bits, as the limits above allow: a microcontroller has no others in one instruction.
void add(PlaneSums& sums, std::int32_t weight, std::int32_t n, std::int32_t e, std::int32_t z) {
  const std::int32_t weight_n = weight * n;
  const std::int32_t weight_e = weight * e;
  sums.s += weight;
  sums.sn += weight_n;
  sums.se += weight_e;
  sums.snn += weight_n * n;
  sums.sne += weight_n * e;
  sums.see += weight_e * e;
  sums.sz += static_cast<std::int64_t>(weight) * z;
  sums.snz += static_cast<std::int64_t>(weight_n) * z;
  sums.sez += static_cast<std::int64_t>(weight_e) * z;
}

// floor(2^40 / divisor), 1 <= divisor < 2^29. Where 64-bit division is a library's loop: by digits of the
// quotient, each one 32-bit division.
std::int64_t reciprocal_q40(std::uint32_t divisor) {
  if constexpr (sizeof(void*) > 4) {
    return static_cast<std::int64_t>((std::uint64_t{1} << 40U) / divisor);
  }
  constexpr std::uint32_t kFirst = 1U << 31U;
  std::uint64_t quotient = kFirst / divisor;
  std::uint32_t rest = kFirst % divisor;
  for (int digit = 0; digit < 3; ++digit) {
    rest <<= 3U;
    quotient = (quotient << 3U) | (rest / divisor);
    rest %= divisor;
  }
  return static_cast<std::int64_t>(quotient);
}

// Products of two sums stay below 2^58.
Plane solve(const PlaneSums& sums) {
  const auto product = [](std::int32_t a, std::int32_t b) {
    return static_cast<std::int64_t>(a) * b;
  };
  const std::int64_t ridge = (product(sums.s, sums.s) >> 6) + 1;  // 1/64 cell^2: a line is solvable
  std::int64_t cnn = product(sums.s, sums.snn) - product(sums.sn, sums.sn) + ridge;
  std::int64_t cee = product(sums.s, sums.see) - product(sums.se, sums.se) + ridge;
  std::int64_t cne = product(sums.s, sums.sne) - product(sums.sn, sums.se);
  std::int64_t cnz = sums.s * sums.snz - sums.sn * sums.sz;
  std::int64_t cez = sums.s * sums.sez - sums.se * sums.sz;
  const auto magnitude = [](std::int64_t v) { return static_cast<std::uint64_t>(v < 0 ? -v : v); };
  const int bits =
      64 - base::leading_zeros64(magnitude(cnn) | magnitude(cee) | magnitude(cnz) | magnitude(cez));
  const int shift = max_of(0, bits - 40);
  cnn = max_of<std::int64_t>(cnn >> shift, 1);
  cee = max_of<std::int64_t>(cee >> shift, 1);
  cne >>= shift;
  cnz >>= shift;
  cez >>= shift;
  const std::int64_t slant_q20 = ratio(cne, cee, 20);
  const std::int64_t pivot = max_of<std::int64_t>(cnn - mul_shift(slant_q20, cne, 20), 1);
  const std::int64_t north_q14 = ratio(cnz - mul_shift(slant_q20, cez, 20), pivot, 6);
  const std::int64_t east_q14 = ratio(cez - ((north_q14 * cne) >> 6), cee, 6);
  const std::int64_t centre_q14 =
      (sums.sz * 64 - north_q14 * sums.sn - east_q14 * sums.se) / sums.s;
  return Plane{static_cast<std::int32_t>((centre_q14 + 32) >> 6),
               static_cast<std::int32_t>(north_q14 >> 6), static_cast<std::int32_t>(east_q14 >> 6)};
}

// One past the deepest voxel with evidence of either kind; 0 when there is none.
std::int32_t evidence_end(const Voxel* voxels, std::int32_t depth_cells) {
  std::int32_t end = depth_cells;
  while (end > 0 && voxels[end - 1].hit == 0 && voxels[end - 1].miss == 0) {
    --end;
  }
  return end;
}

// A column of the smoothing window: place and depth relative to the middle one, noise of its depth.
struct Neighbour {
  std::int32_t e, z_q8, distance4;
  std::int32_t noise_q16;  // cells^2, 1 .. kMostNoise_q16
  bool lone;               // kColumnLone
};

// Those with a depth, row by row: what a row has in common is worked out once.
struct Window {
  struct Row {
    std::int32_t n;
    int end;  // one past its last column
  };
  Neighbour columns[kWindow];
  int count;
  Row rows[2 * kReach + 1];
  int row_count;
};

// Of a column's depth, from the evidence in it: unit / mass within limits. Units are below 2^32 but for cells of
// a sonar that no one builds.
std::int32_t column_noise_q16(std::int64_t unit_q16, std::uint32_t mass) {
  const std::int64_t noise_q16 = unit_q16 >> 32 == 0 ? static_cast<std::uint32_t>(unit_q16) / mass
                                                     : unit_q16 / static_cast<std::int64_t>(mass);
  return static_cast<std::int32_t>(clamp<std::int64_t>(noise_q16, 1, kMostNoise_q16));
}

std::int32_t distance(std::int32_t a, std::int32_t b) { return a < b ? b - a : a - b; }

// Of values[0 .. count - 1], which it puts into another order: by partition about what stands in the middle, which
// leaves less each time. Mostly O(count), at most O(count^2).
std::int32_t median(std::int32_t* values, int count) {
  const int middle = count / 2;
  int first = 0;
  int last = count - 1;
  while (first < last) {
    const std::int32_t pivot = values[middle];
    int i = first;
    int j = last;
    while (i <= j) {
      while (values[i] < pivot) {
        ++i;
      }
      while (pivot < values[j]) {
        --j;
      }
      if (i <= j) {
        const std::int32_t value = values[i];
        values[i] = values[j];
        values[j] = value;
        ++i;
        --j;
      }
    }
    first = j < middle ? i : first;
    last = middle < i ? j : last;
  }
  return values[middle];
}

// What one ping alone says far from what the neighbourhood says is taken for noise as large as that
// distance: a false echo where few pings passed. What two pings say stands.
void discount_lone(Neighbour* window, int count) {
  constexpr int kLeastColumns = 8;
  if (count < kLeastColumns) {
    return;
  }
  std::int32_t values[kWindow];
  std::int32_t least = INT32_MAX;
  std::int32_t most = INT32_MIN;
  std::int32_t least_lone = INT32_MAX;
  std::int32_t most_lone = INT32_MIN;
  for (int i = 0; i < count; ++i) {
    const std::int32_t z_q8 = window[i].z_q8;
    values[i] = z_q8;
    least = min_of(least, z_q8);
    most = max_of(most, z_q8);
    if (window[i].lone) {
      least_lone = min_of(least_lone, z_q8);
      most_lone = max_of(most_lone, z_q8);
    }
  }
  if (most_lone - least <= 4 * kLeastSpread_q8 && most - least_lone <= 4 * kLeastSpread_q8) {
    return;  // wherever the middle is, none is far from it
  }
  const std::int32_t middle_q8 = median(values, count);
  if (most_lone - middle_q8 <= 4 * kLeastSpread_q8 &&
      middle_q8 - least_lone <= 4 * kLeastSpread_q8) {
    return;
  }
  for (int i = 0; i < count; ++i) {
    values[i] = distance(window[i].z_q8, middle_q8);
  }
  const std::int32_t limit_q8 = 4 * max_of(median(values, count), kLeastSpread_q8);
  for (int i = 0; i < count; ++i) {
    const std::int64_t off_q8 = distance(window[i].z_q8, middle_q8);
    if (window[i].lone && off_q8 > limit_q8) {
      window[i].noise_q16 = static_cast<std::int32_t>(
          min_of<std::int64_t>(window[i].noise_q16 + 4 * off_q8 * off_q8, kMostNoise_q16));
    }
  }
}

// Weights 1 / (noise + roughness d^4) Q40, scaled so that the largest takes 14 bits; returns by how many bits. Their
// sum: below 2^29.
int weigh(const Window& window, std::int32_t roughness_q16, std::int32_t* weights) {
  std::uint32_t divisors[kWindow];
  std::uint32_t least = UINT32_MAX;
  for (int i = 0; i < window.count; ++i) {
    const Neighbour& column = window.columns[i];
    divisors[i] = static_cast<std::uint32_t>(column.noise_q16 + roughness_q16 * column.distance4);
    least = min_of(least, divisors[i]);
  }
  const auto largest = static_cast<std::uint64_t>(reciprocal_q40(least));
  const int shift = max_of(0, 50 - base::leading_zeros64(largest));
  // floor(floor(2^40 / d) / 2^shift) is floor(2^(40 - shift) / d): mostly one division of 32 bits.
  constexpr int kLeastNarrow = 9;
  if (shift >= kLeastNarrow) {
    const std::uint32_t one = 1U << static_cast<std::uint32_t>(40 - shift);
    for (int i = 0; i < window.count; ++i) {
      weights[i] = static_cast<std::int32_t>(one / divisors[i]);
    }
  } else {
    for (int i = 0; i < window.count; ++i) {
      weights[i] = static_cast<std::int32_t>(reciprocal_q40(divisors[i]) >> shift);
    }
  }
  return shift;
}

PlaneSums plane_sums(const Window& window, const std::int32_t* weights) {
  PlaneSums sums{};
  int i = 0;
  for (int r = 0; r < window.row_count; ++r) {
    const Window::Row& row = window.rows[r];
    PlaneSums own{};
    for (; i < row.end; ++i) {
      const Neighbour& column = window.columns[i];
      const std::int32_t weight_e = weights[i] * column.e;
      own.s += weights[i];
      own.se += weight_e;
      own.see += weight_e * column.e;
      own.sz += static_cast<std::int64_t>(weights[i]) * column.z_q8;
      own.sez += static_cast<std::int64_t>(weight_e) * column.z_q8;
    }
    sums.s += own.s;
    sums.sn += own.s * row.n;
    sums.se += own.se;
    sums.snn += own.s * row.n * row.n;
    sums.sne += own.se * row.n;
    sums.see += own.see;
    sums.sz += own.sz;
    sums.snz += own.sz * row.n;
    sums.sez += own.sez;
  }
  // No window is empty, and some weight in it takes 14 bits; who reads the function alone cannot know.
  sums.s = max_of(sums.s, 1);
  return sums;
}

// Weighted sums over a window: squares of what a plane leaves, and noise.
struct Residuals {
  std::int64_t squares, noise;
};

// Number: holds the plane's depths within the window, and twice that.
template <typename Number>
Residuals residuals_in(const Window& window, const std::int32_t* weights, const Plane& plane) {
  Residuals sums{};
  int i = 0;
  for (int r = 0; r < window.row_count; ++r) {
    const Window::Row& row = window.rows[r];
    const Number middle = plane.centre_q8 + static_cast<Number>(plane.north_q8) * row.n;
    for (; i < row.end; ++i) {
      const Neighbour& column = window.columns[i];
      const Number fit = middle + static_cast<Number>(plane.east_q8) * column.e;
      const auto miss = static_cast<std::int32_t>(clamp<Number>(column.z_q8 - fit, -16384, 16384));
      sums.squares += static_cast<std::int64_t>(weights[i] * miss) * miss;
      sums.noise += static_cast<std::int64_t>(weights[i]) * column.noise_q16;
    }
  }
  return sums;
}

Residuals residuals(const Window& window, const std::int32_t* weights, const Plane& plane) {
  constexpr std::int32_t kNarrow = 1 << 26;
  const auto narrow = [](std::int32_t value) { return value > -kNarrow && value < kNarrow; };
  return narrow(plane.centre_q8) && narrow(plane.north_q8) && narrow(plane.east_q8)
             ? residuals_in<std::int32_t>(window, weights, plane)
             : residuals_in<std::int64_t>(window, weights, plane);
}

// Slope of a result: from columns so far apart on either side.
constexpr std::int32_t kSlopeStep = 2;

// Where all four are known, as nearly everywhere.
bool whole_slope(const ColumnResult& north0, const ColumnResult& north1, const ColumnResult& east0,
                 const ColumnResult& east1, Slope& slope) {
  if (north0.depth_q8 == kUnknownDepth || north1.depth_q8 == kUnknownDepth ||
      east0.depth_q8 == kUnknownDepth || east1.depth_q8 == kUnknownDepth) {
    return false;
  }
  slope = Slope{((north1.depth_q8 - north0.depth_q8) * 16) / (2 * kSlopeStep),
                ((east1.depth_q8 - east0.depth_q8) * 16) / (2 * kSlopeStep)};
  return true;
}

/// What a horizontal variance, in cells^2 below 2^45, does to the depth on a slope of at most 2^22. From eight cells
/// of sigma on with fewer bits, and no more than 512 cells: the product has to fit.
std::int64_t along_slope_q16(std::int32_t slope_q12, std::int64_t variance_q12) {
  constexpr std::int64_t kExact_q12 = 1 << 18;
  constexpr std::int64_t kMost_q12 = 1 << 30;
  const std::int64_t square_q24 = static_cast<std::int64_t>(slope_q12) * slope_q12;
  return variance_q12 <= kExact_q12
             ? mul_shift(square_q24, variance_q12, 20)
             : mul_shift(square_q24 >> 12, min_of(variance_q12, kMost_q12), 8);
}

}  // namespace

// Rectangle of tiles, all bounds inclusive.
struct Model::TileSpan {
  std::int32_t north0, north1, east0, east1;
};

Model::TileSpan Model::tiles_around(TileId tile, std::int32_t reach) const {
  const std::int32_t n = static_cast<std::int32_t>(tile) / grid_.tiles_east();
  const std::int32_t e = static_cast<std::int32_t>(tile) % grid_.tiles_east();
  return TileSpan{max_of(n - reach, 0), min_of(n + reach, grid_.tiles_north() - 1),
                  max_of(e - reach, 0), min_of(e + reach, grid_.tiles_east() - 1)};
}

// Depth of a column's own voxels. Returns whether what its neighbours or its own smoothing see of it may
// have changed: a column without a vote is smoothed by where its evidence ends.
bool Model::read_column(std::uint32_t column, DepthMethod method) {
  ColumnRecord& record = grid_.column(column);
  ColumnResult& result = results_[column];
  const ColumnDepth found = depth_of(column, method);
  // One ping of variance v adds 255 min_variance / v units, and v to the width; kernels end at 1/4 cell^2.
  const std::int64_t lone_q4 =
      kLonePings * 255 * max_of<std::int64_t>(scale_.min_variance_q12, 1024) >> 8;
  const bool lone = found.support_q4 < lone_q4;
  const bool changed = found.depth_q8 != result.raw_q8 || found.mass != result.mass ||
                       lone != ((record.flags & kColumnLone) != 0) ||
                       found.depth_q8 == kUnknownDepth;
  result.raw_q8 = found.depth_q8;
  result.mass =
      found.depth_q8 != kUnknownDepth
          ? found.mass
          : static_cast<std::uint32_t>(evidence_end(grid_.column_voxels(column), scale_.size[2]));
  const int kept = record.flags & ~(kColumnMultiSurface | kColumnLone | kColumnDirty);
  record.flags = static_cast<std::uint8_t>(kept | (found.multi_surface ? kColumnMultiSurface : 0) |
                                           (lone ? kColumnLone : 0));
  return changed;
}

// Columns within kReach of those in `rows` (of `tile`) are to be smoothed again.
void Model::mark_unsmoothed(TileId tile, const std::uint16_t rows[kTileCells]) {
  // Rows -kReach .. kTileCells + kReach - 1 of the surroundings; bit 16 is the tile's own column 0.
  constexpr std::int32_t kRows = kTileCells + 2 * kReach;
  std::uint64_t spread[kRows] = {};
  for (std::int32_t row = 0; row < kTileCells; ++row) {
    const std::uint64_t own = static_cast<std::uint64_t>(rows[row]) << 16U;
    std::uint64_t wide = own;
    for (std::uint32_t step = 1; step <= static_cast<std::uint32_t>(kReach); ++step) {
      wide |= (own << step) | (own >> step);
    }
    for (std::int32_t i = 0; i <= 2 * kReach; ++i) {
      spread[row + i] |= wide;
    }
  }
  const TileSpan span = tiles_around(tile, 1);
  const std::int32_t north = static_cast<std::int32_t>(tile) / grid_.tiles_east();
  const std::int32_t east = static_cast<std::int32_t>(tile) % grid_.tiles_east();
  for (std::int32_t n = span.north0; n <= span.north1; ++n) {
    for (std::int32_t e = span.east0; e <= span.east1; ++e) {
      TileRecord& record = grid_.tile(static_cast<TileId>(n * grid_.tiles_east() + e));
      const auto shift = static_cast<std::uint32_t>(16 * (e - east + 1));
      std::uint32_t any = 0;
      for (std::int32_t row = 0; row < kTileCells; ++row) {
        const std::int32_t from = row + kTileCells * (n - north) + kReach;
        const std::uint64_t bits = from >= 0 && from < kRows ? spread[from] >> shift : 0;
        record.unsmoothed[row] = static_cast<std::uint16_t>(record.unsmoothed[row] | bits);
        any |= record.unsmoothed[row];
      }
      if (any != 0) {
        record.flags |= kTileUnsmoothed;
      }
    }
  }
}

// Reads the columns of a tile that was touched since.
void Model::read_tile(TileId tile) {
  TileRecord& record = grid_.tile(tile);
  record.generation_read = record.generation;
  // Sigma follows the columns' own records as well.
  record.flags |= kTileUnassessed;
  std::uint16_t changed[kTileCells] = {};
  for (std::uint32_t i = 0; i < kTileCells * kTileCells; ++i) {
    if (read_column((tile << 8U) + i, DepthMethod::kRobustMoment)) {
      changed[i >> 4U] = static_cast<std::uint16_t>(changed[i >> 4U] | (1U << (i & 15U)));
    }
  }
  mark_unsmoothed(tile, changed);
}

void Model::smooth_column(std::int32_t n, std::int32_t e) {
  ColumnResult& own = results_[grid_.column_index(n, e)];
  own.depth_q8 = kUnknownDepth;
  const bool voteless = own.raw_q8 == kUnknownDepth;
  const std::int32_t lit = voteless ? static_cast<std::int32_t>(own.mass) : 0;
  if (voteless && lit == 0) {
    return;
  }
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): read as far as it is filled below
  Window window;
  window.count = 0;
  window.row_count = 0;
  bool any_lone = false;
  std::int32_t reference_q8 = own.raw_q8;
  const std::int64_t unit_q16 = (255 * scale_.min_variance_q12) << 4;
  const std::int32_t first_e = max_of(-kReach, -e);
  const std::int32_t last_e = min_of(kReach, scale_.size[1] - 1 - e);
  std::uint32_t places[2 * kReach + 1];  // of the columns in row 0
  for (std::int32_t j = first_e; j <= last_e; ++j) {
    places[j + kReach] = grid_.column_index(0, e + j);
  }
  for (std::int32_t i = max_of(-kReach, -n); i <= min_of(kReach, scale_.size[0] - 1 - n); ++i) {
    const std::uint32_t row_place = grid_.column_index(n + i, 0);
    for (std::int32_t j = first_e; j <= last_e; ++j) {
      const std::uint32_t index = row_place + places[j + kReach];
      const ColumnResult& other = results_[index];
      if (other.raw_q8 == kUnknownDepth) {
        continue;
      }
      // A column that a beam has lit without a vote of its own speaks through its neighbours.
      reference_q8 = reference_q8 == kUnknownDepth ? other.raw_q8 : reference_q8;
      const std::int32_t distance2 = i * i + j * j;
      Neighbour& column = window.columns[window.count];
      column = Neighbour{j, clamp(other.raw_q8 - reference_q8, -32768, 32767),
                         distance2 * distance2, column_noise_q16(unit_q16, other.mass),
                         (grid_.column(index).flags & kColumnLone) != 0};
      any_lone = any_lone || column.lone;
      ++window.count;
    }
    window.rows[window.row_count] = Window::Row{i, window.count};
    ++window.row_count;
  }
  constexpr int kLeastNeighbours = 3;
  if (voteless && (window.count < kLeastNeighbours || reference_q8 - 256 * lit > kLitReach_q8)) {
    return;
  }
  if (any_lone) {
    discount_lone(window.columns, window.count);
  }
  std::int32_t weights[kWindow];
  static_cast<void>(weigh(window, kRoughnessStart_q16, weights));
  const PlaneSums first = plane_sums(window, weights);
  const Residuals left = residuals(window, weights, solve(first));
  // What the plane leaves beyond noise is terrain: let it narrow the window of the second pass.
  const std::int64_t residual_q16 = left.squares / first.s;
  const std::int64_t noise_q16 = left.noise / first.s;
  const std::int64_t spread_q8 =
      max_of<std::int64_t>(128, ((std::int64_t{first.snn} + first.see) << 8) / first.s);
  const std::int64_t excess_q16 = max_of<std::int64_t>(0, residual_q16 - noise_q16 / 2);
  const auto roughness_q16 = static_cast<std::int32_t>(clamp<std::int64_t>(
      kRoughnessGain * (excess_q16 << 8) / spread_q8, kRoughnessLeast_q16, kRoughnessMost_q16));
  const int shift = weigh(window, roughness_q16, weights);
  const PlaneSums second = plane_sums(window, weights);
  own.depth_q8 = clamp(reference_q8 + solve(second).centre_q8, 0, 256 * scale_.size[2]);
  own.noise_q16 = static_cast<std::uint32_t>(clamp<std::int64_t>(
      (1LL << 40) / max_of<std::int64_t>(std::int64_t{second.s} << shift, 1), 1, 1LL << 30));
}

// Central difference of the smoothed depths over +-2 cells, one-sided at edges and holes.
Slope Model::result_slope(std::int32_t n, std::int32_t e) const {
  const bool inside = n >= kSlopeStep && e >= kSlopeStep && n < scale_.size[0] - kSlopeStep &&
                      e < scale_.size[1] - kSlopeStep;
  Slope whole{};
  if (inside && whole_slope(results_[grid_.column_index(n - kSlopeStep, e)],
                            results_[grid_.column_index(n + kSlopeStep, e)],
                            results_[grid_.column_index(n, e - kSlopeStep)],
                            results_[grid_.column_index(n, e + kSlopeStep)], whole)) {
    return whole;
  }
  const auto derivative = [this, n, e](std::int32_t north, std::int32_t east) -> std::int32_t {
    std::int32_t span = 0;
    std::int32_t ends_q8[2] = {0, 0};
    for (int side = 0; side < 2; ++side) {
      for (std::int32_t step = kSlopeStep; step >= 0; --step) {
        const std::int32_t offset = side == 0 ? -step : step;
        const std::int32_t nn = n + north * offset;
        const std::int32_t ee = e + east * offset;
        if (nn < 0 || ee < 0 || nn >= scale_.size[0] || ee >= scale_.size[1]) {
          continue;
        }
        const std::int32_t depth_q8 = results_[grid_.column_index(nn, ee)].depth_q8;
        if (depth_q8 != kUnknownDepth) {
          ends_q8[side] = depth_q8;
          span += step;
          break;
        }
      }
    }
    return span == 0 ? 0 : ((ends_q8[1] - ends_q8[0]) * 16) / span;
  };
  return Slope{derivative(1, 0), derivative(0, 1)};
}

void Model::assess_column(std::int32_t n, std::int32_t e) {
  ColumnResult& own = results_[grid_.column_index(n, e)];
  if (own.depth_q8 == kUnknownDepth) {
    own.sigma_q12 = 0;
    return;
  }
  const std::int64_t noise_q16 = own.noise_q16;
  const ColumnRecord& record = grid_.column(grid_.column_index(n, e));

  // Blur: relief that a plane leaves over three by three columns at the distance of the events' blur.
  const auto blur_sigma_q8 =
      static_cast<std::int32_t>(base::sqrt_u32(static_cast<std::uint32_t>(record.blur_q8) << 8U));
  std::int32_t stride = clamp((3 * blur_sigma_q8 / 2 + 128) >> 8, 1, kMaxFootprintCells);
  stride = max_of(1, min_of(stride, (min_of(scale_.size[0], scale_.size[1]) - 1) / 2));
  const std::int32_t window_n = clamp(n, stride, max_of(stride, scale_.size[0] - 1 - stride));
  const std::int32_t window_e = clamp(e, stride, max_of(stride, scale_.size[1] - 1 - stride));
  PlaneSums sums{};
  std::int32_t z_q8[9];
  int count = 0;
  for (std::int32_t i = -1; i <= 1; ++i) {
    for (std::int32_t j = -1; j <= 1; ++j) {
      const std::int32_t nn = window_n + i * stride;
      const std::int32_t ee = window_e + j * stride;
      if (nn < 0 || ee < 0 || nn >= scale_.size[0] || ee >= scale_.size[1]) {
        continue;
      }
      const std::int32_t depth_q8 = results_[grid_.column_index(nn, ee)].depth_q8;
      if (depth_q8 == kUnknownDepth) {
        continue;
      }
      z_q8[count] = clamp(depth_q8 - own.depth_q8, -32768, 32767);
      add(sums, 1, i, j, z_q8[count]);
      ++count;
    }
  }
  std::int64_t blur_q16 = 0;
  if (count == 9) {
    // Exact for the full window: orthogonal regressors with sums of squares 9, 6, 6.
    std::int64_t squares = 0;
    for (const std::int32_t z : z_q8) {
      squares += static_cast<std::int64_t>(z) * z;
    }
    blur_q16 = max_of<std::int64_t>(
        0,
        (squares - sums.sz * sums.sz / 9 - sums.snz * sums.snz / 6 - sums.sez * sums.sez / 6) / 6);
  }

  // Relief: how much the slope differs from its surroundings, near (4 cells) and regional (32 cells).
  const Slope slope = result_slope(n, e);
  std::int64_t near_q24 = 0;
  std::int64_t regional_n = 0;
  std::int64_t regional_e = 0;
  int near_count = 0;
  int regional_count = 0;
  for (std::int32_t i = -1; i <= 1; ++i) {
    for (std::int32_t j = -1; j <= 1; ++j) {
      const std::int32_t near_n = n + 4 * i;
      const std::int32_t near_e = e + 4 * j;
      if (near_n >= 0 && near_e >= 0 && near_n < scale_.size[0] && near_e < scale_.size[1]) {
        const Slope other = result_slope(near_n, near_e);
        const std::int64_t dn = slope.north_q12 - other.north_q12;
        const std::int64_t de = slope.east_q12 - other.east_q12;
        near_q24 += dn * dn + de * de;
        ++near_count;
      }
      const Slope far = result_slope(clamp(n + 32 * i, 0, scale_.size[0] - 1),
                                     clamp(e + 32 * j, 0, scale_.size[1] - 1));
      regional_n += far.north_q12;
      regional_e += far.east_q12;
      ++regional_count;
    }
  }
  near_q24 /= 2 * max_of<std::int64_t>(1, near_count - 1);
  const std::int64_t apart_n = slope.north_q12 - regional_n / regional_count;
  const std::int64_t apart_e = slope.east_q12 - regional_e / regional_count;
  const std::int64_t regional_q24 = apart_n * apart_n + apart_e * apart_e;

  std::int64_t variance_q16 =
      ((kNoiseFactor_q8 * noise_q16 + kBlurFactor_q8 * blur_q16 +
        kReliefFactor_q8 * (near_q24 >> 8) +
        kRegistrationFactor_q8 * mul_shift(regional_q24, registration_q12_, 20)) >>
       8) +
      kFloor_q16;
  // Declared correlated errors: a floor, never averaged.
  variance_q16 += correlated_q12_[2] << 4;
  variance_q16 += along_slope_q16(slope.north_q12, correlated_q12_[0]);
  variance_q16 += along_slope_q16(slope.east_q12, correlated_q12_[1]);
  own.sigma_q12 = base::sqrt_u64(static_cast<std::uint64_t>(variance_q16) << 8U);
}

// Smooths what is out of date in a tile; returns how many columns that was.
std::uint32_t Model::smooth_tile(TileId tile) {
  TileRecord& record = grid_.tile(tile);
  record.flags = static_cast<std::uint8_t>((record.flags & ~kTileUnsmoothed) | kTileUnassessed);
  const std::int32_t n0 = static_cast<std::int32_t>(tile) / grid_.tiles_east() * kTileCells;
  const std::int32_t e0 = static_cast<std::int32_t>(tile) % grid_.tiles_east() * kTileCells;
  std::uint32_t smoothed = 0;
  bool moved = false;
  for (std::int32_t row = 0; row < kTileCells && n0 + row < scale_.size[0]; ++row) {
    const std::uint32_t bits = record.unsmoothed[row];
    record.unsmoothed[row] = 0;
    for (std::int32_t i = 0; i < kTileCells && e0 + i < scale_.size[1]; ++i) {
      if (((bits >> static_cast<std::uint32_t>(i)) & 1U) == 0) {
        continue;
      }
      const ColumnResult& own = results_[grid_.column_index(n0 + row, e0 + i)];
      const std::int32_t before_q8 = own.depth_q8;
      smooth_column(n0 + row, e0 + i);
      moved = moved || own.depth_q8 != before_q8;
      ++smoothed;
    }
  }
  if (moved) {
    const TileSpan span = tiles_around(tile, kInfluenceTiles);
    for (std::int32_t n = span.north0; n <= span.north1; ++n) {
      for (std::int32_t e = span.east0; e <= span.east1; ++e) {
        grid_.tile(static_cast<TileId>(n * grid_.tiles_east() + e)).flags |= kTileUnassessed;
      }
    }
  }
  return smoothed;
}

std::uint32_t Model::assess_tile(TileId tile) {
  TileRecord& record = grid_.tile(tile);
  record.flags = static_cast<std::uint8_t>(record.flags & ~kTileUnassessed);
  const std::int32_t n0 = static_cast<std::int32_t>(tile) / grid_.tiles_east() * kTileCells;
  const std::int32_t e0 = static_cast<std::int32_t>(tile) % grid_.tiles_east() * kTileCells;
  const std::int32_t n1 = min_of(n0 + kTileCells, scale_.size[0]);
  const std::int32_t e1 = min_of(e0 + kTileCells, scale_.size[1]);
  for (std::int32_t n = n0; n < n1; ++n) {
    for (std::int32_t e = e0; e < e1; ++e) {
      assess_column(n, e);
    }
  }
  return static_cast<std::uint32_t>((n1 - n0) * (e1 - e0));
}

std::uint32_t Model::read_touched_tile(TileId tile) {
  if (!configured_ || !grid_.resident(tile) ||
      grid_.tile(tile).generation_read == grid_.tile(tile).generation) {
    return 0;
  }
  read_tile(tile);
  return kTileCells * kTileCells;
}

std::uint32_t Model::smooth_changed_tile(TileId tile) {
  return (grid_.tile(tile).flags & kTileUnsmoothed) != 0 ? smooth_tile(tile) : 0;
}

std::uint32_t Model::assess_changed_tile(TileId tile) {
  return (grid_.tile(tile).flags & kTileUnassessed) != 0 ? assess_tile(tile) : 0;
}

TileWork Model::extract_tile(TileId tile) {
  TileWork work{};
  if (!configured_ || tile >= grid_.tile_count()) {
    return work;
  }
  if (method_ != DepthMethod::kRobustMoment) {
    extract();
  }
  const TileSpan read = tiles_around(tile, kInfluenceTiles + 1);
  for (std::int32_t n = read.north0; n <= read.north1; ++n) {
    for (std::int32_t e = read.east0; e <= read.east1; ++e) {
      work.columns_read += read_touched_tile(static_cast<TileId>(n * grid_.tiles_east() + e));
    }
  }
  const TileSpan smooth = tiles_around(tile, kInfluenceTiles);
  for (std::int32_t n = smooth.north0; n <= smooth.north1; ++n) {
    for (std::int32_t e = smooth.east0; e <= smooth.east1; ++e) {
      work.columns_smoothed += smooth_changed_tile(static_cast<TileId>(n * grid_.tiles_east() + e));
    }
  }
  work.columns_assessed += assess_changed_tile(tile);
  return work;
}

void Model::extract(DepthMethod method) {
  if (!configured_) {
    return;
  }
  // Everything anew, whatever was noted: voxels may have been written from outside.
  method_ = method;
  for (std::uint32_t column = 0; column < grid_.column_count(); ++column) {
    if (grid_.resident(column >> 8U)) {
      static_cast<void>(read_column(column, method));
    }
  }
  for (TileId id = 0; id < grid_.tile_count(); ++id) {
    TileRecord& record = grid_.tile(id);
    if (grid_.resident(id)) {
      record.generation_read = record.generation;
    }
    for (std::uint16_t& row : record.unsmoothed) {
      row = UINT16_MAX;
    }
    static_cast<void>(smooth_tile(id));
  }
  for (TileId id = 0; id < grid_.tile_count(); ++id) {
    static_cast<void>(assess_tile(id));
  }
}

}  // namespace leadline::model
