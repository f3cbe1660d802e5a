"""What every catalogued part promises. A new part is tested by its line in the catalog."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.catalog import Catalog
from surgsim.control.port_estimators import PORT_ESTIMATORS
from surgsim.control.port_estimators.base import PortProblem
from surgsim.control.failure import ControlFailure
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.torque_laws import TORQUE_LAWS
from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig, TrocarConfig
from surgsim.plant import PLANTS
from surgsim.plant.disturbances import DISTURBANCES
from surgsim.plant.props import PROPS
from surgsim.tasks import TASKS
from surgsim.tasks.base import Feedback

CATALOGS = (RESOLVERS, TORQUE_LAWS, PORT_ESTIMATORS, TASKS, DISTURBANCES, PROPS, PLANTS)
PARTS = [(catalog, name) for catalog in CATALOGS for name in catalog.names()]
every_part = pytest.mark.parametrize(("catalog", "name"), PARTS, ids=[f"{c.kind}-{n}" for c, n in PARTS])
every_resolver = pytest.mark.parametrize("name", RESOLVERS.names())
every_law = pytest.mark.parametrize("name", TORQUE_LAWS.names())
every_estimator = pytest.mark.parametrize("name", PORT_ESTIMATORS.names())
every_task = pytest.mark.parametrize("name", TASKS.names())
every_disturbance = pytest.mark.parametrize("name", DISTURBANCES.names())
trocar_or_none = pytest.mark.parametrize("trocar", [True, False], ids=["trocar", "no trocar"])
SCENE = SceneConfig(
    robot=RobotConfig(name="lwr4plus"), trocar=TrocarConfig(position_m=(0.0, 0.55, 0.2)), theatre=False
)
DT = 0.001


@every_part
def test_defaults_construct_and_the_type_is_the_name(catalog: Catalog, name):
    config = catalog.config(name)()
    assert config.type == name
    assert catalog.config(name).model_validate_json(config.model_dump_json(), strict=True) == config


@every_part
def test_unknown_keys_and_later_changes_are_refused(catalog: Catalog, name):
    with pytest.raises(ValidationError, match="Extra inputs are not permitted"):
        catalog.config(name)(no_such_key=1)
    with pytest.raises(ValidationError, match="frozen"):
        catalog.config(name)().type = name


@every_part
def test_the_docstring_says_what_it_is(catalog: Catalog, name):
    own = vars(catalog.config(name)).get("__doc__")
    assert own, "the config has no docstring of its own"
    summary = catalog.summary(name)
    assert 10 < len(summary) < 110
    assert summary.endswith(".")


def _steps(resolver, problems, memory=None):
    memory = resolver.start(problems[0]) if memory is None else memory
    answers = []
    for problem in problems:
        answer, memory = resolver.step(problem, memory)
        answers.append(answer)
    return answers, memory


def _moving(velocity_problem, seed, trocar=True, count=5):
    """An arm at rest that is asked to move from 0.1 s on, with its shaft in a trocar at rest."""
    problem = velocity_problem(seed, trocar=trocar, rcm_error_m=0.0, trocar_speed=0.0)
    problem = replace(problem, v=np.zeros(7))
    return [replace(problem, t_s=0.1 + k * DT) for k in range(count)]


@every_resolver
@trocar_or_none
@pytest.mark.parametrize("seed", range(3))
def test_resolver_answers_are_finite_inside_the_bounds_with_their_residual(
    arm, velocity_problem, name, trocar, seed
):
    answers, _ = _steps(RESOLVERS.config(name)().build(arm), _moving(velocity_problem, seed, trocar))
    for answer in answers:
        assert answer.qdot.shape == (7,)
        assert answer.residual >= 0.0
        assert np.isfinite([*answer.qdot, answer.residual]).all()
    assert np.abs(answers[-1].qdot).max() > 1e-6


@every_resolver
@pytest.mark.parametrize("seed", range(20))
def test_resolver_answers_respect_the_bounds_whatever_is_asked(arm, velocity_problem, random_q, name, seed):
    rng = np.random.default_rng(seed)
    q = random_q(rng)
    joint = rng.integers(7)
    q[joint] = arm.limits.q_max[joint] - rng.choice([0.0, 1e-3, 0.05])
    problem = velocity_problem(seed, q=q, speed=10.0 ** rng.uniform(-2, 1), rcm_error_m=0.02)
    resolver = RESOLVERS.config(name)().build(arm)
    memory = resolver.start(problem)
    for k in range(3):
        try:
            answer, memory = resolver.step(replace(problem, t_s=k * DT), memory)
        except ControlFailure:  # hard rows may be out of reach, and a failure is an answer
            return
        assert (answer.qdot >= problem.lower - 1e-12).all()
        assert (answer.qdot <= problem.upper + 1e-12).all()


@every_resolver
@trocar_or_none
def test_resolver_at_a_singular_arm_gives_an_answer_or_an_outcome(arm, velocity_problem, name, trocar):
    problem = velocity_problem(0, trocar=trocar, q=np.zeros(7))  # standing straight up
    resolver = RESOLVERS.config(name)().build(arm)
    try:
        answer, _ = resolver.step(problem, resolver.start(problem))
    except (ControlFailure, np.linalg.LinAlgError):  # the controller makes an outcome of both
        return
    assert np.isfinite(answer.qdot).all()
    assert (np.abs(answer.qdot) <= arm.limits.velocity + 1e-12).all()


def _equal(a, b):
    return all(np.array_equal(x.qdot, y.qdot) and x.residual == y.residual for x, y in zip(a, b, strict=True))


@every_resolver
def test_resolver_is_deterministic_and_starts_afresh(arm, velocity_problem, name):
    problems = _moving(velocity_problem, 1)
    resolver = RESOLVERS.config(name)().build(arm)
    first, _ = _steps(resolver, problems)
    _steps(resolver, _moving(velocity_problem, 2))
    assert _equal(first, _steps(resolver, problems)[0])
    assert _equal(first, _steps(RESOLVERS.config(name)().build(arm), problems)[0])


@every_resolver
def test_resolver_step_is_a_pure_function_of_problem_and_memory(arm, velocity_problem, name):
    problems = _moving(velocity_problem, 1)
    resolver = RESOLVERS.config(name)().build(arm)
    _, memory = _steps(resolver, problems)
    inputs = [problems[0].q.copy(), problems[0].lower.copy(), problems[0].command.p_WTd.copy()]
    first, _ = _steps(resolver, problems[:1], memory)
    _steps(resolver, _moving(velocity_problem, 2))
    again, _ = _steps(resolver, problems[:1], memory)
    np.testing.assert_allclose(first[0].qdot, again[0].qdot, rtol=0, atol=1e-9)
    after = [problems[0].q, problems[0].lower, problems[0].command.p_WTd]
    assert all(np.array_equal(a, b) for a, b in zip(inputs, after, strict=True))


@every_law
@trocar_or_none
@pytest.mark.parametrize("seed", range(3))
def test_torque_law_gives_a_finite_row_for_every_term_the_same_each_time(
    arm, torque_problem, name, trocar, seed
):
    problem = torque_problem(seed, trocar=trocar)
    law = TORQUE_LAWS.config(name)().build(arm)

    def run(law):
        memory, rows = law.start(problem), []
        for k in range(3):
            terms, memory = law.torque(replace(problem, t_s=problem.t_s + k * DT), memory)
            rows.append(np.array(terms))
        return np.array(rows)

    first = run(law)
    assert first.shape == (3, len(law.terms), 7)
    assert len(set(law.terms)) == len(law.terms) > 0
    assert np.isfinite(first).all()
    assert np.abs(first.sum(axis=1)).max() > 1e-3
    np.testing.assert_array_equal(run(law), first)
    np.testing.assert_array_equal(run(TORQUE_LAWS.config(name)().build(arm)), first)


@every_law
def test_torque_law_holds_an_arm_that_is_where_it_should_be(arm, torque_problem, name):
    """With no error, at rest, what is left is gravity."""
    p, zero3, zero7 = torque_problem(4, trocar=False), np.zeros(3), np.zeros(7)
    dyn = arm.dynamics(p.q, zero7)
    p = replace(
        p,
        v=zero7,
        dyn=dyn,
        tau_measured=dyn.bias,
        command=replace(p.command, p_WTd=p.kin.p_WT, v_WTd=zero3, a_WTd=zero3),
        resolution=replace(p.resolution, qdot=zero7),
        q_ref=p.q,
    )
    law = TORQUE_LAWS.config(name)().build(arm)
    terms, _ = law.torque(p, law.start(p))
    np.testing.assert_allclose(terms.sum(axis=0), dyn.bias, atol=1e-9)


@every_estimator
def test_port_estimators_start_where_the_trocar_is_seen_and_repeat_themselves(arm, velocity_problem, name):
    p = velocity_problem(0, trocar_speed=0.0)
    kin, dyn = arm.evaluate(p.q, p.v)
    problem = PortProblem(
        t_s=0.0, dt_s=DT, v=p.v, tau_measured=dyn.bias, kin=kin, dyn=dyn, p_WC=p.p_WC, v_WC=p.v_WC
    )
    estimator = PORT_ESTIMATORS.config(name)().build(arm)

    def run():
        memory, out = estimator.start(problem), []
        for k in range(20):
            seen = replace(problem, t_s=k * DT, p_WC=problem.p_WC + 1e-5 * k)
            estimate, memory = estimator.step(seen, memory)
            out.append([estimate.p_WC, estimate.v_WC, estimate.a_WC])
        return np.array(out)

    first = run()
    assert np.isfinite(first).all()
    np.testing.assert_allclose(first[0, 0], problem.p_WC, atol=1e-12)
    np.testing.assert_array_equal(run(), first)


@every_task
def test_task_commands_are_finite_and_the_same_at_any_order_of_time(name):
    task = TASKS.config(name)().build(np.array([0.1, 0.5, 0.0]))
    if task.reacts:
        pytest.skip("it answers to what happens, in order of time")
    times = np.linspace(0.0, task.duration_s, 23)

    def values(order):
        commands = {t: task.command(float(t)) for t in order}
        return np.array([[commands[t].p_WTd, commands[t].v_WTd, commands[t].a_WTd] for t in times])

    forward = values(times)
    assert forward.shape == (23, 3, 3)
    assert np.isfinite(forward).all()
    np.testing.assert_array_equal(values(times[::-1]), forward)
    assert np.ptp(forward[:, 0], axis=0).max() > 1e-4


@every_task
def test_a_task_that_reacts_starts_afresh_and_says_the_same_again(name):
    start = np.array([0.1, 0.5, 0.0])
    task = TASKS.config(name)().build(start)
    if not task.reacts:
        pytest.skip("it is a function of time alone")
    feedback = Feedback(p_WT=start, v_WT=np.zeros(3), R_WT=np.eye(3), w_WT=np.zeros(3), f_T=np.zeros(3))

    def run():
        task.reset()
        rows = []
        for k in range(300):
            command = task.command(DT * k, feedback)
            rows.append(np.concatenate((command.p_WTd, command.v_WTd, command.a_WTd, task.values())))
        return np.array(rows)

    first = run()
    assert first.shape == (300, 9 + sum(len(block.columns) for block in task.columns))
    assert np.isfinite(first[:, :9]).all()
    np.testing.assert_array_equal(run(), first)


def _plant(*disturbances, seed=3):
    scene = build(SCENE, disturbances)
    config = PLANTS.config("dynamic")()
    return config.build(scene, DT, disturbances, np.random.SeedSequence(seed))


def _fall(plant, q, steps=60):
    """States under gravity compensation for the nominal arm, pushed a little."""
    rows = [plant.reset(q)]
    for k in range(steps):
        torque = np.full(7, 2.0) * np.sin(0.3 * k)
        rows.append(plant.step(torque, np.zeros(7)))
    return np.array([np.concatenate([state.q, state.v, state.tau, state.p_WC]) for state in rows])


@every_disturbance
def test_disturbance_is_deterministic_under_a_seed_and_starts_afresh(random_q, name):
    q = random_q(np.random.default_rng(0))
    config = DISTURBANCES.config(name)()
    plant = _plant(config.build(np.random.default_rng(0)))
    first = _fall(plant, q)
    assert np.isfinite(first).all()
    np.testing.assert_array_equal(_fall(plant, q), first)
    np.testing.assert_array_equal(_fall(_plant(config.build(np.random.default_rng(0))), q), first)
    plant.reset(q)
    np.testing.assert_array_equal(plant.truth().q, q)


@every_disturbance
def test_disturbance_leaves_the_controller_s_model_alone(arm, name):
    disturbance = DISTURBANCES.config(name)().build(np.random.default_rng(0))
    scene = build(SCENE, [disturbance])
    assert (scene.model.nv, scene.model.nu) == (7, 7)
    assert mujoco.mj_name2id(arm.scene.model, mujoco.mjtObj.mjOBJ_BODY, name) < 0
    np.testing.assert_array_equal(scene.limits.q_max, arm.limits.q_max)


@pytest.mark.parametrize("name", PLANTS.names())
def test_plant_resets_cleanly_and_its_states_are_the_reader_s_own(random_q, name):
    q = random_q(np.random.default_rng(1))
    plant = PLANTS.config(name)().build(build(SCENE), DT, (), np.random.SeedSequence(0))
    torque, qdot = np.full(7, 1.0), np.full(7, 0.1)

    def run():
        states = [plant.reset(q)] + [plant.step(torque, qdot) for _ in range(5)]
        return states, np.array([[s.q, s.v, s.tau] for s in states])

    states, first = run()
    assert states[0].t_s == 0.0
    assert states[-1].t_s == pytest.approx(5 * DT)
    np.testing.assert_array_equal(first[0, :2], [q, np.zeros(7)])
    assert np.abs(first[-1, 0] - q).max() > 1e-6
    _, again = run()
    np.testing.assert_array_equal(again, first)
    np.testing.assert_array_equal([[s.q, s.v, s.tau] for s in states], first)  # old states stay
    np.testing.assert_allclose(states[-1].p_WC, SCENE.trocar.position_m)
