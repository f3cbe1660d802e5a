"""Parts come and go without a change of the schema."""

import ast
import inspect

from surgsim.control.instrument_estimators import INSTRUMENT_ESTIMATORS
from surgsim.control.port_estimators import PORT_ESTIMATORS
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.torque_laws import TORQUE_LAWS
from surgsim.plant import PLANTS
from surgsim.plant.disturbances import DISTURBANCES
from surgsim.plant.props import PROPS
from surgsim.scenario import schema
from surgsim.tasks import TASKS
from surgsim.teleop.bilateral import BILATERAL

CATALOGS = (
    TASKS,
    PLANTS,
    DISTURBANCES,
    PROPS,
    RESOLVERS,
    TORQUE_LAWS,
    PORT_ESTIMATORS,
    INSTRUMENT_ESTIMATORS,
    BILATERAL,
)


def named_in(source):
    """Parts that a module names: by a text, or by importing their configs."""
    known = {name: place for catalog in CATALOGS for name, place in catalog.places.items()}
    modules = {place.partition(":")[0]: name for name, place in known.items()}
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and node.value in known:
            found.add(node.value)
        if isinstance(node, ast.ImportFrom) and node.module in modules:
            found.add(modules[node.module])
    return found


def test_the_schema_names_no_part():
    assert named_in(inspect.getsource(schema)) == set()
    assert named_in("from surgsim.tasks.circle import CircleConfig\nx = task.type == 'teleoperation'") == {
        "circle",
        "teleoperation",
    }
