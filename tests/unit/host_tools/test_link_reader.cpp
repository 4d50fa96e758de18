// The topside's end of a link while its owner is busy.
#include <cstring>
#include <vector>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "host_tools/topside/link_reader.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::LinkReader;

TEST(what_comes_while_its_owner_is_busy_is_kept_in_order) {
  LinkReader reader("udp:@127.0.0.1:0", "test");
  reader.hold(0.0);
  const int sender = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(reader.local_port());
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  // Many times what a socket keeps by itself.
  constexpr std::uint32_t kSent = 20'000;
  std::uint32_t sent = 0;
  const auto send_one = [&] {
    std::uint32_t words[25] = {sent++};
    assert_int_equal(
        sendto(sender, words, sizeof words, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to),
        sizeof words);
  };
  std::uint32_t came = 0;
  const auto take = [&](const std::uint8_t* data, std::size_t size_bytes) {
    assert_int_equal(size_bytes % 100, 0);
    for (; size_bytes > 0; data += 100, size_bytes -= 100) {
      std::uint32_t number = 0;
      std::memcpy(&number, data, sizeof number);
      assert_int_equal(number, came);
      came += 1;
    }
  };
  while (sent < kSent) {
    for (int k = 0; k < 100; ++k) {
      send_one();
    }
    reader.hold(0.0);
  }
  assert_int_equal(reader.read_bytes(0.0, take), std::size_t{kSent} * 100);
  // Inside of a read too: what is under work stays as it is.
  send_one();
  (void)reader.read_bytes(0.0, [&](const std::uint8_t* data, std::size_t size_bytes) {
    send_one();
    reader.hold(0.0);
    take(data, size_bytes);
  });
  (void)reader.read_bytes(0.0, take);
  assert_int_equal(came, sent);
  close(sender);
}

}  // namespace
