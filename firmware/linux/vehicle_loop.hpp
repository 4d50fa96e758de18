// The vehicle thread: polls ports, runs cycles, sends, hands the log to the recorder. firmware/README.md has
// the cycle.
#pragma once

#include <array>
#include <csignal>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <poll.h>

#include "firmware/config/vehicle_file.hpp"
#include "firmware/linux/chunk_buffer.hpp"
#include "firmware/linux/command_port.hpp"
#include "firmware/linux/page_file.hpp"
#include "firmware/linux/recorder.hpp"
#include "firmware/linux/service_manager.hpp"
#include "firmware/linux/timing.hpp"
#include "firmware/pipeline/host_report.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "hal/linux/linux_port.hpp"
#include "hal/linux/lockstep.hpp"
#include "hal/linux/port_watch.hpp"

namespace leadline::host {

struct LoopOptions {
  std::string lockstep_path;  ///< "" = CLOCK_MONOTONIC
  /// After the order to stop: how long queued changes may take to leave, and how long the link has to be
  /// silent before the vehicle believes that nothing is asked for again.
  std::int64_t drain_us = 5'000'000;
  std::int64_t linger_us = 300'000;
};

/// What a run came to.
struct LoopSummary {
  std::uint64_t cycles = 0;
  std::int64_t cycle_max_us = 0;  ///< longest cycle, real time, waiting not counted
  std::uint64_t overruns = 0;     ///< cycles that began a period or more too late
  bool drained = false;           ///< everything had left when it stopped
  bool stored = false;            ///< every page was saved when it stopped, or there is no store
  base::TimeUs t_us = 0;          ///< of the last cycle
};

class VehicleLoop {
 public:
  /// Makes the ports (throws HostError kUsage: a host without address, an address that is taken, a device
  /// that is none, or not there and not optional). The
  /// vehicle is configured; `recorder`, `pages` and `commands` may be null. All outlive the loop.
  VehicleLoop(const VehicleFile& file, const std::vector<model::LocalizationTable>& tables,
              firmware::Vehicle& vehicle, Recorder* recorder, PageFile* pages,
              CommandPort* commands, const LoopOptions& options);
  ~VehicleLoop();
  VehicleLoop(const VehicleLoop&) = delete;
  VehicleLoop& operator=(const VehicleLoop&) = delete;

  /// Until `stop` becomes non-zero or the emulator finishes; then drains the link and writes the log's
  /// end. Throws HostError kInput when the emulator is gone or breaks the protocol; the log is ended
  /// in order before that.
  LoopSummary run(const volatile std::sig_atomic_t& stop);
  /// Of the real clock; of cycles under a virtual one only what they took.
  [[nodiscard]] const LoopTiming& timing() const { return timing_; }

 private:
  struct Line {
    std::unique_ptr<hal::LinuxPort> port;
    std::string uri;
    std::string name;  ///< for messages: "port 0" or "link"
    hal::PortWatch watch;
  };

  void fly_real(const volatile std::sig_atomic_t& stop);
  void fly_lockstep(const volatile std::sig_atomic_t& stop);
  void drain(const volatile std::sig_atomic_t& stop);
  /// Gathers input until `deadline_us` of the real clock.
  void gather(std::int64_t deadline_us, bool only_link, const volatile std::sig_atomic_t& stop);
  void gather_granted(base::TimeUs t_us, const hal::LockstepCounts& granted);
  void take_granted(std::size_t index, base::TimeUs t_us, std::uint64_t total);
  [[nodiscard]] hal::LockstepCounts requested() const;
  void take_line(std::size_t index, base::TimeUs now_us);
  void hear_commands(base::TimeUs t_us);
  void run_cycle(base::TimeUs t_us);
  void send(const firmware::CycleOutput& output);
  void record(const firmware::CycleInput& input, const firmware::CycleOutput& output);
  void begin_log(base::TimeUs t_us);
  void end_log();
  void add_host_report(base::TimeUs t_us);
  void service(base::TimeUs now_us);
  [[nodiscard]] firmware::HostReport host_report() const;
  [[nodiscard]] std::uint32_t downlink_room() const;
  [[nodiscard]] std::size_t wait_set(bool only_link);
  [[nodiscard]] std::uint8_t source_number(std::size_t index) const;
  [[nodiscard]] hal::LinuxPort& port(std::size_t index) { return *lines_[index].port; }
  [[nodiscard]] std::size_t link_index() const { return lines_.size() - 1; }
  [[nodiscard]] bool lockstep() const { return !options_.lockstep_path.empty(); }

  const VehicleFile& file_;
  const std::vector<model::LocalizationTable>& tables_;
  firmware::Vehicle& vehicle_;
  Recorder* recorder_;
  PageFile* pages_;
  CommandPort* commands_;
  bool finish_said_ = false;  ///< to the store
  LoopOptions options_;
  hal::LockstepClient clock_;
  std::vector<Line> lines_;  ///< device ports, then the link
  ChunkBuffer chunks_;
  std::vector<std::uint8_t> batch_;
  LoopSummary summary_;
  LoopTiming timing_;
  ServiceManager manager_;
  bool link_spoke_ = false;  ///< bytes came up the link in this cycle
  // Of the real clock.
  std::int64_t cycle_begun_us_ = 0;
  std::int64_t wish_us_ = INT64_MAX;  ///< firmware::CycleOutput::wish_us
  std::int64_t cycle_last_us_ = 0;
  base::TimeUs report_due_us_ = 0;
  firmware::HostReport reported_{};
  bool ever_reported_ = false;
  bool stopping_ = false;  ///< devices are asked for nothing any more
  std::array<pollfd, ChunkBuffer::kSources> waits_{};
  std::array<std::size_t, ChunkBuffer::kSources> waiting_lines_{};
};

}  // namespace leadline::host
