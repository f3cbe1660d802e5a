# %% [markdown]
# # 1 Run and look
#
# A shipped scenario is run, and its result is looked at. Every step works in a notebook, in a script and in
# the interpreter. The first run on a machine also compiles the control loop, which takes about a minute,
# once.

# %%
import surgsim

run = surgsim.run("circle_lwr4plus")
run

# %% [markdown]
# An arm has moved the tip of an instrument along a circle inside the patient. The shaft had to pass through
# the trocar all the time. Two errors say how well that went:
#
# - the tip error, the distance of the tip from where it should be at that moment;
# - the RCM error, the distance of the shaft's axis from the trocar.

# %%
print(run.outcome)
for name in ("tip_error_rms_mm", "tip_error_max_mm", "rcm_error_rms_mm", "rcm_error_max_mm"):
    print(f"{name:18} {run.metrics[name]:.3g}")

# %% [markdown]
# The figure shows the path of the tip, and both errors over time.

# %%
run.figure()

# %% [markdown]
# The RCM error is more than a millimetre, and nothing disturbed the run. The controller `vprnn` is a
# published one with the gains of its paper, and its torque law is soft at the trocar. The same circle under
# a law that uses the arm's dynamics:

# %%
stiff = surgsim.run("circle_lwr4plus", controller="rcm_inverse_dynamics")
print(f"{stiff.metrics['rcm_error_max_mm']:.2g} mm instead of {run.metrics['rcm_error_max_mm']:.2g} mm")

# %% [markdown]
# ## Every control tick
#
# The trace has a row for each millisecond. Columns have names that end with their unit, and units are SI.

# %%
trace = run.trace
worst = trace["rcm_error_m"].argmax()
print(len(trace), "rows;", f"the shaft was farthest from the trocar at {trace['t_s'][worst]:.2f} s")
print("joints there:", trace.block("q")[worst].round(2))

# %% [markdown]
# ## A run that ends early
#
# A run that passes a limit is stopped, and that is a result too. With `robot.drive: real` the motors sit
# behind elastic gears. A law that takes them for rigid does not survive that:

# %%
broken = surgsim.run("circle_lwr4plus", controller="rcm_inverse_dynamics", robot={"drive": "real"})
print(broken.ended)

# %% [markdown]
# ## Keep a run
#
# With `out` a folder is written: the scenario with every default, the metrics, and a recording that the
# rerun viewer plays. `surgsim inspect runs/first --view` opens it.

# %%
surgsim.run("circle_lwr4plus", out="runs/first")
print(surgsim.read("runs/first").metrics["rcm_error_max_mm"] == run.metrics["rcm_error_max_mm"])

# %% [markdown]
# The same seed on the same machine gives the same numbers to the last bit.
#
# Next: [write a scenario](write_a_scenario.py).
