// A link that one program holds, lent to others of this user: what comes down goes to all of them, and what they send
// goes up if it is a command (which the vehicle checks by its key) or asks who is there. Nothing else gets through: what
// a guest has missed comes from the map that the program has, in frames like the vehicle's, and costs the link nothing.
// The other end is a port unix:PATH (hal/linux/uri.hpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hal/linux/local_socket.hpp"
#include "host_tools/topside/receiver.hpp"
#include "proto/framing.hpp"

namespace leadline::host {

/// Never decremented.
struct LinkShareCounters {
  std::uint64_t joined = 0;
  std::uint64_t refused = 0;       ///< too many at a time
  std::uint64_t forwarded = 0;     ///< frames that the link took
  std::uint64_t withheld = 0;      ///< frames that are nothing to forward
  std::uint64_t cut_off = 0;       ///< did not read what came down
  std::uint64_t handed_tiles = 0;  ///< of the map, to guests that came later
};

class LinkShare {
 public:
  static constexpr std::size_t kMostGuests = 4;
  /// Bytes of one guest that are looked at in a round.
  static constexpr std::size_t kRound_bytes = 4096;
  /// Of the map, to one guest in a round; none while he has as much to read.
  static constexpr std::size_t kHandOut_bytes = 16384;

  /// Listens at `path`, which only this user reaches. Throws HostError kOutput.
  explicit LinkShare(const std::string& path);
  ~LinkShare();
  LinkShare(const LinkShare&) = delete;
  LinkShare& operator=(const LinkShare&) = delete;

  /// What came down. Who does not read it is cut off: nobody waits for a guest.
  void give(const std::uint8_t* data, std::size_t size_bytes);
  /// Lets guests in and passes on what they send, frame by frame; `send` returns false where it has no room, and the
  /// frame is lost, as on any link. `heard`: what has come so far, all of which was given before. Whoever has not heard
  /// its map gets hello, last status, coarse cells that still show and tiles, those that changed last first, at the pace at
  /// which he reads; a tile of which something is missing once more when it is whole. Once a round.
  void serve(const std::function<bool(const std::vector<std::uint8_t>&)>& send,
             const Receiver& heard);

  [[nodiscard]] const LinkShareCounters& counters() const { return counters_; }

 private:
  struct Guest;
  void let_in();
  /// False: the guest is gone.
  bool listen_to(Guest* guest, const std::function<bool(const std::vector<std::uint8_t>&)>& send);
  void hand_out(Guest* guest, const Receiver& heard);
  bool add_next_tile(Guest* guest, const TileStore& map, proto::TilePacketEncoder* packet);
  void pass_on(const proto::FrameView& frame,
               const std::function<bool(const std::vector<std::uint8_t>&)>& send);

  hal::LocalListener listener_;
  std::array<std::unique_ptr<Guest>, kMostGuests> guests_;
  LinkShareCounters counters_;
};

}  // namespace leadline::host
