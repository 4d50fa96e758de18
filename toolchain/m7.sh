#!/usr/bin/env bash
# Builds images for a Cortex-M7 and runs them on QEMU's board MPS2 AN500.
#
# usage: toolchain/m7.sh [--board an500|stm32h743] COMMAND ...
#   build [TARGET...]     the images: build/<preset>/firmware/leadline-m7*.elf
#   fly BLOCK [OPTION...] leadline-m7 in real time with this configuration block (leadline config compile); QEMU's OPTIONs
#                         say what hangs at its lines (-serial ..., five times, the last is the link). An instruction takes
#                         8 ns; where this machine is slower, the board's time goes slower than the clock on the wall
#   replay LOG...         plays logs on the board; a line for each:
#                         map_hash=... link_hash=... cells_hash=... same_as_flight=...
#                         instructions_total=... (of Vehicle::cycle), instructions_worst_cycle, ..._worst_ping (of
#                         Model::integrate), with the ping's number and voxels; exact to a third of an instruction a
#                         cycle or ping, and the same in every run with the same logs
#   gates                 what an image may not hold, and how deep its stack goes (toolchain/m7_gates.py)
#   test [PATTERN]        the unit tests of vehicle code on the board
#   --board stm32h743     as much memory as that part has (default an500: 16 MiB for the map)
#
# Installs and builds what it needs (toolchain/setup.sh --m7: the compiler is 2.4 GB); messages go to standard
# error. Exit code of replay as leadline-replay's: 3 a log cannot be replayed, 5 the flight ended otherwise.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

board=an500
parse_options 'board=an500|stm32h743 +COMMAND' "$@"
set -- "${operands[@]}"
case $board in
  an500) preset=cortex-m7 ;;
  stm32h743) preset=stm32h743 ;;
esac
[ $# -gt 0 ] || usage_error "a command is needed"
command=$1
shift
images="$root/build/$preset/firmware"

messages=$(mktemp)
trap 'rm -f "$messages" "$messages.list"' EXIT
build() {
  mkdir -p "$root/build"
  exec 9>"$root/build/.$preset.lock"
  flock 9
  if ! { "$root/toolchain/setup.sh" --m7 && configure_and_build "$preset" "$@"; } >"$messages" 2>&1; then
    cat "$messages" >&2
    die "$preset cannot be built"
  fi
  exec 9>&-
}

# All in one run of the board: its start costs more than a small log.
replay_all() {
  local log list="$messages.list"
  for log in "$@"; do
    [ -r "$log" ] && [ ! -d "$log" ] || {
      warn "cannot read $log"
      return 3
    }
    realpath "$log"
  done >"$list"
  m7_run "$images/leadline-m7-replay.elf" "arg=replay,arg=@$list" | while IFS= read -r line; do
    case $line in
      map_hash=*) printf '%s\n' "$line" ;;
      *) printf '%s\n' "$line" >&2 ;;
    esac
  done
}

# CMocka's one file is compiled with the tests: Debian's source package, by a private apt state, so that nothing
# on the machine changes.
fetch_cmocka() {
  local to="$root/build/cmocka" state
  [ ! -e "$to/src/cmocka.c" ] || return 0
  state=$(mktemp -d)
  mkdir -p "$state/lists/partial" "$state/archives/partial" "$to"
  echo "deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg]" \
    "http://deb.debian.org/debian bookworm main" >"$state/sources.list"
  local options=(-o "Dir::Etc::SourceList=$state/sources.list" -o "Dir::Etc::SourceParts=/dev/null"
    -o "Dir::State=$state" -o "Dir::State::Lists=$state/lists" -o "Dir::Cache=$state"
    -o APT::Sandbox::User=root -o Acquire::Retries=3)
  apt-get "${options[@]}" update && (cd "$state" && apt-get "${options[@]}" source --download-only cmocka) &&
    tar -xf "$state"/cmocka_*.orig.tar.xz -C "$to" --strip-components=1 || return 1
  rm -rf "$state"
}

# counts XML: tests within the programs, and why which were skipped.
counts() {
  awk '/<testcase / {++programs}
    /^\[       OK \]/ {++passed}
    /^\[  FAILED  \] [^ ]+$/ {++failed}
    /\*skipped\*: / {sub(/.*\*skipped\*: /, ""); why[++skipped] = $0}
    END {
      printf "on the board: %d programs, %d tests: %d passed, %d failed, %d skipped\n", programs,
        passed + failed + skipped, passed, failed, skipped
      for (i = 1; i <= skipped; ++i) print "  skipped: " why[i]
    }' "$1"
}

gates() {
  local image result=0
  for image in "$images"/leadline-m7*.elf; do
    case $image in *-replay.elf | *-lockstep.elf | *-cost.elf) continue ;; esac
    "$root/toolchain/m7_gates.py" symbols "$image" || result=1
    "$root/toolchain/m7_gates.py" stack "$image" || result=1
    "$root/toolchain/m7_gates.py" footprint "$image" || result=1
  done
  return $result
}

case $command in
  build)
    [ $# -gt 0 ] || set -- all
    build "$@"
    ;;
  fly)
    [ $# -gt 0 ] && [ -r "$1" ] || usage_error "fly wants a configuration block that can be read"
    [ "$board" = an500 ] || usage_error "fly goes with --board an500"
    block=$(realpath "$1")
    shift
    build leadline-m7
    exec qemu-system-arm -M mps2-an500 -display none -monitor none -icount shift=3 \
      -device "loader,file=${block//,/,,},addr=0x3E0000,force-raw=on" "$@" \
      -kernel "$images/leadline-m7.elf" </dev/null
    ;;
  gates)
    build all
    gates
    ;;
  test)
    mkdir -p "$root/build"
    if ! { "$root/toolchain/setup.sh" --m7 && fetch_cmocka; } >"$messages" 2>&1; then
      cat "$messages" >&2
      die "CMocka's sources cannot be had"
    fi
    preset=cortex-m7-tests
    # A pattern's tests, or all.
    targets=(m7_tests)
    if [ $# -gt 0 ]; then
      (cd "$root" && cmake --preset $preset --log-level=WARNING) >"$messages" 2>&1 || {
        cat "$messages" >&2
        exit 1
      }
      mapfile -t targets < <(ctest --test-dir "$root/build/$preset" -N -R "$1" | sed -n 's/^ *Test *#[0-9]*: //p')
      [ ${#targets[@]} -gt 0 ] || die "no test matches $1"
    fi
    build "${targets[@]}"
    result=0
    run_ctest $preset ${1:+-R "$1"} --output-junit "$root/build/$preset/tests.xml" \
      --test-output-size-passed 4000000 || result=$?
    counts "$root/build/$preset/tests.xml"
    exit $result
    ;;
  replay)
    [ $# -gt 0 ] || usage_error "replay wants a log"
    build leadline-m7-replay
    result=0
    replay_all "$@" || result=$?
    exit $result
    ;;
  *) usage_error "unknown command $command" ;;
esac
