#include "host_tools/store/survey_store.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>

#include <sqlite3.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"
#include "model/base/crc32c.hpp"

namespace leadline::host {
namespace {

constexpr std::int64_t kApplicationId = 0x4C4C5331;  // "LLS1"
constexpr std::int64_t kFormatVersion = 1;
constexpr std::size_t kCells_bytes = sizeof(proto::CodedCell) * proto::kTileArea_cells;
constexpr std::size_t kDisputed_bytes = proto::kTileArea_cells / 8;

// Tiles have rowids: in a tree of their key alone (WITHOUT ROWID) a row of 1.1 KB spills into a page of its own, 5 KB a
// tile. Earlier programs made such stores: they read and are written alike. Those without the last two columns of
// surveys get them from the first that writes.
constexpr const char* kSchema = R"(
CREATE TABLE surveys (
  number INTEGER PRIMARY KEY,
  survey_id INTEGER NOT NULL, session INTEGER NOT NULL,
  kind TEXT NOT NULL, name TEXT NOT NULL,
  cell_mm INTEGER NOT NULL,
  size_north INTEGER NOT NULL, size_east INTEGER NOT NULL, size_down INTEGER NOT NULL,
  origin_north_mm INTEGER NOT NULL, origin_east_mm INTEGER NOT NULL, origin_down_mm INTEGER NOT NULL,
  latitude_e9deg INTEGER, longitude_e9deg INTEGER, epsg INTEGER NOT NULL,
  begun_unix_s INTEGER NOT NULL, saved_unix_s INTEGER NOT NULL,
  vertical_datum TEXT NOT NULL DEFAULT '', parts TEXT NOT NULL DEFAULT '');
CREATE TABLE tiles (
  survey INTEGER NOT NULL REFERENCES surveys (number), tile INTEGER NOT NULL,
  generation INTEGER NOT NULL, hash32 INTEGER NOT NULL, known_cells INTEGER NOT NULL,
  crc32c INTEGER NOT NULL, cells BLOB NOT NULL, disputed BLOB,
  PRIMARY KEY (survey, tile));
)";

constexpr std::array<const char*, 2> kLaterColumns = {"vertical_datum", "parts"};

constexpr const char* kSurveyColumns =
    "SELECT number, survey_id, session, kind, name, cell_mm, size_north, size_east, size_down, "
    "origin_north_mm, origin_east_mm, origin_down_mm, latitude_e9deg, longitude_e9deg, epsg, "
    "begun_unix_s, saved_unix_s, "
    "(SELECT COALESCE(SUM(known_cells), 0) FROM tiles WHERE survey = number), "
    "(SELECT COUNT(*) FROM tiles WHERE survey = number), ";

std::int64_t now_unix_s() {
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string cells_blob(const proto::CodedCell* cells) {
  static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "written as memory has it");
  std::string blob(kCells_bytes, '\0');
  std::memcpy(blob.data(), cells, kCells_bytes);
  return blob;
}

std::string disputed_blob(const DisputedCells& disputed) {
  std::string blob(kDisputed_bytes, '\0');
  for (std::size_t k = 0; k < disputed.size(); ++k) {
    if (disputed.test(k)) {
      blob[k / 8] = static_cast<char>(static_cast<unsigned char>(blob[k / 8]) | 1U << k % 8);
    }
  }
  return blob;
}

DisputedCells disputed_of(const std::string& blob) {
  DisputedCells disputed;
  for (std::size_t k = 0; blob.size() == kDisputed_bytes && k < disputed.size(); ++k) {
    disputed.set(k, (static_cast<unsigned char>(blob[k / 8]) >> k % 8 & 1U) != 0);
  }
  return disputed;
}

/// Of everything in a row of tiles that a map is made of.
std::uint32_t tile_crc(std::uint32_t tile, std::uint32_t generation, std::uint32_t hash32,
                       const std::string& cells, const std::string& disputed) {
  const std::uint32_t words[3] = {tile, generation, hash32};
  std::uint32_t crc = base::crc32c(words, sizeof words);
  crc = base::crc32c(cells.data(), cells.size(), crc);
  return base::crc32c(disputed.data(), disputed.size(), crc);
}

/// What went wrong last, in words for whoever wants his map.
std::string reason_of(sqlite3* database) {
  const int system_error = sqlite3_system_errno(database);
  switch (sqlite3_errcode(database)) {
    case SQLITE_CORRUPT:
      return "the file is damaged: take another one for what comes; what is left in it comes out "
             "with "
             "\"sqlite3 FILE .recover | sqlite3 NEW\"";
    case SQLITE_NOTADB:
      return "no store of surveys";
    case SQLITE_READONLY:
      return "the file or its folder cannot be written";
    case SQLITE_BUSY:
      return "another program is writing to it";
    case SQLITE_CANTOPEN:
      return std::string("cannot be opened") +
             (system_error != 0 ? std::string(": ") + std::strerror(system_error) : "");
    default:
      return sqlite3_errmsg(database);
  }
}

/// `path` as SQLite's URI of a file that nobody changes.
std::string unchanging_uri(const std::string& path) {
  constexpr const char* kDigits = "0123456789ABCDEF";
  std::string uri = "file:";
  for (const char character : path) {
    const auto byte = static_cast<unsigned char>(character);
    if (byte < 0x21 || byte > 0x7E || character == '%' || character == '?' || character == '#') {
      uri += {'%', kDigits[byte >> 4U], kDigits[byte & 15U]};
    } else {
      uri += character;
    }
  }
  return uri + "?immutable=1";
}

}  // namespace

void SurveyStore::CloseDatabase::operator()(sqlite3* database) const { sqlite3_close(database); }

/// A prepared statement, its parameters bound in order from 1 on.
class SurveyStore::Statement {
 public:
  Statement(const SurveyStore& store, const std::string& sql) : store_(store) {
    if (sqlite3_prepare_v2(store.database_.get(), sql.c_str(), -1, &statement_, nullptr) !=
        SQLITE_OK) {
      fail();
    }
  }
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  Statement& integer(std::int64_t value) {
    return checked(sqlite3_bind_int64(statement_, ++bound_, value));
  }
  Statement& null() { return checked(sqlite3_bind_null(statement_, ++bound_)); }
  /// The text or bytes must live until the statement has run.
  Statement& text(const std::string& value) {
    return checked(sqlite3_bind_text(statement_, ++bound_, value.data(),
                                     static_cast<int>(value.size()), nullptr));
  }
  Statement& blob(const std::string& value) {
    return checked(sqlite3_bind_blob(statement_, ++bound_, value.data(),
                                     static_cast<int>(value.size()), nullptr));
  }

  /// The next row; false: there is none.
  bool step() {
    const int result = sqlite3_step(statement_);
    if (result != SQLITE_ROW && result != SQLITE_DONE) {
      fail();
    }
    return result == SQLITE_ROW;
  }

  [[nodiscard]] bool is_null(int column) const {
    return sqlite3_column_type(statement_, column) == SQLITE_NULL;
  }
  [[nodiscard]] std::int64_t integer_at(int column) const {
    return sqlite3_column_int64(statement_, column);
  }
  [[nodiscard]] std::string bytes_at(int column) const {
    const void* const data = sqlite3_column_blob(statement_, column);
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_, column));
    return data == nullptr ? std::string() : std::string(static_cast<const char*>(data), size);
  }

 private:
  Statement& checked(int result) {
    if (result != SQLITE_OK) {
      fail();
    }
    return *this;
  }
  [[noreturn]] void fail() {
    const std::string reason = store_.reason();
    // A constructor that throws runs no destructor.
    sqlite3_finalize(std::exchange(statement_, nullptr));
    store_.fail(reason);
  }

  const SurveyStore& store_;
  sqlite3_stmt* statement_ = nullptr;
  int bound_ = 0;
};

/// All or nothing.
class SurveyStore::Transaction {
 public:
  explicit Transaction(SurveyStore* store) : store_(store) { store->execute("BEGIN IMMEDIATE"); }
  ~Transaction() {
    if (!done_) {
      // An error may have rolled it back already: then there is nothing to do.
      (void)sqlite3_exec(store_->database_.get(), "ROLLBACK", nullptr, nullptr, nullptr);
    }
  }
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  void commit() {
    store_->execute("COMMIT");
    done_ = true;
  }

 private:
  SurveyStore* store_;
  bool done_ = false;
};

void SurveyStore::fail(const std::string& what) const {
  throw HostError(writes_ ? ExitCode::kOutput : ExitCode::kInput, path_ + ": " + what);
}

void SurveyStore::execute(const char* sql) const {
  if (sqlite3_exec(database_.get(), sql, nullptr, nullptr, nullptr) != SQLITE_OK) {
    fail(reason());
  }
}

std::string SurveyStore::reason() const { return reason_of(database_.get()); }

SurveyStore::SurveyStore(const std::string& path, Access access)
    : path_(path), writes_(access == Access::kWrite) {
  // Readers open for writing where they may: they then see what a killed writer has left in its log.
  open(path, SQLITE_OPEN_READWRITE | (writes_ ? SQLITE_OPEN_CREATE : 0));
  set_patience(kPatience_ms);
  if (writes_) {
    create();
  } else {
    open_unchanging();
  }
  check_format();
  if (writes_) {
    execute("PRAGMA journal_mode = WAL");
    execute("PRAGMA synchronous = FULL");
  }
  find_columns();
}

SurveyStore::~SurveyStore() = default;

void SurveyStore::open(const std::string& name, int flags) {
  sqlite3* opened = nullptr;
  const int result = sqlite3_open_v2(name.c_str(), &opened, flags, nullptr);
  database_.reset(opened);
  if (result != SQLITE_OK) {
    fail(opened == nullptr ? "out of memory" : reason());
  }
}

// To look into a write-ahead log's database takes a file beside it. Where none can be made (a read-only folder) and no
// log is left to look into, the file is read as it is.
void SurveyStore::open_unchanging() {
  const int result = sqlite3_exec(database_.get(), "SELECT COUNT(*) FROM sqlite_master", nullptr,
                                  nullptr, nullptr);
  if (result != SQLITE_READONLY && result != SQLITE_CANTOPEN) {
    return;
  }
  std::error_code none;
  const std::uintmax_t left_bytes = std::filesystem::file_size(path_ + "-wal", none);
  if (!none && left_bytes > 0) {
    fail("its last saves are in " + path_ +
         "-wal, and the folder cannot be written: copy both to "
         "where it can");
  }
  open(unchanging_uri(path_), SQLITE_OPEN_READONLY | SQLITE_OPEN_URI);
}

void SurveyStore::set_patience(int wait_ms) { sqlite3_busy_timeout(database_.get(), wait_ms); }

void SurveyStore::create() {
  {
    Statement tables(*this, "SELECT COUNT(*) FROM sqlite_master");
    (void)tables.step();
    if (tables.integer_at(0) != 0) {
      return;
    }
  }
  // In the rollback journal that a new file starts with: who is killed here leaves an empty file.
  execute("PRAGMA synchronous = FULL");
  Transaction transaction(this);
  execute(("PRAGMA application_id = " + std::to_string(kApplicationId)).c_str());
  execute(("PRAGMA user_version = " + std::to_string(kFormatVersion)).c_str());
  execute(kSchema);
  transaction.commit();
}

void SurveyStore::check_format() {
  Statement id(*this, "PRAGMA application_id");
  (void)id.step();
  Statement version(*this, "PRAGMA user_version");
  (void)version.step();
  if (id.integer_at(0) != kApplicationId) {
    throw HostError(ExitCode::kInput, path_ + ": an SQLite file, but no store of surveys");
  }
  if (version.integer_at(0) > kFormatVersion) {
    throw HostError(ExitCode::kInput,
                    path_ + ": a store of format " + std::to_string(version.integer_at(0)) +
                        ", this program reads up to " + std::to_string(kFormatVersion) +
                        ": use a newer leadline");
  }
}

void SurveyStore::find_columns() {
  const auto has = [this](const char* column) {
    Statement found(*this, "SELECT COUNT(*) FROM pragma_table_info('surveys') WHERE name = ?");
    const std::string name = column;
    found.text(name);
    (void)found.step();
    return found.integer_at(0) != 0;
  };
  const auto all = [&has] { return std::all_of(kLaterColumns.begin(), kLaterColumns.end(), has); };
  has_columns_ = all();
  if (has_columns_ || !writes_) {
    return;
  }
  Transaction transaction(this);
  for (const char* column : kLaterColumns) {
    if (!has(column)) {  // another program may have been first
      execute(
          ("ALTER TABLE surveys ADD COLUMN " + std::string(column) + " TEXT NOT NULL DEFAULT ''")
              .c_str());
    }
  }
  transaction.commit();
  has_columns_ = true;
}

std::string SurveyStore::survey_rows() const {
  return std::string(kSurveyColumns) + (has_columns_ ? "vertical_datum, parts" : "'', ''") +
         " FROM surveys ";
}

namespace {

proto::HelloText hello_text(const std::string& text) {
  proto::HelloText out{};
  out.size_bytes =
      static_cast<std::uint8_t>(std::min<std::size_t>(text.size(), proto::kMaxHelloText_bytes));
  std::copy_n(text.begin(), out.size_bytes, std::begin(out.text));
  return out;
}

std::string text_of(const proto::HelloText& text) { return {text.text, text.size_bytes}; }

template <typename Row>
StoredSurvey survey_at(const Row& row) {
  StoredSurvey survey;
  survey.number = row.integer_at(0);
  proto::Hello& hello = survey.hello;
  hello.protocol_major = proto::kProtocolMajor;
  hello.tile_side_cells = proto::kTileSide_cells;
  hello.survey_id = static_cast<std::uint64_t>(row.integer_at(1));
  hello.session = static_cast<std::uint32_t>(row.integer_at(2));
  survey.kind = row.bytes_at(3);
  survey.name = row.bytes_at(4);
  hello.cell_mm = static_cast<std::int32_t>(row.integer_at(5));
  for (int axis = 0; axis < 3; ++axis) {
    hello.size_cells[axis] = static_cast<std::int32_t>(row.integer_at(6 + axis));
    hello.origin_mm[axis] = row.integer_at(9 + axis);
  }
  hello.has_geodetic_origin = row.is_null(12) || row.is_null(13) ? 0 : 1;
  if (hello.has_geodetic_origin != 0) {
    hello.latitude_e9deg = row.integer_at(12);
    hello.longitude_e9deg = row.integer_at(13);
  }
  hello.epsg = static_cast<std::int32_t>(row.integer_at(14));
  survey.begun_unix_s = row.integer_at(15);
  survey.saved_unix_s = row.integer_at(16);
  survey.known_cells = static_cast<std::uint64_t>(row.integer_at(17));
  survey.tiles = static_cast<std::uint32_t>(row.integer_at(18));
  hello.vertical_datum = hello_text(row.bytes_at(19));
  hello.survey_name = hello_text(survey.name);
  const std::string parts = row.bytes_at(20);
  for (std::size_t at = 0; at < parts.size();) {
    const std::size_t end = std::min(parts.find('\n', at), parts.size());
    survey.parts.push_back(parts.substr(at, end - at));
    at = end + 1;
  }
  return survey;
}

/// Whether the numbers make a grid that a hello could have said.
bool plausible(const proto::Hello& hello) {
  std::uint8_t bytes[proto::kMaxHello_bytes];
  return proto::encode_hello(hello, bytes, sizeof bytes).ok();
}

}  // namespace

std::vector<StoredSurvey> SurveyStore::surveys() const {
  std::vector<StoredSurvey> found;
  Statement rows(*this, survey_rows() + "ORDER BY number");
  while (rows.step()) {
    found.push_back(survey_at(rows));
  }
  return found;
}

std::optional<StoredSurvey> SurveyStore::survey(std::optional<std::int64_t> number) const {
  Statement rows(
      *this, survey_rows() +
                 (number ? "WHERE number = ?"
                         : "WHERE number = (SELECT number FROM surveys ORDER BY saved_unix_s DESC, "
                           "number DESC LIMIT 1)"));
  if (number) {
    rows.integer(*number);
  }
  if (!rows.step()) {
    return std::nullopt;
  }
  StoredSurvey found = survey_at(rows);
  if (!plausible(found.hello)) {
    throw HostError(ExitCode::kInput, path_ + ": survey " + std::to_string(found.number) +
                                          ": its grid or place is out of range");
  }
  return found;
}

std::optional<StoredSurvey> SurveyStore::survey_of(const proto::Hello& hello) const {
  const std::optional<std::int64_t> number = number_of(hello);
  return number ? survey(number) : std::nullopt;
}

// Without the survey's sums, for which all of its tiles would be read.
std::optional<std::int64_t> SurveyStore::number_of(const proto::Hello& hello) const {
  Statement rows(*this,
                 "SELECT number FROM surveys "
                 "WHERE kind = 'link' AND survey_id = ? AND session = ? AND cell_mm = ? "
                 "AND size_north = ? AND size_east = ? AND size_down = ? AND "
                 "origin_north_mm = ? AND origin_east_mm = ? AND origin_down_mm = ?");
  rows.integer(static_cast<std::int64_t>(hello.survey_id)).integer(hello.session);
  rows.integer(hello.cell_mm);
  for (const std::int32_t size : hello.size_cells) {
    rows.integer(size);
  }
  for (const std::int64_t origin_mm : hello.origin_mm) {
    rows.integer(origin_mm);
  }
  return rows.step() ? std::optional<std::int64_t>(rows.integer_at(0)) : std::nullopt;
}

StoreLoad SurveyStore::load(std::int64_t number, TileStore* store,
                            std::vector<DisputedCells>* disputed,
                            const std::function<void()>& meanwhile) const {
  StoreLoad load;
  if (disputed != nullptr) {
    disputed->assign(store->tile_count(), DisputedCells());
  }
  Statement rows(*this,
                 "SELECT tile, generation, hash32, crc32c, cells, disputed FROM tiles WHERE survey "
                 "= ? ORDER BY tile");
  rows.integer(number);
  while (rows.step()) {
    StoredTile tile;
    tile.tile = static_cast<std::uint32_t>(rows.integer_at(0));
    tile.generation = static_cast<std::uint32_t>(rows.integer_at(1));
    tile.hash32 = static_cast<std::uint32_t>(rows.integer_at(2));
    const std::string cells = rows.bytes_at(4);
    const std::string disputes = rows.bytes_at(5);
    const auto crc = static_cast<std::uint32_t>(rows.integer_at(3));
    if (cells.size() != kCells_bytes ||
        crc != tile_crc(tile.tile, tile.generation, tile.hash32, cells, disputes)) {
      load.damaged_tiles += 1;
      continue;
    }
    std::memcpy(tile.cells, cells.data(), kCells_bytes);
    if (!store->restore(tile)) {
      load.damaged_tiles += 1;
      continue;
    }
    load.tiles += 1;
    if (meanwhile && load.tiles % kTilesPerStep == 0) {
      meanwhile();
    }
    if (disputed != nullptr) {
      (*disputed)[tile.tile] = disputed_of(disputes);
    }
  }
  return load;
}

std::int64_t SurveyStore::insert_survey(const proto::Hello& hello, const char* kind,
                                        const std::string& name) {
  Statement row(
      *this,
      "INSERT INTO surveys (survey_id, session, kind, name, cell_mm, size_north, size_east, "
      "size_down, origin_north_mm, origin_east_mm, origin_down_mm, epsg, begun_unix_s, "
      "saved_unix_s) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, 0, ?, ?)");
  const std::string kind_text = kind;
  row.integer(static_cast<std::int64_t>(hello.survey_id)).integer(hello.session);
  row.text(kind_text).text(name).integer(hello.cell_mm);
  for (const std::int32_t size : hello.size_cells) {
    row.integer(size);
  }
  for (const std::int64_t origin_mm : hello.origin_mm) {
    row.integer(origin_mm);
  }
  const std::int64_t now = now_unix_s();
  row.integer(now).integer(now);
  (void)row.step();
  return sqlite3_last_insert_rowid(database_.get());
}

void SurveyStore::write_tile(std::int64_t number, std::uint32_t tile, const TileView& view,
                             const DisputedCells* disputed) {
  // Generations count modulo 2^32: the half ahead of the stored one is newer. Of two halves of one generation that
  // two topsides have, the one with more cells stays.
  Statement row(
      *this,
      "INSERT INTO tiles (survey, tile, generation, hash32, known_cells, crc32c, cells, "
      "disputed) VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (survey, tile) DO UPDATE SET "
      "generation = excluded.generation, hash32 = excluded.hash32, known_cells = "
      "excluded.known_cells, crc32c = excluded.crc32c, cells = excluded.cells, disputed = "
      "excluded.disputed WHERE ((excluded.generation - tiles.generation) & 4294967295) < "
      "2147483648 AND (? OR excluded.generation <> tiles.generation OR excluded.known_cells >= "
      "tiles.known_cells)");
  const std::string cells = cells_blob(view.cells);
  const std::string disputes =
      disputed != nullptr && disputed->any() ? disputed_blob(*disputed) : std::string();
  std::int64_t known = 0;
  for (int k = 0; k < proto::kTileArea_cells; ++k) {
    known += proto::cell_known(view.cells[k]) ? 1 : 0;
  }
  row.integer(number).integer(tile).integer(view.generation).integer(view.hash32).integer(known);
  row.integer(tile_crc(tile, view.generation, view.hash32, cells, disputes)).blob(cells);
  if (disputes.empty()) {
    row.null();
  } else {
    row.blob(disputes);
  }
  row.integer(view.complete ? 1 : 0);
  (void)row.step();
}

std::int64_t SurveyStore::save(const TileStore& store, std::uint64_t since) {
  Transaction transaction(this);
  const proto::Hello& hello = store.hello();
  const std::optional<std::int64_t> found = number_of(hello);
  const std::int64_t number =
      found ? *found : insert_survey(hello, "link", text_of(hello.survey_name));
  for (const std::uint32_t tile : store.changed_since(since)) {
    write_tile(number, tile, *store.tile(tile), nullptr);
  }
  write_place(number, hello);
  transaction.commit();
  return number;
}

// Where the map lies, and what its depth 0 means; now is when it was saved.
void SurveyStore::write_place(std::int64_t number, const proto::Hello& hello) {
  Statement row(
      *this,
      "UPDATE surveys SET latitude_e9deg = ?, longitude_e9deg = ?, epsg = ?, vertical_datum = ?, "
      "saved_unix_s = ? WHERE number = ?");
  if (hello.has_geodetic_origin != 0) {
    row.integer(hello.latitude_e9deg).integer(hello.longitude_e9deg);
  } else {
    row.null().null();
  }
  const std::string datum = text_of(hello.vertical_datum);
  row.integer(hello.epsg).text(datum).integer(now_unix_s()).integer(number);
  (void)row.step();
}

std::int64_t SurveyStore::write_merged(const TileStore& store,
                                       const std::vector<DisputedCells>& disputed,
                                       const std::string& name,
                                       const std::vector<std::string>& parts) {
  Transaction transaction(this);
  const proto::Hello& hello = store.hello();
  const std::int64_t number = insert_survey(hello, "merged", name);
  for (const std::uint32_t tile : store.changed_since(0)) {
    write_tile(number, tile, *store.tile(tile), &disputed[tile]);
  }
  write_place(number, hello);
  std::string lines;
  for (const std::string& part : parts) {
    lines += (lines.empty() ? "" : "\n") + part;
  }
  Statement row(*this, "UPDATE surveys SET parts = ? WHERE number = ?");
  row.text(lines).integer(number);
  (void)row.step();
  transaction.commit();
  return number;
}

StoreLoad StoreKeeper::begin(TileStore* map, const std::function<void()>& meanwhile) {
  StoreLoad load;
  if (const std::optional<StoredSurvey> found = store_.survey_of(map->hello())) {
    load = store_.load(found->number, map, nullptr, meanwhile);
    if (map->hello().has_geodetic_origin == 0 && found->hello.has_geodetic_origin != 0) {
      map->take_place(found->hello);
    }
  }
  saved_sequence_ = map->sequence();
  place_known_ = false;
  return load;
}

bool StoreKeeper::save(const TileStore& map, int patience_ms) {
  const bool place_known = map.hello().has_geodetic_origin != 0;
  if (map.sequence() == saved_sequence_ && place_known == place_known_) {
    return true;
  }
  const std::uint64_t sequence = map.sequence();
  try {
    store_.set_patience(patience_ms);
    (void)store_.save(map, saved_sequence_);
  } catch (const HostError& error) {
    problem_ = error.what();
    return false;
  }
  problem_.clear();
  saved_sequence_ = sequence;
  place_known_ = place_known;
  return true;
}

StorePath parse_store_path(const std::string& path) {
  const std::size_t mark = path.rfind('#');
  if (mark == std::string::npos) {
    return {path, std::nullopt};
  }
  std::int64_t number = 0;
  const char* const end = path.data() + path.size();
  const auto [stop, error] = std::from_chars(path.data() + mark + 1, end, number);
  if (error != std::errc() || stop != end || number < 1) {
    return {path, std::nullopt};
  }
  return {path.substr(0, mark), number};
}

bool is_store_path(const std::string& path) {
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  std::ifstream file(parse_store_path(path).file, std::ios::binary);
  char head[kMagic.size()] = {};
  return file.read(head, sizeof head) && std::string_view(head, sizeof head) == kMagic;
}

OpenedSurvey open_survey(const std::string& path) {
  const StorePath parts = parse_store_path(path);
  const SurveyStore store(parts.file, SurveyStore::Access::kRead);
  const std::optional<StoredSurvey> found = store.survey(parts.survey);
  if (!found) {
    throw HostError(ExitCode::kInput, parts.survey ? parts.file + ": has no survey " +
                                                         std::to_string(*parts.survey) +
                                                         " (leadline store list)"
                                                   : parts.file + ": has no survey yet");
  }
  OpenedSurvey opened{*found, std::make_unique<TileStore>(found->hello), {}, {}};
  opened.load = store.load(found->number, opened.map.get(), &opened.disputed);
  return opened;
}

}  // namespace leadline::host
