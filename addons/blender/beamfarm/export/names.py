"""Names for the scene file and for files: one for each thing, the same each time."""

import re

RESERVED = {"all", "camera", "world", "none"}
UNSAFE = re.compile(r"[^\w .+-]")


def plain(name):
    """`name` with only letters, digits and a few signs: no brackets, which would name a copy of instances."""
    return UNSAFE.sub("_", name).strip() or "unnamed"


def file_name(name):
    """`name` for a file on any system."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", name)[:60].strip("_") or "unnamed"


class Names:
    """Gives each key a name of its own."""

    def __init__(self):
        self._by_key = {}
        self._taken = set(RESERVED)

    def get(self, key, *wanted):
        """Name of `key`: `wanted`, parts with / between them, with a number behind it where that is taken."""
        if key not in self._by_key:
            base = "/".join(map(plain, wanted))
            name, count = base, 1
            while name in self._taken:
                count += 1
                name = f"{base}-{count}"
            self._taken.add(name)
            self._by_key[key] = name
        return self._by_key[key]
