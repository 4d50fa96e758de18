#!/usr/bin/env bash
# Builds and tests the GPIO port against libgpiod 2, which Debian 12 has in its backports: fetches that package into the
# cache (nothing is installed), builds the test of the kernel's buses with it, and runs it in the user-mode kernel with
# lines (toolchain/user_mode_kernel.sh).
#
# usage: toolchain/gpiod2.sh
#
# Exit code 0: passed; 77: no network, or no user-mode kernel; anything else: failed.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
parse_options '' "$@"

cache=${LEADLINE_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/leadline}/gpiod2
files=$cache/root/usr
if [ ! -f "$files/include/gpiod.h" ]; then
  mkdir -p "$cache/lists/partial" "$cache/archives/partial"
  echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian bookworm-backports main" \
    >"$cache/sources.list"
  options=(-q -o "Dir::Etc::sourcelist=$cache/sources.list" -o Dir::Etc::sourceparts=- -o "Dir::State::lists=$cache/lists"
    -o "Dir::Cache=$cache" -o APT::Sandbox::User=root)
  (cd "$cache" && apt-get "${options[@]}" update &&
    apt-get "${options[@]}" download libgpiod-dev/bookworm-backports libgpiod3/bookworm-backports) || {
    echo "*skipped*: libgpiod 2 cannot be fetched from bookworm-backports"
    exit 77
  }
  for package in "$cache"/libgpiod*.deb; do
    dpkg-deb -x "$package" "$cache/root"
  done
  # Where it lies, not where it would be installed.
  sed -i "s#^prefix=.*#prefix=$files#" "$files"/lib/*/pkgconfig/libgpiod.pc
fi
pc=$(dirname "$(ls "$files"/lib/*/pkgconfig/libgpiod.pc)")
export PKG_CONFIG_PATH=$pc PKG_CONFIG_ALLOW_SYSTEM_CFLAGS=1
build=$root/build/gpiod2
cd "$root"
cmake --preset release -B "$build" --log-level=WARNING
grep -q 'LEADLINE_GPIOD_2:INTERNAL=1' "$build/CMakeCache.txt" || die "libgpiod 2 was not taken"
cmake --build "$build" --target unit.hal_linux.kernel_buses
ldd "$build/tests/unit.hal_linux.kernel_buses" | grep 'libgpiod.so.3' || die "not linked with libgpiod 2"
status=0
LEADLINE_ROOT=$root LEADLINE_BUILD=$build LEADLINE=- LEADLINE_VEHICLE=- \
  bash "$root/tests/cli/test_kernel_buses_ci.sh" || status=$?
exit "$status"
