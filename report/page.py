"""The page: one HTML file that needs nothing else, from rows, panels and plots.

build() is pure; main() reads the sections' CSV files under build/report and writes index.html, report.csv and the
plots as files beside it.
"""
import base64
import csv
import html
import math
import os

from . import run

TITLES = {"figures": "The paper's figures", "time": "Error against run time", "size": "Size of the light field", "storage": "Storage forms",
          "budget": "Error budget of the chain", "depth": "Depth correction", "grid": "Spatial resolution", "lamps": "Lamps taken out",
          "shrink": "Light fields that shrink"}
INTRO = {
    "figures": "The photograph is the room itself with the objects in it, its lamps as light sources. Beside it the same objects in the captured light field, and in a "
               "single probe. The error maps show picture minus photograph: blue too dark, red too bright, full colour at the photograph's mean.",
    "time": "One light field, one scene, one picture of {pixels} pixels, rendered in every way there is. No depth correction here, because stock Radiance's "
            "<code>colordata</code> table has none: so all ways but the single probe have the same limit.",
    "size": "The finest light field, made by rays without a camera, then with fewer probes and with smaller ones. What stays at the finest size is the way of "
            "interpolating itself.",
    "storage": "One light field in the forms that <code>ilfpack</code> writes. The error is that of the texels, relative to their mean; the CPU seconds are those of reading it all "
               "(<code>ilfinfo</code>).",
    "budget": "The ideal: probes traced by rays at the true places, float, without camera. Then one stage at a time is made real; its own error is the difference from the picture "
              "with all but that stage.",
    "depth": "The studio with two small bare lamps, one light field of 4 × 4 probes, 25 cm apart, looked up on different auxiliary geometry. The lamps as geometry of their own do harm: a ray that just passes a lamp meets the wall behind it at a point that the probes, which stand elsewhere, see hidden by that lamp: so its light counts twice there.",
    "grid": "The light through a branch varies quickly over the plane: probes by rays, without camera, at grids from coarse to the paper's own.",
    "lamps": "Perfect captures, without a camera, of rooms whose light is known everywhere; the walls are given. Version 1 is the light field as captured, version 2 what "
             "<code>ilflamps</code> makes of it. Rooms by chance come with nothing given: what the gain is, and how often it was none.",
    "shrink": "One light field, smaller and smaller: compressed as it is, by DWA, with its texels rounded (<code>--tolerance</code>), and with its lamps taken out and fewer probes of what is left. "
              "The error is that of irradiance, on the plane and above it, up and to four sides, beside the field as it was; where lamps were taken out, beside that form with all its probes. The CPU seconds "
              "are those of reading it all (<code>ilfinfo</code>).",
}
CSS = """
:root { color-scheme: light; --ink: #1d1f21; --quiet: #5b6066; --line: #d9dcdf; --soft: #f5f6f7; --link: #0b5c97; }
* { box-sizing: border-box; }
body { margin: 0; font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; color: var(--ink); background: #fff; }
main, header { max-width: 1180px; margin: 0 auto; padding: 0 24px; }
header { padding-top: 32px; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .4em; }
h2 { font-size: 1.4rem; margin: 2.4em 0 .3em; padding-top: .5em; border-top: 1px solid var(--line); }
h3 { font-size: 1.05rem; margin: 1.6em 0 .5em; }
p, li { max-width: 48em; }
.quiet, figcaption, .note { color: var(--quiet); font-size: .9rem; }
a { color: var(--link); }
nav { display: flex; flex-wrap: wrap; gap: .3em 1.2em; margin: 1em 0; }
img { max-width: 100%; height: auto; display: block; }
figure { margin: 1em 0; max-width: 880px; }
figcaption { margin-top: .4em; max-width: 48em; }
.panel { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 14px; margin: .6em 0 1.4em; }
.panel > div > img { width: 100%; }
.panel .map { margin-top: 8px; border: 1px solid var(--line); }
.panel strong { display: block; margin-top: .4em; }
.scale { height: 12px; margin: 8px 0 2px; background: linear-gradient(90deg, #053061, #4393c3, #f7f7f7, #d6604d, #67001f); }
.ends { display: flex; justify-content: space-between; font-size: .8rem; color: var(--quiet); }
table { border-collapse: collapse; width: 100%; font-size: .9rem; margin: 1em 0; }
th, td { text-align: left; padding: .35em .7em .35em 0; border-bottom: 1px solid var(--line); vertical-align: top; }
th { color: var(--quiet); font-weight: 600; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.c { width: 1%; }
td.c summary { white-space: nowrap; }
td.c pre { width: 26em; }
summary { cursor: pointer; color: var(--link); }
code { white-space: nowrap; }
pre, code { font: .82rem/1.45 ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; background: var(--soft); padding: .6em .8em; margin: .3em 0; border-radius: 4px; user-select: all; }
footer { margin: 3em 0 2em; color: var(--quiet); font-size: .9rem; }
@media (max-width: 700px) {
  main, header { padding: 0 15px; }
  header { padding-top: 20px; }
  h1 { font-size: 1.5rem; } h2 { font-size: 1.2rem; }
  .panel { grid-template-columns: minmax(0, 1fr); }
  table, tbody, tr, td { display: block; width: 100%; }
  thead { display: none; }
  tr { border: 1px solid var(--line); border-radius: 6px; padding: .5em .8em; margin: 0 0 .7em; }
  td, td.n { display: inline-block; width: auto; max-width: 100%; border: 0; padding: 0 .9em 0 0; text-align: left; white-space: normal; overflow-wrap: anywhere; }
  td::before { content: attr(data-label) " "; color: var(--quiet); }
  td:first-child, td.c { display: block; width: 100%; border: 0; padding: .1em 0; }
  td.c pre { width: auto; }
  td:first-child { font-weight: 600; } td:first-child::before, td.c::before { content: ""; }
}
"""


def data_uri(png):
    return "data:image/png;base64," + base64.b64encode(png).decode()


def text(x):
    return html.escape(str(x))


def percent(x):
    return f"{100 * float(x):.3g} %" if x != "" else ""


def plain(x, form="{:.3g}"):
    return form.format(float(x)) if x != "" else ""


def seconds(x):
    return (f"{float(x):.2f}" if float(x) < 10 else f"{float(x):.0f}") if x != "" else ""


# heading, class, key, how it is shown
COLUMNS = [("row", "", "row", text), ("error", "n", "error", percent), ("SSIM", "n", "ssim", lambda x: plain(x, "{:.4f}")), ("CPU s", "n", "cpu_s", seconds),
           ("peak MB", "n", "peak_mb", lambda x: plain(x, "{:.0f}")), ("reference", "", "reference", text),
           ("its own error", "n", "reference_error", percent), ("measure", "", "measure", text)]
NOTED = {"storage", "budget", "size", "lamps", "shrink"}     # sections whose rows say more in words


def table(rows):
    shown = [c for c in COLUMNS if any(r[c[2]] != "" for r in rows)]
    if len({r["figure"] for r in rows}) > 1 or rows[0]["figure"] != rows[0]["section"]:
        shown.insert(1, ("figure", "", "figure", text))
    if rows[0]["section"] in NOTED:
        shown.insert(1, ("what", "", "note", text))
    head = "".join(f'<th class="{k}">{h}</th>' if k else f"<th>{h}</th>" for h, k, _, _ in shown) + "<th>command</th>"
    body = []
    for r in rows:
        cells = [f'<td{f" class={chr(34)}{k}{chr(34)}" if k else ""} data-label="{h}" data-key="{key}" data-value="{text(r[key])}">{show(r[key])}</td>'
                 for h, k, key, show in shown]
        cells.append(f'<td class="c"><details><summary>command</summary><pre>{text(r["command"])}</pre>'
                     f'<span class="quiet">by {text(r["programs"])}</span></details></td>')
        body.append(f'<tr data-section="{text(r["section"])}" data-row="{text(r["row"])}">{"".join(cells)}</tr>')
    return f"<table><thead><tr>{head}</tr></thead><tbody>\n" + "\n".join(body) + "\n</tbody></table>"


def panel(title, pictures, rows):
    """One figure: pictures as figures.panel gives them; rows by the picture's key."""
    found = {r["note"]: r for r in rows}
    cells = []
    for key, label, shown, error in pictures:
        r = found.get(key)
        words = (f'RMSE {percent(r["error"])} · SSIM {plain(r["ssim"], "{:.3f}")} · {seconds(r["cpu_s"])} CPU s' if r else "the reference")
        image = f'<img src="{data_uri(shown)}" alt="{text(title)}: {text(label)}">'
        if error:
            image += f'<img class="map" src="{data_uri(error)}" alt="difference of {text(label)} from the photograph">'
        else:
            image += ('<div class="scale"></div><div class="ends"><span>too dark by the mean</span><span>right</span><span>too bright</span></div>')
        cells.append(f"<div>{image}<strong>{text(label)}</strong><span class=quiet>{words}</span></div>")
    return f"<h3>{text(title)}</h3><div class=panel>{''.join(cells)}</div>"


def plot(caption, wide, narrow):
    return (f'<figure><picture><source media="(max-width: 700px)" srcset="{data_uri(narrow)}"><img src="{data_uri(wide)}" alt="{text(caption)}"></picture>'
            f"<figcaption>{text(caption)}</figcaption></figure>")


def programs_table(found):
    """found: programs.table's rows."""
    body = "".join(f'<tr data-program="{text(name)}"><td data-label="program">{text(name)}</td><td data-label="build"><code>{text(digest)}</code></td>'
                   f'<td class="n" data-label="numbers">{count}</td><td data-label="">{text(remark)}</td></tr>\n' for name, digest, count, remark in found)
    return f'<table><thead><tr><th>program</th><th>build</th><th class="n">numbers</th><th></th></tr></thead><tbody>\n{body}</tbody></table>'


def build(sections, panels, plots, findings=(), facts=None, built=((), "")):
    """The page's text.  sections {name: rows}; panels [(title, pictures, rows)]; plots {name: [(file, caption, wide, narrow)]};
    built: programs.table's rows, and words on the version."""
    facts = {"pixels": "?", **(facts or {})}
    shown = [n for n in TITLES if sections.get(n)]
    parts = ["<!doctype html>", '<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">',
             "<title>Incident light fields: how wrong, for how much time</title>", f"<style>{CSS}</style></head><body><header>",
             "<h1>Incident light fields: how wrong, for how much time</h1>",
             "<p>Every picture is compared with one that is known to be right, because the rooms are virtual. Errors are root-mean-square "
             "differences relative to the mean of the reference. Each number can be made again by the command beside it, in a shell at the project's top after "
             "<code>eval \"$(make -s env)\"</code>; all numbers are in <code>report.csv</code> beside this page.</p>"]
    if findings:
        parts.append("<ul>" + "".join(f"<li>{f}</li>" for f in findings) + "</ul>")
    parts.append("<nav>" + "".join(f'<a href="#{n}">{TITLES[n]}</a>' for n in shown) + ('<a href="#programs">Programs</a>' if built[0] else "") + "</nav></header><main>")
    for n in shown:
        parts.append(f'<h2 id="{n}">{TITLES[n]}</h2><p>{INTRO[n].format(**facts)}</p>')
        if n == "figures":
            parts += [panel(*p) for p in panels]
        parts += [plot(c, w, m) for _, c, w, m in plots.get(n, [])]
        parts.append(table(sections[n]))
    if built[0]:
        parts.append(f'<h2 id="programs">Programs</h2><p>{text(built[1])} A build is named by the first digits of the SHA-256 of the program\'s bytes. '
                     "What each row came from stands below its command; a number is made again when one of its programs has changed.</p>")
        parts.append(programs_table(built[0]))
    parts.append("<footer><p>CPU seconds are user plus system time of the command and its children, not of the measuring; peak memory is that of "
                 "the largest process (never below about 12 MB, the size of the program that starts it). Pictures with independent random numbers are seeded by the second "
                 "of the clock: a reference made again differs by its own error.</p></footer></main></body></html>\n")
    return "\n".join(parts)


def write(path, data):
    part = f"{path}.part"
    with open(part, "wb" if isinstance(data, bytes) else "w") as f:
        f.write(data)
    os.replace(part, path)


def seconds_for(rows, error):
    """CPU seconds at which a way of rendering reaches an error, between its runs in the logarithm; None outside them."""
    points = sorted((float(r["error"]), float(r["cpu_s"])) for r in rows)
    for (e0, t0), (e1, t1) in zip(points, points[1:]):
        if e0 <= error <= e1:
            return t0 * (t1 / t0) ** (math.log(error / e0) / math.log(e1 / e0)) if e1 > e0 else t0
    return None


def time_findings(rows):
    """The most accurate run with importance samples beside what blind rays need for the same error."""
    ways = {w: [r for r in rows if r["row"].rsplit(" ", 1)[0] == w] for w in ("literal", "colordata", "-di", "-di, cache")}
    aimed = sorted(ways["-di"] + ways["-di, cache"], key=lambda r: float(r["error"]))
    if not aimed:
        return []
    r = aimed[0]
    needs = [(w, seconds_for(ways[w], float(r["error"]))) for w in ("literal", "colordata")]
    said = "; ".join(f"{name} needs {seconds(t)} s for that" for (w, t), name in zip(needs, ("the paper's way", "a <code>colordata</code> table")) if t)
    return [f"<code>{text(r['row'])}</code> is wrong by {percent(r['error'])} after {seconds(r['cpu_s'])} CPU s{'; ' + said if said else ''}."]


def findings(sections):
    """What the numbers say, in words: only from the rows."""
    out = []
    for name in dict.fromkeys(r["figure"] for r in sections.get("figures", [])):
        by = {r["note"]: float(r["error"]) for r in sections["figures"] if r["figure"] == name}
        lit = f", with its lamps taken out by {percent(by['with_room.lamps'])}" if "with_room.lamps" in by else ""
        out.append(f"{text(name.replace('figure', 'figure ')).capitalize()}: the light field is wrong by {percent(by['with_room'])}{lit}, a single probe by "
                   f"{percent(by['with_single'])}: {by['with_single'] / by['with_room']:.1f} times as much as the light field.")
    out += time_findings(sections.get("time", []))
    rows = [r for r in sections.get("budget", []) if r["figure"] == "budget" and r["y"]]
    if rows:
        r = sorted(rows, key=lambda x: -float(x["y"]))
        out.append(f"Of the chain's stages, <b>{text(r[0]['row'])}</b> costs most ({percent(r[0]['y'])}), then {text(r[1]['row'])} ({percent(r[1]['y'])})."
                   if len(r) > 1 else f"{text(r[0]['row'])}: {percent(r[0]['y'])}.")
    rows = sections.get("depth", [])
    by = {r["row"]: r for r in rows}
    if {"nodepth", "room, no lamps", "the true room"} <= set(by):
        out.append(f"Depth correction under small lamps: {percent(by['nodepth']['error'])} without, {percent(by['room, no lamps']['error'])} with the room's walls as "
                   f"auxiliary geometry, {percent(by['the true room']['error'])} with the lamps as surfaces of their own, too.")
    rows = sorted(sections.get("grid", []), key=lambda r: float(r["x"]))
    if len(rows) > 1:
        out.append("Dappled light: " + ", ".join(f"{text(r['row'])} {percent(r['error'])}" for r in (rows[0], rows[len(rows) // 2], rows[-1])) + ".")
    return out


def main(argv=()):
    from . import figures, plots_of, programs, scene
    folder = run.TOP / run.OUT
    wanted = list(argv) or list(TITLES)
    sections = {n: run.read_rows(folder / f"{n}.csv") for n in TITLES if n in wanted and (folder / f"{n}.csv").is_file()}
    if not sections:
        raise run.ReportError(f"{run.OUT}: expected a section's .csv, found none")
    panels = []
    for name in dict.fromkeys(r["figure"] for r in sections.get("figures", [])):
        panels.append((figures.TITLES.get(name, name), figures.panel(name), [r for r in sections["figures"] if r["figure"] == name]))
    drawn = {n: plots_of.OF[n](rows) for n, rows in sections.items() if n in plots_of.OF}
    for found in drawn.values():
        for name, _, wide, _ in found:
            write(folder / f"{name}.png", wide)
    page = build(sections, panels, drawn, findings(sections), {"pixels": f"{scene.SIZE[0]} × {scene.SIZE[1]}"},
                 (programs.table(sections), programs.version()))
    part = folder / "report.csv.part"
    with open(part, "w", newline="") as f:
        w = csv.DictWriter(f, run.FIELDS)
        w.writeheader()
        for rows in sections.values():
            w.writerows(rows)
    os.replace(part, folder / "report.csv")
    write(folder / "index.html", page)
    run.say(f"page: {run.OUT}/index.html, {len(page) / 1e6:.1f} MB, {sum(map(len, sections.values()))} rows")
