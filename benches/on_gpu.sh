#!/bin/bash
# Checks and measures krylux on a machine with a GPU that has no compiler, in a few minutes:
#
#   benches/on_gpu.sh collect FOLDER    builds the program, its tests and the benchmark here, and copies them to FOLDER
#   benches/on_gpu.sh run FOLDER        runs them there, from the root of the repository
#
# Tests find the repository under the path where they were built; a link there will do.
set -u
task=${1:?collect or run}
folder=${2:?a folder}

if [ "$task" = collect ]; then
    set -eo pipefail
    mkdir -p "$folder"
    rm -f "$folder"/test-* "$folder/device" "$folder/krylux"
    cargo build --release --locked
    # Names and files of all test programs, and of the benchmark.
    { cargo test --release --locked --no-run --message-format=json; cargo bench --locked --bench device --no-run --message-format=json; } |
        sed -n 's/.*"target":{"kind":\["\([a-z]*\)".*"name":"\([a-z_]*\)".*"executable":"\([^"]*\)".*/\1 \2 \3/p' |
        while read -r kind name file; do
            case "$kind $name" in
                "bench device") cp "$file" "$folder/device" ;;
                "lib krylux") cp "$file" "$folder/test-unit" ;;
                "test library") cp "$file" "$folder/test-$name" ;;
            esac
        done
    cp target/release/krylux "$folder/krylux"
    strip "$folder"/*
    exit
fi

export KRYLUX_CACHE= XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-/tmp}
krylux=$folder/krylux
status=0
"$krylux" info 2>&1 | head -20

echo; echo "## The benchmark"
timeout 100 "$folder/device" || { echo "FAILED: the benchmark"; status=1; }

echo; echo "## Whole processes: three runs of 50 photos each"
runs=$(mktemp -d)
for side in 128 512 1024; do
    for scene in corner cornell; do
        line="$scene ${side}²:"
        for turn in 1 2 3; do
            before=$(date +%s%N)
            "$krylux" eigs "assets/scenes/$scene/scene.glb" --size $side --photos 50 --tolerance 1e-13 --no-check -q -o "$runs/$scene-$side-$turn" || status=1
            line="$line $(( ($(date +%s%N) - before) / 1000000 )) ms"
        done
        echo "$line"
    done
done

[ -e "$folder/test-library" ] || { echo "FAILED: no tests of the library were copied"; status=1; }
for program in "$folder"/test-*; do
    echo; echo "## $(basename "$program"), 12 threads"
    # Of the library's tests, those that use the device.
    filters=(); [ "$(basename "$program")" = test-library ] && filters=(render:: transport:: analysis::)
    timeout 150 "$program" "${filters[@]}" --test-threads 12 -q 2>&1 | grep -v '^\.*$\|^[0-9/ .]*$' | tail -${LINES_OF_TESTS:-15}
    [ "${PIPESTATUS[0]}" = 0 ] || { echo "FAILED: $(basename "$program")"; status=1; }
done
exit $status
