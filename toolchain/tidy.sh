#!/usr/bin/env bash
# Runs clang-tidy 14 (.clang-tidy) on the vehicle code and compiles every vehicle header alone.
#
# usage: toolchain/tidy.sh [--seconds N] [FILE...]
#   --seconds N   stop after N seconds in all, as a failure (default 600)
#   FILE...       only these sources (default: every .cpp of the vehicle folders)
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

seconds=600
files=()
while [ $# -gt 0 ]; do
  case $1 in
    --seconds)
      [ $# -ge 2 ] || usage_error "--seconds wants a number"
      seconds=$2
      shift
      ;;
    -h | --help)
      print_help
      exit 0
      ;;
    -*) usage_error "unknown option $1" ;;
    *) files+=("$(realpath "$1")") ;;
  esac
  shift
done

command -v clang-tidy-14 >/dev/null || die "clang-tidy-14 is missing: toolchain/setup.sh --checks"
configure_and_build release all_verify_interface_header_sets
cd "$root"
if [ ${#files[@]} -eq 0 ]; then
  folders=()
  for folder in model estimator proto firmware/pipeline hal/heads hal/attitude; do
    [ ! -d "$folder" ] || folders+=("$folder")
  done
  mapfile -t files < <(find "${folders[@]}" -name '*.cpp' | sort)
fi
# The database names gcc's flags; those that clang does not know are no finding. clang-tidy's count of
# suppressed warnings in system headers goes to stderr and says nothing.
printf '%s\0' "${files[@]}" |
  timeout "$seconds" xargs -0 -r -n 1 -P "$jobs" sh -c '
    out=$(clang-tidy-14 -p build/release --quiet --extra-arg=-Wno-unknown-warning-option "$0" 2>&1)
    status=$?
    printf "%s\n" "$out" | grep -vE "^[0-9]+ warnings?( and [0-9]+ errors?)? generated\.$" | grep -v "^$"
    exit $status' ||
  die "clang-tidy found something, or took over $seconds s"
echo "tidy: ${#files[@]} files, nothing found"
