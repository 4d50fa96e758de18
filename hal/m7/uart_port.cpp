#include "hal/m7/uart_port.hpp"

namespace leadline::hal::m7 {
namespace {

constexpr std::uint32_t kData = 0x0U;
constexpr std::uint32_t kState = 0x4U;
constexpr std::uint32_t kControl = 0x8U;
constexpr std::uint32_t kInterruptClear = 0xCU;
constexpr std::uint32_t kDivider = 0x10U;

constexpr std::uint32_t kStateReceiveFull = 1U << 1U;
constexpr std::uint32_t kStateReceiveOverrun = 1U << 3U;
constexpr std::uint32_t kSendEnable = 1U << 0U;
constexpr std::uint32_t kReceiveEnable = 1U << 1U;
constexpr std::uint32_t kSendInterrupt = 1U << 2U;
constexpr std::uint32_t kReceiveInterrupt = 1U << 3U;
constexpr std::uint32_t kClearSend = 1U << 0U;
constexpr std::uint32_t kClearReceive = 1U << 1U;
constexpr std::uint32_t kLeastDivider = 16;
constexpr std::uint32_t kMostDivider = 0xFFFFFU;

static_assert((kSendRing_bytes & (kSendRing_bytes - 1)) == 0, "indices wrap by masking");

}  // namespace

void UartPort::open(const UartPlace& place, std::uint32_t baud, Clock& clock) {
  clock_ = &clock;
  base_ = place.base;
  const std::uint32_t rate = baud == 0 ? kDefaultBaud : baud;
  std::uint32_t divider = (kClock_hz + rate / 2U) / rate;
  divider = divider < kLeastDivider ? kLeastDivider : divider;
  divider = divider > kMostDivider ? kMostDivider : divider;
  reg(base_ + kControl) = 0;
  reg(base_ + kDivider) = divider;
  reg(base_ + kInterruptClear) = kClearSend | kClearReceive;
  reg(base_ + kControl) = kSendEnable | kReceiveEnable | kSendInterrupt | kReceiveInterrupt;
  enable_interrupt(place.rx_interrupt);
  enable_interrupt(place.tx_interrupt);
  counters_.opens += 1;
}

void UartPort::on_receive() {
  reg(base_ + kInterruptClear) = kClearReceive;
  const std::uint32_t state = reg(base_ + kState);
  if ((state & kStateReceiveOverrun) != 0) {
    reg(base_ + kState) = kStateReceiveOverrun;
    ++overruns_;
  }
  if ((state & kStateReceiveFull) == 0) {
    return;
  }
  const auto byte = static_cast<std::uint8_t>(reg(base_ + kData));
  if (received_ring_.push(byte, clock_->now_us())) {
    received_ = received_ + 1U;
  }
}

std::size_t UartPort::read(std::uint8_t* out, std::size_t capacity, base::TimeUs& t_arrival_us) {
  // Copying with the interrupt off costs less than a byte's time for the largest burst that fits the ring in
  // that time: 4096 bytes take some 30,000 instructions, and bytes come one in 2170 clocks.
  constexpr std::size_t kPiece_bytes = 256;
  const std::size_t most = capacity < kPiece_bytes ? capacity : kPiece_bytes;
  const InterruptsOff off;
  const std::size_t size = received_ring_.take(out, most, t_arrival_us);
  counters_.bytes_in += size;
  counters_.bytes_dropped_in = std::uint64_t{received_ring_.dropped()} + overruns_;
  return size;
}

std::size_t UartPort::write_room() const { return kSendRing_bytes - (send_head_ - send_tail_); }

std::size_t UartPort::write(const std::uint8_t* data, std::size_t size) {
  const std::size_t room = write_room();
  const std::size_t taken = size < room ? size : room;
  for (std::size_t i = 0; i < taken; ++i) {
    send_ring_[send_head_ & (kSendRing_bytes - 1)] = data[i];
    send_head_ = send_head_ + 1U;
  }
  counters_.bytes_out += taken;
  counters_.bytes_dropped_out += size - taken;
  const InterruptsOff off;
  if (!sending_) {
    send_next();
  }
  return taken;
}

void UartPort::send_next() {
  sending_ = send_tail_ != send_head_;
  if (sending_) {
    const std::uint8_t byte = send_ring_[send_tail_ & (kSendRing_bytes - 1)];
    send_tail_ = send_tail_ + 1U;
    reg(base_ + kData) = byte;
  }
}

void UartPort::on_sent() {
  reg(base_ + kInterruptClear) = kClearSend;
  send_next();
}

}  // namespace leadline::hal::m7
