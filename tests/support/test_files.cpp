// The files that tests use. On a target without a file system: tests/m7/target.cpp.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <system_error>

#include <stdlib.h>

#include "tests/support/test.hpp"

namespace leadline::test {

std::string data_directory() {
  const char* configured = std::getenv("LEADLINE_DATA");
  if (configured != nullptr && configured[0] != '\0') {
    return configured;
  }
  return source_directory() + "/../shared/data";
}

std::string require_data(const std::string& relative) {
  const std::string path = data_directory() + "/" + relative;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    skip_test(path + " is not there (LEADLINE_DATA names another folder)");
  }
  return path;
}

std::string source_directory() { return LEADLINE_SOURCE_DIRECTORY; }

std::string scratch_directory() {
  struct Scratch {
    std::filesystem::path base;
    int count = 0;
    Scratch() {
      std::string pattern =
          (std::filesystem::temp_directory_path() / "leadline-test-XXXXXX").string();
      if (mkdtemp(pattern.data()) == nullptr) {
        std::perror("scratch_directory");
        std::exit(1);
      }
      base = pattern;
    }
    ~Scratch() {
      std::error_code ignored;
      std::filesystem::remove_all(base, ignored);
    }
  };
  static Scratch scratch;
  const auto path = scratch.base / std::to_string(scratch.count++);
  std::filesystem::create_directory(path);
  return path.string();
}

}  // namespace leadline::test
