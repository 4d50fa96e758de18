# Shared by the scripts of this folder; sourced, never run. Sets $root and $jobs and goes nowhere: every
# script works from any folder.
# shellcheck shell=bash

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# LEADLINE_JOBS: how many compilers and tests at once (default: one per core).
jobs=${LEADLINE_JOBS:-$(nproc)}
script_name=$(basename "$0")

say() { printf '\n== %s\n' "$*"; }
warn() { printf '%s: %s\n' "$script_name" "$*" >&2; }
die() {
  warn "$*"
  exit 1
}
usage_error() {
  warn "$* (see --help)"
  exit 2
}

# The comment block at the top of the calling script is its --help.
print_help() { sed -n '2,/^[^#]/{/^#/!q;s/^# \{0,1\}//;p}' "$0"; }

# stems FOLDER PATTERN: names without folder and extension, sorted; nothing when there are none.
stems() {
  [ ! -d "$1" ] || find "$1" -maxdepth 1 -name "$2" -printf '%f\n' | sed 's/\.[^.]*$//' | sort
}

# Tests of the target vehicle_tests (tests/CMakeLists.txt).
vehicle_tests_regex='^(unit\.(base|model|estimator|proto|hal|firmware)|property)\.'

# configure_and_build PRESET [TARGET...]
configure_and_build() {
  local preset=$1
  shift
  # Preset files are found from the source folder only.
  (cd "$root" && cmake --preset "$preset" --log-level=NOTICE) || return 1
  local targets=()
  [ $# -eq 0 ] || targets=(--target "$@")
  (cd "$root" && cmake --build --preset "$preset" --parallel "$jobs" "${targets[@]}")
}

# run_ctest PRESET OPTIONS... : the log stays in build/PRESET/ctest.log, each test's limit holds, and
# --timeout is the net below it. One test more than jobs at a time: those with devices and links mostly wait.
run_ctest() {
  local preset=$1
  shift
  local log="$root/build/$preset/ctest.log"
  ctest --test-dir "$root/build/$preset" --parallel $((jobs + 1)) --timeout 3600 --no-tests=error \
    --output-on-failure "$@" 2>&1 | tee "$log"
}

# Steps with their time; a failed step does not hide what the later ones would have found.
step_names=()
step_seconds=()
step_results=()
step() {
  local name=$1
  shift
  say "$name"
  local start=$SECONDS result=ok
  # Called under "if", where errexit does not reach: every function used here says return 1 itself.
  if ! "$@"; then
    result=FAILED
  fi
  step_names+=("$name")
  step_seconds+=($((SECONDS - start)))
  step_results+=("$result")
  [ "$result" = ok ]
}
step_summary() {
  local i failed=0
  printf '\n%-44s %8s  %s\n' step seconds result
  for i in "${!step_names[@]}"; do
    printf '%-44s %8d  %s\n' "${step_names[i]}" "${step_seconds[i]}" "${step_results[i]}"
    [ "${step_results[i]}" = ok ] || failed=1
  done
  printf '%-44s %8d\n' total "$SECONDS"
  return $failed
}

# m7_run IMAGE [SEMIHOSTING] [QEMU OPTION...] : the board until the image ends it; its words on standard output.
# An instruction takes 2^7 ns of the board's time: hal/m7/clock.hpp counts them.
m7_run() {
  local image=$1 semihosting=${2:-}
  shift
  [ $# -eq 0 ] || shift
  qemu-system-arm -M mps2-an500 -display none -monitor none -serial none -chardev stdio,id=sh0 \
    -icount shift=7,sleep=off \
    -semihosting-config "enable=on,target=native,chardev=sh0${semihosting:+,$semihosting}" "$@" \
    -kernel "$image" </dev/null
}
