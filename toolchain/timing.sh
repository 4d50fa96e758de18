#!/usr/bin/env bash
# What a ping costs a Cortex-M7, in instructions (QEMU's board MPS2 AN500, -icount: exact, and the same in every
# run; never cycles: caches, wait states of external memory and dual issue are not modelled).
#
# usage: toolchain/timing.sh [--check | --search N | --listing | --cycles]
#   (none)      the tables of firmware/README.md, "Timing"
#   --check     only the kept worst pings: exit code 1 when the worst of a head costs over 2 % more than
#               tests/data/worst_pings/ceilings.txt says
#   --search N  looks for worse pings: N of each head on this machine, the worst hundred replayed on the target; and for
#               the dearest columns and cycles of an extraction, on the target
#   --listing   the inner loop as compiled
#   --cycles    only the last of the tables: whole cycles, from the devices' bytes to the link's
#
# Installs and builds what it needs (the compiler is 2.4 GB). Files are left in out/timing/.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

check=0
search=
listing=0
cycles=0
parse_options 'check search=number listing cycles' "$@"
mode=tables
[ $check -eq 0 ] || mode=check
[ $listing -eq 0 ] || mode=listing
[ $cycles -eq 0 ] || mode=cycles
[ -z "$search" ] || mode=search

out="$root/out/timing"
mkdir -p "$out"
heads=(ping1d fan16)
image="$root/build/cortex-m7/firmware/leadline-m7-cost.elf"
searcher="$root/build/release/tests/property.work_bound_ci"

build_image() {
  mkdir -p "$root/build"
  exec 9>"$root/build/.cortex-m7.lock" # as toolchain/m7.sh: two tests may ask at once
  flock 9
  configure_and_build cortex-m7 leadline-m7-cost leadline-m7-extraction leadline-m7-replay >"$out/build.log" 2>&1 || {
    cat "$out/build.log" >&2
    die "cortex-m7 cannot be built"
  }
  exec 9>&-
}
build() {
  "$root/toolchain/setup.sh" --m7
  configure_and_build release "$@"
  build_image
}
# measure NAME: out/timing/NAME.cost on the board, its lines in NAME.txt
measure() {
  local path="$out/$1.cost"
  m7_run "$image" "arg=cost,arg=${path//,/,,}" >"$out/$1.lines" || die "the board failed on $path"
}
# Logs of flights on the board; how much of a second its cycles take. Cycles are of 50 ms.
cycles() {
  local name path
  "$root/build/release/tests/cycle_jobs" "$out" >"$out/cycle_jobs.txt"
  cat "$out/cycle_jobs.txt"
  for name in $(awk '$2 == "seconds" && $1 !~ /-once$/ {print $1}' "$out/cycle_jobs.txt"); do
    path="$out/$name.lll"
    m7_run "$root/build/cortex-m7/firmware/leadline-m7-replay.elf" "arg=replay,arg=${path//,/,,}" >"$out/$name.cycles" ||
      die "the board does not replay $path: $(cat "$out/$name.cycles")"
    tr ' ' '\n' <"$out/$name.cycles" | awk -F = -v name="$name" '{v[$1] = $2} END {
      s = v["cycles"] * 0.05
      printf "whole cycles, %s: %.1f million instructions a second, %.1f %% of 480 million; of these pings %.1f %%; the longest cycle %.1f million\n",
        name, v["instructions_total"] / s / 1e6, v["instructions_total"] / s / 4.8e6, v["instructions_pings"] / s / 4.8e6,
        v["instructions_worst_cycle"] / 1e6}'
  done
}
worst_of() { awk '$1 == "ping" && $4 > worst {worst = $4} END {print worst + 0}' "$out/$1.lines"; }
summary='
$1 == "ping" {++n; sum += $4; voxels += $6; if ($4 > worst) worst = $4; if (least == 0 || $4 < least) least = $4}
END {printf "| %s | %d | %.0f | %d | %.1f | %.1f |\n", name, n, sum / n, worst, voxels / n, sum / voxels}'
kept() {
  local head=$1
  LEADLINE_COST_FOLDER=$out LEADLINE_COST_FROM=$root/tests/data/worst_pings/$head.txt \
    LEADLINE_WORK_BOUND_ONLY=$head "$searcher" >"$out/kept.log" 2>&1 || {
    cat "$out/kept.log"
    die "the kept pings of $head cannot be read"
  }
  measure "$head"
}

case $mode in
  check)
    # Where a test asks, the search is there already.
    [ -x "$searcher" ] || configure_and_build release property.work_bound_ci
    build_image
    failed=0
    for head in "${heads[@]}"; do
      kept "$head"
      ceiling=$(awk -v head="$head" '$1 == head {print $2}' "$root/tests/data/worst_pings/ceilings.txt")
      worst=$(worst_of "$head")
      verdict=holds
      if [ $((worst * 100)) -gt $((ceiling * 102)) ]; then
        verdict="BROKEN: over 2 % more"
        failed=1
      fi
      echo "worst ping of $head: $worst instructions, ceiling $ceiling: $verdict"
    done
    exit $failed
    ;;
  search)
    build property.work_bound_ci
    for head in "${heads[@]}"; do
      LEADLINE_COST_FOLDER=$out LEADLINE_WORK_BOUND_ONLY=$head LEADLINE_WORK_BOUND_PINGS=$((search * 4)) \
        "$searcher" | grep "^$head:" | tee "$out/$head.found"
      cp "$out/$head.txt" "$out/$head.pings"
      measure "$head"
      paste -d ' ' <(cut -d ' ' -f 1 "$out/$head.pings") <(grep '^ping' "$out/$head.lines") |
        awk -v head="$head" '{++n; if ($5 > $1) ++above; if ($5 > worst) worst = $5}
          END {print head ": " n " replayed on the target, worst " worst ", above their own price " above + 0}'
    done
    path="$out/ping1d.cost"
    m7_run "${image/cost.elf/extraction.elf}" "arg=extraction,arg=${path//,/,,}" |
      awk -v bound="$(sed -n 's/.*a pass takes at most \([0-9]*\) .*/\1/p' "$out/ping1d.found")" '
        $1 == "dearest" {printf "%s; of the bound of a cycle %.3f\n", $0, $10 / bound; above += $10 > bound}
        END {exit NR != 3 || above > 0}' || die "a pass cost more than its bound, or the board failed"
    ;;
  listing)
    "$root/toolchain/setup.sh" --m7
    build_image
    arm-none-eabi-objdump -d --no-show-raw-insn "$image" |
      awk '/^[0-9a-f]+ <.*empty_loop/ {on = 1} on && /^$/ {exit} on'
    ;;
  cycles)
    build cycle_jobs
    cycles
    ;;
  tables)
    build cost_jobs cycle_jobs property.work_bound_ci
    "$root/build/release/tests/cost_jobs" "$out" >"$out/hashes.txt"
    echo "| pings | number | instructions a ping | largest observed | voxels a ping | instructions a voxel |"
    echo "|---|---|---|---|---|---|"
    for name in job fan16 wide ping1d; do
      measure "$name"
      grep -q "^$name $(grep '^map_hash' "$out/$name.lines")\$" "$out/hashes.txt" ||
        die "the map of $name differs from this machine's"
      awk -v name="$name" "$summary" "$out/$name.lines"
    done
    mkdir -p "$out/flights"
    mv "$out"/*.lines "$out/flights/"
    for head in "${heads[@]}"; do
      kept "$head"
      awk -v name="worst found, $head" "$summary" "$out/$head.lines"
    done
    awk '$1 == "loop" {printf "loop over %s runs: %.2f instructions a voxel, minimal %.2f, ratio %.2f\n", $2, $4 / $8, $6 / $8, $4 / $6}
      $1 == "extract" {printf "extraction: a column %s: %.0f instructions\n", $2, $4 / $6}
      $1 == "deltas" {printf "deltas: %.0f instructions a byte, %.0f a cell\n", $3 / $5, $3 / $7}' "$out/flights/job.lines"
    load() {
      awk -v what="$2" -v rate="$3" '$1 == "ping" {++n; sum += $4}
        END {printf "%s: %.1f %% of 480 million a second\n", what, sum / n * rate / 4.8e6}' "$out/flights/$1.lines"
    }
    load ping1d "a Ping1D at 20 Hz" 20
    load fan16 "16 beams at 10 Hz" 160
    cycles
    ;;
esac
