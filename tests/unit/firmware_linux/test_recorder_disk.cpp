// The recorder on a disk that fails or stops at any of its writes. This program's own write() and
// clock_gettime() stand before the library's: each write to the log may be told to fail, to come short or to wait.
#include <atomic>
#include <cerrno>
#include <ctime>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "firmware/linux/recorder.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace {

using leadline::host::Recorder;
using leadline::proto::LogGapReason;
using leadline::proto::LogReader;
using leadline::proto::LogRecord;
using leadline::proto::LogWriter;
using leadline::proto::MessageType;
using leadline::test::wait_until;

/// Batches begin with this many bytes at least; what the recorder says on stderr is shorter.
constexpr std::size_t kFiller_bytes = 4000;

struct Disk {
  std::atomic<int> writes{0};            ///< to the log, so far
  std::atomic<int> fails_at{-1};         ///< the number of the first write that fails
  std::atomic<int> fails{1};             ///< so many do
  std::atomic<int> error{0};             ///< with this errno
  std::atomic<bool> short_first{false};  ///< half of it is written, the rest fails
  std::atomic<bool> held{false};         ///< a write waits until this is over
  std::atomic<bool> waits{false};        ///< one does
  std::atomic<long> later_s{0};          ///< added to the monotonic clock
};
Disk disk;

ssize_t real_write(int fd, const void* data, std::size_t size) {
  return ::syscall(SYS_write, fd, data, size);
}

}  // namespace

extern "C" ssize_t write(int fd, const void* data, std::size_t size) {
  if (fd <= STDERR_FILENO) {
    return real_write(fd, data, size);
  }
  while (disk.held.load()) {
    disk.waits.store(true);
    (void)::poll(nullptr, 0, 1);
  }
  const int number = disk.writes.fetch_add(1);
  const int into = number - disk.fails_at.load();
  if (disk.fails_at.load() < 0 || into < 0 || into >= disk.fails.load()) {
    return real_write(fd, data, size);
  }
  if (disk.short_first.exchange(false)) {
    disk.fails_at.store(number + 1);
    return real_write(fd, data, size / 2);
  }
  errno = disk.error.load();
  return -1;
}

extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const int result = static_cast<int>(::syscall(SYS_clock_gettime, clock, time));
  if (clock == CLOCK_MONOTONIC) {
    time->tv_sec += disk.later_s.load();
  }
  return result;
}

namespace {

std::vector<std::uint8_t> batch_of(std::uint32_t cycle, std::size_t filler_bytes) {
  std::vector<std::uint8_t> bytes(filler_bytes + filler_bytes / 100 + 4096);
  LogWriter writer(bytes.data(), bytes.size());
  const std::vector<std::uint8_t> fill(kFiller_bytes, static_cast<std::uint8_t>(cycle));
  for (std::size_t at = 0; at < filler_bytes; at += kFiller_bytes) {
    assert_int_equal(writer.chunk({cycle, 0, 0, {fill.data(), kFiller_bytes}}), 0);
  }
  assert_int_equal(writer.cycle({cycle, cycle, 0, 0, 0}), 0);
  bytes.resize(writer.size_bytes());
  return bytes;
}

void push(Recorder& recorder, std::uint32_t cycle, std::size_t filler_bytes = kFiller_bytes) {
  const std::vector<std::uint8_t> batch = batch_of(cycle, filler_bytes);
  (void)recorder.push(cycle, batch.data(), batch.size(), 1);
}

struct Found {
  std::vector<std::uint32_t> cycles;
  std::vector<leadline::proto::LogGap> gaps;
  bool whole = false;  ///< nothing in it but whole records
};

Found read_log(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  std::size_t size = bytes.size();
  const auto reader = std::make_unique<LogReader>();
  Found found;
  while (size > 0) {
    std::size_t used = 0;
    LogRecord record{};
    if (reader->next(data, size, used, record)) {
      if (record.type == MessageType::kLogCycle) {
        found.cycles.push_back(
            leadline::proto::decode_log_cycle(record.payload, record.payload_bytes).value().cycle);
      } else if (record.type == MessageType::kLogGap) {
        found.gaps.push_back(
            leadline::proto::decode_log_gap(record.payload, record.payload_bytes).value());
      }
    }
    data += used;
    size -= used;
  }
  found.whole = reader->counters().gaps == 0 && !reader->mid_record();
  return found;
}

/// Six batches, the one with number `broken` meets the error; the next is lost too, as the disk is left alone
/// for a second.
void fail_one_write(int broken, int error, bool short_first, LogGapReason reason) {
  constexpr std::uint32_t kBatches = 6;
  const std::string path = leadline::test::scratch_directory() + "/log.lll";
  const auto failed = static_cast<std::uint32_t>(broken);
  std::uint32_t written = 0;
  Recorder recorder(path, 0);
  disk.writes.store(0);
  disk.error.store(error);
  disk.short_first.store(short_first);
  disk.fails_at.store(broken);
  for (std::uint32_t cycle = 0; cycle < kBatches; ++cycle) {
    if (cycle == failed + 2) {
      disk.later_s.fetch_add(2);
    }
    push(recorder, cycle);
    const bool lost = cycle == failed || cycle == failed + 1;
    written += lost ? 0 : 1;
    const std::uint32_t losses = cycle + 1 - written;
    assert_true(wait_until([&] {
      return recorder.report().records_lost == losses && recorder.report().failing == lost &&
             recorder.report().bytes_written >= written * batch_of(0, kFiller_bytes).size();
    }));
  }
  assert_false(recorder.finish());  // not every record was written
  const Found found = read_log(path);
  assert_true(found.whole);
  assert_int_equal(recorder.report().records_lost, kBatches - written);
  assert_int_equal(found.cycles.size(), written);
  for (std::uint32_t i = 0; i < written; ++i) {
    assert_int_equal(found.cycles[i], i < failed ? i : i + 2);
  }
  // What came behind the failure says what is missing.
  assert_int_equal(found.gaps.size(), written > failed ? 1 : 0);
  if (written > failed) {
    assert_int_equal(found.gaps[0].reason, reason);
    assert_int_equal(found.gaps[0].lost_records, 2);
  }
}

TEST(every_write_may_fail_with_enospc_or_eio_whole_or_short) {
  for (int broken = 0; broken < 4; ++broken) {
    for (const bool short_first : {false, true}) {
      fail_one_write(broken, ENOSPC, short_first, LogGapReason::kDiskFull);
      fail_one_write(broken, EIO, short_first, LogGapReason::kWriteError);
    }
  }
}

TEST(a_mark_of_what_is_missing_that_fails_comes_later) {
  const std::string path = leadline::test::scratch_directory() + "/log.lll";
  Recorder recorder(path, 0);
  disk.writes.store(0);
  disk.error.store(EIO);
  disk.fails.store(2);  // a batch, and the mark in front of the next
  disk.fails_at.store(1);
  for (std::uint32_t cycle = 0; cycle < 4; ++cycle) {
    push(recorder, cycle);
    const bool lost = cycle == 1 || cycle == 2;
    const std::uint32_t losses = cycle < 2 ? cycle : 2;
    assert_true(wait_until([&] {
      return recorder.report().records_lost == losses && recorder.report().failing == lost &&
             (lost || recorder.report().bytes_written > cycle * kFiller_bytes / 2);
    }));
    disk.later_s.fetch_add(2);
  }
  disk.fails.store(1);
  assert_false(recorder.finish());
  const Found found = read_log(path);
  assert_true(found.whole);
  assert_int_equal(found.cycles.size(), 2);
  assert_int_equal(found.cycles[1], 3);
  assert_int_equal(found.gaps.size(), 1);
  assert_int_equal(found.gaps[0].lost_records, 2);
}

TEST(an_interrupted_write_is_no_failure) {
  const std::string path = leadline::test::scratch_directory() + "/log.lll";
  Recorder recorder(path, 0);
  disk.writes.store(0);
  disk.error.store(EINTR);
  disk.fails_at.store(1);
  for (std::uint32_t cycle = 0; cycle < 3; ++cycle) {
    push(recorder, cycle);
  }
  assert_true(recorder.finish());
  assert_int_equal(read_log(path).cycles.size(), 3);
}

// 25 cycles of 20 ms: half a second, in which cycles bring the most that the ring is made for (a ring a second).
TEST(a_write_that_takes_500_ms_loses_nothing) {
  constexpr std::uint32_t kCycles = 25;
  constexpr std::size_t kMost_bytes = Recorder::kRing_bytes / 50 / kFiller_bytes * kFiller_bytes;
  const std::string path = leadline::test::scratch_directory() + "/log.lll";
  Recorder recorder(path, 0);
  disk.fails_at.store(-1);
  disk.waits.store(false);
  disk.held.store(true);
  push(recorder, 0);
  assert_true(wait_until([&] { return disk.waits.load(); }));
  for (std::uint32_t cycle = 1; cycle <= kCycles; ++cycle) {
    push(recorder, cycle, kMost_bytes);  // comes back at once, or this test would never end
  }
  assert_int_equal(recorder.report().bytes_written, 0);
  disk.held.store(false);
  assert_true(recorder.finish());
  const Found found = read_log(path);
  assert_true(found.whole && found.gaps.empty());
  assert_int_equal(found.cycles.size(), kCycles + 1);
  for (std::uint32_t cycle = 0; cycle <= kCycles; ++cycle) {
    assert_int_equal(found.cycles[cycle], cycle);
  }
}

}  // namespace
