#include "host_tools/topside/live_output.hpp"

#include <utility>

#include "host_tools/exit_codes.hpp"
#include "host_tools/export/map_source.hpp"
#include "host_tools/map_output.hpp"
#include "host_tools/output_dir.hpp"

namespace leadline::host {
namespace {

/// Why it could not be written; "": it is.
std::string problem_of_writing(const std::string& directory, const TileStore& store,
                               const std::string& summary) {
  try {
    OutputDir output(directory);
    stage_map(&output, store.elevation(), store.sigma(), hello_reference(store.hello()));
    output.write("receive.json", summary);
    output.commit();
  } catch (const HostError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

LiveOutput::LiveOutput(std::string directory, std::function<void(const std::string&)> say)
    : directory_(std::move(directory)), say_(std::move(say)) {
  if (!directory_.empty()) {
    const OutputDir probe(directory_);
  }
}

void LiveOutput::write(const TileStore& store, const std::string& summary) {
  if (directory_.empty()) {
    return;
  }
  const std::string before =
      std::exchange(problem_, problem_of_writing(directory_, store, summary));
  if (!problem_.empty() && before.empty()) {
    say_("error: the map is not written: " + problem_);
  } else if (problem_.empty() && !before.empty()) {
    say_("the map is written again");
  }
}

void LiveOutput::write_ended(const TileStore& ended, const std::string& summary) {
  if (directory_.empty() || ended.known_cells() == 0) {
    return;
  }
  const proto::Hello& hello = ended.hello();
  const std::string problem =
      problem_of_writing(directory_ + "/survey-" + std::to_string(hello.survey_id) + "-session-" +
                             std::to_string(hello.session),
                         ended, summary);
  if (!problem.empty()) {
    say_("error: the map that ended is not written: " + problem);
    lost_ = "a map that ended is not written: " + problem;
  }
}

void LiveOutput::require_whole() const {
  if (!problem_.empty() || !lost_.empty()) {
    throw HostError(ExitCode::kOutput, problem_.empty() ? lost_ : problem_);
  }
}

}  // namespace leadline::host
