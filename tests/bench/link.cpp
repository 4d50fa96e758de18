// What framing costs: encoding and decoding of one payload, in bytes of payload per second.
#include <cstdint>
#include <vector>

#include <benchmark/benchmark.h>

#include "proto/framing.hpp"

namespace {

using leadline::proto::encode_frame;
using leadline::proto::frame_bound_bytes;
using leadline::proto::FrameDecoderBuffer;
using leadline::proto::FrameView;

/// A payload with a zero every 32 bytes or so, as small integers in records have.
std::vector<std::uint8_t> payload_of(std::size_t size) {
  std::vector<std::uint8_t> payload(size);
  std::uint32_t state = 1;
  for (auto& byte : payload) {
    state = state * 1664525U + 1013904223U;
    byte = static_cast<std::uint8_t>((state >> 24U) < 8U ? 0U : state >> 24U);
  }
  return payload;
}

void encode(benchmark::State& state) {
  const auto payload = payload_of(static_cast<std::size_t>(state.range(0)));
  std::vector<std::uint8_t> frame(frame_bound_bytes(payload.size()));
  for (auto step : state) {
    static_cast<void>(step);
    auto size = encode_frame(payload.data(), payload.size(), frame.data(), frame.size());
    benchmark::DoNotOptimize(size);
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(state.iterations() * state.range(0));
}
BENCHMARK(encode)->Arg(64)->Arg(1024)->Arg(4096);

void decode(benchmark::State& state) {
  const auto payload = payload_of(static_cast<std::size_t>(state.range(0)));
  std::vector<std::uint8_t> frame(frame_bound_bytes(payload.size()));
  const auto size = encode_frame(payload.data(), payload.size(), frame.data(), frame.size());
  FrameDecoderBuffer<> buffer;
  for (auto step : state) {
    static_cast<void>(step);
    FrameView view{};
    std::size_t used = 0;
    bool complete = buffer.decoder().feed(frame.data(), size.value(), used, view);
    benchmark::DoNotOptimize(complete);
  }
  if (buffer.decoder().counters().frames != static_cast<std::uint32_t>(state.iterations())) {
    state.SkipWithError("a frame was not decoded");
  }
  state.SetBytesProcessed(state.iterations() * state.range(0));
}
BENCHMARK(decode)->Arg(64)->Arg(1024)->Arg(4096);

}  // namespace

BENCHMARK_MAIN();
