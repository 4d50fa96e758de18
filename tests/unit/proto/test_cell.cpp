#include <array>
#include <cmath>

#include "proto/cell.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::test::Random;
using namespace leadline::proto;  // NOLINT: every name of the header is under test

TEST(sigma_codes_are_nearest_half_octaves) {
  assert_int_equal(sigma_code(0), 0);
  assert_int_equal(sigma_code(64), 0);
  assert_int_equal(sigma_code(4096), 12);
  assert_int_equal(sigma_code(UINT32_MAX), 30);
  for (std::uint32_t sigma_q12 = 64; sigma_q12 < 2'000'000; sigma_q12 += 1 + sigma_q12 / 50) {
    const int code = sigma_code(sigma_q12);
    const double exact = 2.0 * std::log2(sigma_q12 / 64.0);
    // Thresholds are integers: one unit of sigma may fall on either side.
    assert_near(code, exact, 0.5 + 2.0 / sigma_q12 * 2.0);
    assert_int_equal(sigma_code(cell_sigma_q12(code_cell(0, sigma_q12, 0))), code);
  }
}

TEST(step_is_the_largest_power_of_two_within_half_a_sigma) {
  for (int code = 0; code < kSigmaCodes; ++code) {
    const double sigma_q8 = 4.0 * std::pow(2.0, code / 2.0);
    const double step_q8 = 1 << depth_step_shift(code);
    assert_true(step_q8 <= sigma_q8 / 2 * 1.0001);
    assert_true(2 * step_q8 > sigma_q8 / 2 * 1.0001);
  }
}

TEST(a_coded_depth_is_within_half_a_step_and_valid) {
  Random random;
  for (int i = 0; i < 200'000; ++i) {
    const auto depth_q8 = static_cast<std::int32_t>(random.between(0, kMaxCellDepth_q8));
    const auto sigma_q12 = static_cast<std::uint32_t>(random.next() >> random.between(34, 63));
    const auto flags = static_cast<std::uint8_t>(random.between(0, 7));
    const CodedCell cell = code_cell(depth_q8, sigma_q12, flags);
    assert_true(cell_known(cell) && cell_valid(cell));
    assert_int_equal(cell_flags(cell), flags);
    assert_int_equal(cell_sigma_code(cell), sigma_code(sigma_q12));
    const int step_q8 = 1 << depth_step_shift(cell_sigma_code(cell));
    assert_true(2 * std::abs(cell_depth_q8(cell) - depth_q8) <= step_q8);
    assert_int_equal(cell_depth_q8(cell) % step_q8, 0);
  }
}

TEST(depths_are_limited_and_unknown_is_zero) {
  assert_int_equal(code_cell(kUnknownDepth_q8, 1000, 7), kUnknownCell);
  assert_int_equal(cell_depth_q8(code_cell(-5, 64, 0)), 0);
  assert_int_equal(cell_depth_q8(code_cell(INT32_MAX, 64, 0)), kMaxCellDepth_q8);
  assert_int_equal(cell_depth_q8(code_cell(INT32_MAX, UINT32_MAX, 0)), kMaxCellDepth_q8);
  assert_int_equal(cell_depth_q8(kUnknownCell), kUnknownDepth_q8);
  assert_int_equal(cell_sigma_q12(kUnknownCell), 0);
  assert_int_equal(cell_sigma_code(kUnknownCell), -1);
  assert_int_equal(cell_flags(code_cell(0, 64, 0xFF)), kCellFlagMask);
}

TEST(vectors_of_the_specification) {
  assert_int_equal(code_cell(1000, 1024, 0), 0x0003E009);
  assert_int_equal(code_cell(1000, 1448, 1), 0x0003E02A);
  std::array<CodedCell, kTileArea_cells> cells{};
  const std::uint64_t unknown = tile_hash(cells.data());
  assert_true(unknown == 0x51D88627DF287325U);
  assert_int_equal(fold_hash(unknown), 0x8EF0F502);
  cells[0] = 0x0003E009;
  const std::uint64_t one = tile_hash(cells.data());
  assert_true(one == 0x8ADE1F96733F6197U);
  assert_true(add_tile_hash(add_tile_hash(kFnvOffset, unknown), one) == 0xBD135540785FF9A7U);
}

TEST(cells_that_cannot_be_are_told) {
  assert_true(cell_valid(kUnknownCell));
  assert_false(cell_valid(0x00000100));  // unknown with a depth
  assert_false(cell_valid(0x00000020));  // unknown with a flag
  assert_true(cell_valid(code_cell(1000, 1024, 0)));
  assert_false(cell_valid(code_cell(1000, 1024, 0) + 0x100));  // off its step
  assert_false(cell_valid((static_cast<std::uint32_t>(kMaxCellDepth_q8 + 2) << 8U) | 1U));
  assert_true(cell_valid((static_cast<std::uint32_t>(kMaxCellDepth_q8) << 8U) | 1U));
}

TEST(a_trembling_value_is_sent_once) {
  // Sigma a quarter of a cell: step 32, kept within 24.
  const CodedCell kept = code_cell(3200, 1024, 0);
  assert_int_equal(cell_depth_q8(kept), 3200);
  assert_int_equal(code_cell_near(kept, 3224, 1024, 0), kept);
  assert_int_equal(code_cell_near(kept, 3176, 1024, 0), kept);
  assert_int_equal(cell_depth_q8(code_cell_near(kept, 3225, 1024, 0)), 3232);
  assert_int_equal(cell_depth_q8(code_cell_near(kept, 3175, 1024, 0)), 3168);
  // Sigma one half octave off is kept, two are not.
  assert_int_equal(code_cell_near(kept, 3200, 1448, 0), kept);
  assert_int_equal(code_cell_near(kept, 3200, 724, 0), kept);
  assert_int_not_equal(code_cell_near(kept, 3200, 2048, 0), kept);
  assert_int_not_equal(code_cell_near(kept, 3200, 512, 0), kept);
  // Flags and knowledge are news at once.
  assert_int_not_equal(code_cell_near(kept, 3200, 1024, kCellMultiSurface), kept);
  assert_int_equal(code_cell_near(kept, kUnknownDepth_q8, 1024, 0), kUnknownCell);
  assert_int_equal(code_cell_near(kUnknownCell, 3200, 1024, 0), kept);
}

/// Mean of (coded - true)^2 / sigma^2, sigma that of the code, over depths that wander; `keep`: coded as the
/// receiver's cell is kept.
double added_variance(int code, bool keep) {
  Random random(static_cast<std::uint64_t>(code));
  const std::uint32_t sigma_q12 = cell_sigma_q12(static_cast<CodedCell>(code + 1));
  const double sigma_q8 = sigma_q12 / 16.0;
  double sum = 0;
  CodedCell kept = kUnknownCell;
  std::int32_t depth_q8 = 200'000;
  constexpr int kSamples = 200'000;
  for (int i = 0; i < kSamples; ++i) {
    depth_q8 += static_cast<std::int32_t>(random.between(-20, 20));
    kept = keep ? code_cell_near(kept, depth_q8, sigma_q12, 0) : code_cell(depth_q8, sigma_q12, 0);
    const double error = (cell_depth_q8(kept) - depth_q8) / sigma_q8;
    sum += error * error / kSamples;
  }
  return sum;
}

TEST(coarsening_adds_as_much_noise_as_stated) {
  // README.md: step^2 / 12, where step is sigma / 2 or sigma / 2.83; kept cells at most 2.25 times that.
  for (int code = 8; code < 14; ++code) {
    const double step_by_sigma = code % 2 == 0 ? 0.5 : 0.5 / std::sqrt(2.0);
    const double stated = step_by_sigma * step_by_sigma / 12.0;
    assert_near(added_variance(code, false), stated, 0.05 * stated);
    const double kept = added_variance(code, true);
    assert_true(kept > stated && kept < 2.25 * stated);
  }
}

TEST(a_value_that_stands_still_stops_changing) {
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    const auto centre = static_cast<std::int32_t>(random.between(10'000, 200'000));
    const auto sigma_q12 = static_cast<std::uint32_t>(random.between(400, 4000));
    const int step_q8 = 1 << depth_step_shift(sigma_code(sigma_q12));
    CodedCell kept = kUnknownCell;
    int changes = 0;
    for (int k = 0; k < 100; ++k) {
      const auto tremble = static_cast<std::int32_t>(random.between(-step_q8 / 8, step_q8 / 8));
      const CodedCell now = code_cell_near(kept, centre + tremble, sigma_q12, 0);
      changes += now != kept ? 1 : 0;
      kept = now;
    }
    assert_int_equal(changes, 1);
  }
}

TEST(any_changed_bit_changes_the_hash) {
  Random random(4);
  std::array<CodedCell, kTileArea_cells> cells{};
  for (auto& cell : cells) {
    cell = code_cell(static_cast<std::int32_t>(random.between(0, 100'000)), 1000, 0);
  }
  const std::uint64_t before = tile_hash(cells.data());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    for (unsigned bit = 0; bit < 32; ++bit) {
      cells[i] ^= 1U << bit;
      assert_true(tile_hash(cells.data()) != before);
      assert_int_not_equal(fold_hash(tile_hash(cells.data())), fold_hash(before));
      cells[i] ^= 1U << bit;
    }
  }
}

}  // namespace
