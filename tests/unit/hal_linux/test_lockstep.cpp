#include <cstring>
#include <fstream>
#include <string>
#include <thread>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "hal/linux/lockstep.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::hal::LockstepChannel;
using leadline::hal::LockstepClient;
using leadline::hal::LockstepCounts;
using leadline::hal::LockstepMessage;
using leadline::hal::LockstepServer;
using leadline::hal::LockstepStatus;

constexpr int kLong_ms = 20'000;

std::string socket_path() { return leadline::test::scratch_directory() + "/clock"; }

struct Pair {
  Pair() {
    const std::string path = socket_path();
    assert_true(server.listen(path));
    assert_true(client.connect(path, kLong_ms));
    assert_int_equal(server.accept(kLong_ms), LockstepStatus::kOk);
  }
  LockstepServer server;
  LockstepClient client;
};

TEST(grants_and_answers_carry_time_and_counts) {
  Pair pair;
  LockstepCounts written;
  LockstepCounts requested;
  for (std::uint64_t step = 1; step <= 1000; ++step) {
    const TimeUs t_us = static_cast<TimeUs>(step) * 20'000;
    written.bytes[0] += step;
    written.bytes[15] = step << 40U;
    assert_int_equal(pair.server.grant(t_us, written, kLong_ms), LockstepStatus::kOk);
    LockstepCounts none;
    assert_int_equal(pair.server.wait_answer(none, 0), LockstepStatus::kTimeout);
    TimeUs granted_us = 0;
    LockstepCounts seen;
    assert_int_equal(pair.client.wait_grant(granted_us, seen, kLong_ms), LockstepStatus::kOk);
    assert_int_equal(granted_us, t_us);
    assert_true(seen.bytes == written.bytes);
    requested.bytes[3] += 12;
    assert_int_equal(pair.client.answer(t_us, requested, kLong_ms), LockstepStatus::kOk);
    LockstepCounts back;
    assert_int_equal(pair.server.wait_answer(back, kLong_ms), LockstepStatus::kOk);
    assert_int_equal(back.bytes[3], 12 * step);
  }
  assert_int_equal(pair.server.finish(kLong_ms), LockstepStatus::kOk);
  TimeUs t_us = 0;
  LockstepCounts seen;
  assert_int_equal(pair.client.wait_grant(t_us, seen, kLong_ms), LockstepStatus::kFinished);
}

TEST(time_and_counts_never_go_back) {
  const LockstepCounts none;
  LockstepCounts one;
  one.bytes[2] = 1;
  TimeUs t_us = 0;
  LockstepCounts seen;
  {
    Pair pair;
    assert_int_equal(pair.server.grant(100, none, kLong_ms), LockstepStatus::kOk);
    assert_int_equal(pair.client.wait_grant(t_us, seen, kLong_ms), LockstepStatus::kOk);
    assert_int_equal(pair.server.grant(99, none, kLong_ms), LockstepStatus::kOk);
    assert_int_equal(pair.client.wait_grant(t_us, seen, kLong_ms), LockstepStatus::kProtocol);
  }
  {
    Pair pair;
    assert_int_equal(pair.server.grant(100, one, kLong_ms), LockstepStatus::kOk);
    assert_int_equal(pair.client.wait_grant(t_us, seen, kLong_ms), LockstepStatus::kOk);
    assert_int_equal(pair.server.grant(101, none, kLong_ms), LockstepStatus::kOk);
    assert_int_equal(pair.client.wait_grant(t_us, seen, kLong_ms), LockstepStatus::kProtocol);
  }
  {
    Pair pair;  // an answer to another grant
    assert_int_equal(pair.server.grant(100, none, kLong_ms), LockstepStatus::kOk);
    assert_int_equal(pair.client.answer(99, none, kLong_ms), LockstepStatus::kOk);
    assert_int_equal(pair.server.wait_answer(seen, kLong_ms), LockstepStatus::kProtocol);
  }
}

TEST(a_peer_that_is_gone_is_told_at_once) {
  LockstepServer server;
  const std::string path = socket_path();
  assert_true(server.listen(path));
  LockstepCounts counts;
  {
    LockstepClient client;
    assert_true(client.connect(path, kLong_ms));
    assert_int_equal(server.accept(kLong_ms), LockstepStatus::kOk);
  }
  assert_int_equal(server.wait_answer(counts, kLong_ms), LockstepStatus::kPeerGone);
  assert_int_equal(server.grant(1, counts, kLong_ms), LockstepStatus::kPeerGone);
  // The next vehicle is served by the same emulator.
  LockstepClient again;
  assert_true(again.connect(path, kLong_ms));
  assert_int_equal(server.accept(kLong_ms), LockstepStatus::kOk);
  assert_int_equal(server.grant(5, counts, kLong_ms), LockstepStatus::kOk);
  TimeUs t_us = 0;
  assert_int_equal(again.wait_grant(t_us, counts, kLong_ms), LockstepStatus::kOk);
  LockstepClient unconnected;
  assert_int_equal(unconnected.wait_grant(t_us, counts, 0), LockstepStatus::kPeerGone);
  assert_int_equal(unconnected.answer(0, counts, 0), LockstepStatus::kPeerGone);
}

TEST(silence_ends_in_a_timeout) {
  Pair pair;
  TimeUs t_us = 0;
  LockstepCounts counts;
  assert_int_equal(pair.client.wait_grant(t_us, counts, 20), LockstepStatus::kTimeout);
  assert_int_equal(pair.server.accept(20), LockstepStatus::kTimeout);
  // A peer that never reads: its socket fills up, the sender gives up in time.
  LockstepStatus status = LockstepStatus::kOk;
  for (int i = 0; i < 100'000 && status == LockstepStatus::kOk; ++i) {
    status = pair.server.grant(i, counts, 20);
  }
  assert_int_equal(status, LockstepStatus::kTimeout);
}

TEST(foreign_bytes_are_refused_and_partial_ones_waited_for) {
  int ends[2] = {-1, -1};
  assert_int_equal(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends), 0);
  LockstepChannel channel;
  channel.adopt(ends[0]);
  LockstepMessage message;
  const std::string junk(144, 'j');
  assert_int_equal(::send(ends[1], junk.data(), 143, 0), 143);
  assert_int_equal(channel.receive(message, 10), LockstepStatus::kTimeout);
  assert_int_equal(::send(ends[1], junk.data(), 1, 0), 1);
  assert_int_equal(channel.receive(message, kLong_ms), LockstepStatus::kProtocol);
  ::close(ends[1]);
  assert_int_equal(channel.receive(message, kLong_ms), LockstepStatus::kPeerGone);
}

TEST(an_emulator_that_comes_late_is_waited_for) {
  const std::string path = socket_path();
  LockstepServer server;
  bool listening = false;
  std::thread late([&] { listening = server.listen(path); });
  LockstepClient client;
  const bool connected = client.connect(path, kLong_ms);
  late.join();
  assert_true(listening);
  assert_true(connected);
}

TEST(nobody_there_names_the_path) {
  LockstepClient client;
  assert_false(client.connect("/nowhere/clock", 0));
  assert_true(client.error().find("\"/nowhere/clock\": no emulator listens there") !=
              std::string::npos);
  assert_false(client.connect("", 0));
  assert_false(client.connect(std::string(108, 'x'), 0));
  assert_true(client.error().find("1 to 107 bytes") != std::string::npos);
}

TEST(a_socket_left_by_a_dead_emulator_is_replaced_and_nothing_else) {
  const std::string path = socket_path();
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  std::strncpy(name.sun_path, path.c_str(), sizeof name.sun_path - 1);
  const int dead = ::socket(AF_UNIX, SOCK_STREAM, 0);
  assert_int_equal(::bind(dead, reinterpret_cast<const sockaddr*>(&name), sizeof name), 0);
  ::close(dead);
  LockstepServer server;
  assert_true(server.listen(path));
  LockstepServer second;
  assert_false(second.listen(path));
  assert_true(second.error().find("Address already in use") != std::string::npos);

  const std::string file = leadline::test::scratch_directory() + "/file";
  std::ofstream(file) << "data";
  LockstepServer third;
  assert_false(third.listen(file));
  assert_int_equal(::access(file.c_str(), F_OK), 0);
  assert_false(third.listen("/nowhere/clock"));
}

TEST(only_the_own_socket_is_removed) {
  const std::string path = socket_path();
  {
    LockstepServer server;
    assert_true(server.listen(path));
    assert_int_equal(::unlink(path.c_str()), 0);
    std::ofstream(path) << "somebody else's";
  }
  assert_int_equal(::access(path.c_str(), F_OK), 0);
  assert_int_equal(::unlink(path.c_str()), 0);
  {
    LockstepServer server;
    assert_true(server.listen(path));
  }
  assert_int_equal(::access(path.c_str(), F_OK), -1);
}

}  // namespace
