// A recording of a link (a vehicle's log, or the bytes of a link as they came) on a clock that can be moved.
//
// The file is read once for an index: where the downlink's frames of each moment stand. Going back means
// beginning again with an empty map: what the map was at a time is told only by all that came before.
#pragma once

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "host_tools/monitor/page_messages.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

class Player {
 public:
  /// Reads the index. `speed` > 0: plays from the beginning; 0: stands at the end. Throws HostError kInput: the file
  /// cannot be read, or holds no frame of a downlink.
  Player(const std::string& path, double speed);

  /// Where what is played goes.
  struct Sink {
    std::function<void()> restart;  ///< forget everything: what comes next is from the beginning
    std::function<void(const std::uint8_t* data, std::size_t size_bytes, base::TimeUs t_us)> feed;
  };
  /// Moves the clock to `now_s` (any clock that does not go back) and feeds what became due, at most about
  /// kStep_bytes: then seeking() is true, and the next call goes on.
  void step(double now_s, const Sink& sink);
  void take(const PageRequest& request);

  [[nodiscard]] base::TimeUs begin_us() const { return begin_us_; }
  [[nodiscard]] double length_s() const;
  /// Of the clock, since the recording's first moment.
  [[nodiscard]] double position_s() const { return position_s_; }
  [[nodiscard]] bool playing() const { return playing_; }
  [[nodiscard]] double speed() const { return speed_; }
  /// What was fed is not yet what belongs to the clock.
  [[nodiscard]] bool seeking() const { return behind_; }

 private:
  static constexpr std::size_t kStep_bytes = 256 * 1024;
  static constexpr std::uint32_t kMaxPiece_bytes = 64 * 1024;
  /// Frames that stand together and are of one moment.
  struct Piece {
    base::TimeUs t_us;
    std::uint64_t offset;
    std::uint32_t size_bytes;
  };
  class Indexer;

  std::string path_;
  std::ifstream file_;
  std::vector<Piece> pieces_;
  base::TimeUs begin_us_ = 0;
  std::vector<char> buffer_;

  bool playing_ = false;
  double speed_ = 1.0;
  double position_s_ = 0.0;
  std::size_t next_ = 0;  ///< piece
  double fed_s_ = 0.0;
  bool restart_ = false;
  bool behind_ = true;
  double last_s_ = -1.0;
};

}  // namespace leadline::host
