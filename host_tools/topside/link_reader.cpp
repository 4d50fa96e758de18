#include "host_tools/topside/link_reader.hpp"

#include <cerrno>
#include <cstring>
#include <utility>

#include <poll.h>
#include <unistd.h>

#include "hal/linux/uri.hpp"
#include "host_tools/exit_codes.hpp"

namespace leadline::host {
namespace {

// A whole read of a socket at a time, and no more of them before the clock is looked at.
constexpr std::size_t kRead_bytes = 65536;
constexpr int kReadsPerRound = 64;

}  // namespace

LinkReader::LinkReader(const std::string& uri, const std::string& command)
    : uri_(uri), buffer_(kRead_bytes) {
  const hal::UriResult parsed = hal::parse_uri(uri);
  if (!parsed.ok()) {
    throw HostError(ExitCode::kUsage, command + ": --link: " + parsed.error);
  }
  is_file_ = parsed.spec.scheme == hal::UriScheme::kFile;
  const std::string problem = hal::device_problem(parsed.spec, hal::FileUse::kRead, !is_file_);
  if (!problem.empty()) {
    throw HostError(ExitCode::kInput, command + ": --link: " + problem);
  }
  if (is_file_ && access(parsed.spec.path.c_str(), R_OK) != 0) {
    throw HostError(ExitCode::kInput,
                    parsed.spec.path + ": cannot be read: " + std::strerror(errno));
  }
  hal::PortResult made = hal::make_port(parsed.spec, hal::FileUse::kRead);
  if (!made.port) {
    throw HostError(ExitCode::kUsage, command + ": --link: " + made.error);
  }
  port_ = std::move(made.port);
}

void LinkReader::share(const std::string& socket_path) {
  if (is_file_) {
    throw HostError(ExitCode::kUsage, "--share: " + uri_ + " is no link to share");
  }
  share_ = std::make_unique<LinkShare>(socket_path);
}

void LinkReader::feed(Receiver* receiver, const std::uint8_t* data, std::size_t size_bytes) {
  try {
    receiver->feed(data, size_bytes);
  } catch (const HostError&) {
    // A vehicle of another major is told why nobody listens.
    if (!is_file_) {
      (void)send(hello_request_frame());
    }
    throw;
  }
}

std::size_t LinkReader::read_some(Receiver* receiver, double now_s) {
  const std::size_t got =
      read_bytes(now_s, [this, receiver](const std::uint8_t* data, std::size_t size_bytes) {
        feed(receiver, data, size_bytes);
      });
  if (share_) {
    share_->serve([this](const std::vector<std::uint8_t>& frame) { return send(frame); },
                  *receiver);
  }
  return got;
}

bool LinkReader::send(const std::vector<std::uint8_t>& frame) {
  return port_->write_room() >= frame.size() &&
         port_->write(frame.data(), frame.size()) == frame.size();
}

std::size_t LinkReader::read_bytes(
    double now_s, const std::function<void(const std::uint8_t*, std::size_t)>& take) {
  const auto now_us = static_cast<base::TimeUs>(now_s * 1e6);
  port_->service(now_us);
  const std::vector<std::uint8_t> held = std::exchange(held_, {});
  std::size_t sum = held.size();
  if (!held.empty()) {
    if (share_) {
      share_->give(held.data(), held.size());
    }
    take(held.data(), held.size());
  }
  for (int k = 0; k < kReadsPerRound; ++k) {
    base::TimeUs ignored_us = 0;
    const std::size_t got = port_->read(now_us, buffer_.data(), buffer_.size(), ignored_us);
    if (got == 0) {
      break;
    }
    sum += got;
    if (share_) {
      share_->give(buffer_.data(), got);
    }
    take(buffer_.data(), got);
  }
  return sum;
}

void LinkReader::hold(double now_s) {
  const auto now_us = static_cast<base::TimeUs>(now_s * 1e6);
  // Not into buffer_: what stands there may be under work.
  std::vector<std::uint8_t> piece(is_file_ ? 0 : kRead_bytes);
  while (!piece.empty() && held_.size() + piece.size() <= kMaxHeld_bytes) {
    base::TimeUs ignored_us = 0;
    const std::size_t got = port_->read(now_us, piece.data(), piece.size(), ignored_us);
    if (got == 0) {
      return;
    }
    held_.insert(held_.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(got));
  }
}

void LinkReader::ask_again(Receiver* receiver, double now_s) {
  if (is_file_) {
    return;
  }
  const auto now_us = static_cast<base::TimeUs>(now_s * 1e6);
  for (std::vector<std::uint8_t> frame = receiver->uplink(now_us); !frame.empty();
       frame = receiver->uplink(now_us)) {
    (void)send(frame);
  }
}

void LinkReader::wait(int timeout_ms) const {
  pollfd wanted{port_->poll_fd(), port_->poll_events(), 0};
  (void)poll(&wanted, wanted.fd >= 0 ? 1 : 0, timeout_ms);
}

std::string LinkReader::port_change() {
  const std::string change = is_file_ ? "" : watch_.change(*port_);
  return change.empty() || port_->local_port() != 0 ? "" : uri_ + ": " + change;
}

const char* severity_word(proto::Severity severity) {
  switch (severity) {
    case proto::Severity::kInfo:
      return "";
    case proto::Severity::kWarning:
      return "warning: ";
    case proto::Severity::kError:
      return "error: ";
  }
  return "";
}

}  // namespace leadline::host
