// A Doppler log of four Janus beams that sends PD0 ensembles.
#pragma once

#include <array>
#include <cstdint>

#include "hal/emu/emulated_device.hpp"
#include "hal/emu/motion.hpp"

namespace leadline::emu {

enum class Pd0Coordinates : std::uint8_t { kBeam = 0, kInstrument = 1, kShip = 2, kEarth = 3 };

struct Pd0Setup {
  Pd0Coordinates coordinates = Pd0Coordinates::kBeam;
  double beam_angle_deg = 20;
  double alignment_deg = 0;  ///< beam 3 clockwise from the bow (EA)
  bool convex = true;
  bool looks_up = false;
  bool three_beam = false;  ///< solutions of three beams are allowed
  bool tilts = true;        ///< ship and earth coordinates are level
  bool bottom_track = true;
  bool depth_sensor = false;
  std::array<bool, 4> bad_beam{};
};

/// One ensemble; `number` counts them.
[[nodiscard]] Bytes pd0_ensemble(const Motion& motion, const Pd0Setup& setup, unsigned number = 1);
/// Header, blocks and checksum around blocks that the caller made.
[[nodiscard]] Bytes pd0_frame(const std::vector<Bytes>& blocks);

}  // namespace leadline::emu
