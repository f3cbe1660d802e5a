"""The frozen protocol: what is run under a name, who may enter, and the score that comes of it.

- `definition`: the protocol as data, `scenarios/protocols/NAME.yaml`, and the place of its files.
- `cells`: the runs that a protocol asks for, each with its complete scenario.
- `entrants`: a controller that is scored, what it reads, and the tracks that it may enter.
- `items`, `freeze`: hashes of all that the name stands for, `scenarios/protocols/NAME.lock.json`.
- `seeds`: development seeds, and those of a round, which derive from a phrase.
- `runs`: the store of finished runs, by their content; `rows`: what a score keeps of each.
- `levels`, `figures`, `scorecard`: the numbers; `passport`, `passport_page`: the page about one controller.
- `score`: all of it for one controller; `board`: for many.

A score's folder holds:

- `score.json`: `schema_version`, `protocol`, `protocol_sha256`, `draft`, `track`, `arms`, `seeds` (`kind`,
  `round`, `key`), `controller` (`name`, `definition`, `definition_sha256`, `plugins`, `policies`,
  `externals`, `weights`), `tuning`, `environment`, `rows_sha256`, `scorecard`, `scorecard_sha256`;
- `rows.jsonl`: a run a line, sorted by the cell's id: `cell`, `generator`, `arm`, `axis`, `level`, `seed`,
  `scenario_sha256`, `run_key`, `outcome`, `success`, `exceeded`, `metrics`;
- `timing.json`: what depends on the machine: control times, deadline misses, wall time, command; in no hash;
- `passport.html`, `passport.pdf`, `passport.png`: one page for a person.

Nothing in `rows.jsonl` and `scorecard` depends on time, machine, folder, language or number of workers.
Hashes are SHA-256 of canonical JSON (`surgsim.protocol.canonical`); `rows_sha256` is of the file's bytes.
"""
