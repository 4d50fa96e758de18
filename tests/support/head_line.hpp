// A head's codec and its emulated device with a line each way between them, stepped millisecond by
// millisecond: what the tests of conversations share.
#pragma once

#include <functional>
#include <vector>

#include "hal/emu/faulty_stream.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/ping.hpp"
#include "tests/support/device_bytes.hpp"

namespace leadline::test {

/// The device's bytes carry the millisecond of their arrival.
template <typename Codec>
class HeadLine {
 public:
  HeadLine(Codec& codec, emu::EmulatedDevice& device, const emu::FaultConfig& down = {},
           const emu::FaultConfig& up = {})
      : codec_(codec), device_(device), down_(down), up_(up) {}

  void run_until(base::TimeUs t_end_us, const std::function<void(const base::Ping&)>& use) {
    for (; now_us_ < t_end_us; now_us_ += 1000) {
      std::uint8_t out[Codec::kMaxRequest_bytes];
      const std::size_t size = codec_.request(now_us_, out, sizeof out);
      Bytes heard;
      up_.pass(now_us_, Bytes(out, out + size), heard);
      device_.take(now_us_, heard.data(), heard.size());
      Bytes bytes;
      device_.advance(now_us_, bytes);
      Bytes arrived;
      down_.pass(now_us_, bytes, arrived);
      base::Ping ping{};
      for (const std::uint8_t byte : arrived) {
        if (codec_.feed(byte, now_us_, ping)) {
          do {
            use(ping);
          } while (codec_.next(ping));
        }
      }
    }
  }
  std::size_t count_until(base::TimeUs t_end_us) {
    std::size_t count = 0;
    run_until(t_end_us, [&count](const base::Ping&) { ++count; });
    return count;
  }
  [[nodiscard]] base::TimeUs now_us() const { return now_us_; }

 private:
  Codec& codec_;
  emu::EmulatedDevice& device_;
  emu::FaultyStream down_;
  emu::FaultyStream up_;
  base::TimeUs now_us_ = 0;
};

/// The samples that a head's codec has waiting.
template <typename Codec>
std::vector<base::NavSample> samples_of(Codec& codec) {
  std::vector<base::NavSample> samples;
  base::NavSample sample{};
  while (codec.take_sample(sample)) {
    samples.push_back(sample);
  }
  return samples;
}

/// Each byte of `frame` lost in turn, or changed, between two intact ones costs no more than its frame:
/// `make` gives a fresh codec, `records` is what one frame holds.
template <typename Make>
void check_damage_costs_one_frame(const Make& make, const Bytes& frame, std::size_t records) {
  for (std::size_t position = 0; position < frame.size(); ++position) {
    auto codec = make();
    assert_int_equal(records_of<base::Ping>(codec, without(frame, position) + frame + frame).size(),
                     2 * records);
    auto other = make();
    Bytes cut(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(position));
    assert_int_equal(records_of<base::Ping>(other, cut + frame + frame).size(), 2 * records);
  }
}

inline double degrees(base::Bam32 angle_bam32) {
  return static_cast<std::int32_t>(angle_bam32) * (360.0 / 4294967296.0);
}

}  // namespace leadline::test
