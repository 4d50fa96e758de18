#include "hal/attitude/tss1.hpp"

#include "hal/angles.hpp"
#include "hal/text_fields.hpp"

namespace leadline::hal {

namespace {

// A character for each column: x hex digit, 9 decimal digit, - sign, Q status, others themselves.
constexpr const char* kColumns = ":xxxxxx -9999Q-9999 -9999\r\n";

constexpr std::size_t kHeave = 8;  // its sign
constexpr std::size_t kStatus = 13;
constexpr std::size_t kRoll = 14;
constexpr std::size_t kPitch = 20;
constexpr std::int32_t kQuarterTurn_cdeg = 9000;

bool is_status(char c) {
  const char letter = upper(c);
  return letter == 'U' || letter == 'G' || letter == 'H' || letter == 'F';
}

bool fits_column(char c, char column) {
  switch (column) {
    case 'x':
      return hex_digit(c) >= 0;
    case '9':
      return is_digit(c);
    case '-':
      return c == '-' || c == ' ';
    case 'Q':
      return is_status(c);
    default:
      return c == column;
  }
}

/// Sign and four digits.
std::int32_t number_at(const char* text) {
  std::int32_t value = 0;
  for (std::size_t i = 1; i <= 4; ++i) {
    value = value * 10 + (text[i] - '0');
  }
  return text[0] == '-' ? -value : value;
}

Judgement judge(const std::uint8_t* bytes, std::size_t available) {
  const char* text = as_text(bytes);
  const std::size_t seen = base::min_of(available, Tss1Codec::kLine_bytes);
  for (std::size_t i = 0; i < seen; ++i) {
    if (!fits_column(text[i], kColumns[i])) {
      return {i == 0 ? FrameVerdict::kNoStart : FrameVerdict::kBadLength, 0};
    }
  }
  if (seen < Tss1Codec::kLine_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  return {FrameVerdict::kFrame, Tss1Codec::kLine_bytes};
}

base::Bam32 bam_of_cdeg(std::int32_t angle_cdeg) {
  return bam_of_e9deg(std::int64_t{angle_cdeg} * 10'000'000);
}

/// The Euler roll whose athwartships axis is `tss_roll` off level. False: no attitude has both angles.
bool euler_roll(base::Bam32 tss_roll_bam32, base::Bam32 pitch_bam32, base::Bam32& roll_bam32) {
  const std::int64_t across_q30 = base::sin_q30(tss_roll_bam32);
  const std::int64_t cos_pitch_q30 = base::cos_q30(pitch_bam32);
  const std::int64_t size_q30 = across_q30 < 0 ? -across_q30 : across_q30;
  // Hundredths of a degree are rounded on the wire: a hair over 90 degrees is 90.
  const std::int64_t slack_q30 = base::kOne_q30 / 5'000;
  if (cos_pitch_q30 <= 0 || size_q30 > cos_pitch_q30 + slack_q30) {
    return false;
  }
  roll_bam32 = asin_bam32(across_q30 * base::kOne_q30 / cos_pitch_q30);
  return true;
}

}  // namespace

bool Tss1Codec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(sample);
}

bool Tss1Codec::next(base::NavSample& sample) {
  const bool made = framer_.take_next(judge, counters_,
                                      [&](const FrameBytes& frame) { return take(frame, sample); });
  counters_.records += made ? 1U : 0U;
  return made;
}

bool Tss1Codec::take(const FrameBytes& frame, base::NavSample& sample) {
  const char* text = as_text(frame.data);
  const std::int32_t roll_cdeg = number_at(text + kRoll);
  const std::int32_t pitch_cdeg = number_at(text + kPitch);
  const bool upright = roll_cdeg >= -kQuarterTurn_cdeg && roll_cdeg <= kQuarterTurn_cdeg &&
                       pitch_cdeg >= -kQuarterTurn_cdeg && pitch_cdeg <= kQuarterTurn_cdeg;
  base::Bam32 roll_bam32 = bam_of_cdeg(roll_cdeg);
  const base::Bam32 pitch_bam32 = bam_of_cdeg(pitch_cdeg);
  if (!upright || (!config_.euler_roll && !euler_roll(roll_bam32, pitch_bam32, roll_bam32))) {
    ++counters_.bad_values;
    return false;
  }
  sample = base::NavSample{};
  sample.t_us = sent_us(frame, config_.byte_time_ns);
  sample.kind = base::NavKind::kAttitude;
  sample.fields = base::kNavRollPitch;
  sample.attitude.roll_bam32 = roll_bam32;
  sample.attitude.pitch_bam32 = pitch_bam32;
  const bool settled = text[kStatus] <= 'Z';
  sample.quality = settled ? 255 : kUnsettledQuality;
  if (settled) {
    sample.fields |= base::kNavHeave;
    sample.heave_um = std::int64_t{number_at(text + kHeave)} * -10'000;
  }
  return true;
}

}  // namespace leadline::hal
