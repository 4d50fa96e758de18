#include "host_tools/store/live_store.hpp"

#include <utility>

#include "host_tools/exit_codes.hpp"

namespace leadline::host {
namespace {

constexpr double kStoreEvery_s = 1.0;
// The link is read and the page served between two saves: neither waits for another program that writes.
constexpr int kLivePatience_ms = 50;

}  // namespace

LiveStore::LiveStore(const std::string& path, std::function<void(const std::string&)> say)
    : keeper_(path), say_(std::move(say)) {}

void LiveStore::begin(TileStore* map, const std::function<void()>& meanwhile) {
  unusable_.clear();
  StoreLoad load;
  try {
    load = keeper_.begin(map, meanwhile);
  } catch (const HostError& error) {
    // Written over, what it has of this map would be lost.
    unusable_ = error.what();
    say_("error: " + unusable_ + ". This map is not kept");
    return;
  }
  if (load.tiles > 0) {
    say_("resumed from " + keeper_.path() + ": " + std::to_string(load.tiles) + " tiles, " +
         std::to_string(map->known_cells()) + " cells known");
  }
  if (load.damaged_tiles > 0) {
    say_("warning: " + keeper_.path() + ": " + std::to_string(load.damaged_tiles) +
         " damaged tiles, to be asked for again");
  }
}

void LiveStore::end(const TileStore& ended) {
  keep(ended);
  lost_ = lost_ || !works_ || !unusable_.empty();
}

void LiveStore::follow(const TileStore& map, double now_s) {
  if (now_s - kept_s_ >= kStoreEvery_s) {
    kept_s_ = now_s;
    keep(map, kLivePatience_ms);
  }
}

void LiveStore::keep(const TileStore& map) { keep(map, SurveyStore::kPatience_ms); }

void LiveStore::keep(const TileStore& map, int patience_ms) {
  if (!unusable_.empty()) {
    return;
  }
  const bool kept = keeper_.save(map, patience_ms);
  if (!kept && works_) {
    say_("error: the store is behind: " + keeper_.problem());
  } else if (kept && !works_) {
    say_("the store has caught up");
  }
  works_ = kept;
}

void LiveStore::require_whole() const {
  if (!unusable_.empty()) {
    throw HostError(ExitCode::kOutput, unusable_);
  }
  if (!works_ || lost_) {
    throw HostError(ExitCode::kOutput, works_
                                           ? keeper_.path() + ": an earlier map is not whole in it"
                                           : keeper_.problem());
  }
}

}  // namespace leadline::host
