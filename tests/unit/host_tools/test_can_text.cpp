// CAN frames as text: the lines of candump in both layouts and of canboat.
#include <string>

#include "host_tools/import/can_text.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::hal::CanFrame;
using leadline::hal::kCanError;
using leadline::hal::kCanExtended;
using leadline::hal::kCanRemote;
using leadline::host::CanLine;
using leadline::host::CanLineKind;
using leadline::host::CanTextReader;

CanLine parsed(const std::string& line) { return CanTextReader().parse(line); }

CanFrame only_frame(const std::string& line) {
  const CanLine result = parsed(line);
  assert_true(result.kind == CanLineKind::kFrames);
  assert_int_equal(result.frames.size(), 1);
  return result.frames[0];
}

// The same frame in every way to write it.
TEST(layouts_say_the_same) {
  for (const char* const line : {
           "(1502984866.421964) slcan0 09F112CC#FF725AFF7FFF7FFD",
           "(1502984866.421964) slcan0 09F112CC#FF.72.5A.FF.7F.FF.7F.FD",
           "  can0  09F112CC   [8]  FF 72 5A FF 7F FF 7F FD",
           "  can0  09F112CC   [8]  FF 72 5A FF 7F FF 7F FD   '.rZ.....'",
           " (1502984866.421964)  can0  RX - -  09F112CC   [8]  FF 72 5A FF 7F FF 7F FD",
           " (2017-08-17 15:47:46.421964)  can0  09F112CC   [8]  ff 72 5a ff 7f ff 7f fd",
           "2017-08-17T15:47:46.421Z,2,127250,204,255,8,ff,72,5a,ff,7f,ff,7f,fd",
           "2017-08-17-15:47:46.421,2,127250,204,255,8,ff,72,5a,ff,7f,ff,7f,fd",
           "2017-08-17 15:47:46.421, 2, 127250, 204, 255, 8, ff, 72, 5a, ff, 7f, ff, 7f, fd",
           "<0x09f112cc> [8] ff 72 5a ff 7f ff 7f fd",
           "00:17:55.475 R 09F112CC FF 72 5A FF 7F FF 7F FD",
           "  can0  09F112CC  FF 72 5A FF 7F FF 7F FD",
           "(1502984866.421964) can0 09F112CC##1FF725AFF7FFF7FFD",
           "  can0  09F112CC  [08]  FF 72 5A FF 7F FF 7F FD",
           "(1502984866.421964) can0 09F112CC#FF725AFF7FFF7FFD_E",
           "  can0  09F112CC  {E}  FF 72 5A FF 7F FF 7F FD",
       }) {
    const CanFrame frame = only_frame(line);
    assert_int_equal(frame.id, 0x09F112CCU | kCanExtended);
    assert_int_equal(frame.length_bytes, 8);
    const std::uint8_t data[] = {0xFF, 0x72, 0x5A, 0xFF, 0x7F, 0xFF, 0x7F, 0xFD};
    assert_memory_equal(frame.data.data(), data, sizeof data);
  }
}

TEST(times_are_as_written) {
  assert_true(parsed("(1502984866.421964) can0 09F112CC#FF").t_us == 1'502'984'866'421'964);
  assert_true(parsed(" (2017-08-17 15:47:46.421964)  can0  123   [0]").t_us ==
              1'502'984'866'421'964);
  assert_true(parsed("2016-02-29T23:59:59.999Z,2,127250,7,255,1,ff").t_us == 1'456'790'399'999'000);
  assert_true(parsed("(000.002000) can0 123#").t_us == 2'000);
  assert_true(parsed("2016-02-29 23:59:59.999,2,127250,7,255,1,ff").t_us == 1'456'790'399'999'000);
  assert_true(parsed("00:17:55.475 R 0DF50B23 FF").t_us == 1'075'475'000);
  assert_false(parsed("can0  123   [0]").t_us.has_value());
}

TEST(kinds_of_frames) {
  assert_int_equal(only_frame("can0  7FF   [1]  01").id, 0x7FF);
  const CanFrame remote = only_frame("(1.0) can0 123#R");
  assert_int_equal(remote.id, 0x123U | kCanRemote);
  assert_int_equal(remote.length_bytes, 0);
  assert_int_equal(only_frame("can0  123   [4]  remote request").id, 0x123U | kCanRemote);
  assert_int_equal(only_frame("(1.0) can0 20000004#0004000000000000").id, 4U | kCanError);
  // A message to one address: the destination stands in the identifier.
  assert_int_equal(only_frame("2016-02-28T19:57:02.364Z,6,59904,1,35,3,00,ee,00").id,
                   0x18EA2301U | kCanExtended);
}

TEST(long_messages_travel_as_fast_packets) {
  std::string line = "2016-02-28T19:57:02.364Z,3,129029,7,255,43";
  for (int i = 0; i < 43; ++i) {
    line += "," + std::string(1, static_cast<char>('0' + i / 10)) +
            std::string(1, static_cast<char>('0' + i % 10));
  }
  CanTextReader reader;
  (void)reader.parse(line);
  const CanLine second = reader.parse(line);
  // 6 bytes in the first frame, 7 in each of the others: 6 + 5 * 7 = 41, so 7 frames.
  assert_int_equal(second.frames.size(), 7);
  std::size_t at = 0;
  for (std::size_t k = 0; k < second.frames.size(); ++k) {
    const CanFrame& frame = second.frames[k];
    assert_int_equal(frame.id, 0x0DF80507U | kCanExtended);
    assert_int_equal(frame.length_bytes, 8);
    assert_int_equal(frame.data[0], (1U << 5U) | k);  // the second message has another sequence
    for (std::size_t i = k == 0 ? 2 : 1; i < 8 && at < 43; ++i, ++at) {
      assert_int_equal(frame.data[i], (at / 10) * 16 + at % 10);
    }
  }
  assert_int_equal(second.frames[0].data[1], 43);
  assert_int_equal(second.frames[6].data[7], 0xFF);
}

TEST(long_frames_of_can_fd_are_told_from_damage) {
  std::string compact = "(1.0) can0 09F112CC##1";
  std::string spaced = "  can0  09F112CC  [12] ";
  for (int i = 0; i < 12; ++i) {
    compact += "5A";
    spaced += " 5A";
  }
  for (const std::string& line : {compact, spaced}) {
    assert_true(parsed(line).kind == CanLineKind::kLong);
    assert_true(parsed(line).frames.empty());
    assert_true(parsed(line.substr(0, line.size() - 1)).kind == CanLineKind::kBad);
  }
  // candump -e: an error frame, then what it means.
  const CanFrame error = only_frame("  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME");
  assert_int_equal(error.id, 4U | kCanError);
  assert_true(parsed("\tcontroller-problem{tx-error-warning}").kind == CanLineKind::kComment);
}

TEST(other_lines_are_comments_or_bad) {
  for (const char* const line :
       {"", "   ", "# candump sample", "2016-02-28T19:57:02.480Z,0,262386,0,0,3,01,0e,00"}) {
    assert_true(parsed(line).kind == CanLineKind::kComment);
  }
  for (const char* const line : {
           "(1502984866.421964) can0 09F112CC",      // no frame
           "(1502984866.421964) can0 09F112CC#FF7",  // half a byte
           "(1502984866.421964) can0 09F112CC#FFFFFFFFFFFFFFFFFF",
           "(1502984866.421964) can0 09F112CC##",  // CAN FD without its flags
           "(1502984866.421964) can0 09F112CC#FF_E",
           "can0  09F112CC   {8}  FF 72 5A FF 7F FF 7F FD",
           "can0  09F112CC   [65]  FF",
           "(1.0) can0 09F112CC##1FF725AFF7FFF7FFD00",
           "can0  09F112CC  FF 72 5A FF 7F FF 7F FD 00",
           "can0  123  FF 72",
           "(1502984866,421964) can0 09F112CC#FF",  // no time
           "(1502984866.421964 can0 09F112CC#FF",
           "(1.0) can0 12#FF",  // no identifier
           "(1.0) can0 FFFFFFFFF#FF",
           "can0  09F112CC   [9]  FF 72 5A FF 7F FF 7F FD 00",
           "can0  09F112CC   [8]  FF 72 5A FF 7F FF 7F",  // a byte short
           "can0  09F112CC   [x]  FF",
           "[8] FF",
           "2016-02-28T19:57:02.364Z,2,127250,7,255,8,ff,10,3b,ff,7f,ce,f5",
           "2016-02-28T19:57:02.364Z,2,127250,7,255,2,ff,g0",
           "2016-02-28T19:57:02.364Z,9,127250,7,255,1,ff",
           "2016-02-28T19:57:02.364Z,2,127250,7,256,1,ff",
           "2016-13-28T19:57:02.364Z,2,127250,7,255,1,ff",
           "2016-02-28T19:57:02.364Z,2,127250",
           "<0x09f112cc> ff 72",
           "00:17:55.475 X 09F112CC FF",
           "00:77:55.475 R 09F112CC FF",
           "00:17:55.475 R 09F112CC FF 72 5A FF 7F FF 7F FD 00",
           "hello",
       }) {
    const CanLine result = parsed(line);
    if (result.kind != CanLineKind::kBad || !result.frames.empty()) {
      fail_msg("taken for a frame: %s", line);
    }
  }
}

}  // namespace
