"""Drawn scenarios on the command line: run by name, refused with the reason, and rows of a batch."""

import csv

from surgsim.cli.main import main


def test_a_port_out_of_reach_is_refused_with_its_reason_and_exit_status_2(capsys, tmp_path):
    assert main(["run", "random_panda_31", "--no-record", "--out", str(tmp_path / "a")]) == 2
    assert "the start at (0.008, 0.607, 0.214) m cannot be reached: the best" in capsys.readouterr().err
    assert not (tmp_path / "a").exists()


def test_the_suite_has_a_row_for_each_seed_and_the_refused_are_among_them(capsys, tmp_path):
    options = ["--seeds", "31:33", "--controllers", "pinv", "--jobs", "1", "--out", str(tmp_path / "b")]
    settings = ["--set", "task.duration_s=1", "--set", "task.ramp_s=0.4"]
    main(["compare", "random", *options, *settings])
    with (tmp_path / "b" / "runs.csv").open() as file:
        rows = {(row["scenario"], row["seed"]): row["outcome"] for row in csv.DictReader(file)}
    assert set(rows) == {
        (f"random_{robot}", seed) for robot in ("lwr4plus", "panda") for seed in ("31", "32")
    }
    assert rows["random_panda", "31"] == "refused"
    assert rows["random_panda", "32"] != "refused"
