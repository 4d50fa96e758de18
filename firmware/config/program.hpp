// What the main() of every program does around its work: messages, exit status, standard output.
#pragma once

#include <functional>
#include <string>

#include "firmware/config/exit_codes.hpp"

namespace leadline::host {

/// Prints every line of `message` to stderr as "<program>: error: <line>", so that logs of several
/// programs stay readable.
void print_error(const char* program, const std::string& message);

/// Runs `work`; everything that it throws ends here, printed and as an exit status.
[[nodiscard]] int run_guarded(const char* program, const std::function<int()>& work);

/// Standard output is a result too: what could not be written must not look like success. Returns
/// `status`, or kOutput.
[[nodiscard]] int checked_output(const char* program, int status);

/// A closed pipe and a file that reaches its size limit are errors of a write, reported as such.
void ignore_write_signals();

}  // namespace leadline::host
