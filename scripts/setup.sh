# Sourced by the other scripts: changes to the project's root and provides functions that set up tools and build.
# For --help it prints the comment at the top of the script and ends. Needs cargo, a C compiler and Python 3.11 or newer; no root.
set -euo pipefail
for option in "$@"; do
    case $option in
        -h | --help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' "${BASH_SOURCE[-1]}"; exit ;;
    esac
done
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '%s\n' "$*" >&2; }
fail() { say "error: $*"; exit 1; }

command -v cargo >/dev/null || fail "cargo was not found; install Rust with rustup (https://rustup.rs)"
command -v cc >/dev/null || fail "no C compiler (cc) was found; install gcc"

target=$(realpath -m "${CARGO_TARGET_DIR:-target}")

# The libraries in the FMUs must not contain paths of this machine, which panic messages would bring in. (Cargo's
# trim-paths is not stable.) All builds need the same flags: cargo compiles everything again for others.
for folder in "${CARGO_HOME:-$HOME/.cargo}=/cargo" "$(rustc --print sysroot)=/rustc" "$PWD=/vines"; do
    case $folder in
        *" "*) say "warning: libraries will contain the path ${folder%=*}, because it has a space" ;;
        *) case " ${RUSTFLAGS:-} " in
            *" --remap-path-prefix=$folder "*) ;; # A script that another one calls.
            *) export RUSTFLAGS="${RUSTFLAGS:+$RUSTFLAGS }--remap-path-prefix=$folder" ;;
        esac ;;
    esac
done

# stage TEXT: announces a stage of a script.
stage() { say "== $*"; }

# progress SUBCOMMAND [ARGUMENT ...]: runs cargo, with its progress bar in a terminal and silently elsewhere.
progress() {
    if [ -t 2 ]; then
        cargo "$@"
    else
        cargo "$1" --quiet "${@:2}"
    fi
}

# rust_tool NAME VERSION [options of cargo install]: a program of a crate, in target/tools/bin, which comes first in PATH. The first call
# builds it, some minutes.
rust_tool() {
    local tools=$target/tools
    export PATH="$tools/bin:$PATH"
    ! grep -qs "^\"$1 $2 " "$tools/.crates.toml" || return 0
    stage "Installing $1 $2 (some minutes)"
    cargo install "$1" --quiet --locked --force --version "$2" --root "$tools" --target-dir "$tools/build" "${@:3}"
    rm -rf "$tools/build"
}

# environment FOLDER REQUIREMENTS [options of pip]: a Python environment with the packages of a requirements file. Those of the
# scripts have the hash of every package. It is created again when the file changes. If the packages cannot be installed, it returns 1 and leaves pip's output in FOLDER.log.
environment() {
    local folder=$1 requirements=$2 hashes=()
    [ "${requirements%/*}" != scripts ] || hashes=(--require-hashes)
    cmp -s "$requirements" "$folder/requirements.txt" && return
    command -v python3 >/dev/null || fail "python3 was not found; Python 3.11 or newer is needed"
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
        fail "python3 is $(python3 --version); 3.11 or newer is needed"
    stage "Python packages in $folder"
    rm -rf "$folder"
    mkdir -p "$(dirname "$folder")"
    python3 -m venv "$folder" >/dev/null 2>&1 || { rm -rf "$folder"; python3 -m virtualenv -q "$folder" >/dev/null 2>&1; } ||
        fail "python3 cannot create a virtual environment; install python3-venv (name of the Debian package) or virtualenv"
    if ! "$folder/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile "${hashes[@]}" "${@:3}" -r "$requirements" >"$folder.log" 2>&1
    then
        rm -rf "$folder"
        return 1
    fi
    rm "$folder.log"
    cp "$requirements" "$folder/requirements.txt"
}

# The environment of the project's own Python code.
python_environment() {
    environment .venv scripts/requirements.txt || { cat .venv.log >&2; fail "the packages in scripts/requirements.txt could not be installed"; }
}

# The environment that builds and tests the Python package.
package_environment() {
    environment .venv-python scripts/requirements-python.txt ||
        { cat .venv-python.log >&2; fail "the packages in scripts/requirements-python.txt could not be installed"; }
}

# Builds the wheel, in target/wheels, and installs it in that environment.
python_package() {
    local python=$PWD/.venv-python/bin/python pip=(-m pip --quiet --disable-pip-version-check)
    stage "Wheel (the first time: some minutes)"
    rm -rf target/wheels
    PATH="${python%/*}:$PATH" "$python" "${pip[@]}" wheel --no-build-isolation --no-deps -w target/wheels ./python
    "$python" "${pip[@]}" install --no-deps --force-reinstall target/wheels/vines_testbench-*.whl
}

# `cargo zigbuild` and the zig linker, for libraries that load on older Linux.
portable_environment() {
    environment .venv-portable scripts/requirements-portable.txt && export PATH="$PWD/.venv-portable/bin:$PATH"
}

# One environment per client of the FMUs in tests/clients, because some of them exclude each other; without the packages that are never
# imported here. The test of a client without an environment is skipped.
client_environments() {
    local file name
    for file in tests/clients/requirements/*.txt; do
        name=$(basename "$file" .txt)
        environment ".venv-clients/$name" "$file" --no-deps || say "warning: the packages of $name could not be installed"
    done
}

# The program `vines` and the libraries of the two FMUs. One call for all: cargo builds packages again for another selection, because
# features of dependencies differ.
build() {
    stage "Building vines and the FMUs (the first time: some minutes)"
    progress build --release --locked -p vines -p lovines-fmu -p phase-lock-fmu
}
