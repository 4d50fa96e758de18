// The input of one cycle: what the ports had, bounded so that no port starves another.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "firmware/pipeline/session_log.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "hal/linux/linux_port.hpp"

namespace leadline::host {

/// Allocates once. Every source (device port, link) may fill its share of a cycle; what is beyond waits in
/// the kernel for the next cycle.
class ChunkBuffer {
 public:
  static constexpr std::size_t kSources = firmware::kMaxPorts + 1;  ///< the link is the last
  static constexpr std::size_t kMaxChunksPerSource = 64;
  /// Of the program's own: its report, the store's answers, a command and a tally of those refused.
  static constexpr std::size_t kOwnChunks = 19;
  static_assert(kSources * kMaxChunksPerSource + kOwnChunks <= firmware::kMaxCycleChunks,
                "what a cycle takes is replayed");
  /// A source of datagrams with less room than that left waits for the next cycle. No datagram is cut: the rest of a
  /// large one is held by its port.
  static constexpr std::size_t kDatagram_bytes = 2048;

  static constexpr std::size_t kReserve_bytes = 384;  ///< for add(), whatever else comes

  /// `share_bytes` per source: at most kMaxCycleBytes all together.
  ChunkBuffer(std::size_t sources, std::size_t share_bytes);

  void clear();
  /// Reads `port` once, at most `limit_bytes`; false when there was nothing or no room. Bytes of a stream
  /// that arrive at the same time as those before go into the same chunk.
  bool read(hal::LinuxPort& port, std::size_t source, std::uint8_t number, base::TimeUs now_us,
            std::size_t limit_bytes = SIZE_MAX);
  /// What the port still holds of a datagram, also beyond its share: at a cycle's end, when nobody else can use the
  /// room any more. False: nothing held, or no room.
  bool read_rest(hal::LinuxPort& port, std::size_t source, std::uint8_t number,
                 base::TimeUs now_us);
  /// A chunk of the program's own. False: no room.
  bool add(std::uint8_t number, base::TimeUs t_us, const std::uint8_t* data, std::size_t size);
  /// Every chunk arrived at `t_us`: bytes that came on another clock.
  void retime(base::TimeUs t_us);
  /// Whether a source may still be read in this cycle.
  [[nodiscard]] bool has_room(const hal::LinuxPort& port, std::size_t source) const;

  [[nodiscard]] const firmware::InputChunk* chunks() const { return chunks_.data(); }
  [[nodiscard]] std::size_t chunk_count() const { return chunks_.size(); }

 private:
  void push(std::uint8_t number, base::TimeUs t_us, std::size_t size);
  [[nodiscard]] bool extends(std::uint8_t number, base::TimeUs t_us) const;

  std::size_t share_bytes_;
  std::size_t filled_bytes_ = 0;
  std::vector<std::uint8_t> bytes_;
  std::vector<firmware::InputChunk> chunks_;
  std::array<std::size_t, kSources> used_bytes_{};
  std::array<std::size_t, kSources> used_chunks_{};
};

}  // namespace leadline::host
