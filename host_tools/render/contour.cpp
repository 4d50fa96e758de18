#include "host_tools/render/contour.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <unordered_map>

namespace leadline::host::render {
namespace {

/// An edge of the lattice: horizontal (right of its sample) or vertical (below it). Every contour
/// point lies on one, so equal keys are the same point.
using EdgeKey = std::uint64_t;

struct Segment {
  EdgeKey a;
  EdgeKey b;
  bool used = false;
};

class LevelTracer {
 public:
  LevelTracer(const Lattice& lattice, double level) : lattice_(lattice), level_(level) {}

  void add_square(int row, int column) {
    const double corner[4] = {lattice_.at(row, column), lattice_.at(row, column + 1),
                              lattice_.at(row + 1, column + 1), lattice_.at(row + 1, column)};
    const EdgeKey edge[4] = {horizontal(row, column), vertical(row, column + 1),
                             horizontal(row + 1, column), vertical(row, column)};
    unsigned above = 0;
    for (unsigned i = 0; i < 4; ++i) {
      above |= corner[i] >= level_ ? 1U << i : 0U;
    }
    switch (above) {
      case 0:
      case 15:
        return;
      case 5:
      case 10: {
        const double centre = 0.25 * (corner[0] + corner[1] + corner[2] + corner[3]);
        // The two corners on the centre's side are joined through it.
        if ((centre >= level_) == (above == 5)) {
          add(edge[0], edge[1]);
          add(edge[2], edge[3]);
        } else {
          add(edge[3], edge[0]);
          add(edge[1], edge[2]);
        }
        return;
      }
      default:
        break;
    }
    // Exactly two edges change sides.
    EdgeKey ends[2] = {0, 0};
    int found = 0;
    for (unsigned i = 0; i < 4; ++i) {
      const bool first = (above >> i & 1U) != 0;
      const bool second = (above >> ((i + 1U) % 4U) & 1U) != 0;
      if (first != second) {
        ends[found++] = edge[i];
      }
    }
    add(ends[0], ends[1]);
  }

  void join(std::vector<Contour>* result) {
    for (std::size_t start = 0; start < segments_.size(); ++start) {
      if (segments_[start].used) {
        continue;
      }
      segments_[start].used = true;
      std::deque<EdgeKey> keys = {segments_[start].a, segments_[start].b};
      while (extend(&keys, true)) {
      }
      const bool closed = keys.size() > 2 && keys.front() == keys.back();
      if (closed) {
        keys.pop_back();
      } else {
        while (extend(&keys, false)) {
        }
      }
      Contour contour{level_, closed, {}};
      contour.points.reserve(keys.size());
      for (const EdgeKey key : keys) {
        contour.points.push_back(point(key));
      }
      result->push_back(std::move(contour));
    }
  }

 private:
  [[nodiscard]] EdgeKey horizontal(int row, int column) const {
    return static_cast<EdgeKey>(lattice_.index(row, column)) * 2U;
  }
  [[nodiscard]] EdgeKey vertical(int row, int column) const { return horizontal(row, column) + 1U; }

  void add(EdgeKey a, EdgeKey b) {
    at_edge_[a].push_back(segments_.size());
    at_edge_[b].push_back(segments_.size());
    segments_.push_back({a, b});
  }

  bool extend(std::deque<EdgeKey>* keys, bool at_back) {
    const EdgeKey end = at_back ? keys->back() : keys->front();
    if (keys->size() > 2 && keys->front() == keys->back()) {
      return false;
    }
    for (const std::size_t index : at_edge_[end]) {
      Segment& segment = segments_[index];
      if (segment.used) {
        continue;
      }
      segment.used = true;
      const EdgeKey next = segment.a == end ? segment.b : segment.a;
      if (at_back) {
        keys->push_back(next);
      } else {
        keys->push_front(next);
      }
      return true;
    }
    return false;
  }

  [[nodiscard]] PointOnLattice point(EdgeKey key) const {
    const std::size_t sample = key / 2U;
    const int row = static_cast<int>(sample / static_cast<std::size_t>(lattice_.columns));
    const int column = static_cast<int>(sample % static_cast<std::size_t>(lattice_.columns));
    const bool is_vertical = (key & 1U) != 0;
    const double first = lattice_.at(row, column);
    const double second = is_vertical ? lattice_.at(row + 1, column) : lattice_.at(row, column + 1);
    const double t = std::clamp((level_ - first) / (second - first), 0.0, 1.0);
    return is_vertical ? PointOnLattice{static_cast<double>(column), row + t}
                       : PointOnLattice{column + t, static_cast<double>(row)};
  }

  const Lattice& lattice_;
  double level_;
  std::vector<Segment> segments_;
  std::unordered_map<EdgeKey, std::vector<std::size_t>> at_edge_;
};

}  // namespace

std::vector<Contour> contours(const Lattice& lattice, double interval, double lowest,
                              double highest) {
  std::vector<Contour> result;
  double low = HUGE_VAL;
  double high = -HUGE_VAL;
  for (const float value : lattice.values) {
    if (!std::isnan(value)) {
      low = std::min(low, static_cast<double>(value));
      high = std::max(high, static_cast<double>(value));
    }
  }
  low = std::max(low, lowest);
  high = std::min(high, highest);
  if (!(low <= high) || !(interval > 0.0)) {
    return result;
  }
  const double first = std::ceil(low / interval);
  const int levels = static_cast<int>(std::min(1e6, std::floor(high / interval) - first + 1.0));
  std::vector<LevelTracer> tracers;
  for (int i = 0; i < levels; ++i) {
    tracers.emplace_back(lattice, (first + i) * interval);
  }
  for (int row = 0; row + 1 < lattice.rows; ++row) {
    for (int column = 0; column + 1 < lattice.columns; ++column) {
      const double corner[4] = {lattice.at(row, column), lattice.at(row, column + 1),
                                lattice.at(row + 1, column + 1), lattice.at(row + 1, column)};
      const double smallest = std::min({corner[0], corner[1], corner[2], corner[3]});
      const double largest = std::max({corner[0], corner[1], corner[2], corner[3]});
      if (std::isnan(corner[0]) || std::isnan(corner[1]) || std::isnan(corner[2]) ||
          std::isnan(corner[3])) {
        continue;
      }
      const int from = static_cast<int>(std::max(0.0, std::ceil(smallest / interval) - first));
      const int to =
          static_cast<int>(std::min(levels - 1.0, std::floor(largest / interval) - first));
      for (int i = from; i <= to; ++i) {
        tracers[static_cast<std::size_t>(i)].add_square(row, column);
      }
    }
  }
  for (LevelTracer& tracer : tracers) {
    tracer.join(&result);
  }
  return result;
}

}  // namespace leadline::host::render
