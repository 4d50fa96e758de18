// CAN and GPIO ports on a kernel that has such things. tests/cli/test_kernel_buses_ci.sh runs this program
// inside of a user-mode kernel; elsewhere what needs the kernel is skipped.
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "estimator/utc_clock.hpp"
#include "hal/attitude/line.hpp"
#include "hal/attitude/nmea2000.hpp"
#include "hal/can_frame.hpp"
#include "hal/emu/nmea2000_bus.hpp"
#include "hal/linux/can_port.hpp"
#include "hal/linux/gpio_port.hpp"
#include "hal/linux/pty_pair.hpp"
#include "tests/support/nav_streams.hpp"
#include "tests/support/port_loop.hpp"

namespace {

using leadline::base::NavSample;
using leadline::emu::n2k_truth;
using leadline::emu::N2kTruth;
using leadline::estimator::PingSync;
using leadline::hal::CanCounters;
using leadline::hal::CanFrame;
using leadline::hal::CanPort;
using leadline::hal::kCanFrame_bytes;
using leadline::hal::LineCodec;
using leadline::hal::LineConfig;
using leadline::hal::LineRole;
using leadline::hal::LinuxPort;
using leadline::hal::Nmea2000Codec;
using leadline::hal::PortState;
using leadline::test::Arrival;
using leadline::test::Bytes;
using leadline::test::from_text;
using leadline::test::monotonic_us;
using leadline::test::port_of;
using leadline::test::read_once;
using leadline::test::until;
using leadline::test::wait_open;

/// Value of an environment variable that the guest's script sets; skips the running test without it.
std::string guest(const char* name) {
  const char* value = std::getenv(name);
  if (value == nullptr) {
    leadline::test::skip_test(std::string(name) + " is not set: not in the user-mode kernel");
  }
  return value;
}

std::string bus() { return guest("LEADLINE_TEST_CAN"); }

Bytes frame(std::uint32_t id, const Bytes& data) {
  CanFrame can{id, static_cast<std::uint8_t>(data.size()), {}};
  std::copy(data.begin(), data.end(), can.data.begin());
  Bytes bytes(kCanFrame_bytes);
  leadline::hal::write_can_frame(can, bytes.data());
  return bytes;
}

CanFrame can_of(const Bytes& bytes) {
  CanFrame can{};
  assert_int_equal(bytes.size(), kCanFrame_bytes);
  assert_true(leadline::hal::read_can_frame(bytes.data(), can));
  return can;
}

void send(LinuxPort& port, const Bytes& bytes) {
  assert_int_equal(port.write(bytes.data(), bytes.size()), bytes.size());
}

Arrival next(LinuxPort& port) {
  Arrival arrival;
  until(
      [&] {
        arrival = read_once(port);
        return !arrival.bytes.empty();
      },
      "a frame");
  return arrival;
}

CanCounters counts(LinuxPort& port) { return dynamic_cast<CanPort&>(port).can_counters(); }

void set_up(const std::string& interface, bool up) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM, 0);
  ifreq request{};
  std::strncpy(request.ifr_name, interface.c_str(), IFNAMSIZ - 1);
  assert_int_equal(::ioctl(fd, SIOCGIFFLAGS, &request), 0);
  const int flags = up ? request.ifr_flags | IFF_UP : request.ifr_flags & ~IFF_UP;
  request.ifr_flags = static_cast<short>(flags);
  assert_int_equal(::ioctl(fd, SIOCSIFFLAGS, &request), 0);
  ::close(fd);
}

}  // namespace

TEST(an_interface_that_is_not_there_is_a_closed_port) {
  const auto port = port_of("can:no_such_bus");
  port->service(0);
  assert_int_equal(port->state(), PortState::kClosed);
  assert_true(port->last_errno() != 0);
  const Bytes bytes = frame(0x123, {1});
  assert_int_equal(port->write(bytes.data(), bytes.size()), 0);
  assert_int_equal(port->counters().bytes_dropped_out, bytes.size());
  assert_true(read_once(*port).bytes.empty());
  assert_int_equal(port->poll_fd(), -1);
}

TEST(a_line_that_is_not_there_is_a_closed_port) {
  for (const char* const uri : {"gpio:no_such_chip:3", "gpio:no_such_chip:3:out"}) {
    const auto port = port_of(uri);
    port->service(0);
    assert_int_equal(port->state(), PortState::kClosed);
    assert_true(port->last_errno() != 0);
    const std::uint8_t up = 'R';
    assert_int_equal(port->write(&up, 1), 0);
    assert_int_equal(port->counters().bytes_dropped_out, 1);
    assert_true(read_once(*port).bytes.empty());
  }
}

TEST(frames_go_from_port_to_port_with_the_kernel_s_time) {
  const auto sender = port_of("can:" + bus());
  const auto receiver = port_of("can:" + bus());
  wait_open(*sender);
  wait_open(*receiver);
  const auto before_us = monotonic_us();
  const Bytes both = frame(0x123, {1, 2, 3});
  send(*sender, both);
  (void)::poll(nullptr, 0, 50);
  const auto reading_us = monotonic_us();
  const Arrival arrival = next(*receiver);
  assert_true(arrival.bytes == both);
  // The frame is older than its reading.
  assert_true(arrival.t_us >= before_us - 2000 && arrival.t_us < reading_us);
  send(*sender, frame(0x8DF50B23U, {}));
  assert_int_equal(can_of(next(*receiver).bytes).id, 0x8DF50B23U);
  assert_true(read_once(*sender).bytes.empty());  // its own are not heard
  assert_int_equal(receiver->counters().bytes_in, 2 * kCanFrame_bytes);
}

TEST(filters_are_the_kernel_s) {
  const auto sender = port_of("can:" + bus());
  const auto receiver = port_of("can:" + bus() + ":0DF50B23,700/7F0");
  wait_open(*sender);
  wait_open(*receiver);
  for (const std::uint32_t id : {0x123U, 0x8DF50B22U, 0x710U, 0x80000700U}) {
    send(*sender, frame(id, {1}));
  }
  send(*sender, frame(0x8DF50B23U, {2}));
  send(*sender, frame(0x70FU, {3}));
  assert_int_equal(can_of(next(*receiver).bytes).id, 0x8DF50B23U);
  assert_int_equal(can_of(next(*receiver).bytes).id, 0x70FU);
  (void)::poll(nullptr, 0, 20);
  assert_true(read_once(*receiver).bytes.empty());
}

TEST(a_bus_of_nmea_2000_is_decoded) {
  const auto sender = port_of("can:" + bus());
  const auto receiver = port_of("can:" + bus());
  wait_open(*sender);
  wait_open(*receiver);
  N2kTruth truth;
  truth.motion.roll_deg = 10;
  truth.latitude_deg = 60;
  truth.longitude_deg = 24;
  send(*sender, n2k_truth(127'257, 5, truth));
  send(*sender, n2k_truth(129'029, 5, truth));
  Nmea2000Codec codec(leadline::hal::Nmea2000Config{});
  std::vector<NavSample> samples;
  until(
      [&] {
        const Arrival arrival = read_once(*receiver);
        for (const NavSample& sample :
             leadline::test::samples_of(codec, arrival.bytes, arrival.t_us)) {
          samples.push_back(sample);
        }
        return samples.size() == 2;
      },
      "samples");
  assert_near(leadline::test::degrees(samples[0].attitude.roll_bam32), 10, 0.003);
  assert_int_equal(samples[1].latitude_e9deg, 60'000'000'000);
}

TEST(a_flood_is_counted_where_it_is_dropped) {
  const auto sender = port_of("can:" + bus());
  const auto receiver = port_of("can:" + bus());
  wait_open(*sender);
  wait_open(*receiver);
  // More than any socket's buffer takes; what the sender's end drops is counted there.
  constexpr std::uint64_t kFrames = 20'000;
  for (std::uint64_t i = 0; i < kFrames; ++i) {
    const Bytes bytes = frame(0x100, {1, 2, 3, 4, 5, 6, 7, 8});
    (void)sender->write(bytes.data(), bytes.size());
  }
  std::uint64_t taken = 0;
  for (int quiet = 0; quiet < 20;) {
    const bool some = !read_once(*receiver).bytes.empty();
    taken += some ? 1 : 0;
    quiet = some ? 0 : quiet + 1;
  }
  // The count of drops comes with the next frame.
  send(*sender, frame(0x101, {}));
  assert_int_equal(can_of(next(*receiver).bytes).id, 0x101);
  const std::uint64_t sent = sender->counters().bytes_out / kCanFrame_bytes - 1;
  assert_true(taken < sent);
  assert_int_equal(receiver->counters().bytes_dropped_in, (sent - taken) * kCanFrame_bytes);
  assert_int_equal(sender->counters().bytes_dropped_out, (kFrames - sent) * kCanFrame_bytes);
}

TEST(bus_off_is_reported_counted_and_tried_again) {
  const auto sender = port_of("can:" + bus());
  const auto receiver = port_of("can:" + bus());
  wait_open(*sender);
  wait_open(*receiver);
  send(*sender,
       frame(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, CAN_ERR_CRTL_RX_OVERFLOW, 0, 0, 0, 0, 0, 0}));
  assert_int_equal(can_of(next(*receiver).bytes).id, CAN_ERR_FLAG | CAN_ERR_CRTL);
  assert_int_equal(counts(*receiver).overflows, 1);
  assert_int_equal(receiver->state(), PortState::kOpen);
  leadline::base::TimeUs waited_us[2]{};
  for (leadline::base::TimeUs& wait_us : waited_us) {
    send(*sender, frame(CAN_ERR_FLAG | CAN_ERR_BUSOFF, Bytes(8, 0)));
    const Arrival arrival = next(*receiver);
    assert_int_equal(can_of(arrival.bytes).id, CAN_ERR_FLAG | CAN_ERR_BUSOFF);
    assert_int_equal(receiver->state(), PortState::kClosed);
    const auto from_us = monotonic_us();
    wait_open(*receiver);
    wait_us = monotonic_us() - from_us;
  }
  // The second is backed off further: nothing came from the bus in between.
  assert_true(waited_us[0] >= 90'000 && waited_us[1] >= 190'000);
  assert_int_equal(counts(*receiver).bus_offs, 2);
  assert_int_equal(receiver->counters().losses, 2);
  send(*sender, frame(CAN_ERR_FLAG | CAN_ERR_RESTARTED, Bytes(8, 0)));
  send(*sender, frame(0x77, {1}));
  (void)next(*receiver);
  assert_int_equal(can_of(next(*receiver).bytes).id, 0x77);
  assert_int_equal(counts(*receiver).restarts, 1);
  send(*sender, frame(CAN_ERR_FLAG | CAN_ERR_BUSOFF, Bytes(8, 0)));
  (void)next(*receiver);
  const auto from_us = monotonic_us();
  wait_open(*receiver);
  assert_true(monotonic_us() - from_us < 190'000);  // from the beginning again
}

TEST(an_interface_that_goes_down_comes_back) {
  const auto receiver = port_of("can:" + bus());
  wait_open(*receiver);
  set_up(bus(), false);
  until(
      [&] {
        (void)read_once(*receiver);
        return receiver->state() == PortState::kClosed;
      },
      "the loss");
  assert_int_equal(receiver->last_errno(), ENETDOWN);
  set_up(bus(), true);
  wait_open(*receiver);
  const auto sender = port_of("can:" + bus());
  wait_open(*sender);
  send(*sender, frame(0x55, {1}));
  assert_int_equal(can_of(next(*receiver).bytes).id, 0x55);
}

TEST(an_adapter_on_a_serial_line_is_a_bus) {
  (void)bus();
  leadline::hal::PtyPair pty;
  const int fd = ::open(pty.path().c_str(), O_RDWR | O_NOCTTY);
  const int discipline = 17;  // N_SLCAN
  if (::ioctl(fd, TIOCSETD, &discipline) != 0) {
    ::close(fd);
    leadline::test::skip_test("this kernel has no slcan");
  }
  std::array<char, IFNAMSIZ> name{};
  assert_int_equal(::ioctl(fd, SIOCGIFNAME, name.data()), 0);
  set_up(name.data(), true);
  const auto port = port_of(std::string("can:") + name.data());
  wait_open(*port);
  // What the adapter says becomes a frame; what is sent becomes what the adapter hears.
  const Bytes said = from_text("t3212AABB\rT09F119238FFFF7F1B002105FF\r");
  (void)pty.port().write(said.data(), said.size());
  const CanFrame short_id = can_of(next(*port).bytes);
  assert_int_equal(short_id.id, 0x321);
  assert_int_equal(short_id.data[1], 0xBB);
  assert_int_equal(can_of(next(*port).bytes).id, 0x89F11923U);
  send(*port, frame(0x123, {0x11, 0x22}));
  std::string heard;
  until(
      [&] {
        const Bytes more = read_once(pty.port()).bytes;
        heard.append(more.begin(), more.end());
        return heard.find("t12321122\r") != std::string::npos;
      },
      "the frame on the adapter's line");
  ::close(fd);
}

TEST(edges_come_with_the_time_that_the_kernel_saw_them) {
  const std::string line = guest("LEADLINE_TEST_GPIO");
  const std::string pull = guest("LEADLINE_TEST_GPIO_PULL");
  const auto port = port_of("gpio:" + line);
  wait_open(*port);
  assert_true(next(*port).bytes == from_text("L"));  // the level, which is no edge
  int older = 0;                                     // than their reading
  for (int i = 0; i < 20; ++i) {
    const bool up = i % 2 == 0;
    const auto before_us = monotonic_us();
    std::ofstream(pull) << (up ? "pull-up" : "pull-down") << std::endl;
    // This kernel hands interrupts on with its tick of 10 ms: edges closer than two of them melt into one.
    (void)::poll(nullptr, 0, 60);
    const auto reading_us = monotonic_us();
    const Arrival arrival = next(*port);
    assert_int_equal(arrival.bytes.size(), 1);
    assert_int_equal(arrival.bytes[0], up ? 'R' : 'F');
    assert_true(arrival.t_us >= before_us && arrival.t_us <= monotonic_us());
    older += arrival.t_us < reading_us ? 1 : 0;
  }
  assert_true(older > 0);  // on a busy machine not all: interrupts come late
  assert_true(read_once(*port).bytes.empty());
  assert_int_equal(port->counters().bytes_in, 21);
  const std::uint8_t byte = 'R';
  assert_int_equal(port->write(&byte, 1), 0);  // an input
}

TEST(edges_become_a_head_s_transmission_and_a_level_a_leak) {
  const std::string line = guest("LEADLINE_TEST_GPIO");
  const std::string pull = guest("LEADLINE_TEST_GPIO_PULL");
  LineCodec sync(LineConfig{LineRole::kPingSync, true});
  LineCodec leak(LineConfig{LineRole::kLeak, true});
  PingSync edges;
  NavSample sample{};
  std::ofstream(pull) << "pull-down" << std::endl;
  auto port = port_of("gpio:" + line);
  wait_open(*port);
  Arrival arrival = next(*port);
  assert_true(leak.feed(arrival.bytes[0], arrival.t_us, sample));
  assert_int_equal(sample.leak, 0);
  int older = 0;
  for (int i = 0; i < 10; ++i) {
    const auto before_us = monotonic_us();
    std::ofstream(pull) << "pull-up" << std::endl;
    (void)::poll(nullptr, 0, 60);
    const auto reading_us = monotonic_us();
    arrival = next(*port);
    assert_true(sync.feed(arrival.bytes[0], arrival.t_us, sample));
    edges.add(sample.t_us);
    assert_true(leak.feed(arrival.bytes[0], arrival.t_us, sample));
    assert_int_equal(sample.leak, 1);
    std::int64_t edge_us = 0;
    assert_true(edges.edge_of(monotonic_us(), edge_us));
    assert_true(edge_us >= before_us && edge_us <= monotonic_us());
    older += edge_us < reading_us ? 1 : 0;
    std::ofstream(pull) << "pull-down" << std::endl;
    (void)::poll(nullptr, 0, 60);
    arrival = next(*port);
    assert_false(sync.feed(arrival.bytes[0], arrival.t_us, sample));
  }
  assert_true(older > 0);
  // A boat that is full of water already when its program starts.
  port.reset();
  std::ofstream(pull) << "pull-up" << std::endl;
  port = port_of("gpio:" + line);
  wait_open(*port);
  arrival = next(*port);
  assert_true(leak.feed(arrival.bytes[0], arrival.t_us, sample));
  assert_int_equal(sample.leak, 1);
  std::ofstream(pull) << "pull-down" << std::endl;
}

TEST(a_trigger_sets_its_line) {
  const std::string line = guest("LEADLINE_TEST_GPIO_OUT");
  const std::string value = guest("LEADLINE_TEST_GPIO_OUT_VALUE");
  const auto port = port_of("gpio:" + line + ":out");
  wait_open(*port);
  const auto level = [&] {
    int read = -1;
    std::ifstream(value) >> read;
    return read;
  };
  assert_int_equal(level(), 0);
  const Bytes up = from_text("R");
  send(*port, up);
  assert_int_equal(level(), 1);
  send(*port, from_text("F"));
  assert_int_equal(level(), 0);
  const Bytes pulse = from_text("RxF");
  assert_int_equal(port->write(pulse.data(), pulse.size()), 2);
  assert_int_equal(port->counters().bytes_dropped_out, 1);
  assert_true(read_once(*port).bytes.empty());
}
