// What a topside says to a vehicle of minor 1, and when: which frames came, where the two maps differ, what
// never came. Paced by what came down, so that the way up stays a small part of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <set>
#include <vector>

#include "host_tools/topside/tile_store.hpp"
#include "model/base/units.hpp"
#include "proto/messages.hpp"

namespace leadline::host {

class UplinkPlanner {
 public:
  /// Another map begins: what was heard stays to be reported, what was wanted is forgotten.
  void restart();

  /// A whole frame of the downlink came, `wire_bytes` long.
  void note_bytes(std::size_t wire_bytes);
  /// It was one of cells: its number is to be reported.
  void note_cells(std::uint32_t number, std::size_t wire_bytes);
  /// The vehicle waits for a report.
  void note_question(const proto::Question& question);
  /// The vehicle's hashes beside those of `store`: remembers where they differ.
  void note_digest(const proto::Digest& digest, const TileStore& store);
  /// The topside looks at these tiles: said now and again.
  void look(std::uint32_t tile, std::uint8_t radius_tiles);

  /// The next payload to send at `now_us` (any clock that does not go back); empty: none now. To be asked
  /// until it is empty, at least every kUplinkPoll_us (receiver.hpp).
  [[nodiscard]] std::vector<std::uint8_t> next(base::TimeUs now_us, const TileStore& store,
                                               const std::optional<proto::Status>& status);

  /// Payload bytes so far, and what frames add to them.
  [[nodiscard]] std::uint64_t sent_bytes() const { return sent_bytes_; }
  /// Whether the last hash over everything was this map's own.
  [[nodiscard]] bool agreed() const { return agreed_; }

 private:
  struct Heard {
    std::uint32_t number;
    int reports_left;
  };

  [[nodiscard]] std::vector<std::uint8_t> paid(const std::uint8_t* payload,
                                               const base::Result<std::size_t>& size,
                                               double debt_bytes);
  void earn(base::TimeUs now_us, const TileStore& store, bool unfinished);
  [[nodiscard]] double sent_of_came() const;
  [[nodiscard]] std::vector<std::uint8_t> report(base::TimeUs now_us, const TileStore& store,
                                                 bool unfinished);
  [[nodiscard]] std::vector<std::uint8_t> wanted_tiles(const TileStore& store);
  [[nodiscard]] std::vector<std::uint8_t> finer_digest(base::TimeUs now_us, const TileStore& store);
  [[nodiscard]] std::vector<std::uint8_t> unseen_tiles(base::TimeUs now_us, const TileStore& store,
                                                       const std::optional<proto::Status>& status);
  [[nodiscard]] std::vector<std::uint8_t> look_again(base::TimeUs now_us, const TileStore& store);

  std::deque<Heard> heard_;             ///< as they came
  std::uint32_t newest_ = 0;            ///< of heard_
  std::optional<std::uint16_t> asked_;  ///< by the vehicle since the last report: its newest number
  int news_since_report_ = 0;           ///< frames that carried map
  bool joined_ = false;                 ///< the vehicle has been told that somebody listens
  base::TimeUs begun_us_ = 0;           ///< of the map
  std::uint64_t sent_bytes_ = 0;
  // Rhythm of what comes, to know when it pauses.
  std::size_t news_count_ = 0;
  std::size_t news_seen_ = 0;
  base::TimeUs news_us_ = 0;
  base::TimeUs news_gap_us_ = 0;
  base::TimeUs reported_us_ = 0;
  std::set<std::uint32_t> wanted_;
  std::deque<proto::TileRange> differing_;  ///< to be looked at more closely
  base::TimeUs asked_digest_us_ = 0;
  int digest_tries_ = 0;
  std::uint32_t known_tiles_ = 0;
  base::TimeUs ask_unseen_us_ = 0;
  base::TimeUs ask_gap_us_ = 0;
  std::optional<proto::Look> look_;
  base::TimeUs look_us_ = 0;
  double payable_bytes_ = 18.0;
  double credit_bytes_ = 18.0;  ///< of these, not yet paid back
  base::TimeUs earned_us_ = 0;
  bool agreed_ = false;
};

}  // namespace leadline::host
