#!/usr/bin/env bash
# Runs the long trials and reports what was reached.
#
# usage: toolchain/soak.sh [--minutes N] [--work-bound-pings N]
#        toolchain/soak.sh --targets N [--from FIRST]
#        toolchain/soak.sh --sensors|--transports [--minutes N]
#   --minutes N            in all (default 60): a quarter each for fuzzing, for mapping and for the search
#                          for the worst ping; the tests labelled full take what they take
#   --work-bound-pings N   pings per configuration of that search (default: what a quarter of the time
#                          allows, 7,500 per minute; a billion in all is 32,000,000)
#   --targets N            only this: N random flights replayed on every target (toolchain/replay-on.sh):
#                          the same hashes. In batches of 500, each told when it is done; --from goes on behind FIRST of them
#   --sensors              only this, for N minutes (default 10): all emulated devices at ten times their
#                          rate, lines that break at random. In = fused + shed + rejected, to the byte and
#                          the record; no growth in memory or descriptors
#   --transports           the same in real time, with every device a program of its own behind a real pty, socket or
#                          Modbus line, killed and started again at random: three vehicles side by side
#
#   tests     those labelled full, release build
#   fuzzing   every fuzz target in turn
#   bound     pings that touch as many voxels as they can, over all named configurations: none may exceed
#             the work bound, each has to reach 0.9 of it
#   mapping   the demo survey over and over: each run must give the first run's map_hash and counts, and
#             peak memory must not grow
#
# Leaves logs in out/soak/. Exit code 0: everything held; the table at the end says for how long.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

minutes=
work_bound_pings=
sensors=0
transports=0
targets=0
from=0
parse_options 'minutes=number work-bound-pings=number sensors transports targets=number from=number' "$@"

if [ "$targets" -gt 0 ]; then
  "$root/toolchain/setup.sh" --clang --cross --m7
  configure_and_build release property.random_logs
  # In batches: their logs are 75 MB at a time.
  batch=500
  for ((first = from; first < targets; first += batch)); do
    left=$((targets - first))
    LEADLINE_ROOT=$root LEADLINE_BUILD=$root/build/release LEADLINE_SAME_BITS_SEED=$((20270000 + first)) \
      LEADLINE_SAME_BITS_COUNT=$((left < batch ? left : batch)) python3 "$root/tests/cli/test_same_bits_ci.py" |
      grep -v '^  [a-z0-9]* *[0-9]* ports \|^\['
    echo "soak: random logs up to $((left < batch ? targets : first + batch)) of $targets are the same everywhere"
  done
  echo "soak: $targets random logs, the same on every target"
  exit 0
fi

if [ -z "$minutes" ]; then
  minutes=60
  [ $sensors$transports = 00 ] || minutes=10
fi
[ "$minutes" -gt 0 ] || usage_error "--minutes wants a whole number from 1"
bound_pings=${work_bound_pings:-$((minutes * 7500))}
[ "$bound_pings" -gt 0 ] || usage_error "--work-bound-pings wants a whole number from 1"

out="$root/out/soak"
rm -rf "$out"
mkdir -p "$out"
leadline="$root/build/release/host_tools/leadline"

fuzz_all() {
  local count
  count=$(stems "$root/tests/fuzz" 'fuzz_*.cpp' | wc -l)
  local each=$((minutes * 15 / (count > 0 ? count : 1)))
  "$root/toolchain/fuzz.sh" --seconds $((each > 0 ? each : 1))
}

search_worst_ping() {
  LEADLINE_WORK_BOUND_PINGS=$bound_pings "$root/build/release/tests/property.work_bound_ci" 2>&1 |
    tee "$out/work_bound.txt"
}

sensors_at_ten_times_their_rate() {
  LEADLINE_SENSOR_SOAK_S=$((minutes * 60)) "$root/build/release/tests/property.faults_soak_ci" 2>&1 |
    tee "$out/sensors.txt"
}

overload() {
  LEADLINE_OVERLOAD_S=600 "$root/build/release/tests/property.overload" 2>&1 | tee "$out/overload.txt"
}

vehicles_on_real_lines() {
  LEADLINE=$leadline LEADLINE_VEHICLE=$root/build/release/firmware/leadline-vehicle \
    LEADLINE_TRANSPORT_SOAK_S=$((minutes * 60)) \
    python3 "$root/tests/cli/test_transport_soak_ci.py" 2>&1 | tee "$out/transports.txt"
}

map_again_and_again() {
  "$leadline" scene --out "$out/survey" || return 1
  python3 - "$leadline" "$out" $((minutes * 15)) <<'PYTHON'
import json, os, subprocess, sys, time

leadline, out, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3])
# What must not differ from run to run; times may.
SAME = ("map_hash", "pings", "rejected", "voxel_updates", "max_voxels_per_ping", "table_crc")
end = time.monotonic() + seconds
first, runs, pings, first_peak, peak = None, 0, 0, 0, 0
while runs == 0 or time.monotonic() < end:
    child = subprocess.Popen([leadline, "map", "--pings", f"{out}/survey/pings.csv", "--config",
                              f"{out}/survey/map.toml", "--out", f"{out}/map"],
                             stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    if status != 0:
        sys.exit(f"soak: run {runs + 1} ended with status {status}")
    with open(f"{out}/map/stats.json", encoding="utf-8") as stream:
        stats = json.load(stream)
    result = {key: stats.get(key) for key in SAME}
    first = first or result
    if result != first:
        sys.exit(f"soak: run {runs + 1} gave {result}, the first one {first}")
    runs += 1
    pings += stats["pings"]
    first_peak = first_peak or usage.ru_maxrss
    peak = max(peak, usage.ru_maxrss)
    # Each run is a process of its own: growth would mean that it depends on what the last one left.
    if peak > 1.1 * first_peak:
        sys.exit(f"soak: peak memory grew from {first_peak} to {peak} KiB")
print(f"mapping: {runs} runs, {pings} pings, map_hash {first['map_hash']} each time, "
      f"peak {peak / 1024:.0f} MiB")
PYTHON
}

"$root/toolchain/setup.sh" --checks
if [ $sensors -eq 1 ]; then
  step "build release" configure_and_build release property.faults_soak_ci || { step_summary; exit 1; }
  step "sensors, $minutes min" sensors_at_ten_times_their_rate || true
  grep -h '^reached\|vehicles. time; memory' "$out/sensors.txt" | tail -1 | sed 's/^/sensors: /' || true
  step_summary
  exit
fi
if [ $transports -eq 1 ]; then
  step "build release" configure_and_build release leadline leadline-vehicle || { step_summary; exit 1; }
  step "transports, $minutes min" vehicles_on_real_lines || true
  step_summary
  exit
fi
step "build release" configure_and_build release || { step_summary; exit 1; }
step "tests labelled full" run_ctest release -L '^full$' || true
step "fuzzing, $minutes/4 min" fuzz_all || true
step "work bound, $bound_pings pings each" search_worst_ping || true
step "ten minutes at ten times the rated pings" overload || true
step "mapping, $minutes/4 min" map_again_and_again || true
for target in $(stems "$root/tests/fuzz" 'fuzz_*.cpp'); do
  grep -h '^stat::number_of_executed_units' "$root/out/fuzz/$target/log" 2>/dev/null || true
done | awk '{n += $2} END {print "fuzzing: " NR " targets, " n " inputs"}'
grep -h 'configurations, .* pings\|above$' "$out/work_bound.txt" 2>/dev/null | sed 's/^/work bound: /' || true
grep -h '^overload' "$out/overload.txt" 2>/dev/null || true
step_summary
