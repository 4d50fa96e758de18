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

TEST(text_reads_back_to_the_same) {
  for (const char* const text : {"serial:/dev/ttyUSB0:115200", "udp:192.168.2.2:9090", "udp:@:9100",
                                 "tcp:[fe80::1]:80", "tcp:@localhost:80", "file:a b"}) {
    assert_string_equal(uri_text(good(text).spec).c_str(), text);
  }
}

TEST(what_is_wrong_is_said_with_the_text_and_what_is_needed) {
  struct Case {
    std::string text;
    const char* message;
  };
  const std::vector<Case> cases = {
      {"", "has to begin with serial:, udp:, tcp: or file:"},
      {"/dev/ttyUSB0", "\"/dev/ttyUSB0\": has to begin with serial:"},
      {"can:can0", "has to begin with serial:"},
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
      {"file:", "needs a name"},
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
  const std::string alphabet = "serialudptcpfile::::@[]/09.\x01\xff ";
  for (int round = 0; round < 20'000; ++round) {
    std::string text;
    const std::int64_t size = random.between(0, 24);
    for (std::int64_t i = 0; i < size; ++i) {
      text += alphabet[static_cast<std::size_t>(
          random.between(0, static_cast<std::int64_t>(alphabet.size()) - 1))];
    }
    const UriResult result = parse_uri((round % 2 == 0 ? "udp:" : "") + text);
    if (result.ok()) {
      assert_string_equal(uri_text(good(uri_text(result.spec)).spec).c_str(),
                          uri_text(result.spec).c_str());
    }
  }
}

}  // namespace
