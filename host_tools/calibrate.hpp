// The patch test: how a head is turned on its vehicle, and how late the attitude is, from soundings that
// overlap. No bottom lies at two depths: what is wrong with the mounting shows as soundings of one cell
// that do not lie on one plane.
//
// What is minimized. Soundings are sorted into square cells; a plane is fitted through each cell's
// (depth over north and east), so slopes cost nothing and a cell that only one line has seen says little.
// The residuals from the planes are made as small as they can be over the parameters: Gauss-Newton,
// derivatives by differences, Huber weights at 2.5 robust sigma, nothing beyond 10. A cell keeps its
// soundings during one step and gets new ones for the next.
//
// What a slope says. A horizontal shift shows as depth only over a slope. Slopes of noise would let the
// heading look known over a flat bottom, so a cell's slope counts in the derivatives only when it is
// larger than 4 times its own sigma.
//
// Sigmas are not those of independent soundings: the terrain is not plane in a cell, and attitude errors
// last for seconds. Pieces of ground (5 cells wide) and blocks of time are taken as independent of each
// other, not what lies within one (sandwich estimate, clustered both ways).
//
// A single line shows the boresight only in the second order (what a head that is turned does while the vehicle
// swings), where anything else that is slightly wrong shows, too: such angles fit well and are wrong. So
// they are looked for only where two passes cover the same ground; latency and lever arm, which the
// vehicle's motion shows, are looked for in any case.
//
// What cannot be seen gets no number. A prior sigma (kAlignmentTraits) keeps the equations solvable; a
// parameter whose sigma stays above `limit` is refused, with the reason: either the soundings hardly
// depend on it, or not otherwise than on another one. A refused angle or latency stays free in the
// equations, so that the sigmas of the others include it; a refused lever arm is held as given and the
// rest is fitted anew, as in every patch test: pitch is known as well as that lever arm is. The same is done
// to a lever arm that goes with an angle by more than kLeverArmCorrelation, however small its sigma: at
// one altitude pitch and forward shift soundings alike, and what would tell them apart is of second order.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "host_tools/grid_baselines.hpp"

namespace leadline::host {

/// What is found; all in addition to what is given.
enum class AlignmentParameter : std::uint8_t {
  kRoll,             ///< of the head on the vehicle, degrees
  kPitch,            ///< degrees
  kHeading,          ///< degrees
  kLatency,          ///< the attitude of a stamp was true that much earlier, milliseconds
  kForward,          ///< of the lever arm, metres
  kStarboard,        ///< metres
  kPositionLatency,  ///< the position of a stamp was true that much earlier, milliseconds
};
inline constexpr std::size_t kAlignmentParameters = 7;

/// In the order and the units of AlignmentParameter.
using Alignment = std::array<double, kAlignmentParameters>;
using AlignmentChoice = std::array<bool, kAlignmentParameters>;

struct AlignmentTraits {
  const char* name;
  const char* unit;
  double step;      ///< of the differences
  double limit;     ///< no number is given with a larger sigma
  double prior;     ///< sigma of what is given
  double farthest;  ///< a solution that far from what is given is none
};
inline constexpr std::array<AlignmentTraits, kAlignmentParameters> kAlignmentTraits = {
    {{"roll", "deg", 0.02, 0.2, 5.0, 15.0},
     {"pitch", "deg", 0.02, 0.5, 5.0, 15.0},
     {"heading", "deg", 0.05, 1.0, 10.0, 30.0},
     {"latency", "ms", 2.0, 20.0, 200.0, 600.0},
     {"forward", "m", 0.02, 0.25, 3.0, 10.0},
     {"starboard", "m", 0.02, 0.25, 3.0, 10.0},
     {"position_latency", "ms", 10.0, 100.0, 1000.0, 3000.0}}};

inline constexpr double kLeverArmCorrelation = 0.95;

/// A sign turned round before everything else.
enum class SignFlip : std::uint8_t { kNone, kRoll, kPitch };

/// Where soundings come to lie for an alignment. Element i is always the same beam of the same ping.
class AlignedSoundings {
 public:
  AlignedSoundings() = default;
  AlignedSoundings(const AlignedSoundings&) = delete;
  AlignedSoundings& operator=(const AlignedSoundings&) = delete;
  virtual ~AlignedSoundings() = default;

  /// Number of the block of time (kBlock_us of one line) of each sounding, ascending from 0.
  [[nodiscard]] virtual const std::vector<std::uint32_t>& blocks() const = 0;
  /// Number of the pass of each sounding, ascending: another line, or kPassTurn_deg off its course at first.
  [[nodiscard]] virtual const std::vector<std::uint32_t>& passes() const = 0;
  /// As many soundings as blocks() has; one that has no place has NaN for its depth.
  virtual void place(const Alignment& alignment, SignFlip flip,
                     std::vector<Sounding>* soundings) const = 0;
};
inline constexpr std::int64_t kBlock_us = 2'000'000;
inline constexpr double kPassTurn_deg = 45.0;

struct CalibrationSettings {
  AlignmentChoice fit = {true, true, true, true, true, true, false};
  double cell_m = 1.0;
  std::size_t min_soundings = 10;  ///< of a cell; at least 6
};

struct CalibratedParameter {
  bool fitted = false;      ///< it was asked for
  bool observable = false;  ///< the rest is meaningless without
  double value = 0;
  double sigma = 0;
  std::string why_not;  ///< for people; "" when observable or not asked for
};

struct Calibration {
  std::array<CalibratedParameter, kAlignmentParameters> parameters;
  std::size_t soundings = 0;  ///< in cells that have enough
  std::size_t cells = 0;
  std::size_t shared_cells = 0;  ///< of these, those that two passes or more have seen
  unsigned steps = 0;            ///< of Gauss-Newton, of the last fit
  double spread_before_m = 0;    ///< robust sigma about the planes, as given
  double spread_after_m = 0;     ///< of the solution, refused parameters as they came out
};

/// Fewest cells with enough soundings; and fewest shared ones for the boresight.
inline constexpr std::size_t kMinCalibrationCells = 20;

/// Throws HostError kInput: too few cells; no convergence or a solution beyond `farthest` (with the numbers).
/// Each step places all soundings once per parameter; some 5 steps.
[[nodiscard]] Calibration calibrate(const AlignedSoundings& source,
                                    const CalibrationSettings& settings,
                                    SignFlip flip = SignFlip::kNone);

}  // namespace leadline::host
