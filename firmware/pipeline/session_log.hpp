// What stands in the log of a session, and in which order (proto/log.hpp): the one writer that the vehicle's
// program, the simulator and whoever else runs a Vehicle share, so that every log replays.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "model/base/status.hpp"
#include "model/base/units.hpp"
#include "proto/log.hpp"

namespace leadline::firmware {

/// Longest chunk that log_cycle() takes; whoever reads ports reads no more at a time.
inline constexpr std::size_t kMaxChunk_bytes = proto::kMaxLogChunk_bytes;

/// Most chunks that one cycle of a log may have (a Linux vehicle's ports fill less); whoever runs a Vehicle
/// and logs it hands it no more at once.
inline constexpr std::size_t kMaxCycleChunks = 1024;

/// A log begins with so many of log_begin(), one behind the other: it replays from these, and no one
/// damaged record takes both.
inline constexpr int kLogPreambleCopies = 2;

/// Header, configuration, tables. `t_us` is the time of the first cycle, `utc_us` the same instant since
/// 1970 (0: not known). kFull: the writer's span is too small, what is in it is then to be thrown away.
/// O(bytes).
[[nodiscard]] base::Status log_begin(proto::LogWriter& writer, const VehicleConfig& config,
                                     const TableBlock* tables, std::size_t table_count,
                                     base::TimeUs t_us, std::int64_t utc_us);

/// One cycle, after it ran: its chunks, its record, the frames that it made. Numbers count from 0.
/// kOutOfRange: a chunk is over kMaxChunk_bytes, or there are more than kMaxCycleChunks. kFull as above.
[[nodiscard]] base::Status log_cycle(proto::LogWriter& writer, std::uint32_t cycle,
                                     const CycleInput& input, const CycleOutput& output);

/// The end of an orderly stop: what a replay is compared with. O(grid).
[[nodiscard]] proto::LogEnd log_end_of(const Vehicle& vehicle, base::TimeUs t_us);

}  // namespace leadline::firmware
