#include "hal/linux/can_port.hpp"

#include <cerrno>
#include <cstring>
#include <ctime>

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include <linux/can/raw.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include "hal/linux/bus_ports.hpp"

namespace leadline::hal {
namespace {

static_assert(CAN_EFF_FLAG == kCanExtended && CAN_RTR_FLAG == kCanRemote &&
                  CAN_ERR_FLAG == kCanError,
              "the kernel's flags are those of can_frame.hpp");

constexpr std::size_t kMaxWriteFrames = 64;
constexpr int kReceiveBuffer_bytes = 1 << 20;

/// CAN_ERR_BUSERROR stays off: a broken wire floods with them.
constexpr can_err_mask_t kErrors =
    CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED;

/// Appends an attribute of rtnetlink to `message`; returns it.
rtattr* append(nlmsghdr* message, unsigned short type, const void* data, std::size_t size) {
  // By way of void: the place is aligned, though bytes on ARM are not by their type.
  void* const place = reinterpret_cast<char*>(message) + NLMSG_ALIGN(message->nlmsg_len);
  auto* attribute = static_cast<rtattr*>(place);
  attribute->rta_type = type;
  attribute->rta_len = static_cast<unsigned short>(RTA_LENGTH(size));
  if (size > 0) {
    std::memcpy(RTA_DATA(attribute), data, size);
  }
  message->nlmsg_len =
      static_cast<std::uint32_t>(NLMSG_ALIGN(message->nlmsg_len) + RTA_ALIGN(attribute->rta_len));
  return attribute;
}

void close_nest(const nlmsghdr* message, rtattr* nest) {
  const char* end = reinterpret_cast<const char*>(message) + message->nlmsg_len;
  nest->rta_len = static_cast<unsigned short>(end - reinterpret_cast<char*>(nest));
}

}  // namespace

CanPort::CanPort(const UriSpec& spec) : interface_(spec.path), filters_(spec.can_filters) {}

std::size_t CanPort::write_room() const { return fd_ >= 0 ? kMaxWriteFrames * kCanFrame_bytes : 0; }

bool CanPort::set_up(int fd, int interface_index) {
  std::array<can_filter, kMaxCanFilters> filters{};
  for (std::size_t i = 0; i < filters_.size(); ++i) {
    // The kind of identifier is part of the filter, and no remote request passes.
    filters[i] = {filters_[i].id, filters_[i].mask | CAN_EFF_FLAG | CAN_RTR_FLAG};
  }
  const auto filters_bytes = static_cast<socklen_t>(filters_.size() * sizeof(can_filter));
  if (filters_bytes > 0 &&
      ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), filters_bytes) != 0) {
    return false;
  }
  const can_err_mask_t errors = kErrors;
  const int on = 1;
  const int buffer = kReceiveBuffer_bytes;
  // Without these it works, only less well.
  (void)::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors);
  (void)::setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  (void)::setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
  (void)::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = interface_index;
  if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return false;
  }
  // An interface that is down takes a bind: its state is the error that waits in the socket.
  int pending = 0;
  socklen_t size = sizeof pending;
  if (::getsockopt(fd, SOL_SOCKET, SO_ERROR, &pending, &size) == 0 && pending != 0) {
    errno = pending;
    return false;
  }
  return true;
}

bool CanPort::open_now() {
  interface_index_ = static_cast<int>(::if_nametoindex(interface_.c_str()));
  if (interface_index_ == 0) {
    return false;
  }
  if (bus_off_) {
    ask_for_restart();
  }
  const int fd = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (fd < 0) {
    return false;
  }
  if (!set_up(fd, interface_index_)) {
    const int number = errno;
    ::close(fd);
    errno = number;
    return false;
  }
  fd_ = fd;
  kernel_drops_ = 0;
  counters_.opens += 1;
  return true;
}

/// As `ip link set IFACE type can restart`. What comes of it shows on the bus: nobody waits for an answer.
void CanPort::ask_for_restart() {
  const int fd = ::socket(AF_NETLINK, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, NETLINK_ROUTE);
  if (fd < 0) {
    return;
  }
  alignas(nlmsghdr) std::array<char, 256> buffer{};
  void* const bytes = buffer.data();
  auto* message = static_cast<nlmsghdr*>(bytes);
  message->nlmsg_len = NLMSG_LENGTH(sizeof(ifinfomsg));
  message->nlmsg_type = RTM_NEWLINK;
  message->nlmsg_flags = NLM_F_REQUEST;
  void* const body = buffer.data() + NLMSG_HDRLEN;
  auto* info = static_cast<ifinfomsg*>(body);
  info->ifi_family = AF_UNSPEC;
  info->ifi_index = interface_index_;
  const std::uint32_t restart = 1;
  rtattr* link = append(message, IFLA_LINKINFO, nullptr, 0);
  (void)append(message, IFLA_INFO_KIND, "can", 3);
  rtattr* data = append(message, IFLA_INFO_DATA, nullptr, 0);
  (void)append(message, IFLA_CAN_RESTART, &restart, sizeof restart);
  close_nest(message, data);
  close_nest(message, link);
  (void)!::send(fd, buffer.data(), message->nlmsg_len, 0);
  ::close(fd);
}

void CanPort::service(base::TimeUs now_us) {
  now_us_ = now_us;
  if (fd_ >= 0 || !backoff_.due(now_us)) {
    return;
  }
  if (!open_now()) {
    errno_ = errno;
    backoff_.failed(now_us);
    return;
  }
  if (!bus_off_) {
    backoff_.succeeded();
  }
}

void CanPort::lose(int number) {
  ::close(fd_);
  fd_ = -1;
  errno_ = number;
  counters_.losses += 1;
  backoff_.failed(now_us_);
}

void CanPort::take_error(const CanFrame& frame) {
  ++can_counters_.error_frames;
  const std::uint32_t classes = frame.id & CAN_ERR_MASK;
  can_counters_.restarts += (classes & CAN_ERR_RESTARTED) != 0 ? 1U : 0U;
  can_counters_.tx_timeouts += (classes & CAN_ERR_TX_TIMEOUT) != 0 ? 1U : 0U;
  const bool overflow =
      (classes & CAN_ERR_CRTL) != 0 &&
      (frame.data[1] & (CAN_ERR_CRTL_RX_OVERFLOW | CAN_ERR_CRTL_TX_OVERFLOW)) != 0;
  can_counters_.overflows += overflow ? 1U : 0U;
  if ((classes & CAN_ERR_BUSOFF) != 0) {
    ++can_counters_.bus_offs;
    bus_off_ = true;
    lose(ENETDOWN);
  }
}

std::size_t CanPort::read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                          base::TimeUs& t_arrival_us) {
  now_us_ = now_us;
  if (fd_ < 0 || capacity < kCanFrame_bytes) {
    return 0;
  }
  can_frame raw{};
  iovec piece{&raw, sizeof raw};
  alignas(cmsghdr) std::array<std::uint8_t, 128> control{};
  msghdr message{};
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t size = ::recvmsg(fd_, &message, 0);
  if (size < 0) {
    if (errno != EAGAIN && errno != EINTR) {
      counters_.errors += 1;
      lose(errno);
    }
    return 0;
  }
  if (size != CAN_MTU || raw.can_dlc > kMaxCanData_bytes) {
    counters_.errors += 1;
    return 0;
  }
  t_arrival_us = now_us;
  for (cmsghdr* part = CMSG_FIRSTHDR(&message); part != nullptr;
       part = CMSG_NXTHDR(&message, part)) {
    if (part->cmsg_level == SOL_SOCKET && part->cmsg_type == SO_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(part), sizeof stamp);
      const std::int64_t stamp_ns = std::int64_t{stamp.tv_sec} * 1'000'000'000 + stamp.tv_nsec;
      t_arrival_us = kernel_stamp_us(now_us, CLOCK_REALTIME, stamp_ns);
    } else if (part->cmsg_level == SOL_SOCKET && part->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t drops = 0;
      std::memcpy(&drops, CMSG_DATA(part), sizeof drops);
      counters_.bytes_dropped_in += std::uint64_t{drops - kernel_drops_} * kCanFrame_bytes;
      kernel_drops_ = drops;
    }
  }
  CanFrame frame{raw.can_id, raw.can_dlc, {}};
  std::memcpy(frame.data.data(), raw.data, frame.data.size());
  write_can_frame(frame, out);
  counters_.bytes_in += kCanFrame_bytes;
  if ((frame.id & kCanError) != 0) {
    take_error(frame);
  } else if (bus_off_) {
    bus_off_ = false;
    backoff_.succeeded();
  }
  return kCanFrame_bytes;
}

bool CanPort::send_frame(const std::uint8_t* bytes) {
  CanFrame frame{};
  if (fd_ < 0 || !read_can_frame(bytes, frame)) {
    return false;
  }
  can_frame raw{};
  raw.can_id = frame.id;
  raw.can_dlc = frame.length_bytes;
  std::memcpy(raw.data, frame.data.data(), frame.data.size());
  if (::send(fd_, &raw, sizeof raw, 0) == static_cast<ssize_t>(sizeof raw)) {
    return true;
  }
  errno_ = errno;
  const bool full = errno == EAGAIN || errno == ENOBUFS || errno == EINTR;
  counters_.errors += full ? 0U : 1U;
  if (!full && errno != EINVAL) {
    lose(errno);
  }
  return false;
}

std::size_t CanPort::write(const std::uint8_t* data, std::size_t size) {
  std::size_t taken = 0;
  for (std::size_t i = 0; i + kCanFrame_bytes <= size; i += kCanFrame_bytes) {
    taken += send_frame(data + i) ? kCanFrame_bytes : 0;
  }
  counters_.bytes_out += taken;
  counters_.bytes_dropped_out += size - taken;
  return taken;
}

}  // namespace leadline::hal
