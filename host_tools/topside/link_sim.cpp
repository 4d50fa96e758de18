#include "host_tools/topside/link_sim.hpp"

#include <algorithm>
#include <cmath>
#include <iostream>

#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"
#include "host_tools/topside/host_vehicle.hpp"
#include "host_tools/topside/link_trial.hpp"
#include "host_tools/topside/replay.hpp"

namespace leadline::host {
namespace {

constexpr double kBitsPerByte = 10.0;
// Slower lines than any modem would make a run endless, faster ones are none.
constexpr double kSlowest_baud = 100.0;
constexpr double kFastest_baud = 1e9;

void check(const LinkSimOptions& options) {
  const auto refuse = [](const std::string& what) {
    throw HostError(ExitCode::kUsage, "link-sim: " + what);
  };
  if (!(options.rate_baud >= kSlowest_baud && options.rate_baud <= kFastest_baud)) {
    refuse("--rate is 100 to 1e9 baud, not " + json_number(options.rate_baud));
  }
  for (const auto& [name, share] : {std::pair<const char*, double>{"--loss", options.loss},
                                    {"--reorder", options.reorder},
                                    {"--dup", options.duplicate}}) {
    if (!(share >= 0.0 && share <= 0.9)) {
      refuse(std::string(name) + " is a fraction of 0 to 0.9, not " + json_number(share));
    }
  }
  if (!(options.delay_ms >= 0.0 && options.delay_ms <= 60'000.0)) {
    refuse("--delay-ms is 0 to 60000, not " + json_number(options.delay_ms));
  }
}

std::string result_json(const LinkSimOptions& options, const LinkTrialResult& lossy,
                        const LinkTrialResult& lossless) {
  std::string text = std::string("{\n  \"converged\": ") + (lossy.converged ? "true" : "false");
  const auto add = [&text](const char* key, const std::string& value) {
    text += std::string(",\n  \"") + key + "\": " + value;
  };
  add("seconds", json_number(lossy.seconds));
  add("bytes_down", std::to_string(lossy.bytes_down));
  add("bytes_up", std::to_string(lossy.bytes_up));
  add("lossless_bytes", std::to_string(lossless.bytes_down));
  add("hash_equal", lossy.hash_equal ? "true" : "false");
  add("lossless_seconds", json_number(lossless.seconds));
  add("tiles", std::to_string(lossy.tiles));
  add("frames_down", std::to_string(lossy.frames_down));
  add("frames_up", std::to_string(lossy.frames_up));
  add("tiles_lost", std::to_string(lossy.tiles_lost));
  add("most_bytes_in_1s", std::to_string(lossy.most_in_1s));
  // What a line that loses so much needs at least, and how much of it was used.
  const double ideal_bytes = static_cast<double>(lossless.bytes_down) / (1.0 - options.loss);
  const double ideal_s = ideal_bytes * kBitsPerByte / options.rate_baud;
  add("bytes_of_ideal", json_number(static_cast<double>(lossy.bytes_down) / ideal_bytes));
  add("seconds_of_ideal", json_number(lossy.seconds / ideal_s));
  add("up_of_down", json_number(static_cast<double>(lossy.bytes_up) /
                                static_cast<double>(std::max<std::uint64_t>(lossy.bytes_down, 1))));
  return text + "\n}\n";
}

}  // namespace

int run_link_sim(const LinkSimOptions& options) {
  check(options);
  FlightLog log(options.log_path);
  firmware::VehicleConfig config = log.config();
  config.link.rate_bytes_s = static_cast<std::uint32_t>(options.rate_baud / kBitsPerByte);
  if (options.mtu_bytes != 0) {
    config.link.mtu_bytes = static_cast<std::uint16_t>(std::clamp(options.mtu_bytes, 0, 65535));
  }
  const HostVehicle vehicle(config, log.tables(), options.log_path);
  const ReplayResult replay = replay_flight(&log, &*vehicle, nullptr);
  LinkTrialOptions trial;
  trial.introduced = !options.join;
  base::TimeUs t_us = replay.now.t_us;
  if (replay.cycles > 1) {
    trial.cycle_us = std::clamp<base::TimeUs>(
        (t_us - log.header().t_us) / static_cast<base::TimeUs>(replay.cycles - 1), 1000, 100'000);
  }
  settle_vehicle(&*vehicle, &t_us, trial.cycle_us);
  trial.line.bytes_per_s = options.rate_baud / kBitsPerByte;
  trial.line.delay_us = static_cast<base::TimeUs>(std::llround(options.delay_ms * 1000.0));
  trial.line.seed = options.seed;
  const LinkTrialResult lossless = run_link_trial(&*vehicle, &t_us, trial);
  settle_vehicle(&*vehicle, &t_us, trial.cycle_us);
  trial.line.loss = options.loss;
  trial.line.reorder = options.reorder;
  trial.line.duplicate = options.duplicate;
  const LinkTrialResult lossy = run_link_trial(&*vehicle, &t_us, trial);
  if (options.json) {
    std::cout << result_json(options, lossy, lossless);
  } else {
    std::cout << lossy.tiles << " tiles, " << (lossy.converged ? "equal" : "not equal") << " after "
              << json_number(lossy.seconds) << " s: " << lossy.bytes_down << " bytes down, "
              << lossy.bytes_up << " up; without loss " << lossless.bytes_down << " down in "
              << json_number(lossless.seconds) << " s\n";
  }
  return static_cast<int>(lossy.converged && lossless.converged ? ExitCode::kOk
                                                                : ExitCode::kComparisonFailed);
}

}  // namespace leadline::host
