// UTC against the vehicle's clock, from a pulse per second and the messages that name the seconds.
//
// A pulse says exactly when, a message says roughly which second: it comes less than a second after the pulse
// that it names (or, naming an instant in between, less than a second after that). Pairs of both go into a
// ClockSync, whose device is UTC and whose pairs are late by an interrupt's jitter only: it states what the
// result is good for.
//
// An edge counts when it lies whole seconds after the last one that did, within 500 ppm; others are refused.
// When the pulse moved (a receiver that found its time), three edges that agree with each other and a silence
// of the old beat are needed before the new one counts. A message that names another second than the count of
// pulses does is refused, until four in a row agree on another: a leap second, or a receiver that now has the
// date. Both start the clock anew.
//
// Integers, no heap, no clock of its own. The result depends on the sequence of calls alone.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/clock_sync.hpp"
#include "model/base/units.hpp"

namespace leadline::estimator {

/// Times of UTC below this are a time of day without a date, and name no second.
inline constexpr base::TimeUs kFirstUtc_us = 315'532'800'000'000;  // 1980

/// Never decremented; wraps at 2^32.
struct UtcClockCounters {
  std::uint32_t pulses;          ///< accepted
  std::uint32_t pulses_refused;  ///< not whole seconds, within 500 ppm, after the last
  std::uint32_t messages;        ///< that named the second of a pulse, each pulse once
  std::uint32_t
      unpaired;  ///< messages without a pulse in the second before, or with one named already
  std::uint32_t mislabelled;  ///< refused: another second than the pulses count
  std::uint32_t restarts;     ///< of the beat or of the seconds' names
};

/// The edges of a pulse per second: which of them are it.
class PulseGate {
 public:
  /// Most seconds without a pulse that the beat is kept over.
  static constexpr std::int64_t kMaxMissing_s = 30;
  static constexpr std::int64_t kTolerance_ppm = 500;
  static constexpr int kAgree = 3;

  void restart() {
    beating_ = false;
    candidates_ = 0;
  }
  /// True: the edge is a pulse, at `t_us`. O(1).
  [[nodiscard]] bool take(base::TimeUs t_us);
  /// A new beat has taken the place of the old one, since the last call.
  [[nodiscard]] bool moved();

 private:
  bool beating_ = false;
  base::TimeUs last_us_ = 0;       ///< newest pulse
  base::TimeUs candidate_us_ = 0;  ///< newest edge that was none
  int candidates_ = 0;             ///< edges in a row that agree with it
  bool moved_ = false;
};

/// A time of the day, and what it is good for.
struct UtcReading {
  base::TimeUs utc_us;    ///< since 1970
  base::TimeUs error_us;  ///< as ClockReading::error_us
  bool sure;              ///< false: neither counts
};

/// About 1 KiB.
class UtcClock {
 public:
  static constexpr int kSurePulses = 16;

  /// The pulse's port was opened again: what is known stays, the next pulse has to fit or to prove itself.
  void restart_pulse() {
    gate_.restart();
    waiting_ = false;
  }
  /// An edge. False: refused. O(1).
  bool add_pulse(base::TimeUs t_us);
  /// A message about the instant `utc_us`, since 1970. False: it names no pulse. O(1), once a second
  /// O(ClockSync::kBlocks).
  bool add_utc(base::TimeUs utc_us, base::TimeUs t_arrival_us);
  /// Vehicle time of an instant of UTC. O(1).
  [[nodiscard]] ClockReading at(base::TimeUs utc_us) const;
  /// UTC of an instant of the vehicle's clock. O(1).
  [[nodiscard]] UtcReading utc_at(base::TimeUs t_us) const;
  /// From kSurePulses named pulses on, where ClockSync is: with fewer its line may turn more than it states.
  [[nodiscard]] bool sure() const { return named_in_a_row_ >= kSurePulses && clock_.sure(); }
  /// Rate of vehicle time against UTC, less 1.
  [[nodiscard]] std::int64_t drift_ppb() const { return clock_.drift_ppb(); }
  [[nodiscard]] const UtcClockCounters& counters() const { return counters_; }

 private:
  void start_over();
  [[nodiscard]] bool label_holds(base::TimeUs label_us);

  PulseGate gate_;
  ClockSync clock_{ClockSyncConfig{20'000, 2'000, 1'000, 500}};
  base::TimeUs pulse_us_ = 0;         ///< newest
  base::TimeUs pulse_utc_us_ = 0;     ///< its second, counted from the one that was named last
  bool waiting_ = false;              ///< no message has named it yet
  bool named_ = false;                ///< pulse_utc_us_ counts
  int named_in_a_row_ = 0;            ///< since the clock began anew, up to kSurePulses
  base::TimeUs other_offset_us_ = 0;  ///< name less count, of messages refused
  int others_ = 0;                    ///< in a row that agree on it
  UtcClockCounters counters_{};
};

/// When a head said on a line that it transmits, for pings whose own time is made of the arrival of their
/// bytes.
class PingSync {
 public:
  static constexpr int kEdges = 64;
  /// A ping's own time is late by what its bytes were under way, and never early by more than `kEarly_us`.
  static constexpr base::TimeUs kEarly_us = 10'000;
  static constexpr base::TimeUs kLate_us = 500'000;

  void restart() { count_ = 0; }
  /// An edge; those that go back are left. O(1).
  void add(base::TimeUs t_us);
  /// The newest edge in [t_us - kLate_us, t_us + kEarly_us]. False: none. What is under way for longer than
  /// from one ping to the next gets the wrong one: state the latency. O(kEdges).
  [[nodiscard]] bool edge_of(base::TimeUs t_us, base::TimeUs& edge_us) const;

 private:
  std::array<base::TimeUs, kEdges> edges_us_{};
  std::size_t next_ = 0;
  std::size_t count_ = 0;
};

}  // namespace leadline::estimator
