"""TOML from dicts, lists, strings, numbers and booleans. Floats are written so that they read back exactly."""

import math
import re

import numpy as np

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+\Z")
ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\r": "\\r", "\t": "\\t", "\b": "\\b", "\f": "\\f"}
LINE = 110


def document(tables):
    """Text of a dict of tables; a list of dicts is an array of tables, and a dict of dicts a table of tables."""
    parts = []
    for name, value in tables.items():
        if isinstance(value, list):
            parts.extend(f"[[{key(name)}]]\n{_body(table)}" for table in value)
        elif value and all(isinstance(entry, dict) for entry in value.values()):
            parts.extend(f"[{key(name)}.{key(inner)}]\n{_body(table)}" for inner, table in value.items())
        elif value:
            parts.append(f"[{key(name)}]\n{_body(value)}")
    return "\n".join(parts)


def _body(table):
    return "".join(f"{key(name)} = {_value(name, value)}\n" for name, value in table.items())


def _value(name, value):
    text = inline(value)
    if isinstance(value, list) and len(name) + len(text) > LINE:
        return "[\n" + "".join(f"    {inline(entry)},\n" for entry in value) + "]"
    return text


def key(name):
    return name if BARE_KEY.match(name) else text(name)


def text(value):
    def escape(letter):
        if letter in ESCAPES:
            return ESCAPES[letter]
        if ord(letter) < 0x20 or ord(letter) == 0x7F:
            return f"\\u{ord(letter):04x}"
        return letter

    return '"' + "".join(map(escape, value)) + '"'


def inline(value):
    """`value` on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return text(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return number(value)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key(name)} = {inline(entry)}" for name, entry in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(inline, value)) + "]"
    raise TypeError(f"no TOML for {type(value).__name__}")


def number(value):
    if not math.isfinite(value):
        raise ValueError(f"{value} is no number for a scene")
    # Most of Blender's numbers are single precision: the shortest text that reads back as these.
    short = np.float32(value) if abs(value) < 3e38 else value
    return repr(float(str(short))) if float(short) == value else repr(value)
