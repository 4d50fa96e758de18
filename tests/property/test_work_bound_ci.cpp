// The most that one ping can cost: a search for pings that touch more voxels than W(config), and for
// pings that come close to it. A bound that is never met tells as little as one that is exceeded.
//
// Per configuration: seeded corners (the beam level and in the grid, straight down, along the diagonal,
// from outside, over prepared slopes), random pings around them, then hill climbing on several islands
// over position, attitude, beam direction, range, stated covariance and the map under the beam's end.
// Every ping is checked against W, not only the best one.
//
// The same search looks for the ping that costs a Cortex-M7 most: by what a ping's instructions go with
// (model::PingWork), at the price that toolchain/timing.sh measures on the target.
//
//   LEADLINE_WORK_BOUND_PINGS   pings per configuration (toolchain/soak.sh runs the long search)
//   LEADLINE_WORK_BOUND_ONLY    run the configurations whose name contains this
//   LEADLINE_COST_FOLDER        leave the worst pings there: NAME.cost for the target, NAME.txt to be kept
//   LEADLINE_COST_FROM          a NAME.txt: no search, these pings
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "firmware/config/m7_load.hpp"
#include "firmware/config/m7_prices.hpp"
#include "firmware/m7/cost_file.hpp"
#include "host_tools/table/generator.hpp"
#include "model/model.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::BeamDescription;
using leadline::model::BeamKind;
using leadline::test::Random;
namespace base = leadline::base;
namespace model = leadline::model;

// As on a vehicle: one static object.
model::Model the_model;

constexpr double kPi = 3.141592653589793;
constexpr double kReachedShare = 0.9;

struct Trial {
  std::string name;
  std::array<std::int32_t, 3> size;
  double max_range_cells;
  BeamDescription beam;
  std::int32_t cell_mm = 1000;
  std::array<double, 3> sigma_position_cells = {0, 0, 0};
  model::Rule rule = model::Rule::kLogOdds;
  bool empty_without_return = false;
};

BeamDescription cone(double half_angle_deg, double sigma_pointing_deg, double sigma_range_mm) {
  BeamDescription beam;
  beam.half_angle_deg = half_angle_deg;
  beam.sigma_pointing_deg = sigma_pointing_deg;
  beam.sigma_range_mm = sigma_range_mm;
  return beam;
}

BeamDescription piston(double diameter_mm, double frequency_hz) {
  BeamDescription beam = cone(0, 0.5, 100);
  beam.kind = BeamKind::kPiston;
  beam.piston_diameter_mm = diameter_mm;
  beam.frequency_hz = frequency_hz;
  return beam;
}

BeamDescription aperture(double along_mm, double across_mm, double frequency_hz,
                         double max_half_angle_deg) {
  BeamDescription beam = cone(0, 0.5, 200);
  beam.kind = BeamKind::kRectangle;
  beam.aperture_along_mm = along_mm;
  beam.aperture_across_mm = across_mm;
  beam.frequency_hz = frequency_hz;
  beam.max_half_angle_deg = max_half_angle_deg;
  return beam;
}

std::vector<Trial> trials() {
  std::vector<Trial> list;
  const auto add = [&list](const char* name, std::array<std::int32_t, 3> size, double range,
                           const BeamDescription& beam) -> Trial& {
    Trial trial{};
    trial.name = name;
    trial.size = size;
    trial.max_range_cells = range;
    trial.beam = beam;
    trial.rule = list.size() % 2 == 0 ? model::Rule::kLogOdds : model::Rule::kWeightedMean;
    list.push_back(trial);
    return list.back();
  };
  // The scenes of the accuracy table and the job of the speed table.
  add("helens_low", {128, 128, 32}, 80, cone(3, 1, 1500));
  add("helens_high", {128, 128, 32}, 80, cone(3, 1, 1500)).sigma_position_cells = {3, 3, 1};
  Trial& monterey = add("monterey_fan", {128, 128, 32}, 86.6, cone(1.5, 0.5, 15000));
  monterey.cell_mm = 30000;
  monterey.sigma_position_cells = {0.5, 0.5, 0.2};
  add("helens_altimeter", {128, 128, 32}, 60, cone(12.5, 1, 200)).sigma_position_cells = {0.5, 0.5,
                                                                                          0.1};
  add("helens_rolling_fan", {128, 128, 32}, 90, cone(1.2, 0.5, 300)).sigma_position_cells = {
      0.2, 0.2, 0.1};
  add("plane_flat", {64, 64, 8}, 60, cone(3, 1, 1000));
  add("plane_slope30", {64, 64, 45}, 60, cone(3, 1, 1000));
  add("speed_job", {128, 128, 32}, 40, cone(3, 1, 1000));
  // Beams from 0.5 to 20 degrees.
  add("pencil_0.5deg", {512, 512, 32}, 400, cone(0.5, 0.1, 300));
  add("exact_pencil", {128, 128, 32}, 100, cone(0.5, 0, 0));
  add("wide_20deg", {96, 96, 64}, 40, cone(20, 1, 500));
  add("wide_20deg_long", {256, 256, 128}, 160, cone(20, 2, 1000));
  add("piston_200kHz", {128, 128, 64}, 60, piston(60, 200000));
  add("piston_30kHz", {128, 128, 64}, 50, piston(100, 30000));
  // Two-axis beams.
  add("aperture_4_to_1", {128, 128, 48}, 60, aperture(200, 50, 200000, 30));
  add("multibeam_transmit", {128, 128, 64}, 50, aperture(400, 20, 200000, 20));
  add("side_scan", {256, 256, 64}, 100, aperture(1000, 40, 100000, 25));
  // Errors from none to more than the grid.
  add("noiseless", {128, 128, 32}, 40, cone(6, 0, 0));
  add("range_sigma_20_cells", {128, 128, 64}, 80, cone(3, 1, 20000));
  add("pointing_10deg", {128, 128, 64}, 40, cone(3, 10, 500));
  add("position_20_cells", {128, 128, 32}, 60, cone(3, 1, 1000)).sigma_position_cells = {20, 20, 5};
  add("no_return_is_empty", {128, 128, 64}, 60, piston(150, 100000)).empty_without_return = true;
  // Grids of all shapes.
  add("one_layer", {256, 256, 1}, 60, cone(3, 1, 500));
  add("four_layers_20deg", {128, 128, 4}, 60, cone(20, 1, 500));
  add("shaft", {16, 16, 512}, 200, cone(3, 1, 500));
  add("one_column", {1, 1, 256}, 200, cone(5, 1, 500));
  add("strip", {12, 1000, 16}, 300, cone(2, 1, 500));
  add("two_cells_a_side", {2, 2, 2}, 20, cone(5, 1, 500));
  add("small_grid_long_range", {64, 64, 64}, 2000, cone(3, 1, 1000));
  add("longest_range", {64, 64, 64}, 8000, cone(0.5, 0.1, 1000));
  add("eighty_degrees", {128, 128, 32}, 4000, cone(80, 1, 1000));
  add("wide_beam_small_grid", {32, 32, 16}, 100, cone(20, 1, 500));
  // Scales.
  Trial& tank = add("tank_10mm_cells", {256, 256, 128}, 120, cone(5, 0.5, 5));
  tank.cell_mm = 10;
  Trial& abyss = add("kilometre_cells", {64, 64, 16}, 6, cone(2, 0.5, 20000));
  abyss.cell_mm = 1'000'000;
  add("half_a_cell_of_range", {64, 64, 32}, 0.5, cone(3, 1, 100));
  return list;
}

/// One ping and the map under it. Lengths in cells, angles in degrees.
enum Coordinate : std::size_t {
  kOriginN,
  kOriginE,
  kOriginD,  // transducer from the grid's corner
  kHeading,
  kPitch,
  kRoll,  // attitude; pitch as base::Attitude
  kAzimuth,
  kElevation,
  kRotation,
  kRange,
  kSigmaN,
  kSigmaE,
  kSigmaD,  // stated position sigma
  kSlopeN,
  kSlopeE,      // of the prepared map, depth cells per cell
  kPlaneDepth,  // of the prepared map, under the beam's end
  kMapped,      // over 0: there is a prepared map
  kReturn,      // over 0: a return was heard
  kCoordinates
};
using Candidate = std::array<double, kCoordinates>;

base::Bam32 bam(double deg) {
  return static_cast<base::Bam32>(
      static_cast<std::int64_t>(std::llround(std::fmod(deg, 360.0) / 360.0 * 4294967296.0)));
}

std::array<double, 3> beam_end(const Candidate& c) {
  const double rad = kPi / 180;
  const double az = c[kAzimuth] * rad;
  const double el = c[kElevation] * rad;
  const double v[3] = {std::cos(el) * std::cos(az), std::cos(el) * std::sin(az), std::sin(el)};
  const double r = c[kRoll] * rad;
  const double p = c[kPitch] * rad;
  const double h = c[kHeading] * rad;
  const double y = std::cos(r) * v[1] - std::sin(r) * v[2];
  const double z1 = std::sin(r) * v[1] + std::cos(r) * v[2];
  const double x = std::cos(p) * v[0] + std::sin(p) * z1;
  const double z = std::cos(p) * z1 - std::sin(p) * v[0];
  return {c[kOriginN] + c[kRange] * (std::cos(h) * x - std::sin(h) * y),
          c[kOriginE] + c[kRange] * (std::sin(h) * x + std::cos(h) * y),
          c[kOriginD] + c[kRange] * z};
}

/// What the last prepare_map() did, for the target to do the same.
std::vector<leadline::firmware::m7::PreparedColumn> prepared_columns;

/// Gives column (n, e) the voxels of a surface at `depth`, as thousands of pings would have left them.
void prepare_column(std::int32_t n, std::int32_t e, double depth) {
  model::Grid& grid = the_model.grid();
  if (n < 0 || e < 0 || n >= grid.north_cells() || e >= grid.east_cells()) {
    return;
  }
  const std::uint32_t index = grid.column_index(n, e);
  model::Voxel* const voxels = grid.column_voxels(index);
  std::memset(static_cast<void*>(voxels), 0,
              sizeof(model::Voxel) * static_cast<std::size_t>(grid.depth_cells()));
  model::ColumnRecord& record = grid.column(index);
  record.depth_q8 = model::kUnknownDepth;
  record.mass = 0;
  record.gain = 0;
  // Two voxels around the depth, in proportion: their mean is the depth.
  const double above = std::floor(depth - 0.5);
  const double share = depth - 0.5 - above;
  for (int i = 0; i < 2; ++i) {
    const double k = above + i;
    if (k < 0 || k >= grid.depth_cells()) {
      continue;
    }
    voxels[static_cast<std::int32_t>(k)].hit =
        static_cast<std::uint16_t>(std::lround(20000 * (i == 0 ? 1 - share : share)));
    record.gain = 20000;
  }
  prepared_columns.push_back({static_cast<std::uint16_t>(n),
                              static_cast<std::uint16_t>(e),
                              static_cast<std::int16_t>(std::clamp(above, -2.0, 2000.0)),
                              {static_cast<std::uint16_t>(std::lround(20000 * (1 - share))),
                               static_cast<std::uint16_t>(std::lround(20000 * share))},
                              static_cast<std::uint16_t>(record.gain)});
}

/// The columns that the slope feedback can ask: eight directions, any stride.
void prepare_map(const Candidate& c) {
  prepared_columns.clear();
  const std::array<double, 3> end = beam_end(c);
  const double north = std::floor(end[0]);
  const double east = std::floor(end[1]);
  const double far = 2.0 * model::kMaxFootprintCells + 2;
  const model::Grid& grid = the_model.grid();
  if (!(north > -far && east > -far && north < grid.north_cells() + far &&
        east < grid.east_cells() + far)) {
    return;
  }
  const auto n0 = static_cast<std::int32_t>(north);
  const auto e0 = static_cast<std::int32_t>(east);
  const bool mapped = c[kMapped] > 0;
  for (std::int32_t stride = 0; stride <= model::kMaxFootprintCells; ++stride) {
    for (std::int32_t i = -1; i <= 1; ++i) {
      for (std::int32_t j = -1; j <= 1; ++j) {
        if ((stride == 0) != (i == 0 && j == 0)) {
          continue;
        }
        const double depth =
            mapped ? c[kPlaneDepth] + stride * (i * c[kSlopeN] + j * c[kSlopeE]) : -10;
        prepare_column(n0 + i * stride, e0 + j * stride, depth);
      }
    }
  }
}

/// What later returns cost, of the configuration under way.
struct Behind {
  std::uint32_t tries;
  std::uint32_t worst;
};
Behind behind;

struct Records {
  base::Ping ping{};
  base::Pose pose{};
};

Records records_of(const Trial& trial, const Candidate& c) {
  const double cell_um = trial.cell_mm * 1000.0;
  Records records;
  base::Ping& ping = records.ping;
  ping.azimuth_bam32 = bam(c[kAzimuth]);
  ping.elevation_bam32 = bam(c[kElevation]);
  ping.rotation_bam32 = bam(c[kRotation]);
  ping.kind = c[kReturn] > 0 ? base::ReturnKind::kRange : base::ReturnKind::kNoReturn;
  ping.range_um = std::llround(c[kRange] * cell_um);
  ping.quality = 255;
  base::Pose& pose = records.pose;
  const double origin[3] = {c[kOriginN], c[kOriginE], c[kOriginD]};
  const double sigma[3] = {c[kSigmaN], c[kSigmaE], c[kSigmaD]};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    pose.position_um[axis] = std::llround(origin[axis] * cell_um);
    pose.covariance.sigma_position_mm[axis] =
        static_cast<std::uint32_t>(std::llround(sigma[axis] * trial.cell_mm));
  }
  pose.attitude = {bam(c[kRoll]), bam(c[kPitch]), bam(c[kHeading])};
  pose.validity = base::kPoseAll;
  return records;
}

/// Of the ping that voxel_cost() integrated last.
model::PingWork work_done;

/// Voxels that a ping writes; 0 when it is not used.
std::uint32_t voxel_cost(const Trial& trial, const Candidate& c) {
  prepare_map(c);
  const Records records = records_of(trial, c);
  const model::PingResult result = the_model.integrate(records.ping, records.pose);
  const bool used = result == model::PingResult::kFused ||
                    (result == model::PingResult::kNoReturn && trial.empty_without_return);
  const std::uint32_t voxels = used ? the_model.counters().last_voxels_per_ping : 0;
  work_done = the_model.last_work();
  // Some as a later return of the ping as well, over the same map.
  constexpr std::uint32_t kEvery = 4;
  ++behind.tries;
  if (result == model::PingResult::kFused && behind.tries % kEvery == 0) {
    prepare_map(c);
    static_cast<void>(the_model.integrate_behind(records.ping, records.pose));
    behind.worst = std::max(behind.worst, the_model.counters().last_voxels_per_ping);
  }
  return voxels;
}

constexpr leadline::host::m7::PingPrices kCosts = leadline::host::m7::kPingPrices;

std::uint32_t instruction_cost(const Trial& trial, const Candidate& c) {
  (void)voxel_cost(trial, c);
  return static_cast<std::uint32_t>(leadline::host::m7_ping_instructions(work_done, trial.size[2]));
}

/// A cone `range` cells long that widens by `growth` a cell, `elevation` below the level, seen from above: the places
/// of its columns by how many voxels they hold, and the columns that the integrator looks at.
struct Shadow {
  double candidates;
  double columns;
  double runs;
};

/// How long the vertical at (x, y) is inside the cone. x along the axis, from the transducer.
double chord(double range, double growth, double near, double c, double s, double x, double y) {
  const double p = c * x;
  const double a = c * c - growth * growth * s * s;
  const double b = s * (p + growth * growth * p + growth * near);
  const double r = near + growth * p;
  const double disc = b * b - a * (s * s * x * x + y * y - r * r);
  double low = -1e9;
  double high = 1e9;
  if (s > 1e-6) {
    low = -p / s;
    high = (range - p) / s;
  } else if (p < 0 || p > range) {
    return 0;
  }
  if (disc < 0 && a > 0) {
    return 0;
  }
  const double root = std::sqrt(std::max(0.0, disc));
  const double one = (b - root) / a;
  const double other = (b + root) / a;
  if (a > 0) {
    return std::min(high, other) - std::max(low, one);
  }
  // The vertical runs inside the opening: forward of the farther root.
  return high - std::max(low, std::max(one, other));
}

/// The most lattice points that a convex figure can hold: its area, half its outline, and one.
double most_points(double area, double width, double height) {
  return area > 0 ? area + width + height + 1 : 0;
}

Shadow shadow_of(const Trial& trial, double range, double growth, double elevation) {
  constexpr double kRunCells = 24;
  constexpr int kStepsX = 240;
  constexpr int kStepsY = 80;
  constexpr std::size_t kMostRuns = 43;  // 1,024 cells
  const double near = model::kTouch_q10 / 1024.0;
  const double far = near + growth * range;
  const double c = std::cos(elevation);
  const double s = std::sin(elevation);
  const double length = range * c;
  // The figures of the columns that hold a voxel at all, more than a run, more than two ...: convex, as the cone is.
  struct Figure {
    double area, first, last, half;
  };
  std::array<Figure, kMostRuns> figures{};
  figures.fill(Figure{0, 1e9, -1e9, 0});
  const double dx = (length + 2 * far) / kStepsX;
  const double dy = far / kStepsY;
  for (int i = 0; i < kStepsX; ++i) {
    const double x = -far + (i + 0.5) * dx;
    for (int j = 0; j < kStepsY; ++j) {
      const double y = (j + 0.5) * dy;
      // A chord of n cells holds n + 1 voxels at most.
      const double cells =
          std::min<double>(chord(range, growth, near, c, s, x, y), trial.size[2] - 1);
      for (std::size_t run = 0;
           run < kMostRuns && cells > 0 && cells >= kRunCells * static_cast<double>(run); ++run) {
        Figure& figure = figures[run];
        figure.area += 2 * dx * dy;
        figure.first = std::min(figure.first, x - dx / 2);
        figure.last = std::max(figure.last, x + dx / 2);
        figure.half = std::max(figure.half, y + dy / 2);
      }
    }
  }
  Shadow out{};
  for (std::size_t run = 0; run < kMostRuns; ++run) {
    const Figure& figure = figures[run];
    const double points = most_points(figure.area, figure.last - figure.first, 2 * figure.half);
    out.columns = run == 0 ? points : out.columns;
    out.runs += points;
  }
  // Looked at: a band of 2 r in the grid, and where the cone holds no vertical what of it lies between its outlines
  // with their margin, up to the box about its end; or the box of a heading too close to east to be cut by rows.
  const double north = trial.size[0];
  const double east = trial.size[1];
  const double rows = std::min(north, length + 2 * far + 1);
  const double diagonal = std::min(std::hypot(north, east), length + 2.83 * far);
  const double a = c * c - growth * growth * s * s;
  const double banded = 2 * far * diagonal - 2 * far * far + rows;
  const double boxed =
      std::min(north, 2 * far + 1 + length / 16) * std::min(east, length + 2 * far + 1);
  out.candidates = std::max(banded, boxed);
  // As model/frustum.cpp, with a little more margin and a little less than its least A.
  constexpr double kLeastA = 1.02 / 256;
  constexpr double kMargin = 0.16;
  constexpr double kWorthwhile = 41;
  // The last line: an outline almost along the rows only says which rows it leaves.
  const double end = far * far * (1 - s) > kWorthwhile
                         ? std::min(far, s * far + kMargin + 2 * (length + far) / 1024)
                         : far;
  if (a > kLeastA && far * (length + far) > kWorthwhile) {
    const double tangent = growth / std::sqrt(a);
    const double room = kMargin + near * c / std::sqrt(a) + 2 * s / tangent / 1024 +
                        2 * (length + far) * (1 + tangent) / 1024;
    double area = 2 * far * end;
    const double step = (length + far) / kStepsX;
    for (int i = 0; i < kStepsX; ++i) {
      const double x = -far + (i + 0.5) * step;
      area += step * 2 * std::clamp(tangent * x + room, 0.0, far);
    }
    out.candidates = std::min(out.candidates, most_points(area, length + far + end, 2 * far));
  }
  if (length < 0.99 * far && far * far > kWorthwhile) {
    const double radius = std::max(far, length + near) * (1 + 1.0 / 2048) + kMargin;
    out.candidates =
        std::min(out.candidates, most_points(kPi * radius * radius, 2 * radius, 2 * radius));
  }
  out.candidates = std::min(north * east, out.candidates);
  out.columns = std::min(out.columns, out.candidates);
  return out;
}

/// Of a return, before its shell and cone.
double return_bound(const Trial& trial) {
  return kCosts.fixed +
         model::Model::kSlopeColumns * (kCosts.column_read + kCosts.cell_read * trial.size[2]);
}

/// The most that a shell costs at these prices, with what goes before it: all taps over its whole box. What each later
/// return of a ping comes to (Model::integrate_behind), which carves no cone.
double shell_bound(const Trial& trial) {
  const double side = 2.0 * the_model.scale().footprint_cells;
  const double rows = std::min<double>(side, trial.size[0]);
  const double box = rows * std::min<double>(side, trial.size[1]);
  const double taps = std::min(14, trial.size[2]);
  return return_bound(trial) + kCosts.shell_row * rows +
         box * (kCosts.shell_candidate + kCosts.shell_column + taps * kCosts.shell_voxel);
}

/// The most that any ping of the configuration costs at these prices: a shell of its whole box with all taps and the
/// cone up to the steepest plane's kernel (or the whole cone, and none), the cone at the elevation where the sum is
/// largest, none of it cut off by the grid but its voxels.
std::uint32_t instruction_bound(const Trial& trial) {
  const model::Scale& scale = the_model.scale();
  const double north = trial.size[0];
  // 7 cells over the secant of 2.5 (work_bound.cpp).
  constexpr std::int32_t kPlaneLoss_q10 = 2662;
  double most = 0;
  for (const bool with_shell : {false, true}) {
    const std::int32_t range_q10 = (scale.max_range_q16 >> 6) - (with_shell ? kPlaneLoss_q10 : 0);
    const double range = range_q10 / 1024.0;
    const double growth = model::cone_growth_q20(scale.cone_tan_q20, range_q10) / 1048576.0;
    const double far = model::kTouch_q10 / 1024.0 + range * growth;
    const double voxels = model::cone_volume(scale, range_q10);
    double cone = 0;
    for (int elevation_deg = 0; elevation_deg <= 90; ++elevation_deg) {
      const double elevation = elevation_deg * kPi / 180;
      const Shadow shadow = shadow_of(trial, range, growth, elevation);
      const double rows = std::min(north, range * std::cos(elevation) + 2 * far + 1);
      cone =
          std::max(cone, kCosts.cone_row * rows + kCosts.cone_candidate * shadow.candidates +
                             kCosts.cone_column * shadow.columns + kCosts.cone_run * shadow.runs);
    }
    most = std::max(most, cone + kCosts.cone_voxel * voxels +
                              (with_shell ? shell_bound(trial) : return_bound(trial)));
  }
  return static_cast<std::uint32_t>(most);
}

double log_uniform(Random& random, double low, double high) {
  return low * std::pow(high / low, random.uniform());
}

/// Brings a candidate back to what a record can state.
void legalize(const Trial& trial, Candidate& c) {
  c[kRange] = std::clamp(c[kRange], 1e-3, trial.max_range_cells);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double reach = trial.max_range_cells + 20;
    c[kOriginN + axis] = std::clamp(c[kOriginN + axis], -reach, trial.size[axis] + reach);
    c[kSigmaN + axis] = std::clamp(c[kSigmaN + axis], 0.0, 60.0);
  }
  c[kSlopeN] = std::clamp(c[kSlopeN], -4.0, 4.0);
  c[kSlopeE] = std::clamp(c[kSlopeE], -4.0, 4.0);
}

/// A ping whose beam ends at a place in or near the grid: the corners of the search, then anything.
Candidate start(const Trial& trial, Random& random, int number) {
  Candidate c{};
  const double range = trial.max_range_cells * (number % 3 == 2 ? random.uniform() : 1.0);
  double end[3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Whole and half cells first: lattice effects are strongest there.
    end[axis] = trial.size[axis] * random.uniform();
    if (number % 2 == 0) {
      end[axis] = std::floor(2 * end[axis]) / 2 + 1e-3 * random.normal();
    }
  }
  const int look = number % 8;
  double elevation = 0;
  double heading = 360 * random.uniform();
  if (look == 0) {  // level, along an axis of the grid
    heading = 90.0 * static_cast<double>(random.between(0, 3)) + random.normal();
    elevation = random.normal();
  } else if (look == 1) {  // level, along a diagonal
    heading = 45.0 + 90.0 * static_cast<double>(random.between(0, 3)) + random.normal();
    elevation = 2 * random.normal();
  } else if (look == 2) {  // just above grazing
    elevation = 11 + 3 * random.uniform();
  } else if (look == 3) {  // straight down
    elevation = 90 - std::fabs(random.normal());
  } else if (look == 4) {  // space diagonal
    elevation = 35 + 5 * random.normal();
  } else if (look == 5) {  // straight up
    elevation = -90 + std::fabs(random.normal());
  } else {
    elevation = -90 + 180 * random.uniform();
  }
  c[kHeading] = heading;
  c[kElevation] = elevation;
  c[kRotation] = number % 4 == 0 ? 0 : 360 * random.uniform();
  if (number % 16 == 15) {  // the same direction through the attitude
    c[kPitch] = -elevation;
    c[kElevation] = 0;
    c[kRoll] = 360 * random.uniform();
  }
  c[kRange] = range;
  const std::array<double, 3> tip = beam_end(c);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    c[kOriginN + axis] = end[axis] - tip[axis];
    c[kSigmaN + axis] = random.between(0, 3) == 0 ? 0 : log_uniform(random, 0.05, 30);
  }
  if (trial.empty_without_return && random.between(0, 1) == 0) {
    c[kReturn] = -1;
  } else {
    c[kReturn] = 1;
  }
  c[kMapped] = random.between(0, 1) == 0 ? -1 : 1;
  c[kPlaneDepth] = end[2];
  c[kSlopeN] = number % 5 == 0 ? 0 : 2 * random.normal();
  c[kSlopeE] = number % 5 == 0 ? 0 : 2 * random.normal();
  legalize(trial, c);
  return c;
}

Candidate neighbour(const Trial& trial, Random& random, const Candidate& from) {
  Candidate c = from;
  // From a thousandth of a cell (one lattice plane more or less) to a tenth of the grid.
  const double scale = log_uniform(random, 1e-3, 10);
  const std::int64_t changes = random.between(1, 4);
  for (std::int64_t i = 0; i < changes; ++i) {
    const auto which = static_cast<std::size_t>(random.between(0, kCoordinates + 1));
    const double step = scale * random.normal();
    if (which == kMapped || which == kReturn) {
      if (random.between(0, 9) == 0 && (which == kMapped || trial.empty_without_return)) {
        c[which] = -c[which];
      }
    } else if (which >= kSigmaN && which <= kSigmaD) {
      c[which] = c[which] <= 0 ? std::fabs(step) : c[which] * std::exp(0.2 * step);
    } else if (which >= kHeading && which <= kRotation) {
      // Keep the beam's end where it is: turning alone would swing it out of the grid.
      const std::array<double, 3> before = beam_end(c);
      c[which] += step;
      const std::array<double, 3> after = beam_end(c);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        c[kOriginN + axis] += before[axis] - after[axis];
      }
    } else if (which == kSlopeN || which == kSlopeE) {
      c[which] += 0.3 * step;
    } else if (which == kCoordinates) {  // slide along the beam
      const std::array<double, 3> end = beam_end(c);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        c[kOriginN + axis] += step * (end[axis] - c[kOriginN + axis]) / c[kRange];
      }
    } else if (which == kCoordinates + 1) {  // all three sigmas
      for (std::size_t axis = 0; axis < 3; ++axis) {
        c[kSigmaN + axis] = std::max(0.01, c[kSigmaN + axis]) * std::exp(0.2 * step);
      }
    } else {
      c[which] += step;
    }
  }
  legalize(trial, c);
  return c;
}

struct Scored {
  Candidate ping;
  std::uint32_t cost;
};

struct Outcome {
  std::uint32_t worst = 0;
  Candidate ping{};
  std::int64_t above = 0;
  std::vector<Scored> records;  ///< each worse than all before it
};

using Cost = std::uint32_t (*)(const Trial&, const Candidate&);

Outcome search(const Trial& trial, std::uint64_t stream, std::int64_t pings, std::uint32_t bound,
               Cost cost = voxel_cost) {
  Random random(stream);
  Outcome outcome;
  const auto evaluate = [&](const Candidate& c) {
    const std::uint32_t voxels = cost(trial, c);
    outcome.above += voxels > bound ? 1 : 0;
    if (voxels > outcome.worst) {
      outcome.worst = voxels;
      outcome.ping = c;
      outcome.records.push_back({c, voxels});
    }
    return voxels;
  };
  struct Island {
    Candidate place;
    std::uint32_t voxels;
  };
  constexpr std::size_t kIslands = 6;
  std::vector<Island> islands;
  const std::int64_t sowing = pings / 4;
  for (std::int64_t i = 0; i < sowing; ++i) {
    const Candidate c = start(trial, random, static_cast<int>(i));
    islands.push_back({c, evaluate(c)});
    if (islands.size() >= 4 * kIslands) {
      std::sort(islands.begin(), islands.end(),
                [](const Island& a, const Island& b) { return a.voxels > b.voxels; });
      islands.resize(kIslands);
    }
  }
  for (std::int64_t i = sowing; i < pings; ++i) {
    // All islands at first; the better half, then the best one, when time runs out.
    const std::int64_t left = pings - i;
    const std::size_t alive = left > pings / 2   ? islands.size()
                              : left > pings / 4 ? islands.size() / 2
                                                 : 1;
    if (i == pings / 2 || i == pings - pings / 4) {
      std::sort(islands.begin(), islands.end(),
                [](const Island& a, const Island& b) { return a.voxels > b.voxels; });
    }
    Island& island = islands[static_cast<std::size_t>(i) % std::max<std::size_t>(1, alive)];
    const Candidate c = neighbour(trial, random, island.place);
    const std::uint32_t voxels = evaluate(c);
    if (voxels >= island.voxels) {
      island = {c, voxels};
    }
  }
  return outcome;
}

base::Status configure(const Trial& trial) {
  model::ModelConfig config{};
  config.schema_version = model::kConfigSchemaVersion;
  config.rule = trial.rule;
  config.no_return =
      trial.empty_without_return ? model::NoReturnPolicy::kEmpty : model::NoReturnPolicy::kIgnore;
  config.cell_mm = trial.cell_mm;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    config.size[axis] = trial.size[axis];
    config.sigma_position_mm[axis] = std::llround(trial.sigma_position_cells[axis] * trial.cell_mm);
  }
  config.max_range_um = std::llround(trial.max_range_cells * trial.cell_mm * 1000);
  config.detect_range_um = config.max_range_um;
  const leadline::host::GeneratedTable generated = leadline::host::generate_table(trial.beam);
  return the_model.configure(config, &generated.table, sizeof generated.table);
}

std::int64_t environment_number(const char* name, std::int64_t otherwise) {
  const char* const text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoll(text, nullptr, 10);
}

TEST(no_ping_exceeds_the_bound_and_the_bound_is_near) {
  const std::int64_t pings =
      std::max<std::int64_t>(100, environment_number("LEADLINE_WORK_BOUND_PINGS", 12'000));
  const char* const only = std::getenv("LEADLINE_WORK_BOUND_ONLY");
  std::printf(
      "| configuration | grid | range | F | W | shell | cone | worst | worst / W | cones cut | "
      "later "
      "return, worst | bound |\n");
  std::printf("|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  int failures = 0;
  std::int64_t total = 0;
  std::uint64_t voxels = 0;
  int count = 0;
  double least = 1;
  int number = 0;
  for (const Trial& trial : trials()) {
    ++number;
    if (only != nullptr && trial.name.find(only) == std::string::npos) {
      continue;
    }
    const base::Status status = configure(trial);
    assert_int_equal(static_cast<int>(status), static_cast<int>(base::Status::kOk));
    const model::WorkBound bound = the_model.bound();
    // Pings of hundreds of thousands of voxels take long and are easily found: a quarter of them will do.
    constexpr std::uint32_t kLarge = 100'000;
    const std::int64_t tries = bound.total_voxels > kLarge ? pings / 4 : pings;
    behind = Behind{};
    const Outcome outcome =
        search(trial, static_cast<std::uint64_t>(number), tries, bound.total_voxels);
    const double ratio = static_cast<double>(outcome.worst) / bound.total_voxels;
    const bool ok = outcome.above == 0 && outcome.worst <= bound.total_voxels &&
                    ratio >= kReachedShare && behind.worst <= bound.behind_voxels;
    total += tries;
    voxels += the_model.counters().voxel_updates;
    ++count;
    least = std::min(least, ratio);
    std::printf(
        "| %s | %d x %d x %d | %g | %d | %u | %u | %u | %u | %.3f%s | %.1f %% | %u | %u |\n",
        trial.name.c_str(), trial.size[0], trial.size[1], trial.size[2], trial.max_range_cells,
        the_model.scale().footprint_cells, bound.total_voxels, bound.shell_voxels,
        bound.cone_voxels, outcome.worst, ratio, ok ? "" : " **FAILED**",
        100.0 * static_cast<double>(the_model.counters().cones_cut) / static_cast<double>(tries),
        behind.worst, bound.behind_voxels);
    if (!ok) {
      ++failures;
      const Candidate& c = outcome.ping;
      std::printf(
          "    %lld pings above W; worst: origin %.4f %.4f %.4f  heading %.4f pitch %.4f roll %.4f "
          " az %.4f "
          "el %.4f rot %.4f  range %.4f  sigma %.3f %.3f %.3f  map %g: depth %.3f slope %.3f %.3f  "
          "return %g\n",
          static_cast<long long>(outcome.above), c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7],
          c[8], c[9], c[10], c[11], c[12], c[kMapped], c[kPlaneDepth], c[kSlopeN], c[kSlopeE],
          c[kReturn]);
    }
    std::fflush(stdout);
    // The counter in the shipped code saw what the search saw.
    assert_true(the_model.counters().max_voxels_per_ping == outcome.worst);
  }
  std::printf(
      "\n%d configurations, %lld pings, %llu voxel updates: %d outside [0.9 W, W], least worst / W "
      "%.3f\n",
      count, static_cast<long long>(total), static_cast<unsigned long long>(voxels), failures,
      least);
  assert_int_equal(failures, 0);
}

/// The heads of the load that a Cortex-M7 has to carry: 30 m of range, cells of 0.25 m.
std::vector<Trial> load_trials() {
  Trial wide{};
  wide.name = "ping1d";
  wide.size = {128, 128, 128};
  wide.max_range_cells = 120;
  wide.beam = cone(12.5, 1, 50);
  wide.cell_mm = 250;
  Trial fan = wide;
  fan.name = "fan16";
  fan.beam = cone(1.5, 0.5, 50);
  return {wide, fan};
}

std::vector<Scored> kept_pings(const char* path) {
  std::ifstream in(path);
  std::vector<Scored> list;
  Scored scored{};
  while (in >> scored.cost) {
    for (double& value : scored.ping) {
      in >> value;
    }
    assert_false(in.fail());
    list.push_back(scored);
  }
  return list;
}

void leave(const Trial& trial, const std::vector<Scored>& pings, const std::string& folder) {
  namespace m7 = leadline::firmware::m7;
  std::ofstream text(folder + "/" + trial.name + ".txt");
  text.precision(17);
  std::ofstream out(folder + "/" + trial.name + ".cost", std::ios::binary);
  const auto put = [&out](const auto& record) {
    out.write(reinterpret_cast<const char*>(&record), sizeof record);
  };
  m7::CostHeader header{};
  header.magic = m7::kCostMagic;
  std::copy(std::begin(m7::kCostSizes), std::end(m7::kCostSizes), header.sizes);
  header.pings = static_cast<std::uint32_t>(pings.size());
  put(header);
  put(the_model.config());
  put(the_model.table());
  for (const Scored& scored : pings) {
    text << scored.cost;
    for (const double value : scored.ping) {
      text << ' ' << value;
    }
    text << '\n';
    const Records records = records_of(trial, scored.ping);
    prepare_map(scored.ping);
    m7::CostPing ping{};
    ping.range_um = records.ping.range_um;
    ping.pose = records.pose;
    ping.azimuth_bam32 = records.ping.azimuth_bam32;
    ping.elevation_bam32 = records.ping.elevation_bam32;
    ping.rotation_bam32 = records.ping.rotation_bam32;
    ping.kind = static_cast<std::uint32_t>(records.ping.kind);
    ping.prepared_columns = static_cast<std::uint32_t>(prepared_columns.size());
    assert_true(prepared_columns.size() <= m7::kMostPreparedColumns);
    put(ping);
    for (const m7::PreparedColumn& column : prepared_columns) {
      put(column);
    }
  }
  assert_true(text.flush().good() && out.flush().good());
}

TEST(the_worst_pings_of_the_load_in_instructions) {
  constexpr std::size_t kKept = 100;
  const std::int64_t tries =
      std::max<std::int64_t>(100, environment_number("LEADLINE_WORK_BOUND_PINGS", 12'000)) / 4;
  const char* const only = std::getenv("LEADLINE_WORK_BOUND_ONLY");
  const char* const folder = std::getenv("LEADLINE_COST_FOLDER");
  const char* const from = std::getenv("LEADLINE_COST_FROM");
  for (const Trial& trial : load_trials()) {
    if (only != nullptr && trial.name.find(only) == std::string::npos) {
      continue;
    }
    assert_int_equal(static_cast<int>(configure(trial)), static_cast<int>(base::Status::kOk));
    std::vector<Scored> worst;
    if (from != nullptr) {
      worst = kept_pings(from);
    } else {
      const std::uint32_t bound = instruction_bound(trial);
      const Outcome outcome = search(trial, 77, tries, bound, instruction_cost);
      worst.assign(outcome.records.rbegin(), outcome.records.rend());
      worst.resize(std::min(worst.size(), kKept));
      std::printf(
          "%s: %lld pings, %llu voxel updates, bound %u instructions, worst %u = %.3f, %lld "
          "above; a later return at most %.0f\n",
          trial.name.c_str(), static_cast<long long>(tries),
          static_cast<unsigned long long>(the_model.counters().voxel_updates), bound, outcome.worst,
          static_cast<double>(outcome.worst) / bound, static_cast<long long>(outcome.above),
          shell_bound(trial));
      assert_true(outcome.above == 0);
      constexpr std::uint32_t kTileBudget = 1;
      std::printf("%s: a pass takes at most %llu instructions of a cycle\n", trial.name.c_str(),
                  static_cast<unsigned long long>(leadline::host::m7::pass_cycle_bound(
                      kTileBudget, static_cast<std::uint32_t>(trial.size[2]),
                      the_model.grid().tile_count())));
    }
    assert_false(worst.empty());
    // No ping of the search wrote more than the bound allows, whatever it was looking for.
    assert_true(the_model.counters().max_voxels_per_ping <= the_model.bound().total_voxels);
    if (folder != nullptr) {
      leave(trial, worst, folder);
    }
  }
}

}  // namespace
