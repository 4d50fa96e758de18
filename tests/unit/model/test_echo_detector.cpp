// Synthetic echoes of known arrival, with noise of a converter, at every strength; and nonsense.
#include <algorithm>
#include <cmath>
#include <vector>

#include "model/echo_detector.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::RangeProfile;
using leadline::model::detect_echo;
using leadline::model::EchoDetection;
using leadline::model::EchoDetectorConfig;
using leadline::test::Random;

constexpr std::uint32_t kBin_um = 25'000;
constexpr EchoDetectorConfig kConfig{6554, 0, 100'000'000};  // a tenth of the energy

RangeProfile profile_of(const std::vector<std::uint16_t>& bins) {
  return RangeProfile{bins.data(), kBin_um, kBin_um / 2, static_cast<std::uint16_t>(bins.size())};
}

// An echo that rises at once and decays: energy density exp(-(r - start) / length), of `energy` in all.
struct Echo {
  double start_um;
  double length_um;
  double energy;
  [[nodiscard]] double in_bin(int bin) const {
    const auto cumulative = [this](double r) {
      return r <= start_um ? 0.0 : 1.0 - std::exp(-(r - start_um) / length_um);
    };
    return energy * (cumulative((bin + 1.0) * kBin_um) - cumulative(bin * 1.0 * kBin_um));
  }
  [[nodiscard]] double arrival_um(double fraction) const {
    return start_um - length_um * std::log(1.0 - fraction);
  }
};

std::vector<std::uint16_t> heard(const std::vector<Echo>& echoes, int count, double level,
                                 double noise, Random& random) {
  std::vector<std::uint16_t> bins;
  for (int i = 0; i < count; ++i) {
    double value = level + noise * random.normal();
    for (const Echo& echo : echoes) {
      value += echo.in_bin(i);
    }
    bins.push_back(static_cast<std::uint16_t>(std::clamp(std::lround(value), 0L, 65535L)));
  }
  return bins;
}

TEST(a_clean_echo_is_found_where_its_fraction_arrives) {
  Random random(1);
  for (const int fraction : {1311, 6554, 32768, 58982}) {
    for (int i = 0; i < 300; ++i) {
      const Echo echo{1e6 + 20e6 * random.uniform(), 30'000.0 + 300'000.0 * random.uniform(),
                      100'000};
      const auto bins = heard({echo}, 1200, 20, 0, random);
      const EchoDetection found =
          detect_echo(profile_of(bins),
                      EchoDetectorConfig{static_cast<std::uint16_t>(fraction), 0, 100'000'000});
      assert_true(found.found);
      assert_in_range(found.noise_q8, 20 * 256, 20 * 256 + 8);  // the echo's last traces
      // Within a bin energy is taken as even: the bin in which it begins counts whole.
      const double tail = fraction > 50'000 ? 0.1 * echo.length_um : 0.0;
      assert_near(static_cast<double>(found.range_um), echo.arrival_um(fraction / 65536.0),
                  0.75 * kBin_um + tail + 0.005 * echo.length_um);
      assert_near(static_cast<double>(found.energy_q8) / 256.0, 100'000, 2'000);
      assert_true(found.quality > 200);
    }
  }
}

TEST(a_single_bin_is_an_echo) {
  Random random(2);
  std::vector<std::uint16_t> bins(400, 5);
  bins[100] = 900;
  const EchoDetection found = detect_echo(profile_of(bins), kConfig);
  assert_true(found.found);
  // A tenth of the way through the bin.
  assert_near(static_cast<double>(found.range_um), 100.1 * kBin_um, 0.02 * kBin_um);
}

TEST(noise_costs_precision_as_its_strength_says_and_no_bias) {
  Random random(3);
  for (const double noise : {2.0, 10.0, 30.0}) {
    double sum = 0;
    double squares = 0;
    int found_count = 0;
    constexpr int kRuns = 400;
    for (int i = 0; i < kRuns; ++i) {
      const Echo echo{5e6 + 15e6 * random.uniform(), 150'000, 6000};
      const auto bins = heard({echo}, 1000, 150, noise, random);
      const EchoDetection found = detect_echo(profile_of(bins), kConfig);
      if (!found.found) {
        continue;
      }
      ++found_count;
      const double error = (static_cast<double>(found.range_um) - echo.arrival_um(0.1)) / kBin_um;
      sum += error;
      squares += error * error;
    }
    print_message("noise %g of a peak of 930: found %d of %d, mean %.3f, rms %.3f bins\n", noise,
                  found_count, kRuns, sum / found_count, std::sqrt(squares / found_count));
    assert_true(found_count > kRuns * 98 / 100);
    assert_near(sum / found_count, 0.0, 0.25);
    assert_true(std::sqrt(squares / found_count) < 0.2 + noise / 25.0);
  }
}

TEST(noise_alone_is_no_echo) {
  Random random(4);
  int alarms = 0;
  for (int i = 0; i < 2000; ++i) {
    const auto bins = heard({}, 1200, 100, 15, random);
    alarms += detect_echo(profile_of(bins), kConfig).found ? 1 : 0;
  }
  assert_int_equal(alarms, 0);
  // Rayleigh's amplitudes, as an envelope detector has them, have a longer tail.
  int rayleigh = 0;
  for (int i = 0; i < 2000; ++i) {
    std::vector<std::uint16_t> bins;
    for (int k = 0; k < 1200; ++k) {
      bins.push_back(
          static_cast<std::uint16_t>(40 * std::sqrt(-2 * std::log(1 - random.uniform()))));
    }
    rayleigh += detect_echo(profile_of(bins), kConfig).found ? 1 : 0;
  }
  assert_true(rayleigh <= 2);
}

TEST(quality_grows_with_the_signal) {
  Random random(5);
  int before = 0;
  for (const double energy : {3e3, 1e4, 5e4, 3e5}) {
    const auto bins = heard({Echo{10e6, 150'000, energy}}, 1000, 100, 8, random);
    const EchoDetection found = detect_echo(profile_of(bins), kConfig);
    assert_true(found.found);
    assert_true(found.quality >= 128 && found.quality > before);
    before = found.quality;
  }
}

TEST(the_nearest_of_comparable_echoes_is_taken) {
  Random random(6);
  const Echo near{5e6, 100'000, 30'000};
  const Echo far{12e6, 100'000, 60'000};
  const auto both = heard({near, far}, 1000, 50, 3, random);
  assert_near(static_cast<double>(detect_echo(profile_of(both), kConfig).range_um),
              near.arrival_um(0.1), kBin_um);
  // A fish of a tenth of the bottom's energy is passed over.
  const auto fish = heard({Echo{5e6, 50'000, 6'000}, far}, 1000, 50, 3, random);
  assert_near(static_cast<double>(detect_echo(profile_of(fish), kConfig).range_um),
              far.arrival_um(0.1), kBin_um);
}

TEST(what_outdoes_the_echo_before_it_is_a_return_of_its_own) {
  Random random(6);
  EchoDetectorConfig many = kConfig;
  many.max_returns = leadline::model::kMaxReturns;
  many.apart_q16 = 13'107;  // a fifth
  const Echo fish{5e6, 60'000, 40'000};
  const Echo bottom{12e6, 200'000, 100'000};
  const Echo multiple{24e6, 200'000, 30'000};
  const auto bins = heard({fish, bottom, multiple}, 1200, 20, 4, random);
  EchoDetection found = detect_echo(profile_of(bins), many);
  assert_true(found.found);
  assert_true(std::fabs(static_cast<double>(found.range_um) - fish.arrival_um(0.1)) < 20'000);
  assert_true(std::fabs(static_cast<double>(found.clear_um) - 5e6) < 60'000);
  assert_int_equal(found.behind_count, 1);
  assert_true(std::fabs(static_cast<double>(found.behind[0].range_um) - bottom.arrival_um(0.1)) <
              20'000);
  assert_true(found.behind[0].quality > 200);
  // Alone it is the same first return, and there is nothing behind it.
  const EchoDetection alone = detect_echo(profile_of(bins), kConfig);
  assert_true(alone.range_um == found.range_um);
  assert_int_equal(alone.behind_count, 0);
  assert_int_equal(alone.quality, found.quality);
  // A fish too faint for a return ends what is free all the same.
  found =
      detect_echo(profile_of(heard({{5e6, 60'000, 15'000}, bottom}, 1200, 20, 4, random)), many);
  assert_true(std::fabs(static_cast<double>(found.range_um) - bottom.arrival_um(0.1)) < 20'000);
  assert_true(std::fabs(static_cast<double>(found.clear_um) - 5e6) < 60'000);
  assert_int_equal(found.behind_count, 0);
  // Too near behind it: another part of the same surface.
  found = detect_echo(
      profile_of(heard({{10e6, 60'000, 40'000}, {11.5e6, 60'000, 100'000}}, 1200, 20, 4, random)),
      many);
  assert_true(std::fabs(static_cast<double>(found.range_um) - 10e6) < 60'000);
  assert_int_equal(found.behind_count, 0);
  // Of four that grow, with room for three, the last is the strongest.
  const std::vector<Echo> four = {{3e6, 60'000, 30'000},
                                  {6e6, 60'000, 50'000},
                                  {12e6, 60'000, 70'000},
                                  {20e6, 60'000, 100'000}};
  found = detect_echo(profile_of(heard(four, 1200, 20, 4, random)), many);
  assert_int_equal(found.behind_count, 2);
  assert_true(std::fabs(static_cast<double>(found.behind[0].range_um) - 6e6) < 60'000);
  assert_true(std::fabs(static_cast<double>(found.behind[1].range_um) - 20e6) < 60'000);
}

TEST(bins_out_of_range_are_not_heard) {
  Random random(7);
  const Echo ring{200'000, 200'000, 500'000};
  const Echo bottom{8e6, 100'000, 30'000};
  const auto bins = heard({ring, bottom}, 1000, 50, 3, random);
  assert_true(detect_echo(profile_of(bins), kConfig).range_um < 1'000'000);
  const EchoDetection blanked =
      detect_echo(profile_of(bins), EchoDetectorConfig{6554, 3'000'000, 100'000'000});
  assert_near(static_cast<double>(blanked.range_um), bottom.arrival_um(0.1), kBin_um);
  assert_false(detect_echo(profile_of(bins), EchoDetectorConfig{6554, 3'000'000, 7'000'000}).found);
  // The whole window before, behind, or too short to say anything.
  assert_false(
      detect_echo(profile_of(bins), EchoDetectorConfig{6554, 90'000'000, 100'000'000}).found);
  assert_false(detect_echo(profile_of(bins), EchoDetectorConfig{6554, 0, -5}).found);
  assert_false(detect_echo(profile_of(bins), EchoDetectorConfig{6554, 8'000'000, 8'100'000}).found);
}

TEST(nonsense_is_no_echo_and_stays_in_its_bounds) {
  assert_false(detect_echo(RangeProfile{}, kConfig).found);
  Random random(8);
  const std::vector<std::uint16_t> flat(1000, 65535);
  assert_false(detect_echo(profile_of(flat), kConfig).found);
  for (int i = 0; i < 3000; ++i) {
    std::vector<std::uint16_t> bins(static_cast<std::size_t>(random.between(1, 1300)));
    const auto bits = static_cast<unsigned>(random.between(48, 63));
    for (std::uint16_t& bin : bins) {
      bin = static_cast<std::uint16_t>(random.between(0, 20) == 0 ? random.next() >> 48U
                                                                  : random.next() >> bits);
    }
    const EchoDetectorConfig config{static_cast<std::uint16_t>(random.next()),
                                    random.between(-1'000'000, 20'000'000),
                                    random.between(0, 40'000'000)};
    const EchoDetection found = detect_echo(profile_of(bins), config);
    if (found.found) {
      assert_true(found.range_um >= config.min_range_um - kBin_um);
      assert_true(found.range_um <= config.max_range_um + kBin_um);
      assert_true(found.quality >= 1);
    } else {
      assert_int_equal(found.quality, 0);
    }
  }
}

}  // namespace
