// The model's inner loops and its steps, each alone: what a ping's time is made of.
#include <cstdint>
#include <cstdlib>
#include <vector>

#include <benchmark/benchmark.h>

#include "host_tools/table/generator.hpp"
#include "model/column_depth.hpp"
#include "model/column_kernels.hpp"
#include "model/model.hpp"

namespace {

namespace base = leadline::base;
namespace model = leadline::model;

// As on a vehicle: one static object.
model::Model the_model;

const model::LocalizationTable& table() {
  static const leadline::host::GeneratedTable generated = [] {
    leadline::host::BeamDescription beam;
    beam.half_angle_deg = 3;
    beam.sigma_pointing_deg = 1;
    beam.sigma_range_mm = 1000;
    return leadline::host::generate_table(beam);
  }();
  return generated.table;
}

void configure(model::Rule rule) {
  model::ModelConfig config{};
  config.schema_version = model::kConfigSchemaVersion;
  config.rule = rule;
  config.cell_mm = 1000;
  config.size[0] = config.size[1] = 128;
  config.size[2] = 32;
  config.max_range_um = 40'000'000;
  if (the_model.configure(config, &table(), sizeof(model::LocalizationTable)) !=
      base::Status::kOk) {
    std::abort();
  }
}

struct Records {
  base::Ping ping{};
  base::Pose pose{};
};

/// Number `i` of a lawn mower 20 cells above a bottom 20 cells deep, heeling a little.
Records records(std::uint32_t i) {
  Records r;
  r.ping.kind = base::ReturnKind::kRange;
  r.ping.quality = 255;
  r.ping.elevation_bam32 = base::kBam32QuarterTurn;
  r.ping.range_um = 20'000'000 + static_cast<std::int64_t>(i * 7919U % 2'000'000U) - 1'000'000;
  r.pose.position_um[0] = static_cast<std::int64_t>(i % 256U) * 500'000;
  r.pose.position_um[1] = static_cast<std::int64_t>(i / 256U % 64U) * 2'000'000 + 1'000'000;
  r.pose.attitude.roll_bam32 = i * 104'729U % (1U << 24U);  // 0 .. 1.4 degrees
  r.pose.attitude.heading_bam32 = i * 2'654'435'761U;
  r.pose.validity = base::kPoseAll;
  return r;
}

void shell_run(benchmark::State& state) {
  std::vector<model::Voxel> column(64);
  const auto count = static_cast<std::int32_t>(state.range(0));
  const std::int16_t* const taps = table().kernel_q15[model::kKernelLevels - 1][0] + 1;
  std::uint32_t dither = 0;
  for (auto step : state) {
    static_cast<void>(step);
    model::add_shell(column.data() + 8, taps, count, 8, model::Evidence{3000, 200}, ++dither);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * count);
}
BENCHMARK(shell_run)->Arg(3)->Arg(7)->Arg(14);

void empty_run(benchmark::State& state) {
  std::vector<model::Voxel> column(256);
  const auto count = static_cast<std::int32_t>(state.range(0));
  std::uint32_t dither = 0;
  for (auto step : state) {
    static_cast<void>(step);
    model::add_uniform(column.data(), count, 0, model::Evidence{40, 900}, ++dither);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * count);
}
BENCHMARK(empty_run)->Arg(4)->Arg(24)->Arg(200);

// The same without vector instructions: their ratio is what those are worth.
void shell_run_scalar(benchmark::State& state) {
  std::vector<model::Voxel> column(64);
  const auto count = static_cast<std::int32_t>(state.range(0));
  const std::int16_t* const taps = table().kernel_q15[model::kKernelLevels - 1][0] + 1;
  std::uint32_t dither = 0;
  for (auto step : state) {
    static_cast<void>(step);
    model::add_shell_scalar(column.data() + 8, taps, count, 8, model::Evidence{3000, 200},
                            ++dither);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * count);
}
BENCHMARK(shell_run_scalar)->Arg(3)->Arg(7)->Arg(14);

void empty_run_scalar(benchmark::State& state) {
  std::vector<model::Voxel> column(256);
  const auto count = static_cast<std::int32_t>(state.range(0));
  std::uint32_t dither = 0;
  for (auto step : state) {
    static_cast<void>(step);
    model::add_uniform_scalar(column.data(), count, 0, model::Evidence{40, 900}, ++dither);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * count);
}
BENCHMARK(empty_run_scalar)->Arg(4)->Arg(24)->Arg(200);

void depth_of_column(benchmark::State& state) {
  const auto depth = static_cast<std::int32_t>(state.range(0));
  std::vector<model::Voxel> column(static_cast<std::size_t>(depth) + 64);
  for (std::int32_t k = 0; k < depth; ++k) {
    const std::int32_t off = k - depth / 2;
    column[static_cast<std::size_t>(k)] =
        model::Voxel{static_cast<std::uint16_t>(off * off < 25 ? 1000 - 36 * off * off : 3),
                     static_cast<std::uint16_t>(off < -4 ? 2000 : 100)};
  }
  for (auto step : state) {
    static_cast<void>(step);
    model::ColumnDepth found = model::column_depth(
        column.data(), depth, model::DepthMethod::kRobustMoment, model::Rule::kLogOdds);
    benchmark::DoNotOptimize(found);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * depth);
}
BENCHMARK(depth_of_column)->Arg(32)->Arg(128)->Arg(1024);

void beam_axes(benchmark::State& state) {
  std::uint32_t i = 0;
  for (auto step : state) {
    static_cast<void>(step);
    const base::Attitude attitude{i * 12345U, i * 777U, i * 99991U};
    model::BeamFrame frame = model::beam_frame(attitude, i, base::kBam32QuarterTurn - i, 0);
    benchmark::DoNotOptimize(frame);
    ++i;
  }
}
BENCHMARK(beam_axes);

void shell_geometry(benchmark::State& state) {
  configure(model::Rule::kLogOdds);
  std::int32_t i = 0;
  const base::Attitude level{};
  const model::BeamFrame frame =
      model::beam_frame(level, 0, base::kBam32QuarterTurn - 20'000'000U, 0);
  for (auto step : state) {
    static_cast<void>(step);
    const model::Sighting sighting{{4'000'000 + i % 65536, 4'000'000, 0}, 20 << 16, {0, 0, 0}};
    model::ShellEvent event =
        model::make_shell(the_model.scale(), table(), frame, sighting, model::Slope{i % 1024, 300});
    benchmark::DoNotOptimize(event);
    ++i;
  }
}
BENCHMARK(shell_geometry);

void whole_ping(benchmark::State& state) {
  configure(state.range(0) == 0 ? model::Rule::kLogOdds : model::Rule::kWeightedMean);
  std::vector<Records> pings;
  for (std::uint32_t i = 0; i < 16384; ++i) {
    pings.push_back(records(i));
  }
  std::size_t i = 0;
  for (auto step : state) {
    static_cast<void>(step);
    the_model.integrate(pings[i].ping, pings[i].pose);
    i = (i + 1) % pings.size();
  }
  const auto updates = static_cast<double>(the_model.counters().voxel_updates);
  state.SetItemsProcessed(state.iterations());
  state.counters["voxels/s"] = benchmark::Counter(updates, benchmark::Counter::kIsRate);
  state.counters["s/voxel"] =
      benchmark::Counter(updates, benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(whole_ping)->ArgName("weighted_mean")->Arg(0)->Arg(1);

void extract_grid(benchmark::State& state) {
  configure(model::Rule::kLogOdds);
  for (std::uint32_t i = 0; i < 32768; ++i) {
    const Records r = records(i);
    the_model.integrate(r.ping, r.pose);
  }
  for (auto step : state) {
    static_cast<void>(step);
    the_model.extract();
  }
  state.SetItemsProcessed(state.iterations() * 128 * 128);
}
BENCHMARK(extract_grid)->Unit(benchmark::kMillisecond);

void make_table(benchmark::State& state) {
  leadline::host::BeamDescription beam;
  beam.half_angle_deg = 3;
  beam.sigma_pointing_deg = 1;
  for (auto step : state) {
    static_cast<void>(step);
    auto generated = leadline::host::generate_table(beam);
    benchmark::DoNotOptimize(generated);
  }
}
BENCHMARK(make_table)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
