#include "hal/attitude/pd0.hpp"

#include "hal/angles.hpp"
#include "hal/checksums.hpp"
#include "hal/wire.hpp"

namespace leadline::hal {

namespace {

constexpr std::uint8_t kSync = 0x7F;
constexpr std::size_t kHeader_bytes = 6;
constexpr std::uint16_t kFixedLeader = 0x0000;
constexpr std::uint16_t kVariableLeader = 0x0080;
constexpr std::uint16_t kBottomTrack = 0x0600;
// Least bytes of a block of which something is used, and those of the parts that old firmware lacks.
constexpr std::size_t kFixed_bytes = 32;
constexpr std::size_t kFixedBeamAngle_bytes = 59;
constexpr std::size_t kVariable_bytes = 28;
constexpr std::size_t kBottom_bytes = 44;
constexpr std::size_t kBottomHighRange_bytes = 81;

constexpr std::uint8_t kTiltsUsed = 0x04;
constexpr std::uint8_t kThreeBeamAllowed = 0x02;
constexpr std::uint8_t kDepthSensor = 0x20;
constexpr std::uint8_t kUpLooking = 0x80;
constexpr std::uint8_t kConvex = 0x08;

/// A block's bytes; null where the ensemble has none.
struct Block {
  const std::uint8_t* bytes = nullptr;
  std::size_t size_bytes = 0;
};

struct Blocks {
  Block fixed;
  Block variable;
  Block bottom;
};

/// What the fixed leader says of the geometry.
struct Geometry {
  Pd0Frame frame;
  bool tilts_used;
  bool three_beam;
  bool convex;
  bool up;
  std::uint8_t beam_angle_deg;  ///< 0: not known
  base::Bam32 alignment_bam32;
};

Judgement judge(const std::uint8_t* bytes, std::size_t available) {
  if (bytes[0] != kSync || (available >= 2 && bytes[1] != kSync)) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (available < kHeader_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  const std::size_t size = std::size_t{read_u16_le(bytes + 2)} + 2;
  const std::size_t count = bytes[5];
  const std::size_t first = kHeader_bytes + 2 * count;
  if (size > Pd0Codec::kMaxEnsemble_bytes || count == 0 || count > Pd0Codec::kMaxBlocks ||
      first + 4 > size) {
    return {FrameVerdict::kBadLength, 0};
  }
  if (available >= kHeader_bytes + 2 && read_u16_le(bytes + kHeader_bytes) < first) {
    return {FrameVerdict::kBadLength, 0};
  }
  if (available < size) {
    return {FrameVerdict::kMore, 0};
  }
  const bool good = sum16(bytes, size - 2) == read_u16_le(bytes + size - 2);
  return good ? Judgement{FrameVerdict::kFrame, size} : Judgement{FrameVerdict::kBadChecksum, 0};
}

/// The bytes up to the nearest block behind `offset`, or to the checksum.
std::size_t block_bytes(const FrameBytes& frame, std::size_t offset) {
  std::size_t end = frame.size_bytes - 2;
  for (std::size_t i = 0; i < frame.data[5]; ++i) {
    const std::size_t other = read_u16_le(frame.data + kHeader_bytes + 2 * i);
    end = other > offset && other < end ? other : end;
  }
  return end - offset;
}

/// False: an offset that leads out of the ensemble.
bool find_blocks(const FrameBytes& frame, Blocks& blocks) {
  const std::size_t end = frame.size_bytes - 2;
  for (std::size_t i = 0; i < frame.data[5]; ++i) {
    const std::size_t offset = read_u16_le(frame.data + kHeader_bytes + 2 * i);
    if (offset + 2 > end) {
      return false;
    }
    const std::uint16_t id = read_u16_le(frame.data + offset);
    const Block block{frame.data + offset, block_bytes(frame, offset)};
    if (id == kFixedLeader && block.size_bytes >= kFixed_bytes) {
      blocks.fixed = block;
    } else if (id == kVariableLeader && block.size_bytes >= kVariable_bytes) {
      blocks.variable = block;
    } else if (id == kBottomTrack && block.size_bytes >= kBottom_bytes) {
      blocks.bottom = block;
    }
  }
  return true;
}

base::Bam32 bam_of_cdeg(std::int64_t angle_cdeg) { return bam_of_e9deg(angle_cdeg * 10'000'000); }

Geometry geometry_of(const Block& fixed) {
  constexpr std::array<std::uint8_t, 4> kAngles_deg{15, 20, 30, 0};
  const std::uint8_t coordinates = fixed.bytes[25];
  Geometry geometry{};
  geometry.frame = static_cast<Pd0Frame>((coordinates >> 3U) & 3U);
  geometry.tilts_used = (coordinates & kTiltsUsed) != 0;
  geometry.three_beam = (coordinates & kThreeBeamAllowed) != 0;
  geometry.convex = (fixed.bytes[4] & kConvex) != 0;
  geometry.up = (fixed.bytes[4] & kUpLooking) != 0;
  geometry.beam_angle_deg = kAngles_deg[fixed.bytes[5] & 3U];
  if (geometry.beam_angle_deg == 0 && fixed.size_bytes >= kFixedBeamAngle_bytes) {
    const std::uint8_t stated_deg = fixed.bytes[58];
    geometry.beam_angle_deg = stated_deg >= 5 && stated_deg <= 60 ? stated_deg : std::uint8_t{0};
  }
  geometry.alignment_bam32 = bam_of_cdeg(as_i16(read_u16_le(fixed.bytes + 26)));
  return geometry;
}

/// Days from 1970-01-01 of a date of the Gregorian calendar.
std::int64_t days_since_1970(std::int64_t year, std::int64_t month, std::int64_t day) {
  // Years that begin in March: the leap day is the last.
  const std::int64_t from_march = (month + 9) % 12;
  const std::int64_t y = year - (month <= 2 ? 1 : 0);
  return 365 * y + y / 4 - y / 100 + y / 400 + (153 * from_march + 2) / 5 + day - 719'469;
}

/// Year (two digits), month, day, hour, minute, second, hundredths; 0 for what is no date.
std::int64_t utc_of(const std::uint8_t* clock) {
  if (clock[0] > 99 || clock[1] < 1 || clock[1] > 12 || clock[2] < 1 || clock[2] > 31 ||
      clock[3] > 23 || clock[4] > 59 || clock[5] > 60 || clock[6] > 99) {
    return 0;
  }
  const std::int64_t year = clock[0] + (clock[0] < 80 ? 2000 : 1900);
  const std::int64_t days = days_since_1970(year, clock[1], clock[2]);
  const std::int64_t seconds = ((days * 24 + clock[3]) * 60 + clock[4]) * 60 + clock[5];
  return seconds * 1'000'000 + std::int64_t{clock[6]} * 10'000;
}

void read_bottom(const Block& bottom, Pd0Ensemble& ensemble) {
  ensemble.has_bottom_track = true;
  const bool high = bottom.size_bytes >= kBottomHighRange_bytes;
  for (std::size_t beam = 0; beam < 4; ++beam) {
    ensemble.velocity_mm_s[beam] = as_i16(read_u16_le(bottom.bytes + 24 + 2 * beam));
    ensemble.range_cm[beam] =
        read_u16_le(bottom.bytes + 16 + 2 * beam) +
        (high ? static_cast<std::uint32_t>(bottom.bytes[77 + beam]) << 16U : 0U);
  }
}

Pd0Ensemble read_ensemble(const Blocks& blocks) {
  Pd0Ensemble ensemble{};
  ensemble.velocity_mm_s.fill(kPd0BadVelocity);
  if (blocks.fixed.bytes != nullptr) {
    const Geometry geometry = geometry_of(blocks.fixed);
    ensemble.frame = geometry.frame;
    ensemble.looks_up = geometry.up;
    ensemble.convex = geometry.convex;
    ensemble.beam_angle_deg = geometry.beam_angle_deg;
    ensemble.alignment_cdeg = as_i16(read_u16_le(blocks.fixed.bytes + 26));
  }
  if (blocks.variable.bytes != nullptr) {
    const std::uint8_t* leader = blocks.variable.bytes;
    ensemble.number = read_u16_le(leader + 2) + (std::uint32_t{leader[11]} << 16U);
    ensemble.utc_us = utc_of(leader + 4);
    ensemble.sound_speed_m_s = read_u16_le(leader + 14);
    ensemble.depth_dm = read_u16_le(leader + 16);
    ensemble.heading_cdeg = read_u16_le(leader + 18);
    ensemble.pitch_cdeg = as_i16(read_u16_le(leader + 20));
    ensemble.roll_cdeg = as_i16(read_u16_le(leader + 22));
    ensemble.temperature_cdegc = as_i16(read_u16_le(leader + 26));
  }
  if (blocks.bottom.bytes != nullptr) {
    read_bottom(blocks.bottom, ensemble);
  }
  return ensemble;
}

/// Starboard, forward, up in um/s.
using Sfu = std::array<std::int64_t, 3>;

/// One bad beam of four from the others: no error velocity. False: still one missing.
bool complete_beams(bool three_beam, std::array<std::int64_t, 4>& beams) {
  constexpr std::array<std::size_t, 4> kOpposite{1, 0, 3, 2};
  std::size_t bad_count = 0;
  std::size_t bad = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    if (beams[i] == kPd0BadVelocity) {
      ++bad_count;
      bad = i;
    }
  }
  if (bad_count == 0) {
    return true;
  }
  if (bad_count > 1 || !three_beam) {
    return false;
  }
  const std::size_t opposite = kOpposite[bad];
  const std::size_t other = bad < 2 ? 2 : 0;
  beams[bad] = beams[other] + beams[other + 1] - beams[opposite];
  return true;
}

bool instrument_of_beams(const Pd0Ensemble& ensemble, const Geometry& geometry, Sfu& out) {
  std::array<std::int64_t, 4> b{};
  for (std::size_t i = 0; i < 4; ++i) {
    b[i] = ensemble.velocity_mm_s[i];
  }
  if (geometry.beam_angle_deg == 0 || !complete_beams(geometry.three_beam, b)) {
    return false;
  }
  const base::Bam32 angle_bam32 = bam_of_cdeg(std::int64_t{geometry.beam_angle_deg} * 100);
  const std::int64_t twice_sin = 2 * std::int64_t{base::sin_q30(angle_bam32)};
  const std::int64_t four_cos = 4 * std::int64_t{base::cos_q30(angle_bam32)};
  // mm/s * 1000 * 2^30 stays below 2^58.
  constexpr std::int64_t kUm_q30 = std::int64_t{1000} * base::kOne_q30;
  const std::int64_t side = geometry.convex ? kUm_q30 : -kUm_q30;
  out = {divide_rounded((b[0] - b[1]) * side, twice_sin),
         divide_rounded((b[3] - b[2]) * side, twice_sin),
         divide_rounded((b[0] + b[1] + b[2] + b[3]) * kUm_q30, four_cos)};
  return true;
}

bool stated(const Pd0Ensemble& ensemble, Sfu& out) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (ensemble.velocity_mm_s[i] == kPd0BadVelocity) {
      return false;
    }
    out[i] = std::int64_t{ensemble.velocity_mm_s[i]} * 1000;
  }
  return true;
}

Vector3 frd_of(const Sfu& v) { return {v[1], v[0], -v[2]}; }

/// Pitch of the tilt sensor to the Euler angle: tan P = tan(tilt) cos(roll).
base::Bam32 euler_pitch(base::Bam32 tilt_bam32, base::Bam32 roll_bam32) {
  const std::int64_t rise = std::int64_t{base::sin_q30(tilt_bam32)} * base::cos_q30(roll_bam32);
  return atan2_bam32(rise >> 30, base::cos_q30(tilt_bam32));
}

/// The axes of the instrument in the vehicle, EA clockwise from the bow.
Rotation alignment(base::Bam32 alignment_bam32) { return rotation_of({0, 0, alignment_bam32}); }

/// Level axes of the ship to those of its body.
Vector3 body_of_level(const Vector3& level, const Pd0Ensemble& ensemble, const Geometry& geometry) {
  const base::Bam32 roll_bam32 = bam_of_cdeg(ensemble.roll_cdeg);
  const base::Bam32 tilt_bam32 = bam_of_cdeg(ensemble.pitch_cdeg);
  const Rotation turned = alignment(geometry.alignment_bam32);
  // The tilts are about the instrument's axes.
  const Rotation tilted = rotation_of({roll_bam32, euler_pitch(tilt_bam32, roll_bam32), 0});
  return rotated(turned, rotated_back(tilted, rotated_back(turned, level)));
}

/// Velocity of the bottom in the body or in the world (earth coordinates).
bool velocity_of(const Pd0Ensemble& ensemble, const Geometry& geometry, Vector3& out) {
  Sfu v{};
  const bool known = geometry.frame == Pd0Frame::kBeam ? instrument_of_beams(ensemble, geometry, v)
                                                       : stated(ensemble, v);
  if (!known) {
    return false;
  }
  switch (geometry.frame) {
    case Pd0Frame::kBeam:
    case Pd0Frame::kInstrument:
      if (geometry.up) {
        v[0] = -v[0];
        v[2] = -v[2];
      }
      out = rotated(alignment(geometry.alignment_bam32), frd_of(v));
      return true;
    case Pd0Frame::kShip:
      out = geometry.tilts_used ? body_of_level(frd_of(v), ensemble, geometry) : frd_of(v);
      return true;
    case Pd0Frame::kEarth:
      out = frd_of(v);  // east, north, up to north, east, down: the same exchange
      return true;
  }
  return false;
}

/// Mean of all four vertical ranges, or of an opposite pair: there the tilts cancel. 0: neither.
std::int64_t altitude_um(const std::array<std::uint32_t, 4>& range_cm) {
  const bool first = range_cm[0] > 0 && range_cm[1] > 0;
  const bool second = range_cm[2] > 0 && range_cm[3] > 0;
  std::int64_t sum_cm = 0;
  std::int64_t count = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    if (i < 2 ? first : second) {
      sum_cm += range_cm[i];
      ++count;
    }
  }
  const std::int64_t mean_um = count == 0 ? 0 : divide_rounded(sum_cm * 10'000, count);
  return mean_um <= base::kMaxRange_um ? mean_um : 0;
}

}  // namespace

bool Pd0Codec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(sample);
}

bool Pd0Codec::next(base::NavSample& sample) {
  if (queued_next_ < queued_count_) {
    sample = queued_[queued_next_];
    ++queued_next_;
    ++counters_.records;
    return true;
  }
  FrameBytes frame{};
  if (!framer_.next(judge, counters_, frame)) {
    return false;
  }
  take(frame, sample);
  ++counters_.records;
  return true;
}

void Pd0Codec::restart() {
  framer_.reset(counters_);
  queued_count_ = 0;
  queued_next_ = 0;
}

void Pd0Codec::queue(const base::NavSample& sample) {
  queued_[queued_count_] = sample;
  ++queued_count_;
}

void Pd0Codec::take(const FrameBytes& frame, base::NavSample& sample) {
  queued_count_ = 0;
  queued_next_ = 0;
  base::NavSample blank{};
  blank.t_us = sent_us(frame, config_.byte_time_ns);
  blank.quality = 255;
  sample = blank;
  sample.kind = base::NavKind::kVelocity;
  Blocks blocks;
  if (!find_blocks(frame, blocks)) {
    // Its sum is right: an ensemble all the same, of which nothing is understood.
    ++counters_.bad_values;
    ensemble_ = read_ensemble(Blocks{});
    return;
  }
  ensemble_ = read_ensemble(blocks);
  blank.t_device_us = ensemble_.utc_us;
  sample.t_device_us = ensemble_.utc_us;

  Vector3 velocity_um_s{};
  if (blocks.fixed.bytes != nullptr && ensemble_.has_bottom_track &&
      velocity_of(ensemble_, geometry_of(blocks.fixed), velocity_um_s)) {
    for (std::size_t i = 0; i < 3; ++i) {
      sample.velocity_um_s[i] = config_.velocity_of_bottom ? -velocity_um_s[i] : velocity_um_s[i];
    }
    sample.fields =
        ensemble_.frame == Pd0Frame::kEarth ? base::kNavVelocityWorld : base::kNavVelocityBody;
  } else {
    ++counters_.no_data;
  }

  base::NavSample altitude = blank;
  altitude.kind = base::NavKind::kAltitude;
  altitude.altitude_um = altitude_um(ensemble_.range_cm);
  altitude.fields = base::kNavAltitude;
  if (altitude.altitude_um > 0) {
    queue(altitude);
  }
  if (blocks.variable.bytes == nullptr) {
    return;
  }

  constexpr std::int32_t kQuarterTurn_cdeg = 9'000;
  constexpr std::int32_t kHalfTurn_cdeg = 18'000;
  base::NavSample attitude = blank;
  attitude.kind = base::NavKind::kAttitude;
  if (ensemble_.pitch_cdeg >= -kQuarterTurn_cdeg && ensemble_.pitch_cdeg <= kQuarterTurn_cdeg &&
      ensemble_.roll_cdeg >= -kHalfTurn_cdeg && ensemble_.roll_cdeg <= kHalfTurn_cdeg) {
    attitude.attitude.roll_bam32 = bam_of_cdeg(ensemble_.roll_cdeg);
    attitude.attitude.pitch_bam32 = bam_of_cdeg(ensemble_.pitch_cdeg);
    if (config_.euler_pitch) {
      attitude.attitude.pitch_bam32 =
          euler_pitch(attitude.attitude.pitch_bam32, attitude.attitude.roll_bam32);
    }
    attitude.fields |= base::kNavRollPitch;
  }
  if (ensemble_.heading_cdeg < 2 * kHalfTurn_cdeg) {
    attitude.attitude.heading_bam32 = bam_of_cdeg(ensemble_.heading_cdeg);
    attitude.fields |= config_.true_heading ? base::kNavHeading : base::kNavHeadingMagnetic;
  }
  if (ensemble_.utc_us != 0) {
    attitude.utc_us = ensemble_.utc_us;
    attitude.fields |= base::kNavUtc;
  }
  queue(attitude);

  const bool depth_sensor = blocks.fixed.bytes != nullptr &&
                            (blocks.fixed.bytes[30] & blocks.fixed.bytes[31] & kDepthSensor) != 0;
  if (depth_sensor) {
    base::NavSample depth = blank;
    depth.kind = base::NavKind::kDepth;
    depth.depth_um = std::int64_t{ensemble_.depth_dm} * 100'000;
    depth.fields = base::kNavDepth;
    queue(depth);
  }

  base::NavSample water = blank;
  water.kind = base::NavKind::kWater;
  water.sound_speed_mm_s = std::int32_t{ensemble_.sound_speed_m_s} * 1000;
  water.temperature_mdegc = std::int32_t{ensemble_.temperature_cdegc} * 10;
  water.fields = base::kNavSoundSpeed | base::kNavTemperature;
  queue(water);
}

}  // namespace leadline::hal
