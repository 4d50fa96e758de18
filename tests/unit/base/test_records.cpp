// The records that everything else builds on: sizes, limits and ranges are contracts.
#include <type_traits>

#include "model/base/ping.hpp"
#include "model/base/pose.hpp"
#include "model/base/units.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::base;  // NOLINT: a test of this namespace

// Records are copied through rings and compared in logs: plain bytes, whatever the target.
static_assert(std::is_trivially_copyable_v<Ping> && std::is_standard_layout_v<Ping>);
static_assert(std::is_trivially_copyable_v<Pose> && std::is_standard_layout_v<Pose>);
static_assert(std::is_trivially_copyable_v<PoseCovariance>);
static_assert(std::is_trivially_copyable_v<RangeProfile>);
static_assert(std::is_signed_v<TimeUs> && sizeof(TimeUs) == 8);

TEST(sizes) {
  assert_int_equal(sizeof(Attitude), 12);
  assert_int_equal(sizeof(PoseCovariance), 24);
  assert_int_equal(sizeof(Pose), 72);
  // A ping carries one pointer; on a 64-bit host the rest packs to this.
  assert_int_equal(sizeof(Ping), sizeof(void*) == 8 ? 88 : sizeof(Ping));
}

TEST(angles_wrap_as_integers_do) {
  const Bam32 almost_full_turn = 0xFFFFFFFFU;
  assert_int_equal(static_cast<Bam32>(almost_full_turn + 1U), 0);
  assert_int_equal(2U * kBam32QuarterTurn, kBam32HalfTurn);
}

TEST(limits_fit_the_arithmetic) {
  // Positions are micrometres in 64 bits; millimetres of the farthest one fit 32 bits.
  assert_true(kMaxHorizontal_um / 1000 < (1LL << 31));
  assert_true(kMaxVertical_um < kMaxHorizontal_um);
  assert_true(kMaxRange_um <= kMaxVertical_um);
}

TEST(validity_needs_every_bit) {
  assert_int_equal(kPoseAll, 7);
  assert_int_equal(kPoseHorizontal & kPoseVertical, 0);
  assert_int_equal(kPoseAttitude & (kPoseHorizontal | kPoseVertical), 0);
}

}  // namespace
