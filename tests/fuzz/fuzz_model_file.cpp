// Any bytes as model.llm. What must hold: only HostError kInput comes out; a model that is accepted has
// exactly the voxels of its grid, can be asked about any of them, and is written back to the same bytes
// but for the reserved ones. The checksum is made to fit in a second try: otherwise nothing behind it
// would ever be reached.
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "host_tools/exit_codes.hpp"
#include "host_tools/model_file.hpp"
#include "model/base/crc32c.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::fuzz::require;
using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::SavedModel;

void fuzz(std::string_view bytes) {
  SavedModel saved;
  try {
    saved = leadline::host::parse_model_file(bytes, "f.llm");
  } catch (const HostError& error) {
    require(error.code() == ExitCode::kInput, "only input errors");
    require(std::string_view(error.what()).substr(0, 5) == "f.llm", "messages name the file");
    return;
  }
  require(saved.voxels.size() == saved.config.grid.voxel_count(), "as many voxels as the grid has");
  const auto states = leadline::host::voxel_states(saved);
  const auto& grid = saved.config.grid;
  (void)leadline::host::query_box(states, {grid.origin_mm[0], grid.origin_mm[1], grid.origin_mm[2]},
                                  {grid.origin_mm[0] + 10, grid.origin_mm[1], grid.origin_mm[2]});
  (void)leadline::host::voxel_field(saved).probability(grid.size[0] - 1, grid.size[1] - 1,
                                                       grid.size[2] - 1);
  const std::string again = leadline::host::format_model_file(saved);
  const SavedModel reread = leadline::host::parse_model_file(again, "r.llm");
  require(reread.map_hash == saved.map_hash, "what is written reads back");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz(std::string_view(reinterpret_cast<const char*>(data), size));
  if (size >= 48) {
    std::string sealed(reinterpret_cast<const char*>(data), size);
    const std::uint64_t size_bytes = size;
    std::memcpy(sealed.data(), "LLM1\x01\x00\x00\x00", 8);
    std::memcpy(sealed.data() + 8, &size_bytes, sizeof size_bytes);
    const std::uint32_t crc = leadline::base::crc32c(sealed.data() + 24, size - 24);
    std::memcpy(sealed.data() + 16, &crc, sizeof crc);
    fuzz(sealed);
  }
  return 0;
}
