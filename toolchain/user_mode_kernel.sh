#!/usr/bin/env bash
# Builds a Linux kernel that runs as a plain process and carries what a machine need not have: CAN buses
# (vcan, slcan) and GPIO lines (gpio-sim) for tests/cli/test_kernel_buses_ci.sh, bad lines (netem) and time of its own
# (time-travel) for toolchain/link_kernel.py.
#
# usage: toolchain/user_mode_kernel.sh [--jobs N] [--print-path]
#   --jobs N       parallel compilations (default: all processors)
#   --print-path   only print where the kernel is, or will be
#
# Takes up to ten minutes of processor time, once: the kernel stays in $LEADLINE_CACHE (by default
# ~/.cache/leadline), outside of the checkout. Needs Debian's linux-source-6.1, flex, bison, bc, make, gcc and
# xz-utils; says what is missing.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

cache=${LEADLINE_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/leadline}
# Another list of options gets another number: kernels of older checkouts stay theirs.
kernel=$cache/user-mode-6.1-2/linux
archive=/usr/src/linux-source-6.1.tar.xz
jobs=$(nproc)
print_path=0
parse_options 'jobs=number print-path' "$@"
if [ $print_path -eq 1 ]; then
  echo "$kernel"
  exit 0
fi

if [ -x "$kernel" ]; then
  echo "user_mode_kernel: there already: $kernel"
  exit 0
fi
[ -r "$archive" ] || die "no $archive: apt-get install linux-source-6.1"
for tool in flex bison bc make gcc xz; do
  command -v "$tool" >/dev/null || die "$tool is not installed"
done

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
echo "user_mode_kernel: unpacking"
tar -C "$work" -xJf "$archive"
source_tree=$work/linux-source-6.1
build=$work/build
mkdir -p "$build"
# This architecture has 64 interrupt numbers and uses all of them: the edges of simulated lines need more.
sed -i '/else/,/endif/s/define NR_IRQS\t*UM_LAST_SIGNAL_IRQ$/define NR_IRQS (UM_LAST_SIGNAL_IRQ + 64)/' \
  "$source_tree/arch/um/include/asm/irq.h"
options=(
  # A system that programs run in
  64BIT PRINTK BUG MULTIUSER POSIX_TIMERS FUTEX EPOLL EVENTFD SIGNALFD TIMERFD AIO HIGH_RES_TIMERS
  FILE_LOCKING BINFMT_ELF BINFMT_SCRIPT TTY UNIX98_PTYS STDERR_CONSOLE SSL NULL_CHAN PTY_CHAN TTY_CHAN
  BLOCK PROC_FS PROC_SYSCTL SYSFS TMPFS SHMEM DEVTMPFS DEVTMPFS_MOUNT HOSTFS CONFIGFS_FS DEBUG_FS
  # Network and CAN
  NET INET UNIX PACKET NETDEVICES NET_CORE CAN CAN_RAW CAN_VCAN CAN_DEV CAN_NETLINK CAN_SLCAN
  # Two machines with a bad line between them, and a clock that jumps over waiting
  NAMESPACES NET_NS VETH NET_SCHED NET_SCH_NETEM UML_TIME_TRAVEL_SUPPORT
  # Lines
  GPIOLIB GPIO_CDEV GPIO_CDEV_V1 GPIO_SIM
)
{
  for option in "${options[@]}"; do
    echo "CONFIG_$option=y"
  done
  echo 'CONFIG_CON_ZERO_CHAN="fd:0,fd:1"'
  echo 'CONFIG_CON_CHAN="null"'
  echo 'CONFIG_SSL_CHAN="null"'
} >"$work/fragment"
(
  cd "$source_tree"
  make -s ARCH=um O="$build" tinyconfig
  # It tells of every option that the fragment changes.
  ./scripts/kconfig/merge_config.sh -m -O "$build" "$build/.config" "$work/fragment" >"$work/merge.log" 2>&1 ||
    die "its options do not merge: $(tail -3 "$work/merge.log")"
  make -s ARCH=um O="$build" olddefconfig
)
for option in "${options[@]}"; do
  grep -q "^CONFIG_$option=y" "$build/.config" || die "this kernel cannot have CONFIG_$option"
done
echo "user_mode_kernel: building"
make -s -C "$source_tree" ARCH=um O="$build" -j"$jobs" linux >"$work/build.log" 2>&1 ||
  die "the build failed: $(tail -5 "$work/build.log")"
mkdir -p "$(dirname "$kernel")"
strip -g "$build/linux"
# Whole or not at all: two builds may end at the same time.
cp "$build/linux" "$kernel.$$"
mv "$kernel.$$" "$kernel"
echo "user_mode_kernel: $kernel"
