#include "hal/heads/r2sonic.hpp"

#include <cstring>

#include "hal/heads/beam_angles.hpp"
#include "hal/wire.hpp"

namespace leadline::hal {

namespace {

constexpr std::array<std::uint8_t, 4> kMagic = {'B', 'T', 'H', '0'};
constexpr std::size_t kPacketHeader_bytes = 12;
constexpr std::size_t kSectionHeader_bytes = 4;
constexpr std::size_t kH0_bytes = 116;
constexpr std::size_t kAngles_bytes = 36;  // header, first, last or scale, six spare floats
constexpr std::size_t kScaled_bytes = 8;   // header and scale, in front of the points
constexpr std::uint32_t kUnlimitedGap_us = 2'000'000;
constexpr std::int64_t kUsPerS = 1'000'000;
constexpr std::int64_t kNsPerUs = 1'000;
/// Longest two-way time: both ways over base::kMaxRange_um at 1300 m/s.
constexpr std::int64_t kMaxTwoWay_ns = 31'000'000'000;
/// 2^32 / 2 pi, times 256 (error 2e-12).
constexpr std::int64_t kBamPerRad_q8 = 174'992'710'548;

constexpr std::uint16_t name_of(char first, char second) {
  return static_cast<std::uint16_t>((static_cast<unsigned>(first) << 8U) |
                                    static_cast<unsigned>(second));
}

constexpr std::size_t padded(std::size_t size_bytes) { return (size_bytes + 3U) & ~std::size_t{3}; }

/// The float with these bits, times 2^power * scale, to the nearest integer: the power keeps digits of a
/// small number. False where the result leaves the format.
bool scaled(std::uint32_t bits, unsigned power, std::int64_t scale, std::int64_t& out) {
  const std::uint32_t biased = (bits >> 23U) & 0xFFU;
  if (biased == 0) {
    out = 0;  // zero, or far below what any field means
    return true;
  }
  if (biased + power >= 0xFFU) {
    return false;
  }
  return f32_bits_to_integer(bits + (power << 23U), scale, out);
}

/// How many bytes at the end of the frame could begin a packet: 0 .. 3.
std::uint8_t start_at_end(const std::uint8_t* end) {
  for (std::size_t length = kMagic.size() - 1; length > 0; --length) {
    if (std::memcmp(end - length, kMagic.data(), length) == 0) {
      return static_cast<std::uint8_t>(length);
    }
  }
  return 0;
}

bool second_start_inside(const std::uint8_t* bytes, std::size_t size_bytes) {
  for (std::size_t i = kMagic.size(); i + kMagic.size() <= size_bytes; ++i) {
    if (bytes[i] == kMagic[0] && std::memcmp(bytes + i, kMagic.data(), kMagic.size()) == 0) {
      return true;
    }
  }
  return false;
}

/// Sections fill the packet to its end.
bool sections_add_up(const std::uint8_t* bytes, std::size_t size_bytes) {
  std::size_t at = kPacketHeader_bytes;
  while (at + kSectionHeader_bytes <= size_bytes) {
    const std::size_t section_bytes = read_u16_be(bytes + at + 2);
    if (section_bytes < kSectionHeader_bytes) {
      return false;
    }
    at += padded(section_bytes);
  }
  return at == size_bytes;
}

Judgement judge(const std::uint8_t* bytes, std::size_t available) {
  for (std::size_t i = 0; i < kMagic.size() && i < available; ++i) {
    if (bytes[i] != kMagic[i]) {
      return {FrameVerdict::kNoStart, 0};
    }
  }
  if (available < kPacketHeader_bytes + kSectionHeader_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  const std::uint32_t size_bytes = read_u32_be(bytes + 4);
  if (size_bytes < kPacketHeader_bytes + kH0_bytes || size_bytes > kMaxR2SonicPacket_bytes) {
    return {FrameVerdict::kBadLength, 0};
  }
  if (read_u16_be(bytes + kPacketHeader_bytes) != name_of('H', '0') ||
      read_u16_be(bytes + kPacketHeader_bytes + 2) != kH0_bytes) {
    return {FrameVerdict::kBadValues, 0};
  }
  if (available < size_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  if (!sections_add_up(bytes, size_bytes) || second_start_inside(bytes, size_bytes)) {
    return {FrameVerdict::kBadLength, 0};
  }
  return {FrameVerdict::kFrame, size_bytes};
}

}  // namespace

R2SonicCodec::R2SonicCodec(const R2SonicConfig& config)
    : config_(config), framer_(kUnlimitedGap_us) {}

void R2SonicCodec::restart() {
  framer_.reset(counters_);
  beam_count_ = 0;
  next_beam_ = 0;
  tail_bytes_ = 0;
}

bool R2SonicCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping) {
  beam_count_ = 0;
  next_beam_ = 0;
  if (tail_bytes_ != 0) {
    // A byte lost in the last section let the packet take the start of the next: give it back.
    if (byte == kMagic[tail_bytes_]) {
      for (std::size_t i = 0; i < tail_bytes_; ++i) {
        framer_.feed(kMagic[i], t_arrival_us, counters_);
      }
    }
    tail_bytes_ = 0;
  }
  framer_.feed(byte, t_arrival_us, counters_);
  return next_packet(ping);
}

bool R2SonicCodec::next(base::Ping& ping) {
  while (next_beam_ < beam_count_) {
    const std::size_t index = next_beam_;
    ++next_beam_;
    if (take_beam(index, ping)) {
      ++counters_.records;
      return true;
    }
  }
  return next_packet(ping);
}

bool R2SonicCodec::next_packet(base::Ping& ping) {
  FrameBytes frame{};
  while (framer_.next(judge, counters_, frame)) {
    tail_bytes_ = framer_.buffered_bytes() == 0 ? start_at_end(frame.data + frame.size_bytes)
                                                : std::uint8_t{0};
    if (!open(frame)) {
      beam_count_ = 0;
      next_beam_ = 0;
      continue;
    }
    while (next_beam_ < beam_count_) {
      const std::size_t index = next_beam_;
      ++next_beam_;
      if (take_beam(index, ping)) {
        ++counters_.records;
        return true;
      }
    }
  }
  return false;
}

/// Copies and checks a packet; false, and counted, when it cannot be used.
bool R2SonicCodec::open(const FrameBytes& frame) {
  if (!read_header(frame)) {
    ++counters_.bad_values;
    return false;
  }
  if (!find_sections(frame)) {
    ++counters_.bad_length;
    return false;
  }
  std::memcpy(packet_.data(), frame.data, frame.size_bytes);
  if (!read_scales()) {
    ++counters_.bad_values;
    return false;
  }
  next_beam_ = 0;
  step_sum_ = 0;
  if (!config_.device_clock) {
    std::int64_t longest_ns = 0;
    for (std::size_t i = 0; i < beam_count_; ++i) {
      const std::int64_t time_ns = two_way_ns(i);
      longest_ns = time_ns > longest_ns ? time_ns : longest_ns;
    }
    t_transmit_us_ = frame.t_first_us - longest_ns / kNsPerUs;
  }
  return true;
}

bool R2SonicCodec::read_header(const FrameBytes& frame) {
  const std::uint8_t* const bytes = frame.data;
  std::int64_t speed_mm_s = 0;
  if (!f32_bits_to_integer(read_u32_be(bytes + 56), 1000, speed_mm_s) ||
      speed_mm_s < config_.min_sound_speed_mm_s || speed_mm_s > config_.max_sound_speed_mm_s) {
    return false;
  }
  const std::uint32_t nanoseconds = read_u32_be(bytes + 44);
  const std::size_t count = read_u16_be(bytes + 126);
  if (nanoseconds >= 1'000'000'000U || count > kMaxR2SonicBeams) {
    return false;
  }
  sound_speed_mm_s_ = static_cast<std::int32_t>(speed_mm_s);
  ping_number_ = read_u32_be(bytes + 48);
  beam_count_ = count;
  t_device_us_ = static_cast<std::int64_t>(read_u32_be(bytes + 40)) * kUsPerS +
                 static_cast<std::int64_t>(nanoseconds) / kNsPerUs;
  t_transmit_us_ = t_device_us_ + config_.clock_offset_us;
  return true;
}

/// False where a section that is needed is missing or too short for the points.
bool R2SonicCodec::find_sections(const FrameBytes& frame) {
  sections_ = Sections{};
  std::size_t at = kPacketHeader_bytes;
  while (at + kSectionHeader_bytes <= frame.size_bytes) {
    const std::uint16_t name = read_u16_be(frame.data + at);
    const std::size_t size_bytes = read_u16_be(frame.data + at + 2);
    const auto offset = static_cast<std::uint16_t>(at);
    if (at + size_bytes > frame.size_bytes) {
      return false;
    }
    if (name == name_of('R', '0') && size_bytes >= kScaled_bytes + 2 * beam_count_) {
      sections_.ranges = offset;
    } else if (name == name_of('A', '0') && size_bytes >= kAngles_bytes) {
      sections_.angles = offset;
      sections_.equidistant = false;
    } else if (name == name_of('A', '2') && size_bytes >= kAngles_bytes + 2 * beam_count_) {
      sections_.angles = offset;
      sections_.equidistant = true;
    } else if (name == name_of('I', '1') && size_bytes >= kScaled_bytes + 2 * beam_count_) {
      sections_.intensities = offset;
    } else if (name == name_of('Q', '0') &&
               size_bytes >= kSectionHeader_bytes + 4 * ((beam_count_ + 7) / 8)) {
      sections_.flags = offset;
    }
    at += padded(size_bytes);
  }
  return sections_.ranges != 0 && sections_.angles != 0;
}

/// Angles as Q12 of a binary angle; the factor of A2 as Q20, since up to 2^26 steps are summed.
bool R2SonicCodec::read_scales() {
  std::int64_t unit = 0;
  // The scale of R0 is a part of a second.
  if (!scaled(read_u32_be(packet_.data() + sections_.ranges + 4), 10, 1'000'000, unit) ||
      unit < 0 || unit >= 1024 * kUsPerS) {
    return false;
  }
  const std::uint8_t* const angles = packet_.data() + sections_.angles + kSectionHeader_bytes;
  std::int64_t second = 0;
  if (!scaled(read_u32_be(angles), 4, kBamPerRad_q8, angle_first_bam_) ||
      !scaled(read_u32_be(angles + 4), sections_.equidistant ? 12 : 4, kBamPerRad_q8, second)) {
    return false;
  }
  // No head looks farther round than straight to the side; units of a step are far below a beam.
  constexpr std::int64_t kLimit_q12 = std::int64_t{base::kBam32QuarterTurn} << 12U;
  constexpr std::int64_t kLimit_q20 = std::int64_t{1} << 36U;  // 1e-4 rad a unit
  const std::int64_t limit = sections_.equidistant ? kLimit_q20 : kLimit_q12;
  if (angle_first_bam_ < -kLimit_q12 || angle_first_bam_ > kLimit_q12 || second < -limit ||
      second > limit) {
    return false;
  }
  angle_factor_bam_ = sections_.equidistant ? second : second - angle_first_bam_;
  return true;
}

/// Two-way time of a beam; negative where it cannot be told.
std::int64_t R2SonicCodec::two_way_ns(std::size_t index) const {
  const std::uint8_t* const section = packet_.data() + sections_.ranges;
  const std::int64_t count = read_u16_be(section + kScaled_bytes + 2 * index);
  std::int64_t time = 0;  // in units of 1000 / 1024 ns
  if (count == 0) {
    return 0;
  }
  if (!scaled(read_u32_be(section + 4), 10, count * kUsPerS, time) || time > kMaxTwoWay_ns) {
    return -1;
  }
  return (time * 1000 + 512) / 1024;
}

/// Angle of a beam, starboard positive; to be asked for each beam in order (A2 sums up).
std::int64_t R2SonicCodec::angle_bam32(std::size_t index) {
  if (!sections_.equidistant) {
    const auto last = static_cast<std::int64_t>(beam_count_ > 1 ? beam_count_ - 1 : 1);
    return (angle_first_bam_ + angle_factor_bam_ * static_cast<std::int64_t>(index) / last) / 4096;
  }
  const std::uint32_t step =
      read_u16_be(packet_.data() + sections_.angles + kAngles_bytes + 2 * index);
  const std::uint32_t before = step_sum_;
  step_sum_ += step;
  const std::int64_t steps = config_.a2_inclusive ? step_sum_ : before;
  return (angle_first_bam_ + (angle_factor_bam_ * steps) / 256) / 4096;
}

std::uint8_t R2SonicCodec::flags_of(std::size_t index) const {
  const std::uint32_t word =
      read_u32_be(packet_.data() + sections_.flags + kSectionHeader_bytes + 4 * (index / 8));
  return static_cast<std::uint8_t>((word >> (28U - 4U * (index % 8))) & 0xFU);
}

bool R2SonicCodec::take_beam(std::size_t index, base::Ping& ping) {
  const std::int64_t time_ns = two_way_ns(index);
  const std::int64_t angle = angle_bam32(index);
  const bool has_flags = sections_.flags != 0;
  const std::uint8_t flags = has_flags ? flags_of(index) : std::uint8_t{0};
  if (time_ns == 0 || (has_flags && (flags & (kR2SonicMagnitude | kR2SonicPhase)) == 0)) {
    ++counters_.no_data;
    return false;
  }
  constexpr std::int64_t kQuarter = base::kBam32QuarterTurn;
  // mm/s * ns = 1e-6 um; there and back
  const std::int64_t range_um = (time_ns * sound_speed_mm_s_ + kUsPerS) / (2 * kUsPerS);
  if (time_ns < 0 || range_um <= 0 || range_um > base::kMaxRange_um || angle < -kQuarter ||
      angle > kQuarter) {
    ++counters_.bad_values;
    return false;
  }
  beam_.ping_number = ping_number_;
  beam_.beam = static_cast<std::uint16_t>(index);
  beam_.intensity =
      sections_.intensities == 0
          ? std::uint16_t{0}
          : read_u16_be(packet_.data() + sections_.intensities + kScaled_bytes + 2 * index);
  beam_.two_way_ns = time_ns;
  beam_.angle_bam32 = static_cast<std::int32_t>(angle);
  beam_.flags = flags;

  ping = base::Ping{};
  ping.t_transmit_us = t_transmit_us_;
  ping.t_device_us = config_.device_clock ? 0 : t_device_us_;
  ping.t_receive_us = t_transmit_us_ + time_ns / kNsPerUs;
  set_fan_beam(ping, static_cast<base::Bam32>(static_cast<std::uint64_t>(angle)));
  ping.mount = config_.mount;
  ping.kind = base::ReturnKind::kRange;
  const unsigned passed = (flags & 1U) + ((flags >> 1U) & 1U);
  ping.quality = static_cast<std::uint8_t>(has_flags ? 85U * (1U + passed) : 255U);
  ping.range_um = range_um;
  ping.sound_speed_mm_s = sound_speed_mm_s_;
  return true;
}

}  // namespace leadline::hal
