# Sourced by the other scripts: goes to the project's root, sets up what is missing, tells the build where it is.
# Needs cargo, a C compiler and Python 3.11 or newer; no root.
set -euo pipefail
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '%s\n' "$*" >&2; }
fail() { say "error: $*"; exit 1; }

command -v cargo >/dev/null || fail "cargo was not found; install Rust with rustup (https://rustup.rs)"
command -v cc >/dev/null || fail "no C compiler (cc) was found; install gcc"

# environment FOLDER REQUIREMENTS [options of pip]: a Python environment with what the file pins, made anew when the file
# changes. Fails where the packages cannot be installed; pip's words are in FOLDER.log then.
environment() {
    local folder=$1 requirements=$2
    cmp -s "$requirements" "$folder/requirements.txt" && return
    command -v python3 >/dev/null || fail "python3 was not found; Python 3.11 or newer is needed"
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
        fail "python3 is $(python3 --version); 3.11 or newer is needed"
    say "Setting up Python packages in $folder ..."
    rm -rf "$folder"
    mkdir -p "$(dirname "$folder")"
    python3 -m venv "$folder" >/dev/null 2>&1 || { rm -rf "$folder"; python3 -m virtualenv -q "$folder" >/dev/null 2>&1; } ||
        fail "python3 cannot make a virtual environment; install python3-venv (Debian's name for it) or virtualenv"
    if ! "$folder/bin/python" -m pip install --quiet --disable-pip-version-check "${@:3}" -r "$requirements" >"$folder.log" 2>&1
    then
        rm -rf "$folder"
        return 1
    fi
    rm "$folder.log"
    cp "$requirements" "$folder/requirements.txt"
}

# The project's own environment.
python_environment() {
    environment .venv scripts/requirements.txt || { cat .venv.log >&2; fail "the packages in scripts/requirements.txt could not be installed"; }
}

# `cargo zigbuild` and the zig it links with, for libraries that load on older Linux.
portable_environment() {
    environment .venv-portable scripts/requirements-portable.txt && export PATH="$PWD/.venv-portable/bin:$PATH"
}

# An environment for each client of the FMUs in tests/clients; one that cannot be had is skipped by its test.
client_environments() {
    local file name
    for file in tests/clients/requirements/*.txt; do
        name=$(basename "$file" .txt)
        environment ".venv-clients/$name" "$file" --no-deps || say "warning: the packages of $name could not be installed"
    done
}

# The fmi crate generates its C bindings with libclang: the system's where LIBCLANG_PATH says so, else the one from PyPI,
# which lacks the compiler's own headers.
libclang() {
    [ -n "${LIBCLANG_PATH:-}" ] && return
    environment .venv-build scripts/requirements-build.txt || { cat .venv-build.log >&2; fail "libclang could not be installed"; }
    LIBCLANG_PATH=$(.venv-build/bin/python -c 'import clang, pathlib; print(pathlib.Path(clang.__file__).parent / "native")')
    export LIBCLANG_PATH
    export BINDGEN_EXTRA_CLANG_ARGS="-I$(cc -print-file-name=include) ${BINDGEN_EXTRA_CLANG_ARGS:-}"
}

# The program and the two libraries; cargo shows its progress only where somebody can watch it.
build() {
    local quiet=--quiet
    [ -t 2 ] && quiet=
    cargo build --release --locked $quiet --features lovines/fmu
}
