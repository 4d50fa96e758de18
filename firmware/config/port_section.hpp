// [[port]] of vehicle.toml: which driver, and the keys that it has.
#pragma once

#include <string>
#include <vector>

#include "firmware/config/entry_list.hpp"
#include "firmware/config/survey_sections.hpp"
#include "firmware/config/toml_reader.hpp"
#include "firmware/pipeline/config.hpp"
#include "hal/linux/uri.hpp"

namespace leadline::host {

struct PortSection {
  firmware::PortConfig config{};
  hal::UriSpec uri;
  bool optional = false;
};

/// What a port refers to.
struct PortContext {
  const std::vector<std::string>& mount_names;
  const SonarRanges& ranges;  ///< default of a head's own
};

/// What a port is that says nothing but its driver and where; a head's ranges stay 0.
[[nodiscard]] firmware::PortConfig default_port(firmware::Driver driver, const hal::UriSpec& uri);
/// Names of PortConfig::variant_plus_1 = 1, 2, ..; none for drivers of one kind of device.
[[nodiscard]] std::vector<std::string> variant_names(firmware::Driver driver);
/// The device measures, or sends what it measured, only when asked.
[[nodiscard]] bool silent_unless_asked(firmware::Driver driver);
/// All keys of all drivers, for KnownTable.
[[nodiscard]] std::vector<std::string> port_keys();
/// Keys that the driver does not have are findings, too.
[[nodiscard]] PortSection read_port(const TomlSection& section, const PortContext& context);
/// The keys of the port's driver, with every value.
void add_port(const PortSection& port, const std::vector<std::string>& mount_names,
              EntryList* list);

/// Key "uri"; false: missing or wrong, and found.
bool read_uri(const TomlSection& section, hal::UriSpec* spec);

}  // namespace leadline::host
