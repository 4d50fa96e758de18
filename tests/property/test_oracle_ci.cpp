// The integer model against the oracle (tests/support/oracle.hpp) on random configurations:
//   (a) one event: every voxel increment within one unit plus the stated table error;
//   (b) a survey: depths after 10^4 pings within 0.05 cell rms.
// The seed is printed by a failing test; the figures are printed by every run.
//
//   LEADLINE_ORACLE_CONFIGURATIONS   how many random configurations (default 24; soak runs use more)
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "host_tools/table/generator.hpp"
#include "model/model.hpp"
#include "tests/support/oracle.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using namespace leadline::test;   // NOLINT
using leadline::base::Attitude;
using leadline::base::Bam32;
using leadline::base::Ping;
using leadline::base::Pose;
using leadline::base::ReturnKind;
using leadline::base::Status;
using leadline::host::BeamDescription;

Model model;  // tens of megabytes: static

// The integrator's own constants (model/integrate.cpp, carve.cpp, evidence.hpp), which are part of the method as built.
constexpr int kConeRunCells = 24;
constexpr double kRegrowth = 2.0;

int configurations() {
  const char* text = std::getenv("LEADLINE_ORACLE_CONFIGURATIONS");
  return text == nullptr ? 24 : std::max(1, std::atoi(text));
}

struct Setup {
  std::string name;
  ModelConfig config;
  LocalizationTable table;
};

/// A random sonar over a random grid. Lengths of the sonar go with the cell, so that every ratio that
/// surveys have occurs: beams of a tenth of a cell to several cells, errors of none to two.
Setup random_setup(Random& random, int index, std::int32_t side, std::int32_t depth) {
  Setup setup;
  BeamDescription beam;
  const double cell_mm = std::floor(std::exp(std::log(100.0) + std::log(50.0) * random.uniform()));
  if (index % 3 == 0) {
    beam.kind = BeamKind::kCone;
    beam.half_angle_deg = 0.3 + 7.0 * random.uniform();
  } else {
    beam.frequency_hz =
        1500.0 * 1000.0 / (0.5 + 4.0 * random.uniform());  // wavelengths of 0.5 to 4.5 mm
    const double wavelength_mm = 1500.0 * 1000.0 / beam.frequency_hz;
    if (index % 3 == 1) {
      beam.kind = BeamKind::kPiston;
      beam.piston_diameter_mm = wavelength_mm * (6.0 + 40.0 * random.uniform());
    } else {
      beam.kind = BeamKind::kRectangle;
      beam.aperture_along_mm = wavelength_mm * (6.0 + 40.0 * random.uniform());
      beam.aperture_across_mm = wavelength_mm * (6.0 + 40.0 * random.uniform());
    }
    beam.max_half_angle_deg = 12.0;
  }
  beam.sigma_pointing_deg = random.between(0, 3) == 0 ? 0.0 : 1.5 * random.uniform();
  beam.sigma_range_mm = cell_mm * (0.1 + 1.2 * random.uniform());
  setup.table = leadline::host::generate_table(beam).table;

  setup.config = plain_config(side, side, depth);
  setup.config.cell_mm = static_cast<std::int32_t>(cell_mm);
  setup.config.rule = index % 2 == 0 ? Rule::kLogOdds : Rule::kWeightedMean;
  for (std::int64_t& origin_mm : setup.config.origin_mm) {
    origin_mm = random.between(-1'000'000, 1'000'000);
  }
  const double longest_cells = 60.0 + 60.0 * random.uniform();
  setup.config.max_range_um = std::llround(longest_cells * cell_mm * 1000.0);
  setup.config.min_range_um = 0;
  setup.config.no_return = NoReturnPolicy::kEmpty;
  setup.config.detect_range_um = setup.config.max_range_um / 2;
  if (random.between(0, 1) == 0) {
    for (std::int64_t& sigma_mm : setup.config.sigma_position_mm) {
      sigma_mm = std::llround(cell_mm * 1.5 * random.uniform());
    }
  }
  const char* const kinds[] = {"cone", "piston", "rectangle"};
  char text[160];
  std::snprintf(text, sizeof(text), "%d: %s, cell %.0f mm, envelope %.2f x %.2f deg, %s", index,
                kinds[index % 3], cell_mm,
                std::atan(setup.table.tan_envelope_along_q24 * 0x1.0p-24) * 57.29578,
                std::atan(setup.table.tan_envelope_across_q24 * 0x1.0p-24) * 57.29578,
                setup.config.rule == Rule::kLogOdds ? "log-odds" : "weighted mean");
  setup.name = text;
  return setup;
}

Pose random_pose(Random& random, const ModelConfig& config, double north, double east, double down,
                 double tilt_deg) {
  const double cell_um = config.cell_mm * 1000.0;
  Pose pose = pose_at(0, 0, 0);
  const double cells[3] = {north, east, down};
  for (int axis = 0; axis < 3; ++axis) {
    pose.position_um[axis] = config.origin_mm[axis] * 1000 + std::llround(cells[axis] * cell_um);
    pose.covariance.sigma_position_mm[axis] =
        static_cast<std::uint32_t>(config.sigma_position_mm[axis]);
  }
  pose.attitude = Attitude{bam(tilt_deg * random.normal()), bam(tilt_deg * random.normal()),
                           static_cast<Bam32>(random.next())};
  return pose;
}

struct Tally {
  std::int64_t voxels = 0;
  std::int64_t within_one = 0;
  std::int64_t edges = 0;
  double squares = 0.0;
  double worst = 0.0;
  double allowed = 0.0;
};

void print_tally(const char* what, const Tally& tally) {
  const auto count = static_cast<double>(std::max<std::int64_t>(tally.voxels, 1));
  print_message(
      "%s: %lld increments, %.2f %% within 1 unit, rms difference %.3f, worst %.2f; mean allowance "
      "beyond "
      "the unit %.2f; %lld at a cut\n",
      what, static_cast<long long>(tally.voxels),
      100.0 * static_cast<double>(tally.within_one) / count, std::sqrt(tally.squares / count),
      tally.worst, tally.allowed / count, static_cast<long long>(tally.edges));
}

TEST(one_event_is_the_oracles_within_a_unit_and_the_table_error) {
  constexpr std::int32_t kSide = 36;
  constexpr std::int32_t kDepth = 32;
  constexpr int kEvents = 60;
  Tally hits;
  Tally misses;
  Tally single;  // misses against an oracle that weighs every voxel of the cone by itself
  int events = 0;
  int ambiguous = 0;
  int walls = 0;
  Random random(1);
  for (int index = 0; index < configurations(); ++index) {
    const Setup setup = random_setup(random, index, kSide, kDepth);
    for (int trial = 0; trial < kEvents; ++trial) {
      assert_int_equal(model.configure(setup.config, &setup.table, sizeof(setup.table)),
                       Status::kOk);
      OracleSettings settings;
      settings.footprint_cells = model.scale().footprint_cells;
      settings.cone_run_cells = kConeRunCells;
      settings.regrowth = kRegrowth;
      Oracle oracle(setup.config, setup.table, settings);
      settings.cone_run_cells = 1;
      Oracle exact(setup.config, setup.table, settings);
      // Both read the same slope from the same side records: a tilted plane.
      const double tilt_n = 0.7 * random.normal();
      const double tilt_e = 0.7 * random.normal();
      const bool sloped = trial % 4 != 0;
      for (std::int32_t n = 0; n < kSide && sloped; ++n) {
        for (std::int32_t e = 0; e < kSide; ++e) {
          const double depth = std::clamp(16.0 + tilt_n * (n - 18) + tilt_e * (e - 18), 0.0, 32.0);
          ColumnRecord& record = model.grid().column(model.grid().column_index(n, e));
          record.depth_q8 = static_cast<std::int32_t>(std::lround(depth * 256.0));
          record.mass = 2'000'000;
          record.gain = 0;
          record.slope_weight_q4 = 63;
          for (Oracle* const one : {&oracle, &exact}) {
            one->record(n, e) =
                Oracle::Record{true, record.depth_q8 / 256.0, 2'000'000.0, 0.0, 0.0, 63.0};
          }
        }
      }
      const Pose pose = random_pose(random, setup.config, 46.0 * random.uniform() - 5.0,
                                    46.0 * random.uniform() - 5.0, 12.0 * random.uniform() - 8.0,
                                    trial % 3 == 0 ? 25.0 : 6.0);
      Ping ping = ping_along(
          360.0 * random.uniform(),
          trial % 5 == 0 ? 90.0 * random.uniform() - 20.0 : 75.0 + 15.0 * random.uniform(), 1.0);
      ping.rotation_bam32 = random.between(0, 1) == 0 ? 0 : static_cast<Bam32>(random.next());
      ping.range_um = std::llround((4.0 + 28.0 * random.uniform()) * setup.config.cell_mm * 1000.0);
      if (trial % 20 == 19) {
        ping.kind = ReturnKind::kNoReturn;
      }
      const PingResult result = model.integrate(ping, pose);
      assert_true(result == PingResult::kFused || result == PingResult::kNoReturn);
      oracle.integrate(ping, pose);
      ++events;
      if (oracle.ambiguous() || model.counters().cones_cut != 0) {
        ++ambiguous;
        continue;
      }
      exact.integrate(ping, pose);
      walls += oracle.wall() ? 1 : 0;
      std::size_t at = 0;
      for (std::int32_t n = 0; n < kSide; ++n) {
        for (std::int32_t e = 0; e < kSide; ++e) {
          const Voxel* const voxels = model.grid().column_voxels(model.grid().column_index(n, e));
          for (std::int32_t k = 0; k < kDepth; ++k, ++at) {
            const Increment& expected = oracle.event()[at];
            const auto compare = [&](double actual, double truth, double allowed, Tally* tally,
                                     const char* half) {
              if (actual == 0.0 && truth == 0.0) {
                return;
              }
              if (expected.edge) {
                ++tally->edges;
                return;
              }
              const double difference = std::fabs(actual - truth);
              ++tally->voxels;
              tally->within_one += difference <= 1.0 ? 1 : 0;
              tally->squares += difference * difference;
              tally->worst = std::max(tally->worst, difference);
              tally->allowed += allowed;
              if (difference > 1.0 + allowed) {
                fail_msg(
                    "%s; event %d, voxel (%d %d %d): %s %g, the oracle says %g, allowed 1 + %g",
                    setup.name.c_str(), trial, n, e, k, half, actual, truth, allowed);
              }
            };
            compare(voxels[k].hit, expected.hit, expected.allowed_hit, &hits, "hit");
            compare(voxels[k].miss, expected.miss, expected.allowed_miss, &misses, "miss");
            const Increment& alone = exact.event()[at];
            if (alone.miss > 0.0 && !alone.edge) {
              const double difference = std::fabs(voxels[k].miss - alone.miss);
              ++single.voxels;
              single.within_one += difference <= 1.0 ? 1 : 0;
              single.squares += difference * difference;
              single.worst = std::max(single.worst, difference);
            }
          }
        }
      }
    }
  }
  print_message(
      "%d events of %d configurations, %d of them walls; %d undecided between two kernels were "
      "left out\n",
      events, configurations(), walls, ambiguous);
  print_tally("hit", hits);
  print_tally("miss", misses);
  print_tally("miss, against one weight per voxel", single);
  assert_true(events > 4 * ambiguous);
  assert_true(walls > events / 50);
}

// What Model::integrate_behind writes is the oracle's shell, and nothing of its cone.
TEST(a_later_return_is_the_oracles_shell_alone) {
  constexpr std::int32_t kSide = 36;
  constexpr std::int32_t kDepth = 32;
  constexpr int kEvents = 12;
  Random random(3);
  Tally hits;
  int events = 0;
  for (int index = 0; index < configurations(); index += 2) {  // log-odds: a shell has hits alone
    const Setup setup = random_setup(random, index, kSide, kDepth);
    OracleSettings settings;
    for (int trial = 0; trial < kEvents; ++trial) {
      assert_int_equal(model.configure(setup.config, &setup.table, sizeof(setup.table)),
                       Status::kOk);
      settings.footprint_cells = model.scale().footprint_cells;
      settings.cone_run_cells = kConeRunCells;
      settings.regrowth = kRegrowth;
      Oracle oracle(setup.config, setup.table, settings);
      const Pose pose =
          random_pose(random, setup.config, kSide * random.uniform(), kSide * random.uniform(),
                      8.0 * random.uniform() - 8.0, trial % 3 == 0 ? 25.0 : 6.0);
      Ping ping = ping_along(360.0 * random.uniform(), 75.0 + 15.0 * random.uniform(), 1.0);
      ping.range_um = std::llround((8.0 + 24.0 * random.uniform()) * setup.config.cell_mm * 1000.0);
      assert_true(model.integrate_behind(ping, pose) == PingResult::kFused);
      assert_true(model.counters().last_voxels_per_ping <= model.bound().behind_voxels);
      assert_true(model.counters().pings[static_cast<int>(PingResult::kFused)] == 0);
      assert_true(model.counters().behind_fused == 1);
      oracle.integrate(ping, pose);
      if (oracle.ambiguous()) {
        continue;
      }
      ++events;
      std::size_t at = 0;
      for (std::int32_t n = 0; n < kSide; ++n) {
        for (std::int32_t e = 0; e < kSide; ++e) {
          const Voxel* const voxels = model.grid().column_voxels(model.grid().column_index(n, e));
          for (std::int32_t k = 0; k < kDepth; ++k, ++at) {
            const Increment& expected = oracle.event()[at];
            assert_int_equal(voxels[k].miss, 0);
            if ((voxels[k].hit == 0 && expected.hit == 0.0) || expected.edge) {
              continue;
            }
            const double difference = std::fabs(voxels[k].hit - expected.hit);
            ++hits.voxels;
            hits.within_one += difference <= 1.0 ? 1 : 0;
            hits.squares += difference * difference;
            hits.worst = std::max(hits.worst, difference);
            if (difference > 1.0 + expected.allowed_hit) {
              fail_msg("%s; event %d, voxel (%d %d %d): hit %d, the oracle says %g",
                       setup.name.c_str(), trial, n, e, k, voxels[k].hit, expected.hit);
            }
          }
        }
      }
    }
  }
  print_tally("hit of later returns", hits);
  assert_true(events > 4 * kEvents);
}

/// A bottom with relief at two scales.
struct Bottom {
  double depth, slope_n, slope_e, waves[2][4];

  explicit Bottom(Random& random) {
    depth = 17.0 + 3.0 * random.uniform();
    slope_n = 0.1 * random.normal();
    slope_e = 0.1 * random.normal();
    for (auto& wave : waves) {
      wave[0] = 0.8 * random.uniform();
      wave[1] = 0.5 * random.uniform();
      wave[2] = 0.5 * random.uniform();
      wave[3] = 6.28 * random.uniform();
    }
  }
  [[nodiscard]] double at(double n, double e) const {
    double value = depth + slope_n * (n - 14) + slope_e * (e - 14);
    for (const auto& wave : waves) {
      value += wave[0] * std::sin(wave[1] * n + wave[2] * e + wave[3]);
    }
    return value;
  }
};

TEST(depths_after_ten_thousand_pings_are_the_oracles) {
  constexpr std::int32_t kSide = 28;
  constexpr std::int32_t kDepth = 32;
  constexpr int kPings = 10'000;
  double worst_rms = 0.0;
  double squares = 0.0;
  int total = 0;
  Random random(2);
  for (int index = 0; index < std::max(1, configurations() / 3); ++index) {
    const Setup setup = random_setup(random, index, kSide, kDepth);
    assert_int_equal(model.configure(setup.config, &setup.table, sizeof(setup.table)), Status::kOk);
    OracleSettings settings;
    settings.footprint_cells = model.scale().footprint_cells;
    settings.cone_run_cells = kConeRunCells;
    settings.regrowth = kRegrowth;
    settings.allowances = false;
    Oracle oracle(setup.config, setup.table, settings);
    const Bottom bottom(random);
    const double noise = setup.table.sigma_range_um / (setup.config.cell_mm * 1000.0);
    for (int i = 0; i < kPings; ++i) {
      const double n = kSide * random.uniform();
      const double e = kSide * random.uniform();
      const Pose pose = random_pose(random, setup.config, n, e, 1.0, 4.0);
      // Along the axis by iteration; which part of the footprint answers first is not at issue here.
      const double roll =
          static_cast<std::int32_t>(pose.attitude.roll_bam32) * (3.141592653589793 / 2147483648.0);
      const double pitch =
          static_cast<std::int32_t>(pose.attitude.pitch_bam32) * (3.141592653589793 / 2147483648.0);
      const double heading = static_cast<std::int32_t>(pose.attitude.heading_bam32) *
                             (3.141592653589793 / 2147483648.0);
      const double forward = std::sin(pitch) * std::cos(roll);
      const double right = -std::sin(roll);
      const double u[3] = {std::cos(heading) * forward - std::sin(heading) * right,
                           std::sin(heading) * forward + std::cos(heading) * right,
                           std::cos(pitch) * std::cos(roll)};
      double range = 17.0;
      for (int step = 0; step < 20; ++step) {
        range = (bottom.at(n + range * u[0], e + range * u[1]) - 1.0) / u[2];
      }
      Ping ping = ping_along(0, 90, 1.0);
      ping.range_um =
          std::llround((range + noise * random.normal()) * setup.config.cell_mm * 1000.0);
      if (model.integrate(ping, pose) == PingResult::kFused) {
        oracle.integrate(ping, pose);
      }
    }
    model.extract();
    const std::vector<double> depths = oracle.extract();
    double sum = 0.0;
    double worst = 0.0;
    int known = 0;
    int disagreed = 0;
    for (std::int32_t n = 0; n < kSide; ++n) {
      for (std::int32_t e = 0; e < kSide; ++e) {
        const double expected = depths[static_cast<std::size_t>(n * kSide + e)];
        const std::int32_t depth_q8 = model.result(n, e).depth_q8;
        if ((depth_q8 == kUnknownDepth) != std::isnan(expected)) {
          ++disagreed;
          continue;
        }
        if (depth_q8 != kUnknownDepth) {
          const double difference = depth_q8 / 256.0 - expected;
          sum += difference * difference;
          worst = std::max(worst, std::fabs(difference));
          ++known;
        }
      }
    }
    const double rms = std::sqrt(sum / std::max(known, 1));
    print_message("%s: %d columns, rms difference %.4f, worst %.3f cells; %d known to one only\n",
                  setup.name.c_str(), known, rms, worst, disagreed);
    worst_rms = std::max(worst_rms, rms);
    squares += sum;
    total += known;
    assert_true(known > kSide * kSide * 9 / 10);
    assert_true(disagreed <= kSide * kSide / 100);
    assert_true(rms <= 0.05);
  }
  print_message("depth: worst rms of a configuration %.4f, overall %.4f cells\n", worst_rms,
                std::sqrt(squares / std::max(total, 1)));
}

}  // namespace
