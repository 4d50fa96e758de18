// When a link falls silent and when it is heard again, as lines for the user. No clock: the time comes in.
#pragma once

#include <optional>

#include "host_tools/topside/receiver.hpp"

namespace leadline::host {

class SilenceWatch {
 public:
  /// A slow link pauses for seconds.
  static constexpr double kSilence_s = 10.0;

  /// `heard`: something came since the last call; `now_s` by a clock that does not go back. What there is to say: after
  /// kSilence_s without a word, and when it is over. A link that pauses by habit is said less often: the next silence
  /// has to be twice as long, up to kLongest_s.
  std::optional<ReceiverNotice> follow(bool heard, double now_s);

  /// Since something was heard; negative: nothing ever was.
  [[nodiscard]] double silent_s(double now_s) const { return heard_s_ ? now_s - *heard_s_ : -1.0; }

 private:
  static constexpr double kLongest_s = 120.0;
  std::optional<double> heard_s_;
  double patience_s_ = kSilence_s;
  bool said_ = false;
};

}  // namespace leadline::host
