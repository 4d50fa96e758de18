// Outcomes of vehicle code. No exceptions on the vehicle: a call returns a Status (or a Result that
// carries a value), and whatever the environment does wrong moves a counter as well.
#pragma once

#include <cstdint>

namespace leadline::base {

/// What a call came to. Values are stable: they appear in logs and over the link.
enum class Status : std::uint8_t {
  kOk = 0,
  kInvalidArgument = 1,  ///< The caller broke the contract in the header.
  kOutOfRange = 2,       ///< A value is outside its stated range.
  kOverCapacity = 3,     ///< Compile-time storage is too small for the configuration.
  kOverBudget = 4,       ///< The closed-form work bound exceeds the configured budget.
  kBadVersion = 5,       ///< A block of another major version.
  kBadChecksum = 6,      ///< A block whose CRC does not match its bytes.
  kTruncated = 7,        ///< A block shorter than its header says.
  kNotReady = 8,         ///< Something must be configured first.
  kStale = 9,            ///< Older than what was already accepted (time went backwards).
  kEpochMismatch = 10,   ///< Navigation jumped between the two records.
  kFull = 11,            ///< A fixed container has no room.
  kEmpty = 12,           ///< Nothing to take.
};

/// Short English text for logs; never null.
[[nodiscard]] const char* status_text(Status status);

/// A value or the reason why there is none. `T` is a trivially copyable record.
template <typename T>
class [[nodiscard]] Result {
 public:
  // Implicit on purpose: `return value;` and `return Status::kFull;` both read naturally.
  Result(const T& value) : value_(value), status_(Status::kOk) {}  // NOLINT
  Result(Status status) : value_(), status_(status) {}             // NOLINT

  [[nodiscard]] bool ok() const { return status_ == Status::kOk; }
  [[nodiscard]] Status status() const { return status_; }
  /// The value; a default-constructed one when !ok(), so a missed check reads zeros, not garbage.
  [[nodiscard]] const T& value() const { return value_; }

 private:
  T value_;
  Status status_;
};

}  // namespace leadline::base
