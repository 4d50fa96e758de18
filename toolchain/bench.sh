#!/usr/bin/env bash
# Builds the benches (tests/bench/*.cpp) and prints their tables.
#
# usage: toolchain/bench.sh [--core N] [--list] [NAME...] [-- OPTION...]
#   --core N    run on this core only (default: the last one, which interrupts like least)
#   --list      only tell the names
#   NAME...     only these (default: all)
#   OPTION...   handed to every bench, e.g. --benchmark_filter=REGEX
#
# Each table is also left in out/bench/NAME.txt, what Google Benchmark measured in out/bench/NAME.json.
# Times are worth what the machine's quiet is: close other programs, and compare within one run only.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

core=$(($(nproc) - 1))
list=0
names=()
options=()
while [ $# -gt 0 ]; do
  case $1 in
    --core)
      [ $# -ge 2 ] || usage_error "--core wants a number"
      core=$2
      shift
      ;;
    --list) list=1 ;;
    --)
      shift
      options=("$@")
      break
      ;;
    -h | --help)
      print_help
      exit 0
      ;;
    -*) usage_error "unknown option $1" ;;
    *) names+=("$1") ;;
  esac
  shift
done

if [ ${#names[@]} -eq 0 ]; then
  mapfile -t names < <(stems "$root/tests/bench" '*.cpp')
fi
[ ${#names[@]} -gt 0 ] || die "no benches in tests/bench"
if [ "$list" -eq 1 ]; then
  printf '%s\n' "${names[@]}"
  exit 0
fi

"$root/toolchain/setup.sh"
configure_and_build release "${names[@]/#/bench.}"

out="$root/out/bench"
mkdir -p "$out"
machine() {
  sed -n 's/^model name[^:]*: */cpu       /p' /proc/cpuinfo | head -n 1
  echo "cores     $(nproc), benches on core $core"
  echo "load      $(cut -d' ' -f1-3 /proc/loadavg) before"
  echo "compiler  $(sed -n 's/^CMAKE_CXX_COMPILER:[^=]*=//p' "$root/build/release/CMakeCache.txt" |
    xargs -I{} sh -c '{} --version | head -n 1')"
  local commit=none
  if commit=$(git -C "$root" rev-parse --short HEAD 2>/dev/null); then
    git -C "$root" diff --quiet HEAD || commit+=" with changes"
  fi
  echo "commit    ${commit:-none}"
}
machine | tee "$out/machine.txt"

failed=()
for name in "${names[@]}"; do
  say "bench $name"
  if ! taskset -c "$core" "$root/build/release/tests/bench.$name" \
    --benchmark_out="$out/$name.json" --benchmark_out_format=json "${options[@]}" |
    tee "$out/$name.txt"; then
    failed+=("$name")
  fi
done
[ ${#failed[@]} -eq 0 ] || die "failed: ${failed[*]}"
