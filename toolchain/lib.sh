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

# parse_options SPEC ARGUMENT... : the script's options into variables of their names, "-" as "_"; they keep what they had
# where the option does not come. SPEC, separated by spaces:
#   name        --name is a switch: 1
#   name=KIND   --name VALUE or --name=VALUE. KIND is number (a whole one), decimal, folder (absolute from then on), file
#               (can be read; absolute), text, or the words to choose from, a|b|c
#   name+=KIND  may come again: an array
#   NAME...     words that are no options go to the array operands; without this they are errors
#   +NAME...    likewise, and everything behind the first of them
#   --          what is behind -- goes to the array rest
# -h and --help print the help, and end. What is wrong is a usage_error.
parse_options() {
  local -A kinds=() again=()
  local spec name value takes_operands=0 first_ends=0 takes_rest=0
  for spec in $1; do
    case $spec in
      --) takes_rest=1 ;;
      +*) takes_operands=1 first_ends=1 ;;
      [A-Z]*) takes_operands=1 ;;
      *+=*) kinds[${spec%%+=*}]=${spec#*=} again[${spec%%+=*}]=1 ;;
      *=*) kinds[${spec%%=*}]=${spec#*=} ;;
      *) kinds[$spec]=switch ;;
    esac
  done
  shift
  operands=()
  rest=()
  while [ $# -gt 0 ]; do
    case $1 in
      -h | --help)
        print_help
        exit 0
        ;;
      --)
        [ $takes_rest -eq 1 ] || usage_error "unknown option --"
        rest=("${@:2}")
        return
        ;;
      --?*)
        name=${1%%=*}
        name=${name#--}
        case ${kinds[${name:-none}]:-} in
          '') usage_error "unknown option $1" ;;
          switch)
            [ "$1" = "--$name" ] || usage_error "--$name takes no value"
            value=1
            ;;
          *)
            value=${1#*=}
            if [ "$1" = "--$name" ]; then
              [ $# -ge 2 ] || usage_error "--$name wants $(option_kind "${kinds[$name]}")"
              value=$2
              shift
            fi
            check_option "$name" "${kinds[$name]}"
            ;;
        esac
        name=${name//-/_}
        if [ -n "${again[$name]:-}" ]; then
          local -n list=$name
          list+=("$value")
        else
          printf -v "$name" %s "$value"
        fi
        ;;
      -?*) usage_error "unknown option $1" ;;
      *)
        [ $takes_operands -eq 1 ] || usage_error "unknown argument $1"
        if [ $first_ends -eq 1 ]; then
          operands=("$@")
          return
        fi
        operands+=("$1")
        ;;
    esac
    shift
  done
}
# option_kind KIND: in words.
option_kind() {
  case $1 in
    number) echo "a whole number" ;;
    decimal) echo "a number" ;;
    folder | file) echo "a $1" ;;
    text) echo "a value" ;;
    *) echo "one of ${1//|/, }" ;;
  esac
}
# check_option NAME KIND: of parse_options, whose `value` it looks at and completes.
check_option() {
  local fits=1
  case $2 in
    number) if [[ $value =~ ^[0-9]{1,18}$ ]]; then value=$((10#$value)); else fits=0; fi ;;
    decimal) [[ $value =~ ^[0-9]+(\.[0-9]+)?$ ]] || fits=0 ;;
    folder)
      [ -n "$value" ] || usage_error "--$1 wants a folder"
      value=$(realpath -m -- "$value")
      ;;
    file)
      [ -r "$value" ] && [ ! -d "$value" ] || usage_error "--$1: cannot read $value"
      value=$(realpath -- "$value")
      ;;
    *\|*) [[ $value =~ ^($2)$ ]] || fits=0 ;;
  esac
  [ $fits -eq 1 ] || usage_error "--$1 wants $(option_kind "$2"), not $value"
}

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
