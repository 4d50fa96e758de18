#include "host_tools/table/generator.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <stdexcept>
#include <type_traits>

#include "host_tools/table/beam_profile.hpp"
#include "host_tools/table/first_return.hpp"
#include "host_tools/table/kernel_rows.hpp"
#include "host_tools/table/table_io.hpp"
#include "host_tools/table/table_math.hpp"

namespace leadline::host {
namespace {

using model::FirstReturnEntry;
using model::LocalizationTable;

constexpr double kQ15Peak = 32767.0;
// Half-step of the slope's central difference.
constexpr double kSlopeStep_rad = 0.02;

/// `value` * 2^fraction_bits, rounded; the description's limits keep it inside, so that clipping
/// would be a defect of the generator.
template <typename T>
T to_fixed(double value, int fraction_bits) {
  const double scaled =
      value * static_cast<double>(std::uint64_t{1} << static_cast<unsigned>(fraction_bits));
  const double low = static_cast<double>(std::numeric_limits<T>::min());
  const double high = static_cast<double>(std::numeric_limits<T>::max());
  if (!(scaled > low - 0.5 && scaled < high + 0.5)) {
    throw std::logic_error("table generator: a value does not fit its field");
  }
  return static_cast<T>(exact::round_to_integer(scaled));
}

/// A bound stated in units of the last place: rounded up.
std::uint32_t stated_bound(double units) { return static_cast<std::uint32_t>(std::ceil(units)); }

double excess_of(double q, double cos_incidence) {
  const double excess = q - cos_incidence;
  // An unsigned field cannot say that the range is longer than the plane's distance.
  return std::is_signed_v<decltype(FirstReturnEntry::excess_q30)> ? excess : std::max(0.0, excess);
}

struct Incidence {
  double sine;
  double cosine;
  double angle_rad;
};

/// `position`: in entries, not necessarily whole.
Incidence incidence_at(double position) {
  const double sine = position / model::kIncidenceSteps;
  const double cosine = std::sqrt(std::max(0.0, (1.0 - sine) * (1.0 + sine)));
  return {sine, cosine, exact::atan2(sine, cosine)};
}

void fill_first_return(const AveragedFirstReturn& first, std::size_t axis, double* worst_error,
                       double* worst_to_75deg, LocalizationTable* table) {
  FirstReturnEntry* const entries = table->first_return[axis];
  const FirstReturn& geometry = first.geometry(axis);
  for (int k = 0; k <= model::kIncidenceSteps; ++k) {
    const Incidence at = incidence_at(k);
    const double q = first.q(axis, at.angle_rad);
    FirstReturnEntry& entry = entries[k];
    entry.excess_q30 = to_fixed<decltype(entry.excess_q30)>(excess_of(q, at.cosine), 30);
    // The incidence has no sign: on the other side of 0 the same values come back.
    const double after = first.q(axis, at.angle_rad + kSlopeStep_rad);
    const double before = first.q(axis, std::fabs(at.angle_rad - kSlopeStep_rad));
    entry.slope_q20 = to_fixed<std::int32_t>((after - before) / (2.0 * kSlopeStep_rad), 20);
    if (k > 0) {
      const double uphill_rad = std::max(0.0, at.angle_rad - exact::acos(q));
      entry.shift_q20 = to_fixed<std::uint32_t>(exact::tan(uphill_rad) / at.sine, 20);
    }
    const FirstReturn::Patch patch = geometry.patch(at.angle_rad, geometry.cap_rad(at.angle_rad));
    entry.patch_variance_q30 =
        to_fixed<std::uint32_t>(0.5 * (patch.variance_radial + patch.variance_transverse), 30);
  }
  entries[0].shift_q20 = entries[1].shift_q20;

  for (int k = 0; k < model::kIncidenceSteps; ++k) {
    const double left = entries[k].excess_q30;
    const double right = entries[k + 1].excess_q30;
    for (const double f : {0.0, 0.25, 0.5, 0.75, 1.0}) {
      const Incidence at = incidence_at(k + f);
      const double truth = excess_of(first.q(axis, at.angle_rad), at.cosine) * 0x1.0p30;
      const double error = std::fabs(left + f * (right - left) - truth);
      *worst_error = std::max(*worst_error, error);
      if (at.angle_rad <= 75.0 * exact::kRadPerDeg) {
        *worst_to_75deg = std::max(*worst_to_75deg, error);
      }
    }
  }
}

void fill_profile(const BeamPattern& pattern, std::size_t axis, double* worst_error,
                  LocalizationTable* table) {
  constexpr double kCut2 = model::kProfileCut2_q8 / 256.0;
  for (int c = 0; c < model::kProfileClasses; ++c) {
    const BeamProfile profile(pattern, axis, c / (model::kProfileClasses - 1.0));
    const auto weight_at = [&](double position) {
      return kQ15Peak * profile.weight(std::sqrt(position / model::kProfileSteps * kCut2));
    };
    std::uint16_t* const entries = table->profile_q15[axis][c];
    for (int j = 0; j < model::kProfileSteps + 4; ++j) {
      // Entry 128 is the cut itself; what follows is padding.
      const double weight =
          j <= model::kProfileSteps ? weight_at(j) : entries[model::kProfileSteps];
      entries[j] = to_fixed<std::uint16_t>(std::min(kQ15Peak, weight), 0);
    }
    const auto check_at = [&](double position, int j) {
      const double f = position - j;
      const double stored = entries[j] + f * (entries[j + 1] - entries[j]);
      *worst_error = std::max(*worst_error, std::fabs(stored - weight_at(position)));
    };
    for (int j = 0; j < model::kProfileSteps; ++j) {
      check_at(j, j);
      check_at(j + 0.5, j);
    }
    // The beam alone may end in a jump (max_half_angle_deg): just before and just after it.
    const double edge = profile.edge_m() * profile.edge_m() / kCut2 * model::kProfileSteps;
    if (c == model::kProfileClasses - 1 && edge < model::kProfileSteps - 1e-6) {
      const int j = static_cast<int>(edge);
      check_at(std::max<double>(j, edge * (1.0 - 1e-9)), j);
      check_at(std::min<double>(j + 1, edge * (1.0 + 1e-9)), j);
    }
  }
}

void fill_beam_weight(const BeamPattern& pattern, std::size_t axis, LocalizationTable* table) {
  const double tan_envelope = exact::tan(pattern.envelope_rad(axis));
  std::uint16_t* const entries = table->beam_weight_q15[axis];
  for (int j = 0; j < model::kBeamWeightSteps; ++j) {
    const double tangent =
        tan_envelope * std::sqrt(static_cast<double>(j) / model::kBeamWeightSteps);
    const double sine = tangent / std::sqrt(1.0 + tangent * tangent);
    entries[j] = to_fixed<std::uint16_t>(kQ15Peak * pattern.axis_two_way(axis, sine), 0);
  }
  const double edge = pattern.axis_two_way(axis, exact::sin(pattern.envelope_rad(axis)));
  entries[model::kBeamWeightSteps] = to_fixed<std::uint16_t>(kQ15Peak * edge, 0);
  entries[model::kBeamWeightSteps + 1] = entries[model::kBeamWeightSteps];
}

void fill_kernels(double* worst_error, double* worst_moment, LocalizationTable* table) {
  for (std::size_t level = 0; level < model::kKernelLevels; ++level) {
    for (std::size_t phase = 0; phase < model::kKernelPhases; ++phase) {
      const KernelRow row = kernel_row(level, phase);
      std::copy(row.tap_q15.begin(), row.tap_q15.end(), table->kernel_q15[level][phase]);
      table->kernel_first[level][phase] = row.first;
      table->kernel_count[level][phase] = row.count;
      *worst_error = std::max(*worst_error, kernel_row_error(level, phase, row));
      *worst_moment = std::max(*worst_moment, std::fabs(row.moment));
    }
  }
}

}  // namespace

GeneratedTable generate_table(const BeamDescription& beam) {
  const BeamPattern pattern(beam);
  GeneratedTable generated;
  LocalizationTable& table = generated.table;
  TableFacts& facts = generated.facts;
  const double sigma_pointing_rad = beam.sigma_pointing_deg * exact::kRadPerDeg;

  table.magic = model::kTableMagic;
  table.version = model::kTableVersion;
  table.size_bytes = sizeof(LocalizationTable);
  table.beam_kind = beam.kind;
  table.two_axis = pattern.two_axis() ? 1 : 0;
  table.detection_fraction_q16 = static_cast<std::uint16_t>(std::clamp<std::int64_t>(
      exact::round_to_integer(beam.detection_fraction * 65536.0), 1, 65535));
  table.tan_envelope_along_q24 = to_fixed<std::uint32_t>(exact::tan(pattern.envelope_rad(0)), 24);
  table.tan_envelope_across_q24 = to_fixed<std::uint32_t>(exact::tan(pattern.envelope_rad(1)), 24);
  table.beam_variance_along_q30 = std::max(1U, to_fixed<std::uint32_t>(pattern.variance(0), 30));
  table.beam_variance_across_q30 = std::max(1U, to_fixed<std::uint32_t>(pattern.variance(1), 30));
  const double tan_pointing = exact::tan(sigma_pointing_rad);
  table.pointing_variance_q30 = to_fixed<std::uint32_t>(tan_pointing * tan_pointing, 30);
  table.sigma_range_um = to_fixed<std::uint32_t>(beam.sigma_range_mm * 1000.0, 0);
  table.discarded_energy_ppm = to_fixed<std::uint32_t>(pattern.discarded_fraction() * 1e6, 0);

  const AveragedFirstReturn first(pattern, beam.detection_fraction, sigma_pointing_rad);
  double excess_error = 0.0;
  double excess_error_to_75deg = 0.0;
  double profile_error = 0.0;
  double kernel_error = 0.0;
  double kernel_moment = 0.0;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (axis == 1 && !pattern.two_axis()) {
      std::copy(std::begin(table.first_return[0]), std::end(table.first_return[0]),
                std::begin(table.first_return[1]));
      std::copy(&table.profile_q15[0][0][0], &table.profile_q15[1][0][0],
                &table.profile_q15[1][0][0]);
      std::copy(std::begin(table.beam_weight_q15[0]), std::end(table.beam_weight_q15[0]),
                std::begin(table.beam_weight_q15[1]));
      break;
    }
    fill_first_return(first, axis, &excess_error, &excess_error_to_75deg, &table);
    fill_profile(pattern, axis, &profile_error, &table);
    fill_beam_weight(pattern, axis, &table);
  }
  fill_kernels(&kernel_error, &kernel_moment, &table);
  table.error_excess_q30 = stated_bound(excess_error);
  table.error_profile_q15 = stated_bound(profile_error);
  table.error_kernel_q15 = stated_bound(kernel_error);
  table.error_kernel_moment_q15 = stated_bound(kernel_moment * model::kKernelSum);
  table.crc32c = model::table_crc(table);
  if (model::check_table(&table, sizeof(table)) != base::Status::kOk) {
    throw std::logic_error("table generator: the table does not pass its own check");
  }

  for (std::size_t axis = 0; axis < 2; ++axis) {
    facts.envelope_deg[axis] = pattern.envelope_rad(axis) * exact::kDegPerRad;
    facts.cut[axis] = pattern.cut(axis);
    facts.sigma_beam_deg[axis] =
        exact::atan2(std::sqrt(pattern.variance(axis)), 1.0) * exact::kDegPerRad;
  }
  facts.discarded_fraction = pattern.discarded_fraction();
  facts.worst_excess_error = excess_error * 0x1.0p-30;
  facts.worst_excess_error_to_75deg = excess_error_to_75deg * 0x1.0p-30;
  facts.worst_profile_error = profile_error / kQ15Peak;
  facts.worst_kernel_error = kernel_error / model::kKernelSum;
  facts.worst_kernel_moment_cells = kernel_moment;
  generated.report = std::string("Cut: ") + beam_cut_text(pattern.cut(0));
  if (pattern.two_axis()) {
    generated.report += std::string(" along, ") + beam_cut_text(pattern.cut(1)) + " across";
  }
  generated.report += "\n" + table_to_text(table);
  // Behind the worst first return of all, which nearly always is that at grazing incidence.
  char to_75deg[64];
  std::snprintf(to_75deg, sizeof(to_75deg), ", %.2e up to 75 degrees of incidence",
                facts.worst_excess_error_to_75deg);
  const std::size_t line = generated.report.find("  first return ");
  generated.report.insert(std::min(generated.report.find('\n', line), generated.report.size()),
                          to_75deg);
  return generated;
}

}  // namespace leadline::host
