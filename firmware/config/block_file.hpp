// The configuration block of a vehicle without files (firmware/pipeline/config_block.hpp), from vehicle.toml and its
// tables, and read back to be shown.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/config/vehicle_file.hpp"
#include "firmware/pipeline/config_block.hpp"
#include "model/localization_table.hpp"

namespace leadline::host {

/// The block: what the vehicle's own reader takes, checked by it before it is returned. Lines get the baud of
/// their serial: or modbus-rtu: uri, others 0 (the board's own). `session` goes into every frame's tag: the
/// vehicle without a clock has no other. Throws HostError kUsage, `name` in front: a tide_file (it needs
/// the day's clock), a period out of range.
[[nodiscard]] std::string compile_block(const VehicleFile& file,
                                        const std::vector<model::LocalizationTable>& tables,
                                        std::uint32_t session, const std::string& name);

/// A block's bytes, and what is in them; the tables of `block` lie in `storage`.
struct BlockFile {
  std::vector<std::uint64_t> storage;  ///< aligned as read_config_block() wants it
  std::size_t size_bytes = 0;
  firmware::ConfigBlock block{};
};

/// Whether the bytes begin as a block does.
[[nodiscard]] bool is_block(std::string_view bytes);
/// Throws HostError kInput, `name` in front: what is wrong with it.
[[nodiscard]] BlockFile parse_block(std::string_view bytes, const std::string& name);
/// As text, or as one JSON object: everything that the block says.
[[nodiscard]] std::string block_to_text(const BlockFile& file);
[[nodiscard]] std::string block_to_json(const BlockFile& file);

}  // namespace leadline::host
