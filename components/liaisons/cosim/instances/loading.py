"""Subclasses of FMPy's classes whose instances share the functions of their library.

FMPy looks up every function of FMI for each instance, which takes a millisecond and 50 kB, and refuses a library that
lacks one.  Here the instances of a library share the functions, and a missing one raises its error when it is called.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import chdir
from ctypes import CDLL
from pathlib import Path
from threading import RLock
from typing import Any, final

from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from liaisons.fmu_files import Fmu

_lock = RLock()


@final
class _Library(CDLL):
    """A library in which a missing function raises an error when it is called, not when it is looked up.

    :ivar functions: those of FMI, by name, as FMPy calls them.
    :ivar users: number of instances.
    """

    def __init__(self, library: CDLL) -> None:
        super().__init__(library._name, handle=library._handle)  # noqa: SLF001 - ctypes has no other way
        self.functions: dict[str, Any] = {}
        self.users = 0

    def __getattr__(self, name: str) -> Any:
        try:
            return super().__getattr__(name)
        except AttributeError as error:
            return _raising_function(str(error))


def _raising_function(message: str) -> Callable[..., Any]:
    """Function that raises an AttributeError, for one that a library lacks."""

    def call(*_: object) -> None:
        raise AttributeError(message)

    return call


_libraries: dict[tuple[type, int | None], _Library] = {}


class SharedFunctions:
    """Shares the functions of a library among its instances."""

    dll: CDLL
    _functions: dict[str, Any]

    def _loadFunctions(self) -> None:  # noqa: N802 - FMPy's name
        """Set the functions of the library, which FMPy looks up for its first instance."""
        key = type(self), self.dll._handle  # noqa: SLF001 - likewise
        library = _libraries.get(key) or _Library(self.dll)
        self.dll, self._functions = library, library.functions
        if key not in _libraries:
            super()._loadFunctions()  # type: ignore[misc] - of the FMPy class beside this one
            _libraries[key] = library
        library.users += 1

    def freeLibrary(self) -> None:  # noqa: N802 - likewise
        """Unload the library, once for each instance."""
        assert isinstance(self.dll, _Library)
        with _lock:
            self.dll.users -= 1
            if not self.dll.users:
                del _libraries[type(self), self.dll._handle]  # noqa: SLF001 - likewise
            super().freeLibrary()  # type: ignore[misc] - likewise


# the first four characters of a name tell FMPy the version


@final
class FMU2CoSimulation(SharedFunctions, FMU2Slave):
    """A Co-Simulation FMU of FMI 2.0."""


@final
class FMU3CoSimulation(SharedFunctions, FMU3Slave):
    """A Co-Simulation FMU of FMI 3.0."""


def load_fmu(fmpy_class: Callable[..., Any], name: str, fmu: Fmu, directory: Path) -> Any:
    """Load the library of an FMU; returns the object of FMPy, not yet instantiated.

    :param fmpy_class: a class of FMPy with :class:`SharedFunctions`.
    :param name: instance name.
    :param directory: folder of the extracted FMU.
    :raises OSError: if the library cannot be loaded.
    """
    folder = directory.resolve()
    paths = {"unzipDirectory": str(folder), "libraryPath": str(folder / fmu.binary)}
    with _lock, chdir("."):  # FMPy loads in the folder of the library, and stays there if that fails
        try:
            return fmpy_class(guid=fmu.guid, modelIdentifier=fmu.identifier, instanceName=name, **paths)
        except Exception as error:  # FMPy raises nothing more specific
            raise OSError(error.__context__ or error) from error
