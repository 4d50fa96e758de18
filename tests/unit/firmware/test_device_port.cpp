// One port of each driver: its codec's records, requests and rejections come through.
#include <string>
#include <vector>

#include "firmware/pipeline/device_port.hpp"
#include "hal/emu/emulated_ping360.hpp"
#include "hal/emu/nmea_talker.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::emu::Bytes;
using leadline::emu::EmulatedPing360;
using leadline::emu::EmulatedPing360Config;
using leadline::firmware::DevicePort;
using leadline::firmware::DeviceRecord;
using leadline::firmware::Driver;
using leadline::firmware::PortConfig;
using leadline::firmware::RecordKind;

DevicePort port;

PortConfig config_of(Driver driver) {
  PortConfig config{};
  config.driver = driver;
  config.mount = 3;
  config.min_range_um = 750'000;
  config.max_range_um = 10'000'000;
  config.scan_first_grad = 150;
  config.scan_last_grad = 250;
  config.scan_step_grad = 2;
  config.ping_interval_us = 50'000;
  return config;
}

TEST(a_scanning_head_sweeps_its_sector) {
  port.configure(config_of(Driver::kPing360), {1'480'000});
  EmulatedPing360 head(EmulatedPing360Config{}, [](const leadline::emu::Ping360Shot& shot) {
    return Bytes(static_cast<std::size_t>(shot.samples), 9);
  });
  int pings = 0;
  std::uint8_t request[256];
  for (TimeUs t = 0; t < 20'000'000; t += 5'000) {
    Bytes bytes;
    head.advance(t, bytes);
    DeviceRecord record{};
    for (const std::uint8_t byte : bytes) {
      for (RecordKind kind = port.feed(byte, t, record); kind != RecordKind::kNone;
           kind = port.next(record)) {
        assert_int_equal(kind, RecordKind::kPing);
        assert_int_equal(record.ping.mount, 3);
        assert_int_equal(record.ping.kind, leadline::base::ReturnKind::kProfile);
        assert_true(record.ping.profile.first_bin_um >= 750'000);
        // 150 .. 250 gradians are a quarter turn about forward.
        assert_true(std::abs(static_cast<std::int32_t>(record.ping.azimuth_bam32)) <= (1 << 29));
        ++pings;
      }
    }
    const std::size_t size = port.request(t, request, sizeof(request));
    if (size != 0) {
      head.take(t, request, size);
    }
  }
  assert_true(pings > 50);
  assert_int_equal(port.rejected(), 0);
  // The frame's first bytes and nonsense behind them.
  DeviceRecord record{};
  for (const int byte : {0x42, 0x52, 0x01, 0x00, 0xFC, 0x08, 0x02, 0x00, 0x00, 0x00, 0x00}) {
    assert_int_equal(port.feed(static_cast<std::uint8_t>(byte), 21'000'000, record),
                     RecordKind::kNone);
  }
  assert_true(port.rejected() > 0);
}

TEST(sensors_only_talk) {
  port.configure(config_of(Driver::kNmea), {1'500'000});
  leadline::emu::NmeaTruth truth;
  truth.heading_deg = 90;
  const std::string sentence =
      leadline::emu::nmea_sentence(leadline::emu::NmeaKind::kHdt, truth) + "$GPHDT,1.0,T*00\r\n";
  DeviceRecord record{};
  int samples = 0;
  for (const char c : sentence) {
    const RecordKind kind = port.feed(static_cast<std::uint8_t>(c), 5, record);
    samples += kind == RecordKind::kSample ? 1 : 0;
    assert_int_equal(port.next(record), RecordKind::kNone);
  }
  assert_int_equal(samples, 1);
  assert_int_equal(record.sample.attitude.heading_bam32, 0x40000000);
  assert_int_equal(port.rejected(), 1);
  std::uint8_t request[64];
  assert_int_equal(port.request(10, request, sizeof(request)), 0);
}

TEST(a_port_without_a_driver_is_deaf_and_dumb) {
  port.configure(PortConfig{}, {1'500'000});
  assert_int_equal(port.driver(), Driver::kNone);
  DeviceRecord record{};
  std::uint8_t request[64];
  for (int byte = 0; byte < 256; ++byte) {
    assert_int_equal(port.feed(static_cast<std::uint8_t>(byte), 0, record), RecordKind::kNone);
  }
  assert_int_equal(port.next(record), RecordKind::kNone);
  assert_int_equal(port.request(0, request, sizeof(request)), 0);
  assert_int_equal(port.rejected(), 0);
}

// The numbers stand in logs, the names in configurations: neither may ever move.
TEST(drivers_keep_their_numbers_and_names) {
  const std::vector<std::string> names = {
      "ping1d",  "ping360",   "nmea",   "cerulean", "imagenex",  "deltat83p", "tritech",
      "r2sonic", "kongsberg", "wl3d",   "tss1",     "vectornav", "xsens",     "trax",
      "wldvl",   "pd0",       "keller", "nmea2000", "mavlink",   "line"};
  assert_int_equal(names.size(), leadline::firmware::kLastDriver);
  for (std::size_t i = 0; i < names.size(); ++i) {
    assert_string_equal(driver_name(static_cast<Driver>(i + 1)), names[i].c_str());
  }
  assert_null(driver_info(Driver::kNone));
  assert_null(driver_info(static_cast<Driver>(leadline::firmware::kLastDriver + 1)));
  assert_string_equal(driver_name(static_cast<Driver>(255)), "none");
  assert_true(is_head(Driver::kPing360));
  assert_false(is_head(Driver::kNmea));
  assert_false(is_head(Driver::kNone));
}

TEST(a_codec_of_another_driver_takes_the_storage_of_the_one_before) {
  assert_true(port.configure_decoding(Driver::kNmea));
  DeviceRecord record{};
  for (const char c : std::string("$GPHDT,1.0,T*00\r\n")) {
    assert_int_equal(port.feed(static_cast<std::uint8_t>(c), 0, record), RecordKind::kNone);
  }
  assert_int_equal(port.counters().bad_checksum, 1);
  assert_true(port.configure_decoding(Driver::kPing1d));
  assert_int_equal(port.driver(), Driver::kPing1d);
  assert_int_equal(port.rejected(), 0);
  assert_int_equal(port.counters().restarts, 0);
  port.restart();
  assert_int_equal(port.counters().restarts, 1);
  assert_false(port.configure_decoding(Driver::kNone));
  assert_int_equal(port.counters().restarts, 0);
}

TEST(a_record_s_frame_is_there_until_the_next_byte) {
  const std::string hdm = "$IIHDM,201.5,M*24";
  assert_true(port.configure_decoding(Driver::kNmea));
  DeviceRecord record{};
  assert_int_equal(port.frame().size_bytes, 0);
  for (const char c : hdm + "\r") {
    (void)port.feed(static_cast<std::uint8_t>(c), 0, record);
  }
  // Without the '$'.
  assert_int_equal(port.frame().size_bytes, hdm.size() - 1);
  assert_memory_equal(port.frame().data, hdm.data() + 1, hdm.size() - 1);

  const std::string tss1 = ":00FFCA -0003F-0325  0319\r\n";
  assert_true(port.configure_decoding(Driver::kTss1));
  for (const char c : tss1) {
    (void)port.feed(static_cast<std::uint8_t>(c), 0, record);
  }
  assert_int_equal(port.frame().size_bytes, tss1.size());
  assert_memory_equal(port.frame().data, tss1.data(), tss1.size());
  assert_int_equal(port.next(record), RecordKind::kNone);
  assert_int_equal(port.frame().size_bytes, 0);
  // Not every codec keeps it, nor does a port without one.
  assert_true(port.configure_decoding(Driver::kXsens));
  assert_int_equal(port.frame().size_bytes, 0);
  assert_false(port.configure_decoding(Driver::kNone));
  assert_int_equal(port.frame().size_bytes, 0);
}

TEST(codecs_in_one_arena_do_not_touch_each_other_and_a_full_one_leaves_the_port_deaf) {
  using leadline::firmware::CodecArena;
  using leadline::firmware::PortCodec;
  alignas(leadline::firmware::kCodecStorage_alignment) static std::uint8_t bytes[20'000];
  CodecArena arena(bytes, sizeof bytes);
  PortConfig ping1d{};
  ping1d.driver = Driver::kPing1d;
  ping1d.max_range_um = 10'000'000;
  ping1d.ping_interval_us = 100'000;
  PortConfig nmea{};
  nmea.driver = Driver::kNmea;
  PortCodec heads[3];
  PortCodec sensor;
  heads[0].configure(ping1d, {1'500'000}, arena);
  sensor.configure(nmea, {1'500'000}, arena);
  heads[1].configure(ping1d, {1'500'000}, arena);
  heads[2].configure(ping1d, {1'500'000}, arena);
  assert_int_equal(heads[1].driver(), Driver::kPing1d);
  assert_int_equal(heads[2].driver(), Driver::kNone);
  DeviceRecord record{};
  std::uint8_t request[64];
  assert_int_equal(heads[2].feed('$', 0, record), RecordKind::kNone);
  assert_int_equal(heads[2].request(0, request, sizeof(request)), 0);
  // Half a sentence beside two heads that are asked and answered with junk.
  int records = 0;
  for (const char c : std::string("$HEHDT,90.0,T*16\r\n")) {
    assert_true(heads[0].request(0, request, sizeof(request)) <= sizeof(request));
    static_cast<void>(heads[0].feed(static_cast<std::uint8_t>(c), 0, record));
    static_cast<void>(heads[1].feed(0x42, 0, record));
    records += sensor.feed(static_cast<std::uint8_t>(c), 0, record) == RecordKind::kSample ? 1 : 0;
  }
  assert_int_equal(records, 1);
  arena.clear();
  heads[2].configure(ping1d, {1'500'000}, arena);
  assert_int_equal(heads[2].driver(), Driver::kPing1d);
}

}  // namespace
