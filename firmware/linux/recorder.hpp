// The recorder: a thread that writes the log, so that the vehicle never waits for a disk.
//
// The vehicle thread hands over batches of whole frames (a cycle's worth) through a ring of bytes; the
// recorder writes each batch whole. What cannot be kept (ring full, disk full, write error, size limit) is
// lost batch by batch, counted, marked in the log by a gap record as soon as it goes on, and reported
// once per change on stderr. A failing disk is tried again every second.
//
// Every batch reaches the kernel at once (a killed process loses nothing that it handed over) and the disk
// about once a second (a power cut loses the last second).
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>

#include "model/base/spsc_ring.hpp"
#include "model/base/units.hpp"
#include "proto/log.hpp"

namespace leadline::host {

/// Snapshot of what the recorder did. Never decremented, but `failing`.
struct RecorderReport {
  std::uint64_t bytes_written;
  std::uint32_t records_lost;  ///< for any reason
  std::uint64_t bytes_lost;
  bool failing;  ///< the last batch could not be written
};

class Recorder {
 public:
  /// Bytes that a slow disk may be behind: at the most input that cycles of 20 ms can take, a second.
  static constexpr std::size_t kRing_bytes = std::size_t{1} << 22U;
  /// Largest batch.
  static constexpr std::size_t kBatch_bytes = std::size_t{1} << 18U;

  /// Creates the file and starts the thread. A log that is there is kept: the next free number goes
  /// before the extension (survey.1.lll); a device or pipe is written as it is. Throws HostError
  /// kOutput when nothing can be created. `max_bytes`, the end record included; 0: no limit.
  Recorder(const std::string& path, std::int64_t max_bytes);
  /// Writes what is in the ring, brings it to the disk, closes.
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// Vehicle thread: hands over `records` whole frames. False when there was no room: lost, counted.
  bool push(base::TimeUs t_us, const std::uint8_t* frames, std::size_t size_bytes,
            std::uint32_t records);
  /// Either thread.
  [[nodiscard]] RecorderReport report() const;
  /// The name that it was created under.
  [[nodiscard]] const std::string& path() const { return path_; }
  /// Vehicle thread: stops as the destructor does. True when every record was written.
  bool finish();

 private:
  /// In front of each batch in the ring.
  struct BatchHead {
    base::TimeUs t_us;
    std::uint32_t size_bytes;
    std::uint32_t records;
    // Lost before this batch for want of room in the ring.
    std::uint64_t lost_bytes;
    std::uint32_t lost_records;
    std::uint32_t reserved;
  };
  struct Losses {
    std::uint32_t records = 0;
    std::uint64_t bytes = 0;
  };
  using Ring = base::SpscRing<std::uint8_t, kRing_bytes>;

  void run();
  void take(std::uint8_t* out, std::size_t size_bytes);
  void write_batch(const BatchHead& head);
  bool write_gap(const BatchHead& head, const Losses& losses, proto::LogGapReason reason);
  bool write_whole(const std::uint8_t* data, std::size_t size_bytes);
  void lose(const BatchHead& head);
  void say(const std::string& what) const;
  void sync_if_due();

  std::string path_;
  std::int64_t max_bytes_;
  int fd_ = -1;
  bool regular_ = true;

  // Vehicle thread.
  Losses ring_losses_;

  // Recorder thread.
  std::int64_t file_bytes_ = 0;  ///< whole batches
  Losses disk_losses_;           ///< not yet marked in the log
  std::uint64_t lost_since_failure_ = 0;
  proto::LogGapReason reason_ = proto::LogGapReason::kDiskFull;
  int failure_ = 0;       ///< errno of the failure that was reported, 0: none
  int sync_failure_ = 0;  ///< the same of bringing bytes to the disk
  std::int64_t retry_us_ = 0;
  std::int64_t synced_us_ = 0;
  bool dirty_ = false;
  std::array<std::uint8_t, kBatch_bytes> batch_{};

  std::unique_ptr<Ring> ring_;
  std::atomic<bool> stopping_{false};
  std::atomic<std::uint64_t> bytes_written_{0};
  std::atomic<std::uint32_t> records_lost_{0};
  std::atomic<std::uint64_t> bytes_lost_{0};
  std::atomic<bool> failing_{false};
  std::thread thread_;
};

}  // namespace leadline::host
