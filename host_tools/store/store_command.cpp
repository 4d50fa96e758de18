#include "host_tools/store/store_command.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <iomanip>
#include <iostream>

#include "host_tools/exit_codes.hpp"
#include "host_tools/map_output.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/render/render.hpp"
#include "host_tools/store/merge.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

/// "2026-03-14 15:09:26 UTC".
std::string time_text(std::int64_t unix_s) {
  const auto seconds = static_cast<std::time_t>(unix_s);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  char text[40];
  return std::string(text, std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S UTC", &parts));
}

std::string metres_text(double value, int digits) {
  std::string text;
  append_fixed(&text, value, digits);
  return text;
}

std::string grid_text(const proto::Hello& hello) {
  return std::to_string(hello.size_cells[0]) + " x " + std::to_string(hello.size_cells[1]) +
         " cells of " + json_number(hello.cell_mm / 1000.0) + " m";
}

std::string place_text(const proto::Hello& hello) {
  std::string text;
  if (hello.has_geodetic_origin != 0) {
    text = "origin at " + json_number(static_cast<double>(hello.latitude_e9deg) / 1e9) + ", " +
           json_number(static_cast<double>(hello.longitude_e9deg) / 1e9);
  }
  if (hello.epsg != 0) {
    text += (text.empty() ? "EPSG:" : ", EPSG:") + std::to_string(hello.epsg);
  }
  return text.empty() ? "no place on Earth" : text;
}

/// What list and show say of a survey, as members of a JSON object.
std::string survey_json(const StoredSurvey& survey) {
  const proto::Hello& hello = survey.hello;
  std::string text = "\"number\": " + std::to_string(survey.number) +
                     ", \"kind\": " + json_string(survey.kind) +
                     ", \"name\": " + json_string(survey.name) +
                     ", \"survey_id\": " + std::to_string(hello.survey_id) +
                     ", \"session\": " + std::to_string(hello.session) +
                     ", \"cell_m\": " + json_number(hello.cell_mm / 1000.0) +
                     ", \"cells_north\": " + std::to_string(hello.size_cells[0]) +
                     ", \"cells_east\": " + std::to_string(hello.size_cells[1]) +
                     ", \"known_cells\": " + std::to_string(survey.known_cells) +
                     ", \"tiles\": " + std::to_string(survey.tiles) +
                     ", \"begun_unix_s\": " + std::to_string(survey.begun_unix_s) +
                     ", \"saved_unix_s\": " + std::to_string(survey.saved_unix_s);
  if (hello.has_geodetic_origin != 0) {
    text += ", \"lat\": " + json_number(static_cast<double>(hello.latitude_e9deg) / 1e9) +
            ", \"lon\": " + json_number(static_cast<double>(hello.longitude_e9deg) / 1e9);
  }
  if (hello.epsg != 0) {
    text += ", \"epsg\": " + std::to_string(hello.epsg);
  }
  if (hello.vertical_datum.size_bytes > 0) {
    text += ", \"vertical_datum\": " +
            json_string({hello.vertical_datum.text, hello.vertical_datum.size_bytes});
  }
  return text;
}

std::string survey_name(const StoredSurvey& survey) {
  if (survey.kind == "merged") {
    return survey.name.empty() ? "merged" : "merged: " + printable(survey.name, 60);
  }
  return survey_label(survey.hello) +
         (survey.name.empty() ? "" : " (" + printable(survey.name, 60) + ")");
}

}  // namespace

int run_store_list(const StoreShowOptions& options) {
  const SurveyStore store(parse_store_path(options.path).file, SurveyStore::Access::kRead);
  const std::vector<StoredSurvey> surveys = store.surveys();
  if (options.json) {
    std::cout << "[";
    for (const StoredSurvey& survey : surveys) {
      std::cout << (&survey == surveys.data() ? "\n" : ",\n") << "  {" << survey_json(survey)
                << "}";
    }
    std::cout << "\n]\n";
    return static_cast<int>(ExitCode::kOk);
  }
  for (const StoredSurvey& survey : surveys) {
    std::cout << "#" << survey.number << "  " << survey_name(survey) << "  "
              << grid_text(survey.hello) << ", " << survey.known_cells << " known, "
              << place_text(survey.hello) << ", saved " << time_text(survey.saved_unix_s) << "\n";
  }
  if (surveys.empty()) {
    std::cout << options.path << ": no survey yet\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

int run_store_show(const StoreShowOptions& options) {
  const OpenedSurvey opened = open_survey(options.path);
  const TileStore& map = *opened.map;
  std::size_t disputed = 0;
  for (const DisputedCells& tile : opened.disputed) {
    disputed += tile.count();
  }
  const Raster elevation = map.elevation();
  double low = HUGE_VAL;
  double high = -HUGE_VAL;
  for (const double value : elevation.values) {
    if (!std::isnan(value)) {
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  const std::string hash = hex_text(map.cells_hash(), 16);
  if (options.json) {
    std::cout << "{" << survey_json(opened.survey) << ", \"cells_hash\": \"" << hash
              << "\", \"incomplete_tiles\": " << map.tiles_incomplete()
              << ", \"damaged_tiles\": " << opened.load.damaged_tiles
              << ", \"disputed_cells\": " << disputed
              << ", \"shallowest_m\": " << json_number(-high)
              << ", \"deepest_m\": " << json_number(-low) << "}\n";
    return static_cast<int>(ExitCode::kOk);
  }
  const StoredSurvey& survey = opened.survey;
  std::cout << survey_name(survey) << "\n"
            << "grid       " << grid_text(survey.hello) << ", corner at north "
            << json_number(static_cast<double>(survey.hello.origin_mm[0]) / 1000.0) << ", east "
            << json_number(static_cast<double>(survey.hello.origin_mm[1]) / 1000.0) << " m, "
            << place_text(survey.hello) << "\n"
            << "known      " << map.known_cells() << " of " << map.grid_cells() << " cells, "
            << map.known_tiles() << " tiles (" << map.tiles_incomplete() << " incomplete, "
            << opened.load.damaged_tiles << " damaged)";
  if (map.known_cells() > 0) {
    std::cout << ", " << metres_text(-high, 2) << " to " << metres_text(-low, 2) << " m deep";
  }
  std::cout << "\n";
  if (disputed > 0) {
    std::cout << "disputed   " << disputed << " cells where surveys contradict each other\n";
  }
  std::cout << "begun      " << time_text(survey.begun_unix_s) << ", saved "
            << time_text(survey.saved_unix_s) << "\ncells_hash=" << hash << "\n";
  return static_cast<int>(ExitCode::kOk);
}

CodedMap code_map(const Raster& elevation, const Raster& sigma, const Raster& disputed,
                  const GeoReference& reference) {
  const auto refuse = [](const std::string& reason) {
    throw HostError(ExitCode::kInput, "store: " + reason + ": write rasters with --out instead");
  };
  double low = HUGE_VAL;
  double high = -HUGE_VAL;
  for (const double value : elevation.values) {
    if (!std::isnan(value)) {
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  if (!(low <= high)) {
    refuse("the merged map has no known cell");
  }
  const double cell_mm = elevation.cell_m * 1000.0;
  if (std::fabs(cell_mm - std::round(cell_mm)) > 1e-6 * cell_mm) {
    refuse("cells of " + json_number(elevation.cell_m) + " m are no whole millimetres");
  }
  proto::Hello hello{};
  hello.protocol_major = proto::kProtocolMajor;
  hello.tile_side_cells = proto::kTileSide_cells;
  hello.cell_mm = static_cast<std::int32_t>(std::lround(cell_mm));
  hello.size_cells[0] = elevation.rows;
  hello.size_cells[1] = elevation.columns;
  hello.origin_mm[0] = std::llround(elevation.south_m * 1000.0);
  hello.origin_mm[1] = std::llround(elevation.west_m * 1000.0);
  // The top: a whole cell above the shallowest.
  const double top_m = std::floor(-high / elevation.cell_m) * elevation.cell_m;
  hello.origin_mm[2] = std::llround(top_m * 1000.0);
  const double cells_down =
      std::ceil((-low * 1000.0 - static_cast<double>(hello.origin_mm[2])) / hello.cell_mm) + 1.0;
  hello.size_cells[2] = static_cast<std::int32_t>(std::min(cells_down, 1e6));
  if (reference.lat_deg && reference.lon_deg) {
    hello.has_geodetic_origin = 1;
    hello.latitude_e9deg = std::llround(*reference.lat_deg * 1e9);
    hello.longitude_e9deg = std::llround(*reference.lon_deg * 1e9);
  }
  hello.epsg = reference.epsg.value_or(0);
  proto::name_survey(hello, nullptr, reference.vertical_datum.value_or("").c_str(),
                     proto::kMaxHello_bytes);
  std::uint8_t bytes[proto::kMaxHello_bytes];
  if (!proto::encode_hello(hello, bytes, sizeof bytes).ok()) {
    refuse("no store holds " + describe_geometry(elevation) + ", " + json_number(cells_down) +
           " cells deep");
  }
  CodedMap coded{std::make_unique<TileStore>(hello), {}};
  coded.disputed.resize(coded.map->tile_count());
  const int tiles_east = (elevation.columns + proto::kTileSide_cells - 1) / proto::kTileSide_cells;
  for (std::uint32_t id = 0; id < coded.map->tile_count(); ++id) {
    StoredTile tile;
    tile.tile = id;
    tile.generation = 1;
    bool known = false;
    for (int k = 0; k < proto::kTileArea_cells; ++k) {
      const int north = static_cast<int>(id) / tiles_east * proto::kTileSide_cells + (k >> 4);
      const int column = static_cast<int>(id) % tiles_east * proto::kTileSide_cells + (k & 15);
      const int row = elevation.rows - 1 - north;
      if (!elevation.contains(row, column) || std::isnan(elevation.at(row, column))) {
        continue;
      }
      const double depth_cells =
          (-elevation.at(row, column) * 1000.0 - static_cast<double>(hello.origin_mm[2])) /
          hello.cell_mm;
      const double sigma_q12 =
          std::min(sigma.at(row, column) * 1000.0 / hello.cell_mm * 4096.0, 4.0e9);
      tile.cells[k] = proto::code_cell(static_cast<std::int32_t>(std::lround(depth_cells * 256.0)),
                                       static_cast<std::uint32_t>(std::llround(sigma_q12)), 0);
      coded.disputed[id].set(static_cast<std::size_t>(k), disputed.at(row, column) == 1.0);
      known = true;
    }
    if (known) {
      tile.hash32 = proto::fold_hash(proto::tile_hash(tile.cells));
      (void)coded.map->restore(tile);
    }
  }
  return coded;
}

namespace {

/// All surveys that the maps hold, and a warning for each that is in two of them: evidence that is in both counts twice.
std::vector<std::string> surveys_in(const std::vector<MapSource>& maps) {
  std::vector<std::string> all;
  for (const MapSource& map : maps) {
    for (const std::string& survey : map.surveys) {
      if (std::find(all.begin(), all.end(), survey) == all.end()) {
        all.push_back(survey);
      } else {
        std::cerr << "leadline: warning: " << map.origin << " holds " << survey
                  << ", as a map before it does: what both know of it counts twice\n";
      }
    }
  }
  return all;
}

}  // namespace

int run_store_merge(const StoreMergeOptions& options) {
  if (options.paths.size() < 2) {
    throw HostError(ExitCode::kUsage, "store merge: wants two maps or more");
  }
  if (options.into_path.empty() && options.out_dir.empty()) {
    throw HostError(ExitCode::kUsage, "store merge: where to? --into FILE.lls, --out DIR, or both");
  }
  std::vector<MapSource> sources;
  std::string name = options.name;
  for (const std::string& path : options.paths) {
    sources.push_back(load_map_source(path));
    if (options.name.empty()) {
      name += (name.empty() ? "" : " + ") + path;
    }
  }
  const std::vector<AlignedMap> maps = align_maps(sources);
  check_datums(sources, "");
  check_evidence(sources, maps);
  const std::vector<std::string> parts = surveys_in(sources);
  const MergedMap merged = merge_maps(maps);
  if (!options.out_dir.empty()) {
    OutputDir output(options.out_dir);
    stage_map(&output, merged.elevation, merged.sigma, sources.front().reference);
    write_esri_ascii(merged.disputed, output.stage("disputed.asc"), 0);
    output.commit();
  }
  std::string place;
  if (!options.into_path.empty()) {
    const CodedMap coded =
        code_map(merged.elevation, merged.sigma, merged.disputed, sources.front().reference);
    SurveyStore store(options.into_path, SurveyStore::Access::kWrite);
    const std::int64_t number = store.write_merged(*coded.map, coded.disputed, name, parts);
    place = options.into_path + "#" + std::to_string(number) + ": ";
  }
  std::cout << place << merged.elevation.known_count() << " cells: " << merged.single
            << " of one survey, " << merged.consistent << " of several that agree, "
            << merged.disputes << " disputed (over " << json_number(kDisputeSigmas)
            << " sigmas apart: the shallowest is kept)\n";
  for (std::size_t k = 0; k < maps.size(); ++k) {
    if (maps[k].shift_cells > 0.0) {
      std::cout << sources[k].origin << ": its cells lie " << metres_text(maps[k].shift_cells, 2)
                << " cell beside those of " << sources.front().origin << ": interpolated\n";
    }
  }
  return static_cast<int>(ExitCode::kOk);
}

namespace {

std::string difference_json(const MapDifference& difference, double threshold_sigmas) {
  std::string text =
      "{\n  \"compared_cells\": " + std::to_string(difference.compared) +
      ",\n  \"threshold_sigmas\": " + json_number(threshold_sigmas) +
      ",\n  \"significant_cells\": " + std::to_string(difference.significant) +
      ",\n  \"expected_by_chance\": " + json_number(difference.expected_by_chance) +
      ",\n  \"only_earlier_cells\": " + std::to_string(difference.only_earlier) +
      ",\n  \"only_later_cells\": " + std::to_string(difference.only_later) +
      ",\n  \"median_m\": " + json_number(difference.median_m) +
      ",\n  \"removed_offset_m\": " + json_number(difference.removed_offset_m) +
      ",\n  \"removed_offset_sigma_m\": " + json_number(difference.removed_offset_sigma_m) +
      ",\n  \"areas\": [";
  for (const ChangedArea& area : difference.areas) {
    text += std::string(&area == difference.areas.data() ? "\n" : ",\n") +
            "    {\"east_m\": " + json_number(area.east_m) +
            ", \"north_m\": " + json_number(area.north_m) +
            ", \"cells\": " + std::to_string(area.cells) +
            ", \"area_m2\": " + json_number(area.area_m2) +
            ", \"mean_m\": " + json_number(area.mean_m) +
            ", \"volume_m3\": " + json_number(area.volume_m3) +
            ", \"volume_sigma_m3\": " + json_number(area.volume_sigma_m3) +
            ", \"volume_sigma_common_m3\": " + json_number(area.volume_sigma_common_m3) +
            ", \"peak_sigmas\": " + json_number(area.peak_sigmas) + "}";
  }
  return text + "\n  ]\n}\n";
}

void print_difference(const MapDifference& difference, double threshold_sigmas) {
  std::cout << difference.compared << " cells in both, " << difference.only_earlier
            << " only in the earlier, " << difference.only_later << " only in the later\n"
            << "median change " << metres_text(difference.median_m, 3) << " m (deeper is positive)"
            << (difference.removed_offset_m != 0.0 ? ", removed" : "") << "\n"
            << difference.significant << " cells changed by more than "
            << json_number(threshold_sigmas) << " sigmas; chance alone would show "
            << metres_text(difference.expected_by_chance, 1) << "\n"
            << difference.areas.size() << " areas of " << kLeastChangedCells << " cells or more";
  constexpr std::size_t kShown = 20;
  std::cout << (difference.areas.empty() ? "\n"
                                         : ":\n      east     north   area m2   mean m  "
                                           "volume m3    sigma  at most  peak sigmas\n");
  for (std::size_t k = 0; k < std::min(kShown, difference.areas.size()); ++k) {
    const ChangedArea& area = difference.areas[k];
    std::cout << std::setw(10) << metres_text(area.east_m, 1) << std::setw(10)
              << metres_text(area.north_m, 1) << std::setw(10) << metres_text(area.area_m2, 1)
              << std::setw(9) << metres_text(area.mean_m, 3) << std::setw(11)
              << metres_text(area.volume_m3, 2) << std::setw(9)
              << metres_text(area.volume_sigma_m3, 2) << std::setw(9)
              << metres_text(area.volume_sigma_common_m3, 2) << std::setw(13)
              << metres_text(area.peak_sigmas, 1) << "\n";
  }
  if (difference.areas.size() > kShown) {
    std::cout << "and " << difference.areas.size() - kShown << " smaller ones\n";
  }
}

}  // namespace

int run_store_difference(const StoreDifferenceOptions& options) {
  if (!(options.significance_sigmas > 0.0)) {
    throw HostError(ExitCode::kUsage, "store difference: --significance " +
                                          json_number(options.significance_sigmas) +
                                          ": must be over 0");
  }
  const std::vector<MapSource> sources = {load_map_source(options.earlier_path),
                                          load_map_source(options.later_path)};
  const std::vector<AlignedMap> maps = align_maps(sources);
  if (!options.level) {
    check_datums(sources, " (--level takes the median change for that)");
  }
  const MapDifference difference =
      difference_of(maps[0], maps[1], options.significance_sigmas, options.level);
  if (difference.compared == 0) {
    throw HostError(ExitCode::kInput, options.earlier_path + " and " + options.later_path +
                                          " have no known cell in common");
  }
  const std::string json = difference_json(difference, options.significance_sigmas);
  if (!options.out_dir.empty()) {
    OutputDir output(options.out_dir);
    write_esri_ascii(difference.change, output.stage("change.asc"),
                     raster_decimals(difference.change.cell_m));
    write_esri_ascii(difference.significance, output.stage("significance.asc"), 2);
    render::PictureOptions picture;
    picture.title = "Change of depth";
    output.write("change.png", render::difference_png(difference.change, picture));
    output.write("difference.json", json);
    output.commit();
  }
  if (options.json) {
    std::cout << json;
  } else {
    print_difference(difference, options.significance_sigmas);
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
