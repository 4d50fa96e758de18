#include "host_tools/topside/link_share.hpp"

#include <algorithm>
#include <cerrno>
#include <set>

#include <linux/sockios.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "host_tools/exit_codes.hpp"
#include "proto/coarse.hpp"
#include "proto/commands.hpp"
#include "proto/messages.hpp"

namespace leadline::host {
namespace {

bool may_go_up(const proto::FrameView& frame) {
  proto::MessageType type{};
  return proto::message_type(frame.payload, frame.payload_bytes, type) &&
         frame.payload_bytes <= proto::kMaxCommand_bytes &&
         (type == proto::MessageType::kCommand || type == proto::MessageType::kHelloRequest);
}

std::vector<std::uint8_t> framed(const std::uint8_t* payload, std::size_t payload_bytes) {
  std::vector<std::uint8_t> frame(proto::frame_bound_bytes(payload_bytes));
  frame.resize(proto::encode_frame(payload, payload_bytes, frame.data(), frame.size()).value());
  return frame;
}

void add_frame(const std::uint8_t* payload, std::size_t payload_bytes,
               std::vector<std::uint8_t>* bytes) {
  const std::vector<std::uint8_t> frame = framed(payload, payload_bytes);
  bytes->insert(bytes->end(), frame.begin(), frame.end());
}

/// What stands before the tiles: hello, and the last status with all that briefs have said since.
void add_greeting(const Receiver& heard, std::vector<std::uint8_t>* bytes) {
  std::uint8_t payload[proto::kMaxPayload_bytes];
  const auto hello = proto::encode_hello(heard.store()->hello(), payload, sizeof payload);
  if (hello.ok()) {
    add_frame(payload, hello.value(), bytes);
  }
  if (heard.status()) {
    const auto status = proto::encode_status(*heard.status(), payload, sizeof payload);
    if (status.ok()) {
      add_frame(payload, status.value(), bytes);
    }
  }
}

/// Coarse tiles of which something still shows, ascending.
std::set<std::uint32_t> coarse_tiles_of(const Receiver& heard) {
  std::set<std::uint32_t> ids;
  for (const std::uint32_t tile : heard.coarse().changed_since(0)) {
    ids.insert(proto::coarse_place(tile, heard.store()->hello().size_cells[1]).tile);
  }
  return ids;
}

/// What still shows of a coarse tile.
void add_coarse(const Receiver& heard, std::uint32_t coarse_id, std::vector<std::uint8_t>* bytes) {
  proto::CodedCell cells[proto::kTileArea_cells] = {};
  proto::CellMask known{};
  for (const std::uint32_t tile : heard.coarse().changed_since(0)) {
    const proto::CoarsePlace place =
        proto::coarse_place(tile, heard.store()->hello().size_cells[1]);
    for (int index = 0; index < proto::kCoarseOfTile_cells && place.tile == coarse_id; ++index) {
      const proto::CodedCell cell = (*heard.coarse().tile(tile))[static_cast<std::size_t>(index)];
      if (proto::cell_known(cell)) {
        cells[place.cell(index)] = cell;
        known.set(place.cell(index));
      }
    }
  }
  std::uint8_t payload[proto::kMaxPayload_bytes];
  proto::TilePacketEncoder packet(payload, sizeof payload, heard.store()->tag(),
                                  proto::TileScale::kCoarse);
  proto::CellMask taken{};
  if (packet.add_whole({coarse_id, 0, cells, known}, taken).ok()) {
    add_frame(payload, packet.finish(), bytes);
  }
}

proto::CellMask all_cells() {
  proto::CellMask all{};
  std::fill(std::begin(all.rows), std::end(all.rows), UINT16_MAX);
  return all;
}

}  // namespace

struct LinkShare::Guest {
  explicit Guest(int connection) : fd(connection) {}
  ~Guest() { ::close(fd); }
  Guest(const Guest&) = delete;
  Guest& operator=(const Guest&) = delete;

  int fd;
  proto::FrameDecoderBuffer<> frames;
  bool greeted = false;
  std::uint16_t tag = 0;                ///< of the map that he was greeted with
  std::set<std::uint32_t> coarse_owed;  ///< coarse tiles to come before them
  std::vector<std::uint32_t> owed;      ///< tiles to come, the next one last
  std::set<std::uint32_t> unfinished;   ///< were handed out with something missing

  /// Of those, the ones that are whole now.
  void owe_finished(const TileStore& map) {
    for (auto each = unfinished.begin(); each != unfinished.end();) {
      const std::optional<TileView> tile = map.tile(*each);
      if (tile && !tile->complete) {
        ++each;
      } else {
        owed.push_back(*each);
        each = unfinished.erase(each);
      }
    }
  }
};

LinkShare::LinkShare(const std::string& path) {
  const std::string problem = listener_.listen(path);
  if (!problem.empty()) {
    throw HostError(ExitCode::kOutput, "--share: " + problem);
  }
}

LinkShare::~LinkShare() = default;

void LinkShare::give(const std::uint8_t* data, std::size_t size_bytes) {
  for (auto& guest : guests_) {
    // A part would tear a frame, and the rest would need room here.
    if (guest &&
        ::send(guest->fd, data, size_bytes, MSG_NOSIGNAL) != static_cast<ssize_t>(size_bytes)) {
      counters_.cut_off += errno == EPIPE || errno == ECONNRESET ? 0U : 1U;
      guest.reset();
    }
  }
}

void LinkShare::serve(const std::function<bool(const std::vector<std::uint8_t>&)>& send,
                      const Receiver& heard) {
  let_in();
  for (auto& guest : guests_) {
    if (guest && !listen_to(guest.get(), send)) {
      guest.reset();
    }
    if (guest && heard.store() != nullptr) {
      hand_out(guest.get(), heard);
    }
  }
}

void LinkShare::let_in() {
  for (int fd = listener_.accept(); fd >= 0; fd = listener_.accept()) {
    auto* const seat = std::find(guests_.begin(), guests_.end(), nullptr);
    if (seat == guests_.end()) {
      ::close(fd);
      counters_.refused += 1;
    } else {
      *seat = std::make_unique<Guest>(fd);
      counters_.joined += 1;
    }
  }
}

bool LinkShare::listen_to(Guest* guest,
                          const std::function<bool(const std::vector<std::uint8_t>&)>& send) {
  std::array<std::uint8_t, kRound_bytes> bytes{};
  const ssize_t got = ::recv(guest->fd, bytes.data(), bytes.size(), 0);
  if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) {
    return false;
  }
  const std::uint8_t* data = bytes.data();
  for (auto left = static_cast<std::size_t>(std::max<ssize_t>(got, 0)); left > 0;) {
    std::size_t used = 0;
    proto::FrameView frame{};
    if (guest->frames.decoder().feed(data, left, used, frame)) {
      pass_on(frame, send);
    }
    data += used;
    left -= used;
  }
  return true;
}

void LinkShare::hand_out(Guest* guest, const Receiver& heard) {
  int unread_bytes = 0;
  if (::ioctl(guest->fd, SIOCOUTQ, &unread_bytes) != 0 ||
      static_cast<std::size_t>(unread_bytes) >= kHandOut_bytes) {
    return;
  }
  const TileStore& map = *heard.store();
  std::vector<std::uint8_t> bytes;
  if (!guest->greeted || guest->tag != map.tag()) {
    guest->greeted = true;
    guest->tag = map.tag();
    guest->owed = map.changed_since(0);
    std::reverse(guest->owed.begin(), guest->owed.end());
    guest->unfinished.clear();
    guest->coarse_owed = coarse_tiles_of(heard);
    add_greeting(heard, &bytes);
  }
  while (!guest->coarse_owed.empty() && bytes.size() < kHandOut_bytes) {
    add_coarse(heard, *guest->coarse_owed.begin(), &bytes);
    guest->coarse_owed.erase(guest->coarse_owed.begin());
  }
  std::uint8_t payload[proto::kMaxPayload_bytes];
  guest->owe_finished(map);
  while (!guest->owed.empty() && bytes.size() < kHandOut_bytes) {
    proto::TilePacketEncoder packet(payload, sizeof payload, map.tag());
    while (!guest->owed.empty() && add_next_tile(guest, map, &packet)) {
    }
    const std::size_t size_bytes = packet.finish();
    if (size_bytes > 0) {
      add_frame(payload, size_bytes, &bytes);
    }
  }
  if (!bytes.empty() && ::send(guest->fd, bytes.data(), bytes.size(), MSG_NOSIGNAL) !=
                            static_cast<ssize_t>(bytes.size())) {
    ::shutdown(guest->fd, SHUT_RDWR);  // the next look at him finds the end
  }
}

// Whole, unknown cells as well: what he has heard of it in another order gives way. False: there is no room for it.
bool LinkShare::add_next_tile(Guest* guest, const TileStore& map,
                              proto::TilePacketEncoder* packet) {
  const std::uint32_t id = guest->owed.back();
  const std::optional<TileView> tile = map.tile(id);
  if (tile) {
    proto::CodedCell cells[proto::kTileArea_cells];
    std::copy_n(tile->cells, proto::kTileArea_cells, cells);
    proto::CellMask told = all_cells();
    std::uint32_t generation = tile->generation;
    if (!tile->complete) {
      // The vehicle's own next word is to count, with its hash: ours is of what we have. And he is to know that it
      // is not whole, by a hash that one cell which we do not know makes wrong: coarse cells stand in for such.
      generation -= 1;
      const auto* const unknown =
          std::find(std::begin(cells), std::end(cells), proto::kUnknownCell);
      if (unknown != std::end(cells)) {
        const auto cell = static_cast<int>(unknown - std::begin(cells));
        cells[cell] = proto::code_cell(0, 0, 0);
        told.rows[cell / proto::kTileSide_cells] ^=
            static_cast<std::uint16_t>(1U << static_cast<unsigned>(cell % proto::kTileSide_cells));
      }
    }
    proto::CellMask taken{};
    const auto added = packet->add_whole({id, generation, cells, told}, taken);
    if (!added.ok()) {
      return false;
    }
    counters_.handed_tiles += 1;
    if (!tile->complete) {
      guest->unfinished.insert(id);
    }
  }
  guest->owed.pop_back();
  return true;
}

void LinkShare::pass_on(const proto::FrameView& frame,
                        const std::function<bool(const std::vector<std::uint8_t>&)>& send) {
  if (!may_go_up(frame)) {
    counters_.withheld += 1;
    return;
  }
  counters_.forwarded += send(framed(frame.payload, frame.payload_bytes)) ? 1U : 0U;
}

}  // namespace leadline::host
