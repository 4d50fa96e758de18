// What the formats of `leadline export` have in common; used inside this folder only.
#pragma once

#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "host_tools/export/export.hpp"

namespace leadline::host {

/// HostError kUsage, "export: " in front.
[[noreturn]] void export_usage_error(const std::string& message);

/// Where the map comes from, and the survey's name: fit to be printed.
[[nodiscard]] std::string origin_text(const MapSource& source, const ExportPlan& plan);

/// The vertical datum in words, "not stated" where nobody did.
[[nodiscard]] std::string datum_text(const GeoReference& reference);

/// "depth in metres, positive down" or its opposite.
[[nodiscard]] const char* sign_text(VerticalSign sign);

/// What the coordinates in the file are, in words.
[[nodiscard]] std::string coordinates_text(const MapSource& source, const ExportPlan& plan);

[[nodiscard]] inline double signed_height(double elevation_m, VerticalSign sign) {
  return sign == VerticalSign::kDepth ? -elevation_m : elevation_m;
}

/// Calls visit(row, column, elevation) for every known cell, north to south, west to east.
template <typename Visit>
void for_each_cell(const Raster& raster, Visit visit) {
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      if (!std::isnan(raster.at(row, column))) {
        visit(row, column, raster.at(row, column));
      }
    }
  }
}

/// Centre of an occupied voxel: east, north (local metres) and height by the plan's sign.
struct VoxelPoint {
  std::array<double, 3> position_m;
  float probability;
};
[[nodiscard]] std::vector<VoxelPoint> occupied_voxels(const SavedModel& model, VerticalSign sign);

/// Little-endian binary, packed.
class PackedBytes {
 public:
  void text(const std::string& text) { bytes_ += text; }
  /// `text` in a field of `size` bytes, cut or filled with zeros.
  void field(const std::string& text, std::size_t size) {
    std::string filled = text.substr(0, size);
    filled.resize(size, '\0');
    bytes_ += filled;
  }
  template <typename Value>
  void value(Value value) {
    static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "written as memory has it");
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes_.append(raw, sizeof raw);
  }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

}  // namespace leadline::host
