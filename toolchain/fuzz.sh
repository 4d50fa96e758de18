#!/usr/bin/env bash
# Runs every libFuzzer target (tests/fuzz/fuzz_*.cpp) for a while, with ASan and UBSan.
#
# usage: toolchain/fuzz.sh [--seconds N | --total N | --inputs N] [--seed N] [TARGET...]
#   --seconds N   per target (default 60)
#   --total N     seconds for all of them together, at least 1 each
#   --inputs N    so many inputs per target, however long that takes; what one has had in all such runs is kept in
#                 out/fuzz/TARGET/inputs and said beside the billion that is asked for. The seed counts on by itself
#   --seed N      of libFuzzer (default 1; the same seed gives the same inputs)
#   --reached     runs nothing: the table of what each target has had by --inputs, of a billion
#   TARGET...     only these (default: all)
#
# Starts from tests/fuzz/corpus/TARGET/. A failing input is left in out/fuzz/TARGET/; put it into that
# corpus folder with the fix: the normal tests run every file of it from then on.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

seconds=60
total=
inputs=
seed=
reached=0
goal=1000000000
parse_options 'seconds=number total=number inputs=number seed=number reached TARGET...' "$@"
targets=("${operands[@]}")
if [ $reached -eq 1 ]; then
  echo "| target | inputs | of a billion |"
  echo "|---|---|---|"
  for kept in "$root"/out/fuzz/*/inputs; do
    [ ! -f "$kept" ] || awk -v t="$(basename "$(dirname "$kept")")" -v g="$goal" \
      '{printf "| %s | %.3g | %.2g |\n", t, $1, $1 / g}' "$kept"
  done
  exit 0
fi

command -v clang++-14 >/dev/null || die "clang-14 is missing: toolchain/setup.sh --checks"
if [ ${#targets[@]} -eq 0 ]; then
  mapfile -t targets < <(stems "$root/tests/fuzz" 'fuzz_*.cpp')
fi
[ ${#targets[@]} -gt 0 ] || die "no fuzz targets in tests/fuzz"
if [ -n "$total" ]; then
  seconds=$((total / ${#targets[@]}))
  [ "$seconds" -gt 0 ] || seconds=1
fi
[ "$inputs" != 0 ] || usage_error "--inputs wants a whole number from 1"
configure_and_build fuzz "${targets[@]}"

failed=()
for target in "${targets[@]}"; do
  seeds="$root/tests/fuzz/corpus/$target"
  found="$root/out/fuzz/$target"
  mkdir -p "$found/corpus"
  folders=("$found/corpus")
  [ ! -d "$seeds" ] || folders+=("$seeds")
  before=$(cat "$found/inputs" 2>/dev/null || echo 0)
  if [ -n "$inputs" ]; then
    say "fuzz $target, $inputs inputs"
    limits=(-runs="$inputs" -seed="${seed:-$((before / inputs + 1))}")
    patience=()
  else
    say "fuzz $target, $seconds s"
    limits=(-max_total_time="$seconds" -seed="${seed:-1}")
    # libFuzzer ends by itself; the outer limit is for a target that hangs where it cannot look.
    patience=(timeout $((seconds + 120)))
  fi
  if ! "${patience[@]}" "$root/build/fuzz/tests/$target" "${limits[@]}" \
    -timeout=10 -rss_limit_mb=2048 -max_len=65536 -print_final_stats=1 \
    -artifact_prefix="$found/" "${folders[@]}" >"$found/log" 2>&1; then
    tail -n 60 "$found/log"
    failed+=("$target")
  fi
  # A target that stopped looking at once is no test.
  grep -E '^stat::(number_of_executed_units|peak_rss_mb)' "$found/log" || true
  if [ -n "$inputs" ]; then
    done=$((before + $(sed -n 's/^stat::number_of_executed_units: *//p' "$found/log" | tail -1)))
    echo "$done" >"$found/inputs"
    awk -v t="$target" -v n="$done" -v g="$goal" \
      'BEGIN {printf "fuzz: %s: %.3g inputs in all, %.2g of %.0g\n", t, n, n / g, g}'
  fi
done
[ ${#failed[@]} -eq 0 ] || die "failed: ${failed[*]} (inputs in out/fuzz/)"
echo "fuzz: ${#targets[@]} targets, nothing found"
