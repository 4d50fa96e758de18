#!/usr/bin/env bash
# Shows the whole chain: sonar heads and sensors on serial lines, the vehicle's program, its link over UDP,
# the topside that draws what arrives, and the recorded flight replayed to the same bits.
#
# usage: toolchain/demo.sh [--live [--speed X]] [--terrain FILE] [--out DIR] [--target native|m7]
#   --live           watch it in a browser: the page is served while the survey is flown, 10 times as fast as real,
#                    and then plays its recording until Ctrl-C
#   --speed X        X times as fast as real instead (with --live)
#   --terrain FILE   survey this raster (anything that GDAL reads) instead of the built-in seafloor
#   --out DIR        where the results go (default out/demo, out/demo-m7)
#   --target m7      the vehicle is the image for a Cortex-M7 on QEMU's board: heads, sensors and link at its
#                    UARTs (the sensors share one: the board has five), the link over TCP; minutes. Its time is
#                    the emulator's as well; pings_per_s is then of QEMU's CPU
#
# Installs what is missing from Debian and builds first. The devices are emulated (leadline emulate) and
# speak their protocols at ptys; leadline-vehicle knows no difference. Time is virtual (lockstep): a
# survey of twelve minutes takes as long as its arithmetic. Leaves in DIR:
#   depth.png uncertainty.png ...   pictures of the received map; difference.png of map minus truth
#   depth.tif depth.asc sigma.asc   the received map as rasters
#   summary.json                    coverage, rmse_m, bias_m, p95_m: received map against the truth, where
#                                   any ray met the ground; pings_per_s: pings mapped per second of the
#                                   vehicle's CPU; bytes_per_changed_cell: of tile deltas, framing
#                                   included; bytes_per_changed_cell_all: of everything on the link;
#                                   topside_equals_vehicle: every cell, by hash; log: the recorded flight,
#                                   relative to the project; target
#   table.txt                       errors of the map, and of the usual griddings of the same pings
#   survey.lll vehicle.toml         the flight's log and configuration
#   topside/ replay/                what `leadline receive` and `leadline replay` wrote
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

out=
target=native
terrain=
live=0
speed=
parse_options 'terrain=file out=folder live speed=decimal target=native|m7' "$@"
# One echo in a hundred is of something short of the ground: fish, or a second path.
mission=(--set outlier_fraction=0.01)
[ -z "$terrain" ] || mission+=(--terrain "$terrain")
[ -z "$speed" ] || [ "$live" -eq 1 ] || usage_error "--speed goes with --live"
pace=()
[ "$live" -eq 0 ] || pace=(--speed "${speed:-10}")
case $target in
  native) link=udp:@127.0.0.1:0 out=${out:-$root/out/demo} ;;
  m7) link=tcp:@127.0.0.1:0 out=${out:-$root/out/demo-m7} mission+=(--set one_nmea_line=true --set extract_interval_s=1.5) ;;
esac
[ "$target" = native ] || [ "$live" -eq 0 ] || usage_error "--live goes with --target native"

"$root/toolchain/setup.sh"
say "building"
configure_and_build release leadline leadline-vehicle
[ "$target" = native ] || "$root/toolchain/m7.sh" build

leadline() { "$root/build/release/host_tools/leadline" "$@"; }
start=$SECONDS
mkdir -p "$out"
rm -f "$out/survey.lll" "$out/summary.json"
# Sockets and ptys have short names wherever the project lies.
scratch=$(mktemp -d "${TMPDIR:-/tmp}/leadline-demo.XXXXXX")
receiver=
vehicle=
finish() {
  for process in $receiver $vehicle; do
    kill "$process" 2>/dev/null || true
  done
  rm -rf "$scratch"
}
trap finish EXIT

topside=(receive)
if [ "$live" -eq 1 ]; then
  # Of the viewer's seconds: the link carries its 200 bytes per second of the flight.
  topside=(monitor --http 127.0.0.1:0 --budget "$(awk -v x="${pace[1]}" 'BEGIN { print 200 * x }')")
fi
if [ "$target" = native ]; then
  say "flying: emulated heads on ptys -> leadline-vehicle -> UDP -> leadline ${topside[0]}"
else
  say "flying: emulated heads on ptys -> UARTs of a Cortex-M7 on QEMU -> TCP -> leadline receive"
fi
"$root/build/release/host_tools/leadline" "${topside[@]}" --link "$link" --out "$out/topside" \
  >"$out/receive.log" 2>&1 &
receiver=$!
port=
for _ in $(seq 100); do
  port=$(sed -n "s/^${topside[0]}: listening at port //p" "$out/receive.log")
  [ -z "$port" ] || break
  sleep 0.05
done
[ -n "$port" ] || die "the receiver did not start: $(cat "$out/receive.log")"
if [ "$live" -eq 1 ]; then
  url=$(sed -n 's/^monitor: the page is at //p' "$out/receive.log")
  say "the page: $url"
  if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ] && command -v xdg-open >/dev/null; then
    xdg-open "$url" >/dev/null 2>&1 || true
  fi
fi

leadline emulate "${mission[@]}" --write-config "$out" --ports "$scratch/ports" \
  --link "${link%%:*}:127.0.0.1:$port"

fly_native() {
  "$root/build/release/firmware/leadline-vehicle" --config "$out/vehicle.toml" \
    --clock "lockstep:$scratch/clock" --json >"$out/vehicle.json"
}

# Configuration and tables as one block in the board's flash; the clock's socket is QEMU's standard input and output.
fly_m7() {
  local lines=() name
  # Lines are there when the emulator is.
  for _ in $(seq 200); do
    [ ! -S "$scratch/clock" ] || break
    sleep 0.05
  done
  for name in $(sed -n 's|^uri = "serial:.*/\([a-z]*\):[0-9]*".*|\1|p' "$out/vehicle.toml"); do
    lines+=(-serial "chardev:$name" -chardev "serial,id=$name,path=$scratch/ports/$name")
  done
  [ ${#lines[@]} -eq 16 ] || die "the board has four lines for devices, vehicle.toml has $((${#lines[@]} / 4))"
  python3 -c 'import os, socket, sys
clock = socket.socket(socket.AF_UNIX)
clock.connect(sys.argv[1])
os.dup2(clock.fileno(), 0)
os.dup2(clock.fileno(), 1)
os.execvp(sys.argv[2], sys.argv[2:])' "$scratch/clock" \
    qemu-system-arm -M mps2-an500 -display none -monitor none -icount shift=7,sleep=off \
    "${lines[@]}" -serial chardev:link -chardev "socket,id=link,host=127.0.0.1,port=$port" \
    -semihosting-config "enable=on,target=native,arg=lockstep,arg=${out//,/,,}" \
    -device "loader,file=$scratch/block.llb,addr=0x3E0000,force-raw=on" \
    -kernel "$root/build/cortex-m7/firmware/leadline-m7-lockstep.elf"
}
[ "$target" = native ] || leadline config compile "$out/vehicle.toml" --out "$scratch/block.llb"

# Times of the vehicle's CPU: the last line of vehicle.err.
TIMEFORMAT='%U %S'
{
  time "fly_$target" 2>"$out/vehicle.log"
} 2>"$scratch/cpu" &
vehicle=$!
leadline emulate "${mission[@]}" --out "$out" --ports "$scratch/ports" \
  --lockstep "$scratch/clock" "${pace[@]}"
wait "$vehicle" || die "the vehicle failed: $(cat "$out/vehicle.log")"
vehicle=
kill -INT "$receiver"
wait "$receiver" || die "the receiver failed: $(cat "$out/receive.log")"
receiver=
tail -n 5 "$out/receive.log"

say "replaying the recorded flight"
leadline replay "$out/survey.lll" --out "$out/replay"

say "pictures"
cp "$out"/topside/{depth.asc,sigma.asc,depth.tif} "$out"
leadline render "$out/topside" --out "$out"
# Voxels stay on the vehicle: these are of the replay.
leadline render "$out/replay" --out "$out/replay"
cp "$out"/replay/{slice_north,slice_east,slice_down,histogram}.png "$out"

say "comparing with the truth"
truth=("$out/truth.asc" --mask "$out/touched.asc")
{
  echo "The map that arrived:"
  leadline compare "$out/depth.asc" "${truth[@]}" --sigma "$out/sigma.asc" \
    --difference-png "$out/difference.png"
  echo
  echo "Griddings of the same pings:"
  leadline grid --pings "$out/replay/pings.csv" --config "$out/replay/map.toml" \
    --truth "$out/truth.asc" --mask "$out/touched.asc"
} | tee "$out/table.txt"

leadline compare "$out/depth.asc" "${truth[@]}" --json >"$scratch/compare.json"
python3 - "$scratch" "$out" "$target" "$(realpath --relative-to="$root" "$out/survey.lll")" <<'PYTHON'
import json, pathlib, sys
scratch, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
compare = json.loads((scratch / "compare.json").read_text())
vehicle = json.loads((out / "vehicle.json").read_text())
topside = json.loads((out / "topside/receive.json").read_text())
replay = json.loads((out / "replay/replay.json").read_text())
cpu_s = sum(float(t) for t in (scratch / "cpu").read_text().split()[-2:])
summary = {
    "coverage": compare["coverage"],
    "rmse_m": compare["rmse_m"],
    "bias_m": compare["bias_m"],
    "p95_m": compare["p95_m"],
    "pings_per_s": round(vehicle["pings_mapped"] / cpu_s, 1),
    "bytes_per_changed_cell": round(topside["bytes_per_changed_cell"], 4),
    "bytes_per_changed_cell_all": round(topside["bytes_per_changed_cell_all"], 4),
    # Three computed it on their own: the vehicle, the topside, the replay.
    "topside_equals_vehicle": topside["cells_hash"] == vehicle["cells_hash"] == replay["cells_hash"],
    "log": sys.argv[4],
    "target": sys.argv[3],
}
text = json.dumps(summary, indent=2)
(out / "summary.json").write_text(text + "\n")
print("\nsummary:", text)
if not summary["topside_equals_vehicle"] or replay["same_as_flight"] is not True:
    sys.exit("demo: topside, vehicle and replay do not agree")
PYTHON

for result in depth.png depth.tif difference.png table.txt summary.json survey.lll; do
  [ -s "$out/$result" ] || die "$result was not made"
done
say "done in $((SECONDS - start)) s; look at"
ls "$out"/*.png "$out"/*.tif "$out/table.txt" "$out/summary.json"
if [ "$live" -eq 1 ] && [ -t 0 ]; then
  say "the page plays the recording now: $url (Ctrl-C ends)"
  leadline monitor --link "file:$out/survey.lll" --http "$(sed "s|^http://||; s|/$||" <<<"$url")" || true
fi
