// Any bytes as a device with pages of a map. What must hold: it mounts or is refused; no access leaves the device; a tile
// with a generation is read whole, or the failure is counted; a page that is written is the one that is read, also
// after the device is mounted anew. The sums of each slot are put right by its first byte: no fuzzer finds a CRC.
#include <cstdint>
#include <cstring>
#include <vector>

#include "firmware/pipeline/page_store.hpp"
#include "model/base/crc32c.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::base::Status;
using leadline::firmware::kPageHeader_bytes;
using leadline::firmware::PageDevice;
using leadline::firmware::PageStore;
using leadline::fuzz::require;

constexpr std::uint32_t kPayload_bytes = 16;
constexpr std::uint32_t kSlot_bytes = kPageHeader_bytes + kPayload_bytes;
constexpr std::uint32_t kPayloadCrcAt = 32;
constexpr std::uint32_t kTiles = 4;
constexpr std::uint32_t kLayout = 0x31323334;

struct Medium {
  std::vector<std::uint8_t> bytes;

  [[nodiscard]] std::uint8_t* at(std::uint32_t slot, std::uint32_t offset, std::uint32_t size) {
    require(std::uint64_t{offset} + size <= kSlot_bytes, "inside a slot");
    require((std::size_t{slot} + 1) * kSlot_bytes <= bytes.size(), "inside the device");
    return bytes.data() + std::size_t{slot} * kSlot_bytes + offset;
  }
};

PageDevice device_of(Medium* medium) {
  PageDevice device{};
  device.context = medium;
  device.slot_count = static_cast<std::uint32_t>(medium->bytes.size() / kSlot_bytes);
  device.slot_bytes = kSlot_bytes;
  device.read = [](void* context, std::uint32_t slot, std::uint32_t offset, void* out,
                   std::uint32_t size) {
    std::memcpy(out, static_cast<Medium*>(context)->at(slot, offset, size), size);
    return true;
  };
  device.erase = [](void* context, std::uint32_t slot) {
    std::memset(static_cast<Medium*>(context)->at(slot, 0, kSlot_bytes), 0xFF, kSlot_bytes);
    return true;
  };
  device.program = [](void* context, std::uint32_t slot, std::uint32_t offset, const void* data,
                      std::uint32_t size) {
    std::memcpy(static_cast<Medium*>(context)->at(slot, offset, size), data, size);
    return true;
  };
  device.sync = [](void*) { return true; };
  return device;
}

PageStore store;  // large

void check(Medium* medium) {
  if (store.mount(device_of(medium), kLayout, kTiles, kPayload_bytes) != Status::kOk) {
    return;
  }
  std::uint8_t payload[kPayload_bytes];
  for (std::uint32_t tile = 0; tile < kTiles; ++tile) {
    const auto before = store.counters().read_failures;
    const bool is_there = store.generation(static_cast<leadline::model::TileId>(tile)) != 0;
    const bool read = store.read(static_cast<leadline::model::TileId>(tile), payload);
    require(read ? is_there : !is_there || store.counters().read_failures == before + 1,
            "a page is read, or its failure counted");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kInput_bytes = kSlot_bytes + 1;
  Medium medium;
  for (std::size_t at = 0; at + kInput_bytes <= size && at < 32 * kInput_bytes;
       at += kInput_bytes) {
    std::vector<std::uint8_t> slot(data + at + 1, data + at + kInput_bytes);
    if (data[at] % 2 == 0) {
      const std::uint32_t payload_crc =
          leadline::base::crc32c(slot.data() + kPageHeader_bytes, kPayload_bytes);
      std::memcpy(slot.data() + kPayloadCrcAt, &payload_crc, 4);
      const std::uint32_t header_crc = leadline::base::crc32c(slot.data(), kPageHeader_bytes - 4);
      std::memcpy(slot.data() + kPageHeader_bytes - 4, &header_crc, 4);
    }
    medium.bytes.insert(medium.bytes.end(), slot.begin(), slot.end());
  }
  check(&medium);
  std::uint8_t written[kPayload_bytes] = {1, 2, 3};
  if (store.tile_count() == kTiles && medium.bytes.size() >= kSlot_bytes * (kTiles + 2) &&
      store.write(1, 7, written)) {
    std::uint8_t back[kPayload_bytes] = {};
    require(store.read(1, back) && std::memcmp(back, written, sizeof back) == 0,
            "what is written is read");
    require(store.mount(device_of(&medium), kLayout, kTiles, kPayload_bytes) == Status::kOk,
            "what was mounted is mounted again");
    require(store.generation(1) == 7 && store.read(1, back) &&
                std::memcmp(back, written, sizeof back) == 0,
            "and has the page");
  }
  return 0;
}
