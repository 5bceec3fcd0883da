#!/usr/bin/env bash
# Objects in a bucket of Ceph's radosgw: the test that run.sh runs on moto, and a farm that is disturbed while it works (radosgw.py).
#
#   tests/s3/radosgw.sh          some ten minutes on two cores
#   ROOST=… LIFE=0 tests/s3/radosgw.sh     another binary, which has the feature s3; without the test of run.sh
#
# Wants Debian's ceph-mon, ceph-osd, radosgw and ceph-common, curl, Python 3 with venv, and the network once: boto3 and blake3 come from
# PyPI into target/s3. Everything else is in a temporary folder on loopback, from port 27300 (PORT) on, and ends with the script.
set -euo pipefail
cd "$(dirname "$0")/../.."
roost=${ROOST:-}
if [[ -z $roost ]]; then
    cargo build --bin roost --features s3
    roost=$PWD/target/debug/roost
fi
venv=$PWD/target/s3/venv
[[ -x $venv/bin/pip ]] || python3 -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check boto3==1.44.8 blake3==1.0.11

source tests/s3/ceph.sh
start_ceph
# The first owns the buckets. The server is the second.
for user in owner roost; do
    radosgw-admin user create --uid $user --display-name $user --access-key $user-key --secret-key $user-secret > "$here/$user.json" 2>> "$here/admin.log"
done
radosgw --version

if [[ ${LIFE:-1} == 1 ]]; then
    start_gateway
    export AWS_ENDPOINT_URL=$s3 AWS_ALLOW_HTTP=true AWS_REGION=us-east-1 AWS_ACCESS_KEY_ID=roost-key AWS_SECRET_ACCESS_KEY=roost-secret
    "$venv/bin/python" -c 'import boto3; boto3.client("s3").create_bucket(Bucket="roost-test")'
    ROOST_TEST_BUCKET=s3://roost-test/some/where cargo test --package roost-server --features s3 --lib -- \
        --include-ignored --exact store::objects::tests::object_life_cycle_in_a_bucket
    kill "$gateway"
    wait "$gateway" || true
    gateway=
fi
"$venv/bin/python" tests/s3/radosgw.py "$roost" "$here" "$s3"
