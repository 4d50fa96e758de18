// Error of the topside's map against time over a bad line, beside grids that are sent round and round.
//
// usage: link_curve LOG OUT   (as `leadline link-sim`: the log is replayed to its end, then the map stands still and is
// sent to a topside that has none; 30 % of the frames lost, 5 % late, 5 % doubled, seeds 1 to 5)
//
//   ours    the vehicle's link code and the topside's receiver: depth, sigma and flags of every cell, reports, statuses
//   coarse  the same, with coarse tiles before those that would have to wait (the flight's coarse_wait_s; 5 s where it has
//           none); a coarse cell counts in place of cells that have not come
//   int16   a grid of 16-bit depths, row by row, as many cells in a frame as it has room for, and again from the
//           beginning until every cell came: nothing goes up
//   zstd    the same; of the cells of a frame, each coded as the difference to the one before it, as many as zstd -19
//           brings into the frame
//
// Frames are as long as the vehicle's longest at that rate, around the cells 11 bytes: the frame's 7 and where the
// cells begin. All three meet the same losses: what becomes of the n-th frame hangs on seed and n alone. Error: root of
// the mean square over the cells that the vehicle knows; a cell that has not come counts with the mean depth of all.
//
// Leaves OUT/link-curves.csv and OUT/link-curves.png, prints a table: seconds until the error is a half, a tenth, a
// hundredth of what it was, and until it is none (mean of the seeds).
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <zstd.h>

#include "host_tools/render/canvas.hpp"
#include "host_tools/topside/flight_log.hpp"
#include "host_tools/topside/host_vehicle.hpp"
#include "host_tools/topside/link_trial.hpp"
#include "host_tools/topside/lossy_line.hpp"
#include "host_tools/topside/replay.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::Vehicle;
using leadline::host::LinkTrialOptions;
using leadline::host::LossyLine;
using leadline::host::Receiver;

constexpr std::array<double, 4> kBauds = {1200.0, 9600.0, 115'200.0, 1'000'000.0};
constexpr int kSeeds = 5;
constexpr std::size_t kSamples = 400;
constexpr std::size_t kOverhead_bytes = 11;
constexpr TimeUs kCycle_us = 20'000;
constexpr std::array<double, 4> kShares = {0.5, 0.1, 0.01, 0.0};
constexpr std::array<const char*, 4> kWays = {"coarse", "ours", "int16", "zstd"};
constexpr std::uint32_t kCoarseWait_us = 5'000'000;

/// Depths of the whole grid, row by row, in cells; NaN where the vehicle knows none.
using Depths = std::vector<double>;

struct Step {
  double seconds;
  double rms_cells;
};
/// From time 0 on; the error falls at its steps.
using Curve = std::vector<Step>;

struct Grid {
  std::int32_t north = 0;
  std::int32_t east = 0;
  std::int32_t tiles_east = 0;

  [[nodiscard]] std::size_t tile(std::size_t cell) const {
    const auto n = static_cast<std::int32_t>(cell) / east;
    const auto e = static_cast<std::int32_t>(cell) % east;
    return static_cast<std::size_t>(n / 16 * tiles_east + e / 16);
  }
  [[nodiscard]] std::size_t in_tile(std::size_t cell) const {
    const auto n = static_cast<std::int32_t>(cell) / east;
    const auto e = static_cast<std::int32_t>(cell) % east;
    return static_cast<std::size_t>(n % 16 * 16 + e % 16);
  }
  [[nodiscard]] std::size_t cells() const {
    return static_cast<std::size_t>(north) * static_cast<std::size_t>(east);
  }
};

double depth_of(leadline::proto::CodedCell cell) {
  return leadline::proto::cell_known(cell) ? leadline::proto::cell_depth_q8(cell) / 256.0 : NAN;
}

/// Sum of squares over what is known of `truth`, kept up to date cell by cell.
class Error {
 public:
  explicit Error(const Depths& truth) : truth_(truth) {
    double sum = 0.0;
    for (const double depth : truth_) {
      sum += std::isnan(depth) ? 0.0 : depth;
      known_ += std::isnan(depth) ? 0.0 : 1.0;
    }
    mean_ = sum / known_;
    squares_.assign(truth_.size(), 0.0);
    for (std::size_t cell = 0; cell < truth_.size(); ++cell) {
      set(cell, NAN);
    }
  }
  void set(std::size_t cell, double depth) {
    if (std::isnan(truth_[cell])) {
      return;
    }
    const double off = (std::isnan(depth) ? mean_ : depth) - truth_[cell];
    sum_ += off * off - squares_[cell];
    squares_[cell] = off * off;
  }
  [[nodiscard]] double rms() const { return std::sqrt(std::max(sum_, 0.0) / known_); }

 private:
  const Depths& truth_;
  std::vector<double> squares_;
  double known_ = 0.0;
  double mean_ = 0.0;
  double sum_ = 0.0;
};

/// A frame of a grid that goes round and round: cells first .. first + count - 1.
struct Part {
  std::size_t first;
  std::size_t count;
  std::size_t bytes;
};

std::vector<std::int16_t> int16_grid(const Depths& truth) {
  // Sixteenths of a cell: finer than what is known of nearly any cell.
  std::vector<std::int16_t> grid;
  for (const double depth : truth) {
    grid.push_back(std::isnan(depth) ? INT16_MIN
                                     : static_cast<std::int16_t>(std::lround(depth * 16.0)));
  }
  return grid;
}

std::vector<Part> raw_parts(const Depths& truth, std::size_t room_bytes) {
  std::vector<Part> parts;
  const std::size_t most = room_bytes / 2;
  for (std::size_t first = 0; first < truth.size(); first += most) {
    const std::size_t count = std::min(most, truth.size() - first);
    parts.push_back({first, count, 2 * count + kOverhead_bytes});
  }
  return parts;
}

std::size_t zstd_bytes(const std::vector<std::int16_t>& grid, std::size_t first,
                       std::size_t count) {
  std::vector<std::uint8_t> low;
  std::vector<std::uint8_t> high;
  std::int16_t before = 0;
  for (std::size_t cell = first; cell < first + count; ++cell) {
    const auto step = static_cast<std::uint16_t>(grid[cell] - before);
    before = grid[cell];
    low.push_back(static_cast<std::uint8_t>(step & 0xFFU));
    high.push_back(static_cast<std::uint8_t>(step >> 8U));
  }
  low.insert(low.end(), high.begin(), high.end());
  std::vector<std::uint8_t> out(ZSTD_compressBound(low.size()));
  return ZSTD_compress(out.data(), out.size(), low.data(), low.size(), 19);
}

std::vector<Part> zstd_parts(const Depths& truth, std::size_t room_bytes) {
  const std::vector<std::int16_t> grid = int16_grid(truth);
  std::vector<Part> parts;
  std::size_t first = 0;
  while (first < grid.size()) {
    // The most cells that fit, by halving: a cell more is nearly never a byte less.
    std::size_t fits = 1;
    std::size_t beyond = std::min(grid.size() - first, 8 * room_bytes) + 1;
    while (fits + 1 < beyond) {
      const std::size_t middle = (fits + beyond) / 2;
      (zstd_bytes(grid, first, middle) <= room_bytes ? fits : beyond) = middle;
    }
    parts.push_back({first, fits, zstd_bytes(grid, first, fits) + kOverhead_bytes});
    first += fits;
  }
  return parts;
}

/// The parts in their order, over and over, until all came.
Curve go_round(const std::vector<Part>& parts, const Depths& truth,
               const leadline::host::LineOptions& options) {
  Error error(truth);
  Curve curve = {{0.0, error.rms()}};
  LossyLine line(options, 0);
  std::vector<bool> came(parts.size(), false);
  std::size_t left = parts.size();
  std::size_t next = 0;
  double free_us = 0.0;
  while (left > 0) {
    // The frame's number in its first bytes tells who came.
    std::vector<std::uint8_t> frame(parts[next].bytes);
    for (unsigned k = 0; k < 4; ++k) {
      frame[k] = static_cast<std::uint8_t>(next >> (8U * k));
    }
    static_cast<void>(line.send(static_cast<TimeUs>(free_us), frame.data(), frame.size(), false));
    free_us += 1e6 * static_cast<double>(frame.size()) / options.bytes_per_s;
    next = (next + 1) % parts.size();
    while (auto arrived = line.receive(static_cast<TimeUs>(free_us))) {
      std::size_t number = 0;
      for (unsigned k = 0; k < 4; ++k) {
        number |= std::size_t{arrived->second[k]} << (8U * k);
      }
      if (came[number]) {
        continue;
      }
      came[number] = true;
      left -= 1;
      for (std::size_t cell = parts[number].first; cell < parts[number].first + parts[number].count;
           ++cell) {
        error.set(cell, truth[cell]);
      }
      curve.push_back({1e-6 * static_cast<double>(arrived->first), error.rms()});
    }
  }
  return curve;
}

Curve fly(Vehicle* vehicle, TimeUs* t_us, const LinkTrialOptions& trial, const Depths& truth,
          const Grid& grid) {
  Error error(truth);
  Curve curve = {{0.0, error.rms()}};
  std::uint64_t seen = 0;
  std::uint64_t seen_coarse = 0;
  const auto watch = [&](TimeUs since_us, const Receiver& receiver) {
    if (receiver.store() == nullptr) {
      return;
    }
    std::vector<std::uint32_t> changed = receiver.store()->changed_since(seen);
    for (const std::uint32_t tile : receiver.coarse().changed_since(seen_coarse)) {
      changed.push_back(tile);
    }
    for (const std::uint32_t tile : changed) {
      const auto view = receiver.store()->tile(tile);
      const auto* const coarse = receiver.coarse().tile(tile);
      const std::size_t n0 = tile / static_cast<std::uint32_t>(grid.tiles_east) * 16;
      const std::size_t e0 = tile % static_cast<std::uint32_t>(grid.tiles_east) * 16;
      for (std::size_t k = 0; k < 256; ++k) {
        const std::size_t n = n0 + k / 16;
        const std::size_t e = e0 + k % 16;
        if (n < static_cast<std::size_t>(grid.north) && e < static_cast<std::size_t>(grid.east)) {
          const double fine = view ? depth_of(view->cells[k]) : NAN;
          const bool stands_in = std::isnan(fine) && coarse != nullptr;
          error.set(n * static_cast<std::size_t>(grid.east) + e,
                    stands_in ? depth_of((*coarse)[k / 64 * 4 + k % 16 / 4]) : fine);
        }
      }
    }
    seen = receiver.store()->sequence();
    seen_coarse = receiver.coarse().sequence();
    curve.push_back({1e-6 * static_cast<double>(since_us), error.rms()});
  };
  const auto result = run_link_trial(vehicle, t_us, trial, watch);
  if (!result.converged) {
    throw std::runtime_error("the maps did not become equal");
  }
  return curve;
}

/// What the vehicle knows at the end of a flight.
struct Truth {
  Grid grid;
  Depths depths;
};

/// Curves of a vehicle with that configuration, one a trial; and what it knows. (There is one vehicle at a time.)
std::vector<Curve> fly_all(const std::string& log_path,
                           const leadline::firmware::VehicleConfig& config,
                           const std::vector<LinkTrialOptions>& trials, Truth* truth) {
  leadline::host::FlightLog log(log_path);
  const leadline::host::HostVehicle vehicle(config, log.tables(), log_path);
  TimeUs t_us = replay_flight(&log, &*vehicle, nullptr).now.t_us;
  leadline::host::settle_vehicle(&*vehicle, &t_us, kCycle_us);
  truth->grid = {config.model.size[0], config.model.size[1], vehicle->model().grid().tiles_east()};
  truth->depths.clear();
  for (std::size_t cell = 0; cell < truth->grid.cells(); ++cell) {
    const auto tile = static_cast<std::uint32_t>(truth->grid.tile(cell));
    truth->depths.push_back(depth_of(vehicle->link_cells(tile)[truth->grid.in_tile(cell)]));
  }
  std::vector<Curve> curves;
  for (const LinkTrialOptions& trial : trials) {
    curves.push_back(fly(&*vehicle, &t_us, trial, truth->depths, truth->grid));
    leadline::host::settle_vehicle(&*vehicle, &t_us, kCycle_us);
  }
  return curves;
}

double seconds_to(const Curve& curve, double rms_cells) {
  for (const Step& step : curve) {
    if (step.rms_cells <= rms_cells + 1e-9) {
      return step.seconds;
    }
  }
  return curve.back().seconds;
}

double rms_at(const Curve& curve, double seconds) {
  double rms = curve.front().rms_cells;
  for (const Step& step : curve) {
    if (step.seconds > seconds) {
      break;
    }
    rms = step.rms_cells;
  }
  return rms;
}

/// Mean of the seeds at kSamples moments from 0 to `end_s`.
struct Sampled {
  double end_s = 0.0;
  std::array<std::array<double, kSamples>, kWays.size()> rms_m{};
};

void draw(const std::vector<Sampled>& all, double highest_m, const std::string& path) {
  namespace render = leadline::host::render;
  constexpr std::array<render::Colour, kWays.size()> kColours = {
      render::Colour{0.05, 0.35, 0.65}, render::Colour{0.10, 0.60, 0.80},
      render::Colour{0.75, 0.30, 0.10}, render::Colour{0.25, 0.55, 0.25}};
  render::Canvas canvas(1600, 1100);
  const auto seconds_text = [](double baud) {
    return leadline::host::render::tick_label(baud, 0) + " baud";
  };
  for (std::size_t panel = 0; panel < all.size(); ++panel) {
    const render::Rectangle frame = {panel % 2 == 0 ? 110.0 : 900.0, panel < 2 ? 90.0 : 620.0,
                                     650.0, 380.0};
    render::draw_axes(&canvas, frame, {0.0, all[panel].end_s, "seconds"},
                      {0.0, highest_m, "error of the map, m"}, 1.0);
    canvas.text(seconds_text(kBauds[panel]), frame.x, frame.y - 14.0, 22.0, render::Align::kLeft,
                true);
    for (std::size_t way = 0; way < kWays.size(); ++way) {
      canvas.set_colour(kColours[way]);
      cairo_t* const cairo = canvas.cairo();
      cairo_set_line_width(cairo, 3.0);
      for (std::size_t k = 0; k < kSamples; ++k) {
        const double x = frame.x + frame.width * static_cast<double>(k) / (kSamples - 1);
        const double y = frame.bottom() - frame.height * all[panel].rms_m[way][k] / highest_m;
        k == 0 ? cairo_move_to(cairo, x, y) : cairo_line_to(cairo, x, y);
      }
      cairo_stroke(cairo);
      const double y = frame.y + 34.0 + 30.0 * static_cast<double>(way);
      canvas.line(frame.right() - 150.0, y - 6.0, frame.right() - 110.0, y - 6.0, 4.0);
      canvas.set_colour(render::kInkColour);
      canvas.text(kWays[way], frame.right() - 100.0, y, 20.0);
    }
  }
  std::ofstream(path, std::ios::binary) << canvas.png();
}

int run(const std::string& log_path, const std::string& out_dir) {
  std::filesystem::create_directories(out_dir);
  std::ofstream csv(out_dir + "/link-curves.csv");
  csv << "baud,seconds,coarse_m,ours_m,int16_m,zstd_m\n";
  std::vector<Sampled> all;
  double highest_m = 0.0;
  std::printf("seconds until the error is a half, a tenth, a hundredth, none of what it was\n");
  for (const double baud : kBauds) {
    leadline::firmware::VehicleConfig config = leadline::host::FlightLog(log_path).config();
    config.link.rate_bytes_s = static_cast<std::uint32_t>(baud / 10.0);
    if (config.link.coarse_wait_us == 0) {
      config.link.coarse_wait_us = kCoarseWait_us;
    }
    std::vector<LinkTrialOptions> trials(kSeeds);
    for (int seed = 1; seed <= kSeeds; ++seed) {
      LinkTrialOptions& trial = trials[static_cast<std::size_t>(seed - 1)];
      trial.cycle_us = kCycle_us;
      trial.line.bytes_per_s = baud / 10.0;
      trial.line.loss = 0.3;
      trial.line.reorder = 0.05;
      trial.line.duplicate = 0.05;
      trial.line.seed = static_cast<std::uint64_t>(seed);
    }
    Truth flown;
    std::array<std::vector<Curve>, kWays.size()> curves;
    curves[0] = fly_all(log_path, config, trials, &flown);
    config.link.coarse_wait_us = 0;
    curves[1] = fly_all(log_path, config, trials, &flown);
    const Depths& truth = flown.depths;
    leadline::firmware::Downlink bucket;
    bucket.configure(config.link.rate_bytes_s, config.link.mtu_bytes);
    const std::size_t room_bytes = bucket.longest_frame_bytes() - kOverhead_bytes;
    const std::array<std::vector<Part>, 2> parts = {raw_parts(truth, room_bytes),
                                                    zstd_parts(truth, room_bytes)};
    for (const LinkTrialOptions& trial : trials) {
      curves[2].push_back(go_round(parts[0], truth, trial.line));
      curves[3].push_back(go_round(parts[1], truth, trial.line));
    }
    const double first_cells = curves[0][0].front().rms_cells;
    const double cell_m = config.model.cell_mm / 1000.0;
    highest_m = std::max(highest_m, 1.05 * first_cells * cell_m);
    std::printf("%-8.0f", baud);
    Sampled sampled;
    for (std::size_t way = 0; way < kWays.size(); ++way) {
      std::printf("  %s", kWays[way]);
      for (const double share : kShares) {
        double sum = 0.0;
        for (const Curve& curve : curves[way]) {
          sum += seconds_to(curve, share * first_cells);
        }
        std::printf(" %.3g", sum / kSeeds);
      }
      for (const Curve& curve : curves[way]) {
        // The slowest two are seen to their last tenth.
        sampled.end_s = std::max(sampled.end_s, seconds_to(curve, 0.1 * first_cells));
      }
    }
    std::printf("\n");
    for (std::size_t k = 0; k < kSamples; ++k) {
      const double seconds = sampled.end_s * static_cast<double>(k) / (kSamples - 1);
      csv << baud << ',' << seconds;
      for (std::size_t way = 0; way < kWays.size(); ++way) {
        for (const Curve& curve : curves[way]) {
          sampled.rms_m[way][k] += rms_at(curve, seconds) * cell_m / kSeeds;
        }
        csv << ',' << sampled.rms_m[way][k];
      }
      csv << '\n';
    }
    all.push_back(sampled);
  }
  draw(all, highest_m, out_dir + "/link-curves.png");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: link_curve LOG OUT\n");
    return 2;
  }
  try {
    return run(argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "link_curve: %s\n", error.what());
    return 1;
  }
}
