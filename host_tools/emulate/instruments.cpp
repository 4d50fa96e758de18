#include "host_tools/emulate/instruments.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "host_tools/sim/exact_math.hpp"

namespace leadline::host {
namespace {

// Streams of the mission's seed. Heads take four each from kHeadStreams on.
enum Stream : std::uint64_t {
  kAttitudeStream = 1,
  kFixStream = 2,
  kPressureStream = 3,
  kHeadingDriftStream = 4,
  kNorthDriftStream = 5,
  kEastDriftStream = 6,
  kMisalignmentStream = 7,
  kHeadStreams = 16,
  kFishStreams = 1024,  // one a head
};

constexpr std::size_t kRays = 300;
// Share of the echo's energy that has arrived when the heads' own detectors fire.
constexpr double kDetectionFraction = 0.1;
constexpr double kProfilePeak = 220.0;
constexpr double kProfileNoise = 9.0;

EchoSpec echo_spec(const Mission& mission, const HeadSpec& head) {
  EchoSpec spec;
  spec.beam_half_angle_deg = head.beam_half_angle_deg;
  spec.across_half_angle_deg = head.across_half_angle_deg;
  spec.ray_count = kRays;
  spec.detection_fraction = kDetectionFraction;
  spec.range_bin_m = 0.125 * mission.ground.cell_m;
  spec.max_range_m = head.max_range_m;
  return spec;
}

std::uint64_t head_stream(std::size_t number, std::uint64_t which) {
  return kHeadStreams + 4 * static_cast<std::uint64_t>(number) + which;
}

Vec3 misalignment_rad(const Mission& mission, std::size_t number) {
  Random random(mission.seed, kMisalignmentStream);
  Vec3 angle;
  for (std::size_t k = 0; k <= number; ++k) {
    angle.x = random.normal();
    angle.y = random.normal();
  }
  return mission.errors.misalignment_deg * exact::kRadPerDeg * angle;
}

}  // namespace

double SlowError::at(std::int64_t time_us) {
  const double elapsed_s = static_cast<double>(time_us - last_us_) * 1e-6;
  if (sigma_ == 0.0 || elapsed_s <= 0.0) {
    return value_;
  }
  last_us_ = time_us;
  const double keep = exact::exp(-std::min(elapsed_s / time_s_, 700.0));
  value_ = keep * value_ + sigma_ * std::sqrt(1.0 - keep * keep) * random_.normal();
  return value_;
}

Sounder::Sounder(const Terrain& ground, const Trajectory& trajectory, const Mission& mission,
                 std::size_t number)
    : trajectory_(trajectory),
      mission_(mission),
      head_(mission.heads[number]),
      echo_(ground, echo_spec(mission, mission.heads[number])),
      range_(mission.seed, head_stream(number, 0)),
      outlier_(mission.seed, head_stream(number, 1)),
      dropout_(mission.seed, head_stream(number, 2)),
      noise_(mission.seed, head_stream(number, 3)),
      fish_(mission.seed, kFishStreams + static_cast<std::uint64_t>(number)),
      misalignment_rad_(misalignment_rad(mission, number)) {}

Heard Sounder::ping(std::int64_t time_us, double azimuth_deg, TouchedMask* touched) {
  // In the head's own frame: where the beam looks, and its long side.
  Vec3 axis{0.0, 0.0, 1.0};
  Vec3 long_side{1.0, 0.0, 0.0};
  if (head_.kind == HeadKind::kPing360) {
    axis = vehicle_direction({azimuth_deg, 0.0});
    long_side = {0.0, 0.0, 1.0};
  }
  // A small turn by the misalignment; the vehicle does not know of it.
  axis = normalized(axis + cross(misalignment_rad_, axis));
  const auto in_world = [this](const TruePose& pose, Vec3 v) {
    return world_from_vehicle(pose.attitude, world_from_vehicle(head_.boresight, v));
  };
  // Sound leaves at one place and is heard at another: the middle of the two stands for both.
  const TruePose sent = trajectory_.at(time_us);
  const double guess_m = last_.range_m.value_or(mission_.motion.altitude_m);
  const auto way_us = static_cast<std::int64_t>(guess_m / mission_.sound_speed_m_s * 1e6);
  const TruePose pose = trajectory_.at(time_us + way_us);
  const Vec3 place = pose.position_m + world_from_vehicle(pose.attitude, head_.lever_arm_m);
  const std::optional<double> true_range_m =
      echo_.measure(place, in_world(sent, axis), touched, in_world(sent, long_side));

  // Every error is drawn every time: one can be switched off without changing the others.
  const double error_m = mission_.errors.sigma_range_m * range_.normal();
  const bool outlier = outlier_.uniform() < mission_.errors.outlier_fraction;
  const double outlier_share = outlier_.uniform();
  const bool dropout = dropout_.uniform() < mission_.errors.dropout_fraction;
  const bool fish = fish_.uniform() < mission_.errors.fish_fraction;
  const double fish_way = fish_.uniform();
  const double fish_share = fish_.uniform(0.1, 1.0);
  hit_ = true_range_m.has_value();
  last_ = Heard{};
  if (!hit_) {
    return last_;
  }
  if (dropout) {
    last_.dropout = true;
  } else if (outlier) {
    last_.outlier = true;
    last_.range_m = outlier_share * *true_range_m;
  } else {
    last_.range_m = std::max(0.0, *true_range_m + error_m);
    if (fish) {
      constexpr double kReported = 0.5;
      last_.fish_m = fish_way * *true_range_m;
      last_.fish_share = fish_share;
      last_.range_m = fish_share >= kReported ? last_.fish_m : last_.range_m;
    }
  }
  return last_;
}

void Sounder::profile(double start_m, double length_m, std::vector<std::uint8_t>* samples) {
  std::vector<double> energy(samples->size(), 0.0);
  const double bins_per_m = static_cast<double>(samples->size()) / length_m;
  const auto add = [&](double range_m, double weight) {
    const double bin = std::floor((range_m - start_m) * bins_per_m);
    if (bin >= 0.0 && bin < static_cast<double>(energy.size())) {
      energy[static_cast<std::size_t>(bin)] += weight;
    }
  };
  if (last_.outlier) {
    add(*last_.range_m, 1.0);
  } else if (hit_ && !last_.dropout) {
    for (const EchoModel::Arrival& arrival : echo_.arrivals()) {
      add((arrival.bin + 0.5) * echo_.spec().range_bin_m, arrival.weight);
    }
    if (last_.fish_m) {
      add(*last_.fish_m, last_.fish_share * std::accumulate(energy.begin(), energy.end(), 0.0));
    }
  }
  const double strongest = *std::max_element(energy.begin(), energy.end());
  const double scale = strongest > 0.0 ? kProfilePeak / strongest : 0.0;
  for (std::size_t k = 0; k < samples->size(); ++k) {
    // Noise has an exponential distribution of energy.
    const double noise = -kProfileNoise * exact::log(1.0 - noise_.uniform());
    (*samples)[k] = static_cast<std::uint8_t>(std::min(255.0, scale * energy[k] + noise));
  }
}

NavigationSensors::NavigationSensors(const Trajectory& trajectory, const Mission& mission)
    : trajectory_(trajectory),
      spec_(mission.navigation),
      attitude_(mission.seed, kAttitudeStream),
      fix_(mission.seed, kFixStream),
      pressure_(mission.seed, kPressureStream),
      heading_(spec_.heading_drift_deg, spec_.drift_time_s, mission.seed, kHeadingDriftStream),
      north_(spec_.fix_drift_m, spec_.drift_time_s, mission.seed, kNorthDriftStream),
      east_(spec_.fix_drift_m, spec_.drift_time_s, mission.seed, kEastDriftStream) {
  // WGS 84: radii of curvature at the origin.
  constexpr double kSemiMajor_m = 6378137.0;
  constexpr double kEccentricity2 = 0.00669437999014;
  const exact::SinCos latitude = exact::sin_cos(spec_.latitude_deg * exact::kRadPerDeg);
  const double w2 = 1.0 - kEccentricity2 * latitude.sin * latitude.sin;
  const double prime_vertical_m = kSemiMajor_m / std::sqrt(w2);
  const double meridian_m = prime_vertical_m * (1.0 - kEccentricity2) / w2;
  metres_per_degree_north_ = meridian_m * exact::kRadPerDeg;
  metres_per_degree_east_ = prime_vertical_m * latitude.cos * exact::kRadPerDeg;
}

Attitude NavigationSensors::attitude(std::int64_t time_us) {
  Attitude attitude = trajectory_.at(time_us).attitude;
  attitude.roll_deg += spec_.sigma_attitude_deg * attitude_.normal();
  attitude.pitch_deg += spec_.sigma_attitude_deg * attitude_.normal();
  attitude.heading_deg += spec_.sigma_heading_deg * attitude_.normal() + heading_.at(time_us);
  attitude.heading_deg -= 360.0 * std::floor(attitude.heading_deg / 360.0);
  return attitude;
}

FixReading NavigationSensors::fix(std::int64_t time_us) {
  const Vec3 position = trajectory_.at(time_us).position_m;
  const double north_m = position.x + spec_.sigma_fix_m * fix_.normal() + north_.at(time_us);
  const double east_m = position.y + spec_.sigma_fix_m * fix_.normal() + east_.at(time_us);
  return {spec_.latitude_deg + north_m / metres_per_degree_north_,
          spec_.longitude_deg + east_m / metres_per_degree_east_};
}

double NavigationSensors::pressure_pa(std::int64_t time_us) {
  const double depth_m = trajectory_.at(time_us).position_m.z;
  return kSurfacePressure_pa + kWaterDensity_kg_m3 * kGravity_m_s2 * depth_m +
         spec_.sigma_pressure_pa * pressure_.normal();
}

}  // namespace leadline::host
