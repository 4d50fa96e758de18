#!/usr/bin/env bash
# Runs clang-tidy 14 (.clang-tidy) on the vehicle code, as for the Cortex-M7 on what is only for that (hal/m7,
# firmware/m7; the compiler of setup.sh --m7 has the headers), and compiles every vehicle header alone.
#
# usage: toolchain/tidy.sh [--seconds N] [FILE...]
#   --seconds N   stop after N seconds in all, as a failure (default 600)
#   FILE...       only these sources (default: every .cpp of these folders)
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

seconds=600
parse_options 'seconds=number FILE...' "$@"
files=()
for file in "${operands[@]}"; do
  files+=("$(realpath -- "$file")")
done

command -v clang-tidy-14 >/dev/null || die "clang-tidy-14 is missing: toolchain/setup.sh --checks"
configure_and_build release all_verify_interface_header_sets
cd "$root"
if [ ${#files[@]} -eq 0 ]; then
  folders=()
  for folder in model estimator proto firmware/pipeline hal/heads hal/attitude hal/m7 firmware/m7; do
    [ ! -d "$folder" ] || folders+=("$folder")
  done
  mapfile -t files < <(find "${folders[@]}" -name '*.cpp' | sort)
fi
m7_files=()
host_files=()
for file in "${files[@]}"; do
  case $(realpath --relative-to=. "$file") in
    hal/m7/* | firmware/m7/*) m7_files+=("$file") ;;
    *) host_files+=("$file") ;;
  esac
done

# The flags of toolchain/cmake/cortex-m7.cmake that clang knows, and where newlib's headers are: they are gcc's own
# business. Clang's headers stand for gcc's.
m7_database="$root/build/tidy-m7"
make_m7_database() {
  command -v arm-none-eabi-g++ >/dev/null || die "arm-none-eabi-g++ is missing: toolchain/setup.sh --m7"
  mkdir -p "$m7_database"
  local flags=(-mcpu=cortex-m7 -mthumb -mfpu=fpv5-d16 -mfloat-abi=hard)
  {
    printf '%s\n' -xc++ -std=c++17 --target=arm-none-eabi "${flags[@]}" -fno-exceptions -fno-rtti -nostdinc++ "-I$root"
    arm-none-eabi-g++ "${flags[@]}" -E -v -x c++ /dev/null 2>&1 |
      sed -n '/^#include <\.\.\.>/,/^End of/s/^ //p' | grep -vE '/lib/gcc/arm-none-eabi/[0-9.]+/include(-fixed)?$' |
      xargs -n 1 realpath | sed 's/^/-isystem/'
  } >"$m7_database/compile_flags.txt"
}

# The database names gcc's flags; those that clang does not know are no finding. clang-tidy's count of
# suppressed warnings in system headers goes to stderr and says nothing.
# tidy SECONDS OPTION... : on the files that standard input names.
tidy() {
  local limit=$1
  shift
  timeout "$limit" xargs -r -d '\n' -n 1 -P "$jobs" sh -c '
    out=$(clang-tidy-14 --quiet --extra-arg=-Wno-unknown-warning-option "$@" 2>&1)
    status=$?
    printf "%s\n" "$out" | grep -vE "^[0-9]+ warnings?( and [0-9]+ errors?)? generated\.$" | grep -v "^$"
    exit $status' sh "$@" ||
    die "clang-tidy found something, or took over $seconds s"
}
start=$SECONDS
[ ${#host_files[@]} -eq 0 ] || printf '%s\n' "${host_files[@]}" | tidy "$seconds" -p build/release
if [ ${#m7_files[@]} -gt 0 ]; then
  make_m7_database
  left=$((seconds - SECONDS + start))
  # Off there: what interrupts, the linker and the images share are variables with external linkage, and registers
  # and the board's memory are reached by address.
  printf '%s\n' "${m7_files[@]}" | tidy $((left > 1 ? left : 1)) -p "$m7_database" \
    "--header-filter=.*/(hal|firmware)/m7/.*" \
    "--checks=-cppcoreguidelines-avoid-non-const-global-variables,-cppcoreguidelines-pro-type-reinterpret-cast"
fi
echo "tidy: ${#files[@]} files, nothing found"
