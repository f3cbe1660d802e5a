"""Keys and sticks: what they say, and what becomes of it."""

import os
import struct

import numpy as np
import pytest

from surgsim.errors import SurgsimError
from surgsim.live.controls import SPEEDS_M_PER_S, Controls, Wish
from surgsim.live.gamepad import DEAD_ZONE, Gamepad, find_gamepad
from surgsim.live.keyboard import TAP_S, Keyboard

RIGHT, UP, PAGE_DOWN, SPACE, ESCAPE, MINUS, PLUS = 262, 265, 267, 32, 256, 45, 61
HOME, END, LEFT_CTRL, RIGHT_CTRL = 268, 269, 341, 345


class Script:
    """A device that says one thing after the other, then nothing."""

    def __init__(self, *wishes):
        self._wishes = list(wishes)

    def poll(self, t_s):
        return self._wishes.pop(0) if self._wishes else Wish(direction=np.zeros(3))


def wish(*actions, direction=(0.0, 0.0, 0.0), roll=0.0, clutch=False):
    return Wish(direction=np.array(direction), roll=roll, clutch=clutch, actions=actions)


def test_keys_move_while_they_are_held():
    keyboard = Keyboard()
    keyboard.changed(RIGHT, True)
    assert keyboard.poll(0.0).direction.tolist() == [1.0, 0.0, 0.0]
    keyboard.changed(PAGE_DOWN, True)
    assert keyboard.poll(1.0).direction.tolist() == [1.0, 0.0, -1.0]
    keyboard.changed(RIGHT, False)
    assert keyboard.poll(2.0).direction.tolist() == [0.0, 0.0, -1.0]
    keyboard.changed(PAGE_DOWN, False)
    assert not keyboard.poll(3.0).direction.any()


def test_a_tap_between_two_looks_still_moves_a_little():
    keyboard = Keyboard()
    keyboard.changed(UP, True)
    keyboard.changed(UP, False)
    assert keyboard.poll(1.0).direction.tolist() == [0.0, 1.0, 0.0]
    assert keyboard.poll(1.0 + 0.9 * TAP_S).direction.any()
    assert not keyboard.poll(1.0 + 1.1 * TAP_S).direction.any()


def test_opposite_keys_cancel_and_actions_come_once():
    keyboard = Keyboard()
    for key in (262, 263, SPACE, PLUS, 87):
        keyboard.changed(key, True)
    first = keyboard.poll(0.0)
    assert not first.direction.any()
    assert first.actions == ("jaw", "faster")
    assert keyboard.poll(0.1).actions == ()


def test_end_rolls_to_the_right_and_home_to_the_left_while_they_are_held():
    keyboard = Keyboard()
    keyboard.changed(END, True)
    assert keyboard.poll(0.0).roll == 1.0
    keyboard.changed(HOME, True)
    assert keyboard.poll(1.0).roll == 0.0
    keyboard.changed(END, False)
    assert keyboard.poll(2.0).roll == -1.0
    keyboard.changed(HOME, False)
    assert keyboard.poll(3.0).roll == 0.0
    keyboard.changed(END, True)
    keyboard.changed(END, False)
    assert [keyboard.poll(t).roll for t in (4.0, 4.0 + 1.1 * TAP_S)] == [1.0, 0.0]


def test_the_clutch_is_open_while_a_ctrl_key_is_held_and_the_other_keys_act():
    keyboard = Keyboard()
    assert not keyboard.poll(0.0).clutch
    for key in (LEFT_CTRL, RIGHT_CTRL, UP):
        keyboard.changed(key, True)
    held = keyboard.poll(1.0)
    assert held.clutch
    assert held.direction.tolist() == [0.0, 1.0, 0.0]
    keyboard.changed(LEFT_CTRL, False)
    assert keyboard.poll(2.0).clutch
    keyboard.changed(RIGHT_CTRL, False)
    assert not keyboard.poll(2.0).clutch  # no longer than it is held


def event(value, kind, number):
    return struct.pack("<IhBB", 12345, value, kind, number)


@pytest.fixture
def pad(tmp_path):
    """A gamepad on a pipe, and the function that feeds it."""
    path = tmp_path / "js0"
    os.mkfifo(path)
    with Gamepad(find_gamepad(tmp_path)) as gamepad:
        writer = os.open(path, os.O_WRONLY)
        yield gamepad, lambda *parts: os.write(writer, b"".join(parts))
        os.close(writer)


def test_sticks_are_right_away_and_up(pad):
    gamepad, feed = pad
    feed(event(32767, 2, 0), event(-32767, 2, 1), event(32767, 2 | 0x80, 4), event(9, 2, 7))
    np.testing.assert_allclose(gamepad.poll(0.0).direction, [1.0, 1.0, -1.0])
    np.testing.assert_allclose(gamepad.poll(0.0).direction, [1.0, 1.0, -1.0])
    feed(event(0, 2, 1), event(-32768, 2, 0))
    np.testing.assert_allclose(gamepad.poll(0.0).direction, [-1.0, 0.0, -1.0])


def test_small_deflections_are_rest_and_nothing_jumps_beyond(pad):
    gamepad, feed = pad
    feed(event(int(0.99 * DEAD_ZONE * 32767), 2, 0), event(int(-1.02 * DEAD_ZONE * 32767), 2, 1))
    direction = gamepad.poll(0.0).direction
    assert direction[0] == 0.0
    assert 0.0 < direction[1] < 0.01


def test_the_right_stick_rolls_and_the_left_trigger_is_the_pedal(pad):
    gamepad, feed = pad
    feed(event(-32767, 2 | 0x80, 2), event(int(0.99 * DEAD_ZONE * 32767), 2, 3))
    rest = gamepad.poll(0.0)
    assert (rest.roll, rest.clutch) == (0.0, False)
    feed(event(32767, 2, 3), event(20000, 2, 2))
    pulled = gamepad.poll(0.1)
    assert (pulled.roll, pulled.clutch) == (1.0, True)
    assert not pulled.direction.any()
    feed(event(-32768, 2, 3), event(-100, 2, 2))
    let_go = gamepad.poll(0.2)
    assert (let_go.roll, let_go.clutch) == (-1.0, False)


def test_buttons_count_when_they_go_down_and_events_may_come_in_pieces(pad):
    gamepad, feed = pad
    whole = event(1, 1, 0) + event(0, 1, 0) + event(1, 1, 5) + event(1, 1 | 0x80, 0)
    feed(whole[:11])
    assert gamepad.poll(0.0).actions == ("jaw",)
    feed(whole[11:])
    assert gamepad.poll(0.0).actions == ("faster",)


def test_an_unplugged_gamepad_is_at_rest(pad, monkeypatch):
    gamepad, feed = pad
    feed(event(32767, 2, 0), event(32767, 2, 2), event(32767, 2, 3))
    before = gamepad.poll(0.0)
    assert before.direction.any()
    assert (before.roll, before.clutch) == (1.0, True)

    def gone(*_):
        raise OSError(19, "No such device")

    monkeypatch.setattr(os, "read", gone)
    for _ in range(2):
        after = gamepad.poll(0.1)
        assert not after.direction.any()
        assert (after.roll, after.clutch) == (0.0, False)


def test_no_gamepad_is_said_in_one_line(tmp_path):
    with pytest.raises(SurgsimError) as caught:
        find_gamepad(tmp_path)
    assert str(caught.value) == f"no gamepad: there is no {tmp_path}/js*; --operator keyboard needs none"
    with pytest.raises(SurgsimError, match="cannot be read: No such file or directory"):
        Gamepad(tmp_path / "js3")


def test_the_screen_s_axes_and_the_speed_make_the_velocity():
    axes = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    forth = wish(direction=(1.0, 0.0, -0.5))
    controls = Controls([Script(forth, wish("slower", direction=(1.0, 0.0, -0.5)))])
    controls.poll(0.0, axes)
    first = controls.speed_m_per_s
    assert controls(0.0).velocity == pytest.approx((0.0, first, -0.5 * first))
    controls.poll(0.0, axes)
    assert controls.speed_m_per_s < first
    assert controls(0.0).velocity == pytest.approx(
        (0.0, controls.speed_m_per_s, -0.5 * controls.speed_m_per_s)
    )


def test_speed_has_ends_and_two_devices_are_not_twice_as_fast():
    right = wish("faster", "faster", "faster", "faster", "faster", direction=(1.0, 0.0, 0.0))
    controls = Controls([Script(right), Script(right)])
    controls.poll(0.0, np.eye(3))
    assert controls(0.0).velocity == (SPEEDS_M_PER_S[-1], 0.0, 0.0)


def test_two_devices_roll_no_faster_than_one_and_either_opens_the_clutch():
    controls = Controls([Script(wish(roll=0.7)), Script(wish(roll=0.7, clutch=True))])
    controls.poll(0.0, np.eye(3))
    assert (controls(0.0).roll, controls(0.0).clutch) == (1.0, True)
    controls.poll(0.1, np.eye(3))
    assert (controls(0.1).roll, controls(0.1).clutch) == (0.0, False)


def test_who_is_done_stays_done_with_the_jaws_as_they_are():
    moving = wish(direction=(1.0, 0.0, 0.0))
    ending = wish("end", direction=(1.0, 0.0, 0.0), roll=1.0, clutch=True)
    controls = Controls([Script(wish("jaw"), ending, moving)])
    controls.poll(0.0, np.eye(3))
    assert (controls.intent.jaw, controls.intent.end) == (1.0, False)
    for _ in range(2):
        controls.poll(0.0, np.eye(3))
        assert (controls.intent.velocity, controls.intent.jaw, controls.intent.end) == (
            (0.0, 0.0, 0.0),
            1.0,
            True,
        )
        assert (controls.intent.roll, controls.intent.clutch) == (0.0, False)
