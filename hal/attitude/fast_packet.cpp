#include "hal/attitude/fast_packet.hpp"

#include "model/base/fixed.hpp"

namespace leadline::hal {

FastPackets::Slot* FastPackets::find(std::uint32_t key) {
  for (Slot& slot : slots_) {
    if (slot.key == key) {
      return &slot;
    }
  }
  return nullptr;
}

/// The key's own slot, a free one, or the one that has waited longest.
FastPackets::Slot& FastPackets::slot_for(std::uint32_t key, std::uint32_t& dropped) {
  Slot* chosen = find(key);
  if (chosen == nullptr) {
    chosen = find(0);
  }
  if (chosen == nullptr) {
    chosen = slots_.data();
    for (Slot& slot : slots_) {
      chosen = slot.t_last_us < chosen->t_last_us ? &slot : chosen;
    }
  }
  dropped += chosen->key != 0 ? 1U : 0U;
  return *chosen;
}

void FastPackets::append(Slot& slot, const CanFrame& frame, std::size_t first) {
  const std::size_t missing = std::size_t{slot.size_bytes} - slot.filled_bytes;
  const std::size_t count = base::min_of(missing, frame.length_bytes - first);
  for (std::size_t i = 0; i < count; ++i) {
    slot.data[slot.filled_bytes + i] = frame.data[first + i];
  }
  slot.filled_bytes = static_cast<std::uint8_t>(slot.filled_bytes + count);
  slot.next_frame = static_cast<std::uint8_t>(slot.next_frame + 1);
}

bool FastPackets::take(std::uint32_t key, const CanFrame& frame, base::TimeUs t_us,
                       FastPacket& packet, std::uint32_t& dropped) {
  const auto sequence = static_cast<std::uint8_t>(frame.data[0] >> 5U);
  const auto number = static_cast<std::uint8_t>(frame.data[0] & 0x1FU);
  Slot* slot = nullptr;
  if (number == 0) {
    const bool possible =
        frame.length_bytes > 2 && frame.data[1] <= kMaxFastPacket_bytes && frame.data[1] > 0;
    slot = &slot_for(key, dropped);
    slot->key = possible ? key : 0;
    if (!possible) {
      ++dropped;
      return false;
    }
    slot->sequence = sequence;
    slot->next_frame = 0;
    slot->size_bytes = frame.data[1];
    slot->filled_bytes = 0;
    slot->t_first_us = t_us;
    append(*slot, frame, 2);
  } else {
    slot = find(key);
    if (slot == nullptr) {
      return false;  // its beginning was lost, and counted there or before this program began
    }
    const bool next = slot->sequence == sequence && slot->next_frame == number &&
                      t_us - slot->t_last_us <= kMaxGap_us && frame.length_bytes > 1;
    if (!next) {
      ++dropped;
      slot->key = 0;
      return false;
    }
    append(*slot, frame, 1);
  }
  slot->t_last_us = t_us;
  if (slot->filled_bytes < slot->size_bytes) {
    return false;
  }
  slot->key = 0;
  packet = {slot->data.data(), slot->size_bytes, slot->t_first_us};
  return true;
}

std::uint32_t FastPackets::reset() {
  std::uint32_t dropped = 0;
  for (Slot& slot : slots_) {
    dropped += slot.key != 0 ? 1U : 0U;
    slot.key = 0;
  }
  return dropped;
}

}  // namespace leadline::hal
