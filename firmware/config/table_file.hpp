// Reading localization tables (`.llt`: the block's bytes and nothing else).
#pragma once

#include <string>
#include <string_view>

#include "model/localization_table.hpp"

namespace leadline::host {

/// Reads and checks a block. Throws HostError kInput: what is wrong with it and what to do.
[[nodiscard]] model::LocalizationTable load_table(const std::string& path);
/// The same over bytes; `name` stands for the file in messages.
[[nodiscard]] model::LocalizationTable parse_table(std::string_view bytes, const std::string& name);

}  // namespace leadline::host
