#include <array>
#include <fstream>
#include <optional>
#include <thread>
#include <vector>

#include <unistd.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/ping_csv.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Bam32;
using leadline::host::decimal_to_scaled;
using leadline::host::DecimalStatus;
using leadline::host::degrees_to_bam32;
using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::kMaxLine_bytes;
using leadline::host::PingCsvOptions;
using leadline::host::PingCsvReader;
using leadline::host::PingCsvStats;
using leadline::host::PingRow;
using leadline::host::read_ping_csv;
using leadline::test::assert_contains;
using leadline::test::Random;

__extension__ typedef __int128 Int128;  // NOLINT: a typedef takes the extension mark

const std::string kHeader =
    "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n";
const std::string kGood = "100,1,2,3,0,0,0,0,90,10\n";

/// Everything that reading a text came to.
struct Outcome {
  std::vector<PingRow> rows;
  PingCsvStats stats;
  std::vector<std::string> messages;
  std::string error;  ///< of the HostError; "" when there was none
  ExitCode code = ExitCode::kOk;

  [[nodiscard]] bool said(const std::string& part) const {
    for (const std::string& message : messages) {
      if (message.find(part) != std::string::npos) {
        return true;
      }
    }
    return error.find(part) != std::string::npos;
  }
  [[nodiscard]] std::uint64_t rejected(const std::string& reason) const {
    const auto found = stats.rejected.find(reason);
    return found == stats.rejected.end() ? 0 : found->second;
  }
};

Outcome read(const std::string& text, bool strict = false) {
  Outcome outcome;
  PingCsvOptions options;
  options.strict = strict;
  options.message = [&](const std::string& message) { outcome.messages.push_back(message); };
  std::optional<PingCsvReader> reader;
  try {
    reader.emplace("p.csv", std::string_view(text), options);
    PingRow row{};
    while (reader->next(&row)) {
      outcome.rows.push_back(row);
    }
  } catch (const HostError& error) {
    outcome.error = error.what();
    outcome.code = error.code();
  }
  if (reader) {
    outcome.stats = reader->stats();
  }
  return outcome;
}

std::int64_t scaled(const std::string& text, int digits = 6) {
  std::int64_t value = 0;
  assert_int_equal(decimal_to_scaled(text, digits, false, &value), DecimalStatus::kOk);
  return value;
}

Bam32 bam(const std::string& text) {
  Bam32 angle = 0;
  assert_int_equal(degrees_to_bam32(text, &angle), DecimalStatus::kOk);
  return angle;
}

// ---- Decimals ----

TEST(decimals_become_integers_halves_away_from_zero) {
  assert_int_equal(scaled("0"), 0);
  assert_int_equal(scaled("-0.0"), 0);
  assert_int_equal(scaled("12.6122"), 12612200);
  assert_int_equal(scaled("+7."), 7000000);
  assert_int_equal(scaled("-.5"), -500000);
  assert_int_equal(scaled("0.0000005"), 1);
  assert_int_equal(scaled("-0.0000005"), -1);
  assert_int_equal(scaled("0.00000049999999999999999999999999999999"), 0);
  assert_int_equal(scaled("0.00000050000000000000000000000000000001"), 1);
  assert_int_equal(scaled("0.0000015"), 2);
  assert_int_equal(scaled("000000000000000000000000000001.5"), 1500000);
  assert_int_equal(scaled("  3\t"), 3000000);
}

TEST(exponents_are_exact) {
  assert_int_equal(scaled("1e3"), 1000000000);
  assert_int_equal(scaled("1.25E+1"), 12500000);
  assert_int_equal(scaled("12345678901234567890123456789e-22"), 1234567890123);
  assert_int_equal(scaled("1e-999999999999999999999999"), 0);
  assert_int_equal(scaled("0e999999999999999999999999"), 0);
  std::int64_t value = 42;
  assert_int_equal(decimal_to_scaled("1e999999999999999999999", 6, false, &value),
                   DecimalStatus::kTooLarge);
  assert_int_equal(decimal_to_scaled("9300000000000", 6, false, &value), DecimalStatus::kTooLarge);
  assert_int_equal(decimal_to_scaled("18446744073709.551615", 6, false, &value),
                   DecimalStatus::kTooLarge);
  assert_int_equal(value, 42);
  assert_int_equal(scaled("-9200000000000"), -9200000000000000000);
}

TEST(whole_refuses_a_fraction_and_nothing_else) {
  std::int64_t value = 0;
  assert_int_equal(decimal_to_scaled("20000.0", 0, true, &value), DecimalStatus::kOk);
  assert_int_equal(value, 20000);
  assert_int_equal(decimal_to_scaled("2.5e1", 0, true, &value), DecimalStatus::kOk);
  assert_int_equal(value, 25);
  assert_int_equal(decimal_to_scaled("0.5", 0, true, &value), DecimalStatus::kInexact);
  assert_int_equal(decimal_to_scaled("1e-30", 0, true, &value), DecimalStatus::kInexact);
  assert_int_equal(decimal_to_scaled("7.00000000000000000000000001", 0, true, &value),
                   DecimalStatus::kInexact);
}

TEST(what_is_not_a_number_is_told_apart) {
  std::int64_t value = 0;
  const auto status = [&](const std::string& text) {
    return decimal_to_scaled(text, 6, false, &value);
  };
  for (const char* const text : {"", " ", "\t"}) {
    assert_int_equal(status(text), DecimalStatus::kEmpty);
  }
  for (const char* const text : {"nan", "NaN", "-nan", "inf", "-Infinity", "+INF", "1.#QNAN"}) {
    assert_int_equal(status(text), DecimalStatus::kNotFinite);
  }
  for (const char* const text : {"abc", "-", "+", ".", "-.", "1.2.3", "1e", "1e+", "1e1.5", "--1",
                                 "1 2", "0x10", "1,5", "1m", "e5", "nano", "NA", "1_000"}) {
    assert_int_equal(status(text), DecimalStatus::kMalformed);
  }
}

TEST(decimals_equal_wide_integer_arithmetic) {
  Random random(1);
  for (int i = 0; i < 200000; ++i) {
    // value = digits / 10^fraction, written out, read back, compared with exact rounding.
    const std::int64_t digits = random.between(0, 9'000'000'000'000);
    const auto fraction = static_cast<int>(random.between(0, 14));
    std::int64_t power = 1;
    for (int k = 0; k < fraction; ++k) {
      power *= 10;
    }
    std::string rest = std::to_string(digits % power);
    rest.insert(
        0, static_cast<std::size_t>(fraction) - std::min<std::size_t>(rest.size(), fraction), '0');
    const bool negative = random.between(0, 1) == 1;
    const std::string text =
        (negative ? "-" : "") + std::to_string(digits / power) + "." + (fraction == 0 ? "" : rest);
    const Int128 scaled_up = static_cast<Int128>(digits) * 1'000'000;
    const auto expected = static_cast<std::int64_t>((2 * scaled_up + power) / (2 * power));
    assert_int_equal(scaled(text), negative ? -expected : expected);
  }
}

TEST(angles_are_wrapped_and_rounded) {
  assert_int_equal(bam("0"), 0);
  assert_int_equal(bam("90"), 0x40000000U);
  assert_int_equal(bam("-90"), 0xC0000000U);
  assert_int_equal(bam("180"), 0x80000000U);
  assert_int_equal(bam("360"), 0);
  assert_int_equal(bam("-720.0"), 0);
  assert_int_equal(bam("450"), 0x40000000U);
  assert_int_equal(bam("45e0"), 0x20000000U);
  assert_int_equal(bam("1"), 11930465);      // 11930464.71
  assert_int_equal(bam("359.99999999"), 0);  // rounds up to a full turn
  assert_int_equal(bam("-0.00000001"), 0);
  // 10^k modulo 360 is 280 from k = 3 on.
  assert_int_equal(bam("1e3"), bam("280"));
  assert_int_equal(bam("1e300"), bam("280"));
  assert_int_equal(bam("-1e999999999999999999999"), bam("-280"));
  assert_int_equal(bam("1e-999999999999999999999"), 0);
  assert_int_equal(bam("123456789012345678901234567890"), bam("90"));  // 2 mod 8, 0 mod 9, 0 mod 5
}

TEST(angles_round_halves_away_from_zero_with_any_number_of_digits) {
  // Half a unit is 180 / 2^32 degrees, which has 33 decimals or fewer: the exact tie and its two
  // neighbours at the last of 40 digits.
  const std::string tie = "0.0000000419095158576965332031250000000000";
  assert_int_equal(bam(tie), 1);
  assert_int_equal(bam("-" + tie), 0xFFFFFFFFU);
  assert_int_equal(bam("0.0000000419095158576965332031249999999999"), 0);
  assert_int_equal(bam("-0.0000000419095158576965332031249999999999"), 0);
  assert_int_equal(bam("0.0000000419095158576965332031250000000001"), 1);
  // The same tie above a whole number of degrees that is a whole number of units (45 = 2^29).
  assert_int_equal(bam("45.000000041909515857696533203125"), 0x20000001U);
  assert_int_equal(bam("45.0000000419095158576965332031249"), 0x20000000U);
  assert_int_equal(bam("4.5000000041909515857696533203125e1"), 0x20000001U);
}

TEST(angles_equal_wide_integer_arithmetic) {
  Random random(2);
  for (int i = 0; i < 200000; ++i) {
    const std::int64_t micro = random.between(-2'000'000'000, 2'000'000'000);  // +-2,000 degrees
    const std::int64_t magnitude = micro < 0 ? -micro : micro;
    std::string rest = std::to_string(magnitude % 1'000'000);
    rest.insert(0, 6 - rest.size(), '0');
    const std::string text =
        (micro < 0 ? "-" : "") + std::to_string(magnitude / 1'000'000) + "." + rest;
    const std::uint64_t divisor = 360'000'000;
    const auto expected = static_cast<Bam32>(
        ((static_cast<std::uint64_t>(magnitude) << 32U) + divisor / 2) / divisor);
    assert_int_equal(bam(text), micro < 0 ? 0U - expected : expected);
  }
}

// ---- Rows ----

TEST(a_plain_row) {
  const Outcome outcome =
      read(kHeader + "20000,12.6122,-63.7735,55.2948,0.5,-0.25,287.7404,-1.4059,56.2439,20.0359\n");
  assert_int_equal(outcome.rows.size(), 1);
  const PingRow& row = outcome.rows[0];
  assert_int_equal(row.t_us, 20000);
  assert_int_equal(row.position_um[0], 12612200);
  assert_int_equal(row.position_um[1], -63773500);
  assert_int_equal(row.position_um[2], 55294800);
  assert_int_equal(row.attitude.roll_bam32, bam("0.5"));
  assert_int_equal(row.attitude.pitch_bam32, bam("-0.25"));
  assert_int_equal(row.attitude.heading_bam32, bam("287.7404"));
  assert_int_equal(row.azimuth_bam32, bam("-1.4059"));
  assert_int_equal(row.elevation_bam32, bam("56.2439"));
  assert_int_equal(row.range_um, 20035900);
  assert_true(row.has_range);
  assert_int_equal(row.line, 2);
  assert_int_equal(outcome.messages.size(), 0);
}

TEST(columns_are_found_by_name_and_others_ignored_with_one_notice) {
  const Outcome outcome = read(
      "quality,range_m,beam_el_deg,beam_az_deg,heading_deg,pitch_deg,roll_deg,z_m,y_m,x_m,time_us,"
      "note\n"
      "0.9,10,90,0,5,6,7,3,2,1,100,hello\n"
      "0.8,11,90,0,5,6,7,3,2,1,101,\"a, b\"\n");
  assert_int_equal(outcome.rows.size(), 2);
  assert_int_equal(outcome.rows[1].range_um, 11000000);
  assert_int_equal(outcome.rows[1].position_um[0], 1000000);
  assert_int_equal(outcome.rows[1].attitude.roll_bam32, bam("7"));
  assert_int_equal(outcome.messages.size(), 1);
  assert_contains(outcome.messages[0], "\"quality\" \"note\"");
  assert_int_equal(outcome.stats.ignored_columns.size(), 2);
}

TEST(line_ends_blanks_comments_quotes_and_byte_order_mark_are_accepted) {
  const Outcome outcome =
      read("\xEF\xBB\xBF# survey of today\r\n\r\n" +
           std::string("time_us, x_m ,\"y_m\",z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,"
                       "beam_el_deg,range_m\r\n") +
           "100,1,2,3,0,0,0,0,90,10\r\n   \r\n# 5,5\r\n  # 6\r\n 101 , 1.0,\"2\",3,0,0,0,0,\"90\" "
           ",\r\n");
  assert_string_equal(outcome.error.c_str(), "");
  assert_int_equal(outcome.rows.size(), 2);
  assert_int_equal(outcome.stats.rows, 2);
  assert_false(outcome.rows[1].has_range);
  assert_int_equal(outcome.rows[1].position_um[1], 2000000);
  assert_int_equal(outcome.rows[1].line, 8);
}

TEST(an_empty_range_is_no_return) {
  const Outcome outcome = read(kHeader + "1,1,2,3,0,0,0,0,90,\n2,1,2,3,0,0,0,0,90, \n" + kGood);
  assert_int_equal(outcome.rows.size(), 3);
  assert_false(outcome.rows[0].has_range);
  assert_false(outcome.rows[1].has_range);
  assert_int_equal(outcome.stats.no_return, 2);
}

TEST(the_fast_path_gives_what_the_full_path_gives) {
  // A quoted first value sends the same row through the other path.
  Random random(3);
  std::string plain = kHeader;
  std::string quoted = kHeader;
  for (int i = 0; i < 5000; ++i) {
    std::string row = std::to_string(i) + (random.between(0, 9) == 0 ? ".0" : "");
    std::string rest;
    for (int column = 0; column < 9; ++column) {
      const int decimals = static_cast<int>(random.between(0, 12));
      std::string value = random.between(0, 1) == 0 ? "-" : "";
      value += std::to_string(random.between(0, column < 3 ? 19'999 : 999));
      if (decimals > 0) {
        value += "." + std::to_string(random.between(0, 999'999'999'999))
                           .substr(0, static_cast<std::size_t>(decimals));
      }
      if (column == 8) {
        value = random.between(0, 5) == 0 ? "" : value.substr(value[0] == '-' ? 1 : 0);
      }
      rest += "," + value;
    }
    plain += row + rest + "\n";
    quoted += "\"" + row + "\"" + rest + "\n";
  }
  const Outcome a = read(plain);
  const Outcome b = read(quoted);
  assert_int_equal(a.rows.size(), 5000);
  assert_int_equal(b.rows.size(), 5000);
  for (std::size_t i = 0; i < a.rows.size(); ++i) {
    assert_int_equal(a.rows[i].t_us, b.rows[i].t_us);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      assert_int_equal(a.rows[i].position_um[axis], b.rows[i].position_um[axis]);
    }
    assert_int_equal(a.rows[i].attitude.roll_bam32, b.rows[i].attitude.roll_bam32);
    assert_int_equal(a.rows[i].attitude.pitch_bam32, b.rows[i].attitude.pitch_bam32);
    assert_int_equal(a.rows[i].attitude.heading_bam32, b.rows[i].attitude.heading_bam32);
    assert_int_equal(a.rows[i].azimuth_bam32, b.rows[i].azimuth_bam32);
    assert_int_equal(a.rows[i].elevation_bam32, b.rows[i].elevation_bam32);
    assert_int_equal(a.rows[i].range_um, b.rows[i].range_um);
    assert_int_equal(a.rows[i].has_range, b.rows[i].has_range);
    assert_int_equal(a.rows[i].line, b.rows[i].line);
  }
}

// ---- Rows that cannot be used ----

struct BadRow {
  const char* row;
  const char* reason;
  const char* message;
};

TEST(bad_rows_are_counted_by_reason_and_described) {
  static constexpr std::array<BadRow, 20> kBad = {{
      {"x,1,2,3,0,0,0,0,90,10", "malformed", "p.csv:3: column time_us: value \"x\": not a decimal"},
      {"0.5,1,2,3,0,0,0,0,90,10", "malformed", "column time_us: value \"0.5\": not a whole number"},
      {"101,1,2,3,0,0,0,0,90,1O", "malformed", "column range_m: value \"1O\": not a decimal"},
      {"101,1,2,3,0,0,0,0,90,10,", "malformed", "the row has 11 values, the header names 10"},
      {"101,1,2,\"3,0,0,0,0,90,10", "malformed", "broken quote"},
      {"101,1,2,\"3\"3,0,0,0,0,90,10", "malformed", "broken quote"},
      {"101,1,,3,0,0,0,0,90,10", "missing", "column y_m: value \"\": a value is needed"},
      {",1,2,3,0,0,0,0,90,10", "missing", "column time_us: value \"\": a value is needed"},
      {"101,1,2,3,0,0,0", "missing", "column beam_az_deg: value \"\": the row has 7 values"},
      {"101,nan,2,3,0,0,0,0,90,10", "not_finite", "column x_m: value \"nan\": not a finite"},
      {"101,1,2,-inf,0,0,0,0,90,10", "not_finite", "column z_m: value \"-inf\": not a finite"},
      {"101,1,2,3,NaN,0,0,0,90,10", "not_finite", "column roll_deg: value \"NaN\""},
      {"101,1,2,3,0,0,0,0,90,inf", "not_finite", "column range_m: value \"inf\""},
      {"101,1,2,3,0,0,0,0,90,-0.1", "out_of_range", "column range_m: value \"-0.1\": a range"},
      {"101,1,2,3,0,0,0,0,90,1e300", "out_of_range",
       "column range_m: value \"1e300\": over 1,000 km"},
      {"101,1,2,20000.000001,0,0,0,0,90,1", "out_of_range", "column z_m: value \"20000.000001\""},
      {"101,1,-1e200,3,0,0,0,0,90,1", "out_of_range",
       "column y_m: value \"-1e200\": over 25,000 km"},
      {"5e18,1,2,3,0,0,0,0,90,1", "out_of_range", "column time_us: value \"5e18\": over 4e18"},
      {"99,1,2,3,0,0,0,0,90,10", "time_backwards", "time goes backwards, line 2 has 100"},
      {"\x01\xff,1,2,3,0,0,0,0,90,10", "malformed", "value \"\\x01\\xff\": not a decimal"},
  }};
  for (const BadRow& bad : kBad) {
    const std::string text = kHeader + kGood + bad.row + "\n102,1,2,3,0,0,0,0,90,10\n";
    const Outcome outcome = read(text);
    assert_string_equal(outcome.error.c_str(), "");
    assert_int_equal(outcome.rows.size(), 2);
    assert_int_equal(outcome.stats.rows, 3);
    assert_int_equal(outcome.stats.accepted, 2);
    assert_int_equal(outcome.rejected(bad.reason), 1);
    assert_int_equal(outcome.stats.rejected.size(), 1);
    assert_int_equal(outcome.messages.size(), 1);
    assert_contains(outcome.messages[0], bad.message);
    assert_contains(outcome.messages[0], "p.csv:3: ");

    const Outcome strict = read(text, true);
    assert_int_equal(strict.code, ExitCode::kInput);
    assert_contains(strict.error, bad.message);
    assert_int_equal(strict.rows.size(), 1);
  }
}

TEST(the_limits_themselves_are_accepted) {
  const Outcome outcome =
      read(kHeader +
           "-4000000000000000000,2000000,-2000000,20000,0,0,0,0,90,1000000\n"
           "4000000000000000000,-2000000,2000000.0000004,-20000,0,0,0,0,90,0\n");
  assert_string_equal(outcome.error.c_str(), "");
  assert_int_equal(outcome.rows.size(), 2);
  assert_int_equal(outcome.rows[0].position_um[0], leadline::base::kMaxHorizontal_um);
  assert_int_equal(outcome.rows[1].position_um[1], leadline::base::kMaxHorizontal_um);
  assert_int_equal(outcome.rows[1].range_um, 0);
  assert_true(outcome.rows[1].has_range);
}

TEST(a_survey_too_far_from_its_origin_stops_with_advice) {
  for (const char* const position : {"4500000,2", "1,-2000000.000001", "2000001,nan"}) {
    const std::string row = "101," + std::string(position) + ",3,0,0,0,0,90,10\n";
    const Outcome outcome = read(kHeader + kGood + row);
    if (row.find("nan") != std::string::npos) {
      assert_int_equal(outcome.rejected("not_finite"), 1);  // a broken row is only a broken row
      continue;
    }
    assert_int_equal(outcome.code, ExitCode::kInput);
    assert_contains(outcome.error, "p.csv:3: column ");
    assert_contains(outcome.error, "re-origin");
  }
}

TEST(rows_of_one_time_belong_together_and_pass) {
  const Outcome outcome = read(kHeader + kGood + kGood + kGood);
  assert_int_equal(outcome.rows.size(), 3);
}

TEST(a_rejected_row_does_not_move_the_clock) {
  const Outcome outcome =
      read(kHeader + kGood + "900,1,2,3,0,0,0,0,90,abc\n" + "200,1,2,3,0,0,0,0,90,10\n");
  assert_int_equal(outcome.rows.size(), 2);
  assert_int_equal(outcome.rejected("time_backwards"), 0);
}

TEST(descriptions_stop_after_a_few_and_counting_goes_on) {
  std::string text = kHeader + kGood;
  for (int i = 0; i < 100; ++i) {
    text += "101,1,2,3,0,0,0,0,90,abc\n";
  }
  const Outcome outcome = read(text);
  assert_int_equal(outcome.rejected("malformed"), 100);
  assert_int_equal(outcome.messages.size(), 6);
  assert_contains(outcome.messages[5], "only counted");
}

TEST(lines_of_any_length_are_survived) {
  const std::string junk(3 * 1024 * 1024, '7');
  const Outcome outcome =
      read(kHeader + kGood + junk + "\n" + "#" + std::string(70'000, 'x') + "\n" +
           "101,1,2,3,0,0,0,0,90,10." + std::string(kMaxLine_bytes - 24, '0') + "\n" +
           "102,1,2,3,0,0,0,0,90,10." + std::string(kMaxLine_bytes - 23, '0') +
           "\n103,1,2,3,0,0,0,0,90,9\n" + junk);
  assert_string_equal(outcome.error.c_str(), "");
  assert_int_equal(outcome.rows.size(), 3);
  assert_int_equal(outcome.rows[1].t_us, 101);
  assert_int_equal(outcome.rows[1].range_um, 10'000'000);
  assert_int_equal(outcome.rows[2].t_us, 103);
  assert_int_equal(outcome.rejected("line_too_long"), 4);
  assert_int_equal(outcome.rows[2].line, 7);
}

TEST(rows_across_buffer_ends_are_whole) {
  std::string text = kHeader;
  const std::uint64_t count = 60'000;  // about 3 MiB, several buffers
  for (std::uint64_t i = 0; i < count; ++i) {
    text += std::to_string(i) + "," + std::to_string(i % 1000) + ".25,-2,3,0,0,0,0,90,10.5\r\n";
  }
  const Outcome outcome = read(text);
  assert_int_equal(outcome.rows.size(), count);
  for (std::uint64_t i = 0; i < count; ++i) {
    assert_int_equal(outcome.rows[i].t_us, static_cast<std::int64_t>(i));
    assert_int_equal(outcome.rows[i].position_um[0],
                     static_cast<std::int64_t>(i % 1000) * 1'000'000 + 250'000);
    assert_int_equal(outcome.rows[i].range_um, 10'500'000);
    assert_int_equal(outcome.rows[i].line, i + 2);
  }
}

// ---- Whole files ----

TEST(files_without_a_usable_row_are_errors) {
  struct Case {
    std::string text;
    const char* message;
  };
  const std::vector<Case> cases = {
      {"", "is empty"},
      {"\n\n# only this\n", "no header line"},
      {kHeader, "no row after the header"},
      {kHeader + "\n# nothing\n", "no row after the header"},
      {kHeader + "1,nan,2,3,0,0,0,0,90,10\n2,1,2\n",
       "no usable row among 2 (missing 1, not_finite 1); the first:\np.csv:2: column x_m: value "
       "\"nan\""},
      {kHeader + "1,3e10,2,3,0,0,0,0,90,10\n", "re-origin"},
  };
  for (const Case& bad : cases) {
    const Outcome outcome = read(bad.text);
    assert_int_equal(outcome.code, ExitCode::kInput);
    assert_contains(outcome.error, bad.message);
    assert_int_equal(outcome.rows.size(), 0);
  }
}

TEST(headers_that_do_not_name_the_columns_are_errors) {
  struct Case {
    std::string text;
    const char* message;
  };
  const std::vector<Case> cases = {
      {kGood, "this one holds numbers"},
      {"time_us;x_m;y_m\n1;2;3\n", "separated by commas"},
      {"time_us,x,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n",
       "column x_m is missing (found: \"time_us,x,"},
      {"time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading,beam_az_deg,beam_el_deg,range_m\n",
       "column heading_deg is missing; is it the column named \"heading\"?"},
      {"time_us,x_m,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n",
       "column x_m is named twice"},
      {"\"time_us,x_m\n", "broken quote"},
      {"time_us,x_m\r1,2\r3,4\r", "carriage return"},
      {std::string("\xFF\xFEt\0i\0", 6), "UTF-16"},
      {std::string(3'000'000, 'a'), "header longer than"},
  };
  for (const Case& bad : cases) {
    const Outcome outcome = read(bad.text + kGood);
    assert_int_equal(outcome.code, ExitCode::kInput);
    assert_contains(outcome.error, bad.message);
  }
}

TEST(a_missing_last_line_end_is_read_and_remarked) {
  const Outcome outcome = read(kHeader + kGood + "101,1,2,3,0,0,0,0,90,10");
  assert_int_equal(outcome.rows.size(), 2);
  assert_int_equal(outcome.rows[1].range_um, 10'000'000);
  assert_true(outcome.said("no line end"));
  const Outcome cut = read(kHeader + kGood + "101,1,2,3,0,0");
  assert_int_equal(cut.rejected("missing"), 1);
}

TEST(files_and_pipes_give_the_same_rows) {
  std::string text = kHeader;
  for (int i = 0; i < 20'000; ++i) {
    text += std::to_string(i) + ",1.5,2,3,0,0,0,0,90,10\n";
  }
  const std::string path = leadline::test::scratch_directory() + "/pings.csv";
  std::ofstream(path) << text;
  PingCsvStats stats;
  const std::vector<PingRow> rows = read_ping_csv(path, PingCsvOptions{}, &stats);
  assert_int_equal(rows.size(), 20'000);
  assert_int_equal(stats.accepted, 20'000);

  std::array<int, 2> ends{};
  assert_int_equal(::pipe(ends.data()), 0);
  std::thread writer([&] {
    // Odd pieces, so that lines and numbers are cut anywhere.
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t count = std::min<std::size_t>(977, text.size() - at);
      const ssize_t written = ::write(ends[1], text.data() + at, count);
      at += written > 0 ? static_cast<std::size_t>(written) : 0;
    }
    ::close(ends[1]);
  });
  const std::vector<PingRow> piped =
      read_ping_csv("/dev/fd/" + std::to_string(ends[0]), PingCsvOptions{}, nullptr);
  writer.join();
  ::close(ends[0]);
  assert_int_equal(piped.size(), rows.size());
  assert_int_equal(piped.back().t_us, rows.back().t_us);
}

TEST(files_that_cannot_be_read_are_input_errors) {
  for (const std::string& path : {std::string("/nowhere/pings.csv"), std::string("/tmp")}) {
    ExitCode code = ExitCode::kOk;
    std::string message;
    try {
      (void)read_ping_csv(path, PingCsvOptions{}, nullptr);
    } catch (const HostError& error) {
      code = error.code();
      message = error.what();
    }
    assert_int_equal(code, ExitCode::kInput);
    assert_contains(message, path);
  }
}

TEST(progress_is_known_for_text_and_files) {
  const std::string text = kHeader + kGood;
  PingCsvReader reader("p.csv", std::string_view(text), PingCsvOptions{});
  PingRow row{};
  while (reader.next(&row)) {
  }
  assert_int_equal(reader.bytes_total(), text.size());
  assert_int_equal(reader.bytes_read(), text.size());
  assert_int_equal(reader.stats().rows, 1);
}

TEST(the_scenes_are_read_without_a_rejection) {
  for (const char* const scene : {"helens_rolling_fan", "monterey_fan", "plane_flat"}) {
    const std::string path =
        leadline::test::require_data("scenes/" + std::string(scene) + "/pings.csv");
    PingCsvStats stats;
    const std::vector<PingRow> rows = read_ping_csv(path, PingCsvOptions{}, &stats);
    assert_int_equal(stats.rows, rows.size());
    assert_int_equal(stats.rejected.size(), 0);
  }
}

}  // namespace
