#include "hal/heads/deltat83p.hpp"

#include "hal/heads/beam_angles.hpp"
#include "hal/wire.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

constexpr base::TimeUs kMaxGap_us = 500'000;
constexpr std::int64_t kSecond_us = 1'000'000;
constexpr std::uint16_t kValid = 0x8000;

constexpr bool is_digit(std::uint8_t c) { return c >= '0' && c <= '9'; }

/// `count` decimal digits, spaces in front allowed; -1 for anything else.
std::int64_t digits(const std::uint8_t* text, std::size_t count) {
  std::int64_t value = 0;
  bool started = false;
  for (std::size_t i = 0; i < count; ++i) {
    if (text[i] == ' ' && !started) {
      continue;
    }
    if (!is_digit(text[i])) {
      return -1;
    }
    started = true;
    value = value * 10 + (text[i] - '0');
  }
  return started ? value : -1;
}

/// 1 .. 12; 0: no month.
std::int64_t month_of(const std::uint8_t* text) {
  constexpr char kNames[] = "JANFEBMARAPRMAYJUNJULAUGSEPOCTNOVDEC";
  for (std::int64_t month = 0; month < 12; ++month) {
    bool same = true;
    for (std::int64_t i = 0; i < 3; ++i) {
      // Letters in either case.
      same = same && (text[i] & 0xDFU) == static_cast<std::uint8_t>(kNames[3 * month + i]);
    }
    if (same) {
      return month + 1;
    }
  }
  return 0;
}

/// Days from 1970-01-01 to a date of the Gregorian calendar.
constexpr std::int64_t days_of(std::int64_t year, std::int64_t month, std::int64_t day) {
  // Years that begin in March: the leap day is their last.
  const std::int64_t y = month <= 2 ? year - 1 : year;
  const std::int64_t m = month <= 2 ? month + 9 : month - 3;
  return 365 * y + y / 4 - y / 100 + y / 400 + (153 * m + 2) / 5 + day - 1 - 719'468;
}

/// The header's date and time in microseconds since 1970, in whatever zone the sender's clock runs; -1 when
/// it is none.
std::int64_t stamp_of(const std::uint8_t* header) {
  const std::int64_t day = digits(header + 8, 2);
  const std::int64_t month = month_of(header + 11);
  const std::int64_t year = digits(header + 15, 4);
  const std::int64_t hour = digits(header + 20, 2);
  const std::int64_t minute = digits(header + 23, 2);
  const std::int64_t second = digits(header + 26, 2);
  const bool dashes = header[10] == '-' && header[14] == '-';
  const bool colons = header[22] == ':' && header[25] == ':';
  if (!dashes || !colons || day < 1 || day > 31 || month == 0 || year < 1970 || hour < 0 ||
      hour > 23 || minute < 0 || minute > 59 || second < 0 || second > 60) {
    return -1;
  }
  std::int64_t fraction_us = digits(header + 113, 3) * 1000;
  if (fraction_us < 0) {
    fraction_us = base::max_of<std::int64_t>(digits(header + 30, 2), 0) * 10'000;
  }
  return ((days_of(year, month, day) * 24 + hour) * 60 + minute) * 60 * kSecond_us +
         second * kSecond_us + fraction_us;
}

std::int32_t range_m_of(const std::uint8_t* header) { return read_u16_be(header + 79); }

bool valid_angle(std::uint16_t word, std::uint16_t most) {
  return (word & kValid) == 0 || (word & 0x7FFFU) <= most;
}

/// Settings that a DeltaT can have.
bool plausible(const std::uint8_t* header) {
  const std::uint16_t beams = read_u16_be(header + 70);
  const std::uint16_t sector_deg = read_u16_be(header + 74);
  const std::uint16_t start = read_u16_be(header + 76);
  const std::uint16_t frequency_khz = read_u16_be(header + 81);
  const std::uint16_t speed = read_u16_be(header + 83);
  const std::uint16_t resolution_mm = read_u16_be(header + 85);
  const std::int32_t swath_cdeg = (beams - 1) * header[78];
  const bool speed_good =
      (speed & kValid) == 0 || ((speed & 0x7FFFU) >= 13'000 && (speed & 0x7FFFU) <= 17'000);
  return sector_deg >= 1 && sector_deg <= 180 && start >= 9'000 && start <= 27'000 &&
         start + swath_cdeg <= 27'000 && range_m_of(header) >= 1 && range_m_of(header) <= 1'000 &&
         frequency_khz >= 50 && frequency_khz <= 2'000 && speed_good && resolution_mm >= 1 &&
         resolution_mm <= 2 * range_m_of(header) + 2 && header[117] <= 1 && header[125] <= 25 &&
         valid_angle(read_u16_be(header + 64), 1'800) &&
         valid_angle(read_u16_be(header + 66), 1'800) &&
         valid_angle(read_u16_be(header + 68), 3'600) && stamp_of(header) >= 0;
}

/// No range is farther than the sonar listened: a tenth more, for the tail of the last bin.
bool ranges_fit(const std::uint8_t* bytes, std::size_t beams) {
  const std::int64_t resolution_mm = read_u16_be(bytes + 85);
  for (std::size_t i = 0; i < beams; ++i) {
    const std::int64_t range_mm = read_u16_be(bytes + kDeltatHeader_bytes + 2 * i) * resolution_mm;
    if (range_mm > range_m_of(bytes) * std::int64_t{1'100}) {
      return false;
    }
  }
  return true;
}

Judgement judge(const std::uint8_t* bytes, std::size_t available) {
  constexpr std::uint8_t kStart[] = {'8', '3'};
  for (std::size_t i = 0; i < 2 && i < available; ++i) {
    if (bytes[i] != kStart[i]) {
      return {FrameVerdict::kNoStart, 0};
    }
  }
  if (available < 3) {
    return {FrameVerdict::kMore, 0};
  }
  if (bytes[2] == 'B' || bytes[2] == '7') {
    return {FrameVerdict::kUnknownId, 0};  // raw data
  }
  if (bytes[2] != 'P' || (available > 3 && bytes[3] != 0 && bytes[3] != 10)) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (available < kDeltatHeader_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  const std::size_t size = read_u16_be(bytes + 4);
  const std::size_t beams = read_u16_be(bytes + 70);
  const std::size_t words = bytes[117] == 1 ? 2 : 1;
  if (beams < 1 || beams > kMaxDeltatBeams || size != kDeltatHeader_bytes + 2 * words * beams) {
    return {FrameVerdict::kBadLength, 0};
  }
  if (!plausible(bytes)) {
    return {FrameVerdict::kBadValues, 0};
  }
  if (available < size) {
    return {FrameVerdict::kMore, 0};
  }
  if (!ranges_fit(bytes, beams)) {
    return {FrameVerdict::kBadValues, 0};
  }
  return {FrameVerdict::kFrame, size};
}

/// "dd.mm.xxxxx" degrees, minutes and their decimals, in 1e-9 degrees; -1 when it is none.
std::int64_t degrees_e9(const std::uint8_t* text, std::size_t degree_digits) {
  const std::int64_t degrees = digits(text, degree_digits);
  const std::int64_t minutes = digits(text + degree_digits + 1, 2);
  const std::int64_t decimals = digits(text + degree_digits + 4, 5);
  if (degrees < 0 || minutes < 0 || minutes > 59 || decimals < 0 || text[degree_digits] != '.' ||
      text[degree_digits + 3] != '.') {
    return -1;
  }
  const std::int64_t minutes_e5 = minutes * 100'000 + decimals;
  return degrees * 1'000'000'000 + (minutes_e5 * 10'000 + 30) / 60;
}

}  // namespace

Deltat83pCodec::Deltat83pCodec(const Deltat83pConfig& config)
    : config_(config), framer_(kMaxGap_us) {}

bool Deltat83pCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(ping);
}

bool Deltat83pCodec::next(base::Ping& ping) {
  if (deliver(ping)) {
    return true;
  }
  FrameBytes frame{};
  if (!framer_.next(judge, counters_, frame)) {
    return false;
  }
  take(frame);
  return deliver(ping);
}

void Deltat83pCodec::restart() {
  framer_.reset(counters_);
  beam_count_ = 0;
  next_beam_ = 0;
  ++counters_.restarts;
}

void Deltat83pCodec::take(const FrameBytes& frame) {
  const std::uint8_t* header = frame.data;
  beam_count_ = read_u16_be(header + 70);
  next_beam_ = 0;
  start_cdeg_ = read_u16_be(header + 76) - 18'000;
  increment_cdeg_ = header[78];
  resolution_mm_ = read_u16_be(header + 85);
  option_flags_ = header[123];
  for (std::size_t i = 0; i < beam_count_; ++i) {
    counts_[i] = read_u16_be(header + kDeltatHeader_bytes + 2 * i);
  }
  listening_us_ = range_m_of(header) * std::int64_t{2'000'000'000} / kDeltatSoundSpeed_mm_s;
  const std::int64_t ping_latency_us = read_u16_be(header + 118) * std::int64_t{100};
  const std::int64_t data_latency_us = read_u16_be(header + 120) * std::int64_t{100};
  const std::int64_t age_us = data_latency_us - ping_latency_us;
  t_transmit_us_ = frame.t_arrival_us - (age_us > 0 ? age_us : listening_us_);
  take_attitude(header, t_transmit_us_);
  take_position(header, t_transmit_us_);
}

bool Deltat83pCodec::deliver(base::Ping& ping) {
  if (next_beam_ >= beam_count_) {
    return false;
  }
  const std::int64_t range_um = counts_[next_beam_] * std::int64_t{resolution_mm_} * 1000;
  const std::int32_t angle_cdeg = start_cdeg_ + next_beam_ * increment_cdeg_;
  ++next_beam_;
  ping = base::Ping{};
  ping.t_transmit_us = t_transmit_us_;
  set_fan_beam(ping,
               bam_of_parts(config_.positive_to_starboard ? angle_cdeg : -angle_cdeg, 36'000));
  ping.mount = config_.mount;
  ping.quality = 255;
  ping.sound_speed_mm_s = kDeltatSoundSpeed_mm_s;
  ping.kind = range_um > 0 ? base::ReturnKind::kRange : base::ReturnKind::kNoReturn;
  ping.range_um = range_um;
  ping.t_receive_us =
      t_transmit_us_ + (range_um > 0 ? 2000 * range_um / kDeltatSoundSpeed_mm_s : listening_us_);
  ++counters_.records;
  return true;
}

void Deltat83pCodec::take_attitude(const std::uint8_t* header, base::TimeUs t_us) {
  const std::uint16_t pitch = read_u16_be(header + 64);
  const std::uint16_t roll = read_u16_be(header + 66);
  const std::uint16_t heading = read_u16_be(header + 68);
  const auto tilt = [](std::uint16_t word, bool positive) {
    const std::int32_t ddeg = (word & 0x7FFF) - 900;
    return bam_of_parts(positive ? ddeg : -ddeg, 3'600);
  };
  base::NavSample sample{};
  sample.kind = base::NavKind::kAttitude;
  sample.t_us = t_us;
  sample.t_device_us = stamp_of(header);
  sample.quality = 255;
  std::uint32_t fields = 0;
  if ((pitch & roll & kValid) != 0) {
    sample.attitude.roll_bam32 = tilt(roll, config_.roll_positive);
    sample.attitude.pitch_bam32 = tilt(pitch, config_.pitch_positive);
    fields |= base::kNavRollPitch;
  }
  if ((heading & kValid) != 0) {
    sample.attitude.heading_bam32 = bam_of_parts(heading & 0x7FFF, 3'600);
    fields |= config_.heading_is_true ? base::kNavHeading : base::kNavHeadingMagnetic;
  }
  if (fields == 0) {
    sample.quality = 0;
    ++counters_.no_data;
  }
  sample.fields = static_cast<std::uint16_t>(fields);
  samples_.push(sample);
}

void Deltat83pCodec::take_position(const std::uint8_t* header, base::TimeUs t_us) {
  const std::int64_t latitude_e9 = degrees_e9(header + 34, 2);
  const std::int64_t longitude_e9 = degrees_e9(header + 47, 3);
  const std::uint8_t north = header[46];
  const std::uint8_t east = header[60];
  if (latitude_e9 < 0 || latitude_e9 > 90'000'000'000 || longitude_e9 < 0 ||
      longitude_e9 > 180'000'000'000 || (north != 'N' && north != 'S') ||
      (east != 'E' && east != 'W')) {
    return;
  }
  base::NavSample sample{};
  sample.kind = base::NavKind::kPosition;
  sample.t_us = t_us;
  sample.t_device_us = stamp_of(header);
  // Without a receiver the text is all zeros.
  if (latitude_e9 != 0 || longitude_e9 != 0) {
    sample.fields = base::kNavGeodetic;
    sample.quality = 255;
    sample.latitude_e9deg = north == 'N' ? latitude_e9 : -latitude_e9;
    sample.longitude_e9deg = east == 'E' ? longitude_e9 : -longitude_e9;
  }
  samples_.push(sample);
}

}  // namespace leadline::hal
