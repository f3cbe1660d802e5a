"""Machine code of one kernel: small kernels that it calls are compiled into it, larger ones called by name.

numba copies the code of every kernel into each of its callers and optimises it again there, so that a kernel
eight calls deep is optimised eight times. Here a kernel whose code is larger than `LARGEST_INLINED_BYTES`
stays where it is, and its callers hold its symbol. A symbol is named after the key of the kernel in the
cache, so that two functions of one name never share a symbol, and code that different processes compiled
mostly fits together. numba also puts numbers into it that it gave to the argument types in that process; so
what a caller holds is kept with it, and compared when it is loaded: LLVM ends the process for a symbol that
is not there.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any
from uuid import uuid4

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, PassManager, register_pass
from numba.core.typed_passes import AnnotateTypes

LARGEST_INLINED_BYTES = 12_000
_SYMBOL_DIGITS = 16
_key_of: dict[tuple[Callable[..., Any], Any, bool], str | None] = {}


def expect(function: Callable[..., Any], arguments: Any, called_from_python: bool, key: str | None) -> None:
    """Say under which key `function`, to be compiled for these types, will be kept; None: it cannot be."""
    _key_of[function, arguments, called_from_python] = key


class KernelLibrary(JITCodeLibrary):
    """The code of a kernel.

    Attributes:
        entry: Its file in the cache; None if it has none.
        needs: Libraries whose symbols its code holds.
    """

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self.entry: str | None = None
        self.needs: list[KernelLibrary] = []
        self._bitcode: bytes | None = None
        self._symbols: set[str] | None = None

    @classmethod
    def stored(
        cls, codegen: Any, stored: tuple[str, str, Any], symbols: set[str], needs: list["KernelLibrary"]
    ) -> "KernelLibrary":
        """The library that `serialize_using_object_code` gave; what it needs has to be loaded before."""
        name, _, (object_code, bitcode) = stored
        library = cls(codegen, name)
        library.needs, library._bitcode, library._symbols = needs, bitcode, symbols
        library.enable_object_caching()
        library._set_compiled_object(object_code)
        library._finalize_final_module()
        codegen._engine._defined_symbols |= symbols
        return library

    @property
    def symbols(self) -> set[str]:
        """Names of what its code defines."""
        if self._symbols is None:
            self._symbols = {value.name for value in self._values() if not value.is_declaration}
        return self._symbols

    @property
    def held(self) -> set[str]:
        """Those names that its code holds of what the libraries that it needs define."""
        declared = {value.name for value in self._values() if value.is_declaration}
        return declared & defined_by(self.needs)

    def _values(self) -> Iterator[Any]:
        yield from self._final_module.functions
        yield from self._final_module.global_variables

    @property
    def is_large(self) -> bool:
        """Whether callers call it by name."""
        if self._bitcode is None:
            self._bitcode = self._get_module_for_linking().as_bitcode()
        return len(self._bitcode) > LARGEST_INLINED_BYTES

    def add_llvm_module(self, ll_module: Any) -> None:
        """Add code as it is: it is optimised when all is there."""
        ll_module.data_layout = self._codegen._data_layout
        self._final_module.link_in(ll_module)

    def finalize(self) -> None:
        """Link the small libraries, optimise, and make machine code."""
        self._raise_if_finalized()
        needs: dict[KernelLibrary, None] = {}
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            if isinstance(library, KernelLibrary) and library.is_large:
                needs[library] = None
            else:
                needs.update(dict.fromkeys(_needed(library)))
                self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self.needs = list(needs)
        self._optimize_final_module()
        self._final_module.verify()
        self._finalize_final_module()

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None and self._bitcode is not None:
            self._shared_module = llvm.parse_bitcode(self._bitcode)
        return super()._get_module_for_linking()


def defined_by(libraries: Iterable[KernelLibrary]) -> set[str]:
    """Names of what the code of all these libraries defines."""
    return {name for library in libraries for name in library.symbols}


def _needed(library: Any) -> Iterator[KernelLibrary]:
    """Libraries whose symbols are in the code of `library`, whatever kind it is."""
    if isinstance(library, KernelLibrary):
        yield from library.needs
    else:
        for linked in library._linking_libraries:
            yield from _needed(linked)


def rebuilt(context: Any, library: KernelLibrary, rest: tuple[Any, ...]) -> Any:
    """What numba's `CompileResult._rebuild` makes of what was kept, with a library of ours."""
    descriptor, environment, signature, objectmode, lifted, annotation, reload_init, environments = rest
    for start in reload_init:
        start()
    of_kind: Any = CompileResult
    result = of_kind(
        target_context=context,
        typing_context=context.typing_context,
        library=library,
        environment=environment,
        entry_point=context.get_executable(library, descriptor, environment),
        fndesc=descriptor,
        type_annotation=annotation,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        typing_error=None,
        call_helper=None,
        metadata=None,
        reload_init=reload_init,
        referenced_envs=environments,
    )
    for referenced in environments:
        library.codegen.set_env(referenced.env_name, referenced)
    return result


@register_pass(mutates_CFG=False, analysis_only=False)
class _OwnLibrary(LoweringPass):
    """Give a kernel its library, and its symbol the name of its key."""

    _name = "kernel_library"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        key = _key_of.get((state.func_id.func, tuple(state.args), not state.flags.no_cpython_wrapper))
        number = uuid4().int if key is None else int(key[:_SYMBOL_DIGITS], 16)
        for identity in (state.func_id, state.func_ir.func_id):
            identity.unique_id = number
            identity.unique_name = f"{identity.func_qualname}${number}"
        state.library = KernelLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return True


class KernelCompiler(CompilerBase):
    """numba's compiler, but for the library."""

    def define_pipelines(self) -> list[PassManager]:
        """The passes, in order."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_OwnLibrary, AnnotateTypes)
        passes.finalize()
        return [passes]
