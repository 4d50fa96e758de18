#include "firmware/config/survey_sections.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "firmware/config/exit_codes.hpp"
#include "firmware/config/text.hpp"
#include "model/capacity.hpp"

namespace leadline::host {
namespace {

constexpr std::array<const char*, 4> kRuleNames = {"weighted_mean", "log_odds", "certainty_factor",
                                                   "recursive"};
constexpr std::array<const char*, 2> kNoReturnNames = {"ignore", "empty"};

[[noreturn]] void refuse(const std::string& name, const std::string& what, std::uint32_t line = 0) {
  const std::string where = line > 0 ? name + ":" + std::to_string(line) : name;
  throw HostError(ExitCode::kUsage, where + ": " + what);
}

/// What this build of the model cannot hold, said with the numbers.
void check_capacity(const GridConfig& grid, const SonarRanges& ranges, const std::string& name,
                    bool windowed) {
  const std::string size = "[grid] size = " + array_text(grid.size) + ": ";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int32_t limit = axis == base::kDown ? model::kMaxDepthCells : model::kMaxSideCells;
    if (grid.size[axis] > limit) {
      refuse(name,
             size + std::to_string(grid.voxel_count()) + " voxels, and over the capacity of " +
                 std::to_string(limit) + " cells on axis " + std::to_string(axis),
             grid.size_line);
    }
  }
  // Columns are stored in square tiles; the last ones are padded.
  constexpr std::uint64_t kTile = model::kTileCells;
  const std::uint64_t columns =
      (static_cast<std::uint64_t>(grid.size[0]) + kTile - 1) / kTile * kTile *
      ((static_cast<std::uint64_t>(grid.size[1]) + kTile - 1) / kTile * kTile);
  const std::uint64_t voxels = columns * static_cast<std::uint64_t>(grid.size[2]);
  if ((voxels > model::kVoxelCapacity && !windowed) || columns > model::kColumnCapacity) {
    refuse(name,
           size + std::to_string(grid.voxel_count()) + " voxels (" + std::to_string(voxels) +
               " in " + std::to_string(columns) +
               " columns of whole tiles), over the capacity of " +
               std::to_string(model::kVoxelCapacity) + " voxels in " +
               std::to_string(model::kColumnCapacity) +
               " columns; take larger cells or a smaller grid",
           grid.size_line);
  }
  const std::int64_t longest_mm = static_cast<std::int64_t>(model::kMaxRangeCells) * grid.cell_mm;
  if (ranges.max_range_mm > longest_mm) {
    refuse(name,
           "[sonar] max_range_mm = " + std::to_string(ranges.max_range_mm) +
               ": has to be at most " + std::to_string(model::kMaxRangeCells) +
               " cells = " + std::to_string(longest_mm) + " mm",
           ranges.max_range_line);
  }
}

template <typename T>
std::string triple_text(const T (&values)[3]) {
  std::string text = "[";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    text += axis == 0 ? "" : ", ";
    if constexpr (std::is_floating_point_v<T>) {
      text += json_number(values[axis]);
    } else {
      text += std::to_string(values[axis]);
    }
  }
  return text + "]";
}

/// The grid has to end inside the coordinates that records can carry.
void check_far_corner(const TomlSection& section, const GridConfig& grid) {
  static constexpr std::array<const char*, 3> kAxisNames = {"north", "east", "down"};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t limit_mm =
        (axis == base::kDown ? base::kMaxVertical_um : base::kMaxHorizontal_um) / 1000;
    const std::int64_t far_mm =
        grid.origin_mm[axis] + static_cast<std::int64_t>(grid.size[axis]) * grid.cell_mm;
    if (far_mm > limit_mm) {
      section.find("size", std::string("the grid ends ") + std::to_string(far_mm) + " mm " +
                               kAxisNames[axis] + ": it has to end within " +
                               std::to_string(limit_mm) +
                               " mm (re-origin the survey or take fewer or smaller cells)");
    }
  }
}

}  // namespace

std::vector<std::string> grid_keys() { return {"cell_mm", "size", "origin_mm"}; }
std::vector<std::string> sonar_range_keys() {
  return {"min_range_mm", "max_range_mm", "no_return", "detect_range_mm", "sound_speed_mm_s"};
}
std::vector<std::string> navigation_sigma_keys() {
  return {"sigma_position_mm", "sigma_correlated_mm"};
}
std::vector<std::string> model_keys() { return {"rule", "k_p"}; }
std::vector<std::string> frame_keys() { return {"lat", "lon", "epsg", "vertical_datum"}; }

const char* rule_name(Rule rule) { return kRuleNames[static_cast<std::size_t>(rule)]; }
const char* no_return_name(NoReturn policy) {
  return kNoReturnNames[static_cast<std::size_t>(policy)];
}

std::string array_text(const std::int32_t (&values)[3]) { return triple_text(values); }
std::string array_text(const std::int64_t (&values)[3]) { return triple_text(values); }
std::string array_text(const double (&values)[3]) { return triple_text(values); }

std::int64_t default_max_range_mm(const GridConfig& grid) {
  double square_mm2 = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double low_mm = static_cast<double>(grid.origin_mm[axis]);
    const double high_mm = low_mm + static_cast<double>(grid.size[axis]) * grid.cell_mm;
    const double side_mm =
        axis == base::kDown ? std::max(high_mm, 0.0) - std::min(low_mm, 0.0) : high_mm - low_mm;
    square_mm2 += side_mm * side_mm;
  }
  constexpr auto kLongest_mm = static_cast<double>(base::kMaxRange_um / 1000);
  return static_cast<std::int64_t>(std::min(std::ceil(std::sqrt(square_mm2)), kLongest_mm));
}

GridConfig read_grid(TomlReader* reader) {
  GridConfig grid;
  const TomlSection section = reader->section("grid");
  if (!section.exists()) {
    if (!reader->root().has("grid")) {  // there but no table: found by the check of keys
      reader->find_missing("the table [grid] with cell_mm, size and origin_mm is missing");
    }
    return grid;
  }
  for (const char* const key : {"cell_mm", "size", "origin_mm"}) {
    if (!section.has(key)) {
      section.find_missing(std::string(key) + " is missing");
    }
  }
  std::int64_t cell_mm = 0;
  const bool cell_good = section.read_integer("cell_mm", {1, 1'000'000}, &cell_mm);
  grid.cell_mm = static_cast<std::int32_t>(cell_mm);

  const Limits cells = {1, 1'048'576};
  std::int64_t size[3] = {0, 0, 0};
  const bool size_good = section.read_integers("size", {cells, cells, cells}, size);
  grid.size_line = section.line("size");

  constexpr auto kHorizontal_mm = static_cast<double>(base::kMaxHorizontal_um / 1000);
  constexpr auto kVertical_mm = static_cast<double>(base::kMaxVertical_um / 1000);
  const Limits horizontal = {-kHorizontal_mm, kHorizontal_mm};
  const Limits vertical = {-kVertical_mm, kVertical_mm};
  const bool origin_good =
      section.read_integers("origin_mm", {horizontal, horizontal, vertical}, grid.origin_mm);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    grid.size[axis] = static_cast<std::int32_t>(size[axis]);
  }
  if (cell_good && size_good && origin_good) {
    check_far_corner(section, grid);
  }
  return grid;
}

void read_sonar_ranges(TomlReader* reader, const GridConfig& grid, const Limits& sound_speed_mm_s,
                       SonarRanges* ranges) {
  const TomlSection section = reader->section("sonar");
  constexpr auto kRange_mm = static_cast<double>(base::kMaxRange_um / 1000);
  section.read_integer("min_range_mm", {0, kRange_mm}, &ranges->min_range_mm);
  section.read_integer("max_range_mm", {1, kRange_mm}, &ranges->max_range_mm);
  ranges->max_range_line = section.line("max_range_mm");
  if (!section.has("max_range_mm")) {
    ranges->max_range_mm = default_max_range_mm(grid);
  }
  if (section.has("min_range_mm") && ranges->max_range_mm > 0 &&
      ranges->min_range_mm >= ranges->max_range_mm) {
    section.find("min_range_mm",
                 "min_range_mm = " + std::to_string(ranges->min_range_mm) +
                     ": has to be below max_range_mm = " + std::to_string(ranges->max_range_mm));
  }
  ranges->no_return = static_cast<NoReturn>(section.read_choice(
      "no_return", kNoReturnNames, static_cast<std::size_t>(ranges->no_return)));
  std::int64_t detect_mm = 0;
  if (section.read_integer("detect_range_mm", {1, kRange_mm}, &detect_mm)) {
    ranges->detect_range_mm = detect_mm;
    if (ranges->max_range_mm > 0 && detect_mm > ranges->max_range_mm) {
      section.find("detect_range_mm", "detect_range_mm = " + std::to_string(detect_mm) +
                                          ": has to be at most max_range_mm = " +
                                          std::to_string(ranges->max_range_mm));
    }
  }
  if (ranges->no_return == NoReturn::kEmpty && !section.has("detect_range_mm")) {
    section.find(
        "no_return",
        "no_return = \"empty\": needs detect_range_mm, the range up to which a target would "
        "have been heard");
  }
  section.read_integer("sound_speed_mm_s", sound_speed_mm_s, &ranges->sound_speed_mm_s);
}

void read_navigation_sigmas(TomlReader* reader, NavigationSigmas* navigation) {
  const TomlSection section = reader->section("navigation");
  const Limits sigma_mm = {0, 1e6};
  section.read_numbers("sigma_position_mm", sigma_mm, navigation->sigma_position_mm);
  section.read_numbers("sigma_correlated_mm", sigma_mm, navigation->sigma_correlated_mm);
}

ModelConfig read_model(TomlReader* reader) {
  ModelConfig model;
  const TomlSection section = reader->section("model");
  model.rule = static_cast<Rule>(
      section.read_choice("rule", kRuleNames, static_cast<std::size_t>(model.rule)));
  section.read_number("k_p", {0, 1, true}, &model.k_p);
  return model;
}

FrameConfig read_frame(TomlReader* reader) {
  FrameConfig frame;
  const TomlSection section = reader->section("frame");
  double degrees = 0;
  if (section.read_number("lat", {-90, 90}, &degrees)) {
    frame.lat_deg = degrees;
  }
  if (section.read_number("lon", {-180, 360}, &degrees)) {
    frame.lon_deg = degrees;
  }
  if (section.has("lat") != section.has("lon")) {
    section.find(section.has("lat") ? "lat" : "lon", "lat and lon have to be given together");
  }
  std::int64_t epsg = 0;
  if (section.read_integer("epsg", {1, 999'999}, &epsg)) {
    frame.epsg = static_cast<std::int32_t>(epsg);
  }
  std::string datum;
  if (section.read_text("vertical_datum", 64, &datum)) {
    frame.vertical_datum = datum;
  }
  return frame;
}

model::ModelConfig to_model_config(const GridConfig& grid, const SonarRanges& ranges,
                                   const NavigationSigmas& navigation, const ModelConfig& model,
                                   const std::string& config_name, bool windowed) {
  check_capacity(grid, ranges, config_name, windowed);
  model::ModelConfig result{};
  result.schema_version = model::kConfigSchemaVersion;
  result.rule = model.rule;
  result.k_p_q16 = static_cast<std::uint32_t>(std::max(1LL, std::llround(model.k_p * 65536.0)));
  result.no_return = ranges.no_return == NoReturn::kEmpty ? model::NoReturnPolicy::kEmpty
                                                          : model::NoReturnPolicy::kIgnore;
  result.cell_mm = grid.cell_mm;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result.size[axis] = grid.size[axis];
    result.origin_mm[axis] = grid.origin_mm[axis];
    result.sigma_position_mm[axis] = std::llround(navigation.sigma_position_mm[axis]);
    result.sigma_correlated_mm[axis] = std::llround(navigation.sigma_correlated_mm[axis]);
  }
  result.min_range_um = ranges.min_range_mm * 1000;
  result.max_range_um = ranges.max_range_mm * 1000;
  result.detect_range_um = ranges.detect_range_mm.value_or(0) * 1000;
  return result;
}

void refuse_work_bound(const model::WorkBound& bound, std::uint32_t budget_voxels,
                       const std::string& config_name) {
  refuse(config_name, "one ping can touch up to " + std::to_string(bound.total_voxels) +
                          " voxels (shell " + std::to_string(bound.shell_voxels) + ", cone " +
                          std::to_string(bound.cone_voxels) + "), the budget is " +
                          std::to_string(budget_voxels) +
                          "; take larger cells, a shorter max_range_mm or a narrower beam");
}

}  // namespace leadline::host
