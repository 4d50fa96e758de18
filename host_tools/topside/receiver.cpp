#include "host_tools/topside/receiver.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "host_tools/exit_codes.hpp"
#include "proto/log.hpp"

namespace leadline::host {
namespace {

/// Packets that are kept for a hello: more than a vehicle sends between two hellos on a fast link.
constexpr std::size_t kMaxEarlyPackets = 4096;
constexpr std::uint8_t kFirstMinorWithReports = 1;
// Of a vehicle that takes no reports, tiles that miss something are asked for this often; by then the
// vehicle's own next word may have come.
constexpr base::TimeUs kAskEvery_us = 2'000'000;
// The question for a hello: again after so many bytes that came without it - the vehicle says it before all else, so it
// is lost by then -, but no sooner than a round trip; and after so long, on a line that was seen to be fast twice what
// those bytes took. Each time half as much more, up to the above.
constexpr double kFirstHelloWait_bytes = 500.0;
constexpr base::TimeUs kLeastHelloWait_us = 20'000;
constexpr base::TimeUs kFirstHelloWait_us = 200'000;
constexpr double kHelloWaitGrows = 1.5;
// Who has a map asks so often for what another survey's deltas may be: they may come from a vehicle that does not hear it.
constexpr int kMostQuestionsOfOthers = 8;

std::string survey_text(const proto::Hello& hello) {
  const std::string name(hello.survey_name.text, hello.survey_name.size_bytes);
  return "survey " + std::to_string(hello.survey_id) + (name.empty() ? "" : " (" + name + ")") +
         ", session " + std::to_string(hello.session);
}

/// Whether two hellos speak of one map.
bool same_map(const proto::Hello& a, const proto::Hello& b) {
  bool same = a.survey_id == b.survey_id && a.session == b.session && a.cell_mm == b.cell_mm;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    same =
        same && a.size_cells[axis] == b.size_cells[axis] && a.origin_mm[axis] == b.origin_mm[axis];
  }
  return same;
}

/// The frame of a payload; none when it could not be made.
std::vector<std::uint8_t> framed(const std::uint8_t* payload,
                                 const base::Result<std::size_t>& payload_bytes) {
  if (!payload_bytes.ok()) {
    return {};
  }
  std::vector<std::uint8_t> frame(proto::frame_bound_bytes(payload_bytes.value()));
  const auto size = proto::encode_frame(payload, payload_bytes.value(), frame.data(), frame.size());
  frame.resize(size.ok() ? size.value() : 0);
  return frame;
}

struct AlarmName {
  std::uint32_t bit;
  const char* words;
};
constexpr AlarmName kAlarmNames[] = {
    {proto::kAlarmMappingPaused, "mapping paused"},
    {proto::kAlarmNoPose, "no pose"},
    {proto::kAlarmPortLost, "a port is lost"},
    {proto::kAlarmPortSilent, "a device is silent"},
    {proto::kAlarmRecorderLost, "the recorder lost records"},
    {proto::kAlarmShed, "pings were shed"},
    {proto::kAlarmQueueFull, "ping queue full"},
    {proto::kAlarmLinkBehind, "the link lags behind the map"},
    {proto::kAlarmTimeStepped, "time went back"},
    {proto::kAlarmOutsideGrid, "outside the grid"},
    {proto::kAlarmInputDropped, "device bytes dropped"},
    {proto::kAlarmPoseEpoch, "navigation jumped"},
    {proto::kAlarmRestarted, "the vehicle failed and started over"},
    {proto::kAlarmLeak, "leak"},
    {proto::kAlarmStopped, "survey stopped by command"},
    {proto::kAlarmForeignTopside, "a topside of another version is refused"},
    {proto::kAlarmStoreFailing, "the vehicle's store cannot save the map"},
};

}  // namespace

std::vector<std::uint8_t> hello_request_frame() {
  std::uint8_t payload[proto::kHelloRequest_bytes];
  return framed(payload, proto::encode_hello_request(payload, sizeof payload));
}

std::string alarm_text(std::uint32_t alarms) {
  std::string text;
  const auto append = [&text](const std::string& words) {
    text += (text.empty() ? "" : ", ") + words;
  };
  for (const AlarmName& name : kAlarmNames) {
    if ((alarms & name.bit) != 0) {
      append(name.words);
      alarms &= ~name.bit;
    }
  }
  for (std::uint32_t bit = 0; bit < 32; ++bit) {
    if (((alarms >> bit) & 1U) != 0) {
      append("alarm " + std::to_string(bit));
    }
  }
  return text;
}

Receiver::Receiver(std::optional<std::uint64_t> survey_id) : wanted_survey_(survey_id) {}

void Receiver::feed(const std::uint8_t* data, std::size_t size_bytes) {
  counters_.bytes += size_bytes;
  while (size_bytes > 0) {
    std::size_t used = 0;
    proto::FrameView frame{};
    const bool complete = buffer_.decoder().feed(data, size_bytes, used, frame);
    wire_bytes_ += used;
    if (complete) {
      take(frame);
      wire_bytes_ = 0;
    }
    data += used;
    size_bytes -= used;
  }
  const proto::FrameCounters& framing = buffer_.decoder().counters();
  counters_.frames = framing.frames;
  counters_.damaged_frames =
      std::uint64_t{framing.bad_crc} + framing.bad_code + framing.too_short + framing.too_long;
}

void Receiver::take(const proto::FrameView& frame) {
  proto::MessageType type{};
  if (!proto::message_type(frame.payload, frame.payload_bytes, type)) {
    counters_.unknown_types += 1;
    return;
  }
  if (type < proto::MessageType::kResendRequest) {
    counters_.link_bytes += wire_bytes_;
    question_.wanted = question_.wanted || counters_.hellos == 0;
    planner_.note_bytes(wire_bytes_);
  }
  switch (type) {
    case proto::MessageType::kHello:
      take_hello(frame);
      break;
    case proto::MessageType::kTileDelta:
      take_delta(frame.payload, frame.payload_bytes, wire_bytes_);
      break;
    case proto::MessageType::kCoarseDelta:
      take_coarse(frame.payload, frame.payload_bytes, wire_bytes_);
      break;
    case proto::MessageType::kStatus:
      take_status(frame);
      break;
    case proto::MessageType::kBrief:
      take_brief(frame);
      break;
    case proto::MessageType::kText:
      take_text(frame);
      break;
    case proto::MessageType::kDigest:
      take_digest(frame);
      break;
    case proto::MessageType::kQuestion:
      take_question(frame);
      break;
    case proto::MessageType::kCommandAnswer:
    case proto::MessageType::kSlice:
      break;  // of whoever gave a command
    case proto::MessageType::kResendRequest:
    case proto::MessageType::kHelloRequest:
    case proto::MessageType::kReport:
    case proto::MessageType::kDigestRequest:
    case proto::MessageType::kLook:
    case proto::MessageType::kCommand:
      break;  // the echo of our own
    case proto::MessageType::kLogEnd:
      take_end(frame);
      counters_.log_records += 1;
      break;
    default:
      counters_.log_records += 1;
      break;
  }
}

void Receiver::take_hello(const proto::FrameView& frame) {
  const auto hello = proto::decode_hello(frame.payload, frame.payload_bytes);
  if (hello.status() == base::Status::kBadVersion) {
    const int major = frame.payload_bytes > 1 ? frame.payload[1] : 0;
    throw HostError(ExitCode::kInput, "receive: the vehicle speaks version " +
                                          std::to_string(major) +
                                          " of the protocol, this program version " +
                                          std::to_string(proto::kProtocolMajor) +
                                          ": use the leadline that belongs to the vehicle");
  }
  if (!hello.ok()) {
    counters_.malformed += 1;
    return;
  }
  counters_.hellos += 1;
  const proto::Hello& said = hello.value();
  explain(proto::survey_tag(said.survey_id, said.session));
  if (wanted_survey_ && said.survey_id != *wanted_survey_) {
    if (!foreign_noticed_) {
      notice(proto::Severity::kWarning, survey_text(said) + " is on the link and passed over");
    }
    foreign_noticed_ = true;
    return;
  }
  if (store_ && same_map(store_->hello(), said)) {
    // A vehicle without an origin of its own takes the first fix, after it has said hello.
    if (said.has_geodetic_origin != 0) {
      store_->take_place(said);
    }
    return;
  }
  if (store_) {
    notice(proto::Severity::kWarning, "a new map begins: " + survey_text(said));
    if (on_replaced) {
      on_replaced(*store_);
    }
  } else {
    notice(proto::Severity::kInfo, survey_text(said) + ": " + std::to_string(said.size_cells[0]) +
                                       " x " + std::to_string(said.size_cells[1]) + " cells of " +
                                       std::to_string(said.cell_mm) + " mm");
  }
  if (said.schema_hash != proto::schema_hash()) {
    const bool older = said.protocol_minor < proto::kProtocolMinor;
    notice(proto::Severity::kInfo,
           "the vehicle speaks minor version " + std::to_string(said.protocol_minor) +
               " of the protocol, this program " + std::to_string(proto::kProtocolMinor) +
               (older ? ": what came later is not said"
                      : ": what this program does not know of it is passed over"));
  }
  if (store_) {
    status_.reset();  // of the map before
  }
  store_ = std::make_unique<TileStore>(said);
  coarse_.clear();
  planner_.restart();
  if (on_begun) {
    on_begun(*store_);
  }
  vehicle_cells_hash_.reset();
  resend_after_ = 0;
  map_cells_ = 0;
  cells_lost_ = cells_made_up_ = 0;
  cells_lost_when_asked_.reset();
  take_early();
  if (status_) {
    compare_sent(true);
  }
}

// A hello has come for this tag. Of other deltas that wait for theirs the question goes on.
void Receiver::explain(std::uint16_t tag) {
  explained_.insert(tag);
  if (!question_.tag || *question_.tag == tag) {
    question_ = {};
  }
}

// What came of this map before its hello, in the order in which it came.
void Receiver::take_early() {
  std::vector<EarlyPacket> others;
  std::vector<EarlyPacket> early = std::exchange(early_, {});
  for (EarlyPacket& packet : early) {
    proto::MessageType type{};
    if (packet.tag != store_->tag()) {
      others.push_back(std::move(packet));
    } else if (proto::message_type(packet.payload.data(), packet.payload.size(), type) &&
               type == proto::MessageType::kCoarseDelta) {
      take_coarse(packet.payload.data(), packet.payload.size(), packet.wire_bytes);
    } else {
      take_delta(packet.payload.data(), packet.payload.size(), packet.wire_bytes);
    }
  }
  early_ = std::move(others);
}

// Nobody says whose deltas these are.
void Receiver::give_up_early(std::uint16_t tag) {
  const auto kept = std::remove_if(early_.begin(), early_.end(),
                                   [tag](const EarlyPacket& each) { return each.tag == tag; });
  counters_.before_hello += static_cast<std::uint64_t>(early_.end() - kept);
  early_.erase(kept, early_.end());
  explain(tag);
}

// Whether deltas of this tag are of the map that there is. Others are kept as long as a hello may make them its own.
bool Receiver::of_this_map(std::uint16_t tag, const std::uint8_t* payload, std::size_t size_bytes,
                           std::size_t wire_bytes) {
  if (store_ && tag == store_->tag()) {
    return true;
  }
  if (explained_.count(tag) != 0) {
    counters_.other_surveys += 1;
    return false;
  }
  if (!question_.wanted || !question_.tag) {
    question_.wanted = true;
    question_.tag = tag;
  }
  if (early_.size() < kMaxEarlyPackets) {
    early_.push_back({tag, {payload, payload + size_bytes}, wire_bytes});
  } else {
    counters_.before_hello += 1;
  }
  return false;
}

void Receiver::take_delta(const std::uint8_t* payload, std::size_t size_bytes,
                          std::size_t wire_bytes) {
  proto::TilePacketDecoder packet;
  if (packet.open(payload, size_bytes) != base::Status::kOk) {
    counters_.malformed += 1;
    return;
  }
  if (!of_this_map(packet.survey_tag(), payload, size_bytes, wire_bytes)) {
    return;
  }
  proto::TileDelta delta;
  std::uint32_t number = 0;
  while (packet.next(delta)) {
    number = delta.generation;
    const DeltaOutcome outcome = store_->apply(delta);
    coarse_.settle(delta.tile, *store_);
    counters_.deltas += 1;
    counters_.delta_cells += static_cast<std::uint64_t>(delta.cell_count);
    map_cells_ += static_cast<std::uint64_t>(delta.cell_count);
    counters_.repeated_cells += static_cast<std::uint64_t>(outcome.repeated_cells);
    counters_.outside_grid += outcome.outside ? 1U : 0U;
  }
  if (packet.status() == base::Status::kOk) {
    planner_.note_cells(number, wire_bytes);
  } else {
    counters_.malformed += 1;
  }
  counters_.delta_bytes += wire_bytes;
}

void Receiver::take_coarse(const std::uint8_t* payload, std::size_t size_bytes,
                           std::size_t wire_bytes) {
  proto::TilePacketDecoder packet;
  if (packet.open(payload, size_bytes, proto::TileScale::kCoarse) != base::Status::kOk) {
    counters_.malformed += 1;
    return;
  }
  if (!of_this_map(packet.survey_tag(), payload, size_bytes, wire_bytes)) {
    return;
  }
  proto::TileDelta coarse;
  std::uint32_t number = 0;
  while (packet.next(coarse)) {
    number = coarse.generation;
    counters_.coarse_deltas += 1;
    counters_.outside_grid += coarse_.apply(coarse, *store_) ? 0U : 1U;
  }
  if (packet.status() == base::Status::kOk) {
    planner_.note_cells(number, wire_bytes);
  } else {
    counters_.malformed += 1;
  }
}

void Receiver::take_question(const proto::FrameView& frame) {
  const auto question = proto::decode_question(frame.payload, frame.payload_bytes);
  if (!question.ok()) {
    counters_.malformed += 1;
  } else if (!store_ || question.value().survey_tag != store_->tag()) {
    counters_.other_surveys += store_ ? 1U : 0U;
  } else {
    planner_.note_question(question.value());
  }
}

void Receiver::take_status(const proto::FrameView& frame) {
  const auto status = proto::decode_status(frame.payload, frame.payload_bytes);
  if (!status.ok()) {
    counters_.malformed += 1;
    return;
  }
  counters_.statuses += 1;
  const bool first = !status_;
  status_ = status.value();
  compare_sent(first);
}

void Receiver::take_brief(const proto::FrameView& frame) {
  const auto brief = proto::decode_brief(frame.payload, frame.payload_bytes);
  if (!brief.ok()) {
    counters_.malformed += 1;
    return;
  }
  counters_.statuses += 1;
  const bool first = !status_;
  if (first) {
    status_.emplace();
  }
  proto::apply_brief(brief.value(), *status_);
  compare_sent(first);
}

void Receiver::compare_sent(bool first) {
  cells_lost_ = status_->cells_sent - static_cast<std::uint32_t>(map_cells_);
  if (first) {
    // Who joins now misses whole tiles, or parts that their hashes tell of: no need to count.
    cells_made_up_ = cells_lost_;
  }
}

void Receiver::take_text(const proto::FrameView& frame) {
  const auto text = proto::decode_text(frame.payload, frame.payload_bytes);
  if (!text.ok()) {
    counters_.malformed += 1;
    return;
  }
  counters_.texts += 1;
  notice(text.value().severity, std::string(text.value().text, text.value().size_bytes));
}

void Receiver::take_digest(const proto::FrameView& frame) {
  const auto digest = proto::decode_digest(frame.payload, frame.payload_bytes);
  if (!digest.ok()) {
    counters_.malformed += 1;
    return;
  }
  counters_.digests += 1;
  if (store_ && digest.value().survey_tag == store_->tag()) {
    planner_.note_digest(digest.value(), *store_);
  }
}

void Receiver::take_end(const proto::FrameView& frame) {
  const auto end = proto::decode_log_end(frame.payload, frame.payload_bytes);
  if (end.ok()) {
    vehicle_cells_hash_ = end.value().cells_hash;
  }
}

void Receiver::notice(proto::Severity severity, std::string text) {
  notices_.push_back({severity, std::move(text)});
}

double Receiver::bytes_per_changed_cell() const {
  return counters_.delta_cells == 0 ? 0.0
                                    : static_cast<double>(counters_.delta_bytes) /
                                          static_cast<double>(counters_.delta_cells);
}

double Receiver::bytes_per_changed_cell_all() const {
  return counters_.delta_cells == 0 ? 0.0
                                    : static_cast<double>(counters_.link_bytes) /
                                          static_cast<double>(counters_.delta_cells);
}

std::optional<double> Receiver::work_share() const {
  if (!status_ || status_->work_bound_voxels == 0) {
    return std::nullopt;
  }
  return static_cast<double>(status_->work_max_voxels) /
         static_cast<double>(status_->work_bound_voxels);
}

std::vector<ReceiverNotice> Receiver::take_notices() { return std::exchange(notices_, {}); }

// Tiles that the vehicle is owed a request for at this moment, if any.
proto::ResendRequest Receiver::wanted() {
  proto::ResendRequest request = store_->missing(resend_after_);
  if (request.range_count == 0) {
    request = store_->missing(0);
  }
  const bool quiet = status_ && status_->tiles_dirty == 0;
  if (request.range_count > 0 || !quiet) {
    return request;
  }
  if (store_->known_tiles() < status_->tiles_known) {
    request = store_->unseen(resend_after_);
    return request.range_count > 0 ? request : store_->unseen(0);
  }
  if (cells_lost_ == cells_made_up_) {
    return request;
  }
  if (cells_lost_when_asked_ == cells_lost_) {
    // Everything came again, and nothing was lost on the way.
    cells_made_up_ = cells_lost_;
    cells_lost_when_asked_.reset();
    return request;
  }
  cells_lost_when_asked_ = cells_lost_;
  return store_->everything();
}

bool Receiver::hello_is_asked(base::TimeUs now_us) {
  if (!question_.wanted) {
    return false;
  }
  const auto grown = [](double first, int times) {
    return first * std::pow(kHelloWaitGrows, std::min(times, 30));
  };
  if (question_.asked > 0) {
    const base::TimeUs waited_us = now_us - question_.asked_us;
    const auto came_bytes = static_cast<double>(counters_.link_bytes - question_.asked_bytes);
    const bool lost = waited_us >= kLeastHelloWait_us &&
                      came_bytes >= grown(kFirstHelloWait_bytes, question_.after_bytes);
    const base::TimeUs first_us =
        std::min(kFirstHelloWait_us, 2 * question_.pace_us.value_or(kFirstHelloWait_us));
    const double most_us =
        std::min(grown(static_cast<double>(first_us), question_.asked - 1 - question_.after_bytes),
                 static_cast<double>(kAskEvery_us));
    if (!lost && static_cast<double>(waited_us) < most_us) {
      return false;
    }
    if (store_ && question_.asked == kMostQuestionsOfOthers) {
      give_up_early(*question_.tag);
      return false;
    }
    question_.after_bytes += lost ? 1 : 0;
    if (lost && !question_.pace_us) {
      question_.pace_us = waited_us;
    }
  }
  question_.asked += 1;
  question_.asked_us = now_us;
  question_.asked_bytes = counters_.link_bytes;
  return true;
}

std::vector<std::uint8_t> Receiver::uplink(base::TimeUs now_us) {
  if (hello_is_asked(now_us)) {
    return hello_request_frame();
  }
  if (store_ && store_->hello().protocol_minor >= kFirstMinorWithReports) {
    const std::vector<std::uint8_t> payload = planner_.next(now_us, *store_, status_);
    return payload.empty() ? payload : framed(payload.data(), payload.size());
  }
  if (!store_ || (asked_us_ && now_us - *asked_us_ < kAskEvery_us)) {
    return {};
  }
  std::vector<std::uint8_t> request = resend_request();
  if (!request.empty()) {
    asked_us_ = now_us;
  }
  return request;
}

std::vector<std::uint8_t> Receiver::resend_request() {
  std::uint8_t payload[proto::kMaxResendRequest_bytes];
  if (!store_) {
    return question_.wanted ? hello_request_frame() : std::vector<std::uint8_t>{};
  }
  const proto::ResendRequest request = wanted();
  if (request.range_count == 0) {
    return {};
  }
  const proto::TileRange& last = request.ranges[request.range_count - 1];
  resend_after_ = last.first + last.count;
  return framed(payload, proto::encode_resend_request(request, payload, sizeof payload));
}

}  // namespace leadline::host
