"""The hand that follows a person's input, and the record of that input."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surgsim.errors import SurgsimError
from surgsim.teleop.console import ConsoleConfig, new_console, step_console
from surgsim.teleop.manual.hand import LEAD_M, LEAD_RAD, LiveHand
from surgsim.teleop.manual.intent import Intent
from surgsim.teleop.manual.tape import HEADER, Player, Recorder, read_tape
from surgsim.teleop.mapping import MappingConfig, rotation_matrix
from surgsim.teleop.operator import OperatorConfig
from surgsim.teleop.roll import turn_grip

TURNED = (0.5**0.5, 0.0, 0.0, 0.5**0.5)
PLAIN = MappingConfig()


def operate(source, ticks, mapping=PLAIN, held=False):
    """(handle positions, commands) of the hand on a console that no motor drives, or that stands still."""
    _console, law, memory = new_console(ConsoleConfig())
    hand = LiveHand(OperatorConfig(), mapping, source, 0.001)
    state, places, commands = memory.state, [], []
    for k in range(ticks):
        command = hand.step(1e-3 * k, np.zeros(3), state)
        if not held:
            step_console(law, memory, np.zeros(6), command.wrench)
        places.append(state.position.copy())
        commands.append(command)
    return np.array(places), commands


@pytest.mark.parametrize("mapping", [PLAIN, MappingConfig(scale=0.25, rotation_wxyz=TURNED)])
def test_the_handle_takes_the_tip_along_at_the_wanted_velocity(mapping):
    wanted = (0.012, -0.006, 0.004)
    places, _ = operate(lambda t: Intent(velocity=wanted), 700, mapping)
    seen = mapping.scale * rotation_matrix(mapping.rotation_wxyz) @ (places[-1] - places[-301]) / 0.3
    np.testing.assert_allclose(seen, wanted, atol=6e-4)


def test_the_intention_leads_a_held_handle_by_no_more_than_an_arm_can():
    places, commands = operate(lambda t: Intent(velocity=(0.04, 0.0, 0.0)), 3000, held=True)
    lead = commands[-1].intended - places[-1]
    assert np.linalg.norm(lead) == pytest.approx(LEAD_M)
    back = Intent(velocity=(-0.04, 0.0, 0.0))
    _, commands = operate(lambda t: Intent(velocity=(0.04, 0.0, 0.0)) if t < 3.0 else back, 3800, held=True)
    assert commands[-1].intended[0] < places[-1][0]  # no wind-up: 0.08 m/s undo 50 mm in less than 0.8 s


def test_jaws_close_in_their_time_and_the_end_is_passed_on():
    _, commands = operate(lambda t: Intent(jaw=1.0, end=t >= 0.4), 500)
    jaw = np.array([command.jaw for command in commands])
    assert np.argmax(jaw == 1.0) == pytest.approx(OperatorConfig().jaw_time_s / 0.001, abs=1.0)
    assert [command.done for command in commands] == [k >= 400 for k in range(500)]


def test_the_clutch_is_passed_on_while_it_is_held():
    _, commands = operate(lambda t: Intent(clutch=0.1 <= t < 0.3), 500)
    assert [command.clutch for command in commands] == [100 <= k < 300 for k in range(500)]


def grip_turn(state, upright):
    """How far the handle is turned about the grip's axis [rad]: what the gimbal's roll says."""
    turned = np.zeros((3, 3))
    turn_grip(upright, state.q[5], turned)
    assert state.rotation == pytest.approx(turned, abs=0.01)
    return state.q[5]


@pytest.mark.parametrize("roll", [1.0, -0.5])
def test_the_grip_turns_at_the_wanted_rate_and_stays_where_it_is_let(roll):
    _console, law, memory = new_console(ConsoleConfig())
    config = OperatorConfig()
    hand = LiveHand(config, PLAIN, lambda t: Intent(roll=roll if t < 1.0 else 0.0), 0.001)
    state, turns = memory.state, []
    upright = state.rotation.copy()
    for k in range(1600):
        command = hand.step(1e-3 * k, np.zeros(3), state)
        step_console(law, memory, np.zeros(6), command.wrench)
        turns.append(grip_turn(state, upright))
    speed = config.roll_speed_rad_per_s * roll
    assert (turns[900] - turns[500]) / 0.4 == pytest.approx(speed, rel=0.02)
    assert turns[-1] == pytest.approx(speed * 1.0, abs=0.03)
    assert turns[-1] == pytest.approx(turns[-301], abs=5e-3)


def test_a_grip_that_is_held_winds_up_no_turn():
    _, commands = operate(lambda t: Intent(roll=1.0 if t < 3.0 else -1.0), 3900, held=True)
    torque = np.array([command.wrench[3:] for command in commands])
    most = OperatorConfig().turn_stiffness_nm_per_rad * np.sin(LEAD_RAD)
    assert np.linalg.norm(torque[2999]) == pytest.approx(most, rel=1e-6)
    assert torque[3899] @ torque[2999] < 0.0  # 1 rad/s undoes the lead in half a second


finite = st.floats(-10.0, 10.0)
intents = st.builds(
    Intent,
    velocity=st.tuples(finite, finite, finite),
    jaw=st.floats(0.0, 1.0),
    roll=st.floats(-1.0, 1.0),
    clutch=st.booleans(),
    end=st.booleans(),
)


@given(st.lists(intents, min_size=1, max_size=30))
def test_a_record_plays_back_exactly_what_was_recorded(tmp_path_factory, inputs):
    times = [0.001 * k for k in range(3 * len(inputs))]
    recorder = Recorder(lambda t: inputs[round(t / 0.001) // 3])
    given_ = [recorder(t) for t in times]
    path = tmp_path_factory.mktemp("tape") / "operator_input.csv"
    path.write_text(recorder.text())
    player = Player(read_tape(path))
    again = Recorder(player)
    assert [again(t) for t in times] == given_
    assert again.text() == recorder.text()


def test_only_changes_are_recorded():
    recorder = Recorder(lambda t: Intent(velocity=(0.01 if t >= 0.5 else 0.0, 0.0, 0.0)))
    for k in range(1000):
        recorder(1e-3 * k)
    assert (
        recorder.text() == f"{','.join(HEADER)}\n0.0,0.0,0.0,0.0,0.0,0.0,0,0\n0.5,0.01,0.0,0.0,0.0,0.0,0,0\n"
    )


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        (["0,0,0,0,0,0"], "2: 6 values, not 8"),
        (["0,0,nan,0,0,0,0,0"], "2: velocity_y_m_per_s 'nan' is not a finite number"),
        (["0,0,0,0,0,0,0,0", "x,0,0,0,0,0,0,0"], "3: t_s 'x' is not a finite number"),
        (["1,0,0,0,0,0,0,0", "1,0,0,0,0,0,0,0"], "3: t_s 1 is not after the line before, 1"),
        (["0,0,11,0,0,0,0,0"], "2: velocity above 10 m/s"),
        (["0,0,0,0,1.5,0,0,0"], "2: jaw 1.5 is not from 0 to 1"),
        (["0,0,0,0,0,-1.5,0,0"], "2: roll -1.5 is not from -1 to 1"),
        (["0,0,0,0,0,0,2,0"], "2: clutch 2 is neither 0 nor 1"),
        (["0,0,0,0,0,0,0,2"], "2: end 2 is neither 0 nor 1"),
    ],
)
def test_what_is_wrong_with_a_record_is_said_with_its_line(tmp_path, lines, reason):
    path = tmp_path / "input.csv"
    path.write_text("\n".join([",".join(HEADER), *lines]) + "\n")
    with pytest.raises(SurgsimError) as caught:
        read_tape(path)
    assert str(caught.value) == f"{path}:{reason}"


@pytest.mark.parametrize("content", [b"", b"t_s,jaw\n", b"\xff\xfe", None])
def test_another_file_is_refused(tmp_path, content):
    path = tmp_path / "input.csv"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SurgsimError, match=r"input\.csv:(1: not a record| cannot be read)"):
        read_tape(path)
