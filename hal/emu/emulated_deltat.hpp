// A DeltaT multibeam from the outside: an 83P packet per ping, at its own rate.
// From the maker's description of the format, as printed in MB-System mbsys_image83p.h.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "hal/emu/free_running_head.hpp"

namespace leadline::emu {

struct DeltatShot {
  base::TimeUs t_transmit_us;
  int beams;
  double start_deg;
  double increment_deg;
  double range_m;
};

struct DeltatEcho {
  std::vector<double> range_m;      ///< one per beam, 0: nothing; with sound at 1500 m/s
  std::vector<unsigned> intensity;  ///< empty: not sent
  double pitch_deg = 0;
  double roll_deg = 0;
  double heading_deg = 0;
  bool has_attitude = true;
  std::string latitude = " 00.00.00000 N";
  std::string longitude = "000.00.00000 E";
};

struct EmulatedDeltatConfig {
  int beams = 120;
  double sector_deg = 120;
  double range_m = 20;
  std::int64_t interval_us = 100'000;
  std::int64_t data_latency_us =
      0;  ///< from the ping to its packet; 0: at the end of listening, not said
  std::string date = "22-NOV-2026";
};

class EmulatedDeltat final : public FreeRunningHead {
 public:
  using Measure = std::function<DeltatEcho(const DeltatShot&)>;

  EmulatedDeltat(const EmulatedDeltatConfig& config, Measure measure);

  [[nodiscard]] std::uint64_t shots() const { return shots_; }

 private:
  void ping(base::TimeUs t_us) override;

  EmulatedDeltatConfig config_;
  Measure measure_;
  std::uint64_t shots_ = 0;
};

}  // namespace leadline::emu
