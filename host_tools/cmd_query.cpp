#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/model_file.hpp"
#include "host_tools/query.hpp"

namespace leadline::host {

int run_query(const QueryOptions& options) {
  const PointMm from_mm = parse_point("--from", options.from);
  const PointMm to_mm = parse_point("--to", options.to);
  const SavedModel saved = load_model_file(options.map_path);
  const VoxelStates voxels = voxel_states(saved);
  std::cout << (options.box
                    ? format_box_answer(query_box(voxels, from_mm, to_mm), options.json)
                    : format_segment_answer(query_segment(voxels, from_mm, to_mm), options.json));
  return static_cast<int>(ExitCode::kOk);
}

void add_query_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<QueryOptions>();
  CLI::App* const command = app->add_subcommand(
      "query", "Ask a saved map: free, occupied or unknown, on a line or in a box");
  command
      ->add_option("map", options->map_path, "Folder that `leadline map` wrote, or its model.llm")
      ->type_name("PATH")
      ->required();
  command->add_option("--from", options->from, "Start of the line, or a corner, metres")
      ->type_name("NORTH,EAST,DOWN")
      ->required();
  command->add_option("--to", options->to, "End of the line, or the opposite corner, metres")
      ->type_name("NORTH,EAST,DOWN")
      ->required();
  command->add_flag("--box", options->box, "--from and --to are corners of a box");
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(
      "The first word of the answer is the verdict: occupied when any voxel is, else unknown when "
      "any\n"
      "is, else free. Unknown is what no ping said anything about, everything outside the grid\n"
      "included; it is never taken for free. Along a line the stretches follow, with their "
      "distances\n"
      "from --from.\n\n"
      "Examples:\n"
      "  leadline query map --from 10,20,58 --to 40,20,58\n"
      "  leadline query map --box --from 10,20,58 --to 12,22,60 --json");
  command->callback([options, run] { *run = [options] { return run_query(*options); }; });
}

}  // namespace leadline::host
