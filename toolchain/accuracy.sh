#!/usr/bin/env bash
# Maps the scenes with known truth, compares with the baselines and prints the tables of model/README.md.
#
# usage: toolchain/accuracy.sh [--scenes DIR] [--out DIR] [--no-build] [--rules | --outliers] [NAME...]
#   --scenes DIR   folder of scenes (default: $LEADLINE_DATA/scenes, or ../shared/data/scenes); each is a
#                  folder with pings.csv, map.toml, truth.asc and touched.asc
#   --out DIR      where maps, grids and accuracy.json go (default out/accuracy)
#   --no-build     take build/release as it is
#   --rules        instead: each combining rule on each scene
#   --outliers     only the table of short false echoes (which a run over all scenes ends with)
#   NAME...        only these scenes (default: all)
#
# One parameter set for all scenes: only what each map.toml states differs. Exit code 0: every bound
# holds; 1: one does not (each is named); 2: usage; 77: no scenes on this machine.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

scenes=
out=
no_build=0
rules=0
outliers=0
parse_options 'scenes=folder out=folder no-build rules outliers NAME...' "$@"
arguments=("${operands[@]}")
[ -z "$scenes" ] || arguments+=(--scenes "$scenes")
[ -z "$out" ] || arguments+=(--out "$out")
[ $rules -eq 0 ] || arguments+=(--rules)
[ $outliers -eq 0 ] || arguments+=(--outliers)

if [ $no_build -eq 0 ]; then
  "$root/toolchain/setup.sh"
  configure_and_build release leadline octomap_scene
fi
exec python3 "$root/toolchain/accuracy.py" --root "$root" "${arguments[@]}"
