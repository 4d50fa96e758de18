// The one walk over a tile's cells that encoder, decoder and the maker of the model's table share: which
// bit is asked of which model, in which order. Internal to proto; the normative text is proto/SPEC.md,
// "Tile delta".
//
// `Coder` is what turns bits into bytes or back:
//   bool bit(BitModel&, bool)                  codes one bit; a decoder ignores the bit that it is
//                                              given and returns the one that it reads
//   std::uint32_t raw(std::uint32_t, unsigned) the same for up to 16 bits of equal chance
// A decoder starts from cells that are unknown and from an empty mask; both fill as it reads.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/fixed.hpp"
#include "proto/cell.hpp"
#include "proto/tile_coder.hpp"
#include "proto/tile_model.hpp"

namespace leadline::proto {

/// Cells that a depth is predicted from: all of them earlier in north-major order, near ones first.
struct NeighbourOffset {
  int north;
  int east;
  int weight;  ///< in the plane through them
};
inline constexpr std::array<NeighbourOffset, 12> kNeighbours = {{
    {0, -1, 128},
    {-1, 0, 128},
    {-1, -1, 32},
    {-1, 1, 32},
    {0, -2, 8},
    {-2, 0, 8},
    {-1, -2, 8},
    {-1, 2, 8},
    {-2, -1, 8},
    {-2, 1, 8},
    {-2, -2, 4},
    {-2, 2, 4},
}};
inline constexpr int kSideNeighbours = 2;   ///< the first of them share a side with the cell
inline constexpr int kTouchNeighbours = 4;  ///< the first of them touch it

template <typename Coder>
class TileWalk {
 public:
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): errors are filled in right here
  TileWalk(Coder& coder, TileModel& model, PacketMemory& memory)
      : coder_(coder), model_(model), memory_(memory) {
    error_q8_.fill(kNoError);
  }

  /// Which `count` (1 .. 256) cells follow. O(tile).
  void mask(CellMask& changed, int count) {
    int left = count;
    for (int cell = 0; left > 0; ++cell) {
      const int cells_left = kTileArea_cells - cell;
      // What is certain costs nothing.
      const bool is_changed =
          left == cells_left ||
          coder_.bit(model_.mask[density(left, cells_left)][pattern(changed, cell)],
                     changed.test(cell));
      if (is_changed) {
        changed.set(cell);
        --left;
      }
    }
  }

  /// One changed cell; cells before it have been through here. False when what was read is no cell.
  [[nodiscard]] bool cell(const CellMask& changed, int at, CodedCell& own, const CodedCell* cells) {
    look_around(changed, at, cells);
    if (coder_.bit(model_.unknown[near_unknown_], !cell_known(own))) {
      own = kUnknownCell;
      return true;
    }
    const int code = sigma(cell_sigma_code(own));
    if (code < 0) {
      return false;
    }
    std::uint32_t flags = cell_flags(own);
    if (!flag_bits(flags)) {
      return false;
    }
    std::int32_t depth_q8 = cell_known(own) ? cell_depth_q8(own) : 0;
    if (!depth(at, depth_step_shift(code), depth_q8)) {
      return false;
    }
    own = static_cast<std::uint32_t>(code + 1) | (flags << 5U) |
          (static_cast<std::uint32_t>(depth_q8) << 8U);
    memory_.depth_q8 = depth_q8;
    memory_.sigma_code = code;
    return true;
  }

 private:
  static constexpr std::int32_t kNoError = -1;

  struct Seen {
    NeighbourOffset at;
    std::int32_t depth_q8;
  };

  static bool in_mask(const CellMask& changed, int north, int east) {
    return north >= 0 && east >= 0 && east < kTileSide_cells &&
           changed.test(north * kTileSide_cells + east);
  }

  static int pattern(const CellMask& changed, int cell) {
    const int north = cell / kTileSide_cells;
    const int east = cell % kTileSide_cells;
    return (in_mask(changed, north, east - 1) ? 1 : 0) |
           (in_mask(changed, north - 1, east) ? 2 : 0) |
           (in_mask(changed, north - 1, east + 1) ? 4 : 0) |
           (in_mask(changed, north - 1, east - 1) ? 8 : 0);
  }

  static int density(int left, int cells_left) {
    if (left * 16 < cells_left) {
      return 0;
    }
    if (left * 4 < cells_left) {
      return 1;
    }
    return left * 4 < cells_left * 3 ? 2 : 3;
  }

  /// Collects what the neighbours in the same packet say.
  void look_around(const CellMask& changed, int at, const CodedCell* cells) {
    seen_count_ = 0;
    near_unknown_ = 0;
    near_multi_ = 0;
    sigma_sum_ = 0;
    touch_weight_ = 0;
    sigma_least_ = kSigmaCodes;
    sigma_most_ = 0;
    error_sum_q8_ = 0;
    error_weight_ = 0;
    int index = 0;
    for (const NeighbourOffset& offset : kNeighbours) {
      const int north = at / kTileSide_cells + offset.north;
      const int east = at % kTileSide_cells + offset.east;
      if (in_mask(changed, north, east)) {
        look_at(offset, index, north * kTileSide_cells + east, cells);
      }
      ++index;
    }
  }

  void look_at(const NeighbourOffset& offset, int index, int other, const CodedCell* cells) {
    const CodedCell cell = cells[other];
    const bool side = index < kSideNeighbours;
    if (!cell_known(cell)) {
      near_unknown_ += side ? 1 : 0;
      return;
    }
    seen_[static_cast<std::size_t>(seen_count_)] = Seen{offset, cell_depth_q8(cell)};
    ++seen_count_;
    if (index >= kTouchNeighbours) {
      return;
    }
    const int weight = side ? 2 : 1;
    const int code = cell_sigma_code(cell);
    near_multi_ += side && (cell_flags(cell) & kCellMultiSurface) != 0 ? 1 : 0;
    sigma_sum_ += weight * code;
    touch_weight_ += weight;
    sigma_least_ = base::min_of(sigma_least_, code);
    sigma_most_ = base::max_of(sigma_most_, code);
    const std::int32_t error_q8 = error_q8_[static_cast<std::size_t>(other)];
    if (error_q8 != kNoError) {
      error_sum_q8_ += weight * error_q8;
      error_weight_ += weight;
    }
  }

  /// Sigma code, -1 when what was read is none.
  int sigma(int own) {
    int context = kSigmaContexts - 1;
    int expected = memory_.sigma_code;
    if (touch_weight_ > 0) {
      expected = (2 * sigma_sum_ + touch_weight_) / (2 * touch_weight_);
      context = sigma_context(expected);
    }
    if (coder_.bit(model_.sigma_same[context], own == expected)) {
      return expected;
    }
    const bool up = coder_.bit(model_.sigma_up[context], own > expected);
    const int apart = up ? own - expected : expected - own;
    const int most = up ? kSigmaCodes - 1 - expected : expected;
    int magnitude = 1;
    while (magnitude <= most &&
           coder_.bit(model_.sigma_more[context][base::min_of(magnitude, kSigmaMagnitudes) - 1],
                      apart > magnitude)) {
      ++magnitude;
    }
    if (magnitude > most) {
      return -1;
    }
    return up ? expected + magnitude : expected - magnitude;
  }

  /// Neighbours that agree, and on which side of `expected` their mean lies.
  [[nodiscard]] int sigma_context(int expected) const {
    if (touch_weight_ < 3) {
      return kSigmaContexts - 2;
    }
    const int off = 4 * (sigma_sum_ - expected * touch_weight_);
    int lean = 1;
    if (off < -touch_weight_) {
      lean = 0;
    } else if (off > touch_weight_) {
      lean = 2;
    }
    return 3 * base::min_of(sigma_most_ - sigma_least_, 3) + lean;
  }

  bool flag_bits(std::uint32_t& flags) {
    const std::uint32_t own = flags;
    flags = coder_.bit(model_.multi_surface[near_multi_], (own & kCellMultiSurface) != 0) ? 1U : 0U;
    if (!coder_.bit(model_.other_flags, own > kCellMultiSurface)) {
      return true;
    }
    const std::uint32_t others = coder_.raw(own >> 1U, 2);
    flags |= others << 1U;
    return others != 0;
  }

  /// Value at the cell of the plane through the neighbours: least squares, slopes held back by a ridge
  /// so that any set of neighbours, one or all in line, has an answer. Weights sum to at most 376 and
  /// depths differ by at most 2^20: products stay below 2^47.
  [[nodiscard]] std::int32_t predict_q8() const {
    if (seen_count_ == 0) {
      return memory_.depth_q8;
    }
    const std::int32_t reference_q8 = seen_[0].depth_q8;
    std::int64_t s = 0;
    std::int64_t sn = 0;
    std::int64_t se = 0;
    std::int64_t sz = 0;
    std::int64_t snn = 1;
    std::int64_t sne = 0;
    std::int64_t see = 1;
    std::int64_t snz = 0;
    std::int64_t sez = 0;
    for (int i = 0; i < seen_count_; ++i) {
      const Seen& other = seen_[static_cast<std::size_t>(i)];
      const std::int64_t weight = other.at.weight;
      const std::int64_t north = weight * other.at.north;
      const std::int64_t east = weight * other.at.east;
      const std::int64_t z = other.depth_q8 - reference_q8;
      s += weight;
      sn += north;
      se += east;
      sz += weight * z;
      snn += north * other.at.north;
      sne += north * other.at.east;
      see += east * other.at.east;
      snz += north * z;
      sez += east * z;
    }
    const std::int64_t a = snn * see - sne * sne;
    const std::int64_t b = se * sne - sn * see;
    const std::int64_t c = sn * sne - snn * se;
    const std::int64_t below = s * a + sn * b + se * c;  // > 0: the ridge
    const std::int64_t above = sz * a + snz * b + sez * c;
    const std::int64_t rounded = above >= 0 ? above / below : -((-above + below - 1) / below);
    return static_cast<std::int32_t>(
        base::clamp<std::int64_t>(reference_q8 + rounded, 0, kMaxCellDepth_q8));
  }

  /// How far off the neighbours' own predictions were, in steps of this cell.
  [[nodiscard]] int activity(int step_shift) const {
    if (seen_count_ == 0) {
      return kActivities - 1;
    }
    if (error_weight_ == 0) {
      return seen_count_ < 3 ? kActivities - 2 : kActivities - 3;
    }
    constexpr std::array<int, kActivities - 4> kAbove_q4 = {3, 5, 7, 10, 14, 20, 28, 44, 72, 160};
    const std::int32_t mean_q4 = ((error_sum_q8_ << 4) / error_weight_) >> step_shift;
    int level = 0;
    for (const int above_q4 : kAbove_q4) {
      level += mean_q4 >= above_q4 ? 1 : 0;
    }
    return level;
  }

  /// Depth as a multiple of the step; false when what was read is out of range.
  bool depth(int at, int step_shift, std::int32_t& depth_q8) {
    const std::int32_t predicted_q8 = predict_q8();
    const std::int32_t expected = (predicted_q8 + (1 << (step_shift - 1))) >> step_shift;
    const std::int32_t beyond_q8 = predicted_q8 - (expected << step_shift);
    const std::int32_t off_q8 = beyond_q8 < 0 ? -beyond_q8 : beyond_q8;
    const int fraction = base::min_of((off_q8 * (2 * kFractions)) >> step_shift, kFractions - 1);
    const int level = activity(step_shift);
    std::int32_t steps = (depth_q8 >> step_shift) - expected;
    if (coder_.bit(model_.depth_same[level][fraction], steps == 0)) {
      steps = 0;
    } else {
      const bool leans_up = beyond_q8 >= 0;
      const bool toward = coder_.bit(model_.depth_toward[level][fraction], (steps > 0) == leans_up);
      std::int32_t magnitude = steps < 0 ? -steps : steps;
      if (!depth_magnitude(level, magnitude)) {
        return false;
      }
      steps = toward == leans_up ? magnitude : -magnitude;
    }
    // |steps| < 2^21, shift at most 16.
    const std::int64_t value_q8 =
        (static_cast<std::int64_t>(expected) + steps) * (1LL << step_shift);
    if (value_q8 < 0 || value_q8 > kMaxCellDepth_q8) {
      return false;
    }
    depth_q8 = static_cast<std::int32_t>(value_q8);
    if (seen_count_ > 0) {
      error_q8_[static_cast<std::size_t>(at)] =
          depth_q8 < predicted_q8 ? predicted_q8 - depth_q8 : depth_q8 - predicted_q8;
    }
    return true;
  }

  /// 1 or more: one bit each up to kDepthMagnitudes, then exponent and mantissa of the rest.
  bool depth_magnitude(int level, std::int32_t& magnitude) {
    for (int i = 0; i < kDepthMagnitudes; ++i) {
      if (!coder_.bit(model_.depth_more[level][i], magnitude > i + 1)) {
        magnitude = i + 1;
        return true;
      }
    }
    const auto rest = static_cast<std::uint32_t>(base::max_of(magnitude - kDepthMagnitudes, 1));
    const int own_exponent = 31 - base::leading_zeros(rest);
    int exponent = 0;
    while (exponent < kExponents &&
           coder_.bit(model_.exponent_more[exponent], own_exponent > exponent)) {
      ++exponent;
    }
    if (exponent == kExponents) {
      return false;
    }
    const auto bits = static_cast<unsigned>(exponent);
    const unsigned low_bits = base::min_of(bits, 10U);
    const std::uint32_t high =
        coder_.raw((rest & ((1U << bits) - 1U)) >> low_bits, bits - low_bits);
    const std::uint32_t low = coder_.raw(rest & ((1U << low_bits) - 1U), low_bits);
    magnitude =
        kDepthMagnitudes + static_cast<std::int32_t>((1U << bits) | (high << low_bits) | low);
    return true;
  }

  Coder& coder_;
  TileModel& model_;
  PacketMemory& memory_;
  std::array<Seen, kNeighbours.size()> seen_{};
  int seen_count_ = 0;
  int near_unknown_ = 0;
  int near_multi_ = 0;
  int sigma_sum_ = 0;
  int touch_weight_ = 0;
  int sigma_least_ = 0;
  int sigma_most_ = 0;
  std::int32_t error_sum_q8_ = 0;
  int error_weight_ = 0;
  std::array<std::int32_t, kTileArea_cells> error_q8_;  ///< of the predictions so far, or kNoError
};

}  // namespace leadline::proto
