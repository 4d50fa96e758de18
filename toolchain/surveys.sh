#!/usr/bin/env bash
# Maps real surveys from their original files and prints the tables of host_tools/SURVEYS.md: how far
# soundings of a cell lie apart with each sign turned round, how lines agree where they cross, and how well
# a map foretells soundings that it has not seen, beside plain gridding; what the patch test finds; how straight
# the walls of a tank are, and how far apart, in the voxels of a scanning head.
#
# usage: toolchain/surveys.sh [--data DIR] [--out DIR] [--no-build] [r2sonic | caputh | ping360 | river]...
#   --data DIR   the shared data (default: $LEADLINE_DATA, or ../shared/data)
#   --out DIR    where pings, maps and pictures go (default out/surveys)
#   --no-build   take build/release as it is
#
# Exit code 0; 1: a command failed, or a wrong roll sign went unnoticed; 2: usage; 77: no data on this
# machine.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

no_build=0
data=${LEADLINE_DATA:-$root/../shared/data}
out=$root/out/surveys
parse_options 'data=folder out=folder no-build SURVEY...' "$@"
surveys=("${operands[@]}")
for survey in "${surveys[@]}"; do
  [[ $survey =~ ^(r2sonic|caputh|ping360|river)$ ]] || usage_error "unknown survey $survey"
done
[ ${#surveys[@]} -gt 0 ] || surveys=(r2sonic caputh ping360 river)
if [ ! -d "$data" ]; then
  echo "*skipped*: no data at $data"
  exit 77
fi
if [ $no_build -eq 0 ]; then
  "$root/toolchain/setup.sh"
  configure_and_build release leadline
  # Its target is there where the benches' libraries are.
  case " ${surveys[*]} " in *" ping360 "*) configure_and_build release tank_walls ;; esac
fi
leadline=$root/build/release/host_tools/leadline

# foretold PINGS CONFIG TEST NAME: maps and grids PINGS, compares both with the soundings of TEST.
foretold() {
  "$leadline" map --pings "$1" --config "$2" --out "$out/$4.map" > /dev/null
  "$leadline" grid --pings "$1" --config "$2" --out "$out/$4.grid" > /dev/null
  echo "| soundings not seen, against | cells or pairs | median m | robust sigma m | rms m | 95 % m | S-44 |"
  echo "|---|---|---|---|---|---|---|"
  local map
  for map in "$4.map/depth" "$4.grid/mean" "$4.grid/median-1" "$4.grid/gaussian-1"; do
    "$leadline" crosslines "$3" --map "$out/$map.asc" | sed -n "3s#^| [^|]*|#| $map |#p"
  done
  echo
}

# picture NAME TITLE CONTOURS: of the map and of the mean beside it, in one scale.
picture() {
  "$leadline" render "$out/$1.map" --view depth --width 640 --contours "$3" --title "$2" --out "$out/$1.png"
  "$leadline" render "$out/$1.grid/mean.asc" --view depth --width 640 --contours "$3" \
    --title "$2: mean of each cell" --out "$out/$1-mean.png"
}

run_r2sonic() {
  local file=$data/multibeam_r2sonic2026_sfbay/raw/first550pings.xtf
  local config=$root/toolchain/surveys/r2sonic.toml
  if [ ! -f "$file" ]; then
    echo "*skipped*: no $file"
    return
  fi
  echo "## R2Sonic, as recorded"
  "$leadline" survey "$file" --max-angle 57.3 --out "$out/r2sonic-plain.csv"
  echo "## R2Sonic, lever arm found from the soundings"
  "$leadline" survey "$file" --max-angle 57.3 --fit-lever-arm --out "$out/r2sonic.csv"
  echo "## R2Sonic, a wrong roll sign"
  local status=0
  "$leadline" survey "$file" --flip roll --max-angle 57.3 --out "$out/wrong.csv" || status=$?
  if [ "$status" -ne 3 ]; then
    echo "a wrong roll sign went unnoticed (exit status $status)" >&2
    exit 1
  fi
  echo "## R2Sonic, patch test"
  "$leadline" calibrate "$file" --max-angle 57.3
  echo "## R2Sonic, patch test, a wrong roll sign"
  status=0
  "$leadline" calibrate "$file" --flip roll --max-angle 57.3 || status=$?
  if [ "$status" -ne 3 ]; then
    echo "a wrong roll sign went unnoticed by the patch test (exit status $status)" >&2
    exit 1
  fi
  echo "## R2Sonic, every second ping mapped, the others foretold"
  awk -F, -v even="$out/r2sonic-even.csv" -v odd="$out/r2sonic-odd.csv" '
    NR == 1 { print > even; print > odd; next }
    $1 - last > 30000 { ping++ }
    { last = $1; print > (ping % 2 ? odd : even) }' "$out/r2sonic.csv"
  foretold "$out/r2sonic-even.csv" "$config" "$out/r2sonic-odd.csv" r2sonic-half
  "$leadline" map --pings "$out/r2sonic.csv" --config "$config" --out "$out/r2sonic.map"
  "$leadline" grid --pings "$out/r2sonic.csv" --config "$config" --out "$out/r2sonic.grid" > /dev/null
  picture r2sonic "San Francisco Bay, R2Sonic, 0.25 m cells" 0.25
}

run_caputh() {
  local raw=$data/survey_lake_caputh_m9/raw
  local config=$root/toolchain/surveys/caputh.toml
  local place=(--lat 52.342325 --lon 12.998377778 --vertical none --no-check)
  if [ ! -d "$raw" ]; then
    echo "*skipped*: no $raw"
    return
  fi
  echo "## Lake Caputh: do the file's depths want roll and pitch?"
  local files=("$raw"/202501{17,22,23}*.sum)
  local way
  for way in "--level" "" "--flip pitch" "--flip roll"; do
    # shellcheck disable=SC2086 # an option and its value
    printf '%s: ' "${way:-roll and pitch applied}"
    "$leadline" survey "${files[@]}" "${place[@]}" --cell 5 $way | sed -n 's/^ *as given: //p'
  done
  local day
  for day in 0117 0122 0123; do
    "$leadline" survey "$raw"/2025$day*.sum "${place[@]}" --level --out "$out/caputh-$day.csv" > /dev/null
    "$leadline" survey "$raw"/2025$day*.sum "${place[@]}" --level --beam 0 \
      --out "$out/caputh-vertical-$day.csv" > /dev/null
  done
  echo "## Lake Caputh: days against each other, vertical beam, then all five; pairs within 1.5 m"
  (cd "$out" && "$leadline" crosslines caputh-vertical-0117.csv caputh-vertical-0122.csv caputh-vertical-0123.csv --radius 1.5)
  (cd "$out" && "$leadline" crosslines caputh-0117.csv caputh-0122.csv caputh-0123.csv --radius 1.5)
  echo "## Lake Caputh: two days mapped, the third foretold"
  { cat "$out/caputh-0117.csv" && tail -n +2 "$out/caputh-0122.csv"; } > "$out/caputh-two.csv"
  { cat "$out/caputh-two.csv" && tail -n +2 "$out/caputh-0123.csv"; } > "$out/caputh.csv"
  foretold "$out/caputh-two.csv" "$config" "$out/caputh-0123.csv" caputh-two
  "$leadline" map --pings "$out/caputh.csv" --config "$config" --out "$out/caputh.map"
  "$leadline" grid --pings "$out/caputh.csv" --config "$config" --out "$out/caputh.grid" > /dev/null
  picture caputh "Lake Caputh, SonTek M9, 2 m cells" 1
}

# The frames through the vehicle's own pipeline: decoded, echoes detected, mapped. The head stood still and nobody
# recorded where: the navigation is made.
run_ping360() {
  local frames=$data/ping360_sector_junayed/derived/frames.bin
  local here=$root/toolchain/surveys
  local work=$out/ping360
  if [ ! -f "$frames" ]; then
    echo "*skipped*: no $frames"
    return
  fi
  echo "## Ping360 in a tank"
  rm -rf "$work"
  mkdir -p "$work"
  cp "$here/ping360.toml" "$work/vehicle.toml"
  "$leadline" table --config "$here/ping360-beam.toml" --out "$work/beam.llt"
  python3 "$here/still.py" 5954.0000,N 01042.0000,E 1100 > "$work/still.nmea"
  "$leadline" import --config "$work/vehicle.toml" --record "0=$frames" --record "1=$work/still.nmea" \
    --out "$work/survey.lll"
  "$leadline" replay "$work/survey.lll" --out "$work/map"
  "$leadline" render "$work/map" --view slice --axis down --at 0.005 --width 640 \
    --title "Ping360 in a tank: horizontal slice, 2 cm cells" --out "$out/ping360.png"
  "$root/build/release/tests/tank_walls" "$work/map" 0.005 0.3 0.95
}

# Sonar and navigation from one file; every second ensemble mapped, the others foretold.
run_river() {
  local file=$data/adcp_dvl_pd0/raw/winriver02_transect.PD0
  local config=$root/toolchain/surveys/river.toml
  if [ ! -f "$file" ]; then
    echo "*skipped*: no $file"
    return
  fi
  echo "## A river, four beams of an ADCP"
  "$leadline" survey "$file" --out "$out/river.csv"
  echo "## A river: the signs in 1 m cells"
  local way
  for way in "" "--level" "--flip pitch" "--flip roll"; do
    # shellcheck disable=SC2086 # an option and its value
    printf '%s: ' "${way:-as given}"
    "$leadline" survey "$file" --cell 1 --no-check $way 2> /dev/null | sed -n 's/^ *as given: //p'
  done
  echo "## A river, every second ensemble mapped, the others foretold"
  awk -F, -v even="$out/river-even.csv" -v odd="$out/river-odd.csv" '
    NR == 1 { print > even; print > odd; next }
    $1 - last > 200000 { ping++ }
    { last = $1; print > (ping % 2 ? odd : even) }' "$out/river.csv"
  foretold "$out/river-even.csv" "$config" "$out/river-odd.csv" river-half
  "$leadline" map --pings "$out/river.csv" --config "$config" --out "$out/river.map"
  "$leadline" grid --pings "$out/river.csv" --config "$config" --out "$out/river.grid" > /dev/null
  picture river "A river across, four beams of an ADCP, 1 m cells" 1
}

mkdir -p "$out"
for survey in "${surveys[@]}"; do
  "run_$survey"
done
