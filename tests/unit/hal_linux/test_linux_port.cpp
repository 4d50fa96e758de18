// Ports over real ptys, sockets and files. Time is the test's own: a port reads no clock.
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "hal/linux/linux_port.hpp"
#include "hal/linux/pty_pair.hpp"
#include "tests/support/test.hpp"

namespace {
std::atomic<std::uint64_t> allocations{0};
}  // namespace

// Counts what this program allocates: a port has to do without after it was made.
// NOLINTNEXTLINE
void* operator new(std::size_t size) {
  allocations += 1;
  if (void* const memory = std::malloc(size == 0 ? 1 : size)) {
    return memory;
  }
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t /*size*/) noexcept { std::free(memory); }

namespace {

using leadline::base::TimeUs;
using leadline::hal::BytePort;
using leadline::hal::FileUse;
using leadline::hal::LinuxPort;
using leadline::hal::make_port;
using leadline::hal::parse_uri;
using leadline::hal::PortResult;
using leadline::hal::PortState;
using leadline::hal::PtyPair;

constexpr TimeUs kStep_us = 20'000;

std::unique_ptr<LinuxPort> make(const std::string& uri, FileUse use = FileUse::kRead) {
  const auto parsed = parse_uri(uri);
  assert_string_equal(parsed.error.c_str(), "");
  PortResult result = make_port(parsed.spec, use);
  assert_string_equal(result.error.c_str(), "");
  return std::move(result.port);
}

/// Everything that comes within `cycles` cycles or until `wanted` bytes are there; the kernel may hand
/// bytes from one end of a pty to the other a little later.
std::string take(BytePort& port, TimeUs* now_us, std::size_t wanted, int cycles = 2000) {
  std::string bytes;
  std::vector<std::uint8_t> buffer(4096);
  for (int i = 0; i < cycles && bytes.size() < wanted; ++i) {
    *now_us += kStep_us;
    port.service(*now_us);
    TimeUs t_us = -1;
    const std::size_t size = port.read(*now_us, buffer.data(), buffer.size(), t_us);
    if (size == 0) {
      (void)::poll(nullptr, 0, 1);
      continue;
    }
    assert_int_equal(t_us, *now_us);
    bytes.append(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size));
  }
  return bytes;
}

std::size_t put(BytePort& port, const std::string& text) {
  return port.write(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
}

/// Serves until the port is in that state; false when it never is.
bool reach(BytePort& port, PortState state, TimeUs* now_us, int cycles = 2000) {
  std::uint8_t byte = 0;
  TimeUs t_us = 0;
  for (int i = 0; i < cycles; ++i) {
    *now_us += kStep_us;
    port.service(*now_us);
    if (port.state() == PortState::kOpen) {
      (void)port.read(*now_us, &byte, 1, t_us);
    }
    if (port.state() == state) {
      return true;
    }
    (void)::poll(nullptr, 0, 1);
  }
  return false;
}

int open_descriptors() {
  int count = 0;
  for (int fd = 0; fd < 1024; ++fd) {
    count += ::fcntl(fd, F_GETFD) >= 0 ? 1 : 0;
  }
  return count;
}

TEST(a_pty_carries_every_byte_both_ways_unchanged) {
  PtyPair pair;
  assert_string_equal(pair.error().c_str(), "");
  const auto port = make("serial:" + pair.path() + ":9600");
  TimeUs now_us = 0;
  port->service(now_us);
  assert_int_equal(port->state(), PortState::kOpen);
  std::string all;
  for (int value = 0; value < 256; ++value) {
    all += static_cast<char>(value);
  }
  assert_int_equal(put(pair.port(), all), all.size());
  assert_true(take(*port, &now_us, all.size()) == all);
  assert_int_equal(put(*port, all), all.size());
  assert_true(take(pair.port(), &now_us, all.size()) == all);
  assert_int_equal(port->counters().bytes_in, 256);
  assert_int_equal(port->counters().bytes_out, 256);
  assert_int_equal(port->counters().errors, 0);
}

TEST(bytes_written_before_the_port_opens_are_kept) {
  PtyPair pair;
  put(pair.port(), "early\r\n");
  const auto port = make("serial:" + pair.path());
  TimeUs now_us = 0;
  assert_string_equal(take(*port, &now_us, 7).c_str(), "early\r\n");
}

TEST(nothing_there_is_not_an_end) {
  PtyPair pair;
  const auto port = make("serial:" + pair.path());
  TimeUs now_us = 0;
  assert_string_equal(take(*port, &now_us, 1, 20).c_str(), "");
  assert_int_equal(port->state(), PortState::kOpen);
  assert_int_equal(port->counters().losses, 0);
  assert_true((port->poll_events() & POLLIN) != 0);
  assert_true(port->poll_fd() >= 0);
}

TEST(an_unplugged_adapter_is_found_again_under_its_name) {
  const std::string link = leadline::test::scratch_directory() + "/tty";
  PtyPair pair(link);
  assert_string_equal(pair.path().c_str(), link.c_str());
  const auto port = make("serial:" + link);
  TimeUs now_us = 0;
  constexpr int kCycles = 200;
  assert_true(reach(*port, PortState::kOpen, &now_us));
  const int descriptors = open_descriptors();
  const std::uint64_t before = allocations;
  std::uint64_t made_by_the_pair = 0;
  for (int cycle = 0; cycle < kCycles; ++cycle) {
    const std::uint64_t start = allocations;
    pair.unplug();
    made_by_the_pair += allocations - start;
    assert_true(reach(*port, PortState::kClosed, &now_us));
    assert_int_equal(port->poll_fd(), -1);
    assert_int_equal(put(*port, "lost"), 0);
    const std::uint64_t again = allocations;
    assert_true(pair.plug());
    made_by_the_pair += allocations - again;
    const TimeUs plugged_us = now_us;
    assert_true(reach(*port, PortState::kOpen, &now_us));
    assert_true(now_us - plugged_us <= LinuxPort::kLongestRetry_us + kStep_us);
  }
  assert_int_equal(allocations - before - made_by_the_pair, 0);
  assert_int_equal(open_descriptors(), descriptors);
  assert_int_equal(port->counters().opens, kCycles + 1);
  assert_int_equal(port->counters().losses, kCycles);
  assert_int_equal(port->counters().bytes_dropped_out, 4 * kCycles);
  put(pair.port(), "back");
  assert_string_equal(take(*port, &now_us, 4).c_str(), "back");
}

TEST(a_pty_takes_no_name_but_its_own) {
  namespace fs = std::filesystem;
  const std::string folder = leadline::test::scratch_directory();
  // Whoever put something else under the name meanwhile keeps it.
  {
    PtyPair pair(folder + "/tty");
    fs::remove(folder + "/tty");
    std::ofstream(folder + "/tty") << "important";
  }
  assert_true(fs::is_regular_file(folder + "/tty"));
  // A link to anything but a pty is no leftover of ours.
  fs::create_symlink(folder + "/tty", folder + "/mine");
  PtyPair refused(folder + "/mine");
  assert_false(refused.error().empty());
  assert_true(fs::read_symlink(folder + "/mine") == folder + "/tty");
  // That of an emulator which was killed is.
  fs::create_symlink("/dev/pts/999999", folder + "/stale");
  PtyPair pair(folder + "/stale");
  assert_string_equal(pair.path().c_str(), (folder + "/stale").c_str());
}

TEST(a_missing_device_is_tried_again_ever_more_rarely) {
  const std::string link = leadline::test::scratch_directory() + "/later";
  const auto port = make("serial:" + link);
  TimeUs now_us = 0;
  port->service(now_us);
  assert_int_equal(port->state(), PortState::kClosed);
  assert_int_equal(port->last_errno(), ENOENT);
  assert_int_equal(port->write_room(), 0);
  PtyPair pair(link);
  port->service(now_us + 99'999);
  assert_int_equal(port->state(), PortState::kClosed);
  port->service(now_us + 100'000);
  assert_int_equal(port->state(), PortState::kOpen);
}

TEST(a_file_that_is_no_terminal_is_refused) {
  const auto port = make("serial:/dev/null");
  port->service(0);
  assert_int_equal(port->state(), PortState::kClosed);
  assert_int_equal(port->last_errno(), ENOTTY);
}

TEST(partial_writes_wait_in_the_queue_and_the_rest_is_counted) {
  PtyPair pair;
  const auto port = make("serial:" + pair.path());
  TimeUs now_us = 0;
  port->service(now_us);
  // Nobody reads at the other end: the kernel takes some, the queue the rest, then it is full.
  const std::string block(1000, 'x');
  std::size_t taken = 0;
  std::size_t offered = 0;
  while (port->write_room() > 0) {
    offered += block.size();
    taken += put(*port, block);
  }
  assert_int_equal(port->pending_out_bytes(), LinuxPort::kQueue_bytes);
  assert_int_equal(port->counters().bytes_dropped_out, offered - taken);
  assert_int_equal(put(*port, "no"), 0);
  assert_true((port->poll_events() & POLLOUT) != 0);
  // Everything that was taken arrives, in pieces.
  std::size_t arrived = 0;
  for (int i = 0; i < 20'000 && arrived < taken; ++i) {
    port->service(now_us += kStep_us);
    arrived += take(pair.port(), &now_us, 1, 2).size();
  }
  assert_int_equal(arrived, taken);
  assert_int_equal(port->counters().bytes_out, taken);
  assert_int_equal(port->pending_out_bytes(), 0);
}

TEST(a_flood_takes_no_more_than_the_room_that_it_is_given) {
  PtyPair pair;
  PtyPair quiet;
  const auto flooded = make("serial:" + pair.path());
  const auto port = make("serial:" + quiet.path());
  put(quiet.port(), "ping");
  std::vector<std::uint8_t> buffer(512);
  TimeUs now_us = 0;
  TimeUs t_us = 0;
  std::size_t most = 0;
  std::string heard;
  for (int cycle = 0; cycle < 200; ++cycle) {
    put(pair.port(), std::string(4000, 'f'));
    pair.port().service(now_us += kStep_us);
    flooded->service(now_us);
    port->service(now_us);
    most = std::max(most, flooded->read(now_us, buffer.data(), buffer.size(), t_us));
    const std::size_t size = port->read(now_us, buffer.data(), buffer.size(), t_us);
    heard.append(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size));
  }
  assert_int_equal(most, buffer.size());
  assert_string_equal(heard.c_str(), "ping");
  // Queue and kernel filled up at the writer's side, and the writer knows.
  assert_true(pair.port().counters().bytes_dropped_out > 0);
}

TEST(udp_sends_to_one_and_hears_it_answer) {
  const auto server = make("udp:@127.0.0.1:0");
  assert_true(server->local_port() != 0);
  const auto client = make("udp:127.0.0.1:" + std::to_string(server->local_port()));
  TimeUs now_us = 0;
  client->service(now_us);
  assert_int_equal(server->write_room(), 0);  // nobody to answer yet
  assert_int_equal(put(*server, "x"), 0);
  assert_int_equal(put(*client, "hello"), 5);
  assert_string_equal(take(*server, &now_us, 5).c_str(), "hello");
  assert_int_equal(put(*server, "resend"), 6);
  assert_string_equal(take(*client, &now_us, 6).c_str(), "resend");
  // One datagram per read, whatever the room.
  put(*client, "one");
  put(*client, "two");
  std::vector<std::uint8_t> buffer(100);
  TimeUs t_us = 0;
  assert_int_equal(server->read(now_us, buffer.data(), buffer.size(), t_us), 3);
  assert_int_equal(server->read(now_us, buffer.data(), buffer.size(), t_us), 3);
  // What does not fit is held for the next reads, and not mixed with the next datagram.
  put(*client, "0123456789");
  put(*client, "next");
  assert_int_equal(server->held_bytes(), 0);
  assert_int_equal(server->read(now_us, buffer.data(), 4, t_us), 4);
  assert_int_equal(server->held_bytes(), 6);
  assert_int_equal(server->read(now_us, buffer.data(), 4, t_us), 4);
  assert_int_equal(server->read(now_us, buffer.data(), buffer.size(), t_us), 2);
  assert_int_equal(buffer[1], '9');
  assert_int_equal(server->held_bytes(), 0);
  assert_int_equal(server->read(now_us, buffer.data(), buffer.size(), t_us), 4);
  assert_int_equal(server->counters().bytes_dropped_in, 0);
  // An empty datagram is nothing and hides nothing.
  put(*client, "");
  put(*client, "after");
  assert_int_equal(server->read(now_us, buffer.data(), buffer.size(), t_us), 5);
}

TEST(udp_without_a_listener_counts_and_goes_on) {
  std::uint16_t number = 0;
  { number = make("udp:@127.0.0.1:0")->local_port(); }
  const auto client = make("udp:127.0.0.1:" + std::to_string(number));
  TimeUs now_us = 0;
  client->service(now_us);
  for (int i = 0; i < 10; ++i) {
    put(*client, "anyone?");
    (void)take(*client, &now_us, 1, 3);
  }
  assert_int_equal(client->state(), PortState::kOpen);
  assert_true(client->counters().errors > 0);
  const auto server = make("udp:@127.0.0.1:" + std::to_string(number));
  put(*client, "there");
  assert_string_equal(take(*server, &now_us, 5).c_str(), "there");
}

TEST(udp_floods_are_dropped_in_the_kernel_and_counted) {
  const auto server = make("udp:@127.0.0.1:0");
  const auto client = make("udp:127.0.0.1:" + std::to_string(server->local_port()));
  client->service(0);
  const std::string datagram(1400, 'f');
  constexpr std::uint32_t kSent = 5000;
  for (std::uint32_t i = 0; i < kSent; ++i) {
    put(*client, datagram);
  }
  std::vector<std::uint8_t> buffer(2048);
  TimeUs t_us = 0;
  std::uint32_t read = 0;
  while (server->read(0, buffer.data(), buffer.size(), t_us) > 0) {
    read += 1;
  }
  // The count of drops comes with the next datagram that gets through.
  put(*client, "last");
  assert_int_equal(server->read(0, buffer.data(), buffer.size(), t_us), 4);
  assert_true(server->kernel_drops() > 0);
  assert_int_equal(read + server->kernel_drops(), kSent);
}

TEST(an_address_that_is_taken_is_an_error_at_once) {
  for (const std::string scheme : {"udp", "tcp"}) {
    const auto first = make(scheme + ":@127.0.0.1:0");
    const std::string uri = scheme + ":@127.0.0.1:" + std::to_string(first->local_port());
    const PortResult second = make_port(parse_uri(uri).spec);
    assert_null(second.port.get());
    assert_true(second.error.find(uri) != std::string::npos);
    assert_true(second.error.find("cannot listen: Address already in use") != std::string::npos);
  }
}

TEST(an_unknown_host_is_an_error_at_once) {
  const PortResult result = make_port(parse_uri("udp:no.such.host.invalid:9").spec);
  assert_null(result.port.get());
  assert_true(result.error.find("no address for host \"no.such.host.invalid\"") !=
              std::string::npos);
}

TEST(tcp_connects_again_after_the_peer_was_gone) {
  std::uint16_t number = 0;
  { number = make("tcp:@127.0.0.1:0")->local_port(); }
  const std::string port = std::to_string(number);
  const auto client = make("tcp:127.0.0.1:" + port);
  TimeUs now_us = 0;
  for (int i = 0; i < 50; ++i) {  // a second of virtual time: refused, backed off
    client->service(now_us += kStep_us);
  }
  assert_int_equal(client->state(), PortState::kClosed);
  assert_int_equal(client->last_errno(), ECONNREFUSED);
  for (int round = 0; round < 3; ++round) {
    const auto server = make("tcp:@127.0.0.1:" + port);
    assert_true(reach(*client, PortState::kOpen, &now_us));
    assert_int_equal(put(*client, "frames"), 6);
    assert_string_equal(take(*server, &now_us, 6).c_str(), "frames");
    assert_int_equal(put(*server, "up"), 2);
    assert_string_equal(take(*client, &now_us, 2).c_str(), "up");
    // Closing with data that nobody read resets the connection: the client sees an error, not an end.
    if (round == 1) {
      put(*client, "unread");
    }
  }
  assert_true(reach(*client, PortState::kClosed, &now_us));
  assert_int_equal(client->counters().opens, 3);
  assert_int_equal(client->counters().losses, 3);
}

TEST(the_newest_tcp_peer_wins) {
  const auto server = make("tcp:@127.0.0.1:0");
  const std::string uri = "tcp:127.0.0.1:" + std::to_string(server->local_port());
  TimeUs now_us = 0;
  assert_int_equal(server->state(), PortState::kClosed);
  assert_true(server->poll_fd() >= 0);  // a connection wakes the loop
  const auto first = make(uri);
  assert_true(reach(*first, PortState::kOpen, &now_us));
  assert_true(reach(*server, PortState::kOpen, &now_us));
  const auto second = make(uri);
  assert_true(reach(*second, PortState::kOpen, &now_us));
  put(*second, "new");
  assert_string_equal(take(*server, &now_us, 3).c_str(), "new");
  assert_true(reach(*first, PortState::kClosed, &now_us));
  assert_int_equal(server->counters().losses, 1);
}

TEST(files_are_read_to_their_end_and_followed) {
  const std::string path = leadline::test::scratch_directory() + "/log";
  const auto port = make("file:" + path);
  TimeUs now_us = 0;
  port->service(now_us);
  assert_int_equal(port->last_errno(), ENOENT);
  std::ofstream(path) << "frames";
  assert_string_equal(take(*port, &now_us, 6).c_str(), "frames");
  assert_string_equal(take(*port, &now_us, 1, 3).c_str(), "");
  assert_true(port->at_end());
  assert_int_equal(port->state(), PortState::kOpen);
  assert_int_equal(port->poll_fd(), -1);
  std::ofstream(path, std::ios::app) << "more";
  assert_string_equal(take(*port, &now_us, 4).c_str(), "more");
  assert_false(port->at_end());
  assert_int_equal(put(*port, "x"), 0);
}

TEST(files_are_written_to_their_end) {
  const std::string path = leadline::test::scratch_directory() + "/out";
  std::ofstream(path) << "old ";
  {
    const auto port = make("file:" + path, FileUse::kWrite);
    port->service(0);
    assert_int_equal(put(*port, "new"), 3);
    TimeUs t_us = 0;
    std::uint8_t byte = 0;
    assert_int_equal(port->read(0, &byte, 1, t_us), 0);
  }
  std::string text;
  std::getline(std::ifstream(path), text);
  assert_string_equal(text.c_str(), "old new");
}

TEST(a_full_disk_is_counted_and_nothing_waits) {
  const auto port = make("file:/dev/full", FileUse::kWrite);
  port->service(0);
  assert_int_equal(port->state(), PortState::kOpen);
  const std::string block(LinuxPort::kQueue_bytes, 'x');
  assert_int_equal(put(*port, block), block.size());
  assert_int_equal(put(*port, "more"), 0);
  assert_int_equal(port->counters().bytes_dropped_out, 4);
  assert_true(port->counters().errors > 0);
  assert_int_equal(port->last_errno(), ENOSPC);
}

TEST(a_folder_is_no_file) {
  const auto port = make("file:" + leadline::test::scratch_directory());
  port->service(0);
  assert_int_equal(port->state(), PortState::kClosed);
  assert_int_equal(port->last_errno(), EISDIR);
}

TEST(what_can_never_be_the_device_is_said_at_once) {
  using leadline::hal::device_problem;
  const std::string folder = leadline::test::scratch_directory();
  const std::string file = folder + "/data";
  std::ofstream(file) << "data";
  const PtyPair pair;
  const auto problem = [](const std::string& uri, FileUse use = FileUse::kRead,
                          bool may_be_missing = false) {
    return device_problem(leadline::hal::parse_uri(uri).spec, use, may_be_missing);
  };
  assert_string_equal(problem("serial:" + folder).c_str(),
                      ("\"serial:" + folder + ":115200\": is a folder").c_str());
  assert_true(problem("serial:" + file).find("is no serial device") != std::string::npos);
  assert_true(problem("file:" + folder).find("is a folder") != std::string::npos);
  assert_true(problem("serial:" + folder + "/no").find("No such file") != std::string::npos);
  assert_true(problem("file:" + folder + "/no").find("No such file") != std::string::npos);
  assert_string_equal(problem("serial:" + folder + "/no", FileUse::kRead, true).c_str(), "");
  assert_string_equal(problem("file:" + folder + "/no", FileUse::kWrite).c_str(), "");
  assert_true(problem("file:" + folder + "/no/x", FileUse::kWrite).find("no folder") !=
              std::string::npos);
  assert_string_equal(problem("file:" + file).c_str(), "");
  assert_string_equal(problem("serial:" + pair.path()).c_str(), "");
  assert_string_equal(problem("udp:127.0.0.1:1").c_str(), "");
}

TEST(a_pty_takes_no_name_that_a_file_has) {
  const std::string path = leadline::test::scratch_directory() + "/precious";
  std::ofstream(path) << "data";
  const PtyPair pair(path);
  assert_true(pair.error().find("cannot make the link") != std::string::npos);
  std::string text;
  std::getline(std::ifstream(path), text);
  assert_string_equal(text.c_str(), "data");
}

}  // namespace
