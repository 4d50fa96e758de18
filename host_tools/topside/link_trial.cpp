#include "host_tools/topside/link_trial.hpp"

#include <algorithm>
#include <deque>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "proto/framing.hpp"

namespace leadline::host {
namespace {

using Bytes = std::vector<std::uint8_t>;
using base::TimeUs;

// Alarms of a vehicle without devices are all raised, and said, within this time.
constexpr TimeUs kSettle_us = 15'000'000;
constexpr TimeUs kLongestSettle_us = 7'200'000'000;

/// Whole frames of a downlink, one by one: `each(data, size)`.
template <typename Each>
void each_frame(const firmware::OutputSpan& downlink, Each each) {
  std::size_t begin = 0;
  for (std::size_t at = 1; at < downlink.size_bytes; ++at) {
    if (downlink.data[at] == proto::kDelimiter) {
      each(downlink.data + begin, at + 1 - begin);
      begin = at + 1;
      at = begin;  // its leading delimiter
    }
  }
}

/// Which tiles of a receiver's map are not the vehicle's, kept up to date by what changed.
class Comparison {
 public:
  explicit Comparison(const firmware::Vehicle& vehicle)
      : vehicle_(vehicle), differs_(vehicle.model().grid().tile_count(), false) {
    restart();
  }
  void restart() {
    seen_ = 0;
    differing_ = 0;
    for (std::uint32_t tile = 0; tile < differs_.size(); ++tile) {
      const proto::CodedCell* const cells = vehicle_.link_cells(tile);
      differs_[tile] = std::any_of(cells, cells + proto::kTileArea_cells,
                                   [](proto::CodedCell cell) { return proto::cell_known(cell); });
      differing_ += differs_[tile] ? 1U : 0U;
    }
  }
  void update(const TileStore& store) {
    for (const std::uint32_t tile : store.changed_since(seen_)) {
      const proto::CodedCell* const theirs = vehicle_.link_cells(tile);
      const bool differs =
          !std::equal(theirs, theirs + proto::kTileArea_cells, store.tile(tile)->cells);
      differing_ += differs ? 1U : 0U;
      differing_ -= differs_[tile] ? 1U : 0U;
      differs_[tile] = differs;
    }
    seen_ = store.sequence();
  }
  [[nodiscard]] std::uint32_t differing() const { return differing_; }

 private:
  const firmware::Vehicle& vehicle_;
  std::vector<bool> differs_;
  std::uint32_t differing_ = 0;
  std::uint64_t seen_ = 0;
};

class Trial {
 public:
  using Watch = std::function<void(TimeUs, const Receiver&)>;

  Trial(firmware::Vehicle* vehicle, TimeUs* t_us, const LinkTrialOptions& options,
        const Watch& watch)
      : vehicle_(vehicle),
        t_us_(t_us),
        options_(options),
        watch_(watch),
        down_(options.line, 0),
        up_(options.line, 1),
        comparison_(*vehicle) {}

  LinkTrialResult run() {
    receiver_ = std::make_unique<Receiver>();
    if (options_.introduced) {
      introduce();
    }
    vehicle_->restart_link();
    begin_us_ = *t_us_;
    down_.begin(begin_us_);
    up_.begin(begin_us_);
    tiles_lost_before_ = vehicle_->counters().tiles_lost;
    result_.tiles = vehicle_->counters().tiles_unsent;
    TimeUs poll_us = begin_us_;
    TimeUs cycle_us = begin_us_ + options_.cycle_us;
    bool restarted = options_.topside_restart_us == 0;
    cycle(begin_us_);
    result_.tiles = comparison_.differing();
    while (!done_ && cycle_us - begin_us_ <= options_.most_us) {
      // As the vehicle's program: on time, and when something came up the link.
      const TimeUs heard_us = std::max(std::min(up_.next_us(), wish_us_),
                                       *t_us_ + firmware::least_cycle_us(options_.cycle_us));
      const TimeUs now_us = std::min({cycle_us, heard_us, poll_us, down_.next_us()});
      if (!restarted && now_us - begin_us_ >= options_.topside_restart_us) {
        restarted = true;
        receiver_ = std::make_unique<Receiver>();
        comparison_.restart();
      }
      while (auto frame = down_.receive(now_us)) {
        take(frame->first, frame->second);
        if (done_) {
          return result_;
        }
      }
      answer(now_us);
      if (now_us == poll_us) {
        poll_us += kUplinkPoll_us;
      }
      if (now_us == cycle_us || now_us == heard_us) {
        cycle(now_us);
        cycle_us += now_us == cycle_us ? options_.cycle_us : 0;
      }
    }
    finish(cycle_us - options_.cycle_us);
    return result_;
  }

 private:
  // The vehicle says hello on request; nobody hears the rest of what it says meanwhile.
  void introduce() {
    const std::uint8_t payload = static_cast<std::uint8_t>(proto::MessageType::kHelloRequest);
    Bytes request(proto::frame_bound_bytes(1));
    request.resize(proto::encode_frame(&payload, 1, request.data(), request.size()).value());
    for (int k = 0; k < 400 && receiver_->store() == nullptr; ++k) {
      *t_us_ += options_.cycle_us;
      const firmware::InputChunk chunk{*t_us_, request.data(),
                                       static_cast<std::uint16_t>(request.size()),
                                       firmware::kUplinkPort};
      firmware::CycleOutput output{};
      vehicle_->cycle({*t_us_, &chunk, k == 0 ? 1U : 0U, kRoom_bytes}, output);
      each_frame(output.downlink, [this](const std::uint8_t* frame, std::size_t size) {
        Receiver probe;
        probe.feed(frame, size);
        if (probe.counters().hellos > 0) {
          receiver_->feed(frame, size);
        }
      });
    }
  }

  [[nodiscard]] bool cut(TimeUs now_us) const {
    const TimeUs since_us = now_us - begin_us_;
    return since_us >= options_.cut_from_us && since_us < options_.cut_until_us;
  }

  void cycle(TimeUs now_us) {
    std::vector<Bytes> arrived;
    std::vector<firmware::InputChunk> chunks;
    while (auto frame = up_.receive(now_us)) {
      arrived.push_back(std::move(frame->second));
      const Bytes& bytes = arrived.back();
      chunks.push_back({frame->first, bytes.data(), static_cast<std::uint16_t>(bytes.size()),
                        firmware::kUplinkPort});
    }
    firmware::CycleOutput output{};
    vehicle_->cycle({now_us, chunks.data(), chunks.size(), kRoom_bytes}, output);
    *t_us_ = now_us;
    wish_us_ = output.wish_us == 0 ? INT64_MAX : now_us + output.wish_us;
    each_frame(output.downlink, [this, now_us](const std::uint8_t* frame, std::size_t size) {
      result_.bytes_down += size;
      result_.frames_down += 1;
      last_second_.emplace_back(now_us, size);
      in_last_second_ += size;
      count_kind(frame[kTypeAt], size);
      result_.frames_dropped += down_.send(now_us, frame, size, cut(now_us)) ? 0U : 1U;
    });
    while (!last_second_.empty() && last_second_.front().first <= now_us - 1'000'000) {
      in_last_second_ -= last_second_.front().second;
      last_second_.pop_front();
    }
    result_.most_in_1s = std::max<std::uint64_t>(result_.most_in_1s, in_last_second_);
  }

  void count_kind(std::uint8_t type, std::size_t size_bytes) {
    const auto kind = static_cast<proto::MessageType>(type);
    const bool status = kind == proto::MessageType::kStatus || kind == proto::MessageType::kBrief;
    result_.delta_bytes += kind == proto::MessageType::kTileDelta ? size_bytes : 0U;
    result_.coarse_bytes += kind == proto::MessageType::kCoarseDelta ? size_bytes : 0U;
    result_.status_bytes += status ? size_bytes : 0U;
  }

  void take(TimeUs now_us, const Bytes& frame) {
    receiver_->feed(frame.data(), frame.size());
    if (watch_) {
      watch_(now_us - begin_us_, *receiver_);
    }
    if (receiver_->store() != nullptr) {
      comparison_.update(*receiver_->store());
      if (comparison_.differing() == 0 && options_.topside_restart_us < now_us - begin_us_) {
        finish(now_us);
      }
    }
  }

  void answer(TimeUs now_us) {
    for (Bytes frame = receiver_->uplink(now_us); !frame.empty();
         frame = receiver_->uplink(now_us)) {
      result_.bytes_up += frame.size();
      result_.frames_up += 1;
      up_.send(now_us, frame.data(), frame.size(), cut(now_us));
    }
  }

  void finish(TimeUs now_us) {
    done_ = true;
    result_.seconds = 1e-6 * static_cast<double>(now_us - begin_us_);
    result_.hash_equal =
        receiver_->store() != nullptr && receiver_->store()->cells_hash() == vehicle_->cells_hash();
    result_.converged = result_.hash_equal;
    result_.tiles_lost = vehicle_->counters().tiles_lost - tiles_lost_before_;
    result_.idle_seconds = 1e-6 * down_.idle_us(now_us);
    result_.cells_came = receiver_->counters().delta_cells;
    result_.cells_needless = receiver_->counters().repeated_cells;
  }

  /// Delimiter and code of the first block stand before it; no type is 0.
  static constexpr std::size_t kTypeAt = 2;
  static constexpr std::uint32_t kRoom_bytes = firmware::kDownlinkCapacity_bytes;

  firmware::Vehicle* vehicle_;
  TimeUs* t_us_;
  const LinkTrialOptions& options_;
  const Watch& watch_;
  LossyLine down_;
  LossyLine up_;
  Comparison comparison_;
  std::unique_ptr<Receiver> receiver_;
  TimeUs begin_us_ = 0;
  TimeUs wish_us_ = INT64_MAX;
  std::uint64_t tiles_lost_before_ = 0;
  std::deque<std::pair<TimeUs, std::size_t>> last_second_;
  std::size_t in_last_second_ = 0;
  bool done_ = false;
  LinkTrialResult result_;
};

}  // namespace

void settle_vehicle(firmware::Vehicle* vehicle, TimeUs* t_us, TimeUs cycle_us) {
  const TimeUs begin_us = *t_us;
  while (*t_us - begin_us < kSettle_us ||
         (!vehicle->drained() && *t_us - begin_us < kLongestSettle_us)) {
    *t_us += cycle_us;
    firmware::CycleOutput output{};
    vehicle->cycle({*t_us, nullptr, 0, firmware::kDownlinkCapacity_bytes}, output);
  }
}

LinkTrialResult run_link_trial(
    firmware::Vehicle* vehicle, TimeUs* t_us, const LinkTrialOptions& options,
    const std::function<void(TimeUs since_us, const Receiver& receiver)>& watch) {
  return Trial(vehicle, t_us, options, watch).run();
}

}  // namespace leadline::host
