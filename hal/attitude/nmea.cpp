#include "hal/attitude/nmea.hpp"

#include "hal/angles.hpp"
#include "hal/text_fields.hpp"

namespace leadline::hal {

namespace {

constexpr std::int64_t kE9 = 1'000'000'000;
constexpr std::size_t kMaxFields = 24;  // the address included; what is behind them is left

using Field = TextField;
using Sentence = TextFields<kMaxFields>;

/// What became of one sentence.
enum class Outcome : std::uint8_t { kRecord, kNoData, kBadField, kIgnored };

bool parse_within(const Field& field, std::int64_t low_e9, std::int64_t high_e9,
                  std::int64_t& value_e9) {
  return hal::parse_within(field, 9, low_e9, high_e9, value_e9);
}

bool parse_heading(const Field& field, std::int64_t& heading_e9deg) {
  return parse_within(field, -180 * kE9, 360 * kE9, heading_e9deg);
}

/// A correction with its side: `value`, 'E' or 'W'; east is positive. Empty is zero.
bool parse_correction(const Field& value, const Field& side, std::int64_t& correction_e9deg) {
  correction_e9deg = 0;
  if (value.empty()) {
    return true;
  }
  if (!parse_within(value, -180 * kE9, 180 * kE9, correction_e9deg)) {
    return false;
  }
  if (is(side, "W")) {
    correction_e9deg = -correction_e9deg;
    return true;
  }
  return is(side, "E");
}

bool unit_is(const Field& field, const char* unit) { return field.empty() || is(field, unit); }

Outcome take_hdg(const Sentence& sentence, const NmeaConfig& config, base::NavSample& sample) {
  if (sentence.at(1).empty()) {
    return Outcome::kNoData;
  }
  std::int64_t heading_e9deg = 0;
  std::int64_t deviation_e9deg = 0;
  std::int64_t variation_e9deg = 0;
  if (!parse_heading(sentence.at(1), heading_e9deg) ||
      !parse_correction(sentence.at(2), sentence.at(3), deviation_e9deg) ||
      !parse_correction(sentence.at(4), sentence.at(5), variation_e9deg)) {
    return Outcome::kBadField;
  }
  heading_e9deg += deviation_e9deg;
  const bool to_true = config.use_variation && !sentence.at(4).empty();
  sample.fields = to_true ? base::kNavHeading : base::kNavHeadingMagnetic;
  sample.attitude.heading_bam32 = bam_of_e9deg(heading_e9deg + (to_true ? variation_e9deg : 0));
  return Outcome::kRecord;
}

Outcome take_heading(const Sentence& sentence, const char* reference, base::NavField field,
                     base::NavSample& sample) {
  if (sentence.at(1).empty()) {
    return Outcome::kNoData;
  }
  std::int64_t heading_e9deg = 0;
  if (!parse_heading(sentence.at(1), heading_e9deg) || !unit_is(sentence.at(2), reference)) {
    return Outcome::kBadField;
  }
  sample.fields = field;
  sample.attitude.heading_bam32 = bam_of_e9deg(heading_e9deg);
  return Outcome::kRecord;
}

/// Both or none: an attitude with half of it missing is none.
bool parse_roll_pitch(const Field& roll, const Field& pitch, base::NavSample& sample) {
  std::int64_t roll_e9deg = 0;
  std::int64_t pitch_e9deg = 0;
  if (!parse_within(roll, -180 * kE9, 180 * kE9, roll_e9deg) ||
      !parse_within(pitch, -90 * kE9, 90 * kE9, pitch_e9deg)) {
    return false;
  }
  sample.fields |= base::kNavRollPitch;
  sample.attitude.roll_bam32 = bam_of_e9deg(roll_e9deg);
  sample.attitude.pitch_bam32 = bam_of_e9deg(pitch_e9deg);
  return true;
}

bool parse_optional_heading(const Field& field, base::NavField kind, base::NavSample& sample) {
  if (field.empty()) {
    return true;
  }
  std::int64_t heading_e9deg = 0;
  if (!parse_heading(field, heading_e9deg)) {
    return false;
  }
  sample.fields |= kind;
  sample.attitude.heading_bam32 = bam_of_e9deg(heading_e9deg);
  return true;
}

/// hhmmss, hhmmss.sss or hhmmsssss (one maker leaves the point out), microseconds of the day.
bool parse_time(const Field& field, std::int64_t& time_us) {
  const bool dotless = field.size == 9 && field.text[6] != '.';
  for (std::size_t i = 0; i < field.size; ++i) {
    const bool digit_place = i != 6 || dotless;
    if (digit_place ? !is_digit(field.text[i]) : field.text[i] != '.') {
      return false;
    }
  }
  if (field.size < 6) {
    return false;
  }
  const auto two = [&field](std::size_t at) {
    return (field.text[at] - '0') * 10 + (field.text[at + 1] - '0');
  };
  const int hour = two(0);
  const int minute = two(2);
  const int second = two(4);
  if (hour > 23 || minute > 59 || second > 60) {
    return false;
  }
  time_us = (hour * 3600LL + minute * 60LL + second) * 1'000'000;
  std::int64_t weight_us = 100'000;
  for (std::size_t i = dotless ? 6 : 7; i < field.size; ++i) {
    time_us += (field.text[i] - '0') * weight_us;
    weight_us /= 10;
  }
  return true;
}

/// Informative: what is no time of day is left out and spoils nothing.
void take_time(const Field& field, base::NavSample& sample) {
  if (parse_time(field, sample.utc_us)) {
    sample.fields |= base::kNavUtc;
  } else {
    sample.utc_us = 0;
  }
}

bool parse_digits(const Field& field, std::size_t at, std::size_t count, std::int64_t& value) {
  value = 0;
  for (std::size_t i = at; i < at + count; ++i) {
    if (i >= field.size || !is_digit(field.text[i])) {
      return false;
    }
    value = value * 10 + (field.text[i] - '0');
  }
  return true;
}

/// Days from 1970 to a date of the Gregorian calendar; false: there is no such day.
bool days_of(std::int64_t year, std::int64_t month, std::int64_t day, std::int64_t& days) {
  constexpr std::array<std::int64_t, 12> kBefore{0,   31,  59,  90,  120, 151,
                                                 181, 212, 243, 273, 304, 334};
  constexpr std::array<std::int64_t, 12> kLength{31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  if (year < 1980 || year > 2099 || month < 1 || month > 12) {
    return false;
  }
  const bool leap = year % 4 == 0;  // 2000 was one as well
  const auto index = static_cast<std::size_t>(month - 1);
  if (day < 1 || day > kLength[index] + (leap && month == 2 ? 1 : 0)) {
    return false;
  }
  days = (year - 1970) * 365 + (year - 1969) / 4 + kBefore[index] + (leap && month > 2 ? 1 : 0) +
         day - 1;
  return true;
}

constexpr std::int64_t kDay_us = 86'400'000'000;

bool take_sigma(const Field& field, std::uint32_t& sigma_urad) {
  if (field.empty()) {
    return true;
  }
  std::int64_t sigma_e9deg = 0;
  if (!parse_within(field, 0, 180 * kE9, sigma_e9deg)) {
    return false;
  }
  sigma_urad = static_cast<std::uint32_t>(urad_of_e9deg(sigma_e9deg));
  return true;
}

Outcome take_pashr(const Sentence& sentence, base::NavSample& sample) {
  if (!is(sentence.at(3), "T")) {
    return Outcome::kIgnored;  // PASHR,ATT  PASHR,POS  PASHR,ACK ...
  }
  if (sentence.at(2).empty() && sentence.at(4).empty() && sentence.at(5).empty()) {
    return Outcome::kNoData;
  }
  const bool levelled = !sentence.at(4).empty() || !sentence.at(5).empty();
  if ((levelled && !parse_roll_pitch(sentence.at(4), sentence.at(5), sample)) ||
      !parse_optional_heading(sentence.at(2), base::kNavHeading, sample) ||
      !take_sigma(sentence.at(7), sample.sigma_attitude_urad[0]) ||
      !take_sigma(sentence.at(8), sample.sigma_attitude_urad[1]) ||
      !take_sigma(sentence.at(9), sample.sigma_attitude_urad[2])) {
    return Outcome::kBadField;
  }
  take_time(sentence.at(1), sample);
  return Outcome::kRecord;
}

Outcome take_prdid(const Sentence& sentence, const NmeaConfig& config, base::NavSample& sample) {
  if (sentence.at(1).empty() && sentence.at(2).empty() && sentence.at(3).empty()) {
    return Outcome::kNoData;
  }
  const base::NavField north = config.prdid_true ? base::kNavHeading : base::kNavHeadingMagnetic;
  const bool good = parse_roll_pitch(sentence.at(2), sentence.at(1), sample) &&
                    parse_optional_heading(sentence.at(3), north, sample);
  return good ? Outcome::kRecord : Outcome::kBadField;
}

/// `value` in units of `unit_nm` (nanometres: feet and fathoms are whole numbers of them).
bool take_altitude(const Field& value, std::int64_t unit_nm, base::NavSample& sample) {
  std::int64_t value_e9 = 0;
  if (value.empty()) {
    return true;
  }
  // Limited first: 20 km of the smallest unit times 2e9 nm still fits.
  if (!parse_within(value, 0, 70'000 * kE9, value_e9)) {
    return false;
  }
  // value_e9 / 1e9 * unit_nm / 1e3, whole and broken part apart
  const std::int64_t whole_nm = value_e9 / kE9 * unit_nm;
  const std::int64_t broken_nm = (value_e9 % kE9 * (unit_nm / 1000) + kE9 / 2000) / (kE9 / 1000);
  const std::int64_t altitude_um = (whole_nm + broken_nm + 500) / 1000;
  if (altitude_um > base::kMaxRange_um) {
    return false;
  }
  if (altitude_um > 0) {
    sample.altitude_um = altitude_um;
    sample.fields |= base::kNavAltitude;
  }
  return true;
}

constexpr std::int64_t kMetre_nm = 1'000'000'000;
constexpr std::int64_t kFoot_nm = 304'800'000;
constexpr std::int64_t kFathom_nm = 1'828'800'000;

Outcome take_dbt(const Sentence& sentence, base::NavSample& sample) {
  struct Unit {
    std::size_t field;
    const char* name;
    std::int64_t length_nm;
  };
  constexpr std::array<Unit, 3> kUnits{
      {{3, "M", kMetre_nm}, {1, "f", kFoot_nm}, {5, "F", kFathom_nm}}};
  for (const Unit& unit : kUnits) {
    if (sentence.at(unit.field).empty()) {
      continue;
    }
    const bool good = unit_is(sentence.at(unit.field + 1), unit.name) &&
                      take_altitude(sentence.at(unit.field), unit.length_nm, sample);
    return good ? Outcome::kRecord : Outcome::kBadField;
  }
  return Outcome::kNoData;
}

Outcome take_dpt(const Sentence& sentence, base::NavSample& sample) {
  return take_altitude(sentence.at(1), kMetre_nm, sample) ? Outcome::kRecord : Outcome::kBadField;
}

bool take_pressure(const Field& value, const NmeaConfig& config, base::NavSample& sample) {
  std::int64_t pressure_e9dbar = 0;
  if (!parse_within(value, -100 * kE9, 20'000 * kE9, pressure_e9dbar)) {
    return false;
  }
  const std::int64_t half = pressure_e9dbar < 0 ? -50'000 : 50'000;
  std::int64_t pressure_pa = (pressure_e9dbar + half) / 100'000;
  pressure_pa += config.gauge_pressure ? config.gauge_reference_pa : 0;
  if (pressure_pa > 0) {
    sample.pressure_pa = pressure_pa;
    sample.fields |= base::kNavPressure;
  }
  return true;
}

bool take_depth(const Field& value, base::NavSample& sample) {
  std::int64_t depth_e9m = 0;
  if (!parse_within(value, -20'000 * kE9, 20'000 * kE9, depth_e9m)) {
    return false;
  }
  sample.depth_um = (depth_e9m + (depth_e9m < 0 ? -500 : 500)) / 1000;
  sample.fields |= base::kNavDepth;
  return true;
}

Outcome take_prvat(const Sentence& sentence, const NmeaConfig& config, base::NavSample& sample) {
  if (!unit_is(sentence.at(2), "M") || !take_altitude(sentence.at(1), kMetre_nm, sample)) {
    return Outcome::kBadField;
  }
  const Field value = sentence.at(3);
  const Field unit = sentence.at(4);
  if (value.empty()) {
    return Outcome::kRecord;
  }
  if (is(unit, "dBar")) {
    return take_pressure(value, config, sample) ? Outcome::kRecord : Outcome::kBadField;
  }
  if (is(unit, "Metres")) {
    return take_depth(value, sample) ? Outcome::kRecord : Outcome::kBadField;
  }
  return Outcome::kBadField;
}

/// d..dmm.mmm and its hemisphere.
bool parse_coordinate(const Field& value, const Field& side, const char* positive,
                      const char* negative, std::int64_t limit_deg, std::int64_t& out_e9deg) {
  std::int64_t packed_e9 = 0;
  if (!parse_within(value, 0, 20'000 * kE9, packed_e9)) {
    return false;
  }
  const std::int64_t minutes_e9 = packed_e9 % (100 * kE9);
  const std::int64_t whole_deg = packed_e9 / (100 * kE9);
  const std::int64_t magnitude_e9deg = whole_deg * kE9 + (minutes_e9 + 30) / 60;
  if (minutes_e9 >= 60 * kE9 || magnitude_e9deg > limit_deg * kE9) {
    return false;
  }
  const bool south_or_west = is(side, negative);
  out_e9deg = south_or_west ? -magnitude_e9deg : magnitude_e9deg;
  return south_or_west || is(side, positive);
}

/// 0: no fix that anybody should use.
std::uint8_t fix_quality(const Field& field) {
  constexpr std::array<std::uint8_t, 7> kQuality{0, 160, 192, 192, 255, 224, 64};
  if (field.size != 1 || field.text[0] < '0' || field.text[0] > '6') {
    return 0;  // empty, 7 typed in by hand, 8 simulated
  }
  return kQuality[static_cast<std::size_t>(field.text[0] - '0')];
}

Outcome take_gga(const Sentence& sentence, base::NavSample& sample) {
  sample.quality = fix_quality(sentence.at(6));
  if (sample.quality == 0) {
    return Outcome::kNoData;
  }
  if (!parse_coordinate(sentence.at(2), sentence.at(3), "N", "S", 90, sample.latitude_e9deg) ||
      !parse_coordinate(sentence.at(4), sentence.at(5), "E", "W", 180, sample.longitude_e9deg)) {
    return Outcome::kBadField;
  }
  sample.fields = base::kNavGeodetic;
  take_time(sentence.at(1), sample);
  return Outcome::kRecord;
}

/// `value` in units of `unit_nm_s` (nanometres a second).
bool parse_speed(const Field& value, std::int64_t unit_nm_s, std::int64_t& speed_um_s) {
  std::int64_t value_e9 = 0;
  if (!parse_within(value, -1000 * kE9, 1000 * kE9, value_e9)) {
    return false;
  }
  speed_um_s = divide_rounded(divide_rounded(value_e9, 1000) * unit_nm_s, kE9);
  return true;
}

constexpr std::int64_t kKnot_nm_s = 514'444'444;
constexpr std::int64_t kKilometreAnHour_nm_s = 277'777'778;

/// Speed in knots, or where that is missing in km/h, each in front of its unit.
bool take_speed(const Sentence& sentence, std::size_t knots_at, std::int64_t& speed_um_s) {
  const Field knots = sentence.at(knots_at);
  if (!knots.empty()) {
    return unit_is(sentence.at(knots_at + 1), "N") && parse_speed(knots, kKnot_nm_s, speed_um_s);
  }
  return unit_is(sentence.at(knots_at + 3), "K") &&
         parse_speed(sentence.at(knots_at + 2), kKilometreAnHour_nm_s, speed_um_s);
}

Outcome take_vhw(const Sentence& sentence, base::NavSample& sample) {
  if (sentence.at(5).empty() && sentence.at(7).empty()) {
    return Outcome::kNoData;
  }
  if (!take_speed(sentence, 5, sample.velocity_um_s[0])) {
    return Outcome::kBadField;
  }
  sample.fields = base::kNavVelocityWater;
  return Outcome::kRecord;
}

void set_course(std::int64_t course_e9deg, std::int64_t speed_um_s, base::NavSample& sample) {
  const base::Bam32 course_bam32 = bam_of_e9deg(course_e9deg);
  sample.velocity_um_s[base::kNorth] = base::mul_shift(speed_um_s, base::cos_q30(course_bam32), 30);
  sample.velocity_um_s[base::kEast] = base::mul_shift(speed_um_s, base::sin_q30(course_bam32), 30);
  sample.fields |= base::kNavVelocityWorld;
}

Outcome take_vtg(const Sentence& sentence, base::NavSample& sample) {
  const bool no_speed = sentence.at(5).empty() && sentence.at(7).empty();
  if (sentence.at(1).empty() || no_speed || is(sentence.at(9), "N")) {
    return Outcome::kNoData;
  }
  std::int64_t course_e9deg = 0;
  std::int64_t speed_um_s = 0;
  if (!parse_heading(sentence.at(1), course_e9deg) || !unit_is(sentence.at(2), "T") ||
      !take_speed(sentence, 5, speed_um_s)) {
    return Outcome::kBadField;
  }
  set_course(course_e9deg, speed_um_s, sample);
  return Outcome::kRecord;
}

Outcome take_zda(const Sentence& sentence, base::NavSample& sample) {
  if (sentence.at(1).empty() || sentence.at(4).empty()) {
    return Outcome::kNoData;
  }
  std::int64_t time_us = 0;
  std::int64_t day = 0;
  std::int64_t month = 0;
  std::int64_t year = 0;
  std::int64_t days = 0;
  const bool good = parse_time(sentence.at(1), time_us) &&
                    parse_digits(sentence.at(2), 0, sentence.at(2).size, day) &&
                    parse_digits(sentence.at(3), 0, sentence.at(3).size, month) &&
                    sentence.at(4).size == 4 && parse_digits(sentence.at(4), 0, 4, year);
  if (!good || sentence.at(2).size > 2 || sentence.at(3).size > 2 ||
      !days_of(year, month, day, days)) {
    return Outcome::kBadField;
  }
  sample.utc_us = days * kDay_us + time_us;
  sample.fields = base::kNavUtc;
  return Outcome::kRecord;
}

/// Two digits of the year: 80 to 99 are of the last century.
bool parse_date(const Field& date, std::int64_t& days) {
  std::int64_t day = 0;
  std::int64_t month = 0;
  std::int64_t year = 0;
  return date.size == 6 && parse_digits(date, 0, 2, day) && parse_digits(date, 2, 2, month) &&
         parse_digits(date, 4, 2, year) &&
         days_of(year + (year < 80 ? 2000 : 1900), month, day, days);
}

Outcome take_rmc(const Sentence& sentence, bool with_place, base::NavSample& sample) {
  constexpr std::uint8_t kPlainFix = 160;
  if (!is(sentence.at(2), "A") || is(sentence.at(12), "N")) {
    return Outcome::kNoData;
  }
  std::int64_t time_us = 0;
  std::int64_t days = 0;
  if (!parse_time(sentence.at(1), time_us) || !parse_date(sentence.at(9), days)) {
    return Outcome::kBadField;
  }
  sample.utc_us = days * kDay_us + time_us;
  sample.fields = base::kNavUtc;
  sample.quality = kPlainFix;
  if (!sentence.at(7).empty() && !sentence.at(8).empty()) {
    std::int64_t course_e9deg = 0;
    std::int64_t speed_um_s = 0;
    if (!parse_speed(sentence.at(7), kKnot_nm_s, speed_um_s) ||
        !parse_heading(sentence.at(8), course_e9deg)) {
      return Outcome::kBadField;
    }
    set_course(course_e9deg, speed_um_s, sample);
  }
  if (with_place) {
    if (!parse_coordinate(sentence.at(3), sentence.at(4), "N", "S", 90, sample.latitude_e9deg) ||
        !parse_coordinate(sentence.at(5), sentence.at(6), "E", "W", 180, sample.longitude_e9deg)) {
      return Outcome::kBadField;
    }
    sample.fields |= base::kNavGeodetic;
  }
  return Outcome::kRecord;
}

Outcome take_rot(const Sentence& sentence, base::NavSample& sample) {
  constexpr std::int64_t kMost_deg_min = 36'000;  // ten turns a second
  if (sentence.at(1).empty() || !is(sentence.at(2), "A")) {
    return Outcome::kNoData;
  }
  std::int64_t rate_e9deg_min = 0;
  if (!parse_within(sentence.at(1), -kMost_deg_min * kE9, kMost_deg_min * kE9, rate_e9deg_min)) {
    return Outcome::kBadField;
  }
  sample.rate_urad_s[2] = urad_of_e9deg(divide_rounded(rate_e9deg_min, 60));
  sample.fields = base::kNavYawRate;
  return Outcome::kRecord;
}

Outcome take_phtro(const Sentence& sentence, base::NavSample& sample) {
  if (sentence.at(1).empty() && sentence.at(3).empty()) {
    return Outcome::kNoData;
  }
  const bool bow_down = is(sentence.at(2), "P");
  const bool port_down = is(sentence.at(4), "B");
  std::int64_t pitch_e9deg = 0;
  std::int64_t roll_e9deg = 0;
  if ((!bow_down && !is(sentence.at(2), "M")) || (!port_down && !is(sentence.at(4), "T")) ||
      !parse_within(sentence.at(1), 0, 90 * kE9, pitch_e9deg) ||
      !parse_within(sentence.at(3), 0, 180 * kE9, roll_e9deg)) {
    return Outcome::kBadField;
  }
  sample.attitude.pitch_bam32 = bam_of_e9deg(bow_down ? -pitch_e9deg : pitch_e9deg);
  sample.attitude.roll_bam32 = bam_of_e9deg(port_down ? -roll_e9deg : roll_e9deg);
  sample.fields = base::kNavRollPitch;
  return Outcome::kRecord;
}

Outcome take_gll(const Sentence& sentence, base::NavSample& sample) {
  constexpr std::uint8_t kPlainFix = 160;
  const bool no_fix = is(sentence.at(6), "V") || is(sentence.at(7), "N");
  if (no_fix || (sentence.at(1).empty() && sentence.at(3).empty())) {
    return Outcome::kNoData;
  }
  if (!parse_coordinate(sentence.at(1), sentence.at(2), "N", "S", 90, sample.latitude_e9deg) ||
      !parse_coordinate(sentence.at(3), sentence.at(4), "E", "W", 180, sample.longitude_e9deg)) {
    return Outcome::kBadField;
  }
  sample.quality = kPlainFix;
  sample.fields = base::kNavGeodetic;
  take_time(sentence.at(5), sample);
  return Outcome::kRecord;
}

enum class Kind : std::uint8_t {
  kOther,
  kHdg,
  kHdm,
  kHdt,
  kDbt,
  kDpt,
  kGga,
  kGll,
  kVtg,
  kVhw,
  kRmc,
  kRot,
  kZda,
  kPashr,
  kPhtro,
  kPrdid,
  kPrvat
};

struct SentenceType {
  const char* name;  ///< behind the talker; whole where there is none
  Kind kind;
  base::NavKind about;
};

constexpr SentenceType kTypes[]{
    {"HDG", Kind::kHdg, base::NavKind::kHeading},
    {"HDM", Kind::kHdm, base::NavKind::kHeading},
    {"HDT", Kind::kHdt, base::NavKind::kHeading},
    {"DBT", Kind::kDbt, base::NavKind::kAltitude},
    {"DPT", Kind::kDpt, base::NavKind::kAltitude},
    {"GGA", Kind::kGga, base::NavKind::kPosition},
    {"GLL", Kind::kGll, base::NavKind::kPosition},
    {"VTG", Kind::kVtg, base::NavKind::kVelocity},
    {"VHW", Kind::kVhw, base::NavKind::kVelocity},
    {"RMC", Kind::kRmc, base::NavKind::kPosition},
    {"ROT", Kind::kRot, base::NavKind::kRates},
    {"ZDA", Kind::kZda, base::NavKind::kTime},
    {"PASHR", Kind::kPashr, base::NavKind::kAttitude},
    {"PHTRO", Kind::kPhtro, base::NavKind::kAttitude},
    {"PRDID", Kind::kPrdid, base::NavKind::kAttitude},
    {"PRVAT", Kind::kPrvat, base::NavKind::kAltitude},
};
constexpr SentenceType kOtherType{"", Kind::kOther, base::NavKind::kOther};

SentenceType type_of(const Field& address) {
  if (address.size != 5) {
    return kOtherType;
  }
  const bool proprietary = upper(address.text[0]) == 'P';
  const Field name = proprietary ? address : Field{address.text + 2, 3};
  for (const SentenceType& type : kTypes) {
    if (is(name, type.name)) {
      return type;
    }
  }
  return kOtherType;
}

/// `saw_gga`: positions come with a quality from there.
Outcome take_sentence(Kind kind, const Sentence& sentence, const NmeaConfig& config, bool saw_gga,
                      base::NavSample& sample) {
  switch (kind) {
    case Kind::kHdg:
      return take_hdg(sentence, config, sample);
    case Kind::kHdm:
      return take_heading(sentence, "M", base::kNavHeadingMagnetic, sample);
    case Kind::kHdt:
      return take_heading(sentence, "T", base::kNavHeading, sample);
    case Kind::kDbt:
      return take_dbt(sentence, sample);
    case Kind::kDpt:
      return take_dpt(sentence, sample);
    case Kind::kGga:
      return take_gga(sentence, sample);
    case Kind::kGll:
      return saw_gga ? Outcome::kIgnored : take_gll(sentence, sample);
    case Kind::kRmc:
      return take_rmc(sentence, !saw_gga, sample);
    case Kind::kRot:
      return take_rot(sentence, sample);
    case Kind::kZda:
      return take_zda(sentence, sample);
    case Kind::kPhtro:
      return take_phtro(sentence, sample);
    case Kind::kVtg:
      return take_vtg(sentence, sample);
    case Kind::kVhw:
      return take_vhw(sentence, sample);
    case Kind::kPashr:
      return take_pashr(sentence, sample);
    case Kind::kPrdid:
      return take_prdid(sentence, config, sample);
    case Kind::kPrvat:
      return take_prvat(sentence, config, sample);
    case Kind::kOther:
      break;
  }
  return Outcome::kIgnored;
}

}  // namespace

bool NmeaCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample) {
  const char c = static_cast<char>(byte);
  if (c == '$' || c == '!') {
    // The end of the sentence before was lost; with its checksum it is whole all the same.
    bool delivered = false;
    if (inside_ && size_ > 3 && text_[size_ - 3] == '*') {
      delivered = finish(sample);
    } else if (inside_) {
      ++counters_.unfinished;
    }
    inside_ = c == '$';
    size_ = 0;
    t_last_us_ = t_arrival_us;
    return delivered;
  }
  if (!inside_) {
    return false;
  }
  if (c == '\r' || c == '\n') {
    inside_ = false;
    return finish(sample);
  }
  if (byte < 0x20 || byte > 0x7E) {
    ++counters_.bad_byte;
    inside_ = false;
    return false;
  }
  if (size_ == text_.size()) {
    ++counters_.too_long;
    inside_ = false;
    return false;
  }
  text_[size_] = c;
  ++size_;
  t_last_us_ = t_arrival_us;
  return false;
}

void NmeaCodec::restart() {
  counters_.unfinished += inside_ ? 1U : 0U;
  inside_ = false;
}

FrameView NmeaCodec::frame() const {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): the bytes that the text came as
  return {reinterpret_cast<const std::uint8_t*>(text_.data()), record_bytes_};
}

bool NmeaCodec::finish(base::NavSample& sample) {
  std::size_t body = 0;
  std::uint32_t sum = 0;
  while (body < size_ && text_[body] != '*') {
    sum ^= static_cast<std::uint8_t>(text_[body]);
    ++body;
  }
  if (body == size_) {
    if (config_.require_checksum) {
      ++counters_.no_checksum;
      return false;
    }
  } else {
    const bool two = size_ - body == 3;
    const int high = two ? hex_digit(text_[body + 1]) : -1;
    const int low = two ? hex_digit(text_[body + 2]) : -1;
    if (high < 0 || low < 0 || static_cast<std::uint32_t>(high * 16 + low) != sum) {
      ++counters_.bad_checksum;
      return false;
    }
  }
  const Sentence sentence = split<kMaxFields>(text_.data(), body);
  const SentenceType type = type_of(sentence.at(0));
  base::NavSample taken{};
  taken.quality = 255;
  taken.kind = type.about;
  const std::int64_t sent_ns = (static_cast<std::int64_t>(size_) + 1) * config_.byte_time_ns;
  taken.t_us = t_last_us_ - sent_ns / 1000;
  saw_gga_ = saw_gga_ || type.kind == Kind::kGga;
  switch (take_sentence(type.kind, sentence, config_, saw_gga_, taken)) {
    case Outcome::kBadField:
      ++counters_.bad_field;
      return false;
    case Outcome::kIgnored:
      ++counters_.ignored;
      return false;
    case Outcome::kNoData:
    case Outcome::kRecord:
      break;
  }
  counters_.no_data += taken.fields == 0 ? 1U : 0U;
  counters_.records += taken.fields == 0 ? 0U : 1U;
  sample = taken;
  record_bytes_ = size_;
  return true;
}

}  // namespace leadline::hal
