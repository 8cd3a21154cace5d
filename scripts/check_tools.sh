#!/bin/sh
# Names what is missing on this machine, with the command that installs it. Argument: "lint" or nothing.

PYTHON=${PYTHON:-python3}
CARGO=${CARGO:-cargo}
oldest_rust=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
failed=0

missing() {
    echo "missing: $1" >&2
    echo "   install it with: $2" >&2
    failed=1
}

if [ "${1:-}" = lint ]; then
    for part in fmt clippy; do
        "$CARGO" $part --version >/dev/null 2>&1 || missing "cargo $part" "rustup component add rustfmt clippy"
    done
    exit $failed
fi

case $(uname) in
    Darwin) python_command="brew install python3" ;;
    *) python_command="sudo apt-get install python3 python3-venv   (Debian, Ubuntu; dnf install python3 on Fedora)" ;;
esac
if ! command -v "$PYTHON" >/dev/null 2>&1; then
    missing "$PYTHON" "$python_command"
elif ! "$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 10))'; then
    missing "Python 3.10 or newer ($("$PYTHON" --version) is here; or name another one: make PYTHON=python3.12 ...)" \
        "$python_command"
elif ! "$PYTHON" -c 'import venv, ensurepip' 2>/dev/null; then
    missing "the venv module of $PYTHON" "sudo apt-get install python3-venv   (Debian, Ubuntu)"
fi

if ! command -v "$CARGO" >/dev/null 2>&1; then
    missing "$CARGO, the build tool of Rust" "curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh"
else
    version=$("$CARGO" --version | cut -d' ' -f2)
    first=$(printf '%s\n%s\n' "$oldest_rust" "$version" | sort -V | head -n 1)
    [ "$first" = "$oldest_rust" ] || missing "Rust $oldest_rust or newer (cargo $version is here)" "rustup update stable"
fi
if ! command -v cc >/dev/null 2>&1 && ! command -v gcc >/dev/null 2>&1 && ! command -v clang >/dev/null 2>&1; then
    case $(uname) in
        Darwin) missing "a linker (cc)" "xcode-select --install" ;;
        *) missing "a linker (cc)" "sudo apt-get install build-essential   (Debian, Ubuntu)" ;;
    esac
fi
exit $failed
