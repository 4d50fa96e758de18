#include "firmware/keys/command_key.hpp"

#include <cerrno>
#include <cstring>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include "firmware/config/exit_codes.hpp"
#include "firmware/keys/small_file.hpp"

namespace leadline::host {
namespace {

constexpr const char* kIdLabel = "leadline key id 1";
constexpr const char* kCommandLabel = "leadline command 1";
constexpr const char* kAnswerLabel = "leadline answer 1";
constexpr std::size_t kMac_bytes = 16;
static_assert(kMac_bytes == proto::kCommandTag_bytes);
static_assert(kMac_bytes >= crypto_generichash_BYTES_MIN);
static_assert(CommandKey::kKey_bytes == crypto_generichash_KEYBYTES);

void start_library() {
  if (sodium_init() < 0) {
    throw HostError(ExitCode::kInternal, "libsodium does not start");
  }
}

void mac(const std::array<std::uint8_t, CommandKey::kKey_bytes>& key, const char* label,
         const std::uint8_t* data, std::size_t size_bytes, std::uint8_t (&out)[kMac_bytes]) {
  crypto_generichash_state state;
  crypto_generichash_init(&state, key.data(), key.size(), sizeof out);
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): ASCII as bytes
  crypto_generichash_update(&state, reinterpret_cast<const unsigned char*>(label),
                            std::strlen(label));
  crypto_generichash_update(&state, data, size_bytes);
  crypto_generichash_final(&state, out, sizeof out);
  sodium_memzero(&state, sizeof state);
}

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw HostError(ExitCode::kUsage, path + ": " + why);
}

constexpr const char* kNoKey =
    "is no key of commands: make one with `leadline key new FILE`, or copy it again";

std::uint64_t number(const std::string& path, const std::string& text, int base,
                     std::uint64_t most) {
  std::uint64_t value = 0;
  if (!read_number(text, base, most, &value)) {
    refuse(path, kNoKey);
  }
  return value;
}

}  // namespace

CommandKey::CommandKey(const std::array<std::uint8_t, kKey_bytes>& bytes, std::uint16_t vehicle)
    : bytes_(bytes), vehicle_(vehicle) {
  start_library();
  std::uint8_t id[kMac_bytes];
  mac(bytes_, kIdLabel, nullptr, 0, id);
  for (unsigned i = 0; i < 4; ++i) {
    id_ |= std::uint32_t{id[i]} << (8U * i);
  }
}

CommandKey::~CommandKey() { sodium_memzero(bytes_.data(), bytes_.size()); }

CommandKey CommandKey::random(std::uint16_t vehicle) {
  start_library();
  std::array<std::uint8_t, kKey_bytes> bytes{};
  randombytes_buf(bytes.data(), bytes.size());
  return {bytes, vehicle};
}

void CommandKey::tag(const std::uint8_t* covered, std::size_t covered_bytes,
                     std::uint8_t (&out)[proto::kCommandTag_bytes]) const {
  mac(bytes_, kCommandLabel, covered, covered_bytes, out);
}

bool CommandKey::right(const std::uint8_t* covered, std::size_t covered_bytes,
                       const std::uint8_t* tag) const {
  std::uint8_t own[kMac_bytes];
  mac(bytes_, kCommandLabel, covered, covered_bytes, own);
  return sodium_memcmp(own, tag, sizeof own) == 0;
}

void CommandKey::answer_tag(std::uint64_t counter, proto::CommandResult result,
                            std::uint8_t (&out)[proto::kAnswerTag_bytes]) const {
  std::uint8_t said[4 + 2 + 8 + 1];
  const auto put = [&said](std::size_t at, std::uint64_t value, unsigned bytes) {
    for (unsigned i = 0; i < bytes; ++i) {
      said[at + i] = static_cast<std::uint8_t>((value >> (8U * i)) & 0xFFU);
    }
  };
  put(0, id_, 4);
  put(4, vehicle_, 2);
  put(6, counter, 8);
  put(14, static_cast<std::uint8_t>(result), 1);
  std::uint8_t whole[kMac_bytes];
  mac(bytes_, kAnswerLabel, said, sizeof said, whole);
  std::memcpy(out, whole, sizeof out);
}

bool CommandKey::right(const proto::CommandAnswer& answer) const {
  std::uint8_t own[proto::kAnswerTag_bytes];
  answer_tag(answer.counter, answer.result, own);
  return answer.key_id == id_ && sodium_memcmp(own, answer.tag, sizeof own) == 0;
}

firmware::CommandAuthenticator CommandKey::authenticator() const {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast): and const again in the function
  return {const_cast<CommandKey*>(this), [](void* context, const std::uint8_t* covered,
                                            std::size_t covered_bytes, const std::uint8_t* tag) {
            return static_cast<const CommandKey*>(context)->right(covered, covered_bytes, tag);
          }};
}

CommandKey load_command_key(const std::string& path) {
  SmallFile file(path);
  if (file.problem() != 0) {
    refuse(path,
           std::string("the key of commands cannot be read: ") + std::strerror(file.problem()));
  }
  if (!file.regular()) {
    refuse(path, "the key of commands has to be a file");
  }
  if ((file.mode() & 077U) != 0) {
    refuse(path, "others may read the key of commands (mode " + octal_text(file.mode()) +
                     "): chmod 600 it, and make a new one if somebody may have");
  }
  const std::vector<std::string> lines = file.lines();
  const auto value = [&](std::size_t line, std::string_view name) {
    if (line >= lines.size() || lines[line].compare(0, name.size(), name) != 0) {
      refuse(path, kNoKey);
    }
    return lines[line].substr(name.size());
  };
  if (value(0, "leadline-key ") != "1") {
    refuse(path, "is a key of a newer leadline than this");
  }
  const std::uint64_t vehicle = number(path, value(1, "vehicle "), 10, UINT16_MAX);
  const std::uint64_t id = number(path, value(2, "id "), 16, UINT32_MAX);
  std::string digits = value(3, "key ");
  if (lines.size() != 4 || vehicle == 0 || digits.size() != 2 * CommandKey::kKey_bytes) {
    refuse(path, kNoKey);
  }
  std::array<std::uint8_t, CommandKey::kKey_bytes> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<std::uint8_t>(number(path, digits.substr(2 * i, 2), 16, 255));
  }
  const CommandKey key(bytes, static_cast<std::uint16_t>(vehicle));
  sodium_memzero(bytes.data(), bytes.size());
  sodium_memzero(digits.data(), digits.size());
  if (key.id() != id) {
    refuse(path, std::string("is damaged: its id is not that of its key; ") + kNoKey);
  }
  return key;
}

void write_command_key(const std::string& path, const CommandKey& key) {
  std::string text = "leadline-key 1\nvehicle " + std::to_string(key.vehicle()) + "\nid " +
                     hex_of(key.id()) + "\nkey ";
  for (const std::uint8_t byte : key.bytes()) {
    text += hex_of(byte).substr(6);
  }
  text += "\n";
  const int problem = write_new_file(path, text);
  sodium_memzero(text.data(), text.size());
  if (problem == EEXIST) {
    throw HostError(ExitCode::kOutput, path + ": is there already, and stays as it is");
  }
  if (problem != 0) {
    throw HostError(ExitCode::kOutput, path + ": cannot be written: " + std::strerror(problem));
  }
}

}  // namespace leadline::host
