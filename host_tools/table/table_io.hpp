// Localization tables as files (`.llt`: the block's bytes and nothing else) and as text.
#pragma once

#include <string>
#include <string_view>

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
/// Reads and checks a block. Throws HostError kInput: what is wrong with it and what to do.
[[nodiscard]] model::LocalizationTable load_table(const std::string& path);
/// The same over bytes; `name` stands for the file in messages.
[[nodiscard]] model::LocalizationTable parse_table(std::string_view bytes, const std::string& name);

}  // namespace leadline::host
