"""Markdown to pages: render.py FOLDER DOCUMENT ...

The first file is index.html.  Links between the documents lead from page to page, links to man pages to their HTML, all others
to the file in the source tree.
"""
import os
import re
import shutil
import sys
from pathlib import Path

import markdown

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title><link rel="stylesheet" href="page.css"></head><body>
<nav>{nav}</nav>
{body}
</body></html>
"""


def page_name(path, first):
    """README.md of a folder has the folder's name."""
    if path == first:
        return "index.html"
    return (path.parent.name if path.stem == "README" else path.stem).lower() + ".html"


def main(folder, *names):
    out, files = Path(folder), [Path(n) for n in names]
    pages = {f.resolve(): page_name(f, files[0]) for f in files}
    manual = sorted(Path("man").glob("*.[17]"))
    nav = "".join(f'<a href="{name}">{f.parent.name + "/" if f.stem == "README" and f.parent.name else ""}{f.stem}</a>'
                  for f, name in zip(files, pages.values())) + '<a href="api/files.html">API</a><br>'
    nav += "".join(f'<a href="man/{m.name}.html">{m.stem}({m.suffix[1:]})</a>' for m in manual)
    shutil.copy("docs/page.css", out)

    def moved(source, target):
        """Where a link in the document source leads from the pages' folder."""
        name, hash_, part = target.partition("#")
        if not name or re.match(r"\w+:", target):
            return target
        there = (source.parent / name).resolve()
        if there in pages:
            return pages[there] + hash_ + part
        if there.parent.name == "man" and there.suffix[1:].isdigit():
            return f"man/{there.name}.html"
        if there.suffix in (".jpg", ".png"):
            (out / "pictures").mkdir(exist_ok=True)
            shutil.copy(there, out / "pictures")
            return f"pictures/{there.name}"
        return os.path.relpath(there, out) + hash_ + part

    for f in files:
        text = f.read_text()
        body = markdown.markdown(text, extensions=["tables", "fenced_code", "toc", "sane_lists", "attr_list"])
        body = re.sub(r'(href|src)="([^"]*)"', lambda m, f=f: f'{m[1]}="{moved(f, m[2])}"', body)
        title = re.search(r"^# (.*)$", text, re.M)
        (out / pages[f.resolve()]).write_text(PAGE.format(title=title[1] if title else f.stem, nav=nav, body=body))


if __name__ == "__main__":
    main(*sys.argv[1:])
