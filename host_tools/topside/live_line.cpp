#include "host_tools/topside/live_line.hpp"

#include <iostream>

#include <unistd.h>

#include "host_tools/text.hpp"

namespace leadline::host {

LiveLine::LiveLine() : enabled_(isatty(STDERR_FILENO) == 1) {}

void LiveLine::show(const std::string& text) {
  if (!enabled_) {
    return;
  }
  std::cerr << "\r\033[K" << text << std::flush;
  drawn_ = true;
}

void LiveLine::wipe() {
  if (drawn_) {
    std::cerr << "\r\033[K" << std::flush;
  }
  drawn_ = false;
}

std::string live_text(const Receiver& receiver, double bytes_per_s) {
  const TileStore* const store = receiver.store();
  if (store == nullptr) {
    return "waiting for a vehicle's hello, " + std::to_string(receiver.counters().bytes) + " bytes";
  }
  const double share =
      100.0 * static_cast<double>(store->known_cells()) / static_cast<double>(store->grid_cells());
  std::string line = std::to_string(store->known_cells()) + " cells (";
  append_fixed(&line, share, 0);
  line += " %), " + std::to_string(store->known_tiles()) + " tiles";
  if (receiver.coarse().tiles() > 0) {
    line += ", " + std::to_string(receiver.coarse().tiles()) + " more coarse so far";
  }
  if (receiver.status()) {
    line += ", " + std::to_string(receiver.status()->pings[proto::kPingFused]) + " pings";
  }
  line += ", ";
  append_fixed(&line, bytes_per_s, 0);
  line += " B/s, ";
  append_fixed(&line, receiver.bytes_per_changed_cell(), 2);
  line += " B/cell";
  if (const auto work = receiver.work_share()) {
    line += ", work ";
    append_fixed(&line, 100.0 * *work, 1);
    line += " %";
  }
  const std::string alarms = receiver.status() ? alarm_text(receiver.status()->alarms) : "";
  return line + (alarms.empty() ? "" : " | " + alarms);
}

}  // namespace leadline::host
