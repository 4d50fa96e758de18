#include "host_tools/topside/silence_watch.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace leadline::host {

std::optional<ReceiverNotice> SilenceWatch::follow(bool heard, double now_s) {
  const double silent_s = this->silent_s(now_s);
  const std::string seconds = std::to_string(std::lround(silent_s)) + " s";
  if (heard) {
    heard_s_ = now_s;
    if (said_) {
      said_ = false;
      patience_s_ = std::clamp(2.0 * silent_s, kSilence_s, kLongest_s);
      return ReceiverNotice{proto::Severity::kInfo, "heard again, after " + seconds};
    }
  } else if (!said_ && silent_s >= patience_s_) {
    said_ = true;
    return ReceiverNotice{proto::Severity::kWarning, "nothing heard for " + seconds};
  }
  return std::nullopt;
}

}  // namespace leadline::host
