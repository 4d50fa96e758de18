#!/usr/bin/env bash
# Shows what Leadline does: surveys a seafloor, maps it from the pings alone, compares with the truth.
#
# usage: toolchain/demo.sh [--terrain FILE] [--out DIR]
#   --terrain FILE   survey this raster (anything that GDAL reads) instead of the built-in seafloor
#   --out DIR        where the results go (default out/demo)
#
# Installs what is missing from Debian and builds first. Leaves in DIR:
#   depth.png uncertainty.png ...   pictures of the map; difference.png of map minus truth
#   depth.tif depth.asc sigma.asc   the map as rasters
#   table.txt                       errors of the map, and of the usual griddings of the same pings
#   pings.csv map.toml truth.asc    the survey
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

out="$root/out/demo"
terrain=()
while [ $# -gt 0 ]; do
  case $1 in
    --terrain)
      [ $# -ge 2 ] || usage_error "--terrain wants a file"
      [ -r "$2" ] || usage_error "cannot read $2"
      terrain=(--terrain "$(realpath "$2")")
      shift
      ;;
    --out)
      [ $# -ge 2 ] || usage_error "--out wants a folder"
      out=$(realpath -m "$2")
      shift
      ;;
    -h | --help)
      print_help
      exit 0
      ;;
    *) usage_error "unknown option $1" ;;
  esac
  shift
done

"$root/toolchain/setup.sh"
say "building"
configure_and_build release leadline

leadline() { "$root/build/release/host_tools/leadline" "$@"; }
start=$SECONDS
mkdir -p "$out"

say "surveying"
leadline simulate "${terrain[@]}" --out "$out"

say "mapping"
leadline map --pings "$out/pings.csv" --config "$out/map.toml" --out "$out"

say "pictures"
leadline render "$out" --out "$out"

say "comparing with the truth"
{
  echo "The map:"
  leadline compare "$out/depth.asc" "$out/truth.asc" --mask "$out/touched.asc" \
    --sigma "$out/sigma.asc" --difference-png "$out/difference.png"
  echo
  echo "Griddings of the same pings:"
  leadline grid --pings "$out/pings.csv" --config "$out/map.toml" --truth "$out/truth.asc" \
    --mask "$out/touched.asc"
} | tee "$out/table.txt"

for result in depth.png depth.tif difference.png table.txt; do
  [ -s "$out/$result" ] || die "$result was not made"
done
say "done in $((SECONDS - start)) s; look at"
ls "$out"/*.png "$out"/*.tif "$out/table.txt"
