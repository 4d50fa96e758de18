#include "hal/linux/modbus_port.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

#include <arpa/inet.h>
#include <modbus/modbus.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/select.h>
#include <unistd.h>

#include "hal/checksums.hpp"
#include "hal/linux/bus_ports.hpp"
#include "hal/linux/socket_ports.hpp"
#include "hal/wire.hpp"

namespace leadline::hal {
namespace {

constexpr std::size_t kCrc_bytes = 2;
constexpr std::size_t kShortest_bytes = 4;   // address, function, CRC
constexpr std::size_t kTcpHeader_bytes = 6;  // in front of the address
constexpr int kIdle_ms = 200;

std::int64_t monotonic_ns() {
  timespec time{};
  (void)::clock_gettime(CLOCK_MONOTONIC, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

void raise_event(int fd) {
  const std::uint64_t one = 1;
  (void)!::write(fd, &one, sizeof one);
}

void clear_event(int fd) {
  std::uint64_t count = 0;
  (void)!::read(fd, &count, sizeof count);
}

bool sealed(const std::uint8_t* bytes, std::size_t size) {
  return crc16_modbus(bytes, size - kCrc_bytes) == read_u16_le(bytes + size - kCrc_bytes);
}

}  // namespace

ModbusPort::ModbusPort(_modbus* context, std::uint8_t unit, bool tcp)
    : context_(context),
      unit_(unit),
      tcp_(tcp),
      request_event_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
      answer_event_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  // The slave's address, which answers are held against; both timeouts: the byte's alone may be off.
  (void)modbus_set_slave(context_, unit_);
  (void)modbus_set_response_timeout(context_, 0, static_cast<std::uint32_t>(kAnswer_us));
  (void)modbus_set_byte_timeout(context_, 0, static_cast<std::uint32_t>(kByte_us));
  (void)modbus_set_error_recovery(context_, MODBUS_ERROR_RECOVERY_NONE);
  thread_ = std::thread([this] { run(); });
}

ModbusPort::~ModbusPort() {
  stop_ = true;
  raise_event(request_event_);
  thread_.join();
  if (up_) {
    modbus_close(context_);
  }
  modbus_free(context_);
  ::close(request_event_);
  ::close(answer_event_);
}

// ---- The vehicle's side -------------------------------------------------------------------------

short ModbusPort::poll_events() const { return POLLIN; }

ModbusCounters ModbusPort::modbus_counters() const {
  return {sent_, answered_, timeouts_, bad_answers_, bad_requests_};
}

std::size_t ModbusPort::write_room() const {
  return state_ == PortState::kOpen && !request_.full ? kMaxFrame_bytes : 0;
}

std::size_t ModbusPort::write(const std::uint8_t* data, std::size_t size) {
  const bool frame =
      size >= kShortest_bytes && size <= kMaxFrame_bytes && data[0] == unit_ && sealed(data, size);
  bad_requests_ += frame ? 0U : 1U;
  if (!frame || !up_ || request_.full) {
    counters_.bytes_dropped_out += size;
    return 0;
  }
  std::memcpy(request_.bytes.data(), data, size);
  request_.size_bytes = size;
  request_.full = true;
  raise_event(request_event_);
  counters_.bytes_out += size;
  return size;
}

std::size_t ModbusPort::read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                             base::TimeUs& t_arrival_us) {
  if (!answer_.full) {
    return 0;
  }
  const std::size_t size = answer_.size_bytes;
  if (size > capacity) {
    return 0;  // stays until there is room
  }
  std::memcpy(out, answer_.bytes.data(), size);
  t_arrival_us = kernel_stamp_us(now_us, CLOCK_MONOTONIC, answer_.stamp_ns);
  clear_event(answer_event_);
  answer_.full = false;
  counters_.bytes_in += size;
  return size;
}

void ModbusPort::service(base::TimeUs /*now_us*/) {
  const PortState now = up_ ? PortState::kOpen : PortState::kClosed;
  if (now != state_) {
    counters_.opens += now == PortState::kOpen ? 1U : 0U;
    counters_.losses += now == PortState::kClosed ? 1U : 0U;
    state_ = now;
  }
  counters_.errors = timeouts_ + bad_answers_;
}

// ---- The thread's side --------------------------------------------------------------------------

bool ModbusPort::wait_for_request(int timeout_ms) {
  pollfd wait{request_event_, POLLIN, 0};
  (void)::poll(&wait, 1, timeout_ms);
  clear_event(request_event_);
  return request_.full && !stop_;
}

bool ModbusPort::connected() {
  if (up_) {
    return true;
  }
  if (modbus_connect(context_) != 0) {
    last_errno_ = errno;
    return false;
  }
  // The library waits with select(), which writes beyond its set for such a descriptor.
  if (modbus_get_socket(context_) >= FD_SETSIZE) {
    modbus_close(context_);
    last_errno_ = EMFILE;
    return false;
  }
  (void)modbus_flush(context_);
  up_ = true;
  return true;
}

void ModbusPort::disconnect(int number) {
  last_errno_ = number;
  modbus_close(context_);
  up_ = false;
}

void ModbusPort::run() {
  std::int64_t wait_us = 0;
  while (!stop_) {
    if (!connected()) {
      wait_us = std::clamp(2 * wait_us, kFirstRetry_us, kLongestRetry_us);
      const std::int64_t until_ns = monotonic_ns() + wait_us * 1000;
      while (!stop_ && monotonic_ns() < until_ns) {
        (void)wait_for_request(static_cast<int>(wait_us / 1000));
      }
      continue;
    }
    wait_us = 0;
    if (wait_for_request(kIdle_ms)) {
      serve();
    }
  }
}

bool ModbusPort::send_request() {
  // What came late belongs to an earlier request.
  (void)modbus_flush(context_);
  const auto size = static_cast<int>(request_.size_bytes - kCrc_bytes);
  ++sent_;
  return modbus_send_raw_request(context_, request_.bytes.data(), size) > 0;
}

void ModbusPort::serve() {
  if (!send_request()) {
    disconnect(errno);
    request_.full = false;
    return;
  }
  std::array<std::uint8_t, MODBUS_MAX_ADU_LENGTH> bytes{};
  const int size = modbus_receive_confirmation(context_, bytes.data());
  const int error = errno;
  // Before the answer is there to be read: who has read it may ask again.
  request_.full = false;
  if (size > 0) {
    deliver(bytes.data(), static_cast<std::size_t>(size));
    return;
  }
  const int number = size < 0 ? error : EMBBADSLAVE;
  if (number == ETIMEDOUT) {
    ++timeouts_;
  } else {
    ++bad_answers_;
  }
  // A stream that lost its frames is begun anew; a line that still stands is only flushed.
  const bool gone = number == ECONNRESET || number == EPIPE || number == EBADF || number == EIO ||
                    number == ENODEV || number == ENXIO || (tcp_ && number != ETIMEDOUT);
  if (gone) {
    disconnect(number);
  } else {
    last_errno_ = number;
    (void)modbus_flush(context_);
  }
}

void ModbusPort::deliver(const std::uint8_t* bytes, std::size_t size_bytes) {
  const std::int64_t stamp_ns = monotonic_ns();
  const std::size_t skipped = tcp_ ? kTcpHeader_bytes : 0;
  const std::size_t body = size_bytes - std::min(skipped, size_bytes);
  const std::size_t total = tcp_ ? body + kCrc_bytes : body;
  if (body < 2 || total > kMaxFrame_bytes || bytes[skipped] != unit_) {
    ++bad_answers_;
    return;
  }
  if (answer_.full) {
    return;  // nobody reads: the older one stays
  }
  std::memcpy(answer_.bytes.data(), bytes + skipped, body);
  if (tcp_) {
    write_u16_le(answer_.bytes.data() + body, crc16_modbus(answer_.bytes.data(), body));
  }
  answer_.size_bytes = total;
  answer_.stamp_ns = stamp_ns;
  ++answered_;
  answer_.full = true;
  raise_event(answer_event_);
}

PortResult make_modbus_port(const UriSpec& spec) {
  const bool tcp = spec.scheme == UriScheme::kModbusTcp;
  modbus_t* context = nullptr;
  if (tcp) {
    UriSpec host = spec;
    host.scheme = UriScheme::kTcp;
    SocketAddress address;
    if (const std::string error = resolve(host, &address); !error.empty()) {
      return {nullptr, error};
    }
    std::array<char, INET6_ADDRSTRLEN> text{};
    const void* const any = &address.storage;
    if (address.storage.ss_family == AF_INET) {
      const auto* v4 = static_cast<const sockaddr_in*>(any);
      (void)::inet_ntop(AF_INET, &v4->sin_addr, text.data(), text.size());
      context = modbus_new_tcp(text.data(), spec.port);
    } else {
      const auto* v6 = static_cast<const sockaddr_in6*>(any);
      (void)::inet_ntop(AF_INET6, &v6->sin6_addr, text.data(), text.size());
      context = modbus_new_tcp_pi(text.data(), std::to_string(spec.port).c_str());
    }
  } else {
    context = modbus_new_rtu(spec.path.c_str(), static_cast<int>(spec.baud), spec.framing.parity, 8,
                             spec.framing.stop_bits);
  }
  if (context == nullptr) {
    return {nullptr, "\"" + uri_text(spec) + "\": " + modbus_strerror(errno)};
  }
  return {std::make_unique<ModbusPort>(context, spec.unit, tcp), ""};
}

}  // namespace leadline::hal
