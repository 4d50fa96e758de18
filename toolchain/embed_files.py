#!/usr/bin/env python3
"""Writes a C++ file that holds the files of the monitor's page, compressed: what find_web_asset() finds.

usage: embed_files.py OUT.cpp URL_PATH=FILE ...

Same files, same bytes (with one zlib). Called by the build (host_tools/CMakeLists.txt).
"""

import gzip
import pathlib
import sys

CONTENT_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
}


def main():
    out = pathlib.Path(sys.argv[1])
    lines = [
        "// Made by toolchain/embed_files.py: do not edit.",
        '#include "host_tools/monitor/web_assets.hpp"',
        "",
        "namespace leadline::host {",
        "namespace {",
        "",
    ]
    entries = []
    for number, argument in enumerate(sys.argv[2:]):
        url, path = argument.split("=", 1)
        suffix = pathlib.PurePosixPath(url).suffix
        data = gzip.compress(pathlib.Path(path).read_bytes(), compresslevel=9, mtime=0)
        rows = [",".join(map(str, data[i:i + 64])) for i in range(0, len(data), 64)]
        lines.append(f"constexpr std::uint8_t kFile{number}[] = {{" + ",\n".join(rows) + "};")
        entries.append(f'    {{"{url}", "{CONTENT_TYPES[suffix]}", kFile{number}, '
                       f"sizeof kFile{number}}},")
    lines += ["", "constexpr WebAsset kAssets[] = {", *entries, "};", "", "}  // namespace", ""]
    lines += [
        "const WebAsset* find_web_asset(std::string_view path) {",
        "  for (const WebAsset& asset : kAssets) {",
        "    if (path == asset.path) {",
        "      return &asset;",
        "    }",
        "  }",
        "  return nullptr;",
        "}",
        "",
        "}  // namespace leadline::host",
        "",
    ]
    out.write_text("\n".join(lines))


if __name__ == "__main__":
    main()
