// Hours of a bad link in a minute: frames through a line that flips, loses, repeats and bursts, at rates
// from clean to hopeless. Whatever arrives is what was sent, in order; a clean stretch loses nothing.
#include <cstdio>
#include <deque>
#include <vector>

#include "proto/framing.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::proto::encode_frame;
using leadline::proto::frame_bound_bytes;
using leadline::proto::FrameDecoderBuffer;
using leadline::proto::FrameView;
using leadline::test::Random;

using Bytes = std::vector<std::uint8_t>;

/// Changes bytes on their way. `errors_per_million`: events per byte, of any of four kinds.
void transmit(Random& random, const Bytes& sent, std::int64_t errors_per_million, Bytes& received) {
  for (std::size_t i = 0; i < sent.size(); ++i) {
    if (random.between(1, 1'000'000) > errors_per_million) {
      received.push_back(sent[i]);
      continue;
    }
    switch (random.between(0, 3)) {
      case 0:  // one bit
        received.push_back(static_cast<std::uint8_t>(sent[i] ^ (1U << random.between(0, 7))));
        break;
      case 1:  // lost
        break;
      case 2:  // twice
        received.push_back(sent[i]);
        received.push_back(sent[i]);
        break;
      default:  // a burst of noise in its place
        for (std::int64_t k = random.between(1, 40); k > 0; --k) {
          received.push_back(static_cast<std::uint8_t>(random.next()));
        }
        break;
    }
  }
}

TEST(whatever_arrives_was_sent_in_order) {
  for (const std::int64_t errors_per_million : {0, 1, 10, 100, 1000, 10'000, 100'000}) {
    Random random(static_cast<std::uint64_t>(errors_per_million));
    FrameDecoderBuffer<1024> buffer;
    std::deque<Bytes> under_way;
    std::uint64_t sent_frames = 0;
    std::uint64_t delivered = 0;
    Bytes received;
    for (int frame_number = 0; frame_number < 2'000'000; ++frame_number) {
      Bytes payload(static_cast<std::size_t>(random.between(0, 400)));
      for (auto& byte : payload) {
        byte =
            random.between(0, 9) == 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(random.next());
      }
      Bytes frame(frame_bound_bytes(payload.size()));
      const auto size = encode_frame(payload.data(), payload.size(), frame.data(), frame.size());
      assert_true(size.ok());
      frame.resize(size.value());
      under_way.push_back(std::move(payload));
      ++sent_frames;

      received.clear();
      transmit(random, frame, errors_per_million, received);
      FrameView view{};
      for (const std::uint8_t byte : received) {
        if (!buffer.decoder().feed(byte, view)) {
          continue;
        }
        ++delivered;
        const Bytes got(view.payload, view.payload + view.payload_bytes);
        // Frames before it are lost, never late.
        while (!under_way.empty() && under_way.front() != got) {
          under_way.pop_front();
        }
        assert_true(!under_way.empty());
        under_way.pop_front();
      }
      // Nothing stays inside longer than the next frame's leading delimiter.
      while (under_way.size() > 2) {
        under_way.pop_front();
      }
    }
    std::printf("%7lld errors per million bytes: %llu of %llu frames\n",
                static_cast<long long>(errors_per_million),
                static_cast<unsigned long long>(delivered),
                static_cast<unsigned long long>(sent_frames));
    if (errors_per_million == 0) {
      assert_true(delivered == sent_frames);
    } else if (errors_per_million <= 100) {
      // About 200 bytes a frame: at 100 per million two frames in a hundred are hit.
      assert_true(delivered * 100 >= sent_frames * 95);
    }
  }
}

}  // namespace
