#!/usr/bin/env bash
# Replays logs on a target, emulated where this machine is none of the kind: the same log has the same hashes on all.
#
# usage: toolchain/replay-on.sh TARGET LOG...
#   native      the release build
#   clang       clang 14, -O3
#   aarch64     64-bit ARM Linux, under QEMU
#   armhf       32-bit ARM Linux, under QEMU
#   cortex-m7   the firmware without an operating system on QEMU's board MPS2 AN500 (toolchain/m7.sh)
#   gcc-O0, gcc-O3-native, scalar, clang-O0
#               other builds for this machine: not optimized; with all that its processor has, fused
#               multiply-adds included; no vector instructions
#
# Prints a line for each log, and nothing else:
#   map_hash=0x... link_hash=0x... cells_hash=0x... same_as_flight=true|false|unknown
# link_hash is over all bytes of the downlink. On cortex-m7 more fields follow (instructions_total=...).
# Installs and builds what it needs; that is silent unless it fails, all messages go to standard error.
# Exit code as leadline-replay: 0 done, 2 usage, 3 a log cannot be read or replayed, 5 the flight ended with
# another result; 1 when the target cannot be built.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

case ${1:-} in
  -h | --help)
    print_help
    exit 0
    ;;
esac
[ $# -ge 2 ] || usage_error "a target and a log are needed"
target=$1
shift
for log in "$@"; do
  [ -r "$log" ] || {
    warn "cannot read $log"
    exit 3
  }
done

setup=()
runner=()
case $target in
  native) preset=release ;;
  clang | clang-O0) preset=replay-$target setup=(--clang) ;;
  gcc-O0 | gcc-O3-native | scalar) preset=replay-$target ;;
  aarch64) preset=replay-$target setup=(--cross) runner=(qemu-aarch64-static) ;;
  armhf) preset=replay-$target setup=(--cross) runner=(qemu-arm-static) ;;
  cortex-m7) preset= ;;
  *) usage_error "unknown target $target" ;;
esac

messages=$(mktemp)
trap 'rm -f "$messages"' EXIT

if [ "$target" = cortex-m7 ]; then
  result=0
  lines=$("$root/toolchain/m7.sh" replay "$@" 2>"$messages") || result=$?
  # The board's other words go with the messages.
  grep '^map_hash=' <<<"$lines" || true
  if [ $result -ne 0 ]; then
    cat "$messages" >&2
  fi
  exit $result
fi

build() {
  "$root/toolchain/setup.sh" "${setup[@]}" && configure_and_build "$preset" leadline-replay
}
# One build at a time in a folder, whoever calls.
mkdir -p "$root/build"
exec 9>"$root/build/.$preset.lock"
flock 9
if ! build >"$messages" 2>&1; then
  cat "$messages" >&2
  die "$target cannot be built"
fi
exec 9>&-

"${runner[@]}" "$root/build/$preset/firmware/leadline-replay" "$@"
