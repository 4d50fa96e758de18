#include "model/localization_table.hpp"

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "model/base/crc32c.hpp"

namespace leadline::model {
namespace {

using base::Status;

// Widest envelope of a table: tan of 80.5 degrees. Wider ones would let the footprint of one ping
// outgrow every grid; the generator cuts at 80 degrees.
constexpr std::uint32_t kMaxTanEnvelope_q24 = 6U << 24U;
// cos + excess is a cosine: |excess| stays below 1.5, |slope| below 64 (a pointing error turns a unit
// of range into at most a few units of depth) and the shift below tan(80.5 deg) * kIncidenceSteps.
constexpr std::int64_t kMaxExcess_q30 = std::int64_t{3} << 29U;
constexpr std::int64_t kMaxSlope_q20 = std::int64_t{64} << 20U;
constexpr std::int64_t kMaxShift_q20 = (std::int64_t{6} * kIncidenceSteps) << 20U;
constexpr std::uint16_t kPeak_q15 = 32767;

bool magnitude_within(std::int64_t value, std::int64_t limit) {
  return value >= -limit && value <= limit;
}

bool envelope_ok(std::uint32_t tan_q24) { return tan_q24 > 0 && tan_q24 <= kMaxTanEnvelope_q24; }

bool first_return_ok(const FirstReturnEntry& entry) {
  return magnitude_within(entry.excess_q30, kMaxExcess_q30) &&
         magnitude_within(entry.slope_q20, kMaxSlope_q20) &&
         magnitude_within(entry.shift_q20, kMaxShift_q20);
}

// Values that start at the peak and never exceed it.
bool weights_ok(const std::uint16_t* values, int count) {
  if (values[0] != kPeak_q15) {
    return false;
  }
  for (int i = 1; i < count; ++i) {
    if (values[i] > kPeak_q15) {
      return false;
    }
  }
  return true;
}

// Taps sum to kKernelSum, none is negative, and none lies outside [first, first + count).
bool kernel_row_ok(const std::int16_t* taps, int first, int count) {
  if (count < 1 || first + count > kKernelTaps) {
    return false;
  }
  std::int32_t sum = 0;
  for (int tap = 0; tap < kKernelTaps; ++tap) {
    const bool inside = tap >= first && tap < first + count;
    if (taps[tap] < 0 || (taps[tap] != 0 && !inside)) {
      return false;
    }
    sum += taps[tap];
  }
  return sum == kKernelSum;
}

bool header_ok(const LocalizationTable& table) {
  const bool axes_equal = table.tan_envelope_along_q24 == table.tan_envelope_across_q24 &&
                          table.beam_variance_along_q30 == table.beam_variance_across_q30;
  return static_cast<std::uint8_t>(table.beam_kind) <=
             static_cast<std::uint8_t>(BeamKind::kMeasured) &&
         table.two_axis <= 1 && (table.two_axis == 1 || axes_equal) &&
         table.detection_fraction_q16 > 0 && envelope_ok(table.tan_envelope_along_q24) &&
         envelope_ok(table.tan_envelope_across_q24) && table.beam_variance_along_q30 > 0 &&
         table.beam_variance_across_q30 > 0;
}

bool axis_ok(const LocalizationTable& table, int axis) {
  for (const FirstReturnEntry& entry : table.first_return[axis]) {
    if (!first_return_ok(entry)) {
      return false;
    }
  }
  for (const auto& profile : table.profile_q15[axis]) {
    if (!weights_ok(profile, kProfileSteps + 4)) {
      return false;
    }
  }
  return weights_ok(table.beam_weight_q15[axis], kBeamWeightSteps + 2);
}

bool kernels_ok(const LocalizationTable& table) {
  for (int level = 0; level < kKernelLevels; ++level) {
    for (int phase = 0; phase < kKernelPhases; ++phase) {
      if (!kernel_row_ok(table.kernel_q15[level][phase], table.kernel_first[level][phase],
                         table.kernel_count[level][phase])) {
        return false;
      }
    }
  }
  return true;
}

}  // namespace

Status check_table(const void* bytes, std::size_t size_bytes) {
  if (bytes == nullptr) {
    return Status::kInvalidArgument;
  }
  // The header first, from whatever address the bytes came to: a file of a later version may have
  // another size, and "wrong version" tells its reader more than "wrong size".
  constexpr std::size_t kVersionEnd = offsetof(LocalizationTable, reserved0);
  std::uint32_t magic = 0;
  std::uint16_t version = 0;
  if (size_bytes < kVersionEnd) {
    return Status::kTruncated;
  }
  const auto* const first = static_cast<const std::uint8_t*>(bytes);
  std::memcpy(&magic, first + offsetof(LocalizationTable, magic), sizeof(magic));
  std::memcpy(&version, first + offsetof(LocalizationTable, version), sizeof(version));
  if (magic != kTableMagic) {
    return Status::kOutOfRange;
  }
  if (version != kTableVersion) {
    return Status::kBadVersion;
  }
  if (size_bytes < sizeof(LocalizationTable)) {
    return Status::kTruncated;
  }
  if (size_bytes > sizeof(LocalizationTable)) {
    return Status::kOutOfRange;
  }
  // The caller works with the block in place, so it must lie where a table can.
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): the only way to see an alignment
  if (reinterpret_cast<std::uintptr_t>(bytes) % alignof(LocalizationTable) != 0) {
    return Status::kInvalidArgument;
  }
  const auto& table = *static_cast<const LocalizationTable*>(bytes);
  if (table.reserved0 != 0 || table.size_bytes != sizeof(LocalizationTable)) {
    return Status::kOutOfRange;
  }
  if (table.crc32c != table_crc(table)) {
    return Status::kBadChecksum;
  }
  // The CRC only says that the block is what somebody wrote; the rest, that it can be worked with.
  const bool ok = header_ok(table) && axis_ok(table, 0) && axis_ok(table, 1) && kernels_ok(table);
  return ok ? Status::kOk : Status::kOutOfRange;
}

std::uint32_t table_crc(const LocalizationTable& table) {
  constexpr std::size_t kBegin = offsetof(LocalizationTable, beam_kind);
  const void* const block = &table;
  const auto* const first = static_cast<const std::uint8_t*>(block);
  return base::crc32c(first + kBegin, sizeof(LocalizationTable) - kBegin);
}

}  // namespace leadline::model
