"""A simulation that MuJoCo warns of writes nothing into the working folder."""

import mujoco

import surgsim.models

UNSTABLE = "<mujoco><worldbody><body><joint/><geom size='1' mass='1'/></body></worldbody></mujoco>"


def test_warnings_leave_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert surgsim.models
    model = mujoco.MjModel.from_xml_string(UNSTABLE)
    data = mujoco.MjData(model)
    data.qvel[0] = float("nan")
    mujoco.mj_step(model, data)
    assert sum(warning.number for warning in data.warning) > 0
    assert list(tmp_path.iterdir()) == []
