#include "hal/linux/lockstep.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "hal/wire.hpp"

namespace leadline::hal {
namespace {

constexpr std::uint32_t kMagic = 0x314B4C4CU;  // "LLK1"
constexpr std::size_t kMessage_bytes = 4 + 4 + 8 + 8 * kLockstepPorts;
enum Kind : std::uint32_t { kGrant = 1, kAnswer = 2, kFinish = 3 };

using Clock = std::chrono::steady_clock;

/// What is left of a wait: real time, whatever the virtual one says.
class Deadline {
 public:
  explicit Deadline(int timeout_ms) : end_(Clock::now() + std::chrono::milliseconds(timeout_ms)) {}
  [[nodiscard]] int left_ms() const {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end_ - Clock::now());
    return static_cast<int>(std::max<std::int64_t>(left.count(), 0));
  }
  [[nodiscard]] bool over() const { return Clock::now() >= end_; }

 private:
  Clock::time_point end_;
};

void write_u64_le(std::uint8_t* out, std::uint64_t value) {
  write_u32_le(out, static_cast<std::uint32_t>(value));
  write_u32_le(out + 4, static_cast<std::uint32_t>(value >> 32U));
}

bool goes_back(const LockstepCounts& now, const LockstepCounts& before) {
  return !std::equal(now.bytes.begin(), now.bytes.end(), before.bytes.begin(),
                     [](std::uint64_t a, std::uint64_t b) { return a >= b; });
}

}  // namespace

const char* lockstep_status_text(LockstepStatus status) {
  switch (status) {
    case LockstepStatus::kOk:
      return "ok";
    case LockstepStatus::kTimeout:
      return "the other side does not answer";
    case LockstepStatus::kPeerGone:
      return "the other side is gone";
    case LockstepStatus::kProtocol:
      return "the other side breaks the protocol";
    case LockstepStatus::kFinished:
      return "finished";
    case LockstepStatus::kSystem:
      break;
  }
  return "a system call failed";
}

// ---- Channel ------------------------------------------------------------------------------------

static_assert(kMessage_bytes == 144, "the header states the layout");

LockstepChannel::~LockstepChannel() { close(); }

void LockstepChannel::adopt(int fd) {
  close();
  fd_ = fd;
  filled_ = 0;
}

void LockstepChannel::close() {
  if (fd_ >= 0) {
    ::close(fd_);
    fd_ = -1;
  }
}

LockstepStatus LockstepChannel::send(const LockstepMessage& message, int timeout_ms) {
  if (fd_ < 0) {
    return LockstepStatus::kPeerGone;
  }
  std::array<std::uint8_t, kMessage_bytes> bytes{};
  write_u32_le(bytes.data(), kMagic);
  write_u32_le(bytes.data() + 4, message.kind);
  write_u64_le(bytes.data() + 8, static_cast<std::uint64_t>(message.t_us));
  for (std::size_t i = 0; i < message.counts.bytes.size(); ++i) {
    write_u64_le(bytes.data() + 16 + 8 * i, message.counts.bytes[i]);
  }
  const Deadline deadline(timeout_ms);
  std::size_t sent = 0;
  while (sent < bytes.size()) {
    const ssize_t some = ::send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (some > 0) {
      sent += static_cast<std::size_t>(some);
      continue;
    }
    if (errno == EPIPE || errno == ECONNRESET) {
      return LockstepStatus::kPeerGone;
    }
    if (errno != EAGAIN && errno != EINTR) {
      return LockstepStatus::kSystem;
    }
    if (deadline.over()) {
      return LockstepStatus::kTimeout;
    }
    pollfd wait{fd_, POLLOUT, 0};
    (void)::poll(&wait, 1, deadline.left_ms());
  }
  return LockstepStatus::kOk;
}

LockstepStatus LockstepChannel::receive(LockstepMessage& message, int timeout_ms) {
  if (fd_ < 0) {
    return LockstepStatus::kPeerGone;
  }
  const Deadline deadline(timeout_ms);
  while (filled_ < buffer_.size()) {
    const ssize_t some = ::recv(fd_, buffer_.data() + filled_, buffer_.size() - filled_, 0);
    if (some > 0) {
      filled_ += static_cast<std::size_t>(some);
      continue;
    }
    if (some == 0 || errno == ECONNRESET) {
      return LockstepStatus::kPeerGone;
    }
    if (errno != EAGAIN && errno != EINTR) {
      return LockstepStatus::kSystem;
    }
    if (deadline.over()) {
      return LockstepStatus::kTimeout;
    }
    pollfd wait{fd_, POLLIN, 0};
    (void)::poll(&wait, 1, deadline.left_ms());
  }
  filled_ = 0;
  if (read_u32_le(buffer_.data()) != kMagic) {
    return LockstepStatus::kProtocol;
  }
  message.kind = read_u32_le(buffer_.data() + 4);
  message.t_us = static_cast<base::TimeUs>(read_u64_le(buffer_.data() + 8));
  for (std::size_t i = 0; i < message.counts.bytes.size(); ++i) {
    message.counts.bytes[i] = read_u64_le(buffer_.data() + 16 + 8 * i);
  }
  return LockstepStatus::kOk;
}

// ---- Vehicle ------------------------------------------------------------------------------------

bool LockstepClient::connect(const std::string& path, int timeout_ms) {
  const Deadline deadline(timeout_ms);
  int number = 0;
  do {
    const int fd = connect_local(path);
    if (fd >= 0) {
      channel_.adopt(fd);
      granted_ = false;
      last_counts_ = {};
      return true;
    }
    number = errno;
    (void)::poll(nullptr, 0, std::min(20, deadline.left_ms()));
  } while (!deadline.over());
  error_ = "\"" + path + "\": no emulator listens there: " + local_socket_error(number);
  return false;
}

LockstepStatus LockstepClient::wait_grant(base::TimeUs& t_us, LockstepCounts& written,
                                          int timeout_ms) {
  LockstepMessage message;
  if (const LockstepStatus status = channel_.receive(message, timeout_ms);
      status != LockstepStatus::kOk) {
    return status;
  }
  if (message.kind == kFinish) {
    return LockstepStatus::kFinished;
  }
  const bool back = granted_ && (message.t_us < last_t_us_ || message.t_us < 0);
  if (message.kind != kGrant || back || goes_back(message.counts, last_counts_)) {
    return LockstepStatus::kProtocol;
  }
  granted_ = true;
  last_t_us_ = message.t_us;
  last_counts_ = message.counts;
  t_us = message.t_us;
  written = message.counts;
  return LockstepStatus::kOk;
}

LockstepStatus LockstepClient::answer(base::TimeUs t_us, const LockstepCounts& requested,
                                      int timeout_ms) {
  return channel_.send({kAnswer, t_us, requested}, timeout_ms);
}

// ---- Emulator -----------------------------------------------------------------------------------

bool LockstepServer::listen(const std::string& path) {
  error_ = listener_.listen(path);
  return error_.empty();
}

LockstepStatus LockstepServer::accept(int timeout_ms) {
  const Deadline deadline(timeout_ms);
  while (true) {
    const int fd = listener_.accept();
    if (fd >= 0) {
      channel_.adopt(fd);
      last_requested_ = {};
      return LockstepStatus::kOk;
    }
    if (errno != EAGAIN && errno != EINTR) {
      error_ = std::string("accept: ") + std::strerror(errno);
      return LockstepStatus::kSystem;
    }
    if (deadline.over()) {
      return LockstepStatus::kTimeout;
    }
    pollfd wait{listener_.fd(), POLLIN, 0};
    (void)::poll(&wait, 1, deadline.left_ms());
  }
}

LockstepStatus LockstepServer::grant(base::TimeUs t_us, const LockstepCounts& written,
                                     int timeout_ms) {
  last_t_us_ = t_us;
  return channel_.send({kGrant, t_us, written}, timeout_ms);
}

LockstepStatus LockstepServer::wait_answer(LockstepCounts& requested, int timeout_ms) {
  LockstepMessage message;
  if (const LockstepStatus status = channel_.receive(message, timeout_ms);
      status != LockstepStatus::kOk) {
    return status;
  }
  if (message.kind != kAnswer || message.t_us != last_t_us_ ||
      goes_back(message.counts, last_requested_)) {
    return LockstepStatus::kProtocol;
  }
  last_requested_ = message.counts;
  requested = message.counts;
  return LockstepStatus::kOk;
}

LockstepStatus LockstepServer::finish(int timeout_ms) {
  return channel_.send({kFinish, last_t_us_, {}}, timeout_ms);
}

}  // namespace leadline::hal
