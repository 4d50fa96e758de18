#!/usr/bin/env bash
# Runs the unit tests and properties of the vehicle's folders under ASan and UBSan, and measures which lines of
# these folders they run (what programs and scripts run besides does not count). Fails where a test does or a folder
# is below the bound.
#
# usage: toolchain/coverage.sh [--min PERCENT] [--label REGEX]
#   --min PERCENT   lines of each folder that must run (default 95)
#   --label REGEX   which tests run, by ctest label (default: fast and ci)
#
# Leaves build/coverage/coverage.html (line by line) and build/coverage/coverage.txt.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

min=95
label='^(fast|ci)$'
parse_options 'min=decimal label=text' "$@"

command -v gcovr >/dev/null || die "gcovr is missing: toolchain/setup.sh --checks"
configure_and_build coverage vehicle_tests
build="$root/build/coverage"
# Counts of an earlier run would hide a test that no longer runs.
find "$build" -name '*.gcda' -delete
tests_failed=0
# The search for the work bound and the oracle take minutes so and run three lines that the others do not; the soak
# watches its memory, which the sanitizer keeps. The lines of a test that fails count all the same.
run_ctest coverage -L "$label" -R "$vehicle_tests_regex" \
  -E '^property\.(work_bound|oracle|faults_soak)' || tests_failed=1

# gcov's counts are read once; the folders are parts of the result.
folders=(model estimator proto hal/heads hal/attitude firmware/pipeline)
filters=()
for folder in "${folders[@]}"; do
  filters+=(--filter "$root/$folder/")
done
gcovr --root "$root" --object-directory "$build" "${filters[@]}" --exclude-unreachable-branches \
  --html-details "$build/coverage.html" --txt "$build/coverage.txt" --json "$build/coverage.json" ||
  die "gcovr failed"
below=0
# Never a device as gcovr's output: it deletes what it finds under that name first, and root may.
for folder in "${folders[@]}"; do
  summary=$(gcovr --root "$root" --add-tracefile "$build/coverage.json" --filter "$root/$folder/" \
    --fail-under-line "$min" --print-summary --txt "$build/coverage_folder.txt") || below=1
  printf '%-18s %s\n' "$folder" "$(grep '^lines' <<<"$summary")"
done
[ "$below" -eq 0 ] || die "a folder is below $min % of its lines: see $build/coverage.txt"
[ "$tests_failed" -eq 0 ] || die "tests failed: see $build/ctest.log"
