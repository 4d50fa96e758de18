// Options of every command that are given what they cannot mean: the exit code, and the words that name option and value.
#include <algorithm>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "host_tools/command_line.hpp"
#include "host_tools/exit_codes.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::ExitCode;
using leadline::host::make_command_line;
using leadline::test::assert_contains;
using Words = std::vector<std::string>;

/// Exit status and standard error of `leadline` with these words.
std::pair<int, std::string> leadline_with(Words words) {
  words.insert(words.begin(), "leadline");
  std::vector<char*> argv;
  for (std::string& word : words) {
    argv.push_back(word.data());
  }
  std::ostringstream errors;
  std::ostringstream output;
  std::streambuf* const before = std::cerr.rdbuf(errors.rdbuf());
  std::streambuf* const output_before = std::cout.rdbuf(output.rdbuf());
  const int status = leadline::host::run_command_line(static_cast<int>(argv.size()), argv.data());
  std::cerr.rdbuf(before);
  std::cout.rdbuf(output_before);
  return {status, errors.str()};
}

void assert_refused(const Words& words, std::vector<ExitCode> codes, const std::string& part) {
  const auto [status, errors] = leadline_with(words);
  bool right = errors.find(part) != std::string::npos;
  bool code = false;
  for (const ExitCode each : codes) {
    code = code || status == static_cast<int>(each);
  }
  if (!right || !code) {
    std::string line;
    for (const std::string& word : words) {
      line += " \"" + word + "\"";
    }
    fail_msg("%s\nends with %d: %s\nwithout %s", line.c_str(), status, errors.c_str(),
             part.c_str());
  }
}

/// A word in the place of each required option of a command.
Words required_words(const CLI::App& command, const CLI::Option* except) {
  Words words;
  for (const CLI::Option* const option : command.get_options()) {
    if (!option->get_required() || option == except) {
      continue;
    }
    if (!option->get_positional()) {
      words.push_back(option->get_name());
    }
    words.emplace_back(option->get_type_name() == "NORTH,EAST,DOWN" ? "0,0,0"
                       : option->get_name() == "plane"              ? "north"
                                                                    : "x");
  }
  return words;
}

/// Every option of the command that takes a value, with `value` for it: what comes of each.
void try_options(const CLI::App& command, const Words& before, int* tried) {
  for (const CLI::App* const sub : command.get_subcommands([](const CLI::App*) { return true; })) {
    Words words = before;
    const Words required = required_words(command, nullptr);
    words.insert(words.end(), required.begin(), required.end());
    words.push_back(sub->get_name());
    try_options(*sub, words, tried);
  }
  for (const CLI::Option* const option : command.get_options()) {
    if (option->get_expected_max() == 0 || option->get_type_name() == "TEXT" ||
        option->get_positional()) {
      continue;
    }
    for (const char* const value : {"", "nan", "-inf", "1e999"}) {
      Words words = before;
      const Words required = required_words(command, option);
      words.insert(words.end(), required.begin(), required.end());
      words.push_back(option->get_name());
      words.insert(words.end(), static_cast<std::size_t>(std::max(option->get_expected_min(), 1)),
                   value);
      for (const CLI::App* const sub :
           command.get_subcommands([](const CLI::App*) { return true; })) {
        words.push_back(sub->get_name());  // the first: without one the command does nothing
        const Words more = required_words(*sub, nullptr);
        words.insert(words.end(), more.begin(), more.end());
        break;
      }
      assert_refused(words, {ExitCode::kUsage}, option->get_name());
      ++*tried;
    }
  }
}

TEST(no_option_of_any_command_takes_nothing_or_what_is_no_number) {
  leadline::host::CommandRun run;
  const auto app = make_command_line(&run);
  int tried = 0;
  try_options(*app, {}, &tried);
  assert_true(tried > 600);
}

TEST(numbers_outside_their_limits_are_named_with_them) {
  const std::vector<std::pair<Words, const char*>> cases = {
      {{"compare", "a", "b", "--max-rmse", "-1"}, "--max-rmse -1: has to be 0 to 1000000000"},
      {{"compare", "a", "b", "--min-coverage", "1e300"}, "--min-coverage 1e+300: has to be 0 to 1"},
      {{"compare", "a", "b", "--max-p95", "much"}, "--max-p95"},
      {{"probe", "file:x", "--max-range", "301"}, "--max-range 301: has to be 1 to 300, metres"},
      {{"emulate", "ping1d", "--port", "pty:", "--bottom", "0.2"},
       "--bottom 0.2: has to be 0.3 to 100, metres below"},
      {{"emulate", "--speed", "0"}, "--speed 0: has to be over 0 to 10000"},
      {{"emulate", "--set", "speed_m_s=fast", "--write-config", "x"},
       "--set: speed_m_s=fast: not a decimal"},
      {{"emulate", "--link", "udp:h", "--write-config", "x"}, "--link: "},
      {{"simulate", "--set", "spede_m_s=1", "--out", "x"},
       "unknown parameter \"spede_m_s\"; did you mean speed_m_s?"},
      {{"scene", "--set", "cell_m=-1", "--out", "x"}, "cell_m must be positive, got -1"},
      {{"import", "x.sum", "--lat", "91", "--lon", "0", "--out", "x"},
       "--lat 91: has to be -85 to 85, degrees"},
      {{"link-sim", "x", "--loss", "1"}, "--loss"},
      {{"config", "compile", "x", "--out", "y", "--beams", "0"}, "--beams"},
  };
  for (const auto& [words, part] : cases) {
    assert_refused(words, {ExitCode::kUsage}, part);
  }
}

TEST(options_that_would_do_nothing_are_refused) {
  assert_refused({"render", "m", "--view", "depth", "--out", "p", "--reference", "r"},
                 {ExitCode::kUsage}, "--reference: goes with --view difference");
  assert_refused({"render", "m", "--view", "slice", "--out", "p", "--view-azimuth", "9"},
                 {ExitCode::kUsage}, "--view-azimuth: goes with --view oblique");
  assert_refused({"calibrate", "p.csv", "--draft", "1"}, {ExitCode::kUsage},
                 "--draft: is for recordings");
}

TEST(folders_and_what_is_missing_or_something_else_are_named) {
  const std::string folder = leadline::test::scratch_directory();
  const std::string junk = folder + "/junk";
  std::ofstream(junk) << std::string("\x00\x01\xFF junk", 8);
  const std::string good = folder + "/good.asc";
  std::ofstream(good)
      << "ncols 1\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n-1\n";
  for (const std::string& path : {folder, folder + "/missing", junk, folder + "/missing/x"}) {
    for (const Words& words :
         std::vector<Words>{{"compare", path, good},
                            {"compare", good, good, "--mask", path},
                            {"map", "--pings", path, "--config", good, "--out", folder + "/m"},
                            {"render", path, "--view", "depth", "--out", folder + "/p.png"},
                            {"query", path, "--from", "0,0,0", "--to", "1,1,1"},
                            {"replay", path},
                            {"export", path, "--out", folder + "/e.tif"},
                            {"table", "--show", path},
                            {"table", "--config", path},
                            {"config", "show", path},
                            {"config", "compile", path, "--out", folder + "/b"},
                            {"store", "list", path},
                            {"crosslines", path, good},
                            {"link-sim", path}}) {
      const bool config_first = words[0] == "map";
      assert_refused(words, {ExitCode::kUsage, ExitCode::kInput}, config_first ? good : path);
    }
  }
}

TEST(results_that_cannot_be_written_are_named) {
  const std::string folder = leadline::test::scratch_directory();
  const std::string good = folder + "/good.asc";
  std::ofstream(good)
      << "ncols 1\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n-1\n";
  for (const std::string& path : {folder, folder + "/nowhere/d.asc", std::string("/dev/full")}) {
    assert_refused({"compare", good, good, "--difference-asc", path}, {ExitCode::kOutput}, path);
  }
}

}  // namespace
