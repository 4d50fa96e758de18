#include "hal/m7/semihost.hpp"

#include <cstring>

namespace leadline::hal::m7 {
namespace {

constexpr std::uint32_t kOpen = 0x01;
constexpr std::uint32_t kClose = 0x02;
constexpr std::uint32_t kWriteText = 0x04;
constexpr std::uint32_t kWrite = 0x05;
constexpr std::uint32_t kRead = 0x06;
constexpr std::uint32_t kCommandLine = 0x15;
constexpr std::uint32_t kExitExtended = 0x20;
constexpr std::uint32_t kApplicationExit = 0x20026;

std::int32_t call(std::uint32_t operation, const void* argument) {
  std::int32_t result = 0;
  asm volatile("mov r0, %1\n mov r1, %2\n bkpt 0xab\n mov %0, r0"
               : "=r"(result)
               : "r"(operation), "r"(argument)
               : "r0", "r1", "memory");
  return result;
}

std::uint32_t address(const void* pointer) {
  return static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(pointer));
}

}  // namespace

bool HostFile::open(const char* path, OpenMode mode) {
  const std::uint32_t block[3] = {address(path), static_cast<std::uint32_t>(mode),
                                  static_cast<std::uint32_t>(std::strlen(path))};
  handle_ = call(kOpen, block);
  return handle_ >= 0;
}

// NOLINTNEXTLINE(readability-make-member-function-const): the file goes on
std::size_t HostFile::read(std::uint8_t* out, std::size_t capacity) {
  const std::uint32_t block[3] = {static_cast<std::uint32_t>(handle_), address(out),
                                  static_cast<std::uint32_t>(capacity)};
  const std::int32_t missing = call(kRead, block);
  return missing < 0 || static_cast<std::size_t>(missing) > capacity
             ? 0
             : capacity - static_cast<std::size_t>(missing);
}

// NOLINTNEXTLINE(readability-make-member-function-const): the file goes on
bool HostFile::write(const void* data, std::size_t size_bytes) {
  const std::uint32_t block[3] = {static_cast<std::uint32_t>(handle_), address(data),
                                  static_cast<std::uint32_t>(size_bytes)};
  return call(kWrite, block) == 0;
}

void HostFile::close() {
  const std::uint32_t block[1] = {static_cast<std::uint32_t>(handle_)};
  (void)call(kClose, block);
  handle_ = -1;
}

void say(const char* text) { (void)call(kWriteText, text); }

bool command_line(char* out, std::size_t capacity) {
  const std::uint32_t block[2] = {address(out), static_cast<std::uint32_t>(capacity)};
  return call(kCommandLine, block) == 0;
}

void exit(std::uint32_t status) {
  const std::uint32_t block[2] = {kApplicationExit, status};
  (void)call(kExitExtended, block);
  for (;;) {
    asm volatile("wfi");
  }
}

}  // namespace leadline::hal::m7
