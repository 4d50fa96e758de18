// What the images that measure share: a model as a cost file says (cost_file.hpp), the counter, and how such an image
// begins. Exit status of such an image: 0, 2 usage, 3 the file is of no use.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/m7/cost_file.hpp"
#include "firmware/m7/say.hpp"
#include "firmware/pipeline/link_map.hpp"
#include "hal/m7/clock.hpp"
#include "hal/m7/semihost.hpp"
#include "model/model.hpp"

namespace leadline::firmware::m7 {

inline constexpr std::uint32_t kMeasured = 0;
inline constexpr std::uint32_t kUsage = 2;
inline constexpr std::uint32_t kInput = 3;

extern model::Model the_model;
extern LinkMap link_map;
extern CostHeader header;
extern model::ModelConfig config;
extern hal::m7::InstructionCounter counter;

template <typename T>
[[nodiscard]] bool take(hal::m7::HostFile& file, T* out, std::size_t count = 1) {
  return file.read(reinterpret_cast<std::uint8_t*>(out), sizeof(T) * count) == sizeof(T) * count;
}

/// `program: error: ` and the words.
void say_error(const char* program, const char* words);

/// The begin of `program`: opens the file on the command line, reads it up to its pings and configures the model. What is
/// wrong is said, and ends the image.
void begin_measuring(const char* program, hal::m7::HostFile& file);

/// Compares a tile with what the link has of it; its columns.
std::uint32_t compare_tile(model::TileId tile);

}  // namespace leadline::firmware::m7
