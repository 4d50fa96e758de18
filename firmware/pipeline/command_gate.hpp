// Which commands a vehicle takes (proto/SPEC.md, "Command"): the decision, for whoever has a key. The tag itself is
// checked by an authenticator that is handed in (on Linux: firmware/keys, libsodium), so that this is vehicle code
// without a library. There is no way around the tag.
//
//   view = {};
//   switch (gate.judge(payload, size, now_us, authenticator, view)) {
//     case kTaken:     save gate.mark_of(view), and when that is safe: gate.commit(mark), tell the vehicle
//     case kRepeated:  tell the vehicle to answer again
//     case kRefused:   counted
//   }
//
// Work before a tag is looked at: a few comparisons. Tags: kTagBurst at once, then one each kTagInterval_us.
// No heap, no clock, no I/O. Not thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/pipeline/command_event.hpp"
#include "model/base/units.hpp"
#include "proto/commands.hpp"

namespace leadline::firmware {

/// Whoever has the key.
struct CommandAuthenticator {
  void* context;
  /// Whether `tag` (proto::kCommandTag_bytes) is that of the bytes; in constant time.
  bool (*right)(void* context, const std::uint8_t* covered, std::size_t covered_bytes,
                const std::uint8_t* tag);
};

/// The last command that was taken: what has to outlive a power cut.
struct CommandMark {
  std::uint64_t counter;  ///< 0: none yet
  std::uint8_t tag[proto::kCommandTag_bytes];
};

enum class CommandVerdict : std::uint8_t { kRefused, kTaken, kRepeated };

class CommandGate {
 public:
  static constexpr std::uint32_t kTagBurst = 8;
  static constexpr base::TimeUs kTagInterval_us = 5'000;

  CommandGate() = default;

  /// The key's number, the vehicle's, and the last command taken before.
  void configure(std::uint32_t key_id, std::uint16_t vehicle, const CommandMark& last);

  /// `now_us` does not go back. `view` is set for kTaken and kRepeated. Nothing but counts changes: a command is used
  /// up by commit() alone.
  [[nodiscard]] CommandVerdict judge(const std::uint8_t* payload, std::size_t size_bytes,
                                     base::TimeUs now_us, const CommandAuthenticator& authenticator,
                                     proto::CommandView& view);
  [[nodiscard]] static CommandMark mark_of(const proto::CommandView& view);
  /// The mark is safe: neither this counter nor one below it is taken any more.
  void commit(const CommandMark& mark) { last_ = mark; }
  /// The mark could not be saved: the command is not done.
  void note_unsaved() { count(CommandRefusal::kNotSaved); }

  [[nodiscard]] const CommandMark& last() const { return last_; }
  [[nodiscard]] std::uint32_t key_id() const { return key_id_; }
  [[nodiscard]] std::uint16_t vehicle() const { return vehicle_; }
  /// By CommandRefusal; wraps at 2^32.
  [[nodiscard]] const std::array<std::uint32_t, kCommandRefusals>& refused() const {
    return refused_;
  }
  /// Tags that were checked.
  [[nodiscard]] std::uint64_t tags_checked() const { return tags_checked_; }

 private:
  void count(CommandRefusal refusal) { ++refused_[static_cast<std::size_t>(refusal)]; }
  [[nodiscard]] bool may_check(base::TimeUs now_us);

  std::uint32_t key_id_ = 0;
  std::uint16_t vehicle_ = 0;
  CommandMark last_{};
  base::TimeUs refilled_us_ = 0;
  std::uint32_t tags_left_ = kTagBurst;
  std::array<std::uint32_t, kCommandRefusals> refused_{};
  std::uint64_t tags_checked_ = 0;
};

}  // namespace leadline::firmware
