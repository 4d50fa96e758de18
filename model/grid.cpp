#include "model/grid.hpp"

#include <cstring>

namespace leadline::model {
namespace {

constexpr std::uint64_t kFnvOffset = 0xCBF29CE484222325ULL;
constexpr std::uint64_t kFnvPrime = 0x100000001B3ULL;

std::uint64_t hash_column(std::uint64_t hash, const Voxel* voxels, std::int32_t depth) {
  for (std::int32_t k = 0; k < depth; ++k) {
    const std::uint32_t word = voxels[k].hit | (static_cast<std::uint32_t>(voxels[k].miss) << 16U);
    hash = (hash ^ word) * kFnvPrime;
  }
  return hash;
}

}  // namespace

base::Status Grid::configure(const std::int32_t size[3], std::uint32_t resident_tiles) {
  if (size[0] < 1 || size[1] < 1 || size[2] < 1 || size[0] > kMaxSideCells ||
      size[1] > kMaxSideCells || size[2] > kMaxDepthCells) {
    return base::Status::kOutOfRange;
  }
  const std::int32_t tiles_north = (size[0] + kTileCells - 1) / kTileCells;
  const std::int32_t tiles_east = (size[1] + kTileCells - 1) / kTileCells;
  const std::uint64_t columns = static_cast<std::uint64_t>(tiles_north) *
                                static_cast<std::uint64_t>(tiles_east) *
                                static_cast<std::uint64_t>(kTileCells * kTileCells);
  const std::uint64_t tiles = columns / static_cast<std::uint64_t>(kTileCells * kTileCells);
  const bool windowed = resident_tiles != 0;
  // One more for the blank page.
  const std::uint64_t pages = windowed ? std::uint64_t{resident_tiles} + 1 : tiles;
  const std::uint64_t voxels = pages * static_cast<std::uint64_t>(kTileCells * kTileCells) *
                               static_cast<std::uint64_t>(size[2]);
  if (columns > kColumnCapacity || pages > std::uint64_t{kTileCapacity} + 1 ||
      voxels > kVoxelCapacity) {
    return base::Status::kOverCapacity;
  }
  north_ = size[0];
  east_ = size[1];
  depth_ = size[2];
  tiles_east_ = tiles_east;
  tile_count_ = static_cast<TileId>(tiles_north * tiles_east);
  std::memset(static_cast<void*>(voxels_), 0, static_cast<std::size_t>(voxels) * sizeof(Voxel));
  for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(columns); ++i) {
    columns_[i] = ColumnRecord{};
    columns_[i].depth_q8 = kUnknownDepth;
  }
  for (TileId id = 0; id < tile_count_; ++id) {
    tiles_[id] = TileRecord{};
    tiles_[id].page = windowed ? resident_tiles : id;
  }
  windowed_ = windowed;
  page_count_ = windowed ? resident_tiles : tile_count_;
  free_count_ = 0;
  for (std::uint32_t page = page_count_; windowed && page > 0; --page) {
    free_pages_[free_count_] = page - 1;
    ++free_count_;
  }
  touched_count_ = 0;
  return base::Status::kOk;
}

bool Grid::resident(std::int32_t n0, std::int32_t n1, std::int32_t e0, std::int32_t e1) const {
  if (n0 > n1 || e0 > e1) {
    return true;
  }
  for (std::int32_t n = n0 >> 4; n <= n1 >> 4; ++n) {
    for (std::int32_t e = e0 >> 4; e <= e1 >> 4; ++e) {
      if (!resident(static_cast<TileId>(n * tiles_east_ + e))) {
        return false;
      }
    }
  }
  return true;
}

bool Grid::take_page(std::uint32_t& page) {
  if (free_count_ == 0) {
    return false;
  }
  --free_count_;
  page = free_pages_[free_count_];
  return true;
}

bool Grid::page_in(TileId id) {
  std::uint32_t page = 0;
  if (resident(id) || !take_page(page)) {
    return false;
  }
  tiles_[id].page = page;
  std::memset(static_cast<void*>(tile_voxels(id)), 0,
              static_cast<std::size_t>(tile_voxel_count()) * sizeof(Voxel));
  return true;
}

void Grid::page_out(TileId id) {
  if (!windowed_ || !resident(id)) {
    return;
  }
  give_page(tiles_[id].page);
  tiles_[id].page = page_count_;
}

std::uint64_t Grid::tile_hash(TileId id) const {
  const std::int32_t n0 = static_cast<std::int32_t>(id) / tiles_east_ * kTileCells;
  const std::int32_t e0 = static_cast<std::int32_t>(id) % tiles_east_ * kTileCells;
  std::uint64_t hash = kFnvOffset;
  for (std::int32_t n = n0; n < n0 + kTileCells && n < north_; ++n) {
    for (std::int32_t e = e0; e < e0 + kTileCells && e < east_; ++e) {
      hash = hash_column(hash, column_voxels(column_index(n, e)), depth_);
    }
  }
  return hash;
}

std::uint64_t Grid::map_hash() const {
  std::uint64_t hash = kFnvOffset;
  for (std::int32_t n = 0; n < north_; ++n) {
    for (std::int32_t e = 0; e < east_; ++e) {
      hash = hash_column(hash, column_voxels(column_index(n, e)), depth_);
    }
  }
  return hash;
}

}  // namespace leadline::model
