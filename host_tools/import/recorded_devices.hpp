// Recordings at the ends of a vehicle's ports: each piece arrives when it was recorded.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host_tools/emulate/port_devices.hpp"
#include "host_tools/import/recording.hpp"

namespace leadline::host {

/// A recording and the port that it is heard on.
struct PortRecording {
  std::size_t port = 0;
  std::unique_ptr<Recording> recording;
  base::TimeUs shift_us = 0;  ///< added to its times
};

class RecordedDevices : public PortDevices {
 public:
  /// Reads everything. Bytes without a time arrive as on a line of `bytes_per_s`, from the start. Ports
  /// below `port_count` without a recording stay silent. Throws HostError kInput from the recordings.
  RecordedDevices(std::vector<PortRecording> recordings, std::size_t port_count,
                  std::int64_t bytes_per_s);

  [[nodiscard]] std::size_t port_count() const override { return port_count_; }
  [[nodiscard]] base::TimeUs t_end_us() const override;
  [[nodiscard]] base::TimeUs next_us(base::TimeUs now_us) const override;
  void advance(base::TimeUs now_us, std::vector<emu::Bytes>* bytes) override;
  void take(std::size_t port, base::TimeUs now_us, const std::uint8_t* data,
            std::size_t size_bytes) override;

  /// The recordings' own time at the vehicle's 0; 0 where none had any.
  [[nodiscard]] base::TimeUs t_origin_us() const { return t_origin_us_; }
  [[nodiscard]] std::size_t piece_count() const { return pieces_.size(); }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// Pieces whose recorded time lies before that of the piece before it: taken as simultaneous with it.
  [[nodiscard]] std::uint64_t steps_back() const { return steps_back_; }

 private:
  struct Piece {
    base::TimeUs t_us;
    std::size_t port;
    std::vector<std::uint8_t> bytes;
  };
  void read(PortRecording* source, std::int64_t bytes_per_s, std::vector<Piece>* timed,
            std::vector<Piece>* untimed);

  std::vector<Piece> pieces_;  ///< ascending by time
  std::size_t next_ = 0;
  std::size_t port_count_;
  base::TimeUs t_origin_us_ = 0;
  std::uint64_t bytes_ = 0;
  std::uint64_t steps_back_ = 0;
};

}  // namespace leadline::host
