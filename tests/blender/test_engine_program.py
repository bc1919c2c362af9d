"""Which command the add-on runs, and the zip that contains it as a wheel."""

from __future__ import annotations

import base64
import hashlib
import os
import shutil
import stat
import subprocess
import sys
import tomllib
import unittest
import zipfile
from pathlib import Path
from unittest import mock

import harness
import bpy
import numpy as np

VERSION = tomllib.loads(harness.package.manifest())["version"]
WHEEL = f"beamfarm-{VERSION}-cp310-abi3-manylinux_2_28_x86_64.whl"


def wheel(folder: Path, program: Path, name: str = WHEEL) -> Path:
    """A wheel like that of the Python package, with nothing but the command."""
    said = f"beamfarm-{VERSION}.dist-info"
    parts = {
        "beamfarm/__init__.py": b"raise ImportError('there is no numpy')\n",
        "beamfarm/bin/beamfarm": program.read_bytes(),
        f"{said}/METADATA": f"Metadata-Version: 2.1\nName: beamfarm\nVersion: {VERSION}\n".encode(),
        f"{said}/WHEEL": b"Wheel-Version: 1.0\nRoot-Is-Purelib: false\nTag: cp310-abi3-any\n",
    }
    record = f"{said}/RECORD"
    with zipfile.ZipFile(folder / name, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        lines = [f"{record},,"]
        for path, content in parts.items():
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            lines.append(f"{path},sha256={digest},{len(content)}")
            info = zipfile.ZipInfo(path)
            info.external_attr = (stat.S_IFREG | (0o755 if "/bin/" in path else 0o644)) << 16
            archive.writestr(info, content, zipfile.ZIP_DEFLATED)
        archive.writestr(record, "\n".join(lines) + "\n")
    return folder / name


def saying(path: Path, version: str, mode: int = 0o644) -> Path:
    """A program that prints its version."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\necho beamfarm {version}\n", encoding="utf-8")
    path.chmod(mode)
    return path


class Zip(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = harness.folder()
        self.program = saying(self.folder / "program", VERSION)

    def test_wheels_are_in_it_and_in_its_manifest(self) -> None:
        package, made = harness.package, wheel(self.folder, self.program)
        self.assertEqual(package.name([made]), f"beamfarm-{VERSION}-linux_x64.zip")
        self.assertEqual(package.name(), f"beamfarm-{VERSION}.zip")
        first, second = (package.build(self.folder / name, [made]) for name in ("a.zip", "b.zip"))
        self.assertEqual(first.read_bytes(), second.read_bytes())
        with zipfile.ZipFile(first) as archive:
            fields = tomllib.loads(archive.read("blender_manifest.toml").decode())
            self.assertEqual(archive.read(f"wheels/{WHEEL}"), made.read_bytes())
        source = tomllib.loads(package.manifest())
        self.assertEqual(fields, source | {"wheels": [f"./wheels/{WHEEL}"], "platforms": ["linux-x64"]})
        self.assertNotIn("wheels", source)

    def test_platforms_are_those_of_the_wheels(self) -> None:
        names = {
            "manylinux_2_28_x86_64": ["linux-x64"],
            "manylinux2014_x86_64.manylinux_2_17_x86_64": ["linux-x64"],
            "linux_aarch64": ["linux-arm64"],
            "macosx_11_0_arm64": ["macos-arm64"],
            "macosx_10_12_universal2": ["macos-arm64", "macos-x64"],
            "win_amd64": ["windows-x64"],
            "any": [],
        }
        package = harness.package
        for tag, wanted in names.items():
            self.assertEqual(package.platforms(f"a-1-py3-none-{tag}.whl"), wanted)
        for wrong in ("a-1-py3-none-win32.whl", "a.whl", "a-1-py3-none-win_amd64.zip", "a-1-py3-none-plan9_x86_64.whl"):
            with self.assertRaises(package.PackageError):
                package.platforms(wrong)
        two = [Path("a-1-py3-none-win_amd64.whl"), Path("b-1-py3-none-linux_x86_64.whl")]
        with self.assertRaisesRegex(package.PackageError, "b-1.* is for linux-x64, but a-1.* for windows-x64"):
            package.common(two)

    def test_the_command_line(self) -> None:
        made = wheel(self.folder, self.program)
        script = harness.ADDONS / "package.py"
        line = [sys.executable, str(script), "--wheel", str(made)]
        done = subprocess.run(line, cwd=self.folder, capture_output=True, text=True, check=True)
        self.assertEqual(done.stdout, f"beamfarm-{VERSION}-linux_x64.zip\n")
        self.assertTrue((self.folder / done.stdout.strip()).is_file())
        line += ["--wheel", "no.whl"]
        done = subprocess.run(line, cwd=self.folder, capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, done.stderr.count("\n")), (1, 1))


class Program(unittest.TestCase):
    """Which command is chosen."""

    def setUp(self) -> None:
        harness.install()
        self.folder = harness.folder()
        self.program = harness.module("program")
        self.site = self.folder / "site-packages"
        self.packaged = self.site / "beamfarm" / "bin" / "beamfarm"
        self.in_path = saying(self.folder / "path" / "beamfarm", VERSION, 0o755)
        environment = {
            "PATH": f"{self.in_path.parent}:{os.environ['PATH']}",
            "XDG_CACHE_HOME": str(self.folder / "cache"),
        }
        # Without what the other tests install.
        others = [path for path in sys.path if not Path(path, "beamfarm", "bin").is_dir()]
        for patch in (
            mock.patch.dict(os.environ, environment),
            mock.patch.object(sys, "path", [str(self.site), *others]),
        ):
            patch.start()
            self.addCleanup(patch.stop)

    def copies(self) -> list[Path]:
        return list((self.folder / "cache").rglob("*"))

    def test_the_preferences_come_first_then_the_package_then_path(self) -> None:
        saying(self.packaged, VERSION, 0o755)
        own = saying(self.folder / "own", VERSION, 0o755)
        usable = self.program.usable
        self.assertEqual(usable(str(own)), (own, "as set above"))
        self.assertEqual(usable(""), (self.packaged, "of the Python package"))
        self.packaged.unlink()
        self.assertEqual(usable(""), (self.in_path, "of PATH"))

    def test_the_add_on_itself_is_not_the_package(self) -> None:
        # As in a folder of Python's path that has the sources of the add-on.
        (self.site / "beamfarm").mkdir(parents=True)
        (self.site / "beamfarm" / "__init__.py").write_text("raise AssertionError\n", encoding="utf-8")
        self.assertEqual(self.program.find("")[0], self.in_path)
        later = self.folder / "later"
        behind = saying(later / "beamfarm" / "bin" / "beamfarm", VERSION, 0o755)
        sys.path.append(str(later))
        self.assertEqual(self.program.find("")[0], behind)

    def test_what_was_unpacked_without_permissions_gets_them(self) -> None:
        saying(self.packaged, VERSION)
        self.assertFalse(os.access(self.packaged, os.X_OK))
        self.assertEqual(self.program.usable(""), (self.packaged, "of the Python package"))
        self.assertTrue(os.access(self.packaged, os.X_OK))
        self.assertEqual(self.copies(), [])

    def test_where_permissions_cannot_be_changed_a_copy_is_run(self) -> None:
        saying(self.packaged, VERSION)
        (self.site / f"beamfarm-{VERSION}.dist-info").mkdir()
        # Whoever runs the tests may have every permission.
        with mock.patch.object(Path, "chmod", side_effect=PermissionError):
            copy, whose = self.program.usable("")
            again, _ = self.program.usable("")
        self.assertEqual((again, whose), (copy, "of the Python package"))
        self.assertTrue(copy.parent.name.startswith(f"{VERSION}-"), copy)
        self.assertTrue(copy.is_relative_to(self.folder / "cache" / "beamfarm" / "programs"))
        self.assertFalse(os.access(self.packaged, os.X_OK))
        self.assertEqual([path for path in self.copies() if path.is_file()], [copy])
        # The next start of Blender finds the copy, unless it is damaged.
        before = copy.stat().st_ino
        for damage, kept in ((lambda: None, True), (lambda: copy.write_text("no"), False), (copy.unlink, False)):
            damage()
            self.program._copies.clear()
            with mock.patch.object(Path, "chmod", side_effect=PermissionError):
                self.assertEqual(self.program.usable("")[0], copy)
            self.assertEqual(copy.read_bytes(), self.packaged.read_bytes())
            if kept:
                self.assertEqual(copy.stat().st_ino, before)
        self.assertEqual([path for path in self.copies() if path.is_file()], [copy])

    def test_where_there_is_no_room_for_a_copy_it_says_so(self) -> None:
        saying(self.packaged, VERSION)
        (self.folder / "cache").write_text("no folder", encoding="utf-8")
        with mock.patch.object(Path, "chmod", side_effect=PermissionError):
            with self.assertRaisesRegex(self.program.ProgramError, "may not be executed, nor be copied"):
                self.program.find("")

    def test_the_panel_says_which_it_is(self) -> None:
        saying(self.packaged, VERSION, 0o755)
        preferences = harness.preferences()
        self.addCleanup(harness.install)
        preferences.program = ""
        self.assertEqual(preferences.found(), (self.packaged, "of the Python package"))
        layout = mock.MagicMock()
        type(preferences).draw(mock.Mock(wraps=preferences, layout=layout, use_farm=False), bpy.context)
        layout.row().label.assert_called_once_with(
            text=f"Version {VERSION}, of the Python package: {self.packaged}", icon="CHECKMARK"
        )


@unittest.skipUnless(sys.platform == "linux" and os.uname().machine == "x86_64", "the wheel is for Linux on x86-64")
class Installed(unittest.TestCase):
    """The zip with the wheel, installed by Blender, and nothing else."""

    def test_f12_with_an_empty_path_and_no_preference(self) -> None:
        folder = harness.folder()
        scene = harness.lit_floor((16, 12))
        bpy.ops.render.render(write_still=True)
        wanted = red(scene.render.filepath)
        bpy.ops.preferences.addon_disable(module=harness.MODULE)
        bpy.ops.extensions.package_uninstall(repo_index=repository(), pkg_id="beamfarm")

        package = harness.package
        out = package.build(folder / package.name([Path(WHEEL)]), [wheel(folder, harness.PROGRAM)])
        done = bpy.ops.extensions.package_install_files(
            filepath=str(out), repo="user_default", enable_on_install=True, overwrite=True
        )
        self.assertEqual(done, {"FINISHED"})
        preferences = harness.preferences()
        preferences.program = ""
        with mock.patch.dict(os.environ, {"PATH": "", "XDG_CACHE_HOME": str(folder / "cache")}):
            path, whose = preferences.found()
            self.assertEqual(whose, "of the Python package")
            self.assertTrue(path.is_relative_to(harness.RESOURCES), path)
            self.assertIsNone(shutil.which("beamfarm"))
            scene = bpy.context.scene
            scene.render.engine = "BEAMFARM"
            scene.render.filepath = str(folder / "again.exr")
            bpy.ops.render.render(write_still=True)
        self.assertGreater(wanted.max(), 0.0)
        np.testing.assert_array_equal(red(scene.render.filepath), wanted)


def red(path: str) -> np.ndarray:
    """The red channel of a render."""
    return harness.module("exr").read(Path(path).read_bytes())["ViewLayer.Combined.R"]


def repository() -> int:
    """The index of the repository into which zips go."""
    names = [repo.module for repo in bpy.context.preferences.extensions.repos]
    return names.index("user_default")


if __name__ == "__main__":
    unittest.main()
