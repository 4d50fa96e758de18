#!/usr/bin/env bash
# The monitor's page in Chromium, driven by Playwright: tests/browser/monitor_page.mjs. LEADLINE_PICTURES: folder for
# screenshots. Skipped (77) without node,
# Chromium or playwright-core, which toolchain/setup.sh --checks brings.
set -euo pipefail
if ! command -v node >/dev/null; then
  echo "skipped: no node (toolchain/setup.sh --checks)"
  exit 77
fi
node "$LEADLINE_ROOT/tests/browser/monitor_page.mjs" "$LEADLINE" "$LEADLINE_ROOT/build/browser" ${LEADLINE_PICTURES:+"$LEADLINE_PICTURES"}
