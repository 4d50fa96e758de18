// Vehicle: commands that were authenticated (command_event.hpp), and what it answers.
#include <cstring>

#include "firmware/pipeline/vehicle.hpp"
#include "model/base/fixed.hpp"

namespace leadline::firmware {
namespace {

using base::Status;
using base::TimeUs;
using model::TileId;
using proto::Command;
using proto::CommandKind;
using proto::CommandParameter;
using proto::CommandResult;

// A refusal is told so often at most.
constexpr TimeUs kRefusalEvery_us = 10'000'000;
// Slices take this part of the link at most.
constexpr TimeUs kSliceShare = 2;

struct ParameterRange {
  std::int32_t low;
  std::int32_t high;
};
// By CommandParameter less 1; as in vehicle.toml.
constexpr ParameterRange kRanges[proto::kCommandParameters] = {
    {10, 125'000'000}, {0, 60'000}, {1, 3'600'000}, {1, 3'600'000}, {1'300'000, 1'700'000},
    {0, 16'777'216},   {1, 4096},   {0, 10'000},    {0, 100},       {0, INT32_MAX},
};

}  // namespace

// The first event of a cycle that is a command is carried out; there is never a second but in a log that somebody
// made, and begin_map() costs as much as the grid is large.
void Vehicle::take_command_event(const InputChunk& chunk, bool& carried_out) {
  CommandEvent event{};
  if (chunk.data == nullptr || !decode_command_event(chunk.data, chunk.size_bytes, event)) {
    ++counters_.chunks_ignored;
    return;
  }
  commands_.keyed = true;
  if (event.kind == CommandEventKind::kTally) {
    for (std::size_t i = 0; i < kCommandRefusals; ++i) {
      const std::uint32_t more = event.refused[i] - commands_.refused[i];
      commands_.refused[i] = event.refused[i];
      counters_.commands_dropped += more;
      if (more != 0) {
        commands_.refusal_text = command_refusal_text(static_cast<CommandRefusal>(i));
      }
    }
    return;
  }
  if (carried_out) {
    ++counters_.chunks_ignored;
    return;
  }
  carried_out = true;
  proto::CommandAnswer& answer = commands_.answer;
  CommandResult result = answer.result;
  if (event.kind == CommandEventKind::kCommand) {
    result = carry_out(event);
    counters_.commands_done += result == CommandResult::kDone ? 1U : 0U;
    counters_.commands_refused += result == CommandResult::kDone ? 0U : 1U;
  } else if (answer.counter != event.counter || answer.key_id != event.key_id) {
    result = CommandResult::kInterrupted;  // of a life before this one
  }
  answer.key_id = event.key_id;
  answer.counter = event.counter;
  answer.result = result;
  std::memcpy(answer.tag, event.answer_tags[static_cast<std::size_t>(result)], sizeof answer.tag);
  commands_.answer_due = true;
}

void Vehicle::note_unkeyed_command() {
  if (!commands_.keyed) {
    ++counters_.commands_dropped;
    commands_.refusal_text = "Command refused: this vehicle has no key";
  }
}

CommandResult Vehicle::carry_out(const CommandEvent& event) {
  const auto decoded = proto::decode_command_body(event.body, event.body_bytes);
  if (!decoded.ok()) {
    return CommandResult::kUnknown;
  }
  const Command& command = decoded.value();
  switch (command.kind) {
    case CommandKind::kStart:
      return start_survey(command.name);
    case CommandKind::kStop:
      commands_.stopped = true;
      return CommandResult::kDone;
    case CommandKind::kSet:
      return set_parameter(command.parameter, command.value);
    case CommandKind::kOrigin:
      return move_origin(command);
    case CommandKind::kSave:
      if (config_.has_store == 0) {
        return CommandResult::kNotHere;
      }
      pager_.hurry(model_.grid());
      return CommandResult::kDone;
    case CommandKind::kTiles:
      return owe_tiles(command.tiles);
    case CommandKind::kSlice:
      return begin_slice(event.counter, command.slice);
  }
  return CommandResult::kUnknown;
}

CommandResult Vehicle::start_survey(const proto::HelloText& name) {
  if (name.size_bytes == 0) {
    commands_.stopped = false;
    return CommandResult::kDone;
  }
  if (config_.has_store != 0) {
    return CommandResult::kNotHere;  // it holds this survey's map
  }
  std::int64_t origin_mm[3] = {config_.model.origin_mm[0], config_.model.origin_mm[1],
                               config_.model.origin_mm[2]};
  const CommandResult result = begin_map(origin_mm);
  if (result == CommandResult::kDone) {
    std::memset(config_.survey_name, 0, sizeof config_.survey_name);
    std::memcpy(config_.survey_name, name.text, name.size_bytes);
    commands_.stopped = false;
  }
  return result;
}

CommandResult Vehicle::move_origin(const Command& command) {
  if (config_.has_store != 0) {
    return CommandResult::kNotHere;
  }
  std::int64_t origin_mm[3] = {command.origin_mm[0], command.origin_mm[1], command.origin_mm[2]};
  if (command.centred != 0) {
    const base::Pose& pose = navigator_.latest();
    if ((pose.validity & base::kPoseHorizontal) == 0) {
      return CommandResult::kNoPosition;
    }
    for (int axis = 0; axis < 2; ++axis) {
      const std::int64_t side_mm =
          static_cast<std::int64_t>(config_.model.size[axis]) * config_.model.cell_mm;
      origin_mm[axis] = pose.position_um[axis] / 1000 - side_mm / 2;
    }
    origin_mm[base::kDown] = config_.model.origin_mm[base::kDown];
  }
  return begin_map(origin_mm);
}

// Another map from now on, and nothing of the one before in it: voxels, what the link owes, what topsides know.
CommandResult Vehicle::begin_map(const std::int64_t (&origin_mm)[3]) {
  if (model_.restart(origin_mm) != Status::kOk) {
    return CommandResult::kOutOfRange;
  }
  for (int axis = 0; axis < 3; ++axis) {
    config_.model.origin_mm[axis] = origin_mm[axis];
  }
  ++config_.session;
  survey_tag_ = proto::survey_tag(config_.survey_id, config_.session);
  reset_map_state();
  watch_.hello_gap_us = 0;  // says hello at once
  watch_.digest_gap_us = 0;
  watch_.digest_due_us = link_us_;
  return CommandResult::kDone;
}

CommandResult Vehicle::set_parameter(CommandParameter parameter, std::int32_t value) {
  const ParameterRange& range = kRanges[static_cast<std::size_t>(parameter) - 1];
  if (value < range.low || value > range.high) {
    return CommandResult::kOutOfRange;
  }
  const auto unsigned_value = static_cast<std::uint32_t>(value);
  LinkConfig& link = config_.link;
  switch (parameter) {
    case CommandParameter::kLinkRate:
      link.rate_bytes_s = unsigned_value;
      watch_.hello_gap_us = 0;  // the hello says it
      downlink_.set_rate(unsigned_value);
      break;
    case CommandParameter::kMaxTileAge:
      link.max_tile_age_us = unsigned_value * 1000U;
      break;
    case CommandParameter::kStatusInterval:
      link.status_interval_us = unsigned_value * 1000U;
      watch_.status_due_us =
          base::min_of<TimeUs>(watch_.status_due_us, link_us_ + link.status_interval_us);
      break;
    case CommandParameter::kHelloInterval:
      link.hello_interval_us = unsigned_value * 1000U;
      watch_.hello_due_us =
          base::min_of<TimeUs>(watch_.hello_due_us, link_us_ + link.hello_interval_us);
      break;
    case CommandParameter::kSoundSpeed:
      return sound_path_.set_water_speed(value) == Status::kOk ? CommandResult::kDone
                                                               : CommandResult::kNotHere;
    case CommandParameter::kVoxelBudget:
      config_.cycle_voxel_budget = unsigned_value;
      break;
    case CommandParameter::kTileBudget:
      config_.cycle_tile_budget = unsigned_value;
      break;
    case CommandParameter::kMaxWait:
      config_.navigation.max_wait_us = value * 1000;
      break;
    case CommandParameter::kQualityWeight:
      for (PortConfig& port : config_.ports) {
        port.quality_weight_percent = value;
      }
      break;
    case CommandParameter::kMinRange:
      return set_min_range(std::int64_t{value} * 1000);
  }
  return CommandResult::kDone;
}

CommandResult Vehicle::set_min_range(std::int64_t min_range_um) {
  for (int port = 0; port < config_.port_count; ++port) {
    if (is_head(config_.ports[port].driver) && min_range_um >= config_.ports[port].max_range_um) {
      return CommandResult::kOutOfRange;
    }
  }
  for (model::EchoDetectorConfig& detector : detector_) {
    detector.min_range_um = min_range_um;
  }
  return CommandResult::kDone;
}

CommandResult Vehicle::owe_tiles(const proto::TileRange& tiles) {
  const TileId tile_count = model_.grid().tile_count();
  if (tiles.first >= tile_count) {
    return CommandResult::kOutsideGrid;
  }
  const TileId end = tiles.first + base::min_of(tiles.count, tile_count - tiles.first);
  for (TileId tile = tiles.first; tile < end; ++tile) {
    if (model_.grid().tile(tile).generation != 0) {
      owe(tile);
    }
  }
  return CommandResult::kDone;
}

CommandResult Vehicle::begin_slice(std::uint64_t counter, const proto::SliceBox& box) {
  if (commands_.slice.row_count > 0) {
    return CommandResult::kBusy;
  }
  const model::Grid& grid = model_.grid();
  const proto::SliceCell last = proto::slice_cell(box, box.rows - 1U, box.columns - 1U);
  if (last.north >= static_cast<std::uint32_t>(grid.north_cells()) ||
      last.east >= static_cast<std::uint32_t>(grid.east_cells()) ||
      last.down >= static_cast<std::uint32_t>(grid.depth_cells())) {
    return CommandResult::kOutsideGrid;
  }
  commands_.slice = proto::SlicePart{survey_tag_, static_cast<std::uint32_t>(counter & 0xFFFFFFFFU),
                                     box, 0, box.rows};
  commands_.slice_due_us = link_us_;
  return CommandResult::kDone;
}

void Vehicle::send_command_answer() {
  if (commands_.answer_due &&
      put(proto::encode_command_answer(commands_.answer, payload_.data(), payload_.size()))) {
    commands_.answer_due = false;
  }
}

void Vehicle::send_refusal_text() {
  if (commands_.refusal_text == nullptr || link_us_ < commands_.refusal_due_us) {
    return;
  }
  const proto::Text text =
      proto::make_text(now_us_, proto::Severity::kWarning, commands_.refusal_text);
  if (put(proto::encode_text(text, payload_.data(), payload_.size()))) {
    commands_.refusal_text = nullptr;
    commands_.refusal_due_us = link_us_ + kRefusalEvery_us;
  }
}

// One part a cycle at most, read from the voxels as they are now; slice.first_row and row_count are what is left.
void Vehicle::send_slice() {
  proto::SlicePart& left = commands_.slice;
  if (left.row_count == 0 || link_us_ < commands_.slice_due_us || frame_waits_) {
    return;
  }
  const std::size_t frame_bytes = frame_limit_bytes();
  if (downlink_.free_bytes() < frame_bytes) {
    frame_waits_ = true;  // or tile deltas would leave no room ever
    return;
  }
  const model::Grid& grid = model_.grid();
  proto::SliceWriter part(left, payload_.data(), proto::max_payload_bytes(frame_bytes));
  std::uint8_t levels[proto::kMaxSliceSide];
  bool room = true;
  while (room && part.rows() < left.row_count) {
    for (std::uint32_t column = 0; column < left.box.columns; ++column) {
      const proto::SliceCell cell =
          proto::slice_cell(left.box, std::uint32_t{left.first_row} + part.rows(), column);
      const model::Voxel& voxel = grid.column_voxels(grid.column_index(
          static_cast<std::int32_t>(cell.north), static_cast<std::int32_t>(cell.east)))[cell.down];
      levels[column] = proto::slice_level(voxel.hit, voxel.miss);
    }
    room = part.add_row(levels);
  }
  const std::uint64_t before = downlink_.total_bytes();
  if (!put_frame(part.finish(), 0)) {
    return;
  }
  left.first_row = static_cast<std::uint8_t>(left.first_row + part.rows());
  left.row_count = static_cast<std::uint8_t>(left.row_count - part.rows());
  const auto sent_bytes = static_cast<TimeUs>(downlink_.total_bytes() - before);
  commands_.slice_due_us =
      link_us_ + sent_bytes * kSliceShare * 1'000'000 / config_.link.rate_bytes_s;
}

}  // namespace leadline::firmware
