#!/usr/bin/env bash
# Measures which lines of model/ its own tests run (unit/base, unit/model, property; what programs and
# scripts run besides does not count), and fails below the bound.
#
# usage: toolchain/coverage.sh [--min PERCENT] [--label REGEX]
#   --min PERCENT   lines of model/ that must run (default 95)
#   --label REGEX   which tests run, by ctest label (default: fast and ci)
#
# Leaves build/coverage/coverage.html (line by line) and build/coverage/coverage.txt.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

minimum=95
label='^(fast|ci)$'
while [ $# -gt 0 ]; do
  case $1 in
    --min | --label)
      [ $# -ge 2 ] || usage_error "$1 wants a value"
      if [ "$1" = --min ]; then minimum=$2; else label=$2; fi
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

command -v gcovr >/dev/null || die "gcovr is missing: toolchain/setup.sh --checks"
configure_and_build coverage model_tests
build="$root/build/coverage"
# Counts of an earlier run would hide a test that no longer runs.
find "$build" -name '*.gcda' -delete
tests_failed=0
# The search for the work bound takes minutes without optimization and runs three lines that the others do
# not. The lines of a test that fails count all the same.
run_ctest coverage -L "$label" -R '^(unit\.(base|model)|property)\.' -E '^property\.work_bound' ||
  tests_failed=1
gcovr --root "$root" --object-directory "$build" --filter "$root/model/" \
  --exclude-unreachable-branches --html-details "$build/coverage.html" --txt "$build/coverage.txt" \
  --fail-under-line "$minimum" --print-summary ||
  die "below $minimum % of the lines of model/: see $build/coverage.txt"
[ "$tests_failed" -eq 0 ] || die "tests failed: see $build/ctest.log"
