#!/usr/bin/env bash
# The real programs over a bad line of a real kernel, at the slowest rate (toolchain/link_kernel.py): in the end the topside
# has the vehicle's map. Skipped where there is no such kernel.
set -euo pipefail
exec "$LEADLINE_ROOT/toolchain/link_kernel.py" --build "$LEADLINE_BUILD" --rates 1200 --runs 1 --json
