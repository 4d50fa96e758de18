// Contours and the outline of the coverage, as GeoJSON and as KML.
#include <algorithm>
#include <cmath>
#include <memory>

#include "host_tools/export/export_parts.hpp"
#include "host_tools/export/outline.hpp"
#include "host_tools/render/canvas.hpp"
#include "host_tools/render/contour.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

/// About so many contours where nobody says how far apart; so many at most.
constexpr int kContours = 12;
constexpr double kMostLevels = 1000.0;
/// Degrees: a tenth of a millimetre.
constexpr int kDegreeDigits = 9;

/// A vertex in local metres.
struct LocalPoint {
  double east_m;
  double north_m;
};
using Line = std::vector<LocalPoint>;

struct ContourLine {
  double height_m;  ///< by the plan's sign
  bool closed;
  Line points;  ///< a closed line repeats its first point
};

struct Polygon {
  double area_m2;
  std::vector<Line> rings;  ///< outer first; each repeats its first point
};

struct Features {
  double interval_m = 0.0;
  int height_decimals = 0;
  std::vector<ContourLine> contours;
  std::vector<Polygon> coverage;
};

/// Lines through the centres of cells; what lies between is linear, as GIS programs draw it.
void add_contours(const Raster& elevation, const ExportPlan& plan, Features* features) {
  if (elevation.known_count() == 0 || plan.contour_interval_m == 0.0) {
    return;
  }
  render::Lattice lattice;
  lattice.columns = elevation.columns;
  lattice.rows = elevation.rows;
  lattice.values.reserve(elevation.values.size());
  double low = HUGE_VAL;
  double high = -HUGE_VAL;
  for (const double value : elevation.values) {
    const double height = signed_height(value, plan.sign);
    lattice.values.push_back(static_cast<float>(height));
    if (!std::isnan(height)) {
      low = std::min(low, height);
      high = std::max(high, height);
    }
  }
  const double interval_m =
      plan.contour_interval_m.value_or(render::make_ticks(low, high, kContours).step);
  if (!((high - low) / interval_m <= kMostLevels)) {
    export_usage_error("--contours " + json_number(interval_m) + ": more than 1000 levels from " +
                       json_number(low) + " to " + json_number(high) + " m");
  }
  features->interval_m = interval_m;
  features->height_decimals = render::make_ticks(0.0, interval_m, 1).decimals;
  for (const render::Contour& contour : render::contours(lattice, interval_m, low, high)) {
    ContourLine line{contour.level, contour.closed, {}};
    line.points.reserve(contour.points.size() + 1);
    const auto add = [&line, &elevation](double east_m, double north_m) {
      // A level that is a cell's own height meets all edges of that cell in one point.
      constexpr double kSame_cells = 1e-3;
      if (line.points.empty() ||
          std::hypot(east_m - line.points.back().east_m, north_m - line.points.back().north_m) >
              kSame_cells * elevation.cell_m) {
        line.points.push_back({east_m, north_m});
      }
    };
    for (const render::PointOnLattice& point : contour.points) {
      add(elevation.west_m + (point.column + 0.5) * elevation.cell_m,
          elevation.north_m() - (point.row + 0.5) * elevation.cell_m);
    }
    if (contour.closed) {
      add(line.points.front().east_m, line.points.front().north_m);
      line.points.back() = line.points.front();
    }
    if (line.points.size() < 2) {
      continue;  // around a summit of just that height
    }
    features->contours.push_back(std::move(line));
  }
}

void add_coverage(const Raster& elevation, Features* features) {
  const auto closed = [&elevation](const std::vector<GridCorner>& ring) {
    Line line;
    line.reserve(ring.size() + 1);
    for (std::size_t k = 0; k <= ring.size(); ++k) {
      const GridCorner& corner = ring[k % ring.size()];
      line.push_back({elevation.west_m + corner.column * elevation.cell_m,
                      elevation.north_m() - corner.row * elevation.cell_m});
    }
    return line;
  };
  for (const CoveredArea& area : covered_areas(elevation)) {
    Polygon polygon{static_cast<double>(area.cells) * elevation.cell_m * elevation.cell_m, {}};
    polygon.rings.push_back(closed(area.outer));
    for (const std::vector<GridCorner>& hole : area.holes) {
      polygon.rings.push_back(closed(hole));
    }
    features->coverage.push_back(std::move(polygon));
  }
}

Features features_of(const MapSource& source, const ExportPlan& plan) {
  Features features;
  if (plan.layer != ExportLayer::kCoverage) {
    add_contours(source.elevation, plan, &features);
  }
  if (plan.layer != ExportLayer::kContours) {
    add_coverage(source.elevation, &features);
  }
  return features;
}

/// Writes points the way the plan wants them.
class PointText {
 public:
  PointText(const MapSource& source, const ExportPlan& plan)
      : digits_(raster_decimals(source.elevation.cell_m)) {
    if (plan.frame == ExportFrame::kLonLat) {
      frame_ = std::make_unique<GeographicFrame>(plan.reference);
      const Raster& raster = source.elevation;
      middle_deg_ = frame_->at(raster.west_m, raster.south_m).longitude_deg;
      digits_ = kDegreeDigits;
    }
  }
  void append(std::string* text, const LocalPoint& point) const {
    GeographicPoint shown{point.east_m, point.north_m};
    if (frame_) {
      shown = frame_->at(point.east_m, point.north_m);
      shown.longitude_deg = longitude_near(shown.longitude_deg, middle_deg_);
    }
    append_fixed(text, shown.longitude_deg, digits_);
    *text += ',';
    append_fixed(text, shown.latitude_deg, digits_);
  }

 private:
  std::unique_ptr<GeographicFrame> frame_;
  double middle_deg_ = 0.0;
  int digits_;
};

const char* height_name(const ExportPlan& plan) {
  return plan.sign == VerticalSign::kDepth ? "depth_m" : "elevation_m";
}

std::string height_text(double height_m, const Features& features) {
  std::string text;
  append_fixed(&text, height_m, features.height_decimals);
  return text;
}

std::string json_line(const Line& line, const PointText& points) {
  std::string text = "[";
  for (const LocalPoint& point : line) {
    text += text.size() > 1 ? ",[" : "[";
    points.append(&text, point);
    text += ']';
  }
  return text + "]";
}

/// Five of the markup's own characters, and nothing that XML cannot hold.
std::string xml_text(const std::string& text) {
  std::string escaped;
  for (const char c : printable(text, 200)) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
        break;
    }
  }
  return escaped;
}

std::string kml_line(const Line& line, const PointText& points) {
  std::string text = "<coordinates>";
  for (const LocalPoint& point : line) {
    points.append(&text, point);
    text += ' ';
  }
  text.back() = '<';
  return text + "/coordinates>";
}

}  // namespace

std::string format_geojson(const MapSource& source, const ExportPlan& plan) {
  const Features features = features_of(source, plan);
  const PointText points(source, plan);
  // Members of our own come before the features: who reads only the beginning learns what this is.
  std::string text = "{\"type\": \"FeatureCollection\",\n\"leadline\": {\"source\": " +
                     json_string(origin_text(source, plan)) +
                     ", \"coordinates\": " + json_string(coordinates_text(source, plan)) +
                     ", \"heights\": " + json_string(sign_text(plan.sign)) +
                     ", \"vertical_datum\": " + json_string(datum_text(plan.reference)) + "},\n" +
                     "\"features\": [";
  const char* separator = "\n";
  for (const Polygon& polygon : features.coverage) {
    text += separator + std::string(R"({"type": "Feature", "properties": {"kind": "coverage", )") +
            "\"area_m2\": " + json_number(polygon.area_m2) +
            R"(}, "geometry": {"type": "Polygon", "coordinates": [)";
    for (const Line& ring : polygon.rings) {
      text += (&ring == polygon.rings.data() ? "" : ",") + json_line(ring, points);
    }
    text += "]}}";
    separator = ",\n";
  }
  for (const ContourLine& line : features.contours) {
    text += separator + std::string(R"({"type": "Feature", "properties": {"kind": "contour", ")") +
            height_name(plan) + "\": " + height_text(line.height_m, features) +
            R"(}, "geometry": {"type": "LineString", "coordinates": )" +
            json_line(line.points, points) + "}}";
    separator = ",\n";
  }
  return text + "\n]}\n";
}

std::string format_kml(const MapSource& source, const ExportPlan& plan) {
  const Features features = features_of(source, plan);
  const PointText points(source, plan);
  std::string text =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<kml xmlns=\"http://www.opengis.net/kml/2.2\">\n<Document>\n<name>" +
      xml_text(origin_text(source, plan)) + "</name>\n<description>" +
      xml_text(std::string(sign_text(plan.sign)) + ", vertical datum: " +
               datum_text(plan.reference) + "; " + coordinates_text(source, plan)) +
      "</description>\n"
      "<Style "
      "id=\"contour\"><LineStyle><color>ffb06020</color><width>1.5</width></LineStyle></Style>\n"
      "<Style id=\"coverage\"><LineStyle><color>ff20a0f0</color><width>2</width></LineStyle>"
      "<PolyStyle><color>3020a0f0</color></PolyStyle></Style>\n";
  if (plan.layer != ExportLayer::kContours) {
    text += "<Folder><name>coverage</name>\n";
    for (const Polygon& polygon : features.coverage) {
      text +=
          "<Placemark><styleUrl>#coverage</styleUrl><ExtendedData><Data name=\"area_m2\"><value>" +
          json_number(polygon.area_m2) + "</value></Data></ExtendedData><Polygon>";
      for (const Line& ring : polygon.rings) {
        const bool outer = &ring == polygon.rings.data();
        text += outer ? "<outerBoundaryIs><LinearRing>" : "<innerBoundaryIs><LinearRing>";
        text += kml_line(ring, points);
        text += outer ? "</LinearRing></outerBoundaryIs>" : "</LinearRing></innerBoundaryIs>";
      }
      text += "</Polygon></Placemark>\n";
    }
    text += "</Folder>\n";
  }
  if (plan.layer != ExportLayer::kCoverage) {
    text += "<Folder><name>contours</name>\n";
    for (const ContourLine& line : features.contours) {
      const std::string height = height_text(line.height_m, features);
      text += "<Placemark><name>" + height +
              " m</name><styleUrl>#contour</styleUrl><ExtendedData><Data name=\"" +
              height_name(plan) + "\"><value>" + height +
              "</value></Data></ExtendedData><LineString>" + kml_line(line.points, points) +
              "</LineString></Placemark>\n";
    }
    text += "</Folder>\n";
  }
  return text + "</Document>\n</kml>\n";
}

}  // namespace leadline::host
