// Nothing but what has the key, is meant for this vehicle, and is new passes: a million packets that are not.
#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "firmware/keys/command_key.hpp"
#include "firmware/keys/counter_file.hpp"
#include "firmware/pipeline/command_gate.hpp"
#include "host_tools/topside/command_sender.hpp"
#include "proto/framing.hpp"
#include "tests/support/proto_samples.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::CommandAuthenticator;
using leadline::firmware::CommandGate;
using leadline::firmware::CommandMark;
using leadline::firmware::CommandRefusal;
using leadline::firmware::CommandVerdict;
using leadline::host::CommandKey;
using leadline::host::CommandSender;
using leadline::proto::Command;
using leadline::proto::CommandKind;
using leadline::proto::CommandResult;
using leadline::test::Bytes;
using leadline::test::Random;
using leadline::test::spec_bytes;

CommandKey key_of(std::uint8_t first, std::uint16_t vehicle = 3) {
  std::array<std::uint8_t, CommandKey::kKey_bytes> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<std::uint8_t>(first + i);
  }
  return {bytes, vehicle};
}

Bytes payload_of(const CommandSender& sender) {
  leadline::proto::FrameDecoderBuffer<> decoder;
  for (const std::uint8_t byte : sender.frame()) {
    leadline::proto::FrameView frame{};
    if (decoder.decoder().feed(byte, frame)) {
      return {frame.payload, frame.payload + frame.payload_bytes};
    }
  }
  return {};
}

Command of_kind(CommandKind kind) {
  Command command{};
  command.kind = kind;
  return command;
}

Command some_command(Random& random) {
  Command command = of_kind(static_cast<CommandKind>(random.between(1, 7)));
  command.name.size_bytes = static_cast<std::uint8_t>(random.between(0, 64));
  std::memset(command.name.text, 'x', command.name.size_bytes);
  command.parameter = static_cast<leadline::proto::CommandParameter>(random.between(1, 10));
  command.value = static_cast<std::int32_t>(random.next());
  command.tiles = {static_cast<std::uint32_t>(random.between(0, 1000)), 5};
  command.slice = {leadline::proto::SlicePlane::kEast, {1, 2, 3}, 10, 20};
  return command;
}

/// A gate with its key; time goes on by an interval with each packet, so that every tag that comes is checked.
struct Vehicle {
  explicit Vehicle(const CommandKey& its) : key(its) {
    gate.configure(key.id(), key.vehicle(), CommandMark{});
  }
  CommandVerdict judge(const Bytes& payload) {
    now_us += CommandGate::kTagInterval_us;
    leadline::proto::CommandView view{};
    const CommandVerdict verdict =
        gate.judge(payload.data(), payload.size(), now_us, key.authenticator(), view);
    if (verdict == CommandVerdict::kTaken) {
      gate.commit(CommandGate::mark_of(view));
    }
    return verdict;
  }
  [[nodiscard]] std::uint32_t refused(CommandRefusal why) const {
    return gate.refused()[static_cast<std::size_t>(why)];
  }
  const CommandKey& key;
  CommandGate gate;
  TimeUs now_us = 0;
};

TEST(tags_are_as_specified) {
  const CommandKey key = key_of(0);
  assert_int_equal(key.id(), 0x7B712541);
  const Bytes golden = spec_bytes("so that key_id is `7B712541`");
  Command command = of_kind(CommandKind::kSet);
  command.parameter = leadline::proto::CommandParameter::kLinkRate;
  command.value = 9600;
  assert_true(payload_of(CommandSender(key, command, 300)) == golden);
  Vehicle vehicle(key);
  assert_true(vehicle.judge(golden) == CommandVerdict::kTaken);
  const Bytes answer = spec_bytes("Answer to that command:");
  const auto decoded =
      leadline::proto::decode_command_answer(answer.data(), leadline::proto::kCommandAnswer_bytes);
  assert_true(key.right(decoded.value()));
  assert_false(key_of(1).right(decoded.value()));
}

TEST(a_million_packets_that_are_not_the_owners_and_none_passes) {
  Random random;
  const CommandKey key = key_of(0);
  const CommandKey other = key_of(1);
  const CommandKey twin = key_of(0, 4);  // the same key, for another vehicle
  Vehicle vehicle(key);
  std::vector<Bytes> genuine;
  constexpr std::uint64_t kTaken = 64;
  for (std::uint64_t counter = 1; counter <= kTaken; ++counter) {
    genuine.push_back(payload_of(CommandSender(key, some_command(random), counter * 3)));
    assert_true(vehicle.judge(genuine.back()) == CommandVerdict::kTaken);
  }
  const CommandMark last = vehicle.gate.last();
  const std::uint64_t next = last.counter + 1;
  // The owner's next commands, which are on nobody's line yet: what is forged is made of them.
  std::vector<Bytes> unsent;
  std::vector<Bytes> foreign;
  std::vector<Bytes> twins;
  for (std::uint64_t i = 0; i < 64; ++i) {
    unsent.push_back(payload_of(CommandSender(key, some_command(random), next + i)));
    foreign.push_back(payload_of(CommandSender(other, some_command(random), next + i)));
    twins.push_back(payload_of(CommandSender(twin, some_command(random), next + i)));
  }
  const auto some = [&random](const std::vector<Bytes>& of) {
    return of[static_cast<std::size_t>(
        random.between(0, static_cast<std::int64_t>(of.size()) - 1))];
  };
  const auto index = [&random](const Bytes& of) {
    return static_cast<std::size_t>(random.between(0, static_cast<std::int64_t>(of.size()) - 1));
  };
  constexpr int kPackets = 1'000'000;
  int passed = 0;
  for (int i = 0; i < kPackets; ++i) {
    Bytes packet = some(unsent);
    switch (i % 10) {
      case 0:  // replayed
        packet = genuine[static_cast<std::size_t>(random.between(0, kTaken - 2))];
        break;
      case 1:  // one bit is another
        packet[index(packet)] ^= static_cast<std::uint8_t>(1U << random.between(0, 7));
        break;
      case 2:  // shorter
        packet.resize(index(packet));
        break;
      case 3:  // longer
        packet.insert(packet.begin() + static_cast<long>(index(packet)),
                      static_cast<std::uint8_t>(random.next()));
        break;
      case 4:  // of another key
        packet = some(foreign);
        break;
      case 5:  // of another key that calls itself ours
        packet = some(foreign);
        std::copy_n(unsent[0].begin() + 2, 4, packet.begin() + 2);
        break;
      case 6:  // for another vehicle, and one that is renamed
        packet = some(twins);
        packet[6] = static_cast<std::uint8_t>(random.between(0, 1) != 0 ? 3 : 4);
        break;
      case 7:  // of an older version, with and without its tag
        packet[1] =
            static_cast<std::uint8_t>(random.between(0, 1) != 0 ? 0 : random.between(2, 255));
        packet.resize(packet.size() - (random.between(0, 1) != 0 ? 16 : 0));
        break;
      case 8:  // recorded, with a counter of the future
        packet = some(genuine);
        packet[8 + static_cast<std::size_t>(random.between(1, 7))] ^= 0x55U;
        break;
      default:  // a tag of nothing: random, zeros, or that of another command
        for (std::size_t at = packet.size() - 16; at < packet.size(); ++at) {
          packet[at] = static_cast<std::uint8_t>(i % 3 == 0 ? 0U : random.next());
        }
        if (i % 3 == 1) {
          const Bytes from = some(genuine);
          std::copy(from.end() - 16, from.end(), packet.end() - 16);
        }
        break;
    }
    // What chance has put together again is the owner's own.
    if (std::find(unsent.begin(), unsent.end(), packet) != unsent.end() ||
        packet == genuine.back()) {
      continue;
    }
    passed += vehicle.judge(packet) == CommandVerdict::kRefused ? 0 : 1;
  }
  assert_int_equal(passed, 0);
  assert_memory_equal(&vehicle.gate.last(), &last, sizeof last);
  for (const CommandRefusal why :
       {CommandRefusal::kMalformed, CommandRefusal::kVersion, CommandRefusal::kKey,
        CommandRefusal::kVehicle, CommandRefusal::kCounter, CommandRefusal::kTag}) {
    assert_true(vehicle.refused(why) > kPackets / 100);
  }
  // And the owner still may.
  assert_true(vehicle.judge(unsent[0]) == CommandVerdict::kTaken);
  assert_true(vehicle.judge(unsent[0]) == CommandVerdict::kRepeated);
}

TEST(work_before_a_tag_is_bounded_whatever_comes) {
  const CommandKey key = key_of(0);
  Vehicle vehicle(key);
  Bytes forged = payload_of(CommandSender(key, of_kind(CommandKind::kStop), 5));
  forged.back() ^= 1U;
  leadline::proto::CommandView view{};
  // A second of a thousand packets each millisecond.
  for (TimeUs now_us = 0; now_us < 1'000'000; ++now_us) {
    assert_true(vehicle.gate.judge(forged.data(), forged.size(), now_us, key.authenticator(),
                                   view) == CommandVerdict::kRefused);
  }
  const std::uint64_t checked = vehicle.gate.tags_checked();
  assert_in_range(checked, 200, 200 + CommandGate::kTagBurst);
  assert_int_equal(vehicle.refused(CommandRefusal::kTag), checked);
  assert_int_equal(vehicle.refused(CommandRefusal::kTooMany), 1'000'000 - checked);
}

TEST(counters_end_and_do_not_begin_again) {
  const CommandKey key = key_of(0);
  Vehicle vehicle(key);
  const auto stop = [&key](std::uint64_t counter) {
    return payload_of(CommandSender(key, of_kind(CommandKind::kStop), counter));
  };
  assert_true(vehicle.judge(stop(UINT64_MAX - 1)) == CommandVerdict::kTaken);
  assert_true(vehicle.judge(stop(UINT64_MAX)) == CommandVerdict::kTaken);
  assert_true(vehicle.judge(stop(UINT64_MAX)) == CommandVerdict::kRepeated);
  for (const std::uint64_t counter : {std::uint64_t{1}, std::uint64_t{1} << 63U, UINT64_MAX - 1}) {
    assert_true(vehicle.judge(stop(counter)) == CommandVerdict::kRefused);
  }
  // The same counter for something else is refused as well, though its tag is right.
  assert_true(vehicle.judge(payload_of(CommandSender(key, of_kind(CommandKind::kSave),
                                                     UINT64_MAX))) == CommandVerdict::kRefused);
  assert_int_equal(vehicle.refused(CommandRefusal::kCounter), 4);
}

TEST(a_sender_believes_only_the_vehicles_answer_and_repeats_until_then) {
  const CommandKey key = key_of(0);
  CommandSender sender(key, of_kind(CommandKind::kStop), 7);
  TimeUs now_us = 5;
  std::vector<TimeUs> sent;
  for (; now_us < 30'000'000; now_us += 1000) {
    if (sender.due(now_us)) {
      sender.note_sent(now_us);
      sent.push_back(now_us);
    }
  }
  assert_in_range(sent.size(), 8, 10);
  assert_in_range(sent[1] - sent[0], 1'000'000, 1'001'000);
  leadline::proto::CommandAnswer answer{key.id(), 7, CommandResult::kDone, {}};
  const auto tell = [&sender](const leadline::proto::CommandAnswer& said) {
    Bytes payload(leadline::proto::kCommandAnswer_bytes);
    assert_true(encode_command_answer(said, payload.data(), payload.size()).ok());
    sender.take(payload.data(), payload.size());
  };
  key.answer_tag(7, CommandResult::kBusy, answer.tag);
  tell(answer);  // that of another result
  answer.counter = 6;
  key.answer_tag(6, CommandResult::kDone, answer.tag);
  tell(answer);  // of another command
  answer.counter = 7;
  key_of(0, 4).answer_tag(7, CommandResult::kDone, answer.tag);
  tell(answer);  // of another vehicle
  assert_false(sender.result().has_value());
  assert_int_equal(sender.forged_answers(), 2);
  key.answer_tag(7, CommandResult::kDone, answer.tag);
  tell(answer);
  assert_true(sender.result() == CommandResult::kDone);
  assert_false(sender.due(INT64_MAX));
}

}  // namespace
