#!/usr/bin/env python3
"""The documents as a site: python3 docs/site.py writes target/site/html, by mdBook
(cargo install mdbook --version "^0.4").

    python3 docs/site.py --check                    # only whether every link leads somewhere: what CI runs
    python3 docs/site.py                            # that, and the site

A link of a document is relative to its file: to a file of the checkout, to a heading, or to both. Headings have the
anchors that GitHub gives them, which are mdBook's as well. Links to files that are no documents and no pictures, such as
sources, lead to the repository if --repository says where it is; without that they stay as text.
"""

import argparse
import pathlib
import re
import shutil
import subprocess
import sys
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parent.parent
SITE = ROOT / "target/site"

# The order in which people need them.
CONTENTS = """\
[beamfarm](README.md)

# First steps

- [Introduction](docs/introduction.md)
- [Glass in fog](docs/tutorials/glass-in-fog.md)
- [A Mitsuba scene with its caustic](docs/tutorials/mitsuba.md)
- [A night street on three machines](docs/tutorials/farm.md)
- [Blender](docs/tutorials/blender.md)

# Reference

- [Manual](docs/manual.md)
- [Scene files](docs/scenes.md)
- [Python](docs/python.md)
- [Blender](docs/blender.md)
- [Farms](deploy/README.md)

# How it works

- [Method](docs/method.md)
- [Measurements](docs/measurements.md)
- [Regret](docs/regret.md)
- [Notes](docs/notes.md)

# Working on it

- [Contributing](CONTRIBUTING.md)
- [Changelog](CHANGELOG.md)
"""

BOOK = """\
[book]
title = "beamfarm"
language = "en"
src = "src"

[build]
build-dir = "html"

[output.html]
mathjax-support = true
"""

# Formulas in a line stand between dollars, as on GitHub.
HEAD = """\
<style>
.pair { position: relative; margin: 1.5em 0; }
.pair img { display: block; width: 100%; }
.pair .before { position: absolute; top: 0; left: 0; clip-path: inset(0 50% 0 0); }
.pair input { width: 100%; margin: 0.5em 0 0; }
.pair figcaption { display: flex; justify-content: space-between; }
</style>
<script>window.MathJax = { tex2jax: { inlineMath: [["$", "$"]], processEscapes: true } };</script>
"""

# A table of two pictures side by side: on the site, a slider uncovers one of them.
PAIR = re.compile(
    r"^\| (?P<before>[^|\n]+) \| (?P<after>[^|\n]+) \|\n\|[-:| ]+\|\n"
    r"\| !\[(?P<alt>[^]]*)\]\((?P<left>[^)]+)\) \| !\[(?P<alt2>[^]]*)\]\((?P<right>[^)]+)\) \|$",
    re.M,
)
SLIDER = r"""<figure class="pair">
<img src="\g<right>" alt="\g<alt2>">
<img class="before" src="\g<left>" alt="\g<alt>">
<input type="range" value="50" aria-label="how much of the left picture"
 oninput="this.previousElementSibling.style.clipPath = 'inset(0 ' + (100 - this.value) + '% 0 0)'">
<figcaption><span>\g<before></span><span>\g<after></span></figcaption>
</figure>
"""

LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)")
FENCE = re.compile(r"^(```|~~~).*?^\1\s*$", re.M | re.S)
CODE = re.compile(r"`[^`]*`")


def documents():
    """Markdown files that git knows or would take."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", "*.md"], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True
    )
    return sorted(ROOT / line for line in listed.stdout.splitlines() if (ROOT / line).exists())


def prose(text):
    """A document with code blanked out, line by line and column by column."""
    blank = lambda found: re.sub(r"[^\n]", " ", found.group())
    text = FENCE.sub(blank, text)
    text = re.sub(r"^(?: {4}|\t).*$", lambda found: blank(found) if "](" not in found.group() else found.group(), text, flags=re.M)
    return CODE.sub(blank, text)


def anchors(text):
    """The anchors of a document's headings, as GitHub makes them."""
    found = set()
    for heading in re.findall(r"^#{1,6}\s+(.*?)\s*#*$", FENCE.sub("", text), re.M):
        words = LINK.sub(lambda link: link.group(2), heading).replace("`", "")
        slug = re.sub(r"[^\w\- ]", "", words.lower()).replace(" ", "-")
        number, name = 0, slug
        while name in found:
            number += 1
            name = f"{slug}-{number}"
        found.add(name)
    found.update(re.findall(r'<a (?:id|name)="([^"]+)"', text))
    return found


def targets(document):
    """Line, address of every link of a document."""
    text = prose(document.read_text(encoding="utf-8"))
    for link in LINK.finditer(text):
        yield text.count("\n", 0, link.start()) + 1, link.group(3)


def dead(documents):
    """A line for each link that leads nowhere."""
    known = {}
    for document in documents:
        for line, address in targets(document):
            parts = urllib.parse.urlsplit(address)
            if parts.scheme or parts.netloc:
                continue
            path = urllib.parse.unquote(parts.path)
            target = (document.parent / path).resolve() if path else document
            where = f"{document.relative_to(ROOT)}:{line}: {address}"
            if not target.exists():
                yield f"{where}: there is no such file"
            elif parts.fragment and target.suffix == ".md":
                if target not in known:
                    known[target] = anchors(target.read_text(encoding="utf-8"))
                if parts.fragment not in known[target]:
                    yield f"{where}: there is no such heading"


def write(repository):
    """The site's sources in target/site/src, with the folders of the checkout, and the site."""
    source = SITE / "src"
    shutil.rmtree(SITE, ignore_errors=True)
    pages = [pathlib.PurePosixPath(path) for path in re.findall(r"\]\(([^)]+)\)", CONTENTS)]
    source.mkdir(parents=True)
    (source / "SUMMARY.md").write_text("# Summary\n\n" + CONTENTS, encoding="utf-8")
    (SITE / "book.toml").write_text(BOOK, encoding="utf-8")
    (SITE / "theme").mkdir()
    (SITE / "theme/head.hbs").write_text(HEAD, encoding="utf-8")
    for page in pages:
        document = ROOT / page

        def link(found):
            mark, text, address = found.groups()
            parts = urllib.parse.urlsplit(address)
            if parts.scheme or not parts.path:
                return found.group()
            target = (document.parent / urllib.parse.unquote(parts.path)).resolve().relative_to(ROOT)
            if pathlib.PurePosixPath(target.as_posix()) in pages:
                return found.group()
            if target.suffix in (".png", ".webp", ".svg"):
                (source / target).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(ROOT / target, source / target)
                return found.group()
            if mark or not repository:
                return text
            return f"[{text}]({repository.rstrip('/')}/blob/main/{target.as_posix()})"

        (source / page).parent.mkdir(parents=True, exist_ok=True)
        text = document.read_text(encoding="utf-8")
        text = re.sub(r"^```math\n(.*?)^```$", r"$$\n\1$$", text, flags=re.M | re.S)
        (source / page).write_text(PAIR.sub(SLIDER, LINK.sub(link, text)), encoding="utf-8")
    subprocess.run(["mdbook", "build", str(SITE)], check=True)
    print(f"{(SITE / 'html/index.html').relative_to(ROOT)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="only check the links")
    parser.add_argument("--repository", default="", help="address of the repository, for links to sources")
    arguments = parser.parse_args()
    found = list(dead(documents()))
    for line in found:
        print(line, file=sys.stderr)
    if found:
        sys.exit(1)
    if not arguments.check:
        if not shutil.which("mdbook"):
            sys.exit('mdbook is not there: cargo install mdbook --version "^0.4"')
        write(arguments.repository)


if __name__ == "__main__":
    main()
