// Dates of recordings to microseconds since 1970, without the system's time zone.
#pragma once

#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::host {

/// Gregorian, UTC (or whatever clock the recorder had).
struct CalendarTime {
  unsigned year;
  unsigned month;   ///< 1 .. 12
  unsigned day;     ///< 1 .. 31
  unsigned hour;    ///< 0 .. 23
  unsigned minute;  ///< 0 .. 59
  unsigned second;  ///< 0 .. 60
};

/// A date that the calendar has, of 1970 .. 2200.
[[nodiscard]] constexpr bool is_calendar_time(const CalendarTime& time) {
  const bool leap = (time.year % 4 == 0 && time.year % 100 != 0) || time.year % 400 == 0;
  const unsigned february = leap ? 29 : 28;
  const bool short_month =
      time.month == 4 || time.month == 6 || time.month == 9 || time.month == 11;
  const unsigned last = time.month == 2 ? february : (short_month ? 30U : 31U);
  return time.year >= 1970 && time.year <= 2200 && time.month >= 1 && time.month <= 12 &&
         time.day >= 1 && time.day <= last && time.hour <= 23 && time.minute <= 59 &&
         time.second <= 60;
}

/// Microseconds since 1970-01-01; `time` is one (is_calendar_time).
[[nodiscard]] constexpr base::TimeUs unix_us(const CalendarTime& time) {
  // Years that begin in March put the leap day last.
  const std::int64_t year = static_cast<std::int64_t>(time.year) - (time.month <= 2 ? 1 : 0);
  const std::int64_t month = (time.month + 9U) % 12U;
  const std::int64_t day_of_year = (153 * month + 2) / 5 + time.day - 1;
  const std::int64_t days = year * 365 + year / 4 - year / 100 + year / 400 + day_of_year - 719'468;
  return (((days * 24 + time.hour) * 60 + time.minute) * 60 + time.second) * 1'000'000;
}

}  // namespace leadline::host
