// Errors of the topside: which one an action raises, and what it says.
#pragma once

#include <string>

#include "host_tools/exit_codes.hpp"
#include "tests/support/test.hpp"

namespace leadline::test {

/// The message of the HostError that `action` has to raise with this code.
template <typename Action>
std::string error_of(host::ExitCode code, const Action& action) {
  std::string message = "(no error)";
  host::ExitCode found = host::ExitCode::kOk;
  try {
    action();
  } catch (const host::HostError& error) {
    message = error.what();
    found = error.code();
  }
  if (found != code) {
    print_message("%s\n", message.c_str());
  }
  assert_int_equal(found, code);
  return message;
}

inline void assert_contains(const std::string& text, const std::string& part) {
  if (text.find(part) == std::string::npos) {
    fail_msg("\"%s\" is not in \"%s\"", part.c_str(), text.c_str());
  }
}

}  // namespace leadline::test
