#include "host_tools/calibrate.hpp"

#include <algorithm>
#include <cmath>
#include <map>

// As in estimator/filter_access.hpp: one program, one Eigen.
#define EIGEN_DONT_VECTORIZE
#define EIGEN_NO_MALLOC
#define EIGEN_NO_DEBUG
#define EIGEN_MAX_ALIGN_BYTES 0
#include <Eigen/Dense>

#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr std::size_t kCount = kAlignmentParameters;
constexpr double kHuber = 2.5;      // robust sigmas
constexpr double kLeftOut = 10.0;   // robust sigmas
constexpr double kSlopeCounts = 4;  // sigmas
constexpr double kGroundCells = 5;  // edge of a piece of ground, in cells
constexpr unsigned kPatience = 12;
constexpr unsigned kMaxSteps = 40;

using Plane = Eigen::Vector3d;
using Matrix = Eigen::Matrix<double, kCount, kCount>;
using Vector = Eigen::Matrix<double, kCount, 1>;

/// Soundings of one cell: a stretch of Patches::order.
struct Cell {
  std::size_t begin;
  std::size_t end;
  double north_m;  ///< centre
  double east_m;
};

struct Patches {
  std::vector<std::uint32_t> order;  ///< numbers of soundings, cell by cell
  std::vector<Cell> cells;           ///< those with enough
};

Patches sort_into_cells(const std::vector<Sounding>& soundings, double cell_m,
                        std::size_t min_soundings) {
  struct Entry {
    std::int64_t north;
    std::int64_t east;
    std::uint32_t sounding;
    bool operator<(const Entry& b) const {
      return north != b.north ? north < b.north
                              : (east != b.east ? east < b.east : sounding < b.sounding);
    }
  };
  std::vector<Entry> entries;
  for (std::size_t i = 0; i < soundings.size(); ++i) {
    if (std::isfinite(soundings[i].depth_m)) {
      entries.push_back({static_cast<std::int64_t>(std::floor(soundings[i].north_m / cell_m)),
                         static_cast<std::int64_t>(std::floor(soundings[i].east_m / cell_m)),
                         static_cast<std::uint32_t>(i)});
    }
  }
  std::sort(entries.begin(), entries.end());
  Patches patches;
  for (std::size_t begin = 0; begin < entries.size();) {
    std::size_t end = begin;
    while (end < entries.size() && entries[end].north == entries[begin].north &&
           entries[end].east == entries[begin].east) {
      ++end;
    }
    if (end - begin >= std::max<std::size_t>(min_soundings, 6)) {
      const std::size_t first = patches.order.size();
      for (std::size_t i = begin; i < end; ++i) {
        patches.order.push_back(entries[i].sounding);
      }
      patches.cells.push_back({first, patches.order.size(),
                               (static_cast<double>(entries[begin].north) + 0.5) * cell_m,
                               (static_cast<double>(entries[begin].east) + 0.5) * cell_m});
    }
    begin = end;
  }
  return patches;
}

/// The weighted least squares over 1, north, east of one cell, factored: any number of right sides.
class CellPlane {
 public:
  CellPlane(const Cell& cell, const Patches& patches, const std::vector<Sounding>& soundings,
            const std::vector<double>& weights, double cell_m)
      : cell_(cell), patches_(patches), soundings_(soundings), weights_(weights), cell_m_(cell_m) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    for (std::size_t k = cell.begin; k < cell.end; ++k) {
      const Plane basis = basis_of(patches_.order[k]);
      normal += weights_[patches_.order[k]] * basis * basis.transpose();
    }
    // A cell of one swath has its soundings in a row: the slope across it must stay finite.
    normal += (1e-6 * static_cast<double>(cell.end - cell.begin)) * Eigen::Matrix3d::Identity();
    inverse_ = normal.inverse();
  }

  /// Level in metres, then slopes in metres per half a cell.
  template <typename Value>
  [[nodiscard]] Plane fit(const Value& value_of) const {
    Plane right = Plane::Zero();
    for (std::size_t k = cell_.begin; k < cell_.end; ++k) {
      const std::uint32_t i = patches_.order[k];
      right += weights_[i] * value_of(k, i) * basis_of(i);
    }
    return inverse_ * right;
  }

  [[nodiscard]] Plane basis_of(std::uint32_t i) const {
    return {1.0, 2.0 * (soundings_[i].north_m - cell_.north_m) / cell_m_,
            2.0 * (soundings_[i].east_m - cell_.east_m) / cell_m_};
  }

  /// Depth per metre to the north and east; 0 where it is not larger than noise would make it.
  void slopes(const Plane& plane, double sigma_m, double* north, double* east) const {
    const Eigen::Matrix2d inverse = inverse_.block<2, 2>(1, 1);
    const Eigen::Vector2d slope(plane[1], plane[2]);
    const double chi2 = slope.dot(inverse.inverse() * slope) / (sigma_m * sigma_m);
    const bool counts = chi2 > 2.0 * kSlopeCounts * kSlopeCounts;
    *north = counts ? 2.0 * slope[0] / cell_m_ : 0.0;
    *east = counts ? 2.0 * slope[1] / cell_m_ : 0.0;
  }

 private:
  const Cell& cell_;
  const Patches& patches_;
  const std::vector<Sounding>& soundings_;
  const std::vector<double>& weights_;
  double cell_m_;
  Eigen::Matrix3d inverse_;
};

/// Distances from the planes, in the order of Patches::order.
std::vector<double> residuals_of(const Patches& patches, const std::vector<Sounding>& soundings,
                                 const std::vector<double>& weights, double cell_m) {
  std::vector<double> residuals(patches.order.size());
  for (const Cell& cell : patches.cells) {
    const CellPlane solver(cell, patches, soundings, weights, cell_m);
    const Plane plane =
        solver.fit([&](std::size_t, std::uint32_t i) { return soundings[i].depth_m; });
    for (std::size_t k = cell.begin; k < cell.end; ++k) {
      const std::uint32_t i = patches.order[k];
      residuals[k] = soundings[i].depth_m - plane.dot(solver.basis_of(i));
    }
  }
  return residuals;
}

/// 1.4826 times the median of the absolute values, at least a micrometre. Never of an empty list.
double robust_sigma(std::vector<double> values) {
  for (double& value : values) {
    value = std::fabs(value);
  }
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return std::max(1.4826 * *middle, 1e-6);
}

double weighted_squares(const Patches& patches, const std::vector<double>& residuals,
                        const std::vector<double>& weights) {
  double sum = 0;
  for (std::size_t k = 0; k < residuals.size(); ++k) {
    sum += weights[patches.order[k]] * residuals[k] * residuals[k];
  }
  return sum;
}

/// Sums of J w r over groups of soundings, and what their scatter says of the whole sum.
class Scores {
 public:
  explicit Scores(std::size_t groups) : sums_(groups, Vector::Zero()), used_(groups, false) {}
  void add(std::size_t group, const Vector& score) {
    sums_[group] += score;
    used_[group] = true;
  }
  [[nodiscard]] Matrix scatter() const {
    Matrix sum = Matrix::Zero();
    double count = 0;
    for (std::size_t i = 0; i < sums_.size(); ++i) {
      sum += sums_[i] * sums_[i].transpose();
      count += used_[i] ? 1 : 0;
    }
    return count > 1 ? Matrix(sum * (count / (count - 1))) : sum;
  }

 private:
  std::vector<Vector> sums_;
  std::vector<bool> used_;
};

/// Number of the piece of ground, below the number of cells, that each cell lies in.
std::vector<std::size_t> grounds_of(const Patches& patches, double cell_m) {
  std::map<std::pair<double, double>, std::size_t> numbers;
  std::vector<std::size_t> grounds;
  for (const Cell& cell : patches.cells) {
    const double edge_m = kGroundCells * cell_m;
    const std::pair<double, double> key = {std::floor(cell.north_m / edge_m),
                                           std::floor(cell.east_m / edge_m)};
    grounds.push_back(numbers.emplace(key, numbers.size()).first->second);
  }
  return grounds;
}

std::string short_number(double value) {
  std::string text;
  append_fixed(&text, value, std::fabs(value) < 1 ? 3 : 1);
  return text;
}

class Fit {
 public:
  Fit(const AlignedSoundings& source, const CalibrationSettings& settings, SignFlip flip,
      const AlignmentChoice& free)
      : source_(source),
        settings_(settings),
        flip_(flip),
        free_(free),
        weights_(source.blocks().size(), 1.0) {}

  /// To the end; then covariance() and the rest are of the solution.
  void run() {
    for (;;) {
      linearize();
      if (steps_ == 0) {
        spread_before_m_ = sigma_m_;
      }
      const Vector step = normal_.ldlt().solve(gradient_);
      double largest = 0;
      double seen = 0;  // of what can be observed: the rest may go where it likes
      for (std::size_t p = 0; p < kCount; ++p) {
        const double moves = std::fabs(step[row(p)]) / sigma_of(p);
        largest = std::max(largest, moves);
        seen = sigma_of(p) <= kAlignmentTraits[p].limit ? std::max(seen, moves) : seen;
      }
      if (largest < 0.05) {
        return;
      }
      // Soundings that go to and fro between cells can keep it from settling: near enough is said in the sigmas.
      steps_ += 1;
      const bool tired = steps_ > kPatience && seen < 1.0;
      if (tired || steps_ > kMaxSteps || !walk(step, largest)) {
        if (seen < 1.0) {
          covariance_.diagonal() += step.cwiseAbs2();
          return;
        }
        throw HostError(ExitCode::kInput, "the soundings lead to no alignment: after " +
                                              std::to_string(steps_) + " steps it still moves by " +
                                              short_number(seen) + " sigma");
      }
      check_far();
    }
  }

  [[nodiscard]] const Alignment& alignment() const { return alignment_; }
  [[nodiscard]] double sigma_of(std::size_t p) const {
    return std::sqrt(covariance_(row(p), row(p)));
  }
  [[nodiscard]] std::string why_not(std::size_t p) const;
  /// Largest correlation of a parameter with one of the boresight's, absolute.
  [[nodiscard]] double boresight_correlation(std::size_t p) const {
    double largest = 0;
    for (std::size_t q = 0; q <= static_cast<std::size_t>(AlignmentParameter::kHeading); ++q) {
      const double both = covariance_(row(p), row(q)) / (sigma_of(p) * sigma_of(q));
      largest = free_[q] ? std::max(largest, std::fabs(both)) : largest;
    }
    return largest;
  }

  void summarize(Calibration* result) const {
    result->cells = patches_.cells.size();
    result->shared_cells = shared_cells();
    result->soundings = patches_.order.size();
    result->steps = steps_;
    result->spread_before_m = spread_before_m_;
    result->spread_after_m = sigma_m_;
  }

  /// Cells of more than one pass. Of the last linearization.
  [[nodiscard]] std::size_t shared_cells() const {
    const std::vector<std::uint32_t>& passes = source_.passes();
    std::size_t shared = 0;
    for (const Cell& cell : patches_.cells) {
      const auto begin = patches_.order.begin();
      shared += std::any_of(begin + static_cast<std::ptrdiff_t>(cell.begin),
                            begin + static_cast<std::ptrdiff_t>(cell.end),
                            [&](std::uint32_t i) {
                              return passes[i] != passes[patches_.order[cell.begin]];
                            })
                    ? 1
                    : 0;
    }
    return shared;
  }
  /// Places and sorts the soundings as given.
  void prepare() { linearize(); }

 private:
  static Eigen::Index row(std::size_t p) { return static_cast<Eigen::Index>(p); }

  void linearize() {
    source_.place(alignment_, flip_, &soundings_);
    std::vector<std::vector<Sounding>> moved(kCount);
    for (std::size_t p = 0; p < kCount; ++p) {
      if (!free_[p]) {
        continue;
      }
      Alignment trial = alignment_;
      trial[p] += kAlignmentTraits[p].step;
      source_.place(trial, flip_, &moved[p]);
      for (std::size_t i = 0; i < soundings_.size(); ++i) {
        if (!std::isfinite(moved[p][i].depth_m)) {
          soundings_[i].depth_m = kNoValue;
        }
      }
    }
    patches_ = sort_into_cells(soundings_, settings_.cell_m, settings_.min_soundings);
    if (patches_.cells.size() < kMinCalibrationCells) {
      throw HostError(ExitCode::kInput, "only " + std::to_string(patches_.cells.size()) +
                                            " cells of " + json_number(settings_.cell_m) +
                                            " m have " + std::to_string(settings_.min_soundings) +
                                            " soundings: at least " +
                                            std::to_string(kMinCalibrationCells) +
                                            " are wanted (larger cells, more lines)");
    }
    residuals_ = residuals_of(patches_, soundings_, weights_, settings_.cell_m);
    sigma_m_ = robust_sigma(residuals_);
    for (std::size_t k = 0; k < residuals_.size(); ++k) {
      const double from = std::fabs(residuals_[k]) / sigma_m_;
      weights_[patches_.order[k]] = from <= kHuber ? 1.0 : (from > kLeftOut ? 0.0 : kHuber / from);
    }
    residuals_ = residuals_of(patches_, soundings_, weights_, settings_.cell_m);
    cost_ = weighted_squares(patches_, residuals_, weights_);
    add_up(moved);
  }

  /// Normal equations, gradient and covariance of the parameters from all cells.
  void add_up(const std::vector<std::vector<Sounding>>& moved) {
    const std::vector<std::uint32_t>& blocks = source_.blocks();
    const std::vector<std::size_t> grounds = grounds_of(patches_, settings_.cell_m);
    Scores by_ground(patches_.cells.size());
    Scores by_block(static_cast<std::size_t>(blocks.back()) + 1);
    information_ = Matrix::Zero();
    gradient_ = Vector::Zero();
    double squares = 0;
    double count = 0;
    std::vector<Vector> jacobian;
    for (std::size_t c = 0; c < patches_.cells.size(); ++c) {
      const Cell& cell = patches_.cells[c];
      cell_jacobian(cell, moved, &jacobian);
      for (std::size_t k = cell.begin; k < cell.end; ++k) {
        const std::uint32_t i = patches_.order[k];
        const Vector& j = jacobian[k - cell.begin];
        const Vector score = (weights_[i] * residuals_[k]) * j;
        information_ += weights_[i] * j * j.transpose();
        gradient_ -= score;
        by_ground.add(grounds[c], score);
        by_block.add(blocks[i], score);
        squares += weights_[i] * residuals_[k] * residuals_[k];
        count += weights_[i] > 0 ? 1 : 0;
      }
    }
    const double freedom = count - 3.0 * static_cast<double>(patches_.cells.size()) - kCount;
    const double variance = squares / std::max(freedom, 1.0);
    const double inflate = count / std::max(freedom, 1.0);
    Vector prior = Vector::Zero();
    for (std::size_t p = 0; p < kCount; ++p) {
      // What is not free is held by a prior of nothing.
      const double sigma = free_[p] ? kAlignmentTraits[p].prior : 1e-9;
      prior[row(p)] = variance / (sigma * sigma);
      gradient_[row(p)] -= free_[p] ? prior[row(p)] * alignment_[p] : 0.0;
    }
    normal_ = information_;
    normal_ += prior.asDiagonal();
    const Matrix inverse = normal_.inverse();
    const Matrix held = variance * Matrix(prior.asDiagonal());
    const Matrix independent = variance * inverse;
    const Matrix of_grounds = inverse * (inflate * by_ground.scatter() + held) * inverse;
    const Matrix of_blocks = inverse * (inflate * by_block.scatter() + held) * inverse;
    // Errors that go with the ground and errors that go with time add up; what is neither is in both sums.
    const Vector both = of_grounds.diagonal() + of_blocks.diagonal() - independent.diagonal();
    const Vector wanted = both.cwiseMax(independent.diagonal())
                              .cwiseMax(of_grounds.diagonal())
                              .cwiseMax(of_blocks.diagonal());
    const Vector widen = wanted.cwiseQuotient(independent.diagonal()).cwiseSqrt();
    covariance_ = widen.asDiagonal() * independent * widen.asDiagonal();
    // Known alone, were everything else known.
    for (std::size_t p = 0; p < kCount; ++p) {
      alone_[p] = widen[row(p)] * std::sqrt(variance / normal_(row(p), row(p)));
    }
  }

  /// d(residual)/d(parameter) of a cell's soundings.
  void cell_jacobian(const Cell& cell, const std::vector<std::vector<Sounding>>& moved,
                     std::vector<Vector>* jacobian) const {
    const CellPlane solver(cell, patches_, soundings_, weights_, settings_.cell_m);
    const Plane plane =
        solver.fit([&](std::size_t, std::uint32_t i) { return soundings_[i].depth_m; });
    double north = 0;
    double east = 0;
    solver.slopes(plane, sigma_m_, &north, &east);
    jacobian->assign(cell.end - cell.begin, Vector::Zero());
    for (std::size_t p = 0; p < kCount; ++p) {
      if (!free_[p]) {
        continue;
      }
      const double per_step = 1.0 / kAlignmentTraits[p].step;
      const auto off_plane = [&](std::size_t, std::uint32_t i) {
        const Sounding& from = soundings_[i];
        const Sounding& to = moved[p][i];
        return per_step * ((to.depth_m - from.depth_m) - north * (to.north_m - from.north_m) -
                           east * (to.east_m - from.east_m));
      };
      const Plane taken = solver.fit(off_plane);
      for (std::size_t k = cell.begin; k < cell.end; ++k) {
        const std::uint32_t i = patches_.order[k];
        (*jacobian)[k - cell.begin][row(p)] = off_plane(k, i) - taken.dot(solver.basis_of(i));
      }
    }
  }

  /// Goes along `step`, halved until the soundings agree better; false when they never do.
  bool walk(const Vector& step, double largest) {
    double share = 1.0;
    for (int halvings = 0; halvings < 6; ++halvings, share *= 0.5) {
      Alignment trial = alignment_;
      for (std::size_t p = 0; p < kCount; ++p) {
        trial[p] += free_[p] ? share * step[row(p)] : 0.0;
      }
      std::vector<Sounding> soundings;
      source_.place(trial, flip_, &soundings);
      for (const std::uint32_t i : patches_.order) {
        if (!std::isfinite(soundings[i].depth_m)) {
          soundings[i] = soundings_[i];
        }
      }
      const double cost = weighted_squares(
          patches_, residuals_of(patches_, soundings, weights_, settings_.cell_m), weights_);
      // Soundings that move on to another cell make the cost jump a little: near the end that is all.
      if (cost <= cost_ * (1.0 + (largest < 2.0 ? 1e-3 : 0.0))) {
        alignment_ = trial;
        return true;
      }
    }
    return false;
  }

  void check_far() const {
    for (std::size_t p = 0; p < kCount; ++p) {
      const AlignmentTraits& traits = kAlignmentTraits[p];
      if (std::fabs(alignment_[p]) > traits.farthest) {
        throw HostError(ExitCode::kInput, std::string("the soundings lead to no alignment: ") +
                                              traits.name + " runs off to " +
                                              short_number(alignment_[p]) + " " + traits.unit +
                                              " from what is given");
      }
    }
  }

  const AlignedSoundings& source_;
  const CalibrationSettings& settings_;
  SignFlip flip_;
  AlignmentChoice free_;
  Alignment alignment_{};
  std::vector<double> weights_;  // of each sounding
  std::vector<Sounding> soundings_;
  Patches patches_;
  std::vector<double> residuals_;
  double sigma_m_ = 0;
  double spread_before_m_ = 0;
  double cost_ = 0;
  unsigned steps_ = 0;
  Matrix information_;
  Matrix normal_;
  Vector gradient_;
  Matrix covariance_;
  std::array<double, kCount> alone_{};
};

std::string Fit::why_not(std::size_t p) const {
  const AlignmentTraits& traits = kAlignmentTraits[p];
  const std::string unit = std::string(" ") + traits.unit;
  if (alone_[p] > traits.limit) {
    return "the soundings hardly depend on it (" + short_number(alone_[p]) + unit +
           " at best, were all else known; wanted " + short_number(traits.limit) + unit + ")";
  }
  std::size_t partner = p;
  double strongest = 0;
  for (std::size_t q = 0; q < kCount; ++q) {
    const double both = covariance_(row(p), row(q)) / (sigma_of(p) * sigma_of(q));
    if (q != p && free_[q] && std::fabs(both) > std::fabs(strongest)) {
      strongest = both;
      partner = q;
    }
  }
  return std::string("not to be told from ") + kAlignmentTraits[partner].name + " (correlation " +
         json_number(std::round(strongest * 1000.0) / 1000.0) + "; sigma " +
         short_number(sigma_of(p)) + unit + ", wanted " + short_number(traits.limit) + unit + ")";
}

bool is_boresight(std::size_t p) {
  return p <= static_cast<std::size_t>(AlignmentParameter::kHeading);
}

bool is_lever_arm(std::size_t p) {
  return p == static_cast<std::size_t>(AlignmentParameter::kForward) ||
         p == static_cast<std::size_t>(AlignmentParameter::kStarboard);
}

std::size_t count_shared_cells(const AlignedSoundings& source, const CalibrationSettings& settings,
                               SignFlip flip) {
  Fit as_given(source, settings, flip, AlignmentChoice{});
  as_given.prepare();
  return as_given.shared_cells();
}

}  // namespace

Calibration calibrate(const AlignedSoundings& source, const CalibrationSettings& settings,
                      SignFlip flip) {
  Calibration result;
  AlignmentChoice free = settings.fit;
  double before_m = 0;
  const std::size_t shared = count_shared_cells(source, settings, flip);
  for (std::size_t p = 0; p < kCount; ++p) {
    if (free[p] && is_boresight(p) && shared < kMinCalibrationCells) {
      free[p] = false;
      result.parameters[p].why_not = "only " + std::to_string(shared) +
                                     " cells were covered by two passes (wanted " +
                                     std::to_string(kMinCalibrationCells) + ")";
    }
  }
  for (bool again = true; again;) {
    again = false;
    Fit fit(source, settings, flip, free);
    fit.run();
    fit.summarize(&result);
    before_m = before_m == 0 ? result.spread_before_m : before_m;
    for (std::size_t p = 0; p < kCount; ++p) {
      CalibratedParameter& parameter = result.parameters[p];
      parameter.fitted = settings.fit[p];
      if (!free[p]) {
        continue;
      }
      parameter.value = fit.alignment()[p];
      parameter.sigma = fit.sigma_of(p);
      parameter.observable =
          parameter.sigma <= kAlignmentTraits[p].limit &&
          !(is_lever_arm(p) && fit.boresight_correlation(p) > kLeverArmCorrelation);
      parameter.why_not = parameter.observable ? "" : fit.why_not(p);
      if (!parameter.observable && is_lever_arm(p)) {
        free[p] = false;
        again = true;
      }
    }
  }
  result.spread_before_m = before_m;
  return result;
}

}  // namespace leadline::host
