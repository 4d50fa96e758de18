#include "estimator/utc_clock.hpp"

#include "estimator/wide.hpp"
#include "model/base/fixed.hpp"

namespace leadline::estimator {
namespace {

using base::TimeUs;

constexpr std::int64_t kSecond_us = 1'000'000;
constexpr int kOthersAgree = 4;
constexpr TimeUs kLatest_us = std::int64_t{1} << 60U;

TimeUs abs_of(TimeUs value_us) { return value_us < 0 ? -value_us : value_us; }

/// Nearest whole seconds to a time that is not negative.
std::int64_t whole_seconds(TimeUs span_us) { return (span_us + kSecond_us / 2) / kSecond_us; }

/// Whether an edge lies whole seconds after another, 1 .. PulseGate::kMaxMissing_s of them.
bool on_the_beat(TimeUs from_us, TimeUs t_us) {
  const TimeUs span_us = t_us - from_us;
  if (span_us < kSecond_us / 2 || span_us > (PulseGate::kMaxMissing_s + 1) * kSecond_us) {
    return false;
  }
  const std::int64_t seconds = whole_seconds(span_us);
  const TimeUs off_us = span_us - seconds * kSecond_us;
  return abs_of(off_us) <= seconds * PulseGate::kTolerance_ppm * kSecond_us / 1'000'000;
}

}  // namespace

bool PulseGate::take(TimeUs t_us) {
  if (beating_ && on_the_beat(last_us_, t_us)) {
    last_us_ = t_us;
    candidates_ = 0;
    return true;
  }
  const bool agrees = candidates_ > 0 && on_the_beat(candidate_us_, t_us);
  candidates_ = agrees ? candidates_ + 1 : 1;
  candidate_us_ = t_us;
  const bool old_silent = !beating_ || t_us - last_us_ > kAgree * kSecond_us;
  if (candidates_ < kAgree || !old_silent) {
    return false;
  }
  moved_ = true;
  beating_ = true;
  last_us_ = t_us;
  candidates_ = 0;
  return true;
}

bool PulseGate::moved() {
  const bool was = moved_;
  moved_ = false;
  return was;
}

bool UtcClock::add_pulse(TimeUs t_us) {
  if (t_us < -kLatest_us || t_us > kLatest_us || !gate_.take(t_us)) {
    ++counters_.pulses_refused;
    return false;
  }
  ++counters_.pulses;
  const TimeUs span_us = t_us - pulse_us_;
  const std::int64_t seconds = whole_seconds(span_us);
  // The pulses of a beat that was found again are those of the old one, unless they fall elsewhere.
  if (gate_.moved() && named_) {
    const TimeUs drift_us = mul_div(span_us, PulseGate::kTolerance_ppm, 1'000'000);
    if (span_us <= 0 || drift_us > kSecond_us / 4 ||
        abs_of(span_us - seconds * kSecond_us) > drift_us) {
      named_ = false;
      start_over();
    }
  }
  pulse_us_ = t_us;
  pulse_utc_us_ += seconds * kSecond_us;
  waiting_ = true;
  return true;
}

void UtcClock::start_over() {
  ++counters_.restarts;
  others_ = 0;
  named_in_a_row_ = 0;
  clock_.restart();
}

ClockReading UtcClock::at(TimeUs utc_us) const {
  ClockReading reading = clock_.at(utc_us);
  reading.sure = reading.sure && sure();
  return reading;
}

bool UtcClock::label_holds(TimeUs label_us) {
  if (!named_) {
    return true;
  }
  const TimeUs offset_us = label_us - pulse_utc_us_;
  if (offset_us == 0) {
    others_ = 0;
    return true;
  }
  ++counters_.mislabelled;
  others_ = others_ > 0 && offset_us == other_offset_us_ ? others_ + 1 : 1;
  other_offset_us_ = offset_us;
  if (others_ < kOthersAgree) {
    return false;
  }
  start_over();
  return true;
}

bool UtcClock::add_utc(TimeUs utc_us, TimeUs t_arrival_us) {
  if (utc_us < kFirstUtc_us || utc_us > kLatest_us || t_arrival_us < -kLatest_us ||
      t_arrival_us > kLatest_us) {
    return false;
  }
  const TimeUs elapsed_us = t_arrival_us - pulse_us_;
  if (!waiting_ || elapsed_us < 0 || elapsed_us >= kSecond_us) {
    ++counters_.unpaired;
    return false;
  }
  waiting_ = false;
  // The message is late by less than a second: the pulse is the first whole second from here on.
  const TimeUs from_us = utc_us - elapsed_us;
  const TimeUs label_us = (from_us + kSecond_us - 1) / kSecond_us * kSecond_us;
  if (!label_holds(label_us)) {
    return false;
  }
  named_ = true;
  pulse_utc_us_ = label_us;
  ++counters_.messages;
  named_in_a_row_ = base::min_of(named_in_a_row_ + 1, kSurePulses);
  (void)clock_.add(label_us, pulse_us_);
  return true;
}

UtcReading UtcClock::utc_at(TimeUs t_us) const {
  if (!named_ || t_us < -kLatest_us || t_us > kLatest_us) {
    return {0, 0, false};
  }
  // at() is a line of slope 1 within 500 ppm: one step from a guess is off by 500 ppm of the step before,
  // the second by less than a microsecond for any instant that it is sure of.
  TimeUs utc_us = pulse_utc_us_ + (t_us - pulse_us_);
  ClockReading reading = at(utc_us);
  utc_us += t_us - reading.t_us;
  reading = at(utc_us);
  utc_us += t_us - reading.t_us;
  return {utc_us, reading.error_us, reading.sure};
}

void PingSync::add(TimeUs t_us) {
  const std::size_t newest = (next_ + kEdges - 1) % kEdges;
  if (count_ > 0 && t_us < edges_us_[newest]) {
    return;
  }
  edges_us_[next_] = t_us;
  next_ = (next_ + 1) % kEdges;
  count_ = base::min_of<std::size_t>(count_ + 1, kEdges);
}

bool PingSync::edge_of(TimeUs t_us, TimeUs& edge_us) const {
  for (std::size_t back = 1; back <= count_; ++back) {
    const TimeUs candidate_us = edges_us_[(next_ + kEdges - back) % kEdges];
    if (candidate_us <= t_us + kEarly_us) {
      edge_us = candidate_us;
      return candidate_us >= t_us - kLate_us;
    }
  }
  return false;
}

}  // namespace leadline::estimator
