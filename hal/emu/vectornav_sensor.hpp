// A VectorNav: text and binary messages.
#pragma once

#include <string>

#include "hal/emu/emulated_device.hpp"
#include "hal/emu/motion.hpp"

namespace leadline::emu {

enum class VectorNavSeal : std::uint8_t { kXor, kCrc, kUnchecked };

/// '$', `body`, '*', checksum, CR LF.
[[nodiscard]] Bytes vectornav_text(const std::string& body, VectorNavSeal seal);
[[nodiscard]] Bytes vectornav_ymr(const Motion& motion, VectorNavSeal seal = VectorNavSeal::kXor);
/// 0xFA, the header that was made of `groups` and masks, fields, CRC.
[[nodiscard]] Bytes vectornav_binary(const Bytes& header, const Bytes& fields);
/// Common group: time since start, yaw-pitch-roll, rates.
[[nodiscard]] Bytes vectornav_common(const Motion& motion);
/// Common group: time since start, quaternion, rates.
[[nodiscard]] Bytes vectornav_quaternion(const Motion& motion);

}  // namespace leadline::emu
