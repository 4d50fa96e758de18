// `leadline store`: surveys on disk listed, shown, merged, and compared with each other. Maps of other kinds
// (folders, rasters with sigma, logs) merge and differ as well: a path is whatever load_map_source() reads.
#pragma once

#include <string>
#include <vector>

#include "host_tools/geo_reference.hpp"
#include "host_tools/store/survey_store.hpp"

namespace leadline::host {

struct StoreShowOptions {
  std::string path;
  bool json = false;
};

/// One line per survey of the file. Returns 0. Throws HostError kInput.
int run_store_list(const StoreShowOptions& options);
/// One survey. Returns 0. Throws HostError kInput.
int run_store_show(const StoreShowOptions& options);

struct StoreMergeOptions {
  std::vector<std::string> paths;  ///< two or more
  std::string into_path;           ///< store that gets the merged survey; "" = none
  std::string name;                ///< of the merged survey
  std::string out_dir;             ///< folder of rasters; "" = none
};

/// The merged map as cells of a link's map, as fine as a store holds it (proto/cell.hpp: depth to 1/4 sigma,
/// sigma to a quarter octave). Throws HostError kInput where no grid of a hello holds it.
struct CodedMap {
  std::unique_ptr<TileStore> map;
  std::vector<DisputedCells> disputed;  ///< per tile
};
[[nodiscard]] CodedMap code_map(const Raster& elevation, const Raster& sigma,
                                const Raster& disputed, const GeoReference& reference);

/// Returns 0. Throws HostError: kUsage, kInput, kOutput.
int run_store_merge(const StoreMergeOptions& options);

struct StoreDifferenceOptions {
  std::string earlier_path;
  std::string later_path;
  double significance_sigmas = 3.0;
  bool level = false;   ///< take the median difference for a change of datum
  std::string out_dir;  ///< change.asc, significance.asc, change.png, difference.json; "" = none
  bool json = false;    ///< difference.json on standard output instead of text
};

/// Returns 0. Throws HostError: kUsage, kInput (also: no cell in common), kOutput.
int run_store_difference(const StoreDifferenceOptions& options);

}  // namespace leadline::host
