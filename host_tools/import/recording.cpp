#include "host_tools/import/recording.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

#include "hal/can_frame.hpp"
#include "hal/wire.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/import/can_text.hpp"
#include "host_tools/import/xtf.hpp"

namespace leadline::host {
namespace {

using firmware::Driver;

constexpr std::size_t kRawPiece_bytes = 4096;
constexpr std::size_t kMaxLine_bytes = 4096;
constexpr std::size_t kStart_bytes = 65536;  ///< looked at to tell what a file is

class RawRecording : public Recording {
 public:
  explicit RawRecording(ByteSource source) : source_(std::move(source)) {}
  bool next(RecordedBytes* piece) override {
    const std::size_t size = source_.peek(kRawPiece_bytes);
    piece->t_us.reset();
    piece->bytes.assign(source_.data(), source_.data() + size);
    source_.skip(size);
    return size > 0;
  }
  [[nodiscard]] const char* container() const override { return "raw bytes"; }

 private:
  ByteSource source_;
};

class CanTextRecording : public Recording {
 public:
  explicit CanTextRecording(ByteSource source) : source_(std::move(source)) {}
  bool next(RecordedBytes* piece) override {
    std::string text;
    while (source_.line(&text, kMaxLine_bytes)) {
      const CanLine line = reader_.parse(text);
      if (line.kind == CanLineKind::kBad) {
        ++rejected_["bad_line"];
      }
      if (line.kind == CanLineKind::kLong) {
        ++rejected_["can_fd"];
      }
      if (line.kind != CanLineKind::kFrames) {
        continue;
      }
      piece->t_us = line.t_us;
      piece->bytes.clear();
      for (const hal::CanFrame& frame : line.frames) {
        piece->bytes.resize(piece->bytes.size() + hal::kCanFrame_bytes);
        hal::write_can_frame(frame,
                             piece->bytes.data() + piece->bytes.size() - hal::kCanFrame_bytes);
      }
      return true;
    }
    return false;
  }
  [[nodiscard]] const char* container() const override { return "CAN frames as text"; }

 private:
  ByteSource source_;
  CanTextReader reader_;
};

// MAVLink as ground stations keep it. From 2000 to 2100 the time is believed.
constexpr std::uint64_t kTlogFirst_us = 946'684'800'000'000;
constexpr std::uint64_t kTlogLast_us = 4'102'444'800'000'000;
constexpr std::size_t kTlogTime_bytes = 8;
constexpr std::size_t kTlogHead_bytes = kTlogTime_bytes + 3;

/// Of a record with its time; 0 where none begins. Looks at kTlogHead_bytes.
std::size_t tlog_record_bytes(const std::uint8_t* bytes) {
  const std::uint64_t t_us = hal::read_u64_be(bytes);
  if (t_us < kTlogFirst_us || t_us > kTlogLast_us) {
    return 0;
  }
  const std::size_t payload_bytes = bytes[kTlogTime_bytes + 1];
  if (bytes[kTlogTime_bytes] == 0xFE) {
    return kTlogTime_bytes + payload_bytes + 8;
  }
  const bool is_signed = (bytes[kTlogTime_bytes + 2] & 1U) != 0;
  return bytes[kTlogTime_bytes] == 0xFD ? kTlogTime_bytes + payload_bytes + (is_signed ? 25U : 12U)
                                        : 0;
}

class TlogRecording : public Recording {
 public:
  explicit TlogRecording(ByteSource source) : source_(std::move(source)) {}
  bool next(RecordedBytes* piece) override {
    while (source_.peek(kTlogHead_bytes) == kTlogHead_bytes) {
      const std::size_t size = record_bytes();
      if (size == 0) {
        ++rejected_["tlog_bytes"];
        source_.skip(1);
        continue;
      }
      piece->t_us = static_cast<base::TimeUs>(hal::read_u64_be(source_.data()));
      piece->bytes.assign(source_.data() + kTlogTime_bytes, source_.data() + size);
      source_.skip(size);
      return true;
    }
    const std::size_t rest = source_.peek(kTlogHead_bytes);
    if (rest > 0) {
      rejected_["tlog_bytes"] += rest;
      source_.skip(rest);
    }
    return false;
  }
  [[nodiscard]] const char* container() const override { return "MAVLink telemetry log"; }

 private:
  /// Of the record in front, 0 if there is none. A frame that lost bytes still says its old length: where
  /// no record follows there, it ends at the next one that begins earlier.
  std::size_t record_bytes() {
    const std::size_t size = tlog_record_bytes(source_.data());
    if (size == 0) {
      return 0;
    }
    const std::size_t there = source_.peek(size + kTlogHead_bytes);
    const bool follows = there == size + kTlogHead_bytes
                             ? tlog_record_bytes(source_.data() + size) != 0
                             : there == size;
    if (follows) {
      return size;
    }
    for (std::size_t at = kTlogHead_bytes; at + kTlogHead_bytes <= there; ++at) {
      if (tlog_record_bytes(source_.data() + at) != 0) {
        return std::min(at, size);
      }
    }
    return std::min(size, there);
  }
  ByteSource source_;
};

// ping-viewer: everything that has a length has it in front, big-endian.
constexpr std::string_view kPingViewerHeading = "PingViewer sensor log file";
constexpr std::uint32_t kMaxPingViewerText_bytes = 4096;
constexpr std::uint32_t kMaxPingViewerFrame_bytes = 16384;
constexpr base::TimeUs kDay_us = 86'400'000'000;

/// Text of either form (UTF-8; UTF-16 with its first byte 0) as ASCII.
std::string ascii_of(const std::uint8_t* bytes, std::size_t size) {
  std::string text;
  for (std::size_t i = 0; i < size; ++i) {
    if (bytes[i] != 0) {
      text.push_back(static_cast<char>(bytes[i]));
    }
  }
  return text;
}

/// "hh:mm:ss.zzz" since midnight.
std::optional<base::TimeUs> time_of_day_us(const std::string& text) {
  if (text.size() != 12 || text[2] != ':' || text[5] != ':' || text[8] != '.') {
    return std::nullopt;
  }
  std::int64_t digits = 0;
  for (const std::size_t at : {0U, 1U, 3U, 4U, 6U, 7U, 9U, 10U, 11U}) {
    if (text[at] < '0' || text[at] > '9') {
      return std::nullopt;
    }
    digits = digits * 10 + (text[at] - '0');
  }
  const std::int64_t seconds =
      digits / 10'000'000 * 3600 + digits / 100'000 % 100 * 60 + digits / 1000 % 100;
  return seconds * 1'000'000 + digits % 1000 * 1000;
}

class PingViewerRecording : public Recording {
 public:
  explicit PingViewerRecording(ByteSource source) : source_(std::move(source)) {
    std::string ignored;
    std::uint32_t number = 0;
    in_step_ = text(&ignored) && word(&number);
    for (int i = 0; in_step_ && i < 5; ++i) {  // revision, date, tag, system, its version
      in_step_ = text(&ignored);
    }
    in_step_ = in_step_ && word(&number) && word(&number);  // sensor family and type
  }
  bool next(RecordedBytes* piece) override {
    std::string stamp;
    while (in_step_ && source_.peek(1) == 1) {
      std::uint32_t size = 0;
      in_step_ = text(&stamp) && word(&size) && size <= kMaxPingViewerFrame_bytes &&
                 source_.peek(size) == size;
      const std::optional<base::TimeUs> time_us = time_of_day_us(stamp);
      if (!in_step_ || !time_us) {
        break;
      }
      // No date in the file: a clock that went far back has passed midnight.
      const base::TimeUs before_us = last_us_ - day_us_;
      day_us_ += *time_us + kDay_us / 2 < before_us ? kDay_us : 0;
      last_us_ = day_us_ + *time_us;
      if (size == 0) {
        ++rejected_["empty_record"];
        continue;
      }
      piece->t_us = last_us_;
      piece->bytes.assign(source_.data(), source_.data() + size);
      source_.skip(size);
      return true;
    }
    return rest(piece);
  }
  [[nodiscard]] const char* container() const override { return "ping-viewer log"; }

 private:
  /// Out of step nothing says where a record begins; the frames in what follows are still frames.
  bool rest(RecordedBytes* piece) {
    in_step_ = false;
    const std::size_t size = source_.peek(kRawPiece_bytes);
    if (size == 0) {
      return false;
    }
    rejected_["log_bytes"] += size;
    piece->t_us.reset();
    piece->bytes.assign(source_.data(), source_.data() + size);
    source_.skip(size);
    return true;
  }
  bool word(std::uint32_t* value) {
    if (source_.peek(4) < 4) {
      return false;
    }
    *value = hal::read_u32_be(source_.data());
    source_.skip(4);
    return true;
  }
  bool text(std::string* value) {
    std::uint32_t size = 0;
    if (!word(&size) || size > kMaxPingViewerText_bytes || source_.peek(size) < size) {
      return false;
    }
    *value = ascii_of(source_.data(), size);
    source_.skip(size);
    return true;
  }

  ByteSource source_;
  bool in_step_ = true;
  base::TimeUs last_us_ = 0;
  base::TimeUs day_us_ = 0;
};

// XTF: the reader of `leadline survey`, of which only the head's own packets are wanted here.
constexpr std::uint8_t kXtfFile = 0x7B;
constexpr std::size_t kXtfFileHeader_bytes = 1024;

class XtfRecording : public Recording {
 public:
  explicit XtfRecording(ByteSource source) : reader_(std::move(source), "XTF") {}
  bool next(RecordedBytes* piece) override {
    XtfItem item{};
    while (reader_.next(&item)) {
      if (item.kind == XtfItemKind::kR2Sonic) {
        piece->t_us = item.t_us;
        piece->bytes.assign(item.bytes, item.bytes + item.size_bytes);
        return true;
      }
    }
    count("xtf_bytes", reader_.stats().skipped_bytes);
    count("xtf_packets", reader_.stats().unusable);
    count("xtf_cut", reader_.stats().cut ? 1 : 0);
    return false;
  }
  [[nodiscard]] const char* container() const override { return "XTF"; }

 private:
  void count(const char* reason, std::uint64_t number) {
    if (number > 0) {
      rejected_[reason] = number;
    }
  }
  XtfReader reader_;
};

std::string first_lines(ByteSource* source, std::size_t size) {
  const std::size_t there = source->peek(size);
  return std::string(reinterpret_cast<const char*>(source->data()), there);
}

/// One of the first lines is a frame.
bool is_can_text(ByteSource* source) {
  const std::string start = first_lines(source, kStart_bytes);
  std::string_view text = start;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    if (!line.empty() && line.back() == '\r') {
      line.remove_suffix(1);
    }
    if (looks_like_can_text(line)) {
      return true;
    }
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return false;
}

bool is_ping_viewer(ByteSource* source) {
  constexpr std::size_t kLook_bytes = 4 + 2 * kPingViewerHeading.size();
  const std::size_t there = source->peek(kLook_bytes);
  return there > 4 &&
         ascii_of(source->data() + 4, there - 4).rfind(kPingViewerHeading.substr(0, 20), 0) == 0;
}

/// Two records one behind the other, near the beginning.
bool is_tlog(ByteSource* source) {
  const std::size_t there = source->peek(kStart_bytes);
  for (std::size_t at = 0; at + kTlogHead_bytes <= there; ++at) {
    const std::size_t size = tlog_record_bytes(source->data() + at);
    const bool alone = size > 0 && at + size == there;
    if (alone || (size > 0 && at + size + kTlogHead_bytes <= there &&
                  tlog_record_bytes(source->data() + at + size) > 0)) {
      return true;
    }
  }
  return false;
}

bool is_xtf(ByteSource* source) {
  return source->peek(kXtfFileHeader_bytes) == kXtfFileHeader_bytes &&
         source->data()[0] == kXtfFile;
}

}  // namespace

std::unique_ptr<Recording> open_recording(ByteSource source, Driver driver) {
  const bool ping = driver == Driver::kPing1d || driver == Driver::kPing360;
  if (ping && is_ping_viewer(&source)) {
    return std::make_unique<PingViewerRecording>(std::move(source));
  }
  if (driver == Driver::kNmea2000 && is_can_text(&source)) {
    return std::make_unique<CanTextRecording>(std::move(source));
  }
  if (driver == Driver::kMavlink && is_tlog(&source)) {
    return std::make_unique<TlogRecording>(std::move(source));
  }
  if (driver == Driver::kR2sonic && is_xtf(&source)) {
    return std::make_unique<XtfRecording>(std::move(source));
  }
  return std::make_unique<RawRecording>(std::move(source));
}

}  // namespace leadline::host
