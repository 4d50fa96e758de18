#include "firmware/linux/recorder.hpp"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <sstream>

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include "firmware/config/exit_codes.hpp"
#include "firmware/linux/monotonic.hpp"

namespace leadline::host {
namespace {

constexpr int kIdle_ms = 5;
constexpr std::int64_t kRetry_us = 1'000'000;
constexpr std::int64_t kSync_us = 1'000'000;
constexpr int kMostNumbers = 10'000;
/// Errno that stands for the configured limit: not one that write() has.
constexpr int kLimitReached = -1;

/// survey.lll -> survey.3.lll
std::string numbered(const std::string& path, int number) {
  if (number == 0) {
    return path;
  }
  const std::filesystem::path file(path);
  return (file.parent_path() /
          (file.stem().string() + "." + std::to_string(number) + file.extension().string()))
      .string();
}

bool is_regular(int fd) {
  struct stat info {};
  return ::fstat(fd, &info) == 0 && S_ISREG(info.st_mode);
}

/// A descriptor for a file that was not there, or for a device that is; `path` becomes its name.
int create_log(std::string* path) {
  const std::string wanted = *path;
  constexpr int kFlags = O_WRONLY | O_CLOEXEC | O_NOCTTY;
  for (int number = 0; number < kMostNumbers; ++number) {
    *path = numbered(wanted, number);
    const int fd = ::open(path->c_str(), kFlags | O_CREAT | O_EXCL, 0644);
    if (fd >= 0 || errno != EEXIST) {
      return fd;
    }
    struct stat info {};
    if (number == 0 && ::stat(path->c_str(), &info) == 0 && !S_ISREG(info.st_mode)) {
      return ::open(path->c_str(), kFlags);
    }
  }
  errno = EEXIST;
  return -1;
}

}  // namespace

Recorder::Recorder(const std::string& path, std::int64_t max_bytes)
    : path_(path), max_bytes_(max_bytes), ring_(std::make_unique<Ring>()) {
  fd_ = create_log(&path_);
  if (fd_ < 0) {
    const int number = errno;
    throw HostError(ExitCode::kOutput, path + ": cannot create the log: " + std::strerror(number));
  }
  regular_ = is_regular(fd_);
  synced_us_ = monotonic_us();
  thread_ = std::thread([this] { run(); });
}

Recorder::~Recorder() { (void)finish(); }

bool Recorder::finish() {
  if (thread_.joinable()) {
    stopping_.store(true, std::memory_order_release);
    thread_.join();
    ::close(fd_);
    fd_ = -1;
  }
  return records_lost_.load() == 0;
}

RecorderReport Recorder::report() const {
  return {bytes_written_.load(std::memory_order_relaxed),
          records_lost_.load(std::memory_order_relaxed),
          bytes_lost_.load(std::memory_order_relaxed), failing_.load(std::memory_order_relaxed)};
}

// ---- Vehicle thread -----------------------------------------------------------------------------

bool Recorder::push(base::TimeUs t_us, const std::uint8_t* frames, std::size_t size_bytes,
                    std::uint32_t records) {
  const std::size_t room = Ring::capacity() - ring_->size();
  if (size_bytes > kBatch_bytes || sizeof(BatchHead) + size_bytes > room) {
    ring_losses_.records += records;
    ring_losses_.bytes += size_bytes;
    records_lost_.fetch_add(records, std::memory_order_relaxed);
    bytes_lost_.fetch_add(size_bytes, std::memory_order_relaxed);
    return false;
  }
  const BatchHead head = {t_us,
                          static_cast<std::uint32_t>(size_bytes),
                          records,
                          ring_losses_.bytes,
                          ring_losses_.records,
                          0};
  ring_losses_ = {};
  std::array<std::uint8_t, sizeof head> bytes{};
  std::memcpy(bytes.data(), &head, sizeof head);
  // There is room for all of it, and nobody else fills the ring.
  for (const std::uint8_t byte : bytes) {
    (void)ring_->push(byte);
  }
  for (std::size_t i = 0; i < size_bytes; ++i) {
    (void)ring_->push(frames[i]);
  }
  return true;
}

// ---- Recorder thread ----------------------------------------------------------------------------

void Recorder::take(std::uint8_t* out, std::size_t size_bytes) {
  for (std::size_t i = 0; i < size_bytes;) {
    // A batch that is on its way into the ring comes within microseconds.
    i += ring_->pop(out[i]) == base::Status::kOk ? 1 : 0;
  }
}

void Recorder::run() {
  while (true) {
    const bool last_round = stopping_.load(std::memory_order_acquire);
    while (ring_->size() >= sizeof(BatchHead)) {
      std::array<std::uint8_t, sizeof(BatchHead)> bytes{};
      take(bytes.data(), bytes.size());
      BatchHead head{};
      std::memcpy(&head, bytes.data(), bytes.size());
      take(batch_.data(), head.size_bytes);
      write_batch(head);
      sync_if_due();
    }
    if (last_round) {
      break;
    }
    sync_if_due();
    (void)::poll(nullptr, 0, kIdle_ms);
  }
  if (dirty_) {
    (void)::fdatasync(fd_);
  }
}

void Recorder::lose(const BatchHead& head) {
  disk_losses_.records += head.records;
  disk_losses_.bytes += head.size_bytes;
  lost_since_failure_ += head.records;
  records_lost_.fetch_add(head.records, std::memory_order_relaxed);
  bytes_lost_.fetch_add(head.size_bytes, std::memory_order_relaxed);
  failing_.store(true, std::memory_order_relaxed);
}

void Recorder::say(const std::string& what) const {
  // One write: lines of two threads do not mix.
  std::ostringstream line;
  line << "leadline-vehicle: log " << path_ << ": " << what << "\n";
  std::cerr << line.str();
}

void Recorder::write_batch(const BatchHead& head) {
  const std::int64_t now_us = monotonic_us();
  const bool waiting = failure_ != 0 && now_us < retry_us_ && !stopping_.load();
  bool good = !waiting;
  if (good && head.lost_records > 0) {
    good = write_gap(head, {head.lost_records, head.lost_bytes}, proto::LogGapReason::kRingFull);
  }
  if (good && disk_losses_.records > 0) {
    good = write_gap(head, disk_losses_, reason_);
    disk_losses_ = good ? Losses{} : disk_losses_;  // marked: never twice
  }
  good = good && write_whole(batch_.data(), head.size_bytes);
  if (!good) {
    if (!waiting) {
      retry_us_ = now_us + kRetry_us;
    }
    lose(head);
    return;
  }
  if (failure_ != 0) {
    say("recording again; " + std::to_string(lost_since_failure_) + " records were lost");
    failure_ = 0;
    lost_since_failure_ = 0;
  }
  failing_.store(false, std::memory_order_relaxed);
}

bool Recorder::write_gap(const BatchHead& head, const Losses& losses, proto::LogGapReason reason) {
  std::array<std::uint8_t, proto::frame_bound_bytes(64)> frame{};
  proto::LogWriter writer(frame.data(), frame.size());
  const base::Status status = writer.gap({head.t_us, reason, losses.records, losses.bytes});
  return status == base::Status::kOk && write_whole(writer.data(), writer.size_bytes());
}

bool Recorder::write_whole(const std::uint8_t* data, std::size_t size_bytes) {
  int number = 0;
  std::size_t written = 0;
  if (max_bytes_ > 0 && file_bytes_ + static_cast<std::int64_t>(size_bytes) > max_bytes_) {
    number = kLimitReached;
  }
  while (number == 0 && written < size_bytes) {
    const ssize_t some = ::write(fd_, data + written, size_bytes - written);
    if (some > 0) {
      written += static_cast<std::size_t>(some);
    } else if (some == 0) {
      number = EIO;
    } else if (errno != EINTR) {
      number = errno;
    }
  }
  if (number == 0) {
    file_bytes_ += static_cast<std::int64_t>(size_bytes);
    bytes_written_.fetch_add(size_bytes, std::memory_order_relaxed);
    dirty_ = true;
    return true;
  }
  if (written > 0 && regular_ && ::ftruncate(fd_, file_bytes_) == 0) {
    (void)::lseek(fd_, file_bytes_, SEEK_SET);  // half a batch goes: the log holds whole frames
  }
  const bool full =
      number == kLimitReached || number == ENOSPC || number == EDQUOT || number == EFBIG;
  reason_ = full ? proto::LogGapReason::kDiskFull : proto::LogGapReason::kWriteError;
  if (number != failure_) {
    failure_ = number;
    say("not recorded from here on, mapping goes on: " +
        (number == kLimitReached
             ? "the limit of " + std::to_string(max_bytes_) + " bytes is reached"
             : std::string(std::strerror(number))));
  }
  return false;
}

void Recorder::sync_if_due() {
  const std::int64_t now_us = monotonic_us();
  if (!dirty_ || now_us - synced_us_ < kSync_us) {
    return;
  }
  synced_us_ = now_us;
  dirty_ = false;
  if (::fdatasync(fd_) != 0 && errno != EINVAL && errno != EROFS && sync_failure_ != errno) {
    sync_failure_ = errno;
    say(std::string("cannot be brought to the disk: ") + std::strerror(sync_failure_));
  }
}

}  // namespace leadline::host
