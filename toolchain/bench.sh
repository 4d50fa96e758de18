#!/usr/bin/env bash
# Builds the benches (tests/bench/*.cpp) and prints their tables.
#
# usage: toolchain/bench.sh [--core N] [--list] [NAME...] [-- OPTION...]
#   --core N    run on this core only (default: the last one, which interrupts like least)
#   --list      only tell the names
#   --aarch64   instead: instructions of the inner loops on aarch64, scalar and vector form (QEMU counts them; no times)
#   NAME...     only these (default: all)
#   OPTION...   handed to every bench, e.g. --benchmark_filter=REGEX
#
# Each table is also left in out/bench/NAME.txt, what Google Benchmark measured in out/bench/NAME.json.
# Times are worth what the machine's quiet is: close other programs, and compare within one run only.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

core=$(($(nproc) - 1))
list=0
aarch64=0
parse_options 'core=number list aarch64 NAME... --' "$@"
names=("${operands[@]}")

# Of a call: the difference of two runs. QEMU writes a line for every instruction.
count_aarch64() {
  "$root/toolchain/setup.sh" --cross
  local program="$root/out/bench/kernel_loop" run form counts few=100 many=300
  mkdir -p "$root/out/bench"
  (cd "$root" && aarch64-linux-gnu-g++ -std=c++17 -O3 -DNDEBUG -ffp-contract=off -static -I. \
    tests/tools/kernel_loop.cpp model/column_kernels.cpp -o "$program")
  lines() { qemu-aarch64-static -singlestep -d exec,nochain -D /dev/stdout "$program" "$@" | grep -c '^Trace'; }
  for run in "shell 3" "shell 7" "shell 14" "empty 4" "empty 24" "empty 200"; do
    counts=()
    for form in scalar vector; do
      counts+=($(($(lines ${run% *} $form ${run#* } $many) - $(lines ${run% *} $form ${run#* } $few))))
    done
    awk -v run="$run" -v s="${counts[0]}" -v v="${counts[1]}" -v n=$((many - few)) \
      'BEGIN {printf "%s voxels: scalar %.0f instructions, vector %.0f, ratio %.1f\n", run, s / n, v / n, s / v}'
  done
}
if [ "$aarch64" -eq 1 ]; then
  count_aarch64
  exit 0
fi

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
    --benchmark_out="$out/$name.json" --benchmark_out_format=json "${rest[@]}" |
    tee "$out/$name.txt"; then
    failed+=("$name")
  fi
done
[ ${#failed[@]} -eq 0 ] || die "failed: ${failed[*]}"
