#include "hal/attitude/vectornav.hpp"

#include <array>

#include "hal/angles.hpp"
#include "hal/checksums.hpp"
#include "hal/text_fields.hpp"
#include "hal/wire.hpp"

namespace leadline::hal {

namespace {

constexpr std::int64_t kE9 = 1'000'000'000;
constexpr std::uint8_t kSync = 0xFA;
constexpr std::size_t kGroups = 7;
constexpr std::size_t kFields = 16;
constexpr std::size_t kMaxTextFields = 16;
/// Faster than this nothing turns that such a sensor sits on.
constexpr std::int64_t kMaxRate_urad_s = 100'000'000;
constexpr std::int64_t kMaxSpeed_um_s = 1'000'000'000;

/// Bytes of each field, by group and bit; 0: no such field, or of changing length.
constexpr std::array<std::array<std::uint8_t, kFields>, kGroups> kLengths_bytes{{
    {8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8, 0},
    {8, 8, 8, 2, 8, 8, 8, 4, 4, 1, 0, 0, 0, 0, 0, 0},
    {2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 40, 0, 0, 0},
    {8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28, 0, 0},
    {2, 12, 16, 36, 12, 12, 12, 12, 12, 12, 28, 24, 12, 4, 0, 0},
    {2, 24, 24, 12, 12, 12, 12, 12, 12, 4, 4, 68, 64, 0, 0, 0},
    {8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28, 0, 0},
}};

struct FieldId {
  std::uint8_t group;
  std::uint8_t bit;
};

constexpr FieldId kTimeStartup{0, 0};
constexpr FieldId kTimeStartupTime{1, 0};
constexpr FieldId kYpr{0, 3};
constexpr FieldId kYprAttitude{4, 1};
constexpr FieldId kQuaternion{0, 4};
constexpr FieldId kQuaternionAttitude{4, 2};
constexpr FieldId kYprSigma{4, 8};
constexpr FieldId kRate{0, 5};
constexpr FieldId kRateImu{2, 10};
constexpr FieldId kPosition{0, 6};
constexpr FieldId kPositionIns{5, 1};
constexpr FieldId kVelocity{0, 7};
constexpr FieldId kVelocityIns{5, 4};
constexpr FieldId kInsStatus{0, 12};
constexpr FieldId kInsStatusIns{5, 0};
constexpr FieldId kPositionSigma{5, 9};
constexpr FieldId kVelocitySigma{5, 10};

/// Where the fields of a binary frame are.
struct Layout {
  std::array<std::uint16_t, kGroups> masks{};
  std::size_t header_bytes = 0;
  std::size_t size_bytes = 0;  ///< header, fields and CRC; 0: a field of unknown length
};

Layout layout_of(const std::uint8_t* bytes) {
  Layout layout;
  layout.header_bytes = 2;
  std::size_t fields_bytes = 0;
  bool known = (bytes[1] & 0x80U) == 0;
  for (std::size_t group = 0; group < kGroups; ++group) {
    if ((bytes[1] & (1U << group)) == 0) {
      continue;
    }
    layout.masks[group] = read_u16_le(bytes + layout.header_bytes);
    layout.header_bytes += 2;
    for (std::size_t bit = 0; bit < kFields; ++bit) {
      const bool wanted = (layout.masks[group] & (1U << bit)) != 0;
      fields_bytes += wanted ? kLengths_bytes[group][bit] : 0U;
      known = known && (!wanted || kLengths_bytes[group][bit] != 0);
    }
  }
  layout.size_bytes = known && fields_bytes > 0 ? layout.header_bytes + fields_bytes + 2 : 0;
  return layout;
}

/// The field's bytes, or null where the frame has none.
const std::uint8_t* find_field(const std::uint8_t* bytes, const Layout& layout, FieldId id) {
  std::size_t offset = layout.header_bytes;
  for (std::size_t group = 0; group <= id.group; ++group) {
    for (std::size_t bit = 0; bit < kFields; ++bit) {
      const bool wanted = (layout.masks[group] & (1U << bit)) != 0;
      if (group == id.group && bit == id.bit) {
        return wanted ? bytes + offset : nullptr;
      }
      offset += wanted ? kLengths_bytes[group][bit] : 0U;
    }
  }
  return nullptr;
}

const std::uint8_t* find_either(const std::uint8_t* bytes, const Layout& layout, FieldId first,
                                FieldId second) {
  const std::uint8_t* found = find_field(bytes, layout, first);
  return found != nullptr ? found : find_field(bytes, layout, second);
}

std::size_t header_bytes(std::uint8_t groups) {
  std::size_t size = 2;
  for (std::size_t group = 0; group < kGroups; ++group) {
    size += (groups & (1U << group)) != 0 ? 2U : 0U;
  }
  return size;
}

Judgement judge_binary(const std::uint8_t* bytes, std::size_t available) {
  if (available < 2) {
    return {FrameVerdict::kMore, 0};
  }
  if (bytes[1] == 0 || (bytes[1] & 0x80U) != 0) {
    return {FrameVerdict::kUnknownId, 0};
  }
  if (available < header_bytes(bytes[1])) {
    return {FrameVerdict::kMore, 0};
  }
  const std::size_t size = layout_of(bytes).size_bytes;
  if (size == 0 || size > VectorNavCodec::kMaxFrame_bytes) {
    return {FrameVerdict::kBadLength, 0};
  }
  if (available < size) {
    return {FrameVerdict::kMore, 0};
  }
  const bool good = crc16_xmodem(bytes + 1, size - 1) == 0;
  return good ? Judgement{FrameVerdict::kFrame, size} : Judgement{FrameVerdict::kBadChecksum, 0};
}

/// Bytes between '$' and '*'; 0: there is no '*'.
std::size_t body_bytes(const std::uint8_t* bytes, std::size_t text_bytes) {
  for (std::size_t i = 1; i < text_bytes; ++i) {
    if (bytes[i] == '*') {
      return i - 1;
    }
  }
  return 0;
}

bool checksum_fits(const std::uint8_t* bytes, std::size_t text_bytes, std::size_t body,
                   bool accept_unchecked) {
  const char* digits = as_text(bytes) + body + 2;
  const std::size_t count = text_bytes - body - 2;
  if (count == 2 && digits[0] == 'X' && digits[1] == 'X') {
    return accept_unchecked;
  }
  std::uint32_t stated = 0;
  if ((count != 2 && count != 4) || !parse_hex(digits, count, stated)) {
    return false;
  }
  return stated == (count == 2 ? std::uint32_t{xor8(bytes + 1, body)}
                               : std::uint32_t{crc16_xmodem(bytes + 1, body)});
}

Judgement judge_text(const std::uint8_t* bytes, std::size_t available, bool accept_unchecked) {
  constexpr std::array<std::uint8_t, 3> kStart{'$', 'V', 'N'};
  for (std::size_t i = 1; i < kStart.size() && i < available; ++i) {
    if (bytes[i] != kStart[i]) {
      return {FrameVerdict::kNoStart, 0};
    }
  }
  const TextLine line = find_line(bytes, available, '$', VectorNavCodec::kMaxLine_bytes);
  if (line.state == LineState::kMore) {
    return {FrameVerdict::kMore, 0};
  }
  if (line.state == LineState::kBroken) {
    return {FrameVerdict::kBadLength, 0};
  }
  const std::size_t body = body_bytes(bytes, line.text_bytes);
  if (body == 0 || !checksum_fits(bytes, line.text_bytes, body, accept_unchecked)) {
    return {FrameVerdict::kBadChecksum, 0};
  }
  return {FrameVerdict::kFrame, line.size_bytes};
}

bool f32_at(const std::uint8_t* bytes, std::size_t index, std::int64_t scale, std::int64_t low,
            std::int64_t high, std::int64_t& value) {
  return f32_bits_to_integer(read_u32_le(bytes + 4 * index), scale, value) && value >= low &&
         value <= high;
}

/// Yaw, pitch, roll in degrees * 1e9.
bool set_attitude(const std::array<std::int64_t, 3>& ypr_e9deg, base::NavSample& sample) {
  const auto within = [](std::int64_t value, std::int64_t limit_deg) {
    return value >= -limit_deg * kE9 && value <= limit_deg * kE9;
  };
  if (!within(ypr_e9deg[0], 360) || !within(ypr_e9deg[1], 90) || !within(ypr_e9deg[2], 180)) {
    return false;
  }
  sample.attitude = {bam_of_e9deg(ypr_e9deg[2]), bam_of_e9deg(ypr_e9deg[1]),
                     bam_of_e9deg(ypr_e9deg[0])};
  return true;
}

bool take_ypr(const std::uint8_t* field, base::NavSample& sample) {
  std::array<std::int64_t, 3> ypr_e9deg{};
  for (std::size_t i = 0; i < 3; ++i) {
    if (!f32_at(field, i, kE9, -360 * kE9, 360 * kE9, ypr_e9deg[i])) {
      return false;
    }
  }
  return set_attitude(ypr_e9deg, sample);
}

/// x, y, z, w.
bool take_quaternion(const std::uint8_t* field, base::NavSample& sample) {
  constexpr std::array<std::size_t, 4> kFrom{3, 0, 1, 2};
  constexpr std::int64_t kLimit_q30 = std::int64_t{2} * base::kOne_q30;
  std::array<std::int64_t, 4> wxyz_q30{};
  for (std::size_t i = 0; i < 4; ++i) {
    if (!f32_at(field, kFrom[i], base::kOne_q30, -kLimit_q30, kLimit_q30, wxyz_q30[i])) {
      return false;
    }
  }
  Rotation rotation{};
  if (!rotation_of_quaternion(wxyz_q30, rotation)) {
    return false;
  }
  sample.attitude = attitude_of(rotation);
  return true;
}

bool take_rates(const std::uint8_t* field, base::NavSample& sample) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (!f32_at(field, i, 1'000'000, -kMaxRate_urad_s, kMaxRate_urad_s, sample.rate_urad_s[i])) {
      return false;
    }
  }
  sample.fields |= base::kNavRates;
  return true;
}

/// Yaw, pitch, roll in degrees; what makes no sense is left out.
void take_sigmas(const std::uint8_t* field, base::NavSample& sample) {
  for (std::size_t i = 0; i < 3; ++i) {
    std::int64_t sigma_e9deg = 0;
    if (f32_at(field, i, kE9, 0, 180 * kE9, sigma_e9deg)) {
      sample.sigma_attitude_urad[2 - i] = static_cast<std::uint32_t>(urad_of_e9deg(sigma_e9deg));
    }
  }
}

/// Latitude and longitude in degrees, altitude above the ellipsoid (left).
bool take_position(const std::uint8_t* field, base::NavSample& sample) {
  std::int64_t latitude_e9deg = 0;
  std::int64_t longitude_e9deg = 0;
  if (!f64_bits_to_integer(read_u64_le(field), kE9, latitude_e9deg) ||
      !f64_bits_to_integer(read_u64_le(field + 8), kE9, longitude_e9deg) ||
      latitude_e9deg < -90 * kE9 || latitude_e9deg > 90 * kE9 || longitude_e9deg < -180 * kE9 ||
      longitude_e9deg > 180 * kE9) {
    return false;
  }
  sample.latitude_e9deg = latitude_e9deg;
  sample.longitude_e9deg = longitude_e9deg;
  sample.fields |= base::kNavGeodetic;
  return true;
}

bool take_velocity(const std::uint8_t* field, base::NavSample& sample) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (!f32_at(field, i, 1'000'000, -kMaxSpeed_um_s, kMaxSpeed_um_s, sample.velocity_um_s[i])) {
      return false;
    }
  }
  sample.fields |= base::kNavVelocityWorld;
  return true;
}

void take_uncertainty(const std::uint8_t* bytes, const Layout& layout, base::NavSample& sample) {
  const std::uint8_t* position = find_field(bytes, layout, kPositionSigma);
  const std::uint8_t* velocity = find_field(bytes, layout, kVelocitySigma);
  std::int64_t value = 0;
  if (position != nullptr && f32_at(position, 0, 1'000, 0, 1'000'000'000, value)) {
    sample.sigma_position_mm = static_cast<std::uint32_t>(value);
  }
  if (velocity != nullptr && f32_at(velocity, 0, 1'000'000, 0, 1'000'000'000, value)) {
    sample.sigma_velocity_um_s = static_cast<std::uint32_t>(value);
  }
}

bool is_tracking(const std::uint8_t* status) {
  return status == nullptr || (read_u16_le(status) & 3U) == 2;
}

/// False: a value that no sensor sends.
bool take_ins(const std::uint8_t* bytes, const Layout& layout, base::NavSample& sample) {
  if (!is_tracking(find_either(bytes, layout, kInsStatus, kInsStatusIns))) {
    return true;
  }
  const std::uint8_t* position = find_either(bytes, layout, kPosition, kPositionIns);
  const std::uint8_t* velocity = find_either(bytes, layout, kVelocity, kVelocityIns);
  if ((position != nullptr && !take_position(position, sample)) ||
      (velocity != nullptr && !take_velocity(velocity, sample))) {
    return false;
  }
  take_uncertainty(bytes, layout, sample);
  return true;
}

bool has_ins(const std::uint8_t* bytes, const Layout& layout) {
  return find_either(bytes, layout, kPosition, kPositionIns) != nullptr ||
         find_either(bytes, layout, kVelocity, kVelocityIns) != nullptr;
}

}  // namespace

bool VectorNavCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(sample);
}

bool VectorNavCodec::next(base::NavSample& sample) {
  if (has_pending_) {
    has_pending_ = false;
    sample = pending_;
    ++counters_.records;
    return true;
  }
  const auto judge = [this](const std::uint8_t* bytes, std::size_t available) {
    if (bytes[0] == kSync) {
      return judge_binary(bytes, available);
    }
    return bytes[0] == '$' ? judge_text(bytes, available, config_.accept_unchecked)
                           : Judgement{FrameVerdict::kNoStart, 0};
  };
  const bool made = framer_.take_next(judge, counters_,
                                      [&](const FrameBytes& frame) { return take(frame, sample); });
  counters_.records += made ? 1U : 0U;
  return made;
}

void VectorNavCodec::restart() {
  framer_.reset(counters_);
  has_pending_ = false;
}

base::NavSample VectorNavCodec::sample_of(const FrameBytes& frame, base::NavKind kind) const {
  base::NavSample sample{};
  sample.t_us = sent_us(frame, config_.byte_time_ns);
  sample.quality = 255;
  sample.kind = kind;
  return sample;
}

bool VectorNavCodec::take(const FrameBytes& frame, base::NavSample& sample) {
  return frame.data[0] == kSync ? take_binary(frame, sample) : take_text(frame, sample);
}

bool VectorNavCodec::take_text(const FrameBytes& frame, base::NavSample& sample) {
  const std::size_t body = body_bytes(frame.data, frame.size_bytes);
  const auto line = split<kMaxTextFields>(as_text(frame.data) + 1, body);
  if (is(line.at(0), "VNERR")) {
    ++counters_.nacks;
    return false;
  }
  if (config_.every_report && is(line.at(0), "VNRRG")) {
    sample = sample_of(frame, base::NavKind::kOther);
    return true;
  }
  if (!is(line.at(0), "VNYMR")) {
    ++counters_.ignored;
    return false;
  }
  base::NavSample taken = sample_of(frame, base::NavKind::kAttitude);
  std::array<std::int64_t, 3> ypr_e9deg{};
  bool good = line.count == 13;
  for (std::size_t i = 0; i < 3; ++i) {
    good =
        good && parse_decimal(line.at(1 + i), 9, ypr_e9deg[i]) &&
        parse_within(line.at(10 + i), 6, -kMaxRate_urad_s, kMaxRate_urad_s, taken.rate_urad_s[i]);
  }
  if (!good || !set_attitude(ypr_e9deg, taken)) {
    ++counters_.bad_values;
    return false;
  }
  taken.fields =
      static_cast<std::uint16_t>(base::kNavRollPitch | heading_field() | base::kNavRates);
  sample = taken;
  return true;
}

bool VectorNavCodec::take_binary(const FrameBytes& frame, base::NavSample& sample) {
  const std::uint8_t* bytes = frame.data;
  const Layout layout = layout_of(bytes);
  const std::uint8_t* ypr = find_either(bytes, layout, kYpr, kYprAttitude);
  const std::uint8_t* quaternion = find_either(bytes, layout, kQuaternion, kQuaternionAttitude);
  const std::uint8_t* rates = find_either(bytes, layout, kRate, kRateImu);
  const std::uint8_t* sigmas = find_field(bytes, layout, kYprSigma);
  const bool attitude = ypr != nullptr || quaternion != nullptr;
  const bool turning = attitude || rates != nullptr;
  const bool ins = has_ins(bytes, layout);
  if (!turning && !ins) {
    ++counters_.ignored;
    return false;
  }

  base::NavSample first =
      sample_of(frame, attitude ? base::NavKind::kAttitude : base::NavKind::kRates);
  base::NavSample second = sample_of(frame, base::NavKind::kPosition);
  bool good = rates == nullptr || take_rates(rates, first);
  if (attitude) {
    good = good && (ypr != nullptr ? take_ypr(ypr, first) : take_quaternion(quaternion, first));
    first.fields = static_cast<std::uint16_t>(first.fields | base::kNavRollPitch | heading_field());
  }
  if (sigmas != nullptr && attitude) {
    take_sigmas(sigmas, first);
  }
  if (!good || (ins && !take_ins(bytes, layout, second))) {
    ++counters_.bad_values;
    return false;
  }

  const std::uint8_t* clock = find_either(bytes, layout, kTimeStartup, kTimeStartupTime);
  if (clock != nullptr) {
    first.t_device_us = static_cast<std::int64_t>(read_u64_le(clock) / 1000);
    second.t_device_us = first.t_device_us;
  }
  counters_.no_data += ins && second.fields == 0 ? 1U : 0U;
  sample = turning ? first : second;
  pending_ = second;
  has_pending_ = turning && ins;
  return true;
}

}  // namespace leadline::hal
