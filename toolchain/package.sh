#!/usr/bin/env bash
# Makes the Debian packages, and tries them.
#
# usage: toolchain/package.sh [--arch amd64|arm64|armhf] [--try]
#   --arch   amd64 (default): leadline-vehicle and leadline; arm64, armhf: leadline-vehicle
#   --try    amd64: installs both in a Debian system of their own (debootstrap), where the vehicle maps an emulated survey
#            and stops in order; needs root. arm64, armhf: unpacks the package and what it depends on, nothing else, and
#            runs the vehicle there, under QEMU
#
# Leaves them in build/<preset>/packages. Installs and builds what it needs.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

arch=amd64
try=0
while [ $# -gt 0 ]; do
  case $1 in
    --arch)
      [ $# -ge 2 ] || usage_error "--arch wants amd64, arm64 or armhf"
      arch=$2
      shift
      ;;
    --try) try=1 ;;
    -h | --help)
      print_help
      exit 0
      ;;
    *) usage_error "unknown option $1" ;;
  esac
  shift
done
case $arch in
  amd64) preset=release targets=(leadline leadline-vehicle leadline-replay) setup=() ;;
  arm64) preset=aarch64 emulator=qemu-aarch64-static targets=(leadline-vehicle leadline-replay) setup=(--cross) ;;
  armhf) preset=armhf emulator=qemu-arm-static targets=(leadline-vehicle leadline-replay) setup=(--cross) ;;
  *) usage_error "unknown architecture $arch" ;;
esac
[ $try -eq 0 ] || setup+=(--packages)
"$root/toolchain/setup.sh" "${setup[@]}"
[ "$arch" = amd64 ] || "$root/toolchain/sysroot.sh" "$arch"
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
  # What the package says that it needs, of this architecture, and the package.
  dpkg-deb -f "$packages"/leadline-vehicle_*.deb Depends
  "$root/toolchain/sysroot.sh" "$arch" --package "$packages"/leadline-vehicle_*.deb --into "$scratch/root"
  run() { "$emulator" -L "$scratch/root" "$scratch/root/usr/bin/$@"; }
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
say "an emulated survey, as the service's user"
mount -t proc proc "$system/proc"
mount -t devpts devpts "$system/dev/pts" -o newinstance,ptmxmode=0666 || true
ln -sf pts/ptmx "$system/dev/ptmx" 2>/dev/null || true
trap 'umount "$system/dev/pts" "$system/proc" 2>/dev/null; rm -rf "$scratch"' EXIT
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
say "removing"
in_system sh -c 'dpkg -r leadline leadline-vehicle' >"$scratch/log" 2>&1 || die "$(cat "$scratch/log")"
in_system test -f /etc/leadline/vehicle.toml || die "the configuration went with the program"
echo "package: amd64 tried"
