// Containers of recordings: told apart, taken apart, and searched again behind damage.
#include <fstream>
#include <string>
#include <vector>

#include "hal/wire.hpp"
#include "host_tools/import/recording.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::firmware::Driver;
using leadline::host::ByteSource;
using leadline::host::open_recording;
using leadline::host::RecordedBytes;

using Bytes = std::vector<std::uint8_t>;

struct Read {
  std::string container;
  std::vector<RecordedBytes> pieces;
  std::map<std::string, std::uint64_t> rejected;
};

Read read(const Bytes& file, Driver driver) {
  const auto recording = open_recording(ByteSource(file.data(), file.size()), driver);
  Read result;
  result.container = recording->container();
  RecordedBytes piece;
  while (recording->next(&piece)) {
    result.pieces.push_back(piece);
  }
  result.rejected = recording->rejected();
  return result;
}

void append(Bytes* to, const Bytes& bytes) { to->insert(to->end(), bytes.begin(), bytes.end()); }

Bytes u32_be(std::uint32_t value) {
  return {static_cast<std::uint8_t>(value >> 24U), static_cast<std::uint8_t>(value >> 16U),
          static_cast<std::uint8_t>(value >> 8U), static_cast<std::uint8_t>(value)};
}

Bytes u64_be(std::uint64_t value) {
  Bytes bytes = u32_be(static_cast<std::uint32_t>(value >> 32U));
  append(&bytes, u32_be(static_cast<std::uint32_t>(value)));
  return bytes;
}

constexpr std::uint64_t kNow_us = 1'683'220'541'406'000;
// Of no message: the container does not look at checksums.
const Bytes kVersion1 = {0xFE, 2, 0, 1, 1, 0, 0xAA, 0xBB, 0x01, 0x02};
const Bytes kVersion2 = {0xFD, 1, 0, 0, 7, 1, 1, 30, 0, 0, 0xCC, 0x03, 0x04};

Bytes tlog_record(std::uint64_t t_us, const Bytes& frame) {
  Bytes record = u64_be(t_us);
  append(&record, frame);
  return record;
}

TEST(tlog_frames_come_with_their_times) {
  Bytes file = tlog_record(kNow_us, kVersion1);
  append(&file, tlog_record(kNow_us + 5, kVersion2));
  Bytes signed_frame = kVersion2;
  signed_frame[2] = 1;
  signed_frame.resize(signed_frame.size() + 13, 0x77);
  append(&file, tlog_record(kNow_us + 9, signed_frame));
  const Read result = read(file, Driver::kMavlink);
  assert_string_equal(result.container.c_str(), "MAVLink telemetry log");
  assert_int_equal(result.pieces.size(), 3);
  assert_true(result.pieces[0].bytes == kVersion1 && result.pieces[1].bytes == kVersion2);
  assert_true(result.pieces[2].bytes == signed_frame);
  assert_true(result.pieces[2].t_us == static_cast<std::int64_t>(kNow_us + 9));
  assert_true(result.rejected.empty());
}

TEST(tlog_goes_on_behind_a_lost_byte) {
  Bytes whole;
  for (std::uint64_t k = 0; k < 4; ++k) {
    append(&whole, tlog_record(kNow_us + k, k % 2 == 0 ? kVersion1 : kVersion2));
  }
  const std::size_t second = 8 + kVersion1.size();
  const std::size_t third = second + 8 + kVersion2.size();
  for (std::size_t lost = second; lost < third; ++lost) {
    Bytes file = whole;
    file.erase(file.begin() + static_cast<std::ptrdiff_t>(lost));
    const Read result = read(file, Driver::kMavlink);
    assert_true(result.pieces.size() >= 3);
    assert_true(result.pieces.front().bytes == kVersion1);
    assert_true(result.pieces.back().bytes == kVersion2);
    assert_true(result.pieces[result.pieces.size() - 2].bytes == kVersion1);
  }
}

TEST(bytes_without_times_are_raw) {
  const Read result = read(kVersion2, Driver::kMavlink);
  assert_string_equal(result.container.c_str(), "raw bytes");
  assert_true(result.pieces.size() == 1 && result.pieces[0].bytes == kVersion2);
  assert_false(result.pieces[0].t_us.has_value());
  assert_true(read({}, Driver::kMavlink).pieces.empty());
}

Bytes text_of(const std::string& text, bool wide) {
  Bytes bytes;
  for (const char c : text) {
    if (wide) {
      bytes.push_back(0);
    }
    bytes.push_back(static_cast<std::uint8_t>(c));
  }
  Bytes all = u32_be(static_cast<std::uint32_t>(bytes.size()));
  append(&all, bytes);
  return all;
}

Bytes ping_viewer_file(bool wide) {
  Bytes file = text_of("PingViewer sensor log file", wide);
  append(&file, u32_be(1));
  for (const char* const text : {"abcdef", "2024-03-13", "v2.3.0", "linux", "6.1"}) {
    append(&file, text_of(text, wide));
  }
  append(&file, u32_be(1));
  append(&file, u32_be(2));
  for (const char* const stamp : {"23:59:59.950", "00:00:00.050"}) {
    append(&file, text_of(stamp, wide));
    append(&file, u32_be(3));
    append(&file, {'B', 'R', 0});
  }
  return file;
}

TEST(ping_viewer_log_of_either_system) {
  for (const bool wide : {false, true}) {
    const Read result = read(ping_viewer_file(wide), Driver::kPing360);
    assert_string_equal(result.container.c_str(), "ping-viewer log");
    assert_int_equal(result.pieces.size(), 2);
    assert_true(result.pieces[0].bytes == Bytes({'B', 'R', 0}));
    assert_true(result.pieces[0].t_us == 86'399'950'000);
    // Past midnight the time goes on.
    assert_true(result.pieces[1].t_us == 86'400'050'000);
    assert_true(result.rejected.empty());
  }
}

TEST(ping_viewer_log_out_of_step_gives_its_bytes) {
  Bytes file = ping_viewer_file(false);
  const Bytes damage = {0xFF, 0xFF, 0xFF, 0xFF, 'B', 'R'};
  append(&file, damage);
  const Read result = read(file, Driver::kPing1d);
  assert_int_equal(result.pieces.size(), 3);
  assert_true(result.pieces[2].bytes == Bytes({'B', 'R'}));
  assert_int_equal(result.rejected.at("log_bytes"), 2);
}

Bytes xtf_packet(std::uint8_t type, const Bytes& content) {
  Bytes packet(256, 0);
  packet[0] = 0xCE;
  packet[1] = 0xFA;
  packet[2] = type;
  packet[14] = 0xDF;  // 2015-07-08
  packet[15] = 0x07;
  packet[16] = 7;
  packet[17] = 8;
  append(&packet, content);
  packet.resize((packet.size() + 63) / 64 * 64, 0);
  packet[10] = static_cast<std::uint8_t>(packet.size());
  packet[11] = static_cast<std::uint8_t>(packet.size() >> 8U);
  return packet;
}

TEST(xtf_gives_the_packets_inside_and_goes_on_behind_damage) {
  Bytes file(1024, 0);
  file[0] = 0x7B;
  Bytes inner = {'B', 'T', 'H', '0'};
  append(&inner, u32_be(12));
  append(&inner, {1, 2, 3, 4});
  append(&file, xtf_packet(66, {9, 9}));
  append(&file, xtf_packet(65, inner));
  append(&file, {0xCE, 0xFA, 65, 0, 0});  // a packet that was never finished
  append(&file, xtf_packet(65, inner));
  const std::string path = leadline::test::scratch_directory() + "/line.xtf";
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  const auto recording = open_recording(ByteSource(path), Driver::kR2sonic);
  assert_string_equal(recording->container(), "XTF");
  RecordedBytes piece;
  for (int i = 0; i < 2; ++i) {
    assert_true(recording->next(&piece));
    assert_true(piece.bytes.size() >= inner.size());
    assert_memory_equal(piece.bytes.data(), inner.data(), inner.size());
    assert_true(piece.t_us == 1'436'313'600'000'000);
  }
  assert_false(recording->next(&piece));
  assert_int_equal(recording->rejected().at("xtf_bytes"), 5);
}

TEST(can_text_gives_frames_and_counts_bad_lines) {
  const std::string text =
      "# a bus\r\n(1.5) can0 09F112CC#FF725A\r\nnothing\n(2.5) can0 123#\n(3.5) can0 12";
  const Read result = read(Bytes(text.begin(), text.end()), Driver::kNmea2000);
  assert_int_equal(result.pieces.size(), 2);
  assert_int_equal(result.pieces[0].bytes.size(), 16);
  assert_true(result.pieces[1].t_us == 2'500'000);
  assert_int_equal(result.rejected.at("bad_line"), 2);
  // Frames as bytes are taken as they are.
  const Read frames = read(result.pieces[0].bytes, Driver::kNmea2000);
  assert_string_equal(frames.container.c_str(), "raw bytes");
  assert_true(frames.pieces[0].bytes == result.pieces[0].bytes);
}

}  // namespace
