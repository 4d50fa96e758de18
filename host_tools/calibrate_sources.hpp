// Where the soundings of a patch test come from: recordings of a survey, or pings files.
#pragma once

#include <string>
#include <vector>

#include "host_tools/calibrate.hpp"
#include "host_tools/import/survey.hpp"
#include "host_tools/ping_csv.hpp"

namespace leadline::host {

/// What `geometry` becomes with an alignment on top, and a sign turned round.
[[nodiscard]] SurveyGeometry aligned(const SurveyGeometry& geometry, const Alignment& alignment,
                                     SignFlip flip);

/// Numbers passes and blocks of time of soundings, which come in their order.
class SoundingGroups {
 public:
  /// `new_line`: the first one of a line.
  void add(bool new_line, std::int64_t t_us, double heading_deg);
  [[nodiscard]] const std::vector<std::uint32_t>& blocks() const { return blocks_; }
  [[nodiscard]] const std::vector<std::uint32_t>& passes() const { return passes_; }

 private:
  std::vector<std::uint32_t> blocks_;
  std::vector<std::uint32_t> passes_;
  std::int64_t stretch_ = 0;  // of the last one
  double course_deg_ = 0;     // of its pass, at first
};

/// Lines as read by read_survey_line(). What it is given must outlive it. place() costs one build_rows().
class RecordedSoundings : public AlignedSoundings {
 public:
  RecordedSoundings(const std::vector<SurveyLine>& lines, const estimator::LocalPlane& plane,
                    const SurveyGeometry& geometry);
  [[nodiscard]] const std::vector<std::uint32_t>& blocks() const override {
    return groups_.blocks();
  }
  [[nodiscard]] const std::vector<std::uint32_t>& passes() const override {
    return groups_.passes();
  }
  void place(const Alignment& alignment, SignFlip flip,
             std::vector<Sounding>* soundings) const override;

 private:
  const std::vector<SurveyLine>& lines_;
  const estimator::LocalPlane& plane_;
  const SurveyGeometry& geometry_;
  SoundingGroups groups_;
};

/// Pings as `leadline map` reads them: each row's pose is that of the head's mount at the row's time, so
/// the alignment is what the mount's boresight and lever arm lack. The poses of a file's rows are the
/// only navigation there is: attitude and position at other instants lie between them by straight line,
/// nowhere across more than `max_gap_us` or a turn of more than kMaxTurn_deg from row to row. Of the
/// geometry: lever arm, boresight, delays, signs, max_angle_deg, max_gap_us.
class PingSoundings : public AlignedSoundings {
 public:
  static constexpr double kMaxTurn_deg = 10.0;

  explicit PingSoundings(const SurveyGeometry& geometry) : geometry_(geometry) {}
  /// One line; rows in order of time.
  void add_line(const std::vector<PingRow>& rows);
  [[nodiscard]] const std::vector<std::uint32_t>& blocks() const override {
    return groups_.blocks();
  }
  [[nodiscard]] const std::vector<std::uint32_t>& passes() const override {
    return groups_.passes();
  }
  void place(const Alignment& alignment, SignFlip flip,
             std::vector<Sounding>* soundings) const override;

 private:
  struct Stand {
    std::int64_t t_us;
    Vec3 position_m;
    Attitude attitude;
  };
  struct Beam {
    Stand reported;  ///< of its own row
    Vec3 direction;
    double range_m;
    std::size_t line;
    std::size_t stand;  ///< of the line, at the same instant
  };
  [[nodiscard]] static Stand stand_of(const PingRow& row);
  [[nodiscard]] bool hang_together(const Stand& a, const Stand& b) const;
  /// How the line's stand changes in `delay_us` from the beam's instant; false where nobody knows.
  [[nodiscard]] bool change(const Beam& beam, std::int64_t delay_us, Stand* change) const;

  SurveyGeometry geometry_;
  std::vector<std::vector<Stand>> stands_;  // of each line, one an instant
  std::vector<Beam> beams_;
  SoundingGroups groups_;
};

}  // namespace leadline::host
