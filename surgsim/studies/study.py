"""What a study declares: the paper, cases with their measures, tables, claims, figures and the page."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Literal, cast

from surgsim.array import Array
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import simulate
from surgsim.studies.tables import Row, Tables
from surgsim.trace.trace import Trace

Curves = Mapping[str, Array]
Progress = Callable[[str], None]
"""Called with a line about what is being done."""

Verdict = Literal["holds", "can be fitted", "does not hold", "depends", "not comparable"]
"""`can be fitted`: our figures are the paper's, with constants that were fitted to these very figures."""
Judged = tuple[Verdict, str]
"""A verdict and the figures behind it."""


def holds(condition: bool) -> Verdict:
    """The verdict of a yes-or-no claim."""
    return "holds" if condition else "does not hold"


def in_all(flags: Sequence[bool], every: Verdict = "holds") -> Verdict:
    """The verdict of a claim that is so in all (`every`), some or none of several cases."""
    return every if all(flags) else "depends" if any(flags) else "does not hold"


@dataclass(frozen=True)
class Printed:
    """What the paper prints at one place.

    Attributes:
        where: The place: a table, a figure, a section.
        unit: Of every value.
        value: A number, or numbers by what they belong to.
    """

    where: str
    unit: str
    value: Any

    @property
    def source(self) -> str:
        """As the source of a claim."""
        return f"paper, {self.where}"


@dataclass(frozen=True, kw_only=True)
class Paper:
    """What is reproduced.

    Attributes:
        title: Its title.
        reference: Where it appeared, as far as known.
        printed: Every number that the study compares with, by name.
    """

    title: str
    reference: str = ""
    printed: Mapping[str, Printed]

    def __getitem__(self, name: str) -> Any:
        """The value of a printed number."""
        return self.printed[name].value


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A case that was run.

    Attributes:
        case: The case.
        row: Its measures by name, the unit last.
        curves: What the figures show of it.
    """

    case: Any
    row: Row
    curves: Curves = field(default_factory=dict)

    def only(self, *names: str) -> Row:
        """These measures, in this order."""
        return {name: self.row[name] for name in names}


class Case(ABC):
    """One run; a frozen dataclass of its settings, so that equal cases are run once.

    Attributes:
        alone: Whether it measures time: it is run after all others, with no other process beside it.
    """

    alone: ClassVar[bool] = False

    @property
    def label(self) -> str:
        """In words: what kind of case, and its settings."""
        settings = [getattr(self, setting.name) for setting in fields(cast(Any, self))]
        words = [" ".join(map(str, value)) if isinstance(value, tuple) else str(value) for value in settings]
        return f"{type(self).__name__}: {', '.join(filter(None, words))}"

    @abstractmethod
    def measured(self) -> Measured:
        """Run the case and measure it."""


class SimulatedCase(Case):
    """A case that is the run of a scenario: what is measured are functions of its trace."""

    @abstractmethod
    def scenario(self) -> Scenario:
        """The scenario with its controller."""

    def run(self) -> Trace:
        """The trace; it is not kept."""
        return simulate(self.scenario())

    @abstractmethod
    def measures(self, trace: Trace) -> Row:
        """Numbers and words by name; a number's name ends in its unit."""

    def curves(self, trace: Trace) -> Curves:
        """Arrays that the figures show, by name."""
        return {}

    def measured(self) -> Measured:
        """Run the scenario; measures and curves of its trace."""
        trace = self.run()
        return Measured(case=self, row=self.measures(trace), curves=self.curves(trace))


Groups = Mapping[str, Sequence[Case]]
"""Cases by the name of what they are for; a case may be in several groups."""


class Results:
    """Every measured case.

    Args:
        groups: The cases.
        measured: What each gave.
    """

    def __init__(self, groups: Groups, measured: Mapping[Any, Measured]) -> None:
        self._groups, self._measured = groups, measured

    def __getitem__(self, group: str) -> list[Measured]:
        """The cases of a group in their order; none if the group is not run."""
        return [self._measured[case] for case in self._groups.get(group, ())]

    def __contains__(self, case: Case) -> bool:
        """Whether a case was run."""
        return case in self._measured

    def of(self, case: Case) -> Measured:
        """One case.

        Raises:
            KeyError: If it was not run.
        """
        return self._measured[case]

    def rows(self, group: str, *columns: str) -> list[Row]:
        """The measures of a group's cases, all or these columns: the simplest table."""
        return [measured.only(*columns) if columns else measured.row for measured in self[group]]


@dataclass(frozen=True)
class Claim:
    """A statement that the study checks.

    Attributes:
        source: Who says so: the paper with the place in it, or `surgsim`.
        text: The statement, with the paper's number where it has one.
        judge: The rule: verdict and our figures from the tables; None where their rows are missing.
    """

    source: str
    text: str
    judge: Callable[[Tables], Judged | None]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A claim that was checked.

    Attributes:
        source: Who says so.
        text: The statement.
        verdict: Whether it holds.
        evidence: The figures behind the verdict.
    """

    source: str
    text: str
    verdict: Verdict
    evidence: str


@dataclass(frozen=True)
class Figure:
    """A figure.

    Attributes:
        file: Name of its file.
        title: What stands above it.
        draw: Draws into axes (rows, columns).
        shape: Rows and columns of axes.
        size: Width and height [inch].
        share: Whether axes have the same range: `sharex` and `sharey` of matplotlib.
    """

    file: str
    title: str
    draw: Callable[[Any, Results, Tables], None]
    shape: tuple[int, int] = (1, 1)
    size: tuple[float, float] = (11.0, 4.0)
    share: tuple[bool | str, bool | str] = (False, False)


@dataclass(frozen=True)
class Section:
    """A part of the page: a text, a table, figures, in this order.

    Attributes:
        text: Markdown, or what makes it of the tables.
        table: Name of the table that is shown; without its rows the section is left out.
        figures: Files of the figures.
        digits: Significant digits.
        columns: Columns that are shown; all if there are none.
        rows: Rows to show that are no result.
    """

    text: str | Callable[[Tables], str]
    table: str | None = None
    figures: tuple[str, ...] = ()
    digits: int = 4
    columns: tuple[str, ...] = ()
    rows: tuple[Row, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Study:
    """The declaration of a study.

    Attributes:
        name: What `surgsim reproduce` calls it.
        heading: Of the page.
        introduction: Of the page, with `{title}`, `{reference}`, `{command}` and `{versions}`.
        quick_note: What a quick run is, in the page's words.
        paper: What is reproduced.
        cases: The cases, of a quick run if it is called with True.
        tables: How each table is made, the main one first; one without rows is left out.
        claims: What is checked, in order.
        sections: The page after the claims.
        figures: Every figure, drawn unless the run is quick.
    """

    name: str
    heading: str
    introduction: str
    quick_note: str
    paper: Paper
    cases: Callable[[bool], Groups]
    tables: Mapping[str, Callable[[Results], Sequence[Row]]]
    claims: Sequence[Claim]
    sections: Sequence[Section]
    figures: Sequence[Figure]

    def judge(self, tables: Tables) -> tuple[Finding, ...]:
        """Every claim for which there are rows."""
        judged = ((claim, claim.judge(tables)) for claim in self.claims)
        return tuple(
            Finding(source=claim.source, text=claim.text, verdict=found[0], evidence=found[1])
            for claim, found in judged
            if found is not None
        )
