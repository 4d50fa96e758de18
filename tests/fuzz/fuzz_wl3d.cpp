// Range Image Protocol packets: every record is within what the sonar can measure, and the counters account
// for every byte and record. The checksum would keep most inputs out, so the bytes also go as a payload
// into an intact packet, compressed and not.
#include <algorithm>
#include <cstdint>
#include <cstring>

#include "hal/emu/emulated_wl3d.hpp"
#include "hal/heads/snappy.hpp"
#include "hal/heads/wl3d.hpp"
#include "tests/support/fuzz_heads.hpp"

namespace {

void drive(const leadline::emu::Bytes& bytes) {
  static leadline::hal::Wl3dCodec codec({});
  codec = leadline::hal::Wl3dCodec({});
  leadline::fuzz::drive_head<leadline::hal::Wl3dCodec, false, false>(codec, bytes.data(),
                                                                     bytes.size(), 0);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0 || size > 4096) {
    return 0;
  }
  const leadline::emu::Bytes bytes(data, data + size);
  drive(bytes);
  drive(leadline::emu::wl3d_packet("RangeImage", bytes, false));
  drive(leadline::emu::wl3d_packet("RangeImage", bytes, true));
  std::uint8_t out[1000];
  std::size_t made = 0;
  const bool good = leadline::hal::snappy_uncompress(data, size, out, sizeof out, made);
  leadline::fuzz::require(made <= sizeof out && (good || made == 0));
  return 0;
}
