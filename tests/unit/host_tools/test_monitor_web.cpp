// The monitor's server as others meet it: browsers, other sites' pages, slow and hostile peers. Over real sockets
// of this machine, in one thread: the server works while the test waits for bytes.
#include <array>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/monitor/page_messages.hpp"
#include "host_tools/monitor/web_access.hpp"
#include "host_tools/monitor/web_assets.hpp"
#include "host_tools/monitor/web_server.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::ExitCode;
using leadline::host::host_allowed;
using leadline::host::HostError;
using leadline::host::LiveMap;
using leadline::host::origin_allowed;
using leadline::host::PageContent;
using leadline::host::PageRequest;
using leadline::host::parse_web_address;
using leadline::host::TileStore;
using leadline::host::Track;
using leadline::host::web_authority;
using leadline::host::WebServer;

constexpr int kManyRounds = 4000;

/// A server with a map of 32 x 32 tiles.
struct Site {
  std::string palettes = leadline::host::palettes_json();
  std::string state = R"({"type":"state"})";
  LiveMap map;
  Track track;
  std::uint64_t state_number = 1;
  std::vector<PageRequest> requests;
  std::unique_ptr<TileStore> store;
  std::unique_ptr<WebServer> server;
  std::uint32_t generation = 0;

  Site() {
    leadline::proto::Hello hello{};
    hello.protocol_major = leadline::proto::kProtocolMajor;
    hello.tile_side_cells = leadline::proto::kTileSide_cells;
    hello.cell_mm = 500;
    hello.size_cells[0] = hello.size_cells[1] = 512;
    hello.size_cells[2] = 64;
    store = std::make_unique<TileStore>(hello);
    server = std::make_unique<WebServer>(
        parse_web_address("127.0.0.1:0"),
        WebServer::Handlers{
            [this] { return PageContent{&palettes, &map, &track, state_number, &state, true}; },
            [this](const PageRequest& request) { requests.push_back(request); }});
  }
  /// Every tile changes.
  void change_all() {
    generation += 1;
    for (std::uint32_t tile = 0; tile < store->tile_count(); ++tile) {
      leadline::proto::TileDelta delta{};
      delta.tile = tile;
      delta.generation = generation;
      delta.changed.set(0);
      delta.cell_count = 1;
      delta.cells[0] =
          leadline::proto::code_cell(static_cast<std::int32_t>(generation) * 64, 1024, 0);
      (void)store->apply(delta);
    }
    map.follow(*store, generation * 1'000'000);
  }
  void work() {
    server->wake();
    server->run_for(0);
  }
  [[nodiscard]] std::string authority() const {
    return "127.0.0.1:" + std::to_string(server->port());
  }
};

/// The other end of a connection.
class Peer {
 public:
  explicit Peer(Site* site, int receive_buffer_bytes = 0)
      : site_(site), fd_(socket(AF_INET, SOCK_STREAM, 0)) {
    if (receive_buffer_bytes > 0) {
      (void)setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes,
                       sizeof receive_buffer_bytes);
    }
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(site->server->port());
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    (void)fcntl(fd_, F_SETFL, O_NONBLOCK);
  }
  ~Peer() { close(fd_); }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  void send(const std::string& bytes) {
    std::size_t sent = 0;
    for (int round = 0; sent < bytes.size() && round < kManyRounds; ++round) {
      const ssize_t n = ::send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      sent += n > 0 ? static_cast<std::size_t>(n) : 0;
      if (n < 0 && errno != EAGAIN) {
        return;  // refused in the middle: what counts is the answer
      }
      site_->work();
    }
  }
  /// Reads until `enough`, or the end; false: neither came.
  bool read_until(const std::function<bool(const std::string&)>& enough) {
    std::array<char, 65536> buffer{};
    for (int round = 0; round < kManyRounds; ++round) {
      if (enough(received)) {
        return true;
      }
      site_->work();
      const ssize_t n = recv(fd_, buffer.data(), buffer.size(), 0);
      if (n > 0) {
        received.append(buffer.data(), static_cast<std::size_t>(n));
        round = 0;
      } else if (n == 0 || (n < 0 && errno != EAGAIN)) {
        ended = true;
        return enough(received);
      } else {
        usleep(500);
      }
    }
    return false;
  }
  bool read_to_end() {
    (void)read_until([](const std::string&) { return false; });
    return ended;
  }
  /// The answer's first line, and header lines.
  std::string ask(const std::string& request) {
    send(request);
    assert_true(
        read_until([](const std::string& text) { return text.find("\r\n\r\n") != text.npos; }));
    return received.substr(0, received.find("\r\n\r\n"));
  }
  std::string upgrade(const std::string& origin, const std::string& target = "/live") {
    return ask("GET " + target + " HTTP/1.1\r\nHost: " + site_->authority() +
               (origin.empty() ? "" : "\r\nOrigin: " + origin) +
               "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
               "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n");
  }
  std::string received;
  bool ended = false;

 private:
  Site* site_;
  int fd_;
};

/// A WebSocket frame of a client: masked, as it must be, unless told otherwise.
std::string frame(int opcode, const std::string& payload, bool masked = true) {
  std::string bytes(1, static_cast<char>(0x80 | opcode));
  const int mask_bit = masked ? 0x80 : 0;
  if (payload.size() < 126) {
    bytes += static_cast<char>(mask_bit | static_cast<int>(payload.size()));
  } else {
    bytes += static_cast<char>(mask_bit | 126);
    bytes += static_cast<char>(payload.size() >> 8U);
    bytes += static_cast<char>(payload.size() & 255U);
  }
  const std::string mask = "\x11\x22\x33\x44";
  if (masked) {
    bytes += mask;
  }
  for (std::size_t k = 0; k < payload.size(); ++k) {
    bytes += static_cast<char>(payload[k] ^ (masked ? mask[k % 4] : 0));
  }
  return bytes;
}

std::string get(const Site& site, const std::string& target, const std::string& host = "") {
  return "GET " + target + " HTTP/1.1\r\nHost: " + (host.empty() ? site.authority() : host) +
         "\r\nAccept-Encoding: gzip\r\nConnection: close\r\n\r\n";
}

bool has_status(const std::string& answer, const char* status) {
  return answer.rfind("HTTP/1.1 " + std::string(status), 0) == 0;
}

TEST(the_page_and_its_parts_are_served_with_their_policy) {
  Site site;
  for (const char* const target :
       {"/", "/index.html", "/main.js", "/style.css", "/three/build/three.module.js"}) {
    Peer peer(&site);
    const std::string answer = peer.ask(get(site, target));
    assert_true(has_status(answer, "200"));
    assert_true(answer.find("Content-Encoding: gzip") != std::string::npos);
    assert_true(answer.find("default-src 'none'") != std::string::npos);
    assert_true(answer.find("X-Content-Type-Options: nosniff") != std::string::npos);
    assert_true(peer.read_to_end());
    const std::size_t body = peer.received.size() - answer.size() - 4;
    assert_int_equal(
        body, leadline::host::find_web_asset(target == std::string("/") ? "/index.html" : target)
                  ->gzip_bytes);
  }
  Peer head(&site);
  const std::string answer =
      head.ask("HEAD / HTTP/1.1\r\nHost: localhost:" + std::to_string(site.server->port()) +
               "\r\nAccept-Encoding: gzip\r\nConnection: close\r\n\r\n");
  assert_true(has_status(answer, "200"));
  assert_true(head.read_to_end());
  assert_int_equal(head.received.size(), answer.size() + 4);
}

TEST(no_path_leads_anywhere_else) {
  Site site;
  for (const char* const target :
       {"/../../../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/index.html/",
        "/main.js?x=1", "/.git/config", "/three/build/../../../etc/passwd", "/live",
        "/\\..\\..\\etc\\passwd", "*"}) {
    Peer peer(&site);
    assert_true(has_status(peer.ask(get(site, target)), "404"));
  }
  Peer post(&site);
  assert_true(has_status(
      post.ask("POST / HTTP/1.1\r\nHost: " + site.authority() + "\r\nContent-Length: 0\r\n\r\n"),
      "405"));
  Peer plain(&site);
  assert_true(
      has_status(plain.ask("GET / HTTP/1.1\r\nHost: " + site.authority() + "\r\n\r\n"), "406"));
}

TEST(other_names_for_this_machine_are_refused) {
  Site site;
  const std::string port = std::to_string(site.server->port());
  for (const std::string& host :
       {std::string("evil.example:") + port, std::string("evil.example"),
        std::string("127.0.0.1.evil.example:") + port,
        std::string("localhost.evil.example:") + port, std::string("127.0.0.1:1"),
        std::string("[::1"), std::string("user@127.0.0.1:") + port}) {
    Peer peer(&site);
    assert_true(has_status(peer.ask(get(site, "/", host)), "421"));
  }
  Peer none(&site);
  assert_true(has_status(none.ask("GET / HTTP/1.0\r\n\r\n").replace(7, 1, "1"), "421"));
  assert_int_equal(site.server->counters().refused_hosts, 8);
  Peer local(&site);
  assert_true(has_status(local.ask(get(site, "/", "localhost:" + port)), "200"));
}

TEST(pages_of_other_sites_open_no_socket) {
  Site site;
  for (const std::string& origin :
       {std::string("http://evil.example"), std::string("null"), "https://" + site.authority(),
        "http://" + site.authority() + ".evil.example", std::string("http://127.0.0.1:1")}) {
    Peer peer(&site);
    assert_true(has_status(peer.upgrade(origin), "403"));
  }
  assert_int_equal(site.server->counters().refused_origins, 5);
  Peer elsewhere(&site);
  assert_true(has_status(elsewhere.upgrade("", "/else"), "404"));
  Peer own(&site);
  assert_true(has_status(own.upgrade("http://" + site.authority()), "101"));
  assert_true(own.read_until(
      [](const std::string& text) { return text.find("\"type\":\"state\"") != text.npos; }));
  assert_int_equal(site.server->viewers(), 1);
}

TEST(a_page_that_talks_nonsense_is_dropped_and_nobody_else) {
  Site site;
  Peer good(&site);
  assert_true(has_status(good.upgrade(""), "101"));
  const std::string hostile[] = {
      frame(1, "nonsense"),
      frame(1, R"({"type":"seek","t_s":1e999})"),
      frame(2, "binary"),
      frame(1, std::string(4000, 'x')),          // longer than any request
      frame(1, R"({"type":"pause"})", false),    // not masked
      "\x81" + std::string(9, '\xff') + "mask",  // promises 2^64 bytes
      frame(1, "\xff\xfe\xfd"),                  // no UTF-8
      frame(0, "goes on with nothing"),
      frame(7, "unknown"),
  };
  std::uint64_t bad = 0;
  for (const std::string& bytes : hostile) {
    {
      Peer peer(&site);
      assert_true(has_status(peer.upgrade(""), "101"));
      peer.send(bytes);
      assert_true(peer.read_to_end());
    }
    // A closing handshake may wait for the peer's part, which has only now gone away.
    for (int round = 0; round < 1000 && site.server->viewers() > 1; ++round) {
      site.server->run_for(1);
    }
    assert_int_equal(site.server->viewers(), 1);
    assert_true(site.server->counters().bad_messages > bad);
    bad = site.server->counters().bad_messages;
  }
  assert_int_equal(site.requests.size(), 0);
  good.send(frame(1, R"({"type":"seek","t_s":3})"));
  for (int round = 0; round < 100 && site.requests.empty(); ++round) {
    site.server->run_for(1);
  }
  assert_int_equal(site.requests.size(), 1);
}

TEST(garbage_instead_of_http_ends_the_connection) {
  leadline::test::Random random(5);
  Site site;
  for (int k = 0; k < 40; ++k) {
    Peer peer(&site);
    std::string bytes;
    const auto size = random.between(1, 3000);
    for (std::int64_t i = 0; i < size; ++i) {
      bytes += static_cast<char>(random.between(0, 255));
    }
    peer.send(bytes + "\r\n\r\n");
    assert_true(peer.read_to_end());
  }
  Peer endless(&site);
  endless.send("GET / HTTP/1.1\r\n");
  for (int k = 0; k < 600 && !endless.ended; ++k) {
    endless.send("X-Header-" + std::to_string(k) + ": " + std::string(100, 'x') + "\r\n");
  }
  assert_true(endless.read_to_end());
  Peer peer(&site);
  assert_true(has_status(peer.ask(get(site, "/")), "200"));
}

TEST(a_slow_viewer_costs_one_message_and_delays_nobody) {
  Site site;
  site.change_all();
  Peer slow(&site, 4096);
  assert_true(has_status(slow.upgrade(""), "101"));
  const std::uint64_t before = site.server->counters().message_bytes;
  for (int round = 0; round < 60; ++round) {
    site.change_all();  // 2 MB each for whoever keeps up
    site.state_number += 1;
    for (int k = 0; k < 20; ++k) {
      site.work();
    }
  }
  // What the kernel took of the first messages; nothing waits in the program beyond the one under way.
  assert_true(site.server->counters().message_bytes - before < 12'000'000);
  Peer quick(&site);
  assert_true(has_status(quick.upgrade(""), "101"));
  const std::size_t whole = std::size_t{1024} * leadline::host::kPageTile_bytes;
  assert_true(quick.read_until([whole](const std::string& text) { return text.size() > whole; }));
  // The slow one, once he reads, comes to what the map is now.
  const std::string newest(reinterpret_cast<const char*>(&site.map.tile(1023)->cells[0]), 4);
  assert_true(slow.read_until([&newest](const std::string& text) {
    return text.size() > 100'000 && text.find(newest, text.size() - 70'000) != text.npos;
  }));
}

TEST(viewers_are_counted_and_bounded) {
  Site site;
  std::vector<std::unique_ptr<Peer>> peers;
  for (std::size_t k = 0; k < WebServer::kMaxViewers; ++k) {
    peers.push_back(std::make_unique<Peer>(&site));
    assert_true(has_status(peers.back()->upgrade(""), "101"));
  }
  Peer more(&site);
  assert_true(has_status(more.upgrade(""), "503"));
  peers.pop_back();
  for (int round = 0; round < 1000 && site.server->viewers() == WebServer::kMaxViewers; ++round) {
    site.server->run_for(1);
  }
  Peer again(&site);
  assert_true(has_status(again.upgrade(""), "101"));
}

TEST(a_port_in_use_is_a_clear_error) {
  Site site;
  bool thrown = false;
  try {
    const WebServer second({"127.0.0.1", site.server->port()}, {});
  } catch (const HostError& error) {
    thrown = true;
    assert_true(error.code() == ExitCode::kUsage);
    const std::string text = error.what();
    assert_true(text.find("in use") != std::string::npos);
    assert_true(text.find(std::to_string(site.server->port())) != std::string::npos);
  }
  assert_true(thrown);
}

TEST(addresses_are_read) {
  assert_string_equal(web_authority(parse_web_address("127.0.0.1:8080")).c_str(), "127.0.0.1:8080");
  assert_string_equal(web_authority(parse_web_address(":80")).c_str(), "127.0.0.1:80");
  assert_string_equal(web_authority(parse_web_address("LocalHost:0")).c_str(), "127.0.0.1:0");
  assert_string_equal(web_authority(parse_web_address("[::1]:8080")).c_str(), "[::1]:8080");
  for (const char* const bad :
       {"", "8080", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1", "example.org:80",
        "[::1:80", "1.2.3.4.5:80", "127.0.0.1:80x", "::1:80"}) {
    bool thrown = false;
    try {
      (void)parse_web_address(bad);
    } catch (const HostError& error) {
      thrown = error.code() == ExitCode::kUsage;
    }
    assert_true(thrown);
  }
  assert_true(host_allowed("10.0.0.7:8080", 8080));
  assert_true(host_allowed("[fe80::1]:8080", 8080));
  assert_true(host_allowed("localhost", 80));
  assert_false(host_allowed("localhost", 8080));
  assert_false(host_allowed("", 80));
  assert_true(origin_allowed("http://localhost:8080", "localhost:8080"));
  assert_false(origin_allowed("http://localhost:8080", "127.0.0.1:8080"));
}

}  // namespace
