#include "firmware/pipeline/vehicle.hpp"

namespace leadline::firmware {

const char* ping_loss_name(PingLoss loss) {
  switch (loss) {
    case PingLoss::kShed:
      return "shed";
    case PingLoss::kNoPoseBefore:
      return "no_pose_before";
    case PingLoss::kPoseGap:
      return "pose_gap";
    case PingLoss::kPoseEpoch:
      return "pose_epoch";
    case PingLoss::kPoseLate:
      return "pose_late";
    case PingLoss::kPoseInvalid:
      return "pose_invalid";
    case PingLoss::kTooLong:
      return "too_long";
    case PingLoss::kNoEcho:
      return "no_echo";
    case PingLoss::kCount:
      break;
  }
  return "unknown";
}

}  // namespace leadline::firmware
