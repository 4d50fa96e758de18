#include "hal/emu/nmea_talker.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace leadline::emu {

namespace {

/// As printf, into a string. The compiler checks the values against the pattern.
[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
  char text[200];
  std::va_list values;
  va_start(values, pattern);
  const int size = std::vsnprintf(text, sizeof text, pattern, values);
  va_end(values);
  return {text, static_cast<std::size_t>(std::clamp(size, 0, static_cast<int>(sizeof text) - 1))};
}

double turn(double deg) {
  const double rest = std::fmod(deg, 360.0);
  return rest < 0 ? rest + 360.0 : rest;
}

std::string time_of_day(double seconds) {
  const auto centi = static_cast<std::int64_t>(std::floor(seconds * 100.0)) % 8'640'000;
  const auto hour = static_cast<int>(centi / 360'000);
  const auto minute = static_cast<int>(centi / 6'000 % 60);
  const auto second = static_cast<int>(centi / 100 % 60);
  return format("%02d%02d%02d.%02d", hour, minute, second, static_cast<int>(centi % 100));
}

/// ddmm.mmmmmmm of a magnitude, minutes to 0.2 mm.
std::string degrees_minutes(double degrees, int digits) {
  const auto minutes_e7 = static_cast<std::int64_t>(std::llround(std::fabs(degrees) * 60e7));
  const auto whole = static_cast<int>(minutes_e7 / 600'000'000);
  const double minutes = static_cast<double>(minutes_e7 % 600'000'000) / 1e7;
  return format("%0*d%010.7f", digits, whole, minutes);
}

std::string pashr(const NmeaTruth& truth) {
  return "PASHR," + time_of_day(truth.time_of_day_s) +
         format(",%.3f,T,%+.3f,%+.3f,+00.00,%.3f,%.3f,%.3f,1,0", turn(truth.heading_deg),
                truth.roll_deg, truth.pitch_deg, truth.sigma_roll_deg, truth.sigma_pitch_deg,
                truth.sigma_heading_deg);
}

std::string gga(const NmeaTruth& truth) {
  std::string body = "GPGGA," + time_of_day(truth.time_of_day_s);
  if (truth.fix_quality == 0) {
    return body + ",,,,,0,00,,,M,,M,,";
  }
  body += "," + degrees_minutes(truth.latitude_deg, 2) + (truth.latitude_deg < 0 ? ",S," : ",N,");
  body += degrees_minutes(truth.longitude_deg, 3) + (truth.longitude_deg < 0 ? ",W," : ",E,");
  return body + format("%d,12,0.8,0.0,M,0.0,M,,", truth.fix_quality);
}

std::string body_of(NmeaKind kind, const NmeaTruth& truth) {
  constexpr double kFoot_m = 0.3048;
  constexpr double kFathom_m = 1.8288;
  switch (kind) {
    case NmeaKind::kHdg:
      return format("HCHDG,%.3f,,,,", turn(truth.magnetic_heading_deg));
    case NmeaKind::kHdm:
      return format("HCHDM,%.3f,M", turn(truth.magnetic_heading_deg));
    case NmeaKind::kHdt:
      return format("HEHDT,%.3f,T", turn(truth.heading_deg));
    case NmeaKind::kPashr:
      return pashr(truth);
    case NmeaKind::kPrdid:
      return format("PRDID,%.3f,%.3f,%.3f", truth.pitch_deg, truth.roll_deg,
                    turn(truth.heading_deg));
    case NmeaKind::kPrvatPressure:
      return format("PRVAT,%06.3f,M,%08.3f,dBar", truth.altitude_m, truth.pressure_pa / 10'000.0);
    case NmeaKind::kPrvatDepth:
      return format("PRVAT,%06.3f,M,%08.3f,Metres", truth.altitude_m, truth.depth_m);
    case NmeaKind::kDbt:
      return format("SDDBT,%.2f,f,%.3f,M,%.2f,F", truth.altitude_m / kFoot_m, truth.altitude_m,
                    truth.altitude_m / kFathom_m);
    case NmeaKind::kDpt:
      return format("SDDPT,%.3f,0.0", truth.altitude_m);
    case NmeaKind::kGga:
      return gga(truth);
  }
  return {};
}

}  // namespace

std::string nmea_frame(const std::string& body) {
  unsigned sum = 0;
  for (const char c : body) {
    sum ^= static_cast<unsigned char>(c);
  }
  return "$" + body + format("*%02X\r\n", sum);
}

std::string nmea_sentence(NmeaKind kind, const NmeaTruth& truth) {
  return nmea_frame(body_of(kind, truth));
}

namespace {

std::vector<TalkerRow> rows_of(const std::vector<NmeaSchedule>& schedule,
                               const NmeaTalker::Measure& measure) {
  std::vector<TalkerRow> rows;
  for (const NmeaSchedule& each : schedule) {
    const auto message = [kind = each.kind, measure](base::TimeUs t_us) {
      const std::string sentence = nmea_sentence(kind, measure(t_us));
      return Bytes(sentence.begin(), sentence.end());
    };
    rows.push_back({message, each.interval_us, each.first_us});
  }
  return rows;
}

}  // namespace

NmeaTalker::NmeaTalker(const NmeaTalkerConfig& config, const Measure& measure)
    : Talker(config, rows_of(config.schedule, measure)) {}

}  // namespace leadline::emu
