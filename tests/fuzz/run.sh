#!/bin/sh
# Run fuzz targets one after the other: run.sh FOLDER SECONDS NAME...
# New inputs go to FOLDER/corpus/NAME, findings to FOLDER/found/; a line a target goes to FOLDER/results.csv.
set -eu
dir=$1 seconds=$2
shift 2
here=$(dirname "$0")
status=0
for name; do
    mkdir -p "$dir/corpus/$name" "$dir/found" "$dir/log"
    kept=$here/corpus/$name
    [ -d "$kept" ] || kept=
    printf '%-10s ' "$name"
    code=0
    # leaks count; a stuck input is a finding after 10 s; so is more than 1 GB at a time
    "$dir/fuzz_$name" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -malloc_limit_mb=1024 -max_len=16384 \
        -print_final_stats=1 -artifact_prefix="$dir/found/$name-" "$dir/corpus/$name" $kept >"$dir/log/$name" 2>&1 || code=$?
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$dir/log/$name")
    edges=$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$dir/log/$name" | tail -n 1)
    inputs=$(ls "$dir/corpus/$name" | wc -l)
    bytes=$(cat "$dir/corpus/$name"/* 2>/dev/null | wc -c)
    result=clean
    [ "$code" -eq 0 ] || { result="finding (see $dir/log/$name)"; status=1; }
    echo "${runs:-?} runs in $seconds s, $edges edges, corpus $inputs inputs $bytes bytes: $result"
    [ -f "$dir/results.csv" ] || echo 'target,seconds,runs,edges,inputs,bytes,result' >"$dir/results.csv"
    echo "$name,$seconds,${runs:-},${edges:-},$inputs,$bytes,$result" >>"$dir/results.csv"
done
exit $status
