#!/usr/bin/env bash
# Two tabs, visitors that talk nonsense, and guests of its link at one monitor: tests/browser/monitor_many.mjs. Skipped (77) without node,
# Chromium or playwright-core, which toolchain/setup.sh --checks brings.
set -euo pipefail
if ! command -v node >/dev/null; then
  echo "skipped: no node (toolchain/setup.sh --checks)"
  exit 77
fi
node "$LEADLINE_ROOT/tests/browser/monitor_many.mjs" "$LEADLINE" "$LEADLINE_ROOT/build/browser"
