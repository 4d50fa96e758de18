// The topside over any bytes of a link: no frame, message or order of them may break it, and what it holds
// stays consistent. Another major version is refused by an error, which is allowed.
#include <cstddef>
#include <cstdint>

#include "host_tools/exit_codes.hpp"
#include "host_tools/topside/receiver.hpp"

namespace {

void check(bool good) {
  if (!good) {
    __builtin_trap();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using leadline::host::HostError;
  using leadline::host::Receiver;
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
