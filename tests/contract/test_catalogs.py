"""What every catalogued part promises. A part is tested by its line in the catalog, or by its entry point."""

import pytest

from surgsim.contract.package import CATALOGS, checks_of
from surgsim.contract.policies import CHECKS as POLICY_CHECKS
from surgsim.control.policies.registry import find_policy, policy_names

CASES = [
    pytest.param(catalog, name, check, id=f"{catalog.kind}-{name}-{check.name}".replace(" ", "_"))
    for catalog in CATALOGS
    for name in catalog.names()
    for check in checks_of(catalog)
]


@pytest.mark.parametrize(("catalog", "name", "check"), CASES)
def test_a_part_keeps_its_promise(catalog, name, check):
    check.run(catalog.loaded(name))


@pytest.mark.parametrize("name", policy_names())
@pytest.mark.parametrize("check", POLICY_CHECKS, ids=[check.name for check in POLICY_CHECKS])
def test_a_policy_keeps_its_promise(name, check):
    check.run(find_policy(name))
