#!/usr/bin/env bash
# The monitor's page in Chromium, driven by Playwright: tests/browser/monitor_page.mjs, with a small survey.
# LEADLINE_PICTURES: folder for screenshots. Skipped (77) without node, Chromium or playwright-core, which
# toolchain/setup.sh --checks brings.
set -euo pipefail

skip() {
  echo "skipped: $*"
  exit 77
}
modules="$LEADLINE_ROOT/build/browser"
command -v node >/dev/null || skip "no node"
[ -x "${LEADLINE_CHROMIUM:-/usr/bin/chromium}" ] || skip "no Chromium"
[ -d "$modules/node_modules/playwright-core" ] || skip "no playwright-core (toolchain/setup.sh --checks)"

scratch=$(mktemp -d "${TMPDIR:-/tmp}/leadline-page.XXXXXX")
trap 'rm -rf "$scratch"' EXIT
"$LEADLINE" simulate --set north_count=64 --set east_count=80 --set margin_cells=4 --out "$scratch/survey" >/dev/null
"$LEADLINE" receive --link "file:$scratch/survey/survey.lll" --out "$scratch/map" >/dev/null 2>&1
[ -z "${LEADLINE_PICTURES:-}" ] || mkdir -p "$LEADLINE_PICTURES"
node "$LEADLINE_ROOT/tests/browser/monitor_page.mjs" "$LEADLINE" "$scratch/survey/survey.lll" "$scratch/map/depth.asc" \
  "$modules" ${LEADLINE_PICTURES:+"$LEADLINE_PICTURES"}
