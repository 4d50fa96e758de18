#include "hal/text_fields.hpp"
#include "tests/support/device_bytes.hpp"

namespace {

using namespace leadline::hal;  // NOLINT: the file tests one header

TextField field(const std::string& text) { return {text.data(), text.size()}; }

bool number(const std::string& text, int decimals, std::int64_t& value) {
  return parse_number(field(text), decimals, value);
}

std::int64_t decimal(const std::string& text, int decimals) {
  std::int64_t value = -1;
  assert_true(parse_decimal(field(text), decimals, value));
  return value;
}

bool refused(const std::string& text, int decimals = 3) {
  std::int64_t value = 77;
  const bool taken = parse_number(field(text), decimals, value);
  assert_true(taken || value == 77);
  return !taken;
}

}  // namespace

TEST(decimals_are_exact) {
  assert_int_equal(decimal("0", 9), 0);
  assert_int_equal(decimal("-0.000000001", 9), -1);
  assert_int_equal(decimal("+123.456", 6), 123'456'000);
  assert_int_equal(decimal(".5", 0), 1);
  assert_int_equal(decimal("-.5", 0), -1);
  assert_int_equal(decimal(".49999", 0), 0);
  assert_int_equal(decimal("7.", 1), 70);
  assert_int_equal(decimal("1638360213123456", 0), 1638360213123456);  // microseconds since 1970
  assert_int_equal(decimal("0000000000000000000000012.5", 1), 125);
  assert_int_equal(decimal("0.1234567890123456789012345", 18), 123456789012345679);
  assert_int_equal(decimal("999999999999999999", 0), 999999999999999999);
}

TEST(exponents) {
  std::int64_t value = 0;
  assert_true(number("1e-07", 9, value));
  assert_int_equal(value, 100);
  assert_true(number("-1.5E+3", 2, value));
  assert_int_equal(value, -150'000);
  assert_true(number("2.1778e-8", 9, value));
  assert_int_equal(value, 22);
  assert_true(number("5e-9", 3, value));
  assert_int_equal(value, 0);
  assert_true(number("0e9999", 3, value));
  assert_int_equal(value, 0);
  assert_true(number("1e-9999", 3, value));
  assert_int_equal(value, 0);
  assert_true(number("12", 0, value));
  assert_int_equal(value, 12);
}

TEST(no_numbers) {
  for (const char* text :
       {"",    "-",   "+",  ".",   "-.", "1.2.3", "1,2",     " 1",   "1 ",  "0x10",
        "nan", "inf", "1e", "1e+", "e5", "1e5x",  "1e99999", "1ee5", "--1", "+-1"}) {
    assert_true(refused(text));
  }
  assert_true(refused("1000000000000000000", 0));  // the limit itself
  assert_true(refused("1e18", 0));
  assert_true(refused("1e9", 9));
  assert_true(refused("1e400", 0));
  assert_true(refused(std::string(70, '1'), 0));
  std::int64_t value = 0;
  assert_false(parse_decimal(field("1e3"), 0, value));  // an exponent only where it is allowed
}

TEST(limits) {
  std::int64_t value = 0;
  assert_true(parse_within(field("1.5"), 1, -15, 15, value));
  assert_false(parse_within(field("1.6"), 1, -15, 15, value));
  assert_false(parse_within(field("-1.6"), 1, -15, 15, value));
}

TEST(hex) {
  std::uint32_t value = 0;
  assert_true(parse_hex("aF09", 4, value));
  assert_int_equal(value, 0xAF09);
  assert_true(parse_hex("ffffffff", 8, value));
  assert_int_equal(value, 0xFFFFFFFFU);
  assert_false(parse_hex("1g", 2, value));
}

TEST(fields_of_a_line) {
  const std::string text = "WRZ, 1.5 ,,x";
  const auto line = split<8>(text.data(), text.size());
  assert_int_equal(line.count, 4);
  assert_true(is(line.at(0), "wrz"));
  assert_false(is(line.at(0), "wr"));
  assert_false(is(line.at(0), "wrzz"));
  assert_true(is(line.at(1), "1.5"));
  assert_true(line.at(2).empty());
  assert_true(line.at(9).empty());
  assert_int_equal(split<2>(text.data(), text.size()).count, 2);
  assert_int_equal(split<2>(text.data(), 0).count, 1);
  assert_int_equal(split<4>("a;b", 3, ';').count, 2);
}

TEST(ends_of_lines) {
  const auto find = [](const std::string& text, std::size_t limit = 20) {
    const auto bytes = leadline::test::from_text(text);
    return find_line(bytes.data(), bytes.size(), '$', limit);
  };
  assert_true(find("$ab").state == LineState::kMore);
  assert_true(find("$ab\r").state == LineState::kMore);
  for (const auto& [text, size] : {std::pair{"$ab\r\nx", 5U}, {"$ab\n", 4U}, {"$ab\rx", 4U}}) {
    const TextLine line = find(text);
    assert_true(line.state == LineState::kWhole);
    assert_int_equal(line.text_bytes, 3);
    assert_int_equal(line.size_bytes, size);
  }
  assert_true(find("$a$").state == LineState::kBroken);
  assert_true(find("$a\x01").state == LineState::kBroken);
  assert_true(find("$a\xFF").state == LineState::kBroken);
  assert_true(find("$abc", 3).state == LineState::kBroken);
  assert_true(find("$ab\r\n", 3).state == LineState::kWhole);
}
