// Every driver behind a port: made from every combination of its options, it lives on anything that comes in.
#include "firmware/pipeline/device_port.hpp"
#include "firmware/pipeline/driver_codecs.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::DevicePort;
using leadline::firmware::DeviceRecord;
using leadline::firmware::Driver;
using leadline::firmware::DriverInfo;
using leadline::firmware::is_head;
using leadline::firmware::kDrivers;
using leadline::firmware::PortConfig;
using leadline::firmware::RecordKind;
using leadline::test::Random;

DevicePort port;

PortConfig config_of(Driver driver, Random& random) {
  PortConfig config{};
  config.driver = driver;
  config.mount = 2;
  config.switches = static_cast<std::uint16_t>(random.next());
  config.min_range_um = 500'000;
  config.max_range_um = 30'000'000;
  config.ping_interval_us = static_cast<std::int32_t>(random.between(0, 200'000));
  config.scan_last_grad = 399;
  config.scan_step_grad = 1;
  config.profile = static_cast<std::int32_t>(random.between(0, 1));
  config.gain_plus_1 = static_cast<std::int32_t>(random.between(0, 3));
  config.address = static_cast<std::int32_t>(random.between(0, 2));
  config.variant_plus_1 = static_cast<std::int32_t>(random.between(0, 5));
  return config;
}

// Feeds bytes as they come and takes everything that they complete.
int feed(TimeUs t_us, const std::uint8_t* bytes, std::size_t size_bytes, bool head) {
  int records = 0;
  DeviceRecord record{};
  for (std::size_t i = 0; i < size_bytes; ++i) {
    for (RecordKind kind = port.feed(bytes[i], t_us, record); kind != RecordKind::kNone;
         kind = port.next(record)) {
      assert_true(head || kind == RecordKind::kSample);
      assert_true(kind != RecordKind::kPing || record.ping.mount == 2);
      ++records;
    }
  }
  return records;
}

TEST(every_driver_with_every_option_lives_on_noise) {
  Random random(17);
  std::uint8_t bytes[512];
  std::uint8_t request[256];
  for (const DriverInfo& info : kDrivers) {
    for (int run = 0; run < 40; ++run) {
      port.configure(config_of(info.driver, random), {1'480'000});
      assert_int_equal(port.driver(), info.driver);
      for (TimeUs t = 0; t < 4'000'000; t += 250'000) {
        assert_true(port.request(t, request, sizeof(request)) <= sizeof(request));
        for (std::uint8_t& byte : bytes) {
          byte = static_cast<std::uint8_t>(random.next());
        }
        static_cast<void>(feed(t, bytes, sizeof(bytes), is_head(info.driver)));
      }
      port.restart();
    }
  }
}

TEST(every_driver_decodes_files) {
  for (const DriverInfo& info : kDrivers) {
    assert_true(port.configure_decoding(info.driver));
    assert_int_equal(port.driver(), info.driver);
    const std::uint8_t silence[64] = {};
    assert_int_equal(feed(0, silence, sizeof(silence), is_head(info.driver)), 0);
    assert_int_equal(port.counters().records, 0);
  }
}

}  // namespace
