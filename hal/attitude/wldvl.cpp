#include "hal/attitude/wldvl.hpp"

#include "hal/angles.hpp"
#include "hal/attitude/json_members.hpp"
#include "hal/checksums.hpp"
#include "hal/wire.hpp"

namespace leadline::hal {

namespace {

constexpr std::int64_t kE9 = 1'000'000'000;
constexpr std::uint8_t kPd4Start = 0x7D;  // also a closing brace: the zero behind it tells
constexpr std::int64_t kMaxSpeed_um_s = 100'000'000;
constexpr std::int64_t kMaxDelay_us = 1'000'000;
constexpr std::int64_t kMaxPosition_um = 100'000'000'000;

// Whole lines of PD6, without their ends.
constexpr std::size_t kPd6Velocity_bytes = 33;
constexpr std::size_t kPd6Distance_bytes = 57;
constexpr std::size_t kPd6Columns_bytes = 6;

/// A velocity report, whatever it was written in.
struct VelocityReport {
  std::array<TextField, 3> velocity_m_s{};
  TextField altitude_m;  ///< empty: none (water track)
  TextField fom_m_s;
  TextField t_validity_us;
  TextField t_transmission_us;
  bool valid = false;
  bool water = false;
};

struct PositionReport {
  std::array<TextField, 3> position_m{};
  TextField sigma_m;
  TextField roll_deg;
  TextField pitch_deg;
  TextField t_s;
  bool valid = false;
};

bool number_within(const TextField& field, int decimals, std::int64_t limit, std::int64_t& value) {
  return parse_number(field, decimals, value) && value >= -limit && value <= limit;
}

/// Time of validity, and how long ago it was at the transmission. Without both, or with clocks that make
/// no sense, nothing.
void take_times(const VelocityReport& report, base::NavSample& sample) {
  std::int64_t validity_us = 0;
  std::int64_t transmission_us = 0;
  if (!parse_decimal(report.t_validity_us, 0, validity_us) ||
      !parse_decimal(report.t_transmission_us, 0, transmission_us)) {
    return;
  }
  sample.t_device_us = validity_us;
  const std::int64_t delay_us = transmission_us - validity_us;
  if (delay_us >= 0 && delay_us <= kMaxDelay_us) {
    sample.t_us -= delay_us;
  }
}

/// False: a field that the DVL never sends.
bool take_velocity(const VelocityReport& report, base::NavSample& sample) {
  std::array<std::int64_t, 3> velocity_um_s{};
  std::int64_t altitude_um = 0;
  std::int64_t fom_um_s = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    if (!number_within(report.velocity_m_s[i], 6, kMaxSpeed_um_s, velocity_um_s[i])) {
      return false;
    }
  }
  if ((!report.altitude_m.empty() &&
       !number_within(report.altitude_m, 6, base::kMaxRange_um, altitude_um)) ||
      (!report.fom_m_s.empty() && !parse_number(report.fom_m_s, 6, fom_um_s))) {
    return false;
  }
  sample.kind = base::NavKind::kVelocity;
  take_times(report, sample);
  if (!report.valid) {
    return true;
  }
  sample.fields = report.water ? base::kNavVelocityWater : base::kNavVelocityBody;
  for (std::size_t i = 0; i < 3; ++i) {
    sample.velocity_um_s[i] = velocity_um_s[i];
  }
  if (altitude_um > 0) {
    sample.altitude_um = altitude_um;
    sample.fields |= base::kNavAltitude;
  }
  if (fom_um_s > 0 && fom_um_s <= kMaxSpeed_um_s) {
    sample.sigma_velocity_um_s = static_cast<std::uint32_t>(fom_um_s);
  }
  return true;
}

bool take_position(const PositionReport& report, base::NavSample& sample) {
  std::array<std::int64_t, 3> position_um{};
  std::int64_t sigma_mm = 0;
  std::int64_t roll_e9deg = 0;
  std::int64_t pitch_e9deg = 0;
  std::int64_t t_device_us = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    if (!number_within(report.position_m[i], 6, kMaxPosition_um, position_um[i])) {
      return false;
    }
  }
  if (!number_within(report.sigma_m, 3, kE9, sigma_mm) || sigma_mm < 0 ||
      !number_within(report.roll_deg, 9, 360 * kE9, roll_e9deg) ||
      !number_within(report.pitch_deg, 9, 90 * kE9, pitch_e9deg) ||
      !parse_number(report.t_s, 6, t_device_us)) {
    return false;
  }
  sample.kind = base::NavKind::kPosition;
  sample.t_device_us = t_device_us;
  if (!report.valid) {
    return true;
  }
  sample.fields = base::kNavPositionLocal | base::kNavRollPitch;
  for (std::size_t i = 0; i < 3; ++i) {
    sample.position_um[i] = position_um[i];
  }
  sample.sigma_position_mm = static_cast<std::uint32_t>(sigma_mm);
  sample.attitude.roll_bam32 = bam_of_e9deg(roll_e9deg);
  sample.attitude.pitch_bam32 = bam_of_e9deg(pitch_e9deg);
  return true;
}

/// Place of the last '*'; 0: none.
std::size_t star_of(const std::uint8_t* bytes, std::size_t text_bytes) {
  for (std::size_t i = text_bytes; i > 1; --i) {
    if (bytes[i - 1] == '*') {
      return i - 1;
    }
  }
  return 0;
}

Judgement judge_serial(const std::uint8_t* bytes, const TextLine& line, bool require_checksum) {
  const std::size_t star = star_of(bytes, line.text_bytes);
  if (star == 0) {
    return require_checksum ? Judgement{FrameVerdict::kBadChecksum, 0}
                            : Judgement{FrameVerdict::kFrame, line.size_bytes};
  }
  std::uint32_t stated = 0;
  const bool good = line.text_bytes - star == 3 &&
                    parse_hex(as_text(bytes) + star + 1, 2, stated) && stated == crc8(bytes, star);
  return good ? Judgement{FrameVerdict::kFrame, line.size_bytes}
              : Judgement{FrameVerdict::kBadChecksum, 0};
}

/// Structure is all the proof that a report has: a line in which one lost its end begins anew inside.
Judgement judge_json(const std::uint8_t* bytes, const TextLine& line) {
  JsonMembers members(as_text(bytes), line.text_bytes);
  JsonMember member{};
  while (members.next(member)) {
  }
  return members.good() ? Judgement{FrameVerdict::kFrame, line.size_bytes}
                        : Judgement{FrameVerdict::kBadValues, 0};
}

/// ":XX," with two capital letters.
bool is_pd6_start(const std::uint8_t* bytes, std::size_t available) {
  for (std::size_t i = 1; i < 4 && i < available; ++i) {
    const bool letter = bytes[i] >= 'A' && bytes[i] <= 'Z';
    if (i == 3 ? bytes[i] != ',' : !letter) {
      return false;
    }
  }
  return true;
}

Judgement judge_pd4(const std::uint8_t* bytes, std::size_t available) {
  if (available >= 2 && bytes[1] != 0) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (available < 4) {
    return {FrameVerdict::kMore, 0};
  }
  // The makers' number of bytes: with the checksum or, as elsewhere, without.
  const std::size_t stated = read_u16_le(bytes + 2);
  if (stated != WlDvlCodec::kPd4_bytes && stated != WlDvlCodec::kPd4_bytes - 2) {
    return {FrameVerdict::kBadLength, 0};
  }
  if (available < WlDvlCodec::kPd4_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  const std::size_t summed = WlDvlCodec::kPd4_bytes - 2;
  return sum16(bytes, summed) == read_u16_le(bytes + summed)
             ? Judgement{FrameVerdict::kFrame, WlDvlCodec::kPd4_bytes}
             : Judgement{FrameVerdict::kBadChecksum, 0};
}

/// Six columns: spaces, a sign, digits.
bool take_columns(const char* text, std::int64_t& value) {
  const TextField field = trimmed(text, kPd6Columns_bytes);
  return !field.empty() && (field.text[0] == '+' || field.text[0] == '-') &&
         parse_decimal(field, 0, value);
}

bool has_letters(const std::uint8_t* bytes, char first, char second) {
  return bytes[1] == static_cast<std::uint8_t>(first) &&
         bytes[2] == static_cast<std::uint8_t>(second);
}

/// What the keys of one report hold; unknown keys are stepped over.
struct JsonReport {
  TextField type;
  VelocityReport velocity;
  PositionReport position;
  TextField velocity_valid;
  TextField status;
};

void take_member(const JsonMember& member, JsonReport& report) {
  struct Target {
    const char* key;
    TextField* field;
  };
  const std::array<Target, 17> targets{{
      {"type", &report.type},
      {"vx", report.velocity.velocity_m_s.data()},
      {"vy", &report.velocity.velocity_m_s[1]},
      {"vz", &report.velocity.velocity_m_s[2]},
      {"altitude", &report.velocity.altitude_m},
      {"fom", &report.velocity.fom_m_s},
      {"time_of_validity", &report.velocity.t_validity_us},
      {"time_of_transmission", &report.velocity.t_transmission_us},
      {"velocity_valid", &report.velocity_valid},
      {"status", &report.status},
      {"x", report.position.position_m.data()},
      {"y", &report.position.position_m[1]},
      {"z", &report.position.position_m[2]},
      {"std", &report.position.sigma_m},
      {"roll", &report.position.roll_deg},
      {"pitch", &report.position.pitch_deg},
      {"ts", &report.position.t_s},
  }};
  for (const Target& target : targets) {
    if (is(member.key, target.key)) {
      *target.field = member.value;
      return;
    }
  }
}

}  // namespace

bool WlDvlCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample) {
  framer_.feed(byte, t_arrival_us, counters_);
  ++fed_bytes_;
  return next(sample);
}

bool WlDvlCodec::next(base::NavSample& sample) {
  const auto rules = [this](const std::uint8_t* bytes, std::size_t available) {
    return judge(bytes, available);
  };
  const bool made = framer_.take_next(rules, counters_,
                                      [&](const FrameBytes& frame) { return take(frame, sample); });
  counters_.records += made ? 1U : 0U;
  return made;
}

void WlDvlCodec::restart() {
  framer_.reset(counters_);
  new_format_ = false;
}

Judgement WlDvlCodec::judge(const std::uint8_t* bytes, std::size_t available) {
  switch (bytes[0]) {
    case kPd4Start:
      return judge_pd4(bytes, available);
    case 'w':
      return available >= 2 && bytes[1] != 'r' ? Judgement{FrameVerdict::kNoStart, 0}
                                               : judge_line(bytes, available);
    case ':':
      return is_pd6_start(bytes, available) ? judge_line(bytes, available)
                                            : Judgement{FrameVerdict::kNoStart, 0};
    case '{':
      return available >= 2 && bytes[1] != '"' && bytes[1] != ' '
                 ? Judgement{FrameVerdict::kNoStart, 0}
                 : judge_line(bytes, available);
    default:
      return {FrameVerdict::kNoStart, 0};
  }
}

Judgement WlDvlCodec::judge_line(const std::uint8_t* bytes, std::size_t available) {
  // Where the line starts in the stream: its bytes up to there need not be looked at again.
  const std::uint32_t start = fed_bytes_ - static_cast<std::uint32_t>(framer_.buffered_bytes());
  const bool known = seen_.start == start && seen_.bytes >= 1 && seen_.bytes <= available;
  const bool json = bytes[0] == '{';
  const std::uint8_t no_second = json ? std::uint8_t{0} : bytes[0];
  const std::size_t limit = json ? kMaxReport_bytes - 2 : kMaxLine_bytes;
  const TextLine line = find_line(bytes, available, bytes[0] == 'w' ? std::uint8_t{0} : no_second,
                                  limit, known ? seen_.bytes : 1);
  if (line.state == LineState::kMore) {
    // The last byte may be a CR that waits for its LF.
    seen_ = {start, available > 1 ? available - 1 : 1};
    return {FrameVerdict::kMore, 0};
  }
  if (line.state == LineState::kBroken) {
    return {FrameVerdict::kBadLength, 0};
  }
  if (json) {
    return judge_json(bytes, line);
  }
  return bytes[0] == 'w' ? judge_serial(bytes, line, config_.require_checksum)
                         : Judgement{FrameVerdict::kFrame, line.size_bytes};
}

bool WlDvlCodec::take(const FrameBytes& frame, base::NavSample& sample) {
  base::NavSample taken{};
  taken.t_us = sent_us(frame, config_.byte_time_ns);
  taken.quality = 255;
  bool delivered = false;
  switch (frame.data[0]) {
    case kPd4Start:
      delivered = take_pd4(frame, taken);
      break;
    case 'w':
      delivered = take_serial(frame, taken);
      break;
    case ':':
      delivered = take_pd6(frame, taken);
      break;
    default:
      delivered = take_json(frame, taken);
      break;
  }
  if (delivered) {
    sample = taken;
  }
  return delivered;
}

bool WlDvlCodec::settled(bool good, const base::NavSample& sample) {
  if (!good) {
    ++counters_.bad_values;
    return false;
  }
  counters_.no_data += sample.fields == 0 ? 1U : 0U;
  return true;
}

bool WlDvlCodec::take_serial(const FrameBytes& frame, base::NavSample& sample) {
  const TextLine whole = find_line(frame.data, frame.size_bytes, 0, frame.size_bytes);
  const std::size_t star = star_of(frame.data, whole.text_bytes);
  const Fields line = split<kMaxFields>(as_text(frame.data), star == 0 ? whole.text_bytes : star);
  const TextField name = line.at(0);
  if (is(name, "wrn") || is(name, "wr?") || is(name, "wr!")) {
    ++counters_.nacks;
    return false;
  }
  const bool velocity = is(name, "wrz") || is(name, "wrs");
  if (velocity && (line.count == 12 || line.count == 11)) {
    new_format_ = true;
    return take_velocity_line(line, sample);
  }
  if (is(name, "wrx")) {
    return take_old_velocity(line, sample);
  }
  const std::size_t beam_fields = is(name, "wru") ? 6 : (is(name, "wrt") ? 5 : 0);
  if (config_.every_report && beam_fields != 0) {
    counters_.bad_values += line.count == beam_fields ? 0U : 1U;
    return line.count == beam_fields;
  }
  if (!is(name, "wrp")) {
    ++counters_.ignored;
    return false;
  }
  PositionReport report;
  report.t_s = line.at(1);
  report.position_m = {line.at(2), line.at(3), line.at(4)};
  report.sigma_m = line.at(5);
  report.roll_deg = line.at(6);
  report.pitch_deg = line.at(7);
  report.valid = is(line.at(9), "0");
  return settled(line.count == 10 && take_position(report, sample), sample);
}

bool WlDvlCodec::take_velocity_line(const Fields& line, base::NavSample& sample) {
  VelocityReport report;
  report.water = line.count == 11;
  const std::size_t behind_altitude = report.water ? 5 : 6;
  report.velocity_m_s = {line.at(1), line.at(2), line.at(3)};
  report.altitude_m = report.water ? TextField{} : line.at(5);
  report.fom_m_s = line.at(behind_altitude);
  report.t_validity_us = line.at(behind_altitude + 2);
  report.t_transmission_us = line.at(behind_altitude + 3);
  report.valid = is(line.at(4), "y");
  return settled((report.valid || is(line.at(4), "n")) && take_velocity(report, sample), sample);
}

// wrx,time,vx,vy,vz,fom,altitude,valid,status
bool WlDvlCodec::take_old_velocity(const Fields& line, base::NavSample& sample) {
  if (new_format_ && config_.drop_repeats) {
    ++counters_.repeats;
    return false;
  }
  VelocityReport report;
  report.velocity_m_s = {line.at(2), line.at(3), line.at(4)};
  report.fom_m_s = line.at(5);
  report.altitude_m = line.at(6);
  report.valid = is(line.at(7), "y");
  const bool good = line.count == 9 && (report.valid || is(line.at(7), "n"));
  return settled(good && take_velocity(report, sample), sample);
}

bool WlDvlCodec::take_pd6(const FrameBytes& frame, base::NavSample& sample) {
  const TextLine line = find_line(frame.data, frame.size_bytes, 0, frame.size_bytes);
  const char* text = as_text(frame.data);
  if (has_letters(frame.data, 'B', 'I')) {
    std::array<std::int64_t, 4> columns_mm_s{};
    bool good = line.text_bytes == kPd6Velocity_bytes;
    for (std::size_t i = 0; good && i < columns_mm_s.size(); ++i) {
      const std::size_t at = 4 + i * (kPd6Columns_bytes + 1);
      good = take_columns(text + at, columns_mm_s[i]) && text[at + kPd6Columns_bytes] == ',';
    }
    const char status = good ? text[kPd6Velocity_bytes - 1] : '?';
    sample.kind = base::NavKind::kVelocity;
    if (status == 'A') {
      sample.fields = base::kNavVelocityBody;
      for (std::size_t i = 0; i < 3; ++i) {
        sample.velocity_um_s[i] = columns_mm_s[i] * 1000;
      }
    }
    return settled(status == 'A' || status == 'V', sample);
  }
  if (has_letters(frame.data, 'B', 'D')) {
    const auto fields = split<kMaxFields>(text, line.text_bytes);
    std::int64_t altitude_um = 0;
    const bool good = line.text_bytes == kPd6Distance_bytes && fields.count == 6 &&
                      parse_within(fields.at(4), 6, 0, base::kMaxRange_um, altitude_um);
    sample.kind = base::NavKind::kAltitude;
    if (good && altitude_um > 0) {
      sample.altitude_um = altitude_um;
      sample.fields = base::kNavAltitude;
    }
    return settled(good, sample);
  }
  ++counters_.ignored;
  return false;
}

bool WlDvlCodec::take_pd4(const FrameBytes& frame, base::NavSample& sample) {
  constexpr std::int16_t kBad = -32768;
  const std::uint8_t* bytes = frame.data;
  std::array<std::int64_t, 3> velocity_um_s{};
  bool valid = bytes[21] == config_.pd4_good_status;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::int16_t velocity_mm_s = as_i16(read_u16_le(bytes + 5 + 2 * i));
    valid = valid && velocity_mm_s != kBad;
    velocity_um_s[i] = std::int64_t{velocity_mm_s} * 1000;
  }
  if (config_.pd4_ship_axes) {
    velocity_um_s = {velocity_um_s[1], velocity_um_s[0], -velocity_um_s[2]};
  }
  std::int64_t range_sum_cm = 0;
  bool all_ranges = true;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::uint16_t range_cm = read_u16_le(bytes + 13 + 2 * i);
    all_ranges = all_ranges && range_cm > 0;
    range_sum_cm += range_cm;
  }
  sample.kind = base::NavKind::kVelocity;
  if (valid) {
    sample.fields = base::kNavVelocityBody;
    for (std::size_t i = 0; i < 3; ++i) {
      sample.velocity_um_s[i] = velocity_um_s[i];
    }
  }
  if (valid && all_ranges) {
    sample.altitude_um = range_sum_cm * 2'500;
    sample.fields |= base::kNavAltitude;
  }
  return settled(true, sample);
}

bool WlDvlCodec::take_json(const FrameBytes& frame, base::NavSample& sample) {
  const TextLine line = find_line(frame.data, frame.size_bytes, 0, frame.size_bytes);
  JsonMembers members(as_text(frame.data), line.text_bytes);
  JsonReport report;
  JsonMember member{};
  while (members.next(member)) {
    take_member(member, report);
  }
  const bool water = is(report.type, "velocity_water");
  if (water || is(report.type, "velocity")) {
    report.velocity.water = water;
    report.velocity.altitude_m = water ? TextField{} : report.velocity.altitude_m;
    report.velocity.valid = is(report.velocity_valid, "true");
    const bool stated = report.velocity.valid || is(report.velocity_valid, "false");
    return settled(stated && take_velocity(report.velocity, sample), sample);
  }
  if (is(report.type, "position_local")) {
    report.position.valid = is(report.status, "0");
    return settled(take_position(report.position, sample), sample);
  }
  ++counters_.ignored;
  return false;
}

}  // namespace leadline::hal
