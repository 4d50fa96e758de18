// One GPIO line over libgpiod: 1.6 (Debian 12) or 2.x, whichever was there when this was built. Inside of
// hal/linux.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace leadline::hal {

struct GpioEdge {
  bool rising;
  std::int64_t stamp_ns;  ///< CLOCK_MONOTONIC, when the kernel saw it
  std::uint32_t
      lost;  ///< edges lost in front of this one, as far as the library can tell (1.6: never)
};

/// Not copyable; calls return false with errno set. Nothing allocates behind open.
class GpioLine {
 public:
  GpioLine() = default;
  GpioLine(const GpioLine&) = delete;
  GpioLine& operator=(const GpioLine&) = delete;
  ~GpioLine() { close(); }

  /// `chip`: name ("gpiochip0") or path. Both edges are reported.
  [[nodiscard]] bool open_input(const std::string& chip, std::uint32_t line) {
    return open(chip, line, false);
  }
  /// Low until set.
  [[nodiscard]] bool open_output(const std::string& chip, std::uint32_t line) {
    return open(chip, line, true);
  }
  void close();
  [[nodiscard]] bool set(bool high);
  /// Level of an input now.
  [[nodiscard]] bool get(bool* high);
  /// To poll for edges; -1: closed.
  [[nodiscard]] int fd() const;
  /// Takes the next edge; to be called when fd() is readable, otherwise it waits.
  [[nodiscard]] bool read_edge(GpioEdge* edge);

 private:
  [[nodiscard]] bool open(const std::string& chip, std::uint32_t line, bool output);

  void* chip_ = nullptr;
  void* line_ = nullptr;                     ///< 1.6: the line; 2.x: the request
  [[maybe_unused]] void* buffer_ = nullptr;  ///< 2.x: of events
  [[maybe_unused]] std::uint32_t offset_ = 0;
  [[maybe_unused]] unsigned long sequence_ = 0;  ///< 2.x: of the edge before
};

}  // namespace leadline::hal
