// `leadline`: command line, exit codes, and nothing else.
#include "firmware/config/program.hpp"
#include "host_tools/command_line.hpp"

int main(int argc, char** argv) {
  leadline::host::ignore_write_signals();
  return leadline::host::run_command_line(argc, argv);
}
