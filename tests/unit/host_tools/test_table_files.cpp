// Localization tables as files: descriptions, the header, the command, refusals.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <sstream>
#include <string>

#include <nlohmann/json.hpp>

#include "host_tools/exit_codes.hpp"
#include "host_tools/table/generator.hpp"
#include "host_tools/table/run_table.hpp"
#include "host_tools/table/table_io.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/table_beams.hpp"
#include "tests/support/test.hpp"

namespace {

namespace model = leadline::model;

using leadline::host::beam_description;
using leadline::host::BeamDescription;
using leadline::host::ExitCode;
using leadline::host::generate_table;
using leadline::host::GeneratedTable;
using leadline::host::load_table;
using leadline::host::parse_map_config;
using leadline::host::parse_table;
using leadline::host::run_table;
using leadline::host::save_table;
using leadline::host::table_to_json;
using leadline::host::table_to_text;
using leadline::host::TableOptions;
using leadline::test::assert_contains;
using leadline::test::capped;
using leadline::test::cone;
using leadline::test::error_of;
using leadline::test::kRad;
using leadline::test::measured;
using leadline::test::piston;
using leadline::test::rectangle;
using leadline::test::table_of;
using model::LocalizationTable;

std::string description_error(const BeamDescription& beam) {
  return error_of(ExitCode::kUsage, [&] { (void)generate_table(beam); });
}

/// Standard output of `action`.
std::string output_of(const std::function<void()>& action) {
  std::ostringstream captured;
  std::streambuf* const before = std::cout.rdbuf(captured.rdbuf());
  try {
    action();
  } catch (...) {
    std::cout.rdbuf(before);
    throw;
  }
  std::cout.rdbuf(before);
  return captured.str();
}

void write_text(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

// --- the block
// -----------------------------------------------------------------------------------------

TEST(the_header_carries_the_description) {
  BeamDescription beam = rectangle(300.0, 30.0, 200e3, 1.0);
  beam.sigma_range_mm = 12.345;
  beam.detection_fraction = 0.25;
  const GeneratedTable generated = generate_table(beam);
  const LocalizationTable& table = generated.table;
  assert_int_equal(table.beam_kind, model::BeamKind::kRectangle);
  assert_int_equal(table.two_axis, 1);
  assert_int_equal(table.detection_fraction_q16, 16384);
  assert_int_equal(table.sigma_range_um, 12345);
  assert_near(table.tan_envelope_along_q24 * 0x1.0p-24, std::tan(std::asin(0.05)), 1e-7);
  assert_near(table.tan_envelope_across_q24 * 0x1.0p-24, std::tan(std::asin(0.5)), 1e-7);
  assert_near(table.pointing_variance_q30 * 0x1.0p-30, std::pow(std::tan(kRad), 2), 1e-9);
  assert_near(table.discarded_energy_ppm * 1e-6, generated.facts.discarded_fraction, 1e-6);
  assert_int_equal(table.crc32c, model::table_crc(table));
  // An axisymmetric beam has the same on both axes.
  const LocalizationTable round = generate_table(piston(100.0, 200e3, 0.3)).table;
  assert_int_equal(round.two_axis, 0);
  assert_memory_equal(round.first_return[0], round.first_return[1], sizeof(round.first_return[0]));
  assert_memory_equal(round.profile_q15[0], round.profile_q15[1], sizeof(round.profile_q15[0]));
  assert_memory_equal(round.beam_weight_q15[0], round.beam_weight_q15[1],
                      sizeof(round.beam_weight_q15[0]));
}

TEST(descriptions_outside_their_limits_are_refused) {
  assert_contains(description_error(cone(0.0)), "beam_half_angle_deg = 0");
  assert_contains(description_error(cone(90.1)), "beam_half_angle_deg = 90.1");
  assert_contains(description_error(cone(std::nan(""))), "beam_half_angle_deg");
  assert_contains(description_error(cone(3.0, -1.0)), "sigma_pointing_deg = -1");
  assert_contains(description_error(cone(3.0, 46.0)), "sigma_pointing_deg");
  assert_contains(description_error(capped(cone(3.0), 0.0)), "max_half_angle_deg = 0");
  assert_contains(description_error(piston(0.5, 200e3)), "piston_diameter_mm = 0.5");
  assert_contains(description_error(piston(100.0, 99.0)), "frequency_hz = 99");
  assert_contains(description_error(piston(1e4, 1e8)), "too narrow for a table");
  assert_contains(description_error(rectangle(0.0, 30.0, 200e3)), "aperture_along_mm");
  assert_contains(description_error(rectangle(30.0, 1e5, 200e3)), "aperture_across_mm = 1e+05");
  BeamDescription beam = piston(100.0, 200e3);
  beam.sound_speed_mm_s = 0.0;
  assert_contains(description_error(beam), "sound_speed_mm_s");
  for (const double fraction : {0.0, 1.0, -0.1, std::nan("")}) {
    beam = cone(3.0);
    beam.detection_fraction = fraction;
    assert_contains(description_error(beam), "detection_fraction");
  }
  beam = cone(3.0);
  beam.sigma_range_mm = 1e7;
  assert_contains(description_error(beam), "sigma_range_mm");
  beam = measured();
  beam.rows.resize(1);
  assert_contains(description_error(beam), "rows of the pattern");
  beam = measured();
  beam.rows[2].off_axis_deg = 0.5;
  assert_contains(description_error(beam), "off_axis_deg");
  beam = measured();
  beam.rows[1].two_way_db = 0.5;
  assert_contains(description_error(beam), "two_way_db");
}

TEST(descriptions_come_from_the_configuration) {
  const std::string grid =
      "[grid]\ncell_mm = 1000\nsize = [8, 8, 8]\norigin_mm = [0, 0, 0]\n[sonar]\n";
  const auto of = [&](const std::string& sonar) {
    return beam_description(parse_map_config(grid + sonar, "map.toml", "").sonar);
  };
  BeamDescription beam =
      of("beam_half_angle_deg = 3\nsigma_pointing_deg = 1\nsigma_range_mm = 1500\n");
  assert_int_equal(beam.kind, model::BeamKind::kCone);
  assert_near(beam.detection_fraction, 0.1, 0.0);
  assert_near(beam.sigma_range_mm, 1500.0, 0.0);
  assert_int_equal(generate_table(beam).table.sigma_range_um, 1500000);
  beam =
      of("piston_diameter_mm = 60\nfrequency_hz = 2e5\nmax_half_angle_deg = 10\n"
         "sound_speed_mm_s = 1480000\ndetection_fraction = 0.3\n");
  assert_int_equal(beam.kind, model::BeamKind::kPiston);
  assert_near(beam.piston_diameter_mm, 60.0, 0.0);
  assert_near(beam.frequency_hz, 2e5, 0.0);
  assert_near(beam.sound_speed_mm_s, 1480000.0, 0.0);
  assert_near(beam.max_half_angle_deg.value(), 10.0, 0.0);
  assert_near(beam.detection_fraction, 0.3, 0.0);
  beam = of("aperture_along_mm = 300\naperture_across_mm = 30\nfrequency_hz = 2e5\n");
  assert_int_equal(beam.kind, model::BeamKind::kRectangle);
  assert_near(beam.aperture_along_mm, 300.0, 0.0);
  assert_near(beam.aperture_across_mm, 30.0, 0.0);
  const std::string path = leadline::test::scratch_directory() + "/beam.txt";
  write_text(path, "0 0\n5 -20\n10 -40\n");
  beam = of("pattern_file = \"" + path + "\"\n");
  assert_int_equal(beam.kind, model::BeamKind::kMeasured);
  assert_int_equal(beam.rows.size(), 3);
}

// --- files and the command
// ---------------------------------------------------------------------------------

TEST(tables_survive_a_file) {
  const std::string path = leadline::test::scratch_directory() + "/beam.llt";
  const LocalizationTable table = generate_table(cone(3.0, 1.0)).table;
  save_table(path, table);
  assert_int_equal(std::filesystem::file_size(path), sizeof(table));
  const LocalizationTable loaded = load_table(path);
  assert_memory_equal(&loaded, &table, sizeof(table));
  assert_contains(error_of(ExitCode::kOutput, [&] { save_table(path + "/x.llt", table); }), path);
}

TEST(files_that_are_no_tables_are_refused) {
  const LocalizationTable& table = table_of(cone(3.0));
  const std::string bytes(reinterpret_cast<const char*>(&table), sizeof(table));
  const auto error = [](const std::string& text) {
    return error_of(ExitCode::kInput, [&] { (void)parse_table(text, "t.llt"); });
  };
  assert_contains(error(""), "t.llt: truncated: 0 of 25832 bytes");
  assert_contains(error(bytes.substr(0, 1000)), "truncated: 1000 of 25832 bytes");
  assert_contains(error(bytes + "x"), "longer than the 25832 bytes of a table");
  std::string changed = bytes;
  changed[4] = 9;
  assert_contains(error(changed), "table version 9, this program reads version 1");
  assert_contains(error(changed + "longer than ours"), "table version 9");
  changed = bytes;
  changed[5000] = static_cast<char>(changed[5000] ^ 1);
  assert_contains(error(changed), "damaged: the checksum says 0x");
  assert_contains(error("PNG" + bytes.substr(3)), "not a localization table");
  LocalizationTable bad = table;
  bad.kernel_count[3][3] = 200;
  bad.crc32c = model::table_crc(bad);
  assert_contains(error(std::string(reinterpret_cast<const char*>(&bad), sizeof(bad))),
                  "outside its range");
  const std::string folder = leadline::test::scratch_directory();
  for (const std::string& path : {folder + "/missing.llt", folder}) {
    assert_contains(error_of(ExitCode::kInput, [&] { (void)load_table(path); }),
                    path + ": cannot be read");
  }
}

TEST(a_table_describes_itself) {
  const LocalizationTable table = generate_table(rectangle(300.0, 30.0, 200e3, 1.0)).table;
  const std::string text = table_to_text(table);
  assert_contains(text, "Beam: rectangle, different along and across");
  assert_contains(text, "Envelope half-angle: 2.8660 deg along, 30.0000 deg across");
  assert_contains(text, "Energy discarded outside the envelope: 0.09");
  const nlohmann::json json = nlohmann::json::parse(table_to_json(table));
  assert_string_equal(json.at("beam").get<std::string>().c_str(), "rectangle");
  assert_true(json.at("two_axis").get<bool>());
  assert_near(json.at("envelope_deg").at(1).get<double>(), 30.0, 1e-4);
  assert_near(json.at("sigma_pointing_deg").get<double>(), 1.0, 1e-4);
  assert_near(json.at("error_first_return").get<double>(), table.error_excess_q30 * 0x1.0p-30,
              1e-8);
  assert_int_equal(std::stoul(json.at("table_crc").get<std::string>(), nullptr, 16), table.crc32c);
  assert_contains(generate_table(cone(3.0)).report, "Cut: edge of the cone");
  assert_contains(generate_table(cone(3.0)).report, "up to 75 degrees of incidence");
  assert_contains(generate_table(rectangle(300.0, 4.0, 200e3)).report,
                  "Cut: second null along, widest envelope of a table, 80 degrees across");
}

TEST(the_command_makes_and_shows_tables) {
  const std::string folder = leadline::test::scratch_directory();
  write_text(folder + "/map.toml",
             "[grid]\ncell_mm = 1000\nsize = [8, 8, 8]\norigin_mm = [0, 0, 0]\n"
             "[sonar]\nbeam_half_angle_deg = 3\n");
  TableOptions options;
  options.config_path = folder + "/map.toml";
  options.out_path = folder + "/beam.llt";
  assert_contains(output_of([&] { assert_int_equal(run_table(options), 0); }),
                  "Envelope half-angle: 3.0000 deg\n");
  assert_int_equal(load_table(options.out_path).crc32c, generate_table(cone(3.0)).table.crc32c);
  // A beam needs no grid.
  write_text(folder + "/beam.toml", "[sonar]\nbeam_half_angle_deg = 3\nmax_range_mm = 300000\n");
  options.config_path = folder + "/beam.toml";
  options.out_path = folder + "/alone.llt";
  (void)output_of([&] { assert_int_equal(run_table(options), 0); });
  assert_int_equal(load_table(options.out_path).crc32c, generate_table(cone(3.0)).table.crc32c);
  options.json = true;
  const std::string made = output_of([&] { (void)run_table(options); });
  TableOptions show;
  show.show_path = options.out_path;
  show.json = true;
  assert_string_equal(output_of([&] { (void)run_table(show); }).c_str(), made.c_str());
  show.json = false;
  assert_contains(output_of([&] { (void)run_table(show); }), "Beam: cone, axisymmetric");

  assert_contains(error_of(ExitCode::kUsage, [] { (void)run_table({}); }), "nothing to do");
  show.config_path = options.config_path;
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)run_table(show); }), "not both");
  show.config_path = "";
  show.out_path = "x";
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)run_table(show); }),
                  "--out goes with --config");
  options.out_path = folder + "/no/such/beam.llt";
  (void)error_of(ExitCode::kOutput, [&] { (void)run_table(options); });
}

}  // namespace
