#include <string>
#include <vector>

#include "hal/linux/uri.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::hal::parse_uri;
using leadline::hal::uri_text;
using leadline::hal::UriResult;
using leadline::hal::UriScheme;

UriResult good(const std::string& text) {
  UriResult result = parse_uri(text);
  assert_string_equal(result.error.c_str(), "");
  return result;
}

TEST(serial_devices_have_a_path_and_a_rate) {
  assert_int_equal(good("serial:/dev/ttyUSB0:9600").spec.scheme, UriScheme::kSerial);
  assert_string_equal(good("serial:/dev/ttyUSB0:9600").spec.path.c_str(), "/dev/ttyUSB0");
  assert_int_equal(good("serial:/dev/ttyUSB0:9600").spec.baud, 9600);
  assert_int_equal(good("serial:/dev/ttyUSB0").spec.baud, 115'200);
  // By-path names hold colons.
  const UriResult by_path = good("serial:/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0");
  assert_string_equal(by_path.spec.path.c_str(),
                      "/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0");
}

TEST(sockets_connect_or_listen) {
  const UriResult to = good("udp:192.168.2.2:9090");
  assert_int_equal(to.spec.scheme, UriScheme::kUdp);
  assert_false(to.spec.listen);
  assert_string_equal(to.spec.host.c_str(), "192.168.2.2");
  assert_int_equal(to.spec.port, 9090);
  const UriResult at = good("tcp:@:9100");
  assert_int_equal(at.spec.scheme, UriScheme::kTcp);
  assert_true(at.spec.listen);
  assert_string_equal(at.spec.host.c_str(), "");
  assert_string_equal(good("udp:@[::1]:9100").spec.host.c_str(), "::1");
  assert_string_equal(good("udp:topside.local:1").spec.host.c_str(), "topside.local");
  assert_int_equal(good("udp:@127.0.0.1:0").spec.port, 0);
}

TEST(files_have_a_path) {
  assert_int_equal(good("file:out.lld").spec.scheme, UriScheme::kFile);
  assert_string_equal(good("file:a:b").spec.path.c_str(), "a:b");
}

TEST(buses_and_lines) {
  const UriResult can = good("can:can0:0DF50B23,7FF/700,9F119CC/1FFFF00");
  assert_int_equal(can.spec.scheme, UriScheme::kCan);
  assert_string_equal(can.spec.path.c_str(), "can0");
  assert_int_equal(can.spec.can_filters.size(), 3);
  assert_int_equal(can.spec.can_filters[0].id, 0x8DF50B23U);
  assert_int_equal(can.spec.can_filters[0].mask, 0x1FFFFFFF);
  assert_int_equal(can.spec.can_filters[1].id, 0x7FF);
  assert_int_equal(can.spec.can_filters[1].mask, 0x700);
  assert_true(good("can:slcan0").spec.can_filters.empty());
  const UriResult rtu = good("modbus-rtu:/dev/ttyUSB1:19200:8E2@17");
  assert_int_equal(rtu.spec.scheme, UriScheme::kModbusRtu);
  assert_string_equal(rtu.spec.path.c_str(), "/dev/ttyUSB1");
  assert_int_equal(rtu.spec.baud, 19'200);
  assert_int_equal(rtu.spec.framing.parity, 'E');
  assert_int_equal(rtu.spec.framing.stop_bits, 2);
  assert_int_equal(rtu.spec.unit, 17);
  const UriResult tcp = good("modbus-tcp:10.0.0.7:502@247");
  assert_int_equal(tcp.spec.port, 502);
  assert_int_equal(tcp.spec.unit, 247);
  const UriResult in = good("gpio:/dev/gpiochip1:17");
  assert_string_equal(in.spec.path.c_str(), "/dev/gpiochip1");
  assert_int_equal(in.spec.line, 17);
  assert_false(in.spec.output);
  assert_true(good("gpio:gpiochip0:4:out").spec.output);
  std::string many = "can:can0:";
  for (int i = 0; i < 33; ++i) {
    many += (i == 0 ? "" : ",") + std::to_string(i);
  }
  assert_true(parse_uri(many).error.find("more than 32 filters") != std::string::npos);
}

TEST(text_reads_back_to_the_same) {
  for (const char* const text :
       {"serial:/dev/ttyUSB0:115200", "udp:192.168.2.2:9090", "udp:@:9100", "tcp:[fe80::1]:80",
        "tcp:@localhost:80", "file:a b", "can:can0", "can:can0:123/7FF,0DF50B23/1FFFFFFF",
        "modbus-rtu:/dev/ttyUSB1:19200:8N1@1", "modbus-tcp:[::1]:502@9", "gpio:gpiochip0:3",
        "gpio:gpiochip0:3:out", "unix:/run/leadline.sock"}) {
    assert_string_equal(uri_text(good(text).spec).c_str(), text);
  }
}

TEST(what_is_wrong_is_said_with_the_text_and_what_is_needed) {
  struct Case {
    std::string text;
    const char* message;
  };
  const std::vector<Case> cases = {
      {"", "has to begin with serial:, udp:, tcp:, can:,"},
      {"/dev/ttyUSB0", "\"/dev/ttyUSB0\": has to begin with serial:"},
      {"can:", "needs an interface"},
      {"can:a/b", "needs an interface"},
      {"can:sixteen_letters_", "needs an interface"},
      {"can:can0:", "\"\" is no filter"},
      {"can:can0:1x", "\"1x\" is no filter"},
      {"can:can0:800", "\"800\" is no filter"},
      {"can:can0:FFFFFFFF", "is no filter"},
      {"can:can0:123/FFFF", "is no filter"},
      {"can:can0:1,,2", "\"\" is no filter"},
      {"modbus-rtu:/dev/ttyUSB1:19200:8N1", "needs the slave's address, 1 to 247"},
      {"modbus-rtu:/dev/ttyUSB1:19200:8N1@0", "needs the slave's address"},
      {"modbus-rtu:/dev/ttyUSB1:19200:8N1@248", "needs the slave's address"},
      {"modbus-rtu:/dev/ttyUSB1:19200@1", "needs the framing"},
      {"modbus-rtu:/dev/ttyUSB1:19200:7E1@1", "needs the framing"},
      {"modbus-rtu::19200:8N1@1", "needs a device"},
      {"modbus-rtu:/dev/ttyUSB1:19201:8N1@1", "the rate has to be one of"},
      {"modbus-tcp:host@1", "needs a port"},
      {"modbus-tcp:@:502@1", "is a master and connects"},
      {"modbus-tcp:host:502", "needs the slave's address"},
      {"gpio:gpiochip0", "needs a chip and a line's number"},
      {"gpio::3", "needs a chip"},
      {"gpio:gpiochip0:x", "needs a chip"},
      {"gpio:gpiochip0:3:in", "needs a chip"},
      {"serial:", "needs a device"},
      {"serial::9600", "needs a device"},
      {"serial:/dev/ttyS0:9601", "the rate has to be one of 1200 1800"},
      {"serial:/dev/ttyS0:99999999999999999999", "the rate has to be one of"},
      {"udp:9090", "needs a port: udp:HOST:PORT to send, udp:@:PORT or udp:@HOST:PORT to listen"},
      {"udp:host:", "the port has to be 1 to 65535"},
      {"udp:host:0", "the port has to be 1 to 65535"},
      {"udp:host:65536", "the port has to be 1 to 65535"},
      {"udp:host:4294967297", "the port has to be 1 to 65535"},
      {"udp:host:-1", "the port has to be 1 to 65535"},
      {"udp::9090", "needs a host"},
      {"tcp:fe80::1:80", "an IPv6 address goes into brackets: tcp:[::1]:9100"},
      {"tcp:[]:80", "an IPv6 address goes into brackets"},
      {"udp:ho st:80", "\"ho st\" is not a host"},
      {"udp://host:80", "\"//host\" is not a host"},
      {"udp:@@host:80", "\"@host\" is not a host"},
      {"file:", "needs a name: file:PATH"},
      {"unix:", "needs a name: unix:PATH"},
      {"file:a\nb", "holds control characters"},
      {std::string(600, 'x'), "longer than 512 bytes"},
  };
  for (const Case& bad : cases) {
    const std::string error = parse_uri(bad.text).error;
    if (error.find(bad.message) == std::string::npos) {
      fail_msg("\"%s\": \"%s\" is not in \"%s\"", bad.text.c_str(), bad.message, error.c_str());
    }
  }
}

TEST(any_bytes_are_a_uri_or_an_error) {
  leadline::test::Random random;
  const std::string alphabet = "serialudptcpfile::::@[]/09.,8N1\x01\xff ";
  for (int round = 0; round < 20'000; ++round) {
    std::string text;
    const std::int64_t size = random.between(0, 24);
    for (std::int64_t i = 0; i < size; ++i) {
      text += alphabet[static_cast<std::size_t>(
          random.between(0, static_cast<std::int64_t>(alphabet.size()) - 1))];
    }
    const char* const schemes[] = {"udp:", "", "can:", "gpio:", "modbus-rtu:", "modbus-tcp:"};
    const UriResult result = parse_uri(schemes[round % 6] + text);
    if (result.ok()) {
      assert_string_equal(uri_text(good(uri_text(result.spec)).spec).c_str(),
                          uri_text(result.spec).c_str());
    }
  }
}

}  // namespace
