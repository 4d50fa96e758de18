#include "hal/heads/tritech.hpp"

#include "hal/heads/beam_angles.hpp"
#include "hal/wire.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

constexpr base::TimeUs kMaxGap_us = 500'000;
constexpr std::uint8_t kHost = 0xFF;
constexpr std::uint8_t kImagingNode = 2;
constexpr std::uint8_t kProfilerNode = 20;
constexpr std::uint8_t kEnd = 0x0A;
constexpr std::size_t kShortest_bytes = 14;
constexpr std::size_t kImagingFixed_bytes = 45;
constexpr std::size_t kProfilerFixed_bytes = 51;
constexpr std::int32_t kAhead = 3200;

constexpr std::uint8_t kVersionData = 1;
constexpr std::uint8_t kHeadData = 2;
constexpr std::uint8_t kAlive = 4;
constexpr std::uint8_t kHeadCommand = 19;
constexpr std::uint8_t kSendVersion = 23;
constexpr std::uint8_t kSendData = 25;

// mtAlive
constexpr std::uint8_t kCentring = 1U << 0U;
constexpr std::uint8_t kNoParameters = 1U << 6U;

constexpr std::int64_t kCommandTimeout_us = 1'000'000;
constexpr std::int64_t kConfigureTimeout_us = 5'000'000;
constexpr std::int64_t kCentreTimeout_us = 30'000'000;
constexpr std::uint8_t kMaxInARow = 5;
constexpr std::int64_t kDay_ms = 86'400'000;

/// Lengths that a type may have. 0, 0 ends the list.
struct Row {
  std::uint8_t type;
  std::uint16_t min_bytes;
  std::uint16_t max_bytes;
};
constexpr std::array<Row, 14> kRows{{
    {kVersionData, 25, 25},
    {kHeadData, kImagingFixed_bytes, kMaxSeanetFrame_bytes},
    {kAlive, 22, 22},
    {6, 175, 264},  // mtBBUserData
    {7, 14, 512},   // mtTestData
    {8, 14, 512},   // mtAuxData
    {14, 14, 32},   // mtSetTime
    {16, 14, 14},   // mtReBoot
    {kHeadCommand, 15, 82},
    {kSendVersion, 14, 14},
    {24, 14, 14},  // mtSendBBUser
    {kSendData, 18, 18},
    {57, 28, 28},  // mtFpgaVersionData
    {63, 80, 80},  // mtFpgaCalData
}};

const Row* find(std::uint8_t type) {
  for (const Row& row : kRows) {
    if (row.type == type) {
      return &row;
    }
  }
  return nullptr;
}

constexpr std::int32_t hex_of(std::uint8_t digit) {
  if (digit >= '0' && digit <= '9') {
    return digit - '0';
  }
  return digit >= 'A' && digit <= 'F' ? digit - 'A' + 10 : -1;
}

/// The length as text; -1 when it is none.
std::int32_t length_of(const std::uint8_t* digits) {
  std::int32_t value = 0;
  for (int i = 0; i < 4; ++i) {
    const std::int32_t digit = hex_of(digits[i]);
    if (digit < 0) {
      return -1;
    }
    value = value * 16 + digit;
  }
  return value;
}

/// Limits, step and control word of mtHeadData, at the places where both heads have them.
bool limits_plausible(const std::uint8_t* limits, std::uint8_t step, std::uint8_t sweep_code) {
  return read_u16_le(limits) < kSeanetTurn && read_u16_le(limits + 2) < kSeanetTurn && step > 0 &&
         sweep_code <= 7;
}

FrameVerdict judge_imaging(const std::uint8_t* bytes, std::size_t size) {
  const std::size_t data_bytes = read_u16_le(bytes + 42);
  const bool wide = (bytes[18] & 1U) != 0;
  const std::size_t bins = wide ? data_bytes : 2 * data_bytes;
  if (data_bytes == 0 || size != kImagingFixed_bytes + data_bytes || bins > kMaxSeanetBins ||
      read_u16_le(bytes + 13) != size - 14) {
    return FrameVerdict::kBadLength;
  }
  const std::uint16_t interval = read_u16_le(bytes + 33);
  const bool good = limits_plausible(bytes + 35, bytes[39], bytes[17]) && interval >= 5 &&
                    interval <= 1'500 && read_u16_le(bytes + 40) < kSeanetTurn && bytes[26] <= 210;
  return good ? FrameVerdict::kFrame : FrameVerdict::kBadValues;
}

FrameVerdict judge_sweep(const std::uint8_t* bytes, std::size_t size) {
  const std::size_t count = size >= kProfilerFixed_bytes ? read_u16_le(bytes + 38) : 0;
  if (count > kMaxSeanetRanges || size != kProfilerFixed_bytes + 2 * count ||
      read_u16_le(bytes + 13) != size - 14) {
    return FrameVerdict::kBadLength;
  }
  const bool good = limits_plausible(bytes + 31, bytes[35], bytes[17]) &&
                    static_cast<std::int64_t>(count) * bytes[35] <= kSeanetTurn + bytes[35];
  return good ? FrameVerdict::kFrame : FrameVerdict::kBadValues;
}

/// What can be told from the first thirteen bytes; kFrame: nothing is wrong so far.
FrameVerdict judge_start(const std::uint8_t* bytes, std::size_t size) {
  if (read_u16_le(bytes + 5) + 6U != size || size < kShortest_bytes ||
      size > kMaxSeanetFrame_bytes) {
    return FrameVerdict::kBadLength;
  }
  const std::uint8_t type = bytes[10];
  const Row* row = find(type);
  if (row == nullptr) {
    return FrameVerdict::kUnknownId;
  }
  // 0 stands for "more than fits", which only mtHeadData has.
  const bool counted =
      bytes[9] == static_cast<std::uint8_t>(size - 11) || (bytes[9] == 0 && type == kHeadData);
  if (size < row->min_bytes || size > row->max_bytes || !counted) {
    return FrameVerdict::kBadLength;
  }
  const bool from_host = bytes[7] == kHost;
  if (from_host == (bytes[8] == kHost) || bytes[12] != (from_host ? bytes[8] : bytes[7])) {
    return FrameVerdict::kBadValues;
  }
  return FrameVerdict::kFrame;
}

Judgement judge(const std::uint8_t* bytes, std::size_t available) {
  if (bytes[0] != '@') {
    return {FrameVerdict::kNoStart, 0};
  }
  for (std::size_t i = 1; i < 5 && i < available; ++i) {
    if (hex_of(bytes[i]) < 0) {
      return {FrameVerdict::kNoStart, 0};
    }
  }
  if (available < 13) {
    return {FrameVerdict::kMore, 0};
  }
  const auto size = static_cast<std::size_t>(length_of(bytes + 1)) + 6;
  const FrameVerdict start = judge_start(bytes, size);
  if (start != FrameVerdict::kFrame) {
    return {start, 0};
  }
  if (available < size) {
    return {FrameVerdict::kMore, 0};
  }
  if (bytes[size - 1] != kEnd) {
    return {FrameVerdict::kBadLength, 0};
  }
  if (bytes[10] == kHeadData && bytes[7] != kHost) {
    const FrameVerdict data =
        bytes[7] == kProfilerNode ? judge_sweep(bytes, size) : judge_imaging(bytes, size);
    if (data != FrameVerdict::kFrame) {
      return {data, 0};
    }
  }
  return {FrameVerdict::kFrame, size};
}

TritechConfig limited(TritechConfig config) {
  config.left = base::clamp(config.left, 0, kSeanetTurn - 1);
  config.right = base::clamp(config.right, 0, kSeanetTurn - 1);
  config.step = base::clamp(config.step, 1, 255);
  config.bins = base::clamp(config.bins, 1, static_cast<std::int32_t>(kMaxSeanetBins));
  config.gain = base::min_of<std::uint8_t>(config.gain, 210);
  config.max_range_um = base::clamp<std::int64_t>(config.max_range_um, 1'000'000, 300'000'000);
  config.frequency_hz = base::clamp(config.frequency_hz, 100'000, 2'000'000);
  config.sound_speed_mm_s = base::clamp(config.sound_speed_mm_s, 1'300'000, 1'700'000);
  config.byte_time_ns = base::clamp(config.byte_time_ns, 0, 100'000'000);
  return config;
}

/// A command without payload behind it; the payload, if any, is at out + 13. Returns its size.
std::size_t write_command(std::uint8_t type, std::uint8_t node, std::size_t payload_bytes,
                          std::uint8_t* out) {
  constexpr char kHex[] = "0123456789ABCDEF";
  const std::size_t size = kShortest_bytes + payload_bytes;
  const auto length = static_cast<std::uint16_t>(size - 6);
  out[0] = '@';
  for (std::size_t i = 0; i < 4; ++i) {
    out[1 + i] = static_cast<std::uint8_t>(kHex[(length >> (12 - 4 * i)) & 0xFU]);
  }
  write_u16_le(out + 5, length);
  out[7] = kHost;
  out[8] = node;
  out[9] = static_cast<std::uint8_t>(length - 5);
  out[10] = type;
  out[11] = 0x80;  // the last, and only, packet
  out[12] = node;
  out[size - 1] = kEnd;
  return size;
}

/// A frequency as the heads' synthesizer counts it: 32 MHz are 2^32.
std::uint32_t synthesizer_of(std::int64_t frequency_hz) {
  return static_cast<std::uint32_t>((frequency_hz << 32U) / 32'000'000);
}

}  // namespace

TritechCodec::TritechCodec(const TritechConfig& config)
    : config_(limited(config)), framer_(kMaxGap_us) {}

bool TritechCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(ping);
}

bool TritechCodec::next(base::Ping& ping) {
  if (deliver(ping)) {
    return true;
  }
  return framer_.take_next(judge, counters_,
                           [&](const FrameBytes& frame) { return take(frame, ping); });
}

void TritechCodec::restart() {
  framer_.reset(counters_);
  sweep_next_ = sweep_count_;
  ++counters_.restarts;
  advance(Step::kVersion);
}

// --- What arrives ---

bool TritechCodec::take(const FrameBytes& frame, base::Ping& ping) {
  const std::uint8_t* bytes = frame.data;
  if (bytes[7] == kHost) {
    ++counters_.ignored;  // an echo of our own
    return false;
  }
  if (config_.head != TritechHead::kListen && bytes[7] != node()) {
    ++counters_.wrong_device;
    return false;
  }
  switch (bytes[10]) {
    case kVersionData:
      state_.software = bytes[13];
      state_.serial_number = read_u16_le(bytes + 15);
      if (step_ == Step::kVersion) {
        advance(Step::kCentre);
      }
      return false;
    case kAlive:
      take_alive(bytes);
      return false;
    case kHeadData:
      if (step_ == Step::kRun) {
        silences_ = 0;
        exchange_.answered();
      }
      if (bytes[7] == kProfilerNode) {
        take_sweep(frame);
        return deliver(ping);
      }
      return take_imaging(frame, ping);
    default:
      ++counters_.ignored;
      return false;
  }
}

void TritechCodec::take_alive(const std::uint8_t* bytes) {
  state_.motor_position = read_u16_le(bytes + 18);
  state_.head_info = bytes[20];
  const bool lost = (state_.head_info & kNoParameters) != 0;
  centred_ = (state_.head_info & kCentring) == 0;
  ready_ = centred_ && !lost;
  if (step_ == Step::kVersion && silences_ == 0 && state_.serial_number == 0) {
    exchange_.answered();  // it has just come up: ask at once
    ++silences_;
  } else if (step_ == Step::kCentre && centred_) {
    exchange_.answered();
  } else if (step_ == Step::kConfigure && ready_) {
    advance(Step::kRun);
  } else if (step_ == Step::kRun && lost) {
    ++counters_.restarts;
    advance(Step::kCentre);
  }
}

void TritechCodec::take_status(std::uint8_t head_status) {
  // Power was gone, or the motor lost its place: the parameters must be sent again.
  if ((head_status & 3U) != 0 && step_ == Step::kRun) {
    ++counters_.restarts;
    advance(Step::kCentre);
  }
}

bool TritechCodec::take_imaging(const FrameBytes& frame, base::Ping& ping) {
  const std::uint8_t* bytes = frame.data;
  const std::size_t data_bytes = read_u16_le(bytes + 42);
  const bool wide = (bytes[18] & 1U) != 0;
  const std::size_t bins = wide ? data_bytes : 2 * data_bytes;
  for (std::size_t i = 0; i < bins; ++i) {
    const std::uint8_t value = bytes[44 + (wide ? i : i / 2)];
    const bool high = (i % 2 == 0) == config_.high_nibble_first;
    const auto nibble = static_cast<std::uint16_t>(high ? value >> 4U : value & 0xFU);
    intensity_[i] = wide ? value : nibble;
  }
  const std::int64_t interval = read_u16_le(bytes + 33);
  const std::int64_t speed = config_.sound_speed_mm_s;
  const std::int32_t turned = read_u16_le(bytes + 40) - kAhead;
  ping = base::Ping{};
  ping.t_receive_us = frame.t_arrival_us -
                      static_cast<std::int64_t>(frame.size_bytes) * config_.byte_time_ns / 1000;
  ping.t_transmit_us = ping.t_receive_us - static_cast<std::int64_t>(bins) * interval * 640 / 1000;
  ping.azimuth_bam32 = bam_of_parts(config_.clockwise ? turned : -turned, kSeanetTurn);
  ping.mount = config_.mount;
  ping.kind = base::ReturnKind::kProfile;
  ping.quality = 255;
  ping.sound_speed_mm_s = config_.sound_speed_mm_s;
  ping.profile.intensity = intensity_.data();
  ping.profile.bin_count = static_cast<std::uint16_t>(bins);
  // 640 ns there and back: 320e-9 s of sound a unit.
  ping.profile.bin_um = static_cast<std::uint32_t>((interval * speed * 32 + 50'000) / 100'000);
  ping.profile.first_bin_um = interval * speed * 16 / 100'000;
  ++counters_.records;
  take_status(bytes[16]);
  return true;
}

void TritechCodec::take_sweep(const FrameBytes& frame) {
  const std::uint8_t* bytes = frame.data;
  const bool scan_right = (bytes[18] & 4U) != 0;
  const std::int32_t right = read_u16_le(bytes + 33);
  const std::int32_t step = bytes[35];
  sweep_count_ = read_u16_le(bytes + 38);
  sweep_next_ = 0;
  const auto count = static_cast<std::int32_t>(sweep_count_);
  sweep_first_ = scan_right ? right - (count - 1) * step : right;
  sweep_step_ = scan_right ? step : -step;
  sweep_us_ = read_u16_le(bytes + 36) * std::int64_t{100};
  t_sweep_end_us_ = frame.t_arrival_us -
                    static_cast<std::int64_t>(frame.size_bytes) * config_.byte_time_ns / 1000;
  for (std::size_t i = 0; i < sweep_count_; ++i) {
    two_way_us_[i] = read_u16_le(bytes + 40 + 2 * i);
  }
  take_status(bytes[16]);
}

bool TritechCodec::deliver(base::Ping& ping) {
  if (sweep_next_ >= sweep_count_) {
    return false;
  }
  const auto index = static_cast<std::int64_t>(sweep_next_);
  const auto count = static_cast<std::int64_t>(sweep_count_);
  const std::int64_t two_way_us = two_way_us_[sweep_next_];
  ++sweep_next_;
  const std::int64_t turned = sweep_first_ + index * sweep_step_ - kAhead;
  ping = base::Ping{};
  ping.t_transmit_us =
      t_sweep_end_us_ - base::max_of(two_way_us, sweep_us_ * (count - index) / count);
  ping.t_receive_us = ping.t_transmit_us + two_way_us;
  ping.azimuth_bam32 = bam_of_parts(config_.clockwise ? turned : -turned, kSeanetTurn);
  ping.mount = config_.mount;
  ping.quality = 255;
  ping.sound_speed_mm_s = config_.sound_speed_mm_s;
  ping.kind = two_way_us > 0 ? base::ReturnKind::kRange : base::ReturnKind::kNoReturn;
  ping.range_um = two_way_us * config_.sound_speed_mm_s / 2000;
  ++counters_.records;
  return true;
}

// --- What is asked ---

std::uint8_t TritechCodec::node() const {
  return config_.head == TritechHead::kProfiler ? kProfilerNode : kImagingNode;
}

void TritechCodec::advance(Step step) {
  step_ = step;
  silences_ = 0;
  centred_ = false;
  ready_ = false;
  exchange_.answered();
}

std::size_t TritechCodec::request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity) {
  if (config_.head == TritechHead::kListen || capacity < kMaxRequest_bytes) {
    return 0;
  }
  if (exchange_.gave_up(now_us)) {
    ++counters_.timeouts;
    ++silences_;
    if (step_ == Step::kRun && silences_ >= kMaxInARow) {
      ++counters_.restarts;
      advance(Step::kVersion);
    } else if (step_ == Step::kCentre || step_ == Step::kConfigure) {
      advance(Step::kVersion);  // it is not there any more, or does not come to rest
    }
  }
  if (exchange_.waiting()) {
    return 0;
  }
  switch (step_) {
    case Step::kVersion:
      exchange_.sent(now_us, kCommandTimeout_us);
      return write_command(kSendVersion, node(), 0, out);
    case Step::kCentre:
      if (!centred_) {
        exchange_.sent(now_us, kCentreTimeout_us);  // nothing to say: wait for mtAlive
        return 0;
      }
      advance(Step::kConfigure);
      exchange_.sent(now_us, kConfigureTimeout_us);
      return write_head_command(out);
    case Step::kConfigure:
      return 0;
    case Step::kRun: {
      exchange_.sent(now_us, kCommandTimeout_us);
      const std::size_t size = write_command(kSendData, node(), 4, out);
      const std::int64_t ms = now_us / 1000 % kDay_ms;
      write_u32_le(out + 13, static_cast<std::uint32_t>(ms < 0 ? ms + kDay_ms : ms));
      return size;
    }
  }
  return 0;
}

std::size_t TritechCodec::write_head_command(std::uint8_t* out) const {
  const bool profiler = config_.head == TritechHead::kProfiler;
  const bool two_channels = profiler || config_.two_channels;
  for (std::size_t i = 0; i < kMaxRequest_bytes; ++i) {
    out[i] = 0;
  }
  const std::size_t size = write_command(kHeadCommand, node(), two_channels ? 68 : 52, out);
  const std::int64_t range_m = config_.max_range_um / 1'000'000;
  const std::int64_t range_dm = config_.max_range_um / 100'000;
  out[13] = two_channels ? 0x1D : 0x01;
  // Raw, has a motor, reply by ASL; continuous; imaging also to the right, and 8 bits if asked for.
  const std::uint16_t control = config_.eight_bits ? 0x2307 : 0x2306;
  write_u16_le(out + 14, profiler ? std::uint16_t{0x2300} : control);
  out[16] = profiler ? 5 : 2;
  const std::uint32_t transmit = synthesizer_of(config_.frequency_hz);
  const std::uint32_t receive = synthesizer_of(config_.frequency_hz + std::int64_t{455'000});
  write_u32_le(out + 17, transmit);
  write_u32_le(out + 21, transmit);
  write_u32_le(out + 25, receive);
  write_u32_le(out + 29, receive);
  write_u16_le(out + 33, static_cast<std::uint16_t>(
                             base::clamp<std::int64_t>((range_m + 10) * 25 / 10, 50, 350)));
  write_u16_le(out + 35, static_cast<std::uint16_t>(range_dm));
  write_u16_le(out + 37, static_cast<std::uint16_t>(config_.left));
  write_u16_le(out + 39, static_cast<std::uint16_t>(config_.right));
  out[49] = 25;  // 250 us between steps of the motor
  out[50] = static_cast<std::uint8_t>(config_.step);
  write_u16_le(out + 59, 1600);
  out[61] = 1;
  if (profiler) {
    const std::int64_t over_khz = (config_.frequency_hz - std::int64_t{600'000}) / 1000;
    out[41] = config_.gain;
    out[43] = 107;  // adaptive gain: most, and set point
    out[44] = 100;
    write_u16_le(out + 45, static_cast<std::uint16_t>(114 + over_khz * 36 / 600));
    write_u16_le(out + 47, static_cast<std::uint16_t>(114 + over_khz * 36 / 600));
    write_u16_le(out + 51, 30);
    write_u16_le(out + 57, static_cast<std::uint16_t>(542 - over_khz * 271 / 600));
    constexpr std::uint8_t kChannels[8] = {0x32, 0x32, 1, 1, 0x6B, 0x6B, 0x64, 0x64};
    for (std::size_t i = 0; i < sizeof kChannels; ++i) {
      out[65 + i] = kChannels[i];
    }
    write_u16_le(out + 73, 110);
    write_u16_le(out + 75, 150);
    return size;
  }
  out[41] = 77;  // 24 and 13 dB of 80 in 255: only of use with 4 bits
  out[42] = 40;
  out[43] = config_.gain;
  out[44] = config_.gain;
  write_u16_le(out + 45, 125);
  write_u16_le(out + 47, 125);
  // Two-way time of a bin in 640 ns: 2 R / (bins c 640e-9).
  const std::int64_t interval = 3'125'000 * config_.max_range_um /
                                (std::int64_t{config_.bins} * config_.sound_speed_mm_s * 1000);
  write_u16_le(out + 51, static_cast<std::uint16_t>(base::clamp<std::int64_t>(interval, 5, 1'500)));
  write_u16_le(out + 53, static_cast<std::uint16_t>(config_.bins));
  write_u16_le(out + 55, 1000);
  write_u16_le(out + 57, 100);
  if (two_channels) {
    constexpr std::uint8_t kChannels[8] = {77, 77, 40, 40, 0, 0, 99, 99};
    for (std::size_t i = 0; i < sizeof kChannels; ++i) {
      out[65 + i] = i == 4 || i == 5 ? config_.gain : kChannels[i];
    }
    write_u16_le(out + 73, 125);
    write_u16_le(out + 75, 125);
  }
  return size;
}

}  // namespace leadline::hal
