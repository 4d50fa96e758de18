#!/bin/sh
# First process of the user-mode kernel of test_kernel_buses_ci.sh, with the host's own tree as its (read-only)
# root: makes a CAN bus and GPIO lines, runs the tests on them, prints GUEST-RC=<exit code>.
# On the kernel's command line: LEADLINE_TEST=<program>.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
echo GUEST-STARTED
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev /dev 2>/dev/null
mkdir -p /dev/pts
mount -t devpts -o ptmxmode=666 pts /dev/pts
# Not over /tmp: the checkout may lie there.
mount -t tmpfs tmp /mnt
export TMPDIR=/mnt

# Debian's packaged kernel has its drivers as modules; the built one has them inside.
modules=/usr/lib/uml/modules/$(uname -r)/kernel
if [ -d "$modules" ] && [ ! -d /proc/sys/net/can ]; then
  for name in can-dev can can-raw vcan slcan; do
    file=$(find "$modules" -name "$name.ko" | head -1)
    [ -z "$file" ] || insmod "$file" 2>/dev/null
  done
fi
ip link set lo up
ip link add dev vcan0 type vcan && ip link set vcan0 up && export LEADLINE_TEST_CAN=vcan0

if mount -t configfs config /sys/kernel/config 2>/dev/null &&
  mkdir /sys/kernel/config/gpio-sim/leadline 2>/dev/null; then
  simulator=/sys/kernel/config/gpio-sim/leadline
  mkdir $simulator/bank
  echo 8 >$simulator/bank/num_lines
  echo 1 >$simulator/live
  chip=$(cat $simulator/bank/chip_name)
  lines=/sys/devices/platform/$(cat $simulator/dev_name)/$chip
  export LEADLINE_TEST_GPIO=$chip:3 LEADLINE_TEST_GPIO_PULL=$lines/sim_gpio3/pull
  export LEADLINE_TEST_GPIO_OUT=$chip:5 LEADLINE_TEST_GPIO_OUT_VALUE=$lines/sim_gpio5/value
fi

"$LEADLINE_TEST"
echo "GUEST-RC=$?"
poweroff -f 2>/dev/null || echo o >/proc/sysrq-trigger
sleep 5
