#!/usr/bin/env bash
# Fills dist/ with a release for this platform: the archive of programs, the wheel of the Python package, the zip for
# Blender, and SHA256SUMS.
#
#     deploy/release/build.sh [--native]
#
# On Linux programs are linked for glibc 2.28 and later, by zig; --native links for this machine's. Needs Rust, Python
# 3.11 or later with venv, and PyPI for what requirements.txt names. The same commit and Rust give the same bytes.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=deploy/release
python=${PYTHON:-python3}

glibc=2.28
case ${1:-} in
--native) glibc='' ;;
"") ;;
*)
    sed -n '2,8s/^# \{0,1\}//p' "$here/build.sh" >&2
    exit 2
    ;;
esac

version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"$/\1/p' Cargo.toml)
target=$(rustc -vV | sed -n 's/^host: //p')
case $target in
*-linux-gnu) exe='' ending=tar.gz ;;
*-windows-*) exe=.exe ending=zip glibc='' ;;
*) exe='' ending=tar.gz glibc='' ;;
esac

# The date of the commit, not of the build.
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || echo 315532800)}
cargo_home=$(cd "${CARGO_HOME:-$HOME/.cargo}" && pwd)
# Keeps the path of the sources on this machine out of the programs.
RUSTFLAGS="${RUSTFLAGS:-} --remap-path-prefix=$PWD=/beamfarm --remap-path-prefix=$cargo_home=/cargo"
export SOURCE_DATE_EPOCH RUSTFLAGS CARGO_INCREMENTAL=0 CARGO_PROFILE_DIST_STRIP=symbols

tools=target/release-tools
if ! cmp -s "$here/requirements.txt" "$tools/requirements.txt"; then
    rm -rf "$tools"
    "$python" -m venv "$tools"
    bin=$tools/bin
    [[ -d $bin ]] || bin=$tools/Scripts
    "$bin/python" -m pip install --quiet --disable-pip-version-check -r "$here/requirements.txt"
    cp "$here/requirements.txt" "$tools"
fi
bin=$PWD/$tools/bin
[[ -d $bin ]] || bin=$PWD/$tools/Scripts
export PATH="$bin:$PATH"

echo "== programs of $version for $target${glibc:+, glibc $glibc}"
what=(--profile dist --locked -p beamfarm -p beamfarm-worker --features gpu)
if [[ -n $glibc ]]; then
    cargo zigbuild "${what[@]}" --target "$target.$glibc"
else
    cargo build "${what[@]}" --target "$target"
fi
built=${CARGO_TARGET_DIR:-target}/$target/dist

rm -rf dist
mkdir dist
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
name=beamfarm-$version-$target
inside=$work/$name
mkdir -p "$inside/completions" "$inside/man"
cp "$built/beamfarm$exe" "$built/beamfarm-worker$exe" README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE "$inside"
"$inside/beamfarm$exe" completions bash >"$inside/completions/beamfarm.bash"
"$inside/beamfarm$exe" completions zsh >"$inside/completions/_beamfarm"
"$inside/beamfarm$exe" completions fish >"$inside/completions/beamfarm.fish"
"$inside/beamfarm$exe" man "$inside/man" >/dev/null
python "$here/licences.py" "$target" gpu >"$inside/LICENSES-OF-CRATES.txt"
python "$here/archive.py" "$inside" "dist/$name.$ending"
echo "dist/$name.$ending"

echo "== the wheel"
package=addons/python/package/beamfarm
mkdir -p "$package/bin"
cp "$built/beamfarm$exe" "$package/bin/"
cp "$inside/LICENSES-OF-CRATES.txt" "$package"
maturin build --profile dist --locked --features gpu --manifest-path addons/python/Cargo.toml \
    --target "$target" ${glibc:+--zig --compatibility "manylinux_${glibc/./_}"} --out dist
wheel=$(cd dist && echo beamfarm-"$version"-*.whl)
"$here/try_wheel.sh" "dist/$wheel"

echo "== the zip for Blender"
(cd dist && python ../addons/blender/package.py --wheel "$wheel")

python "$here/archive.py" --sums dist
"$here/try.sh" "dist/$name.$ending" ${glibc:+"$glibc"}
