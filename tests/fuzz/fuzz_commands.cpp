// Commands, answers, slices and events of any bytes: nothing is read outside them, what is taken encodes to the same, and
// nothing passes the gate whose tag is not right.
#include <array>
#include <cstdint>
#include <cstring>

#include "firmware/pipeline/command_event.hpp"
#include "firmware/pipeline/command_gate.hpp"
#include "proto/commands.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::fuzz::require;

using namespace leadline::proto;  // NOLINT: every name of the header is under test
namespace firmware = leadline::firmware;

std::array<std::uint8_t, 8192> again;
std::array<std::uint8_t, std::size_t{kMaxSliceSide} * kMaxSliceSide> levels;

void check_body(const std::uint8_t* body, std::size_t size) {
  const auto command = decode_command_body(body, size);
  if (command.ok()) {
    const auto encoded = encode_command_body(command.value(), again.data(), again.size());
    require(encoded.ok() && encoded.value() == size);
    require(std::memcmp(again.data(), body, size) == 0);
  }
}

void check_slice(const std::uint8_t* data, std::size_t size) {
  const auto part = decode_slice(data, size, levels.data());
  if (!part.ok()) {
    return;
  }
  // Runs may be written in more than one way; ours is the shortest.
  SliceWriter writer(part.value(), again.data(), again.size());
  for (std::size_t row = 0; row < part.value().row_count; ++row) {
    require(writer.add_row(levels.data() + row * part.value().box.columns));
  }
  require(writer.finish() <= size);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  check_body(data, size);
  check_slice(data, size);
  const auto answer = decode_command_answer(data, size);
  if (answer.ok()) {
    require(encode_command_answer(answer.value(), again.data(), again.size()).ok());
    require(std::memcmp(again.data(), data, kCommandAnswer_bytes) == 0);
  }
  firmware::CommandEvent event{};
  if (firmware::decode_command_event(data, size, event)) {
    const std::size_t bytes = firmware::encode_command_event(event, again.data(), again.size());
    require(bytes != 0 && bytes <= size && std::memcmp(again.data(), data, bytes) == 0);
  }
  // A gate that any key may open as far as the tag: which is never right here.
  const auto view = read_command(data, size);
  if (view.ok()) {
    check_body(view.value().body, view.value().body_bytes);
    firmware::CommandGate gate;
    gate.configure(view.value().header.key_id, view.value().header.vehicle,
                   firmware::CommandMark{1, {}});
    const firmware::CommandAuthenticator nobody{nullptr, [](void*, const std::uint8_t*, std::size_t,
                                                            const std::uint8_t*) { return false; }};
    CommandView taken{};
    require(gate.judge(data, size, 0, nobody, taken) == firmware::CommandVerdict::kRefused);
  }
  return 0;
}
