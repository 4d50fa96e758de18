#include "hal/heads/cerulean.hpp"

#include "hal/angles.hpp"
#include "hal/heads/beam_angles.hpp"
#include "hal/heads/float_fields.hpp"
#include "hal/heads/ping_protocol.hpp"
#include "hal/wire.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

constexpr std::uint16_t kJson = 10;
constexpr std::uint16_t kUtcRequest = 14;
constexpr std::uint16_t kUtcResponse = 15;
constexpr std::uint16_t kSetNetInfo = 17;
constexpr std::uint16_t kWaterStats = 118;
constexpr std::uint16_t kAttitudeReport = 504;
constexpr std::uint16_t kSetSpeedOfSound = 1002;
constexpr std::uint16_t kS500Parameters = 1015;
constexpr std::uint16_t kDistance2 = 1223;
constexpr std::uint16_t kProfile6 = 1308;
constexpr std::uint16_t kOmniscan450Parameters = 2197;
constexpr std::uint16_t kMonoProfile = 2198;
constexpr std::uint16_t kEndPingInfo = 3010;
constexpr std::uint16_t kYzPoints = 3011;
constexpr std::uint16_t kAtofPoints = 3012;
constexpr std::uint16_t kSurveyorParameters = 3023;
constexpr std::uint16_t kOmniscan3dParameters = 3024;
constexpr std::uint16_t kOs3dPoints = 3104;

constexpr std::size_t kMaxText_bytes = 16'384;
constexpr std::int64_t kMinSpeed_mm_s = 1'300'000;
constexpr std::int64_t kMaxSpeed_mm_s = 1'700'000;
constexpr std::int64_t kLongest_ns = 2'000'000'000;  // a kilometre and a half, there and back
constexpr std::int64_t kFarthest_mm = 1'000'000;
constexpr std::uint8_t kMaxChannel = 7;
constexpr std::int64_t kBamPerRadian = 683'565'276;
constexpr std::int64_t kMaxPower_mdb = 400'000;
constexpr std::int64_t kStopRepeat_us = 1'000'000;
// 2017 to 2099: before it was told, a head counts from its power-up.
constexpr std::uint64_t kFirstUtc_ms = 1'483'228'800'000;
constexpr std::uint64_t kLastUtc_ms = 4'102'444'800'000;

/// A message: a fixed part, and elements behind it which a u16 in the fixed part counts.
struct Row {
  std::uint16_t id;
  std::uint16_t fixed_bytes;
  std::uint16_t extra_bytes;   ///< most that may follow the fixed part
  std::uint8_t element_bytes;  ///< 0: what follows is text, or nothing
  std::uint8_t count_offset;
};

constexpr std::array<Row, 26> kRows{{
    {kPingAck, 2, 0, 0, 0},
    {kPingNack, 2, 512, 0, 0},
    {kPingAsciiText, 0, 512, 0, 0},
    {kPingDeviceInformation, 6, 0, 0, 0},
    {kPingProtocolVersion, 4, 0, 0, 0},
    {kPingGeneralRequest, 2, 0, 0, 0},
    {kJson, 0, kMaxText_bytes, 0, 0},
    {kUtcRequest, 0, 0, 0, 0},
    {kUtcResponse, 12, 0, 0, 0},
    {kSetNetInfo, 12, 0, 0, 0},
    {kWaterStats, 8, 0, 0, 0},
    {kAttitudeReport, 36, 1, 0, 0},
    {kSetSpeedOfSound, 4, 0, 0, 0},
    {kS500Parameters, 20, 0, 0, 0},
    {1203, 4, 0, 0, 0},  // S500 speed_of_sound
    {1211, 5, 0, 0, 0},  // S500 altitude
    {kDistance2, 16, 0, 0, 0},
    {kProfile6, 66, 2 * kMaxCeruleanBins, 2, 64},
    {kOmniscan450Parameters, 36, 0, 0, 0},
    {kMonoProfile, 52, 2 * kMaxCeruleanBins, 2, 22},
    {kEndPingInfo, 80, 0, 0, 0},
    {kYzPoints, 100, 8 * kMaxCeruleanPoints, 8, 98},
    {kAtofPoints, 40, 16 * kMaxCeruleanPoints, 16, 36},
    {kSurveyorParameters, 36, 0, 0, 0},
    {kOmniscan3dParameters, 36, 0, 0, 0},
    {kOs3dPoints, 80, 16 * kMaxCeruleanPoints, 16, 8},
}};

constexpr std::size_t longest_payload() {
  std::size_t longest = 0;
  for (const Row& row : kRows) {
    longest = base::max_of(longest, row.fixed_bytes + std::size_t{row.extra_bytes});
  }
  return longest;
}
static_assert(longest_payload() <= kMaxCeruleanPayload_bytes,
              "a frame that outgrows the buffer would never be complete");

const Row* find(std::uint16_t id) {
  for (const Row& row : kRows) {
    if (row.id == id) {
      return &row;
    }
  }
  return nullptr;
}

bool counted_right(const Row& row, const std::uint8_t* payload, std::size_t payload_bytes) {
  return row.element_bytes == 0 ||
         payload_bytes == row.fixed_bytes + std::size_t{row.element_bytes} *
                                                read_u16_le(payload + row.count_offset);
}

Judgement judge(const std::uint8_t* bytes, std::size_t available) {
  if (bytes[0] != 'B' || (available > 1 && bytes[1] != 'R')) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (available < kPingHeader_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  const Row* row = find(read_u16_le(bytes + 4));
  if (row == nullptr) {
    return {FrameVerdict::kUnknownId, 0};
  }
  const std::size_t payload_bytes = read_u16_le(bytes + 2);
  if (payload_bytes < row->fixed_bytes ||
      payload_bytes > row->fixed_bytes + std::size_t{row->extra_bytes}) {
    return {FrameVerdict::kBadLength, 0};
  }
  const std::size_t checked_bytes = kPingHeader_bytes + payload_bytes;
  if (available < checked_bytes + 2) {
    return {FrameVerdict::kMore, 0};
  }
  if (ping_checksum(bytes, checked_bytes) != read_u16_le(bytes + checked_bytes)) {
    return {FrameVerdict::kBadChecksum, 0};
  }
  if (!counted_right(*row, bytes + kPingHeader_bytes, payload_bytes)) {
    return {FrameVerdict::kBadLength, 0};
  }
  return {FrameVerdict::kFrame, checked_bytes + 2};
}

const std::uint8_t* payload_of(const FrameBytes& frame) { return frame.data + kPingHeader_bytes; }

bool read_speed(std::uint32_t bits, std::int32_t& speed_mm_s) {
  std::int64_t value = 0;
  if (!f32_within(bits, 1000, kMinSpeed_mm_s, kMaxSpeed_mm_s, value)) {
    return false;
  }
  speed_mm_s = static_cast<std::int32_t>(value);
  return true;
}

/// The order of singles as that of unsigned numbers.
constexpr std::uint32_t order_of(std::uint32_t bits) {
  return (bits & 0x80000000U) != 0 ? ~bits : bits | 0x80000000U;
}

/// 2^(-2^-i) in Q30, i = 1 .. 16.
constexpr std::array<std::int64_t, 16> kRoots_q30{
    759'250'125,   902'905'651,   984'625'594,   1'028'218'693, 1'050'733'751, 1'062'175'491,
    1'067'942'999, 1'070'838'486, 1'072'289'173, 1'073'015'252, 1'073'378'477, 1'073'560'135,
    1'073'650'976, 1'073'696'399, 1'073'719'111, 1'073'730'468};

/// 65535 * 10^(-attenuation / 20), rounded; 65535 for an attenuation below 0. Within 2.
std::uint16_t amplitude_of(std::int64_t attenuation_mdb) {
  if (attenuation_mdb <= 0) {
    return 65535;
  }
  // log2(10) / 20 octaves a decibel.
  const std::int64_t octaves_q16 = (attenuation_mdb * 713'379) >> 16;
  const std::int64_t whole = octaves_q16 >> 16;
  if (whole > 16) {
    return 0;
  }
  std::int64_t value_q30 = base::kOne_q30;
  for (std::size_t i = 0; i < kRoots_q30.size(); ++i) {
    if ((octaves_q16 & (std::int64_t{0x8000} >> i)) != 0) {
      value_q30 = (value_q30 * kRoots_q30[i]) >> 30;
    }
  }
  const std::int64_t scaled = (value_q30 * 65535) >> whole;
  return static_cast<std::uint16_t>((scaled + (std::int64_t{1} << 29U)) >> 30);
}

/// Microseconds there and back over `range_um`.
constexpr std::int64_t two_way_us(std::int64_t range_um, std::int64_t speed_mm_s) {
  return 2000 * range_um / speed_mm_s;
}

CeruleanConfig limited(CeruleanConfig config) {
  config.min_confidence_percent = base::min_of<std::uint8_t>(config.min_confidence_percent, 100);
  config.ping_interval_ms = base::clamp(config.ping_interval_ms, 1, 32'767);
  config.silence_us = base::clamp(config.silence_us, 100'000, 60'000'000);
  config.min_range_um = base::clamp<std::int64_t>(config.min_range_um, 0, kFarthest_mm * 1000);
  config.max_range_um = base::clamp<std::int64_t>(config.max_range_um, 0, kFarthest_mm * 1000);
  const std::int32_t most = config.head == CeruleanHead::kSurveyor ? 800 : 1000;
  config.range_steps = base::clamp(config.range_steps, 200, most);
  config.sound_speed_mm_s =
      base::clamp(config.sound_speed_mm_s, static_cast<std::int32_t>(kMinSpeed_mm_s),
                  static_cast<std::int32_t>(kMaxSpeed_mm_s));
  return config;
}

}  // namespace

CeruleanCodec::CeruleanCodec(const CeruleanConfig& config)
    : config_(limited(config)), framer_(PingParser::kMaxGap_us) {}

bool CeruleanCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(ping);
}

bool CeruleanCodec::next(base::Ping& ping) {
  if (deliver_point(ping)) {
    return true;
  }
  return framer_.take_next(judge, counters_,
                           [&](const FrameBytes& frame) { return take(frame, ping); });
}

void CeruleanCodec::restart() {
  framer_.reset(counters_);
  set_ = Set{};
  step_ = Step::kStart;
  ++counters_.restarts;
}

// --- What arrives ---

bool CeruleanCodec::take(const FrameBytes& frame, base::Ping& ping) {
  if (config_.device_id != 0 && frame.data[6] != config_.device_id) {
    ++counters_.wrong_device;
    return false;
  }
  return take_measurement(frame, read_u16_le(frame.data + 4), ping);
}

bool CeruleanCodec::take_measurement(const FrameBytes& frame, std::uint16_t id, base::Ping& ping) {
  bool good = false;
  bool done = false;
  switch (id) {
    case kAtofPoints:
      good = take_atof(frame);
      break;
    case kOs3dPoints:
      good = take_os3d(frame);
      break;
    case kYzPoints:
      good = take_yz(frame);
      break;
    case kDistance2:
      good = done = take_distance2(frame, ping);
      break;
    case kProfile6:
      good = done = take_profile6(frame, ping);
      break;
    case kMonoProfile:
      good = done = take_mono_profile(frame, ping);
      break;
    default:
      if (!take_other(frame, id)) {
        ++counters_.bad_values;
      }
      return false;
  }
  if (!good) {
    set_ = Set{};  // one bad point spoils the message
    ++counters_.bad_values;
    return false;
  }
  heard_ = true;
  if (done) {
    ++counters_.records;
    return true;
  }
  return deliver_point(ping);
}

bool CeruleanCodec::take_other(const FrameBytes& frame, std::uint16_t id) {
  switch (id) {
    case kAttitudeReport:
      return take_attitude(frame);
    case kWaterStats:
      return take_water(frame);
    case kEndPingInfo:
      return take_end_ping(frame);
    case kUtcRequest:
      utc_asked_ = true;
      return true;
    case kPingNack:
      ++counters_.nacks;
      return true;
    default:
      ++counters_.ignored;
      return true;
  }
}

bool CeruleanCodec::begin_set(const FrameBytes& frame, std::uint32_t speed_bits) {
  set_ = Set{};
  set_.t_arrival_us = frame.t_arrival_us;
  set_.mount = config_.mount;
  return read_speed(speed_bits, set_.sound_speed_mm_s);
}

/// False when the point is none that the head could have sent; without a two-way time it is no point.
bool CeruleanCodec::add_point(std::int64_t to_starboard_bam, std::int64_t two_way_ns,
                              std::int64_t longest_ns, std::uint8_t quality) {
  const std::int64_t quarter = base::kBam32QuarterTurn;
  if (to_starboard_bam < -quarter || to_starboard_bam > quarter || two_way_ns < 0 ||
      two_way_ns > longest_ns) {
    return false;
  }
  const std::int64_t range_um = (two_way_ns * set_.sound_speed_mm_s + 1'000'000) / 2'000'000;
  if (range_um == 0) {
    return true;
  }
  Point& point = points_[set_.count];
  point.to_starboard_bam32 = static_cast<base::Bam32>(static_cast<std::uint64_t>(to_starboard_bam));
  point.two_way_ns = static_cast<std::uint32_t>(two_way_ns);
  point.range_um = static_cast<std::uint32_t>(range_um);
  point.quality = quality;
  ++set_.count;
  set_.listening_us = base::max_of(set_.listening_us, two_way_ns / 1000);
  return true;
}

bool CeruleanCodec::take_atof(const FrameBytes& frame) {
  const std::uint8_t* payload = payload_of(frame);
  std::int64_t listening_ns = 0;
  std::int64_t pulse_ns = 0;
  if (!begin_set(frame, read_u32_le(payload + 16)) ||
      !f32_within(read_u32_le(payload + 12), 1'000'000'000, 1, kLongest_ns, listening_ns) ||
      !f32_within(read_u32_le(payload + 28), 1'000'000'000, 0, kLongest_ns, pulse_ns)) {
    return false;
  }
  const std::uint32_t number = read_u32_le(payload + 20);
  const std::int64_t sign = config_.atof_positive_to_port ? -1 : 1;
  // Detection may place an echo in the tail of the last bin.
  const std::int64_t longest_ns = listening_ns + listening_ns / 8 + pulse_ns;
  const std::size_t count = read_u16_le(payload + 36);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint8_t* point = payload + 40 + 16 * i;
    std::int64_t angle_bam = 0;
    std::int64_t two_way_ns = 0;
    if (!f32_within(read_u32_le(point), kBamPerRadian, -kBamPerRadian * 2, kBamPerRadian * 2,
                    angle_bam) ||
        !f32_within(read_u32_le(point + 4), 1'000'000'000, 0, kLongest_ns, two_way_ns) ||
        !add_point(sign * angle_bam, two_way_ns, longest_ns, 255)) {
      return false;
    }
  }
  set_.listening_us = base::max_of(set_.listening_us, listening_ns / 1000);
  has_atof_ = true;
  if (has_yz_ && yz_ping_ == number) {
    ++counters_.repeats;  // its yz points were used already
    set_ = Set{};
  }
  return true;
}

bool CeruleanCodec::take_yz(const FrameBytes& frame) {
  const std::uint8_t* payload = payload_of(frame);
  if (has_atof_) {
    ++counters_.repeats;
    return true;
  }
  if (!begin_set(frame, read_u32_le(payload + 8))) {
    return false;
  }
  const std::size_t count = read_u16_le(payload + 98);
  const std::int64_t farthest_um = kFarthest_mm * 1000;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint8_t* point = payload + 100 + 8 * i;
    std::int64_t port_um = 0;
    std::int64_t up_um = 0;
    if (!f32_within(read_u32_le(point), 1'000'000, -farthest_um, farthest_um, port_um) ||
        !f32_within(read_u32_le(point + 4), 1'000'000, -farthest_um, 0, up_um)) {
      return false;
    }
    const std::int64_t range_um =
        isqrt_u64(static_cast<std::uint64_t>(port_um * port_um + up_um * up_um));
    const std::int64_t two_way_ns = range_um * 2'000'000 / set_.sound_speed_mm_s;
    const auto angle = static_cast<std::int32_t>(atan2_bam32(-port_um, -up_um));
    if (!add_point(angle, two_way_ns, kLongest_ns, 255)) {
      return false;
    }
  }
  has_yz_ = true;
  yz_ping_ = read_u32_le(payload + 4);
  return true;
}

bool CeruleanCodec::take_os3d(const FrameBytes& frame) {
  const std::uint8_t* payload = payload_of(frame);
  const std::uint32_t high = read_u32_le(payload + 32);
  const std::uint32_t medium = read_u32_le(payload + 36);
  const std::uint32_t low = read_u32_le(payload + 40);
  if (!begin_set(frame, read_u32_le(payload + 4)) || payload[28] != 1 ||
      payload[29] > kMaxChannel || !f32_is_finite(high) || !f32_is_finite(medium) ||
      !f32_is_finite(low)) {
    return false;
  }
  set_.mount = static_cast<std::uint16_t>(config_.mount + payload[29]);
  const std::size_t count = read_u16_le(payload + 8);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint8_t* point = payload + 80 + 16 * i;
    const std::uint32_t power = read_u32_le(point + 8);
    const std::uint8_t kind = point[12];
    std::int64_t angle_bam = 0;
    std::int64_t two_way_ns = 0;
    if (!f32_within(read_u32_le(point), kBamPerRadian, -kBamPerRadian * 2, kBamPerRadian * 2,
                    angle_bam) ||
        !f32_within(read_u32_le(point + 4), 1'000'000'000, 0, kLongest_ns, two_way_ns) ||
        !f32_is_finite(power) || kind > 2) {
      return false;
    }
    const bool wanted = config_.points == CeruleanPoints::kAll ||
                        (config_.points == CeruleanPoints::kNoWaterColumn && kind != 2) ||
                        kind == 1;
    std::uint8_t quality = 40;
    quality = order_of(power) >= order_of(low) ? 85 : quality;
    quality = order_of(power) >= order_of(medium) ? 170 : quality;
    quality = order_of(power) >= order_of(high) ? 255 : quality;
    if (wanted && !add_point(angle_bam, two_way_ns, kLongest_ns, quality)) {
      return false;
    }
  }
  set_.listening_us =
      base::max_of(set_.listening_us, two_way_us(end_range_um_, set_.sound_speed_mm_s));
  return true;
}

bool CeruleanCodec::deliver_point(base::Ping& ping) {
  if (set_.next >= set_.count) {
    return false;
  }
  const Point& point = points_[set_.next];
  ++set_.next;
  ping = base::Ping{};
  ping.t_transmit_us = set_.t_arrival_us - set_.listening_us;
  ping.t_receive_us = ping.t_transmit_us + point.two_way_ns / 1000;
  set_fan_beam(ping, point.to_starboard_bam32);
  ping.mount = set_.mount;
  ping.kind = base::ReturnKind::kRange;
  ping.quality = point.quality;
  ping.range_um = point.range_um;
  ping.sound_speed_mm_s = set_.sound_speed_mm_s;
  ++counters_.records;
  return true;
}

base::Ping CeruleanCodec::single_beam(const FrameBytes& frame, std::int32_t sound_speed_mm_s,
                                      std::int64_t farthest_um) const {
  base::Ping ping{};
  ping.t_receive_us = frame.t_arrival_us;
  ping.t_transmit_us = frame.t_arrival_us - two_way_us(farthest_um, sound_speed_mm_s);
  ping.azimuth_bam32 = config_.azimuth_bam32;
  ping.elevation_bam32 = config_.elevation_bam32;
  ping.mount = config_.mount;
  ping.quality = 255;
  ping.sound_speed_mm_s = sound_speed_mm_s;
  return ping;
}

void CeruleanCodec::set_range(std::int64_t range_um, std::uint8_t confidence_percent,
                              base::Ping& ping) const {
  if (range_um <= 0 || confidence_percent == 0 ||
      confidence_percent < config_.min_confidence_percent) {
    ping.kind = base::ReturnKind::kNoReturn;
    return;
  }
  ping.kind = base::ReturnKind::kRange;
  ping.range_um = range_um;
  ping.quality = static_cast<std::uint8_t>((confidence_percent * 255 + 50) / 100);
  ping.t_receive_us = ping.t_transmit_us + two_way_us(range_um, ping.sound_speed_mm_s);
}

bool CeruleanCodec::take_distance2(const FrameBytes& frame, base::Ping& ping) {
  const std::uint8_t* payload = payload_of(frame);
  const std::int64_t distance_mm = read_u32_le(payload);
  if (distance_mm > kFarthest_mm || read_u32_le(payload + 4) > kFarthest_mm || payload[10] > 100 ||
      payload[11] > 100) {
    return false;
  }
  ping = single_beam(frame, config_.sound_speed_mm_s, distance_mm * 1000);
  set_range(distance_mm * 1000, payload[10], ping);
  return true;
}

bool CeruleanCodec::take_profile6(const FrameBytes& frame, base::Ping& ping) {
  const std::uint8_t* payload = payload_of(frame);
  std::int64_t depth_um = 0;
  std::int64_t smooth_um = 0;
  Profile profile{};
  if (!f32_within(read_u32_le(payload + 40), 1000, -kMaxPower_mdb, kMaxPower_mdb,
                  profile.max_mdb) ||
      !f32_within(read_u32_le(payload + 44), 1000, -kMaxPower_mdb, kMaxPower_mdb,
                  profile.min_mdb) ||
      !f32_within(read_u32_le(payload + 48), 1'000'000, 0, kFarthest_mm * 1000, depth_um) ||
      !f32_within(read_u32_le(payload + 52), 1'000'000, 0, kFarthest_mm * 1000, smooth_um) ||
      !f32_is_finite(read_u32_le(payload + 32)) || payload[60] > 100) {
    return false;
  }
  profile.results = payload + 66;
  profile.count = read_u16_le(payload + 64);
  profile.start_mm = read_u32_le(payload + 4);
  profile.length_mm = read_u32_le(payload + 8);
  profile.sound_speed_mm_s = config_.sound_speed_mm_s;
  if (!take_profile(frame, profile, ping)) {
    return false;
  }
  if (!config_.profile) {
    ping.profile = base::RangeProfile{};
    set_range(depth_um, payload[60], ping);
  }
  return true;
}

bool CeruleanCodec::take_mono_profile(const FrameBytes& frame, base::Ping& ping) {
  const std::uint8_t* payload = payload_of(frame);
  const std::uint32_t frequency_hz = read_u32_le(payload + 16);
  const std::int32_t speed_mm_s = read_u16_le(payload + 24) * 100;
  Profile profile{};
  if (speed_mm_s < kMinSpeed_mm_s || speed_mm_s > kMaxSpeed_mm_s || frequency_hz < 10'000 ||
      frequency_hz > 5'000'000 || payload[26] > kMaxChannel ||
      !f32_is_finite(read_u32_le(payload + 28)) || !f32_is_finite(read_u32_le(payload + 32)) ||
      !f32_within(read_u32_le(payload + 36), 1000, -kMaxPower_mdb, kMaxPower_mdb,
                  profile.max_mdb) ||
      !f32_within(read_u32_le(payload + 40), 1000, -kMaxPower_mdb, kMaxPower_mdb,
                  profile.min_mdb)) {
    return false;
  }
  profile.results = payload + 52;
  profile.count = read_u16_le(payload + 22);
  profile.start_mm = read_u32_le(payload + 4);
  profile.length_mm = read_u32_le(payload + 8);
  profile.sound_speed_mm_s = speed_mm_s;
  profile.channel = payload[26];
  return take_profile(frame, profile, ping);
}

bool CeruleanCodec::take_profile(const FrameBytes& frame, const Profile& profile,
                                 base::Ping& ping) {
  if (profile.count == 0 || profile.start_mm > kFarthest_mm || profile.length_mm == 0 ||
      profile.length_mm > kFarthest_mm || profile.max_mdb < profile.min_mdb) {
    return false;
  }
  const std::int64_t full_mdb =
      config_.full_scale_mdb == 0 ? profile.max_mdb : config_.full_scale_mdb;
  const std::int64_t span_mdb = profile.max_mdb - profile.min_mdb;
  for (std::int64_t i = 0; i < profile.count; ++i) {
    const std::int64_t part = read_u16_le(profile.results + 2 * i);
    const std::int64_t power_mdb = profile.min_mdb + (span_mdb * part + 32'767) / 65'535;
    intensity_[static_cast<std::size_t>(i)] = amplitude_of(full_mdb - power_mdb);
  }
  const std::int64_t length_um = profile.length_mm * 1000;
  ping = single_beam(frame, profile.sound_speed_mm_s, profile.start_mm * 1000 + length_um);
  ping.mount = static_cast<std::uint16_t>(config_.mount + profile.channel);
  ping.kind = base::ReturnKind::kProfile;
  ping.profile.intensity = intensity_.data();
  ping.profile.bin_um = static_cast<std::uint32_t>(
      base::max_of<std::int64_t>(1, (length_um + profile.count / 2) / profile.count));
  ping.profile.first_bin_um = profile.start_mm * 1000 + length_um / (2 * profile.count);
  ping.profile.bin_count = static_cast<std::uint16_t>(profile.count);
  return true;
}

bool CeruleanCodec::take_attitude(const FrameBytes& frame) {
  const std::uint8_t* payload = payload_of(frame);
  std::int64_t up_q30[3] = {};
  const std::int64_t limit = std::int64_t{2} * base::kOne_q30;
  for (std::size_t i = 0; i < 3; ++i) {
    if (!f32_within(read_u32_le(payload + 4 * i), base::kOne_q30, -limit, limit, up_q30[i])) {
      return false;
    }
  }
  base::NavSample sample{};
  sample.kind = base::NavKind::kAttitude;
  sample.t_us = frame.t_arrival_us;
  sample.t_device_us = read_u32_le(payload + 32) * std::int64_t{1000};
  const std::int64_t across = up_q30[1] * up_q30[1] + up_q30[2] * up_q30[2];
  const std::int64_t square_q30 = (across + up_q30[0] * up_q30[0]) >> 30;
  // A vector that is not of length one within a tenth is no direction.
  constexpr std::int64_t kLeast_q30 = std::int64_t{base::kOne_q30} * 4 / 5;
  constexpr std::int64_t kMost_q30 = std::int64_t{base::kOne_q30} * 6 / 5;
  if (square_q30 > kLeast_q30 && square_q30 < kMost_q30) {
    const std::int64_t forward = config_.bow_up_is_positive_x ? up_q30[0] : -up_q30[0];
    sample.attitude.roll_bam32 = atan2_bam32(up_q30[1], up_q30[2]);
    sample.attitude.pitch_bam32 =
        atan2_bam32(forward, isqrt_u64(static_cast<std::uint64_t>(across)));
    sample.fields = base::kNavRollPitch;
    sample.quality = 255;
  }
  const std::uint64_t utc_ms = read_u64_le(payload + 24);
  if (utc_ms >= kFirstUtc_ms && utc_ms < kLastUtc_ms) {
    sample.utc_us = static_cast<std::int64_t>(utc_ms) * 1000;
    sample.fields = static_cast<std::uint16_t>(sample.fields | base::kNavUtc);
  }
  samples_.push(sample);
  return true;
}

bool CeruleanCodec::take_water(const FrameBytes& frame) {
  base::NavSample sample{};
  sample.kind = base::NavKind::kWater;
  sample.t_us = frame.t_arrival_us;
  std::int64_t temperature_mdegc = 0;
  // -1000 and noise: no sensor.
  if (f32_within(read_u32_le(payload_of(frame)), 1000, -5'000, 60'000, temperature_mdegc)) {
    sample.temperature_mdegc = static_cast<std::int32_t>(temperature_mdegc);
    sample.fields = base::kNavTemperature;
    sample.quality = 255;
  } else {
    ++counters_.no_data;
  }
  samples_.push(sample);
  return true;
}

bool CeruleanCodec::take_end_ping(const FrameBytes& frame) {
  return f32_within(read_u32_le(payload_of(frame) + 8), 1'000'000, 0, kFarthest_mm * 1000,
                    end_range_um_);
}

// --- What is asked ---

void CeruleanCodec::set_utc_offset(std::int64_t offset_us, std::uint32_t accuracy_ms) {
  knows_utc_ = true;
  utc_offset_us_ = offset_us;
  utc_accuracy_ms_ = accuracy_ms;
}

void CeruleanCodec::stop() {
  step_ = Step::kStop;
  heard_ = true;  // whether it pings is not known: tell it once in any case
  waiting_ = false;
}

std::size_t CeruleanCodec::request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity) {
  if (config_.head == CeruleanHead::kListen || capacity < kMaxRequest_bytes) {
    return 0;
  }
  if (utc_asked_ && knows_utc_) {
    return write_utc(now_us, out, capacity);
  }
  const bool heard = heard_;
  heard_ = false;
  if (heard || now_us < t_heard_us_) {
    t_heard_us_ = now_us;
  }
  switch (step_) {
    case Step::kStop: {
      if (!heard || (waiting_ && now_us >= t_sent_us_ && now_us - t_sent_us_ < kStopRepeat_us)) {
        heard_ = heard;
        return 0;
      }
      waiting_ = true;
      t_sent_us_ = now_us;
      return write_parameters(false, out, capacity);
    }
    case Step::kStart:
      if (config_.head == CeruleanHead::kS500 || config_.head == CeruleanHead::kOmniscan450) {
        step_ = Step::kSpeed;
        std::uint8_t payload[4];
        write_u32_le(payload, static_cast<std::uint32_t>(config_.sound_speed_mm_s));
        return write_ping_frame(kSetSpeedOfSound, 0, config_.device_id, payload, sizeof payload,
                                out, capacity);
      }
      [[fallthrough]];
    case Step::kSpeed:
      step_ = Step::kRun;
      t_heard_us_ = now_us;
      return write_parameters(true, out, capacity);
    case Step::kRun:
      if (now_us - t_heard_us_ >= config_.silence_us) {
        ++counters_.timeouts;
        ++counters_.restarts;
        step_ = Step::kStart;
      }
      return 0;
  }
  return 0;
}

std::size_t CeruleanCodec::write_utc(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity) {
  utc_asked_ = false;
  std::uint8_t payload[12] = {};
  const std::int64_t utc_ms = (now_us + utc_offset_us_) / 1000;
  const auto bits = static_cast<std::uint64_t>(utc_ms);
  write_u32_le(payload, static_cast<std::uint32_t>(bits));
  write_u32_le(payload + 4, static_cast<std::uint32_t>(bits >> 32U));
  write_u32_le(payload + 8, utc_accuracy_ms_);
  return write_ping_frame(kUtcResponse, 0, config_.device_id, payload, sizeof payload, out,
                          capacity);
}

std::size_t CeruleanCodec::write_parameters(bool enable, std::uint8_t* out,
                                            std::size_t capacity) const {
  constexpr std::uint32_t kPulseSteps = 0x3FC00000;     // 1.5
  constexpr std::uint32_t kPulsePercent = 0x3B03126F;   // 0.002
  constexpr std::uint32_t kFilterPercent = 0x3AC49BA6;  // 0.0015
  std::uint8_t payload[36] = {};
  const std::int64_t start_mm = config_.min_range_um / 1000;
  const std::int64_t end_mm = config_.max_range_um / 1000;
  const auto length_mm =
      static_cast<std::uint32_t>(base::max_of<std::int64_t>(0, end_mm - start_mm));
  const auto gain = static_cast<std::uint16_t>(config_.gain_index);
  const auto interval_ms = static_cast<std::uint16_t>(config_.ping_interval_ms);
  const auto steps = static_cast<std::uint16_t>(config_.range_steps);
  const std::uint8_t on = enable ? 1 : 0;
  std::uint16_t id = kSurveyorParameters;
  std::size_t payload_bytes = sizeof payload;
  if (config_.head == CeruleanHead::kS500) {
    id = kS500Parameters;
    payload_bytes = 20;
    write_u32_le(payload, static_cast<std::uint32_t>(start_mm));
    write_u32_le(payload + 4, length_mm);
    write_u16_le(payload + 8, gain);
    write_u16_le(payload + 10, interval_ms);
    write_u16_le(payload + 14,
                 enable ? (config_.profile ? kProfile6 : kDistance2) : std::uint16_t{0});
  } else if (config_.head == CeruleanHead::kOmniscan450) {
    id = kOmniscan450Parameters;
    write_u32_le(payload, static_cast<std::uint32_t>(start_mm));
    write_u32_le(payload + 4, length_mm);
    write_u32_le(payload + 8, interval_ms);
    write_u32_le(payload + 20, kPulsePercent);
    write_u32_le(payload + 24, kFilterPercent);
    write_u16_le(payload + 28, gain);
    write_u16_le(payload + 30, steps);
    payload[32] = on;
  } else {
    const bool surveyor = config_.head == CeruleanHead::kSurveyor;
    id = surveyor ? kSurveyorParameters : kOmniscan3dParameters;
    write_u32_le(payload,
                 surveyor ? static_cast<std::uint32_t>(start_mm) : f32_bits_of_milli(start_mm));
    write_u32_le(payload + 4,
                 surveyor ? static_cast<std::uint32_t>(end_mm) : f32_bits_of_milli(end_mm));
    write_u32_le(payload + 8, f32_bits_of_milli(config_.sound_speed_mm_s));
    write_u16_le(payload + 12, gain);
    write_u16_le(payload + 14, interval_ms);
    payload[19] = on;
    payload[22] = surveyor ? 1 : 0;  // yz points; reserved on the Omniscan
    payload[23] = 1;                 // angle and time
    write_u32_le(payload + 24, surveyor ? 240'000 : 450'000);
    write_u16_le(payload + 28, steps);
    write_u32_le(payload + 32, kPulseSteps);
  }
  return write_ping_frame(id, 0, config_.device_id, payload, payload_bytes, out, capacity);
}

}  // namespace leadline::hal
