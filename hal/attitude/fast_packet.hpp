// NMEA 2000 messages of more than 8 bytes ("fast packets"): put together from CAN frames.
//
//   byte 0 of each frame: sequence << 5 | frame number; byte 1 of frame 0: bytes of the message
//   frame 0 carries 6 bytes of it, every further one 7
//
// A sender keeps the order of its frames, so a number that is not the next one means a lost frame: that
// message is dropped and counted, and no other. Bounded: kSlots messages under way at a time, of which
// the longest untouched gives way. No heap, no clock.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/can_frame.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

/// 6 + 31 * 7. Inclusive.
inline constexpr std::size_t kMaxFastPacket_bytes = 223;

/// A whole message; valid until the assembler's next take().
struct FastPacket {
  const std::uint8_t* data;
  std::size_t size_bytes;
  base::TimeUs t_first_us;  ///< arrival of its frame 0
};

class FastPackets {
 public:
  static constexpr std::size_t kSlots = 6;
  /// A message whose next frame takes longer than this is given up: the sequence number of three bits
  /// comes again.
  static constexpr base::TimeUs kMaxGap_us = 750'000;

  /// Takes one frame of a message (`key`: what tells its sender and kind apart, not 0). True when it
  /// completed one. `dropped` is raised by the messages that it ends unfinished. O(kSlots).
  [[nodiscard]] bool take(std::uint32_t key, const CanFrame& frame, base::TimeUs t_us,
                          FastPacket& packet, std::uint32_t& dropped);
  /// Forgets what is under way. Returns how many messages that were.
  std::uint32_t reset();

 private:
  struct Slot {
    std::uint32_t key;  ///< 0: free
    std::uint8_t sequence;
    std::uint8_t next_frame;
    std::uint8_t size_bytes;
    std::uint8_t filled_bytes;
    base::TimeUs t_first_us;
    base::TimeUs t_last_us;
    std::array<std::uint8_t, kMaxFastPacket_bytes> data;
  };

  [[nodiscard]] Slot* find(std::uint32_t key);
  [[nodiscard]] Slot& slot_for(std::uint32_t key, std::uint32_t& dropped);
  static void append(Slot& slot, const CanFrame& frame, std::size_t first);

  std::array<Slot, kSlots> slots_{};
};

}  // namespace leadline::hal
