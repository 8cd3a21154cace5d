#!/bin/sh
# Builds the interactive page into python/filippov/app/static: the engine as WebAssembly and, where Node.js is, the front.
# What cannot be built here is skipped with a line that names what is missing; everything else works without the page.

set -eu
CARGO=${CARGO:-cargo}
static=python/filippov/app/static
target=wasm32-unknown-unknown
built=target/$target/web

skip() {
    echo "skipped: $1"
    shift
    for line in "$@"; do echo "   $line"; done
}

has_target() {
    libraries=$(rustc --print target-libdir --target $target 2>/dev/null) && ls "$libraries"/libstd-*.rlib >/dev/null 2>&1
}

# Debian has a newer compiler for browsers, without the ready library of the target.
debian_rustc() {
    command -v dpkg >/dev/null 2>&1 || return 1
    compiler=$(dpkg -L rustc-web 2>/dev/null | grep '/bin/rustc$' | head -n 1)
    linker=$(command -v wasm-ld || command -v wasm-ld-22 || true)
    [ -n "$compiler" ] && [ -n "$linker" ] && dpkg -s rust-web-src >/dev/null 2>&1
}

build_engine() {
    # Functions are copied to where they are called only if they are very short: a twentieth less to load.
    export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS="-Cllvm-args=--inline-threshold=4"
    if has_target || { command -v rustup >/dev/null 2>&1 && rustup target add $target; }; then
        "$CARGO" build --profile web --target $target -p filippov-web -p filippov-text
    elif debian_rustc; then
        RUSTC=$compiler RUSTC_BOOTSTRAP=1 CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$linker \
            "$CARGO" build --profile web --target $target -p filippov-web -p filippov-text -Zbuild-std=std,panic_abort
    else
        skip "the engine of the page needs the Rust target $target" \
            "with rustup: rustup target add $target" \
            "on Debian 12: sudo apt-get install rustc-web rust-web-src lld-22"
        return
    fi
    mkdir -p $static
    for module in web text; do
        case $module in web) name=filippov ;; text) name=filippov_text ;; esac
        cp $built/filippov_$module.wasm $static/$name.wasm
        echo "$static/$name.wasm: $(gzip -9 -c $static/$name.wasm | wc -c) bytes, compressed"
    done
}

build_front() {
    [ -f web/package.json ] || return 0
    if ! command -v npm >/dev/null 2>&1; then
        skip "the front of the page needs Node.js with npm" "on Debian: sudo apt-get install nodejs npm"
        return
    fi
    [ web/node_modules/.package-lock.json -nt web/package-lock.json ] || npm --prefix web ci --no-audit --no-fund
    npm --prefix web run build
}

build_engine
build_front
