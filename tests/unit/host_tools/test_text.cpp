#include <cmath>
#include <limits>

#include "host_tools/text.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::closest_name;
using leadline::host::edit_distance;
using leadline::host::json_number;
using leadline::host::json_string;
using leadline::host::printable;

TEST(printable_escapes_what_a_terminal_would_act_on) {
  assert_string_equal(printable("12.5").c_str(), "12.5");
  assert_string_equal(printable("a\"b\\c").c_str(), "a\\\"b\\\\c");
  assert_string_equal(printable("\x1b[2J\n").c_str(), "\\x1b[2J\\x0a");
  assert_string_equal(printable(std::string("\0\xff", 2)).c_str(), "\\x00\\xff");
  assert_string_equal(printable("abcdef", 4).c_str(), "abcd...");
}

TEST(edit_distance_counts_edits_and_swaps) {
  assert_int_equal(edit_distance("", ""), 0);
  assert_int_equal(edit_distance("abc", ""), 3);
  assert_int_equal(edit_distance("cell_mm", "CELL_MM"), 0);
  assert_int_equal(edit_distance("kitten", "sitting"), 3);
  assert_int_equal(edit_distance("clel_mm", "cell_mm"), 1);
  assert_int_equal(edit_distance(std::string(200, 'a'), "a"), 200);
}

TEST(edit_distance_is_symmetric_and_keeps_the_triangle_of_lengths) {
  leadline::test::Random random(1);
  for (int i = 0; i < 2000; ++i) {
    std::string a;
    std::string b;
    for (std::int64_t n = random.between(0, 9); n > 0; --n) {
      a.push_back(static_cast<char>(random.between('a', 'c')));
    }
    for (std::int64_t n = random.between(0, 9); n > 0; --n) {
      b.push_back(static_cast<char>(random.between('a', 'c')));
    }
    const std::size_t distance = edit_distance(a, b);
    assert_int_equal(distance, edit_distance(b, a));
    assert_true(distance <= std::max(a.size(), b.size()));
    assert_true(distance >= std::max(a.size(), b.size()) - std::min(a.size(), b.size()));
    assert_int_equal(distance == 0, a == b);
  }
}

TEST(closest_name_finds_what_was_meant) {
  const std::vector<std::string> keys = {"cell_mm", "size", "origin_mm", "sigma_range_mm"};
  assert_string_equal(closest_name("cel_mm", keys).c_str(), "cell_mm");
  assert_string_equal(closest_name("cell", keys).c_str(), "cell_mm");
  assert_string_equal(closest_name("sigma_range", keys).c_str(), "sigma_range_mm");
  assert_string_equal(closest_name("my_sigma_range_mm", keys).c_str(), "sigma_range_mm");
  assert_string_equal(closest_name("sise", keys).c_str(), "size");
  assert_string_equal(closest_name("zebra", keys).c_str(), "");
  assert_string_equal(closest_name("", keys).c_str(), "");
}

TEST(json_strings_are_valid_whatever_the_bytes) {
  assert_string_equal(json_string("a\"\\\n").c_str(), "\"a\\\"\\\\\\u000a\"");
  assert_string_equal(json_string("m\xc3\xa9tre \xe2\x82\xac \xf0\x9f\x90\x9f").c_str(),
                      "\"m\xc3\xa9tre \xe2\x82\xac \xf0\x9f\x90\x9f\"");
  // Stray, overlong, surrogate, cut and too large sequences.
  assert_string_equal(json_string("\xff").c_str(), "\"\\ufffd\"");
  assert_string_equal(json_string("\xc0\xaf").c_str(), "\"\\ufffd\\ufffd\"");
  assert_string_equal(json_string("\xed\xa0\x80").c_str(), "\"\\ufffd\\ufffd\\ufffd\"");
  assert_string_equal(json_string("\xe0\x80\x80").c_str(), "\"\\ufffd\\ufffd\\ufffd\"");
  assert_string_equal(json_string("\xe2\x82").c_str(), "\"\\ufffd\\ufffd\"");
  assert_string_equal(json_string("\xf4\x90\x80\x80").c_str(), "\"\\ufffd\\ufffd\\ufffd\\ufffd\"");
  assert_string_equal(json_string("\xf0\x80\x80\x80").c_str(), "\"\\ufffd\\ufffd\\ufffd\\ufffd\"");
}

TEST(json_numbers_are_shortest_and_never_nan) {
  assert_string_equal(json_number(0.1).c_str(), "0.1");
  assert_string_equal(json_number(1000).c_str(), "1000");
  assert_string_equal(json_number(-2.5).c_str(), "-2.5");
  assert_string_equal(json_number(std::nan("")).c_str(), "null");
  assert_string_equal(json_number(std::numeric_limits<double>::infinity()).c_str(), "null");
}

TEST(numbers_in_fixed_notation_and_in_hexadecimal) {
  const auto fixed = [](double value, int digits) {
    std::string text = "<";
    leadline::host::append_fixed(&text, value, digits);
    return text;
  };
  assert_string_equal(fixed(-1.23456, 2).c_str(), "<-1.23");
  assert_string_equal(fixed(-0.0004, 3).c_str(), "<0.000");
  assert_string_equal(fixed(-0.0006, 3).c_str(), "<-0.001");
  assert_string_equal(fixed(-0.0, 1).c_str(), "<0.0");
  assert_string_equal(fixed(7.0, 0).c_str(), "<7");
  assert_int_equal(fixed(-1e308, 20).size(), 1 + 1 + 309 + 1 + 20);
  assert_string_equal(leadline::host::hex_text(0, 8).c_str(), "0x00000000");
  assert_string_equal(leadline::host::hex_text(0xABC, 2).c_str(), "0xabc");
  assert_string_equal(leadline::host::hex_text(UINT64_MAX, 16).c_str(), "0xffffffffffffffff");
}

}  // namespace
