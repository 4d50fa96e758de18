#include "host_tools/monitor/page_state.hpp"

#include <nlohmann/json.hpp>

namespace leadline::host {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kDegPerBam16 = 360.0 / 65536.0;
constexpr double kDegPerBam8 = 360.0 / 256.0;

struct OutcomeName {
  proto::PingOutcome outcome;
  const char* key;
};
constexpr OutcomeName kOutcomeNames[] = {
    {proto::kPingFused, "fused"},
    {proto::kPingNoReturn, "no_return"},
    {proto::kPingRangeTooShort, "range_too_short"},
    {proto::kPingRangeTooLong, "range_too_long"},
    {proto::kPingPoseInvalid, "pose_invalid"},
    {proto::kPingTooFar, "too_far"},
    {proto::kPingNotDetected, "not_detected"},
    {proto::kPingNotConfigured, "not_configured"},
    {proto::kPingShed, "shed"},
    {proto::kPingNoPose, "no_pose"},
    {proto::kPingBad, "bad"},
    {proto::kPingPaused, "paused"},
    {proto::kPingStopped, "stopped"},
};

Json map_json(const TileStore& store) {
  const proto::Hello& hello = store.hello();
  Json json;
  const auto text = [](const proto::HelloText& said) {
    return std::string(said.text, said.size_bytes);
  };
  json["name"] = text(hello.survey_name);
  json["vertical_datum"] = text(hello.vertical_datum);
  // As text: a number of 64 bits is not exact in a browser.
  json["survey_id"] = std::to_string(hello.survey_id);
  json["session"] = hello.session;
  json["cell_mm"] = hello.cell_mm;
  json["size_cells"] = hello.size_cells;
  json["origin_mm"] = hello.origin_mm;
  json["known_cells"] = store.known_cells();
  json["known_tiles"] = store.known_tiles();
  json["incomplete_tiles"] = store.tiles_incomplete();
  if (hello.has_geodetic_origin != 0) {
    json["latitude_deg"] = static_cast<double>(hello.latitude_e9deg) * 1e-9;
    json["longitude_deg"] = static_cast<double>(hello.longitude_e9deg) * 1e-9;
  }
  return json;
}

Json pose_json(const proto::Status& status) {
  Json json;
  json["validity"] = status.pose_validity;
  json["epoch"] = status.pose_epoch;
  json["position_mm"] = status.position_mm;
  json["roll_deg"] = static_cast<std::int16_t>(status.roll_bam16) * kDegPerBam16;
  json["pitch_deg"] = static_cast<std::int16_t>(status.pitch_bam16) * kDegPerBam16;
  json["heading_deg"] = status.heading_bam16 * kDegPerBam16;
  json["sigma_cm"] = status.sigma_position_cm;
  return json;
}

Json vehicle_json(const proto::Status& status) {
  Json json;
  json["t_s"] = static_cast<double>(status.t_us) * 1e-6;
  json["alarms"] = status.alarms;
  json["alarm_text"] = alarm_text(status.alarms);
  json["mapping_paused"] = (status.alarms & proto::kAlarmMappingPaused) != 0;
  json["pose"] = pose_json(status);
  for (const OutcomeName& name : kOutcomeNames) {
    json["pings"][name.key] = status.pings[name.outcome];
  }
  json["pings_pending"] = status.pings_pending;
  json["work"] = {{"last", status.work_last_voxels},
                  {"max", status.work_max_voxels},
                  {"bound", status.work_bound_voxels}};
  json["cycle_us"] = {{"last", status.cycle_last_us}, {"max", status.cycle_max_us}};
  json["nav"] = {{"fused", status.nav_fused}, {"rejected", status.nav_rejected}};
  json["beams"] = Json::array();
  for (int k = 0; k < status.swath.beam_count; ++k) {
    const proto::BeamOfNow& beam = status.swath.beams[k];
    json["beams"].push_back({{"azimuth_deg", beam.azimuth_bam8 * kDegPerBam8},
                             {"depression_deg", beam.depression_bam8 * kDegPerBam8},
                             {"range_m", beam.range_dm * 0.1}});
  }
  json["tiles_known"] = status.tiles_known;
  json["tiles_dirty"] = status.tiles_dirty;
  json["queued_bytes"] = status.queued_bytes;
  json["recorder_lost"] = status.recorder_lost;
  json["ports"] = Json::array();
  for (int k = 0; k < status.port_count; ++k) {
    const proto::PortStatus& port = status.ports[k];
    json["ports"].push_back({{"open", port.state != 0},
                             {"bytes_in", port.bytes_in},
                             {"records", port.records},
                             {"bad_frames", port.bad_frames},
                             {"dropped_bytes", port.dropped_bytes}});
  }
  return json;
}

Json player_json(const Player& player) {
  return {{"begin_s", static_cast<double>(player.begin_us()) * 1e-6},
          {"length_s", player.length_s()},
          {"position_s", player.position_s()},
          {"playing", player.playing()},
          {"speed", player.speed()},
          {"seeking", player.seeking()}};
}

Json stored_json(const OpenedSurvey& opened, const std::string& path) {
  std::size_t disputed = 0;
  for (const DisputedCells& cells : opened.disputed) {
    disputed += cells.count();
  }
  return {{"path", path},
          {"number", opened.survey.number},
          {"kind", opened.survey.kind},
          {"begun_unix_s", opened.survey.begun_unix_s},
          {"saved_unix_s", opened.survey.saved_unix_s},
          {"damaged_tiles", opened.load.damaged_tiles},
          {"disputed_cells", disputed}};
}

/// What the vehicle says it may send, unless the pilot knows better.
double budget_bytes_s(const Receiver& receiver, const PageSurroundings& around) {
  if (around.budget_bytes_s > 0.0 || receiver.store() == nullptr) {
    return around.budget_bytes_s;
  }
  return receiver.store()->hello().link_rate_bytes_s;
}

}  // namespace

void PageState::follow(const Receiver& receiver, double now_s) {
  const ReceiverCounters& counters = receiver.counters();
  bytes_.add(now_s, static_cast<std::uint32_t>(counters.bytes));
  frames_.add(now_s, static_cast<std::uint32_t>(counters.frames));
  damaged_.add(now_s, static_cast<std::uint32_t>(counters.damaged_frames));
  if (receiver.status()) {
    fused_.add(static_cast<double>(receiver.status()->t_us) * 1e-6,
               receiver.status()->pings[proto::kPingFused]);
  }
}

void PageState::restart() {
  bytes_.clear();
  frames_.clear();
  damaged_.clear();
  fused_.clear();
}

void PageState::add_notice(const ReceiverNotice& notice, double now_s) {
  notice_count_ += 1;
  notices_.push_back({notice_count_, now_s, notice.severity, notice.text});
  if (notices_.size() > kMaxNotices) {
    notices_.pop_front();
  }
}

std::string PageState::json(const Receiver& receiver, const PageSurroundings& around,
                            double now_s) const {
  const ReceiverCounters& counters = receiver.counters();
  Json json;
  json["type"] = "state";
  json["epoch"] = around.epoch;
  json["viewers"] = around.viewers;
  json["link"] = {{"uri", around.link_uri},
                  {"port", around.port_state},
                  {"refused", around.refused},
                  {"silent_s", around.silent_s},
                  {"bytes_per_s", bytes_.per_second(now_s)},
                  {"budget_bytes_per_s", budget_bytes_s(receiver, around)},
                  {"frames_recent", frames_.sum()},
                  {"damaged_recent", damaged_.sum()},
                  {"frames", counters.frames},
                  {"damaged", counters.damaged_frames},
                  {"malformed", counters.malformed},
                  {"other_surveys", counters.other_surveys},
                  {"bytes", counters.bytes}};
  const TileStore* const map =
      around.stored != nullptr ? around.stored->map.get() : receiver.store();
  json["map"] = map != nullptr ? map_json(*map) : Json();
  if (map != nullptr) {
    json["map"]["coarse_tiles"] = receiver.coarse().tiles();
  }
  if (around.stored != nullptr) {
    json["map"]["name"] = around.stored->survey.name;
    json["stored"] = stored_json(*around.stored, around.stored_path);
  }
  json["vehicle"] = receiver.status() ? vehicle_json(*receiver.status()) : Json();
  if (receiver.status()) {
    json["vehicle"]["fused_per_s"] =
        fused_.per_second(static_cast<double>(receiver.status()->t_us) * 1e-6);
  }
  json["player"] = around.player != nullptr ? player_json(*around.player) : Json();
  json["notices"] = Json::array();
  for (const NumberedNotice& notice : notices_) {
    json["notices"].push_back({{"number", notice.number},
                               {"ago_s", now_s - notice.t_s},
                               {"severity", static_cast<int>(notice.severity)},
                               {"text", notice.text}});
  }
  // Texts of the vehicle are checked UTF-8; names of files need not be.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace leadline::host
