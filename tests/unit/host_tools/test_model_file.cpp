#include <cmath>
#include <cstring>
#include <fstream>

#include "host_tools/exit_codes.hpp"
#include "host_tools/model_file.hpp"
#include "host_tools/table/beam_pattern.hpp"
#include "host_tools/table/generator.hpp"
#include "model/base/crc32c.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::beam_description;
using leadline::host::ExitCode;
using leadline::host::format_model_file;
using leadline::host::generate_table;
using leadline::host::HostError;
using leadline::host::load_model_file;
using leadline::host::map_config_to_toml;
using leadline::host::parse_map_config;
using leadline::host::parse_model_file;
using leadline::host::SavedModel;
using leadline::host::voxel_field;
using leadline::host::voxel_signal;
using leadline::host::voxel_state;
using leadline::host::voxel_states;
using leadline::host::VoxelState;
using leadline::model::Voxel;

/// 2 x 3 x 4 voxels, each different.
SavedModel small() {
  SavedModel saved;
  saved.config = parse_map_config(
      "[grid]\ncell_mm = 500\nsize = [2, 3, 4]\norigin_mm = [-1000, 250, 8000]\n"
      "[sonar]\nbeam_half_angle_deg = 3\n",
      "c.toml", "");
  saved.table = generate_table(beam_description(saved.config.sonar)).table;
  std::uint64_t hash = 0xCBF29CE484222325ULL;
  for (std::uint32_t i = 0; i < 24; ++i) {
    const Voxel voxel{static_cast<std::uint16_t>(i * 2711),
                      static_cast<std::uint16_t>(65535 - i * 13)};
    saved.voxels.push_back(voxel);
    hash =
        (hash ^ (voxel.hit | (static_cast<std::uint32_t>(voxel.miss) << 16U))) * 0x100000001B3ULL;
  }
  saved.map_hash = hash;
  return saved;
}

std::string input_error(const std::string& bytes) {
  std::string message;
  ExitCode code = ExitCode::kOk;
  try {
    (void)parse_model_file(bytes, "m.llm");
  } catch (const HostError& error) {
    message = error.what();
    code = error.code();
  }
  assert_int_equal(code, ExitCode::kInput);
  assert_true(message.find("m.llm") == 0);
  return message;
}

void assert_error(const std::string& bytes, const std::string& part) {
  const std::string message = input_error(bytes);
  if (message.find(part) == std::string::npos) {
    fail_msg("\"%s\" is not in \"%s\"", part.c_str(), message.c_str());
  }
}

/// The file with a checksum that fits whatever was changed in it.
std::string resealed(std::string bytes) {
  const std::uint32_t crc = leadline::base::crc32c(bytes.data() + 24, bytes.size() - 24);
  std::memcpy(bytes.data() + 16, &crc, sizeof crc);
  return bytes;
}

TEST(what_was_saved_is_what_is_read) {
  const SavedModel saved = small();
  const std::string bytes = format_model_file(saved);
  const SavedModel read = parse_model_file(bytes, "m.llm");
  assert_string_equal(map_config_to_toml(read.config).c_str(),
                      map_config_to_toml(saved.config).c_str());
  assert_memory_equal(&read.table, &saved.table, sizeof saved.table);
  assert_int_equal(read.map_hash, saved.map_hash);
  assert_int_equal(read.voxels.size(), 24);
  assert_memory_equal(read.voxels.data(), saved.voxels.data(), 24 * sizeof(Voxel));
  // (north, east, down), down fastest.
  assert_int_equal(read.voxel(1, 2, 3).hit, 23 * 2711);
  assert_int_equal(read.voxel(0, 1, 2).hit, 6 * 2711);
  assert_true(format_model_file(read) == bytes);
}

TEST(folders_and_files_are_read) {
  const std::string directory = leadline::test::scratch_directory();
  const std::string bytes = format_model_file(small());
  std::ofstream(directory + "/model.llm", std::ios::binary) << bytes;
  assert_int_equal(load_model_file(directory).map_hash, small().map_hash);
  assert_int_equal(load_model_file(directory + "/model.llm").map_hash, small().map_hash);
  for (const std::string& path : {directory + "/none.llm", std::string("/nowhere")}) {
    ExitCode code = ExitCode::kOk;
    try {
      (void)load_model_file(path);
    } catch (const HostError& error) {
      code = error.code();
    }
    assert_int_equal(code, ExitCode::kInput);
  }
}

TEST(every_cut_is_noticed) {
  const std::string bytes = format_model_file(small());
  for (std::size_t size = 0; size < bytes.size(); size += size < 100 ? 1 : 997) {
    (void)input_error(bytes.substr(0, size));
  }
  assert_error("", "is not a saved model");
  assert_error("PK\x03\x04 a zip", "is not a saved model");
  assert_error(bytes.substr(0, 47), "is cut");
  assert_error(bytes.substr(0, bytes.size() - 1), "is cut");
  assert_error(bytes + "x", "bytes after its end");
}

TEST(every_flipped_byte_is_noticed) {
  const std::string bytes = format_model_file(small());
  for (std::size_t at = 0; at < bytes.size(); at += at < 600 ? 1 : 101) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    const bool reserved = (at >= 6 && at < 8) || (at >= 20 && at < 24);
    if (!reserved) {
      (void)input_error(damaged);
    }
  }
}

TEST(other_versions_are_named) {
  std::string bytes = format_model_file(small());
  bytes[4] = 2;
  assert_error(bytes, "version 2, this program reads version 1");
}

TEST(parts_that_do_not_fit_are_refused_even_with_a_good_checksum) {
  const std::string bytes = format_model_file(small());
  std::string bad = bytes;
  bad[40] = static_cast<char>(bad[40] + 1);  // one voxel more than there is
  assert_error(resealed(bad), "do not add up");
  bad = bytes;
  bad[47] = static_cast<char>(0xFF);  // a count that overflows when multiplied
  assert_error(resealed(bad), "do not add up");
  bad = bytes;
  bad[24] = static_cast<char>(bad[24] ^ 1);  // another hash
  assert_error(resealed(bad), "map_hash");
  bad = bytes;
  bad.replace(bad.find("size = [2, 3, 4]"), 16, "size = [2, 3, 5]");
  assert_error(resealed(bad), "24 voxels for a grid of 30");
  bad = bytes;
  bad.replace(bad.find("cell_mm = 500"), 13, "cell_mm = -50");
  assert_error(resealed(bad), "(configuration):4: [grid] cell_mm = -50");
  bad = bytes;
  const std::size_t table = 48 + map_config_to_toml(small().config).size();
  bad[table + 200] = static_cast<char>(bad[table + 200] ^ 1);
  assert_error(resealed(bad), "(table)");
}

TEST(states_follow_the_evidence) {
  assert_int_equal(voxel_state({0, 0}), VoxelState::kUnknown);
  assert_int_equal(voxel_state({7, 0}), VoxelState::kUnknown);
  assert_int_equal(voxel_state({8, 0}), VoxelState::kOccupied);
  assert_int_equal(voxel_state({0, 8}), VoxelState::kFree);
  assert_int_equal(voxel_state({100, 100}), VoxelState::kOccupied);
  assert_int_equal(voxel_state({99, 100}), VoxelState::kUnknown);
  assert_int_equal(voxel_state({25, 100}), VoxelState::kFree);
  assert_int_equal(voxel_state({26, 100}), VoxelState::kUnknown);
  assert_int_equal(voxel_state({65535, 65535}), VoxelState::kOccupied);
  assert_true(std::isnan(voxel_signal({0, 0})));
  assert_near(voxel_signal({1, 3}), 0.25, 0);
}

TEST(views_use_the_frame_of_the_survey) {
  const SavedModel saved = small();
  const auto states = voxel_states(saved);
  // North -1.0 .. 0, east 0.25 .. 1.75, down 8 .. 10.
  assert_true(states.lattice.cell_of({-1, 1'749, 9'999}) == leadline::host::CellIndex({1, 2, 3}));
  assert_true(states.contains({1, 2, 3}));
  assert_false(states.contains({2, 0, 0}));
  assert_int_equal(states.state({1, 2, 3}), voxel_state(saved.voxel(1, 2, 3)));
  const auto field = voxel_field(saved);
  assert_int_equal(field.size[1], 3);
  assert_near(field.cell_m, 0.5, 0);
  assert_near(field.origin_m[0], -1, 0);
  assert_near(field.origin_m[2], 8, 0);
  assert_near(field.probability(1, 2, 3), voxel_signal(saved.voxel(1, 2, 3)), 0);
}

}  // namespace
