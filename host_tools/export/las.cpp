// LAS 1.2 (ASPRS, 2008): point record format 0, and sigma as an extra field of four bytes behind it, which
// the standard allows; a record "Extra Bytes" names it for readers that know those of LAS 1.4.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>

#include "host_tools/export/export_parts.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr std::uint16_t kHeader_bytes = 227;
constexpr std::uint16_t kPoint_bytes = 20;
constexpr std::uint8_t kUnclassified = 1;
constexpr std::uint8_t kGround = 2;
constexpr int kDegreeDigits = 9;

struct LasPoint {
  std::array<double, 3> position;
  float sigma_m;
  std::uint16_t intensity;
};

/// A coordinate as the file has it: offset + scale * integer.
struct LasAxis {
  double scale = 1.0;
  double offset = 0.0;
  double low = 0.0;
  double high = 0.0;

  [[nodiscard]] std::int32_t integer(double value) const {
    return static_cast<std::int32_t>(std::llround((value - offset) / scale));
  }
};

/// As many of `digits` decimals as 32 bits hold over the points' extent.
LasAxis fit_axis(const std::vector<LasPoint>& points, std::size_t axis, int digits) {
  LasAxis fit;
  if (points.empty()) {
    return fit;
  }
  fit.low = HUGE_VAL;
  fit.high = -HUGE_VAL;
  for (const LasPoint& point : points) {
    fit.low = std::min(fit.low, point.position[axis]);
    fit.high = std::max(fit.high, point.position[axis]);
  }
  fit.offset = std::round(0.5 * (fit.low + fit.high));
  const double reach = std::max(fit.high - fit.offset, fit.offset - fit.low);
  do {
    fit.scale = std::pow(10.0, -digits);
    --digits;
  } while (reach / fit.scale > 2.0e9);
  // What a reader computes from the integers, so that no point lies outside.
  const auto stored = [&fit](double value) {
    return fit.offset + fit.scale * static_cast<double>(fit.integer(value));
  };
  fit.low = stored(fit.low);
  fit.high = stored(fit.high);
  return fit;
}

/// Local metres to the file's coordinates.
class LasFrame {
 public:
  LasFrame(const MapSource& source, const ExportPlan& plan) : frame_(plan.frame) {
    if (frame_ == ExportFrame::kLonLat) {
      degrees_ = std::make_unique<GeographicFrame>(plan.reference);
      middle_deg_ = degrees_->at(source.elevation.west_m, source.elevation.south_m).longitude_deg;
    } else if (frame_ == ExportFrame::kProjected) {
      // The very cells of the GeoTIFF in that system.
      placement_ = place_raster(plan.reference, source.elevation);
      require_affine(*placement_, source.elevation);
    }
  }
  [[nodiscard]] std::array<double, 3> at(double east_m, double north_m, double height_m) const {
    if (degrees_) {
      const GeographicPoint point = degrees_->at(east_m, north_m);
      return {longitude_near(point.longitude_deg, middle_deg_), point.latitude_deg, height_m};
    }
    if (placement_) {
      return {placement_->plane.x(east_m, north_m), placement_->plane.y(east_m, north_m), height_m};
    }
    return {east_m, north_m, height_m};
  }

 private:
  ExportFrame frame_;
  std::unique_ptr<GeographicFrame> degrees_;
  double middle_deg_ = 0.0;
  std::optional<Placement> placement_;
};

std::vector<LasPoint> points_of(const MapSource& source, const ExportPlan& plan) {
  const LasFrame frame(source, plan);
  std::vector<LasPoint> points;
  if (plan.layer == ExportLayer::kVoxels) {
    for (const VoxelPoint& voxel : occupied_voxels(*source.model, plan.sign)) {
      const auto& at = voxel.position_m;
      points.push_back({frame.at(at[0], at[1], at[2]), 0.0F,
                        static_cast<std::uint16_t>(std::lround(voxel.probability * 65535.0F))});
    }
    return points;
  }
  const Raster& raster = source.elevation;
  for_each_cell(raster, [&](int row, int column, double elevation_m) {
    const float sigma_m = source.sigma ? static_cast<float>(source.sigma->at(row, column))
                                       : std::numeric_limits<float>::quiet_NaN();
    points.push_back({frame.at(raster.east_of_column_m(column), raster.north_of_row_m(row),
                               signed_height(elevation_m, plan.sign)),
                      sigma_m, 0});
  });
  return points;
}

void record_header(PackedBytes* las, const char* user, std::uint16_t id, std::size_t size_bytes,
                   const char* description) {
  las->value(std::uint16_t{0});
  las->field(user, 16);
  las->value(id);
  las->value(static_cast<std::uint16_t>(size_bytes));
  las->field(description, 32);
}

/// The coordinate system as GeoTIFF keys; nothing for local metres.
std::vector<std::uint16_t> geo_keys(const ExportPlan& plan) {
  struct Key {
    std::uint16_t id;
    std::uint16_t value;
  };
  constexpr std::uint16_t kModelType = 1024;
  constexpr std::uint16_t kGeographicType = 2048;
  constexpr std::uint16_t kAngularUnits = 2054;
  constexpr std::uint16_t kProjectedType = 3072;
  constexpr std::uint16_t kLinearUnits = 3076;
  constexpr std::uint16_t kVerticalUnits = 4099;
  constexpr std::uint16_t kMetre = 9001;
  constexpr std::uint16_t kDegree = 9102;
  constexpr std::uint16_t kWgs84 = 4326;
  if (plan.frame == ExportFrame::kLocal) {
    return {};
  }
  std::vector<Key> keys;
  if (plan.frame == ExportFrame::kLonLat) {
    keys.push_back({kModelType, 2});
    keys.push_back({kGeographicType, kWgs84});
    keys.push_back({kAngularUnits, kDegree});
  } else {
    constexpr int kMostCode = 65535;
    if (*plan.reference.epsg > kMostCode) {
      export_usage_error("--epsg " + std::to_string(*plan.reference.epsg) +
                         ": LAS has room for codes up to 65535; give --frame lonlat");
    }
    keys.push_back({kModelType, 1});
    keys.push_back({kProjectedType, static_cast<std::uint16_t>(*plan.reference.epsg)});
    keys.push_back({kLinearUnits, kMetre});
  }
  keys.push_back({kVerticalUnits, kMetre});
  std::vector<std::uint16_t> directory = {1, 1, 0, static_cast<std::uint16_t>(keys.size())};
  for (const Key& key : keys) {
    for (const std::uint16_t word : {key.id, std::uint16_t{0}, std::uint16_t{1}, key.value}) {
      directory.push_back(word);
    }
  }
  return directory;
}

/// What LAS 1.4 calls an Extra Bytes descriptor.
void sigma_descriptor(PackedBytes* las) {
  constexpr std::uint8_t kFloat = 9;
  constexpr std::size_t kDescriptor_bytes = 192;
  record_header(las, "LASF_Spec", 4, kDescriptor_bytes, "Extra Bytes");
  las->field("", 2);
  las->value(kFloat);
  las->value(std::uint8_t{0});
  las->field("sigma", 32);
  las->field("", 4 + 5 * 24);  // no data, minimum, maximum, scale, offset: none is given
  las->field("one sigma of z, metres", 32);
}

}  // namespace

std::string format_las(const MapSource& source, const ExportPlan& plan) {
  const std::vector<LasPoint> points = points_of(source, plan);
  const bool has_sigma = plan.layer == ExportLayer::kMap && source.sigma.has_value();
  const bool degrees = plan.frame == ExportFrame::kLonLat;
  const int metre_digits = raster_decimals(source.elevation.cell_m);
  const int plane_digits = degrees ? kDegreeDigits : metre_digits;
  const std::array<LasAxis, 3> axes = {fit_axis(points, 0, plane_digits),
                                       fit_axis(points, 1, plane_digits),
                                       fit_axis(points, 2, metre_digits)};
  const std::string words = "leadline: " + origin_text(source, plan) + "; z is " +
                            sign_text(plan.sign) + ", vertical datum " +
                            printable(datum_text(plan.reference), 100) + "; x and y are " +
                            coordinates_text(source, plan);
  PackedBytes records;
  std::uint32_t record_count = 1;
  record_header(&records, "LASF_Spec", 3, words.size() + 1, "Text Area Description");
  records.field(words, words.size() + 1);
  const std::vector<std::uint16_t> keys = geo_keys(plan);
  if (!keys.empty()) {
    record_header(&records, "LASF_Projection", 34735, 2 * keys.size(), "GeoKeyDirectoryTag");
    for (const std::uint16_t key : keys) {
      records.value(key);
    }
    ++record_count;
  }
  if (has_sigma) {
    sigma_descriptor(&records);
    ++record_count;
  }

  const auto point_bytes = static_cast<std::uint16_t>(kPoint_bytes + (has_sigma ? 4 : 0));
  const auto count = static_cast<std::uint32_t>(points.size());
  PackedBytes las;
  las.text("LASF");
  las.field("", 2 + 2 + 16);  // source, encoding, project: none
  las.value(std::uint8_t{1});
  las.value(std::uint8_t{2});
  las.field("MODELING", 32);
  las.field(std::string("leadline ") + LEADLINE_VERSION, 32);
  las.field("", 2 + 2);  // day and year are not told, so that the same map makes the same file
  las.value(kHeader_bytes);
  las.value(static_cast<std::uint32_t>(kHeader_bytes + records.size()));
  las.value(record_count);
  las.value(std::uint8_t{0});
  las.value(point_bytes);
  las.value(count);
  las.value(count);  // of the first return; four more
  las.field("", 4 * 4);
  for (const LasAxis& axis : axes) {
    las.value(axis.scale);
  }
  for (const LasAxis& axis : axes) {
    las.value(axis.offset);
  }
  for (const LasAxis& axis : axes) {
    las.value(axis.high);
    las.value(axis.low);
  }
  las.text(records.take());
  for (const LasPoint& point : points) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      las.value(axes[axis].integer(point.position[axis]));
    }
    las.value(point.intensity);
    las.value(std::uint8_t{1U | 1U << 3U});  // return 1 of 1
    las.value(plan.layer == ExportLayer::kVoxels ? kUnclassified : kGround);
    las.field("", 1 + 1 + 2);  // scan angle, user data, source
    if (has_sigma) {
      las.value(point.sigma_m);
    }
  }
  return las.take();
}

}  // namespace leadline::host
