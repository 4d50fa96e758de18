// What a `leadline` command and `leadline-vehicle` end with, and the one error type that carries it.
// Scripts rely on the numbers: they are part of the contract and never change meaning.
#pragma once

#include <stdexcept>
#include <string>

namespace leadline::host {

/// Exit status of every program.
enum class ExitCode : int {
  kOk = 0,                ///< Done; rows that were rejected are counted, not an error.
  kInternal = 1,          ///< A defect of the program itself (an exception that nobody expected).
  kUsage = 2,             ///< Command line or configuration.
  kInput = 3,             ///< Input data: unreadable, malformed, nothing usable in it.
  kOutput = 4,            ///< A result cannot be written: no permission, disk full.
  kComparisonFailed = 5,  ///< `compare` with limits: a limit was exceeded.
  kRefused = 6,           ///< `command`: the vehicle answered that it does not do it.
  kNoAnswer = 7,          ///< `command`: no answer came in time.
};

/// Ends a command: `main` prints what() to stderr after "<program>: error: " and exits with code().
/// The message is one or more complete lines without a trailing newline, names the file (and the
/// line, column and value where there is one), and says what to do where that is not obvious.
class HostError : public std::runtime_error {
 public:
  HostError(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

}  // namespace leadline::host
