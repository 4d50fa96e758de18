#include <chrono>
#include <string>
#include <thread>

#include <fcntl.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include "host_tools/progress.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::Progress;

/// Runs `action` in a child whose standard error is a new terminal (or, without, a pipe) and returns
/// what it wrote there.
template <typename Action>
std::string standard_error_of(bool terminal, const Action& action) {
  int reading = -1;
  int writing = -1;
  if (terminal) {
    reading = ::posix_openpt(O_RDWR | O_NOCTTY);
    assert_true(reading >= 0);
    assert_int_equal(::grantpt(reading), 0);
    assert_int_equal(::unlockpt(reading), 0);
    writing = ::open(::ptsname(reading), O_RDWR | O_NOCTTY);
  } else {
    int ends[2] = {-1, -1};
    assert_int_equal(::pipe(ends), 0);
    reading = ends[0];
    writing = ends[1];
  }
  assert_true(writing >= 0);
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(writing, STDERR_FILENO);
    action();
    ::_exit(0);
  }
  ::close(writing);
  std::string text;
  char buffer[256];
  // A terminal whose other side is gone reports EIO, a pipe the end of the file.
  for (ssize_t count = 0; (count = ::read(reading, buffer, sizeof buffer)) > 0;) {
    text.append(buffer, static_cast<std::size_t>(count));
  }
  int status = -1;
  ::waitpid(child, &status, 0);
  ::close(reading);
  assert_int_equal(status, 0);
  return text;
}

void work(std::uint64_t total, std::chrono::milliseconds duration) {
  Progress progress("mapping", total);
  const auto end = std::chrono::steady_clock::now() + duration;
  while (std::chrono::steady_clock::now() < end) {
    progress.update_now(total / 4);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

TEST(nothing_is_drawn_before_two_seconds) {
  assert_string_equal(
      standard_error_of(true, [] { work(100, std::chrono::milliseconds(300)); }).c_str(), "");
}

TEST(nothing_is_drawn_where_nobody_watches) {
  assert_string_equal(
      standard_error_of(false, [] { work(100, std::chrono::milliseconds(2300)); }).c_str(), "");
}

TEST(a_terminal_sees_a_bar_and_then_a_clean_line) {
  const std::string text =
      standard_error_of(true, [] { work(100, std::chrono::milliseconds(2300)); });
  assert_true(text.find("mapping [========>") != std::string::npos);
  assert_true(text.find(" 25 %") != std::string::npos);
  assert_true(text.find(" s left") != std::string::npos);
  assert_string_equal(text.substr(text.size() - 4).c_str(), "\r\033[K");
}

TEST(an_unknown_total_shows_the_time) {
  const std::string text =
      standard_error_of(true, [] { work(0, std::chrono::milliseconds(2300)); });
  assert_true(text.find("mapping 2 s") != std::string::npos);
  assert_true(text.find('%') == std::string::npos);
}

}  // namespace
