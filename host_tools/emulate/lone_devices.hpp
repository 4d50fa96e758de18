// Every device that has an emulated side (hal/emu), alone in a small scene.
//
// Heads look down: sounders and fans straight below, the fan across the track; scanners and the 3-D camera have
// their forward axis down, and scanners turn across the track. What one hears is the bottom along the beam's
// axis, as a range or as an echo of one bin among weak noise.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "firmware/pipeline/drivers.hpp"
#include "hal/emu/emulated_device.hpp"
#include "host_tools/emulate/device_scene.hpp"

namespace leadline::host {

/// `variant`: a position in variant_names() (firmware/config/port_section.hpp); devices of one kind ignore it.
/// Null where the driver has no emulated side.
[[nodiscard]] std::unique_ptr<emu::EmulatedDevice> make_lone_device(firmware::Driver driver,
                                                                    std::size_t variant,
                                                                    const DeviceScene& scene);
/// Whether make_lone_device() knows it.
[[nodiscard]] bool has_lone_device(firmware::Driver driver);
/// Their names, separated by spaces.
[[nodiscard]] std::string lone_device_names();

}  // namespace leadline::host
