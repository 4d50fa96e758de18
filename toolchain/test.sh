#!/usr/bin/env bash
# Installs what is missing, builds and runs the tests.
#
# usage: toolchain/test.sh [--tier fast|ci|full]
#        toolchain/test.sh --target aarch64|armhf|cortex-m7
#   fast   release build, fast tests; under 5 minutes on 2 cores (default)
#   ci     and: tests labelled ci, benches compile, format, clang-tidy and lone headers, vehicle code under
#          the sanitizers with its coverage (at least 95 % of lines), 80 s for all fuzz targets; under 30
#          minutes
#   full   and: tests labelled full, debug build, all tests under the sanitizers, fuzz targets 60 s each,
#          demo; hours
#   --target: the unit tests of the vehicle's folders on another target, under QEMU
#
# Exit code 0: everything passed. A failed step does not stop the later ones (only a build that fails
# does); a table at the end tells what failed. ctest's output stays in build/<preset>/ctest.log.
# LEADLINE_JOBS: parallel jobs (default: one per core). LEADLINE_DATA: shared data (default
# ../shared/data); tests that need it report *skipped* where it is absent.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

tier=fast
target=
parse_options 'tier=fast|ci|full target=aarch64|armhf|cortex-m7' "$@"
[ "$target" != cortex-m7 ] || exec "$root/toolchain/m7.sh" test

# Words that promise work for later do not stay in the sources.
unfinished_marks() {
  # Split, so that this line does not find itself.
  local words='TO''DO|FIX''ME|X''XX|HA''CK|not imple''mented'
  ! (cd "$root" && grep -rnIwE "$words" --include='*.hpp' --include='*.cpp' --include='*.sh' \
    --include='*.py' --include='*.cmake' --include='CMakeLists.txt' \
    firmware hal model estimator proto host_tools tests toolchain CMakeLists.txt)
}

finish() {
  local result=0
  for log in "$root"/build/{release,debug,asan,coverage,aarch64,armhf}/ctest.log; do
    # Only logs of this run.
    if [ -f "$log" ] && [ "$log" -nt "$start_mark" ]; then
      printf '\n%s:\n' "${log#"$root"/}"
      sed -n '/tests passed/,$p' "$log"
    fi
  done
  step_summary || result=1
  rm -f "$start_mark"
  local what="tier $tier"
  [ -z "$target" ] || what="target $target"
  if [ $result -eq 0 ]; then echo "test: $what passed"; else warn "$what FAILED"; fi
  exit $result
}
start_mark=$(mktemp)

if [ -n "$target" ]; then
  step "set-up" "$root/toolchain/setup.sh" --cross || finish
  arch=$target
  [ "$target" = armhf ] || arch=arm64
  step "libraries of $arch" "$root/toolchain/sysroot.sh" "$arch" || finish
  step "build $target" configure_and_build "$target" || finish
  step "tests, $target" run_ctest "$target" || true
  finish
fi

setup_options=()
[ "$tier" = fast ] || setup_options=(--checks --cross --m7)
[ "$tier" != full ] || setup_options+=(--full)
step "set-up" "$root/toolchain/setup.sh" "${setup_options[@]}" || finish

step "build release" configure_and_build release || finish
case $tier in
  fast) step "tests, release" run_ctest release -L '^fast$' || true ;;
  ci) step "tests, release" run_ctest release -L '^(fast|ci)$' || true ;;
  full) step "tests, release" run_ctest release || true ;;
esac
[ "$tier" != fast ] || finish

step "build benches" configure_and_build release benches || true
step "format" "$root/toolchain/format.sh" --check || true
step "unfinished marks" unfinished_marks || true
step "clang-tidy and lone headers" "$root/toolchain/tidy.sh" || true

# What parses on the host runs under the sanitizers in the fuzz targets.
step "vehicle code: sanitizers, coverage" "$root/toolchain/coverage.sh" || true
if [ "$tier" = full ]; then
  step "build asan" configure_and_build asan || finish
  step "tests, asan" run_ctest asan -LE '^full$' || true
  step "build debug" configure_and_build debug || finish
  step "tests, debug" run_ctest debug -L '^fast$' || true
  step "fuzz" "$root/toolchain/fuzz.sh" --seconds 60 || true
  step "demo" "$root/toolchain/demo.sh" || true
else
  step "fuzz" "$root/toolchain/fuzz.sh" --total 80 || true
fi
finish
