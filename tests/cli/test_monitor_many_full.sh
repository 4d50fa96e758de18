#!/usr/bin/env bash
# Two tabs, visitors that talk nonsense, and guests of its link at one monitor: tests/browser/monitor_many.mjs. Skipped
# (77) without node, Chromium or playwright-core, which toolchain/setup.sh --checks brings.
set -euo pipefail
modules="$LEADLINE_ROOT/build/browser"
if ! command -v node >/dev/null || [ ! -d "$modules/node_modules/playwright-core" ]; then
  echo "skipped: no node or no playwright-core (toolchain/setup.sh --checks)"
  exit 77
fi
scratch=$(mktemp -d "${TMPDIR:-/tmp}/leadline-many.XXXXXX")
trap 'rm -rf "$scratch"' EXIT
"$LEADLINE" simulate --set north_count=64 --set east_count=80 --set margin_cells=4 --out "$scratch/survey" >/dev/null
node "$LEADLINE_ROOT/tests/browser/monitor_many.mjs" "$LEADLINE" "$scratch/survey/survey.lll" "$modules" "$scratch"
