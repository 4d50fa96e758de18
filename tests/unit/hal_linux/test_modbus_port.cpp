// The Modbus port against a slave of our own: bytes on a pty, and on a loopback socket.
#include <memory>
#include <string>

#include "hal/attitude/keller.hpp"
#include "hal/emu/faulty_stream.hpp"
#include "hal/emu/keller_sensor.hpp"
#include "hal/linux/modbus_port.hpp"
#include "hal/linux/pty_pair.hpp"
#include "tests/support/port_loop.hpp"

namespace {

using leadline::emu::FaultConfig;
using leadline::emu::FaultyStream;
using leadline::emu::KellerSensor;
using leadline::emu::KellerTruth;
using leadline::emu::modbus_sealed;
using leadline::hal::KellerCodec;
using leadline::hal::KellerConfig;
using leadline::hal::LinuxPort;
using leadline::hal::ModbusCounters;
using leadline::hal::ModbusPort;
using leadline::hal::PortState;
using leadline::hal::PtyPair;
using leadline::test::Bytes;
using leadline::test::from_hex;
using leadline::test::monotonic_us;
using leadline::test::port_of;
using leadline::test::read_once;
using leadline::test::until;
using leadline::test::wait_open;

KellerTruth deep(leadline::base::TimeUs /*t_us*/) { return {3.5, 7.25}; }

ModbusCounters counts(LinuxPort& port) { return dynamic_cast<ModbusPort&>(port).modbus_counters(); }

const Bytes kRequest = from_hex("01 03 01 00 00 04 45 f5");

/// A slave on a pty, its line at will faulty.
struct RtuSlave {
  PtyPair pty;
  KellerSensor sensor{{}, deep};
  FaultyStream line{FaultConfig{}};

  explicit RtuSlave(const std::string& link = "") : pty(link) {}
  void step() {
    const Bytes heard = read_once(pty.port()).bytes;
    const auto now_us = monotonic_us();
    sensor.take(now_us, heard.data(), heard.size());
    Bytes said;
    Bytes sent;
    sensor.advance(now_us, said);
    line.pass(now_us, said, sent);
    (void)pty.port().write(sent.data(), sent.size());
  }
};

/// The same sensor behind TCP: frames in and out of the header.
struct TcpSlave {
  std::unique_ptr<LinuxPort> port = port_of("tcp:@127.0.0.1:0");
  KellerSensor sensor{{}, deep};
  Bytes heard;
  Bytes header;

  [[nodiscard]] std::string uri() const {
    return "modbus-tcp:127.0.0.1:" + std::to_string(port->local_port()) + "@1";
  }
  void step() {
    const Bytes more = read_once(*port).bytes;
    heard.insert(heard.end(), more.begin(), more.end());
    if (heard.size() >= 12) {
      header = Bytes(heard.begin(), heard.begin() + 4);
      const Bytes request = modbus_sealed(Bytes(heard.begin() + 6, heard.begin() + 12));
      heard.erase(heard.begin(), heard.begin() + 12);
      sensor.take(monotonic_us(), request.data(), request.size());
    }
    Bytes said;
    sensor.advance(monotonic_us(), said);
    if (!said.empty()) {
      said.resize(said.size() - 2);
      Bytes frame = header;
      frame.push_back(0);
      frame.push_back(static_cast<std::uint8_t>(said.size()));
      frame.insert(frame.end(), said.begin(), said.end());
      (void)port->write(frame.data(), frame.size());
    }
  }
};

/// One poll after the other until there are `wanted` samples.
template <typename Slave>
void poll_sensor(LinuxPort& port, Slave& slave, KellerCodec& codec, int wanted) {
  int samples = 0;
  until(
      [&] {
        slave.step();
        const auto arrival = read_once(port);
        for (const std::uint8_t byte : arrival.bytes) {
          leadline::base::NavSample sample{};
          if (codec.feed(byte, arrival.t_us, sample)) {
            assert_int_equal(sample.pressure_pa, 350'000);
            assert_int_equal(sample.temperature_mdegc, 7250);
            assert_true(sample.t_us <= monotonic_us() && sample.t_us > monotonic_us() - 1'000'000);
            ++samples;
          }
        }
        if (samples >= wanted) {
          return true;  // and nothing is under way
        }
        std::uint8_t request[KellerCodec::kMaxRequest_bytes];
        const std::size_t size = codec.request(monotonic_us(), request, sizeof request);
        if (size > 0) {
          (void)port.write(request, size);
        }
        return false;
      },
      "samples");
}

KellerConfig often() {
  KellerConfig config;
  config.poll_interval_us = 10'000;
  return config;
}

/// Writes one request and lets both sides work until `done`.
template <typename Slave>
void ask(LinuxPort& port, Slave& slave, const std::function<bool()>& done, const char* what) {
  assert_int_equal(port.write(kRequest.data(), kRequest.size()), kRequest.size());
  until(
      [&] {
        slave.step();
        port.service(monotonic_us());
        return done();
      },
      what);
}

}  // namespace

TEST(a_slave_on_a_serial_line_is_polled) {
  RtuSlave slave;
  const auto port = port_of("modbus-rtu:" + slave.pty.path() + ":19200:8N1@1");
  wait_open(*port);
  KellerCodec codec(often());
  poll_sensor(*port, slave, codec, 20);
  assert_true(counts(*port).answers >= 20);
  assert_int_equal(counts(*port).bad_answers, 0);
  assert_int_equal(codec.counters().bad_checksum, 0);
}

TEST(a_slave_behind_tcp_is_the_same_to_the_codec) {
  TcpSlave slave;
  const auto port = port_of(slave.uri());
  wait_open(*port);
  KellerCodec codec(often());
  poll_sensor(*port, slave, codec, 20);
  assert_int_equal(counts(*port).bad_answers, 0);
  assert_int_equal(codec.counters().bad_checksum, 0);
  // Its refusal is bytes as well.
  const Bytes wrong = modbus_sealed(from_hex("01 03 02 00 00 04"));
  assert_int_equal(port->write(wrong.data(), wrong.size()), wrong.size());
  Bytes answer;
  until(
      [&] {
        slave.step();
        answer = read_once(*port).bytes;
        return !answer.empty();
      },
      "a refusal");
  assert_true(answer == modbus_sealed(from_hex("01 83 02")));
}

TEST(silence_is_a_timeout_and_the_loop_does_not_wait_for_it) {
  RtuSlave slave;
  const auto port = port_of("modbus-rtu:" + slave.pty.path() + ":19200:8N1@1");
  wait_open(*port);
  slave.sensor.set_silent(true);
  ask(
      *port, slave, [&] { return counts(*port).timeouts == 1; }, "a timeout");
  assert_int_equal(port->state(), PortState::kOpen);
  slave.sensor.set_silent(false);
  KellerCodec codec(often());
  poll_sensor(*port, slave, codec, 3);
}

TEST(one_request_at_a_time_and_only_frames_for_this_slave) {
  RtuSlave slave;
  const auto port = port_of("modbus-rtu:" + slave.pty.path() + ":19200:8N1@1");
  wait_open(*port);
  slave.sensor.set_silent(true);
  assert_true(port->write_room() > 0);
  assert_int_equal(port->write(kRequest.data(), kRequest.size()), kRequest.size());
  assert_int_equal(port->write_room(), 0);
  assert_int_equal(port->write(kRequest.data(), kRequest.size()), 0);
  assert_int_equal(port->counters().bytes_dropped_out, kRequest.size());
  until([&] { return port->write_room() > 0; }, "room again");
  Bytes broken = kRequest;
  broken[3] ^= 1U;
  assert_int_equal(port->write(broken.data(), broken.size()), 0);
  const Bytes other = modbus_sealed(from_hex("02 03 01 00 00 04"));
  assert_int_equal(port->write(other.data(), other.size()), 0);
  assert_int_equal(port->write(other.data(), 2), 0);
  assert_int_equal(counts(*port).bad_requests, 3);
}

TEST(a_corrupt_or_cut_answer_is_counted_and_the_next_one_is_whole) {
  for (const bool cut : {false, true}) {
    RtuSlave slave;
    const auto port = port_of("modbus-rtu:" + slave.pty.path() + ":19200:8N1@1");
    wait_open(*port);
    FaultConfig faults;
    faults.corrupt_ppm = cut ? 0 : 1'000'000;
    faults.truncate_ppm = cut ? 200'000 : 0;
    faults.seed = 3;
    slave.line = FaultyStream(faults);
    ask(
        *port, slave, [&] { return counts(*port).timeouts + counts(*port).bad_answers == 1; },
        "a bad answer");
    assert_true(read_once(*port).bytes.empty());
    assert_int_equal(port->counters().errors, 1);
    slave.line = FaultyStream(FaultConfig{});
    KellerCodec codec(often());
    poll_sensor(*port, slave, codec, 3);
  }
}

TEST(a_late_answer_is_not_the_next_one_s) {
  RtuSlave slave;
  const auto port = port_of("modbus-rtu:" + slave.pty.path() + ":19200:8N1@1");
  wait_open(*port);
  FaultConfig late;
  late.delay_ppm = 1'000'000;
  late.delay_us = 400'000;
  slave.line = FaultyStream(late);
  ask(
      *port, slave, [&] { return counts(*port).timeouts == 1; }, "a timeout");
  until(
      [&] {
        slave.step();
        return slave.line.next_event_us() == leadline::emu::kNever_us;
      },
      "the late bytes");
  slave.line = FaultyStream(FaultConfig{});
  KellerCodec codec(often());
  poll_sensor(*port, slave, codec, 3);
  assert_int_equal(counts(*port).bad_answers, 0);
}

TEST(a_tcp_slave_that_goes_is_connected_to_again) {
  auto slave = std::make_unique<TcpSlave>();
  const std::string uri = slave->uri();
  const std::string listen = "tcp:@127.0.0.1:" + std::to_string(slave->port->local_port());
  const auto port = port_of(uri);
  wait_open(*port);
  KellerCodec codec(often());
  poll_sensor(*port, *slave, codec, 2);
  slave->port.reset();
  until(
      [&] {
        (void)port->write(kRequest.data(), kRequest.size());
        port->service(monotonic_us());
        return port->state() == PortState::kClosed;
      },
      "the loss");
  assert_int_equal(port->counters().losses, 1);
  slave->port = port_of(listen);
  slave->heard.clear();
  wait_open(*port);
  poll_sensor(*port, *slave, codec, 2);
  assert_int_equal(port->counters().opens, 2);
}

TEST(a_serial_adapter_that_is_pulled_comes_back) {
  const std::string link = leadline::test::scratch_directory() + "/sensor";
  RtuSlave slave(link);
  const auto port = port_of("modbus-rtu:" + link + ":19200:8N1@1");
  wait_open(*port);
  KellerCodec codec(often());
  poll_sensor(*port, slave, codec, 2);
  slave.pty.unplug();
  until(
      [&] {
        (void)port->write(kRequest.data(), kRequest.size());
        port->service(monotonic_us());
        return port->state() == PortState::kClosed;
      },
      "the loss");
  assert_true(slave.pty.plug());
  wait_open(*port);
  poll_sensor(*port, slave, codec, 2);
}

TEST(what_is_not_there_is_a_closed_port_and_ends_at_once) {
  const auto rtu = port_of("modbus-rtu:/dev/no_such_tty:19200:8N1@1");
  until(
      [&] {
        rtu->service(monotonic_us());
        return rtu->last_errno() == ENOENT;
      },
      "an error");
  assert_int_equal(rtu->state(), PortState::kClosed);
  assert_int_equal(rtu->write(kRequest.data(), kRequest.size()), 0);
  assert_int_equal(rtu->counters().bytes_dropped_out, kRequest.size());
}
