#include "host_tools/decode/decoder.hpp"

#include <utility>

#include "host_tools/decode/frame_values.hpp"
#include "host_tools/decode/record_json.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

using firmware::Driver;
using firmware::RecordKind;
using nlohmann::ordered_json;

// Arrival times for bytes that nobody timed: 142 years after 1970, later than any device's clock and farther
// from it than any recording is long, so that a time made of an arrival is told from a device's own.
constexpr base::TimeUs kNobodysTime_us = base::TimeUs{1} << 52U;
constexpr base::TimeUs kByteStep_us = 1;
constexpr base::TimeUs kOneHour_us = 3'600'000'000;

ordered_json rejected_json(const hal::CodecCounters& counters) {
  ordered_json rejected = ordered_json::object();
  const std::pair<const char*, std::uint32_t> reasons[] = {
      {"bad_checksum", counters.bad_checksum}, {"bad_length", counters.bad_length},
      {"bad_values", counters.bad_values},     {"unknown_id", counters.unknown_id},
      {"wrong_device", counters.wrong_device}, {"unfinished", counters.unfinished}};
  for (const auto& [reason, count] : reasons) {
    if (count > 0) {
      rejected[reason] = count;
    }
  }
  return rejected;
}

}  // namespace

Decoder::Decoder(Driver driver, Out out)
    : driver_(driver),
      out_(std::move(out)),
      port_(std::make_unique<firmware::DevicePort>()),
      arrival_us_(kNobodysTime_us),
      untimed_us_(kNobodysTime_us) {
  (void)port_->configure_decoding(driver);
}

Decoder::Decoder(const firmware::PortConfig& port, const firmware::DeviceSetup& setup, Out out)
    : Decoder(port.driver, std::move(out)) {
  port_->configure(port, setup);
}

void Decoder::feed(const std::uint8_t* bytes, std::size_t size, std::optional<base::TimeUs> t_us) {
  timed_ = t_us.has_value();
  arrival_us_ = t_us.value_or(arrival_us_);
  for (std::size_t i = 0; i < size; ++i) {
    if (!timed_) {
      untimed_us_ +=
          driver_ == Driver::kNmea2000 ? 0 : kByteStep_us;  // a frame's bytes come together
      arrival_us_ = untimed_us_;
    }
    take(bytes[i]);
  }
  bytes_ += size;
}

void Decoder::finish() {
  arrival_us_ += kOneHour_us;
  const std::uint32_t skipped = port_->counters().skipped_bytes;
  take(0);
  port_->restart();
  // That byte was ours; it belongs to no frame.
  added_skips_ = port_->counters().skipped_bytes > skipped ? 1 : 0;
}

ordered_json Decoder::summary(const char* container) const {
  const hal::CodecCounters counters = port_->counters();
  ordered_json json;
  json["record"] = "summary";
  json["driver"] = firmware::driver_name(driver_);
  if (container != nullptr) {
    json["container"] = container;
  }
  json["frames"] = counters.frames;
  json["records"] = records_;
  json["rejected"] = rejected_json(counters);
  json["ignored"] = counters.ignored;
  json["no_data"] = counters.no_data;
  json["repeats"] = counters.repeats;
  json["skipped_bytes"] = counters.skipped_bytes - added_skips_;
  json["bytes"] = bytes_;
  return json;
}

void Decoder::take(std::uint8_t byte) {
  RecordKind kind = port_->feed(byte, arrival_us_, record_);
  while (kind != RecordKind::kNone) {
    if (kind == RecordKind::kSample) {
      flush_beams();
      ordered_json json = sample_json(record_.sample, driver_, sample_time());
      add_frame_values(driver_, port_->frame(), &json);
      deliver(json);
    } else if (record_.ping.kind == base::ReturnKind::kProfile) {
      flush_beams();
      deliver(profile_json(record_.ping, driver_, ping_time(record_.ping)));
    } else {
      add_beam(record_.ping);
    }
    kind = port_->next(record_);
  }
  flush_beams();
}

/// Beams that one byte completed and that share their transmission are one ping.
void Decoder::add_beam(const base::Ping& ping) {
  const bool another = !beams_.empty() && (beams_.front().t_transmit_us != ping.t_transmit_us ||
                                           beams_.front().mount != ping.mount);
  if (another) {
    flush_beams();
  }
  if (beams_.empty()) {
    // The codec's own goes with the next record that it is asked for.
    const hal::FrameView frame = port_->frame();
    beams_frame_.assign(frame.data, frame.data + frame.size_bytes);
  }
  beams_.push_back(ping);
}

void Decoder::flush_beams() {
  if (beams_.empty()) {
    return;
  }
  ordered_json json = beams_json(beams_, driver_, ping_time(beams_.front()));
  add_frame_values(driver_, {beams_frame_.data(), beams_frame_.size()}, &json);
  deliver(json);
  beams_.clear();
}

void Decoder::deliver(const ordered_json& json) {
  ++records_;
  out_(json);
}

/// Nothing of a device's clock: it was made of an arrival that nobody took down.
bool Decoder::is_nobodys(base::TimeUs t_us) const {
  return !timed_ && t_us > kNobodysTime_us - kOneHour_us;
}

std::optional<base::TimeUs> Decoder::ping_time(const base::Ping& ping) const {
  return is_nobodys(ping.t_transmit_us) ? std::nullopt : std::optional(ping.t_transmit_us);
}

std::optional<base::TimeUs> Decoder::sample_time() const {
  const base::NavSample& sample = record_.sample;
  if (!is_nobodys(sample.t_us)) {
    return sample.t_us;
  }
  if (sample.t_device_us != 0) {
    return sample.t_device_us;
  }
  // With a date; a time of day (GGA) is none.
  constexpr base::TimeUs kOneDay_us = 24 * kOneHour_us;
  const bool dated = (sample.fields & base::kNavUtc) != 0 && sample.utc_us > kOneDay_us;
  return dated ? std::optional(sample.utc_us) : std::nullopt;
}

Driver driver_named(const std::string& name, const std::string& where) {
  std::vector<std::string> names;
  std::string all;
  for (const firmware::DriverInfo& info : firmware::kDrivers) {
    if (name == info.name) {
      if (firmware::device_codec(info.driver) == nullptr) {
        throw HostError(ExitCode::kUsage, std::string(where).append(" ").append(name).append(
                                              ": this build does not carry it"));
      }
      return info.driver;
    }
    names.emplace_back(info.name);
    all += (all.empty() ? "" : ", ") + names.back();
  }
  const std::string near = closest_name(name, names);
  throw HostError(ExitCode::kUsage, where + " " + printable(name) + ": must be one of " + all +
                                        (near.empty() ? "" : "; did you mean " + near + "?"));
}

std::string driver_names_help() {
  std::string names;
  std::size_t line_size = 0;
  for (const firmware::DriverInfo& info : firmware::kDrivers) {
    const std::string name = info.name;
    const bool wraps = line_size + name.size() > 68;
    names += names.empty() ? "" : (wraps ? "\n" : " ");
    line_size = wraps ? name.size() : line_size + name.size() + 1;
    names += name;
  }
  return names;
}

}  // namespace leadline::host
