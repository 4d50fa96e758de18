#include "host_tools/topside/link_sim.hpp"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <vector>

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
constexpr std::uint64_t kMostSeeds = 100'000;

void check(const LinkSimOptions& options) {
  const auto refuse = [](const std::string& what) {
    throw HostError(ExitCode::kUsage, "link-sim: " + what);
  };
  if (!(options.rate_baud >= kSlowest_baud && options.rate_baud <= kFastest_baud)) {
    refuse("--rate is 100 to 1e9 baud, not " + json_number(options.rate_baud));
  }
  if (options.seeds < 1 || options.seeds > kMostSeeds) {
    refuse("--seeds is 1 to 100000, not " + std::to_string(options.seeds));
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

/// A run beside what a line that loses so much needs at least.
struct Shares {
  double bytes;    ///< bytes down, of that
  double seconds;  ///< time, of that
  double up;       ///< bytes up, of those down
};

// What is demanded of a run.
constexpr Shares kDemanded = {1.3, 1.5, 0.1};

double ideal_bytes(const LinkSimOptions& options, const LinkTrialResult& lossless) {
  return static_cast<double>(lossless.bytes_down) / (1.0 - options.loss);
}

Shares shares_of(const LinkSimOptions& options, const LinkTrialResult& run,
                 const LinkTrialResult& lossless) {
  const double ideal = ideal_bytes(options, lossless);
  const auto down = static_cast<double>(run.bytes_down);
  return {down / ideal, run.seconds * options.rate_baud / (kBitsPerByte * ideal),
          static_cast<double>(run.bytes_up) / std::max(down, 1.0)};
}

/// Lines of one JSON object.
class JsonObject {
 public:
  void add(const char* key, const std::string& value) {
    text_ += std::string(text_.empty() ? "{\n" : ",\n") + "  \"" + key + "\": " + value;
  }
  void add(const char* key, double value) { add(key, json_number(value)); }
  void add(const char* key, std::uint64_t value) { add(key, std::to_string(value)); }
  void add(const char* key, bool value) { add(key, std::string(value ? "true" : "false")); }
  [[nodiscard]] std::string text() const { return text_ + "\n}\n"; }

 private:
  std::string text_;
};

std::string result_json(const LinkSimOptions& options, const LinkTrialResult& lossy,
                        const LinkTrialResult& lossless) {
  JsonObject json;
  json.add("converged", lossy.converged);
  json.add("seconds", lossy.seconds);
  json.add("bytes_down", lossy.bytes_down);
  json.add("bytes_up", lossy.bytes_up);
  json.add("lossless_bytes", lossless.bytes_down);
  json.add("hash_equal", lossy.hash_equal);
  json.add("lossless_seconds", lossless.seconds);
  json.add("tiles", std::uint64_t{lossy.tiles});
  json.add("frames_down", lossy.frames_down);
  json.add("frames_up", lossy.frames_up);
  json.add("frames_dropped", lossy.frames_dropped);
  json.add("tiles_lost", lossy.tiles_lost);
  json.add("delta_bytes", lossy.delta_bytes);
  json.add("coarse_bytes", lossy.coarse_bytes);
  json.add("status_bytes", lossy.status_bytes);
  json.add("cells_came", lossy.cells_came);
  json.add("cells_needless", lossy.cells_needless);
  json.add("idle_seconds", lossy.idle_seconds);
  json.add("most_bytes_in_1s", lossy.most_in_1s);
  const Shares shares = shares_of(options, lossy, lossless);
  json.add("bytes_of_ideal", shares.bytes);
  json.add("seconds_of_ideal", shares.seconds);
  json.add("up_of_down", shares.up);
  return json.text();
}

/// One figure over all seeds.
struct Spread {
  double mean = 0.0;
  double p99 = 0.0;
  double largest = 0.0;
  double within = 0.0;  ///< share of the seeds
};

Spread spread_of(std::vector<double> values, double bound) {
  Spread spread;
  std::sort(values.begin(), values.end());
  const auto count = static_cast<double>(values.size());
  for (const double value : values) {
    spread.mean += value / count;
    spread.within += value <= bound ? 1.0 / count : 0.0;
  }
  spread.p99 = values[static_cast<std::size_t>(std::ceil(0.99 * count)) - 1];
  spread.largest = values.back();
  return spread;
}

/// Chance that a sender who knew at once what was lost would need more than `share` times the mean to bring
/// `frames` frames of equal length through: they are all through after T frames, and T has a spread.
double oracle_breaks(std::uint64_t frames, double loss, double share) {
  const auto most = static_cast<std::uint64_t>(share * static_cast<double>(frames) / (1.0 - loss));
  // Not all through: fewer than `frames` of `most` arrive.
  double chance = 0.0;
  for (std::uint64_t arrive = 0; arrive < frames && arrive <= most; ++arrive) {
    const auto n = static_cast<double>(most);
    const auto k = static_cast<double>(arrive);
    const double ways = std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0);
    chance += std::exp(ways + k * std::log1p(-loss) + (n - k) * std::log(loss));
  }
  return chance;
}

std::string seeds_json(const LinkSimOptions& options, const std::vector<LinkTrialResult>& runs,
                       const LinkTrialResult& lossless) {
  std::vector<double> bytes;
  std::vector<double> seconds;
  std::vector<double> up;
  double frames = 0.0;
  double frame_bytes = 0.0;
  double needless = 0.0;
  double idle = 0.0;
  bool converged = true;
  bool equal = true;
  const auto count = static_cast<double>(runs.size());
  for (const LinkTrialResult& run : runs) {
    const Shares shares = shares_of(options, run, lossless);
    bytes.push_back(shares.bytes);
    seconds.push_back(shares.seconds);
    up.push_back(shares.up);
    frames += static_cast<double>(run.frames_down);
    frame_bytes += static_cast<double>(run.bytes_down);
    needless += static_cast<double>(run.cells_needless) /
                static_cast<double>(std::max<std::uint64_t>(run.cells_came, 1)) / count;
    idle += run.idle_seconds / std::max(run.seconds, 1e-6) / count;
    converged = converged && run.converged;
    equal = equal && run.hash_equal;
  }
  const auto oracle_frames = static_cast<std::uint64_t>(
      std::llround(static_cast<double>(lossless.bytes_down) * frames / std::max(frame_bytes, 1.0)));
  JsonObject json;
  json.add("seeds", static_cast<std::uint64_t>(runs.size()));
  json.add("converged", converged);
  json.add("hash_equal", equal);
  json.add("lossless_bytes", lossless.bytes_down);
  json.add("lossless_seconds", lossless.seconds);
  const auto add = [&json](const std::string& name, const std::vector<double>& values,
                           double bound) {
    const Spread spread = spread_of(values, bound);
    json.add((name + "_mean").c_str(), spread.mean);
    json.add((name + "_p99").c_str(), spread.p99);
    json.add((name + "_largest").c_str(), spread.largest);
    json.add((name + "_within").c_str(), spread.within);
  };
  add("bytes_of_ideal", bytes, kDemanded.bytes);
  add("seconds_of_ideal", seconds, kDemanded.seconds);
  add("up_of_down", up, kDemanded.up);
  json.add("frames_of_lossless", oracle_frames);
  json.add(
      "oracle_bytes_within",
      options.loss > 0.0 ? 1.0 - oracle_breaks(oracle_frames, options.loss, kDemanded.bytes) : 1.0);
  json.add("cells_needless_share", needless);
  json.add("idle_share", idle);
  return json.text();
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
  const LinkTrialResult lossless = run_link_trial(&*vehicle, &t_us, trial);
  trial.line.loss = options.loss;
  trial.line.reorder = options.reorder;
  trial.line.duplicate = options.duplicate;
  std::vector<LinkTrialResult> runs;
  bool converged = lossless.converged;
  for (std::uint64_t k = 0; k < options.seeds; ++k) {
    settle_vehicle(&*vehicle, &t_us, trial.cycle_us);
    trial.line.seed = options.seed + k;
    runs.push_back(run_link_trial(&*vehicle, &t_us, trial));
    converged = converged && runs.back().converged;
  }
  const LinkTrialResult& lossy = runs.front();
  if (options.seeds > 1) {
    std::cout << seeds_json(options, runs, lossless);
  } else if (options.json) {
    std::cout << result_json(options, lossy, lossless);
  } else {
    std::cout << lossy.tiles << " tiles, " << (lossy.converged ? "equal" : "not equal") << " after "
              << json_number(lossy.seconds) << " s: " << lossy.bytes_down << " bytes down, "
              << lossy.bytes_up << " up; without loss " << lossless.bytes_down << " down in "
              << json_number(lossless.seconds) << " s\n";
  }
  return static_cast<int>(converged ? ExitCode::kOk : ExitCode::kComparisonFailed);
}

}  // namespace leadline::host
