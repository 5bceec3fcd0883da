#!/usr/bin/env bash
# The store of objects against a bucket: starts moto, which speaks as S3 does, on loopback, and runs the test that needs one.
#
# Wants Python 3 with venv, curl, and the network once: moto comes from PyPI into target/s3.
set -euo pipefail
cd "$(dirname "$0")/../.."
version=5.2.5
venv=$PWD/target/s3/venv
[ -x "$venv/bin/pip" ] || python3 -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check "moto[server]==$version"

address=127.0.0.1:${PORT:-7394}
"$venv/bin/moto_server" --host "${address%:*}" --port "${address#*:}" > target/s3/moto.log 2>&1 &
moto=$!
trap 'kill $moto' EXIT
until curl --silent --output /dev/null "http://$address/"; do kill -0 $moto; sleep 0.2; done
curl --silent --fail --output /dev/null --request PUT "http://$address/roost-test"

export AWS_ENDPOINT_URL=http://$address AWS_ALLOW_HTTP=true AWS_REGION=us-east-1
export AWS_ACCESS_KEY_ID=test AWS_SECRET_ACCESS_KEY=test ROOST_TEST_BUCKET=s3://roost-test/some/where
cargo test --package roost-server --features s3 --lib -- --include-ignored --exact store::objects::tests::object_life_cycle_in_a_bucket
grep -oE '(DELETE|GET|HEAD|POST|PUT) /' target/s3/moto.log | sort | uniq -c   # what was asked of it
