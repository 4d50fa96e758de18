#include "host_tools/monitor/player.hpp"

#include <algorithm>

#include "firmware/config/input_file.hpp"
#include "host_tools/exit_codes.hpp"
#include "proto/framing.hpp"
#include "proto/log.hpp"
#include "proto/messages.hpp"

namespace leadline::host {

/// Goes through the frames of the file and keeps where those of the downlink stand.
class Player::Indexer {
 public:
  explicit Indexer(std::vector<Piece>* pieces) : pieces_(pieces) {}

  void feed(const std::uint8_t* data, std::size_t size_bytes) {
    while (size_bytes > 0) {
      std::size_t used = 0;
      proto::FrameView frame{};
      const bool complete = buffer_.decoder().feed(data, size_bytes, used, frame);
      offset_ += used;
      data += used;
      size_bytes -= used;
      if (complete) {
        take(frame);
        frame_begin_ = offset_;
      }
    }
  }

 private:
  void take(const proto::FrameView& frame) {
    proto::MessageType type{};
    if (!proto::message_type(frame.payload, frame.payload_bytes, type)) {
      keep();  // of a newer minor: the receiver counts it
      return;
    }
    learn_time(type, frame);
    const bool down = type < proto::MessageType::kResendRequest;
    if (down || type == proto::MessageType::kLogEnd) {
      keep();
    }
  }

  void learn_time(proto::MessageType type, const proto::FrameView& frame) {
    if (type == proto::MessageType::kLogCycle) {
      const auto cycle = proto::decode_log_cycle(frame.payload, frame.payload_bytes);
      if (cycle.ok()) {
        logged_ = true;
        advance(cycle.value().t_us);
      }
    } else if (type == proto::MessageType::kStatus && !logged_) {
      const auto status = proto::decode_status(frame.payload, frame.payload_bytes);
      if (status.ok()) {
        advance(status.value().t_us);
      }
    } else if (type == proto::MessageType::kBrief && !logged_) {
      const auto brief = proto::decode_brief(frame.payload, frame.payload_bytes);
      if (brief.ok()) {
        const auto now_ms = static_cast<std::uint32_t>(t_us_ / 1000);
        const auto ahead_ms = static_cast<std::int32_t>(brief.value().t_ms - now_ms);
        advance(t_us_ + std::int64_t{ahead_ms} * 1000);
      }
    }
  }

  /// The recording's clock never goes back: a vehicle that started again goes on behind what was.
  void advance(base::TimeUs t_us) {
    if (t_us + shift_us_ < t_us_) {
      shift_us_ = t_us_ - t_us;
    }
    t_us_ = t_us + shift_us_;
  }

  void keep() {
    const auto size = static_cast<std::uint32_t>(offset_ - frame_begin_);
    if (!pieces_->empty()) {
      Piece& last = pieces_->back();
      if (last.t_us == t_us_ && last.offset + last.size_bytes == frame_begin_ &&
          last.size_bytes + size <= kMaxPiece_bytes) {
        last.size_bytes += size;
        return;
      }
    }
    pieces_->push_back({t_us_, frame_begin_, size});
  }

  std::vector<Piece>* pieces_;
  proto::FrameDecoderBuffer<> buffer_;
  std::uint64_t offset_ = 0;
  std::uint64_t frame_begin_ = 0;
  base::TimeUs t_us_ = 0;
  base::TimeUs shift_us_ = 0;
  bool logged_ = false;
};

Player::Player(const std::string& path, double speed)
    : path_(path), file_(open_input(path)), buffer_(kMaxPiece_bytes) {
  Indexer indexer(&pieces_);
  for (;;) {
    file_.read(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    const std::streamsize got = file_.gcount();
    if (got <= 0) {
      break;
    }
    indexer.feed(reinterpret_cast<const std::uint8_t*>(buffer_.data()),
                 static_cast<std::size_t>(got));
  }
  if (pieces_.empty()) {
    throw HostError(ExitCode::kInput,
                    path + ": holds no frame of a vehicle's link: neither a log nor a capture");
  }
  file_.clear();
  // What comes before the first word about the time belongs to it.
  const auto timed = std::find_if(pieces_.begin(), pieces_.end(),
                                  [](const Piece& piece) { return piece.t_us != 0; });
  if (timed != pieces_.end()) {
    std::for_each(pieces_.begin(), timed, [&timed](Piece& piece) { piece.t_us = timed->t_us; });
  }
  begin_us_ = pieces_.front().t_us;
  playing_ = speed > 0.0;
  speed_ = playing_ ? speed : 1.0;
  position_s_ = playing_ ? 0.0 : length_s();
}

double Player::length_s() const {
  return static_cast<double>(pieces_.back().t_us - begin_us_) * 1e-6;
}

void Player::take(const PageRequest& request) {
  switch (request.kind) {
    case PageRequest::Kind::kSeek:
      position_s_ = std::min(request.t_s, length_s());
      break;
    case PageRequest::Kind::kPlay:
      if (position_s_ >= length_s()) {
        position_s_ = 0.0;  // again
      }
      speed_ = request.speed;
      playing_ = true;
      break;
    case PageRequest::Kind::kPause:
      playing_ = false;
      break;
  }
  restart_ = position_s_ < fed_s_;
  behind_ = behind_ || request.kind == PageRequest::Kind::kSeek || restart_;
}

void Player::step(double now_s, const Sink& sink) {
  const double elapsed_s = last_s_ < 0.0 ? 0.0 : now_s - last_s_;
  last_s_ = now_s;
  if (playing_ && !behind_) {
    position_s_ = std::min(position_s_ + elapsed_s * speed_, length_s());
    playing_ = position_s_ < length_s();
  }
  if (restart_) {
    restart_ = false;
    next_ = 0;
    sink.restart();
  }
  // In microseconds, rounded up: the last piece is due at the end whatever the division did.
  const base::TimeUs until_us = begin_us_ + static_cast<base::TimeUs>(position_s_ * 1e6 + 0.5);
  std::size_t fed_bytes = 0;
  while (next_ < pieces_.size() && pieces_[next_].t_us <= until_us && fed_bytes < kStep_bytes) {
    const Piece& piece = pieces_[next_];
    next_ += 1;
    file_.seekg(static_cast<std::streamoff>(piece.offset));
    file_.read(buffer_.data(), piece.size_bytes);
    const auto got = static_cast<std::size_t>(std::max<std::streamsize>(file_.gcount(), 0));
    file_.clear();
    sink.feed(reinterpret_cast<const std::uint8_t*>(buffer_.data()), got, piece.t_us);
    fed_bytes += piece.size_bytes;
  }
  behind_ = next_ < pieces_.size() && pieces_[next_].t_us <= until_us;
  fed_s_ = position_s_;
}

}  // namespace leadline::host
