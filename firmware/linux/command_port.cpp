#include "firmware/linux/command_port.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <iostream>

#include "firmware/config/exit_codes.hpp"

namespace leadline::host {
namespace {

constexpr base::TimeUs kTallyEvery_us = 1'000'000;

}  // namespace

CommandPort::CommandPort(const CommandKey& key, const std::string& counter_path)
    : key_(key), file_(counter_path, key.id()) {
  const firmware::CommandMark last = file_.load();
  // Now, not when the first command comes.
  const int problem = file_.save(last);
  if (problem != 0) {
    throw HostError(
        ExitCode::kOutput,
        counter_path + ": the counter of commands cannot be written: " + std::strerror(problem));
  }
  gate_.configure(key_.id(), key_.vehicle(), last);
  thread_ = std::thread([this] { run(); });
}

CommandPort::~CommandPort() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void CommandPort::run() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    wake_.wait(lock, [this] { return stopping_ || saving_ == Saving::kAsked; });
    if (saving_ != Saving::kAsked) {
      return;
    }
    const firmware::CommandMark mark = mark_;
    lock.unlock();
    const int problem = file_.save(mark);
    lock.lock();
    saving_ = problem == 0 ? Saving::kSaved : Saving::kFailed;
    if (problem != failure_ && problem != 0) {
      std::cerr << "leadline-vehicle: " << file_.path()
                << ": commands are refused, their counter cannot be written: "
                << std::strerror(problem) << "\n";
    }
    failure_ = problem;
  }
}

void CommandPort::hear(const std::uint8_t* data, std::size_t size_bytes, base::TimeUs now_us) {
  while (size_bytes > 0) {
    std::size_t used = 0;
    proto::FrameView frame{};
    if (decoder_.decoder().feed(data, size_bytes, used, frame)) {
      judge(frame, now_us);
    }
    data += used;
    size_bytes -= used;
  }
}

void CommandPort::judge(const proto::FrameView& frame, base::TimeUs now_us) {
  if (frame.payload_bytes == 0 ||
      frame.payload[0] != static_cast<std::uint8_t>(proto::MessageType::kCommand)) {
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (saving_ != Saving::kIdle) {
      return;
    }
  }
  proto::CommandView view{};
  const firmware::CommandVerdict verdict =
      gate_.judge(frame.payload, frame.payload_bytes, now_us, key_.authenticator(), view);
  if (verdict == firmware::CommandVerdict::kRepeated) {
    repeat_due_ = true;
  } else if (verdict == firmware::CommandVerdict::kTaken) {
    body_bytes_ = view.body_bytes;
    std::memcpy(body_, view.body, view.body_bytes);
    repeat_due_ = false;  // an older one: nobody waits for its answer any more
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      mark_ = firmware::CommandGate::mark_of(view);
      saving_ = Saving::kAsked;
    }
    wake_.notify_one();
  }
}

firmware::CommandEvent CommandPort::event_of(firmware::CommandEventKind kind,
                                             std::uint64_t counter) const {
  firmware::CommandEvent event{};
  event.kind = kind;
  event.key_id = key_.id();
  event.counter = counter;
  for (std::size_t result = 0; result < proto::kCommandResults; ++result) {
    key_.answer_tag(counter, static_cast<proto::CommandResult>(result), event.answer_tags[result]);
  }
  return event;
}

bool CommandPort::tell(const firmware::CommandEvent& event, base::TimeUs t_us,
                       ChunkBuffer* chunks) {
  std::array<std::uint8_t, firmware::kMaxCommandEvent_bytes> bytes{};
  const std::size_t size = firmware::encode_command_event(event, bytes.data(), bytes.size());
  return chunks->add(firmware::kCommandPort, t_us, bytes.data(), size);
}

void CommandPort::take(base::TimeUs t_us, ChunkBuffer* chunks) {
  std::uint64_t sum = 0;
  for (const std::uint32_t count : gate_.refused()) {
    sum += count;
  }
  if (!tallied_ || (sum != tally_sum_ && t_us >= tally_due_us_)) {
    firmware::CommandEvent tally{};
    tally.kind = firmware::CommandEventKind::kTally;
    tally.key_id = key_.id();
    std::copy(gate_.refused().begin(), gate_.refused().end(), std::begin(tally.refused));
    if (tell(tally, t_us, chunks)) {
      tallied_ = true;
      tally_sum_ = sum;
      tally_due_us_ = t_us + kTallyEvery_us;
    }
  }
  Saving state = Saving::kIdle;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    state = saving_;
  }
  if (state == Saving::kFailed) {
    gate_.note_unsaved();
  } else if (state == Saving::kSaved) {
    firmware::CommandEvent event = event_of(firmware::CommandEventKind::kCommand, mark_.counter);
    event.body = body_;
    event.body_bytes = body_bytes_;
    if (!tell(event, t_us, chunks)) {
      return;  // in the next cycle
    }
    gate_.commit(mark_);
  }
  if (state == Saving::kFailed || state == Saving::kSaved) {
    const std::lock_guard<std::mutex> lock(mutex_);
    saving_ = Saving::kIdle;
  } else if (state == Saving::kIdle && repeat_due_ &&
             tell(event_of(firmware::CommandEventKind::kRepeated, gate_.last().counter), t_us,
                  chunks)) {
    repeat_due_ = false;
  }
}

}  // namespace leadline::host
