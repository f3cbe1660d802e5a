"""Controllers outside surgsim: a process that is asked at every tick, or a C function in the loop itself.

`layout` is what is exchanged, and `texts` the same as a C header and as JSON; `given` says which command
stands for a name, `command` what kind it is; `process` and `library` are the two kinds, `outside` is either
of them, and `exchange` the kernel that asks it. `docs/external_controllers.md` is the page for who writes
such a controller.
"""
