// A device's bytes to records as JSON objects: what `decode` does with a recording and `probe` with a port.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "firmware/pipeline/device_port.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

class Decoder {
 public:
  /// Gets each record as it is complete (record_json.hpp).
  using Out = std::function<void(const nlohmann::ordered_json& record)>;

  /// For bytes that are there, by the codec's defaults for files. The driver is one that this build carries.
  Decoder(firmware::Driver driver, Out out);
  /// For a device that is asked as well.
  Decoder(const firmware::PortConfig& port, const firmware::DeviceSetup& setup, Out out);

  /// Bytes that arrived together; `t_us` null: nobody took down when.
  void feed(const std::uint8_t* bytes, std::size_t size, std::optional<base::TimeUs> t_us);
  /// As DevicePort::request(); on the time base of feed().
  [[nodiscard]] std::size_t request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity) {
    return port_->request(now_us, out, capacity);
  }
  /// A last byte an hour later: what waits for the rest of a frame is given up and searched again, as on a
  /// line that fell silent.
  void finish();

  [[nodiscard]] firmware::Driver driver() const { return driver_; }
  [[nodiscard]] std::uint64_t records() const { return records_; }
  /// "record": "summary", what was decoded and what was not. `container`: null for a port.
  [[nodiscard]] nlohmann::ordered_json summary(const char* container) const;

 private:
  void take(std::uint8_t byte);
  void add_beam(const base::Ping& ping);
  void flush_beams();
  void deliver(const nlohmann::ordered_json& json);
  [[nodiscard]] bool is_nobodys(base::TimeUs t_us) const;
  [[nodiscard]] std::optional<base::TimeUs> ping_time(const base::Ping& ping) const;
  [[nodiscard]] std::optional<base::TimeUs> sample_time() const;

  firmware::Driver driver_;
  Out out_;
  std::unique_ptr<firmware::DevicePort> port_;
  firmware::DeviceRecord record_{};
  std::vector<base::Ping> beams_;
  std::vector<std::uint8_t> beams_frame_;  ///< that the first of them came in
  bool timed_ = false;
  base::TimeUs arrival_us_;
  base::TimeUs untimed_us_;
  std::uint64_t records_ = 0;
  std::uint64_t bytes_ = 0;
  std::uint32_t added_skips_ = 0;
};

/// The driver of that name. Throws HostError kUsage, with `where` in front of the message ("decode:
/// --driver"): nobody knows it, or this build does not carry it.
[[nodiscard]] firmware::Driver driver_named(const std::string& name, const std::string& where);

/// Names of all drivers, in lines of a help text.
[[nodiscard]] std::string driver_names_help();

}  // namespace leadline::host
