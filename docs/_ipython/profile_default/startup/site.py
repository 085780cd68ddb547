"""What is run before the first cell of a page: commands that fail are errors, and figures can be read on any ground."""

import matplotlib as mpl
from IPython.core.getipython import get_ipython

_shell = get_ipython()
_system = _shell.system


def _checked(command: str) -> None:
    _system(command)
    if _shell.user_ns["_exit_code"]:
        raise RuntimeError(f"{command!r} ended with {_shell.user_ns['_exit_code']}")


_shell.system = _checked
_shell.run_line_magic("config", "InlineBackend.figure_formats = ['svg']")
_shell.run_line_magic("config", "InlineBackend.rc = {}")
mpl.rcParams.update({"savefig.transparent": True, "figure.constrained_layout.use": True, "axes.grid": True,
                     "grid.alpha": 0.3, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
                     "figure.figsize": (7, 3.2)})  # fmt: skip
