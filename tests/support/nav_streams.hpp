// What every codec of a navigation sensor must survive, whatever its protocol.
#pragma once

#include <vector>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"
#include "tests/support/device_bytes.hpp"

namespace leadline::test {

inline constexpr double kBamPerDegree = 4294967296.0 / 360.0;

/// -180 .. 180 degrees.
inline double degrees(std::uint32_t bam32) {
  return static_cast<std::int32_t>(bam32) / kBamPerDegree;
}
/// 0 .. 360 degrees.
inline double turn(std::uint32_t bam32) { return bam32 / kBamPerDegree; }

template <typename Codec>
std::vector<base::NavSample> samples_of(Codec& codec, const Bytes& bytes, std::int64_t t_us = 0) {
  return records_of<base::NavSample>(codec, bytes, t_us);
}

/// The one sample of `bytes` to a codec that has just been made.
template <typename Codec, typename Config>
base::NavSample only_sample(const Config& config, const Bytes& bytes, std::int64_t t_us = 0) {
  Codec codec(config);
  const auto samples = samples_of(codec, bytes, t_us);
  assert_int_equal(samples.size(), 1);
  return samples[0];
}

/// What becomes of `damaged` between intact frames; a pause and one byte more end what it began.
template <typename Codec, typename Config>
std::size_t records_around(const Config& config, const Bytes& before, const Bytes& damaged,
                           const Bytes& after) {
  Codec codec(config);
  std::size_t records = samples_of(codec, before, 0).size();
  records += samples_of(codec, damaged, 0).size();
  records += samples_of(codec, after, 0).size();
  records += samples_of(codec, Bytes{0}, 60'000'000).size();
  return records;
}

/// Deletes and changes every byte of `frame` in turn and cuts it everywhere, between two that are whole: those
/// always decode, the damaged one never more often than whole.
template <typename Codec, typename Config>
void check_damage_costs_one_frame(const Config& config, const Bytes& frame) {
  Codec fresh(config);
  const std::size_t each = samples_of(fresh, frame).size();
  assert_true(each > 0);
  const auto check = [&](const Bytes& damaged, std::size_t position) {
    const std::size_t records = records_around<Codec>(config, frame, damaged, frame + frame);
    if (records < 3 * each || records > 4 * each) {
      fail_msg("byte %zu: %zu records of %zu", position, records, 4 * each);
    }
  };
  for (std::size_t i = 0; i < frame.size(); ++i) {
    check(without(frame, i), i);
    check(Bytes(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(i)), i);
    for (const unsigned flip : {0x01U, 0x10U, 0x80U}) {
      Bytes changed = frame;
      changed[i] = static_cast<std::uint8_t>(changed[i] ^ flip);
      check(changed, i);
    }
  }
}

/// As above for protocols with a checksum: no damaged frame makes a record at all.
template <typename Codec, typename Config>
void check_damage_is_noticed(const Config& config, const Bytes& frame) {
  for (std::size_t i = 0; i < frame.size(); ++i) {
    Bytes changed = frame;
    changed[i] ^= 0x04U;
    Codec codec(config);
    const std::size_t records =
        samples_of(codec, changed).size() + samples_of(codec, Bytes{0}, 60'000'000).size();
    if (records != 0) {
      fail_msg("byte %zu changed and nobody noticed", i);
    }
  }
}

/// Noise around frames: as many records as without it, and each byte is in exactly one place of the books.
template <typename Codec, typename Config>
void check_noise(const Config& config, const Bytes& frame) {
  Codec fresh(config);
  const std::size_t each = samples_of(fresh, frame).size();
  Random random(17);
  for (int round = 0; round < 50; ++round) {
    Codec codec(config);
    std::size_t records = 0;
    std::int64_t t_us = 0;
    for (int i = 0; i < 4; ++i) {
      records += samples_of(codec, random_bytes(random, 40), t_us).size();
      t_us += 10'000'000;  // noise, silence, frame
      records += samples_of(codec, frame, t_us).size();
    }
    records += samples_of(codec, Bytes{0}, t_us + 60'000'000).size();
    assert_true(records >= 4 * each);
    assert_int_equal(codec.counters().records, records);
  }
}

}  // namespace leadline::test
