// Vehicle: what goes to the link, and what comes from it.
#include "firmware/pipeline/vehicle.hpp"
#include "model/base/angle.hpp"
#include "model/base/fixed.hpp"
#include "model/event.hpp"

namespace leadline::firmware {
namespace {

using base::min_of;
using base::TimeUs;
using model::TileId;

// A packet is begun when this much of it can be sent: below, headers eat the line.
constexpr std::size_t kWorthwhileFrame_bytes = 256;
// Of frame_limit_bytes(): about one tile and a half.
constexpr std::size_t kLeastFrames = 32;
constexpr std::size_t kManyFrames = 30;
constexpr std::size_t kLossyFrame_bytes = 160;
constexpr std::size_t kTwoTiles_bytes = 200;
constexpr std::uint32_t kLossy_q16 = 65'536 / 20;
constexpr TimeUs kFirstPatience_us = 300'000;
// Of line_is_busy().
constexpr TimeUs kLongestCycle_us = 200'000;
// A digest is said when nothing has been under way for this long.
constexpr TimeUs kQuiet_us = 300'000;
constexpr std::size_t kFewTiles = 8;
// A digest without its hashes.
constexpr std::size_t kDigestHeader_bytes = 10;
// Where the topside looked last counts for so long.
constexpr TimeUs kLook_us = 60'000'000;
// A topside of another major is spoken of for so long.
constexpr TimeUs kForeign_us = 60'000'000;
// A port that has not said anything intelligible for this long is silent.
constexpr TimeUs kSilence_us = 5'000'000;
// Changes that wait longer than this for the link, in ticks of 32.768 ms: 10 s.
constexpr std::uint32_t kBehind_ticks = 305;
constexpr unsigned kTick_log2us = 15;
constexpr std::uint32_t kTicks_s = 31;
// Hellos come after this, then after twice as long each time, up to the configured interval.
constexpr TimeUs kFirstHelloGap_us = 1'000'000;
// Who asks before a hello can have come gets none for it: it is through the line, and so long under way.
constexpr TimeUs kHelloUnderWay_us = 20'000;
constexpr std::size_t kTypicalHello_bytes = 122;
// Statuses get this part of the link, and one of so many is a full one.
constexpr TimeUs kStatusShare = 16;
constexpr std::uint32_t kStatusesPerFull = 16;
// What was mapped longer ago than this is no beam of now.
constexpr TimeUs kBeamOfNow_us = 2'000'000;
// A survey leaves the grid at every turn. That is said again only after so long inside.
constexpr TimeUs kOutsideEpisode_us = 300'000'000;

struct AlarmText {
  std::uint32_t bit;
  proto::Severity severity;
  const char* text;
};

// What the pilot reads when an alarm begins, and, where there is a second text, when it ends.
constexpr AlarmText kBegins[] = {
    {proto::kAlarmMappingPaused, proto::Severity::kWarning,
     "Mapping paused: position too uncertain"},
    {proto::kAlarmNoPose, proto::Severity::kWarning, "No pose: pings wait or are lost"},
    {proto::kAlarmPortSilent, proto::Severity::kWarning, "A device says nothing intelligible"},
    {proto::kAlarmShed, proto::Severity::kWarning, "Pings shed: more than can be mapped"},
    {proto::kAlarmTimeStepped, proto::Severity::kWarning, "Clock went back"},
    {proto::kAlarmOutsideGrid, proto::Severity::kInfo, "Outside the grid"},
    {proto::kAlarmPoseEpoch, proto::Severity::kWarning, "Navigation jumped: new epoch"},
    {proto::kAlarmRestarted, proto::Severity::kError, "Started over after a failure"},
    {proto::kAlarmLeak, proto::Severity::kError, "LEAK: water in the hull"},
    {proto::kAlarmStopped, proto::Severity::kInfo, "Survey stopped: nothing is mapped"},
    {proto::kAlarmForeignTopside, proto::Severity::kWarning,
     "Topside refused: it speaks another major version"},
    {proto::kAlarmStoreFailing, proto::Severity::kError, "Store: the map cannot be saved"},
};
constexpr AlarmText kEnds[] = {
    {proto::kAlarmMappingPaused, proto::Severity::kInfo, "Mapping goes on"},
    {proto::kAlarmNoPose, proto::Severity::kInfo, "Poses are back"},
    {proto::kAlarmLeak, proto::Severity::kWarning, "Leak switch dry again"},
    {proto::kAlarmStopped, proto::Severity::kInfo, "Survey goes on"},
    {proto::kAlarmStoreFailing, proto::Severity::kInfo, "Store: the map is saved again"},
};
// Bits of "ended" beside those of "began" in one mask.
constexpr std::uint32_t kEndShift = 32;

std::uint32_t low32(std::uint64_t count) { return static_cast<std::uint32_t>(count & 0xFFFFFFFFU); }

std::uint16_t limited16(std::uint32_t value) {
  return static_cast<std::uint16_t>(min_of<std::uint32_t>(value, UINT16_MAX));
}

std::int32_t millimetres(std::int64_t um) {
  return static_cast<std::int32_t>(base::clamp<std::int64_t>(um / 1000, -INT32_MAX, INT32_MAX));
}

}  // namespace

std::uint32_t Vehicle::uplink_errors() {
  const proto::FrameCounters& frames = uplink_.decoder().counters();
  return frames.bad_crc + frames.bad_code + frames.too_short + frames.too_long;
}

void Vehicle::take_uplink(const InputChunk& chunk, std::size_t size_bytes) {
  const TimeUs since_us = base::clamp<TimeUs>(clock_us_ - chunk.t_arrival_us, 0, link_elapsed_us_);
  const std::uint8_t* data = chunk.data;
  proto::FrameDecoder& decoder = uplink_.decoder();
  while (size_bytes > 0) {
    std::size_t used = 0;
    proto::FrameView frame{};
    if (decoder.feed(data, size_bytes, used, frame)) {
      ++counters_.uplink_frames;
      take_message(frame, link_us_ - since_us);
    }
    data += used;
    size_bytes -= used;
  }
  counters_.uplink_rejected += uplink_errors() - uplink_bad_;
  uplink_bad_ = uplink_errors();
}

void Vehicle::take_message(const proto::FrameView& frame, TimeUs came_us) {
  const auto ours = [this](const auto& message) {
    return message.ok() && message.value().survey_tag == survey_tag_;
  };
  const std::uint8_t* const payload = frame.payload;
  const std::size_t size = frame.payload_bytes;
  proto::MessageType type{};
  const bool known = proto::message_type(payload, size, type);
  bool taken = false;
  if (known && type == proto::MessageType::kHelloRequest) {
    const auto request = proto::decode_hello_request(payload, size);
    taken = request.ok();
    if (taken) {
      answer_hello_request();
    } else if (request.status() == base::Status::kBadVersion) {
      // Whatever else it says lacks the survey's tag, which only a hello that it can read tells.
      ++counters_.uplink_foreign;
      watch_.foreign_until_us = link_us_ + kForeign_us;
    }
  } else if (known && type == proto::MessageType::kResendRequest) {
    const auto request = proto::decode_resend_request(payload, size);
    taken = ours(request);
    if (taken) {
      resend(request.value());
    }
  } else if (known && type == proto::MessageType::kReport) {
    const auto report = proto::decode_report(payload, size);
    taken = ours(report);
    if (taken) {
      take_report(report.value(), came_us);
    }
  } else if (known && type == proto::MessageType::kDigestRequest) {
    const auto request = proto::decode_digest_request(payload, size);
    taken = ours(request);
    if (taken) {
      digest_asked_ = request.value().range;
    }
  } else if (known && type == proto::MessageType::kLook) {
    const auto look = proto::decode_look(payload, size);
    taken = ours(look);
    if (taken) {
      take_look(look.value());
    }
  } else if (known && type == proto::MessageType::kCommand) {
    // What is authentic of it comes on kCommandPort.
    note_unkeyed_command();
    taken = true;
  }
  counters_.uplink_rejected += taken ? 0U : 1U;
}

// All cells of a tile, as soon as the link has room.
void Vehicle::owe(TileId tile) {
  // Of one that still waits whole, coarse cells were told, too.
  if (!link_map_.blank(tile)) {
    coarse_.forget(tile);
  }
  link_map_.force(tile);
  unsent_.add(tile, TileSet::kMaxWeight, tick_);
}

void Vehicle::restart_link() {
  ledger_.reset(first_patience_us(), ledger_.next_number());
  coarse_.reset(model_.grid().tile_count());
  digest_asked_ = proto::TileRange{};
  watch_.status_due_us = link_us_;
  watch_.statuses = 1;  // a brief
  watch_.digest_gap_us = kFirstHelloGap_us;
  watch_.digest_sent_us = link_us_;
  watch_.digest_due_us = link_us_ + kFirstHelloGap_us;
  for (TileId tile = 0; tile < model_.grid().tile_count(); ++tile) {
    if (model_.grid().tile(tile).generation != 0) {
      owe(tile);
    }
  }
}

// Sets dirty bits, nothing else. A tile that no ping ever touched is unknown at both ends; one that is under
// way to a topside which reports goes again by itself if it is lost.
void Vehicle::resend(const proto::ResendRequest& request) {
  ++counters_.resend_requests;
  const TileId tile_count = model_.grid().tile_count();
  for (int i = 0; i < request.range_count; ++i) {
    const proto::TileRange& range = request.ranges[i];
    if (range.first >= tile_count) {
      continue;
    }
    const TileId end = range.first + min_of(range.count, tile_count - range.first);
    for (TileId tile = range.first; tile < end; ++tile) {
      const bool on_its_way = ledger_.heard() && link_map_.under_way(tile);
      if (model_.grid().tile(tile).generation != 0 && !on_its_way) {
        owe(tile);
      }
    }
  }
}

void Vehicle::take_report(const proto::Report& report, TimeUs came_us) {
  ++counters_.reports;
  const bool news = !ledger_.heard();
  ledger_.note_report(came_us);
  for (std::uint32_t i = 0; i < 8U * report.mask_bytes; ++i) {
    if (report.came(i)) {
      take_came(static_cast<std::uint16_t>(report.newest - i), came_us);
    }
  }
  if (report.asked) {
    ledger_.answered(report.newest);
  }
  if (!news) {
    return;
  }
  // Somebody listens again: what was sent while nobody did.
  watch_.digest_gap_us = kFirstHelloGap_us;
  for (TileId tile = 0; tile < model_.grid().tile_count(); ++tile) {
    if (link_map_.owe_missed(tile)) {
      coarse_.forget(tile);
      unsent_.add(tile, TileSet::kMaxWeight, tick_);
    }
  }
}

// A frame of cells came.
void Vehicle::take_came(std::uint16_t number16, TimeUs came_us) {
  const LinkLedger::Word word = ledger_.confirm(number16, came_us);
  FrameTile came{};
  while (ledger_.next_confirmed(came)) {
    if (came.coarse) {
      continue;
    }
    if (word == LinkLedger::Word::kCame) {
      link_map_.confirm(came.tile, came.epoch);
    }
    if (link_map_.came(came.tile, came.epoch, came.version, came.cells)) {
      ledger_.cover(came);
    }
  }
}

void Vehicle::take_look(const proto::Look& look) {
  const std::int32_t tiles_east = model_.grid().tiles_east();
  looked_at_.row = static_cast<std::int32_t>(look.tile) / tiles_east;
  looked_at_.column = static_cast<std::int32_t>(look.tile) % tiles_east;
  looked_at_.radius_tiles = look.radius_tiles;
  looked_at_.until_us = link_us_ + kLook_us;
}

// Frames that are lost by now: their cells are owed again, at once.
void Vehicle::settle_lost_frames() {
  FrameTile lost{};
  const bool idle = unsent_.size() == 0;
  while (ledger_.next_lost(link_us_, idle, lost)) {
    counters_.tiles_lost += lost.coarse || lost.cells.count() == 0 ? 0U : 1U;
    owe_lost(lost);
  }
  if (unsent_.size() == 0) {
    ledger_.note_rest();
  }
}

void Vehicle::owe_lost(const FrameTile& lost) {
  if (lost.coarse) {
    coarse_.lose(model_.grid(), lost.tile, lost.cells);
    return;
  }
  link_map_.lose(lost.tile, lost.epoch, lost.cells);
  if (lost.cells.count() > 0) {  // what came in another frame is not lost
    unsent_.add(lost.tile, TileSet::kMaxWeight, tick_);
  }
}

// Many who ask get one hello, and whoever goes on asking half of the link at most.
void Vehicle::answer_hello_request() {
  const TimeUs came_us = watch_.hello_through_us + kHelloUnderWay_us;
  if (link_us_ >= came_us) {
    const TimeUs soonest_us =
        base::max_of(link_us_, watch_.hello_through_us + line_time_us(kTypicalHello_bytes));
    watch_.hello_due_us = min_of(watch_.hello_due_us, soonest_us);
  }
}

// A frame of `payload_`. What finds no room goes before tile deltas in the cycles to come.
bool Vehicle::put(const base::Result<std::size_t>& payload_bytes) {
  const bool done = payload_bytes.ok() && downlink_.put(payload_.data(), payload_bytes.value());
  frame_waits_ = frame_waits_ || !done;
  return done;
}

// What so many bytes take on a line of the configured rate.
TimeUs Vehicle::line_time_us(std::size_t bytes) const {
  return static_cast<TimeUs>(std::uint64_t{bytes} * 1'000'000 / config_.link.rate_bytes_s);
}

// Of a report, before one came: what two frames take, and both ends to look.
TimeUs Vehicle::first_patience_us() const {
  return kFirstPatience_us + line_time_us(2 * downlink_.longest_frame_bytes());
}

// The frame of cells in `payload_`, noted with its tiles: the first of frame_tiles_. Their cells are under way.
bool Vehicle::put_frame(std::size_t payload_bytes, std::size_t tile_count) {
  if (!downlink_.put(payload_.data(), payload_bytes)) {
    return false;
  }
  while (!ledger_.has_room(tile_count)) {
    FrameTile old{};
    while (ledger_.give_up_oldest(old)) {
      if (ledger_.heard()) {
        owe_lost(old);
      } else if (!old.coarse) {
        link_map_.give_up(old.tile, old.epoch);
      }
    }
  }
  ledger_.sent(frame_tiles_.data(), tile_count, link_us_ + line_time_us(downlink_.backlog_bytes()),
               line_time_us(payload_bytes));
  for (std::size_t i = 0; i < tile_count; ++i) {
    if (!frame_tiles_[i].coarse) {
      link_map_.note_under_way(frame_tiles_[i].tile);
    }
  }
  return true;
}

void Vehicle::fill_digest(const proto::TileRange& range, proto::Digest& digest) const {
  const TileId tile_count = model_.grid().tile_count();
  digest.survey_tag = survey_tag_;
  digest.first = range.first;
  const std::uint32_t count = min_of(range.count, tile_count - range.first);
  // As fine as one frame has room for.
  const std::size_t room_bytes = proto::max_payload_bytes(downlink_.longest_frame_bytes());
  const auto most = static_cast<std::uint32_t>(
      min_of<std::size_t>(proto::kMaxDigestHashes, (room_bytes - kDigestHeader_bytes) / 4));
  while ((((count - 1) >> digest.tiles_log2) + 1) > most) {
    ++digest.tiles_log2;
  }
  const std::uint32_t step = 1U << digest.tiles_log2;
  for (std::uint32_t at = 0; at < count; at += step) {
    std::uint64_t hash = proto::kFnvOffset;
    const TileId begin = range.first + at;
    const TileId end = begin + min_of(step, tile_count - begin);
    for (TileId tile = begin; tile < end; ++tile) {
      hash = proto::add_digest_tile(hash, link_map_.hash32(tile));
    }
    digest.hashes[digest.hash_count] = step == 1 ? link_map_.hash32(begin) : proto::fold_hash(hash);
    ++digest.hash_count;
  }
}

// The answer to a digest request; of its own accord one hash over everything when the map rests, after gaps that
// double while it does.
void Vehicle::send_digest() {
  if (!ledger_.heard()) {
    return;
  }
  proto::Digest digest{};
  if (digest_asked_.count != 0) {
    if (digest_asked_.first < model_.grid().tile_count()) {
      fill_digest(digest_asked_, digest);
      if (!put(proto::encode_digest(digest, payload_.data(), payload_.size()))) {
        return;
      }
    }
    digest_asked_ = proto::TileRange{};
    return;
  }
  if (ledger_.under_way_frames() > 0) {
    watch_.digest_gap_us = kFirstHelloGap_us;
    watch_.digest_due_us = link_us_ + kQuiet_us;
    return;
  }
  // A map that never rests has its word between two batches, rarely; a link that is behind has better to do.
  const bool rests = unsent_.size() == 0;
  const bool behind =
      unsent_.size() > kFewTiles || unsent_.oldest_age(tick_) > max_age_ticks() + kTicks_s;
  if (link_us_ < watch_.digest_due_us || behind ||
      (!rests && link_us_ < watch_.digest_sent_us + config_.link.hello_interval_us)) {
    return;
  }
  digest.survey_tag = survey_tag_;
  digest.tiles_log2 = proto::kMaxDigestLog2;
  digest.hash_count = 1;
  std::uint64_t hash = proto::kFnvOffset;
  for (TileId tile = 0; tile < model_.grid().tile_count(); ++tile) {
    hash = proto::add_digest_tile(hash, link_map_.hash32(tile));
  }
  digest.hashes[0] = proto::fold_hash(hash);
  if (put(proto::encode_digest(digest, payload_.data(), payload_.size()))) {
    watch_.digest_sent_us = link_us_;
    watch_.digest_due_us = link_us_ + watch_.digest_gap_us;
    watch_.digest_gap_us = min_of<TimeUs>(2 * watch_.digest_gap_us, config_.link.hello_interval_us);
  }
}

// The longest frame of cells: a slow link is not to be deaf for more than about a second; and where frames
// are lost, what is left goes in many short ones rather than in a few long: one loss then costs little, and
// what the last ones cost does not hang on luck.
std::size_t Vehicle::frame_limit_bytes() const {
  const std::size_t longest = downlink_.longest_frame_bytes();
  if (ledger_.loss_q16() <= kLossy_q16) {
    return longest;
  }
  const std::size_t backlog_bytes = unsent_.size() * kTypicalTile_bytes;
  // One tile in a frame of a small map, two of a larger one.
  const std::size_t map_bytes = link_map_.known_tiles() * kTypicalTile_bytes;
  const std::size_t least =
      base::clamp(map_bytes / kManyFrames, kLossyFrame_bytes, kTwoTiles_bytes);
  return min_of(longest, base::max_of(backlog_bytes / kLeastFrames, least));
}

// The line is to have work until the next cycle, and no queue that every later frame would wait behind: what
// becomes of a frame is known the later for it.
bool Vehicle::line_is_busy() const {
  const auto cycle_us = static_cast<std::uint64_t>(min_of(link_pause_us_, kLongestCycle_us));
  const std::uint64_t one_and_a_half = config_.link.rate_bytes_s * cycle_us * 3 / 2'000'000;
  return downlink_.backlog_bytes() > one_and_a_half;
}

bool Vehicle::frame_may_begin() const {
  return downlink_.free_bytes() >= min_of(frame_limit_bytes(), kWorthwhileFrame_bytes) &&
         !line_is_busy();
}

// What is near the vehicle, or looked at, goes first; a tile of which a pass is half done stays.
std::uint32_t Vehicle::favour(TileId tile) const {
  if (pass_.half_done(tile)) {
    return TileSet::kNotNow;
  }
  const std::int32_t tiles_east = model_.grid().tiles_east();
  const auto row = static_cast<std::int32_t>(tile) / tiles_east;
  const auto column = static_cast<std::int32_t>(tile) % tiles_east;
  std::uint32_t favour = 0;
  const auto distance = [](std::int32_t a, std::int32_t b) { return a < b ? b - a : a - b; };
  if (vehicle_tile_known_) {
    const std::int32_t tiles =
        base::max_of(distance(row, vehicle_row_), distance(column, vehicle_column_));
    favour = tiles < 8 ? static_cast<std::uint32_t>(8 - tiles) * 12 : 0U;
  }
  const bool looked_at = looked_at_.radius_tiles > 0 && link_us_ < looked_at_.until_us &&
                         distance(row, looked_at_.row) <= looked_at_.radius_tiles &&
                         distance(column, looked_at_.column) <= looked_at_.radius_tiles;
  return favour + (looked_at ? 128U : 0U);
}

// Which tile the vehicle is over, once a cycle: while that is known to half a tile. Dead reckoning goes on for ever, and
// would carry it off the map.
void Vehicle::note_vehicle_tile() {
  const base::Pose& pose = navigator_.latest();
  const std::uint32_t(&sigma_mm)[3] = pose.covariance.sigma_position_mm;
  const auto half_tile_mm =
      static_cast<std::uint32_t>(config_.model.cell_mm * model::kTileCells / 2);
  if ((pose.validity & base::kPoseHorizontal) == 0 ||
      base::max_of(sigma_mm[base::kNorth], sigma_mm[base::kEast]) > half_tile_mm) {
    return;
  }
  const auto tile_of = [this, &pose](std::size_t axis) {
    const std::int64_t cells =
        (pose.position_um[axis] / 1000 - config_.model.origin_mm[axis]) / config_.model.cell_mm;
    return static_cast<std::int32_t>(
        base::clamp<std::int64_t>(cells / model::kTileCells, -32768, 32767));
  };
  vehicle_row_ = tile_of(base::kNorth);
  vehicle_column_ = tile_of(base::kEast);
  vehicle_tile_known_ = true;
}

void Vehicle::send_hello() {
  // At once when an origin has been found: until then a receiver does not know where the map lies.
  const bool has_origin = navigator_.plane().configured();
  const bool news = has_origin != watch_.origin_said || watch_.hello_gap_us == 0;
  if (link_us_ < watch_.hello_due_us && !news) {
    return;
  }
  proto::Hello hello{};
  hello.protocol_major = proto::kProtocolMajor;
  hello.protocol_minor = proto::kProtocolMinor;
  hello.tile_side_cells = proto::kTileSide_cells;
  hello.table_count = static_cast<std::uint8_t>(config_.table_count);
  hello.schema_hash = proto::schema_hash();
  hello.survey_id = config_.survey_id;
  hello.session = config_.session;
  hello.config_crc = config_crc_;
  hello.cell_mm = config_.model.cell_mm;
  for (int axis = 0; axis < 3; ++axis) {
    hello.size_cells[axis] = config_.model.size[axis];
    hello.origin_mm[axis] = config_.model.origin_mm[axis];
  }
  if (has_origin) {
    hello.has_geodetic_origin = 1;
    hello.latitude_e9deg = navigator_.plane().origin().latitude_e9deg;
    hello.longitude_e9deg = navigator_.plane().origin().longitude_e9deg;
  }
  hello.epsg = config_.epsg;
  hello.link_rate_bytes_s = config_.link.rate_bytes_s;
  for (int i = 0; i < config_.table_count; ++i) {
    hello.table_crc[i] = table_crc_[i];
  }
  proto::name_survey(hello, config_.survey_name, config_.vertical_datum,
                     proto::max_payload_bytes(downlink_.longest_frame_bytes()));
  if (put(proto::encode_hello(hello, payload_.data(), payload_.size()))) {
    watch_.origin_said = has_origin;
    watch_.hello_gap_us = min_of<TimeUs>(news ? kFirstHelloGap_us : 2 * watch_.hello_gap_us,
                                         config_.link.hello_interval_us);
    watch_.hello_through_us = link_us_ + line_time_us(downlink_.backlog_bytes());
    watch_.hello_due_us = link_us_ + watch_.hello_gap_us;
  }
}

proto::Swath Vehicle::swath_now() const {
  proto::Swath swath{};
  if (newest_beams_.count == 0 || now_us_ - newest_beams_.t_transmit_us > kBeamOfNow_us) {
    return swath;
  }
  constexpr base::Bam32 kHalfStep_bam32 = base::Bam32{1} << 23U;
  for (int i = 0; i < newest_beams_.count; ++i) {
    const MappedBeam& beam = i == 0 ? newest_beams_.first : newest_beams_.last;
    const model::Direction axis =
        model::beam_frame(beam.attitude, beam.azimuth_bam32, beam.elevation_bam32, 0).axis;
    const std::int64_t north = axis.q30[base::kNorth];
    const std::int64_t east = axis.q30[base::kEast];
    const std::uint32_t horizontal =
        base::isqrt_u64(static_cast<std::uint64_t>(north * north + east * east));
    const base::Bam32 azimuth = base::atan2_bam32(east, north);
    const base::Bam32 depression = base::atan2_bam32(axis.q30[base::kDown], horizontal);
    const std::uint32_t range_dm = static_cast<std::uint32_t>(beam.range_um / 100'000);
    swath.beams[swath.beam_count++] = {
        static_cast<std::uint8_t>((azimuth + kHalfStep_bam32) >> 24U),
        static_cast<std::int8_t>((depression + kHalfStep_bam32) >> 24U), limited16(range_dm)};
  }
  return swath;
}

void Vehicle::send_status() {
  if (link_us_ < watch_.status_due_us) {
    return;
  }
  proto::Status status{};
  fill_status(status);
  base::Result<std::size_t> size = base::Status::kNotReady;
  if (watch_.statuses % kStatusesPerFull == 0) {
    size = encode_full_status(status);
  }
  if (!size.ok()) {
    size = proto::encode_brief(proto::brief_of(status), payload_.data(), payload_.size());
  }
  const std::uint64_t before = downlink_.total_bytes();
  if (!put(size)) {
    return;
  }
  const auto frame_bytes = static_cast<TimeUs>(downlink_.total_bytes() - before);
  const TimeUs share_us = frame_bytes * kStatusShare * 1'000'000 / config_.link.rate_bytes_s;
  watch_.status_due_us = link_us_ + base::max_of<TimeUs>(config_.link.status_interval_us, share_us);
  ++watch_.statuses;
  watch_.shed_at_status = pings_shed();
  watch_.clamped_at_status = counters_.cycle_time_clamped + counters_.chunk_time_clamped;
  watch_.over_limit_at_status = counters_.bytes_over_limit;
  watch_.epoch_at_status = navigator_.epoch();
}

// With as many ports as the MTU has room for. kFull: not even without them.
base::Result<std::size_t> Vehicle::encode_full_status(proto::Status& status) {
  const std::size_t capacity =
      min_of(payload_.size(), proto::max_payload_bytes(downlink_.longest_frame_bytes()));
  base::Result<std::size_t> size = proto::encode_status(status, payload_.data(), capacity);
  while (!size.ok() && status.port_count > 0) {
    --status.port_count;
    size = proto::encode_status(status, payload_.data(), capacity);
  }
  return size;
}

void Vehicle::fill_status(proto::Status& status) const {
  status.t_us = now_us_;
  status.cycle = low32(counters_.cycles);
  status.alarms = counters_.alarms;

  const base::Pose& pose = navigator_.latest();
  status.pose_t_us = pose.t_us;
  status.pose_validity = pose.validity;
  status.pose_epoch = pose.epoch;
  for (int axis = 0; axis < 3; ++axis) {
    status.position_mm[axis] = millimetres(pose.position_um[axis]);
    status.sigma_position_cm[axis] =
        limited16((pose.covariance.sigma_position_mm[axis] + 9U) / 10U);
    status.sigma_attitude_urad16[axis] = pose.covariance.sigma_attitude_urad16[axis];
  }
  status.roll_bam16 = static_cast<std::uint16_t>(pose.attitude.roll_bam32 >> 16U);
  status.pitch_bam16 = static_cast<std::uint16_t>(pose.attitude.pitch_bam32 >> 16U);
  status.heading_bam16 = static_cast<std::uint16_t>(pose.attitude.heading_bam32 >> 16U);

  status.cycle_last_us = host_.cycle_last_us;
  status.cycle_max_us = host_.cycle_max_us;
  status.recorder_lost = host_.recorder_lost;
  status.work_last_voxels = counters_.work_last_voxels;
  status.work_max_voxels = counters_.work_max_voxels;
  status.work_bound_voxels = cycle_bound_voxels();

  static_assert(proto::kPingNotConfigured == static_cast<int>(model::PingResult::kNotConfigured),
                "the outcomes' first part is the model's own");
  status.pings[proto::kPingStopped] =
      low32(counters_.pings_lost[static_cast<int>(PingLoss::kStopped)]);
  // kAbsentTile, which follows, is no outcome: such a ping waits, and is shed in the end.
  for (int i = 0; i <= proto::kPingNotConfigured; ++i) {
    status.pings[i] = low32(model_.counters().pings[i]);
  }
  const auto lost = [this](PingLoss loss) {
    return low32(counters_.pings_lost[static_cast<int>(loss)]);
  };
  status.pings[proto::kPingShed] = low32(pings_shed());
  status.pings[proto::kPingNoPose] =
      lost(PingLoss::kNoPose) + lost(PingLoss::kPoseGap) + lost(PingLoss::kPoseEpoch);
  status.pings[proto::kPingBad] = lost(PingLoss::kBad) + lost(PingLoss::kNoPath);
  status.pings[proto::kPingPaused] = lost(PingLoss::kPaused);
  status.pings_pending = static_cast<std::uint32_t>(pending_.size());
  const estimator::NavigatorCounters& navigation = navigator_.counters();
  status.nav_fused = navigation.fused;
  status.nav_rejected =
      navigation.gated + navigation.unusable + navigation.out_of_range + navigation.stale;

  status.tiles_known = link_map_.known_tiles();
  status.tiles_dirty = static_cast<std::uint32_t>(stale_.size() + pass_.size() + unsent_.size());
  status.cells_sent = low32(counters_.cells_sent);
  status.link_bytes = low32(downlink_.total_bytes());
  status.queued_bytes = static_cast<std::uint32_t>(downlink_.size_bytes());
  status.uplink_frames = low32(counters_.uplink_frames);
  status.uplink_bad = low32(counters_.uplink_rejected);

  status.port_count = static_cast<std::uint8_t>(config_.port_count);
  for (int port = 0; port < config_.port_count; ++port) {
    const PortTally& tally = counters_.ports[port];
    const bool heard = now_us_ - watch_.last_record_us[port] <= kSilence_us && tally.records != 0;
    // Without a host that knows, a port that says something is open.
    const bool told = port < host_.port_count;
    const bool open = told ? host_.port_open[port] != 0 : heard;
    status.ports[port] = proto::PortStatus{
        static_cast<std::uint8_t>(open ? 1 : 0), low32(tally.bytes), low32(tally.records),
        low32(tally.rejected), told ? host_.dropped_bytes[port] : 0U};
  }
  status.swath = swath_now();
}

std::uint32_t Vehicle::alarms_now() const {
  std::uint32_t alarms = watch_.paused ? proto::kAlarmMappingPaused : 0U;
  alarms |= commands_.stopped ? proto::kAlarmStopped : 0U;
  alarms |=
      host_.alarms & (proto::kAlarmPortLost | proto::kAlarmRecorderLost | proto::kAlarmRestarted);
  const auto raise = [&alarms](bool condition, std::uint32_t bit) {
    alarms |= condition ? bit : 0U;
  };
  const base::Pose& pose = navigator_.latest();
  const TimeUs allowed_us =
      static_cast<TimeUs>(config_.navigation.max_gap_us) + config_.navigation.max_wait_us;
  raise(pose.validity != base::kPoseAll || now_us_ - pose.t_us > allowed_us, proto::kAlarmNoPose);
  bool silent = false;
  bool leak = false;
  for (int port = 0; port < config_.port_count; ++port) {
    // A leak switch that says nothing is a good one.
    const bool talks = config_.ports[port].driver != Driver::kNone &&
                       !has_role(static_cast<std::size_t>(port), hal::LineRole::kLeak);
    silent = silent || (talks && now_us_ - watch_.last_record_us[port] > kSilence_us);
    leak = leak || wet_[port];
  }
  raise(silent, proto::kAlarmPortSilent);
  raise(leak, proto::kAlarmLeak);
  raise(pings_shed() != watch_.shed_at_status, proto::kAlarmShed);
  raise(pending_.size() == PingQueue::kCapacity_count, proto::kAlarmQueueFull);
  raise(unsent_.oldest_age(tick_) > max_age_ticks() + kBehind_ticks, proto::kAlarmLinkBehind);
  raise(counters_.cycle_time_clamped + counters_.chunk_time_clamped != watch_.clamped_at_status,
        proto::kAlarmTimeStepped);
  raise(counters_.bytes_over_limit != watch_.over_limit_at_status, proto::kAlarmInputDropped);
  raise(navigator_.epoch() != watch_.epoch_at_status, proto::kAlarmPoseEpoch);
  bool outside = false;
  for (int axis = 0; axis < 2; ++axis) {
    const std::int64_t cells =
        (pose.position_um[axis] / 1000 - config_.model.origin_mm[axis]) / config_.model.cell_mm;
    outside = outside || cells < 0 || cells >= config_.model.size[axis];
  }
  raise(model_.grid().windowed() && pager_.failing(), proto::kAlarmStoreFailing);
  raise(link_us_ < watch_.foreign_until_us, proto::kAlarmForeignTopside);
  raise(outside && (pose.validity & base::kPoseHorizontal) != 0, proto::kAlarmOutsideGrid);
  return alarms;
}

void Vehicle::update_alarms() {
  counters_.alarms = alarms_now();
  std::uint32_t began = counters_.alarms & ~alarms_said_;
  if (watch_.outside_said && link_us_ - watch_.outside_us < kOutsideEpisode_us) {
    began &= ~std::uint32_t{proto::kAlarmOutsideGrid};
  }
  if ((counters_.alarms & proto::kAlarmOutsideGrid) != 0) {
    watch_.outside_said = true;
    watch_.outside_us = link_us_;
  }
  const std::uint32_t ended = alarms_said_ & ~counters_.alarms;
  texts_due_ |= began | (std::uint64_t{ended} << kEndShift);
  alarms_said_ = counters_.alarms;
}

void Vehicle::send_texts() {
  const auto say = [this](const AlarmText& alarm, std::uint64_t bit) {
    if ((texts_due_ & bit) == 0) {
      return;
    }
    const proto::Text text = proto::make_text(now_us_, alarm.severity, alarm.text);
    if (put(proto::encode_text(text, payload_.data(), payload_.size()))) {
      texts_due_ &= ~bit;
    }
  };
  for (const AlarmText& alarm : kBegins) {
    say(alarm, alarm.bit);
  }
  for (const AlarmText& alarm : kEnds) {
    say(alarm, std::uint64_t{alarm.bit} << kEndShift);
  }
}

std::uint32_t Vehicle::max_age_ticks() const {
  return config_.link.max_tile_age_us >> kTick_log2us;
}

// Packets of changed cells, as long as the link takes them. A tile is clean once its bytes are in the buffer.
// Headers are what single cells cost: nothing is sent before a tile has waited for max_tile_age_us, or all of
// one has changed or is asked for; then whatever else waits goes along.
void Vehicle::send_deltas() {
  note_vehicle_tile();
  const auto favoured = [this](TileId tile) { return favour(tile); };
  TileId tile = 0;
  while (!frame_waits_ &&
         unsent_.best_due(tick_, TileSet::kMaxWeight, max_age_ticks(), favoured, tile)) {
    if (!frame_may_begin()) {
      return;
    }
    const std::size_t limit = frame_limit_bytes();
    proto::TilePacketEncoder packet(
        payload_.data(), min_of(downlink_.free_payload_bytes(), proto::max_payload_bytes(limit)),
        survey_tag_);
    std::size_t tile_count = 0;
    const bool more = fill_packet(packet, tile, tile_count);
    const std::size_t size = packet.finish();
    const std::uint64_t before = downlink_.total_bytes();
    // free_payload_bytes() is a promise: put_frame() does not refuse.
    if (size == 0 || !put_frame(size, tile_count)) {
      return;
    }
    ++counters_.tile_deltas;
    counters_.delta_bytes += downlink_.total_bytes() - before;
    if (!more) {
      return;
    }
  }
}

// Nothing is left to send, and of some of it nobody knows whether it came: a word about that is cheaper than its cells
// once more.
void Vehicle::send_question() {
  if (frame_waits_ || unsent_.size() > 0 || !ledger_.question_due(link_us_)) {
    return;
  }
  const proto::Question question{survey_tag_,
                                 static_cast<std::uint16_t>(ledger_.next_number() - 1)};
  if (put(proto::encode_question(question, payload_.data(), payload_.size()))) {
    ledger_.asked(link_us_ + line_time_us(downlink_.backlog_bytes()));
  }
}

// Fills a packet from the unsent tiles, `tile` first; false when they are used up.
bool Vehicle::fill_packet(proto::TilePacketEncoder& packet, TileId tile, std::size_t& tile_count) {
  const auto favoured = [this](TileId other) { return favour(other); };
  TileCells present;
  do {
    link_map_.present(model_, tile, present);
    const proto::TileUpdate update{tile, ledger_.next_number(), present.data(),
                                   link_map_.owed(tile, present)};
    const int owed = update.changed.count();
    if (owed == 0) {
      // Changed and changed back, since.
      unsent_.remove(tile);
      continue;
    }
    proto::CellMask taken{};
    // Half a tile has a header of its own, and its first cells are predicted from nothing.
    const base::Result<int> added =
        tile_count == 0 ? packet.add(update, taken) : packet.add_whole(update, taken);
    if (!added.ok()) {
      return true;
    }
    counters_.cells_sent += static_cast<std::uint64_t>(added.value());
    const auto changed = static_cast<std::uint64_t>(link_map_.sent(tile, present, taken));
    frame_tiles_[tile_count] =
        FrameTile{tile, link_map_.epoch(tile), link_map_.version(tile), taken};
    ++tile_count;
    counters_.cells_changed += changed;
    counters_.cell_wait_ms +=
        changed * ((std::uint64_t{unsent_.age(tile, tick_)} << kTick_log2us) / 1000);
    if (added.value() < owed) {
      return true;
    }
    unsent_.remove(tile);
  } while (unsent_.best_due(tick_, 0, 0, favoured, tile));
  return false;
}

}  // namespace leadline::firmware
