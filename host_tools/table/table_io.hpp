// Localization tables as files and as text. Reading is the vehicle's as well: table_file.hpp.
#pragma once

#include <string>
#include <string_view>

#include "firmware/config/table_file.hpp"  // IWYU pragma: export
#include "model/localization_table.hpp"

namespace leadline::host {

/// What a table says about itself: beam, envelope, widths, discarded energy, worst errors. Several
/// lines, the last without a newline. The table must have passed check_table.
[[nodiscard]] std::string table_to_text(const model::LocalizationTable& table);
/// The same as one JSON object on one line; angles in degrees, `table_crc` as "0x" and eight
/// digits.
[[nodiscard]] std::string table_to_json(const model::LocalizationTable& table);

/// Writes the block, whole or not at all. Throws HostError kOutput.
void save_table(const std::string& path, const model::LocalizationTable& table);

}  // namespace leadline::host
