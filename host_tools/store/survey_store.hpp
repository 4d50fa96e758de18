// Surveys on disk, `FILE.lls`: the maps that came over links, tile by tile, in one SQLite file.
//
// What a save() has returned from stays, whatever ends the program, the machine or its power; a save under
// way is there whole or not at all. SQLite does that (write-ahead log, synchronous=FULL); a CRC-32C per
// tile finds what a disk has changed afterwards.
//
//   surveys  number, survey_id, session, kind, name, cell_mm, size and origin of the grid, its place on
//            Earth, seconds since 1970 of the first and of the last save
//   tiles    survey, tile, generation, hash32, known_cells, crc32c, cells (256 coded cells of
//            proto/cell.hpp, little-endian), disputed (merged surveys: 256 bits, or null)
// Signed 64-bit columns hold unsigned numbers by their bits. PRAGMA application_id is 0x4C4C5331 ("LLS1"),
// PRAGMA user_version the version of the format, 1.
#pragma once

#include <bitset>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/topside/tile_store.hpp"

struct sqlite3;

namespace leadline::host {

/// Cells of one tile where the merged surveys contradict each other.
using DisputedCells = std::bitset<proto::kTileArea_cells>;

/// A survey of a store.
struct StoredSurvey {
  std::int64_t number = 0;  ///< in this file, from 1 on
  proto::Hello hello{};     ///< survey, session, grid, place and texts; nothing else of it
  std::string kind;         ///< "link", "merged"
  std::string name;         ///< for people, of a "link" the vehicle's; "" = none
  std::int64_t begun_unix_s = 0;
  std::int64_t saved_unix_s = 0;
  std::uint64_t known_cells = 0;
  std::uint32_t tiles = 0;
  std::vector<std::string> parts;  ///< of a "merged": MapSource::surveys of what was merged
};

/// What load() found.
struct StoreLoad {
  std::uint32_t tiles = 0;
  std::uint32_t damaged_tiles = 0;  ///< their CRC is wrong, or the grid has no such tile: left out
};

/// One connection to one file. Several processes may share a file; a writer waits for another, kPatience_ms at most.
/// Errors: HostError naming the file; kInput: cannot be opened or read, is no store, a newer version; kOutput:
/// cannot be written, disk full. After an error of save() or write_merged() the file is as before the call.
class SurveyStore {
 public:
  enum class Access : std::uint8_t {
    kRead,   ///< also in a folder that cannot be written
    kWrite,  ///< creates the file where there is none
  };
  static constexpr int kPatience_ms = 5000;
  SurveyStore(const std::string& path, Access access);
  ~SurveyStore();
  SurveyStore(const SurveyStore&) = delete;
  SurveyStore& operator=(const SurveyStore&) = delete;

  /// How long to wait for another program that writes.
  void set_patience(int wait_ms);

  /// All surveys, by number. Reads the whole file.
  [[nodiscard]] std::vector<StoredSurvey> surveys() const;
  /// The one with this number, or the one that was saved last.
  [[nodiscard]] std::optional<StoredSurvey> survey(std::optional<std::int64_t> number) const;
  /// The survey that speaks of the same map as the hello: survey, session and grid.
  [[nodiscard]] std::optional<StoredSurvey> survey_of(const proto::Hello& hello) const;

  /// Restores the survey's tiles into `store`, a TileStore of its hello that has none of them. Into
  /// `disputed`, unless null, one entry per tile of the grid. `meanwhile`, unless empty, is called every kTilesPerStep
  /// tiles: a large survey takes longer than a link waits.
  StoreLoad load(std::int64_t number, TileStore* store,
                 std::vector<DisputedCells>* disputed = nullptr,
                 const std::function<void()>& meanwhile = {}) const;
  static constexpr std::uint32_t kTilesPerStep = 128;

  /// Writes the tiles of `store` that changed after its sequence() was `since`, and its place, in one
  /// transaction; a map that is new to the file becomes a survey. A tile that the file has in a newer
  /// generation, or with more cells in the same, stays. Returns the survey's number. O(tiles written).
  std::int64_t save(const TileStore& store, std::uint64_t since);

  /// Adds a survey of kind "merged". `disputed`: one entry per tile of the grid; `parts`: no line breaks in them.
  std::int64_t write_merged(const TileStore& store, const std::vector<DisputedCells>& disputed,
                            const std::string& name, const std::vector<std::string>& parts);

  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  class Statement;
  class Transaction;
  void open(const std::string& name, int flags);
  void open_unchanging();
  void execute(const char* sql) const;
  [[nodiscard]] std::string reason() const;
  void create();
  void check_format();
  void find_columns();
  [[nodiscard]] std::string survey_rows() const;
  void write_place(std::int64_t number, const proto::Hello& hello);
  [[nodiscard]] std::optional<std::int64_t> number_of(const proto::Hello& hello) const;
  std::int64_t insert_survey(const proto::Hello& hello, const char* kind, const std::string& name);
  void write_tile(std::int64_t number, std::uint32_t tile, const TileView& view,
                  const DisputedCells* disputed);
  [[noreturn]] void fail(const std::string& what) const;

  std::string path_;
  bool writes_;
  /// All columns are there; not in a file of an earlier program that none has written since.
  bool has_columns_ = false;
  struct CloseDatabase {
    void operator()(sqlite3* database) const;
  };
  std::unique_ptr<sqlite3, CloseDatabase> database_;
};

/// Keeps a store up to date with a live map: for commands that watch a link. A store that cannot be written
/// for a while (a full disk) costs nothing but the wait: what is missing in it is written later.
class StoreKeeper {
 public:
  /// Opens or creates the file. Throws as SurveyStore.
  explicit StoreKeeper(const std::string& path) : store_(path, SurveyStore::Access::kWrite) {}

  /// To be called when a map begins, before anything is applied to it: what the file has of it comes back. `meanwhile` as
  /// SurveyStore::load's.
  StoreLoad begin(TileStore* map, const std::function<void()>& meanwhile = {});
  /// Writes what changed since the last call, after waiting so long for another program that writes. False: it could
  /// not be written now; problem() says why.
  bool save(const TileStore& map, int patience_ms = SurveyStore::kPatience_ms);
  [[nodiscard]] const std::string& problem() const { return problem_; }
  [[nodiscard]] const std::string& path() const { return store_.path(); }

 private:
  SurveyStore store_;
  std::uint64_t saved_sequence_ = 0;
  bool place_known_ = false;
  std::string problem_;
};

/// "FILE" or "FILE#N": survey N of a store.
struct StorePath {
  std::string file;
  std::optional<std::int64_t> survey;
};
[[nodiscard]] StorePath parse_store_path(const std::string& path);

/// Whether a path names a store: an SQLite file, with or without #N.
[[nodiscard]] bool is_store_path(const std::string& path);

/// The survey that a path names, or the one saved last. Throws HostError kInput: as SurveyStore; no such
/// survey, none at all.
struct OpenedSurvey {
  StoredSurvey survey;
  std::unique_ptr<TileStore> map;
  StoreLoad load;
  std::vector<DisputedCells> disputed;
};
[[nodiscard]] OpenedSurvey open_survey(const std::string& path);

}  // namespace leadline::host
