#include "tests/support/plain_table.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "model/capacity.hpp"

namespace leadline::test {
namespace {

using namespace leadline::model;  // NOLINT: everything here is about its records

std::uint32_t fixed(double value, int bits) {
  return static_cast<std::uint32_t>(std::lround(std::ldexp(value, bits)));
}

// Gaussian at the voxel centres within the cut, tilted until its first moment vanishes (bisection),
// then rounded so that the sum is exact; what rounding leaves goes to the largest tap.
void fill_kernel_row(int level, int phase_index, LocalizationTable* table) {
  const double variance = 0.25 * std::pow(2.0, level / 4.0);
  const double cut = std::max(1.5, std::min(2.0 * std::sqrt(variance), 7.0));
  const double phase = (phase_index + 0.5) / kKernelPhases;
  double taps[kKernelTaps] = {};
  int first = kKernelTaps;
  int last = 0;
  double low = -20.0;
  double high = 20.0;
  for (int step = 0; step < 100; ++step) {
    const double tilt = 0.5 * (low + high);
    double sum = 0.0;
    double moment = 0.0;
    for (int tap = 0; tap < kKernelTaps; ++tap) {
      const double x = tap - 6.5 - phase;
      taps[tap] = 0.0;
      if (std::fabs(x) <= cut) {
        taps[tap] = std::exp(-x * x / (2.0 * variance) + tilt * x);
        first = std::min(first, tap);
        last = std::max(last, tap);
      }
      sum += taps[tap];
      moment += taps[tap] * x;
    }
    for (double& tap : taps) {
      tap /= sum;
    }
    (moment > 0.0 ? high : low) = tilt;
  }
  auto& row = table->kernel_q15[level][phase_index];
  int rest = kKernelSum;
  int largest = first;
  for (int tap = first; tap <= last; ++tap) {
    row[tap] = static_cast<std::int16_t>(std::lround(taps[tap] * kKernelSum));
    rest -= row[tap];
    largest = row[tap] > row[largest] ? tap : largest;
  }
  row[largest] = static_cast<std::int16_t>(row[largest] + rest);
  table->kernel_first[level][phase_index] = static_cast<std::uint8_t>(first);
  table->kernel_count[level][phase_index] = static_cast<std::uint8_t>(last - first + 1);
}

void fill_axis(double half_angle_rad, int axis, LocalizationTable* table) {
  const double tangent = std::tan(half_angle_rad);
  const double variance = tangent * tangent / 6.0;  // of 1 - x over the disc, per axis
  if (axis == 0) {
    table->tan_envelope_along_q24 = fixed(tangent, 24);
    table->beam_variance_along_q30 = fixed(variance, 30);
  }
  if (axis == 1) {
    table->tan_envelope_across_q24 = fixed(tangent, 24);
    table->beam_variance_across_q30 = fixed(variance, 30);
  }
  for (int k = 0; k <= kIncidenceSteps; ++k) {
    const double sine = static_cast<double>(k) / kIncidenceSteps;
    FirstReturnEntry& entry = table->first_return[axis][k];
    entry.slope_q20 = static_cast<std::int32_t>(std::lround(-sine * 0x1.0p20));
    entry.patch_variance_q30 = fixed(variance, 30);
  }
  for (auto& profile : table->profile_q15[axis]) {
    for (int j = 0; j < kProfileSteps + 4; ++j) {
      const double m2 = static_cast<double>(j) / kProfileSteps * kProfileCut2_q8 / 256.0;
      profile[j] = static_cast<std::uint16_t>(std::lround(32767.0 * std::exp(-m2 / 2.0)));
    }
  }
  for (int j = 0; j <= kBeamWeightSteps; ++j) {
    table->beam_weight_q15[axis][j] = static_cast<std::uint16_t>(
        std::lround(32767.0 * (1.0 - static_cast<double>(j) / kBeamWeightSteps)));
  }
}

}  // namespace

LocalizationTable plain_table(const PlainBeam& beam) {
  LocalizationTable table;
  std::memset(&table, 0, sizeof(table));
  table.magic = kTableMagic;
  table.version = kTableVersion;
  table.size_bytes = sizeof(table);
  table.beam_kind = beam.two_axis ? BeamKind::kRectangle : BeamKind::kCone;
  table.two_axis = beam.two_axis ? 1 : 0;
  table.detection_fraction_q16 = 6554;
  const double tan_pointing = std::tan(beam.sigma_pointing_rad);
  table.pointing_variance_q30 = fixed(tan_pointing * tan_pointing, 30);
  table.sigma_range_um = beam.sigma_range_um;
  fill_axis(beam.half_angle_along_rad, 0, &table);
  fill_axis(beam.two_axis ? beam.half_angle_across_rad : beam.half_angle_along_rad, 1, &table);
  for (int level = 0; level < kKernelLevels; ++level) {
    for (int phase = 0; phase < kKernelPhases; ++phase) {
      fill_kernel_row(level, phase, &table);
    }
  }
  table.crc32c = table_crc(table);
  return table;
}

ModelConfig plain_config(std::int32_t north, std::int32_t east, std::int32_t down) {
  ModelConfig config{};
  config.schema_version = kConfigSchemaVersion;
  config.rule = Rule::kLogOdds;
  config.k_p_q16 = 32768;
  config.no_return = NoReturnPolicy::kIgnore;
  config.cell_mm = 1000;
  config.size[0] = north;
  config.size[1] = east;
  config.size[2] = down;
  config.min_range_um = 100'000;
  config.max_range_um = 500'000'000;
  config.detect_range_um = 100'000'000;
  return config;
}

std::int32_t widest_side_cells() {
  std::uint32_t tiles = 1;
  while ((tiles + 1) * (tiles + 1) <= model::kTileCapacity) {
    ++tiles;
  }
  return static_cast<std::int32_t>(tiles) * model::kTileCells;
}

std::int32_t deepest_cells(std::int32_t north, std::int32_t east) {
  return static_cast<std::int32_t>(model::kVoxelCapacity /
                                   static_cast<std::uint32_t>(north * east));
}

base::Bam32 bam(double degrees) {
  const double turns = degrees / 360.0;
  return static_cast<base::Bam32>(
      static_cast<std::int64_t>(std::llround((turns - std::floor(turns)) * 0x1.0p32)));
}

base::Pose pose_at(double north_m, double east_m, double down_m) {
  base::Pose pose{};
  pose.position_um[base::kNorth] = std::llround(north_m * 1e6);
  pose.position_um[base::kEast] = std::llround(east_m * 1e6);
  pose.position_um[base::kDown] = std::llround(down_m * 1e6);
  pose.validity = base::kPoseAll;
  return pose;
}

base::Ping ping_along(double azimuth_deg, double elevation_deg, double range_m) {
  base::Ping ping{};
  ping.azimuth_bam32 = bam(azimuth_deg);
  ping.elevation_bam32 = bam(elevation_deg);
  ping.kind = base::ReturnKind::kRange;
  ping.quality = 255;
  ping.range_um = std::llround(range_m * 1e6);
  return ping;
}

}  // namespace leadline::test
