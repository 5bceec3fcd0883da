#!/usr/bin/env bash
# schemathesis against a server of its own: tests/schemathesis/run.sh [EXAMPLES], so many for each operation, 100 unless said otherwise;
# ROOST is the binary, if one is built.
#
# Wants Python 3 with venv, and the network once: schemathesis comes from PyPI into target/schemathesis. Ends with its report; what it
# said of every failure is above, with a line of curl that repeats it. What it cannot know stands in
# schemathesis.toml; and a scenario may have the right fields and still be one that cannot run, so that not all that fits its schema is taken.
set -euo pipefail
cd "$(dirname "$0")/../.."
version=4.32.5
here=$PWD/tests/schemathesis
out=$PWD/target/schemathesis
[ -x "$out/venv/bin/schemathesis" ] || python3 -m venv "$out/venv"
"$out/venv/bin/pip" install --quiet --disable-pip-version-check "schemathesis==$version"

[ -n "${ROOST:-}" ] || cargo build
roost=${ROOST:-target/debug/roost}
data=$(mktemp -d)
address=127.0.0.1:${PORT:-7393}
token=$("$roost" token create --data "$data" --scope admin --name schemathesis)
"$roost" serve --listen "$address" --data "$data" --max-subparticles 20000 > "$out/server.log" 2>&1 &
server=$!
trap 'kill $server; rm -rf "$data"' EXIT

# It keeps notes where it is called.
cd "$out"
SCHEMATHESIS_HOOKS=$here/hooks.py "$out/venv/bin/schemathesis" --config-file "$here/schemathesis.toml" run "http://$address/openapi.json" \
    --wait-for-schema 20 --request-timeout 40 --header "Authorization: Bearer $token" --checks all \
    --exclude-checks positive_data_acceptance --max-examples "${1:-100}" --seed "${SEED:-1}" --continue-on-failure --generation-database none
kill -0 $server
