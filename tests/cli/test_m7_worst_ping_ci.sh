#!/usr/bin/env bash
# The worst pings that a search has found cost a Cortex-M7 no more than they did.
set -euo pipefail
for tool in arm-none-eabi-g++ qemu-system-arm; do
  command -v "$tool" >/dev/null || {
    echo "skipped: $tool is not installed (toolchain/setup.sh --m7)"
    exit 77
  }
done
"$LEADLINE_ROOT/toolchain/timing.sh" --check
