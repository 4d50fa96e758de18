// Files of older schemas, lifted to the newest: text of vehicle.toml line by line, so that comments, order and layout
// stay; what a step does not name is not touched.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace leadline::host {

/// What one version changed in one key.
struct SchemaEdit {
  enum class Kind : std::uint8_t {
    kRename,      ///< `key` of `table` is now called `to`
    kKeepDefault  ///< the default of `key` changed: where it is absent, the old one `to` is written out
  };
  Kind kind;
  const char* table;  ///< "link", or "port" for each [[port]]
  const char* key;
  const char* to;
};

/// From `version` to the next.
struct SchemaStep {
  std::int64_t version;
  std::vector<SchemaEdit> edits;
};

/// All steps of vehicle.toml, oldest first.
[[nodiscard]] const std::vector<SchemaStep>& vehicle_schema_steps();

struct Migrated {
  std::string text;
  std::int64_t from = 0;             ///< version that it was
  std::vector<std::string> changes;  ///< a line each: "12: [cycle] voxel_budget = 0: ..."
};

/// `text` is of version `schema_version`, and where it says none, of `unsaid`. The result says the newest version (the one
/// behind the last step). Throws HostError kUsage, `NAME:LINE:` in front: a version that is none or newer, a key
/// that would be there twice. The result is not checked beyond that: parse it.
[[nodiscard]] Migrated migrate_toml(std::string_view text, const std::string& name,
                                    std::int64_t unsaid, const std::vector<SchemaStep>& steps);

}  // namespace leadline::host
