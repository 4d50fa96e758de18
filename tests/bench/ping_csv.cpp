// Rows per second of the CSV reader: a scene's kind of rows, in memory.
#include "host_tools/ping_csv.hpp"

#include <string>
#include <string_view>

#include <benchmark/benchmark.h>

namespace {

constexpr int kRows = 100'000;

std::string scene_text() {
  std::string text =
      "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n";
  for (int i = 0; i < kRows; ++i) {
    const std::string number = std::to_string(1000 + i % 9000);
    text += std::to_string(i * 100) + "," + std::to_string(i % 128) + "." + number + ",63." +
            number + ",67.0952,-3." + number + ",5." + number + ",287." + number + ",-85.4055,87." +
            number + "," + (i % 33 == 0 ? "" : "13." + number) + "\n";
  }
  return text;
}

void read_rows(benchmark::State& state) {
  const std::string text = scene_text();
  for (auto _ : state) {
    leadline::host::PingCsvReader reader("bench.csv", std::string_view(text), {});
    leadline::host::PingRow row{};
    while (reader.next(&row)) {
      benchmark::DoNotOptimize(row);
    }
  }
  state.SetItemsProcessed(state.iterations() * kRows);
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(text.size()));
}
BENCHMARK(read_rows)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
