// Commands on Linux: takes them out of the uplink's bytes, has the gate decide, brings the counter to the disk on a
// thread of its own, and then tells the vehicle (firmware/pipeline/command_event.hpp). The vehicle never waits for a
// disk; while one command is on its way there, others are passed over: who sent them repeats them.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "firmware/keys/command_key.hpp"
#include "firmware/keys/counter_file.hpp"
#include "firmware/linux/chunk_buffer.hpp"
#include "firmware/pipeline/command_gate.hpp"
#include "proto/framing.hpp"

namespace leadline::host {

class CommandPort {
 public:
  /// Throws HostError: kUsage (a counter file that is damaged or another key's), kOutput (it cannot be written).
  CommandPort(const CommandKey& key, const std::string& counter_path);
  /// Waits for the disk.
  ~CommandPort();
  CommandPort(const CommandPort&) = delete;
  CommandPort& operator=(const CommandPort&) = delete;

  /// Vehicle thread: what came up the link.
  void hear(const std::uint8_t* data, std::size_t size_bytes, base::TimeUs now_us);
  /// Vehicle thread: puts what is settled into the cycle's input.
  void take(base::TimeUs t_us, ChunkBuffer* chunks);

  [[nodiscard]] std::uint64_t last_counter() const { return gate_.last().counter; }

 private:
  enum class Saving : std::uint8_t { kIdle, kAsked, kSaved, kFailed };

  void judge(const proto::FrameView& frame, base::TimeUs now_us);
  [[nodiscard]] firmware::CommandEvent event_of(firmware::CommandEventKind kind,
                                                std::uint64_t counter) const;
  [[nodiscard]] bool tell(const firmware::CommandEvent& event, base::TimeUs t_us,
                          ChunkBuffer* chunks);
  void run();

  CommandKey key_;
  CounterFile file_;
  firmware::CommandGate gate_;
  proto::FrameDecoderBuffer<proto::kMaxCommand_bytes> decoder_;
  bool repeat_due_ = false;
  bool tallied_ = false;
  base::TimeUs tally_due_us_ = 0;
  std::uint64_t tally_sum_ = 0;
  std::uint8_t body_[proto::kMaxCommandBody_bytes] = {};  ///< of the command under way
  std::size_t body_bytes_ = 0;
  firmware::CommandMark mark_{};  ///< the same; the thread's while kAsked

  std::mutex mutex_;
  std::condition_variable wake_;
  Saving saving_ = Saving::kIdle;
  bool stopping_ = false;
  int failure_ = 0;  ///< errno that was told last
  std::thread thread_;
};

}  // namespace leadline::host
