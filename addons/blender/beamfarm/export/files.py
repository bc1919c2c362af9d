"""Files in the scene's folder."""

import hashlib
import os
import shutil


class Files:
    """Writes files into the scene's folder under names derived from their contents; existing files stay."""

    def __init__(self, folder):
        self.folder = folder
        self.used = set()
        self.kept = set()

    def put(self, place, stem, ending, content):
        """Relative path of a file with `content` in the subfolder `place`."""
        digest = hashlib.blake2b(content, digest_size=6).hexdigest()
        path = f"{place}/{stem}-{digest}{ending}"
        target = self.folder / path
        if path in self.kept or target.exists() and target.stat().st_size == len(content):
            self.use(path)
        else:
            self._put_at(path, content)
        return path

    def _put_at(self, path, content):
        self.use(path)
        target = self.folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        # Whole or not at all: a reader never sees half of a file.
        partial = target.with_name(target.name + ".part")
        partial.write_bytes(content)
        partial.replace(target)

    def put_frames(self, place, stem, ending, contents, times, own):
        """Writes a file for each of these frames under one name, with #### for the number, and returns that name.

        `contents`: (time, bytes) for some frames; the others are as at the time `own`.
        """
        pattern, first, whole = None, None, {float(time) for time in times}
        for time, content in contents:
            if pattern is None:
                digest = hashlib.blake2b(content, digest_size=6).hexdigest()
                pattern = f"{place}/{stem}-{digest}_####{ending}"
            if time == own:
                first = content
            whole.discard(time)
            self._put_at(pattern.replace("####", f"{int(time):04}"), content)
        for time in whole:
            self._put_at(pattern.replace("####", f"{int(time):04}"), first)
        return pattern

    def drop(self, path):
        """Removes a file that this object wrote and that no scene uses after all."""
        self.used.discard(path)
        if path not in self.kept:
            (self.folder / path).unlink(missing_ok=True)

    def use(self, path):
        """Marks a file written earlier as used by this scene."""
        self.used.add(path)

    def sweep(self):
        """Removes what this object wrote for scenes before the last one."""
        for path in self.kept - self.used:
            (self.folder / path).unlink(missing_ok=True)
        self.kept, self.used = self.used, set()

    def copy(self, place, stem, ending, path):
        """Relative path of a copy of a large file, identified by its name, size and modification time."""
        there = os.stat(path)
        state = f"{os.path.abspath(path)} {there.st_size} {there.st_mtime_ns}"
        digest = hashlib.blake2b(state.encode("utf-8"), digest_size=6).hexdigest()
        copied = f"{place}/{stem}-{digest}{ending}"
        self.use(copied)
        target = self.folder / copied
        if not (target.exists() and target.stat().st_size == there.st_size):
            target.parent.mkdir(parents=True, exist_ok=True)
            partial = target.with_name(target.name + ".part")
            shutil.copyfile(path, partial)
            partial.replace(target)
        return copied
