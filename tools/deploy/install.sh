#!/bin/sh
# Installs the flying part on the glider's computer: 64-bit Raspberry Pi OS or another Debian with systemd. Run as root
# from the unpacked sources; `make deploy HOST=user@glider` does both. Again for a new version; files in /etc/glider stay.
#
# With DESTDIR=FOLDER it installs into that folder and touches neither users nor services: for a look, and for tests.
set -eu

cd "$(dirname "$0")/../.."
root=${DESTDIR:-}
python=${PYTHON:-python3}
say() { echo "install: $*"; }
refuse() { echo "install: $*" >&2; exit 2; }

"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || refuse "Python 3.11 or newer is needed"
"$python" -c 'import struct, sys; sys.exit(struct.calcsize("P") != 8)' || refuse "a 64-bit system is needed"
"$python" -c 'import venv, ensurepip' 2>/dev/null || refuse "python3-venv is needed: apt-get install python3-venv"
if [ -z "$root" ]; then
    [ "$(id -u)" = 0 ] || refuse "run as root"
    [ -d /run/systemd/system ] || refuse "systemd does not run here"
    for unit in $(systemctl list-units --plain --no-legend --state=active 'glider-flight@*' | cut -d' ' -f1); do
        refuse "$unit is under way"
    done
    getent passwd glider >/dev/null || useradd --system --home-dir /var/lib/glider --shell /usr/sbin/nologin glider
fi

say "program into $root/opt/glider"
mkdir -p "$root/opt"
[ -x "$root/opt/glider/bin/python" ] || "$python" -m venv "$root/opt/glider"
"$root/opt/glider/bin/python" -m pip install --quiet --disable-pip-version-check --upgrade --constraint constraints.txt .

say "units, rules, settings"
mkdir -p "$root/etc/systemd/system" "$root/etc/udev/rules.d" "$root/etc/glider" "$root/var/lib/glider/cache" \
    "$root/var/lib/glider/logs"
cp tools/deploy/glider-outofband.service 'tools/deploy/glider-flight@.service' "$root/etc/systemd/system/"
cp tools/deploy/60-glider.rules "$root/etc/udev/rules.d/"
for pair in tools/deploy/flight.env:flight.env hal/boards/roughie.toml:board.toml \
    firmware/model/vehicles/roughie.toml:vehicle.toml firmware/guidance/missions/sawtooth.toml:sawtooth.toml; do
    [ -e "$root/etc/glider/${pair#*:}" ] || cp "${pair%%:*}" "$root/etc/glider/${pair#*:}"
done

say "kernels, compiled here and not in flight"
export GLIDER_CACHE_DIR="$root/var/lib/glider/cache"
if [ -z "$root" ]; then
    chown -R glider:glider /var/lib/glider
    runuser -u glider -- env GLIDER_CACHE_DIR="$GLIDER_CACHE_DIR" /opt/glider/bin/glider check --compile
    udevadm control --reload || true
    systemctl daemon-reload
    systemctl enable --quiet glider-outofband.service
    systemctl restart glider-outofband.service
else
    (cd / && "$root/opt/glider/bin/glider" check --compile)
fi
say "done: put board.toml, vehicle.toml and missions into $root/etc/glider, then systemctl start glider-flight@MISSION"
