#include <cstring>

#include "proto/commands.hpp"
#include "proto/framing.hpp"
#include "tests/support/proto_samples.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::test::Bytes;
using leadline::test::from_hex;
using leadline::test::Random;
using leadline::test::spec_block;
using leadline::test::spec_bytes;
using namespace leadline::proto;  // NOLINT: every name of the header is under test
using BaseStatus = leadline::base::Status;

constexpr const char* kBodies = "Kinds with their fields:";
constexpr const char* kAnswerAndSlice = "Answer to that command:";

/// The lines of a block of SPEC.md.
std::vector<Bytes> spec_lines(const char* mark) {
  std::vector<Bytes> lines;
  const std::string block = spec_block(mark);
  std::size_t at = 0;
  while (at < block.size()) {
    const std::size_t end = block.find('\n', at);
    lines.push_back(from_hex(block.substr(at, end - at)));
    at = end + 1;
  }
  return lines;
}

HelloText name_of(const char* text) {
  HelloText name{};
  name.size_bytes = static_cast<std::uint8_t>(std::strlen(text));
  std::memcpy(name.text, text, name.size_bytes);
  return name;
}

/// One of each kind, as the SPEC has them.
std::vector<Command> sample_commands() {
  std::vector<Command> commands;
  const auto add = [&commands](CommandKind kind) -> Command& {
    Command command{};
    command.kind = kind;
    commands.push_back(command);
    return commands.back();
  };
  add(CommandKind::kStart).name = name_of("F\xC3\xB6rde");
  add(CommandKind::kStop);
  Command& set = add(CommandKind::kSet);
  set.parameter = CommandParameter::kSoundSpeed;
  set.value = 1'480'000;
  Command& origin = add(CommandKind::kOrigin);
  origin.origin_mm[0] = -1000;
  origin.origin_mm[2] = 11'000;
  add(CommandKind::kSave);
  add(CommandKind::kTiles).tiles = {300, 64};
  add(CommandKind::kSlice).slice = {SlicePlane::kNorth, {300, 5, 0}, 3, 20};
  return commands;
}

Bytes body_of(const Command& command) {
  Bytes bytes(kMaxCommandBody_bytes);
  const auto size = encode_command_body(command, bytes.data(), bytes.size());
  assert_true(size.ok());
  bytes.resize(size.value());
  return bytes;
}

TEST(bodies_are_as_specified) {
  const std::vector<Bytes> golden = spec_lines(kBodies);
  const std::vector<Command> commands = sample_commands();
  assert_int_equal(golden.size(), commands.size());
  for (std::size_t i = 0; i < golden.size(); ++i) {
    assert_true(body_of(commands[i]) == golden[i]);
    const auto back = decode_command_body(golden[i].data(), golden[i].size());
    assert_true(back.ok());
    assert_true(body_of(back.value()) == golden[i]);
    for (std::size_t size = 0; size < golden[i].size(); ++size) {
      assert_false(decode_command_body(golden[i].data(), size).ok());
      Bytes room(size);
      assert_int_equal(
          static_cast<int>(encode_command_body(commands[i], room.data(), size).status()),
          static_cast<int>(BaseStatus::kFull));
    }
    // Nothing may stand behind: nobody knows what it means.
    Bytes longer = golden[i];
    longer.push_back(0);
    assert_int_equal(static_cast<int>(decode_command_body(longer.data(), longer.size()).status()),
                     static_cast<int>(BaseStatus::kOutOfRange));
  }
}

TEST(a_command_is_read_up_to_its_tag) {
  const Bytes golden = spec_bytes("so that key_id is `7B712541`");
  const auto read = read_command(golden.data(), golden.size());
  assert_true(read.ok());
  const CommandView& view = read.value();
  assert_int_equal(view.header.key_id, 0x7B712541);
  assert_int_equal(view.header.vehicle, 3);
  assert_true(view.header.counter == 300);
  assert_true(view.covered == golden.data() && view.covered_bytes == golden.size() - 16);
  assert_true(view.tag == golden.data() + golden.size() - 16);
  const auto command = decode_command_body(view.body, view.body_bytes);
  assert_true(command.ok() && command.value().kind == CommandKind::kSet);
  assert_int_equal(command.value().value, 9600);
  Bytes again(kMaxCommand_bytes);
  const auto size = encode_command(view.header, command.value(), again.data(), again.size());
  assert_int_equal(size.value(), view.covered_bytes);
  assert_memory_equal(again.data(), golden.data(), view.covered_bytes);

  const auto status_of = [](const Bytes& bytes) {
    return static_cast<int>(read_command(bytes.data(), bytes.size()).status());
  };
  // Shorter than the shortest: no command, whatever it says.
  for (std::size_t bytes = 1; bytes <= kCommandHeader_bytes + kCommandTag_bytes; ++bytes) {
    assert_int_equal(status_of(Bytes(golden.begin(), golden.begin() + static_cast<long>(bytes))),
                     static_cast<int>(BaseStatus::kTruncated));
  }
  assert_int_equal(status_of({}), static_cast<int>(BaseStatus::kInvalidArgument));
  Bytes longest(kMaxCommand_bytes, 1);
  longest[0] = 0x45;
  assert_int_equal(status_of(longest), static_cast<int>(BaseStatus::kOk));
  longest.push_back(1);
  assert_int_equal(status_of(longest), static_cast<int>(BaseStatus::kOutOfRange));
  for (const int version : {0, 2, 255}) {
    Bytes other = golden;
    other[1] = static_cast<std::uint8_t>(version);
    assert_int_equal(status_of(other), static_cast<int>(BaseStatus::kBadVersion));
  }
  Bytes nobody = golden;
  nobody[6] = nobody[7] = 0;
  assert_int_equal(status_of(nobody), static_cast<int>(BaseStatus::kOutOfRange));
  Bytes never = golden;
  std::memset(never.data() + 8, 0, 8);
  assert_int_equal(status_of(never), static_cast<int>(BaseStatus::kOutOfRange));
}

TEST(fields_out_of_range_are_refused_both_ways) {
  const auto refused = [](const Command& command) {
    std::uint8_t room[kMaxCommandBody_bytes];
    return encode_command_body(command, room, sizeof room).status() == BaseStatus::kOutOfRange;
  };
  for (Command command : sample_commands()) {
    switch (command.kind) {
      case CommandKind::kStart:
        command.name.text[0] = '\n';
        break;
      case CommandKind::kSet:
        command.parameter = static_cast<CommandParameter>(kCommandParameters + 1);
        break;
      case CommandKind::kOrigin:
        command.centred = 1;  // and yet somewhere else
        break;
      case CommandKind::kTiles:
        command.tiles.count = (1U << 24U) - 299;
        break;
      case CommandKind::kSlice:
        command.slice.rows = kMaxSliceSide + 1;
        break;
      default:
        command.kind = static_cast<CommandKind>(8);
        break;
    }
    assert_true(refused(command));
  }
  const Bytes bad[] = {
      {0},
      {8},
      {1, 65},
      {1, 1, 0x80},
      {3, 0, 0, 0, 0, 0},
      {3, 11, 0, 0, 0, 0},
      {6, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F},
      {7, 3, 0, 0, 0, 1, 1},
      {7, 0, 0, 0, 0, 0, 1},
      {7, 0, 0x80, 0x80, 0x01, 0, 0, 1, 1},
  };
  for (const Bytes& body : bad) {
    assert_int_equal(static_cast<int>(decode_command_body(body.data(), body.size()).status()),
                     static_cast<int>(BaseStatus::kOutOfRange));
  }
}

TEST(answer_is_as_specified) {
  const Bytes golden = spec_lines(kAnswerAndSlice)[0];
  assert_int_equal(golden.size(), kCommandAnswer_bytes);
  const auto answer = decode_command_answer(golden.data(), golden.size());
  assert_true(answer.ok());
  assert_true(answer.value().counter == 300);
  assert_int_equal(static_cast<int>(answer.value().result),
                   static_cast<int>(CommandResult::kOutOfRange));
  Bytes again(kCommandAnswer_bytes);
  assert_true(encode_command_answer(answer.value(), again.data(), again.size()).ok());
  assert_true(again == golden);
  for (std::size_t size = 1; size < golden.size(); ++size) {
    assert_int_equal(static_cast<int>(decode_command_answer(golden.data(), size).status()),
                     static_cast<int>(BaseStatus::kTruncated));
  }
  Bytes other = golden;
  other[13] = kCommandResults;
  assert_int_equal(static_cast<int>(decode_command_answer(other.data(), other.size()).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
}

TEST(a_slice_is_as_specified) {
  const Bytes golden = spec_lines(kAnswerAndSlice)[1];
  std::uint8_t levels[kMaxSliceSide * kMaxSliceSide];
  const auto part = decode_slice(golden.data(), golden.size(), levels);
  assert_true(part.ok());
  assert_int_equal(part.value().request, 300);
  assert_int_equal(part.value().first_row, 1);
  assert_int_equal(part.value().row_count, 2);
  assert_int_equal(levels[19], 0);
  assert_int_equal(levels[20 + 11], 15);
  assert_int_equal(levels[20 + 10], 1);
  assert_int_equal(levels[39], 8);
  Bytes again(golden.size());
  SliceWriter writer(part.value(), again.data(), again.size());
  assert_true(writer.add_row(levels) && writer.add_row(levels + 20));
  assert_int_equal(writer.finish(), golden.size());
  assert_true(again == golden);
  assert_false(writer.add_row(levels));
  for (std::size_t size = 1; size < golden.size(); ++size) {
    assert_false(decode_slice(golden.data(), size, levels).ok());
  }
}

TEST(any_slice_comes_back_in_parts_that_fit) {
  Random random(17);
  const auto below = [&random](std::uint32_t end) {
    return static_cast<std::uint32_t>(random.between(0, std::int64_t{end} - 1));
  };
  for (int round = 0; round < 300; ++round) {
    SlicePart left{};
    left.survey_tag = 7;
    left.request = 9;
    left.box = {static_cast<SlicePlane>(below(3)),
                {below(16'384), 3, 2000},
                static_cast<std::uint8_t>(1 + below(kMaxSliceSide)),
                static_cast<std::uint8_t>(1 + below(kMaxSliceSide))};
    left.row_count = left.box.rows;
    const std::size_t cells = std::size_t{left.box.rows} * left.box.columns;
    std::vector<std::uint8_t> levels(cells);
    const std::uint32_t calm = 1 + below(40);
    for (std::size_t i = 0; i < cells; ++i) {
      levels[i] = i > 0 && below(calm) != 0 ? levels[i - 1] : static_cast<std::uint8_t>(below(16));
    }
    // The least payload that the least MTU leaves.
    Bytes payload(max_payload_bytes(128) + below(1200));
    std::uint8_t back[kMaxSliceSide * kMaxSliceSide];
    while (left.row_count > 0) {
      SliceWriter writer(left, payload.data(), payload.size());
      while (writer.rows() < left.row_count &&
             writer.add_row(levels.data() + std::size_t{left.box.columns} *
                                                (std::size_t{left.first_row} + writer.rows()))) {
      }
      assert_true(writer.rows() > 0);
      const auto part = decode_slice(payload.data(), writer.finish(), back);
      assert_true(part.ok());
      assert_int_equal(part.value().first_row, left.first_row);
      assert_int_equal(part.value().row_count, writer.rows());
      assert_memory_equal(back, levels.data() + std::size_t{left.first_row} * left.box.columns,
                          std::size_t{writer.rows()} * left.box.columns);
      left.first_row = static_cast<std::uint8_t>(left.first_row + writer.rows());
      left.row_count = static_cast<std::uint8_t>(left.row_count - writer.rows());
    }
  }
}

TEST(levels_tell_unknown_empty_and_surface_apart) {
  assert_int_equal(slice_level(0, 0), 0);
  assert_int_equal(slice_level(0, 1), 1);
  assert_int_equal(slice_level(0, 65'535), 1);
  assert_int_equal(slice_level(1, 0), 15);
  assert_int_equal(slice_level(65'535, 65'535), 8);
  assert_int_equal(slice_level(65'535, 0), 15);
  assert_int_equal(slice_level(65'535, 1), 14);
}

TEST(cells_of_a_slice_lie_in_its_plane) {
  const SliceCell flat = slice_cell({SlicePlane::kHorizontal, {10, 20, 30}, 5, 6}, 4, 5);
  assert_true(flat.north == 14 && flat.east == 25 && flat.down == 30);
  const SliceCell north = slice_cell({SlicePlane::kNorth, {10, 20, 30}, 5, 6}, 4, 5);
  assert_true(north.north == 15 && north.east == 20 && north.down == 34);
  const SliceCell east = slice_cell({SlicePlane::kEast, {10, 20, 30}, 5, 6}, 4, 5);
  assert_true(east.north == 10 && east.east == 25 && east.down == 34);
}

}  // namespace
