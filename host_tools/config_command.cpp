#include "host_tools/config_command.hpp"

#include <filesystem>
#include <iostream>

#include "firmware/config/block_file.hpp"
#include "firmware/config/input_file.hpp"
#include "firmware/config/m7_load.hpp"
#include "firmware/config/migrate.hpp"
#include "firmware/config/toml_reader.hpp"
#include "firmware/config/vehicle_file.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/topside/host_vehicle.hpp"

namespace leadline::host {
namespace {

/// Proves that a vehicle takes it: throws what the vehicle refuses.
void try_vehicle(const firmware::VehicleConfig& config, const firmware::TableBlock* tables,
                 std::size_t table_count, const std::string& name) {
  std::vector<std::vector<std::uint8_t>> bytes;
  for (std::size_t i = 0; i < table_count; ++i) {
    const auto* const begin = static_cast<const std::uint8_t*>(tables[i].bytes);
    bytes.emplace_back(begin, begin + tables[i].size_bytes);
  }
  const HostVehicle vehicle(config, bytes, name);
}

/// The newest schema and version, whatever those of `bytes` are that this program reads.
std::string migrated_block(const std::string& bytes, const std::string& name) {
  BlockFile file = parse_block(bytes, name);
  file.block.config.schema_version = firmware::kVehicleConfigSchemaVersion;
  try_vehicle(file.block.config, file.block.tables, file.block.table_count, name);
  std::string out(firmware::config_block_bytes(file.block), '\0');
  const auto size = firmware::encode_config_block(
      file.block, reinterpret_cast<std::uint8_t*>(out.data()), out.size());
  if (!size.ok()) {
    throw HostError(ExitCode::kInput,
                    name + ": cannot be written anew: " + base::status_text(size.status()));
  }
  return out;
}

}  // namespace

int run_config_compile(const ConfigOptions& options) {
  VehicleFile file = load_vehicle_file(options.path);
  const std::vector<model::LocalizationTable> tables = load_tables(&file);
  const std::vector<std::string> chosen = set_m7_defaults(&file);
  const std::string block = compile_block(file, tables, options.session, options.path);
  const BlockFile made = parse_block(block, options.path);
  try_vehicle(made.block.config, made.block.tables, made.block.table_count, options.path);
  write_file_whole(options.out_path, block);
  for (const std::string& key : chosen) {
    std::cerr << options.path << ": [cycle] " << key
              << ", since the file does not say (a program on Linux has another default)\n";
  }
  const M7Load load = m7_load(file.config, file.cycle_us, tables, options.beams);
  std::cerr << options.path << ": " << m7_load_text(load) << "\n";
  const std::string pass = m7_pass_text(file.config, file.cycle_us);
  if (!pass.empty()) {
    std::cerr << options.path << ": " << pass << "\n";
  }
  const std::string warning =
      m7_load_warning(file.config, file.cycle_us, tables, options.beams, load);
  if (!warning.empty()) {
    std::cerr << options.path << ": warning: " << warning << "\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

int run_config_show(const ConfigOptions& options) {
  const BlockFile file = parse_block(read_input(options.path), options.path);
  std::cout << (options.json ? block_to_json(file) : block_to_text(file));
  return static_cast<int>(ExitCode::kOk);
}

int run_config_migrate(const ConfigOptions& options) {
  const std::string bytes = read_input(options.path);
  if (is_block(bytes)) {
    const std::string out = migrated_block(bytes, options.path);
    write_file_whole(options.out_path, out);
    std::cerr << options.path << ": " << (out == bytes ? "is of the newest schema" : "lifted")
              << "\n";
    return static_cast<int>(ExitCode::kOk);
  }
  const std::int64_t unsaid = options.from < 0 ? kVehicleSchemaVersion : options.from;
  const Migrated migrated = migrate_toml(bytes, options.path, unsaid, vehicle_schema_steps());
  // Keys that nobody knows are told here, not carried along.
  (void)parse_vehicle_file(migrated.text, options.path + ", lifted",
                           std::filesystem::path(options.path).parent_path().string());
  write_file_whole(options.out_path, migrated.text);
  for (const std::string& change : migrated.changes) {
    std::cerr << options.out_path << ":" << change << "\n";
  }
  std::cerr << options.path << ": schema version " << migrated.from << " to "
            << kVehicleSchemaVersion << ", " << migrated.changes.size()
            << (migrated.changes.size() == 1 ? " change\n" : " changes\n");
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
