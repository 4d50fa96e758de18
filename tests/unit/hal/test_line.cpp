// Edges and levels of a single line, by what it stands for.
#include <string>
#include <vector>

#include "hal/attitude/line.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::NavKind;
using leadline::base::NavSample;
using leadline::hal::LineCodec;
using leadline::hal::LineConfig;
using leadline::hal::LineRole;

std::vector<NavSample> samples_of(LineCodec& codec, const std::string& bytes, std::int64_t t_us) {
  std::vector<NavSample> samples;
  NavSample sample{};
  for (const char byte : bytes) {
    if (codec.feed(static_cast<std::uint8_t>(byte), t_us, sample)) {
      samples.push_back(sample);
    }
  }
  return samples;
}

TEST(edges_that_count_are_pulses_and_levels_are_not) {
  for (const LineRole role : {LineRole::kPps, LineRole::kPingSync}) {
    for (const bool rising : {true, false}) {
      LineCodec codec(LineConfig{role, rising});
      const auto samples = samples_of(codec, "HRFRFRLx", 1'234);
      assert_int_equal(samples.size(), rising ? 3 : 2);
      for (const NavSample& sample : samples) {
        assert_int_equal(sample.fields, leadline::base::kNavPulse);
        assert_int_equal(sample.kind, NavKind::kLine);
        assert_int_equal(sample.t_us, 1'234);
      }
      assert_int_equal(codec.counters().frames, 7);
      assert_int_equal(codec.counters().ignored, rising ? 4 : 5);
      assert_int_equal(codec.counters().skipped_bytes, 1);
    }
  }
}

TEST(a_leak_is_a_level_from_the_first_byte_on) {
  for (const bool rising : {true, false}) {
    LineCodec codec(LineConfig{LineRole::kLeak, rising});
    const auto samples = samples_of(codec, "LRFHq", 0);
    assert_int_equal(samples.size(), 4);
    const bool high[] = {false, true, false, true};
    for (std::size_t i = 0; i < samples.size(); ++i) {
      assert_int_equal(samples[i].fields, leadline::base::kNavLeak);
      assert_int_equal(samples[i].leak, high[i] == rising ? 1 : 0);
    }
    assert_int_equal(codec.counters().records, 4);
  }
}

}  // namespace
