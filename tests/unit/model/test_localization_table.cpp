// check_table: whatever is not a table that the integrator can work with is refused, by the right
// name.
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "model/base/crc32c.hpp"
#include "model/localization_table.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using leadline::base::Status;

/// The plainest table that passes; the generator's own are tested in tests/unit/host_tools.
LocalizationTable valid_table() {
  LocalizationTable table;
  std::memset(&table, 0, sizeof(table));
  table.magic = kTableMagic;
  table.version = kTableVersion;
  table.size_bytes = sizeof(table);
  table.beam_kind = BeamKind::kCone;
  table.detection_fraction_q16 = 6554;
  table.tan_envelope_along_q24 = 1U << 20U;
  table.tan_envelope_across_q24 = 1U << 20U;
  table.beam_variance_along_q30 = 1000000;
  table.beam_variance_across_q30 = 1000000;
  for (int axis = 0; axis < 2; ++axis) {
    for (auto& profile : table.profile_q15[axis]) {
      profile[0] = 32767;
    }
    table.beam_weight_q15[axis][0] = 32767;
  }
  for (int level = 0; level < kKernelLevels; ++level) {
    for (int phase = 0; phase < kKernelPhases; ++phase) {
      table.kernel_q15[level][phase][6] = 16384;
      table.kernel_q15[level][phase][7] = 16384;
      table.kernel_first[level][phase] = 6;
      table.kernel_count[level][phase] = 2;
    }
  }
  table.crc32c = table_crc(table);
  return table;
}

Status check(const LocalizationTable& table) { return check_table(&table, sizeof(table)); }

/// The status after `change`, with a CRC that matches the changed bytes.
Status check_changed(const std::function<void(LocalizationTable*)>& change) {
  LocalizationTable table = valid_table();
  change(&table);
  table.crc32c = table_crc(table);
  return check(table);
}

#define assert_refused(statement) \
  assert_int_equal(check_changed([](LocalizationTable* t) { statement; }), Status::kOutOfRange)
#define assert_accepted(statement) \
  assert_int_equal(check_changed([](LocalizationTable* t) { statement; }), Status::kOk)

}  // namespace

TEST(a_valid_table_is_accepted) { assert_int_equal(check(valid_table()), Status::kOk); }

TEST(the_crc_covers_everything_after_itself) {
  const LocalizationTable table = valid_table();
  std::vector<std::uint8_t> bytes(sizeof(table));
  std::memcpy(bytes.data(), &table, sizeof(table));
  assert_int_equal(table.crc32c, leadline::base::crc32c(bytes.data() + 16, bytes.size() - 16));
}

TEST(every_shorter_block_is_truncated) {
  const LocalizationTable table = valid_table();
  for (std::size_t size = 0; size < sizeof(table); ++size) {
    // On the heap and just so long: a sanitizer sees the first byte that is read too many.
    const std::unique_ptr<std::uint8_t[]> bytes(new std::uint8_t[size + 1]);
    std::memcpy(bytes.get(), &table, size);
    assert_int_equal(check_table(bytes.get(), size), Status::kTruncated);
    size += size > 64 && size < sizeof(table) - 64 ? 97 : 0;
  }
}

TEST(a_longer_block_is_refused) {
  std::vector<LocalizationTable> two(2, valid_table());
  assert_int_equal(check_table(two.data(), sizeof(LocalizationTable) + 1), Status::kOutOfRange);
}

TEST(null_and_misaligned_blocks_are_a_broken_contract) {
  assert_int_equal(check_table(nullptr, sizeof(LocalizationTable)), Status::kInvalidArgument);
  const LocalizationTable table = valid_table();
  std::vector<std::uint8_t> bytes(sizeof(table) + 8);
  for (std::size_t shift = 0; shift < 8; ++shift) {
    std::memcpy(bytes.data() + shift, &table, sizeof(table));
    assert_int_equal(
        check_table(bytes.data() + shift, sizeof(table)),
        shift % alignof(LocalizationTable) == 0 ? Status::kOk : Status::kInvalidArgument);
  }
}

TEST(every_flipped_bit_is_found) {
  LocalizationTable table = valid_table();
  auto* const bytes = reinterpret_cast<std::uint8_t*>(&table);
  for (std::size_t at = 0; at < sizeof(table); ++at) {
    // All bits of the header, one of every byte behind it.
    for (unsigned bit = 0; bit < (at < 64 ? 8U : 1U); ++bit) {
      const std::uint8_t mask = static_cast<std::uint8_t>(1U << ((bit + at) % 8));
      bytes[at] ^= mask;
      Status expected = Status::kBadChecksum;
      if (at < 4 || (at >= 6 && at < 12)) {
        expected = Status::kOutOfRange;  // magic, reserved, size
      } else if (at < 6) {
        expected = Status::kBadVersion;
      }
      assert_int_equal(check(table), expected);
      bytes[at] ^= mask;
    }
    // The CRC of 25 kB for each: the header is what differs, the rest is sampled.
    at += at > 64 ? 13 : 0;
  }
  assert_int_equal(check(table), Status::kOk);
}

TEST(a_version_that_is_not_ours_is_named_whatever_its_size) {
  LocalizationTable table = valid_table();
  for (const int version : {0, 2, 3, 65535}) {
    table.version = static_cast<std::uint16_t>(version);
    assert_int_equal(check(table), Status::kBadVersion);
    assert_int_equal(check_table(&table, 64), Status::kBadVersion);
  }
}

TEST(header_values_outside_their_range_are_refused) {
  assert_refused(t->beam_kind = static_cast<BeamKind>(4));
  assert_accepted(t->beam_kind = BeamKind::kMeasured);
  assert_refused(t->two_axis = 2);
  assert_refused(t->detection_fraction_q16 = 0);
  assert_refused(t->tan_envelope_along_q24 = t->tan_envelope_across_q24 = 0);
  assert_refused(t->tan_envelope_along_q24 = t->tan_envelope_across_q24 = (6U << 24U) + 1);
  assert_accepted(t->tan_envelope_along_q24 = t->tan_envelope_across_q24 = 6U << 24U);
  assert_refused(t->beam_variance_along_q30 = t->beam_variance_across_q30 = 0);
  // Axes may differ only where the table says so.
  assert_refused(t->tan_envelope_across_q24 += 1);
  assert_refused(t->beam_variance_across_q30 += 1);
  assert_accepted(t->two_axis = 1; t->tan_envelope_across_q24 += 1;
                  t->beam_variance_across_q30 += 1);
  assert_refused(t->two_axis = 1; t->tan_envelope_across_q24 = 0);
  assert_refused(t->two_axis = 1; t->beam_variance_across_q30 = 0);
}

TEST(first_returns_outside_their_range_are_refused) {
  assert_refused(t->first_return[0][0].excess_q30 =
                     std::numeric_limits<decltype(FirstReturnEntry::excess_q30)>::max());
  assert_refused(t->first_return[1][256].slope_q20 = std::numeric_limits<std::int32_t>::min());
  assert_refused(t->first_return[1][128].slope_q20 = std::numeric_limits<std::int32_t>::max());
  assert_refused(t->first_return[0][256].shift_q20 = std::numeric_limits<std::uint32_t>::max());
  assert_accepted(t->first_return[0][7].patch_variance_q30 =
                      std::numeric_limits<std::uint32_t>::max());
}

TEST(weights_above_the_peak_are_refused) {
  assert_refused(t->profile_q15[0][0][0] = 32766);
  assert_refused(t->profile_q15[1][7][0] = 0);
  assert_refused(t->profile_q15[1][7][131] = 32768);
  assert_refused(t->profile_q15[0][3][64] = 65535);
  assert_refused(t->beam_weight_q15[0][0] = 0);
  assert_refused(t->beam_weight_q15[1][65] = 32768);
}

TEST(kernel_rows_that_gain_lose_or_leave_the_row_are_refused) {
  assert_refused(t->kernel_q15[0][0][6] += 1);
  assert_refused(t->kernel_q15[23][15][7] -= 1);
  assert_refused(t->kernel_q15[5][5][6] += 1; t->kernel_q15[5][5][5] -= 1);  // negative
  assert_refused(t->kernel_q15[5][5][6] -= 1; t->kernel_q15[5][5][5] += 1);  // before the first
  assert_refused(t->kernel_q15[5][5][6] -= 1; t->kernel_q15[5][5][8] += 1);  // after the last
  assert_refused(t->kernel_count[5][5] = 0);
  assert_refused(t->kernel_count[5][5] = 11);
  assert_accepted(t->kernel_count[5][5] = 10);
  assert_refused(t->kernel_first[23][15] = 15);
  assert_refused(t->kernel_first[23][15] = 255; t->kernel_count[23][15] = 255);
  assert_refused(t->kernel_first[23][15] = 7; t->kernel_count[23][15] = 1);
}
