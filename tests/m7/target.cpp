// What a test finds on the board: no files of its own, a heap, standard output through semihosting.
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>

#include "firmware/m7/entry_points.hpp"
#include "firmware/m7/say.hpp"
#include "hal/m7/semihost.hpp"
#include "tests/support/test.hpp"

namespace leadline::test {

int run_all(int argc, char** argv);

std::string source_directory() { return LEADLINE_SOURCE_DIRECTORY; }
std::string data_directory() { return source_directory() + "/../shared/data"; }

std::string require_data(const std::string& relative) {
  std::string path = data_directory() + "/" + relative;
  std::FILE* const file = std::fopen(path.c_str(), "rb");
  if (file == nullptr) {
    skip_test(path + " is not there");
  }
  (void)std::fclose(file);
  return path;
}

std::string scratch_directory() { skip_test("the board has no folder to write to"); }

}  // namespace leadline::test

extern "C" {

// Of sections.ld: addresses, not objects.
extern char leadline_data_end;
extern char leadline_ram_end;
extern char leadline_bss_end;
extern char leadline_psram_end;

void initialise_monitor_handles();
void* __dso_handle = nullptr;
void _init() {}
void _fini() {}

// The C library's heap: what the board's first RAM has left, then what the second has: malloc goes on where an area
// follows at a higher address.
void* _sbrk(std::ptrdiff_t size) {
  static char* top = &leadline_data_end;
  static char* end = &leadline_ram_end;
  if (size > end - top && end == &leadline_ram_end) {
    top = &leadline_bss_end;
    end = &leadline_psram_end;
  }
  if (size > end - top) {
    errno = ENOMEM;
    return reinterpret_cast<void*>(-1);
  }
  char* const begin = top;
  top += size;
  return begin;
}

// The C library's own reports nothing but that something went wrong.
[[noreturn]] void _exit(int status) { leadline::hal::m7::exit(static_cast<std::uint32_t>(status)); }

void leadline_main() {
  leadline::firmware::m7::end_after_fault(99);
  initialise_monitor_handles();
  static char name[256] = "test";
  (void)leadline::hal::m7::command_line(name, sizeof name);
  char* arguments[] = {name, nullptr};
  const int result = leadline::test::run_all(1, arguments);
  (void)std::fflush(stdout);
  (void)std::fflush(stderr);
  leadline::hal::m7::exit(static_cast<std::uint32_t>(result));
}

}  // extern "C"
