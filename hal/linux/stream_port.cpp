#include "hal/linux/stream_port.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <poll.h>
#include <unistd.h>

namespace leadline::hal {

void Backoff::failed(base::TimeUs now_us) {
  wait_us_ =
      waiting_ ? std::min(2 * wait_us_, LinuxPort::kLongestRetry_us) : LinuxPort::kFirstRetry_us;
  waiting_ = true;
  next_us_ = now_us + wait_us_;
}

void Backoff::succeeded() { waiting_ = false; }

StreamPort::~StreamPort() { close_fd(); }

void StreamPort::close_fd() {
  if (fd_ >= 0) {
    ::close(fd_);
    fd_ = -1;
  }
}

void StreamPort::mark_open() {
  state_ = PortState::kOpen;
  counters_.opens += 1;
  backoff_.succeeded();
}

void StreamPort::lose() {
  close_fd();
  counters_.bytes_dropped_out += queued_;
  queued_ = 0;
  if (state_ == PortState::kOpen) {
    state_ = PortState::kClosed;
    counters_.losses += 1;
  }
  backoff_.failed(now_us_);
}

void StreamPort::try_open() {
  const OpenResult result = fd_ < 0 ? open_now() : check_pending(now_us_);
  if (result == OpenResult::kOpen) {
    mark_open();
  } else if (result == OpenResult::kFailed) {
    errno_ = errno;
    close_fd();
    backoff_.failed(now_us_);
  }
}

void StreamPort::service(base::TimeUs now_us) {
  now_us_ = now_us;
  if (state_ == PortState::kClosed && (fd_ >= 0 || backoff_.due(now_us))) {
    try_open();
  }
  if (state_ == PortState::kOpen) {
    flush();
  }
}

std::size_t StreamPort::read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                             base::TimeUs& t_arrival_us) {
  now_us_ = now_us;
  if (state_ == PortState::kClosed || capacity == 0) {
    return 0;
  }
  ssize_t taken = ::read(fd_, out, capacity);
  if (taken < 0 && errno == EINTR) {
    taken = ::read(fd_, out, capacity);
  }
  if (taken > 0) {
    counters_.bytes_in += static_cast<std::uint64_t>(taken);
    t_arrival_us = now_us;
    return static_cast<std::size_t>(taken);
  }
  if (taken == 0) {
    if (end_is_loss()) {
      lose();
    }
    return 0;
  }
  if (errno != EAGAIN && errno != EINTR) {
    note_error(errno);
    lose();
  }
  return 0;
}

std::size_t StreamPort::write_room() const {
  return state_ == PortState::kOpen ? queue_.size() - queued_ : 0;
}

std::size_t StreamPort::write(const std::uint8_t* data, std::size_t size) {
  const std::size_t taken = std::min(size, write_room());
  counters_.bytes_dropped_out += size - taken;
  if (taken > 0) {
    std::memcpy(queue_.data() + queued_, data, taken);
    queued_ += taken;
    flush();
  }
  return taken;
}

long StreamPort::write_some(const std::uint8_t* data, std::size_t size) {
  return ::write(fd_, data, size);
}

void StreamPort::flush() {
  if (queued_ == 0) {
    return;
  }
  const long written = write_some(queue_.data(), queued_);
  if (written < 0) {
    if (errno != EAGAIN && errno != EINTR) {
      note_error(errno);
      if (error_is_loss()) {
        lose();
      }
    }
    return;
  }
  const auto count = static_cast<std::size_t>(written);
  counters_.bytes_out += count;
  queued_ -= count;
  std::memmove(queue_.data(), queue_.data() + count, queued_);
}

short StreamPort::poll_events() const {
  const bool wants_out = queued_ > 0 || (fd_ >= 0 && state_ == PortState::kClosed);
  return static_cast<short>(POLLIN | (wants_out ? POLLOUT : 0));
}

}  // namespace leadline::hal
