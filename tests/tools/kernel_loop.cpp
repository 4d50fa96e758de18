// One of the inner loops, so many times, and nothing else: for whoever counts instructions (toolchain/bench.sh --aarch64).
//
//   kernel_loop shell|empty vector|scalar VOXELS TIMES
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "model/column_kernels.hpp"

namespace {

namespace model = leadline::model;

constexpr std::int32_t kGuard = 8;
model::Voxel column[256 + 2 * kGuard];
// A bell over the taps of a kernel; the numbers do not change the way through.
std::int16_t taps[model::kKernelTaps + kGuard];

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fputs("usage: kernel_loop shell|empty vector|scalar VOXELS TIMES\n", stderr);
    return 2;
  }
  const bool shell = std::strcmp(argv[1], "shell") == 0;
  const bool vector = std::strcmp(argv[2], "vector") == 0;
  const auto count = static_cast<std::int32_t>(std::atoi(argv[3]));
  const auto times = static_cast<std::uint32_t>(std::atoi(argv[4]));
  if (count < 1 || count > (shell ? static_cast<std::int32_t>(model::kKernelTaps) : 256)) {
    std::fputs("kernel_loop: VOXELS: 1 to 256, of a shell as many as a kernel has taps\n", stderr);
    return 2;
  }
  for (std::size_t i = 0; i < model::kKernelTaps; ++i) {
    const int off = static_cast<int>(2 * i) - static_cast<int>(model::kKernelTaps);
    taps[i] = static_cast<std::int16_t>(8000 - 30 * off * off);
  }
  const model::Evidence hits{3000, 200};
  const model::Evidence misses{40, 900};
  for (std::uint32_t dither = 0; dither < times; ++dither) {
    if (shell && vector) {
      model::add_shell(column + kGuard, taps, count, 8, hits, dither);
    } else if (shell) {
      model::add_shell_scalar(column + kGuard, taps, count, 8, hits, dither);
    } else if (vector) {
      model::add_uniform(column + kGuard, count, 0, misses, dither);
    } else {
      model::add_uniform_scalar(column + kGuard, count, 0, misses, dither);
    }
  }
  return 0;
}
