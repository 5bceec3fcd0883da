# shellcheck shell=bash
# Ceph of one machine on loopback, for radosgw.sh: a monitor, a disk (bluestore in a file) and a gateway that speaks as S3 does. Everything
# is in the temporary folder `$here`, and ends with the script that sources this file. Wants Debian's ceph-mon, ceph-osd and radosgw.

here=$(mktemp -d)
daemons=()
gateway=
finish() {
    local status=$?
    # The gateway first: it waits for the others.
    for daemon in "$gateway" "${daemons[@]}"; do
        [[ -z $daemon ]] || kill -KILL "$daemon" 2> /dev/null || true
    done
    wait 2> /dev/null || true
    if ((status)); then echo "failed; logs are in $here" >&2; else rm -rf "$here"; fi
}
trap finish EXIT

port=${PORT:-27300}
s3=http://127.0.0.1:$((port + 9))
export CEPH_CONF=$here/ceph.conf

# Starts monitor and disk. Daemons and commands have their keys in one file.
start_ceph() {
    local fsid uuid
    fsid=$(python3 -c 'import uuid; print(uuid.uuid4())')
    uuid=$(python3 -c 'import uuid; print(uuid.uuid4())')
    mkdir "$here/mon" "$here/osd"
    cat > "$CEPH_CONF" << END
[global]
fsid = $fsid
mon host = [v2:127.0.0.1:$port,v1:127.0.0.1:$((port + 1))]
public addr = 127.0.0.1
cluster addr = 127.0.0.1
ms bind port min = $((port + 20))
ms bind port max = $((port + 60))
keyring = $here/keyring
run dir = $here
admin socket = $here/\$name.\$pid.asok
log file = $here/\$name.log
crash dir = $here
mon data = $here/mon
mon allow pool size one = true
mon data avail warn = 1
mon data avail crit = 0
osd data = $here/osd
osd objectstore = bluestore
bluestore block path =
bluestore block create = true
bluestore block size = 4294967296
osd memory target = 939524096
osd pool default size = 1
osd pool default min size = 1
osd pool default pg num = 4
osd pool default pgp num = 4
osd pool default pg autoscale mode = off
osd crush chooseleaf type = 0
rgw frontends = beast endpoint=127.0.0.1:$((port + 9))
rgw dns name =
rgw relaxed s3 bucket names = false
END
    monmaptool --create --fsid "$fsid" --addv a "[v2:127.0.0.1:$port,v1:127.0.0.1:$((port + 1))]" "$here/monmap" > "$here/monmap.out"
    ceph-authtool --create-keyring "$here/keyring" --gen-key --name mon. --cap mon 'allow *' > "$here/keyring.out"
    for name in client.admin client.rgw.a; do
        ceph-authtool "$here/keyring" --gen-key --name $name --cap mon 'allow *' --cap osd 'allow *' >> "$here/keyring.out"
    done
    ceph-mon --id a --mkfs --monmap "$here/monmap" --keyring "$here/keyring"
    ceph-mon --id a --foreground > "$here/mon.out" 2>&1 &
    daemons+=($!)
    timeout 60 ceph osd new "$uuid" > "$here/osd.out"
    timeout 60 ceph auth get-or-create osd.0 mon 'allow profile osd' osd 'allow *' >> "$here/keyring"
    ceph-osd --id 0 --mkfs --osd-uuid "$uuid" >> "$here/osd.out" 2>&1
    ceph-osd --id 0 --foreground >> "$here/osd.out" 2>&1 &
    daemons+=($!)
    until timeout 10 ceph osd stat 2> /dev/null | grep --quiet '1 up'; do kill -0 "${daemons[@]}"; sleep 0.5; done
}

# Starts the gateway, and waits until it answers.
start_gateway() {
    radosgw --name client.rgw.a --foreground >> "$here/rgw.out" 2>&1 &
    gateway=$!
    until curl --silent --output /dev/null --max-time 5 "$s3/"; do kill -0 "$gateway"; sleep 0.5; done
}
