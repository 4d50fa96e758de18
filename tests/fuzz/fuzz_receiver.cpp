// The topside over any bytes of a link: no frame, message or order of them may break it, and what it holds
// stays consistent. Another major version is refused by an error, which is allowed. A page is sent the map as it is; the
// bytes as a recording, to its end, back and forward again, give one and the same map.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include <sys/mman.h>
#include <unistd.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/monitor/live_map.hpp"
#include "host_tools/monitor/page_messages.hpp"
#include "host_tools/monitor/page_state.hpp"
#include "host_tools/monitor/player.hpp"
#include "host_tools/topside/receiver.hpp"

namespace {

void check(bool good) {
  if (!good) {
    __builtin_trap();
  }
}

using namespace leadline::host;

// A larger grid costs the time of many others, and shows nothing else.
constexpr std::uint32_t kMostTiles = 4096;

void show(const Receiver& receiver) {
  LiveMap map;
  map.follow(*receiver.store(), 1'000'000, &receiver.coarse());
  PageState state;
  state.follow(receiver, 1.0);
  const std::string json = state.json(receiver, {}, 2.0);
  static const std::string palettes = palettes_json();
  Track track;
  PageCursor cursor;
  std::size_t tiles = 0;
  int messages = 0;
  while (const auto message =
             next_page_message({&palettes, &map, &track, 1, &json, true}, &cursor)) {
    const std::uint8_t kind = message->text ? 0 : message->bytes[0];
    const std::size_t bytes = message->bytes.size() - kTileHeader_bytes;
    tiles += kind == 1 ? bytes / kPageTile_bytes : 0;
    tiles += kind == 4 ? bytes / kCoarsePageTile_bytes : 0;
    messages += 1;
    check(messages < 10'000);
  }
  // A tile whose cells are all unknown may be there and need not be shown.
  std::size_t least = 0;
  for (const std::uint32_t tile : receiver.store()->changed_since(0)) {
    const leadline::proto::CodedCell* const cells = receiver.store()->tile(tile)->cells;
    least +=
        std::any_of(cells, cells + leadline::proto::kTileArea_cells, leadline::proto::cell_known)
            ? 1U
            : 0U;
  }
  std::size_t shown = receiver.store()->known_tiles();
  for (const std::uint32_t tile : receiver.coarse().changed_since(0)) {
    shown += receiver.store()->tile(tile) ? 0U : 1U;
  }
  check(cursor.complete && tiles >= least && tiles <= shown);
}

void play(const std::uint8_t* data, std::size_t size) {
  static const int fd = ::memfd_create("recording", MFD_CLOEXEC);
  check(fd >= 0 && ::ftruncate(fd, 0) == 0 &&
        ::pwrite(fd, data, size, 0) == static_cast<ssize_t>(size));
  Player player("/proc/self/fd/" + std::to_string(fd), 0.0);
  auto receiver = std::make_unique<Receiver>();
  double now_s = 0.0;
  const auto settle = [&] {
    do {
      now_s += 0.02;
      player.step(now_s, {[&] { receiver = std::make_unique<Receiver>(); },
                          [&](const std::uint8_t* bytes, std::size_t count,
                              leadline::base::TimeUs) { receiver->feed(bytes, count); }});
    } while (player.seeking());
  };
  const auto hash = [&] {
    return receiver->store() != nullptr ? receiver->store()->cells_hash() : 0;
  };
  settle();
  const std::uint64_t end = hash();
  for (const double share : {0.5, 0.0, 1.0}) {
    PageRequest request;
    request.kind = PageRequest::Kind::kSeek;
    request.t_s = share * player.length_s();
    player.take(request);
    settle();
  }
  check(hash() == end);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  (void)parse_page_request({reinterpret_cast<const char*>(data), size});
  Receiver receiver;
  try {
    receiver.feed(data, size);
  } catch (const HostError&) {
    return 0;
  }
  check(receiver.counters().bytes == size);
  if (receiver.store() != nullptr) {
    check(receiver.store()->known_cells() <= receiver.store()->grid_cells());
    check(receiver.store()->known_tiles() <= receiver.store()->tile_count());
    check(receiver.store()->tiles_incomplete() <= receiver.store()->known_tiles());
    if (receiver.store()->tile_count() <= kMostTiles) {
      show(receiver);
      play(data, size);
    }
  }
  (void)receiver.take_notices();
  (void)receiver.resend_request();
  // Whatever came, it finds an end of what it has to say.
  int frames = 0;
  while (!receiver.uplink(5'000'000).empty()) {
    frames += 1;
    check(frames < 1000);
  }
  return 0;
}
