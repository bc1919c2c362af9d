#!/usr/bin/env bash
# The files of deploy/ against what reads them: Kubernetes' API schemas, OpenJD's, the Compose specification's, systemd's
# own check, bash. The OpenJD template is run as well, and its image's bits compared. Usage: check.sh PATH/TO/beamfarm
#
# Ends with 77, as automake's tests do, where something that it needs is missing and that part was skipped.
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

if ! python3 -m venv "$work/venv" || ! "$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    kubernetes-validate==1.37.0 openjd-cli==0.8.0 pyyaml jsonschema; then
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
        [[ $file == */kustomization.yaml ]] || { echo ---; cat "$file"; }
    done >"$work/all.yaml"
fi
# The oldest version in which pods may be replaced and indices fail as these files ask for, and the newest.
for version in 1.31 1.37; do
    "$work/venv/bin/kubernetes-validate" --quiet --strict -k "$version" "$work/all.yaml"
done
echo "kubernetes: valid for 1.31 and 1.37"

"$work/venv/bin/openjd" check openjd/beamfarm.yaml
cp ../scenes/sphere-caustic.toml "$work"
"$program" render "$work/sphere-caustic.toml" --passes 2 -o "$work/local.exr" >"$work/local"
"$work/venv/bin/openjd" run openjd/beamfarm.yaml --step render -p "Program=$program" -p Workers=1 -p Passes=2 \
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

"$work/venv/bin/python" - <<'PYTHON'
import pathlib, yaml
compose = yaml.safe_load(pathlib.Path("container/compose.yaml").read_text())
known = {"image", "build", "command", "user", "volumes", "secrets", "ports", "read_only", "cap_drop", "security_opt",
         "stop_grace_period", "restart", "healthcheck", "depends_on"}
for name, service in compose["services"].items():
    assert set(service) <= known, (name, set(service) - known)
    assert set(service["secrets"]) <= set(compose["secrets"])
    assert set(service.get("depends_on", [])) <= set(compose["services"])
print("compose: fields and references are as expected")
PYTHON

if command -v systemd-analyze >/dev/null; then
    for unit in systemd/*.service; do
        # The check wants the program to be there.
        sed 's|^ExecStart=[^ ]*|ExecStart=/bin/true|' "$unit" >"$work/$(basename "$unit")"
        said=$(systemd-analyze verify "$work/$(basename "$unit")" 2>&1 | grep -F beamfarm || true)
        if [[ -n $said ]]; then
            echo "$said" >&2
            exit 1
        fi
    done
    echo "systemd: the units are valid"
else
    skipped "systemd-analyze is not here"
fi

bash -n slurm/beamfarm.sbatch
exit "$code"
