#include "hal/attitude/keller.hpp"
#include "hal/emu/keller_sensor.hpp"
#include "hal/emu/wire_bytes.hpp"
#include "tests/support/nav_streams.hpp"

namespace {

using leadline::base::NavKind;
using leadline::base::NavSample;
using leadline::emu::ByteOrder;
using leadline::emu::ByteWriter;
using leadline::emu::keller_sealed;
using leadline::emu::KellerSensor;
using leadline::emu::KellerSensorConfig;
using leadline::emu::KellerTruth;
using leadline::emu::modbus_sealed;
using leadline::hal::KellerBus;
using leadline::hal::KellerCodec;
using leadline::hal::KellerConfig;
using leadline::test::Bytes;
using leadline::test::from_hex;
using leadline::test::only_sample;
using leadline::test::samples_of;
using leadline::test::operator+;

constexpr std::uint32_t kBoth = leadline::base::kNavPressure | leadline::base::kNavTemperature;

Bytes block(double bar, double degc, unsigned address = 1) {
  ByteWriter body(ByteOrder::kBig);
  body.u8(address).u8(3).u8(8).f32(bar).f32(degc);
  return modbus_sealed(body.bytes());
}

Bytes channel(double value, unsigned status = 0) {
  ByteWriter body(ByteOrder::kBig);
  body.u8(1).u8(73).f32(value).u8(status);
  return keller_sealed(body.bytes());
}

KellerConfig keller_bus() {
  KellerConfig config;
  config.bus = KellerBus::kKellerBus;
  return config;
}

Bytes request_of(KellerCodec& codec, std::int64_t t_us) {
  Bytes out(KellerCodec::kMaxRequest_bytes);
  out.resize(codec.request(t_us, out.data(), out.size()));
  return out;
}

/// Codec and sensor on one line for a second, in steps of a millisecond.
std::vector<NavSample> talk(KellerCodec& codec, KellerSensor& sensor, std::int64_t from_us = 0) {
  std::vector<NavSample> samples;
  for (std::int64_t t_us = from_us; t_us < from_us + 1'000'000; t_us += 1000) {
    const Bytes request = request_of(codec, t_us);
    sensor.take(t_us, request.data(), request.size());
    Bytes answer;
    sensor.advance(t_us, answer);
    for (const NavSample& sample : samples_of(codec, answer, t_us)) {
      samples.push_back(sample);
    }
  }
  return samples;
}

KellerTruth deep(leadline::base::TimeUs /*t_us*/) { return {3.5, 7.25}; }

}  // namespace

// devices.md 5.7, MADE.
TEST(made_requests) {
  KellerCodec codec(KellerConfig{});
  assert_true(request_of(codec, 0) == from_hex("01 03 01 00 00 04 45 f5"));
  KellerConfig single;
  single.pressure_only = true;
  KellerCodec one(single);
  assert_true(request_of(one, 0) == from_hex("01 03 00 02 00 02 65 cb"));
  KellerConfig all = keller_bus();
  all.address = 250;
  KellerCodec start(all);
  assert_true(request_of(start, 0) == from_hex("fa 30 04 43"));
}

TEST(made_requests_of_the_maker_s_bus) {
  KellerCodec codec(keller_bus());
  (void)request_of(codec, 0);
  assert_int_equal(samples_of(codec, keller_sealed(from_hex("01 30 05 14 0d 21 0a 01"))).size(), 0);
  assert_true(request_of(codec, 200'000) == from_hex("01 49 01 50 d6"));
  assert_true(keller_sealed(from_hex("fa 49 01")) == from_hex("fa 49 01 a1 a7"));
}

TEST(answers_become_pressure_and_temperature) {
  const NavSample sample = only_sample<KellerCodec>(KellerConfig{}, block(1.01325, -1.5), 7000);
  assert_int_equal(sample.kind, NavKind::kPressure);
  assert_int_equal(sample.fields, kBoth);
  assert_int_equal(sample.pressure_pa, 101'325);
  assert_int_equal(sample.temperature_mdegc, -1500);
  assert_int_equal(sample.t_us, 7000);
  KellerConfig config;
  config.gauge_pressure = true;
  config.byte_time_ns = 1'041'667;
  const NavSample gauge = only_sample<KellerCodec>(config, block(2.5, 10), 1'000'000);
  assert_int_equal(gauge.pressure_pa, 351'325);
  assert_int_equal(gauge.t_us, 1'000'000 - 13 * 1'041'667 / 1000);
  ByteWriter single(ByteOrder::kBig);
  single.u8(1).u8(3).u8(4).f32(12.5);
  const NavSample pressure =
      only_sample<KellerCodec>(KellerConfig{}, modbus_sealed(single.bytes()));
  assert_int_equal(pressure.fields, leadline::base::kNavPressure);
  assert_int_equal(pressure.pressure_pa, 1'250'000);
}

TEST(no_garbage_passes) {
  const double nan = std::nan("");
  for (const double bar : {nan, -3.0, 1e9, -1e30, static_cast<double>(INFINITY)}) {
    const NavSample sample = only_sample<KellerCodec>(KellerConfig{}, block(bar, 10));
    assert_int_equal(sample.fields, leadline::base::kNavTemperature);
    assert_int_equal(sample.pressure_pa, 0);
    assert_int_equal(sample.kind, NavKind::kPressure);
  }
  for (const double degc : {nan, -51.0, 151.0, static_cast<double>(-INFINITY)}) {
    const NavSample sample = only_sample<KellerCodec>(KellerConfig{}, block(1, degc));
    assert_int_equal(sample.fields, leadline::base::kNavPressure);
  }
  assert_int_equal(only_sample<KellerCodec>(KellerConfig{}, block(nan, nan)).fields, 0);
  assert_int_equal(only_sample<KellerCodec>(keller_bus(), channel(1.0, 2)).fields, 0);
  assert_int_equal(only_sample<KellerCodec>(keller_bus(), channel(nan)).fields, 0);
}

TEST(damage_costs_one_frame) {
  leadline::test::check_damage_costs_one_frame<KellerCodec>(KellerConfig{}, block(1.5, 10));
  leadline::test::check_damage_is_noticed<KellerCodec>(KellerConfig{}, block(1.5, 10));
  leadline::test::check_noise<KellerCodec>(KellerConfig{}, block(1.5, 10));
  leadline::test::check_damage_costs_one_frame<KellerCodec>(keller_bus(), channel(1.5));
  leadline::test::check_damage_is_noticed<KellerCodec>(keller_bus(), channel(1.5));
  leadline::test::check_noise<KellerCodec>(keller_bus(), channel(1.5));
}

TEST(a_sensor_is_polled) {
  KellerCodec codec(KellerConfig{});
  KellerSensor sensor({}, deep);
  const auto samples = talk(codec, sensor);
  assert_int_equal(samples.size(), 10);  // every 100 ms
  for (const NavSample& sample : samples) {
    assert_int_equal(sample.pressure_pa, 350'000);
    assert_int_equal(sample.temperature_mdegc, 7250);
  }
  assert_int_equal(codec.counters().timeouts, 0);
}

TEST(a_sensor_on_the_maker_s_bus_is_started_and_polled) {
  KellerCodec codec(keller_bus());
  KellerSensor sensor({}, deep);
  const auto samples = talk(codec, sensor);
  assert_int_equal(samples.size(), 9);
  assert_int_equal(samples[0].pressure_pa, 350'000);
  assert_int_equal(samples[0].kind, NavKind::kPressure);
  assert_int_equal(samples[1].temperature_mdegc, 7250);
  assert_int_equal(samples[1].kind, NavKind::kWater);
  assert_int_equal(samples[2].fields, leadline::base::kNavPressure);
  sensor.reboot();
  const auto again = talk(codec, sensor, 1'000'000);
  assert_int_equal(again.size(), 8);  // a refusal and another start
  assert_int_equal(codec.counters().nacks, 1);
  KellerConfig pressure = keller_bus();
  pressure.pressure_only = true;
  KellerCodec one(pressure);
  for (const NavSample& sample : talk(one, sensor, 2'000'000)) {
    assert_int_equal(sample.fields, leadline::base::kNavPressure);
  }
}

TEST(a_line_that_echoes_is_no_matter) {
  for (const KellerConfig& config : {KellerConfig{}, keller_bus()}) {
    KellerSensorConfig line;
    line.echo = true;
    KellerSensor sensor(line, deep);
    KellerCodec codec(config);
    const auto samples = talk(codec, sensor);
    assert_true(samples.size() >= 9);
    assert_true(codec.counters().ignored >= 9);
    assert_int_equal(leadline::hal::rejected(codec.counters()), 0);
  }
}

TEST(silence_is_waited_for_and_counted) {
  KellerSensor sensor({}, deep);
  sensor.set_silent(true);
  KellerCodec codec(KellerConfig{});
  assert_int_equal(talk(codec, sensor).size(), 0);
  assert_int_equal(codec.counters().timeouts, 3);  // of 300 ms
  sensor.set_silent(false);
  assert_true(talk(codec, sensor, 1'000'000).size() >= 8);
  // Time that goes back does not stretch the wait.
  assert_true(!request_of(codec, 100).empty() || !request_of(codec, 400'000).empty());
}

TEST(refusals_and_other_addresses_are_counted) {
  KellerCodec codec(KellerConfig{});
  assert_int_equal(samples_of(codec, modbus_sealed(from_hex("01 83 02"))).size(), 0);
  assert_int_equal(codec.counters().nacks, 1);
  assert_int_equal(samples_of(codec, block(1, 1, 9)).size(), 0);
  assert_int_equal(codec.counters().wrong_device, 1);
  // Six registers: somebody else's question was answered.
  assert_int_equal(
      samples_of(codec, modbus_sealed(from_hex("01 03 0c 00 00 00 00 00 00 00 00 00 00 00 00")))
          .size(),
      0);
  assert_int_equal(codec.counters().ignored, 1);
  std::uint8_t small[4];
  assert_int_equal(codec.request(0, small, sizeof small), 0);
  KellerCodec bus(keller_bus());
  assert_int_equal(samples_of(bus, keller_sealed(from_hex("01 49 02"))).size(), 0);
  assert_int_equal(samples_of(bus, channel(1.0)).size(), 0);  // of channel 2
  assert_int_equal(bus.counters().ignored, 2);
  bus.restart();
  assert_int_equal(samples_of(bus, channel(1.0)).size(), 1);
}

// What decoding a file asks: both buses, whoever speaks, and no word of our own.
TEST(a_recording_of_either_bus_is_heard) {
  KellerConfig config;
  config.bus = KellerBus::kEither;
  config.address = 0;
  KellerCodec codec(config);
  assert_true(request_of(codec, 0).empty());
  const Bytes both = block(1.25, 10, 7) + channel(1.5) + block(1.75, 10, 250);
  const std::vector<NavSample> samples = samples_of(codec, both);
  assert_int_equal(samples.size(), 3);
  assert_int_equal(samples[0].pressure_pa, 125'000);
  assert_int_equal(samples[1].pressure_pa, 150'000);
  assert_int_equal(samples[2].pressure_pa, 175'000);
  assert_int_equal(codec.counters().wrong_device, 0);
  leadline::test::check_damage_costs_one_frame<KellerCodec>(config, block(1.5, 10));
  leadline::test::check_damage_costs_one_frame<KellerCodec>(config, channel(1.5));
}
