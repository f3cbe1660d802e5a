"""The top of the page: who wins, by how much, how sure, where each fails, and what the scene looks like."""

from collections.abc import Sequence

from surgsim.compare.failures import Failing
from surgsim.compare.summary import Summary, summary
from surgsim.display import count
from surgsim.report import html
from surgsim.report.figures.schematic import schematic
from surgsim.report.results import Results
from surgsim.report.scenes import SceneView
from surgsim.report.sections.leaderboard import Boards


def header(results: Results, boards: Boards, scenes: Sequence[SceneView]) -> str:
    """The header of the page."""
    title = f"<h1>{html.escape(results.name)}</h1>"
    about = html.paragraph(str(results.suite.get("description") or ""), "about")
    told = _told(results, boards)
    words = f'<div class="words">{title}{about}{told}{_counts(results)}</div>'
    drawn = f'<div class="scenes">{"".join(map(_scene, scenes))}</div>' if scenes else ""
    return f"<header><div>{words}{drawn}</div></header>"


def _told(results: Results, boards: Boards) -> str:
    if not boards:
        return html.paragraph(f"No run completed: {count(len(results.runs), 'run')} failed.", "lead")
    metric = results.headline[0]
    found: Summary = summary(results.runs, metric, list(boards[metric].values()))
    fails = "".join(_fails(results, one) for one in found.failing)
    least = html.paragraph(found.least, "least") if found.least else ""
    lead = html.paragraph(found.first, "lead")
    return f'{lead}<h2>Where each fails</h2><ul class="failing">{fails}</ul>{least}'


def _fails(results: Results, one: Failing) -> str:
    order = results.runs.controllers
    marks = [f"{html.swatch(order.index(name))}<b>{html.escape(name)}</b>" for name in one.controllers]
    stops = [*(len(marks) - 1) * ",", ":"]  # within the names' boxes: no line begins with one
    names = " ".join(
        f'<span class="name">{mark}{stop}</span>' for mark, stop in zip(marks, stops, strict=True)
    )
    return f'<li class="{"fails" if one.bad else "holds"}">{names} {html.escape(one.text)}.</li>'


def _counts(results: Results) -> str:
    """How many runs of what there are, in one line."""
    runs = results.runs
    failed, idle = len(runs) - int(runs.completed.sum()), int(runs.not_done.sum())
    points = len(set(runs.parameters.tolist()))
    parts = [
        count(len(runs), "run"),
        count(len(runs.controllers), "controller"),
        count(len(runs.scenarios), "scenario"),
        *([count(points, "grid point")] if points > 1 else []),
        count(len(set(runs.seed.tolist())), "seed"),
        f"{len(runs) - failed} completed",
    ]
    items = [f"<li>{part}</li>" for part in parts]
    items.append(f'<li class="{"bad" if failed else ""}">{failed} failed</li>')
    items += [f'<li class="bad">{idle} completed, task not done</li>'] if idle else []
    return f'<ul class="facts">{"".join(items)}</ul>'


def _scene(view: SceneView) -> str:
    """A picture of a scene, or a schematic where none could be drawn."""
    said = f"Scene at the start of {view.scenario}: the arm {view.robot} holds the instrument in the port."
    if view.picture is None:
        note = "Schematic: this machine has no OpenGL to draw the scene."
        return html.figure(schematic(view), f"The scene of {view.scenario}", note)
    image = f'<img alt="{html.escape(said)}" src="data:image/jpeg;base64,{html.escape(view.picture)}">'
    caption = f"<figcaption><small>{html.escape(view.scenario)} at its start</small></figcaption>"
    return f"<figure>{image}{caption}</figure>"
