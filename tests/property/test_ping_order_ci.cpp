// Order dependence. The map is not a plain sum: the slope feedback reads the map as it is when a ping
// comes, and rounding follows the ping's number. The same pings in another order must give the same
// seafloor all the same, to a small part of its error.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "model/model.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using namespace leadline::test;   // NOLINT
using leadline::base::Attitude;
using leadline::base::Bam32;
using leadline::base::Ping;
using leadline::base::Pose;
using leadline::base::Status;

Model model;  // tens of megabytes: static

constexpr std::int32_t kSide = 48;
constexpr std::int32_t kDepth = 40;

double bottom(double n, double e) {
  return 22.0 + 0.15 * (n - 24.0) + 2.0 * std::sin(e / 6.0) + 0.8 * std::sin(n / 3.0 + e / 5.0);
}

struct Sounding {
  Ping ping;
  Pose pose;
};

/// Lines 3 cells apart, northwards and back, as a survey runs them.
std::vector<Sounding> survey(int count) {
  Random random(1);
  std::vector<Sounding> list;
  for (int i = 0; i < count; ++i) {
    const double along = kSide * static_cast<double>(i % 600) / 600.0;
    const int line = i / 600;
    const double north = line % 2 == 0 ? along : kSide - along;
    const double east = std::fmod(1.5 + 3.0 * line, static_cast<double>(kSide));
    Sounding sounding{};
    sounding.pose = pose_at(north, east, 1.0);
    sounding.pose.t_us = 100'000LL * i;
    const double roll = 3.0 * random.normal();
    const double pitch = 3.0 * random.normal();
    sounding.pose.attitude = Attitude{bam(roll), bam(pitch), 0};
    const double rad = 3.14159265358979323846 / 180.0;
    const double u[3] = {std::sin(pitch * rad) * std::cos(roll * rad), -std::sin(roll * rad),
                         std::cos(pitch * rad) * std::cos(roll * rad)};
    double range = 20.0;
    for (int step = 0; step < 20; ++step) {
      range = (bottom(north + range * u[0], east + range * u[1]) - 1.0) / u[2];
    }
    sounding.ping = ping_along(0, 90, range + 0.4 * random.normal());
    sounding.ping.t_transmit_us = sounding.pose.t_us;
    list.push_back(sounding);
  }
  return list;
}

struct Map {
  std::vector<double> depths;  // cells; NaN unknown
  double rmse;
};

Map map_of(const std::vector<Sounding>& soundings, Rule rule) {
  ModelConfig config = plain_config(kSide, kSide, kDepth);
  config.rule = rule;
  const LocalizationTable table = plain_table(PlainBeam{});
  assert_int_equal(model.configure(config, &table, sizeof(table)), Status::kOk);
  for (const Sounding& sounding : soundings) {
    assert_int_equal(model.integrate(sounding.ping, sounding.pose), PingResult::kFused);
  }
  model.extract();
  Map map{{}, 0.0};
  double squares = 0.0;
  int known = 0;
  for (std::int32_t n = 0; n < kSide; ++n) {
    for (std::int32_t e = 0; e < kSide; ++e) {
      const std::int32_t depth_q8 = model.result(n, e).depth_q8;
      const double depth = depth_q8 == kUnknownDepth ? std::nan("") : depth_q8 / 256.0;
      map.depths.push_back(depth);
      if (!std::isnan(depth)) {
        const double error = depth - bottom(n + 0.5, e + 0.5);
        squares += error * error;
        ++known;
      }
    }
  }
  assert_int_equal(known, kSide * kSide);
  map.rmse = std::sqrt(squares / known);
  return map;
}

TEST(shuffled_pings_give_the_same_seafloor) {
  for (const Rule rule : {Rule::kLogOdds, Rule::kWeightedMean}) {
    const std::vector<Sounding> ordered = survey(600 * 16);
    const Map reference = map_of(ordered, rule);
    Random random(2);
    for (int order = 0; order < 5; ++order) {
      std::vector<Sounding> shuffled = ordered;
      if (order == 0) {
        std::reverse(shuffled.begin(), shuffled.end());
      } else {
        for (std::size_t i = shuffled.size() - 1; i > 0; --i) {
          std::swap(
              shuffled[i],
              shuffled[static_cast<std::size_t>(random.between(0, static_cast<std::int64_t>(i)))]);
        }
      }
      const Map map = map_of(shuffled, rule);
      double squares = 0.0;
      double worst = 0.0;
      for (std::size_t i = 0; i < map.depths.size(); ++i) {
        const double difference = map.depths[i] - reference.depths[i];
        squares += difference * difference;
        worst = std::max(worst, std::fabs(difference));
      }
      const double rms = std::sqrt(squares / static_cast<double>(map.depths.size()));
      print_message(
          "rule %d, %s: rms depth difference %.4f, worst %.3f cells; rmse %.4f -> %.4f (%+.2f "
          "%%)\n",
          static_cast<int>(rule), order == 0 ? "reversed" : "shuffled", rms, worst, reference.rmse,
          map.rmse, 100.0 * (map.rmse / reference.rmse - 1.0));
      assert_true(rms < 0.5 * reference.rmse);
      assert_true(rms < 0.05);
      assert_true(std::fabs(map.rmse / reference.rmse - 1.0) < 0.1);
    }
  }
}

}  // namespace
