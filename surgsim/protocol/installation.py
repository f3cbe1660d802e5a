"""A bundle against this installation: its code, packages and weights, and the machine."""

from collections.abc import Iterator

from surgsim.protocol.bundle import Bundle
from surgsim.protocol.checks import Asked
from surgsim.protocol.entrants import program_hashes
from surgsim.protocol.findings import Finding, differences
from surgsim.protocol.runs import compilers, cpu
from surgsim.runs.part_origins import externals_of, plugins_of, policies_of
from surgsim.runs.provenance import provenance
from surgsim.runs.sources import source_hashes


def check_code(bundle: Bundle, asked: Asked) -> Iterator[Finding]:
    """The sources, assets, packages, policies and programs here are those that the bundle was made with."""
    told = bundle.score.controller
    yield from differences("code", bundle.code.files, source_hashes())
    scenario = next((cell.scenario for cell in asked.cells.values() if cell.scenario is not None), None)
    if scenario is not None:
        yield from differences("package", told.plugins, plugins_of(scenario))
        yield from differences("policy", told.policies, policies_of(scenario))
        yield from differences("external controller", told.externals, externals_of(scenario))
    yield from differences("weights", told.weights, program_hashes(asked.entrant.config))


def platform_differences(bundle: Bundle) -> list[Finding]:
    """What of the platform is different, so that numbers may be; empty if nothing is."""
    there, here = bundle.score.environment, provenance()
    machine = {"machine": here["machine"], "python": here["python"], "cpu": cpu()}
    told = {"machine": there.machine, "python": there.python, "cpu": bundle.code.cpu}
    return [
        *differences("platform", told, machine),
        *differences("platform", there.packages, here["packages"]),
        *differences("platform", bundle.code.compilers, compilers()),
    ]
