"""What is run before the first cell of a page: commands that fail are errors, and figures can be read on any ground."""

import os
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
from IPython.core.getipython import get_ipython

if shared := os.environ.pop("LIAISONS_FMUS", ""):  # built once for all pages, and called fmus/ in each
    Path("fmus").symlink_to(shared, target_is_directory=True)
    os.environ["LIAISONS_FMUS"] = "fmus"

for forced in ("FORCE_COLOR", "CLICOLOR_FORCE"):  # of ipykernel; commands would write to pages as to terminals
    os.environ.pop(forced, None)
_shell = get_ipython()


def _checked(command: str) -> None:
    done = subprocess.run(_shell.var_expand(command, depth=1), shell=True, text=True, check=False,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)  # fmt: skip
    print(done.stdout, end="")
    if done.returncode:
        raise RuntimeError(f"{command!r} ended with {done.returncode}")


_shell.system = _checked
_shell.run_line_magic("config", "InlineBackend.figure_formats = ['svg']")
_shell.run_line_magic("config", "InlineBackend.rc = {}")
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])  # as in an active one
mpl.rcParams.update({"savefig.transparent": True, "figure.constrained_layout.use": True, "axes.grid": True,
                     "grid.alpha": 0.3, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
                     "figure.figsize": (7, 3.2)})  # fmt: skip
