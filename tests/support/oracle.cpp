#include "tests/support/oracle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace leadline::test {
namespace {

using model::LocalizationTable;
using model::Rule;

constexpr double kCut2 = 4.84;             // lateral cut, squared standard deviations
constexpr double kFloorVariance = 0.02;    // rounding of depths and voxels, cells^2
constexpr double kCellVariance = 0.5;      // a voxel's own footprint, cells^2
constexpr double kLateralFloor = 0.05;     // cells^2
constexpr double kTouch = 887.0 / 1024.0;  // half the diagonal of a voxel, as the contract has it
constexpr double kLeastGrowth = 1.0 / 1024.0;
constexpr double kSteepest = 2.5;
constexpr double kGrazing = 0.2;
constexpr double kUnits = 255.0;  // evidence of the best ping
// What the integer side may move a depth or a squared lateral coordinate by: Q12 slopes over a
// footprint, Q16 positions, square roots to 2^-14.
constexpr double kDepthSlack = 0.012;
constexpr double kSpanSlack = 0.02;
// Variances are sums of a few terms in 1/4096 cell^2, each rounded; the event's weight is their ratio.
constexpr double kVarianceSlack = 4.0 / 4096.0;

double square(double x) { return x * x; }

double radians(base::Bam32 angle) { return angle * (6.283185307179586476925 / 4294967296.0); }

std::array<double, 3> turn(const base::Attitude& attitude, std::array<double, 3> v) {
  const double r = radians(attitude.roll_bam32);
  const double p = radians(attitude.pitch_bam32);
  const double h = radians(attitude.heading_bam32);
  v = {v[0], std::cos(r) * v[1] - std::sin(r) * v[2], std::sin(r) * v[1] + std::cos(r) * v[2]};
  v = {std::cos(p) * v[0] + std::sin(p) * v[2], v[1], std::cos(p) * v[2] - std::sin(p) * v[0]};
  return {std::cos(h) * v[0] - std::sin(h) * v[1], std::sin(h) * v[0] + std::cos(h) * v[1], v[2]};
}

/// A sampled function at `position` entries: its value and what reading the entry below instead, at a
/// position off by `slack`, may differ.
struct Reading {
  double value;
  double error;
};
template <typename At>
Reading read(At at, double position, int last, double slack) {
  const auto entry = [&](double p) {
    return at(std::clamp(static_cast<int>(std::floor(p)), 0, last));
  };
  const int below = std::clamp(static_cast<int>(std::floor(position)), 0, last);
  const double f = std::clamp(position - below, 0.0, 1.0);
  const double value = at(below) + f * (at(std::min(below + 1, last)) - at(below));
  double error = 0.0;
  for (const double p : {position - slack, position, position + slack}) {
    error = std::max(error, std::fabs(entry(p) - value));
  }
  return {value, error};
}

/// Gaussian at the centres of voxels 0 .. count - 1 within the cut of its level, tilted until its first
/// moment about `depth` vanishes, sum 1.
std::vector<double> range_blur(double variance, double depth, int count) {
  const double cut = std::max(1.5, std::min(2.0 * std::sqrt(variance), 7.0));
  // Over all voxels, those outside the grid included: clipping must not move weight inside.
  const int first = static_cast<int>(std::ceil(depth - cut - 0.5));
  const int last = static_cast<int>(std::floor(depth + cut - 0.5));
  std::vector<double> all(static_cast<std::size_t>(last - first + 1));
  // Newton's iteration for the tilt: the moment rises with it, and there are taps on both sides.
  double tilt = 0.0;
  for (int step = 0; step < 12; ++step) {
    double sum = 0.0;
    double moment = 0.0;
    double moment2 = 0.0;
    for (int k = first; k <= last; ++k) {
      const double x = k + 0.5 - depth;
      const double value = std::exp(-x * x / (2.0 * variance) + tilt * x);
      all[static_cast<std::size_t>(k - first)] = value;
      sum += value;
      moment += value * x;
      moment2 += value * x * x;
    }
    for (double& value : all) {
      value /= sum;
    }
    if (std::fabs(moment) < 1e-12 * moment2) {
      break;
    }
    tilt -= moment / moment2;
  }
  std::vector<double> taps(static_cast<std::size_t>(count), 0.0);
  for (int k = std::max(first, 0); k <= std::min(last, count - 1); ++k) {
    taps[static_cast<std::size_t>(k)] = all[static_cast<std::size_t>(k - first)];
  }
  return taps;
}

/// rho of "empty" at a share of the maximum range (method 1.2).
double empty_rho(double share) { return 0.5 * std::sqrt(std::clamp(share, 0.0, 1.0)); }

double empty_confidence(double share) {
  const double rho = std::max(0.02, empty_rho(share));
  return std::log(rho / (1.0 - rho)) / std::log(0.02 / 0.98);
}

double frustum_growth(double tangent, double range) {
  const double end = tangent * range;
  return end <= kTouch ? kLeastGrowth : std::max((end - kTouch) / range, kLeastGrowth);
}

}  // namespace

struct Oracle::Shell {
  bool wall = false;
  double centre_n = 0.0, centre_e = 0.0, centre_depth = 0.0;
  double slope_n = 0.0, slope_e = 0.0;
  double xi_n = 0.0, xi_e = 0.0, eta_n = 0.0, eta_e = 0.0;
  double half_n = 0.0, half_e = 0.0;
  int level = 0;
  int profile_class = 0;
  double weight = 0.0;            // units
  double weight_slack = 0.0;      // share of it that rounding of variances may move
  bool growth_undecided = false;  // rounding decides whether it is taken for nothing
  double growth = 0.0;            // part of the variance that goes with the square of the range
  double empty_range = 0.0;

  [[nodiscard]] double variance() const { return 0.25 * std::pow(2.0, level / 4.0); }
  [[nodiscard]] double reach() const {
    return std::max(1.5, std::min(2.0 * std::sqrt(variance()), 7.0));
  }
  [[nodiscard]] double plane(double n, double e) const {
    return centre_depth + slope_n * (n - centre_n) + slope_e * (e - centre_e);
  }
};

Oracle::Oracle(const model::ModelConfig& config, const LocalizationTable& table,
               const OracleSettings& settings)
    : config_(config),
      table_(table),
      settings_(settings),
      size_{config.size[0], config.size[1], config.size[2]},
      cell_um_(config.cell_mm * 1000.0),
      sigma_range_(table.sigma_range_um / cell_um_),
      min_variance_(square(sigma_range_) + kFloorVariance),
      max_range_(static_cast<double>(config.max_range_um) / cell_um_) {
  const auto columns = static_cast<std::size_t>(size_[0]) * static_cast<std::size_t>(size_[1]);
  const std::size_t voxels = columns * static_cast<std::size_t>(size_[2]);
  hits_.assign(voxels, 0.0);
  misses_.assign(voxels, 0.0);
  event_.assign(voxels, Increment{});
  records_.assign(columns, Record{});
}

std::size_t Oracle::column(int n, int e) const {
  return static_cast<std::size_t>(n) * static_cast<std::size_t>(size_[1]) +
         static_cast<std::size_t>(e);
}

std::size_t Oracle::voxel(int n, int e, int k) const {
  return column(n, e) * static_cast<std::size_t>(size_[2]) + static_cast<std::size_t>(k);
}

// ------------------------------------------------------------------------------------ slope feedback

Oracle::ColumnDepth Oracle::column_depth(int n, int e) const {
  const int depth = size_[2];
  std::vector<double> evidence(static_cast<std::size_t>(depth) + 4, 0.0);
  const auto at = [&evidence](int k) -> double& {
    return evidence[static_cast<std::size_t>(k + 2)];
  };
  double mass = 0.0;
  for (int k = 0; k < depth; ++k) {
    const double for_it = hits_[voxel(n, e, k)];
    const double against = misses_[voxel(n, e, k)];
    at(k) = against > for_it ? 0.0 : config_.rule == Rule::kLogOdds ? for_it : for_it - against;
    mass += at(k);
  }
  const auto smooth = [&at](int k) {
    return at(k - 2) + 2 * at(k - 1) + 3 * at(k) + 2 * at(k + 1) + at(k + 2);
  };
  // Under half a unit of evidence the integers have none.
  if (mass < 0.5) {
    return {false, 0.0, 0.0, false};
  }
  // Four runs at most, by height; the most credible counts.
  std::vector<bool> seen(static_cast<std::size_t>(depth), false);
  const auto free = [&seen](int k) { return !seen[static_cast<std::size_t>(k)]; };
  double best_score = 0.0;
  double sum = 0.0;
  double mean = 0.0;
  double variance = 0.0;
  for (int run = 0; run < 4; ++run) {
    double peak = 0.0;
    int peak_k = 0;
    for (int k = 0; k < depth; ++k) {
      if (free(k) && smooth(k) > peak) {
        peak = smooth(k);
        peak_k = k;
      }
    }
    int top = peak_k;
    int bottom = peak_k;
    while (top > 0 && free(top - 1) && smooth(top - 1) > peak / 10.0) {
      --top;
    }
    while (bottom < depth - 1 && free(bottom + 1) && smooth(bottom + 1) > peak / 10.0) {
      ++bottom;
    }
    double run_sum = 0.0;
    double run_mean = 0.0;
    double hit = 0.0;
    double miss = 0.0;
    for (int k = top; k <= bottom; ++k) {
      seen[static_cast<std::size_t>(k)] = true;
      run_sum += at(k);
      run_mean += at(k) * (k + 0.5);
      hit += square(at(k));
      miss += at(k) * misses_[voxel(n, e, k)];
    }
    if (run_sum <= 0.0) {
      break;
    }
    run_mean /= run_sum;
    double run_variance = 0.0;
    for (int k = top; k <= bottom; ++k) {
      run_variance += at(k) * square(k + 0.5 - run_mean) / run_sum;
    }
    // Tails, down to where they rise again, are no runs of their own.
    for (int k = top; k > 0 && free(k - 1) && smooth(k - 1) <= smooth(k); --k) {
      seen[static_cast<std::size_t>(k - 1)] = true;
    }
    for (int k = bottom; k < depth - 1 && free(k + 1) && smooth(k + 1) <= smooth(k); ++k) {
      seen[static_cast<std::size_t>(k + 1)] = true;
    }
    const double score =
        run_sum * std::max(0.5, std::sqrt(run_variance)) * hit / (hit + 2.0 * miss);
    if (score > best_score) {
      best_score = score;
      sum = run_sum;
      mean = run_mean;
      variance = run_variance;
    }
  }
  if (sum <= 0.0) {
    return {false, 0.0, mass, false};
  }
  const bool lone = sum * std::max(0.25, variance) < 2.0 * kUnits * std::max(0.25, min_variance_);
  const double wide = std::clamp(3.5 * std::sqrt(variance), 3.0, 64.0);
  double estimate = mean;
  for (int iteration = 0; iteration < 4; ++iteration) {
    const double window = std::max(1.0, std::min(wide, std::min(estimate, depth - estimate)));
    double weight_sum = 0.0;
    double moment = 0.0;
    for (int k = 0; k < depth; ++k) {
      const double x = k + 0.5 - estimate;
      const double weight = at(k) * std::max(0.0, square(window) - square(x));
      weight_sum += weight;
      moment += weight * x;
    }
    if (weight_sum <= 0.0) {
      break;
    }
    estimate += moment / weight_sum;
    if (std::fabs(moment / weight_sum) < 4.0 / 256.0) {
      break;
    }
  }
  return {true, estimate, mass, lone};
}

void Oracle::rescale(int n, int e) {
  double largest = 0.0;
  for (int k = 0; k < size_[2]; ++k) {
    largest = std::max({largest, hits_[voxel(n, e, k)], misses_[voxel(n, e, k)]});
  }
  record(n, e).unchecked = 0.0;
  if (largest < 32768.0) {
    return;
  }
  record(n, e).mass /= 2.0;
  record(n, e).gain /= 2.0;
  for (int k = 0; k < size_[2]; ++k) {
    hits_[voxel(n, e, k)] /= 2.0;
    misses_[voxel(n, e, k)] /= 2.0;
  }
}

Oracle::Slope Oracle::slope(const Frame& frame, const Vector& from, double range,
                            const Vector& variance) {
  const double beam =
      table_.beam_variance_along_q30 * 0x1.0p-30 + table_.pointing_variance_q30 * 0x1.0p-30;
  const double sigma =
      std::sqrt(square(range) * beam + std::max(variance[0], variance[1]) + kCellVariance);
  // Two standard deviations apart, centre and stride even: a quarter of the columns serves all slopes.
  const int stride = 2 * std::clamp(static_cast<int>(std::floor(sigma + 0.5)), 1, 12);
  const double end_n = from[0] + range * frame.axis[0] + 0.5;
  const double end_e = from[1] + range * frame.axis[1] + 0.5;
  const int centre_n = 2 * static_cast<int>(std::floor(end_n / 2.0));
  const int centre_e = 2 * static_cast<int>(std::floor(end_e / 2.0));
  const auto near_even = [](double x) {
    return std::fabs(x / 2.0 - std::floor(x / 2.0 + 0.5)) < 0.001;
  };
  lattice_undecided_ =
      near_even(end_n) || near_even(end_e) || std::fabs(sigma - std::floor(sigma) - 0.5) < 0.002;
  double s = 0, sn = 0, se = 0, sz = 0, snn = 0, sne = 0, see = 0, snz = 0, sez = 0;
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      const int n = centre_n + i * stride;
      const int e = centre_e + j * stride;
      if (n < 0 || e < 0 || n >= size_[0] || e >= size_[1]) {
        continue;
      }
      Record& own = record(n, e);
      if (own.gain > (settings_.regrowth - 1.0) * own.mass) {
        const ColumnDepth found = column_depth(n, e);
        own = Record{
            found.known,   found.depth,
            found.mass,    0.0,
            own.unchecked, std::clamp(std::floor(found.mass / (16.0 * min_variance_)), 1.0, 63.0)};
      }
      if (!own.known) {
        continue;
      }
      const double weight = own.weight;
      s += weight;
      sn += weight * i;
      se += weight * j;
      sz += weight * own.depth;
      snn += weight * i * i;
      sne += weight * i * j;
      see += weight * j * j;
      snz += weight * i * own.depth;
      sez += weight * j * own.depth;
    }
  }
  if (s <= 0.0) {
    return {0.0, 0.0};
  }
  // A prior of a flat bottom, one over 0.5^2 per cell^2 (in the weights' sixteenths).
  const double ridge = std::max(1.0, s * 64.0 / square(stride));
  const double cnn = s * snn - sn * sn + ridge;
  const double cee = s * see - se * se + ridge;
  const double cne = s * sne - sn * se;
  const double cnz = s * snz - sn * sz;
  const double cez = s * sez - se * sz;
  const double determinant = (cnn * cee - cne * cne) * stride;
  return {(cnz * cee - cez * cne) / determinant, (cez * cnn - cnz * cne) / determinant};
}

// --------------------------------------------------------------------------------------- the shell

Oracle::Shell Oracle::shell(const Frame& frame, const Vector& from, double range,
                            const Vector& variance, const Slope& bottom) {
  const Vector& u = frame.axis;
  double gn = bottom.n;
  double ge = bottom.e;
  const double steepness = std::hypot(gn, ge);
  if (steepness > kSteepest) {
    gn *= kSteepest / steepness;
    ge *= kSteepest / steepness;
  }
  const double secant = std::sqrt(1.0 + gn * gn + ge * ge);
  const double drop = u[2] - gn * u[0] - ge * u[1];
  const double range2 = square(range);
  const double beam_along = range2 * table_.beam_variance_along_q30 * 0x1.0p-30;
  const double beam_across = range2 * table_.beam_variance_across_q30 * 0x1.0p-30;
  const double pointing = range2 * table_.pointing_variance_q30 * 0x1.0p-30;
  // Half of the position error only: the ping itself is displaced by it.
  const double pn = 0.5 * variance[0];
  const double pe = 0.5 * variance[1];

  Shell out;
  double level_variance = 0.0;
  double class_share = 0.0;
  double b1n = 0, b1e = 0, b2n = 0, b2e = 0, c11 = 0, c12 = 0, c22 = 0;
  ambiguous_ = lattice_undecided_ || std::fabs(drop - kGrazing * secant) < 0.003;
  if (drop < kGrazing * secant) {
    out.wall = true;
    const double horizontal = std::hypot(u[0], u[1]);
    double hn = 1.0;
    double he = 0.0;
    double rise = 0.0;
    if (horizontal > 1.0 / 1024.0) {
      hn = u[0] / horizontal;
      he = u[1] / horizontal;
      rise = std::clamp(u[2] / horizontal, -kSteepest, kSteepest);
    }
    ambiguous_ = ambiguous_ || std::fabs(horizontal - 1.0 / 1024.0) < 1e-4;
    const double radial = square(sigma_range_);
    b1n = hn;
    b1e = he;
    b2n = -he;
    b2e = hn;
    c11 = radial + square(hn) * pn + square(he) * pe + kCellVariance;
    c22 = beam_across + pointing + square(he) * pn + square(hn) * pe + kCellVariance;
    level_variance = beam_along + pointing + variance[2] + kFloorVariance;
    class_share = beam_across / c22;
    out.weight = kUnits;  // radial + floor is the smallest variance there is
    out.centre_n = from[0] + range * u[0];
    out.centre_e = from[1] + range * u[1];
    out.centre_depth = from[2] + range * u[2];
    out.slope_n = rise * hn;
    out.slope_e = rise * he;
    // Filled in below, once the kernel is known.
    out.empty_range = range;
  } else {
    const double cosine = drop / secant;
    const double sine = std::sqrt(std::max(0.0, 1.0 - square(cosine)));
    // Down-normal of the bottom, less its part along the beam: where uphill is, across the beam.
    const Vector normal = {-gn / secant, -ge / secant, 1.0 / secant};
    const Vector uphill = {normal[0] - cosine * u[0], normal[1] - cosine * u[1],
                           normal[2] - cosine * u[2]};
    struct First {
      double excess, slope, shift, patch;
    };
    const auto first_return = [&](int axis) {
      const double position = sine * model::kIncidenceSteps;
      const int below = std::clamp(static_cast<int>(position), 0, model::kIncidenceSteps - 1);
      const double f = position - below;
      const model::FirstReturnEntry& a = table_.first_return[axis][below];
      const model::FirstReturnEntry& b = table_.first_return[axis][below + 1];
      const auto between = [f](double from_value, double to_value) {
        return from_value + f * (to_value - from_value);
      };
      return First{between(a.excess_q30, b.excess_q30) * 0x1.0p-30,
                   between(a.slope_q20, b.slope_q20) * 0x1.0p-20,
                   between(a.shift_q20, b.shift_q20) * 0x1.0p-20,
                   between(a.patch_variance_q30, b.patch_variance_q30) * 0x1.0p-30};
    };
    First first = first_return(0);
    double patch_along = range2 * first.patch;
    double patch_across = range2 * first.patch;
    if (table_.two_axis != 0 && sine > 0.0) {
      const double share = std::clamp(
          (uphill[0] * frame.along[0] + uphill[1] * frame.along[1] + uphill[2] * frame.along[2]) /
              sine,
          -1.0, 1.0);
      const double mix = square(share);
      const First second = first_return(1);
      const auto blend = [mix](double along, double across) {
        return across + mix * (along - across);
      };
      patch_along = blend(range2 * first.patch, beam_along);
      patch_across = blend(beam_across, range2 * second.patch);
      first = First{blend(first.excess, second.excess), blend(first.slope, second.slope),
                    blend(first.shift, second.shift), 0.0};
    }
    const double vertical =
        drop + first.excess * secant;  // depth of the plane below, per unit of range
    out.centre_n = from[0] + range * (u[0] + first.shift * uphill[0]);
    out.centre_e = from[1] + range * (u[1] + first.shift * uphill[1]);
    out.centre_depth =
        from[2] + range * vertical + gn * (out.centre_n - from[0]) + ge * (out.centre_e - from[1]);
    out.slope_n = gn;
    out.slope_e = ge;
    const double growing = pointing * square(first.slope * secant) + beam_along / 8.0;
    level_variance = square(sigma_range_ * vertical) + variance[2] + square(gn) * variance[0] +
                     square(ge) * variance[1] + growing + kFloorVariance;
    out.growth = growing / level_variance < 1.0 / 32.0 ? 0.0 : growing / level_variance;
    out.growth_undecided = std::fabs(growing / level_variance - 1.0 / 32.0) < 2e-3;
    out.weight = kUnits * std::min(1.0, min_variance_ / level_variance);
    out.weight_slack = kVarianceSlack / level_variance;
    b1n = frame.along[0] + gn * frame.along[2];
    b1e = frame.along[1] + ge * frame.along[2];
    b2n = frame.across[0] + gn * frame.across[2];
    b2e = frame.across[1] + ge * frame.across[2];
    const double spread_n = pn + kCellVariance;
    const double spread_e = pe + kCellVariance;
    c11 = patch_along + pointing + square(b1n) * spread_n + square(b1e) * spread_e;
    c22 = patch_across + pointing + square(b2n) * spread_n + square(b2e) * spread_e;
    c12 = b1n * b2n * spread_n + b1e * b2e * spread_e;
    class_share = patch_along / c11;
    out.empty_range = range;
  }

  // Whitened lateral coordinates.
  c11 = std::max(c11, kLateralFloor);
  const double slant = c12 / c11;
  c22 = std::max(c22 - c12 * slant, kLateralFloor);
  out.xi_n = b1n / std::sqrt(c11);
  out.xi_e = b1e / std::sqrt(c11);
  out.eta_n = (b2n - slant * b1n) / std::sqrt(c22);
  out.eta_e = (b2e - slant * b1e) / std::sqrt(c22);
  const double determinant = std::fabs(out.xi_n * out.eta_e - out.xi_e * out.eta_n);
  const double cut = std::sqrt(kCut2);
  const double longest = settings_.footprint_cells;
  out.half_n = determinant < 2.4e-4
                   ? longest
                   : std::min(longest, cut * std::hypot(out.xi_e, out.eta_e) / determinant);
  out.half_e = determinant < 2.4e-4
                   ? longest
                   : std::min(longest, cut * std::hypot(out.xi_n, out.eta_n) / determinant);

  const double exact_level =
      std::clamp(4.0 * std::log2(level_variance / 0.25), 0.0, model::kKernelLevels - 1.0);
  out.level = static_cast<int>(std::floor(exact_level + 0.5));
  const double exact_class = class_share * (model::kProfileClasses - 1);
  out.profile_class =
      std::clamp(static_cast<int>(std::floor(exact_class + 0.5)), 0, model::kProfileClasses - 1);
  if (out.wall) {
    // Two radial deviations before a standing shell; before one met from above, its kernel's reach.
    const double clearance =
        std::max(2.0 * std::sqrt(c11) * std::hypot(u[0], u[1]), out.reach() * std::fabs(u[2]));
    out.empty_range = std::max(0.0, range - clearance);
  }
  const auto undecided = [](double value) {
    return std::fabs(value - std::floor(value) - 0.5) < 0.03;
  };
  ambiguous_ = ambiguous_ || undecided(exact_level) || undecided(exact_class);
  wall_ = out.wall;
  return out;
}

void Oracle::add_shell(const Shell& shell, double range) {
  const double variance = shell.variance();
  const double kernel_error = static_cast<double>(table_.error_kernel_q15) / model::kKernelSum;
  double against = 0.0;
  double against_error = 0.0;
  if (config_.rule == Rule::kWeightedMean) {
    const Reading rho =
        read([](int i) { return empty_rho(i / 64.0); }, 64.0 * range / max_range_, 64, 0.01);
    against = empty_rho(range / max_range_);
    against_error = rho.error + std::fabs(rho.value - against);
  }
  for (int n = 0; n < size_[0]; ++n) {
    for (int e = 0; e < size_[1]; ++e) {
      const double dn = n + 0.5 - shell.centre_n;
      const double de = e + 0.5 - shell.centre_e;
      const double xi = shell.xi_n * dn + shell.xi_e * de;
      const double eta = shell.eta_n * dn + shell.eta_e * de;
      const double m2 = xi * xi + eta * eta;
      const double slack = 0.004 + 0.01 * m2;
      // The box is half-open and whole columns wide.
      const double outside = std::max(std::fabs(dn) - shell.half_n, std::fabs(de) - shell.half_e);
      const bool edge = std::fabs(m2 - kCut2) < slack || std::fabs(outside) < 0.01;
      if ((m2 >= kCut2 || outside > 0.0) && !edge) {
        continue;
      }
      const auto profile = [&](int axis, double squared) {
        return read(
            [&](int j) { return table_.profile_q15[axis][shell.profile_class][j] / 32767.0; },
            squared / kCut2 * model::kProfileSteps, model::kProfileSteps + 3,
            slack / kCut2 * model::kProfileSteps);
      };
      Reading lateral = profile(0, m2);
      if (table_.two_axis != 0) {
        const Reading a = profile(0, xi * xi);
        const Reading b = profile(1, eta * eta);
        lateral =
            Reading{a.value * b.value, a.value * b.error + b.value * a.error + a.error * b.error};
      }
      const double weight = shell.weight * lateral.value;
      const double weight_error =
          shell.weight * lateral.error + 0.02 + (2e-3 + shell.weight_slack) * weight;
      Record& own = record(n, e);
      const double depth = shell.plane(n + 0.5, e + 0.5);
      // Far below or above the grid there is nothing to write.
      if (depth < -10.0 || depth > size_[2] + 10.0) {
        continue;
      }
      const std::vector<double> taps = range_blur(variance, depth, size_[2]);
      const double shift = settings_.allowances ? kDepthSlack : 0.0;
      const std::vector<double> upper =
          shift > 0.0 ? range_blur(variance, depth - shift, size_[2]) : taps;
      const std::vector<double> lower =
          shift > 0.0 ? range_blur(variance, depth + shift, size_[2]) : taps;
      bool any = false;
      for (int k = 0; k < size_[2]; ++k) {
        const auto at = static_cast<std::size_t>(k);
        const double least = std::min({taps[at], upper[at], lower[at]});
        const double most = std::max({taps[at], upper[at], lower[at]});
        // A row of the table serves a sixteenth of a cell: it may hold a tap just outside the cut, and
        // the stated error says how large.
        if (most <= 0.0 && std::fabs(k + 0.5 - depth) > shell.reach() + 1.0 / 16.0 + kDepthSlack) {
          continue;
        }
        any = any || (!edge && most > 0.0);
        const double tap_error = kernel_error + most - least;
        Increment& increment = event_[voxel(n, e, k)];
        const double error = weight * tap_error + (most + kernel_error) * weight_error;
        increment.hit += weight * taps[at] * (1.0 - against);
        increment.miss += weight * taps[at] * against;
        increment.allowed_hit += error * (1.0 - against) + weight * most * against_error;
        increment.allowed_miss += error * against + weight * most * against_error;
        increment.edge = increment.edge || edge;
        written_.push_back(voxel(n, e, k));
      }
      if (any) {
        own.gain += std::floor(weight) + 1.0;
        own.unchecked += std::floor(weight) + 1.0;
        if (own.unchecked > 30000.0) {
          candidate_n_ = n;
          candidate_e_ = e;
        }
      }
    }
  }
}

// ---------------------------------------------------------------------------- the cone before it

void Oracle::carve(const Frame& frame, const Vector& from, const Shell* shell, double range,
                   double strength) {
  if (range <= 0.0) {
    return;
  }
  const double tan_along = std::max(table_.tan_envelope_along_q24 * 0x1.0p-24, 512.0 / 1048576.0);
  const double tan_across = std::max(table_.tan_envelope_across_q24 * 0x1.0p-24, 512.0 / 1048576.0);
  const double growth = frustum_growth(std::max(tan_along, tan_across), range);
  const double grow[2] = {frustum_growth(tan_along, range), frustum_growth(tan_across, range)};
  const double widest = kTouch + growth * range;
  // Signed distance inside the frustum (positive: inside), of a point relative to the transducer.
  const auto inside_by = [&](const Vector& d) {
    const double slant = d[0] * frame.axis[0] + d[1] * frame.axis[1] + d[2] * frame.axis[2];
    const double off =
        std::sqrt(std::max(0.0, square(d[0]) + square(d[1]) + square(d[2]) - square(slant)));
    double inside = std::min({slant, range - slant, kTouch + growth * slant - off});
    // Of a two-axis beam, what both axes hold.
    for (int axis = 0; axis < 2 && table_.two_axis != 0; ++axis) {
      const Vector& side = axis == 0 ? frame.along : frame.across;
      inside = std::min(inside, kTouch + grow[axis] * slant -
                                    std::fabs(d[0] * side[0] + d[1] * side[1] + d[2] * side[2]));
    }
    return inside;
  };
  struct Weight {
    double value, error;
  };
  const auto weight_at = [&](const Vector& d) {
    const double slant =
        std::max(0.0, d[0] * frame.axis[0] + d[1] * frame.axis[1] + d[2] * frame.axis[2]);
    const auto share = [&](double off2, double half, int axis) {
      const double position = model::kBeamWeightSteps * off2 / square(half);
      return read([&](int j) { return table_.beam_weight_q15[axis][j] / 32767.0; }, position,
                  model::kBeamWeightSteps, 0.02 + 0.01 * position);
    };
    Reading beam{};
    if (table_.two_axis == 0) {
      const double off2 = std::max(0.0, square(d[0]) + square(d[1]) + square(d[2]) - square(slant));
      beam = share(off2, kTouch + growth * slant, 0);
    } else {
      double value = 1.0;
      double error = 0.0;
      for (int axis = 0; axis < 2; ++axis) {
        const Vector& side = axis == 0 ? frame.along : frame.across;
        const double off = d[0] * side[0] + d[1] * side[1] + d[2] * side[2];
        const double half = kTouch + grow[axis] * slant;
        Reading one = share(square(off), half, axis);
        // Beyond the narrower envelope: nothing, with the edge itself in doubt.
        const double ratio = square(off / half);
        if (ratio >= 1.0) {
          one = Reading{0.0, ratio < 1.03 ? one.value + one.error : 0.0};
        } else if (ratio > 0.97) {
          one.error = std::max(one.error, one.value);
        }
        error = value * one.error + one.value * error + error * one.error;
        value *= one.value;
      }
      beam = Reading{value, error};
    }
    const double position = 64.0 * slant / max_range_;
    const auto of = [&](const auto& function) {
      const Reading reading = read([&](int i) { return function(i / 64.0); }, position, 64, 0.02);
      const double value = function(slant / max_range_);
      return Reading{value, reading.error + std::fabs(reading.value - value)};
    };
    const Reading trust = config_.rule == Rule::kLogOdds ? of(empty_confidence) : of(empty_rho);
    struct Both {
      Weight hit, miss;
    };
    // As much as the ping would have said for a surface here.
    const double passed = square(std::min(1.0, slant / range));
    const double apart = shell == nullptr ? 1.0 : 1.0 - shell->growth * (1.0 - passed);
    const double s = std::min(0.5 * kUnits, strength * std::pow(apart, -1.5));
    // Rounding of variances tells more where little of them is left.
    const double least = shell != nullptr && shell->growth_undecided ? 0.06 : 0.0;
    const double slack =
        3e-3 + least + (shell == nullptr ? 0.0 : 2.5 * shell->weight_slack / apart);
    if (config_.rule == Rule::kLogOdds) {
      return Both{{0.0, 0.0},
                  {s * beam.value * trust.value,
                   s * (beam.value * trust.error + trust.value * beam.error +
                        beam.error * trust.error + slack * beam.value * trust.value) +
                       0.05}};
    }
    const double total = s * beam.value;
    const double error = s * (beam.value * (trust.error + slack) + beam.error) + 0.05;
    return Both{{total * trust.value, error}, {total * (1.0 - trust.value), error}};
  };

  const double low_n = from[0] + std::min(0.0, range * frame.axis[0]) - widest;
  const double high_n = from[0] + std::max(0.0, range * frame.axis[0]) + widest;
  const double low_e = from[1] + std::min(0.0, range * frame.axis[1]) - widest;
  const double high_e = from[1] + std::max(0.0, range * frame.axis[1]) + widest;
  for (int n = 0; n < size_[0]; ++n) {
    for (int e = 0; e < size_[1]; ++e) {
      if (n + 0.5 < low_n || n + 0.5 > high_n || e + 0.5 < low_e || e + 0.5 > high_e) {
        continue;
      }
      Vector d = {n + 0.5 - from[0], e + 0.5 - from[1], 0.0};
      // Voxels of the column inside the frustum and, under a bottom, above the kernel's reach.
      int first = -1;
      int last = -1;
      bool doubtful = false;
      for (int k = 0; k < size_[2]; ++k) {
        d[2] = k + 0.5 - from[2];
        double inside = inside_by(d);
        if (shell != nullptr && !shell->wall) {
          inside = std::min(inside, shell->plane(n + 0.5, e + 0.5) - shell->reach() - (k + 0.5));
        }
        doubtful = doubtful || std::fabs(inside) < kSpanSlack;
        if (inside >= 0.0) {
          first = first < 0 ? k : first;
          last = k;
        }
        if (std::fabs(inside) < kSpanSlack) {
          event_[voxel(n, e, k)].edge = true;
          written_.push_back(voxel(n, e, k));
        }
      }
      if (first < 0) {
        continue;
      }
      const int run = settings_.cone_run_cells;
      for (int k = first; k <= last; k += run) {
        const int count = std::min(run, last - k + 1);
        // Where rounding may begin or end a run one voxel off, its middle moves by up to one.
        const auto middle = [&](double shift) {
          return Vector{d[0], d[1], k + 0.5 * count + shift - from[2]};
        };
        const auto exact = weight_at(middle(0.0));
        const auto apart = [&](double shift) {
          const auto moved = weight_at(middle(shift));
          return Weight{std::fabs(moved.hit.value - exact.hit.value) + moved.hit.error,
                        std::fabs(moved.miss.value - exact.miss.value) + moved.miss.error};
        };
        Weight doubt{0.0, 0.0};   // of hit and of miss
        Weight border{0.0, 0.0};  // of a run's end voxels, which may belong to the next run
        if (settings_.allowances && doubtful && run > 1) {
          for (const double shift : {-1.0, -0.5, 0.5, 1.0}) {
            doubt.value = std::max(doubt.value, apart(shift).value);
            doubt.error = std::max(doubt.error, apart(shift).error);
          }
          for (const double shift :
               {-0.5 * (run + count), 0.5 * (run + std::min(run, last - k - count + 1))}) {
            border.value = std::max(border.value, apart(shift).value);
            border.error = std::max(border.error, apart(shift).error);
          }
        }
        for (int i = k; i < k + count; ++i) {
          const bool at_end = i == k || i == k + count - 1;
          Increment& increment = event_[voxel(n, e, i)];
          increment.hit += exact.hit.value;
          increment.miss += exact.miss.value;
          increment.allowed_hit +=
              exact.hit.error + std::max(doubt.value, at_end ? border.value : 0.0);
          increment.allowed_miss +=
              exact.miss.error + std::max(doubt.error, at_end ? border.error : 0.0);
          written_.push_back(voxel(n, e, i));
        }
      }
    }
  }
}

void Oracle::integrate(const base::Ping& ping, const base::Pose& pose) {
  for (const std::size_t at : written_) {
    event_[at] = Increment{};
  }
  written_.clear();
  ambiguous_ = false;
  wall_ = false;

  const double az = radians(ping.azimuth_bam32);
  const double el = radians(ping.elevation_bam32);
  const double rot = radians(ping.rotation_bam32);
  const Vector axis = {std::cos(el) * std::cos(az), std::cos(el) * std::sin(az), std::sin(el)};
  const Vector up = {-std::sin(el) * std::cos(az), -std::sin(el) * std::sin(az), std::cos(el)};
  const Vector side = {-std::sin(az), std::cos(az), 0.0};
  Vector along{};
  Vector across{};
  for (std::size_t i = 0; i < 3; ++i) {
    along[i] = std::cos(rot) * up[i] + std::sin(rot) * side[i];
    across[i] = std::cos(rot) * side[i] - std::sin(rot) * up[i];
  }
  const Frame frame{turn(pose.attitude, axis), turn(pose.attitude, along),
                    turn(pose.attitude, across)};
  Vector from{};
  Vector variance{};
  for (std::size_t i = 0; i < 3; ++i) {
    from[i] = static_cast<double>(pose.position_um[i] - config_.origin_mm[i] * 1000) / cell_um_;
    variance[i] = square(pose.covariance.sigma_position_mm[i] * 1000.0 / cell_um_);
  }
  if (ping.kind == base::ReturnKind::kNoReturn) {
    if (config_.no_return == model::NoReturnPolicy::kEmpty) {
      carve(frame, from, nullptr, static_cast<double>(config_.detect_range_um) / cell_um_,
            kUnits / 8.0);
    }
  } else {
    const double range = static_cast<double>(ping.range_um) / cell_um_;
    const Slope bottom = slope(frame, from, range, variance);
    const Shell event = shell(frame, from, range, variance, bottom);
    add_shell(event, event.empty_range);
    const double peak =
        table_.kernel_q15[event.level][model::kKernelPhases / 2][model::kKernelCentre] / 32768.0;
    carve(frame, from, &event, event.empty_range, 0.5 * event.weight * peak);
  }
  // A voxel may be listed twice, by shell and cone; its increment counts once.
  std::sort(written_.begin(), written_.end());
  written_.erase(std::unique(written_.begin(), written_.end()), written_.end());
  for (const std::size_t at : written_) {
    hits_[at] = std::min(65535.0, hits_[at] + event_[at].hit);
    misses_[at] = std::min(65535.0, misses_[at] + event_[at].miss);
  }
  if (candidate_n_ >= 0) {
    rescale(candidate_n_, candidate_e_);
    candidate_n_ = -1;
  }
}

// -------------------------------------------------------------------------------------- extraction

std::vector<double> Oracle::extract() const {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto columns = static_cast<std::size_t>(size_[0]) * static_cast<std::size_t>(size_[1]);
  std::vector<ColumnDepth> raw(columns);
  std::vector<int> lit(columns, 0);
  for (int n = 0; n < size_[0]; ++n) {
    for (int e = 0; e < size_[1]; ++e) {
      raw[column(n, e)] = column_depth(n, e);
      for (int k = 0; k < size_[2]; ++k) {
        if (hits_[voxel(n, e, k)] + misses_[voxel(n, e, k)] > 0.5) {
          lit[column(n, e)] = k + 1;
        }
      }
    }
  }
  std::vector<double> depths(columns, nan);
  for (int n = 0; n < size_[0]; ++n) {
    for (int e = 0; e < size_[1]; ++e) {
      const ColumnDepth& own = raw[column(n, e)];
      if (!own.known && lit[column(n, e)] == 0) {
        continue;
      }
      struct Neighbour {
        double n, e, z, d4, noise;
        bool lone;
      };
      std::vector<Neighbour> window;
      for (int i = -3; i <= 3; ++i) {
        for (int j = -3; j <= 3; ++j) {
          if (n + i < 0 || e + j < 0 || n + i >= size_[0] || e + j >= size_[1]) {
            continue;
          }
          const ColumnDepth& other = raw[column(n + i, e + j)];
          if (other.known) {
            const double d2 = i * i + j * j;
            window.push_back(
                {static_cast<double>(i), static_cast<double>(j), other.depth, d2 * d2,
                 std::clamp(kUnits * min_variance_ / other.mass, 1.0 / 65536.0, 1024.0),
                 other.lone});
          }
        }
      }
      if (!own.known && (window.size() < 3 ||
                         window.front().z - lit[column(n, e)] > model::kKernelCentre + 2.0)) {
        continue;
      }
      // What one ping alone says far from the neighbourhood's median counts for little.
      if (window.size() >= 8) {
        const auto median = [&window](const auto& value) {
          std::vector<double> values;
          for (const Neighbour& at : window) {
            values.push_back(value(at));
          }
          std::sort(values.begin(), values.end());
          return values[values.size() / 2];
        };
        const double middle = median([](const Neighbour& at) { return at.z; });
        const auto off = [middle](const Neighbour& at) { return std::fabs(at.z - middle); };
        const double limit = 4.0 * std::max(0.75, median(off));
        for (Neighbour& at : window) {
          at.noise += at.lone && off(at) > limit ? 4.0 * square(off(at)) : 0.0;
          at.noise = std::min(at.noise, 1024.0);
        }
      }
      double roughness = 0.05;
      for (int pass = 0; pass < 2; ++pass) {
        // Weighted least squares of a plane, centred; a ridge keeps a line of columns solvable.
        double s = 0, sn = 0, se = 0, sz = 0;
        for (const Neighbour& at : window) {
          const double w = 1.0 / (at.noise + roughness * at.d4);
          s += w;
          sn += w * at.n;
          se += w * at.e;
          sz += w * at.z;
        }
        double cnn = 1.0 / 64.0, cee = 1.0 / 64.0, cne = 0, cnz = 0, cez = 0, spread = 0, noise = 0;
        for (const Neighbour& at : window) {
          const double w = 1.0 / (at.noise + roughness * at.d4) / s;
          const double dn = at.n - sn / s;
          const double de = at.e - se / s;
          const double dz = at.z - sz / s;
          cnn += w * dn * dn;
          cee += w * de * de;
          cne += w * dn * de;
          cnz += w * dn * dz;
          cez += w * de * dz;
          spread += w * (at.n * at.n + at.e * at.e);
          noise += w * at.noise;
        }
        const double determinant = cnn * cee - cne * cne;
        const double slope_n = (cnz * cee - cez * cne) / determinant;
        const double slope_e = (cez * cnn - cnz * cne) / determinant;
        const double centre = sz / s - slope_n * sn / s - slope_e * se / s;
        if (pass == 1) {
          depths[column(n, e)] = std::clamp(centre, 0.0, static_cast<double>(size_[2]));
          break;
        }
        double residual = 0.0;
        for (const Neighbour& at : window) {
          const double w = 1.0 / (at.noise + roughness * at.d4) / s;
          residual +=
              w * square(std::clamp(at.z - centre - slope_n * at.n - slope_e * at.e, -64.0, 64.0));
        }
        roughness = std::clamp(4.0 * std::max(0.0, residual - 0.5 * noise) / std::max(0.5, spread),
                               0.005, 10.0);
      }
    }
  }
  return depths;
}

}  // namespace leadline::test
