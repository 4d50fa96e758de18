// The store of a map's pages in a file: page_store.hpp on a thread of its own, so that the vehicle never waits
// for a disk. Each page that is written reaches the disk (fdatasync) before it counts.
//
// The vehicle thread hands over what the vehicle wants (ask) and takes what the store answers (take), bytes
// that enter the vehicle as input on firmware::kStorePort and stand in the log like all other input: a log
// replays without the file.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "firmware/linux/chunk_buffer.hpp"
#include "firmware/pipeline/config.hpp"
#include "firmware/pipeline/page_store.hpp"
#include "firmware/pipeline/tile_pager.hpp"
#include "model/localization_table.hpp"

namespace leadline::host {

class PageFile {
 public:
  /// Bytes of pages that one cycle takes: 100 pages of 64 cells a minute at 20 ms.
  static constexpr std::size_t kCycle_bytes = 8192;
  /// Of a piece: with its head well below a chunk.
  static constexpr std::size_t kPiece_bytes = 2000;

  /// Opens or creates the file, reads all of it, and starts the thread; `config` has resident_tiles. Throws
  /// HostError: kOutput (cannot be created or locked), kUsage (pages of another map are in it, or no pages at all:
  /// somebody's other file).
  PageFile(const std::string& path, const firmware::VehicleConfig& config,
           const std::vector<model::LocalizationTable>& tables);
  /// Carries out what was asked, then closes.
  ~PageFile();
  PageFile(const PageFile&) = delete;
  PageFile& operator=(const PageFile&) = delete;

  /// Vehicle thread. Copies what is to be saved.
  void ask(const firmware::StoreOutput& output);
  /// Vehicle thread: puts answers into the cycle's input, as far as their share goes.
  void take(base::TimeUs t_us, ChunkBuffer* chunks);
  /// Vehicle thread, virtual time: waits until all that was asked is answered, so that a flight repeats on any disk.
  void wait_answered();
  /// Vehicle thread: the survey ends. The vehicle will save everything.
  void finish();

  [[nodiscard]] const std::string& path() const { return path_; }
  /// Pages that were there at the start.
  [[nodiscard]] std::uint32_t pages_found() const { return pages_found_; }

 private:
  struct Job {
    model::TileId tile = 0;
    std::uint32_t generation = 0;  ///< of a page to save; 0: load
    std::vector<std::uint8_t> page;
  };
  using Answer = std::vector<std::uint8_t>;

  void open_store(const firmware::VehicleConfig& config,
                  const std::vector<model::LocalizationTable>& tables, std::uint32_t tile_count);
  [[nodiscard]] bool is_foreign_file() const;
  void announce();
  void run();
  void carry_out(const Job& job);
  void answer(Answer message);
  void say(const std::string& what) const;
  [[nodiscard]] std::int64_t offset_of(std::uint32_t slot, std::uint32_t offset) const;

  std::string path_;
  int fd_ = -1;
  std::uint32_t slot_bytes_ = 0;
  std::uint32_t slot_count_ = 0;
  std::uint32_t payload_bytes_ = 0;
  std::uint32_t pages_found_ = 0;
  std::unique_ptr<firmware::PageStore> store_;
  int failure_ = 0;  ///< errno of the failure that was reported, 0: none

  std::mutex mutex_;
  std::condition_variable wake_;
  std::condition_variable idle_;
  std::deque<Job> jobs_;
  std::deque<Answer> answers_;
  bool stopping_ = false;
  bool busy_ = false;  ///< a job is under way
  std::thread thread_;
};

}  // namespace leadline::host
