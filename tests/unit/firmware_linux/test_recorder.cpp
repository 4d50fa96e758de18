#include <csignal>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "firmware/config/exit_codes.hpp"
#include "firmware/linux/recorder.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace {

using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::Recorder;
using leadline::proto::decode_log_gap;
using leadline::proto::LogGap;
using leadline::proto::LogGapReason;
using leadline::proto::LogReader;
using leadline::proto::LogRecord;
using leadline::proto::LogWriter;
using leadline::proto::MessageType;
using leadline::test::wait_until;

std::string contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// A batch with one cycle record of that number and chunks of `filler` bytes.
std::vector<std::uint8_t> batch_of(std::uint32_t cycle, std::size_t filler) {
  std::vector<std::uint8_t> bytes(filler + filler / 100 + 4096);
  LogWriter writer(bytes.data(), bytes.size());
  const std::vector<std::uint8_t> fill(4000, static_cast<std::uint8_t>(cycle));
  for (std::size_t at = 0; at < filler; at += fill.size()) {
    assert_int_equal(writer.chunk({cycle, 0, 0, {fill.data(), 4000}}), 0);
  }
  assert_int_equal(writer.cycle({cycle, cycle, 0, 0, 0}), 0);
  bytes.resize(writer.size_bytes());
  return bytes;
}

struct Found {
  std::vector<std::uint32_t> cycles;
  std::vector<LogGap> gaps;
  std::uint32_t bad = 0;
};

Found read_log(const std::string& path) {
  const std::string bytes = contents(path);
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  std::size_t size = bytes.size();
  auto reader = std::make_unique<LogReader>();
  Found found;
  while (size > 0) {
    std::size_t used = 0;
    LogRecord record{};
    if (reader->next(data, size, used, record)) {
      if (record.type == MessageType::kLogCycle) {
        found.cycles.push_back(
            leadline::proto::decode_log_cycle(record.payload, record.payload_bytes).value().cycle);
      } else if (record.type == MessageType::kLogGap) {
        found.gaps.push_back(decode_log_gap(record.payload, record.payload_bytes).value());
      }
    }
    data += used;
    size -= used;
  }
  found.bad = reader->counters().gaps + (reader->mid_record() ? 1 : 0);
  return found;
}

/// Bytes that found no room.
std::size_t push(Recorder& recorder, std::uint32_t cycle, std::size_t filler = 0) {
  const std::vector<std::uint8_t> batch = batch_of(cycle, filler);
  return recorder.push(cycle, batch.data(), batch.size(), 1) ? 0 : batch.size();
}

TEST(every_batch_is_written_in_order) {
  const std::string path = leadline::test::scratch_directory() + "/log.lll";
  auto recorder = std::make_unique<Recorder>(path, 0);
  std::uint64_t bytes = 0;
  for (std::uint32_t cycle = 0; cycle < 500; ++cycle) {
    bytes += batch_of(cycle, cycle % 3 * 4000).size();
    (void)push(*recorder, cycle, cycle % 3 * 4000);
    if (cycle % 50 == 0) {  // the ring holds what the disk is behind; do not outrun it for ever
      (void)wait_until([&] { return recorder->report().bytes_written == bytes; });
    }
  }
  assert_true(recorder->finish());
  assert_true(recorder->finish());  // once more is nothing
  assert_int_equal(recorder->report().bytes_written, bytes);
  assert_int_equal(recorder->report().records_lost, 0);
  const Found found = read_log(path);
  assert_int_equal(found.bad, 0);
  assert_int_equal(found.cycles.size(), 500);
  for (std::uint32_t cycle = 0; cycle < 500; ++cycle) {
    assert_int_equal(found.cycles[cycle], cycle);
  }
}

TEST(a_log_that_is_there_is_kept) {
  const std::string directory = leadline::test::scratch_directory();
  std::ofstream(directory + "/a.b.lll") << "precious";
  std::ofstream(directory + "/a.b.1.lll") << "too";
  const Recorder recorder(directory + "/a.b.lll", 0);
  assert_string_equal(recorder.path().c_str(), (directory + "/a.b.2.lll").c_str());
  assert_string_equal(contents(directory + "/a.b.lll").c_str(), "precious");
}

TEST(a_place_where_nothing_can_be_made_is_an_output_error) {
  ExitCode code = ExitCode::kOk;
  std::string message;
  try {
    const Recorder recorder("/nowhere/log.lll", 0);
  } catch (const HostError& error) {
    code = error.code();
    message = error.what();
  }
  assert_int_equal(code, ExitCode::kOutput);
  assert_true(message.find("/nowhere/log.lll: cannot create the log") != std::string::npos);
}

TEST(the_limit_is_kept_and_the_losses_are_counted) {
  const std::string path = leadline::test::scratch_directory() + "/log.lll";
  const std::size_t size = batch_of(0, 8000).size();
  {
    Recorder recorder(path, static_cast<std::int64_t>(3 * size + size / 2));
    for (std::uint32_t cycle = 0; cycle < 5; ++cycle) {
      (void)push(recorder, cycle, 8000);
    }
    assert_true(wait_until([&] { return recorder.report().records_lost == 2; }));
    assert_true(recorder.report().failing);
    assert_int_equal(recorder.report().bytes_lost,
                     batch_of(3, 8000).size() + batch_of(4, 8000).size());
    assert_false(recorder.finish());
  }
  const Found found = read_log(path);
  assert_int_equal(found.cycles.size(), 3);
  assert_int_equal(found.bad, 0);
}

TEST(a_ring_that_is_full_loses_whole_batches_and_marks_the_gap) {
  // A pipe that nobody reads stops the recorder in the middle of a write: the slowest disk there is.
  const std::string path = leadline::test::scratch_directory() + "/pipe";
  assert_int_equal(::mkfifo(path.c_str(), 0600), 0);
  const int reader = ::open(path.c_str(), O_RDONLY | O_NONBLOCK);
  assert_true(reader >= 0);
  std::string bytes;
  std::uint32_t pushed = 0;
  std::uint32_t lost = 0;
  std::size_t lost_bytes = 0;
  {
    Recorder recorder(path, 0);
    while (recorder.report().records_lost < 3 && pushed < 10'000) {
      lost_bytes += push(recorder, pushed, 100'000);
      pushed += 1;
    }
    lost = recorder.report().records_lost;
    assert_int_equal(lost, 3);
    std::vector<char> buffer(65536);
    const auto drain = [&] {
      const ssize_t some = ::read(reader, buffer.data(), buffer.size());
      if (some > 0) {
        bytes.append(buffer.data(), static_cast<std::size_t>(some));
      }
      return false;
    };
    for (int i = 0; i < 2000; ++i) {
      (void)drain();
    }
    assert_true(wait_until([&] {
      (void)drain();
      return bytes.size() >= std::size_t{pushed - lost} * 100'000;
    }));
    (void)push(recorder, pushed);
    // Everything fits the pipe from here on.
    assert_true(wait_until([&] {
      (void)drain();
      return recorder.report().bytes_written >= bytes.size() &&
             bytes.size() >= std::size_t{pushed - lost} * 100'000;
    }));
    (void)recorder.finish();
    for (int i = 0; i < 100; ++i) {
      (void)drain();
    }
  }
  ::close(reader);
  const std::string copy = leadline::test::scratch_directory() + "/copy.lll";
  std::ofstream(copy, std::ios::binary) << bytes;
  const Found found = read_log(copy);
  assert_int_equal(found.bad, 0);
  assert_int_equal(found.cycles.size(), pushed - lost + 1);
  assert_int_equal(found.gaps.size(), 1);
  assert_int_equal(found.gaps[0].reason, LogGapReason::kRingFull);
  assert_int_equal(found.gaps[0].lost_records, 3);
  assert_int_equal(found.gaps[0].lost_bytes, lost_bytes);
}

TEST(half_a_batch_does_not_stay_and_recording_goes_on) {
  std::signal(SIGXFSZ, SIG_IGN);
  const std::string path = leadline::test::scratch_directory() + "/log.lll";
  const std::size_t size = batch_of(0, 8000).size();
  rlimit before{};
  assert_int_equal(::getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit tight = before;
  tight.rlim_cur = 2 * size + size / 2;
  std::uint32_t lost = 0;
  {
    Recorder recorder(path, 0);
    assert_int_equal(::setrlimit(RLIMIT_FSIZE, &tight), 0);
    for (std::uint32_t cycle = 0; cycle < 4; ++cycle) {
      (void)push(recorder, cycle, 8000);
    }
    const bool counted = wait_until([&] { return recorder.report().records_lost == 2; });
    assert_int_equal(::setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_true(counted);
    assert_int_equal(read_log(path).bad, 0);
    // Tried again a second later: with whatever comes then.
    std::uint32_t cycle = 4;
    assert_true(wait_until([&] {
      (void)push(recorder, cycle, 0);
      cycle += 1;
      return !recorder.report().failing;
    }));
    assert_false(recorder.finish());
    lost = recorder.report().records_lost;
  }
  const Found found = read_log(path);
  assert_int_equal(found.bad, 0);
  assert_int_equal(found.gaps.size(), 1);
  assert_int_equal(found.gaps[0].reason, LogGapReason::kDiskFull);
  assert_int_equal(found.gaps[0].lost_records, lost);
  assert_int_equal(found.cycles[1], 1);
  assert_int_equal(found.cycles[2], 2 + lost);
}

TEST(other_errors_are_told_from_a_full_disk) {
  const std::string path = leadline::test::scratch_directory() + "/pipe";
  assert_int_equal(::mkfifo(path.c_str(), 0600), 0);
  std::signal(SIGPIPE, SIG_IGN);
  const int reader = ::open(path.c_str(), O_RDONLY | O_NONBLOCK);
  Recorder recorder(path, 0);
  ::close(reader);  // EPIPE from now on
  (void)push(recorder, 0);
  assert_true(wait_until([&] { return recorder.report().failing; }));
  const int again = ::open(path.c_str(), O_RDONLY | O_NONBLOCK);
  std::uint32_t cycle = 1;
  assert_true(wait_until([&] {
    (void)push(recorder, cycle);
    cycle += 1;
    return !recorder.report().failing;
  }));
  (void)recorder.finish();
  std::string bytes(65536, '\0');
  const ssize_t size = ::read(again, bytes.data(), bytes.size());
  ::close(again);
  assert_true(size > 0);
  const std::string copy = leadline::test::scratch_directory() + "/copy.lll";
  std::ofstream(copy, std::ios::binary) << bytes.substr(0, static_cast<std::size_t>(size));
  const Found found = read_log(copy);
  assert_int_equal(found.gaps.size(), 1);
  assert_int_equal(found.gaps[0].reason, LogGapReason::kWriteError);
}

TEST(a_batch_that_is_too_large_is_lost_not_cut) {
  const std::string path = leadline::test::scratch_directory() + "/log.lll";
  Recorder recorder(path, 0);
  const std::vector<std::uint8_t> huge(Recorder::kBatch_bytes + 1);
  assert_false(recorder.push(0, huge.data(), huge.size(), 7));
  assert_int_equal(recorder.report().records_lost, 7);
  (void)push(recorder, 1);
  assert_false(recorder.finish());
  const Found found = read_log(path);
  assert_int_equal(found.gaps.size(), 1);
  assert_int_equal(found.gaps[0].lost_records, 7);
  assert_int_equal(found.cycles.size(), 1);
}

}  // namespace
