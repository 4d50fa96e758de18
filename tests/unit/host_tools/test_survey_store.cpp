#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <linux/capability.h>
#include <sqlite3.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/export/map_source.hpp"
#include "host_tools/store/live_store.hpp"
#include "host_tools/store/survey_store.hpp"
#include "tests/support/proto_samples.hpp"
#include "tests/support/test.hpp"

namespace {

namespace fs = std::filesystem;
using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::StoredSurvey;
using leadline::host::StoreKeeper;
using leadline::host::StoreLoad;
using leadline::host::SurveyStore;
using leadline::host::TileStore;
using leadline::proto::code_cell;
using leadline::proto::Hello;
using leadline::proto::kTileArea_cells;
using leadline::proto::TileDelta;
using leadline::test::Random;

// 80 x 64 cells: 5 x 4 tiles.
Hello grid(std::uint64_t survey_id = 0xFFFF'FFFF'0000'0007U) {
  Hello hello = leadline::test::grid_hello(80, 64);
  hello.survey_id = survey_id;
  hello.session = 0xFFFF'FFFEU;
  hello.origin_mm[0] = -10'000;
  hello.origin_mm[2] = 20'000;
  leadline::proto::name_survey(hello, "wreck", "sea surface", leadline::proto::kMaxHello_bytes);
  return hello;
}

/// Changes some cells of some tiles, as a vehicle would tell them.
void change(TileStore* map, Random* random) {
  for (int k = 0; k < 6; ++k) {
    const auto tile = static_cast<std::uint32_t>(random->between(0, map->tile_count() - 1));
    TileDelta delta{};
    delta.tile = tile;
    const auto before = map->tile(tile);
    // Near the wrap of the counter.
    delta.generation = (before ? before->generation : 0xFFFF'FFF0U) + 1;
    leadline::proto::CodedCell cells[kTileArea_cells] = {};
    if (before) {
      std::copy_n(before->cells, kTileArea_cells, cells);
    }
    for (int c = 0; c < 20; ++c) {
      const auto cell = static_cast<int>(random->between(0, kTileArea_cells - 1));
      cells[cell] = code_cell(static_cast<std::int32_t>(random->between(0, 60 * 256)), 2048, 0);
      delta.changed.set(cell);
      delta.cells[cell] = cells[cell];
    }
    delta.cell_count = 20;
    delta.hash32 = leadline::proto::fold_hash(leadline::proto::tile_hash(cells));
    assert_false(map->apply(delta).outside);
  }
}

std::uint64_t stored_hash(const std::string& path) {
  return leadline::host::open_survey(path).map->cells_hash();
}

void assert_refused(ExitCode code, const std::string& path, SurveyStore::Access access,
                    const std::string& word) {
  try {
    const SurveyStore store(path, access);
    fail_msg("%s was opened", path.c_str());
  } catch (const HostError& error) {
    assert_int_equal(static_cast<int>(error.code()), static_cast<int>(code));
    assert_true(std::string(error.what()).find(word) != std::string::npos);
  }
}

TEST(a_map_comes_back_as_it_was_saved) {
  const std::string path = leadline::test::scratch_directory() + "/s.lls";
  Random random(1);
  TileStore map(grid());
  change(&map, &random);
  std::int64_t number = 0;
  {
    SurveyStore store(path, SurveyStore::Access::kWrite);
    number = store.save(map, 0);
    const std::uint64_t sequence = map.sequence();
    change(&map, &random);
    assert_int_equal(store.save(map, sequence), number);
    TileStore other(grid(8));
    change(&other, &random);
    assert_int_equal(store.save(other, 0), number + 1);
  }
  const SurveyStore store(path, SurveyStore::Access::kRead);
  assert_int_equal(store.surveys().size(), 2);
  const auto found = store.survey_of(grid());
  assert_true(found && found->number == number);
  assert_true(found->hello.survey_id == grid().survey_id);
  assert_int_equal(found->hello.session, grid().session);
  assert_int_equal(found->hello.origin_mm[0], -10'000);
  assert_int_equal(found->known_cells, map.known_cells());
  assert_int_equal(found->tiles, map.known_tiles());
  // What an export says of it: the vehicle's words.
  const auto reference = leadline::host::load_map_source(path + "#1").reference;
  assert_string_equal(reference.vertical_datum.value_or("").c_str(), "sea surface");
  assert_string_equal(reference.survey_name.value_or("").c_str(), "wreck");
  assert_true(stored_hash(path + "#1") == map.cells_hash());
  // The same survey over another grid is another map.
  Hello moved = grid();
  moved.origin_mm[1] += 500;
  assert_false(store.survey_of(moved).has_value());
  const auto source = leadline::host::load_map_source(path + "#1");
  assert_int_equal(source.elevation.known_count(), map.known_cells());
}

TEST(a_restarted_topside_continues_with_what_it_had) {
  const std::string path = leadline::test::scratch_directory() + "/s.lls";
  Random random(2);
  TileStore map(grid());
  {
    StoreKeeper keeper(path);
    assert_int_equal(keeper.begin(&map).tiles, 0);
    change(&map, &random);
    assert_true(keeper.save(map));
  }
  Hello placed = grid();
  placed.has_geodetic_origin = 1;
  placed.latitude_e9deg = 54'000'000'000;
  TileStore resumed(placed);
  StoreKeeper keeper(path);
  std::uint32_t steps = 0;
  const StoreLoad load = keeper.begin(&resumed, [&steps] { steps += 1; });
  assert_int_equal(load.tiles, map.known_tiles());
  assert_int_equal(steps, load.tiles / SurveyStore::kTilesPerStep);
  assert_int_equal(load.damaged_tiles, 0);
  assert_true(resumed.cells_hash() == map.cells_hash());
  assert_int_equal(resumed.tiles_incomplete(), 0);
  // The place is told although no tile changed.
  assert_true(keeper.save(resumed));
  assert_true(leadline::host::open_survey(path).survey.hello.latitude_e9deg == 54'000'000'000);
}

TEST(an_older_word_does_not_replace_a_newer_one) {
  const std::string path = leadline::test::scratch_directory() + "/s.lls";
  Random random(3);
  TileStore old(grid());
  change(&old, &random);
  TileStore map(grid());
  for (std::uint32_t id = 0; id < old.tile_count(); ++id) {
    if (const auto tile = old.tile(id)) {
      leadline::host::StoredTile stored;
      stored.tile = id;
      stored.generation = tile->generation + 20;  // beyond the wrap
      stored.hash32 = tile->hash32;
      std::copy_n(tile->cells, kTileArea_cells, stored.cells);
      stored.cells[0] = code_cell(5, 2048, 0);
      assert_true(map.restore(stored));
    }
  }
  SurveyStore store(path, SurveyStore::Access::kWrite);
  (void)store.save(map, 0);
  (void)store.save(old, 0);
  assert_true(stored_hash(path) == map.cells_hash());
}

TEST(a_store_of_an_earlier_program_goes_on) {
  const std::string path = leadline::test::scratch_directory() + "/s.lls";
  Random random(9);
  TileStore map(grid());
  change(&map, &random);
  { (void)SurveyStore(path, SurveyStore::Access::kWrite).save(map, 0); }
  sqlite3* database = nullptr;
  assert_int_equal(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  assert_int_equal(
      sqlite3_exec(database,
                   "ALTER TABLE surveys DROP COLUMN vertical_datum; ALTER TABLE surveys DROP "
                   "COLUMN parts; ALTER TABLE tiles RENAME TO "
                   "now; CREATE TABLE tiles (survey INTEGER NOT NULL "
                   "REFERENCES surveys (number), tile INTEGER NOT NULL, generation INTEGER NOT "
                   "NULL, hash32 INTEGER NOT NULL, known_cells INTEGER NOT NULL, crc32c INTEGER "
                   "NOT NULL, cells BLOB NOT NULL, disputed BLOB, PRIMARY KEY (survey, tile)) "
                   "WITHOUT ROWID; INSERT INTO tiles SELECT * FROM now; DROP TABLE now",
                   nullptr, nullptr, nullptr),
      SQLITE_OK);
  sqlite3_close(database);
  assert_int_equal(leadline::host::open_survey(path).survey.hello.vertical_datum.size_bytes, 0);
  Hello named = grid();
  leadline::proto::name_survey(named, "wreck", "LAT", leadline::proto::kMaxHello_bytes);
  TileStore resumed(named);
  StoreKeeper keeper(path);
  assert_int_equal(keeper.begin(&resumed).tiles, map.known_tiles());
  assert_true(resumed.cells_hash() == map.cells_hash());
  change(&resumed, &random);
  assert_true(keeper.save(resumed));
  assert_true(stored_hash(path) == resumed.cells_hash());
  assert_string_equal(leadline::host::load_map_source(path).reference.vertical_datum->c_str(),
                      "LAT");
}

TEST(half_a_tile_does_not_replace_a_whole_one) {
  const std::string path = leadline::test::scratch_directory() + "/s.lls";
  // Two topsides hear one vehicle; the second one has missed half of what the tile's generation says.
  TileDelta delta{};
  delta.tile = 3;
  delta.generation = 7;
  leadline::proto::CodedCell cells[kTileArea_cells] = {};
  for (int k = 0; k < 40; ++k) {
    cells[k] = code_cell(1000 + k, 2048, 0);
  }
  delta.hash32 = leadline::proto::fold_hash(leadline::proto::tile_hash(cells));
  const auto tell = [&](TileStore* map, int first, int count) {
    delta.changed = {};
    for (int k = first; k < first + count; ++k) {
      delta.changed.set(k);
      delta.cells[k] = cells[k];
    }
    delta.cell_count = count;
    (void)map->apply(delta);
  };
  TileStore whole(grid());
  tell(&whole, 0, 40);
  TileStore half(grid());
  tell(&half, 0, 20);
  SurveyStore store(path, SurveyStore::Access::kWrite);
  (void)store.save(half, 0);
  assert_true(stored_hash(path) == half.cells_hash());
  (void)store.save(whole, 0);
  (void)store.save(half, 0);
  assert_true(stored_hash(path) == whole.cells_hash());
  // What is still to come of it is taken.
  tell(&half, 20, 20);
  (void)store.save(half, 0);
  assert_true(stored_hash(path) == whole.cells_hash());
}

TEST(damage_costs_the_tile_that_it_hit) {
  const std::string path = leadline::test::scratch_directory() + "/s.lls";
  Random random(4);
  TileStore map(grid());
  change(&map, &random);
  {
    SurveyStore store(path, SurveyStore::Access::kWrite);
    (void)store.save(map, 0);
  }
  sqlite3* database = nullptr;
  assert_int_equal(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  assert_int_equal(
      sqlite3_exec(database,
                   "UPDATE tiles SET generation = generation + 1 WHERE tile = (SELECT MIN(tile) "
                   "FROM tiles); INSERT INTO tiles SELECT survey, 4000, generation, hash32, "
                   "known_cells, crc32c, cells, NULL FROM tiles LIMIT 1",
                   nullptr, nullptr, nullptr),
      SQLITE_OK);
  sqlite3_close(database);
  TileStore resumed(grid());
  StoreKeeper keeper(path);
  const StoreLoad load = keeper.begin(&resumed);
  assert_int_equal(load.damaged_tiles, 2);
  assert_int_equal(load.tiles, map.known_tiles() - 1);
}

TEST(what_is_no_store_is_refused) {
  const std::string folder = leadline::test::scratch_directory();
  assert_refused(ExitCode::kInput, folder + "/none.lls", SurveyStore::Access::kRead, "none.lls");
  assert_refused(ExitCode::kOutput, folder + "/no/such.lls", SurveyStore::Access::kWrite,
                 "such.lls");
  std::ofstream(folder + "/text.lls") << std::string(5000, 'x');
  assert_refused(ExitCode::kInput, folder + "/text.lls", SurveyStore::Access::kRead, "text.lls");
  sqlite3* database = nullptr;
  assert_int_equal(sqlite3_open((folder + "/other.lls").c_str(), &database), SQLITE_OK);
  assert_int_equal(sqlite3_exec(database, "CREATE TABLE t (a)", nullptr, nullptr, nullptr),
                   SQLITE_OK);
  sqlite3_close(database);
  assert_refused(ExitCode::kInput, folder + "/other.lls", SurveyStore::Access::kWrite,
                 "no store of surveys");
  { const SurveyStore store(folder + "/new.lls", SurveyStore::Access::kWrite); }
  try {
    (void)leadline::host::open_survey(folder + "/new.lls#3");
    fail_msg("a survey that is not there");
  } catch (const HostError& error) {
    assert_true(std::string(error.what()).find("no survey 3") != std::string::npos);
  }
  assert_int_equal(sqlite3_open((folder + "/new.lls").c_str(), &database), SQLITE_OK);
  assert_int_equal(sqlite3_exec(database, "PRAGMA user_version = 2", nullptr, nullptr, nullptr),
                   SQLITE_OK);
  sqlite3_close(database);
  assert_refused(ExitCode::kInput, folder + "/new.lls", SurveyStore::Access::kRead, "newer");
}

/// While it lives, root may write only what it owns and has the right to.
class NoPrivileges {
 public:
  NoPrivileges() {
    assert_int_equal(::syscall(SYS_capget, &header_, held_), 0);
    __user_cap_data_struct none[2] = {held_[0], held_[1]};
    none[0].effective = none[1].effective = 0;
    assert_int_equal(::syscall(SYS_capset, &header_, none), 0);
  }
  ~NoPrivileges() { (void)::syscall(SYS_capset, &header_, held_); }
  NoPrivileges(const NoPrivileges&) = delete;
  NoPrivileges& operator=(const NoPrivileges&) = delete;

 private:
  __user_cap_header_struct header_{_LINUX_CAPABILITY_VERSION_3, 0};
  __user_cap_data_struct held_[2] = {};
};

TEST(a_store_that_nobody_may_write_is_read) {
  const std::string folder = leadline::test::scratch_directory() + "/read #1 only";
  assert_true(fs::create_directory(folder));
  const std::string path = folder + "/s?.lls";
  Random random(8);
  TileStore map(grid());
  change(&map, &random);
  { (void)SurveyStore(path, SurveyStore::Access::kWrite).save(map, 0); }
  fs::permissions(path, fs::perms::owner_read);
  fs::permissions(folder, fs::perms::owner_read | fs::perms::owner_exec);
  std::uint64_t hash = 0;
  std::string why;
  {
    const NoPrivileges none;
    try {
      hash = stored_hash(path);
      const SurveyStore store(path, SurveyStore::Access::kWrite);
    } catch (const HostError& error) {
      why = error.what();
    }
  }
  fs::permissions(folder, fs::perms::owner_all);
  assert_true(hash == map.cells_hash());
  assert_true(why.find("cannot be written") != std::string::npos);
}

TEST(a_damaged_store_costs_the_store_only) {
  const std::string path = leadline::test::scratch_directory() + "/s.lls";
  Random random(10);
  TileStore map(grid());
  for (int k = 0; k < 8; ++k) {
    change(&map, &random);
  }
  { (void)SurveyStore(path, SurveyStore::Access::kWrite).save(map, 0); }
  {
    // Behind the first pages, which say what the tables are.
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(4 * 4096);
    file << std::string(4 * 4096, '\x55');
  }
  const auto read = [&path] {
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  const std::string before = read();
  std::string said;
  leadline::host::LiveStore store(path, [&said](const std::string& text) { said += text; });
  TileStore live(grid());
  store.begin(&live);
  assert_true(said.find("error") != std::string::npos && said.find("damaged") != std::string::npos);
  change(&live, &random);
  store.follow(live, 10.0);
  store.keep(live);
  assert_true(read() == before);
  try {
    store.require_whole();
    fail_msg("nothing was said at the end");
  } catch (const HostError& error) {
    assert_int_equal(static_cast<int>(error.code()), static_cast<int>(ExitCode::kOutput));
  }
  // Another map finds its place in it, or says why not: the program goes on.
  store.end(live);
  TileStore other(grid(8));
  store.begin(&other);
  store.follow(other, 20.0);
}

TEST(a_live_store_that_is_behind_catches_up) {
  const std::string path = leadline::test::scratch_directory() + "/s.lls";
  Random random(13);
  std::vector<std::string> said;
  leadline::host::LiveStore store(path, [&said](const std::string& text) { said.push_back(text); });
  TileStore map(grid());
  store.begin(&map);
  sqlite3* other = nullptr;
  assert_int_equal(sqlite3_open(path.c_str(), &other), SQLITE_OK);
  assert_int_equal(sqlite3_exec(other, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr), SQLITE_OK);
  for (int second = 1; second <= 3; ++second) {
    change(&map, &random);
    store.follow(map, second);
  }
  assert_int_equal(said.size(), 1);
  assert_true(said[0].find("another program is writing") != std::string::npos);
  sqlite3_exec(other, "ROLLBACK", nullptr, nullptr, nullptr);
  sqlite3_close(other);
  store.follow(map, 3.5);  // not yet
  assert_int_equal(said.size(), 1);
  store.follow(map, 4.0);
  assert_int_equal(said.size(), 2);
  assert_true(said[1].find("caught up") != std::string::npos);
  store.require_whole();
  assert_true(stored_hash(path) == map.cells_hash());
}

// ---- Power cuts -----------------------------------------------------------------------------------
//
// A layer under SQLite notes every write, truncation, deletion and sync of the store's files. A cut after
// any of them leaves of each file what its last sync promised, and of what came later any part: kept, lost,
// or torn at sectors, independently. The store is opened over each such state.

struct FileOperation {
  enum class Kind : std::uint8_t { kWrite, kTruncate, kSync, kDelete } kind;
  std::string file;    ///< name in the folder
  std::size_t at = 0;  ///< offset, or the new size
  std::string bytes;
};
using Folder = std::map<std::string, std::string>;

std::vector<FileOperation> operations;  // of the files opened through the layer
std::size_t bytes_read = 0;             // through it

void carry_out(const FileOperation& operation, std::string* content) {
  if (operation.kind == FileOperation::Kind::kTruncate) {
    content->resize(operation.at);
  } else if (operation.kind == FileOperation::Kind::kWrite) {
    content->resize(std::max(content->size(), operation.at + operation.bytes.size()));
    content->replace(operation.at, operation.bytes.size(), operation.bytes);
  }
}

/// What a disk may hold when the power goes after the first `count` operations.
Folder after_cut(const Folder& before, std::size_t count, Random* random) {
  constexpr std::size_t kSector_bytes = 512;
  Folder disk = before;
  std::map<std::string, std::size_t> synced;  // operations of a file before this one are safe
  for (std::size_t k = 0; k < count; ++k) {
    const auto kind = operations[k].kind;
    if (kind == FileOperation::Kind::kSync || kind == FileOperation::Kind::kDelete) {
      synced[operations[k].file] = k + 1;
    }
  }
  for (std::size_t k = 0; k < count; ++k) {
    const FileOperation& operation = operations[k];
    if (operation.kind == FileOperation::Kind::kDelete) {
      disk.erase(operation.file);  // SQLite syncs the folder with it
      continue;
    }
    std::string& content = disk[operation.file];
    if (k < synced[operation.file] || random->between(0, 2) == 0) {
      carry_out(operation, &content);
    } else if (operation.kind == FileOperation::Kind::kWrite && random->between(0, 1) == 0) {
      for (std::size_t at = 0; at < operation.bytes.size(); at += kSector_bytes) {
        if (random->between(0, 1) == 0) {
          FileOperation part = operation;
          part.at += at;
          part.bytes = operation.bytes.substr(at, kSector_bytes);
          carry_out(part, &content);
        }
      }
    }
  }
  return disk;
}

struct LayerFile {
  sqlite3_file base;
  char name[64];
  [[nodiscard]] sqlite3_file* real() { return reinterpret_cast<sqlite3_file*>(this + 1); }
};
LayerFile* layer(sqlite3_file* file) { return reinterpret_cast<LayerFile*>(file); }
sqlite3_file* real(sqlite3_file* file) { return layer(file)->real(); }
sqlite3_vfs* real_vfs = nullptr;

void note(sqlite3_file* file, FileOperation::Kind kind, std::size_t at = 0,
          const std::string& bytes = "") {
  operations.push_back({kind, layer(file)->name, at, bytes});
}

const sqlite3_io_methods* layer_methods() {
  static const sqlite3_io_methods methods = [] {
    sqlite3_io_methods m{};
    m.iVersion = 2;  // no memory mapping of the database: every write is seen
    m.xClose = [](sqlite3_file* f) { return real(f)->pMethods->xClose(real(f)); };
    m.xRead = [](sqlite3_file* f, void* to, int size, sqlite3_int64 at) {
      bytes_read += static_cast<std::size_t>(size);
      return real(f)->pMethods->xRead(real(f), to, size, at);
    };
    m.xWrite = [](sqlite3_file* f, const void* from, int size, sqlite3_int64 at) {
      note(f, FileOperation::Kind::kWrite, static_cast<std::size_t>(at),
           std::string(static_cast<const char*>(from), static_cast<std::size_t>(size)));
      return real(f)->pMethods->xWrite(real(f), from, size, at);
    };
    m.xTruncate = [](sqlite3_file* f, sqlite3_int64 size) {
      note(f, FileOperation::Kind::kTruncate, static_cast<std::size_t>(size));
      return real(f)->pMethods->xTruncate(real(f), size);
    };
    m.xSync = [](sqlite3_file* f, int) {
      note(f, FileOperation::Kind::kSync);
      return SQLITE_OK;
    };
    m.xFileSize = [](sqlite3_file* f, sqlite3_int64* size) {
      return real(f)->pMethods->xFileSize(real(f), size);
    };
    m.xLock = [](sqlite3_file* f, int lock) { return real(f)->pMethods->xLock(real(f), lock); };
    m.xUnlock = [](sqlite3_file* f, int lock) { return real(f)->pMethods->xUnlock(real(f), lock); };
    m.xCheckReservedLock = [](sqlite3_file* f, int* out) {
      return real(f)->pMethods->xCheckReservedLock(real(f), out);
    };
    m.xFileControl = [](sqlite3_file* f, int op, void* argument) {
      return real(f)->pMethods->xFileControl(real(f), op, argument);
    };
    m.xSectorSize = [](sqlite3_file* f) { return real(f)->pMethods->xSectorSize(real(f)); };
    m.xDeviceCharacteristics = [](sqlite3_file* f) {
      return real(f)->pMethods->xDeviceCharacteristics(real(f));
    };
    m.xShmMap = [](sqlite3_file* f, int page, int size, int extend, void volatile** out) {
      return real(f)->pMethods->xShmMap(real(f), page, size, extend, out);
    };
    m.xShmLock = [](sqlite3_file* f, int offset, int count, int flags) {
      return real(f)->pMethods->xShmLock(real(f), offset, count, flags);
    };
    m.xShmBarrier = [](sqlite3_file* f) { real(f)->pMethods->xShmBarrier(real(f)); };
    m.xShmUnmap = [](sqlite3_file* f, int remove) {
      return real(f)->pMethods->xShmUnmap(real(f), remove);
    };
    return m;
  }();
  return &methods;
}

void set_name(LayerFile* file, const char* path) {
  const std::string name = fs::path(path == nullptr ? "temporary" : path).filename().string();
  assert_true(name.size() < sizeof file->name);
  std::memcpy(file->name, name.c_str(), name.size() + 1);
}

/// Puts the layer under every database that is opened from now on.
void install_layer() {
  static sqlite3_vfs vfs{};
  if (real_vfs != nullptr) {
    sqlite3_vfs_register(&vfs, 1);
    return;
  }
  real_vfs = sqlite3_vfs_find(nullptr);
  vfs = *real_vfs;
  vfs.pNext = nullptr;
  vfs.zName = "power-cut";
  vfs.szOsFile = static_cast<int>(sizeof(LayerFile)) + real_vfs->szOsFile;
  vfs.xOpen = [](sqlite3_vfs*, const char* path, sqlite3_file* file, int flags, int* out) {
    set_name(layer(file), path);
    real(file)->pMethods = nullptr;
    const int result = real_vfs->xOpen(real_vfs, path, real(file), flags, out);
    file->pMethods = real(file)->pMethods != nullptr ? layer_methods() : nullptr;
    return result;
  };
  vfs.xDelete = [](sqlite3_vfs*, const char* path, int sync) {
    operations.push_back({FileOperation::Kind::kDelete, fs::path(path).filename().string(), 0, ""});
    return real_vfs->xDelete(real_vfs, path, sync);
  };
  sqlite3_vfs_register(&vfs, 1);
}

void remove_layer() { sqlite3_vfs_register(real_vfs, 1); }

void write_folder(const std::string& path, const Folder& folder) {
  fs::remove_all(path);
  fs::create_directory(path);
  for (const auto& [name, content] : folder) {
    std::ofstream(path + "/" + name, std::ios::binary) << content;
  }
}

bool is_sound(const std::string& path) {
  sqlite3* database = nullptr;
  sqlite3_stmt* check = nullptr;
  bool sound =
      sqlite3_open(path.c_str(), &database) == SQLITE_OK &&
      sqlite3_prepare_v2(database, "PRAGMA integrity_check", -1, &check, nullptr) == SQLITE_OK &&
      sqlite3_step(check) == SQLITE_ROW;
  sound =
      sound && std::strcmp(reinterpret_cast<const char*>(sqlite3_column_text(check, 0)), "ok") == 0;
  sqlite3_finalize(check);
  sqlite3_close(database);
  return sound;
}

/// Which save the file holds: 0 = none yet.
std::size_t state_of(const std::string& path, const std::vector<std::uint64_t>& hashes) {
  const SurveyStore store(path, SurveyStore::Access::kWrite);
  const auto found = store.survey(std::nullopt);
  if (!found) {
    return 0;
  }
  TileStore map(found->hello);
  assert_int_equal(store.load(found->number, &map).damaged_tiles, 0);
  const auto at = std::find(hashes.begin(), hashes.end(), map.cells_hash());
  if (at == hashes.end()) {
    fail_msg("a map that was never saved");
  }
  return static_cast<std::size_t>(at - hashes.begin()) + 1;
}

TEST(a_power_cut_costs_at_most_the_save_under_way) {
  const std::string folder = leadline::test::scratch_directory() + "/disk";
  const std::string path = folder + "/s.lls";
  write_folder(folder, {});
  operations.clear();
  install_layer();
  Random random(5);
  TileStore map(grid());
  std::vector<std::uint64_t> hashes;         // of the map at each save
  std::vector<std::size_t> committed = {0};  // operations after which it had returned
  // Twice, so that closing (which empties the log into the database) and reopening are cut as well.
  for (int session = 0; session < 2; ++session) {
    SurveyStore store(path, SurveyStore::Access::kWrite);
    for (int k = 0; k < 3; ++k) {
      const std::uint64_t since = map.sequence();
      change(&map, &random);
      hashes.push_back(map.cells_hash());
      (void)store.save(map, since);
      committed.push_back(operations.size());
    }
  }
  remove_layer();
  const std::vector<FileOperation> first_run = operations;
  int cuts = 0;
  int double_cuts = 0;
  for (std::size_t count = 0; count <= first_run.size(); ++count) {
    std::size_t done = 0;
    while (done + 1 < committed.size() && committed[done + 1] <= count) {
      ++done;
    }
    for (int draw = 0; draw < 3; ++draw) {
      operations = first_run;
      const Folder disk = after_cut({}, count, &random);
      write_folder(folder, disk);
      operations.clear();
      install_layer();
      const std::size_t state = state_of(path, hashes);
      remove_layer();
      assert_true(state == done || state == done + 1);
      assert_true(is_sound(path));
      ++cuts;
      // A second cut, while the store is brought in order.
      if (draw == 0 && !operations.empty()) {
        const auto second = static_cast<std::size_t>(
            random.between(0, static_cast<std::int64_t>(operations.size())));
        const Folder again = after_cut(disk, second, &random);
        write_folder(folder, again);
        const std::size_t later = state_of(path, hashes);
        assert_true(later == done || later == done + 1);
        assert_true(is_sound(path));
        ++double_cuts;
      }
    }
  }
  std::printf("%d cuts after %zu operations, %d double cuts: nothing committed was lost\n", cuts,
              first_run.size(), double_cuts);
  assert_true(cuts > 300);
}

/// Bytes read and written by a program that starts, and saves one tile of a full map.
struct SaveCost {
  std::size_t read = 0;
  std::size_t written = 0;
  std::size_t per_tile = 0;  ///< of the file
};
SaveCost cost_of_a_save(std::int32_t side_cells) {
  const std::string path = leadline::test::scratch_directory() + "/cost.lls";
  Hello hello = grid();
  hello.size_cells[0] = hello.size_cells[1] = side_cells;
  TileStore map(hello);
  TileDelta delta{};
  for (std::uint32_t tile = 0; tile < map.tile_count(); ++tile) {
    delta.tile = tile;
    delta.generation = 1;
    delta.cell_count = kTileArea_cells;
    for (int k = 0; k < kTileArea_cells; ++k) {
      delta.changed.set(k);
      delta.cells[k] = code_cell(static_cast<std::int32_t>(tile) + k, 2048, 0);
    }
    delta.hash32 = leadline::proto::fold_hash(leadline::proto::tile_hash(delta.cells));
    (void)map.apply(delta);
  }
  { (void)SurveyStore(path, SurveyStore::Access::kWrite).save(map, 0); }
  SaveCost cost;
  cost.per_tile = static_cast<std::size_t>(fs::file_size(path)) / map.tile_count();
  const std::uint64_t since = map.sequence();
  delta.generation = 2;
  (void)map.apply(delta);
  SurveyStore store(path, SurveyStore::Access::kWrite);
  operations.clear();
  bytes_read = 0;
  (void)store.save(map, since);
  cost.read = bytes_read;
  for (const FileOperation& operation : operations) {
    cost.written += operation.bytes.size();
  }
  return cost;
}

TEST(a_save_costs_what_changed_and_not_what_is_there) {
  install_layer();
  const SaveCost small = cost_of_a_save(64);
  const SaveCost large = cost_of_a_save(512);
  remove_layer();
  std::printf("one tile of 16: %zu bytes read, %zu written; of 1024: %zu, %zu; %zu a tile\n",
              small.read, small.written, large.read, large.written, large.per_tile);
  // A deeper tree has a page or two more on the way.
  constexpr std::size_t kTwoPages_bytes = 2 * 4096;
  assert_true(large.read <= small.read + kTwoPages_bytes);
  assert_true(large.written <= small.written + kTwoPages_bytes);
  assert_true(large.per_tile < 1400);
}

TEST(a_save_that_fails_leaves_what_was_and_succeeds_later) {
  const std::string path = leadline::test::scratch_directory() + "/s.lls";
  Random random(6);
  TileStore map(grid());
  SurveyStore store(path, SurveyStore::Access::kWrite);
  change(&map, &random);
  (void)store.save(map, 0);
  const std::uint64_t saved = map.cells_hash();
  const std::uint64_t since = map.sequence();
  sqlite3* other = nullptr;
  assert_int_equal(sqlite3_open(path.c_str(), &other), SQLITE_OK);
  // Another program writes for longer than anyone waits.
  assert_int_equal(sqlite3_exec(other, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr), SQLITE_OK);
  change(&map, &random);
  store.set_patience(10);
  try {
    (void)store.save(map, since);
    fail_msg("saved past another writer");
  } catch (const HostError& error) {
    assert_int_equal(static_cast<int>(error.code()), static_cast<int>(ExitCode::kOutput));
  }
  assert_true(stored_hash(path) == saved);
  sqlite3_exec(other, "ROLLBACK", nullptr, nullptr, nullptr);
  sqlite3_close(other);
  (void)store.save(map, since);
  assert_true(stored_hash(path) == map.cells_hash());
}

}  // namespace
