#include "hal/heads/ping_protocol.hpp"
#include "hal/wire.hpp"
#include "tests/support/device_bytes.hpp"

namespace {

using leadline::hal::kMaxPingFrame_bytes;
using leadline::hal::kMaxPingPayload_bytes;
using leadline::hal::ping1d_table;
using leadline::hal::ping360_table;
using leadline::hal::PingFrame;
using leadline::hal::PingParser;
using leadline::hal::PingTable;
using leadline::hal::write_ping_frame;
using leadline::test::Bytes;
using leadline::test::from_hex;
using leadline::test::Random;
using leadline::test::random_bytes;
using leadline::test::without;
using leadline::test::operator+;

struct Found {
  unsigned id;
  unsigned source;
  unsigned destination;
  Bytes payload;
  std::int64_t t_us;
};

std::vector<Found> parse(PingParser& parser, const Bytes& bytes, std::int64_t t_us = 0) {
  std::vector<Found> found;
  PingFrame frame{};
  for (const std::uint8_t byte : bytes) {
    parser.feed(byte, t_us);
    while (parser.next(frame)) {
      found.push_back({frame.id, frame.source, frame.destination,
                       Bytes(frame.payload, frame.payload + frame.payload_bytes),
                       frame.t_arrival_us});
    }
  }
  return found;
}

Bytes frame_of(unsigned id, const Bytes& payload, unsigned source = 1, unsigned destination = 0) {
  Bytes out(kMaxPingFrame_bytes);
  out.resize(write_ping_frame(static_cast<std::uint16_t>(id), static_cast<std::uint8_t>(source),
                              static_cast<std::uint8_t>(destination), payload.data(),
                              payload.size(), out.data(), out.size()));
  assert_true(!out.empty());
  return out;
}

/// Payload of a profile with these samples.
Bytes profile_payload(const Bytes& samples) {
  Bytes payload(26);
  leadline::hal::write_u32_le(payload.data(), 1000);
  leadline::hal::write_u16_le(payload.data() + 24, static_cast<std::uint16_t>(samples.size()));
  return payload + samples;
}

struct Vector {
  const char* hex;
  PingTable table;
  unsigned id;
  std::size_t payload_bytes;
};

// devices.md 1.1 to 1.3, REAL and MADE.
std::vector<Vector> vectors() {
  return {
      {"42 52 02 00 06 00 00 00 05 00 a1 00", ping1d_table(), 6, 2},
      {"42 52 04 00 05 00 00 00 01 02 03 00 a3 00", ping1d_table(), 5, 4},
      {"42 52 04 00 05 00 4d d3 01 02 03 63 26 02", ping360_table(), 5, 4},
      {"42 52 24 00 14 05 38 2d e8 03 00 00 5d 00 3f 08 1c 2b a6 02 a0 0f 00 00 b8 88 00 00 04 00 "
       "00 00 0a 00 00 01 02 03 04 05 06 07 08 09 de 05",
       ping1d_table(), 1300, 36},
      {"42 52 02 00 06 00 00 00 04 00 a0 00", ping360_table(), 6, 2},
      {"42 52 08 00 e9 03 00 00 00 00 00 00 10 27 00 00 bf 01", ping1d_table(), 1001, 8},
      {"42 52 02 00 78 05 00 00 14 05 2c 01", ping1d_table(), 1400, 2},
      {"42 52 18 00 bc 04 01 00 29 09 00 00 64 00 73 00 09 03 00 00 00 00 00 00 88 13 00 00 03 00 "
       "00 00 20 03",
       ping1d_table(), 1212, 24},
      {"42 52 0e 00 29 0a 00 00 01 00 c8 00 20 00 58 00 ee 02 b0 04 01 00 bb 03", ping360_table(),
       2601, 14},
      {"42 52 10 00 2a 0a 00 00 01 00 50 00 50 00 ee 02 00 04 00 00 8f 01 01 00 fe 02",
       ping360_table(), 2602, 16},
      {"42 52 00 00 57 0b 00 00 f6 00", ping360_table(), 2903, 0},
  };
}

}  // namespace

TEST(every_vector_decodes_and_is_written_the_same) {
  for (const Vector& vector : vectors()) {
    const Bytes bytes = from_hex(vector.hex);
    PingParser parser(vector.table);
    const auto found = parse(parser, bytes, 1234);
    assert_int_equal(found.size(), 1);
    assert_int_equal(found[0].id, vector.id);
    assert_int_equal(found[0].payload.size(), vector.payload_bytes);
    assert_int_equal(found[0].t_us, 1234);
    assert_int_equal(parser.counters().skipped_bytes, 0);
    assert_int_equal(parser.buffered_bytes(), 0);
    assert_true(frame_of(vector.id, found[0].payload, found[0].source, found[0].destination) ==
                bytes);
  }
}

TEST(source_and_destination) {
  PingParser parser(ping1d_table());
  const auto found = parse(parser, from_hex("42 52 04 00 05 00 4d d3 01 02 03 63 26 02"));
  assert_int_equal(found[0].source, 77);
  assert_int_equal(found[0].destination, 211);
}

TEST(any_byte_deleted_costs_one_frame) {
  for (const Vector& vector : vectors()) {
    const Bytes bytes = from_hex(vector.hex);
    for (std::size_t position = 0; position < bytes.size(); ++position) {
      PingParser parser(vector.table);
      const auto found = parse(parser, bytes + without(bytes, position) + bytes + bytes);
      // A deletion may leave a frame that is whole (a twin byte): never fewer than three.
      assert_true(found.size() == 3);
      assert_int_equal(parser.counters().skipped_bytes, bytes.size() - 1);
    }
  }
}

TEST(any_byte_changed_costs_one_frame) {
  for (const Vector& vector : vectors()) {
    const Bytes bytes = from_hex(vector.hex);
    for (std::size_t position = 0; position < bytes.size(); ++position) {
      for (unsigned bit = 0; bit < 8; ++bit) {
        Bytes changed = bytes;
        changed[position] = static_cast<std::uint8_t>(changed[position] ^ (1U << bit));
        PingParser parser(vector.table);
        // A length that grew waits for bytes: the frames behind it come as soon as these are there.
        const auto found = parse(parser, bytes + changed + bytes + Bytes(kMaxPingFrame_bytes, 0));
        // Source and destination are under the sum as well: nothing of the changed one passes.
        assert_int_equal(found.size(), 2);
        assert_true(found[0].payload == found[1].payload);
      }
    }
  }
}

TEST(truncated_anywhere_costs_one_frame) {
  for (const Vector& vector : vectors()) {
    const Bytes bytes = from_hex(vector.hex);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      PingParser parser(vector.table);
      const Bytes cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
      assert_int_equal(parse(parser, cut + bytes + bytes).size(), 2);
    }
  }
}

TEST(start_inside_a_payload) {
  const Bytes inner = from_hex("42 52 02 00 06 00 00 00 05 00 a1 00");
  const Bytes outer = frame_of(1300, profile_payload(inner + Bytes{'B', 'R', 'B', 'B', 'R'}));
  PingParser parser(ping1d_table());
  auto found = parse(parser, outer + outer);
  assert_int_equal(found.size(), 2);
  assert_int_equal(found[1].id, 1300);

  // With the outer start broken, the inner frame is one, and the next outer is not lost.
  Bytes broken = outer;
  broken[1] = 'X';
  found = parse(parser, broken + outer);
  assert_int_equal(found.size(), 2);
  assert_int_equal(found[0].id, 6);
  assert_int_equal(found[1].id, 1300);
}

TEST(repeated_first_letters) {
  PingParser parser(ping1d_table());
  const Bytes frame = frame_of(5, {1, 2, 3, 0});
  assert_int_equal(parse(parser, Bytes{'B', 'B', 'B', 'R', 'B', 'B', 'R'} + frame).size(), 1);
  assert_int_equal(parser.counters().skipped_bytes, 7);
}

TEST(counts_by_reason) {
  PingParser parser(ping1d_table());
  assert_int_equal(parse(parser, frame_of(2300, Bytes(14))).size(), 0);  // Ping360's
  assert_int_equal(parser.counters().unknown_id, 1);
  assert_int_equal(parse(parser, frame_of(1212, Bytes(23))).size(), 0);
  assert_int_equal(parser.counters().bad_length, 1);
  assert_int_equal(parse(parser, frame_of(1212, Bytes(25))).size(), 0);
  assert_int_equal(parser.counters().bad_length, 2);
  Bytes sum = frame_of(1212, Bytes(24));
  ++sum.back();
  assert_int_equal(parse(parser, sum).size(), 0);
  assert_int_equal(parser.counters().bad_checksum, 1);
  // A count that contradicts the length, checksum intact.
  Bytes payload = profile_payload(Bytes(10));
  payload[24] = 9;
  assert_int_equal(parse(parser, frame_of(1300, payload)).size(), 0);
  assert_int_equal(parser.counters().bad_length, 3);
  payload[24] = 11;
  assert_int_equal(parse(parser, frame_of(1300, payload)).size(), 0);
  assert_int_equal(parser.counters().bad_length, 4);
  assert_int_equal(parser.counters().frames, 0);
  assert_int_equal(parser.counters().skipped_bytes + parser.buffered_bytes(),
                   24 + 33 + 35 + 34 + 2 * 46);
}

TEST(longest_frames_pass_longer_do_not) {
  PingParser ping1d(ping1d_table());
  assert_int_equal(parse(ping1d, frame_of(1300, profile_payload(Bytes(1200, 7)))).size(), 1);
  assert_int_equal(frame_of(1300, profile_payload(Bytes(1200, 7))).size(), kMaxPingFrame_bytes);
  PingParser ping360(ping360_table());
  Bytes payload(20 + 1200);
  leadline::hal::write_u16_le(payload.data() + 18, 1200);
  const auto found = parse(ping360, frame_of(2301, payload) + frame_of(2301, payload));
  assert_int_equal(found.size(), 2);
  std::uint8_t out[kMaxPingFrame_bytes + 10];
  payload.resize(kMaxPingPayload_bytes + 1);
  assert_int_equal(
      write_ping_frame(2301, 0, 0, payload.data(), kMaxPingPayload_bytes + 1, out, sizeof out), 0);
  assert_int_equal(write_ping_frame(5, 0, 0, payload.data(), 4, out, 13), 0);
  assert_int_equal(write_ping_frame(5, 0, 0, payload.data(), 4, out, 14), 14);
}

TEST(frames_found_late_keep_their_time) {
  PingParser parser(ping1d_table());
  // A start that promises a long profile swallows three frames, one per millisecond.
  Bytes start = frame_of(1300, profile_payload(Bytes(60)));
  start.resize(10);
  assert_int_equal(parse(parser, start, 500).size(), 0);
  const Bytes frame = frame_of(5, {1, 2, 3, 0});
  std::vector<Found> found;
  for (int i = 1; i <= 7; ++i) {
    const auto more = parse(parser, frame, 1000 * i);
    found.insert(found.end(), more.begin(), more.end());
  }
  assert_int_equal(found.size(), 7);
  for (int i = 1; i <= 7; ++i) {
    assert_int_equal(found[static_cast<std::size_t>(i - 1)].t_us, 1000 * i);
  }
  assert_int_equal(parser.counters().bad_checksum, 1);
}

TEST(a_pause_ends_a_frame) {
  PingParser parser(ping1d_table());
  const Bytes frame = frame_of(5, {1, 2, 3, 0});
  Bytes start = frame_of(1300, profile_payload(Bytes(1000)));
  start.resize(100);
  assert_int_equal(parse(parser, start + frame, 0).size(), 0);  // swallowed so far
  const auto found = parse(parser, frame, PingParser::kMaxGap_us + 1);
  assert_int_equal(found.size(), 2);
  assert_int_equal(found[0].t_us, 0);
  assert_int_equal(found[1].t_us, PingParser::kMaxGap_us + 1);
  assert_int_equal(parser.counters().unfinished, 1);
  // Half of a header, too.
  assert_int_equal(parse(parser, {'B', 'R', 4}, 1'000'000).size(), 0);
  assert_int_equal(parse(parser, frame, 2'000'000).size(), 1);
  assert_int_equal(parser.counters().unfinished, 2);
  assert_int_equal(parse(parser, {'B'}, 3'000'000).size(), 0);
  assert_int_equal(parse(parser, frame, 4'000'000).size(), 1);
  assert_int_equal(parser.counters().unfinished, 2);  // a lone letter is noise
}

TEST(reset_forgets_half_a_frame) {
  PingParser parser(ping1d_table());
  Bytes frame = frame_of(5, {1, 2, 3, 0});
  assert_int_equal(parse(parser, Bytes(frame.begin(), frame.begin() + 6)).size(), 0);
  assert_int_equal(parser.buffered_bytes(), 6);
  parser.reset();
  assert_int_equal(parser.buffered_bytes(), 0);
  assert_int_equal(parse(parser, frame).size(), 1);
  assert_int_equal(parser.counters().skipped_bytes, 6);
}

TEST(a_caller_that_never_asks_loses_the_oldest_only) {
  PingParser parser(ping1d_table());
  const Bytes frame = frame_of(5, {1, 2, 3, 0});
  const std::size_t fed = 300;
  for (std::size_t i = 0; i < fed; ++i) {
    for (const std::uint8_t byte : frame) {
      parser.feed(byte, 0);
    }
  }
  PingFrame found{};
  std::size_t count = 0;
  while (parser.next(found)) {
    ++count;
  }
  assert_int_equal(count, kMaxPingFrame_bytes / frame.size());
  assert_int_equal(parser.counters().skipped_bytes, (fed - count) * frame.size());
}

TEST(garbage_between_frames) {
  Random random(2);
  std::size_t sent = 0;
  std::size_t found = 0;
  PingParser parser(ping360_table());
  for (int round = 0; round < 3000; ++round) {
    Bytes noise = random_bytes(random, static_cast<std::size_t>(random.between(0, 60)));
    if (random.between(0, 3) == 0) {
      noise = noise + Bytes{'B', 'R'};
    }
    Bytes payload(14 + static_cast<std::size_t>(random.between(0, 1200)));
    for (std::size_t i = 14; i < payload.size(); ++i) {
      payload[i] = static_cast<std::uint8_t>(random.next());
    }
    leadline::hal::write_u16_le(payload.data() + 12,
                                static_cast<std::uint16_t>(payload.size() - 14));
    ++sent;
    for (const auto& one : parse(parser, noise + frame_of(2300, payload))) {
      found += one.id == 2300 ? 1 : 0;
    }
  }
  // What is still held back by a false start at the very end comes with the next bytes.
  found += parse(parser, Bytes(2 * kMaxPingFrame_bytes)).size();
  assert_int_equal(found, sent);
  assert_int_equal(parser.counters().frames, sent);
}
