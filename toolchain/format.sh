#!/usr/bin/env bash
# Formats the C++ sources, or checks that they are formatted (.clang-format, clang-format 14).
#
# usage: toolchain/format.sh [--check]
#   --check   change nothing, list what differs; exit code 1 when anything does
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

check=0
parse_options 'check' "$@"
mode=(-i)
[ $check -eq 0 ] || mode=(--dry-run -Werror --ferror-limit=3)

# Another version formats differently, so no fallback to whatever clang-format there is.
command -v clang-format-14 >/dev/null || die "clang-format-14 is missing: toolchain/setup.sh --checks"
cd "$root"
find firmware hal model estimator proto host_tools tests \( -name '*.hpp' -o -name '*.cpp' \) -print0 |
  xargs -0 -r clang-format-14 "${mode[@]}"
