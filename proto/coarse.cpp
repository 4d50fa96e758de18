#include "proto/coarse.hpp"

#include "model/base/angle.hpp"
#include "model/base/fixed.hpp"

namespace leadline::proto {
namespace {

/// Of the last sigma code: beyond it all sigmas are one. With depths of 2^19 at most, 16 squares of a cell and 256
/// variances stay below 2^55.
constexpr std::uint32_t kMostSigma_q12 = 1U << 21U;

}  // namespace

void CoarseSum::add(std::int32_t depth_q8, std::uint32_t sigma_q12) {
  if (depth_q8 == kUnknownDepth_q8) {
    return;
  }
  const auto depth =
      static_cast<std::uint64_t>(base::clamp<std::int32_t>(depth_q8, 0, kMaxCellDepth_q8));
  const std::uint64_t sigma = base::min_of(sigma_q12, kMostSigma_q12);
  depth_sum_q8_ += depth;
  depth_squares_q16_ += depth * depth;
  sigma_squares_q24_ += sigma * sigma;
  ++count_;
}

std::int32_t CoarseSum::depth_q8() const {
  return static_cast<std::int32_t>((depth_sum_q8_ + count_ / 2) / count_);
}

std::uint64_t CoarseSum::variance_q24() const {
  const std::uint64_t spread_q16 = (count_ * depth_squares_q16_ - depth_sum_q8_ * depth_sum_q8_) /
                                   (std::uint64_t{count_} * count_);
  return sigma_squares_q24_ / count_ + (spread_q16 << 8U);
}

void CoarseTile::set(int cell, const CoarseSum& sum) {
  if (!sum.known()) {
    return;
  }
  known_.set(cell);
  depths_q8_[cell] = sum.depth_q8();
  variances_q24_ += sum.variance_q24();
}

void CoarseTile::code(CodedCell* cells) const {
  const int count = known_.count();
  const std::uint32_t sigma_q12 =
      count == 0 ? 0U : base::isqrt_u64(variances_q24_ / static_cast<std::uint64_t>(count));
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    cells[cell] = known_.test(cell) ? code_cell(depths_q8_[cell], sigma_q12, 0) : kUnknownCell;
  }
}

}  // namespace leadline::proto
