// A progress bar for whoever is watching.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace leadline::host {

/// Draws `label [=====>    ] 53 %  4 s left` on standard error, only when that is a terminal and only
/// once two seconds have passed; redraws at most ten times a second. The destructor wipes the line.
class Progress {
 public:
  /// `total` in any unit; 0 when unknown (then only the time passed is shown).
  Progress(std::string label, std::uint64_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Call as often as convenient: only every 256th call reads the clock.
  void update(std::uint64_t done);
  /// The same for a caller that comes by seldom: reads the clock every time.
  void update_now(std::uint64_t done);
  /// Wipes the line, if one was drawn. Call before printing to standard error.
  void finish();

 private:
  void draw(std::uint64_t done, std::chrono::steady_clock::time_point now);

  std::string label_;
  std::uint64_t total_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point next_draw_;
  std::uint32_t calls_;
  bool enabled_;
  bool drawn_;
};

}  // namespace leadline::host
