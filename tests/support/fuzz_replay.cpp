// Runs a fuzz target once over each file of the folders given: kept inputs (seeds and past failures)
// are tests in every build, with any compiler, not only under libFuzzer.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int argc, char** argv) {
  std::vector<std::filesystem::path> files;
  for (int i = 1; i < argc; ++i) {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(argv[i], error)) {
      if (entry.is_regular_file()) {
        files.push_back(entry.path());
      }
    }
  }
  std::sort(files.begin(), files.end());
  // Every target must stand an empty input, corpus or not.
  LLVMFuzzerTestOneInput(nullptr, 0);
  for (const auto& file : files) {
    std::ifstream stream(file, std::ios::binary);
    const std::vector<char> bytes{std::istreambuf_iterator<char>(stream), {}};
    std::printf("%s (%zu bytes)\n", file.c_str(), bytes.size());
    std::fflush(stdout);
    std::vector<std::uint8_t> data(bytes.begin(), bytes.end());
    LLVMFuzzerTestOneInput(data.data(), data.size());
    // Every truncation as well, in at most 64 steps: half-written files are the common bad input.
    const std::size_t step = std::max<std::size_t>(1, data.size() / 64);
    for (std::size_t size = 0; size < data.size(); size += step) {
      // A copy of exactly that size, so that AddressSanitizer sees reads past the cut.
      const std::vector<std::uint8_t> cut(data.begin(),
                                          data.begin() + static_cast<std::ptrdiff_t>(size));
      LLVMFuzzerTestOneInput(cut.data(), cut.size());
    }
  }
  std::printf("%zu kept inputs and their truncations\n", files.size());
  return 0;
}
