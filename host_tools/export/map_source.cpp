#include "host_tools/export/map_source.hpp"

#include <filesystem>
#include <fstream>
#include <iostream>
#include <vector>

#include <nlohmann/json.hpp>

#include "firmware/config/input_file.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/map_output.hpp"
#include "host_tools/store/survey_store.hpp"
#include "host_tools/topside/flight_log.hpp"
#include "host_tools/topside/receiver.hpp"
#include "host_tools/topside/soundings.hpp"
#include "proto/framing.hpp"

namespace leadline::host {
namespace {

namespace fs = std::filesystem;

/// The place as `leadline receive` has left it beside its map.
GeoReference received_reference(const std::string& path) {
  std::ifstream file(path);
  const nlohmann::json summary = nlohmann::json::parse(file, nullptr, false);
  GeoReference reference;
  if (!summary.is_object() || !summary.contains("frame") || !summary["frame"].is_object()) {
    return reference;
  }
  const nlohmann::json& frame = summary["frame"];
  const auto number = [&frame](const char* key) -> std::optional<double> {
    const auto found = frame.find(key);
    const bool there = found != frame.end() && found->is_number();
    return there ? std::optional<double>(found->get<double>()) : std::nullopt;
  };
  reference.lat_deg = number("lat");
  reference.lon_deg = number("lon");
  if (const std::optional<double> epsg = number("epsg")) {
    reference.epsg = static_cast<int>(*epsg);
  }
  const auto text = [](const nlohmann::json& of, const char* key) -> std::optional<std::string> {
    const auto found = of.find(key);
    const bool there = found != of.end() && found->is_string();
    return there ? std::optional<std::string>(found->get<std::string>()) : std::nullopt;
  };
  reference.vertical_datum = text(frame, "vertical_datum");
  reference.survey_name = text(summary, "survey_name");
  return reference;
}

/// The configuration has the texts in full where a hello had no room for them, and says them where the hello is
/// older than that. A log without a whole configuration still has its hellos.
void take_configured_names(const std::string& path, GeoReference* reference) {
  try {
    const FlightLog log(path);
    reference->vertical_datum = config_text(log.config().vertical_datum);
    reference->survey_name = config_text(log.config().survey_name);
  } catch (const HostError&) {
  }
}

/// A log starts with a frame, hence with a zero byte: no raster does. One whose beginning is lost, or that is
/// empty, has its ending left.
bool is_log(const std::string& path) {
  constexpr std::string_view kEnding = ".lll";
  if (path.size() > kEnding.size() &&
      path.compare(path.size() - kEnding.size(), kEnding.size(), kEnding) == 0) {
    return true;
  }
  std::ifstream file(path, std::ios::binary);
  char first = 1;
  return file.read(&first, 1) && first == static_cast<char>(proto::kDelimiter);
}

MapSource load_log(const std::string& path) {
  std::ifstream file = open_input(path);
  Receiver receiver;
  std::vector<char> buffer(65536);
  while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size())) ||
         file.gcount() > 0) {
    receiver.feed(reinterpret_cast<const std::uint8_t*>(buffer.data()),
                  static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) {
    throw HostError(ExitCode::kInput, path + ": cannot be read to its end");
  }
  const TileStore* const store = receiver.store();
  if (store == nullptr || store->known_cells() == 0) {
    throw HostError(ExitCode::kInput,
                    path + ": no map in it (" + std::to_string(receiver.counters().frames) +
                        " whole frames, " + std::to_string(receiver.counters().damaged_frames) +
                        " damaged)");
  }
  MapSource source;
  source.elevation = store->elevation();
  source.sigma = store->sigma();
  source.reference = hello_reference(store->hello());
  take_configured_names(path, &source.reference);
  source.surveys = {survey_label(store->hello())};
  source.origin = path + ", the link's map";
  return source;
}

MapSource load_store(const std::string& path) {
  const OpenedSurvey opened = open_survey(path);
  MapSource source;
  source.elevation = opened.map->elevation();
  source.sigma = opened.map->sigma();
  source.reference = hello_reference(opened.survey.hello);
  source.surveys = opened.survey.kind == "merged"
                       ? opened.survey.parts
                       : std::vector<std::string>{survey_label(opened.survey.hello)};
  source.origin = parse_store_path(path).file + ", survey " + std::to_string(opened.survey.number);
  if (opened.load.damaged_tiles > 0) {
    std::cerr << "leadline: warning: " << source.origin << ": " << opened.load.damaged_tiles
              << " damaged tiles are left out\n";
  }
  return source;
}

MapSource load_folder(const std::string& path) {
  MapSource source;
  source.origin = path;
  std::error_code ignored;
  source.elevation = read_esri_ascii(path + "/depth.asc");
  if (fs::exists(path + "/sigma.asc", ignored)) {
    source.sigma = read_esri_ascii(path + "/sigma.asc");
    if (!same_geometry(source.elevation, *source.sigma)) {
      throw HostError(ExitCode::kInput, path + ": depth.asc has " +
                                            describe_geometry(source.elevation) +
                                            ", sigma.asc has " + describe_geometry(*source.sigma));
    }
  }
  if (fs::exists(path + "/model.llm", ignored)) {
    source.model = load_model_file(path);
    source.reference = map_reference(source.model->config);
  } else if (fs::exists(path + "/receive.json", ignored)) {
    source.reference = received_reference(path + "/receive.json");
  }
  return source;
}

MapSource load_file(const std::string& path) {
  MapSource source;
  source.origin = path;
  const bool is_ascii = path.size() >= 4 && path.substr(path.size() - 4) == ".asc";
  if (is_ascii) {
    source.elevation = read_esri_ascii(path);
    return source;
  }
  GeoTiffContent content = read_geotiff(path);
  source.elevation = std::move(content.elevation);
  source.sigma = std::move(content.sigma);
  source.reference.epsg = content.epsg;
  source.reference.lat_deg = content.lat_deg;
  source.reference.lon_deg = content.lon_deg;
  if (!content.vertical_datum.empty()) {
    source.reference.vertical_datum = content.vertical_datum;
  }
  if (!content.survey_name.empty()) {
    source.reference.survey_name = content.survey_name;
  }
  return source;
}

}  // namespace

GeoReference hello_reference(const proto::Hello& hello) {
  GeoReference reference;
  if (hello.has_geodetic_origin != 0) {
    reference.lat_deg = static_cast<double>(hello.latitude_e9deg) / 1e9;
    reference.lon_deg = static_cast<double>(hello.longitude_e9deg) / 1e9;
  }
  if (hello.epsg != 0) {
    reference.epsg = hello.epsg;
  }
  const auto text = [](const proto::HelloText& from) -> std::optional<std::string> {
    return from.size_bytes == 0 ? std::nullopt
                                : std::optional<std::string>({from.text, from.size_bytes});
  };
  reference.vertical_datum = text(hello.vertical_datum);
  reference.survey_name = text(hello.survey_name);
  return reference;
}

std::string survey_label(const proto::Hello& hello) {
  return "survey " + std::to_string(hello.survey_id) + ", session " + std::to_string(hello.session);
}

bool is_log_or_store(const std::string& path) {
  std::error_code ignored;
  return !fs::is_directory(path, ignored) && (is_log(path) || is_store_path(path));
}

MapSource load_map_source(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    return load_folder(path);
  }
  if (is_store_path(path)) {
    return load_store(path);
  }
  (void)open_input(path);  // throws the reason; GDAL would say that it is no raster
  return is_log(path) ? load_log(path) : load_file(path);
}

}  // namespace leadline::host
