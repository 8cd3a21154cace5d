#!/bin/sh
# Install a wheel or an archive of sources into a fresh environment, and run the README with it, away from the
# repository. Arguments: the Python to use, and the package. A wheel is installed without Rust on the path.
set -eu

python=$1
shift
[ $# -eq 1 ] || { echo "one package is checked, and there are several: $*; remove those of earlier builds" >&2; exit 1; }
package=$1
[ -f "$package" ] || { echo "there is no package $package: make build-release, or make sdist" >&2; exit 1; }
root=$(cd "$(dirname "$0")/.." && pwd)
package=$(cd "$(dirname "$package")" && pwd)/$(basename "$package")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

"$python" -m venv "$folder/venv"
bin=$folder/venv/bin
[ -d "$bin" ] || bin=$folder/venv/Scripts
case $package in
    *.whl)
        mkdir "$folder/no_rust"
        for tool in cargo rustc cc gcc clang; do
            printf '#!/bin/sh\necho "a wheel needs no %s" >&2\nexit 1\n' "$tool" >"$folder/no_rust/$tool"
            chmod +x "$folder/no_rust/$tool"
        done
        PATH=$folder/no_rust:$PATH
        ;;
esac
"$bin/python" -m pip install --quiet --disable-pip-version-check "$package" matplotlib scipy pandas xarray
cp "$root/README.md" "$root/scripts/readme_blocks.py" "$folder/"
mkdir "$folder/pictures"
cd "$folder"
unset PYTHONPATH
MPLBACKEND=Agg "$bin/python" readme_blocks.py README.md pictures
"$bin/filippov" --version
(cd pictures && "../venv/${bin##*/}/filippov" demo dry_friction)
"$bin/python" - <<'EOF'
import pathlib

import filippov

where = pathlib.Path(filippov.__file__)
assert "venv" in where.parts, where
assert len(list(pathlib.Path("pictures").glob("*.png"))) >= 3
print("the README runs with", filippov.__version__, "from", where.parent.name)
EOF
