#include "firmware/m7/measure.hpp"

#include <cstring>

namespace leadline::firmware::m7 {

[[gnu::section(".bss.leadline.vehicle")]] model::Model the_model;
[[gnu::section(".bss.leadline.tools")]] LinkMap link_map;
CostHeader header;
model::ModelConfig config;
hal::m7::InstructionCounter counter;

namespace {

[[gnu::section(".bss.leadline.tools")]] model::LocalizationTable table;

}  // namespace

void say_error(const char* program, const char* words) {
  hal::m7::say(program);
  hal::m7::say(": error: ");
  hal::m7::say(words);
  hal::m7::say("\n");
}

void begin_measuring(const char* program, hal::m7::HostFile& file) {
  end_after_fault(kInput);
  counter.start();
  const char* const path = command_argument();
  if (path == nullptr) {
    say_error(program, "no file on the command line");
    hal::m7::exit(kUsage);
  }
  if (!file.open(path, hal::m7::OpenMode::kReadBytes) || !take(file, &header) ||
      header.magic != kCostMagic ||
      std::memcmp(header.sizes, kCostSizes, sizeof header.sizes) != 0 || !take(file, &config) ||
      !take(file, &table)) {
    say_error(program, "the file cannot be read, or is of another version");
    hal::m7::exit(kInput);
  }
  const base::Status status = the_model.configure(config, &table, sizeof table);
  if (status != base::Status::kOk) {
    say_error(program, "the model refuses this configuration");
    say_error(program, base::status_text(status));
    hal::m7::exit(kInput);
  }
}

std::uint32_t compare_tile(model::TileId tile) {
  static TileCells cells;
  link_map.present(the_model, tile, cells);
  (void)link_map.owed(tile, cells).count();
  return static_cast<std::uint32_t>(cells.size());
}

}  // namespace leadline::firmware::m7
