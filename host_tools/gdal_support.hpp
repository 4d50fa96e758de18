// Ownership and messages of GDAL's C interface, for the files that use it.
#pragma once

#include <memory>
#include <string>

namespace leadline::host {

struct DestroySystem {
  void operator()(void* system) const;
};
using CoordinateSystem = std::unique_ptr<void, DestroySystem>;

struct DestroyTransform {
  void operator()(void* transform) const;
};
using CoordinateTransform = std::unique_ptr<void, DestroyTransform>;

/// Keeps GDAL from printing: its last message becomes part of ours. Registers the drivers once.
class QuietGdal {
 public:
  QuietGdal();
  ~QuietGdal();
  QuietGdal(const QuietGdal&) = delete;
  QuietGdal& operator=(const QuietGdal&) = delete;

  /// ": reason" or nothing.
  [[nodiscard]] static std::string reason();
};

}  // namespace leadline::host
