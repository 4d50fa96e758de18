// Short false echoes (fish, multipath): the map with them against the map of the same pings without.
// Wide beams, where a near false echo is by far the most precise that there is.
#include <algorithm>
#include <cmath>
#include <vector>

#include "host_tools/table/generator.hpp"
#include "model/model.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using namespace leadline::test;   // NOLINT
using leadline::base::Ping;
using leadline::base::Pose;
using leadline::base::Status;

Model model;  // tens of megabytes: static

constexpr std::int32_t kSide = 48;
constexpr std::int32_t kDepth = 32;
constexpr double kCell_um = 1e6;

/// Depth of the bottom in cells; `block` raises a few columns of it.
struct Bottom {
  bool block = false;

  [[nodiscard]] double at(double n, double e) const {
    const bool raised = block && n >= 22.0 && n < 25.0 && e >= 22.0 && e < 25.0;
    return raised ? 14.0 : 22.0 + 0.8 * std::sin(0.3 * n) + 0.6 * std::cos(0.25 * e);
  }
};

LocalizationTable cone_table(double half_angle_deg) {
  leadline::host::BeamDescription beam;
  beam.kind = BeamKind::kCone;
  beam.half_angle_deg = half_angle_deg;
  beam.sigma_pointing_deg = 0.5;
  beam.sigma_range_mm = 150.0;
  return leadline::host::generate_table(beam).table;
}

/// Maps `pings` soundings straight down, of which a share is false; the same seed makes the same pings.
std::vector<double> survey(const LocalizationTable& table, const Bottom& bottom, int pings,
                           double false_share) {
  ModelConfig config = plain_config(kSide, kSide, kDepth);
  assert_int_equal(model.configure(config, &table, sizeof(table)), Status::kOk);
  Random random(3);
  for (int i = 0; i < pings; ++i) {
    const double n = kSide * random.uniform();
    const double e = kSide * random.uniform();
    const double noise = 0.15 * random.normal();
    const bool is_false = random.uniform() < false_share;
    const double share = random.uniform();
    const double range = bottom.at(n, e) - 1.0;
    const Pose pose = pose_at(n, e, 1.0);
    Ping ping = ping_along(0, 90, 1.0);
    ping.range_um =
        std::llround(kCell_um * (is_false ? std::max(0.6, share * range) : range + noise));
    static_cast<void>(model.integrate(ping, pose));
  }
  model.extract();
  std::vector<double> depths;
  for (std::int32_t n = 0; n < kSide; ++n) {
    for (std::int32_t e = 0; e < kSide; ++e) {
      const std::int32_t depth_q8 = model.result(n, e).depth_q8;
      depths.push_back(depth_q8 == kUnknownDepth ? 0.0 : depth_q8 / 256.0);
    }
  }
  return depths;
}

double rms_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += (a[i] - b[i]) * (a[i] - b[i]);
  }
  return std::sqrt(sum / static_cast<double>(a.size()));
}

TEST(false_echoes_do_not_move_the_bottom) {
  struct Case {
    double half_angle_deg;
    int pings;
    double false_share;
    double bound_cells;
  };
  for (const Case& c :
       {Case{12.0, 1500, 0.01, 0.25}, Case{12.0, 6000, 0.01, 0.15}, Case{12.0, 6000, 0.1, 0.4},
        Case{5.0, 6000, 0.01, 0.15}, Case{5.0, 12000, 0.1, 0.25}, Case{2.0, 12000, 0.05, 0.25}}) {
    const LocalizationTable table = cone_table(c.half_angle_deg);
    const std::vector<double> clean = survey(table, Bottom{}, c.pings, 0.0);
    const std::vector<double> dirty = survey(table, Bottom{}, c.pings, c.false_share);
    const double rms = rms_difference(clean, dirty);
    print_message("%.0f degrees, %d pings, %.0f %% false: rms difference %.3f cells (bound %.2f)\n",
                  c.half_angle_deg, c.pings, 100.0 * c.false_share, rms, c.bound_cells);
    assert_true(rms <= c.bound_cells);
  }
}

TEST(a_block_that_pings_agree_on_stands) {
  // Three by three cells, eight high, among hundreds of columns that say otherwise: no false echo. The
  // corners have seen both, block and bottom; the middle and its four neighbours must stand.
  const std::vector<double> depths = survey(cone_table(1.0), Bottom{true}, 24'000, 0.0);
  const auto at = [&depths](std::int32_t n, std::int32_t e) {
    return depths[static_cast<std::size_t>(n * kSide + e)];
  };
  assert_near(at(23, 23), 14.0, 0.7);
  for (const std::int32_t step : {-1, 1}) {
    assert_near(at(23 + step, 23), 14.0, 0.7);
    assert_near(at(23, 23 + step), 14.0, 0.7);
  }
}

}  // namespace
