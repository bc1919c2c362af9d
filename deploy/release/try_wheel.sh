#!/usr/bin/env bash
# Tests whether a wheel works on its own: try_wheel.sh WHEEL
#
# Installs it into a fresh environment, from an empty folder, and checks that it renders the bits of its command.
set -euo pipefail
wheel=$(realpath "$1")
scene=$(realpath "$(dirname "$0")/../../scenes/sphere-caustic.toml")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
"${PYTHON:-python3}" -m venv env
bin=$work/env/bin
[[ -d $bin ]] || bin=$work/env/Scripts
"$bin/pip" install --quiet --disable-pip-version-check "$wheel"
size=$(wc -c <"$wheel")
((size <= 30000000)) || { echo "$wheel has $size bytes" >&2; exit 1; }
"$bin/beamfarm" --version
"$bin/beamfarm-worker" --help >/dev/null
"$bin/beamfarm" render "$scene" --scale 25% --passes 2 -o a.exr | grep '^pixels ' >command
"$bin/python" - "$scene" >package <<'end'
import sys
import beamfarm

scene = beamfarm.load(sys.argv[1])
scene["image"].update(width=128, height=96)
image = beamfarm.render(scene, passes=2)
image.save("b.png")
print("pixels", image.hash)
end
diff command package
cmp a.png b.png
echo "$(basename "$wheel"), $((size / 1000000)) MB: the package renders what its command does"
if command -v auditwheel >/dev/null; then
    auditwheel show "$wheel" | sed -n 's/^.*consistent with the following platform tag: */auditwheel: /p; /platform tag/,+1p' | head -n 4
fi
