# Sourced by the other scripts: goes to the project's root, sets up what is missing, tells the build where it is.
# Needs cargo, a C compiler and Python 3.11 or newer; no root.
set -euo pipefail
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '%s\n' "$*" >&2; }
fail() { say "error: $*"; exit 1; }

command -v cargo >/dev/null || fail "cargo was not found; install Rust with rustup (https://rustup.rs)"
command -v cc >/dev/null || fail "no C compiler (cc) was found; install gcc"

# A Python environment of the project's own in .venv with the packages pinned in the file given.
python_environment() {
    local pinned=$1 stamp=.venv/${1##*/}
    cmp -s "$pinned" "$stamp" && return
    command -v python3 >/dev/null || fail "python3 was not found; Python 3.11 or newer is needed"
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
        fail "python3 is $(python3 --version); 3.11 or newer is needed"
    say "Setting up Python packages in .venv ..."
    [ -x .venv/bin/pip ] || {
        rm -rf .venv
        python3 -m venv .venv >/dev/null 2>&1 || { rm -rf .venv; python3 -m virtualenv -q .venv >/dev/null 2>&1; } ||
            fail "python3 cannot make a virtual environment; install python3-venv (Debian's name for it) or virtualenv"
    }
    .venv/bin/python -m pip install --quiet --disable-pip-version-check -r "$pinned" ||
        fail "the packages in $pinned could not be installed"
    cp "$pinned" "$stamp"
}

# The fmi crate generates its C bindings with libclang: the system's where LIBCLANG_PATH says so, else the one from PyPI,
# which lacks the compiler's own headers.
libclang() {
    [ -n "${LIBCLANG_PATH:-}" ] && return
    python_environment scripts/requirements-build.txt
    LIBCLANG_PATH=$(.venv/bin/python -c 'import clang, pathlib; print(pathlib.Path(clang.__file__).parent / "native")')
    export LIBCLANG_PATH
    export BINDGEN_EXTRA_CLANG_ARGS="-I$(cc -print-file-name=include) ${BINDGEN_EXTRA_CLANG_ARGS:-}"
}

# The program and the two libraries; cargo shows its progress only where somebody can watch it.
build() {
    local quiet=--quiet
    [ -t 2 ] && quiet=
    cargo build --release --locked $quiet
}
