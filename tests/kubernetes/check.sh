#!/usr/bin/env bash
# The manifests in deploy/kubernetes against the schemas of Kubernetes and KEDA:
#
#   tests/kubernetes/check.sh                 Kubernetes 1.29, 1.33 and 1.37
#   tests/kubernetes/check.sh 1.34            another version
#
# Requires Python 3.11 with venv, and the network once: the packages come from PyPI into target/kubernetes. Where `kubectl` or `kustomize`
# is installed, the result of each kustomization is checked as well. No cluster is used.
# The program kubeconform is not used: neither PyPI, npm, crates.io nor Debian 12 has it.
set -euo pipefail
cd "$(dirname "$0")/../.."
venv=target/kubernetes/venv
[[ -x $venv/bin/python ]] || python3 -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check --requirement tests/kubernetes/requirements.txt

files=(deploy/kubernetes/*.yaml deploy/kubernetes/*/*.yaml)
rendered=$(mktemp -d)
trap 'rm -rf "$rendered"' EXIT
for folder in deploy/kubernetes deploy/kubernetes/postgres deploy/kubernetes/keda; do
    out=$rendered/$(basename "$folder").yaml
    if command -v kubectl > /dev/null; then kubectl kustomize "$folder" > "$out"
    elif command -v kustomize > /dev/null; then kustomize build "$folder" > "$out"
    else echo "$folder is not rendered: neither kubectl nor kustomize is installed" >&2; continue; fi
    files+=("$out")
done
[[ $# -gt 0 ]] || set -- 1.29 1.33 1.37
"$venv/bin/python" tests/kubernetes/check.py "$(IFS=,; echo "$*")" "${files[@]}"
