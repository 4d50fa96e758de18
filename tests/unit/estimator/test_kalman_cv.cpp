// The integer filter against the same filter in double, written from the matrix equations.
#include <cmath>

#include "estimator/kalman_cv.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::estimator::Fusion;
using leadline::estimator::KalmanConfig;
using leadline::estimator::KalmanCv;
using leadline::estimator::kMaxSigma;
using leadline::estimator::Measurement;
using leadline::estimator::sqrt_up;
using leadline::test::Random;

// Joseph form, matrices written out.
struct Oracle {
  double x, v, pxx, pxv, pvv, q;
  void predict(double dt) {
    x += v * dt;
    const double nxx = pxx + 2 * dt * pxv + dt * dt * pvv + q * dt * dt * dt / 3;
    const double nxv = pxv + dt * pvv + q * dt * dt / 2;
    pvv += q * dt;
    pxx = nxx;
    pxv = nxv;
  }
  void update(double z, double r, double age) {
    const double h0 = 1;
    const double h1 = -age;
    const double s =
        h0 * h0 * pxx + 2 * h0 * h1 * pxv + h1 * h1 * pvv + r + q * age * age * age / 3;
    const double k0 = (pxx * h0 + pxv * h1) / s;
    const double k1 = (pxv * h0 + pvv * h1) / s;
    const double y = z - (h0 * x + h1 * v);
    x += k0 * y;
    v += k1 * y;
    const double noise = s - (h0 * h0 * pxx + 2 * h0 * h1 * pxv + h1 * h1 * pvv);
    const double a = 1 - k0 * h0, b = -k0 * h1, c = -k1 * h0, d = 1 - k1 * h1;
    const double nxx = a * (a * pxx + b * pxv) + b * (a * pxv + b * pvv) + k0 * k0 * noise;
    const double nxv = a * (c * pxx + d * pxv) + b * (c * pxv + d * pvv) + k0 * k1 * noise;
    const double nvv = c * (c * pxx + d * pxv) + d * (c * pxv + d * pvv) + k1 * k1 * noise;
    pxx = nxx;
    pxv = nxv;
    pvv = nvv;
  }
};

TEST(integers_agree_with_double) {
  Random random(1);
  for (int run = 0; run < 50; ++run) {
    const std::int64_t acceleration = random.between(1'000, 2'000'000);
    const std::int64_t sigma = random.between(5'000, 3'000'000);
    KalmanCv filter(KalmanConfig{acceleration, 2'000'000, 0, false});
    filter.start(0, 1'000'000'000, sigma);
    const auto r = static_cast<double>(sigma) * static_cast<double>(sigma);
    Oracle oracle{1e9, 0,    r,
                  0,   4e12, static_cast<double>(acceleration) * static_cast<double>(acceleration)};
    TimeUs t = 0;
    for (int i = 0; i < 300; ++i) {
      const TimeUs dt = random.between(1, i % 50 == 49 ? 26'000'000 : 500'000);
      t += dt;
      filter.predict(t);
      oracle.predict(static_cast<double>(dt) * 1e-6);
      const auto z = static_cast<std::int64_t>(1e9 + 1.2 * static_cast<double>(t) +
                                               static_cast<double>(sigma) * random.normal());
      const TimeUs age = i % 7 == 0 ? random.between(0, 2'000'000) : 0;
      assert_int_equal(filter.update(Measurement{z, sigma, age}), Fusion::kFused);
      oracle.update(static_cast<double>(z), r, static_cast<double>(age) * 1e-6);
      // Time has 2^-20 s: over 26 s at 10 m/s that is 10 um; the rest is rounding.
      assert_near(filter.value(), oracle.x, 100.0 + 1e-4 * std::sqrt(oracle.pxx));
      assert_near(filter.rate(), oracle.v, 100.0 + 1e-3 * std::sqrt(oracle.pvv));
      assert_near(static_cast<double>(filter.variance()) / oracle.pxx, 1.0, 1e-3);
      assert_near(static_cast<double>(filter.rate_variance()) / oracle.pvv, 1.0, 1e-3);
      assert_near(filter.covariance(), oracle.pxv, 2e-3 * std::sqrt(oracle.pxx * oracle.pvv) + 2);
    }
  }
}

TEST(a_gap_grows_alike_in_one_step_and_in_many) {
  const KalmanConfig config{100'000, 500'000, 0, false};
  KalmanCv one(config);
  one.start(0, 0, 500'000);
  KalmanCv many = one;
  one.predict(26'000'000);
  for (TimeUs t = 20'000; t <= 26'000'000; t += 20'000) {
    many.predict(t);
  }
  assert_near(static_cast<double>(many.variance()) / static_cast<double>(one.variance()), 1.0,
              1e-3);
  assert_near(static_cast<double>(many.rate_variance()) / static_cast<double>(one.rate_variance()),
              1.0, 1e-3);
  // sigma^2 = 0.5^2 + (0.5 26)^2 + 0.1^2 26^3 / 3 m^2.
  assert_near(static_cast<double>(one.sigma()) * 1e-6,
              std::sqrt(0.25 + 169.0 + 0.01 * 26 * 26 * 26 / 3.0), 0.01);
}

TEST(growth_ends_and_the_covariance_stays_one) {
  KalmanCv filter(KalmanConfig{kMaxSigma, kMaxSigma, 0, false});
  filter.start(0, 0, kMaxSigma);
  TimeUs t = 0;
  Random random(2);
  for (int i = 0; i < 2000; ++i) {
    t += random.between(1, 4'000'000'000);
    filter.predict(t);
    if (i % 3 == 0) {
      static_cast<void>(
          filter.update(Measurement{random.between(-1'000'000'000'000, 1'000'000'000'000),
                                    random.between(0, kMaxSigma), random.between(0, 5'000'000)}));
    }
    if (i % 5 == 0) {
      static_cast<void>(filter.update_rate(random.between(-100'000'000, 100'000'000),
                                           random.between(1, 1'000'000)));
    }
    assert_true(filter.variance() >= 1 && filter.rate_variance() >= 1);
    assert_true(filter.variance() <= leadline::estimator::kMaxVariance);
    const double correlation = static_cast<double>(filter.covariance()) /
                               std::sqrt(static_cast<double>(filter.variance())) /
                               std::sqrt(static_cast<double>(filter.rate_variance()));
    assert_true(std::fabs(correlation) <= 1.001);
  }
}

TEST(innovations_beyond_the_gate_change_nothing_and_are_counted) {
  KalmanCv filter(KalmanConfig{10'000, 100'000, 4 * 256, false});
  assert_int_equal(filter.update(Measurement{5, 5, 0}), Fusion::kNotReady);
  assert_int_equal(filter.update_rate(5, 5), Fusion::kNotReady);
  filter.predict(100);  // nothing to predict
  filter.start(0, 0, 1'000);
  const std::int64_t variance = filter.variance();
  for (std::uint32_t i = 1; i <= 3; ++i) {
    // Innovation sigma sqrt(2) mm, gate 5.66 mm.
    assert_int_equal(filter.update(Measurement{6'000, 1'000, 0}), Fusion::kGated);
    assert_int_equal(filter.gated_in_a_row(), i);
    assert_int_equal(filter.innovation(), 6'000);
  }
  assert_int_equal(filter.update(Measurement{-6'000, 1'000, 0}), Fusion::kGated);
  assert_int_equal(filter.value(), 0);
  assert_int_equal(filter.variance(), variance);
  assert_int_equal(filter.update(Measurement{5'000, 1'000, 0}), Fusion::kFused);
  assert_int_equal(filter.gated_in_a_row(), 0);
  assert_int_equal(filter.value(), 2'500);
  filter.reset();
  assert_false(filter.started());
}

TEST(time_does_not_go_back) {
  KalmanCv filter(KalmanConfig{10'000, 100'000, 0, false});
  filter.start(1'000'000, 7, 1'000);
  filter.predict(500'000);
  assert_int_equal(filter.t_us(), 1'000'000);
  assert_int_equal(filter.value(), 7);
}

TEST(angles_wrap) {
  KalmanCv filter(KalmanConfig{1'000'000, 1'000'000, 0, true});
  const std::int64_t degree = 11'930'465;
  filter.start(0, 359 * degree, degree / 10);
  // 359, 0, 1, 2 ... degrees, one a second: rate and value go on through north.
  for (int i = 1; i <= 40; ++i) {
    filter.predict(1'000'000 * i);
    const auto bam = static_cast<std::uint32_t>((359 + i) * degree);
    assert_int_equal(filter.update(Measurement{bam, degree / 10, 0}), Fusion::kFused);
  }
  assert_near(filter.rate(), degree, 0.02 * degree);
  const auto value = static_cast<std::int32_t>(static_cast<std::uint32_t>(filter.value()) -
                                               static_cast<std::uint32_t>(399 * degree));
  assert_near(value, 0, 0.05 * degree);
}

TEST(roots_are_never_below) {
  Random random(3);
  assert_int_equal(sqrt_up(0), 0);
  assert_int_equal(sqrt_up(-5), 0);
  for (int i = 0; i < 100'000; ++i) {
    const auto value =
        static_cast<std::int64_t>(random.next() >> static_cast<unsigned>(random.between(1, 62)));
    const double root = std::sqrt(static_cast<double>(value));
    const auto found = static_cast<double>(sqrt_up(value));
    assert_true(found >= root && found <= root * (1 + 0x1.0p-12) + 2);
  }
}

}  // namespace
