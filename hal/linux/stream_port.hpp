// What all byte streams have in common: a descriptor that comes and goes, a queue of fixed size in front
// of it, counters. Inside of hal/linux; users take linux_port.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/linux/linux_port.hpp"

namespace leadline::hal {

/// When to try again: at once, then after 0.1 s, doubling up to 1.6 s; from the beginning after a success.
class Backoff {
 public:
  /// Time that goes back does not make a port wait for ever.
  [[nodiscard]] bool due(base::TimeUs now_us) const {
    return !waiting_ || now_us >= next_us_ || next_us_ - now_us > LinuxPort::kLongestRetry_us;
  }
  void failed(base::TimeUs now_us);
  void succeeded();

 private:
  bool waiting_ = false;
  base::TimeUs next_us_ = 0;
  base::TimeUs wait_us_ = LinuxPort::kFirstRetry_us;
};

/// A derived class opens the descriptor; reading, writing, loss and retry are here.
class StreamPort : public LinuxPort {
 public:
  ~StreamPort() override;

  std::size_t read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                   base::TimeUs& t_arrival_us) override;
  std::size_t write(const std::uint8_t* data, std::size_t size) override;
  void service(base::TimeUs now_us) override;
  [[nodiscard]] PortState state() const override { return state_; }
  [[nodiscard]] const PortCounters& counters() const override { return counters_; }
  [[nodiscard]] std::size_t write_room() const override;
  [[nodiscard]] std::size_t pending_out_bytes() const override { return queued_; }
  [[nodiscard]] int poll_fd() const override { return fd_; }
  [[nodiscard]] short poll_events() const override;
  [[nodiscard]] int last_errno() const override { return errno_; }

 protected:
  enum class OpenResult : std::uint8_t { kOpen, kPending, kFailed };

  /// Opens and calls adopt(); on failure sets errno. Must not block. Called while there is no fd.
  virtual OpenResult open_now() = 0;
  /// A connection under way: done, still under way, or failed.
  virtual OpenResult check_pending(base::TimeUs /*now_us*/) { return OpenResult::kOpen; }
  /// Bytes read at the end of the stream: true = gone, false = there may be more later (a file).
  [[nodiscard]] virtual bool end_is_loss() { return true; }
  [[nodiscard]] virtual long write_some(const std::uint8_t* data, std::size_t size);
  /// A write that failed otherwise than for want of room: true = gone.
  [[nodiscard]] virtual bool error_is_loss() const { return true; }

  void adopt(int fd) { fd_ = fd; }
  /// The open descriptor goes: counted, queue dropped, retried later.
  void lose();
  void close_fd();
  void mark_open();
  void note_error(int number) {
    errno_ = number;
    counters_.errors += 1;
  }

  int fd_ = -1;
  PortState state_ = PortState::kClosed;
  base::TimeUs now_us_ = 0;

 private:
  void try_open();
  void flush();

  Backoff backoff_;
  PortCounters counters_{};
  int errno_ = 0;
  std::size_t queued_ = 0;
  std::array<std::uint8_t, kQueue_bytes> queue_{};
};

}  // namespace leadline::hal
