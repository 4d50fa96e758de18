#include "model/base/status.hpp"

namespace leadline::base {

const char* status_text(Status status) {
  switch (status) {
    case Status::kOk:
      return "ok";
    case Status::kInvalidArgument:
      return "invalid argument";
    case Status::kOutOfRange:
      return "value out of range";
    case Status::kOverCapacity:
      return "over the compiled capacity";
    case Status::kOverBudget:
      return "work bound over the budget";
    case Status::kBadVersion:
      return "unknown version";
    case Status::kBadChecksum:
      return "checksum does not match";
    case Status::kTruncated:
      return "truncated";
    case Status::kNotReady:
      return "not configured";
    case Status::kStale:
      return "older than what was accepted";
    case Status::kEpochMismatch:
      return "navigation epoch changed";
    case Status::kFull:
      return "full";
    case Status::kEmpty:
      return "empty";
  }
  return "unknown status";
}

}  // namespace leadline::base
