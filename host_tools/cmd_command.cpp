#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/topside/command_command.hpp"

namespace leadline::host {
namespace {

using proto::CommandKind;

/// What the subcommands write into before it becomes a command.
struct Order {
  CommandOptions options;
  std::string name;
  std::string setting;
  std::vector<double> at_m;
  bool here = false;
  std::uint32_t first_tile = 0;
  std::uint32_t tile_count = 1;
  std::string plane = "horizontal";
  std::uint32_t rows = 32;
  std::uint32_t columns = 32;
};

[[noreturn]] void refuse(const std::string& why) {
  throw HostError(ExitCode::kUsage, "command: " + why);
}

void fill_name(Order* order) {
  proto::HelloText& name = order->options.command.name;
  if (order->name.size() > proto::kMaxHelloText_bytes ||
      !proto::clean_text(order->name.data(), order->name.size())) {
    refuse("--name has to be UTF-8 of at most " + std::to_string(proto::kMaxHelloText_bytes) +
           " bytes");
  }
  name.size_bytes = static_cast<std::uint8_t>(order->name.size());
  std::copy(order->name.begin(), order->name.end(), name.text);
}

void fill_origin(Order* order) {
  proto::Command& command = order->options.command;
  if (order->here == !order->at_m.empty()) {
    refuse("origin: either --here or --at N E D");
  }
  command.centred = order->here ? 1 : 0;
  constexpr double kFarthest_m = 1e9;
  for (std::size_t axis = 0; axis < order->at_m.size(); ++axis) {
    if (!(std::abs(order->at_m[axis]) <= kFarthest_m)) {
      refuse("origin --at: has to be within 1e9 m");
    }
    command.origin_mm[axis] = std::llround(1000.0 * order->at_m[axis]);
  }
}

void fill_slice(Order* order) {
  proto::SliceBox& box = order->options.command.slice;
  box.plane = order->plane == "north"  ? proto::SlicePlane::kNorth
              : order->plane == "east" ? proto::SlicePlane::kEast
                                       : proto::SlicePlane::kHorizontal;
  box.rows = static_cast<std::uint8_t>(order->rows);
  box.columns = static_cast<std::uint8_t>(order->columns);
  if (!order->at_m.empty()) {
    order->options.slice_at_m = {order->at_m[0], order->at_m[1], order->at_m[2]};
  }
}

void fill_tiles(Order* order) {
  constexpr std::uint32_t kMost = 1U << 24U;
  if (order->first_tile >= kMost || order->tile_count == 0 ||
      order->tile_count > kMost - order->first_tile) {
    refuse("tiles: there are none of that number");
  }
  order->options.command.tiles = {order->first_tile, order->tile_count};
}

}  // namespace

void add_command_command(CLI::App* app, CommandRun* run) {
  const auto order = std::make_shared<Order>();
  CLI::App* const command = app->add_subcommand(
      "command", "Tell a vehicle what to do, with its key, and wait for its answer");
  command->require_subcommand(1);
  command->fallthrough();
  command
      ->add_option(
          "--link", order->options.link_uri,
          "udp:@:PORT, udp:HOST:PORT, tcp:HOST:PORT, serial:PATH:BAUD; unix:SOCKET: that of a "
          "receive or\nmonitor with --share SOCKET")
      ->type_name("URI")
      ->required();
  command
      ->add_option("--key", order->options.key_path,
                   "The key (leadline key new); FILE.sent counts beside it")
      ->type_name("FILE")
      ->required();
  command->add_option("--timeout", order->options.timeout_s, "Give up after S seconds")
      ->type_name("S")
      ->check(CLI::Range(0.1, 86400.0))
      ->capture_default_str();
  command->add_flag("--json", order->options.json, "Print the outcome as a JSON object");
  const auto add = [command, order, run](const char* name, CommandKind kind, const char* help,
                                         void (*fill)(Order*)) {
    CLI::App* const sub = command->add_subcommand(name, help);
    sub->callback([order, run, name, kind, fill] {
      order->options.name = name;
      order->options.command.kind = kind;
      *run = [order, fill] {
        if (fill != nullptr) {
          fill(order.get());
        }
        return run_command(order->options);
      };
    });
    return sub;
  };
  add("start", CommandKind::kStart, "Map (again); with --name: a new survey, in an empty map",
      fill_name)
      ->add_option("--name", order->name, "Name of the new survey")
      ->type_name("TEXT");
  add("stop", CommandKind::kStop, "Map nothing until start", nullptr);
  add("save", CommandKind::kSave, "Bring what changed to the vehicle's store without delay",
      nullptr);
  CLI::App* const set =
      add("set", CommandKind::kSet, "Change a parameter in flight",
          [](Order* each) { read_setting(each->setting, &each->options.command); });
  set->add_option("setting", order->setting, "NAME=VALUE")->type_name("NAME=VALUE")->required();
  set->footer(settings_help());
  CLI::App* const origin = add("origin", CommandKind::kOrigin,
                               "The grid lies elsewhere from now on, and is empty", fill_origin);
  origin->add_flag("--here", order->here, "Its middle is where the vehicle is");
  origin->add_option("--at", order->at_m, "NED of its lowest corner, m")
      ->type_name("N E D")
      ->expected(3);
  CLI::App* const tiles = add("tiles", CommandKind::kTiles, "Have tiles sent whole", fill_tiles);
  tiles->add_option("first", order->first_tile, "Number of the first")
      ->type_name("TILE")
      ->required();
  tiles->add_option("count", order->tile_count, "How many")
      ->type_name("COUNT")
      ->capture_default_str();
  CLI::App* const slice =
      add("slice", CommandKind::kSlice, "See the voxels of a plane around a place", fill_slice);
  slice->add_option("plane", order->plane, "horizontal, north or east: along these axes")
      ->check(CLI::IsMember({"horizontal", "north", "east"}))
      ->required();
  slice->add_option("--at", order->at_m, "NED of its middle, m (default: the vehicle)")
      ->type_name("N E D")
      ->expected(3);
  slice->add_option("--rows", order->rows, "Cells")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  slice->add_option("--columns", order->columns, "Cells")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->footer(
      "The command is sent again until it is answered; the vehicle does it once. One program at a "
      "time has a link:\n"
      "while receive or monitor run, commands go through theirs (--share SOCKET there, --link "
      "unix:SOCKET here);\n"
      "the key stays here. Exit status: 0 done, 6 refused by the vehicle, 7 no answer, else as "
      "always.\n\n"
      "Examples:\n"
      "  leadline command --link udp:@:9100 --key command.key stop\n"
      "  leadline command --link udp:@:9100 --key command.key set link_rate_bytes_s=960\n"
      "  leadline command --link unix:$XDG_RUNTIME_DIR/leadline.sock --key command.key slice "
      "north");
}

}  // namespace leadline::host
