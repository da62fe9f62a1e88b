# What fuzz/run and fuzz/long share; both are in this folder when they read it.

all_targets=(packed lexi ply entropy scene dictionary colmap transforms cameras_json)
corpus=${FUZZ_CORPUS:-$PWD/corpus}
toolchain=${FUZZ_TOOLCHAIN:-nightly}

# Builds all targets; sets where the programs are, and writes the seeds.
build() {
  cargo "+$toolchain" fuzz build
  local host
  host=$(rustc "+$toolchain" -vV | sed -n 's/^host: //p')
  programs=${CARGO_TARGET_DIR:-target}/$host/release
  "$programs/seeds" "$corpus"
}

# fuzz PROGRAMS TARGET SECONDS LOG: one run; its exit status is libFuzzer's.
fuzz() {
  # One allocation and all memory, the sanitizer's included, in MiB. The time for one input, in seconds, is that of a
  # clock on the wall, and long because machines are busy; the slowest ones over a second are kept.
  local options=(-malloc_limit_mb=512 -rss_limit_mb=2048 -timeout="${FUZZ_TIMEOUT:-60}" -report_slow_units=1)
  case $2 in
    ply) options+=(-max_len=16384 -dict=dictionaries/ply.dict) ;;
    lexi | packed | dictionary) options+=(-max_len=16384) ;;
    cameras_json | transforms) options+=(-max_len=8192 -dict=dictionaries/json.dict) ;;
    colmap) options+=(-max_len=8192 -dict=dictionaries/colmap.dict) ;;
    *) options+=(-max_len=2048) ;;
  esac
  mkdir -p "artifacts/$2" "$corpus/$2"
  "$1/$2" "$corpus/$2" -artifact_prefix="artifacts/$2/" -max_total_time="$3" -print_final_stats=1 \
    "${options[@]}" 2>"$4"
}
