// A whole vehicle in a process: emulated altimeter and NMEA sensors around a firmware::Vehicle, virtual time,
// a recording of every input, and a receiver of every frame.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "firmware/pipeline/vehicle.hpp"
#include "model/localization_table.hpp"
#include "proto/framing.hpp"
#include "proto/tile_coder.hpp"

namespace leadline::test {

/// Inputs of one cycle, as a recorder keeps them.
struct RecordedChunk {
  std::uint8_t port;
  base::TimeUs t_arrival_us;
  std::vector<std::uint8_t> bytes;
};
struct RecordedCycle {
  base::TimeUs t_us;
  std::uint32_t room_bytes;
  std::vector<RecordedChunk> chunks;
};
using Recording = std::vector<RecordedCycle>;

/// Runs one recorded cycle; the output's spans are the vehicle's.
firmware::CycleOutput run_cycle(firmware::Vehicle& vehicle, const RecordedCycle& cycle);
/// All of them, from a configured vehicle on.
void run_recording(firmware::Vehicle& vehicle, const Recording& recording);

/// Ports of rig_config().
inline constexpr std::uint8_t kRigSonar = 0;
inline constexpr std::uint8_t kRigNavigation = 1;

/// 0.5 m cells, 96 x 96 x 64 of them about the origin, from 5 m depth on; Ping1D at 10 Hz, NMEA sensors;
/// 4000 bytes/s, frames of at most 400.
[[nodiscard]] firmware::VehicleConfig rig_config();
[[nodiscard]] const model::LocalizationTable& rig_table();
/// Fails the running test when the vehicle refuses.
void configure_rig(firmware::Vehicle& vehicle, const firmware::VehicleConfig& config);

/// How the devices behave.
struct RigOptions {
  double seconds = 40.0;
  double speed_m_s = 1.5;
  double roll_deg = 4.0;          ///< amplitude, 5 s period
  double echo_until_s = 1e9;      ///< nothing but noise comes back afterwards
  double attitude_until_s = 1e9;  ///< silent afterwards
  double fix_until_s = 1e9;
  double jump_at_s = 1e9;  ///< the position fixes move by jump_m north
  double jump_m = 60.0;
  double deeper_m = 0.0;  ///< the bottom lies so much below rig_bottom_m()
  /// 0: the head is a Ping1D; else a DeltaT of so many beams over 60 degrees, ten pings a second, to 30 m.
  int fan_beams = 0;
  std::uint32_t room_bytes = 100'000;
  base::TimeUs cycle_us = 20'000;
  /// Called with every cycle's input before it runs: the place to do harm.
  std::function<void(RecordedCycle&)> tamper;
};

/// Depth of the bottom at (n, e) metres.
[[nodiscard]] double rig_bottom_m(double north_m, double east_m);

/// Lets the vehicle fly a lawn mower over the grid, devices answering its requests. Returns what it was fed.
/// `sink` gets every cycle's downlink.
using Sink = std::function<void(const RecordedCycle&, const firmware::CycleOutput&)>;
Recording fly(firmware::Vehicle& vehicle, const RigOptions& options, const Sink& sink = nullptr);

/// Cycles without chunks until drained() or `most` of them: true when drained.
bool drain(firmware::Vehicle& vehicle, base::TimeUs& t_us, int most, const Sink& sink = nullptr);

/// The other end of the link: applies every delta of every frame.
class RigReceiver {
 public:
  explicit RigReceiver(std::uint16_t survey_tag) : survey_tag_(survey_tag) {}
  void take(const std::uint8_t* data, std::size_t size_bytes);
  /// Hash of proto/cell.hpp over `tile_count` tiles.
  [[nodiscard]] std::uint64_t hash(std::uint32_t tile_count) const;
  [[nodiscard]] const std::vector<proto::CodedCell>* tile(std::uint32_t id) const;
  void forget() { tiles_.clear(); }

  std::uint64_t hellos = 0;
  std::uint64_t statuses = 0;
  std::uint64_t texts = 0;
  std::uint64_t deltas = 0;
  std::uint64_t bad = 0;  ///< frames or messages that do not decode
  std::uint32_t alarms_seen = 0;
  std::uint32_t last_alarms = 0;
  std::size_t longest_frame = 0;

 private:
  void take_frame(const proto::FrameView& frame);

  std::uint16_t survey_tag_;
  proto::FrameDecoderBuffer<> decoder_;
  std::map<std::uint32_t, std::vector<proto::CodedCell>> tiles_;
};

}  // namespace leadline::test
