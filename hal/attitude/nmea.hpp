// NMEA 0183 sentences of attitude, heading, depth, position and time sensors: HDG, HDM, HDT, PASHR, PHTRO,
// PRDID, PRVAT, DBT, DPT, GGA, GLL, RMC, ROT, VTG, VHW, ZDA. One record per sentence with whatever the sentence holds; one that
// is intact and knows nothing is a record whose `fields` are 0.
//
//   '$' talker and type, fields between commas, '*' and the XOR of all bytes between in hex, CR LF
//
// Any two letters of talker; upper- or lower-case checksum; CR, LF, both or none behind it. Decimal text
// becomes integers exactly (up to nine decimals, the tenth rounds).
//
// | sentence | becomes |
// |---|---|
// | HDG | magnetic heading, the sentence's deviation applied (east adds); with `use_variation` and a
// |       variation in the sentence, true heading |
// | HDM, HDT | magnetic, true heading |
// | PASHR (attitude form: field 3 is T) | true heading, roll (positive starboard down), pitch (positive
// |       bow up), their sigmas, time of day; heave is not a pose of the vehicle and is left |
// | PHTRO | pitch (M: bow up, P: bow down), roll (T: port side up, B: port side down) |
// | PRDID | pitch, roll, heading (the sentence does not say of which north: `prdid_true`) |
// | PRVAT | altitude; pressure from dBar, or depth from Metres |
// | DBT, DPT | altitude below the transducer; DPT's offset is left (it belongs to the lever arm) |
// | GGA | latitude, longitude, time of day; without a fix nothing. Quality from the fix: 4 RTK 255,
// |       5 float 224, 2 differential and 3 192, 1 plain 160, 6 dead reckoning 64. Its altitude is above
// |       the geoid and is left |
// | GLL | latitude, longitude, time of day; passed over once a GGA was heard: it says the same without a
// |       quality |
// | RMC | date and time; velocity from speed and course; latitude, longitude unless a GGA was heard |
// | ROT | yaw rate, clockwise positive; without status A nothing |
// | ZDA | date and time |
// | VTG | velocity north and east (course over ground, true) |
// | VHW | forward speed through the water; its headings are those of HDG and HDT and are left |
//
// A distance of 0 to the bottom is "nothing heard" with all of these and is left out.
//
// PRVAT does not say whether its pressure is absolute. The vendor's example (10.073 dBar on the bench)
// is, and that is the default; a tared sensor is `gauge`, and the reference is added.
//
// Facts: NMEA 0183; sentences of the makers as in the product's device notes (Valeport VA500 manual 4.1).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

/// Plain integers.
struct NmeaConfig {
  bool require_checksum = true;  ///< false: also take sentences that have none
  bool use_variation = false;  ///< HDG: apply its own variation; false: one for all, the consumer's
  bool prdid_true = false;     ///< PRDID's heading is of true north, otherwise magnetic
  bool gauge_pressure = false;                ///< PRVAT's pressure has the reference taken off
  std::int32_t gauge_reference_pa = 101'325;  ///< added to gauge pressure
  std::int32_t byte_time_ns = 0;  ///< per byte on the line (4800 baud: 2083333); 0: in the latency
};

/// What the codec has seen since it was made. Never decremented; wraps at 2^32. Every '$' ends in
/// exactly one of these, `unfinished` included.
struct NmeaCounters {
  std::uint32_t records;  ///< delivered, with something in them
  std::uint32_t ignored;  ///< intact, but not one of ours
  std::uint32_t
      no_data;  ///< ours, but says "nothing known" (empty fields, no fix): delivered empty
  std::uint32_t bad_checksum;
  std::uint32_t no_checksum;
  std::uint32_t bad_field;  ///< text that is no number, or a number outside its range
  std::uint32_t bad_byte;   ///< a byte that no sentence has
  std::uint32_t too_long;
  std::uint32_t unfinished;  ///< a new sentence began inside
};

/// Bytes to samples. One object per port; not reentrant. No heap, no clock.
class NmeaCodec {
 public:
  /// From '$' to the checksum. The standard says 80; PASHR passes that.
  static constexpr std::size_t kMaxSentence_bytes = 160;

  explicit NmeaCodec(const NmeaConfig& config) : config_(config) {}

  /// Takes one byte; true when it completed a record. `sample.t_us` is the arrival of the sentence's
  /// last byte less its transmission (byte_time_ns). O(1), O(sentence) at its end.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample);

  /// The port was closed and opened again: forgets half a sentence.
  void restart();

  [[nodiscard]] const NmeaCounters& counters() const { return counters_; }
  /// The sentence of the last record without '$' and line end, until the next byte: for whoever shows what
  /// navigation leaves.
  [[nodiscard]] FrameView frame() const;

 private:
  [[nodiscard]] bool finish(base::NavSample& sample);

  NmeaConfig config_;
  std::array<char, kMaxSentence_bytes> text_{};
  std::size_t size_ = 0;          ///< bytes behind '$'
  std::size_t record_bytes_ = 0;  ///< of the sentence that became the last record
  bool inside_ = false;
  bool saw_gga_ = false;
  base::TimeUs t_last_us_ = 0;
  NmeaCounters counters_{};
};

}  // namespace leadline::hal
