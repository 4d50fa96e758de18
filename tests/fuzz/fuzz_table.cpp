// Any bytes as a localization table. What must hold: what check_table accepts can be read in the
// way the integrator reads it without leaving an array or gaining weight; parse_table only throws
// HostError kInput.
//
// The bytes are tried as they are, and as changes to a valid table (two bytes of offset, one of
// length, the new bytes; repeated), with a CRC that matches: a fuzzer does not find a CRC by
// itself.
#include <cstdint>
#include <cstring>
#include <memory>
#include <string_view>

#include "host_tools/exit_codes.hpp"
#include "host_tools/table/generator.hpp"
#include "host_tools/table/table_io.hpp"
#include "model/localization_table.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::base::Status;
using leadline::fuzz::require;
using leadline::model::check_table;
using leadline::model::LocalizationTable;
using leadline::model::table_crc;

/// Everything that an integrator computes from a table, with the widest inputs.
void read_like_an_integrator(const LocalizationTable& table) {
  using namespace leadline::model;  // NOLINT: its constants
  require(table.two_axis <= 1, "two_axis is a flag");
  for (int axis = 0; axis < 2; ++axis) {
    for (int k = 0; k < kIncidenceSteps; ++k) {
      const auto& left = table.first_return[axis][k];
      const auto& right = table.first_return[axis][k + 1];
      const std::int64_t step = std::int64_t{right.excess_q30} - std::int64_t{left.excess_q30};
      const std::int64_t excess = std::int64_t{left.excess_q30} + ((step * 255) >> 8U);
      require(excess >= -(std::int64_t{2} << 30U) && excess <= std::int64_t{2} << 30U,
              "excess fits its range");
      // tan of the shift: shift / sin of the incidence, times a range of up to 2^30 units.
      require((std::int64_t{left.shift_q20} * k) / kIncidenceSteps < std::int64_t{1} << 32U,
              "shift fits its range");
    }
    for (const auto& profile : table.profile_q15[axis]) {
      require(profile[0] == 32767, "the profile starts at its peak");
      for (int j = 0; j < kProfileSteps + 3; ++j) {
        const std::int32_t value = profile[j] + (((profile[j + 1] - profile[j]) * 127) >> 7);
        require(value >= 0 && value <= 32767, "the profile stays within its peak");
      }
    }
    for (const std::uint16_t weight : table.beam_weight_q15[axis]) {
      require(weight <= 32767, "the beam's weight stays within its peak");
    }
  }
  for (int level = 0; level < kKernelLevels; ++level) {
    for (int phase = 0; phase < kKernelPhases; ++phase) {
      std::int32_t sum = 0;
      const int first = table.kernel_first[level][phase];
      const int count = table.kernel_count[level][phase];
      require(count >= 1 && first + count <= kKernelTaps, "the row's taps are inside the row");
      for (int tap = first; tap < first + count; ++tap) {
        require(table.kernel_q15[level][phase][tap] >= 0, "no tap is negative");
        sum += table.kernel_q15[level][phase][tap];
      }
      require(sum == kKernelSum, "the row neither gains nor loses weight");
    }
  }
}

void try_block(const std::uint8_t* data, std::size_t size) {
  // On the heap, aligned and just so long: ASan knows its exact end.
  const std::unique_ptr<std::uint8_t[]> bytes(new std::uint8_t[size == 0 ? 1 : size]);
  if (size > 0) {
    std::memcpy(bytes.get(), data, size);
  }
  const Status status = check_table(bytes.get(), size);
  if (status == Status::kOk) {
    require(size == sizeof(LocalizationTable), "only whole tables are accepted");
    LocalizationTable table{};
    std::memcpy(&table, bytes.get(), size);
    read_like_an_integrator(table);
    require(!leadline::host::table_to_text(table).empty(), "an accepted table can be described");
    require(leadline::host::table_to_json(table).back() == '}', "JSON is closed");
  }
  bool loaded = false;
  try {
    (void)leadline::host::parse_table(
        std::string_view(reinterpret_cast<const char*>(bytes.get()), size), "t.llt");
    loaded = true;
  } catch (const leadline::host::HostError& error) {
    require(error.code() == leadline::host::ExitCode::kInput, "only input errors");
  }
  require(loaded == (status == Status::kOk), "loading and checking agree");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try_block(data, size);

  static const LocalizationTable base =
      leadline::host::generate_table(leadline::host::BeamDescription{}).table;
  LocalizationTable table = base;
  auto* const bytes = reinterpret_cast<std::uint8_t*>(&table);
  std::size_t at = 0;
  while (at + 3 <= size) {
    const std::size_t offset = (data[at] | static_cast<std::size_t>(data[at + 1]) << 8U);
    const std::size_t length = data[at + 2];
    at += 3;
    for (std::size_t i = 0; i < length && at < size; ++i, ++at) {
      bytes[(offset + i) % sizeof(table)] = data[at];
    }
  }
  table.crc32c = table_crc(table);
  try_block(bytes, sizeof(table));
  return 0;
}
