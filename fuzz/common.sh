# Functions that fuzz/run and fuzz/long share. Both change to this folder before they read it.

all_targets=(packed feed lexi ply entropy scene dictionary colmap transforms cameras_json
  spz sog compressed_ply splat ksplat gltf)
corpus=${FUZZ_CORPUS:-$PWD/corpus}
toolchain=${FUZZ_TOOLCHAIN:-nightly}

# build [OPTION...]: builds all targets with options of `cargo fuzz build`, sets `programs` to the folder they are in, and
# writes the seeds.
build() {
  cargo "+$toolchain" fuzz build "$@"
  local host
  host=$(rustc "+$toolchain" -vV | sed -n 's/^host: //p')
  programs=${CARGO_TARGET_DIR:-target}/$host/release
  "$programs/seeds" "$corpus"
}

# fuzz PROGRAMS TARGET SECONDS LOG: runs one target and returns libFuzzer's exit status.
fuzz() {
  # Limits in MiB of one allocation and of all memory, the sanitizer's included. The limit in seconds for one input is
  # wall time; it is long because machines are busy. libFuzzer keeps the slowest inputs above one second.
  local options=(-malloc_limit_mb=512 -rss_limit_mb=2048 -timeout="${FUZZ_TIMEOUT:-60}" -report_slow_units=1)
  case $2 in
    ply) options+=(-max_len=16384 -dict=dictionaries/ply.dict) ;;
    lexi | packed | feed | dictionary | spz | compressed_ply | splat | ksplat) options+=(-max_len=16384) ;;
    cameras_json | transforms) options+=(-max_len=8192 -dict=dictionaries/json.dict) ;;
    colmap) options+=(-max_len=8192 -dict=dictionaries/colmap.dict) ;;
    sog) options+=(-max_len=32768) ;;
    gltf) options+=(-max_len=16384 -dict=dictionaries/json.dict) ;;
    *) options+=(-max_len=2048) ;;
  esac
  mkdir -p "artifacts/$2" "$corpus/$2"
  "$1/$2" "$corpus/$2" -artifact_prefix="artifacts/$2/" -max_total_time="$3" -print_final_stats=1 \
    "${options[@]}" 2>"$4"
}
