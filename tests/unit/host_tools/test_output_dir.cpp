#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>

#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/output_dir.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

namespace fs = std::filesystem;

using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::OutputDir;
using leadline::host::OutputFile;
using leadline::host::write_file_whole;
using leadline::test::assert_contains;
using leadline::test::error_of;

std::string content_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::size_t entries_in(const fs::path& path) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(path), fs::directory_iterator{}));
}

TEST(results_appear_together_and_only_at_commit) {
  const fs::path path = fs::path(leadline::test::scratch_directory()) / "a" / "b";
  {
    OutputDir output(path.string());
    output.write("depth.asc", "new depth");
    std::ofstream(output.stage("depth.png")) << "picture";
    assert_false(fs::exists(path / "depth.asc"));
    assert_false(fs::exists(path / "depth.png"));
    output.commit();
    assert_string_equal(content_of(path / "depth.asc").c_str(), "new depth");
    assert_string_equal(content_of(path / "depth.png").c_str(), "picture");
    assert_int_equal(entries_in(path), 2);
  }
  assert_int_equal(entries_in(path), 2);
}

TEST(without_commit_earlier_results_stay_as_they_were) {
  const fs::path path = leadline::test::scratch_directory();
  std::ofstream(path / "depth.asc") << "old depth";
  {
    OutputDir output(path.string());
    output.write("depth.asc", "half of the new");
    output.write("stats.json", "{}");
  }
  assert_string_equal(content_of(path / "depth.asc").c_str(), "old depth");
  assert_int_equal(entries_in(path), 1);
}

TEST(a_result_that_was_staged_and_never_written_stops_the_commit) {
  const fs::path path = leadline::test::scratch_directory();
  std::ofstream(path / "depth.asc") << "old depth";
  OutputDir output(path.string());
  output.write("depth.asc", "new depth");
  (void)output.stage("depth.png");
  const std::string message = error_of(ExitCode::kOutput, [&] { output.commit(); });
  assert_contains(message, "depth.png");
  assert_string_equal(content_of(path / "depth.asc").c_str(), "old depth");
}

TEST(side_files_of_format_drivers_do_not_reach_the_directory) {
  const fs::path path = leadline::test::scratch_directory();
  OutputDir output(path.string());
  const std::string staged = output.stage("depth.tif");
  assert_string_equal(fs::path(staged).extension().c_str(), ".tif");
  std::ofstream(staged) << "tif";
  std::ofstream(staged + ".aux.xml") << "side";
  output.commit();
  assert_int_equal(entries_in(path), 1);
}

TEST(what_a_killed_run_left_is_removed_by_the_next) {
  const fs::path path = leadline::test::scratch_directory();
  fs::create_directory(path / ".leadline-staging-abc123");
  std::ofstream(path / ".leadline-staging-abc123" / "depth.asc") << "half";
  fs::create_directory(path / "other");
  {
    OutputDir running(path.string());
    assert_false(fs::exists(path / ".leadline-staging-abc123"));
    // A second run beside the first leaves its staging alone.
    OutputDir second(path.string());
    running.write("depth.asc", "first");
    running.commit();
  }
  assert_string_equal(content_of(path / "depth.asc").c_str(), "first");
  assert_true(fs::exists(path / "other"));
  assert_int_equal(entries_in(path), 2);
}

TEST(places_that_cannot_be_written_are_named) {
  const fs::path path = leadline::test::scratch_directory();
  std::ofstream(path / "file") << "x";
  assert_contains(error_of(ExitCode::kOutput, [&] { OutputDir output((path / "file").string()); }),
                  "file");
  assert_contains(
      error_of(ExitCode::kOutput, [&] { OutputDir output((path / "file" / "sub").string()); }),
      "sub");
  assert_contains(error_of(ExitCode::kOutput, [&] { OutputDir output("/proc/leadline-test"); }),
                  "/proc/leadline-test");
  assert_contains(error_of(ExitCode::kOutput, [&] { OutputDir output("/proc"); }), "/proc");

  fs::create_directory(path / "depth.asc");
  OutputDir output(path.string());
  assert_contains(error_of(ExitCode::kOutput, [&] { output.write("depth.asc", "x"); }),
                  "directory");
}

TEST(a_full_disk_is_an_output_error_from_write_or_close) {
  const std::string large(1'000'000, 'x');
  assert_contains(error_of(ExitCode::kOutput,
                           [&] {
                             OutputFile file("/dev/full");
                             file.write(large);
                           }),
                  "/dev/full: No space left on device");
  assert_contains(error_of(ExitCode::kOutput,
                           [&] {
                             OutputFile file("/dev/full", "DIR/depth.asc");
                             file.write("small");
                             file.close();
                           }),
                  "DIR/depth.asc: No space left on device");
  assert_contains(error_of(ExitCode::kOutput, [&] { write_file_whole("/dev/full", "x"); }),
                  "No space left");
}

TEST(a_limit_in_the_middle_of_a_result_leaves_the_earlier_one) {
  // The file size limit stands in for a disk that fills up: write() fails after the first part.
  const fs::path path = leadline::test::scratch_directory();
  std::ofstream(path / "depth.asc") << "old depth";
  std::ofstream(path / "single.asc") << "old single";
  rlimit old{};
  assert_int_equal(::getrlimit(RLIMIT_FSIZE, &old), 0);
  rlimit small = old;
  small.rlim_cur = 100'000;
  auto* const old_handler = std::signal(SIGXFSZ, SIG_IGN);
  const std::string large(300'000, 'x');
  std::string message;
  std::string single_message;
  assert_int_equal(::setrlimit(RLIMIT_FSIZE, &small), 0);
  try {
    OutputDir output(path.string());
    output.write("depth.asc", large);
    output.commit();
  } catch (const HostError& error) {
    message = error.what();
  }
  try {
    write_file_whole((path / "single.asc").string(), large);
  } catch (const HostError& error) {
    single_message = error.what();
  }
  assert_int_equal(::setrlimit(RLIMIT_FSIZE, &old), 0);
  std::signal(SIGXFSZ, old_handler);
  assert_contains(message, "depth.asc: File too large");
  assert_contains(single_message, "single.asc: File too large");
  assert_string_equal(content_of(path / "depth.asc").c_str(), "old depth");
  assert_string_equal(content_of(path / "single.asc").c_str(), "old single");
  assert_int_equal(entries_in(path), 2);
}

TEST(single_results_are_replaced_whole) {
  const fs::path path = leadline::test::scratch_directory();
  write_file_whole((path / "table.llt").string(), "one");
  write_file_whole((path / "table.llt").string(), "two");
  assert_string_equal(content_of(path / "table.llt").c_str(), "two");
  fs::create_symlink("table.llt", path / "link.llt");
  write_file_whole((path / "link.llt").string(), "three");
  assert_true(fs::is_symlink(path / "link.llt"));
  assert_string_equal(content_of(path / "table.llt").c_str(), "three");
  assert_int_equal(entries_in(path), 2);
  assert_contains(error_of(ExitCode::kOutput, [&] { write_file_whole(path.string(), "x"); }),
                  "directory");
  assert_contains(
      error_of(ExitCode::kOutput, [&] { write_file_whole((path / "no" / "x").string(), "x"); }),
      "No such file");
}

TEST(large_results_keep_every_byte) {
  const fs::path path = leadline::test::scratch_directory();
  std::string expected;
  {
    OutputFile file((path / "x").string());
    for (int i = 0; i < 200'000; ++i) {
      const std::string piece = std::to_string(i) + ",";
      file.write(piece);
      expected += piece;
    }
    file.close();
  }
  assert_true(content_of(path / "x") == expected);
}

}  // namespace
