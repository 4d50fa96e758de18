#include "hal/heads/imagenex.hpp"

#include "hal/heads/beam_angles.hpp"
#include "hal/wire.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

constexpr std::uint8_t kReplyEnd = 0xFC;
constexpr std::size_t kHeader_bytes = 12;
constexpr std::size_t kLongHeader_bytes = 32;
constexpr base::TimeUs kMaxGap_us = 500'000;
constexpr std::int64_t kAnswer_us = 300'000;
constexpr std::uint32_t kPoints831l = 250;
constexpr std::uint32_t kPositionBits = 0x1FFF;  // the fourteenth says which way it turns

struct RangeCode {
  std::uint8_t code;
  std::int32_t range_mm;
  std::uint8_t pulse_10us;  ///< 881A
};

constexpr std::array<RangeCode, 6> kRanges852{{
    {5, 5'000, 0},
    {10, 10'000, 0},
    {20, 20'000, 0},
    {30, 30'000, 0},
    {40, 40'000, 0},
    {50, 50'000, 0},
}};
constexpr std::array<RangeCode, 13> kRanges881a{{
    {1, 1'000, 2},
    {2, 2'000, 2},
    {3, 3'000, 2},
    {4, 4'000, 2},
    {5, 5'000, 6},
    {10, 10'000, 6},
    {20, 20'000, 10},
    {30, 30'000, 16},
    {40, 40'000, 22},
    {50, 50'000, 26},
    {60, 60'000, 32},
    {80, 80'000, 42},
    {100, 100'000, 54},
}};
constexpr std::array<RangeCode, 10> kRanges831l{{
    {2, 125, 0},
    {4, 250, 0},
    {6, 500, 0},
    {8, 750, 0},
    {10, 1'000, 0},
    {20, 2'000, 0},
    {30, 3'000, 0},
    {40, 4'000, 0},
    {50, 5'000, 0},
    {60, 6'000, 0},
}};

struct RangeList {
  const RangeCode* codes;
  std::size_t count;
};

RangeList ranges_of(ImagenexModel model) {
  switch (model) {
    case ImagenexModel::kSounder852:
    case ImagenexModel::kScanner852:
      return {kRanges852.data(), kRanges852.size()};
    case ImagenexModel::k831l:
      return {kRanges831l.data(), kRanges831l.size()};
    case ImagenexModel::kAuto:
    case ImagenexModel::k881a:
      break;
  }
  return {kRanges881a.data(), kRanges881a.size()};
}

const RangeCode* find_range(ImagenexModel model, std::uint8_t code) {
  const RangeList list = ranges_of(model);
  for (std::size_t i = 0; i < list.count; ++i) {
    if (list.codes[i].code == code) {
      return &list.codes[i];
    }
  }
  return nullptr;
}

/// Fourteen bits in two groups of seven.
constexpr std::uint32_t unpack(const std::uint8_t* bytes) {
  return ((bytes[1] & 0x7FU) << 7U) | (bytes[0] & 0x7FU);
}

constexpr bool is_kind(std::uint8_t letter) {
  return letter == 'M' || letter == 'G' || letter == 'P';
}

/// Points that the kind of a reply promises.
constexpr std::uint32_t points_of(std::uint8_t letter) {
  if (letter == 'P') {
    return 0;
  }
  return letter == 'M' ? 252 : 500;
}

/// Whose reply this is, as far as can be told from a whole short header and the byte behind it.
ImagenexModel model_of(ImagenexModel configured, const std::uint8_t* bytes) {
  if (configured != ImagenexModel::kAuto) {
    return configured;
  }
  const bool is_long = (bytes[1] == 'M' && unpack(bytes + 10) == kPoints831l) ||
                       (bytes[1] == 'P' && bytes[kHeader_bytes] != kReplyEnd);
  if (is_long) {
    return ImagenexModel::k831l;
  }
  return bytes[3] >= 0x11 && bytes[3] <= 0x15 ? ImagenexModel::kSounder852 : ImagenexModel::k881a;
}

bool plausible(ImagenexModel model, const std::uint8_t* bytes) {
  for (const std::size_t at : {5U, 6U, 8U, 9U, 10U, 11U}) {
    if (bytes[at] >= 0x80) {
      return false;
    }
  }
  const RangeCode* range = find_range(model, bytes[7]);
  if (range == nullptr) {
    return false;
  }
  // Position 0 .. 2800 (0.15 deg) or 0 .. 1200 (0.3 deg).
  const std::uint32_t position = unpack(bytes + 5) & kPositionBits;
  const std::uint32_t last = model == ImagenexModel::kScanner852 ? 2800 : 1200;
  return model == ImagenexModel::kSounder852 || position <= last;
}

struct Rules {
  ImagenexModel configured;

  Judgement operator()(const std::uint8_t* bytes, std::size_t available) const {
    if (bytes[0] != 'I' || (available > 1 && !is_kind(bytes[1])) ||
        (available > 2 && bytes[2] != 'X')) {
      return {FrameVerdict::kNoStart, 0};
    }
    if (available <= kHeader_bytes) {
      return {FrameVerdict::kMore, 0};
    }
    std::uint32_t points = points_of(bytes[1]);
    const ImagenexModel model = model_of(configured, bytes);
    const bool is_long = model == ImagenexModel::k831l;
    if (is_long && points > 0) {
      points = kPoints831l;
    }
    const std::uint32_t counted = unpack(bytes + 10);
    const bool high_bits = bytes[10] >= 0x80 || bytes[11] >= 0x80;
    if (counted != points || high_bits) {
      return {FrameVerdict::kBadLength, 0};
    }
    if (!plausible(model, bytes)) {
      return {FrameVerdict::kBadValues, 0};
    }
    const std::size_t end = (is_long ? kLongHeader_bytes : kHeader_bytes) + points;
    if (available <= end) {
      return {FrameVerdict::kMore, 0};
    }
    return bytes[end] == kReplyEnd ? Judgement{FrameVerdict::kFrame, end + 1}
                                   : Judgement{FrameVerdict::kBadLength, 0};
  }
};

std::int64_t profile_range_um(ImagenexModel model, const std::uint8_t* bytes,
                              std::int64_t range_mm) {
  const std::int64_t value = unpack(bytes + 8);
  const bool fine = model == ImagenexModel::k881a && range_mm < 5'000;
  return value * (fine ? 2'000 : 10'000);
}

/// No byte of a command may look like its end.
constexpr std::uint8_t without_end(std::int32_t value) {
  const auto byte = static_cast<std::uint8_t>(base::clamp(value, 0, 255));
  return byte == 0xFD ? std::uint8_t{0xFC} : byte;
}

ImagenexConfig limited(ImagenexConfig config) {
  config.gain_db = base::min_of<std::uint8_t>(config.gain_db, 40);
  config.pulse_us = base::max_of<std::uint8_t>(config.pulse_us, 1);
  config.poll_interval_us = base::clamp(config.poll_interval_us, 0, 60'000'000);
  config.train_deg = base::clamp(config.train_deg, -180, 180);
  config.sector_deg = base::clamp(config.sector_deg, 0, 360);
  config.step_ddeg = base::clamp(config.step_ddeg, 0, 60);
  config.forward_cdeg = base::clamp(config.forward_cdeg, -36'000, 36'000);
  config.min_range_um = base::clamp<std::int64_t>(config.min_range_um, 0, 25'000'000);
  config.max_range_um = base::clamp<std::int64_t>(config.max_range_um, 0, 100'000'000);
  config.byte_time_ns = base::clamp(config.byte_time_ns, 0, 100'000'000);
  return config;
}

}  // namespace

ImagenexCodec::ImagenexCodec(const ImagenexConfig& config)
    : config_(limited(config)), framer_(kMaxGap_us) {}

bool ImagenexCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(ping);
}

bool ImagenexCodec::next(base::Ping& ping) {
  return framer_.take_next(Rules{config_.model}, counters_,
                           [&](const FrameBytes& frame) { return take(frame, ping); });
}

void ImagenexCodec::restart() {
  framer_.reset(counters_);
  exchange_.answered();
  ++counters_.restarts;
}

// --- What arrives ---

bool ImagenexCodec::take(const FrameBytes& frame, base::Ping& ping) {
  const std::uint8_t* bytes = frame.data;
  const ImagenexModel model = model_of(config_.model, bytes);
  if (config_.head_id != 0 && bytes[3] != config_.head_id) {
    ++counters_.wrong_device;
    return false;
  }
  const std::int64_t range_mm = find_range(model, bytes[7])->range_mm;
  const std::int64_t found_um = profile_range_um(model, bytes, range_mm);
  // A tenth more: the receiver stays open a little longer than it was asked to.
  if (found_um > range_mm * 1100) {
    ++counters_.bad_values;
    return false;
  }
  exchange_.answered();
  const bool is_852 = model == ImagenexModel::kSounder852 || model == ImagenexModel::kScanner852;
  if (is_852 && (bytes[4] & 0xC0U) != 0x40U) {
    ++counters_.refused_settings;
  }
  if (model == ImagenexModel::k831l) {
    take_attitude(frame);
  }

  ping = base::Ping{};
  ping.t_receive_us = frame.t_arrival_us -
                      static_cast<std::int64_t>(frame.size_bytes) * config_.byte_time_ns / 1000;
  ping.t_transmit_us = ping.t_receive_us - 2'000'000 * range_mm / kImagenexSoundSpeed_mm_s;
  ping.mount = config_.mount;
  ping.quality = 255;
  ping.sound_speed_mm_s = kImagenexSoundSpeed_mm_s;
  set_direction(model, bytes, ping);
  const std::size_t header = model == ImagenexModel::k831l ? kLongHeader_bytes : kHeader_bytes;
  const std::size_t points = frame.size_bytes - header - 1;
  if (points > 0 && config_.profile) {
    set_profile(bytes + header, static_cast<std::int64_t>(points), range_mm, ping);
  } else {
    set_range(found_um, ping);
  }
  ++counters_.records;
  return true;
}

void ImagenexCodec::set_direction(ImagenexModel model, const std::uint8_t* bytes,
                                  base::Ping& ping) const {
  if (model == ImagenexModel::kSounder852) {
    ping.azimuth_bam32 = config_.azimuth_bam32;
    ping.elevation_bam32 = config_.elevation_bam32;
    return;
  }
  const std::int64_t position = unpack(bytes + 5) & kPositionBits;
  const std::int64_t head_cdeg =
      model == ImagenexModel::kScanner852 ? 15 * (position - 1400) : 30 * (position - 600);
  const std::int64_t turned_cdeg = head_cdeg - config_.forward_cdeg;
  ping.azimuth_bam32 = bam_of_parts(config_.clockwise ? turned_cdeg : -turned_cdeg, 36'000);
}

void ImagenexCodec::set_profile(const std::uint8_t* points, std::int64_t count,
                                std::int64_t range_mm, base::Ping& ping) {
  for (std::int64_t i = 0; i < count; ++i) {
    intensity_[static_cast<std::size_t>(i)] = points[i];
  }
  ping.kind = base::ReturnKind::kProfile;
  ping.profile.intensity = intensity_.data();
  ping.profile.bin_count = static_cast<std::uint16_t>(count);
  ping.profile.bin_um = static_cast<std::uint32_t>((range_mm * 1000 + count / 2) / count);
  ping.profile.first_bin_um = range_mm * 500 / count;
}

void ImagenexCodec::set_range(std::int64_t found_um, base::Ping& ping) const {
  ping.kind = base::ReturnKind::kNoReturn;
  if (found_um > 0 && found_um < config_.min_range_um) {
    ping.quality = 0;
  } else if (found_um > 0) {
    ping.kind = base::ReturnKind::kRange;
    ping.range_um = found_um;
    ping.t_receive_us = ping.t_transmit_us + 2'000 * found_um / kImagenexSoundSpeed_mm_s;
  }
}

void ImagenexCodec::take_attitude(const FrameBytes& frame) {
  const std::uint16_t words[2] = {read_u16_le(frame.data + 16), read_u16_le(frame.data + 18)};
  base::NavSample sample{};
  sample.kind = base::NavKind::kAttitude;
  sample.t_us = frame.t_arrival_us;
  const auto angle = [](std::uint16_t word, bool positive) {
    // Fourteen bits in two's complement, 0.025 degrees each.
    const std::int32_t value = (word & 0x3FFF) - ((word & 0x2000) != 0 ? 0x4000 : 0);
    return bam_of_parts(positive ? value : -value, 14'400);
  };
  const bool good = (words[0] & 0xC000U) == 0x8000U && (words[1] & 0xC000U) == 0x8000U;
  if (good) {
    sample.attitude.roll_bam32 = angle(words[0], config_.roll_positive);
    sample.attitude.pitch_bam32 = angle(words[1], config_.pitch_positive);
    sample.fields = base::kNavRollPitch;
    sample.quality = 255;
  } else {
    ++counters_.no_data;
  }
  samples_.push(sample);
}

// --- What is asked ---

std::size_t ImagenexCodec::request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity) {
  if (config_.model == ImagenexModel::kAuto || capacity < kMaxRequest_bytes) {
    return 0;
  }
  if (exchange_.gave_up(now_us)) {
    ++counters_.timeouts;
  }
  const std::int64_t wait_us = next_poll_us_ - now_us;
  // Longer than an interval: time went back.
  if (exchange_.waiting() || (wait_us > 0 && wait_us <= config_.poll_interval_us)) {
    return 0;
  }
  const std::int64_t range_mm = find_range(config_.model, range_code())->range_mm;
  const std::int64_t line_us =
      std::int64_t{kImagenexSwitch_bytes + 513} * config_.byte_time_ns / 1000;
  exchange_.sent(now_us, kAnswer_us + line_us + 2'000'000 * range_mm / kImagenexSoundSpeed_mm_s);
  next_poll_us_ = now_us + config_.poll_interval_us;
  write_switch(out);
  return kImagenexSwitch_bytes;
}

/// The shortest range that reaches as far as was asked for, or the longest.
std::uint8_t ImagenexCodec::range_code() const {
  const RangeList list = ranges_of(config_.model);
  std::size_t i = 0;
  while (i + 1 < list.count && list.codes[i].range_mm * std::int64_t{1000} < config_.max_range_um) {
    ++i;
  }
  return list.codes[i].code;
}

void ImagenexCodec::write_switch(std::uint8_t* out) const {
  for (std::size_t i = 0; i < kImagenexSwitch_bytes; ++i) {
    out[i] = 0;
  }
  const std::uint8_t code = range_code();
  const RangeCode* range = find_range(config_.model, code);
  const bool near_881a = range->range_mm <= 5'000;
  out[0] = 0xFE;
  out[1] = 0x44;
  out[3] = code;
  out[8] = config_.gain_db;
  out[10] = 20;
  out[14] = without_end(config_.pulse_us);
  out[15] = without_end(static_cast<std::int32_t>(config_.min_range_um / 100'000));
  out[19] = config_.many_points ? 50 : 25;
  out[22] = config_.profile ? 0 : 1;
  out[24] = 1;  // two milliseconds between command and reply
  out[26] = 0xFD;
  const std::int32_t sector = config_.sector_deg / 3;
  switch (config_.model) {
    case ImagenexModel::kAuto:
    case ImagenexModel::kSounder852:
      out[2] = config_.head_id == 0 ? 0x11 : without_end(config_.head_id);
      out[6] = 0x43;
      break;
    case ImagenexModel::kScanner852:
      out[2] = 0x10;
      out[11] = without_end((config_.train_deg + 210) / 3);
      out[12] = without_end(sector);
      out[13] = without_end(base::min_of(config_.step_ddeg / 30, 2));
      break;
    case ImagenexModel::k881a:
      out[2] = 0x10;
      out[6] = 0x43;
      out[10] = near_881a ? 60 : 20;
      out[11] = without_end((config_.train_deg + 180) / 3);
      out[12] = without_end(sector);
      out[13] = without_end(base::min_of(config_.step_ddeg / 3, 8));
      out[14] = range->pulse_10us;
      out[20] = 8;
      out[21] = 6;
      out[25] = near_881a ? 165 : 100;  // 1000 or 675 kHz
      break;
    case ImagenexModel::k831l:
      out[11] = without_end(base::max_of(config_.train_deg, 0) / 3);
      out[12] = without_end(sector);
      out[13] = without_end(base::min_of(config_.step_ddeg / 3, 8));
      out[14] = without_end(base::min_of<std::int32_t>(config_.pulse_us, 100));
      out[19] = 25;
      out[20] = 8;
      out[21] = 1;
      out[24] = 0;
      out[25] = 100;  // 2.25 MHz
      break;
  }
}

}  // namespace leadline::hal
