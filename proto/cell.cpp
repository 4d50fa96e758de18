#include "proto/cell.hpp"

#include <algorithm>
#include <array>

#include "model/base/fixed.hpp"

namespace leadline::proto {
namespace {

/// 64 * 2^(k/2), rounded to nearest: sigma of code k, 1/4096 cell.
constexpr std::array<std::uint32_t, kSigmaCodes> kSigma_q12 = {
    64,     91,     128,    181,    256,    362,    512,     724,     1024,   1448,  2048,
    2896,   4096,   5793,   8192,   11585,  16384,  23170,   32768,   46341,  65536, 92682,
    131072, 185364, 262144, 370728, 524288, 741455, 1048576, 1482910, 2097152};
/// 64 * 2^(k/2 + 1/4), rounded up: the least sigma_q12 that takes code k + 1.
constexpr std::array<std::uint32_t, kSigmaCodes - 1> kSigmaAbove_q12 = {
    77,    108,    153,    216,    305,    431,    609,    862,    1218,    1723,
    2436,  3445,   4871,   6889,   9742,   13778,  19484,  27555,  38968,   55109,
    77936, 110218, 155872, 220436, 311744, 440872, 623488, 881744, 1246975, 1763488};

/// Multiple of the step that is nearest to depth, halves upwards. Depth 0 .. kMaxCellDepth_q8.
std::int32_t on_step(std::int32_t depth_q8, int shift) {
  return ((depth_q8 + (1 << (shift - 1))) >> shift) << shift;
}

std::uint64_t add_byte(std::uint64_t hash, std::uint32_t byte) { return (hash ^ byte) * kFnvPrime; }

}  // namespace

int sigma_code(std::uint32_t sigma_q12) {
  const auto* above = std::upper_bound(kSigmaAbove_q12.begin(), kSigmaAbove_q12.end(), sigma_q12);
  return static_cast<int>(above - kSigmaAbove_q12.begin());
}

CodedCell code_cell(std::int32_t depth_q8, std::uint32_t sigma_q12, std::uint8_t flags) {
  if (depth_q8 == kUnknownDepth_q8) {
    return kUnknownCell;
  }
  const int code = sigma_code(sigma_q12);
  const std::int32_t depth = base::clamp(depth_q8, 0, kMaxCellDepth_q8);
  const auto coded_q8 = static_cast<std::uint32_t>(on_step(depth, depth_step_shift(code)));
  return static_cast<std::uint32_t>(code + 1) |
         (static_cast<std::uint32_t>(flags & kCellFlagMask) << 5U) | (coded_q8 << 8U);
}

CodedCell code_cell_near(CodedCell previous, std::int32_t depth_q8, std::uint32_t sigma_q12,
                         std::uint8_t flags) {
  const CodedCell fresh = code_cell(depth_q8, sigma_q12, flags);
  if (!cell_known(previous) || !cell_known(fresh) || cell_flags(previous) != cell_flags(fresh)) {
    return fresh;
  }
  const int code_change = cell_sigma_code(fresh) - cell_sigma_code(previous);
  const std::int32_t depth_change =
      base::clamp(depth_q8, 0, kMaxCellDepth_q8) - cell_depth_q8(previous);
  const std::int32_t near_q8 = (3 << depth_step_shift(cell_sigma_code(previous))) / 4;
  const bool near =
      code_change >= -1 && code_change <= 1 && depth_change >= -near_q8 && depth_change <= near_q8;
  return near ? previous : fresh;
}

std::uint32_t cell_sigma_q12(CodedCell cell) {
  return cell_known(cell) ? kSigma_q12[static_cast<std::size_t>(cell_sigma_code(cell))] : 0;
}

bool cell_valid(CodedCell cell) {
  if (!cell_known(cell)) {
    return cell == kUnknownCell;
  }
  const std::int32_t depth_q8 = cell_depth_q8(cell);
  const int shift = depth_step_shift(cell_sigma_code(cell));
  return depth_q8 <= on_step(kMaxCellDepth_q8, shift) && on_step(depth_q8, shift) == depth_q8;
}

std::uint64_t tile_hash(const CodedCell* cells) {
  std::uint64_t hash = kFnvOffset;
  for (int i = 0; i < kTileArea_cells; ++i) {
    for (unsigned shift = 0; shift < 32; shift += 8) {
      hash = add_byte(hash, (cells[i] >> shift) & 0xFFU);
    }
  }
  return hash;
}

std::uint64_t add_tile_hash(std::uint64_t cells_hash, std::uint64_t tile_hash) {
  for (unsigned shift = 0; shift < 64; shift += 8) {
    cells_hash = add_byte(cells_hash, static_cast<std::uint32_t>((tile_hash >> shift) & 0xFFU));
  }
  return cells_hash;
}

}  // namespace leadline::proto
