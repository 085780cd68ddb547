"""Random MJCF files against MuJoCo: mass matrix and accelerations at a random state."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from liaisons import Linkage, derive

SEEDS = range(4300, 4500)
DIGITS = 1e-9  # of the largest number; both are right to rounding times the condition of the mass matrix, at most 1e6

pytestmark = pytest.mark.slow


class RandomFile:
    """A random tree of two to four bodies in MJCF."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.joints: list[tuple[str, str]] = []  # name and kind, in the order of the file
        self.degrees, self.count = bool(self.rng.integers(2)), 0
        world = "".join(self.body(0) for _ in range(self.rng.integers(1, 3)))
        compiler = {
            "angle": "degree" if self.degrees else "radian",
            "eulerseq": "".join(self.rng.choice([*"xyzXYZ"], 3)),
            "boundmass": str(self.rng.choice([0, 0.5])),
            "boundinertia": str(self.rng.choice([0, 0.02])),
            "inertiafromgeom": str(self.rng.choice(["auto", "auto", "true"])),
            "inertiagrouprange": str(self.rng.choice(["0 5", "0 1"])),
        }
        flags = {
            flag: str(self.rng.choice(["enable", "enable", "disable"])) for flag in ("gravity", "spring", "damper")
        }
        classes = f'<default class="soft"><joint damping="{self.numbers(1, 0.1, 1)}"/><geom density="700"/></default>'
        self.text = (
            f"<mujoco><compiler {attributes(compiler)}/>"
            f'<option gravity="{self.numbers(3)}"><flag {attributes(flags)}/></option>'
            f'<default><joint armature="0"/>{classes}</default><worldbody>{world}</worldbody></mujoco>'
        )

    def numbers(self, count: int, low: float = -1, high: float = 1) -> str:
        return " ".join(f"{x:.6f}" for x in self.rng.uniform(low, high, count))

    def turned(self) -> str:
        kind = self.rng.choice(["", "quat", "euler", "axisangle", "xyaxes", "zaxis"])
        angle = 100 if self.degrees else 2
        values = {"quat": self.numbers(4), "euler": self.numbers(3, -angle, angle), "xyaxes": self.numbers(6)}
        values |= {"axisangle": f"{self.numbers(3)} {self.numbers(1, -angle, angle)}", "zaxis": self.numbers(3)}
        return f'pos="{self.numbers(3)}" ' + (f'{kind}="{values[kind]}"' if kind else "")

    def geom(self) -> str:
        kind, mass = self.rng.choice(["sphere", "box", "capsule", "cylinder", "ellipsoid"]), self.numbers(1, 0.5, 3)
        group, own = self.rng.integers(0, 2), self.rng.choice(["", f'mass="{mass}"', 'density="300"', 'class="soft"'])
        place = self.turned()
        if kind in ("capsule", "cylinder") and self.rng.integers(2):
            place = f'fromto="{self.numbers(6)}"'
        return f'<geom type="{kind}" size="{self.numbers(3, 0.1, 0.5)}" {place} group="{group}" {own}/>'

    def joint(self, kind: str) -> str:
        name = f"j{len(self.joints)}"
        self.joints.append((name, kind))
        if kind == "free":
            return f'<freejoint name="{name}"/>'
        law = f'damping="{self.numbers(1, 0, 1)}"' if self.rng.integers(2) else ""
        law += f' stiffness="{self.numbers(1, 0, 5)}"' if kind != "ball" and self.rng.integers(2) else ""
        return f'<joint name="{name}" type="{kind}" pos="{self.numbers(3)}" axis="{self.numbers(3)}" {law}/>'

    def body(self, depth: int) -> str:
        self.count += 1
        name, inside = f"b{self.count}", ""
        kinds = [["hinge"], ["slide"], ["ball"], ["slide", "hinge"], ["hinge", "hinge"], ["slide", "ball"]]
        kinds += [["free"]] if depth == 0 else [[]]
        joints = "".join(map(self.joint, kinds[self.rng.integers(len(kinds))]))
        if self.rng.integers(2):
            low = sorted(self.rng.uniform(0.5, 1, 3))
            inertia = f'diaginertia="{" ".join(f"{x:.6f}" for x in low)}"'
            if self.rng.integers(2):
                R = Rotation.from_quat(self.rng.normal(size=4)).as_matrix()
                full = R @ np.diag(low) @ R.T
                inertia = 'fullinertia="' + " ".join(repr(float(full[i, j])) for i, j in ORDER) + '"'
                inside = f'<inertial pos="{self.numbers(3)}" mass="{self.numbers(1, 0.2, 3)}" {inertia}/>'
            else:
                inside = f'<inertial {self.turned()} mass="{self.numbers(1, 0.2, 3)}" {inertia}/>'
        inside += "".join(self.geom() for _ in range(self.rng.integers(1, 3)))
        inside += f'<geom type="box" size="0.2 0.3 0.4" mass="{self.numbers(1, 0.5, 1)}"/>'  # of group 0
        inside += "".join(self.body(depth + 1) for _ in range(int(depth < 2 and self.rng.integers(2))))
        child = 'childclass="soft"' if self.rng.integers(3) == 0 else ""
        return f'<body name="{name}" {self.turned()} {child}>{joints}{inside}</body>'


ORDER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def attributes(values: dict[str, str]) -> str:
    return " ".join(f'{key}="{value}"' for key, value in values.items())


def states(model: Any, file: RandomFile) -> tuple[dict[str, float], np.ndarray, np.ndarray, np.ndarray]:
    """A random state by our names; qpos and qvel of MuJoCo; and the matrix from rates by our names to qvel."""
    rng, ours = np.random.default_rng(1), dict[str, float]()
    q, T = model.qpos0.copy(), np.eye(model.nv)
    v, names = np.zeros(model.nv), [""] * model.nv
    for i, (name, kind) in enumerate(file.joints):
        a, d = model.jnt_qposadr[i], model.jnt_dofadr[i]
        endings = {"hinge": [""], "slide": [""], "ball": [], "free": ["_x", "_y", "_z"]}[kind]
        values, rates = rng.uniform(-0.8, 0.8, len(endings)), rng.uniform(-1, 1, len(endings))
        ours |= {f"{name}{e}": float(x) for e, x in zip(endings, values, strict=True)}
        ours |= {f"{name}{e}_dot": float(x) for e, x in zip(endings, rates, strict=True)}
        R_0 = Rotation.identity()
        if kind == "free":
            R_0 = Rotation.from_quat(np.roll(q[a + 3 : a + 7], -1))
            T[d : d + 3, d : d + 3] = R_0.as_matrix()
            q[a : a + 3] += R_0.apply(values)
        elif endings:
            q[a] += values[0]
        v[d : d + len(endings)] = rates
        names[d : d + len(endings)] = [f"{name}{e}_dot" for e in endings]
        if kind in ("ball", "free"):
            turn, spin = Rotation.from_quat(rng.normal(size=4)), rng.uniform(-1, 1, 3)
            x, y, z, w = turn.as_quat()
            ours |= {f"{name}_q_{axis}": float(c) for axis, c in zip("wxyz", (w, x, y, z), strict=True)}
            ours |= {f"{name}_omega_{axis}": float(c) for axis, c in zip("xyz", spin, strict=True)}
            at, first = (a + 3, d + 3) if kind == "free" else (a, d)
            q[at : at + 4] = np.roll((R_0 * turn).as_quat(), 1)
            v[first : first + 3] = spin
            names[first : first + 3] = [f"{name}_omega_{axis}" for axis in "xyz"]
    return ours, q, T @ v, T[:, [names.index(n) for n in sorted(names)]]


@pytest.mark.parametrize("seed", SEEDS)
def test_random_files_move_as_in_mujoco(seed: int, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    file = RandomFile(seed)
    if not file.joints:
        file.text = file.text.replace("<geom", '<joint name="j0"/><geom', 1)
        file.joints = [("j0", "hinge")]
    (tmp_path / "random.xml").write_text(file.text, encoding="utf-8")
    model = mujoco.MjModel.from_xml_string(file.text)
    data, matrix = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    state, data.qpos[:], data.qvel[:], T = states(model, file)
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, matrix)
    tree = Linkage.from_mjcf(tmp_path / "random.xml")
    equations = derive(tree)
    rates = [*(f"{c.name}_dot" for c in tree.coordinates), *(name for o in tree.orientations for name in o.rates)]
    order = [rates.index(name) for name in sorted(rates)]
    mass = np.atleast_2d(equations.evaluate("mass_matrix", **state))[np.ix_(order, order)]
    accelerations = np.ravel(equations.evaluate("accelerations", **state))[order]
    for got, expected in ((mass, T.T @ matrix @ T), (T @ accelerations, data.qacc_smooth)):
        np.testing.assert_allclose(
            got, expected, rtol=0, atol=DIGITS * max(1e-3, np.abs(expected).max()), err_msg=file.text
        )
