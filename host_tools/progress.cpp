#include "host_tools/progress.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include <unistd.h>

namespace leadline::host {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kQuietAtFirst{2000};
constexpr std::chrono::milliseconds kRedraw{100};
constexpr std::uint32_t kCallsPerClock = 256;
constexpr int kBarWidth = 30;

}  // namespace

Progress::Progress(std::string label, std::uint64_t total)
    : label_(std::move(label)),
      total_(total),
      start_(Clock::now()),
      next_draw_(start_ + kQuietAtFirst),
      calls_(0),
      enabled_(::isatty(STDERR_FILENO) == 1),
      drawn_(false) {}

Progress::~Progress() { finish(); }

void Progress::update(std::uint64_t done) {
  if (calls_++ % kCallsPerClock == 0) {
    update_now(done);
  }
}

void Progress::update_now(std::uint64_t done) {
  if (!enabled_) {
    return;
  }
  const Clock::time_point now = Clock::now();
  if (now >= next_draw_) {
    draw(done, now);
    next_draw_ = now + kRedraw;
  }
}

void Progress::draw(std::uint64_t done, Clock::time_point now) {
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  drawn_ = true;
  if (total_ == 0) {
    std::fprintf(stderr, "\r\033[K%s %.0f s", label_.c_str(), elapsed_s);
    std::fflush(stderr);
    return;
  }
  const double share = std::min(1.0, static_cast<double>(done) / static_cast<double>(total_));
  const auto filled = static_cast<int>(std::lround(share * kBarWidth));
  std::string bar(static_cast<std::size_t>(filled), '=');
  bar += filled < kBarWidth ? ">" : "";
  bar.resize(static_cast<std::size_t>(kBarWidth), ' ');
  std::fprintf(stderr, "\r\033[K%s [%s] %3.0f %%", label_.c_str(), bar.c_str(), share * 100.0);
  if (share > 0.0) {
    std::fprintf(stderr, "  %.0f s left", elapsed_s / share - elapsed_s);
  }
  std::fflush(stderr);
}

void Progress::finish() {
  if (drawn_) {
    std::fputs("\r\033[K", stderr);
    std::fflush(stderr);
    drawn_ = false;
  }
}

}  // namespace leadline::host
