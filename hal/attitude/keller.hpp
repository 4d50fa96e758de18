// Keller pressure transmitters (Series 30 and relatives) on RS-485: Modbus RTU, or the maker's own bus.
//
// Modbus RTU: function 3, singles with the high register first.
//   0x0100: P1 in bar and TOB1 in deg C in one read of four registers (the default)
//   0x0002: P1 alone (`pressure_only`, for devices without the block)
// The answer does not name its registers: four are the block, two are P1. A Modbus port of hal/linux carries
// the same bytes, for Modbus TCP as well.
//
// Keller bus: address, function, data, CRC of Modbus but its high byte first.
//   48 start (answer of 6 bytes), 73 read channel (1: P1, 4: TOB1; answer: single, status)
//   function | 0x80 with a code is a refusal; code 32 asks for another start
//
// Requests that come back (local echo) or stand in a recorded bus are known and passed over. Other
// addresses are counted.
//
// Not stated in public: whether a device measures absolute pressure (types PAA do, PA and PR do not):
// `gauge_pressure`; the address as delivered (1; 250 answers to all, alone on its line).
//
// A value is taken when it is a number and within what such a device can measure (NaN is how it says
// that a sensor failed); an answer without one is a record whose `fields` are 0. Its status byte other
// than 0 on the Keller bus is a value that the device calls faulty.
//
// Facts: EnviroDIY/KellerModbus; LSTS/dune src/Sensors/Keller.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

enum class KellerBus : std::uint8_t {
  kModbusRtu = 0,
  kKellerBus = 1,
  kEither = 2,  ///< a recording: its functions tell them apart; nothing is asked
};

/// Plain integers.
struct KellerConfig {
  KellerBus bus = KellerBus::kModbusRtu;
  std::uint8_t address = 1;                  ///< 1 .. 250; 0: all are heard, and nothing is asked
  bool pressure_only = false;                ///< ask for P1 alone
  bool gauge_pressure = false;               ///< the device has the air's pressure taken off
  std::int32_t reference_pa = 101'325;       ///< added to gauge pressure
  std::int32_t poll_interval_us = 100'000;   ///< between requests, 10'000 or more
  std::int32_t answer_timeout_us = 300'000;  ///< a request without an answer until then is given up
  std::int32_t byte_time_ns = 0;  ///< per byte on the line (9600 baud: 1041667); 0: in the latency
};

/// Bytes to samples, and the polls. One object per port; not reentrant. No heap, no clock. About 1 KiB.
///
/// The sample's instant is its arrival less the transmission of the answer. Counters: `ignored` are
/// requests heard and answers to anything else; `nacks` refusals.
class KellerCodec {
 public:
  /// Largest request; a smaller buffer gets nothing.
  static constexpr std::size_t kMaxRequest_bytes = 8;

  /// Values outside their range are limited to it.
  explicit KellerCodec(const KellerConfig& config);

  /// Takes one byte; true when it completed a record. O(1), O(frame) at a frame's end.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample);
  /// What else the last byte completed.
  [[nodiscard]] bool next(base::NavSample& sample);
  /// Bytes that the device is owed now: 0, or one whole request. Nothing is sent while an answer is due.
  [[nodiscard]] std::size_t request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);
  /// The port was closed and opened again.
  void restart();

  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  /// Of the answers here none is longer; a frame that claims more is none.
  static constexpr std::size_t kMaxFrame_bytes = 64;
  /// Silence inside of a frame: the line's own limit is 3.5 characters, what USB adapters add is more.
  static constexpr base::TimeUs kMaxGap_us = 100'000;
  static constexpr std::uint8_t kPressureChannel = 1;
  static constexpr std::uint8_t kTemperatureChannel = 4;

  [[nodiscard]] bool take(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] bool take_modbus(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] bool take_keller_bus(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] bool waiting(base::TimeUs now_us);
  void begin(const FrameBytes& frame, base::NavSample& sample) const;
  void take_pressure(const std::uint8_t* bytes, base::NavSample& sample) const;
  static void take_temperature(const std::uint8_t* bytes, base::NavSample& sample);
  [[nodiscard]] std::size_t write_modbus(std::uint8_t* out) const;
  [[nodiscard]] std::size_t write_keller_bus(std::uint8_t* out);

  KellerConfig config_;
  Framer<2 * kMaxFrame_bytes> framer_{kMaxGap_us};
  CodecCounters counters_{};
  bool polled_ = false;   ///< request() was asked for at least one
  bool asked_ = false;    ///< a request is under way
  bool started_ = false;  ///< Keller bus: the device took function 48
  /// Keller bus: channel of the request under way, or heard last. The answer does not name it.
  std::uint8_t channel_ = kPressureChannel;
  bool turned_ =
      false;  ///< Keller bus: a channel was asked for: pressure and temperature take turns
  base::TimeUs t_asked_us_ = 0;
};

}  // namespace leadline::hal
