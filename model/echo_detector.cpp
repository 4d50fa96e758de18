#include "model/echo_detector.hpp"

#include "model/base/fixed.hpp"

namespace leadline::model {
namespace {

using base::max_of;
using base::min_of;

constexpr std::int64_t kEdgeSigmas = 3;
constexpr std::int64_t kPeakSigmas = 8;
constexpr int kGap = 2;     // bins below the edge that do not yet end a run
constexpr int kMargin = 2;  // bins around a run that belong to its energy
constexpr std::int64_t kFirstShare =
    4;  // an echo counts from this part of the strongest one's energy on

// Bins first .. last of a profile, and their noise.
struct Window {
  const std::uint16_t* intensity;
  int first;
  int last;
  std::int64_t noise_q8;
  std::int64_t sigma_q8;
};

struct Run {
  int first;
  int last;
  std::int64_t peak_q8;
  std::int64_t energy_q8;
};

// Smallest value v so that at least half of the window's distances |x - centre| are <= v: bit by bit from
// above, so that no sorting is needed.
std::int32_t median_distance(const Window& window, std::int32_t centre) {
  const int count = window.last - window.first + 1;
  std::int32_t below = 0;  // every value < below leaves less than half
  for (std::int32_t bit = 1 << 15; bit != 0; bit >>= 1) {
    const std::int32_t trial = below + bit;
    int smaller = 0;
    for (int i = window.first; i <= window.last; ++i) {
      const std::int32_t apart = window.intensity[i] - centre;
      smaller += (apart < 0 ? -apart : apart) < trial ? 1 : 0;
    }
    below = 2 * smaller < count ? trial : below;
  }
  return below;
}

// Mean of what lies within three median deviations of the median; a sigma is 1.48 median deviations, and
// never below half a step of the converter.
void estimate_noise(Window& window) {
  const std::int32_t median = median_distance(window, 0);
  const std::int32_t deviation = median_distance(window, median);
  const std::int32_t limit = 4 * deviation + 1;
  std::int64_t sum = 0;
  std::int64_t count = 0;
  for (int i = window.first; i <= window.last; ++i) {
    const std::int32_t apart = window.intensity[i] - median;
    if (apart <= limit && apart >= -limit) {
      sum += window.intensity[i];
      ++count;
    }
  }
  window.noise_q8 = (sum << 8) / max_of<std::int64_t>(count, 1);
  window.sigma_q8 = max_of<std::int64_t>(128, static_cast<std::int64_t>(deviation) * 380);
}

std::int64_t excess_q8(const Window& window, int bin) {
  return (static_cast<std::int64_t>(window.intensity[bin]) << 8) - window.noise_q8;
}

// (1 2 1) / 4, ends repeated.
std::int64_t smoothed_q8(const Window& window, int bin) {
  return (excess_q8(window, max_of(bin - 1, window.first)) + 2 * excess_q8(window, bin) +
          excess_q8(window, min_of(bin + 1, window.last))) >>
         2;
}

// The next run at or behind bin `from`; false when there is none.
bool next_run(const Window& window, int from, Run& run) {
  const std::int64_t edge_q8 = kEdgeSigmas * window.sigma_q8;
  int first = from;
  while (first <= window.last && smoothed_q8(window, first) <= edge_q8) {
    ++first;
  }
  if (first > window.last) {
    return false;
  }
  run = Run{first, first, 0, 0};
  for (int bin = first; bin <= window.last && bin - run.last <= kGap + 1; ++bin) {
    const std::int64_t level_q8 = smoothed_q8(window, bin);
    if (level_q8 > edge_q8) {
      run.last = bin;
      run.peak_q8 = max_of(run.peak_q8, level_q8);
    }
  }
  for (int bin = run.first; bin <= run.last; ++bin) {
    run.energy_q8 += excess_q8(window, bin);
  }
  return true;
}

bool strong(const Window& window, const Run& run) {
  return run.peak_q8 > kPeakSigmas * window.sigma_q8 && run.energy_q8 > 0;
}

// The returns of a profile: the nearest strong run that has its share of the strongest one's energy, and
// runs far enough behind it that outdo all before them. `origin` is the bin at range 0. Returns how many.
int choose_runs(const Window& window, const EchoDetectorConfig& config, std::int64_t origin,
                Run chosen[kMaxReturns], int& heard_bin) {
  const int max_returns = base::clamp<int>(config.max_returns, 1, kMaxReturns);
  std::int64_t strongest_q8 = 0;
  Run run{};
  for (int from = window.first; next_run(window, from, run); from = run.last + 1) {
    if (strong(window, run)) {
      heard_bin = strongest_q8 == 0 ? run.first : heard_bin;
      strongest_q8 = max_of(strongest_q8, run.energy_q8);
    }
  }
  int count = 0;
  for (int from = window.first; strongest_q8 > 0 && next_run(window, from, run);
       from = run.last + 1) {
    if (!strong(window, run)) {
      continue;
    }
    if (count == 0 && kFirstShare * run.energy_q8 < strongest_q8) {
      continue;
    }
    if (count > 0) {
      const Run& before = chosen[count - 1];
      const std::int64_t apart = ((before.first - origin) * config.apart_q16) >> 16;
      if (run.energy_q8 <= before.energy_q8 || run.first - before.first < apart) {
        continue;
      }
    }
    // The last place is the strongest one's.
    count = min_of(count + 1, max_returns);
    chosen[count - 1] = run;
    if (max_returns == 1) {
      break;
    }
  }
  return count;
}

// Bins of the profile whose centres are in range.
Window window_of(const base::RangeProfile& profile, const EchoDetectorConfig& config) {
  const auto bin_um = static_cast<std::int64_t>(max_of<std::uint32_t>(profile.bin_um, 1));
  const std::int64_t count = min_of<std::int64_t>(profile.bin_count, kMaxProfileBins);
  const std::int64_t near_um = config.min_range_um - profile.first_bin_um;
  const std::int64_t far_um = config.max_range_um - profile.first_bin_um;
  const std::int64_t first = near_um <= 0 ? 0 : min_of(count, (near_um + bin_um - 1) / bin_um);
  const std::int64_t last = far_um < 0 ? -1 : min_of(count - 1, far_um / bin_um);
  return Window{profile.intensity, static_cast<int>(first), static_cast<int>(last), 0, 0};
}

// Where `wanted` of the energy summed from bin `first` on is reached: bins first .. last, as a distance in
// 1/256 bin from the near edge of bin `first`.
std::int64_t arrival_q8(const Window& window, int first, int last, std::int64_t wanted_q8) {
  std::int64_t sum_q8 = 0;
  for (int bin = first; bin <= last; ++bin) {
    const std::int64_t own_q8 = excess_q8(window, bin);
    if (own_q8 > 0 && sum_q8 + own_q8 >= wanted_q8) {
      const std::int64_t part = max_of<std::int64_t>(wanted_q8 - sum_q8, 0);
      return ((static_cast<std::int64_t>(bin) - first) << 8) + (part << 8) / own_q8;
    }
    sum_q8 += own_q8;
  }
  return (static_cast<std::int64_t>(last) - first + 1) << 8;
}

// Where the detector's fraction of a run's energy has arrived.
struct Arrival {
  std::int64_t range_um;
  std::int64_t energy_q8;
};

Arrival arrival_of(const base::RangeProfile& profile, const Window& window, const Run& run,
                   std::uint16_t fraction_q16) {
  const int first = max_of(run.first - kMargin, window.first);
  const int last = min_of(run.last + kMargin, window.last);
  std::int64_t energy_q8 = 0;
  for (int bin = first; bin <= last; ++bin) {
    energy_q8 += excess_q8(window, bin);
  }
  energy_q8 = max_of<std::int64_t>(energy_q8, 1);
  const std::int64_t wanted_q8 = max_of<std::int64_t>(1, (energy_q8 * fraction_q16) >> 16);
  const std::int64_t way_q8 = arrival_q8(window, first, last, wanted_q8);
  // Bin i is centred at first_bin + i * bin: its near edge lies half a bin before.
  return Arrival{profile.first_bin_um + static_cast<std::int64_t>(profile.bin_um) * first -
                     profile.bin_um / 2 + ((way_q8 * profile.bin_um) >> 8),
                 energy_q8};
}

std::uint8_t quality_of(const Window& window, const Run& run) {
  // snr / (snr + 8): half at the least ratio that counts.
  const std::int64_t peak = run.peak_q8;
  return static_cast<std::uint8_t>(
      max_of<std::int64_t>(1, 255 * peak / (peak + kPeakSigmas * window.sigma_q8)));
}

}  // namespace

EchoDetection detect_echo(const base::RangeProfile& profile, const EchoDetectorConfig& config) {
  EchoDetection detection{};
  if (profile.intensity == nullptr) {
    return detection;
  }
  Window window = window_of(profile, config);
  if (window.last - window.first + 1 < kMinProfileBins) {
    return detection;
  }
  estimate_noise(window);
  detection.noise_q8 = static_cast<std::uint32_t>(window.noise_q8);
  detection.noise_sigma_q8 = static_cast<std::uint32_t>(window.sigma_q8);
  Run runs[kMaxReturns] = {};
  const std::int64_t origin =
      -profile.first_bin_um / static_cast<std::int64_t>(max_of<std::uint32_t>(profile.bin_um, 1));
  int heard_bin = 0;
  const int count = choose_runs(window, config, origin, runs, heard_bin);
  if (count == 0) {
    return detection;
  }
  const Arrival first = arrival_of(profile, window, runs[0], config.detection_fraction_q16);
  detection.range_um = first.range_um;
  detection.found = true;
  detection.clear_um = profile.first_bin_um + static_cast<std::int64_t>(profile.bin_um) * heard_bin;
  detection.quality = quality_of(window, runs[0]);
  detection.peak_q8 = static_cast<std::uint32_t>(runs[0].peak_q8);
  detection.energy_q8 = static_cast<std::uint64_t>(first.energy_q8);
  for (int i = 1; i < count; ++i) {
    detection.behind[i - 1] = {
        arrival_of(profile, window, runs[i], config.detection_fraction_q16).range_um,
        quality_of(window, runs[i])};
  }
  detection.behind_count = static_cast<std::uint8_t>(count - 1);
  return detection;
}

}  // namespace leadline::model
