#include "tests/support/test.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <vector>

namespace leadline::test {
namespace {

struct Entry {
  const char* name;
  Body body;
};

// Function-local: registrations of other files may run before this file's globals exist.
std::vector<Entry>& entries() {
  static std::vector<Entry> list;
  return list;
}

/// Thrown by skip_test(): unlike CMocka's longjmp it runs the destructors of the test body.
struct Skipped {};

struct Tally {
  int started = 0;
  int skipped = 0;
};
Tally tally;
std::uint64_t chosen_seed = 20261122;

constexpr int kExitSkipped = 77;  // SKIP_RETURN_CODE in tests/CMakeLists.txt

void run_entry(void** state) {
  const auto* entry = static_cast<const Entry*>(*state);
  ++tally.started;
  bool escaped = false;
  bool skipped = false;
  try {
    entry->body();
  } catch (const Skipped&) {
    skipped = true;
  } catch (const std::exception& exception) {
    print_error("ERROR: exception: %s\n", exception.what());
    escaped = true;
  } catch (...) {
    print_error("ERROR: exception that is no std::exception\n");
    escaped = true;
  }
  // Outside the handlers: both leave by longjmp, and the exception must be gone by then.
  if (skipped) {
    ++tally.skipped;
    _skip(entry->name, 0);
  }
  if (escaped) {
    _fail(entry->name, 0);
  }
}

}  // namespace

Registration::Registration(const char* name, Body body) { entries().push_back({name, body}); }

void skip_test(const std::string& reason) {
  print_message("*skipped*: %s\n", reason.c_str());
  throw Skipped{};
}

std::uint64_t seed() { return chosen_seed; }

void assert_near_impl(double actual, double expected, double tolerance, const char* expression,
                      const char* file, int line) {
  // Written so that NaN on either side fails.
  if (std::fabs(actual - expected) <= tolerance) {
    return;
  }
  print_error("%s = %.17g, expected %.17g within %.3g\n", expression, actual, expected, tolerance);
  _fail(file, line);
}

/// Called by main() only. Not in the header: a test has no use for it.
int run_all(int argc, char** argv);

int run_all(int argc, char** argv) {
  const char* pattern = nullptr;
  bool list = false;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--list") == 0) {
      list = true;
    } else if (std::strcmp(argv[i], "--seed") == 0 && i + 1 < argc) {
      chosen_seed = std::strtoull(argv[++i], nullptr, 0);
    } else if (argv[i][0] == '-') {
      std::fprintf(stderr, "usage: %s [--list] [--seed N] [PATTERN]\n", argv[0]);
      return 2;
    } else {
      pattern = argv[i];
    }
  }
  if (list) {
    for (const Entry& entry : entries()) {
      std::puts(entry.name);
    }
    return 0;
  }
  std::vector<CMUnitTest> tests;
  tests.reserve(entries().size());
  for (Entry& entry : entries()) {
    tests.push_back({entry.name, run_entry, nullptr, nullptr, &entry});
  }
  if (pattern != nullptr) {
    cmocka_set_test_filter(pattern);
  }
  const char* const slash = std::strrchr(argv[0], '/');
  const std::string name = slash != nullptr ? slash + 1 : argv[0];
  const int failed =
      _cmocka_run_group_tests(name.c_str(), tests.data(), tests.size(), nullptr, nullptr);
  if (failed != 0) {
    std::fprintf(stderr, "random choices repeat with: %s --seed %llu\n", argv[0],
                 static_cast<unsigned long long>(chosen_seed));
    return 1;
  }
  if (tally.started == 0) {
    std::fprintf(stderr, "%s: no test ran\n", argv[0]);
    return 1;
  }
  return tally.skipped == tally.started ? kExitSkipped : 0;
}

}  // namespace leadline::test
