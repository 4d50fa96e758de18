// The emulators themselves: bad lines are repeatable, and what a device refuses they refuse.
#include "hal/emu/emulated_ping1d.hpp"
#include "hal/emu/emulated_ping360.hpp"
#include "hal/emu/faulty_stream.hpp"
#include "hal/heads/ping1d.hpp"
#include "hal/heads/ping360.hpp"
#include "tests/support/device_bytes.hpp"
#include "tests/support/ping_line.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::emu::EmulatedDevice;
using leadline::emu::EmulatedPing1d;
using leadline::emu::EmulatedPing360;
using leadline::emu::FaultConfig;
using leadline::emu::FaultyStream;
using leadline::test::Bytes;
using leadline::test::Random;
using leadline::test::sinking;
using leadline::test::wall;

constexpr TimeUs kSecond_us = 1'000'000;

TEST(faulty_stream_is_repeatable_and_accounts_for_every_byte) {
  FaultConfig config;
  config.seed = 9;
  config.drop_ppm = 50'000;
  config.corrupt_ppm = 50'000;
  config.repeat_ppm = 50'000;
  config.truncate_ppm = 20'000;
  config.delay_ppm = 20'000;
  config.delay_us = 5000;
  config.disconnect_at_byte = 60'000;
  const auto run = [&config](leadline::emu::FaultCounters& counters) {
    FaultyStream stream(config);
    Random random(11);
    Bytes out;
    for (TimeUs t_us = 0; t_us < kSecond_us; t_us += 1000) {
      stream.pass(t_us, leadline::test::random_bytes(random, 70), out);
    }
    assert_false(stream.connected());
    stream.reconnect();
    assert_true(stream.connected());
    stream.pass(2 * kSecond_us, Bytes(100, 1), out);
    while (stream.next_event_us() != leadline::emu::kNever_us) {
      stream.pass(stream.next_event_us(), {}, out);
    }
    counters = stream.counters();
    return out;
  };
  leadline::emu::FaultCounters a{};
  leadline::emu::FaultCounters b{};
  const Bytes first = run(a);
  assert_true(first == run(b));
  assert_int_equal(a.bytes_in, 70'100);
  assert_int_equal(a.bytes_out, first.size());
  assert_int_equal(a.disconnects, 1);
  assert_int_equal(a.bytes_in + a.repeated,
                   a.bytes_out + a.dropped + a.truncated + a.lost_unplugged);
  assert_true(a.dropped > 100 && a.corrupted > 100 && a.repeated > 100 && a.truncated > 100 &&
              a.delays > 100 && a.lost_unplugged > 100);
}

TEST(emulators_refuse_what_the_devices_refuse) {
  const auto answer = [](EmulatedDevice& device, unsigned id, const Bytes& payload) {
    const Bytes frame = leadline::emu::ping_frame(id, 0, 0, payload);
    device.take(0, frame.data(), frame.size());
    Bytes out;
    device.advance(0, out);
    return out.empty() ? 0U : leadline::emu::payload_u16(out, 4);
  };
  using leadline::emu::PayloadWriter;
  EmulatedPing1d ping1d({}, sinking);
  assert_int_equal(answer(ping1d, 1001, PayloadWriter().u32(0).u32(5000).payload()),
                   2);  // automatic
  assert_int_equal(answer(ping1d, 1003, PayloadWriter().u8(0).payload()), 1);
  assert_int_equal(answer(ping1d, 1001, PayloadWriter().u32(0).u32(5000).payload()), 1);
  assert_int_equal(answer(ping1d, 1001, PayloadWriter().u32(0).u32(999).payload()), 2);
  assert_int_equal(answer(ping1d, 1002, PayloadWriter().u32(0).payload()), 2);
  assert_int_equal(answer(ping1d, 1005, PayloadWriter().u8(7).payload()), 2);
  assert_int_equal(answer(ping1d, 1004, PayloadWriter().u8(7).payload()), 2);  // too short
  assert_int_equal(answer(ping1d, 1400, PayloadWriter().u16(1212).payload()), 2);
  assert_int_equal(answer(ping1d, 6, PayloadWriter().u16(9999).payload()), 2);
  assert_int_equal(answer(ping1d, 6, PayloadWriter().u8(5).payload()), 2);
  assert_int_equal(answer(ping1d, 5, {}), 5);  // as old hosts ask
  assert_int_equal(answer(ping1d, 1208, {}), 1208);
  assert_int_equal(answer(ping1d, 1006, PayloadWriter().u8(0).payload()), 1);
  assert_int_equal(answer(ping1d, 1006, PayloadWriter().u8(1).payload()), 1);
  assert_int_equal(answer(ping1d, 77, Bytes(3)), 2);
  Bytes later;
  const Bytes simple = leadline::emu::ping_frame(6, 0, 0, PayloadWriter().u16(1211).payload());
  ping1d.take(50'000, simple.data(), simple.size());
  ping1d.advance(50'000, later);
  assert_int_equal(leadline::emu::payload_u16(later, 4), 1211);

  EmulatedPing360 ping360({}, wall);
  const auto beam = [](unsigned angle, unsigned samples) {
    return PayloadWriter()
        .u8(1)
        .u8(0)
        .u16(angle)
        .u16(32)
        .u16(88)
        .u16(750)
        .u16(samples)
        .u8(1)
        .u8(0)
        .payload();
  };
  assert_int_equal(answer(ping360, 2601, beam(400, 1200)), 2);
  assert_int_equal(answer(ping360, 2601, beam(0, 199)), 2);
  assert_int_equal(answer(ping360, 6, PayloadWriter().u16(2300).payload()), 2300);
  assert_int_equal(answer(ping360, 6, PayloadWriter().u16(1212).payload()), 2);
  assert_int_equal(answer(ping360, 2601, beam(100, 1200)), 0);  // on its way
  assert_int_equal(answer(ping360, 2601, beam(200, 1200)), 0);
  assert_int_equal(ping360.missed(), 1);
  assert_int_equal(answer(ping360, 2903, {}), 1);
  assert_int_equal(answer(ping360, 2602, Bytes(16)), 2);
  assert_int_equal(answer(ping360, 2600, PayloadWriter().u8(0).u8(0).payload()), 0);
  assert_int_equal(answer(ping360, 5, {}), 0);  // booting
}

}  // namespace
