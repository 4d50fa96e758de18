#!/usr/bin/env bash
# Makes the Debian packages, and tries them.
#
# usage: toolchain/package.sh [--arch amd64|arm64|armhf] [--try]
#   --arch   amd64 (default), arm64: leadline-vehicle and leadline; armhf: leadline-vehicle
#   --try    amd64: installs both in a Debian system of their own (debootstrap), where the vehicle maps an emulated survey
#            and stops in order, the unit and the rules are checked by systemd's own tools, and upgrade, removal and purge
#            leave and take what they should; in a container with a systemd of its own the service starts, begins again when
#            it is killed or stands still, is upgraded and removed; needs root. arm64, armhf: unpacks the packages and what they depend on,
#            nothing else, and runs the programs there, under QEMU
#
# Leaves them in build/<preset>/packages. Installs and builds what it needs.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

arch=amd64
try=0
parse_options 'arch=amd64|arm64|armhf try' "$@"
case $arch in
  amd64) preset=release targets=(leadline leadline-vehicle leadline-replay) setup=() ;;
  arm64) preset=package-arm64 emulator=qemu-aarch64-static targets=(leadline leadline-vehicle leadline-replay) setup=(--cross) ;;
  armhf) preset=armhf emulator=qemu-arm-static targets=(leadline-vehicle leadline-replay) setup=(--cross) ;;
esac
[ $try -eq 0 ] || setup+=(--packages)
"$root/toolchain/setup.sh" "${setup[@]}"
case $arch in
  arm64) "$root/toolchain/sysroot.sh" "$arch" --topside ;;
  armhf) "$root/toolchain/sysroot.sh" "$arch" ;;
esac
configure_and_build "$preset" "${targets[@]}"
packages=$root/build/$preset/packages
rm -rf "$packages"
(cd "$root/build/$preset" && cpack -G DEB) >"$root/build/$preset/cpack.log" 2>&1 ||
  die "no package: $(tail -n 5 "$root/build/$preset/cpack.log")"
ls -l "$packages"/*.deb
[ $try -eq 1 ] || exit 0

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
chmod 755 "$scratch"

if [ "$arch" != amd64 ]; then
  # What the packages say that they need, of this architecture, and the packages: each on its own, so that none lives on what
  # another brought.
  for deb in "$packages"/*.deb; do
    dpkg-deb -f "$deb" Package Depends
    "$root/toolchain/sysroot.sh" "$arch" --package "$deb" --into "$scratch/$(dpkg-deb -f "$deb" Package)"
  done
  run_in() { "$emulator" -L "$scratch/$1" "$scratch/$1/usr/bin/$2" "${@:3}"; }
  run() { run_in leadline-vehicle "$@"; }
  run leadline-vehicle --version
  run leadline-vehicle --help-config | cmp - "$root/firmware/vehicle.example.toml" || die "another example"
  say "a survey that was flown here, replayed there"
  configure_and_build release leadline leadline-replay >/dev/null
  "$root/build/release/host_tools/leadline" simulate --set north_count=40 --set east_count=40 \
    --out "$scratch/survey" >/dev/null
  here=$("$root/build/release/firmware/leadline-replay" "$scratch/survey/survey.lll")
  there=$(run leadline-replay "$scratch/survey/survey.lll")
  echo "$there"
  [ "$here" = "$there" ] || die "another result than here: $here"
  if [ "$arch" = arm64 ]; then
    say "and drawn there"
    topside() { run_in leadline leadline "$@"; }
    topside --version
    topside replay "$scratch/survey/survey.lll" --out "$scratch/map" >/dev/null
    "$root/build/release/host_tools/leadline" replay "$scratch/survey/survey.lll" --out "$scratch/map-here" >/dev/null
    cmp "$scratch"/map{,-here}/depth.asc || die "another map than here"
    topside render "$scratch/map" --out "$scratch/pictures" >/dev/null
    topside export "$scratch/survey/survey.lll" --out "$scratch/depth.tif" >/dev/null
    ls -l "$scratch"/pictures/depth.png "$scratch/depth.tif"
  fi
  echo "package: $arch tried"
  exit 0
fi

[ "$(id -u)" -eq 0 ] || die "--try needs root: debootstrap and chroot"
say "a clean Debian 12"
system=$scratch/system
debootstrap --variant=minbase bookworm "$system" http://deb.debian.org/debian >"$scratch/log" 2>&1 ||
  die "no clean system: $(tail -n 5 "$scratch/log")"
cp "$packages"/*.deb "$system/tmp"
in_system() { chroot "$system" env DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 "$@"; }
say "installing"
in_system sh -c 'apt-get install -y --no-install-recommends /tmp/*.deb' >"$scratch/log" 2>&1 ||
  die "not to be installed: $(tail -n 15 "$scratch/log")"
in_system id leadline
in_system test -f /etc/leadline/vehicle.toml
in_system test -f /usr/lib/systemd/system/leadline-vehicle.service
say "what systemd says of the unit and of the rules"
in_system apt-get install -y --no-install-recommends systemd systemd-sysv dbus udev >"$scratch/log" 2>&1 ||
  die "no systemd: $(tail -n 5 "$scratch/log")"
in_system systemd-analyze verify --man=no leadline-vehicle.service
in_system systemd-analyze security --offline=true --threshold=25 --no-pager leadline-vehicle.service | tail -n 1
mount -t proc proc "$system/proc"
mount -t sysfs -o ro sysfs "$system/sys"
trap 'umount "$system/dev/pts" "$system/sys" "$system/proc" 2>/dev/null || true; rm -rf --one-file-system "$scratch"' EXIT
in_system udevadm test /sys/class/tty/tty 2>&1 | tee "$scratch/log" | grep 'leadline' || die "$(cat "$scratch/log")"
! grep 'leadline.rules:[0-9]' "$scratch/log" || die "the rules are wrong"
say "an emulated survey, as the service's user"
mount -t devpts devpts "$system/dev/pts" -o newinstance,ptmxmode=0666 || true
ln -sf pts/ptmx "$system/dev/ptmx" 2>/dev/null || true
cat >"$system/tmp/fly.sh" <<'FLY'
set -eu
cd "$(mktemp -d)"
mission="--set north_count=40 --set east_count=40"
leadline emulate $mission --write-config . --ports "$PWD/ports" --link udp:127.0.0.1:9100
leadline-vehicle --config vehicle.toml --check-config >/dev/null
leadline-vehicle --config vehicle.toml --clock "lockstep:$PWD/clock" --json >vehicle.json &
vehicle=$!
leadline emulate $mission --out . --ports "$PWD/ports" --lockstep "$PWD/clock" >/dev/null
wait $vehicle
leadline replay survey.lll --out map >/dev/null
leadline render map --out pictures >/dev/null
leadline-replay survey.lll
# In real time, nothing at its ports: SIGTERM ends it in order.
leadline emulate $mission --write-config . --ports "$PWD/ports" --link udp:127.0.0.1:9100
sed -i 's/survey.lll/real.lll/' vehicle.toml
leadline-vehicle --config vehicle.toml >real.txt &
vehicle=$!
sleep 3
kill -TERM $vehicle
wait $vehicle
grep -q '^cycles: ' real.txt
leadline-replay real.lll
FLY
in_system su -s /bin/sh leadline -c 'sh /tmp/fly.sh' || die "it does not fly there"
say "upgrading: first with the configuration as it came, then with one of the owner's"
# newer VERSION: the vehicle's package as that version would be, its example changed.
newer() {
  dpkg-deb -R "$packages"/leadline-vehicle_*.deb "$scratch/$1"
  sed -i "s/^Version: .*/Version: $1/" "$scratch/$1/DEBIAN/control"
  echo "# of $1" >>"$scratch/$1/etc/leadline/vehicle.toml"
  dpkg-deb -b --root-owner-group "$scratch/$1" "$system/tmp/$1.deb"
}
quietly() { "$@" >"$scratch/log" 2>&1 || die "$*: $(cat "$scratch/log")"; }
settings=$system/etc/leadline/vehicle.toml
quietly newer 9.1
quietly in_system dpkg -i /tmp/9.1.deb
grep -q '^# of 9.1' "$settings" || die "an untouched configuration is not brought up to date"
echo '# mine' >>"$settings"
quietly newer 9.2
quietly in_system dpkg -i --force-confdef /tmp/9.2.deb
grep -q '^# mine' "$settings" && grep -q '^# of 9.2' "$settings.dpkg-dist" || die "the owner's configuration is lost"
in_system leadline-vehicle --version
say "removing"
touch "$system/var/lib/leadline/survey.lll" 2>/dev/null || install -D /dev/null "$system/var/lib/leadline/survey.lll"
quietly in_system dpkg -r leadline leadline-vehicle
grep -q '^# mine' "$settings" || die "the configuration went with the program"
[ ! -e "$system/usr/bin/leadline-vehicle" ] || die "the program is still there"
quietly in_system dpkg -P leadline-vehicle
[ ! -e "$settings" ] || die "purged, and the configuration is still there"
[ -e "$system/var/lib/leadline/survey.lll" ] || die "a log went with the program"
rm "$system/var/lib/leadline/survey.lll"
say "the service, under a systemd of its own"
quietly in_system sh -c 'dpkg -i /tmp/leadline*.deb'
umount "$system/dev/pts" "$system/sys" "$system/proc"
mv "$system/tmp/9.1.deb" "$system/opt/next.deb"
cp "$root/toolchain/packaging/service_trial.sh" "$root/tests/data/small_vehicle.toml" "$system/opt"
cat >"$system/etc/systemd/system/trial.service" <<'UNIT'
[Unit]
After=multi-user.target
[Service]
Type=oneshot
ExecStart=/opt/service_trial.sh
UNIT
mkdir -p "$system/etc/systemd/system/graphical.target.wants"
ln -s ../trial.service "$system/etc/systemd/system/graphical.target.wants"
# Memory is locked and SCHED_FIFO had by what the unit says; a container may neither unless told.
timeout 600 systemd-nspawn -q --register=no --keep-unit --capability=CAP_IPC_LOCK,CAP_SYS_NICE,CAP_SYS_RESOURCE \
  --system-call-filter='@memlock @resources' -D "$system" -b </dev/null >"$scratch/log" 2>&1 ||
  die "the container does not end: $(tail -n 5 "$scratch/log")"
[ "$(tail -n 1 "$system/opt/trial")" = held ] || die "$(cat "$system/opt/trial")"
grep -a 'memory\|began\|^map_hash' "$system/opt/trial"
echo "package: amd64 tried"
