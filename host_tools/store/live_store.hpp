// A store beside a map that grows: resumed when the map begins, saved as it goes, said when it is behind. For commands
// that watch a link (receive, monitor).
#pragma once

#include <functional>
#include <string>

#include "host_tools/store/survey_store.hpp"

namespace leadline::host {

class LiveStore {
 public:
  /// `say` takes lines for the user. Throws as StoreKeeper does.
  LiveStore(const std::string& path, std::function<void(const std::string&)> say);

  /// A map begins: what the store has of it comes back. A store that cannot be read is said, and left as it is.
  /// `meanwhile` is called time and again: the link goes on.
  void begin(TileStore* map, const std::function<void()>& meanwhile = {});
  /// A map ended that another one replaces.
  void end(const TileStore& ended);
  /// Saves once a second: what a power cut can cost.
  void follow(const TileStore& map, double now_s);
  /// Everything that the map has, now. A store that fails is said once, and tried again.
  void keep(const TileStore& map);
  /// Throws HostError kOutput where something is missing in the store.
  void require_whole() const;

 private:
  void keep(const TileStore& map, int patience_ms);

  StoreKeeper keeper_;
  std::function<void(const std::string&)> say_;
  bool works_ = true;
  std::string unusable_;  ///< why nothing of this map is kept
  bool lost_ = false;     ///< a map ended that is not whole in the store
  double kept_s_ = 0.0;
};

}  // namespace leadline::host
