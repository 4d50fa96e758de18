// Older schemas of vehicle.toml lifted line by line; blocks compiled and read back.
#include <string>
#include <vector>

#include "firmware/config/block_file.hpp"
#include "firmware/config/exit_codes.hpp"
#include "firmware/config/migrate.hpp"
#include "firmware/config/vehicle_file.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::migrate_toml;
using leadline::host::Migrated;
using leadline::host::parse_vehicle_file;
using leadline::host::SchemaEdit;
using leadline::host::SchemaStep;
using leadline::host::vehicle_schema_steps;

constexpr auto kRename = SchemaEdit::Kind::kRename;
constexpr auto kKeepDefault = SchemaEdit::Kind::kKeepDefault;

// Three versions that never were: what the machinery can do.
const std::vector<SchemaStep> kSteps = {
    {1, {{kRename, "link", "speed", "rate_bytes_s"}, {kRename, "port", "gain", "gain_step"}}},
    {2, {{kKeepDefault, "link", "mtu", "400"}, {kKeepDefault, "log", "max", "0"}}},
    {3, {{kRename, "link", "rate_bytes_s", "rate"}}},
};

Migrated lifted(const std::string& text, std::int64_t unsaid = 1) {
  return migrate_toml(text, "old.toml", unsaid, kSteps);
}

std::string error_of(const std::string& text, std::int64_t unsaid = 1) {
  try {
    (void)lifted(text, unsaid);
  } catch (const HostError& error) {
    assert_true(error.code() == ExitCode::kUsage);
    return error.what();
  }
  fail_msg("accepted: %s", text.c_str());
  return "";
}

TEST(steps_apply_in_order_and_all_else_stays) {
  const std::string old =
      "# my vehicle\n"
      "schema_version = 1   # as it came\n"
      "\n"
      "[link] # speed = not this one\n"
      "  speed=  4000 # speed of the modem\n"
      "note = \"\"\"\n"
      "speed = 3\n"
      "[port]\n"
      "\"\"\"\n"
      "[[port]]\n"
      "gain = 1\n"
      "list = [\n"
      "  1, # gain = 2\n"
      "]\n"
      "[[port]]\n"
      "\"gain\" = 2\n"
      "[other]\n"
      "gain = 7\n"
      "speed = 8";
  const Migrated now = lifted(old);
  assert_int_equal(now.from, 1);
  assert_string_equal(now.text.c_str(),
                      "# my vehicle\n"
                      "schema_version = 4   # as it came\n"
                      "\n"
                      "[link] # speed = not this one\n"
                      "mtu = 400\n"
                      "  rate=  4000 # speed of the modem\n"
                      "note = \"\"\"\n"
                      "speed = 3\n"
                      "[port]\n"
                      "\"\"\"\n"
                      "[[port]]\n"
                      "gain_step = 1\n"
                      "list = [\n"
                      "  1, # gain = 2\n"
                      "]\n"
                      "[[port]]\n"
                      "\"gain_step\" = 2\n"
                      "[other]\n"
                      "gain = 7\n"
                      "speed = 8\n"
                      "\n"
                      "[log]\n"
                      "max = 0");
  assert_int_equal(now.changes.size(), 7);
  // Once more changes nothing, and says so.
  const Migrated again = lifted(now.text);
  assert_int_equal(again.from, 4);
  assert_true(again.text == now.text);
  assert_true(again.changes.empty());
}

TEST(a_file_that_says_no_version_says_one_then) {
  const Migrated now = lifted("# head\n\n[link]\nrate_bytes_s = 1\nmtu = 2\n[log]\nmax = 1\n", 2);
  assert_int_equal(now.from, 2);
  assert_int_equal(now.changes.size(), 2);
  assert_true(now.changes[0].find("3: schema_version = 4") == 0);
  assert_true(now.changes[1].find("6: ") == 0);  // of the lifted file
  assert_string_equal(
      now.text.c_str(),
      "# head\n\nschema_version = 4\n\n[link]\nrate = 1\nmtu = 2\n[log]\nmax = 1\n");
  // Windows' line ends stay.
  const Migrated dos = lifted("schema_version = 3\r\n[link]\r\nrate_bytes_s = 1\r\n");
  assert_string_equal(dos.text.c_str(), "schema_version = 4\r\n[link]\r\nrate = 1\r\n");
}

TEST(what_cannot_be_lifted_says_where) {
  assert_true(error_of("[link]\nspeed = 1\nrate_bytes_s = 2\n").find("old.toml:2: ") == 0);
  assert_true(error_of("schema_version = 9\n").find("9") != std::string::npos);
  assert_true(error_of("schema_version = 0\n").find("1 to 4") != std::string::npos);
  assert_true(error_of("a = 1\nschema_version = \"2\"\n").find("old.toml:2: ") == 0);
  assert_true(error_of("", 77).find("77") != std::string::npos);
}

TEST(a_vehicle_file_from_before_the_default_budget_flies_as_it_did) {
  const std::string old = leadline::host::vehicle_example();
  const auto steps = vehicle_schema_steps();
  assert_int_equal(steps.back().version + 1, leadline::host::kVehicleSchemaVersion);
  const Migrated now = migrate_toml(old, "old.toml", 0, steps);
  assert_int_equal(now.changes.size(), 2);
  const auto file = parse_vehicle_file(now.text, "new.toml", "");
  assert_true(file.voxel_budget_given);
  assert_int_equal(file.config.cycle_voxel_budget, 0);
  // Nothing else differs, and no comment is gone.
  auto before = parse_vehicle_file(old, "old.toml", "");
  before.voxel_budget_given = true;
  before.config.cycle_voxel_budget = 0;
  assert_string_equal(vehicle_file_to_toml(file).c_str(), vehicle_file_to_toml(before).c_str());
  std::size_t at = 0;
  for (std::size_t begin = 0; begin < old.size();) {
    const std::size_t end = old.find('\n', begin);
    at = now.text.find(old.substr(begin, end - begin + 1), at);
    assert_true(at != std::string::npos);
    begin = end + 1;
  }
  // A newer one is left as it is.
  assert_true(migrate_toml(now.text, "new.toml", 0, steps).text == now.text);
}

TEST(blocks_hold_what_the_file_says) {
  auto file = parse_vehicle_file(leadline::host::vehicle_example(), "vehicle.toml", "");
  const std::vector<leadline::model::LocalizationTable> tables = {leadline::test::plain_table({})};
  const std::string bytes = leadline::host::compile_block(file, tables, 42, "vehicle.toml");
  assert_true(leadline::host::is_block(bytes));
  const auto read = leadline::host::parse_block(bytes, "vehicle.llb");
  assert_int_equal(read.block.config.session, 42);
  assert_int_equal(read.block.config.port_count, file.config.port_count);
  assert_int_equal(read.block.cycle_us, file.cycle_us);
  assert_int_equal(read.block.port_baud[0], 115'200);
  assert_int_equal(read.block.port_baud[1], 0);
  assert_int_equal(read.block.port_baud[2], 38'400);
  assert_int_equal(read.block.link_baud, 0);
  assert_int_equal(read.block.table_count, 1);
  const std::string text = leadline::host::block_to_text(read);
  for (const char* const part :
       {"[survey]", "session = 42", "driver = \"ping360\"", "baud = 38400", "cell_mm = 250"}) {
    assert_true(text.find(part) != std::string::npos);
  }
  assert_true(leadline::host::block_to_json(read).find("\"session\": 42") != std::string::npos);
  // Any byte that changes is told.
  for (std::size_t at = 0; at < bytes.size(); at += 131) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x20);
    bool refused = false;
    try {
      (void)leadline::host::parse_block(damaged, "vehicle.llb");
    } catch (const HostError& error) {
      refused = error.code() == ExitCode::kInput;
    }
    assert_true(refused);
  }
  file.tide_path = "tide.csv";
  try {
    (void)leadline::host::compile_block(file, tables, 1, "vehicle.toml");
    fail_msg("a tide that nobody can read there");
  } catch (const HostError& error) {
    assert_true(error.code() == ExitCode::kUsage);
  }
}

}  // namespace
