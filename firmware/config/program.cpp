#include "firmware/config/program.hpp"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <iostream>
#include <new>

namespace leadline::host {

void print_error(const char* program, const std::string& message) {
  std::string::size_type begin = 0;
  while (begin <= message.size()) {
    const auto end = std::min(message.find('\n', begin), message.size());
    std::cerr << program << ": error: " << message.substr(begin, end - begin) << "\n";
    begin = end + 1;
  }
}

int run_guarded(const char* program, const std::function<int()>& work) {
  try {
    return work();
  } catch (const HostError& error) {
    print_error(program, error.what());
    return static_cast<int>(error.code());
  } catch (const std::bad_alloc&) {
    print_error(program, "out of memory");
  } catch (const std::exception& error) {
    print_error(program, std::string("internal: ") + error.what());
  }
  return static_cast<int>(ExitCode::kInternal);
}

int checked_output(const char* program, int status) {
  std::cout.flush();
  const bool written = std::cout.good() && std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
  if (written || status != static_cast<int>(ExitCode::kOk)) {
    return status;
  }
  print_error(program, "cannot write standard output");
  return static_cast<int>(ExitCode::kOutput);
}

void ignore_write_signals() {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

}  // namespace leadline::host
