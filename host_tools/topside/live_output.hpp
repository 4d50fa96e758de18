// The folder that maps of a watched link go to: the one that is growing, and those that another one replaced. What cannot
// be written is said, and a link is watched on. For commands that watch a link (receive, monitor).
#pragma once

#include <functional>
#include <string>

#include "host_tools/topside/tile_store.hpp"

namespace leadline::host {

class LiveOutput {
 public:
  /// `directory`: made when needed; "": none, and nothing is ever written. `say` takes lines for the user. Throws HostError
  /// kOutput: nothing can be written there, known now and not when the dive is over.
  LiveOutput(std::string directory, std::function<void(const std::string&)> say);

  /// The map as it is: depth.asc, sigma.asc, depth.tif, depth.png, and `summary` as receive.json. A failure is said once
  /// until it is written again.
  void write(const TileStore& store, const std::string& summary);
  /// The same of a map that ended, into a folder of its own, survey-ID-session-NUMBER; none where nothing of it is known.
  void write_ended(const TileStore& ended, const std::string& summary);
  /// Throws HostError kOutput where the last write() failed, or one of a map that ended.
  void require_whole() const;

 private:
  std::string directory_;
  std::function<void(const std::string&)> say_;
  std::string problem_;  ///< of the last write(); "": it was written
  std::string lost_;     ///< of a map that ended
};

}  // namespace leadline::host
