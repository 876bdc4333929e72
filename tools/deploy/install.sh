#!/bin/sh
# Installs a release on the glider's computer beside the one that flies, and switches to it when it has passed its
# self-check: 64-bit Raspberry Pi OS or another Debian with systemd. Run as root from the release's folder;
# `make deploy HOST=user@glider` brings it there and does so. No network is needed.
#
#   install.sh [install]     this release
#   install.sh rollback      back to the release before
#   install.sh list          what is installed; * is what flies
#
# /opt/glider/releases/NAME is a whole release, program and units; /opt/glider/current is a link to one. The switch is
# the renaming of that link: whatever breaks off before or after it, one whole release is what starts.
# With ROOT=FOLDER it installs into that folder and touches neither users nor services: for a look, and for tests.
set -eu

root=${ROOT:-}
python=${PYTHON:-python3}
opt=$root/opt/glider
etc=$root/etc/glider
state=$root/var/lib/glider
say() { echo "install: $*"; }
refuse() { echo "install: $*" >&2; exit 2; }
fail() { echo "install: $*" >&2; exit 1; }
current() { readlink "$opt/current" 2>/dev/null | sed 's|.*/||'; }
previous() { readlink "$opt/previous" 2>/dev/null | sed 's|.*/||'; }
written() { sed -n "s/^$2=//p" "$1/RELEASE" | head -n 1; }
as_glider() { if [ -z "$root" ]; then runuser -u glider -- "$@"; else "$@"; fi; }
link() { ln -sfn "$1" "$2.new" && mv -fT "$2.new" "$2"; } # a rename: the old target or the new one, never none

nobody_flies() {
    [ -n "$root" ] && return
    [ "$(id -u)" = 0 ] || refuse "run as root"
    [ -d /run/systemd/system ] || refuse "systemd does not run here"
    for unit in $(systemctl list-units --plain --no-legend --state=active,activating,deactivating 'glider-flight@*' |
        cut -d' ' -f1); do
        refuse "$unit is under way"
    done
}

alone() {
    mkdir -p "$opt/releases"
    exec 9>"$opt/lock"
    flock -n 9 || refuse "another installation is under way"
}

# Python, the machine and the files are those that the release was made for.
fits() {
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || refuse "Python 3.11 or newer is needed"
    "$python" -c 'import struct, sys; sys.exit(struct.calcsize("P") != 8)' || refuse "a 64-bit system is needed"
    for pair in "machine=$(uname -m)" \
        "python=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')"; do
        [ "$(written . "${pair%%=*}")" = "${pair#*=}" ] || refuse "made for another ${pair%%=*} than ${pair#*=}"
    done
    sha256sum --check --quiet --strict SHA256SUMS >&2 || refuse "damaged: bring it here again"
}

# Program and units, whole when WHOLE is there; what broke off before is begun again.
unpack() {
    here=$opt/releases/$name
    [ -e "$here/WHOLE" ] && return
    say "release $name into $here"
    rm -rf "$here"
    "$python" -m venv --without-pip "$here"
    "$here/bin/python" "$(echo wheels/pip-*.whl)/pip" install --quiet --disable-pip-version-check --no-index --find-links wheels \
        "underwater-glider==$(written . version)"
    cp -R RELEASE install.sh units "$here/"
    sed -i "s|@RELEASE@|$name|g" "$here"/units/*.service
    sync
    : >"$here/WHOLE"
}

# Folders and first files; what is in /etc/glider already stays.
prepare() {
    if [ -z "$root" ]; then
        getent passwd glider >/dev/null || useradd --system --home-dir /var/lib/glider --shell /usr/sbin/nologin glider
    fi
    mkdir -p "$etc" "$state/cache/$name" "$state/logs" "$root/etc/udev/rules.d" \
        "$root/etc/systemd/system/multi-user.target.wants" "$root/usr/local/bin"
    for file in first/*.toml units/flight.env; do
        [ -e "$etc/${file#*/}" ] || cp "$file" "$etc/"
    done
    [ -n "$root" ] || chown glider:glider "$state" "$state/logs" "$state/cache" "$state/cache/$name"
}

# A vehicle flies with compiled kernels, and the self-check refuses anything else; with ROOT=FOLDER and GLIDER_JIT=0 it
# may look without.
passes() {
    cache=$state/cache/$1 python=$opt/releases/$1/bin/python
    set --
    if [ -n "$root" ] && [ "${GLIDER_JIT:-}" = 0 ]; then set -- --plain "$cache/selfcheck.mcap"; fi
    (cd / && as_glider env GLIDER_CACHE_DIR="$cache" "$python" -m glider.tools.deploy.selfcheck \
        --files "$etc" --state "$state" "$@")
}

# The services lead through /opt/glider/current, so that they change with it.
services() {
    for unit in glider-outofband.service 'glider-flight@.service'; do
        link "/opt/glider/current/units/$unit" "$root/etc/systemd/system/$unit"
    done
    link ../glider-outofband.service "$root/etc/systemd/system/multi-user.target.wants/glider-outofband.service"
    link /opt/glider/current/units/60-glider.rules "$root/etc/udev/rules.d/60-glider.rules"
    link /opt/glider/current/bin/glider "$root/usr/local/bin/glider"
}

# The service that stands ready to bring the vehicle up says READY=1 and is there two seconds later.
starts() {
    [ -n "$root" ] && return
    systemctl daemon-reload
    udevadm control --reload 2>/dev/null || true
    systemctl restart glider-outofband.service && sleep 2 && systemctl --quiet is-active glider-outofband.service
}

# To release $1, from what flies now; back to that where the service of the new one does not start.
switch() {
    before=$(current)
    nobody_flies
    trap '' HUP INT TERM # a connection that breaks off changes nothing from here on
    link "releases/$1" "$opt/current"
    services
    sync
    if starts; then
        if [ -n "$before" ] && [ "$before" != "$1" ]; then link "releases/$before" "$opt/previous"; fi
        echo "$1" >"$opt/installed.new"
        sync
        mv -f "$opt/installed.new" "$opt/installed"
        return
    fi
    [ -n "$before" ] || fail "the service of $1 does not start, and there is no release before it"
    link "releases/$before" "$opt/current"
    sync
    starts || fail "the service of $1 does not start, nor does that of $before"
    fail "the service of $1 does not start: back to $before"
}

# All but what flies and the one before it.
prune() {
    for folder in "$opt"/releases/*; do
        case ${folder##*/} in "$(current)" | "$(previous)") ;; *) rm -rf "$folder" "$state/cache/${folder##*/}" ;; esac
    done
}

case ${1:-install} in
install)
    cd "$(dirname "$0")"
    name=$(written . release)
    [ -n "$name" ] && [ -f SHA256SUMS ] || refuse "this is no release: make deploy HOST=user@glider"
    nobody_flies
    fits
    alone
    if [ "$(current)" = "$name" ] && [ "$(cat "$opt/installed" 2>/dev/null)" = "$name" ]; then
        say "$name is installed: nothing to do"
        exit 0
    fi
    unpack
    prepare
    before=$(current)
    passes "$name" || fail "$name did not pass its self-check: ${before:-nothing} is still what flies"
    switch "$name"
    prune
    say "$name is what flies now; before: $(previous)"
    say "board.toml, vehicle.toml and missions are in $etc; systemctl start glider-flight@MISSION"
    ;;
rollback)
    nobody_flies
    alone
    name=$(previous)
    [ -n "$name" ] || refuse "there is no release before $(current)"
    passes "$name" || fail "$name did not pass its self-check: $(current) is still what flies"
    switch "$name"
    say "$name is what flies now; before: $(previous)"
    ;;
list)
    for folder in "$opt"/releases/*; do
        mark=' '
        [ "${folder##*/}" = "$(current)" ] && mark='*'
        [ -e "$folder/WHOLE" ] && echo "$mark ${folder##*/}"
    done
    ;;
*) refuse "install, rollback or list, not $1" ;;
esac
