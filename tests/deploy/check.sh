#!/usr/bin/env bash
# Checks the files of deploy/ against what reads them: Kubernetes' API schemas, OpenJD's, the Compose specification's,
# systemd's own check, bash; also what makes a release, and its workflow against GitHub's schema. Runs the OpenJD
# templates and the command of Kubernetes' frames, too, and compares the bits of their images. Usage: check.sh
# PATH/TO/beamfarm
#
# Exits with 77, as automake's skipped tests do, where something that it needs is missing and that part was skipped.
set -euo pipefail
program=$(realpath "$1")
cd "$(dirname "$0")/../../deploy"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

code=0
skipped() {
    echo "SKIPPED: $*" >&2
    code=77
}

if ! python3 -m venv "$work/venv" || ! timeout 300 "$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    kubernetes-validate==1.37.0 openjd-cli==0.8.0 check-jsonschema==0.39.0 pyyaml jsonschema; then
    skipped "the files of deploy/: their validators could not be installed from PyPI"
    exit "$code"
fi

if command -v kubectl >/dev/null; then
    kubectl kustomize kubernetes >"$work/all.yaml"
elif command -v kustomize >/dev/null; then
    kustomize build kubernetes >"$work/all.yaml"
else
    skipped "kustomize: neither kubectl nor kustomize is here; the files are checked one by one"
    for file in kubernetes/*.yaml; do
        [[ $file == */kustomization.yaml || $file == */frames.yaml || $file == */worker-gpu.yaml ]] || { echo ---; cat "$file"; }
    done >"$work/all.yaml"
fi
# The oldest version in which pods may be replaced and indices may fail as these files require, and the newest.
for version in 1.31 1.37; do
    "$work/venv/bin/kubernetes-validate" --quiet --strict -k "$version" "$work/all.yaml" kubernetes/frames.yaml \
        kubernetes/worker-gpu.yaml
done
echo "kubernetes: valid for 1.31 and 1.37"

# As they are, and for hosts with cards.
for template in beamfarm frames; do
    "$work/venv/bin/openjd" check "openjd/$template.yaml"
    sed '/^      # For Engine/d; s/^      #/      /' "openjd/$template.yaml" >"$work/gpu.yaml"
    grep -q '^        - name: amount.worker.gpu' "$work/gpu.yaml"
    "$work/venv/bin/openjd" check "$work/gpu.yaml"
done
cp ../scenes/sphere-caustic.toml "$work"
timeout 300 "$program" render "$work/sphere-caustic.toml" --passes 2 -o "$work/local.exr" >"$work/local"
timeout --kill-after=30 300 "$work/venv/bin/openjd" run openjd/beamfarm.yaml --step render -p "Program=$program" -p Workers=1 -p Passes=2 \
    -p "Scene=$work/sphere-caustic.toml" -p "Output=$work/out.exr" >"$work/openjd" 2>&1 || {
    cat "$work/openjd" >&2
    exit 1
}
pixels=$(sed -n 's/^pixels //p' "$work/local")
if [[ -z $pixels ]] || ! grep -q "$pixels" "$work/openjd"; then
    echo "the image of the OpenJD job has other bits" >&2
    exit 1
fi
echo "openjd: the template's image has the bits of a local one"

# A small scene with a moving light.
sed -e 's/^width = .*/width = 64/; s/^height = .*/height = 48/; s/^passes = .*/passes = 2/' \
    -e 's/^target = \[-0.1, 1.2, 0.0\]/target = { keys = [[1, [-0.1, 1.2, 0]], [3, [0.1, 1, 0]]] }/' \
    ../scenes/sphere-caustic.toml >"$work/moving.toml"
printf '\n[animation]\nframes = [1, 3]\n' >>"$work/moving.toml"
timeout 300 "$program" render "$work/moving.toml" --frames 1-2 -o "$work/local.##.exr" >"$work/local"
pixels=$(sed -n 's/^frame .* pixels //p' "$work/local")
if [[ $(sort -u <<<"$pixels" | wc -l) != 2 ]]; then
    echo "two frames that differ were expected" >&2
    exit 1
fi

timeout --kill-after=30 300 "$work/venv/bin/openjd" run openjd/frames.yaml --step render -p "Program=$program" -p Frames=1-2 -p Passes=2 \
    -p "Scene=$work/moving.toml" -p "Output=$work/openjd-frames/f.##.exr" >"$work/openjd" 2>&1 || {
    cat "$work/openjd" >&2
    exit 1
}
if [[ $(sed -n 's/.*\tpixels //p' "$work/openjd") != "$pixels" || ! -s $work/openjd-frames/f.02.exr ]]; then
    echo "the frames of the OpenJD job have other bits" >&2
    exit 1
fi
echo "openjd: the frames have the bits of local ones"

# What the pod of index 2 runs; then the coordinator with the same frame, which exists already, so it ends at once.
mkdir "$work/job"
cp "$work/moving.toml" "$work/job/scene.toml"
head -c 32 /dev/urandom | od -An -v -tx1 | tr -d ' \n' >"$work/job/token"
chmod 600 "$work/job/token"
"$work/venv/bin/python" - "$program" "$work/job" "$work/all.yaml" kubernetes/frames.yaml >"$work/kubernetes" <<'PYTHON'
import subprocess, sys, yaml
program, job, *files = sys.argv[1:]
parts = [part for file in files for part in yaml.safe_load_all(open(file))]
jobs = {part["metadata"]["name"]: part for part in parts if part["kind"] == "Job"}
def run(name, *more):
    container, = jobs[name]["spec"]["template"]["spec"]["containers"]
    known = ["$(%s)" % one["name"] for one in container.get("env", [])]
    arguments = [one for one in container["args"] if not one.startswith("--tls-")]
    for before, after in [("/job/out.exr", "/job/frame.#.exr"), ("/secrets/token/", "/job/"), ("/job/", job + "/")] \
            + [(name, "2") for name in known]:
        arguments = [one.replace(before, after) for one in arguments]
    assert not any("$(" in one for one in arguments), arguments
    subprocess.run([program, *arguments, *more], check=True, timeout=300)
run("frames")
run("coordinator", "--frames=2")
PYTHON
if [[ $(sed -n 's/^pixels //p' "$work/kubernetes") != "$(tail -n 1 <<<"$pixels")" ]] ||
    ! grep -q 'frame.2.exr is there already' "$work/kubernetes"; then
    cat "$work/kubernetes" >&2
    echo "the frame of Kubernetes' indexed job has other bits, or is not kept by the coordinator" >&2
    exit 1
fi
echo "kubernetes: the frame of an index has the bits of a local one, and a coordinator keeps it"

"$work/venv/bin/python" - <<'PYTHON'
import pathlib, yaml
compose = yaml.safe_load(pathlib.Path("container/compose.yaml").read_text())
known = {"image", "build", "command", "user", "volumes", "secrets", "ports", "read_only", "cap_drop", "security_opt",
         "stop_grace_period", "restart", "healthcheck", "depends_on", "profiles", "deploy", "tmpfs"}
for name, service in compose["services"].items():
    assert set(service) <= known, (name, set(service) - known)
    target = service.get("build", {}).get("target", "build")
    assert f" AS {target}\n" in pathlib.Path("container/Containerfile").read_text(), target
    assert set(service["secrets"]) <= set(compose["secrets"])
    assert set(service.get("depends_on", [])) <= set(compose["services"])
print("compose: fields and references are as expected")
PYTHON

if command -v systemd-analyze >/dev/null; then
    # With a card: the drop-in follows the unit that it is for.
    cat systemd/beamfarm-worker.service >"$work/beamfarm-worker-gpu.service"
    sed -n '/^\[Service\]/,$p' systemd/beamfarm-worker-gpu.conf >>"$work/beamfarm-worker-gpu.service"
    for unit in systemd/*.service "$work/beamfarm-worker-gpu.service"; do
        # The check requires the program to exist.
        mkdir -p "$work/units"
        sed 's|^ExecStart=[^ ][^ ]*|ExecStart=/bin/true|' "$unit" >"$work/units/$(basename "$unit")"
        said=$(systemd-analyze verify "$work/units/$(basename "$unit")" 2>&1 | grep -F beamfarm || true)
        if [[ -n $said ]]; then
            echo "$said" >&2
            exit 1
        fi
    done
    echo "systemd: the units are valid"
else
    skipped "systemd-analyze is not here"
fi

# What a worker's process runs, with cards and without: srun and the program only print their arguments.
mkdir "$work/bin"
printf '#!/bin/bash\nwhile [[ $1 != bash ]]; do shift; done\nexec "$@"\n' >"$work/bin/srun"
printf '#!/bin/bash\necho "$*"\n' >"$work/bin/beamfarm"
chmod +x "$work/bin/srun" "$work/bin/beamfarm"
for cards in "" 2; do
    told=$(env PATH="$work/bin:$PATH" SLURM_JOB_ID=1 SLURM_PROCID=1 SLURM_CPUS_PER_TASK=3 ${cards:+SLURM_GPUS_ON_NODE=$cards} \
        bash slurm/beamfarm.sbatch scene.toml out.exr)
    if [[ $told != "worker --connect http://"*" --threads 3 --patience 5m${cards:+ --gpu all}" ]]; then
        echo "slurm: a worker with ${cards:-no} cards is told: $told" >&2
        exit 1
    fi
done
echo "slurm: a node's cards are workers"

bash -n slurm/beamfarm.sbatch
bash -n slurm/frames.sbatch

# What makes a release. A whole one takes minutes, so only parts are tried: the licences of all crates are found, and
# the same folder gives the same archive.
"$work/venv/bin/check-jsonschema" --quiet --builtin-schema vendor.github-workflows ../.github/workflows/release.yml
bash -n release/build.sh
bash -n release/try.sh
bash -n release/try_wheel.sh
target=$(rustc -vV | sed -n 's/^host: //p')
python3 release/licences.py "$target" gpu >"$work/licences"
if ! grep -q '^clap [0-9.]*: MIT OR Apache-2.0, https' "$work/licences" ||
    ! grep -q 'Permission is hereby granted' "$work/licences"; then
    echo "the licences of crates are not told" >&2
    exit 1
fi
for archive in tar.gz zip; do
    for copy in one two; do
        mkdir -p "$work/$copy/packed/inner"
        echo 'echo packed' >"$work/$copy/packed/program"
        echo text >"$work/$copy/packed/inner/text"
        chmod 700 "$work/$copy/packed/program"
        SOURCE_DATE_EPOCH=1700000000 python3 release/archive.py "$work/$copy/packed" "$work/$copy/packed.$archive"
    done
    cmp "$work/one/packed.$archive" "$work/two/packed.$archive"
done
mkdir "$work/unpacked" "$work/sums"
tar -xzf "$work/one/packed.tar.gz" -C "$work/unpacked"
[[ $("$work/unpacked/packed/program") == packed && $(<"$work/unpacked/packed/inner/text") == text ]]
cp "$work"/one/packed.* "$work/sums"
python3 release/archive.py --sums "$work/sums"
(cd "$work/sums" && sha256sum --check --quiet SHA256SUMS)
echo "release: its scripts, its workflow and the licences of crates are as they should be"
exit "$code"
