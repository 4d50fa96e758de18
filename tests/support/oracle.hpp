// The oracle: the method in double precision, one voxel at a time, as plainly as it can be written.
// Slow on purpose; it shares no arithmetic with model/, only its records and the localization table.
//
// Both sides read the same table. The oracle reads it as a sampled function, linearly interpolated, and
// the range blur not at all: that Gaussian it computes itself. What the vehicle's coarser reading costs
// (nearest entry below, sixteen phases) is the table error; Increment::allowed states it per voxel,
// together with what rounding the geometry may move.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "model/base/ping.hpp"
#include "model/base/pose.hpp"
#include "model/config.hpp"
#include "model/localization_table.hpp"

namespace leadline::test {

/// What one event adds to one voxel, in units of the voxel's halves.
struct Increment {
  double hit = 0.0;
  double miss = 0.0;
  double allowed_hit = 0.0;  ///< stated table error, beyond the one unit of rounding
  double allowed_miss = 0.0;
  bool edge = false;  ///< within a rounding of a cut: may be written or left out
};

/// What the oracle cannot know from the configuration.
struct OracleSettings {
  /// Largest half-width of a footprint, cells (Scale::footprint_cells).
  int footprint_cells = 24;
  /// Voxels of a column that share one weight of empty evidence; 1 = each has its own.
  int cone_run_cells = 1;
  /// A column is read again for the slope once its evidence has grown by this factor.
  double regrowth = 2.0;
  /// Whether Increment::allowed_* is worked out (several times slower).
  bool allowances = true;
};

/// Model of the oracle: doubles, unpaged, unbounded.
class Oracle {
 public:
  Oracle(const model::ModelConfig& config, const model::LocalizationTable& table,
         const OracleSettings& settings);

  /// State of a column for the slope feedback, as in model::ColumnRecord.
  struct Record {
    bool known = false;
    double depth = 0.0;  ///< cells
    double mass = 0.0;
    double gain = 0.0;
    double unchecked = 0.0;  ///< weight since the column was last looked at for saturation
    double weight = 0.0;     ///< in the slope feedback, sixteenths of information per cell^2
  };
  [[nodiscard]] Record& record(int n, int e) { return records_[column(n, e)]; }

  /// Merges one accepted ping (rejections are not the oracle's business).
  void integrate(const base::Ping& ping, const base::Pose& pose);
  /// The increments of the latest ping, index (n * size_e + e) * size_d + k.
  [[nodiscard]] const std::vector<Increment>& event() const { return event_; }
  /// True if the latest event lies so near to the boundary between two kernel levels, two profile
  /// classes, or plane and wall, that rounding may choose the other one.
  [[nodiscard]] bool ambiguous() const { return ambiguous_; }
  /// True if the latest shell stood upright.
  [[nodiscard]] bool wall() const { return wall_; }

  /// Depths of all columns, cells from the top; NaN = unknown. Row-major, north first.
  [[nodiscard]] std::vector<double> extract() const;

  [[nodiscard]] double hit(int n, int e, int k) const { return hits_[voxel(n, e, k)]; }
  [[nodiscard]] double miss(int n, int e, int k) const { return misses_[voxel(n, e, k)]; }

 private:
  using Vector = std::array<double, 3>;
  struct Frame {
    Vector axis, along, across;
  };
  struct Slope {
    double n, e;
  };
  struct Shell;
  struct ColumnDepth {
    bool known;
    double depth;
    double mass;
    bool lone;  // rests on fewer than two pings
  };

  [[nodiscard]] std::size_t column(int n, int e) const;
  [[nodiscard]] std::size_t voxel(int n, int e, int k) const;
  [[nodiscard]] Slope slope(const Frame& frame, const Vector& from, double range,
                            const Vector& variance);
  [[nodiscard]] Shell shell(const Frame& frame, const Vector& from, double range,
                            const Vector& variance, const Slope& bottom);
  void add_shell(const Shell& shell, double range);
  void carve(const Frame& frame, const Vector& from, const Shell* shell, double range,
             double strength);
  [[nodiscard]] ColumnDepth column_depth(int n, int e) const;
  void rescale(int n, int e);

  model::ModelConfig config_;
  model::LocalizationTable table_;
  OracleSettings settings_;
  int size_[3];
  double cell_um_;
  double sigma_range_;   // cells
  double min_variance_;  // cells^2
  double max_range_;     // cells
  bool ambiguous_ = false;
  bool lattice_undecided_ = false;
  bool wall_ = false;
  int candidate_n_ = -1;  ///< column to look at for saturation after the ping
  int candidate_e_ = -1;
  std::vector<double> hits_;
  std::vector<double> misses_;
  std::vector<Record> records_;
  std::vector<Increment> event_;
  std::vector<std::size_t> written_;
};

}  // namespace leadline::test
