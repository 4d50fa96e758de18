#include "host_tools/decode/decode.hpp"

#include <algorithm>
#include <iostream>
#include <memory>
#include <vector>

#include <nlohmann/json.hpp>

#include "firmware/pipeline/device_port.hpp"
#include "host_tools/decode/record_json.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

using firmware::DeviceRecord;
using firmware::Driver;
using firmware::RecordKind;
using nlohmann::ordered_json;

// Arrival times for bytes that nobody timed: 142 years after 1970, later than any device's clock and farther
// from it than any recording is long, so that a time made of an arrival is told from a device's own.
constexpr base::TimeUs kNobodysTime_us = base::TimeUs{1} << 52U;
constexpr base::TimeUs kByteStep_us = 1;
constexpr base::TimeUs kOneHour_us = 3'600'000'000;

class Decoder {
 public:
  Decoder(Driver driver, bool json, const std::function<void(const std::string&)>& out)
      : driver_(driver), json_(json), out_(&out), port_(std::make_unique<firmware::DevicePort>()) {
    if (!port_->configure_decoding(driver)) {
      throw HostError(ExitCode::kUsage, std::string("decode: --driver ") +
                                            firmware::driver_name(driver) +
                                            ": this build does not carry it");
    }
  }

  void feed(const RecordedBytes& piece) {
    timed_ = piece.t_us.has_value();
    if (timed_) {
      arrival_us_ = *piece.t_us;
    }
    for (const std::uint8_t byte : piece.bytes) {
      if (!timed_) {
        untimed_us_ += kByteStep_us;
        arrival_us_ = untimed_us_;
      }
      take(byte);
    }
    bytes_ += piece.bytes.size();
  }

  /// A last byte an hour later: what waits for the rest of a frame is given up and searched again, as on a
  /// line that fell silent.
  void finish() {
    arrival_us_ += kOneHour_us;
    const std::uint32_t skipped = port_->counters().skipped_bytes;
    take(0);
    port_->restart();
    // That byte was ours; it belongs to no frame.
    added_skips_ = port_->counters().skipped_bytes > skipped ? 1 : 0;
  }

  [[nodiscard]] ordered_json summary(const Recording& recording) const {
    const hal::CodecCounters counters = port_->counters();
    ordered_json json;
    json["record"] = "summary";
    json["driver"] = firmware::driver_name(driver_);
    json["container"] = recording.container();
    json["frames"] = counters.frames;
    json["records"] = records_;
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
    for (const auto& [reason, count] : recording.rejected()) {
      rejected[reason] = count;
    }
    json["rejected"] = rejected;
    json["ignored"] = counters.ignored;
    json["no_data"] = counters.no_data;
    json["repeats"] = counters.repeats;
    json["skipped_bytes"] = counters.skipped_bytes - added_skips_;
    json["bytes"] = bytes_;
    return json;
  }

 private:
  void take(std::uint8_t byte) {
    RecordKind kind = port_->feed(byte, arrival_us_, record_);
    while (kind != RecordKind::kNone) {
      if (kind == RecordKind::kSample) {
        flush_beams();
        print(sample_json(record_.sample, sample_time()));
      } else if (record_.ping.kind == base::ReturnKind::kProfile) {
        flush_beams();
        print(profile_json(record_.ping, driver_, ping_time(record_.ping)));
      } else {
        add_beam(record_.ping);
      }
      kind = port_->next(record_);
    }
    flush_beams();
  }

  /// Beams that one byte completed and that share their transmission are one ping.
  void add_beam(const base::Ping& ping) {
    const bool another = !beams_.empty() && (beams_.front().t_transmit_us != ping.t_transmit_us ||
                                             beams_.front().mount != ping.mount);
    if (another) {
      flush_beams();
    }
    beams_.push_back(ping);
  }

  void flush_beams() {
    if (beams_.empty()) {
      return;
    }
    print(beams_json(beams_, driver_, ping_time(beams_.front())));
    beams_.clear();
  }

  void print(const ordered_json& json) {
    ++records_;
    (*out_)(json_ ? json.dump() : record_text(json));
  }

  /// Nothing of a device's clock: it was made of an arrival that nobody took down.
  [[nodiscard]] bool is_nobodys(base::TimeUs t_us) const {
    return !timed_ && t_us > kNobodysTime_us - kOneHour_us;
  }
  [[nodiscard]] std::optional<base::TimeUs> ping_time(const base::Ping& ping) const {
    return is_nobodys(ping.t_transmit_us) ? std::nullopt : std::optional(ping.t_transmit_us);
  }
  [[nodiscard]] std::optional<base::TimeUs> sample_time() const {
    const base::NavSample& sample = record_.sample;
    if (!is_nobodys(sample.t_us)) {
      return sample.t_us;
    }
    return sample.t_device_us != 0 ? std::optional(sample.t_device_us) : std::nullopt;
  }

  Driver driver_;
  bool json_;
  const std::function<void(const std::string&)>* out_;
  std::unique_ptr<firmware::DevicePort> port_;
  DeviceRecord record_{};
  std::vector<base::Ping> beams_;
  bool timed_ = false;
  base::TimeUs arrival_us_ = kNobodysTime_us;
  base::TimeUs untimed_us_ = kNobodysTime_us;
  std::uint64_t records_ = 0;
  std::uint64_t bytes_ = 0;
  std::uint32_t added_skips_ = 0;
};

Driver driver_of(const std::string& name) {
  std::vector<std::string> names;
  std::string all;
  for (const firmware::DriverInfo& info : firmware::kDrivers) {
    if (name == info.name) {
      return info.driver;
    }
    names.emplace_back(info.name);
    all += (all.empty() ? "" : ", ") + names.back();
  }
  const std::string near = closest_name(name, names);
  throw HostError(ExitCode::kUsage, "decode: --driver " + printable(name) + ": must be one of " +
                                        all + (near.empty() ? "" : "; did you mean " + near + "?"));
}

}  // namespace

void decode_recording(Recording* recording, Driver driver, bool json,
                      const std::function<void(const std::string&)>& out) {
  Decoder decoder(driver, json, out);
  RecordedBytes piece;
  while (recording->next(&piece)) {
    decoder.feed(piece);
  }
  decoder.finish();
  const ordered_json summary = decoder.summary(*recording);
  if (json) {
    out(summary.dump());
    return;
  }
  out(std::to_string(summary["frames"].get<std::uint64_t>()) + " frames, " +
      std::to_string(summary["records"].get<std::uint64_t>()) + " records (" +
      recording->container() + "); rejected " + summary["rejected"].dump() + ", skipped " +
      summary["skipped_bytes"].dump() + " of " + summary["bytes"].dump() + " bytes");
}

int run_decode(const DecodeOptions& options) {
  const Driver driver = driver_of(options.driver);
  const std::unique_ptr<Recording> recording = open_recording(ByteSource(options.path), driver);
  decode_recording(recording.get(), driver, options.json,
                   [](const std::string& line) { std::cout << line << '\n'; });
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
