// A page store over an emulated medium that loses power after any operation: what was not yet synced is kept,
// lost or torn, sector by sector, in any order; torn sectors may hold anything.
#include <cstring>
#include <vector>

#include "firmware/pipeline/page_store.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Status;
using leadline::firmware::kPageHeader_bytes;
using leadline::firmware::PageDevice;
using leadline::firmware::PageStore;
using leadline::test::Random;

constexpr std::uint32_t kTiles = 5;
constexpr std::uint32_t kSlots = 8;
constexpr std::uint32_t kPayload_bytes = 80;
constexpr std::uint32_t kSlot_bytes = 128;
constexpr std::uint32_t kSector_bytes = 16;
constexpr std::uint32_t kLayout = 0x1234;

using Media = std::vector<std::uint8_t>;

// What becomes of writes that were not synced.
enum class Loss : std::uint8_t { kAll, kNone, kSome, kGarbled };
constexpr Loss kLosses[] = {Loss::kAll, Loss::kNone, Loss::kSome, Loss::kGarbled};

class Medium {
 public:
  explicit Medium(const Media& media) : durable_(media), now_(media) {}

  // Power goes when this many operations are done; the next one is under way.
  void cut_after(std::size_t operations) { left_ = operations; }
  // Fails this operation only, and goes on: an error of the medium.
  void fail_at(std::size_t operation) { fails_ = operation; }
  [[nodiscard]] bool cut() const { return cut_; }
  [[nodiscard]] std::size_t operations() const { return operations_; }

  // What the medium holds afterwards.
  [[nodiscard]] Media after(Loss loss, Random* random) const {
    Media media = durable_;
    for (std::size_t at = 0; at < media.size(); at += kSector_bytes) {
      bool dirty = false;
      for (std::size_t k = at; k < at + kSector_bytes; ++k) {
        dirty = dirty || touched_[k];
      }
      if (!dirty || loss == Loss::kAll) {
        continue;
      }
      const auto draw =
          loss == Loss::kNone ? 1 : random->between(0, loss == Loss::kGarbled ? 2 : 1);
      for (std::size_t k = at; k < at + kSector_bytes && draw != 0; ++k) {
        media[k] = draw == 1 ? now_[k] : static_cast<std::uint8_t>(random->next());
      }
    }
    return media;
  }

  PageDevice device() {
    return {this,
            kSlots,
            kSlot_bytes,
            [](void* c, std::uint32_t slot, std::uint32_t offset, void* out, std::uint32_t size) {
              std::memcpy(out, &static_cast<Medium*>(c)->now_[slot * kSlot_bytes + offset], size);
              return true;
            },
            [](void* c, std::uint32_t slot) {
              const std::uint8_t erased[kSlot_bytes] = {};
              return static_cast<Medium*>(c)->change(slot * kSlot_bytes, erased, kSlot_bytes);
            },
            [](void* c, std::uint32_t slot, std::uint32_t offset, const void* data,
               std::uint32_t size) {
              return static_cast<Medium*>(c)->change(slot * kSlot_bytes + offset, data, size);
            },
            [](void* c) { return static_cast<Medium*>(c)->sync(); }};
  }

 private:
  bool begin() {
    if (cut_) {
      return false;
    }
    ++operations_;
    if (left_ == 0) {
      cut_ = true;  // this one is under way: its effects are among those that may be lost
    } else {
      --left_;
    }
    return true;
  }
  bool change(std::size_t at, const void* data, std::size_t size) {
    if (!begin()) {
      return false;
    }
    std::memcpy(&now_[at], data, size);
    std::fill(touched_.begin() + static_cast<std::ptrdiff_t>(at),
              touched_.begin() + static_cast<std::ptrdiff_t>(at + size), true);
    return !cut_ && operations_ != fails_;
  }
  bool sync() {
    if (!begin() || cut_ || operations_ == fails_) {
      return false;
    }
    durable_ = now_;
    std::fill(touched_.begin(), touched_.end(), false);
    return true;
  }

  Media durable_;
  Media now_;
  std::vector<bool> touched_ = std::vector<bool>(kSlots * kSlot_bytes, false);
  std::size_t left_ = SIZE_MAX;
  std::size_t fails_ = SIZE_MAX;
  std::size_t operations_ = 0;
  bool cut_ = false;
};

Media blank() { return Media(kSlots * kSlot_bytes, 0xFF); }

// Payload that says which tile and generation it is of in every byte.
std::vector<std::uint8_t> payload_of(std::uint32_t tile, std::uint32_t generation) {
  std::vector<std::uint8_t> payload(kPayload_bytes);
  Random random((std::uint64_t{tile} << 32U) + generation, 0);
  for (std::uint8_t& byte : payload) {
    byte = static_cast<std::uint8_t>(random.next());
  }
  return payload;
}

// A plan of writes: tile k mod 5 mostly, the generation counts up.
struct Write {
  std::uint32_t tile;
  std::uint32_t generation;
};
std::vector<Write> plan() {
  std::vector<Write> writes;
  Random random(11);
  for (std::uint32_t k = 1; k <= 40; ++k) {
    writes.push_back({static_cast<std::uint32_t>(random.between(0, kTiles - 1)), k});
  }
  return writes;
}

// Generations that each tile may have: that of the last write that returned, or of the one under way.
struct Expected {
  std::uint32_t old_generation[kTiles] = {};
  std::uint32_t new_generation[kTiles] = {};
};

PageStore store;  // large
std::uint64_t checked_pages = 0;

// Carries out writes from `first` on until the cut; returns where to go on. `expected` follows.
std::size_t run(Medium* medium, const std::vector<Write>& writes, std::size_t first,
                Expected* expected) {
  assert_int_equal(store.mount(medium->device(), kLayout, kTiles, kPayload_bytes), Status::kOk);
  for (std::size_t k = first; k < writes.size(); ++k) {
    const Write& write = writes[k];
    const bool done =
        store.write(write.tile, write.generation, payload_of(write.tile, write.generation).data());
    expected->new_generation[write.tile] = write.generation;
    if (!done) {
      return k;
    }
    expected->old_generation[write.tile] = write.generation;
  }
  return writes.size();
}

// Every page is the old one or the new one, whole. Makes what was found the state to go on from.
void check(const Media& media, Expected* expected) {
  Medium medium(media);
  assert_int_equal(store.mount(medium.device(), kLayout, kTiles, kPayload_bytes), Status::kOk);
  for (std::uint32_t tile = 0; tile < kTiles; ++tile) {
    const std::uint32_t found = store.generation(tile);
    if (found != expected->old_generation[tile] && found != expected->new_generation[tile]) {
      fail_msg("tile %u has generation %u, not %u or %u", tile, found,
               expected->old_generation[tile], expected->new_generation[tile]);
    }
    std::uint8_t payload[kPayload_bytes];
    assert_int_equal(store.read(tile, payload), found != 0);
    if (found != 0) {
      assert_memory_equal(payload, payload_of(tile, found).data(), kPayload_bytes);
    }
    expected->old_generation[tile] = expected->new_generation[tile] = found;
    ++checked_pages;
  }
  assert_int_equal(medium.operations(), 0);  // nothing is written at mount
}

TEST(every_single_and_every_double_cut_leaves_old_or_new_pages) {
  const std::vector<Write> writes = plan();
  Medium whole(blank());
  Expected all;
  assert_int_equal(run(&whole, writes, 0, &all), writes.size());
  const std::size_t operations = whole.operations();
  assert_int_equal(operations, 4 * writes.size());
  Random random(12);
  std::uint64_t singles = 0;
  std::uint64_t doubles = 0;
  for (std::size_t first = 0; first < operations; ++first) {
    for (const Loss loss : kLosses) {
      Medium medium(blank());
      medium.cut_after(first);
      Expected expected;
      const std::size_t at = run(&medium, writes, 0, &expected);
      assert_true(medium.cut());
      const Media after_first = medium.after(loss, &random);
      check(after_first, &expected);
      ++singles;
      // The vehicle goes on, and loses its power again; every time.
      for (std::size_t second = 0; second < operations - 4 * at; ++second) {
        Medium again(after_first);
        again.cut_after(second);
        Expected then = expected;
        (void)run(&again, writes, at, &then);
        check(again.after(kLosses[(second + first) % 4], &random), &then);
        ++doubles;
      }
    }
  }
  std::printf("%llu single and %llu double cuts, %llu pages checked: each the old or the new\n",
              static_cast<unsigned long long>(singles), static_cast<unsigned long long>(doubles),
              static_cast<unsigned long long>(checked_pages));
  assert_int_equal(singles, 4 * operations);
}

TEST(an_error_of_the_medium_costs_the_write_only) {
  const std::vector<Write> writes = plan();
  for (std::size_t failing = 1; failing <= 4 * writes.size(); ++failing) {
    Medium medium(blank());
    medium.fail_at(failing);
    assert_int_equal(store.mount(medium.device(), kLayout, kTiles, kPayload_bytes), Status::kOk);
    std::uint32_t generation[kTiles] = {};
    for (const Write& write : writes) {
      if (store.write(write.tile, write.generation,
                      payload_of(write.tile, write.generation).data())) {
        generation[write.tile] = write.generation;
      }
      for (std::uint32_t tile = 0; tile < kTiles; ++tile) {
        assert_int_equal(store.generation(tile), generation[tile]);
        std::uint8_t payload[kPayload_bytes];
        if (store.read(tile, payload)) {
          assert_memory_equal(payload, payload_of(tile, generation[tile]).data(), kPayload_bytes);
        } else {
          assert_int_equal(generation[tile], 0);
        }
      }
    }
    assert_int_equal(store.counters().write_failures, 1);
    assert_int_equal(store.counters().pages_written, writes.size() - 1);
  }
}

TEST(any_changed_bit_is_found) {
  Medium medium(blank());
  assert_int_equal(store.mount(medium.device(), kLayout, kTiles, kPayload_bytes), Status::kOk);
  assert_true(store.write(3, 7, payload_of(3, 7).data()));
  Random random(13);
  const Media good = medium.after(Loss::kAll, &random);
  for (std::size_t bit = 0; bit < 8 * (kPageHeader_bytes + kPayload_bytes); ++bit) {
    Media media = good;
    media[bit / 8] = static_cast<std::uint8_t>(media[bit / 8] ^ 1U << bit % 8);
    Medium changed(media);
    assert_int_equal(store.mount(changed.device(), kLayout, kTiles, kPayload_bytes), Status::kOk);
    assert_int_equal(store.generation(3), 0);
    // And when it changes after it was found.
    Medium later(good);
    assert_int_equal(store.mount(later.device(), kLayout, kTiles, kPayload_bytes), Status::kOk);
    assert_int_equal(store.generation(3), 7);
    later = changed;
    std::uint8_t payload[kPayload_bytes];
    assert_false(store.read(3, payload));
    assert_int_equal(store.counters().read_failures, 1);
  }
}

TEST(pages_of_another_layout_are_passed_over) {
  Medium medium(blank());
  assert_int_equal(store.mount(medium.device(), kLayout, kTiles, kPayload_bytes), Status::kOk);
  assert_true(store.write(1, 5, payload_of(1, 5).data()));
  assert_int_equal(store.mount(medium.device(), kLayout + 1, kTiles, kPayload_bytes), Status::kOk);
  assert_int_equal(store.generation(1), 0);
  assert_int_equal(store.counters().slots_foreign, 1);
  assert_int_equal(store.mount(medium.device(), kLayout, kTiles, kPayload_bytes - 1), Status::kOk);
  assert_int_equal(store.generation(1), 0);
  // What does not fit is refused.
  assert_int_equal(store.mount(medium.device(), kLayout, 0, kPayload_bytes), Status::kOutOfRange);
  assert_int_equal(store.mount(medium.device(), kLayout, kTiles, kSlot_bytes), Status::kOutOfRange);
  assert_int_equal(store.mount(medium.device(), kLayout, kSlots - 1, kPayload_bytes),
                   Status::kOverCapacity);
  assert_false(store.write(1, 5, payload_of(1, 5).data()));
  assert_int_equal(store.mount(medium.device(), kLayout, kTiles, kPayload_bytes), Status::kOk);
  assert_false(store.write(kTiles, 5, payload_of(1, 5).data()));
  assert_false(store.write(0, 0, payload_of(1, 5).data()));
  std::uint8_t payload[kPayload_bytes];
  assert_false(store.read(kTiles, payload));
}

}  // namespace
