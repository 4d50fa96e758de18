// Compile-time capacities: every static array of the model is sized here and nowhere else. A target
// overrides them from its build (-DLEADLINE_VOXEL_CAPACITY=...).
#pragma once

#include <cstddef>
#include <cstdint>

#ifndef LEADLINE_VOXEL_CAPACITY
#define LEADLINE_VOXEL_CAPACITY 16777216  // 16 Mi voxels: 64 MiB
#endif
#ifndef LEADLINE_COLUMN_CAPACITY
#define LEADLINE_COLUMN_CAPACITY 1048576  // 1 Mi columns: 24 MiB
#endif
#ifndef LEADLINE_SENSOR_CAPACITY
#define LEADLINE_SENSOR_CAPACITY 4
#endif

#ifndef LEADLINE_QUEUE_PINGS
#define LEADLINE_QUEUE_PINGS \
  4096  // beams that wait for their pose: 320 KiB; a head of 256 makes 256 a ping
#endif
#ifndef LEADLINE_QUEUE_BINS
#define LEADLINE_QUEUE_BINS 65536  // of profiles that wait for their pose: 128 KiB
#endif

// LEADLINE_SPREAD: memory is in banks that no object spans. The largest arrays then lie in sections of their
// own, for the linker script to place, and there is one model to a program.
#ifdef LEADLINE_SPREAD
#define LEADLINE_BANK(name) [[gnu::section(".bss.leadline." name)]] inline static
#else
#define LEADLINE_BANK(name)
#endif

namespace leadline::model {

inline constexpr std::uint32_t kVoxelCapacity = LEADLINE_VOXEL_CAPACITY;
inline constexpr std::uint32_t kColumnCapacity = LEADLINE_COLUMN_CAPACITY;

/// Tiles are the unit of paging, hashing, extraction and of the link: kTileCells x kTileCells columns,
/// whole tiles also at the grid's edge, so that columns bound tiles.
inline constexpr std::int32_t kTileCells = 16;
inline constexpr std::uint32_t kTileCapacity = kColumnCapacity / (kTileCells * kTileCells);

/// Kinds of sensors (localization tables, 26 KB each) that one model takes.
inline constexpr std::size_t kMaxSensors = LEADLINE_SENSOR_CAPACITY;

/// Tallest column in cells. Bounds every per-column loop.
inline constexpr std::int32_t kMaxDepthCells = 1024;
/// Largest grid side in cells, and the farthest that a vehicle outside the grid may be from its
/// origin: coordinates are 32-bit Q16.
inline constexpr std::int32_t kMaxSideCells = 16000;
/// Longest range in cells.
inline constexpr std::int32_t kMaxRangeCells = 8000;
/// Largest half-width of an event's footprint in cells; wider events are cut (and counted).
inline constexpr std::int32_t kMaxFootprintCells = 24;

static_assert(kVoxelCapacity >= 65536, "a useful grid needs at least this");
static_assert(kColumnCapacity >= kTileCells * kTileCells, "at least one tile");
static_assert(kMaxSideCells < 32000 && kMaxRangeCells < 16000, "coordinates must fit Q16");

}  // namespace leadline::model
