// What a topside says of a link that falls silent.
#include <string>

#include "host_tools/topside/silence_watch.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::SilenceWatch;

void assert_says(SilenceWatch* watch, bool heard, double now_s, const std::string& text) {
  const auto notice = watch->follow(heard, now_s);
  assert_string_equal(notice ? notice->text.c_str() : "", text.c_str());
}

TEST(a_silence_is_said_once_and_its_end_too) {
  SilenceWatch watch;
  assert_says(&watch, false, 100.0, "");  // nothing was ever heard: waiting, not silent
  assert_true(watch.silent_s(100.0) < 0.0);
  assert_says(&watch, true, 101.0, "");
  assert_says(&watch, false, 110.9, "");
  assert_says(&watch, false, 111.0, "nothing heard for 10 s");
  assert_says(&watch, false, 130.0, "");
  assert_true(watch.silent_s(130.0) == 29.0);
  assert_says(&watch, true, 131.0, "heard again, after 30 s");
  assert_says(&watch, true, 132.0, "");
  // It pauses by habit: the next one has to be longer, up to two minutes.
  assert_says(&watch, false, 191.0, "");
  assert_says(&watch, false, 192.0, "nothing heard for 60 s");
  assert_says(&watch, true, 1192.0, "heard again, after 1060 s");
  assert_says(&watch, false, 1311.0, "");
  assert_says(&watch, false, 1312.0, "nothing heard for 120 s");
}

}  // namespace
