#!/usr/bin/env bash
# Tests the Blender add-on, installed from its zip into Blender as a Python module: run.sh PATH/TO/beamfarm [TEST.py…]
#
# BPY may name a Python that has bpy already. Exits with 77, as automake's skipped tests do, where there is none and
# none can be installed.
set -euo pipefail
program=$(realpath "$1")
shift
cd "$(dirname "$0")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Blender 4.5's wheels are for this version only.
python=${BPY:-}
if [[ -z $python ]]; then
    if ! command -v python3.11 >/dev/null || ! python3.11 -m venv "$work/venv" ||
        ! timeout 900 "$work/venv/bin/pip" install --quiet --disable-pip-version-check "bpy==4.5.*" numpy; then
        echo "SKIPPED: the Blender add-on: Python 3.11 with bpy 4.5 could not be had" >&2
        exit 77
    fi
    python=$work/venv/bin/python
fi

tests=("$@")
if ((!${#tests[@]})); then
    tests=(test_engine_*.py test_export_text.py test_export_keys.py test_export_lights.py
        test_export_objects.py test_export_hair.py test_export_displacement.py test_export_glass.py
        test_export_graphs.py test_export_bakes.py test_export_emission.py test_export_subsurface.py
        test_export_anisotropy.py test_gltf_*.py test_survey.py)
    # Comparing materials, motion and whole scenes with Cycles takes minutes.
    [[ -z ${BEAMFARM_LONG:-} ]] || tests=(test_*.py)
fi
export BEAMFARM=$program
code=0
# Alone, none takes more than a minute and a half; one that hangs is reported.
limit=900
[[ -z ${BEAMFARM_LONG:-} ]] || limit=7200
for test in "${tests[@]}"; do
    # One process each, so that changes to Blender's preferences do not reach the next.
    ended=0
    timeout --kill-after=30 "$limit" "$python" -m unittest "$test" >"$work/log" 2>&1 || ended=$?
    if ((ended != 0)); then
        code=1
        cat "$work/log"
        ((ended != 124 && ended != 137)) || echo "$test: not done after $limit seconds, and stopped"
    fi
    grep -h '^Ran ' "$work/log" | sed "s/^/$test: /" || true
done
exit "$code"
