// The model: pings in, voxels, depths out. Stochastic backprojection (Stewart 1988; method 1) in
// integers: see DESIGN.md for what was chosen and why.
//
// A Model is a large static object (capacity.hpp): define it at namespace scope, never on a stack. It
// allocates nothing, reads no clock, does no I/O, and its result depends only on the sequence of calls.
// Not thread-safe: one owner.
#pragma once

#include <cstdint>

#include "model/base/ping.hpp"
#include "model/base/pose.hpp"
#include "model/base/status.hpp"
#include "model/column_depth.hpp"
#include "model/config.hpp"
#include "model/event.hpp"
#include "model/grid.hpp"
#include "model/localization_table.hpp"
#include "model/work_bound.hpp"

namespace leadline::model {

struct PlainCone;
enum class ConeForm : std::uint8_t;

/// What became of a ping.
enum class PingResult : std::uint8_t {
  kFused = 0,     ///< written (possibly clipped by the grid, possibly to nothing)
  kNoReturn = 1,  ///< no return: ignored, or carved empty, by policy
  kRangeTooShort = 2,
  kRangeTooLong = 3,
  kPoseInvalid = 4,    ///< a validity bit is missing
  kTooFar = 5,         ///< the transducer is over kMaxSideCells from the grid's origin
  kProfile = 6,        ///< a profile that no detector has turned into a range
  kNotConfigured = 7,  ///< no configuration, or no such sensor in it
  kAbsentTile =
      8,  ///< voxels that it needs are not in memory: nothing was written, to be tried again
  kCount = 9,
};

/// Short name for statistics (`range_too_short`, ...).
[[nodiscard]] const char* ping_result_name(PingResult result);

/// Never-decreasing counters since configure().
struct ModelCounters {
  std::uint64_t pings[static_cast<int>(PingResult::kCount)];
  std::uint64_t voxel_updates;       ///< voxels written
  std::uint64_t columns_updated;     ///< shell columns written
  std::uint64_t column_extractions;  ///< columns read for the slope feedback
  std::uint64_t columns_rescaled;    ///< evidence halved because a voxel neared saturation
  std::uint64_t cones_cut;           ///< cones that met their budget before their end
  std::uint64_t behind_fused;        ///< later returns of pings (integrate_behind)
  std::uint32_t max_voxels_per_ping;
  std::uint32_t last_voxels_per_ping;
};

/// A rectangle of tiles, all bounds inclusive; empty if north0 > north1.
struct TileBox {
  std::int32_t north0, north1, east0, east1;
};

/// Result of an extraction for one column.
struct ColumnResult {
  std::int32_t raw_q8;  ///< depth of the column's own voxels, or kUnknownDepth
  /// Their evidence, event units. Without a depth: where evidence ends, one past its deepest voxel; 0 where there is
  /// none (smoothing asks for it when the voxels may have left).
  std::uint32_t mass;
  std::int32_t depth_q8;    ///< depth after certainty-matched smoothing, or kUnknownDepth
  std::uint32_t sigma_q12;  ///< one sigma of the depth, 1/4096 cell
  std::uint32_t noise_q16;  ///< variance of the depth from noise alone, cells^2: a part of sigma
};

/// What an extract_tile() did, in columns.
struct TileWork {
  std::uint32_t columns_read;
  std::uint32_t columns_smoothed;
  std::uint32_t columns_assessed;
};

/// A kind of sonar: its localization table, and the ranges at which its pings are taken.
struct SensorConfig {
  const void* table;  ///< the block; read by configure() only
  std::size_t table_size_bytes;
  std::int64_t min_range_um;  ///< shorter ranges are rejected and carve nothing
  std::int64_t max_range_um;  ///< longer ranges are rejected; the signal drowns in noise here
  std::int64_t
      detect_range_um;  ///< NoReturnPolicy::kEmpty: where a target would have been detected
};

inline constexpr std::uint32_t kWholeShare_q8 = 256;

/// What is known of a return beside its range.
struct ReturnDetail {
  std::uint32_t share_q8 =
      kWholeShare_q8;  ///< of its evidence that its quality leaves, 0 .. kWholeShare_q8
  /// Something was heard from here on, however faint: the way is free only so far, and not to the return.
  std::int64_t clear_um = base::kMaxRange_um;
};

/// What follows from a checked configuration, a checked table and the longest range, but the unit of evidence:
/// enough for work_bound(). O(1).
[[nodiscard]] Scale sensor_scale(const ModelConfig& config, const LocalizationTable& table,
                                 std::int64_t max_range_um);

// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): extract() writes every result that is read.
class Model {
 public:
  Model() = default;
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;

  /// Checks and adopts a configuration and 1 .. kMaxSensors kinds of sensors (all copied); clears the
  /// map. O(grid). Evidence of all sensors is in one unit: 255 for the best ping of the best of them.
  /// * kInvalidArgument, kBadVersion, kBadChecksum, kTruncated: a table, or sensor_count is 0
  /// * kOutOfRange: a value of the configuration or a range of a sensor
  /// * kOverCapacity: the grid, or sensor_count > kMaxSensors
  /// * kOverBudget: bound() exceeds the configured budget
  [[nodiscard]] base::Status configure_sensors(const ModelConfig& config,
                                               const SensorConfig* sensors,
                                               std::size_t sensor_count);
  /// The same with one sensor, of the ranges in `config`.
  [[nodiscard]] base::Status configure(const ModelConfig& config, const void* table_bytes,
                                       std::size_t table_size_bytes);

  /// Begins an empty map whose lowest corner is elsewhere; sensors and counters stay. kOutOfRange, and nothing done:
  /// no configuration yet, or an origin that configure() would refuse. O(grid).
  [[nodiscard]] base::Status restart(const std::int64_t (&origin_mm)[3]);

  [[nodiscard]] const ModelConfig& config() const { return config_; }
  [[nodiscard]] std::size_t sensor_count() const { return sensor_count_; }
  /// Table of a sensor, sensor < sensor_count().
  [[nodiscard]] const LocalizationTable& table(std::size_t sensor = 0) const {
    return sensors_[sensor].table;
  }
  /// Work bound of the configuration, the largest of its sensors'; valid after configure(), also when it
  /// returned kOverBudget.
  [[nodiscard]] const WorkBound& bound() const { return bound_; }
  [[nodiscard]] const ModelCounters& counters() const { return counters_; }
  /// What the last integrate() did.
  [[nodiscard]] const PingWork& last_work() const { return work_; }
  /// Scale of a sensor; what depends on the grid alone is the same for all.
  [[nodiscard]] const Scale& scale(std::size_t sensor = 0) const { return sensors_[sensor].scale; }
  [[nodiscard]] const Grid& grid() const { return grid_; }
  [[nodiscard]] Grid& grid() { return grid_; }

  /// Merges one ping that `sensor` (index into those configured) heard from `pose` (the transducer's own
  /// pose at the ping: lever arms applied).
  /// Bounded: at most bound().total_voxels voxels written, kSlopeColumns columns read. Never fails on
  /// data: what cannot be used is counted and reported.
  PingResult integrate(const base::Ping& ping, const base::Pose& pose, std::size_t sensor = 0,
                       const ReturnDetail& detail = {});

  /// Merges a later return of the transmission that integrate() took last: `ping.range_um` is its range,
  /// everything else is the same (DESIGN.md, section 10). Only its shell: what stands before it hides the way, so
  /// nothing is said to be empty. Not a ping of its own in the counters.
  /// Bounded: at most bound().behind_voxels voxels written, kSlopeColumns columns read. Results as of
  /// integrate(); anything but kFused wrote nothing. In a windowed grid: kAbsentTile where its tiles are
  /// not there: it may come again as long as no other ping was taken.
  PingResult integrate_behind(const base::Ping& ping, const base::Pose& pose,
                              std::size_t sensor = 0, const ReturnDetail& detail = {});
  /// After kAbsentTile: tiles that the ping needs, as far as it could tell (the shell is known once the
  /// bottom's slope is).
  [[nodiscard]] const TileBox& wanted_tiles() const { return wanted_; }

  /// Depth, smoothing and uncertainty of every touched column: O(grid). Does not change the voxels or
  /// anything that later pings depend on.
  void extract(DepthMethod method = DepthMethod::kRobustMoment);
  /// The same by tiles, and only what has changed since: afterwards the columns of `tile` have the very
  /// results that extract(kRobustMoment) would give them now. What lies in the tile's surroundings is
  /// brought up to date as far as it is needed: columns of touched tiles are read within
  /// kInfluenceTiles + 1 tiles and smoothed within kInfluenceTiles where something near them changed, each
  /// once, whoever asks first. Bound: 81 tiles read, 49 smoothed, 1 assessed (the whole grid, once, when the
  /// last extract() used another method). Nothing before configure().
  /// Tiles of a windowed grid that are not in memory are not read: what was last read of them counts, and is all
  /// that there is if they left with read_touched_tile().
  TileWork extract_tile(TileId tile);
  /// extract_tile() in steps, for whoever spreads it over time: the tiles that were touched are read, then the
  /// tiles are smoothed, all that are out of date, then those that are wanted assessed. What was smoothed belongs to
  /// the voxels as they were when read. Nothing is done where nothing changed; results are the columns worked on, at
  /// most a tile's. O(tile). Only with kRobustMoment in the last extract(), if any.
  /// The first also before a tile's voxels leave: the other two, and the link, do without them.
  std::uint32_t read_touched_tile(TileId tile);
  std::uint32_t smooth_changed_tile(TileId tile);
  std::uint32_t assess_changed_tile(TileId tile);
  /// A ping that touches a tile can change results at most this many tiles away (in north and in east):
  /// sigma looks 34 cells far, smoothing 3.
  static constexpr std::int32_t kInfluenceTiles = 3;
  /// Takes a tile that pings touched since it was taken last; false: none. Whoever keeps results by tiles
  /// has to ask for those within kInfluenceTiles again. O(1).
  [[nodiscard]] bool take_touched_tile(TileId& tile) { return grid_.take_touched(tile); }
  /// Result of the last extraction for column (n, e).
  [[nodiscard]] const ColumnResult& result(std::int32_t n, std::int32_t e) const {
    return results_[grid_.column_index(n, e)];
  }
  /// True if a second surface was seen in the column at the last extract().
  [[nodiscard]] bool multi_surface(std::int32_t n, std::int32_t e) const {
    return (grid_.column(grid_.column_index(n, e)).flags & kColumnMultiSurface) != 0;
  }

  /// Columns that one ping reads for the slope of the bottom.
  static constexpr int kSlopeColumns = 9;

 private:
  /// A kind of sensor with what follows from its table.
  struct Sensor {
    SensorConfig config;  // its table pointer is null: the block is below
    LocalizationTable table;
    Scale scale;
  };
  void set_pull();
  [[nodiscard]] base::Status clear_map();
  [[nodiscard]] ColumnDepth depth_of(std::uint32_t column, DepthMethod method) const;
  [[nodiscard]] base::Status adopt_sensor(const SensorConfig& config, Sensor& sensor) const;
  [[nodiscard]] PingResult sight(const base::Ping& ping, const base::Pose& pose,
                                 Sighting& sighting) const;
  [[nodiscard]] bool has_tiles(std::int32_t n0, std::int32_t n1, std::int32_t e0, std::int32_t e1);
  [[nodiscard]] bool has_cone_tiles(const BeamFrame& frame, const Sighting& sighting,
                                    std::int32_t range_q10);
  struct SlopePlace;
  [[nodiscard]] SlopePlace slope_place(const BeamFrame& frame, const Sighting& sighting) const;
  [[nodiscard]] bool has_slope_tiles(const BeamFrame& frame, const Sighting& sighting);
  [[nodiscard]] bool has_return_tiles(const BeamFrame& frame, const Sighting& sighting, bool cone);
  void prefetch_columns(const BeamFrame& frame, const Sighting& sighting) const;
  void read_for_slope(std::uint32_t index);
  [[nodiscard]] Slope estimate_slope(const BeamFrame& frame, const Sighting& sighting);
  struct ShellContext;
  template <bool kTwoAxis>
  [[nodiscard]] std::uint32_t add_shell_rows(const ShellEvent& event, const ShellContext& context);
  [[nodiscard]] ShellEvent add_return(const base::Ping& ping, const BeamFrame& frame,
                                      const Sighting& sighting, std::uint32_t share_q8);
  void add_shell_event(const ShellEvent& event, std::uint32_t now_ds);
  void check_saturation(std::uint32_t column);
  void add_empty(Voxel* voxels, std::int32_t count, std::uint32_t first, std::uint32_t strength_q7,
                 std::uint32_t distance, std::uint32_t dither) const;
  [[nodiscard]] bool carves_nothing(const BeamFrame& frame, const Sighting& sighting,
                                    std::int32_t range_q10) const;
  void carve(const BeamFrame& frame, const Sighting& sighting, const ShellEvent* shell,
             std::int32_t range_q10, std::uint32_t end_q14);
  struct CarveContext;
  /// Voxels that the ping under way may still write.
  [[nodiscard]] std::uint32_t room_left() const {
    return voxels_this_ping_ < bound_.total_voxels ? bound_.total_voxels - voxels_this_ping_ : 0;
  }
  [[nodiscard]] bool carve_row(const CarveContext& context, std::int32_t n);
  struct CarvedColumn;
  [[nodiscard]] bool carve_column(const CarveContext& context, const CarvedColumn& column,
                                  std::uint32_t& room);
  struct PlacedColumn;
  struct PlainRow;
  [[nodiscard]] bool carve_plain_columns(const PlainCone& cone, const PlainRow& row,
                                         const PlacedColumn* column, const PlacedColumn* end,
                                         std::uint32_t& room);
  template <ConeForm kForm>
  [[nodiscard]] bool carve_plain_row(const CarveContext& context, const PlainCone& cone,
                                     std::int32_t n);
  struct TileSpan;
  [[nodiscard]] TileSpan tiles_around(TileId tile, std::int32_t reach) const;
  [[nodiscard]] bool read_column(std::uint32_t column, DepthMethod method);
  void read_tile(TileId tile);
  void mark_unsmoothed(TileId tile, const std::uint16_t rows[kTileCells]);
  [[nodiscard]] std::uint32_t smooth_tile(TileId tile);
  [[nodiscard]] std::uint32_t assess_tile(TileId tile);
  void smooth_column(std::int32_t n, std::int32_t e);
  void assess_column(std::int32_t n, std::int32_t e);
  [[nodiscard]] Slope result_slope(std::int32_t n, std::int32_t e) const;

  ModelConfig config_{};
  Sensor sensors_[kMaxSensors] = {};
  std::size_t sensor_count_ = 0;
  const Sensor* sensor_ = sensors_;  // of the ping under way
  Scale scale_{};                    // of the first sensor
  WorkBound bound_{};
  ModelCounters counters_{};
  bool configured_ = false;
  TileBox wanted_{0, -1, 0, -1};
  std::uint32_t ping_number_ = 0;
  std::uint32_t voxels_this_ping_ = 0;
  PingWork work_{};
  std::uint32_t limit_voxels_ = 0;       // for them
  std::int64_t correlated_q12_[3] = {};  // cells^2
  std::int64_t registration_q12_ = 0;    // cells^2, see DESIGN.md
  Grid grid_;
  DepthMethod method_ = DepthMethod::kRobustMoment;  // of the raw depths in results_
  LEADLINE_BANK("results") ColumnResult results_[kColumnCapacity];
};

}  // namespace leadline::model
