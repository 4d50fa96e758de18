#include "hal/heads/kongsberg.hpp"

#include "hal/heads/beam_angles.hpp"
#include "hal/wire.hpp"
#include "model/base/angle.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

constexpr std::uint8_t kStx = 2;
constexpr std::uint8_t kEtx = 3;
constexpr std::size_t kHeader_bytes = 20;  // of both kinds, the length in front included
constexpr std::size_t kMinDatagram_bytes = kHeader_bytes + 4;
constexpr base::TimeUs kMaxGap_us = 2'000'000;
constexpr std::int64_t kUsPerS = 1'000'000;
constexpr std::int64_t kNsPerUs = 1'000;
constexpr std::int64_t kMaxTwoWay_ns = 31'000'000'000;
constexpr std::int64_t kCentidegreesPerTurn = 36'000;
/// 2^32 / 360 * 2^12, for degrees in IEEE singles.
constexpr std::int64_t kBamPerDegree_q12 = 48'867'183'457;

std::int64_t read_i16(const std::uint8_t* bytes) { return as_i16(read_u16_le(bytes)); }

std::uint32_t four(const char* letters) {
  std::uint32_t word = 0;
  for (unsigned i = 0; i < 4; ++i) {
    word |= static_cast<std::uint32_t>(static_cast<std::uint8_t>(letters[i])) << (8U * i);
  }
  return word;
}

bool is_letter(std::uint8_t byte) { return byte >= 'A' && byte <= 'Z'; }

/// Of the year-month-day number of the older datagrams; 0 where it is none.
std::int64_t days_since_1970(std::uint32_t date) {
  const std::uint32_t month = date / 100 % 100;
  const std::uint32_t day = date % 100;
  if (date < 19700101 || date > 22001231 || month < 1 || month > 12 || day < 1 || day > 31) {
    return 0;
  }
  // Years that begin in March put the leap day last.
  const std::int64_t year = static_cast<std::int64_t>(date / 10'000) - (month <= 2 ? 1 : 0);
  const std::int64_t day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
  return year * 365 + year / 4 - year / 100 + year / 400 + day_of_year - 719'468;
}

Judgement judge_all(const std::uint8_t* bytes, std::size_t available, std::size_t size_bytes) {
  if (available < kHeader_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  // A plausible date is what tells a start from any other 02.
  if (days_since_1970(read_u32_le(bytes + 8)) == 0 || read_u32_le(bytes + 12) >= 86'400'000) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (available < size_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  std::uint32_t sum = 0;
  for (std::size_t i = 5; i + 3 < size_bytes; ++i) {
    sum += bytes[i];
  }
  if (bytes[size_bytes - 3] != kEtx) {
    return {FrameVerdict::kBadLength, 0};
  }
  if ((sum & 0xFFFFU) != read_u16_le(bytes + size_bytes - 2)) {
    return {FrameVerdict::kBadChecksum, 0};
  }
  return {FrameVerdict::kFrame, size_bytes};
}

Judgement judge_kmall(const std::uint8_t* bytes, std::size_t available, std::size_t size_bytes) {
  for (std::size_t i = 5; i < 8 && i < available; ++i) {
    if (!is_letter(bytes[i])) {
      return {FrameVerdict::kNoStart, 0};
    }
  }
  if (available < size_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  if (read_u32_le(bytes + size_bytes - 4) != size_bytes) {
    return {FrameVerdict::kBadLength, 0};
  }
  return {FrameVerdict::kFrame, size_bytes};
}

Judgement judge(const std::uint8_t* bytes, std::size_t available) {
  if (available < 5) {
    return {FrameVerdict::kMore, 0};
  }
  const std::uint32_t length = read_u32_le(bytes);
  if (length < kMinDatagram_bytes - 4 || length > kMaxKongsbergDatagram_bytes - 4) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (bytes[4] == kStx) {
    return judge_all(bytes, available, length + 4);
  }
  if (bytes[4] == '#' && length >= kMinDatagram_bytes) {
    return judge_kmall(bytes, available, length);
  }
  return {FrameVerdict::kNoStart, 0};
}

/// Degrees in an IEEE single to a binary angle; false outside +-`limit_deg`, and for NaN.
bool angle_of(const std::uint8_t* bytes, std::int64_t limit_deg, base::Bam32& angle) {
  std::int64_t value_q12 = 0;
  if (!f32_bits_to_integer(read_u32_le(bytes), kBamPerDegree_q12, value_q12) ||
      value_q12 > limit_deg * kBamPerDegree_q12 || value_q12 < -limit_deg * kBamPerDegree_q12) {
    return false;
  }
  angle = static_cast<base::Bam32>(static_cast<std::uint64_t>((value_q12 + 2048) >> 12));
  return true;
}

/// A single times `scale` within +-limit.
bool number_of(const std::uint8_t* bytes, std::int64_t scale, std::int64_t limit,
               std::int64_t& value) {
  return f32_bits_to_integer(read_u32_le(bytes), scale, value) && value >= -limit && value <= limit;
}

/// Degrees in an IEEE double times 1e9, within 1e-10 degrees; false beyond `limit_deg` (< 256).
bool degrees_e9(const std::uint8_t* bytes, std::int64_t limit_deg, std::int64_t& value_e9) {
  const std::uint64_t bits = read_u64_le(bytes);
  const int exponent = static_cast<int>((bits >> 52U) & 0x7FFU) - 1023;
  if (exponent > 7) {
    return false;  // 256 or more, infinite, NaN
  }
  const std::uint64_t mantissa = (bits & 0xFFFFFFFFFFFFFU) | 0x10000000000000U;
  // To 34 binary places: below 2^42, times 1e9 below 2^72 - so whole degrees and the rest apart.
  const int shift = 52 - 34 - exponent;
  const std::uint64_t value_q34 = shift > 63 ? 0 : mantissa >> shift;
  const std::uint64_t whole = value_q34 >> 34U;
  const std::uint64_t rest = value_q34 & 0x3FFFFFFFFU;
  // 2^34 * 1e9 is just below 2^64.
  const std::uint64_t magnitude = whole * 1'000'000'000U + ((rest * 1'000'000'000U) >> 34U);
  value_e9 = static_cast<std::int64_t>(magnitude);
  if (value_e9 > limit_deg * 1'000'000'000) {
    return false;
  }
  value_e9 = (bits >> 63U) != 0 ? -value_e9 : value_e9;
  return true;
}

/// Square root of a Q60 as Q30: the table's and one step of Newton, relative error below 2^-28.
std::int64_t root_q30(std::int64_t square_q60) {
  if (square_q60 <= 0) {
    return 0;
  }
  const std::int64_t root = base::sqrt_u64(static_cast<std::uint64_t>(square_q60));
  return root == 0 ? 0 : (root + square_q60 / root) / 2;
}

/// Directs a ping by its sines along the forward and starboard axes; false where none looks there.
bool set_direction(base::Ping& ping, std::int64_t forward_q30, std::int64_t starboard_q30) {
  constexpr std::int64_t kOne_q60 = std::int64_t{1} << 60U;
  const std::int64_t level_q60 = forward_q30 * forward_q30 + starboard_q30 * starboard_q30;
  if (level_q60 >= kOne_q60) {
    return false;
  }
  const std::int64_t down_q30 = root_q30(kOne_q60 - level_q60);
  if (forward_q30 == 0) {
    set_fan_beam(ping, base::atan2_bam32(starboard_q30, down_q30));
    return true;
  }
  ping.azimuth_bam32 = base::atan2_bam32(starboard_q30, forward_q30);
  ping.elevation_bam32 = base::atan2_bam32(down_q30, root_q30(level_q60));
  // Turns the footprint's along axis (up the elevation) to where the forward axis lies.
  ping.rotation_bam32 = base::atan2_bam32(
      base::sin_q30(ping.azimuth_bam32),
      (std::int64_t{base::sin_q30(ping.elevation_bam32)} * base::cos_q30(ping.azimuth_bam32)) >>
          30);
  return true;
}

}  // namespace

KongsbergCodec::KongsbergCodec(const KongsbergConfig& config)
    : config_(config), framer_(kMaxGap_us) {}

void KongsbergCodec::restart() {
  framer_.reset(counters_);
  beam_count_ = 0;
  next_beam_ = 0;
  reading_count_ = 0;
  next_reading_ = 0;
  has_place_ = false;
}

bool KongsbergCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping) {
  beam_count_ = 0;
  next_beam_ = 0;
  reading_count_ = 0;
  next_reading_ = 0;
  has_place_ = false;
  framer_.feed(byte, t_arrival_us, counters_);
  return next_datagram(ping);
}

bool KongsbergCodec::next(base::Ping& ping) { return take_beam(ping) || next_datagram(ping); }

/// The next usable beam of the open datagram.
bool KongsbergCodec::take_beam(base::Ping& ping) {
  while (next_beam_ < beam_count_) {
    const Beam& beam = beams_[next_beam_];
    ++next_beam_;
    // mm/s * ns = 1e-6 um; there and back
    const std::int64_t range_um = (beam.two_way_ns * sound_speed_mm_s_ + kUsPerS) / (2 * kUsPerS);
    ping = base::Ping{};
    if (range_um <= 0 || range_um > base::kMaxRange_um ||
        !set_direction(ping, beam.sin_forward_q30, beam.sin_starboard_q30)) {
      ++counters_.bad_values;
      continue;
    }
    ping.t_transmit_us = t_transmit_us_ + beam.delay_us;
    ping.t_device_us = config_.device_clock ? 0 : t_device_us_ + beam.delay_us;
    ping.t_receive_us = ping.t_transmit_us + beam.two_way_ns / kNsPerUs;
    ping.mount = mount_;
    ping.kind = base::ReturnKind::kRange;
    ping.quality = beam.quality;
    ping.range_um = range_um;
    ping.sound_speed_mm_s = sound_speed_mm_s_;
    about_.beam = beam.index;
    about_.two_way_ns = beam.two_way_ns;
    ++counters_.records;
    return true;
  }
  return false;
}

bool KongsbergCodec::take_sample(base::NavSample& sample) {
  sample = base::NavSample{};
  if (next_reading_ < reading_count_) {
    const Reading& reading = readings_[next_reading_];
    ++next_reading_;
    sample.t_us = reading.t_us;
    sample.kind = base::NavKind::kAttitude;
    sample.fields = base::kNavRollPitch | base::kNavHeading | base::kNavHeave;
    sample.attitude = reading.attitude;
    sample.heave_um = reading.heave_um;
    sample.quality = 255;
    return true;
  }
  if (has_place_) {
    has_place_ = false;
    sample = place_;
    return true;
  }
  return false;
}

bool KongsbergCodec::next_datagram(base::Ping& ping) {
  FrameBytes frame{};
  while (framer_.next(judge, counters_, frame)) {
    beam_count_ = 0;
    next_beam_ = 0;
    open(frame);
    if (take_beam(ping)) {
      return true;
    }
  }
  return false;
}

void KongsbergCodec::open(const FrameBytes& frame) {
  if (frame.data[4] == kStx) {
    open_all(frame);
  } else {
    open_kmall(frame);
  }
}

void KongsbergCodec::open_all(const FrameBytes& frame) {
  bool good = true;
  switch (frame.data[5]) {
    case 'N':
      good = take_raw78(frame);
      break;
    case 'A':
      good = take_attitude(frame);
      break;
    case 'P':
      good = take_position(frame);
      break;
    case 'U':
      good = take_profile(frame);
      break;
    default:
      ++counters_.ignored;
      break;
  }
  counters_.bad_values += good ? 0U : 1U;
}

void KongsbergCodec::open_kmall(const FrameBytes& frame) {
  const std::uint32_t name = read_u32_le(frame.data + 4);
  bool good = true;
  if (name == four("#MRZ")) {
    good = take_mrz(frame);
  } else if (name == four("#SKM")) {
    good = take_skm(frame);
  } else if (name == four("#SPO")) {
    good = take_spo(frame);
  } else if (name == four("#SVP")) {
    good = take_svp(frame);
  } else {
    ++counters_.ignored;
  }
  counters_.bad_values += good ? 0U : 1U;
}

bool KongsbergCodec::set_sound_speed(std::int64_t speed_mm_s) {
  if (speed_mm_s < config_.min_sound_speed_mm_s || speed_mm_s > config_.max_sound_speed_mm_s) {
    return false;
  }
  sound_speed_mm_s_ = static_cast<std::int32_t>(speed_mm_s);
  return true;
}

void KongsbergCodec::add_beam(const Beam& beam) {
  if (beam.two_way_ns <= 0 || beam.two_way_ns > kMaxTwoWay_ns ||
      beam_count_ == kMaxKongsbergBeams) {
    ++counters_.bad_values;
    return;
  }
  beams_[beam_count_] = beam;
  ++beam_count_;
}

/// Times of the pings of a datagram whose beams are all there.
void KongsbergCodec::start_ping(const FrameBytes& frame, base::TimeUs t_device_us) {
  t_device_us_ = t_device_us;
  if (config_.device_clock) {
    t_transmit_us_ = t_device_us + config_.clock_offset_us;
    return;
  }
  std::int64_t longest_us = 0;
  for (std::size_t i = 0; i < beam_count_; ++i) {
    const std::int64_t span_us = beams_[i].delay_us + beams_[i].two_way_ns / kNsPerUs;
    longest_us = span_us > longest_us ? span_us : longest_us;
  }
  t_transmit_us_ = frame.t_first_us - longest_us;
}

base::TimeUs KongsbergCodec::sample_time(const FrameBytes& frame, base::TimeUs t_device_us) const {
  return config_.device_clock ? t_device_us + config_.clock_offset_us : frame.t_first_us;
}

void KongsbergCodec::set_place(std::int64_t latitude_e9deg, std::int64_t longitude_e9deg,
                               std::int64_t sigma_mm) {
  place_.kind = base::NavKind::kPosition;
  place_.fields = base::kNavGeodetic;
  place_.latitude_e9deg = latitude_e9deg;
  place_.longitude_e9deg = longitude_e9deg;
  place_.sigma_position_mm = static_cast<std::uint32_t>(sigma_mm);
  place_.quality = 255;
  has_place_ = true;
}

// ---- .all ----------------------------------------------------------------------------------------

namespace {

base::TimeUs all_time_us(const std::uint8_t* bytes) {
  return days_since_1970(read_u32_le(bytes + 8)) * 86'400 * kUsPerS +
         static_cast<std::int64_t>(read_u32_le(bytes + 12)) * 1000;
}

/// Bytes in front of ETX and sum.
std::size_t body_end(const FrameBytes& frame) { return frame.size_bytes - 3; }

}  // namespace

bool KongsbergCodec::take_raw78(const FrameBytes& frame) {
  constexpr std::size_t kSectors_at = 36;
  constexpr std::size_t kSector_bytes = 24;
  constexpr std::size_t kBeam_bytes = 16;
  const std::uint8_t* const bytes = frame.data;
  if (body_end(frame) < kSectors_at) {
    return false;
  }
  const std::size_t sectors = read_u16_le(bytes + 22);
  const std::size_t beams = read_u16_le(bytes + 24);
  const std::size_t beams_at = kSectors_at + sectors * kSector_bytes;
  if (beams > kMaxKongsbergBeams || body_end(frame) < beams_at + beams * kBeam_bytes ||
      !set_sound_speed(std::int64_t{read_u16_le(bytes + 20)} * 100)) {
    return false;
  }
  for (std::size_t i = 0; i < beams; ++i) {
    const std::uint8_t* const entry = bytes + beams_at + i * kBeam_bytes;
    const std::size_t sector = entry[2];
    const std::uint8_t detection = entry[3];
    const bool flagged_out = entry[14] >= 0x80U;
    if ((detection & 0x80U) != 0 || flagged_out) {
      ++counters_.no_data;
      continue;
    }
    const std::uint8_t* const transmit = bytes + kSectors_at + sector * kSector_bytes;
    Beam beam{};
    std::int64_t delay_us = 0;
    if (sector >= sectors || !number_of(transmit + 8, kUsPerS, kUsPerS, delay_us) ||
        !number_of(entry + 8, 1'000'000'000, kMaxTwoWay_ns, beam.two_way_ns)) {
      ++counters_.bad_values;
      continue;
    }
    beam.index = static_cast<std::uint16_t>(i);
    beam.delay_us = static_cast<std::int32_t>(delay_us);
    beam.sin_forward_q30 = base::sin_q30(bam_of_parts(read_i16(transmit), kCentidegreesPerTurn));
    beam.sin_starboard_q30 = -base::sin_q30(bam_of_parts(read_i16(entry), kCentidegreesPerTurn));
    beam.quality = (detection & 1U) != 0 ? 255 : 170;
    add_beam(beam);
  }
  about_.ping_number = read_u16_le(bytes + 16);
  about_.serial = read_u16_le(bytes + 18);
  const bool second = config_.second_serial != 0 && about_.serial == config_.second_serial;
  mount_ = static_cast<std::uint16_t>(config_.mount + (second ? 1 : 0));
  start_ping(frame, all_time_us(bytes));
  return true;
}

bool KongsbergCodec::take_attitude(const FrameBytes& frame) {
  constexpr std::size_t kFirst = 22;
  constexpr std::size_t kEntry_bytes = 12;
  const std::size_t count = frame.size_bytes > kFirst ? read_u16_le(frame.data + 20) : 0;
  if (count == 0 || count > kMaxKongsbergReadings ||
      body_end(frame) < kFirst + count * kEntry_bytes) {
    return false;
  }
  const base::TimeUs t_us = all_time_us(frame.data);
  reading_count_ = 0;
  next_reading_ = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint8_t* const entry = frame.data + kFirst + i * kEntry_bytes;
    Reading& reading = readings_[reading_count_];
    reading.t_us = sample_time(frame, t_us + std::int64_t{read_u16_le(entry)} * 1000);
    reading.attitude = {bam_of_parts(read_i16(entry + 4), kCentidegreesPerTurn),
                        bam_of_parts(read_i16(entry + 6), kCentidegreesPerTurn),
                        bam_of_parts(read_u16_le(entry + 10), kCentidegreesPerTurn)};
    reading.heave_um = read_i16(entry + 8) * 10'000;  // down positive
    ++reading_count_;
  }
  return true;
}

bool KongsbergCodec::take_position(const FrameBytes& frame) {
  if (body_end(frame) < 38) {
    return false;
  }
  const std::int64_t latitude_e9 = std::int64_t{as_i32(read_u32_le(frame.data + 20))} * 50;
  const std::int64_t longitude_e9 = std::int64_t{as_i32(read_u32_le(frame.data + 24))} * 100;
  if (latitude_e9 > 90'000'000'000 || latitude_e9 < -90'000'000'000 ||
      longitude_e9 > 180'000'000'000 || longitude_e9 < -180'000'000'000) {
    return false;
  }
  const std::int64_t quality_cm = read_u16_le(frame.data + 28);
  place_ = base::NavSample{};
  place_.t_us = sample_time(frame, all_time_us(frame.data));
  set_place(latitude_e9, longitude_e9, quality_cm == 0xFFFF ? 0 : quality_cm * 10);
  return true;
}

bool KongsbergCodec::take_profile(const FrameBytes& frame) {
  constexpr std::size_t kFirst = 32;
  constexpr std::size_t kEntry_bytes = 8;
  if (body_end(frame) < kFirst) {
    return false;
  }
  const std::size_t count = read_u16_le(frame.data + 28);
  const std::int64_t unit_um = std::int64_t{read_u16_le(frame.data + 30)} * 10'000;
  if (count == 0 || unit_um == 0 || body_end(frame) < kFirst + count * kEntry_bytes) {
    return false;
  }
  const std::size_t stride = (count + kMaxKongsbergProfile - 1) / kMaxKongsbergProfile;
  profile_count_ = 0;
  for (std::size_t i = 0; i < count; i += stride) {
    const std::uint8_t* const entry = frame.data + kFirst + i * kEntry_bytes;
    const std::int64_t speed_mm_s = std::int64_t{read_u32_le(entry + 4)} * 100;
    const std::int64_t depth_um = std::int64_t{read_u32_le(entry)} * unit_um;
    if (speed_mm_s > config_.max_sound_speed_mm_s || depth_um > base::kMaxVertical_um) {
      continue;
    }
    profile_[profile_count_] = {depth_um, static_cast<std::int32_t>(speed_mm_s)};
    ++profile_count_;
  }
  return true;
}

// ---- .kmall --------------------------------------------------------------------------------------

namespace {

base::TimeUs kmall_time_us(const std::uint8_t* seconds) {
  return static_cast<std::int64_t>(read_u32_le(seconds)) * kUsPerS +
         static_cast<std::int64_t>(read_u32_le(seconds + 4)) / kNsPerUs;
}

/// Bytes in front of the repeated length.
std::size_t kmall_end(const FrameBytes& frame) { return frame.size_bytes - 4; }

}  // namespace

bool KongsbergCodec::take_mrz(const FrameBytes& frame) {
  const std::uint8_t* const bytes = frame.data;
  const std::size_t end = kmall_end(frame);
  constexpr std::size_t kCommon_at = 24;
  if (end < kCommon_at + 12) {
    return false;
  }
  if (read_u16_le(bytes + 20) != 1) {
    ++counters_.ignored;
    return true;
  }
  const std::size_t info_at = kCommon_at + read_u16_le(bytes + kCommon_at);
  if (end < info_at + 104) {
    return false;
  }
  const std::size_t sectors = read_u16_le(bytes + info_at + 92);
  const std::size_t sector_bytes = read_u16_le(bytes + info_at + 94);
  const std::size_t sectors_at = info_at + read_u16_le(bytes + info_at);
  std::int64_t speed_mm_s = 0;
  if (sector_bytes < 12 || end < sectors_at + sectors * sector_bytes + 32 ||
      !number_of(bytes + info_at + 100, 1000, config_.max_sound_speed_mm_s, speed_mm_s) ||
      !set_sound_speed(speed_mm_s) || !take_mrz_beams(frame, sectors_at, sectors, sector_bytes)) {
    return false;
  }
  about_.ping_number = read_u16_le(bytes + kCommon_at + 2);
  about_.serial = read_u16_le(bytes + 10);
  mount_ = static_cast<std::uint16_t>(config_.mount + bytes[kCommon_at + 9]);
  start_ping(frame, kmall_time_us(bytes + 12));
  return true;
}

bool KongsbergCodec::take_mrz_beams(const FrameBytes& frame, std::size_t sectors_at,
                                    std::size_t sectors, std::size_t sector_bytes) {
  const std::uint8_t* const bytes = frame.data;
  const std::size_t receive_at = sectors_at + sectors * sector_bytes;
  const std::uint8_t* const receive = bytes + receive_at;
  const std::size_t count = read_u16_le(receive + 2);
  const std::size_t sounding_bytes = read_u16_le(receive + 6);
  const std::size_t classes_bytes =
      std::size_t{read_u16_le(receive + 28)} * read_u16_le(receive + 30);
  const std::size_t soundings_at = receive_at + read_u16_le(receive) + classes_bytes;
  if (sounding_bytes < 88 || count > kMaxKongsbergBeams ||
      kmall_end(frame) < soundings_at + count * sounding_bytes) {
    return false;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint8_t* const sounding = bytes + soundings_at + i * sounding_bytes;
    if (sounding[3] != 0) {
      ++counters_.no_data;  // extra or rejected
      continue;
    }
    const std::size_t sector = sounding[2];
    const std::uint8_t* const transmit = bytes + sectors_at + sector * sector_bytes;
    Beam beam{};
    base::Bam32 angle = 0;
    base::Bam32 tilt = 0;
    std::int64_t delay_us = 0;
    if (sector >= sectors || !number_of(transmit + 4, kUsPerS, kUsPerS, delay_us) ||
        !angle_of(transmit + 8, 90, tilt) || !angle_of(sounding + 72, 90, angle) ||
        !number_of(sounding + 80, 1'000'000'000, kMaxTwoWay_ns, beam.two_way_ns)) {
      ++counters_.bad_values;
      continue;
    }
    beam.index = read_u16_le(sounding);
    beam.delay_us = static_cast<std::int32_t>(delay_us);
    beam.sin_forward_q30 = base::sin_q30(tilt);
    beam.sin_starboard_q30 = -base::sin_q30(angle);
    beam.quality = sounding[4] == 2 ? 255 : 170;
    add_beam(beam);
  }
  return true;
}

bool KongsbergCodec::take_skm(const FrameBytes& frame) {
  const std::uint8_t* const bytes = frame.data;
  const std::size_t end = kmall_end(frame);
  if (end < kHeader_bytes + 12) {
    return false;
  }
  const std::size_t first = kHeader_bytes + read_u16_le(bytes + kHeader_bytes);
  const std::size_t count = read_u16_le(bytes + kHeader_bytes + 6);
  const std::size_t entry_bytes = read_u16_le(bytes + kHeader_bytes + 8);
  if (entry_bytes < 56 || count > kMaxKongsbergReadings || end < first + count * entry_bytes) {
    return false;
  }
  reading_count_ = 0;
  next_reading_ = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint8_t* const entry = bytes + first + i * entry_bytes;
    Reading& reading = readings_[reading_count_];
    std::int64_t heave_um = 0;
    if (!angle_of(entry + 40, 180, reading.attitude.roll_bam32) ||
        !angle_of(entry + 44, 90, reading.attitude.pitch_bam32) ||
        !angle_of(entry + 48, 360, reading.attitude.heading_bam32) ||
        !number_of(entry + 52, 1'000'000, 100'000'000, heave_um)) {
      ++counters_.bad_values;
      continue;
    }
    reading.t_us = sample_time(frame, kmall_time_us(entry + 8));
    reading.heave_um = heave_um;  // down positive in this format
    ++reading_count_;
  }
  return true;
}

bool KongsbergCodec::take_spo(const FrameBytes& frame) {
  const std::uint8_t* const bytes = frame.data;
  const std::size_t end = kmall_end(frame);
  if (end < kHeader_bytes + 8) {
    return false;
  }
  const std::size_t at = kHeader_bytes + read_u16_le(bytes + kHeader_bytes);
  std::int64_t latitude_e9 = 0;
  std::int64_t longitude_e9 = 0;
  std::int64_t sigma_mm = 0;
  if (end < at + 28 || !degrees_e9(bytes + at + 12, 90, latitude_e9) ||
      !degrees_e9(bytes + at + 20, 180, longitude_e9)) {
    return false;
  }
  if (!number_of(bytes + at + 8, 1000, 1'000'000, sigma_mm) || sigma_mm < 0) {
    sigma_mm = 0;
  }
  place_ = base::NavSample{};
  place_.t_us = sample_time(frame, kmall_time_us(bytes + at));
  set_place(latitude_e9, longitude_e9, sigma_mm);
  return true;
}

bool KongsbergCodec::take_svp(const FrameBytes& frame) {
  constexpr std::size_t kEntry_bytes = 20;
  const std::uint8_t* const bytes = frame.data;
  const std::size_t end = kmall_end(frame);
  if (end < kHeader_bytes + 28) {
    return false;
  }
  const std::size_t first = kHeader_bytes + read_u16_le(bytes + kHeader_bytes);
  const std::size_t count = read_u16_le(bytes + kHeader_bytes + 2);
  if (count == 0 || end < first + count * kEntry_bytes) {
    return false;
  }
  const std::size_t stride = (count + kMaxKongsbergProfile - 1) / kMaxKongsbergProfile;
  profile_count_ = 0;
  for (std::size_t i = 0; i < count; i += stride) {
    const std::uint8_t* const entry = bytes + first + i * kEntry_bytes;
    std::int64_t depth_um = 0;
    std::int64_t speed_mm_s = 0;
    if (!number_of(entry, 1'000'000, base::kMaxVertical_um, depth_um) ||
        !number_of(entry + 4, 1000, config_.max_sound_speed_mm_s, speed_mm_s)) {
      continue;
    }
    profile_[profile_count_] = {depth_um, static_cast<std::int32_t>(speed_mm_s)};
    ++profile_count_;
  }
  return true;
}

}  // namespace leadline::hal
