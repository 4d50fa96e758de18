#include "firmware/linux/page_file.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <iostream>
#include <sstream>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "firmware/config/exit_codes.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "model/base/crc32c.hpp"

namespace leadline::host {
namespace {

/// Pages of a disk: a slot begins with one.
constexpr std::uint32_t kDiskPage_bytes = 4096;

/// Of everything that decides what a voxel means: grid, rule, tables.
std::uint32_t layout_of(const model::ModelConfig& model,
                        const std::vector<model::LocalizationTable>& tables) {
  const std::int64_t words[] = {1,
                                model.cell_mm,
                                model.size[0],
                                model.size[1],
                                model.size[2],
                                model.origin_mm[0],
                                model.origin_mm[1],
                                model.origin_mm[2],
                                static_cast<std::int64_t>(model.rule),
                                static_cast<std::int64_t>(model.k_p_q16)};
  std::uint32_t crc = base::crc32c(words, sizeof words);
  for (const model::LocalizationTable& table : tables) {
    crc = base::crc32c(&table, sizeof table, crc);
  }
  return crc;
}

bool read_whole(int fd, void* out, std::size_t size_bytes, std::int64_t offset) {
  auto* bytes = static_cast<std::uint8_t*>(out);
  while (size_bytes > 0) {
    const ssize_t some = ::pread(fd, bytes, size_bytes, offset);
    if (some < 0 && errno == EINTR) {
      continue;
    }
    if (some < 0) {
      return false;
    }
    if (some == 0) {
      std::memset(bytes, 0, size_bytes);  // beyond the file's end: never written
      return true;
    }
    bytes += some;
    offset += some;
    size_bytes -= static_cast<std::size_t>(some);
  }
  return true;
}

bool write_whole(int fd, const void* data, std::size_t size_bytes, std::int64_t offset) {
  const auto* bytes = static_cast<const std::uint8_t*>(data);
  while (size_bytes > 0) {
    const ssize_t some = ::pwrite(fd, bytes, size_bytes, offset);
    if (some < 0 && errno == EINTR) {
      continue;
    }
    if (some <= 0) {
      errno = some == 0 ? EIO : errno;
      return false;
    }
    bytes += some;
    offset += some;
    size_bytes -= static_cast<std::size_t>(some);
  }
  return true;
}

}  // namespace

std::int64_t PageFile::offset_of(std::uint32_t slot, std::uint32_t offset) const {
  return static_cast<std::int64_t>(slot) * slot_bytes_ + offset;
}

// Nothing of a store is in it, and it begins with something: somebody's other file. (What a cut has left of a first
// page begins with zeros, or with the head of one.)
bool PageFile::is_foreign_file() const {
  const firmware::PageStoreCounters& counters = store_->counters();
  std::uint8_t head[firmware::kPageHeader_bytes];
  const bool begun = read_whole(fd_, head, sizeof head, 0) &&
                     std::any_of(head, head + sizeof head, [](std::uint8_t b) { return b != 0; });
  return begun && pages_found_ == 0 && counters.slots_damaged == 0;
}

PageFile::PageFile(const std::string& path, const firmware::VehicleConfig& config,
                   const std::vector<model::LocalizationTable>& tables)
    : path_(path), store_(std::make_unique<firmware::PageStore>()) {
  const auto tiles = [&config](int axis) {
    return static_cast<std::uint32_t>((config.model.size[axis] + model::kTileCells - 1) /
                                      model::kTileCells);
  };
  const std::uint32_t tile_count = tiles(0) * tiles(1);
  payload_bytes_ = firmware::page_bytes(config.model.size[2]);
  slot_bytes_ = (firmware::kPageHeader_bytes + payload_bytes_ + kDiskPage_bytes - 1) /
                kDiskPage_bytes * kDiskPage_bytes;
  slot_count_ = std::min(tile_count + std::max(firmware::kSpareSlots, tile_count / 16),
                         firmware::PageStore::kSlotCapacity);
  fd_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd_ < 0) {
    throw HostError(ExitCode::kOutput, path + ": cannot open the store: " + std::strerror(errno));
  }
  try {
    open_store(config, tables, tile_count);
  } catch (const HostError&) {
    ::close(fd_);
    throw;
  }
  thread_ = std::thread([this] { run(); });
}

void PageFile::open_store(const firmware::VehicleConfig& config,
                          const std::vector<model::LocalizationTable>& tables,
                          std::uint32_t tile_count) {
  struct stat file {};
  if (::fstat(fd_, &file) != 0 || !S_ISREG(file.st_mode)) {
    throw HostError(ExitCode::kUsage, path_ + ": [store] path has to name an ordinary file");
  }
  if (::flock(fd_, LOCK_EX | LOCK_NB) != 0) {
    throw HostError(ExitCode::kOutput, path_ + ": the store is in use by another vehicle");
  }
  const firmware::PageDevice device = {
      this,
      slot_count_,
      slot_bytes_,
      [](void* context, std::uint32_t slot, std::uint32_t offset, void* out, std::uint32_t size) {
        const auto* const store = static_cast<PageFile*>(context);
        return read_whole(store->fd_, out, size, store->offset_of(slot, offset));
      },
      [](void*, std::uint32_t) { return true; },
      [](void* context, std::uint32_t slot, std::uint32_t offset, const void* data,
         std::uint32_t size) {
        const auto* const store = static_cast<PageFile*>(context);
        return write_whole(store->fd_, data, size, store->offset_of(slot, offset));
      },
      [](void* context) { return ::fdatasync(static_cast<PageFile*>(context)->fd_) == 0; }};
  const base::Status status =
      store_->mount(device, layout_of(config.model, tables), tile_count, payload_bytes_);
  const bool foreign = store_->counters().slots_foreign > 0;
  if (status != base::Status::kOk || foreign) {
    throw HostError(
        ExitCode::kUsage,
        path_ + (foreign ? ": holds pages of another map (grid, rule or tables differ); "
                           "move it away, or name another file in [store] path"
                         : std::string(": ") + base::status_text(status)));
  }
  announce();
  if (is_foreign_file()) {
    throw HostError(ExitCode::kUsage,
                    path_ +
                        ": is no store of a map, and would be overwritten; move it away, or "
                        "name another file in [store] path");
  }
  if (store_->counters().slots_damaged > 0) {
    say(std::to_string(store_->counters().slots_damaged) +
        " pages were begun and are not whole: those before them count");
  }
}

PageFile::~PageFile() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_one();
  thread_.join();
  ::close(fd_);
}

void PageFile::announce() {
  for (model::TileId tile = 0; tile < store_->tile_count(); ++tile) {
    if (store_->generation(tile) != 0) {
      Answer message(firmware::kStoreHas_bytes);
      (void)firmware::put_store_has(message.data(), tile, store_->generation(tile));
      answers_.push_back(std::move(message));
      ++pages_found_;
    }
  }
  Answer ready(1);
  (void)firmware::put_store_ready(ready.data());
  answers_.push_back(std::move(ready));
}

// ---- Vehicle thread -----------------------------------------------------------------------------

void PageFile::ask(const firmware::StoreOutput& output) {
  if (!output.save && !output.load) {
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (output.save) {
      Job job{output.save_tile, output.save_generation, {}};
      job.page.resize(output.voxels_bytes + output.records_bytes);
      std::memcpy(job.page.data(), output.voxels, output.voxels_bytes);
      std::memcpy(job.page.data() + output.voxels_bytes, output.records, output.records_bytes);
      jobs_.push_back(std::move(job));
    }
    if (output.load) {
      jobs_.push_back({output.load_tile, 0, {}});
    }
  }
  wake_.notify_one();
}

void PageFile::take(base::TimeUs t_us, ChunkBuffer* chunks) {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::size_t room = kCycle_bytes;
  Answer chunk;
  const auto hand_over = [&] {
    if (!chunk.empty() && !chunks->add(firmware::kStorePort, t_us, chunk.data(), chunk.size())) {
      return false;
    }
    chunk.clear();
    return true;
  };
  while (!answers_.empty() && answers_.front().size() <= room) {
    const Answer& next = answers_.front();
    if (chunk.size() + next.size() > firmware::kMaxChunk_bytes && !hand_over()) {
      break;
    }
    chunk.insert(chunk.end(), next.begin(), next.end());
    room -= next.size();
    answers_.pop_front();
  }
  if (!hand_over()) {
    answers_.push_front(std::move(chunk));  // whole messages: the next cycle has room
  }
}

void PageFile::wait_answered() {
  std::unique_lock<std::mutex> lock(mutex_);
  idle_.wait(lock, [this] { return jobs_.empty() && !busy_; });
}

void PageFile::finish() {
  Answer message(1);
  (void)firmware::put_store_finish(message.data());
  answer(std::move(message));
}

// ---- The store's thread -------------------------------------------------------------------------

void PageFile::answer(Answer message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  answers_.push_back(std::move(message));
}

void PageFile::say(const std::string& what) const {
  std::ostringstream line;  // one write: lines of two threads do not mix
  line << "leadline-vehicle: store " << path_ << ": " << what << "\n";
  std::cerr << line.str();
}

void PageFile::carry_out(const Job& job) {
  if (job.generation != 0) {
    errno = 0;
    const bool good = store_->write(job.tile, job.generation, job.page.data());
    const int number = good ? 0 : std::max(errno, 1);
    if (number != failure_) {
      say(good ? "saving again"
               : std::string("pages cannot be saved, mapping goes on: ") + std::strerror(number));
      failure_ = number;
    }
    Answer message(firmware::kStoreSaved_bytes);
    (void)firmware::put_store_saved(message.data(), job.tile, job.generation, good);
    answer(std::move(message));
    return;
  }
  std::vector<std::uint8_t> page(payload_bytes_);
  if (!store_->read(job.tile, page.data())) {
    say("the page of tile " + std::to_string(job.tile) + " cannot be read: it begins anew");
    Answer message(firmware::kStoreLost_bytes);
    (void)firmware::put_store_lost(message.data(), job.tile);
    answer(std::move(message));
    return;
  }
  for (std::size_t at = 0; at < page.size(); at += kPiece_bytes) {
    const std::size_t size = std::min(kPiece_bytes, page.size() - at);
    Answer message(firmware::kStorePieceHead_bytes + size);
    (void)firmware::put_store_piece_head(message.data(), job.tile, static_cast<std::uint32_t>(at),
                                         static_cast<std::uint16_t>(size));
    std::memcpy(message.data() + firmware::kStorePieceHead_bytes, page.data() + at, size);
    answer(std::move(message));
  }
}

void PageFile::run() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    wake_.wait(lock, [this] { return stopping_ || !jobs_.empty(); });
    if (jobs_.empty()) {
      return;
    }
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    busy_ = true;
    lock.unlock();
    carry_out(job);
    lock.lock();
    busy_ = false;
    idle_.notify_all();
  }
}

}  // namespace leadline::host
