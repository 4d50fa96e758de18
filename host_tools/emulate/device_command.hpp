// `leadline emulate DEVICE`: one device at one port.
#pragma once

#include <cstdint>
#include <string>

#include "host_tools/emulate/device_scene.hpp"

namespace leadline::host {

struct EmulateDeviceOptions {
  std::string device;  ///< a driver's name
  std::string model;   ///< of variant_names(); "": the first that is a device
  /// Of hal/linux/uri.hpp, or "pty:" (its name is said) or "pty:PATH" (and a link to it).
  std::string port_uri;
  DeviceScene scene;
  double speed = 1.0;      ///< times real time
  double seconds = 0.0;    ///< of the device's time; 0: until a signal comes
  double drop = 0.0;       ///< share of the bytes sent that are lost
  double corrupt = 0.0;    ///< and that are changed
  std::uint64_t seed = 1;  ///< of the two
};

/// The command. Says on standard error where the device is before it starts, and prints what it sent at the
/// end. Throws HostError: kUsage (no such device or model, one without an emulated side, a port that the
/// device cannot be at), kOutput.
int run_emulate_device(const EmulateDeviceOptions& options);

}  // namespace leadline::host
