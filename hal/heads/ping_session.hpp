// What the codecs of all Ping protocol heads share: frames in, one request at a time out, and what happens
// when the answer is damaged or does not come.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "hal/heads/exchange.hpp"
#include "hal/heads/ping_protocol.hpp"
#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

/// What the head said about itself; zero until it did.
struct PingDeviceInfo {
  std::uint8_t device_type;
  std::uint8_t device_revision;
  std::uint8_t firmware[3];  ///< major, minor, patch
  std::uint8_t protocol[3];
};

/// What has become of the request under way.
enum class PingAnswer : std::uint8_t {
  kWaiting,  ///< or nothing is under way
  kDamaged,  ///< something came that is no frame, and then no more: ask again
  kSilent,   ///< nothing came in time
};

/// One request at a time, on a line that may be half-duplex. A request is given up when its time is over and
/// no bytes are coming in, or, before that, when a damaged frame or half a one came and the line has been
/// quiet since: a lost byte costs no time-out. Each failure in a row makes it more patient, so a line or a
/// device slower than thought is heard in the end. Times that go back restart a wait instead of stretching
/// it. Every call O(1) but next().
class PingSession {
 public:
  /// Largest request of any head.
  static constexpr std::size_t kMaxRequest_bytes = 40;
  /// Line silent for so long behind a damaged frame: no more of it comes. USB adapters hand over bytes every
  /// 16 ms.
  static constexpr std::int64_t kQuiet_us = 30'000;
  /// Beyond listening and transmission: the head's own time, adapters, the cycle of the vehicle.
  static constexpr std::int64_t kMargin_us = 100'000;
  static constexpr std::uint8_t kMaxInARow = 5;

  /// `device_id`: listen to this source only; 0: any.
  PingSession(PingTable table, PingDevice device, std::uint8_t device_id)
      : parser_(table), kind_(device), device_id_(device_id) {}

  void feed(std::uint8_t byte, base::TimeUs t_arrival_us);
  /// The next intact frame from this device; device information and protocol version are noted.
  [[nodiscard]] bool next(PingFrame& frame);
  /// The port was closed and opened again: half a frame and the request under way are forgotten.
  void restart();

  [[nodiscard]] CodecCounters& counters() { return parser_.counters(); }
  [[nodiscard]] const CodecCounters& counters() const { return parser_.counters(); }
  [[nodiscard]] const PingDeviceInfo& device() const { return info_; }
  [[nodiscard]] FrameView last_frame() const { return parser_.last_frame(); }
  /// The head is what its codec is for. One that does not say counts as such.
  [[nodiscard]] bool right_device() const;

  /// A request has been sent, to be answered within `timeout_us`.
  void asked(base::TimeUs now_us, std::int64_t timeout_us);
  /// The head sends by itself; the next frame is due within `timeout_us`. A damaged one is not asked for.
  void expect(base::TimeUs now_us, std::int64_t timeout_us);
  /// Nothing is under way any more. `in_full`: what was asked for has come.
  void answered(bool in_full);
  [[nodiscard]] bool waiting() const { return waiting_; }
  /// Looks at the request under way; says kDamaged or kSilent once, counts it, and gives it up.
  [[nodiscard]] PingAnswer watch(base::TimeUs now_us);
  /// Requests without any answer in a row.
  [[nodiscard]] std::uint8_t silences() const { return silences_; }
  void forget_silences() { silences_ = 0; }

  /// Whether a poll every `interval_us` (0: as often as answered) is due.
  [[nodiscard]] bool due(base::TimeUs now_us, std::int64_t interval_us);
  /// A due poll went out.
  void polled(std::int64_t interval_us) { next_poll_us_ += interval_us; }
  /// The poll that failed is due again.
  void poll_again(base::TimeUs now_us) { next_poll_us_ = now_us; }

  /// Writes a request for a message; its size, 0 without room.
  [[nodiscard]] std::size_t write_question(std::uint16_t id, std::uint8_t* out,
                                           std::size_t capacity) const;
  /// A refusal of that question: old firmware does not know every one.
  [[nodiscard]] static bool refuses(const PingFrame& nack, std::uint16_t question);

 private:
  void begin_wait(base::TimeUs now_us, std::int64_t timeout_us, bool asked);

  PingParser parser_;
  PingDevice kind_;
  std::uint8_t device_id_;
  PingDeviceInfo info_{};
  bool waiting_ = false;
  bool asked_ = false;  ///< by us, not sent by itself
  bool heard_ = false;  ///< a byte since the request
  std::uint8_t silences_ = 0;
  std::uint8_t damages_ = 0;          ///< damaged answers in a row
  std::uint32_t damaged_before_ = 0;  ///< damaged frames when the request went out
  std::int64_t timeout_us_ = 0;
  base::TimeUs t_asked_us_ = 0;
  base::TimeUs t_byte_us_ = 0;  ///< last byte
  base::TimeUs next_poll_us_ = 0;
};

/// Base of a head's codec: `Codec` gives take(frame, ping) and has the session start over in begin_again().
template <class Codec>
class PingHead {
 public:
  static constexpr std::size_t kMaxRequest_bytes = PingSession::kMaxRequest_bytes;

  /// Takes one byte; true when it completed a record. Take what else came with it by next():
  ///   if (codec.feed(byte, t, ping)) { do { use(ping); } while (codec.next(ping)); }
  /// Cost: PingParser::feed(), and O(samples) per profile. Spans point into the codec until the next call.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping) {
    session_.feed(byte, t_arrival_us);
    return next(ping);
  }
  [[nodiscard]] bool next(base::Ping& ping) {
    PingFrame frame{};
    while (session_.next(frame)) {
      if (static_cast<Codec*>(this)->take(frame, ping)) {
        ++session_.counters().records;
        return true;
      }
    }
    return false;
  }
  /// The port was closed and opened again: forgets half a frame and starts over.
  void restart() {
    session_.restart();
    static_cast<Codec*>(this)->begin_again();
  }
  [[nodiscard]] const PingDeviceInfo& device() const { return session_.device(); }
  [[nodiscard]] const CodecCounters& counters() const { return session_.counters(); }
  /// The frame of the last record, until the next byte: for whoever shows what a model leaves.
  [[nodiscard]] FrameView frame() const { return session_.last_frame(); }

 private:
  friend Codec;
  /// In place: a session of its own to copy from is kilobytes of stack.
  PingHead(PingTable table, PingDevice device, std::uint8_t device_id)
      : session_(table, device, device_id) {}

  PingSession session_;
};

}  // namespace leadline::hal
