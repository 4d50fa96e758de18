#!/usr/bin/env bash
# Replays logs on a target, emulated where this machine is none of the kind: the same log has the same hashes on all.
#
# usage: toolchain/replay-on.sh TARGET LOG...
#        toolchain/replay-on.sh --all LOG...
#   native      the release build
#   clang       clang 14, -O3
#   aarch64     64-bit ARM Linux, under QEMU
#   armhf       32-bit ARM Linux, under QEMU: a Cortex-A7 (NEON, fused multiply-adds, a divide instruction)
#   cortex-m7   the firmware without an operating system on QEMU's board MPS2 AN500 (toolchain/m7.sh)
#   gcc-O0, gcc-O3-native, scalar, clang-O0
#               other builds for this machine: not optimized; with all that its processor has, fused
#               multiply-adds included; no vector instructions
#   armhf-v7a   as Debian's armhf and our package: no NEON, no divide instruction; twice the time of armhf
#   --all       every target above in turn, each line headed by its target and the seconds of CPU that it took (builds not
#               counted)
#
# Prints a line for each log, and nothing else:
#   map_hash=0x... link_hash=0x... cells_hash=0x... same_as_flight=true|false|unknown
# link_hash is over all bytes of the downlink. On cortex-m7 more fields follow (instructions_total=...).
# Installs and builds what it needs; that is silent unless it fails, all messages go to standard error.
# Exit code as leadline-replay: 0 done, 2 usage, 3 a log cannot be read or replayed, 5 the flight ended with
# another result, or (--all) a target has another than native; 1 when the target cannot be built.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

all=0
parse_options 'all TARGET LOG...' "$@"
set -- "${operands[@]}"
target=--all
if [ $all -eq 0 ]; then
  [ $# -ge 2 ] || usage_error "a target and a log are needed"
  target=$1
  shift
fi
[ $# -ge 1 ] || usage_error "a log is needed"
for log in "$@"; do
  [ -r "$log" ] && [ ! -d "$log" ] || {
    warn "cannot read $log"
    exit 3
  }
done

messages=$(mktemp)
trap 'rm -f "$messages"' EXIT

# build SETUP_OPTION PRESET: one at a time in a folder, whoever calls.
build() {
  mkdir -p "$root/build"
  exec 9>"$root/build/.$2.lock"
  flock 9
  # shellcheck disable=SC2086 # an option or none
  if ! { "$root/toolchain/setup.sh" $1 && configure_and_build "$2" leadline-replay; } >"$messages" 2>&1; then
    cat "$messages" >&2
    die "$target cannot be built"
  fi
  exec 9>&-
}

# make_player TARGET: builds it; the array `player` plays logs there.
make_player() {
  local preset=replay-$1 setup=
  player=()
  case $1 in
    native) preset=release ;;
    clang | clang-O0) setup=--clang ;;
    gcc-O0 | gcc-O3-native | scalar) ;;
    aarch64) setup=--cross player=(qemu-aarch64-static) ;;
    armhf | armhf-v7a) setup=--cross player=(qemu-arm-static) ;;
    cortex-m7)
      "$root/toolchain/m7.sh" build leadline-m7-replay
      player=("$root/toolchain/m7.sh" replay)
      return
      ;;
    *) usage_error "unknown target $1" ;;
  esac
  build "$setup" "$preset"
  player+=("$root/build/$preset/firmware/leadline-replay")
}

if [ "$target" != --all ]; then
  make_player "$target"
  "${player[@]}" "$@"
  exit
fi

# What all must have in common.
hashes_of() { sed 's/\( cells_hash=0x[0-9a-f]*\) .*/\1/' <<<"$1"; }
TIMEFORMAT='%U %S'
worst=0
first=
for target in native gcc-O0 gcc-O3-native scalar clang clang-O0 aarch64 armhf armhf-v7a cortex-m7; do
  make_player "$target"
  result=0
  { time lines=$("${player[@]}" "$@" 2>&3) || result=$?; } 3>&2 2>"$messages"
  cpu_s=$(awk '{ printf "%.0f", $1 + $2 }' "$messages")
  while IFS= read -r line; do
    printf '%-13s %4s s  %s\n' "$target" "$cpu_s" "$line"
  done <<<"$lines"
  [ "$result" -le "$worst" ] || worst=$result
  # What cannot be read here cannot be read anywhere.
  [ "$target" != native ] || [ "$result" -ne 3 ] || exit 3
  first=${first:-$(hashes_of "$lines")}
  if [ "$(hashes_of "$lines")" != "$first" ]; then
    warn "$target has another result than native"
    [ "$worst" -ge 5 ] || worst=5
  fi
done
exit "$worst"
