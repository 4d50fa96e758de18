// The line that a terminal shows of a link, rewritten in place. Nothing where standard error is no terminal.
#pragma once

#include <string>

#include "host_tools/topside/receiver.hpp"

namespace leadline::host {

class LiveLine {
 public:
  LiveLine();
  ~LiveLine() { wipe(); }
  LiveLine(const LiveLine&) = delete;
  LiveLine& operator=(const LiveLine&) = delete;

  void show(const std::string& text);
  /// Before anything else is written there.
  void wipe();

 private:
  bool enabled_;
  bool drawn_ = false;
};

/// Map, rate, work and alarms in one line.
[[nodiscard]] std::string live_text(const Receiver& receiver, double bytes_per_s);

}  // namespace leadline::host
