// Everything that toolchain/m7_gates.py is to find, in one image: a heap, stdio, recursion, a frame without a
// constant size, a call through a pointer that nobody has named. Linked by tests/cli/test_m7_ci.sh, never run.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "firmware/m7/entry_points.hpp"

namespace {

volatile std::uint32_t sink;

[[gnu::noinline]] std::uint32_t recursive(std::uint32_t depth) {
  return depth == 0 ? sink : recursive(depth - 1) * 3U + sink;
}

[[gnu::noinline]] void frame_of(std::uint32_t size) {
  auto* const room = static_cast<volatile std::uint8_t*>(__builtin_alloca(size));
  room[size / 2U] = 1;
  sink = room[size / 3U];
}

std::uint32_t one() { return 1; }
std::uint32_t two() { return 2; }
[[gnu::noinline]] std::uint32_t through_pointer(std::uint32_t (*volatile function)()) {
  return function();
}

}  // namespace

extern "C" {

void* _sbrk(std::ptrdiff_t size);
void* _sbrk(std::ptrdiff_t /*size*/) { return reinterpret_cast<void*>(-1); }

void leadline_main() {
  void* const block = std::malloc(sink);
  std::printf("%p\n", block);
  std::free(block);
  sink = recursive(sink);
  frame_of(sink);
  sink = through_pointer(sink != 0 ? one : two);
}

}  // extern "C"
