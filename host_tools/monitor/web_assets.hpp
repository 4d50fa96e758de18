// The page's files, built into the program (toolchain/embed_files.py): nothing is read from a disk at run time,
// and no path of a request ever becomes a path of this machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace leadline::host {

struct WebAsset {
  const char* path;  ///< as requested, "/index.html"
  const char* content_type;
  const std::uint8_t* gzip;  ///< compressed
  std::size_t gzip_bytes;
};

/// Null: there is no such file.
[[nodiscard]] const WebAsset* find_web_asset(std::string_view path);

}  // namespace leadline::host
