#include "firmware/config/m7_load.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>

#include "firmware/config/m7_prices.hpp"
#include "firmware/pipeline/mount_pose.hpp"
#include "hal/heads/cerulean.hpp"
#include "hal/heads/deltat83p.hpp"
#include "hal/heads/kongsberg.hpp"
#include "hal/heads/ping360.hpp"
#include "hal/heads/r2sonic.hpp"
#include "hal/heads/wl3d.hpp"
#include "model/event.hpp"
#include "model/model.hpp"

namespace leadline::host {
namespace {

using base::Bam32;
using firmware::Driver;
using firmware::PortConfig;
using firmware::VehicleConfig;
using model::TileId;

constexpr double kSpeed_m_s = 1.5;
constexpr double kSound_m_s = 1500;
constexpr double kFastest_hz = 50;
constexpr double kTile_columns = model::kTileCells * model::kTileCells;

/// Where a beam looks in its mount's frame.
struct Beam {
  double azimuth_deg, elevation_deg;
};

Bam32 bam(double deg) {
  return static_cast<Bam32>(static_cast<std::int64_t>(std::llround(deg / 360.0 * 4294967296.0)));
}

/// Whether all of a head's directions are heard at once, from one transmission.
bool is_array(const PortConfig& port) {
  const auto chosen = static_cast<hal::CeruleanHead>(std::max(port.variant_plus_1 - 1, 0));
  const bool single =
      port.driver == Driver::kCerulean &&
      (chosen == hal::CeruleanHead::kS500 || chosen == hal::CeruleanHead::kOmniscan450);
  return firmware::array_face(port.driver) != firmware::ArrayFace::kNone && !single;
}

/// Beams of one transmission, at most.
double most_beams_of(const PortConfig& port) {
  if (!is_array(port)) {
    return 1;
  }
  switch (port.driver) {
    case Driver::kCerulean:
      return static_cast<double>(hal::kMaxCeruleanPoints);
    case Driver::kDeltat83p:
      return static_cast<double>(hal::kMaxDeltatBeams);
    case Driver::kR2sonic:
      return static_cast<double>(hal::kMaxR2SonicBeams);
    case Driver::kKongsberg:
      return static_cast<double>(hal::kMaxKongsbergBeams);
    default:
      return static_cast<double>(hal::kMaxWl3dPixels);
  }
}

/// Directions that stand for all of a head's.
std::vector<Beam> directions(const PortConfig& port) {
  std::vector<Beam> beams;
  const firmware::ArrayFace face = firmware::array_face(port.driver);
  if (face == firmware::ArrayFace::kDown && is_array(port)) {
    for (int across_deg = -60; across_deg <= 60; across_deg += 10) {
      beams.push_back({across_deg < 0 ? -90.0 : 90.0, 90.0 - std::abs(across_deg)});
    }
  } else if (face == firmware::ArrayFace::kForward) {
    for (int across_deg = -45; across_deg <= 45; across_deg += 9) {
      beams.push_back({static_cast<double>(across_deg), 0});
    }
  } else if (face == firmware::ArrayFace::kDown || port.driver == Driver::kPing1d) {
    beams.push_back({0, 90});
  } else {
    // Scanners: in the plane of the mount's forward and right axes.
    constexpr double kStep_deg = 15;
    double first_deg = -180;
    double last_deg = 180 - kStep_deg;
    if (port.driver == Driver::kPing360) {
      constexpr int kForward_grad = 200;
      const int span_grad = (port.scan_last_grad - port.scan_first_grad + hal::kPing360Turn_grad) %
                            hal::kPing360Turn_grad;
      first_deg = 0.9 * (port.scan_first_grad - kForward_grad);
      last_deg = first_deg + 0.9 * span_grad;
    }
    for (double at_deg = first_deg; at_deg <= last_deg; at_deg += kStep_deg) {
      beams.push_back({at_deg, 0});
    }
  }
  return beams;
}

/// A set of tiles by number.
using Tiles = std::vector<bool>;

/// Columns that a pass over `touched` works on.
struct PassColumns {
  double read = 0;
  double smoothed = 0;
  double assessed = 0;

  [[nodiscard]] double all() const { return read + smoothed + assessed; }
  [[nodiscard]] double instructions(std::int32_t depth_cells) const {
    const m7::UsualColumn& price = m7::kUsualColumn;
    return read * (price.read + price.read_cell * depth_cells) + smoothed * price.smoothed +
           assessed * (price.assessed + price.compared);
  }
};

PassColumns columns_of(const Tiles& touched, const model::Grid& grid) {
  const std::int32_t rows = grid.tiles_north();
  const std::int32_t columns = grid.tiles_east();
  const auto any_within = [&](std::int32_t row, std::int32_t column, std::int32_t reach) {
    for (std::int32_t n = std::max(row - reach, 0); n <= std::min(row + reach, rows - 1); ++n) {
      for (std::int32_t e = std::max(column - reach, 0); e <= std::min(column + reach, columns - 1);
           ++e) {
        if (touched[static_cast<std::size_t>(n * columns + e)]) {
          return true;
        }
      }
    }
    return false;
  };
  // Of a tile beside one that changed, smoothing looks three columns deep.
  constexpr double kBeside_columns = 3.0 * model::kTileCells;
  PassColumns out;
  for (std::int32_t row = 0; row < rows; ++row) {
    for (std::int32_t column = 0; column < columns; ++column) {
      const bool own = touched[static_cast<std::size_t>(row * columns + column)];
      out.read += own ? kTile_columns : 0;
      out.smoothed += own ? kTile_columns : (any_within(row, column, 1) ? kBeside_columns : 0);
      out.assessed += any_within(row, column, model::Model::kInfluenceTiles) ? kTile_columns : 0;
    }
  }
  return out;
}

/// A head's pings, flown over the middle of the map by a model of their own.
class Trial {
 public:
  Trial(const VehicleConfig& config, const std::vector<model::LocalizationTable>& tables,
        const PortConfig& port)
      : config_(config),
        port_(port),
        mount_(config.mounts[port.mount]),
        beams_(directions(port)),
        model_(new model::Model) {
    // Not make_unique(): it writes zeros over what configure() clears, as far as that is used.
    const model::LocalizationTable& table = tables[mount_.table];
    usable_ = model_->configure(config.model, &table, sizeof table) == base::Status::kOk;
    const model::ModelConfig& grid = config.model;
    bottom_m_ =
        static_cast<double>(grid.origin_mm[2] + std::int64_t{grid.size[2] - 1} * grid.cell_mm) *
        1e-3;
    altitude_m_ = bottom_m_ > 0 ? std::min(bottom_m_, longest_m()) : longest_m();
    // The side records of what it flies over say how deep it is, as after some pings.
    constexpr int kBefore = 2;
    for (int i = 0; usable_ && i < kBefore; ++i) {
      fly(0);
    }
  }

  /// Transmissions a second.
  [[nodiscard]] double rate_hz() const {
    const double fastest_hz = std::min(kFastest_hz, kSound_m_s / (2 * altitude_m_));
    return port_.ping_interval_us > 0 ? std::min(1e6 / port_.ping_interval_us, fastest_hz)
                                      : fastest_hz;
  }
  /// One ping in every direction, `along_m` north of the middle.
  void fly(double along_m) {
    for (const Beam& beam : beams_) {
      (void)ping(beam, along_m);
    }
  }
  /// Tiles that were touched since it was asked last.
  Tiles touched() {
    Tiles tiles(model_->grid().tile_count(), false);
    TileId tile = 0;
    while (model_->take_touched_tile(tile)) {
      tiles[tile] = true;
    }
    return tiles;
  }
  [[nodiscard]] bool usable() const { return usable_; }
  [[nodiscard]] bool array() const { return is_array(port_); }
  [[nodiscard]] double most_beams() const { return most_beams_of(port_); }
  [[nodiscard]] const model::Grid& grid() const { return model_->grid(); }
  [[nodiscard]] const std::vector<Beam>& beams() const { return beams_; }

  /// Columns that the shells of so many beams change, with those whose smoothing looks at them, while the vehicle goes
  /// `way_cells`: discs drawn out, none upon another.
  [[nodiscard]] double changed_columns(double beams, double way_cells) const {
    constexpr double kPi = 3.14159265358979323846;
    constexpr double kLooks_cells = 3;
    const double radius = std::sqrt(shell_columns_ / pings_ / kPi) + kLooks_cells;
    return beams * (kPi * radius * radius + 2 * radius * way_cells);
  }

  double ping(const Beam& beam, double along_m) {
    const model::ModelConfig& grid = config_.model;
    base::Pose vehicle{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      vehicle.position_um[axis] =
          1000 * grid.origin_mm[axis] + std::int64_t{500} * grid.cell_mm * grid.size[axis];
    }
    vehicle.position_um[0] += std::llround(along_m * 1e6);
    vehicle.position_um[2] = std::llround((bottom_m_ - altitude_m_) * 1e6);
    vehicle.validity = base::kPoseAll;
    const base::Pose pose = firmware::pose_of_mount(vehicle, mount_);
    base::Ping ping{};
    ping.azimuth_bam32 = bam(beam.azimuth_deg);
    ping.elevation_bam32 = bam(beam.elevation_deg);
    ping.kind = base::ReturnKind::kRange;
    ping.quality = 255;
    const double down =
        model::beam_frame(pose.attitude, ping.azimuth_bam32, ping.elevation_bam32, 0).axis.q30[2] /
        1073741824.0;
    const double range_m = down * longest_m() > altitude_m_ ? altitude_m_ / down : longest_m();
    ping.range_um = std::llround(range_m * 1e6);
    (void)model_->integrate(ping, pose);
    shell_columns_ += model_->last_work().shell_columns;
    ++pings_;
    return m7::kUsualPing * m7_ping_instructions(model_->last_work(), grid.size[2]);
  }

 private:
  [[nodiscard]] double longest_m() const {
    return static_cast<double>(std::min(config_.model.max_range_um, port_.max_range_um)) * 1e-6;
  }

  const VehicleConfig& config_;
  const PortConfig& port_;
  const firmware::MountConfig& mount_;
  std::vector<Beam> beams_;
  std::unique_ptr<model::Model> model_;
  double bottom_m_ = 0;  // down from the survey's origin
  double altitude_m_ = 0;
  double shell_columns_ = 0;  // of all pings
  double pings_ = 0;
  bool usable_ = false;
};

void add_tiles(const Tiles& more, Tiles* tiles) {
  tiles->resize(more.size(), false);
  for (std::size_t i = 0; i < more.size(); ++i) {
    (*tiles)[i] = (*tiles)[i] || more[i];
  }
}

/// What the heads of a vehicle come to together.
class Sums {
 public:
  Sums(const VehicleConfig& config, base::TimeUs cycle_us)
      : config_(config),
        cycles_s_(1e6 / static_cast<double>(cycle_us)),
        interval_s_(config.extract_interval_us * 1e-6),
        cell_m_(config.model.cell_mm * 1e-3),
        budget_columns_(config.cycle_tile_budget * kTile_columns) {}

  void add(Trial& trial, int beams) {
    const double heard = trial.array() && beams > 0 ? beams : trial.most_beams();
    const double pings_s = trial.rate_hz() * heard;
    load_.pings_s += pings_s;
    // What one transmission touches: all beams of an array, one of a scanner.
    (void)trial.touched();
    PassColumns mean;
    double parts = 0;
    for (const Beam& beam : trial.beams()) {
      load_.pings += pings_s * trial.ping(beam, 0) / static_cast<double>(trial.beams().size());
      if (!trial.array() || &beam == &trial.beams().back()) {
        const PassColumns columns = columns_of(trial.touched(), trial.grid());
        mean.read += columns.read;
        mean.smoothed += columns.smoothed;
        mean.assessed += columns.assessed;
        ++parts;
      }
    }
    const double cycles_a_ping = std::max(1.0, cycles_s_ / trial.rate_hz());
    mean.read /= parts;
    mean.smoothed = std::min(mean.smoothed / parts, trial.changed_columns(heard, 0));
    mean.assessed = std::min(mean.assessed / parts, budget_columns_ * cycles_a_ping);
    const double rate_hz = std::min(trial.rate_hz(), cycles_s_);
    at_once_ += rate_hz * mean.instructions(config_.model.size[2]);
    assessed_s_ += rate_hz * mean.assessed;
    // How wide a strip of new cells the head leaves behind: its tiles' side, and some that change again.
    constexpr double kTimes = 1.2;
    new_cells_s_ += kTimes * std::sqrt(mean.read) * kSpeed_m_s / cell_m_;

    // And all that a pass finds.
    constexpr int kSteps = 8;
    for (int step = 0; step < kSteps; ++step) {
      trial.fly(interval_s_ * kSpeed_m_s * step / (kSteps - 1));
    }
    add_tiles(trial.touched(), &pass_);
    const double ways = trial.array() ? heard
                                      : std::min(static_cast<double>(trial.beams().size()),
                                                 trial.rate_hz() * interval_s_);
    changed_ += trial.changed_columns(std::max(ways, 1.0), interval_s_ * kSpeed_m_s / cell_m_);
    pass_columns_ = columns_of(pass_, trial.grid());
    pass_columns_.smoothed = std::min(pass_columns_.smoothed, changed_);
  }

  [[nodiscard]] M7Load load() const {
    M7Load load = load_;
    if (interval_s_ > 0) {
      // Passes begin the interval apart, or one after the other; 1,024 columns a cycle for each tile of the budget.
      const double pass_s =
          std::max(interval_s_, pass_columns_.all() / (4 * budget_columns_) / cycles_s_);
      load.extraction = pass_columns_.instructions(config_.model.size[2]) / pass_s;
    } else {
      // Several heads share the budget of a cycle.
      const double over = std::max(0.0, assessed_s_ - budget_columns_ * cycles_s_);
      load.extraction = at_once_ - over * (m7::kUsualColumn.assessed + m7::kUsualColumn.compared);
    }
    load.rest = cycles_s_ * m7::kUsualCycle +
                std::min<double>(config_.link.rate_bytes_s, new_cells_s_) * m7::kDeltaByte;
    return load;
  }

 private:
  const VehicleConfig& config_;
  double cycles_s_;
  double interval_s_;
  double cell_m_;
  double budget_columns_;
  M7Load load_;
  Tiles pass_;  // that pings of an interval touch
  PassColumns pass_columns_;
  double changed_ = 0;     // columns of an interval
  double at_once_ = 0;     // instructions a second, where every cycle extracts
  double assessed_s_ = 0;  // columns a second of them
  double new_cells_s_ = 0;
};

}  // namespace

double m7_ping_instructions(const model::PingWork& work, std::int32_t depth_cells) {
  const m7::PingPrices& price = m7::kPingPrices;
  return price.fixed + work.columns_read * (price.column_read + price.cell_read * depth_cells) +
         price.shell_row * work.shell_rows + price.shell_candidate * work.shell_candidates +
         price.shell_column * work.shell_columns + price.shell_voxel * work.shell_voxels +
         price.cone_row * work.cone_rows + price.cone_candidate * work.cone_candidates +
         price.cone_column * work.cone_columns + price.cone_run * work.cone_runs +
         price.cone_voxel * work.cone_voxels;
}

M7Load m7_load(const VehicleConfig& config, base::TimeUs cycle_us,
               const std::vector<model::LocalizationTable>& tables, int beams) {
  Sums sums(config, cycle_us);
  for (int i = 0; i < config.port_count; ++i) {
    if (firmware::is_head(config.ports[i].driver)) {
      Trial trial(config, tables, config.ports[i]);
      if (trial.usable()) {
        sums.add(trial, beams);
      }
    }
  }
  return sums.load();
}

std::vector<std::string> set_m7_defaults(VehicleFile* file) {
  std::vector<std::string> set;
  if (!file->extract_interval_given) {
    file->config.extract_interval_us = kM7ExtractInterval_us;
    set.emplace_back("extract_interval_s = 1.5");
  }
  if (!file->tile_budget_given) {
    file->config.cycle_tile_budget = kM7TileBudget;
    set.emplace_back("tile_budget = 1");
  }
  return set;
}

std::string m7_load_text(const M7Load& load) {
  const auto percent = [](double instructions_s) {
    return 100 * instructions_s / kM7Instructions_s;
  };
  std::array<char, 200> text{};
  static_cast<void>(std::snprintf(
      text.data(), text.size(),
      "%.1f %% of a Cortex-M7's 480 million instructions a second by estimate: %.0f beams a second "
      "%.1f %%, depths %.1f %%, all else %.1f %%",
      percent(load.pings + load.extraction + load.rest), load.pings_s, percent(load.pings),
      percent(load.extraction), percent(load.rest)));
  return text.data();
}

std::string m7_pass_text(const firmware::VehicleConfig& config, base::TimeUs cycle_us) {
  if (config.extract_interval_us == 0) {
    return "";
  }
  const auto tiles = [](std::int32_t cells) {
    return static_cast<std::uint32_t>((cells + model::kTileCells - 1) / model::kTileCells);
  };
  const model::ModelConfig& grid = config.model;
  const auto most = static_cast<double>(
      m7::pass_cycle_bound(config.cycle_tile_budget, static_cast<std::uint32_t>(grid.size[2]),
                           tiles(grid.size[0]) * tiles(grid.size[1])));
  std::array<char, 160> text{};
  static_cast<void>(std::snprintf(
      text.data(), text.size(),
      "a pass of depths takes at most %.1f million instructions of a cycle, which has %.1f million",
      most * 1e-6, static_cast<double>(cycle_us) * kM7Instructions_s * 1e-12));
  return text.data();
}

std::string m7_load_warning(const firmware::VehicleConfig& config, base::TimeUs cycle_us,
                            const std::vector<model::LocalizationTable>& tables, int beams,
                            const M7Load& load) {
  if (load.share() <= kM7Share) {
    return "";
  }
  std::string text = "more than the " + std::to_string(std::lround(100 * kM7Share)) +
                     " % that leave room for wait states of its memory";
  VehicleConfig other = config;
  other.extract_interval_us = kM7ExtractInterval_us;
  other.cycle_tile_budget = kM7TileBudget;
  const M7Load then = m7_load(other, cycle_us, tables, beams);
  constexpr double kWorthwhile = 0.8;
  if (then.share() < kWorthwhile * load.share()) {
    text +=
        "; [cycle] extract_interval_s = 1.5 and tile_budget = 1 would make " + m7_load_text(then);
  }
  if (then.share() > kM7Share) {
    text += then.pings > then.extraction
                ? "; fewer pings (interval_ms), shorter ranges or larger cells make less"
                : "; a longer extract_interval_s, a longer period_ms or larger cells make less";
  }
  return text;
}

}  // namespace leadline::host
