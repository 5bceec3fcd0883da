#!/usr/bin/env bash
# Fuzzes one target after the other: tests/fuzz/run.sh [SECONDS [TARGET...]], 600 s each unless said otherwise.
#
# Wants `cargo install cargo-fuzz` and a nightly toolchain. Begins with the project's own examples and keeps what it learns in
# target/fuzz/corpus. ROOST is the binary that makes a run for it, if one is built. What makes a target fail lies in target/fuzz/artifacts afterwards.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=${1:-600}
targets=("${@:2}")
[ ${#targets[@]} -gt 0 ] || targets=(scenario sweep stl frames result checkpoint)
out=$PWD/target/fuzz
seeds=$out/seeds
rm -rf "$seeds"
mkdir -p "$seeds"/{scenario,sweep,stl,frames,result,checkpoint}

# Scenarios and sweeps: every JSON document of the pages, and the smallest scenario of each experiment.
documents=$(mktemp -d)
trap 'rm -rf "$documents"' EXIT
awk -v out="$documents/" '
    /^```$/ || /^JSON$/ { if (file) close(file); file = "" }
    file { print > file }
    /^```json$/ || /<<.JSON.$/ { file = out (++count) ".json" }' README.md api.md docs/*.md docs/howto/*.md
cp src/demo/sweep.json "$documents"
cp "$documents"/* "$seeds/sweep"
grep -L '"design"' "$documents"/* | xargs -r cp -t "$seeds/scenario"
for experiment in hopper drop bend slide compress; do
    echo "{\"experiment\": \"$experiment\"}" > "$seeds/scenario/$experiment.json"
done
factor='"/equipment/belt_speed_m_s"'
factors='{"pointer": '$factor', "low": 0.1, "high": 0.4, "scale": "log"}, {"pointers": ["/equipment/gate_opening_m"], "low": 0.05, "high": 0.07},
 {"pointer": "/contact/fillet_belt/static_friction", "low": 0.1, "high": 0.9}'
base='"name": "seed", "base": {"experiment": "hopper"}'
for design in random latin_hypercube sobol; do
    echo "{$base, \"design\": {\"kind\": \"$design\", \"points\": 4, \"seed\": 2}, \"factors\": [$factors]}" > "$seeds/sweep/$design.json"
done
for design in grid one_at_a_time box_behnken; do
    echo "{$base, \"design\": {\"kind\": \"$design\"}, \"factors\": [$factors], \"replicates\": 2}" > "$seeds/sweep/$design.json"
done
echo "{$base, \"design\": {\"kind\": \"list\", \"rows\": [[0.2], [0.3]]}, \"factors\": [{\"pointer\": $factor}]}" > "$seeds/sweep/list.json"
echo "{$base, \"design\": {\"kind\": \"csv\", \"table\": \"${factor//\"/}\\n0.2\\n0.3\\n\"}}" > "$seeds/sweep/csv.json"

# The words of both: names of fields and their choices, as the tables of the pages have them.
grep -oh '`[a-z0-9_/]*`' docs/reference/*.md docs/sweeps.md api.md | tr -d '`' | tr '/' '\n' | sort -u | grep . |
    sed 's/.*/"\\"&\\""/' > "$out/words.dict"

# A tetrahedron, in text and in numbers.
corners=('0 0 0  0 9 0  9 0 0' '0 0 0  9 0 0  0 0 9' '0 0 0  0 0 9  0 9 0' '9 0 0  0 9 0  0 0 9')
{
    echo "solid tetrahedron"
    for corner in "${corners[@]}"; do
        read -r a b c d e f g h i <<< "$corner"
        echo "facet normal 0 0 0
outer loop
vertex $a $b $c
vertex $d $e $f
vertex $g $h $i
endloop
endfacet"
    done
    echo "endsolid tetrahedron"
} > "$seeds/stl/text.stl"
{
    printf '%-80s\x04\0\0\0' binary
    for corner in "${corners[@]}"; do
        printf '\0%.0s' {1..12}
        for number in $corner; do
            if [ "$number" = 9 ]; then printf '\0\0\x10\x41'; else printf '\0\0\0\0'; fi
        done
        printf '\0\0'
    done
} > "$seeds/stl/binary.stl"

# A small run: its stream of frames, whole and cut short, and its result.
echo '{"experiment": "drop", "product": {"subparticle_radius_m": 0.01}, "numerics": {"timestep_s": "auto", "duration_s": 0.1}}' > "$documents/run.json"
${ROOST:-cargo run --quiet --} run "$documents/run.json" -o "$documents/run" --frames "$documents/frames" --threads 1 2> "$documents/log" ||
    { cat "$documents/log" >&2; exit 1; }
cp "$documents/frames/run.roostframes" "$seeds/frames/whole.roostframes"
head -c -100 "$seeds/frames/whole.roostframes" > "$seeds/frames/cut.roostframes"
cp "$documents/run/result.json" "$seeds/result"

# Edits of a checkpoint: none, one, and a cut.
printf "" > "$seeds/checkpoint/none"
printf '\x10\0\0\0\x01' > "$seeds/checkpoint/one"
printf '\x80' > "$seeds/checkpoint/cut"

# The versions that everything else is built with.
cp Cargo.lock tests/fuzz/Cargo.lock
for target in "${targets[@]}"; do
    corpus=$out/corpus/$target
    mkdir -p "$corpus" "$out/artifacts/$target"
    options=(-max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -print_final_stats=1 -artifact_prefix="$out/artifacts/$target/")
    case $target in
        scenario | sweep | result) options+=(-dict="$out/words.dict") ;;
    esac
    echo "== $target: $seconds s"
    cargo +nightly fuzz run --fuzz-dir tests/fuzz --target-dir "$out/build" "$target" "$corpus" "$seeds/$target" -- "${options[@]}"
done
