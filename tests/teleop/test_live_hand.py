"""The hand that follows a person's input, and the record of that input."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surgsim.errors import SurgsimError
from surgsim.teleop.console import ConsoleConfig, new_console, step_console
from surgsim.teleop.manual.hand import LEAD_M, LiveHand
from surgsim.teleop.manual.intent import Intent
from surgsim.teleop.manual.tape import HEADER, Player, Recorder, read_tape
from surgsim.teleop.mapping import MappingConfig, rotation_matrix
from surgsim.teleop.operator import OperatorConfig

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


finite = st.floats(-10.0, 10.0)
intents = st.builds(
    Intent, velocity=st.tuples(finite, finite, finite), jaw=st.floats(0.0, 1.0), end=st.booleans()
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
    assert recorder.text() == f"{','.join(HEADER)}\n0.0,0.0,0.0,0.0,0.0,0\n0.5,0.01,0.0,0.0,0.0,0\n"


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        (["0,0,0,0,0"], "2: 5 values, not 6"),
        (["0,0,nan,0,0,0"], "2: velocity_y_m_per_s 'nan' is not a finite number"),
        (["0,0,0,0,0,0", "x,0,0,0,0,0"], "3: t_s 'x' is not a finite number"),
        (["1,0,0,0,0,0", "1,0,0,0,0,0"], "3: t_s 1 is not after the line before, 1"),
        (["0,0,11,0,0,0"], "2: velocity above 10 m/s"),
        (["0,0,0,0,1.5,0"], "2: jaw 1.5 is not from 0 to 1"),
        (["0,0,0,0,0,2"], "2: end 2 is neither 0 nor 1"),
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
