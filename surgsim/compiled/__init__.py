"""Compilation of kernels: laws are pure functions of arrays, so they compile as they stand.

Compiled code is kept on disk, so that only the first run on a machine pays for it. `kernel` holds the
decorator, `dispatcher` its two forms, for Python and for kernels, `library` their machine code, `cache` what
is kept, `identity` the key of an entry, `places` the folder, `lock` how processes share one compilation, and
`watch` what a person is told and how long it took.
"""

from surgsim.compiled.kernel import address_of, as_parameter, call_at, compile_for, compiled

__all__ = ["address_of", "as_parameter", "call_at", "compile_for", "compiled"]
