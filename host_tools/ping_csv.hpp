// Pings from CSV: the input contract of `leadline map`, `grid` and every tool that reads soundings.
//
// Format
//   First line that is neither blank nor a comment: the header. Its names say which column is which,
//   in any order:
//     time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m
//   Further columns are ignored with one notice. Values are separated by commas; blanks around them,
//   double quotes around them, a UTF-8 byte order mark, CRLF, blank lines and lines that start with
//   `#` are accepted. A file may also be a pipe.
// Numbers
//   Plain decimals (`-12.5`, `.5`, `7.`) and exponents (`1.25e1`: numpy.savetxt and pandas write
//   them), any number of digits. They become integers without floating point, so a value means the
//   same on every machine:
//     time_us                 whole microseconds (`20000.0` is whole, `0.5` is malformed)
//     x_m, y_m, z_m, range_m  micrometres, nearest, halves away from zero
//     angles                  binary angle, 2^32 a turn, nearest, halves away from zero, exact for
//                             any number of digits; any finite angle is wrapped
//   An empty range_m means that nothing was heard; any other value must be there.
// Rows that cannot be used
//   are rejected whole, counted by reason, and described as
//     FILE:LINE: column NAME: value "TEXT": REASON
//   or stop the reading with `strict`. The reasons (keys of PingCsvStats::rejected):
//     malformed       not a number; a broken quote; more values than the header has names
//     missing         an empty value, or fewer values than the header has names (a cut line)
//     not_finite      nan or inf in any spelling
//     out_of_range    absurd: outside what kMax* below and model/base/units.hpp allow
//     time_backwards  earlier than the last row that was accepted
//     line_too_long   more than kMaxLine_bytes
//   |x_m| or |y_m| over 2,000 km but on Earth is not one bad row but a survey in the wrong frame
//   (UTM northings, say): that always stops, with advice to re-origin.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "model/base/pose.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

/// Largest |time_us| accepted: differences of two times always fit 64 bits.
inline constexpr std::int64_t kMaxTime_us = 4'000'000'000'000'000'000;
/// |x_m|, |y_m| up to here are taken for a survey that needs a re-origin, beyond for a broken value.
inline constexpr std::int64_t kMaxEarth_um = 25'000'000'000'000;
/// Largest range that is still a range (1,000 km). What the sonar can reach is the configuration's
/// business: see range_below_min and range_above_max in cmd_map.
inline constexpr std::int64_t kMaxCsvRange_um = 1'000'000'000'000;
/// Longest line accepted. Inclusive, without the line end.
inline constexpr std::size_t kMaxLine_bytes = 65'536;

/// One usable row.
struct PingRow {
  base::TimeUs t_us;  ///< |t_us| <= kMaxTime_us, not before the previous row's
  std::int64_t
      position_um[3];         ///< NED of the transducer, within kMaxHorizontal_um, kMaxVertical_um
  base::Attitude attitude;    ///< of the mount: v_NED = Rz(heading) Ry(pitch) Rx(roll) v_FRD
  base::Bam32 azimuth_bam32;  ///< v_FRD = (cos el cos az, cos el sin az, sin el)
  base::Bam32 elevation_bam32;
  std::int64_t range_um;  ///< 0 <= range_um <= kMaxCsvRange_um; 0 when !has_range
  bool has_range;         ///< false: the beam listened and heard nothing
  std::uint64_t line;     ///< line number in the file, from 1
};

struct PingCsvOptions {
  bool strict = false;  ///< the first unusable row throws instead of being counted
  /// Rows described per reason before the rest is only counted.
  std::size_t max_messages_per_reason = 5;
  /// Where notices and descriptions go, one line each without newline; may be empty.
  std::function<void(const std::string&)> message;
};

struct PingCsvStats {
  std::uint64_t rows = 0;       ///< data rows seen (not blank, not comment, not header)
  std::uint64_t accepted = 0;   ///< rows == accepted + sum of rejected after every next()
  std::uint64_t no_return = 0;  ///< accepted rows with an empty range
  std::map<std::string, std::uint64_t> rejected;  ///< reason -> rows, only reasons that occurred
  std::vector<std::string> ignored_columns;       ///< names in the header's order
};

/// Reads pings one by one. Holds one buffer of a few MiB whatever the file's size; about 100 ns a row.
/// Not copyable; one thread.
class PingCsvReader {
 public:
  /// Opens `path` ("-" is standard input) and reads the header.
  /// Throws HostError kInput: cannot be read, is empty, a column is missing or named twice.
  PingCsvReader(const std::string& path, const PingCsvOptions& options);
  /// The same over text in memory, which must outlive the reader; `name` is used in messages.
  PingCsvReader(const std::string& name, std::string_view text, const PingCsvOptions& options);
  ~PingCsvReader();
  PingCsvReader(const PingCsvReader&) = delete;
  PingCsvReader& operator=(const PingCsvReader&) = delete;

  /// Fills `row` with the next usable row and returns true; false at the end of the file.
  /// Throws HostError kInput: with `strict` at the first unusable row; at a position that needs a
  /// re-origin; at a read error; and at the end when no row was usable (the message repeats the
  /// first rejection).
  [[nodiscard]] bool next(PingRow* row);

  [[nodiscard]] const PingCsvStats& stats() const;
  /// Bytes taken so far and in all (0 when unknown: a pipe), for a progress bar.
  [[nodiscard]] std::uint64_t bytes_read() const;
  [[nodiscard]] std::uint64_t bytes_total() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// All usable rows of a file, in order; `stats` may be null. Throws like PingCsvReader.
[[nodiscard]] std::vector<PingRow> read_ping_csv(const std::string& path,
                                                 const PingCsvOptions& options,
                                                 PingCsvStats* stats);

/// What decimal_to_scaled and degrees_to_bam32 found.
enum class DecimalStatus : std::uint8_t {
  kOk,
  kEmpty,      ///< nothing but blanks
  kMalformed,  ///< not a decimal number
  kNotFinite,  ///< nan or inf in any spelling
  kTooLarge,   ///< does not fit
  kInexact,    ///< has a fraction where `whole` forbids one
};

/// `text` * 10^scale_digits as an integer, nearest, halves away from zero; with `whole` a remainder
/// is refused instead. 0 <= scale_digits <= 9. |result| <= 9.2e18, else kTooLarge. Exact for any
/// number of digits and any exponent; O(length). `value` is written only on kOk.
[[nodiscard]] DecimalStatus decimal_to_scaled(std::string_view text, int scale_digits, bool whole,
                                              std::int64_t* value);

/// `text` degrees as a binary angle: round(degrees * 2^32 / 360) modulo 2^32, halves away from zero.
/// Exact for any number of digits and any exponent; O(length). Never kTooLarge: it wraps. `angle` is
/// written only on kOk.
[[nodiscard]] DecimalStatus degrees_to_bam32(std::string_view text, base::Bam32* angle);

}  // namespace leadline::host
