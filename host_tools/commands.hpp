// The subcommands of `leadline`: each adds its options and its help to the command line. The work is
// behind functions of their own (run_map, run_grid, ...), which tests call without a command line.
#pragma once

#include <functional>
#include <string>

namespace CLI {
class App;
}  // namespace CLI

namespace leadline::host {

/// What the chosen subcommand will do: returns the exit status, may throw HostError.
using CommandRun = std::function<int()>;

struct MissionOptions;

/// Options that `emulate` and `simulate` share, and the list of settings for their help.
void add_mission_options(CLI::App* command, MissionOptions* mission);
[[nodiscard]] std::string mission_settings_help();

/// Options that `receive` and `monitor` share: a store of surveys, a socket that lends the link.
void add_link_use_options(CLI::App* command, std::string* store_path, std::string* share_path);

/// Each adds one subcommand to `app`; when it is the one that was given, parsing sets `*run`. `run`
/// must outlive the parsing.
void add_map_command(CLI::App* app, CommandRun* run);
void add_grid_command(CLI::App* app, CommandRun* run);
void add_query_command(CLI::App* app, CommandRun* run);
void add_compare_command(CLI::App* app, CommandRun* run);
void add_table_command(CLI::App* app, CommandRun* run);
void add_render_command(CLI::App* app, CommandRun* run);
void add_simulate_command(CLI::App* app, CommandRun* run);
void add_scene_command(CLI::App* app, CommandRun* run);
void add_emulate_command(CLI::App* app, CommandRun* run);
void add_receive_command(CLI::App* app, CommandRun* run);
void add_monitor_command(CLI::App* app, CommandRun* run);
void add_replay_command(CLI::App* app, CommandRun* run);
void add_export_command(CLI::App* app, CommandRun* run);
void add_decode_command(CLI::App* app, CommandRun* run);
void add_probe_command(CLI::App* app, CommandRun* run);
void add_import_command(CLI::App* app, CommandRun* run);
void add_survey_command(CLI::App* app, CommandRun* run);
void add_crosslines_command(CLI::App* app, CommandRun* run);
void add_calibrate_command(CLI::App* app, CommandRun* run);
void add_store_command(CLI::App* app, CommandRun* run);
void add_config_command(CLI::App* app, CommandRun* run);
void add_link_sim_command(CLI::App* app, CommandRun* run);
void add_key_command(CLI::App* app, CommandRun* run);
void add_command_command(CLI::App* app, CommandRun* run);

}  // namespace leadline::host
