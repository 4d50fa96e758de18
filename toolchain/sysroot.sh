#!/usr/bin/env bash
# Unpacks what programs of another architecture are linked with, from Debian 12: headers, libraries, C library.
#
# usage: toolchain/sysroot.sh ARCH [--topside] [--package DEB... --into DIR]
#   ARCH         arm64 or armhf
#   --topside    also what leadline is linked with (GDAL: 226 packages, 700 MB)
#   --package    this package of ours and what it depends on, instead: for a trial (toolchain/package.sh)
#   --into DIR   unpack there
#
# Leaves them in build/sysroot-ARCH, where the presets aarch64 and armhf look. apt-get works on a state of its own there:
# no architecture is added to this machine, none of its packages changes, no rights are needed. Does nothing when
# everything is there. A package mirror that is under change for one architecture (security updates of armhf have been)
# costs only the updates.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

packages=(
  libc6-dev libstdc++-12-dev
  libgpiod-dev libmodbus-dev libsodium-dev libsystemd-dev libtomlplusplus-dev libcmocka-dev libeigen3-dev libcli11-dev
)

topside=0
package=()
into=
parse_options 'topside package+=file into=folder ARCH' "$@"
ours=("${package[@]}")
[ $topside -eq 0 ] || packages+=(libgdal-dev libcairo2-dev libsqlite3-dev nlohmann-json3-dev libboost-dev)
arch=${operands[0]:-}
[[ ${operands[*]} =~ ^(arm64|armhf)$ ]] || usage_error "one architecture is needed: arm64 or armhf"
command -v apt-get >/dev/null || die "this is no Debian: no apt-get"

if [ ${#ours[@]} -gt 0 ]; then
  # Names without versions: "libc6 (>= 2.36), libgcc-s1" becomes two.
  mapfile -t packages < <(for deb in "${ours[@]}"; do dpkg-deb -f "$deb" Depends; done |
    tr ',' '\n' | sed 's/([^)]*)//; s/ //g' | sort -u)
fi
sysroot=${into:-$root/build/sysroot-$arch}
mkdir -p "$root/build"
exec 9>"$root/build/.sysroot-$arch.lock"
flock 9
wanted="${packages[*]}"
# What was asked for last time, and more, is there.
if [ -f "$sysroot/.complete" ]; then
  missing=0
  for package in "${packages[@]}"; do
    grep -qx "$package" "$sysroot/.complete" || missing=1
  done
  if [ $missing -eq 0 ]; then
    echo "sysroot: $sysroot is complete"
    exit 0
  fi
  wanted="$wanted $(tr '\n' ' ' <"$sysroot/.complete")"
fi

keyring=/usr/share/keyrings/debian-archive-keyring.gpg
[ -r "$keyring" ] || die "no $keyring: apt-get install debian-archive-keyring"
mirror=http://deb.debian.org
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
chmod 755 "$work"
mkdir -p "$work"/lists/partial "$work"/cache/archives/partial
: >"$work/status"
apt_get() {
  apt-get -q -o "APT::Architecture=$arch" -o "APT::Architectures::=$arch" \
    -o "Dir::Etc::sourcelist=$work/sources.list" -o Dir::Etc::sourceparts=/dev/null \
    -o "Dir::State=$work" -o "Dir::State::lists=$work/lists" -o "Dir::State::status=$work/status" \
    -o "Dir::Cache=$work/cache" -o "APT::Sandbox::User=$(id -un)" -o APT::Install-Recommends=false \
    -o Debug::NoLocking=1 -o Acquire::Retries=3 "$@"
}
sources() { printf 'deb [signed-by=%s] %s/%s main\n' "$keyring" "$mirror" "$1"; }
sources "debian bookworm" >"$work/sources.list"
sources "debian bookworm-updates" >>"$work/sources.list"
sources "debian-security bookworm-security" >>"$work/sources.list"
if ! apt_get update >"$work/log" 2>&1 || grep -q '^[EW]: Failed' "$work/log"; then
  warn "no updates of $arch to be had, going on without"
  sources "debian bookworm" >"$work/sources.list"
  rm -rf "$work/lists"
  mkdir -p "$work/lists/partial"
  apt_get update >"$work/log" 2>&1 || die "no package lists of $arch: $(tail -n 3 "$work/log")"
fi
# shellcheck disable=SC2086 # a list of names
apt_get -y --download-only install $wanted >"$work/log" 2>&1 ||
  die "packages of $arch cannot be had: $(tail -n 5 "$work/log")"
rm -rf "$sysroot.new"
mkdir -p "$sysroot.new"
for package in "$work"/cache/archives/*.deb; do
  dpkg-deb -x "$package" "$sysroot.new"
done
for package in "${ours[@]}"; do
  dpkg-deb -x "$package" "$sysroot.new"
done
# Absolute links would leave the folder.
find "$sysroot.new" -xdev -type l -lname '/*' | while read -r link; do
  ln -sfr "$sysroot.new$(readlink "$link")" "$link"
done
# What packages leave to the choice of their scripts (update-alternatives).
for library in blas lapack; do
  for path in "$sysroot.new"/usr/lib/*/$library/lib$library.so.3; do
    [ ! -e "$path" ] || ln -sf "$library/${path##*/}" "${path%/*/*}/${path##*/}"
  done
done
printf '%s\n' $wanted | sort -u >"$sysroot.new/.complete"
rm -rf "$sysroot"
mv "$sysroot.new" "$sysroot"
echo "sysroot: $(find "$work/cache/archives" -name '*.deb' | wc -l) packages in $sysroot, $(du -sh "$sysroot" | cut -f1)"
