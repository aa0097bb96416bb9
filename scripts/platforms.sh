# Sourced after setup.sh: builds the libraries for any platform, each with the first toolchain that has its target.

# Where FMUs keep libraries, and what Rust calls the platform.
declare -A TRIPLES=(
    [linux64]=x86_64-unknown-linux-gnu
    [linux32]=i686-unknown-linux-gnu
    [aarch64-linux]=aarch64-unknown-linux-gnu
    [win64]=x86_64-pc-windows-gnu
    [win32]=i686-pc-windows-gnu
    [aarch64-windows]=aarch64-pc-windows-gnullvm
    [darwin64]=x86_64-apple-darwin
    [aarch64-darwin]=aarch64-apple-darwin
)
PLATFORMS="linux64, linux32, aarch64-linux, win64, win32, aarch64-windows, darwin64, aarch64-darwin"

# The oldest glibc that libraries linked by zig load with: that of 2012.
GLIBC=2.17

# What is in the FMUs.
LIBRARIES=(-p lovines-fmu -p phase-lock-fmu)

# The compiler of Debian and the sources of its standard library, unpacked and not installed.
RUST_WEB=.toolchains/rust-web

# platform_list NAMES: the comma-separated names, checked, one on a line.
platform_list() {
    local name names seen=,
    IFS=, read -ra names <<<"$1"
    [ ${#names[@]} -gt 0 ] || fail "--platforms needs a list; there are $PLATFORMS"
    for name in "${names[@]}"; do
        [ -n "${TRIPLES[$name]:-}" ] || fail "\`$name\` is not a platform; known are $PLATFORMS"
        case $seen in *,$name,*) fail "the platform $name was given twice" ;; esac
        seen=$seen$name,
        printf '%s\n' "$name"
    done
}

# toolchain PLATFORM: `rustup`, `rust-src` or `debian`, the first that can build for it; fails naming what would help.
toolchain() {
    local triple=${TRIPLES[$1]} sysroot
    sysroot=$(rustc --print sysroot)
    if [ -d "$sysroot/lib/rustlib/$triple/lib" ]; then
        echo rustup
    elif [ -f "$sysroot/lib/rustlib/src/rust/library/Cargo.lock" ]; then
        echo rust-src
    elif [ -x "$RUST_WEB/usr/bin/rustc" ] || debian_has_rust_web; then
        echo debian
    else
        fail "no Rust toolchain here has the target of $1: \`rustup target add $triple\` installs it (\`rustup component add rust-src\`, or the packages rustc-web and rust-web-src of Debian, 1.95 or newer, would also do)"
    fi
}

# The newest version of rustc-web that apt knows, without revision; nothing where it knows none.
rust_web_version() {
    command -v apt-get >/dev/null && command -v dpkg >/dev/null || return 0
    apt-cache policy rustc-web 2>/dev/null | sed -n 's/^ *Candidate: *\([0-9.]*\).*/\1/p'
}

debian_has_rust_web() {
    local version
    version=$(rust_web_version)
    [ -n "$version" ] && dpkg --compare-versions "$version" ge 1.95
}

# Downloads and unpacks the packages, once. No root is needed.
unpack_rust_web() {
    [ -x "$RUST_WEB/usr/bin/rustc" ] && return
    local folder=$PWD/.toolchains/packages version package llvm
    version=$(rust_web_version)
    say "Unpacking rustc-web $version into $RUST_WEB ..."
    rm -rf "$RUST_WEB.new" "$folder"
    mkdir -p "$RUST_WEB.new" "$folder"
    llvm=$(apt-cache depends "libstd-rust-web-${version%.*}" rustc-web | sed -n 's/.*Depends: *\(libllvm[0-9]*\).*/\1/p' | head -n 1)
    [ -n "$llvm" ] || llvm=libllvm22
    # apt's download drops its rights where it cannot use them in this folder; that it says so is of no interest.
    (cd "$folder" && apt-get download -qq rustc-web rust-web-src libstd-rust-web-dev "libstd-rust-web-${version%.*}" "$llvm" 2>"$folder/log") || {
        cat "$folder/log" >&2
        fail "the packages of rustc-web $version could not be downloaded; run \`apt-get update\`"
    }
    for package in "$folder"/*.deb; do
        dpkg -x "$package" "$RUST_WEB.new"
    done
    mv "$RUST_WEB.new" "$RUST_WEB"
    rm -rf "$folder"
}

# linker PLATFORM: what links for it, `host`, `mingw`, `lld` or `zig`; fails naming what is missing.
linker() {
    local triple=${TRIPLES[$1]}
    case $triple in
        x86_64-pc-windows-gnu | i686-pc-windows-gnu)
            [ -n "$(mingw "$triple")" ] ||
                fail "the linker for $1 is missing: install gcc-mingw-w64-${triple%%-*} (Debian: \`apt-get install gcc-mingw-w64-$(tr _ - <<<"${triple%%-*}")-posix\`)"
            echo mingw
            ;;
        "$(host_triple)") if [ -n "${portable:-}" ]; then echo zig; else echo host; fi ;;
        wasm32-*) echo lld ;;
        *-apple-darwin) if [ "$(uname)" = Darwin ]; then echo host; else echo zig; fi ;;
        *) echo zig ;;
    esac
}

host_triple() { rustc -vV | sed -n 's/^host: //p'; }

# The platform of this machine.
host_platform() {
    local name triple
    triple=$(host_triple)
    for name in "${!TRIPLES[@]}"; do
        [ "${TRIPLES[$name]}" != "$triple" ] || { printf '%s' "$name"; return; }
    done
    fail "there is no FMU for $triple; there are $PLATFORMS"
}

# mingw TRIPLE: the linker's name, that of the variant with POSIX threads first.
mingw() {
    local name=${1%%-*}-w64-mingw32-gcc
    command -v "$name-posix" || command -v "$name" || true
}

# platform_setup PLATFORM: what cargo needs to build for it so that the bytes are the same wherever and whenever they are built: exported
# variables, and the variables triple, verb (a command of cargo, if not set) and unstable (options). Call it in a subshell.
platform_setup() {
    triple=${TRIPLES[$1]} kind=$(toolchain "$1") with=$(linker "$1") unstable=()
    # What a library says of paths would be another on every machine.
    local flags=(-Cstrip=symbols "--remap-path-prefix=$PWD=." "--remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo") variable
    case $kind in
        debian)
            unpack_rust_web
            export RUSTC="$PWD/$RUST_WEB/usr/bin/rustc"
            export LD_LIBRARY_PATH="$PWD/$RUST_WEB/usr/lib/$(uname -m)-linux-gnu"
            ;;&
        debian | rust-src)
            export RUSTC_BOOTSTRAP=1
            case $triple in
                # Without the texts of panics, which a page cannot show.
                wasm32-*)
                    unstable+=(-Z build-std=std,panic_abort -Z build-std-features=optimize_for_size -Z panic-immediate-abort)
                    unstable+=(--config 'profile.live.panic="immediate-abort"')
                    ;;
                *) unstable+=(-Z build-std=std,panic_unwind) ;;
            esac
            ;;
    esac
    flags+=("--remap-path-prefix=$("${RUSTC:-rustc}" --print sysroot)=rust")
    # Cargo gives rustc relative paths of sources inside the folder that it is called in.
    flags+=("--remap-path-prefix=$RUST_WEB/usr=rust")
    verb=${verb:-build}
    case $with in
        mingw)
            variable=CARGO_TARGET_$(tr 'a-z-' 'A-Z_' <<<"$triple")_LINKER
            export "$variable=$(mingw "$triple")"
            # Without it the header holds the time of day.
            flags+=(-Clink-arg=-Wl,--no-insert-timestamp)
            ;;
        lld)
            export RUSTC_BOOTSTRAP=1
            export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER="$(rustc --print sysroot)/lib/rustlib/$(host_triple)/bin/rust-lld"
            ;;
        zig)
            portable_environment || { cat .venv-portable.log >&2; fail "cargo-zigbuild, which links for $1, could not be installed"; }
            verb=zigbuild
            case $triple in *-linux-gnu) triple=$triple.$GLIBC ;; esac
            ;;
    esac
    CARGO_ENCODED_RUSTFLAGS=$(IFS=$'\x1f'; printf '%s' "${flags[*]}")
    # Without increments, which depend on what was built before.
    export CARGO_ENCODED_RUSTFLAGS CARGO_INCREMENTAL=0
    say "Building for $1 ($kind toolchain, $with linker) ..."
}

# build_platform PLATFORM FOLDER [options of cargo build]: the packages of the options, stripped, in FOLDER/TRIPLE/release (or another profile,
# in `profile`; or another command of cargo than build, in `verb`).
build_platform() (
    platform_setup "$1"
    options=(--profile "${profile:-release}" --locked --target-dir "$2" --target "$triple")
    [ -t 2 ] || options+=(--quiet)
    cargo "$verb" "${options[@]}" "${unstable[@]}" "${@:3}" || fail "cargo could not build for $1"
)

# platform_wheel PLATFORM FMUS FOLDER: the wheel, in FOLDER, with the FMUs of the folder FMUS; both absolute.
platform_wheel() (
    portable_environment || { cat .venv-portable.log >&2; fail "maturin, which builds the wheel, could not be installed"; }
    platform_setup "$1"
    mkdir -p python/vines/fmu
    cp "$2"/{LoViNes,PhaseLock}.fmu python/vines/fmu
    options=(--release --locked --target "${TRIPLES[$1]}" --target-dir "$target/platforms" --out "$3" --quiet)
    [ "$with" != zig ] || options+=(--zig --compatibility manylinux2014)
    cd python
    maturin build "${options[@]}" "${unstable[@]}" || fail "maturin could not build the wheel for $1"
)

# pack_options PLATFORM ...: builds the libraries of the FMUs, and prints the options with which `vines pack` takes them, one on a line.
pack_options() {
    local platform library folder=$target/platforms
    echo --only-binaries
    for platform; do
        build_platform "$platform" "$folder" "${LIBRARIES[@]}" >&2 || return
        for library in lovines_fmu phase_lock_fmu; do
            printf -- '--binary\n%s\n' "$platform=$(built_library "$platform" "$folder" "$library")"
        done
    done
}

# built_library PLATFORM FOLDER NAME: the path of a library that build_platform has made.
built_library() {
    local folder=$2/${TRIPLES[$1]}/release
    case $1 in
        win* | *-windows) printf '%s' "$folder/$3.dll" ;;
        *darwin*) printf '%s' "$folder/lib$3.dylib" ;;
        *) printf '%s' "$folder/lib$3.so" ;;
    esac
}
