#include "host_tools/decode/frame_values.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "hal/attitude/nmea2000.hpp"
#include "hal/can_frame.hpp"
#include "hal/heads/ping_protocol.hpp"
#include "hal/text_fields.hpp"
#include "hal/wire.hpp"

namespace leadline::host {
namespace {

using firmware::Driver;
using hal::FrameView;
using hal::TextField;
using nlohmann::ordered_json;

constexpr std::size_t kMaxFields = 24;
using Fields = hal::TextFields<kMaxFields>;

std::string text_of(const TextField& field) { return {field.text, field.size}; }

/// Null where the text is no number.
ordered_json number(TextField field) {
  if (!field.empty() && field.text[0] == '+') {
    field = {field.text + 1, field.size - 1};
  }
  double value = 0;
  const char* const end = field.text + field.size;
  const auto [stop, error] = std::from_chars(field.text, end, value);
  const bool good = !field.empty() && error == std::errc() && stop == end && std::isfinite(value);
  return good ? ordered_json(value) : ordered_json(nullptr);
}

ordered_json whole_number(const TextField& field) {
  std::int64_t value = 0;
  return hal::parse_decimal(field, 0, value) ? ordered_json(value) : ordered_json(nullptr);
}

/// Fields between commas, from the start of the text to its '*' or end.
Fields fields_of(const FrameView& frame, std::size_t skipped_bytes) {
  const char* const text = hal::as_text(frame.data) + skipped_bytes;
  std::size_t size = 0;
  while (skipped_bytes + size < frame.size_bytes && text[size] != '*' && text[size] != '\r' &&
         text[size] != '\n') {
    ++size;
  }
  return hal::split<kMaxFields>(text, size);
}

// --- NMEA 0183 ---

ordered_json east(const TextField& value, const TextField& side) {
  const ordered_json degrees = number(value);
  return degrees.is_null() || !hal::is(side, "W") ? degrees : ordered_json(-degrees.get<double>());
}

void add_nmea(const FrameView& frame, ordered_json& record) {
  const Fields line = fields_of(frame, 0);
  const TextField address = line.at(0);
  const TextField type = address.size == 5 ? TextField{address.text + 2, 3} : TextField{};
  record["sentence"] = text_of(address);
  if (hal::is(type, "HDG")) {
    record["deviation_deg"] = east(line.at(2), line.at(3));
    record["variation_deg"] = east(line.at(4), line.at(5));
  } else if (hal::is(type, "DPT")) {
    record["transducer_offset_m"] = number(line.at(2));
    record["max_range_m"] = number(line.at(3));
  } else if (hal::is(address, "PASHR")) {
    record["heave_m"] = number(line.at(6));
    record["gps_quality"] = whole_number(line.at(10));
    record["ins_status"] = whole_number(line.at(11));
  }
}

// --- NMEA 2000 ---

/// The three largest say that there is none; so does the most negative.
ordered_json scaled_i16(const std::uint8_t* bytes, double per_unit) {
  const std::uint16_t raw = hal::read_u16_le(bytes);
  return raw >= 0x7FFDU && raw <= 0x8000U ? ordered_json(nullptr)
                                          : ordered_json(hal::as_i16(raw) / per_unit);
}

ordered_json small_u8(std::uint8_t raw, int unit) {
  return raw >= 0xFDU ? ordered_json(nullptr) : ordered_json(raw * unit);
}

ordered_json degrees_of_e4rad(const std::uint8_t* bytes) {
  constexpr double kE4radPerDegree = 1e4 / 57.295779513082320877;
  const ordered_json degrees = scaled_i16(bytes, kE4radPerDegree);
  // A unit is 0.006 degrees.
  return degrees.is_null() ? degrees : ordered_json(std::round(degrees.get<double>() * 1e6) / 1e6);
}

void add_nmea2000(const FrameView& bytes, ordered_json& record) {
  hal::CanFrame frame{};
  if (bytes.size_bytes != hal::kCanFrame_bytes || !hal::read_can_frame(bytes.data, frame)) {
    return;
  }
  const std::uint32_t pgn = hal::pgn_of(frame.id);
  record["pgn"] = pgn;
  record["source"] = hal::n2k_source_of(frame.id);
  record["priority"] = (frame.id >> 26U) & 7U;
  const std::uint8_t* const data = frame.data.data();
  // 129025 is nothing but a position; of a fast packet only the last frame is here.
  if (pgn != hal::kPgnPositionRapid && pgn != hal::kPgnGnssPosition) {
    record["sequence_id"] = small_u8(data[0], 1);
  }
  if (pgn == hal::kPgnHeading) {
    record["deviation_deg"] = degrees_of_e4rad(data + 3);
    record["variation_deg"] = degrees_of_e4rad(data + 5);
  }
  if (pgn == hal::kPgnWaterDepth) {
    const bool offset = frame.length_bytes >= 7;
    record["transducer_offset_m"] = offset ? scaled_i16(data + 5, 1e3) : ordered_json(nullptr);
    const bool range = frame.length_bytes >= 8;
    record["max_range_m"] = range ? small_u8(data[7], 10) : ordered_json(nullptr);
  }
}

// --- TSS1 ---

void add_tss1(const FrameView& frame, ordered_json& record) {
  constexpr double kHorizontalUnit_cm_s2 = 3.83;
  constexpr double kHeaveUnit_cm_s2 = 0.0625;
  const char* const text = hal::as_text(frame.data);
  std::uint32_t horizontal = 0;
  std::uint32_t heave = 0;
  if (frame.size_bytes < 19 || !hal::parse_hex(text + 1, 2, horizontal) ||
      !hal::parse_hex(text + 3, 4, heave)) {
    return;
  }
  record["horizontal_acceleration_m_s2"] =
      std::round(horizontal * kHorizontalUnit_cm_s2 * 100) / 1e4;
  record["heave_acceleration_m_s2"] =
      hal::as_i16(static_cast<std::uint16_t>(heave)) * kHeaveUnit_cm_s2 / 100;
  record["status"] = std::string(1, text[13]);
  record["euler_roll_deg"] = record["roll_deg"];
  const double roll_cdeg = number({text + 15, 4}).get<double>();
  record["roll_deg"] = (text[14] == '-' ? -roll_cdeg : roll_cdeg) / 100;
}

// --- VectorNav ---

ordered_json three(const Fields& line, std::size_t first) {
  return {number(line.at(first)), number(line.at(first + 1)), number(line.at(first + 2))};
}

void add_vectornav(const FrameView& frame, ordered_json& record) {
  if (frame.data[0] != '$') {
    return;
  }
  const Fields line = fields_of(frame, 1);
  if (hal::is(line.at(0), "VNYMR")) {
    record["magnetic_field_gauss"] = three(line, 4);
    record["acceleration_m_s2"] = three(line, 7);
    return;
  }
  record["record"] = "register";
  record["valid"] = line.count > 2;
  record["register"] = whole_number(line.at(1));
  record["values"] = ordered_json::array();
  for (std::size_t i = 2; i < line.count; ++i) {
    record["values"].push_back(text_of(line.at(i)));
  }
}

// --- Water Linked DVL ---

/// One entry a beam; a distance of -1 is none.
struct Beam {
  ordered_json number;
  ordered_json velocity_m_s;
  ordered_json distance_m;
  ordered_json rssi_dbm;
  ordered_json nsd_dbm;
};

void add_beam(const Beam& beam, ordered_json& record) {
  const bool heard = beam.distance_m.is_number() && beam.distance_m.get<double>() >= 0;
  record["beam"].push_back(beam.number);
  record["beam_velocity_m_s"].push_back(beam.velocity_m_s);
  record["beam_distance_m"].push_back(heard ? beam.distance_m : ordered_json(nullptr));
  record["beam_rssi_dbm"].push_back(beam.rssi_dbm);
  record["beam_nsd_dbm"].push_back(beam.nsd_dbm);
}

void name_beams(ordered_json& record) {
  record["record"] = "beams";
  bool any = false;
  for (const ordered_json& distance : record["beam_distance_m"]) {
    any = any || !distance.is_null();
  }
  record["valid"] = any;
}

void add_wldvl_line(const Fields& line, ordered_json& record) {
  const TextField name = line.at(0);
  const bool over_ground = hal::is(name, "wrx") || (hal::is(name, "wrz") && line.count == 12);
  if (over_ground && !record.contains("altitude_m")) {
    record["altitude_m"] = nullptr;
  }
  if (hal::is(name, "wru")) {
    add_beam({whole_number(line.at(1)), number(line.at(2)), number(line.at(3)), number(line.at(4)),
              number(line.at(5))},
             record);
    name_beams(record);
  } else if (hal::is(name, "wrt")) {
    for (std::size_t i = 0; i < 4; ++i) {
      add_beam({ordered_json(i), nullptr, number(line.at(1 + i)), nullptr, nullptr}, record);
    }
    name_beams(record);
  } else if (hal::is(name, "wrp")) {
    record["yaw_deg"] = number(line.at(8));
    record["status"] = whole_number(line.at(9));
  } else if (hal::is(name, "wrx")) {
    record["fom_m_s"] = number(line.at(5));
    record["interval_ms"] = number(line.at(1));
    record["status"] = whole_number(line.at(8));
  } else {  // wrz; through the water (11 fields) there is no altitude
    const std::size_t fom = line.count == 12 ? 6 : 5;
    const auto covariance = hal::split<9>(line.at(fom + 1).text, line.at(fom + 1).size, ';');
    record["fom_m_s"] = number(line.at(fom));
    record["covariance_m2_s2"] = ordered_json::array();
    for (std::size_t i = 0; i < covariance.count; ++i) {
      record["covariance_m2_s2"].push_back(number(covariance.at(i)));
    }
    record["time_of_validity_us"] = whole_number(line.at(fom + 2));
    record["time_of_transmission_us"] = whole_number(line.at(fom + 3));
    record["interval_ms"] = number(line.at(fom + 4));
    record["status"] = whole_number(line.at(fom + 5));
  }
}

/// Null where there is none, or none that is a number.
ordered_json number_of(const ordered_json& report, const char* key) {
  const auto found = report.find(key);
  return found != report.end() && found->is_number() ? *found : ordered_json(nullptr);
}

void add_wldvl_report(const FrameView& frame, ordered_json& record) {
  const char* const text = hal::as_text(frame.data);
  const ordered_json report =
      ordered_json::parse(text, text + frame.size_bytes, nullptr, /*allow_exceptions=*/false);
  if (!report.is_object()) {
    return;
  }
  record["status"] = number_of(report, "status");
  if (report.contains("yaw")) {
    record["yaw_deg"] = number_of(report, "yaw");
    return;
  }
  record["fom_m_s"] = number_of(report, "fom");
  record["covariance_m2_s2"] = ordered_json::array();
  for (const ordered_json& row : report.value("covariance", ordered_json::array())) {
    for (const ordered_json& element : row) {
      record["covariance_m2_s2"].push_back(element.is_number() ? element : ordered_json(nullptr));
    }
  }
  record["time_of_validity_us"] = number_of(report, "time_of_validity");
  record["time_of_transmission_us"] = number_of(report, "time_of_transmission");
  record["interval_ms"] = number_of(report, "time");
  for (const ordered_json& beam : report.value("transducers", ordered_json::array())) {
    if (beam.is_object()) {
      add_beam({number_of(beam, "id"), number_of(beam, "velocity"), number_of(beam, "distance"),
                number_of(beam, "rssi"), number_of(beam, "nsd")},
               record);
    }
  }
}

void add_wldvl(const FrameView& frame, ordered_json& record) {
  constexpr std::size_t kPd4Error = 11;
  switch (frame.data[0]) {
    case 'w':
      add_wldvl_line(fields_of(frame, 0), record);
      break;
    case '{':
      add_wldvl_report(frame, record);
      break;
    case ':': {
      const Fields line = fields_of(frame, 1);
      const ordered_json error_mm_s = number(line.at(4));
      if (hal::is(line.at(0), "BI") && error_mm_s.is_number()) {
        record["velocity_error_m_s"] = error_mm_s.get<double>() / 1e3;
      }
      break;
    }
    default: {
      const std::int16_t error_mm_s = hal::as_i16(hal::read_u16_le(frame.data + kPd4Error));
      record["velocity_error_m_s"] =
          error_mm_s == INT16_MIN ? ordered_json(nullptr) : ordered_json(error_mm_s / 1e3);
      break;
    }
  }
}

// --- Ping1D ---

void add_ping1d(const FrameView& frame, ordered_json& record) {
  constexpr std::size_t kSimple_bytes = 5;
  constexpr std::size_t kFixed_bytes = 24;
  if (frame.size_bytes < hal::kPingOverhead_bytes + kSimple_bytes) {
    return;
  }
  const std::uint8_t* const payload = frame.data + hal::kPingHeader_bytes;
  const std::size_t size_bytes = frame.size_bytes - hal::kPingOverhead_bytes;
  record["confidence_percent"] = payload[4];
  if (size_bytes < kFixed_bytes) {
    return;
  }
  const std::uint32_t start_mm = hal::read_u32_le(payload + 12);
  const std::uint32_t length_mm = hal::read_u32_le(payload + 16);
  record["transmit_duration_us"] = hal::read_u16_le(payload + 6);
  record["ping_number"] = hal::read_u32_le(payload + 8);
  record["scan_start_mm"] = start_mm;
  record["scan_length_mm"] = length_mm;
  record["gain_setting"] = hal::read_u32_le(payload + 20);
  const std::size_t count =
      size_bytes >= kFixed_bytes + 2 ? hal::read_u16_le(payload + kFixed_bytes) : 0;
  if (count > 0 && size_bytes >= kFixed_bytes + 2 + count) {
    const std::uint8_t* const samples = payload + kFixed_bytes + 2;
    const double sample_mm = length_mm / static_cast<double>(count);
    record["samples"] = std::vector<int>(samples, samples + count);
    record["first_sample_mm"] = start_mm + sample_mm / 2;
    record["sample_mm"] = sample_mm;
  }
}

}  // namespace

void add_frame_values(Driver driver, const FrameView& frame, ordered_json* record) {
  if (frame.size_bytes == 0) {
    return;
  }
  switch (driver) {
    case Driver::kNmea:
      return add_nmea(frame, *record);
    case Driver::kNmea2000:
      return add_nmea2000(frame, *record);
    case Driver::kTss1:
      return add_tss1(frame, *record);
    case Driver::kVectornav:
      return add_vectornav(frame, *record);
    case Driver::kWldvl:
      return add_wldvl(frame, *record);
    case Driver::kPing1d:
      return add_ping1d(frame, *record);
    default:
      return;
  }
}

}  // namespace leadline::host
