// How vehicle and link fare, as the page shows it: figures from the receiver, rates over the last seconds.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "host_tools/monitor/player.hpp"
#include "host_tools/monitor/rate_window.hpp"
#include "host_tools/store/survey_store.hpp"
#include "host_tools/topside/receiver.hpp"

namespace leadline::host {

/// What only the program knows.
struct PageSurroundings {
  std::string link_uri;
  std::string port_state;     ///< "open", "lost: ..."; "" = nothing to say
  std::string refused;        ///< why nothing of this vehicle is read; "" = it is
  double silent_s = -1.0;     ///< since the last whole frame; < 0: none ever came
  double budget_bytes_s = 0;  ///< of the link; 0: as the vehicle says
  std::size_t viewers = 0;
  std::uint32_t epoch = 0;
  const Player* player = nullptr;  ///< null: not a recording
  std::string stored_path;
  const OpenedSurvey* stored = nullptr;  ///< what is shown instead of a receiver's map; null: that
};

class PageState {
 public:
  /// Takes what the receiver has now; `now_s` is the time that rates of the link count by.
  void follow(const Receiver& receiver, double now_s);
  /// Another map: rates of the vehicle begin again.
  void restart();
  /// `now_s` by the same clock as json()'s.
  void add_notice(const ReceiverNotice& notice, double now_s);

  [[nodiscard]] double bytes_per_second(double now_s) const { return bytes_.per_second(now_s); }
  /// The state message.
  [[nodiscard]] std::string json(const Receiver& receiver, const PageSurroundings& around,
                                 double now_s) const;

 private:
  static constexpr std::size_t kMaxNotices = 30;
  // A link of 1200 baud says a brief every few seconds.
  static constexpr double kWindow_s = 10.0;
  static constexpr double kPingWindow_s = 20.0;

  RateWindow bytes_{kWindow_s};
  RateWindow frames_{kWindow_s};
  RateWindow damaged_{kWindow_s};
  RateWindow fused_{kPingWindow_s};
  struct NumberedNotice {
    std::uint64_t number;
    double t_s;
    proto::Severity severity;
    std::string text;
  };
  std::deque<NumberedNotice> notices_;
  std::uint64_t notice_count_ = 0;
};

}  // namespace leadline::host
