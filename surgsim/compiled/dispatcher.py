"""A kernel in its two forms: as Python calls it, and as other kernels do."""

import gc
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property, update_wrapper
from typing import Any

from numba import types
from numba.core import event, sigutils
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import ForceLiteralArg
from numba.core.imputils import lower_cast
from numba.core.registry import CPUDispatcher
from numba.core.typeinfer import register_dispatcher

from surgsim.compiled.cache import KernelCache
from surgsim.compiled.library import KernelCompiler
from surgsim.compiled.refusals import short_refusals

_OPTIONS = {"nopython": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


@contextmanager
def _without_collecting() -> Iterator[None]:
    """Collect no garbage meanwhile: numba makes millions of objects that live, and looking costs a tenth."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


class _Form(CPUDispatcher):
    """What both forms are: kept on disk, and to be had for one signature alone."""

    def __init__(self, function: Callable[..., Any], compiled: Callable[..., Any], **options: bool) -> None:
        super().__init__(compiled, {}, {**_OPTIONS, **options}, KernelCompiler)
        self.py_func = function
        self._cache = KernelCache(self, compiled)
        self._of_signature: dict[Any, _Form] = {}

    def compile(self, sig: Any) -> Any:
        """The function compiled for the types of `sig`.

        What numba's own does, without its timers: one is told of every call of LLVM by each kernel under way.
        """
        arguments, returned = sigutils.normalize_signature(sig)
        numbas: Any = self
        known = numbas.overloads
        if arguments not in known:
            with short_refusals(), _without_collecting(), global_compiler_lock, self._compiling_counter:
                if not numbas._can_compile:
                    raise RuntimeError("compilation disabled")
                if arguments not in known:  # another thread may have been faster
                    self._make(sig, arguments, returned)
        return known[arguments].entry_point

    def _make(self, sig: Any, arguments: Any, returned: Any) -> None:
        """Load the function from the cache, or compile it and keep it there."""
        found = self._cache.load_overload(sig, self.targetctx)
        if found is not None:
            self.targetctx.insert_user_function(found.entry_point, found.fndesc, [found.library])
            self.add_overload(found)
            return
        with event.trigger_event(
            "numba:compile", data={"dispatcher": self, "args": arguments, "return_type": returned}
        ):
            compiler = vars(self)["_compiler"]
            try:
                made = compiler.compile(arguments, returned)
            except ForceLiteralArg as error:
                raise error.bind_fold_arguments(
                    lambda given, named: compiler.fold_argument_types(given, named)[1]
                ) from None
            self.add_overload(made)
        self._cache.save_overload(sig, made)

    def for_signature(self, signature: Any) -> "_Form":
        """The kernel compiled for `signature`, which takes no other types and returns its type."""
        if signature not in self._of_signature:
            made = self._again()
            with register_dispatcher(made):
                made.compile(signature)
            made.disable_compile()
            self._of_signature[signature] = made
        return self._of_signature[signature]

    def _again(self) -> "_Form":
        """The same, with nothing compiled."""
        raise NotImplementedError


class Within(_Form):
    """A kernel as kernels call it: without the code that takes Python's objects apart.

    It is compiled for plain types: a literal number is a number, and an array that is a record's field is an
    array, so that one compiled kernel serves them all.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function, function, no_cpython_wrapper=True)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """The template of a call, for plain types."""
        plain = {name: _plain(kind) for name, kind in kws.items()}
        return super().get_call_template([_plain(kind) for kind in args], plain)

    def for_signature(self, signature: Any) -> _Form:
        """The kernel compiled for `signature`: this one, if that is what it returns anyhow.

        One that always returns the same number has that number's own type, and the same machine code.
        """
        self.compile(signature.args)
        found: Any = self.overloads[signature.args]
        same = _plain(found.signature.return_type) == signature.return_type
        return self if same else super().for_signature(signature)

    def _again(self) -> "Within":
        return Within(self.py_func)


class Kernel(_Form):
    """A compiled function as Python calls it: an entrance to the form `within`, which kernels call."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function, function)
        self._entered = False

    @cached_property
    def within(self) -> Any:
        """The form that other kernels call."""
        return Within(self.py_func)

    def compile(self, sig: Any) -> Any:
        """The entrance compiled for the types of `sig`."""
        if not self._entered:  # most kernels are never called from Python
            entrance = _entrance(self.within)
            compiler = type(vars(self)["_compiler"])
            options = self.targetoptions
            vars(self)["_compiler"] = compiler(entrance, self.targetdescr, options, {}, KernelCompiler)
            self._cache, self._entered = KernelCache(self, entrance), True
        return super().compile(sig)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """The template of a call from another kernel."""
        return self.within.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        """What another kernel calls."""
        return self.within.get_overload(sig)

    @property
    def nopython_signatures(self) -> Any:
        """Signatures that other kernels call."""
        return self.within.nopython_signatures

    def _again(self) -> "Kernel":
        other = Kernel(self.py_func)
        other.within = self.within
        return other


def _entrance(within: Within) -> Callable[..., Any]:
    """A function of the same parameters that calls the kernel."""
    function = within.py_func
    names = ", ".join(inspect.signature(function).parameters)
    made: dict[str, Any] = {}
    exec(f"def entrance({names}): return within({names})", {"within": within}, made)
    entrance: Callable[..., Any] = update_wrapper(made["entrance"], function)
    entrance.__defaults__ = function.__defaults__
    return entrance


def _plain(kind: Any) -> Any:
    if isinstance(kind, types.NestedArray):
        return types.Array(kind.dtype, kind.ndim, "C")
    return types.unliteral(kind)


@lower_cast(types.NestedArray, types.Array)  # type: ignore[untyped-decorator]
def _nested_is_an_array(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return value
