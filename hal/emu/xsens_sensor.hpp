// An Xsens MTi in measurement mode: MTData2 messages.
#pragma once

#include "hal/emu/emulated_device.hpp"
#include "hal/emu/motion.hpp"

namespace leadline::emu {

/// How numbers are written, as the low two bits of a packet's id say it.
enum class XsensNumber : std::uint8_t { kSingle = 0, kFixed20 = 1, kFixed32 = 2, kDouble = 3 };
/// The world, as the next two bits say it.
enum class XsensWorld : std::uint8_t { kEnu = 0x0, kNed = 0x4, kNwu = 0x8 };
enum class XsensOrientation : std::uint8_t { kQuaternion, kMatrix, kEuler };

/// An Xbus message: preamble, bus id 0xFF, `id`, length, `data`, sum.
[[nodiscard]] Bytes xsens_message(unsigned id, const Bytes& data);
/// Clock, orientation, rates, status in one MTData2.
[[nodiscard]] Bytes xsens_mtdata2(const Motion& motion, XsensOrientation orientation,
                                  XsensWorld world = XsensWorld::kEnu,
                                  XsensNumber number = XsensNumber::kSingle,
                                  bool filter_valid = true);

}  // namespace leadline::emu
