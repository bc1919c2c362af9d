#!/usr/bin/env bash
# Tests whether an archive of programs works on its own: try.sh ARCHIVE [GLIBC]
#
# Unpacks it into an empty folder and runs its programs without any environment variable. With GLIBC, they must not need
# a newer one.
set -euo pipefail
archive=$(realpath "$1")
glibc=${2:-}
scene=$(realpath "$(dirname "$0")/../../scenes/sphere-caustic.toml")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
clean=(env -i)
case $archive in
*.zip)
    python3 -m zipfile -e "$archive" .
    # Windows does not start a program without any variable.
    clean=(env)
    ;;
*) tar -xzf "$archive" ;;
esac
cd ./*/
for file in README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE LICENSES-OF-CRATES.txt man/beamfarm.1 \
    completions/beamfarm.bash completions/_beamfarm completions/beamfarm.fish; do
    [[ -s $file ]] || { echo "$file is not in $archive" >&2; exit 1; }
done
bash -n completions/beamfarm.bash
"${clean[@]}" ./beamfarm --version
# The one starts with its own name.
diff <("${clean[@]}" ./beamfarm --version | tail -n +2) <("${clean[@]}" ./beamfarm-worker --version | tail -n +2)
"${clean[@]}" ./beamfarm render "$scene" --scale 25% --passes 2 -o "$work/a.exr" >"$work/said"
grep '^pixels ' "$work/said"
[[ -s $work/a.exr ]]

if [[ -n $glibc ]]; then
    for program in beamfarm beamfarm-worker; do
        needed=$(objdump -T "$program" | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -n 1)
        echo "$program needs ${needed/_/ }"
        if [[ $(printf '%s\n' "GLIBC_$glibc" "$needed" | sort -V | tail -n 1) != "GLIBC_$glibc" ]]; then
            echo "error: more than glibc $glibc" >&2
            exit 1
        fi
    done
fi
