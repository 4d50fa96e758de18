#include "host_tools/topside/command_sender.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>

#include "proto/framing.hpp"

namespace leadline::host {
namespace {

constexpr base::TimeUs kLongestGap_us = 5'000'000;

std::size_t axis_of_rows(const proto::SliceBox& box) {
  return box.plane == proto::SlicePlane::kHorizontal ? 0 : 2;
}

}  // namespace

CommandSender::CommandSender(const CommandKey& key, const proto::Command& command,
                             std::uint64_t counter)
    : key_(key), counter_(counter) {
  std::array<std::uint8_t, proto::kMaxCommand_bytes> payload{};
  const auto covered = proto::encode_command({key.id(), key.vehicle(), counter}, command,
                                             payload.data(), payload.size());
  if (!covered.ok()) {
    throw std::invalid_argument("a command out of its range");
  }
  std::uint8_t tag[proto::kCommandTag_bytes];
  key.tag(payload.data(), covered.value(), tag);
  std::copy(std::begin(tag), std::end(tag), payload.begin() + static_cast<long>(covered.value()));
  const std::size_t payload_bytes = covered.value() + sizeof tag;
  frame_.resize(proto::frame_bound_bytes(payload_bytes));
  frame_.resize(
      proto::encode_frame(payload.data(), payload_bytes, frame_.data(), frame_.size()).value());
}

void CommandSender::note_sent(base::TimeUs now_us) {
  times_sent_ += 1;
  due_us_ = now_us + gap_us_;
  gap_us_ = std::min(gap_us_ * 3 / 2, kLongestGap_us);
}

void CommandSender::take(const std::uint8_t* payload, std::size_t size_bytes) {
  const auto answer = proto::decode_command_answer(payload, size_bytes);
  if (!answer.ok() || answer.value().counter != counter_ || answer.value().key_id != key_.id()) {
    return;
  }
  if (key_.right(answer.value())) {
    result_ = answer.value().result;
  } else {
    forged_ += 1;
  }
}

const char* command_result_text(proto::CommandResult result) {
  switch (result) {
    case proto::CommandResult::kDone:
      return "done";
    case proto::CommandResult::kUnknown:
      return "the vehicle does not know such a command";
    case proto::CommandResult::kOutOfRange:
      return "a value is out of its range";
    case proto::CommandResult::kNotHere:
      return "not with the vehicle's configuration (save without a store; a new map with one; a "
             "sound speed where a profile is given)";
    case proto::CommandResult::kNoPosition:
      return "the vehicle does not know where it is";
    case proto::CommandResult::kOutsideGrid:
      return "outside the grid";
    case proto::CommandResult::kBusy:
      return "another slice is under way";
    case proto::CommandResult::kInterrupted:
      return "the vehicle started over in between: it may be done or not, and is not done again";
  }
  return "an answer of a newer vehicle";
}

const char* command_result_name(proto::CommandResult result) {
  constexpr std::array<const char*, proto::kCommandResults> kNames = {
      "done",        "unknown",      "out_of_range", "not_here",
      "no_position", "outside_grid", "busy",         "interrupted"};
  return kNames[static_cast<std::size_t>(result)];
}

SliceCollector::SliceCollector(const proto::SliceBox& box)
    : box_(box), has_row_(box.rows), levels_(std::size_t{box.rows} * box.columns) {}

bool SliceCollector::take(const std::uint8_t* payload, std::size_t size_bytes) {
  std::array<std::uint8_t, std::size_t{proto::kMaxSliceSide} * proto::kMaxSliceSide> levels{};
  const auto decoded = proto::decode_slice(payload, size_bytes, levels.data());
  if (!decoded.ok()) {
    return false;
  }
  // Asked for again, a slice is a part of the first.
  const proto::SlicePart& part = decoded.value();
  const std::size_t axis = axis_of_rows(box_);
  bool ours = part.box.plane == box_.plane && part.box.columns == box_.columns &&
              part.box.first[axis] >= box_.first[axis];
  for (std::size_t i = 0; i < 3; ++i) {
    ours = ours && (i == axis || part.box.first[i] == box_.first[i]);
  }
  if (!ours) {
    return false;
  }
  bool news = false;
  for (std::size_t row = 0; row < part.row_count; ++row) {
    const std::size_t at = part.box.first[axis] - box_.first[axis] + part.first_row + row;
    if (at < has_row_.size() && !has_row_[at]) {
      has_row_[at] = true;
      news = true;
      std::copy_n(levels.begin() + static_cast<long>(row * box_.columns), box_.columns,
                  levels_.begin() + static_cast<long>(at * box_.columns));
    }
  }
  return news;
}

bool SliceCollector::complete() const {
  return std::find(has_row_.begin(), has_row_.end(), false) == has_row_.end();
}

proto::SliceBox SliceCollector::missing() const {
  proto::SliceBox left = box_;
  const auto first = std::find(has_row_.begin(), has_row_.end(), false) - has_row_.begin();
  const auto behind = has_row_.rend() - std::find(has_row_.rbegin(), has_row_.rend(), false);
  left.first[axis_of_rows(box_)] += static_cast<std::uint32_t>(first);
  left.rows = static_cast<std::uint8_t>(behind - first);
  return left;
}

}  // namespace leadline::host
