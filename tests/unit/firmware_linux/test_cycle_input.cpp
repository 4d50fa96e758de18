// What surrounds a cycle: chunks of input, datagrams of output, the host's report.
#include <cstring>
#include <string>
#include <vector>

#include "firmware/linux/chunk_buffer.hpp"
#include "firmware/linux/datagrams.hpp"
#include "firmware/linux/monotonic.hpp"
#include "firmware/pipeline/host_report.hpp"
#include "proto/framing.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::decode_host_report;
using leadline::firmware::encode_host_report;
using leadline::firmware::HostReport;
using leadline::hal::LinuxPort;
using leadline::hal::PortCounters;
using leadline::hal::PortState;
using leadline::host::ChunkBuffer;
using leadline::host::next_datagram_bytes;

/// As many bytes as are asked for, at most `piece` at a time.
class Spring final : public LinuxPort {
 public:
  explicit Spring(std::size_t piece, bool datagrams = false)
      : piece_(piece), datagrams_(datagrams) {}

  std::size_t read(TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                   TimeUs& t_arrival_us) override {
    const std::size_t size = capacity < piece_ ? capacity : piece_;
    std::memset(out, 'x', size);
    t_arrival_us = now_us;
    cut_ = cut_ || (datagrams_ && size < piece_);
    return size;
  }
  std::size_t write(const std::uint8_t* /*data*/, std::size_t size) override { return size; }
  void service(TimeUs /*now_us*/) override {}
  [[nodiscard]] PortState state() const override { return PortState::kOpen; }
  [[nodiscard]] const PortCounters& counters() const override { return counters_; }
  [[nodiscard]] std::size_t write_room() const override { return 0; }
  [[nodiscard]] std::size_t pending_out_bytes() const override { return 0; }
  [[nodiscard]] int poll_fd() const override { return -1; }
  [[nodiscard]] short poll_events() const override { return 0; }
  [[nodiscard]] int last_errno() const override { return 0; }
  [[nodiscard]] bool datagrams() const override { return datagrams_; }
  [[nodiscard]] bool cut() const { return cut_; }

 private:
  std::size_t piece_;
  bool datagrams_;
  bool cut_ = false;
  PortCounters counters_{};
};

std::size_t total(const ChunkBuffer& buffer, std::uint8_t number) {
  std::size_t sum = 0;
  for (std::size_t i = 0; i < buffer.chunk_count(); ++i) {
    sum += buffer.chunks()[i].port == number ? buffer.chunks()[i].size_bytes : 0;
  }
  return sum;
}

TEST(a_source_takes_its_share_and_no_more) {
  ChunkBuffer buffer(2, 10'000);
  Spring flood(4096);
  Spring other(10);
  TimeUs now_us = 0;
  while (buffer.read(flood, 0, 0, ++now_us)) {
  }
  assert_int_equal(total(buffer, 0), 10'000);
  assert_false(buffer.has_room(flood, 0));
  assert_true(buffer.has_room(other, 1));
  assert_true(buffer.read(other, 1, 255, now_us));
  assert_int_equal(total(buffer, 255), 10);
  buffer.clear();
  assert_int_equal(buffer.chunk_count(), 0);
  assert_true(buffer.read(flood, 0, 0, now_us));
}

TEST(bytes_that_arrive_together_are_one_chunk) {
  ChunkBuffer buffer(2, 30'000);
  Spring drip(7);
  for (int i = 0; i < 1000; ++i) {
    assert_true(buffer.read(drip, 0, 3, 5));
  }
  // Cut at the limit of a chunk wherever the pieces lie.
  assert_int_equal(buffer.chunk_count(), 2);
  assert_int_equal(buffer.chunks()[0].size_bytes, leadline::firmware::kMaxChunk_bytes);
  assert_int_equal(total(buffer, 3), 7000 - (7 - leadline::firmware::kMaxChunk_bytes % 7));
  assert_int_equal(buffer.chunks()[0].t_arrival_us, 5);
  assert_true(buffer.read(drip, 0, 3, 6));  // later: another chunk
  assert_int_equal(buffer.chunk_count(), 3);
  buffer.retime(9);
  assert_int_equal(buffer.chunks()[2].t_arrival_us, 9);
}

TEST(many_small_chunks_end_at_their_number) {
  ChunkBuffer buffer(1, 60'000);
  Spring drip(1);
  TimeUs now_us = 0;
  std::size_t count = 0;
  while (buffer.read(drip, 0, 0, ++now_us)) {
    count += 1;
  }
  assert_int_equal(count, ChunkBuffer::kMaxChunksPerSource);
  const std::uint8_t own[] = {1, 2, 3};
  for (std::size_t i = 0; i < ChunkBuffer::kOwnChunks; ++i) {
    assert_true(buffer.add(254, now_us, own, sizeof own));  // the program's own always finds room
    assert_memory_equal(buffer.chunks()[count + i].data, own, sizeof own);
  }
  assert_false(buffer.add(254, now_us, own, sizeof own));
}

TEST(datagrams_are_taken_whole_or_left) {
  ChunkBuffer buffer(1, 7000);
  Spring datagrams(1400, true);
  TimeUs now_us = 0;
  while (buffer.read(datagrams, 0, 0, now_us)) {
  }
  assert_false(datagrams.cut());
  assert_int_equal(buffer.chunk_count(), 4);  // the fifth might not have fitted
  assert_true(buffer.read(datagrams, 0, 0, now_us) == false);
}

TEST(a_limit_is_kept) {
  ChunkBuffer buffer(1, 7000);
  Spring flood(4096);
  assert_true(buffer.read(flood, 0, 0, 0, 12));
  assert_int_equal(total(buffer, 0), 12);
}

std::vector<std::uint8_t> frame(std::size_t payload_bytes) {
  const std::vector<std::uint8_t> payload(payload_bytes, 0);
  std::vector<std::uint8_t> out(leadline::proto::frame_bound_bytes(payload_bytes));
  const auto size =
      leadline::proto::encode_frame(payload.data(), payload.size(), out.data(), out.size());
  out.resize(size.value());
  return out;
}

TEST(datagrams_hold_whole_frames) {
  std::vector<std::uint8_t> bytes;
  std::vector<std::size_t> ends;
  for (const std::size_t payload : {100, 300, 50, 700, 20, 1300, 10}) {
    const std::vector<std::uint8_t> one = frame(payload);
    bytes.insert(bytes.end(), one.begin(), one.end());
    ends.push_back(bytes.size());
  }
  std::size_t at = 0;
  std::vector<std::size_t> cuts;
  while (at < bytes.size()) {
    const std::size_t size = next_datagram_bytes(bytes.data() + at, bytes.size() - at, 600);
    assert_true(size > 0);
    at += size;
    cuts.push_back(at);
  }
  // 100 + 300 + 50 together; 700 alone since nothing else fits; 20 alone; 1300 is too long, and goes; 10.
  const std::vector<std::size_t> expected = {ends[2], ends[3], ends[4], ends[5], ends[6]};
  assert_true(cuts == expected);
  assert_int_equal(next_datagram_bytes(bytes.data(), 0, 600), 0);
  const std::uint8_t broken[] = {0, 5, 6, 7};
  assert_int_equal(next_datagram_bytes(broken, sizeof broken, 600), 4);
}

TEST(a_port_that_was_opened_again_is_known) {
  HostReport none{};
  HostReport before{};
  before.port_count = 2;
  before.port_open[1] = 1;
  before.opens[1] = 1;
  HostReport now = before;
  assert_false(reopened(none, now, 1));  // nothing to compare with
  assert_false(reopened(before, now, 1));
  assert_false(reopened(before, now, 7));
  now.opens[1] = 2;  // closed and opened between two reports
  assert_true(reopened(before, now, 1));
  now.port_open[1] = 0;
  assert_false(reopened(before, now, 1));
  // The first time that it opens nothing has been heard yet.
  now.port_open[0] = 1;
  now.opens[0] = 1;
  assert_false(reopened(before, now, 0));
  // Reports of early versions tell by the state alone.
  now.opens[0] = 0;
  assert_true(reopened(before, now, 0));
}

TEST(a_host_report_reads_back) {
  HostReport report{};
  report.alarms = 0x80000010U;
  report.recorder_lost = 12345;
  report.cycle_last_us = 7;
  report.cycle_max_us = 70'000;
  report.port_count = 3;
  report.port_open[0] = 1;
  report.port_open[2] = 1;
  report.dropped_bytes[2] = 0xFFFFFFFFU;
  report.opens[0] = 0x0201;
  report.errors[1] = 13;
  std::uint8_t bytes[leadline::firmware::kMaxHostReport_bytes] = {};
  const std::size_t size = encode_host_report(report, bytes, sizeof bytes);
  assert_int_equal(size, 47);
  const std::uint8_t expected[] = {
      1, 3, 0, 0, 0x10, 0, 0, 0x80, 0x39, 0x30, 0,    0, 7, 0, 0, 0, 0x70, 0x11, 1, 0, 1, 0, 0, 0,
      0, 0, 0, 0, 0,    0, 1, 0xFF, 0xFF, 0xFF, 0xFF, 1, 2, 0, 0, 0, 0,    13,   0, 0, 0, 0, 0};
  assert_memory_equal(bytes, expected, sizeof expected);
  HostReport again{};
  assert_true(decode_host_report(bytes, size, again));
  assert_memory_equal(&again, &report, sizeof report);
  // Any cut is no report, and leaves what was there.
  // But one without what early versions lack.
  assert_true(decode_host_report(bytes, 35, again));
  assert_int_equal(again.opens[0], 0);
  assert_int_equal(again.dropped_bytes[2], 0xFFFFFFFFU);
  for (std::size_t cut = 0; cut < 35; ++cut) {
    HostReport untouched{};
    untouched.alarms = 99;
    assert_false(decode_host_report(bytes, cut, untouched));
    assert_int_equal(untouched.alarms, 99);
  }
  bytes[0] = 2;
  assert_false(decode_host_report(bytes, size, again));
  bytes[0] = 1;
  bytes[1] = 9;
  assert_false(decode_host_report(bytes, sizeof bytes, again));
  assert_int_equal(encode_host_report(report, bytes, size - 1), 0);
  report.port_count = 9;
  assert_int_equal(encode_host_report(report, bytes, sizeof bytes), 0);
}

TEST(the_clocks_run) {
  const std::int64_t before_us = leadline::host::monotonic_us();
  assert_true(leadline::host::monotonic_us() >= before_us);
  assert_true(leadline::host::utc_us() > 1'600'000'000'000'000);  // after 2020
}

}  // namespace
