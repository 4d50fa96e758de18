// The whole job, in one run: 32,000 near-nadir pings of a 3 degree cone over 128 x 128 x 32 cells of 1 m
// from about 20 cells above an invented seafloor. Prints as Markdown
//   ours, per rule, against the same job without arithmetic (a load and a store per voxel);
//   OctoMap given the same pings as bundles of 37 rays and as single rays, each of its insert functions;
//   what a ping costs by map size and by the voxels that it touches.
//
// Records are made before any clock starts. Runs are timed in blocks of 1,000 pings by the processor time
// of the thread, and the least time of each block over all runs is summed: every run does the same work, so
// what differs is what else the machine does. The same for us, for OctoMap and for the loop without
// arithmetic.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include <octomap/octomap.h>

#include "host_tools/sim/random.hpp"
#include "host_tools/sim/simulator.hpp"
#include "host_tools/sim/terrain_sources.hpp"
#include "host_tools/table/generator.hpp"
#include "model/model.hpp"
#include "tests/tools/octomap_survey.hpp"

namespace {

namespace base = leadline::base;
namespace host = leadline::host;
namespace model = leadline::model;
using host::Vec3;
using Clock = std::chrono::steady_clock;

constexpr double kPi = 3.141592653589793;
constexpr double kHalfAngle_deg = 3;
constexpr std::size_t kPings = 32'000;
constexpr int kRuns = 9;

// As on a vehicle: one static object.
model::Model the_model;

/// Processor time of this thread.
double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

/// Times the same work again and again, block by block.
class LeastTime {
 public:
  explicit LeastTime(std::size_t count) : count_(count) {}

  /// One more run: `work(begin, end)` for each block of [0, count), `finish` after the last.
  void run(
      const std::function<void(std::size_t, std::size_t)>& work,
      const std::function<void()>& finish = [] {}) {
    constexpr std::size_t kBlock = 1000;
    const std::size_t blocks = (count_ + kBlock - 1) / kBlock;
    least_.resize(blocks + 1, std::numeric_limits<double>::infinity());
    double before = cpu_seconds();
    for (std::size_t block = 0; block <= blocks; ++block) {
      if (block < blocks) {
        work(block * kBlock, std::min(count_, (block + 1) * kBlock));
      } else {
        finish();
      }
      const double after = cpu_seconds();
      least_[block] = std::min(least_[block], after - before);
      before = after;
    }
  }
  [[nodiscard]] double seconds() const {
    return std::accumulate(least_.begin(), least_.end(), 0.0);
  }

 private:
  std::size_t count_;
  std::vector<double> least_;
};

[[noreturn]] void give_up(const std::string& what) {
  std::fprintf(stderr, "bench.job: %s\n", what.c_str());
  std::exit(1);
}

struct Job {
  model::ModelConfig config{};
  host::GeneratedTable table;
  std::vector<base::Ping> pings;
  std::vector<base::Pose> poses;
};

model::ModelConfig job_config(std::array<std::int32_t, 3> size, std::int64_t max_range_m) {
  model::ModelConfig config{};
  config.schema_version = model::kConfigSchemaVersion;
  config.rule = model::Rule::kLogOdds;
  config.cell_mm = 1000;
  std::copy(size.begin(), size.end(), config.size);
  config.min_range_um = 500'000;
  config.max_range_um = max_range_m * 1'000'000;
  return config;
}

host::GeneratedTable cone_table(double half_angle_deg) {
  host::BeamDescription beam;
  beam.half_angle_deg = half_angle_deg;
  beam.sigma_pointing_deg = 1;
  beam.sigma_range_mm = 1000;
  return host::generate_table(beam);
}

base::Bam32 bam(double deg) {
  return static_cast<base::Bam32>(std::llround(std::fmod(deg, 360.0) / 360.0 * 4294967296.0));
}

void add_ping(Job& job, std::int64_t time_us, Vec3 position_m, const host::Attitude& attitude,
              const host::BeamAngles& beam, double range_m) {
  base::Ping ping{};
  ping.t_transmit_us = time_us;
  ping.azimuth_bam32 = bam(beam.azimuth_deg);
  ping.elevation_bam32 = bam(beam.elevation_deg);
  ping.kind = base::ReturnKind::kRange;
  ping.quality = 255;
  ping.range_um = std::llround(range_m * 1e6);
  base::Pose pose{};
  pose.t_us = time_us;
  pose.position_um[0] = std::llround(position_m.x * 1e6);
  pose.position_um[1] = std::llround(position_m.y * 1e6);
  pose.position_um[2] = std::llround(position_m.z * 1e6);
  pose.attitude = {bam(attitude.roll_deg), bam(attitude.pitch_deg), bam(attitude.heading_deg)};
  pose.validity = base::kPoseAll;
  job.pings.push_back(ping);
  job.poses.push_back(pose);
}

void configure(const Job& job, model::Rule rule) {
  model::ModelConfig config = job.config;
  config.rule = rule;
  if (the_model.configure(config, &job.table.table, sizeof job.table.table) != base::Status::kOk) {
    give_up("the model refuses the configuration");
  }
}

/// `runs` more runs of the whole job from an empty map.
void time_job(const Job& job, model::Rule rule, int runs, LeastTime& least) {
  for (int i = 0; i < runs; ++i) {
    configure(job, rule);
    least.run([&job](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        the_model.integrate(job.pings[k], job.poses[k]);
      }
    });
  }
}

// ---------------------------------------------------------------------------------------------------
// The job

constexpr int kSide = 128;
constexpr int kDepth = 32;
constexpr std::int64_t kOriginDown_m = 36;

struct Survey {
  host::Terrain terrain;
  host::Survey flown;
  Job job;
};

Survey make_survey() {
  host::ProceduralOptions ground;
  ground.north_count = kSide;
  ground.east_count = kSide;
  ground.cell_m = 1.0;
  ground.shallowest_depth_m = 40.0;
  ground.relief_cells = 22.0;
  host::Terrain terrain = host::make_procedural_terrain(ground);
  host::Scene scene;
  scene.echo.beam_half_angle_deg = kHalfAngle_deg;
  scene.survey.kind = host::SurveyKind::kRandom;
  scene.survey.interval_s = 0.02;
  scene.survey.ping_count = kPings + kPings / 16;  // those over the outer half cell are dropped
  scene.survey.altitude_min_m = 18.0;
  scene.survey.altitude_max_m = 22.0;
  scene.survey.max_tilt_deg = 4.0;
  scene.errors.sigma_pointing_deg = 1.0;
  scene.errors.sigma_range_m = 1.0;
  host::Survey flown = host::simulate(terrain, scene);
  Job job;
  job.config = job_config({kSide, kSide, kDepth}, 40);
  job.config.origin_mm[2] = kOriginDown_m * 1000;
  job.table = cone_table(kHalfAngle_deg);
  if (flown.pings.size() < kPings) {
    give_up("the survey is short of pings");
  }
  flown.pings.resize(kPings);
  for (const host::SimulatedPing& ping : flown.pings) {
    // No dropouts were asked for: every ping has its range.
    add_ping(job, ping.time_us, ping.position_m, ping.attitude, ping.beam, ping.range_m.value());
  }
  return {std::move(terrain), std::move(flown), std::move(job)};
}

struct Accuracy {
  double rmse_cells = 0;
  double bias_cells = 0;
  double coverage = 0;
};

/// `depth(n, e)` in metres, NaN where unknown, against the terrain over the cells that rays touched.
Accuracy accuracy(const Survey& survey, const std::function<double(int, int)>& depth) {
  double squares = 0;
  double sum = 0;
  std::size_t known = 0;
  std::size_t touched = 0;
  for (int n = 0; n < kSide; ++n) {
    for (int e = 0; e < kSide; ++e) {
      const auto index = static_cast<std::size_t>(n) * kSide + static_cast<std::size_t>(e);
      if (survey.flown.touched[index] == 0) {
        continue;
      }
      ++touched;
      const double error = depth(n, e) - survey.terrain.depths_m()[index];
      if (!std::isnan(error)) {
        ++known;
        squares += error * error;
        sum += error;
      }
    }
  }
  const auto count = static_cast<double>(known);
  return {std::sqrt(squares / count), -sum / count, count / static_cast<double>(touched)};
}

/// p of the values, 0 .. 1, nearest rank.
double percentile(std::vector<double> values, double p) {
  const auto rank = static_cast<std::size_t>(std::ceil(p * static_cast<double>(values.size())));
  const std::size_t index = rank == 0 ? 0 : rank - 1;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(index),
                   values.end());
  return values[index];
}

/// What two calls of the clock cost, in nanoseconds: subtracted from every interval.
double clock_overhead_ns() {
  std::vector<double> intervals(100'001);
  for (double& interval : intervals) {
    const auto start = Clock::now();
    interval = std::chrono::duration<double, std::nano>(Clock::now() - start).count();
  }
  return percentile(intervals, 0.5);
}

struct Ours {
  LeastTime time{kPings};
  double seconds = 0;
  double voxels_per_ping = 0;
  std::uint32_t max_voxels = 0;
  std::vector<double> least_ns;  ///< per ping, the least of all runs
  std::vector<double> raw_ns;    ///< per ping, of the run with the median total
  double extract_seconds = 0;
  Accuracy accuracy;
};

Ours measure_ours(const Survey& survey, model::Rule rule) {
  const Job& job = survey.job;
  Ours ours;
  time_job(job, rule, kRuns, ours.time);
  const model::ModelCounters& counters = the_model.counters();
  ours.voxels_per_ping = static_cast<double>(counters.voxel_updates) / kPings;
  ours.max_voxels = counters.max_voxels_per_ping;

  const double overhead_ns = clock_overhead_ns();
  std::vector<std::pair<double, std::vector<double>>> runs;
  ours.least_ns.assign(kPings, std::numeric_limits<double>::infinity());
  for (int run = 0; run < kRuns; ++run) {
    configure(job, rule);
    std::vector<double> interval_ns(kPings);
    double total = 0;
    for (std::size_t i = 0; i < kPings; ++i) {
      const auto start = Clock::now();
      the_model.integrate(job.pings[i], job.poses[i]);
      const auto end = Clock::now();
      interval_ns[i] = std::max(
          0.0, std::chrono::duration<double, std::nano>(end - start).count() - overhead_ns);
      total += interval_ns[i];
      ours.least_ns[i] = std::min(ours.least_ns[i], interval_ns[i]);
    }
    runs.emplace_back(total, std::move(interval_ns));
  }
  std::sort(runs.begin(), runs.end());
  ours.raw_ns = runs[kRuns / 2].second;

  LeastTime extraction(1);
  for (int i = 0; i < 5; ++i) {
    extraction.run([](std::size_t, std::size_t) { the_model.extract(); });
  }
  ours.extract_seconds = extraction.seconds();
  ours.accuracy = accuracy(survey, [](int n, int e) {
    const std::int32_t depth_q8 = the_model.result(n, e).depth_q8;
    return depth_q8 == model::kUnknownDepth ? std::nan("")
                                            : static_cast<double>(kOriginDown_m) + depth_q8 / 256.0;
  });
  return ours;
}

// ---------------------------------------------------------------------------------------------------
// The same addresses without arithmetic

/// What integrate() writes, ping after ping: voxel numbers in storage order, ascending within a ping.
struct Addresses {
  std::vector<std::uint32_t> voxel;
  std::vector<std::size_t> end;  ///< of each ping, in `voxel`
  double seen = 0;               ///< share found by comparing; the rest are their neighbours
};

/// Finds the addresses from outside: each ping is integrated several times from the same state, and every
/// voxel around it compared. The dither differs each time, so that increments below one unit show up in
/// some of them. A voxel that only ever got zeros is stood in for by the next one of the same column.
Addresses find_addresses(const Job& job, model::Rule rule) {
  configure(job, rule);
  model::Grid& grid = the_model.grid();
  const auto depth = static_cast<std::size_t>(grid.depth_cells());
  constexpr int kRepeats = 12;
  Addresses found;
  std::size_t seen = 0;
  std::vector<std::uint32_t> columns;
  std::vector<model::Voxel> before;
  std::vector<model::ColumnRecord> records;
  std::vector<std::uint8_t> written(static_cast<std::size_t>(grid.column_count()) * depth, 0);
  for (std::size_t i = 0; i < job.pings.size(); ++i) {
    // Near nadir: everything lies within a footprint and a lean of the transducer's column.
    const std::int32_t reach = the_model.scale().footprint_cells + 4;
    const auto n0 = static_cast<std::int32_t>(job.poses[i].position_um[0] / 1'000'000);
    const auto e0 = static_cast<std::int32_t>(job.poses[i].position_um[1] / 1'000'000);
    columns.clear();
    before.clear();
    records.clear();
    for (std::int32_t n = std::max(0, n0 - reach); n <= std::min(kSide - 1, n0 + reach); ++n) {
      for (std::int32_t e = std::max(0, e0 - reach); e <= std::min(kSide - 1, e0 + reach); ++e) {
        const std::uint32_t column = grid.column_index(n, e);
        columns.push_back(column);
        const model::Voxel* const voxels = grid.column_voxels(column);
        before.insert(before.end(), voxels, voxels + depth);
        records.push_back(grid.column(column));
      }
    }
    std::sort(columns.begin(), columns.end());
    std::uint32_t count = 0;
    std::vector<std::uint32_t> own;
    for (int repeat = 0; repeat < kRepeats; ++repeat) {
      the_model.integrate(job.pings[i], job.poses[i]);
      count = std::max(count, the_model.counters().last_voxels_per_ping);
      std::size_t c = 0;
      for (std::int32_t n = std::max(0, n0 - reach); n <= std::min(kSide - 1, n0 + reach); ++n) {
        for (std::int32_t e = std::max(0, e0 - reach); e <= std::min(kSide - 1, e0 + reach);
             ++e, ++c) {
          const std::uint32_t column = grid.column_index(n, e);
          model::Voxel* const voxels = grid.column_voxels(column);
          for (std::size_t k = 0; k < depth; ++k) {
            const model::Voxel& old = before[c * depth + k];
            const std::size_t address = static_cast<std::size_t>(column) * depth + k;
            if ((voxels[k].hit != old.hit || voxels[k].miss != old.miss) && written[address] == 0) {
              written[address] = 1;
              own.push_back(static_cast<std::uint32_t>(address));
            }
          }
          if (repeat + 1 < kRepeats) {
            std::memcpy(static_cast<void*>(voxels), &before[c * depth],
                        depth * sizeof(model::Voxel));
            grid.column(column) = records[c];
          }
        }
      }
    }
    seen += std::min<std::size_t>(own.size(), count);
    for (std::size_t from = 0; own.size() < count && from < own.size(); ++from) {
      for (const std::uint32_t next : {own[from] + 1, own[from] - 1}) {
        if (own.size() < count && next / depth == own[from] / depth && written[next] == 0) {
          written[next] = 1;
          own.push_back(next);
        }
      }
    }
    std::sort(own.begin(), own.end());
    for (const std::uint32_t address : own) {
      written[address] = 0;
    }
    found.voxel.insert(found.voxel.end(), own.begin(), own.end());
    found.end.push_back(found.voxel.size());
  }
  found.seen = static_cast<double>(seen) / static_cast<double>(found.voxel.size());
  return found;
}

double load_store_seconds(const Addresses& addresses) {
  // The model's own storage: the same memory, the same pages.
  auto* const words = reinterpret_cast<volatile std::uint32_t*>(the_model.grid().column_voxels(0));
  LeastTime least(addresses.end.size());
  for (int i = 0; i < kRuns; ++i) {
    std::size_t at = 0;
    least.run([&](std::size_t begin, std::size_t end) {
      for (std::size_t ping = begin; ping < end; ++ping) {
        for (; at < addresses.end[ping]; ++at) {
          volatile std::uint32_t& word = words[addresses.voxel[at]];
          word = word;
        }
      }
    });
  }
  return least.seconds();
}

// ---------------------------------------------------------------------------------------------------
// OctoMap

struct Insert {
  const char* name;
  std::function<void(octomap::OcTree&, const octomap::Pointcloud&, const octomap::point3d&)> insert;
  bool lazy;
};

std::vector<Insert> inserts() {
  std::vector<Insert> list;
  for (const bool lazy : {false, true}) {
    for (const bool discretize : {false, true}) {
      list.push_back({discretize ? (lazy ? "insertPointCloud, lazy, discretize"
                                         : "insertPointCloud, discretize")
                                 : (lazy ? "insertPointCloud, lazy" : "insertPointCloud"),
                      [lazy, discretize](octomap::OcTree& tree, const octomap::Pointcloud& cloud,
                                         const octomap::point3d& origin) {
                        tree.insertPointCloud(cloud, origin, -1, lazy, discretize);
                      },
                      lazy});
    }
    list.push_back({lazy ? "insertPointCloudRays, lazy" : "insertPointCloudRays",
                    [lazy](octomap::OcTree& tree, const octomap::Pointcloud& cloud,
                           const octomap::point3d& origin) {
                      tree.insertPointCloudRays(cloud, origin, -1, lazy);
                    },
                    lazy});
    list.push_back({lazy ? "insertRay, lazy" : "insertRay",
                    [lazy](octomap::OcTree& tree, const octomap::Pointcloud& cloud,
                           const octomap::point3d& origin) {
                      for (const octomap::point3d& end : cloud) {
                        tree.insertRay(origin, end, -1, lazy);
                      }
                    },
                    lazy});
  }
  return list;
}

struct Octomap {
  std::string name;
  double seconds = std::numeric_limits<double>::infinity();
  std::size_t memory_bytes = 0;
  Accuracy accuracy;
  const char* way = "";
  std::string rows;  ///< of the table of all insert functions
};

/// Every insert function three times, and the fastest as often as ours; prints all, returns the fastest.
Octomap measure_octomap(const Survey& survey, int rays) {
  const Job& job = survey.job;
  std::vector<octomap::Pointcloud> clouds(kPings);
  std::vector<octomap::point3d> origins(kPings);
  for (std::size_t i = 0; i < kPings; ++i) {
    const host::SimulatedPing& ping = survey.flown.pings[i];
    const Vec3 origin = ping.position_m - Vec3{0, 0, static_cast<double>(kOriginDown_m)};
    const Vec3 axis = host::world_from_vehicle(ping.attitude, host::vehicle_direction(ping.beam));
    const double range_m = static_cast<double>(job.pings[i].range_um) * 1e-6;
    for (const Vec3& direction :
         leadline::test::ray_bundle(axis, rays, kHalfAngle_deg * kPi / 180)) {
      clouds[i].push_back(leadline::test::ray_end(origin, direction, range_m));
    }
    origins[i] = leadline::test::ray_end(origin, axis, 0);
  }
  const auto fly = [&](const Insert& insert, octomap::OcTree& tree, LeastTime& least) {
    least.run(
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t i = begin; i < end; ++i) {
            insert.insert(tree, clouds[i], origins[i]);
          }
        },
        [&] {
          if (insert.lazy) {
            tree.updateInnerOccupancy();
          }
        });
  };
  Octomap best;
  const std::vector<Insert> list = inserts();
  std::vector<LeastTime> times(list.size(), LeastTime(kPings));
  // All of them in turn, so that none has the machine's quiet moments to itself.
  for (int run = 0; run < 3; ++run) {
    for (std::size_t i = 0; i < list.size(); ++i) {
      octomap::OcTree tree(1.0);
      fly(list[i], tree, times[i]);
    }
  }
  std::size_t fastest = 0;
  for (std::size_t i = 0; i < list.size(); ++i) {
    char row[120];
    std::snprintf(row, sizeof row, "| %d | %s | %.0f |\n", rays, list[i].name,
                  kPings / times[i].seconds());
    best.rows += row;
    fastest = times[i].seconds() < times[fastest].seconds() ? i : fastest;
  }
  best.name = list[fastest].name;
  for (int run = 3; run < 2 * kRuns; ++run) {
    octomap::OcTree tree(1.0);
    fly(list[fastest], tree, times[fastest]);
    best.seconds = times[fastest].seconds();
    if (run > 3) {
      continue;
    }
    best.memory_bytes = tree.memoryUsage();
    const auto columns = leadline::test::octomap_columns(tree, kSide, kSide, 1.0);
    const auto column = [&](int n, int e) -> const leadline::test::OctomapColumn& {
      return columns[static_cast<std::size_t>(n) * kSide + static_cast<std::size_t>(e)];
    };
    const Accuracy mean = accuracy(survey, [&](int n, int e) {
      return column(n, e).weight > 0 ? static_cast<double>(kOriginDown_m) + column(n, e).mean()
                                     : std::nan("");
    });
    const Accuracy top = accuracy(survey, [&](int n, int e) {
      return column(n, e).weight > 0 ? static_cast<double>(kOriginDown_m) + column(n, e).top
                                     : std::nan("");
    });
    const bool mean_better = mean.rmse_cells <= top.rmse_cells;
    best.accuracy = mean_better ? mean : top;
    best.way = mean_better ? "mean of occupied" : "shallowest occupied";
  }
  return best;
}

// ---------------------------------------------------------------------------------------------------
// Curves

/// Pings straight down, more or less, onto a gentle swell around `depth_m`, from `range_m` above it; in
/// the order of a lawn mower whose lines are two cells apart, or anywhere.
Job curve_job(std::array<std::int32_t, 3> size, double range_m, double half_angle_deg,
              double depth_m, std::size_t count, bool lawn_mower) {
  Job job;
  job.config = job_config(size, static_cast<std::int64_t>(std::ceil(range_m * 1.5)) + 5);
  job.table = cone_table(half_angle_deg);
  host::Random random(7);
  const double north = size[0];
  const double east = size[1];
  for (std::size_t i = 0; i < count; ++i) {
    Vec3 position;
    if (lawn_mower) {
      const double along = 0.5 * static_cast<double>(i);
      const double line = std::floor(along / north);
      const double on_line = along - line * north;
      position.x = std::fmod(line, 2) < 1 ? on_line : north - on_line;
      position.y = std::fmod(2 * line + 1, east);
    } else {
      position.x = random.uniform(0, north);
      position.y = random.uniform(0, east);
    }
    const double ground = depth_m + 2 * std::sin(position.x / 15) * std::sin(position.y / 19);
    const double range = std::max(1.0, range_m + random.normal());
    position.z = ground - range_m;
    add_ping(job, static_cast<std::int64_t>(i) * 20'000, position,
             {random.normal(), random.normal(), random.uniform(0, 360)}, {0, 90}, range);
  }
  return job;
}

struct Point {
  double voxels = 0;
  double columns = 0;  ///< under the cone: its section at the far end, cells
  double ns = 0;
};

Point measure_curve(const Job& job, int runs, LeastTime& least) {
  time_job(job, model::Rule::kLogOdds, runs, least);
  const double seconds = least.seconds();
  const auto pings = static_cast<double>(job.pings.size());
  const model::ModelCounters& counters = the_model.counters();
  return {static_cast<double>(counters.voxel_updates) / pings, 0, seconds / pings * 1e9};
}

void print_map_sizes() {
  std::printf(
      "\n### Map size\n\n32,000 pings, range 20 cells, 3 degrees, log_odds. Lawn mower: lines two "
      "cells apart, as a vehicle "
      "flies. Anywhere: each ping at a random place, so that large maps miss every cache.\n\n");
  std::printf(
      "| grid | MiB of voxels | voxels per ping | lawn mower, ns per ping | anywhere, ns per ping "
      "|\n|---|---|---|---|---|\n");
  const std::array<std::int32_t, 5> sides = {64, 128, 256, 512, 1024};
  std::vector<std::array<Job, 2>> jobs;
  for (const std::int32_t side : sides) {
    jobs.push_back({curve_job({side, side, 16}, 20, kHalfAngle_deg, 8, kPings, true),
                    curve_job({side, side, 16}, 20, kHalfAngle_deg, 8, kPings, false)});
  }
  // Round by round, so that a busy spell of the machine does not fall on one point alone.
  std::vector<std::array<Point, 2>> points(sides.size());
  std::vector<std::array<LeastTime, 2>> times(sides.size(), {LeastTime(kPings), LeastTime(kPings)});
  for (int round = 0; round < 3; ++round) {
    for (std::size_t i = 0; i < sides.size(); ++i) {
      for (std::size_t order = 0; order < 2; ++order) {
        points[i][order] = measure_curve(jobs[i][order], 3, times[i][order]);
      }
    }
  }
  for (std::size_t i = 0; i < sides.size(); ++i) {
    std::printf("| %d x %d x 16 | %.1f | %.1f | %.0f | %.0f |\n", sides[i], sides[i],
                sides[i] * sides[i] * 16 * 4 / 1048576.0, points[i][0].voxels, points[i][0].ns,
                points[i][1].ns);
  }
}

/// Least squares of ns = x0 + x1 columns + x2 voxels in relative terms: a ping of 50 voxels counts like one
/// of 5,000.
std::array<double, 3> fit(const std::vector<Point>& points) {
  double m[3][4] = {};
  for (const Point& p : points) {
    const double row[4] = {1, p.columns, p.voxels, p.ns};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 4; ++j) {
        m[i][j] += row[i] * row[j] / (p.ns * p.ns);
      }
    }
  }
  for (int pivot = 0; pivot < 3; ++pivot) {
    for (int i = 0; i < 3; ++i) {
      const double factor = i == pivot ? 0 : m[i][pivot] / m[pivot][pivot];
      for (int j = 0; j < 4; ++j) {
        m[i][j] -= factor * m[pivot][j];
      }
    }
  }
  return {m[0][3] / m[0][0], m[1][3] / m[1][1], m[2][3] / m[2][2]};
}

void print_voxels_touched() {
  std::printf(
      "\n### Voxels touched\n\n8,000 pings, lawn mower, 128 x 128 x 128 cells, log_odds. Columns "
      "under the cone: "
      "its section at the far end, at least that of the tube that touches every voxel on the "
      "axis.\n\n");
  std::printf(
      "| cone, degrees | range, cells | columns under the cone | voxels per ping | ns per ping | "
      "ns per voxel |\n|---|---|---|---|---|---|\n");
  std::vector<Point> points;
  std::vector<std::array<double, 2>> beams;
  std::vector<Job> jobs;
  for (const double half_angle_deg : {1.0, 3.0, 6.0, 12.0}) {
    for (const double range : {5.0, 10.0, 20.0, 40.0, 80.0}) {
      beams.push_back({half_angle_deg, range});
      jobs.push_back(curve_job({128, 128, 128}, range, half_angle_deg, 100, 8000, true));
    }
  }
  points.resize(jobs.size());
  std::vector<LeastTime> times(jobs.size(), LeastTime(jobs.front().pings.size()));
  // Round by round, so that a busy spell of the machine does not fall on one point alone.
  for (int round = 0; round < 4; ++round) {
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      points[i] = measure_curve(jobs[i], 4, times[i]);
      const double radius =
          std::max(model::kTouch_q10 / 1024.0, std::tan(beams[i][0] * kPi / 180) * beams[i][1]);
      points[i].columns = kPi * radius * radius;
    }
  }
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    std::printf("| %g | %g | %.1f | %.1f | %.0f | %.2f |\n", beams[i][0], beams[i][1],
                points[i].columns, points[i].voxels, points[i].ns, points[i].ns / points[i].voxels);
  }
  const std::array<double, 3> line = fit(points);
  double worst = 0;
  for (const Point& p : points) {
    worst =
        std::max(worst, std::fabs(p.ns / (line[0] + line[1] * p.columns + line[2] * p.voxels) - 1));
  }
  std::printf(
      "\nLinear: %.0f ns + %.1f ns per column + %.2f ns per voxel; no point is further off than "
      "%.0f %%.\n",
      line[0], line[1], line[2], 100 * worst);
}

void print_job() {
  const Survey survey = make_survey();
  const Job& job = survey.job;
  const model::Rule rules[2] = {model::Rule::kLogOdds, model::Rule::kWeightedMean};
  const char* const names[2] = {"log_odds (default)", "weighted_mean"};
  Ours ours[2];
  double bare_seconds[2];
  double seen[2];
  for (int i = 0; i < 2; ++i) {
    ours[i] = measure_ours(survey, rules[i]);
    const Addresses addresses = find_addresses(job, rules[i]);
    seen[i] = addresses.seen;
    // Its addresses may differ in number by the last bit of a slope: per voxel, then.
    bare_seconds[i] = load_store_seconds(addresses) / static_cast<double>(addresses.voxel.size()) *
                      ours[i].voxels_per_ping * kPings;
  }

  const Octomap bundle = measure_octomap(survey, 37);
  const Octomap ray = measure_octomap(survey, 1);
  for (int i = 0; i < 2; ++i) {
    // As late as OctoMap: the machine may have become quieter since.
    time_job(job, rules[i], kRuns, ours[i].time);
    ours[i].seconds = ours[i].time.seconds();
  }

  std::printf(
      "### The job\n\n32,000 pings within 4 degrees of nadir, range 20 cells, cone of 3 degrees, "
      "128 x 128 x 32 cells of "
      "1 m; sigma: range 1 m, pointing 1 degree. One core.\n\n");
  std::printf(
      "| rule | pings/s | ns per ping | voxels per ping | ns per voxel | voxel updates/s | "
      "load-store loop, ns per voxel | ratio "
      "| bound |\n|---|---|---|---|---|---|---|---|---|\n");
  for (int i = 0; i < 2; ++i) {
    const double voxels = ours[i].voxels_per_ping * kPings;
    const double ratio = ours[i].seconds / bare_seconds[i];
    std::printf("| %s | %.0f | %.0f | %.1f (max %u) | %.2f | %.3g | %.2f | %.2f | %s |\n", names[i],
                kPings / ours[i].seconds, ours[i].seconds / kPings * 1e9, ours[i].voxels_per_ping,
                ours[i].max_voxels, ours[i].seconds / voxels * 1e9, voxels / ours[i].seconds,
                bare_seconds[i] / voxels * 1e9, ratio, ratio <= 3 ? "3: holds" : "3: **broken**");
  }
  std::printf(
      "\nLoad-store loop: %.2f %% and %.2f %% of the addresses seen by comparing voxels, the "
      "others are "
      "neighbours that stand in for voxels that only got zeros.\n",
      100 * seen[0], 100 * seen[1]);

  std::printf(
      "\nTime of one ping in ns, the clock's own cost subtracted. Least: of %d runs for each ping, "
      "which leaves out what "
      "else ran on the machine. Raw: all pings of the run with the median total.\n\n",
      kRuns);
  std::printf(
      "| rule | | p50 | p99 | p99.9 | max | p99.9 / p50 | bound "
      "|\n|---|---|---|---|---|---|---|---|\n");
  for (int i = 0; i < 2; ++i) {
    for (const bool raw : {false, true}) {
      const std::vector<double>& ns = raw ? ours[i].raw_ns : ours[i].least_ns;
      const double p50 = percentile(ns, 0.5);
      const double p999 = percentile(ns, 0.999);
      std::printf("| %s | %s | %.0f | %.0f | %.0f | %.0f | %.2f | %s |\n", names[i],
                  raw ? "raw" : "least", p50, percentile(ns, 0.99), p999,
                  *std::max_element(ns.begin(), ns.end()), p999 / p50,
                  p999 <= 5 * p50 ? "5: holds" : "5: **broken**");
    }
  }

  std::printf(
      "\n### OctoMap\n\nSame pings, resolution = cell, its default sensor model.\n\n| rays per "
      "ping | insert function | pings/s |\n|---|---|---|\n");
  std::printf("%s%s", bundle.rows.c_str(), ray.rows.c_str());

  const double cells = static_cast<double>(kSide) * kSide * kDepth;
  const double columns = static_cast<double>(kSide) * kSide;
  const double voxel_mib = cells * sizeof(model::Voxel) / 1048576.0;
  const double all_mib =
      voxel_mib + (columns * (sizeof(model::ColumnRecord) + sizeof(model::ColumnResult)) +
                   columns / 256 * sizeof(model::TileRecord) + sizeof(model::LocalizationTable)) /
                      1048576.0;
  std::printf(
      "\n| | pings/s | ours / this | memory, MiB | rmse, cells | bias, cells | coverage | depth of "
      "a column |\n|---|---|---|---|---|---|---|---|\n");
  for (int i = 0; i < 2; ++i) {
    std::printf(
        "| ours, %s | %.0f | | %.2f (voxels %.2f) | %.3f | %+.3f | %.2f %% | extraction of all "
        "columns: %.1f ms |\n",
        names[i], kPings / ours[i].seconds, all_mib, voxel_mib, ours[i].accuracy.rmse_cells,
        ours[i].accuracy.bias_cells, 100 * ours[i].accuracy.coverage,
        ours[i].extract_seconds * 1e3);
  }
  for (const Octomap* other : {&bundle, &ray}) {
    const double ratio = other->seconds / ours[0].seconds;
    std::printf("| OctoMap, %d rays, %s | %.0f | %.1f%s | %.2f | %.3f | %+.3f | %.2f %% | %s |\n",
                other == &bundle ? 37 : 1, other->name.c_str(), kPings / other->seconds, ratio,
                other != &bundle ? ""
                : ratio >= 40    ? " (bound 40: holds)"
                                 : " (bound 40: **broken**)",
                static_cast<double>(other->memory_bytes) / 1048576.0, other->accuracy.rmse_cells,
                other->accuracy.bias_cells, 100 * other->accuracy.coverage, other->way);
  }
}

}  // namespace

int main(int argc, char** argv) {
  // Parts by name; what starts with a dash is for Google Benchmark's programs.
  std::vector<std::string> parts;
  for (int i = 1; i < argc; ++i) {
    if (argv[i][0] != '-') {
      parts.emplace_back(argv[i]);
    }
  }
  const auto wanted = [&parts](const char* name) {
    return parts.empty() || std::find(parts.begin(), parts.end(), name) != parts.end();
  };
  if (wanted("job")) {
    print_job();
  }
  if (wanted("sizes")) {
    print_map_sizes();
  }
  if (wanted("voxels")) {
    print_voxels_touched();
  }
  return 0;
}
