// Pulses and the messages that name them; edges that are none; a head's own edges.
#include <cstdio>
#include <cstdlib>

#include "estimator/utc_clock.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::estimator::PingSync;
using leadline::estimator::PulseGate;
using leadline::estimator::UtcClock;
using leadline::estimator::UtcReading;
using leadline::test::Random;

constexpr TimeUs kDay_us = 1'795'305'600'000'000;

/// A receiver of which the vehicle's clock runs `ppm` fast, with an interrupt's jitter.
struct Receiver {
  double ppm = 200;
  TimeUs begin_us = 40'000'123;
  TimeUs jitter_us = 40;
  TimeUs latency_us = 300'000;
  TimeUs label_us = 0;  ///< the messages are wrong by this

  [[nodiscard]] TimeUs edge(TimeUs second) const {
    return begin_us + static_cast<TimeUs>(static_cast<double>(second) * (1e6 + ppm));
  }
  /// Seconds [from, to): pulse, then message.
  void run(UtcClock& clock, TimeUs from, TimeUs to, Random& random, bool pulses = true,
           bool messages = true) const {
    for (TimeUs second = from; second < to; ++second) {
      const TimeUs at = edge(second);
      if (pulses) {
        (void)clock.add_pulse(at + random.between(0, jitter_us));
      }
      if (messages) {
        (void)clock.add_utc(kDay_us + second * 1'000'000 + label_us, at + latency_us);
      }
    }
  }
  /// Error of UTC at second + 0.5.
  [[nodiscard]] TimeUs error(const UtcClock& clock, TimeUs second) const {
    const auto t = edge(second) + static_cast<TimeUs>(0.5 * (1e6 + ppm));
    return clock.utc_at(t).utc_us - (kDay_us + second * 1'000'000 + 500'000);
  }
};

TEST(utc_holds_within_the_stated_error_at_500_ppm_and_less) {
  for (const double ppm : {-499.0, -200.0, 0.0, 20.0, 499.0}) {
    Receiver receiver;
    receiver.ppm = ppm;
    receiver.jitter_us = 0;
    Random random(1);
    UtcClock clock;
    receiver.run(clock, 0, 60, random);
    assert_true(clock.sure());
    assert_near(clock.drift_ppb(), ppm * 1000, 2'000);
    assert_true(std::llabs(receiver.error(clock, 60)) <= 4);
    assert_int_equal(clock.counters().pulses_refused, PulseGate::kAgree - 1);
  }
  Receiver receiver;
  Random random(2);
  UtcClock clock;
  TimeUs worst_us = 0;
  TimeUs stated_us = 0;
  for (TimeUs second = 0; second < 600; ++second) {
    receiver.run(clock, second, second + 1, random);
    if (clock.sure()) {
      const UtcReading reading = clock.utc_at(receiver.edge(second));
      assert_true(reading.sure);
      worst_us = std::max<TimeUs>(worst_us, std::llabs(receiver.error(clock, second)));
      stated_us = std::max(stated_us, reading.error_us);
      assert_true(std::llabs(receiver.error(clock, second)) <= reading.error_us);
    }
  }
  std::printf("pulses with 40 us of jitter, 200 ppm: worst %lld us, stated <= %lld us\n",
              static_cast<long long>(worst_us), static_cast<long long>(stated_us));
  assert_true(worst_us < 40 && stated_us < 100);
  // And back: the vehicle's time of an instant of UTC.
  const TimeUs t = receiver.edge(599);
  assert_true(std::llabs(clock.at(kDay_us + 599'000'000).t_us - t) <= 40);
}

TEST(the_message_names_the_pulse_in_front_of_it_however_late_and_whatever_instant_it_speaks_of) {
  for (const TimeUs latency : {TimeUs{5'000}, TimeUs{300'000}, TimeUs{950'000}}) {
    for (const TimeUs measured : {TimeUs{0}, TimeUs{200'000}, TimeUs{-200'000}}) {
      if (latency + measured < 0 || latency + measured >= 1'000'000) {
        continue;
      }
      UtcClock clock;
      for (TimeUs second = 0; second < 24; ++second) {
        const TimeUs edge = 7'000'000 + second * 1'000'000;
        (void)clock.add_pulse(edge);
        (void)clock.add_utc(kDay_us + second * 1'000'000 + measured, edge + measured + latency);
      }
      assert_true(clock.sure());
      assert_int_equal(clock.utc_at(31'000'000).utc_us, kDay_us + 24'000'000);
    }
  }
}

TEST(edges_off_the_beat_are_refused) {
  const Receiver receiver;
  Random random(3);
  UtcClock clock;
  receiver.run(clock, 0, 20, random);
  const auto before = clock.counters();
  // 500 ppm of a second are 500 us; the pulses themselves are 200 us early of a second.
  const TimeUs last = receiver.edge(19);
  assert_false(clock.add_pulse(last + 500'000));
  assert_false(clock.add_pulse(last + 999'400));
  assert_false(clock.add_pulse(last + 1'000'600));
  assert_false(clock.add_pulse(last - 1'000'000));
  assert_false(clock.add_pulse(last));
  assert_false(clock.add_pulse(INT64_MAX));
  assert_false(clock.add_pulse(INT64_MIN));
  assert_int_equal(clock.counters().pulses_refused, before.pulses_refused + 7);
  receiver.run(clock, 20, 40, random);
  assert_int_equal(clock.counters().pulses, before.pulses + 20);
  assert_int_equal(clock.counters().restarts, before.restarts);
  assert_true(std::llabs(receiver.error(clock, 40)) < 40);
  // A line that chatters all the time: each second twenty more edges.
  for (TimeUs second = 40; second < 100; ++second) {
    for (int i = 0; i < 20; ++i) {
      (void)clock.add_pulse(receiver.edge(second) - 990'000 + i * 49'000 + random.between(0, 900));
    }
    receiver.run(clock, second, second + 1, random);
  }
  assert_true(clock.sure());
  assert_true(std::llabs(receiver.error(clock, 100)) < 60);
  assert_int_equal(clock.counters().restarts, before.restarts);
}

TEST(missing_pulses_and_a_port_opened_again_keep_the_count_of_seconds) {
  const Receiver receiver;
  Random random(4);
  UtcClock clock;
  receiver.run(clock, 0, 20, random);
  receiver.run(clock, 20, 32, random, false, true);
  assert_int_equal(clock.counters().unpaired, 12 + 2);
  receiver.run(clock, 32, 50, random);
  assert_true(clock.sure());
  assert_true(std::llabs(receiver.error(clock, 50)) < 60);
  clock.restart_pulse();
  receiver.run(clock, 55, 75, random);
  assert_int_equal(clock.counters().restarts, 0);
  assert_int_equal(clock.counters().mislabelled, 0);
  assert_true(clock.sure());
  assert_true(std::llabs(receiver.error(clock, 75)) < 60);
}

TEST(a_beat_that_moved_and_seconds_that_are_named_anew_start_over_once) {
  Receiver receiver;
  Random random(5);
  UtcClock clock;
  receiver.run(clock, 0, 20, random);
  receiver.begin_us += 250'000;  // a receiver that ran free and found its time
  receiver.run(clock, 20, 60, random);
  assert_int_equal(clock.counters().restarts, 1);
  assert_true(clock.sure());
  assert_true(std::llabs(receiver.error(clock, 60)) < 60);
  receiver.label_us = 1'000'000;  // a leap second
  receiver.run(clock, 60, 63, random);
  assert_int_equal(clock.counters().restarts, 1);
  assert_true(std::llabs(receiver.error(clock, 63)) < 60);
  receiver.run(clock, 63, 100, random);
  assert_int_equal(clock.counters().restarts, 2);
  assert_int_equal(clock.counters().mislabelled, 4);
  assert_true(clock.sure());
  assert_near(receiver.error(clock, 100), 1'000'000, 60);
}

TEST(one_wrong_message_now_and_then_changes_nothing_and_a_time_of_day_names_nothing) {
  const Receiver receiver;
  Receiver liar;
  Random random(6);
  UtcClock clock;
  for (TimeUs second = 0; second < 100; second += 5) {
    receiver.run(clock, second, second + 4, random);
    liar.label_us = random.between(2, 9) * 1'000'000;
    liar.run(clock, second + 4, second + 5, random);
  }
  assert_int_equal(clock.counters().mislabelled, 20);
  assert_int_equal(clock.counters().restarts, 0);
  assert_true(std::llabs(receiver.error(clock, 100)) < 60);
  UtcClock none;
  for (TimeUs second = 0; second < 20; ++second) {
    (void)none.add_pulse(second * 1'000'000);
    assert_false(none.add_utc(second * 1'000'000, second * 1'000'000 + 1'000));
  }
  assert_false(none.sure());
  assert_false(none.utc_at(0).sure);
  assert_false(none.utc_at(INT64_MIN).sure);
}

TEST(a_ping_gets_the_newest_edge_that_it_can_be) {
  PingSync sync;
  TimeUs edge = 0;
  assert_false(sync.edge_of(0, edge));
  for (TimeUs t = 0; t < 20'000'000; t += 100'000) {
    sync.add(t);
    sync.add(t - 50'000);  // back in time: left
    for (const TimeUs late : {TimeUs{-10'000}, TimeUs{0}, TimeUs{37'000}, TimeUs{89'000}}) {
      assert_true(sync.edge_of(t + late, edge));
      assert_int_equal(edge, t);
    }
  }
  // The one before, while the ping waited for its pose.
  assert_true(sync.edge_of(19'840'000, edge));
  assert_int_equal(edge, 19'800'000);
  assert_true(sync.edge_of(19'900'000 + PingSync::kLate_us, edge));
  assert_false(sync.edge_of(19'900'001 + PingSync::kLate_us, edge));
  assert_false(sync.edge_of(1'000'000, edge));  // long forgotten
  sync.restart();
  assert_false(sync.edge_of(19'900'000, edge));
}

}  // namespace
