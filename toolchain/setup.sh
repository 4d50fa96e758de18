#!/usr/bin/env bash
# Installs what is missing from Debian 12 to build, run and test Leadline.
#
# usage: toolchain/setup.sh [--checks] [--full] [--clang] [--cross] [--m7] [--packages] [--dry-run]
#   --checks    also what the ci and full tiers need: clang 14 tools and gcovr
#   --full      also what only the full tier needs: PCL, which reads our point clouds (300 MB), and copc, which reads LAS
#   --clang     also clang 14, the compiler alone
#   --cross     also compilers for ARM Linux (aarch64, armhf), and QEMU to run what they make
#   --m7        also what toolchain/m7.sh needs: the compiler for bare metal, 2.4 GB, and QEMU
#   --packages  also what toolchain/package.sh --try needs
#   --dry-run   only tell what is missing; exit code 1 when something is
#
# Does nothing, and needs no rights, when nothing is missing; otherwise it needs root or sudo. Never
# installs cross compilers unless asked to. Afterwards:
#   cmake --preset release && cmake --build --preset release
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

# Compiler and build; libraries of host_tools; the demo's font; of the ports; tests; benches.
wanted=(
  g++ cmake ninja-build pkg-config python3
  libcli11-dev libtomlplusplus-dev nlohmann-json3-dev libgdal-dev libcairo2-dev libfontconfig-dev libsqlite3-dev
  libsodium-dev
  libboost-dev libjs-three
  fonts-dejavu-core
  libmodbus-dev libgpiod-dev libsystemd-dev
  libcmocka-dev
  libeigen3-dev
  libbenchmark-dev liboctomap-dev libzstd-dev
)
# libclang-rt: the sanitizer and fuzzer libraries, which clang only recommends. llvm: readable reports.
# user-mode-linux, kmod, iproute2: a kernel with CAN as a plain process (tests/cli/test_kernel_buses_ci.sh).
# frama-c-base, why3, z3: toolchain/prove.sh. strace: tests/cli/test_timing_ci.py. chromium: the monitor's page in a
# browser (tests/browser), as are node and, from the npm registry, playwright-core. tshark: cli.wireshark.
# With --full also copc, from there, which reads LAS (tests/cli/test_export_readers_full.py).
check_packages=(
  clang-14 clang-format-14 clang-tidy-14 libclang-rt-14-dev llvm-14 gcovr
  user-mode-linux kmod iproute2 dpkg-dev
  frama-c-base why3 z3 strace tshark
  chromium
)
# Where they are not there in another packaging.
command -v node >/dev/null || check_packages+=(nodejs)
command -v npm >/dev/null || check_packages+=(npm)
full_packages=(pcl-tools)
m7_packages=(
  gcc-arm-none-eabi libstdc++-arm-none-eabi-newlib libnewlib-arm-none-eabi qemu-system-arm
)
# The targets' libraries are unpacked beside the build (toolchain/sysroot.sh), not installed.
cross_packages=(g++-aarch64-linux-gnu g++-arm-linux-gnueabihf qemu-user-static debian-archive-keyring)

checks=0
full=0
clang=0
cross=0
m7=0
packages=0
dry_run=0
parse_options 'checks full clang cross m7 packages dry-run' "$@"
[ $checks -eq 0 ] || wanted+=("${check_packages[@]}")
[ $full -eq 0 ] || wanted+=("${full_packages[@]}")
[ $clang -eq 0 ] || wanted+=(clang-14)
[ $cross -eq 0 ] || wanted+=("${cross_packages[@]}")
[ $m7 -eq 0 ] || wanted+=("${m7_packages[@]}")
[ $packages -eq 0 ] || wanted+=(dpkg-dev debootstrap systemd-container)

# What a test needs of the npm registry, as its lock file says; the test is skipped without.
install_node_modules() {
  local from="$root/$1" folder="$root/build/$2"
  if cmp -s "$from/package-lock.json" "$folder/package-lock.json"; then
    return 0
  fi
  mkdir -p "$folder"
  cp "$from/package.json" "$folder"
  (cd "$folder" && cp "$from/package-lock.json" npm-shrinkwrap.json &&
    npm ci --ignore-scripts --no-audit --no-fund >npm.log 2>&1 &&
    mv npm-shrinkwrap.json package-lock.json) ||
    warn "what $1 needs could not be installed (build/$2/npm.log): its test will be skipped"
}
install_all_node_modules() {
  [ $checks -eq 0 ] || install_node_modules tests/browser browser
  [ $full -eq 0 ] || install_node_modules tests/cli/support/las_reader las_reader
}

if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
  die "this is no Debian: install by other means what corresponds to: ${wanted[*]}"
fi

missing=()
for package in "${wanted[@]}"; do
  # One line per architecture that dpkg has heard of.
  if ! dpkg-query --show --showformat='${db:Status-Status}\n' "$package" 2>/dev/null |
    grep -qx installed; then
    missing+=("$package")
  fi
done

if [ ${#missing[@]} -eq 0 ]; then
  [ $dry_run -eq 1 ] || install_all_node_modules
  echo "setup: nothing is missing"
  exit 0
fi
echo "setup: missing: ${missing[*]}"
[ $dry_run -eq 0 ] || exit 1

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || die "run as root, or install sudo, to install: ${missing[*]}"
  as_root=(sudo)
fi
apt_get() {
  # Another apt on the machine is waited for. No recommended packages: libgdal-dev alone would bring
  # hundreds of MB that nothing here uses.
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 \
    -o Acquire::Retries=3 "$@" </dev/null
}
log=$(mktemp)
trap 'rm -f "$log"' EXIT
quietly() {
  if ! "$@" >"$log" 2>&1; then
    cat "$log" >&2
    die "failed: $*"
  fi
}
quietly apt_get update
echo "setup: installing ${#missing[@]} packages and what they need (a few minutes on a fresh machine)"
quietly apt_get install -y --no-install-recommends "${missing[@]}"
install_all_node_modules
echo "setup: done"
