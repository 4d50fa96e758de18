#!/usr/bin/env bash
# Runs every libFuzzer target (tests/fuzz/fuzz_*.cpp) for a while, with ASan and UBSan.
#
# usage: toolchain/fuzz.sh [--seconds N | --total N] [--seed N] [TARGET...]
#   --seconds N   per target (default 60)
#   --total N     seconds for all of them together, at least 1 each
#   --seed N      of libFuzzer (default 1; the same seed gives the same inputs)
#   TARGET...     only these (default: all)
#
# Starts from tests/fuzz/corpus/TARGET/. A failing input is left in out/fuzz/TARGET/; put it into that
# corpus folder with the fix: the normal tests run every file of it from then on.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

seconds=60
total=
seed=1
targets=()
while [ $# -gt 0 ]; do
  case $1 in
    --seconds | --total | --seed)
      [ $# -ge 2 ] || usage_error "$1 wants a number"
      case $1 in
        --seconds) seconds=$2 ;;
        --total) total=$2 ;;
        --seed) seed=$2 ;;
      esac
      shift
      ;;
    -h | --help)
      print_help
      exit 0
      ;;
    -*) usage_error "unknown option $1" ;;
    *) targets+=("$1") ;;
  esac
  shift
done

command -v clang++-14 >/dev/null || die "clang-14 is missing: toolchain/setup.sh --checks"
if [ ${#targets[@]} -eq 0 ]; then
  mapfile -t targets < <(stems "$root/tests/fuzz" 'fuzz_*.cpp')
fi
[ ${#targets[@]} -gt 0 ] || die "no fuzz targets in tests/fuzz"
if [ -n "$total" ]; then
  seconds=$((total / ${#targets[@]}))
  [ "$seconds" -gt 0 ] || seconds=1
fi
configure_and_build fuzz "${targets[@]}"

failed=()
for target in "${targets[@]}"; do
  seeds="$root/tests/fuzz/corpus/$target"
  found="$root/out/fuzz/$target"
  mkdir -p "$found/corpus"
  folders=("$found/corpus")
  [ ! -d "$seeds" ] || folders+=("$seeds")
  say "fuzz $target, $seconds s"
  # libFuzzer ends by itself; the outer limit is for a target that hangs where it cannot look.
  if ! timeout $((seconds + 120)) "$root/build/fuzz/tests/$target" -max_total_time="$seconds" \
    -seed="$seed" -timeout=10 -rss_limit_mb=2048 -max_len=65536 -print_final_stats=1 \
    -artifact_prefix="$found/" "${folders[@]}" >"$found/log" 2>&1; then
    tail -n 60 "$found/log"
    failed+=("$target")
  fi
  # A target that stopped looking at once is no test.
  grep -E '^stat::(number_of_executed_units|peak_rss_mb)' "$found/log" || true
done
[ ${#failed[@]} -eq 0 ] || die "failed: ${failed[*]} (inputs in out/fuzz/)"
echo "fuzz: ${#targets[@]} targets, nothing found"
