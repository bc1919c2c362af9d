"""Names for the scene file and for files: unique, and the same each time."""

import re

RESERVED = {"all", "camera", "world", "none"}
UNSAFE = re.compile(r"[^\w .+-]")


def plain(name):
    """`name` reduced to letters, digits and a few signs, without brackets, which would denote a copy among
    instances."""
    return UNSAFE.sub("_", name).strip() or "unnamed"


def file_name(name):
    """`name` as a valid file name on any system."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", name)[:60].strip("_") or "unnamed"


class Names:
    """Gives each key a unique name."""

    def __init__(self):
        self._by_key = {}
        self._taken = set(RESERVED)

    def get(self, key, *wanted):
        """Name of `key`: `wanted`, parts joined with /, followed by a number if it is taken."""
        if key not in self._by_key:
            base = "/".join(map(plain, wanted))
            name, count = base, 1
            while name in self._taken:
                count += 1
                name = f"{base}-{count}"
            self._taken.add(name)
            self._by_key[key] = name
        return self._by_key[key]
