#include "host_tools/exit_codes.hpp"
#include "host_tools/query.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::CellIndex;
using leadline::host::ExitCode;
using leadline::host::format_box_answer;
using leadline::host::format_segment_answer;
using leadline::host::parse_point;
using leadline::host::PointMm;
using leadline::host::query_box;
using leadline::host::query_segment;
using leadline::host::SegmentAnswer;
using leadline::host::StateCounts;
using leadline::host::VoxelState;
using leadline::host::VoxelStates;
using leadline::test::error_of;

/// 10 x 10 x 10 cells of 1 m from (0, 0, 100 m): free above cell 5, a wall at 5, unknown below.
VoxelStates wall() {
  return {{{0, 0, 100'000}, 1000}, {10, 10, 10}, [](const CellIndex& cell) {
            return cell[2] < 5 ? VoxelState::kFree
                               : (cell[2] == 5 ? VoxelState::kOccupied : VoxelState::kUnknown);
          }};
}

std::uint64_t count(const StateCounts& counts, VoxelState state) {
  return counts.of[static_cast<std::size_t>(state)];
}

TEST(a_free_line_is_free) {
  const SegmentAnswer answer = query_segment(wall(), {500, 500, 100'500}, {9'500, 500, 104'999});
  assert_int_equal(answer.counts.verdict(), VoxelState::kFree);
  assert_int_equal(answer.runs.size(), 1);
  assert_near(answer.runs[0].to_m, answer.length_m, 0);
  assert_false(answer.first_occupied_m.has_value());
}

TEST(a_line_into_the_wall_says_where) {
  const SegmentAnswer answer = query_segment(wall(), {500, 500, 101'000}, {500, 500, 109'000});
  assert_int_equal(answer.counts.verdict(), VoxelState::kOccupied);
  assert_near(answer.length_m, 8, 1e-12);
  assert_near(answer.first_occupied_m.value(), 4, 1e-12);
  assert_int_equal(answer.runs.size(), 3);
  assert_near(answer.runs[1].from_m, 4, 1e-12);
  assert_near(answer.runs[1].to_m, 5, 1e-12);
  assert_int_equal(answer.runs[2].state, VoxelState::kUnknown);
  assert_int_equal(count(answer.counts, VoxelState::kFree), 4);
  assert_int_equal(count(answer.counts, VoxelState::kOccupied), 1);
  assert_int_equal(count(answer.counts, VoxelState::kUnknown), 4);
}

TEST(outside_the_grid_is_unknown_never_free) {
  const SegmentAnswer answer = query_segment(wall(), {-1'500, 500, 100'500}, {1'500, 500, 100'500});
  assert_int_equal(answer.counts.verdict(), VoxelState::kUnknown);
  assert_int_equal(answer.counts.outside, 2);
  assert_int_equal(answer.runs.size(), 2);
  assert_near(answer.runs[1].from_m, 1.5, 1e-12);
}

TEST(a_point_is_a_line_of_one_voxel) {
  const SegmentAnswer answer = query_segment(wall(), {500, 500, 105'000}, {500, 500, 105'000});
  assert_int_equal(answer.counts.verdict(), VoxelState::kOccupied);
  assert_int_equal(answer.runs.size(), 1);
  assert_near(answer.length_m, 0, 0);
}

TEST(boxes_count_what_they_share_volume_with) {
  // Exactly the first two layers; the upper faces only touch.
  StateCounts counts = query_box(wall(), {0, 0, 100'000}, {10'000, 10'000, 102'000});
  assert_int_equal(counts.verdict(), VoxelState::kFree);
  assert_int_equal(count(counts, VoxelState::kFree), 200);
  // One millimetre more, corners the other way round.
  counts = query_box(wall(), {10'000, 10'000, 105'001}, {0, 0, 100'000});
  assert_int_equal(count(counts, VoxelState::kOccupied), 100);
  // No extent: the voxel that holds the point.
  counts = query_box(wall(), {0, 0, 105'000}, {0, 0, 105'000});
  assert_int_equal(count(counts, VoxelState::kOccupied), 1);
  // Half outside.
  counts = query_box(wall(), {-2'000, 0, 100'000}, {2'000, 1'000, 101'000});
  assert_int_equal(counts.outside, 2);
  assert_int_equal(count(counts, VoxelState::kFree), 2);
  assert_int_equal(counts.verdict(), VoxelState::kUnknown);
  // Far away, as large as can be.
  counts = query_box(wall(), {-2'000'000'000, -2'000'000'000, -20'000'000},
                     {2'000'000'000, 2'000'000'000, 0});
  assert_int_equal(counts.verdict(), VoxelState::kUnknown);
  assert_int_equal(count(counts, VoxelState::kUnknown), 4'000'000ULL * 4'000'000ULL * 20'000ULL);
}

TEST(queries_over_the_limit_are_refused) {
  VoxelStates fine = wall();
  fine.lattice.cell_mm = 1;
  fine.size = {1'000'000, 1'000, 1'000};
  const std::string line = error_of(ExitCode::kUsage, [&] {
    (void)query_segment(fine, {-1'000'000'000, 0, 0}, {1'000'000'000, 0, 0});
  });
  assert_true(line.find("2000000001 voxels") != std::string::npos);
  (void)error_of(ExitCode::kUsage, [&] {
    (void)query_box(fine, {0, 0, 100'000}, {1'000'000, 1'000, 101'000});
  });
}

TEST(points_are_parsed_exactly) {
  assert_true(parse_point("--from", "1,2,3") == PointMm({1'000, 2'000, 3'000}));
  assert_true(parse_point("--from", "-0.001, 2.5 ,1e2") == PointMm({-1, 2'500, 100'000}));
  for (const char* const text : {"", "1,2", "1,2,3,4", "1,2,x", "1,,3", "nan,1,2", "1;2;3"}) {
    const std::string message =
        error_of(ExitCode::kUsage, [&] { (void)parse_point("--from", text); });
    assert_true(message.find(std::string("--from ") + text) == 0);
    assert_true(message.find("NORTH,EAST,DOWN") != std::string::npos);
  }
  (void)error_of(ExitCode::kUsage, [] { (void)parse_point("--to", "2000000.001,0,0"); });
  (void)error_of(ExitCode::kUsage, [] { (void)parse_point("--to", "0,0,-20001"); });
}

TEST(answers_read_well_and_parse) {
  const SegmentAnswer answer = query_segment(wall(), {500, 500, 104'000}, {500, 500, 105'500});
  assert_string_equal(
      format_segment_answer(answer, true).c_str(),
      "{\"query\": \"segment\", \"verdict\": \"occupied\", \"voxels\": {\"free\": 1, "
      "\"occupied\": 1, \"unknown\": 0, \"outside\": 0}, \"length_m\": 1.5, "
      "\"first_occupied_m\": 1, \"runs\": [{\"state\": \"free\", \"from_m\": 0, "
      "\"to_m\": 1}, {\"state\": \"occupied\", \"from_m\": 1, \"to_m\": 1.5}]}\n");
  assert_string_equal(format_segment_answer(answer, false).c_str(),
                      "occupied\nvoxels    1 free, 1 occupied, 0 unknown\n"
                      "free      0.000 m to 1.000 m\noccupied  1.000 m to 1.500 m\n");
  const StateCounts box = query_box(wall(), {-1'000, 0, 100'000}, {1'000, 1'000, 101'000});
  assert_string_equal(format_box_answer(box, true).c_str(),
                      "{\"query\": \"box\", \"verdict\": \"unknown\", \"voxels\": {\"free\": 1, "
                      "\"occupied\": 0, \"unknown\": 1, \"outside\": 1}}\n");
  assert_string_equal(
      format_box_answer(box, false).c_str(),
      "unknown\nvoxels    1 free, 0 occupied, 1 unknown (1 of them outside the grid)\n");
}

}  // namespace
