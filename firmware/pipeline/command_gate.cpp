#include "firmware/pipeline/command_gate.hpp"

#include <cstring>

#include "model/base/fixed.hpp"

namespace leadline::firmware {

void CommandGate::configure(std::uint32_t key_id, std::uint16_t vehicle, const CommandMark& last) {
  key_id_ = key_id;
  vehicle_ = vehicle;
  last_ = last;
  refilled_us_ = 0;
  tags_left_ = kTagBurst;
  refused_.fill(0);
  tags_checked_ = 0;
}

CommandMark CommandGate::mark_of(const proto::CommandView& view) {
  CommandMark mark{view.header.counter, {}};
  std::memcpy(mark.tag, view.tag, sizeof mark.tag);
  return mark;
}

bool CommandGate::may_check(base::TimeUs now_us) {
  const base::TimeUs intervals = (now_us - refilled_us_) / kTagInterval_us;
  if (intervals > 0) {
    tags_left_ = static_cast<std::uint32_t>(base::min_of<base::TimeUs>(
        kTagBurst, tags_left_ + base::min_of(intervals, base::TimeUs{kTagBurst})));
    refilled_us_ += intervals * kTagInterval_us;
  }
  if (tags_left_ == 0) {
    return false;
  }
  --tags_left_;
  return true;
}

CommandVerdict CommandGate::judge(const std::uint8_t* payload, std::size_t size_bytes,
                                  base::TimeUs now_us, const CommandAuthenticator& authenticator,
                                  proto::CommandView& view) {
  const auto refuse = [this](CommandRefusal refusal) {
    count(refusal);
    return CommandVerdict::kRefused;
  };
  const auto read = proto::read_command(payload, size_bytes);
  if (!read.ok()) {
    return refuse(read.status() == base::Status::kBadVersion ? CommandRefusal::kVersion
                                                             : CommandRefusal::kMalformed);
  }
  view = read.value();
  if (view.header.key_id != key_id_) {
    return refuse(CommandRefusal::kKey);
  }
  if (view.header.vehicle != vehicle_) {
    return refuse(CommandRefusal::kVehicle);
  }
  if (view.header.counter < last_.counter) {
    return refuse(CommandRefusal::kCounter);
  }
  // Of the last counter only the very command that had it; its tag was on the line, so that is no secret.
  const bool again = view.header.counter == last_.counter;
  if (again && std::memcmp(view.tag, last_.tag, sizeof last_.tag) != 0) {
    return refuse(CommandRefusal::kCounter);
  }
  if (!may_check(now_us)) {
    return refuse(CommandRefusal::kTooMany);
  }
  ++tags_checked_;
  if (!authenticator.right(authenticator.context, view.covered, view.covered_bytes, view.tag)) {
    return refuse(CommandRefusal::kTag);
  }
  return again ? CommandVerdict::kRepeated : CommandVerdict::kTaken;
}

}  // namespace leadline::firmware
