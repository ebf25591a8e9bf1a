#!/usr/bin/env bash
# Makes the root of femxdem.def as Apptainer would, and runs a case in it by chroot, as another user. As root:
#
#   bash validation/container/run.sh FOLDER      # FOLDER: for the root, about 4 GB; keeps it
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
readonly RECIPE=validation/container/femxdem.def ROOT=${1:?a folder for the root}

field() { sed -n "s/^$1: //p" "$RECIPE"; }
section() { awk -v name="%$1" '/^%/ { on = $1 == name; next } on' "$RECIPE"; }
within() { chroot "$ROOT" env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "$@"; }

[[ -x $ROOT/bin/bash ]] || debootstrap --variant=minbase "$(field OSVersion)" "$ROOT" "$(field MirrorURL)"
mount --bind /proc "$ROOT/proc"
mount --bind /dev "$ROOT/dev"
trap 'umount "$ROOT/proc" "$ROOT/dev"' EXIT
cp /etc/resolv.conf "$ROOT/etc/"
APPTAINER_ROOTFS=$ROOT bash -euc "$(section setup)"
SECONDS=0
within sh -c "$(section post)"
echo "post: $SECONDS s, root: $(du -shx "$ROOT" | cut -f1)"
within sh -c "$(section test)"
install -m 644 -D tests/program/small.toml "$ROOT/srv/case.toml"
install -d -m 777 "$ROOT/srv/out"
within setpriv --reuid=nobody --regid=nogroup --clear-groups sh -c 'cd /srv/out && femxdem run ../case.toml --out small && femxdem report small'
