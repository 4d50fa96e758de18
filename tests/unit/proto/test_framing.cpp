#include <vector>

#include "model/base/crc32c.hpp"
#include "proto/framing.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Status;
using leadline::proto::encode_frame;
using leadline::proto::frame_bound_bytes;
using leadline::proto::FrameCounters;
using leadline::proto::FrameDecoder;
using leadline::proto::FrameDecoderBuffer;
using leadline::proto::FrameView;
using leadline::proto::kMaxPayload_bytes;
using leadline::test::Random;

using Bytes = std::vector<std::uint8_t>;

Bytes encoded(const Bytes& payload) {
  Bytes frame(frame_bound_bytes(payload.size()));
  const auto size = encode_frame(payload.data(), payload.size(), frame.data(), frame.size());
  assert_true(size.ok());
  frame.resize(size.value());
  return frame;
}

/// Everything the decoder delivers for `link`.
std::vector<Bytes> decoded(FrameDecoder& decoder, const Bytes& link) {
  std::vector<Bytes> payloads;
  FrameView view{};
  for (const std::uint8_t byte : link) {
    if (decoder.feed(byte, view)) {
      payloads.emplace_back(view.payload, view.payload + view.payload_bytes);
    }
  }
  return payloads;
}

/// COBS from its definition, block by block, slowly.
Bytes reference_cobs(const Bytes& raw) {
  Bytes with_zero = raw;
  with_zero.push_back(0);
  Bytes out;
  std::size_t i = 0;
  while (i < with_zero.size()) {
    std::size_t run = 0;
    while (run < 254 && with_zero[i + run] != 0) {
      ++run;
    }
    out.push_back(static_cast<std::uint8_t>(run + 1));
    for (std::size_t k = 0; k < run; ++k) {
      out.push_back(with_zero[i + k]);
    }
    i += run < 254 ? run + 1 : run;
    if (run == 254 && i + 1 == with_zero.size()) {
      break;  // only the appended zero is left, and a full block stands without one
    }
  }
  return out;
}

Bytes with_crc(Bytes payload) {
  const std::uint32_t crc = leadline::base::crc32c(payload.data(), payload.size());
  for (unsigned i = 0; i < 4; ++i) {
    payload.push_back(static_cast<std::uint8_t>(crc >> (8 * i)));
  }
  return payload;
}

Bytes random_payload(Random& random, std::size_t size) {
  // Zeros often, rarely or never, so that blocks of all lengths occur.
  const std::int64_t zero_one_in = random.between(0, 2) == 0 ? 3 : random.between(100, 2000);
  Bytes payload(size);
  for (auto& byte : payload) {
    byte = random.between(1, zero_one_in) == 1 ? std::uint8_t{0}
                                               : static_cast<std::uint8_t>(random.between(1, 255));
  }
  return payload;
}

std::uint32_t errors(const FrameCounters& counters) {
  return counters.bad_crc + counters.bad_code + counters.too_short + counters.too_long;
}

/// The table of proto/SPEC.md, byte by byte.
TEST(vectors_of_the_specification) {
  const Bytes none = {0x00, 0x01, 0x01, 0x01, 0x01, 0x01, 0x00};
  const Bytes zero = {0x00, 0x01, 0x05, 0x51, 0x53, 0x7D, 0x52, 0x00};
  const Bytes digits = {0x00, 0x0E, '1', '2',  '3',  '4',  '5',  '6',
                        '7',  '8',  '9', 0x83, 0x92, 0x06, 0xE3, 0x00};
  assert_true(encoded({}) == none);
  assert_true(encoded({0}) == zero);
  assert_true(encoded({'1', '2', '3', '4', '5', '6', '7', '8', '9'}) == digits);
}

TEST(encoder_equals_the_definition_at_every_size_around_a_block) {
  Random random(1);
  for (std::size_t size = 0; size < 1100; ++size) {
    for (const bool zeros : {false, true}) {
      Bytes payload(size, 0x55);
      if (zeros) {
        payload = random_payload(random, size);
      }
      const Bytes frame = encoded(payload);
      const Bytes body(frame.begin() + 1, frame.end() - 1);
      assert_true(frame.front() == 0 && frame.back() == 0);
      assert_true(body == reference_cobs(with_crc(payload)));
      assert_true(frame.size() <= frame_bound_bytes(size));
    }
  }
}

TEST(round_trip_of_random_payloads_up_to_the_largest) {
  Random random(2);
  FrameDecoderBuffer<> buffer;
  std::uint32_t sent = 0;
  for (int round = 0; round < 400; ++round) {
    const std::size_t size = round < 2
                                 ? kMaxPayload_bytes - static_cast<std::size_t>(round)
                                 : static_cast<std::size_t>(random.between(0, kMaxPayload_bytes));
    const Bytes payload = random_payload(random, size);
    const auto got = decoded(buffer.decoder(), encoded(payload));
    assert_int_equal(got.size(), 1);
    assert_true(got[0] == payload);
    ++sent;
  }
  assert_int_equal(buffer.decoder().counters().frames, sent);
  assert_int_equal(errors(buffer.decoder().counters()), 0);
  assert_int_equal(buffer.decoder().counters().dropped_bytes, 0);
}

TEST(encoder_refuses_what_does_not_fit) {
  Bytes payload(kMaxPayload_bytes + 1, 1);
  Bytes frame(frame_bound_bytes(payload.size()));
  assert_int_equal(
      encode_frame(payload.data(), payload.size(), frame.data(), frame.size()).status(),
      Status::kOutOfRange);
  frame.assign(frame_bound_bytes(10) - 1, 0xAA);
  assert_int_equal(encode_frame(payload.data(), 10, frame.data(), frame.size()).status(),
                   Status::kFull);
  for (const auto byte : frame) {
    assert_int_equal(byte, 0xAA);
  }
}

TEST(both_forms_of_a_final_full_block_are_accepted) {
  // 250 bytes and the CRC fill one block when neither has a zero.
  Bytes payload(250, 1);
  for (std::uint8_t last = 1; last != 0; ++last) {
    payload.back() = last;
    const Bytes raw = with_crc(payload);
    bool has_zero = false;
    for (const auto byte : raw) {
      has_zero = has_zero || byte == 0;
    }
    if (has_zero) {
      continue;
    }
    Bytes frame = encoded(payload);
    assert_int_equal(frame.size(), 1 + 255 + 1);
    FrameDecoderBuffer<> buffer;
    assert_int_equal(decoded(buffer.decoder(), frame).size(), 1);
    frame.insert(frame.end() - 1, 0x01);
    const auto got = decoded(buffer.decoder(), frame);
    assert_int_equal(got.size(), 1);
    assert_true(got[0] == payload);
    return;
  }
  fail_msg("no payload without zeros found");
}

/// Damage one frame in every way at every byte: the frames around it arrive, it does not.
TEST(every_byte_deleted_changed_or_added_costs_one_frame_at_most) {
  Random random(3);
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{1}, std::size_t{40}, std::size_t{600}}) {
    const Bytes before = random_payload(random, 30);
    const Bytes victim = random_payload(random, size);
    const Bytes behind = random_payload(random, 50);
    const Bytes first = encoded(before);
    const Bytes middle = encoded(victim);
    const Bytes last = encoded(behind);
    for (std::size_t at = 0; at < middle.size(); ++at) {
      // 0: deleted. 1..8: one bit flipped. 9: set to the delimiter. 10: a byte added in front.
      for (int way = 0; way <= 10; ++way) {
        Bytes damaged = middle;
        const auto where = damaged.begin() + static_cast<std::ptrdiff_t>(at);
        if (way == 0) {
          damaged.erase(where);
        } else if (way <= 8) {
          *where = static_cast<std::uint8_t>(*where ^ (1U << static_cast<unsigned>(way - 1)));
        } else if (way == 9) {
          *where = 0;
        } else {
          damaged.insert(where, static_cast<std::uint8_t>(random.between(1, 255)));
        }
        Bytes link = first;
        link.insert(link.end(), damaged.begin(), damaged.end());
        link.insert(link.end(), last.begin(), last.end());
        FrameDecoderBuffer<> buffer;
        const auto got = decoded(buffer.decoder(), link);
        assert_true(got.size() == 2 || got.size() == 3);
        assert_true(got.front() == before);
        assert_true(got.back() == behind);
        if (got.size() == 3) {
          assert_true(got[1] == victim);  // the damage was to a delimiter of two
        }
        // Each dropped frame moved a counter; damage to a spare delimiter need not drop any.
        const auto& counters = buffer.decoder().counters();
        assert_int_equal(counters.frames, got.size());
        if (got.size() == 2) {
          assert_true(errors(counters) >= 1);
          assert_true(counters.dropped_bytes >= 1 || middle.size() <= 8);
        }
      }
    }
  }
}

TEST(garbage_before_between_and_behind_frames) {
  Random random(4);
  FrameDecoderBuffer<> buffer;
  Bytes link;
  std::vector<Bytes> sent;
  for (int round = 0; round < 300; ++round) {
    const auto noise = random.between(0, 300);
    for (std::int64_t i = 0; i < noise; ++i) {
      link.push_back(static_cast<std::uint8_t>(random.next()));
    }
    sent.push_back(random_payload(random, static_cast<std::size_t>(random.between(0, 700))));
    const Bytes frame = encoded(sent.back());
    link.insert(link.end(), frame.begin(), frame.end());
  }
  const auto got = decoded(buffer.decoder(), link);
  assert_true(got == sent);
  assert_true(errors(buffer.decoder().counters()) > 0);
}

TEST(block_feed_equals_byte_feed_for_any_cut) {
  Random random(5);
  Bytes link;
  std::vector<Bytes> sent;
  for (int i = 0; i < 50; ++i) {
    sent.push_back(random_payload(random, static_cast<std::size_t>(random.between(0, 300))));
    const Bytes frame = encoded(sent.back());
    link.insert(link.end(), frame.begin(), frame.end());
  }
  FrameDecoderBuffer<300> buffer;
  std::vector<Bytes> got;
  std::size_t at = 0;
  while (at < link.size()) {
    std::size_t size = static_cast<std::size_t>(random.between(1, 400));
    size = size < link.size() - at ? size : link.size() - at;
    std::size_t done = 0;
    while (done < size) {
      FrameView view{};
      std::size_t used = 0;
      if (buffer.decoder().feed(link.data() + at + done, size - done, used, view)) {
        got.emplace_back(view.payload, view.payload + view.payload_bytes);
      }
      assert_in_range(used, 1, size - done);
      done += used;
    }
    at += size;
  }
  assert_true(got == sent);
}

TEST(each_fault_moves_its_own_counter) {
  FrameDecoderBuffer<16> buffer;
  auto& decoder = buffer.decoder();
  // Three bytes are no CRC.
  assert_int_equal(decoded(decoder, {0x04, 1, 2, 3, 0x00}).size(), 0);
  assert_int_equal(decoder.counters().too_short, 1);
  assert_int_equal(decoder.counters().dropped_bytes, 4);
  // A code that points behind the delimiter.
  assert_int_equal(decoded(decoder, {0x09, 1, 2, 3, 4, 5, 0x00}).size(), 0);
  assert_int_equal(decoder.counters().bad_code, 1);
  assert_int_equal(decoder.counters().dropped_bytes, 10);
  // A CRC that does not match.
  assert_int_equal(decoded(decoder, {0x05, 1, 2, 3, 4, 0x00}).size(), 0);
  assert_int_equal(decoder.counters().bad_crc, 1);
  // One byte more than there is room for; exactly full is fine.
  assert_int_equal(decoded(decoder, encoded(Bytes(17, 9))).size(), 0);
  assert_int_equal(decoder.counters().too_long, 1);
  assert_int_equal(decoded(decoder, encoded(Bytes(16, 9))).size(), 1);
  // An idle link is no fault.
  assert_int_equal(decoded(decoder, Bytes(100, 0)).size(), 0);
  assert_int_equal(errors(decoder.counters()), 4);
}

TEST(reset_forgets_the_frame_under_way_only) {
  FrameDecoderBuffer<> buffer;
  auto& decoder = buffer.decoder();
  const Bytes frame = encoded({1, 2, 3, 4, 5});
  const Bytes half(frame.begin(), frame.begin() + 4);
  assert_int_equal(decoded(decoder, half).size(), 0);
  decoder.reset();
  assert_int_equal(decoded(decoder, frame).size(), 1);
  assert_int_equal(errors(decoder.counters()), 0);
  assert_int_equal(decoder.counters().frames, 1);
}

}  // namespace
