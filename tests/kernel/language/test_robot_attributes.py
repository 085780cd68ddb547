"""Each element and attribute of MJCF and URDF, one at a time in a small model: obeyed, listed in left_out, or refused.

Those that are refused unless a user leaves them out by name are listed on request.

What is obeyed gives the numbers of MuJoCo and Pinocchio.  Run as a program it writes the
two pages of the documentation, docs/reference/mjcf.md and urdf.md, which these tests keep up to date.
"""

from __future__ import annotations

import re
import tempfile
import textwrap
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import casadi as ca
import numpy as np
import pytest

from liaisons import Linkage, derive
from liaisons.errors import ComponentError
from liaisons_exchange.robot_files.mjcf import read_mjcf
from liaisons_exchange.robot_files.robot import RobotOptions
from liaisons_exchange.robot_files.urdf import read_urdf

PAGES = Path(__file__).parents[3] / "docs" / "reference"
OBEYED, LISTED, REQUESTED, REFUSED = "obeyed", "listed", "listed on request", "refused"
Edits = dict[str, dict[str, str]]
"""Attributes by the path of an element, which is added where there is none; ``""`` removes one."""

MJCF = """<mujoco>
  <worldbody>
    <body name="a" pos="0.1 0 1">
      <joint name="p" axis="0 1 0" limited="true" range="-40 50"/>
      <inertial mass="2" pos="0.1 0 0.2" diaginertia="1 1.1 1.2"/>
      <geom size="0.2" pos="0.3 0 0"/>
      <body name="b" pos="0 0 1">
        <joint name="s" type="slide" axis="1 0 0"/>
        <geom type="box" size="0.3 0.2 0.1" pos="0 0.2 0" group="1"/>
        <geom type="capsule" size="0.1 0.2" pos="0.1 0 0.4"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""
CONNECT = '<equality><connect name="c" body1="b" anchor="0.1 0 0.3"/></equality></mujoco>'
FOLLOW = '<equality><joint name="c" joint1="s" joint2="p"/></equality></mujoco>'
TENDONS = """<tendon><fixed name="t"><joint joint="p" coef="0.5"/><joint joint="s" coef="1"/></fixed>
  <fixed name="u"><joint joint="p" coef="2"/></fixed></tendon>
  <equality><tendon name="c" tendon1="t" tendon2="u"/></equality></mujoco>"""
WELD = '<equality><weld name="c" body1="b"/></equality></mujoco>'
BODY, INNER = "worldbody/body", "worldbody/body/body"
SMALL = {  # models by the paths of what is tried in them
    f"{BODY}/freejoint": re.sub(r"<joint name=.p.*?>", '<freejoint name="p"/>', MJCF),
    "equality/connect": MJCF.replace("</mujoco>", CONNECT),
    "equality/weld": MJCF.replace("</mujoco>", WELD),
    "default/equality": MJCF.replace("</mujoco>", CONNECT),
    "equality/joint": MJCF.replace("</mujoco>", FOLLOW),
    "equality/tendon": MJCF.replace("</mujoco>", TENDONS),
    "tendon/fixed": MJCF.replace("</mujoco>", TENDONS),
    "tendon/fixed/joint": MJCF.replace("</mujoco>", TENDONS),
}


def of_class(**attributes: dict[str, str]) -> Edits:
    """A default class ``k`` with these attributes, by tag."""
    return {"default/default": {"class": "k"}} | {f"default/default/{tag}": own for tag, own in attributes.items()}


TURNED = {"pos": "1 2 3", "quat": "1 2 3 4", "axisangle": "1 2 3 40", "xyaxes": "1 2 0 0 1 3", "zaxis": "1 2 3"}
TURNED |= {"euler": "10 20 30"}
JOINT, BOXED = f"{BODY}/joint", f"{INNER}/geom"
VALUES: dict[str, dict[str, str | tuple[str, Edits]]] = {  # that change the motion, or are refused; others: "1"
    "": {"model": "small"},
    "compiler": {
        "angle": "radian",
        "autolimits": "false",
        "balanceinertia": ("true", {f"{BODY}/inertial": {"diaginertia": "1 1 4"}}),
        "boundinertia": "1.15",
        "boundmass": "30",
        "coordinate": "global",
        "eulerseq": ("zYx", {BODY: {"euler": "10 20 30"}}),
        "inertiafromgeom": "true",
        "inertiagrouprange": "1 3",
        "settotalmass": "7",
    },
    "include": {"file": "part.xml"},
    "option": {"gravity": "1 2 -3", "density": "1.2", "viscosity": "0.1"},
    "option/flag": {
        "gravity": "disable",
        "spring": ("disable", {JOINT: {"stiffness": "3"}}),
        "damper": ("disable", {JOINT: {"damping": "3"}}),
        "frictionloss": ("disable", {JOINT: {"frictionloss": "3"}}),
        "limit": "disable",
        "equality": ("disable", {"equality/connect": {"body1": "b", "anchor": "0 0 0"}}),
        "constraint": ("disable", {JOINT: {"frictionloss": "3"}}),
        "contact": "disable",
    },
    BODY: {**TURNED, "name": "other", "mocap": "true", "childclass": ("k", of_class(joint={"damping": "2"}))},
    f"{BODY}/inertial": {
        **TURNED,
        "mass": "5",
        "diaginertia": "2 3 4",
        "fullinertia": ("2 3 4 0.1 0.2 0.3", {f"{BODY}/inertial": {"diaginertia": ""}}),
    },
    JOINT: {
        "name": "other",
        "class": ("k", of_class(joint={"damping": "2"})),
        "type": "slide",
        "pos": "1 2 3",
        "axis": "1 2 3",
        "range": "-10 20",
        "limited": "false",
        "ref": "10",
        "armature": "2",
        "springref": ("10", {JOINT: {"stiffness": "30"}}),
        "stiffness": "30",
        "damping": "4",
        "frictionloss": "5",
        "springdamper": "0.5 1",
        "springyield": ("10", {JOINT: {"stiffness": "30"}}),
    },
    f"{BODY}/freejoint": {"name": "other"},
    BOXED: {
        **TURNED,
        "name": "other",
        "class": ("k", of_class(geom={"density": "2"})),
        "type": "ellipsoid",
        "size": "0.1 0.2 0.4",
        "fromto": ("0 0 0 1 1 0", {BOXED: {"type": "cylinder", "pos": ""}}),
        "mass": "3",
        "density": "300",
        "group": ("5", {"compiler": {"inertiagrouprange": "0 4"}}),
        "mesh": "m",
        "shellinertia": "true",
    },
    "equality/connect": {
        "name": "other",
        "active": "false",
        "anchor": "0.2 0 0.5",
        "body1": "a",
        "body2": "a",
        "class": ("k", of_class(equality={"active": "false"})),
        "site1": ("x", {"equality/connect": {"body1": "", "anchor": "", "site2": "y"}}),
        "site2": ("x", {"equality/connect": {"body1": "", "anchor": "", "site1": "y"}}),
    },
    "equality/weld": {
        "name": "other",
        "active": "false",
        "body1": "a",
        "body2": "a",
        "class": ("k", of_class(equality={"active": "false"})),
        "relpose": "0 0 0 1 0 0 0",
        "site1": ("x", {"equality/weld": {"body1": "", "site2": "y"}}),
        "site2": ("x", {"equality/weld": {"body1": "", "site1": "y"}}),
    },
    "equality/joint": {
        "name": "other",
        "active": "false",
        "joint1": ("p", {"equality/joint": {"joint2": "s"}}),
        "joint2": ("", {"equality/joint": {"joint2": ""}}),
        "class": ("k", of_class(equality={"active": "false"})),
        "polycoef": "0.1 0.2 0.3 0 0.4",
    },
    "equality/tendon": {
        "name": "other",
        "active": "false",
        "tendon1": ("u", {"equality/tendon": {"tendon2": "t"}}),
        "tendon2": ("", {"equality/tendon": {"tendon2": ""}}),
        "class": ("k", of_class(equality={"active": "false"})),
        "polycoef": "0.1 0.2 0.3 0 0.4",
    },
    "tendon/fixed": {
        "name": ("other", {"equality/tendon": {"tendon1": "other"}}),
        "class": ("k", of_class(tendon={"width": "2"})),
        "range": "0 1",
        "limited": ("true", {"tendon/fixed": {"range": "0 1"}}),
    },
    "tendon/fixed/joint": {"joint": ("s", {"tendon/fixed/joint[2]": {"joint": "p"}}), "coef": "3"},
    "actuator/motor": {key: ("1", {"actuator/motor": {"joint": "p"}}) for key in ("armature", "damping")},
    "default/joint": {"": ("", {"default/joint": {"damping": "2"}})},
    "default/geom": {"": ("", {"default/geom": {"density": "2"}})},
    "default/equality": {"": ("", {"default/equality": {"active": "false"}})},
}
PLACES = {  # of elements in the schema, those that are looked at attribute by attribute
    "mujoco": "",
    "mujoco/compiler": "compiler",
    "mujoco/option": "option",
    "mujoco/option/flag": "option/flag",
    "mujoco/size": "size",
    "mujoco/statistic": "statistic",
    "mujoco/body": BODY,
    "mujoco/body/inertial": f"{BODY}/inertial",
    "mujoco/body/joint": JOINT,
    "mujoco/body/freejoint": f"{BODY}/freejoint",
    "mujoco/body/geom": BOXED,
    "mujoco/equality/connect": "equality/connect",
    "mujoco/equality/weld": "equality/weld",
    "mujoco/equality/joint": "equality/joint",
    "mujoco/equality/tendon": "equality/tendon",
    "mujoco/tendon/fixed": "tendon/fixed",
    "mujoco/tendon/fixed/joint": "tendon/fixed/joint",
}
NOT_IN_SCHEMA = [f"{BODY}/frame", f"{BODY}/replicate", f"{BODY}/composite"]  # expanded before it is checked


class Trial(NamedTuple):
    """An attribute of an element, or, without one, an element as a whole."""

    path: str
    attribute: str = ""

    def document(self, base: str, values: dict[str, dict[str, Any]], *, plain: bool = False) -> str:
        """The small model with the attribute.

        :param plain: without it, but with what its value needs besides.
        """
        root = ElementTree.fromstring(base)
        value = values.get(self.path, {}).get(self.attribute, "1")
        value, besides = value if isinstance(value, tuple) else (value, {})
        edits = list(besides.items()) + ([] if plain else [(self.path, {self.attribute: value})])
        for path, attributes in edits:
            element = root
            for tag in filter(None, path.split("/")):
                found = element.find(tag)
                element = ElementTree.SubElement(element, tag.partition("[")[0]) if found is None else found
            for key, text in attributes.items():
                element.attrib.pop(key, None)
                element.attrib |= {key: text} if key and text else {}
        return ElementTree.tostring(root, encoding="unicode")

    def verdict(self, name: str, file: Path) -> str:
        """Whether the attribute is obeyed, listed, listed on request, or refused."""
        (file.parent / "part.xml").write_text("<mujoco/>", encoding="utf-8")
        _, base, values = FORMATS[name]
        base, tag = SMALL.get(self.path, base), self.path.rpartition("/")[2].partition("[")[0]
        before: tuple[str, ...] = ()
        with suppress(ComponentError):  # which some attributes mend
            before = left_out(name, file, self.document(base, values, plain=True))
        attribute = rf"(\w+, )*{self.attribute}(, \w+)*( = \S+)? of [<\w]"
        listed, refusal = attribute if self.attribute else rf"\d+ <{tag}>", ""
        try:
            after = left_out(name, file, self.document(base, values))
            if any(re.match(listed, line) for line in after if line not in before):
                return LISTED
            linkage(name, file, self.document(base, values))
        except ComponentError as error:
            refusal = str(error)
        assert not refusal or re.search(rf": line \d+: .*({tag}|{self.attribute})", refusal), refusal
        return REQUESTED if "leave_out=" in refusal else REFUSED if refusal else OBEYED


@cache
def left_out(name: str, file: Path, text: str) -> tuple[str, ...]:
    """What is left out of a document."""
    file.write_text(text, encoding="utf-8")
    return FORMATS[name][0](file, RobotOptions(limits=True)).class_members()["left_out"]


def linkage(name: str, file: Path, text: str) -> type[Linkage]:
    """Class of a document."""
    file.write_text(text, encoding="utf-8")
    return (Linkage.from_mjcf if name == "mjcf" else Linkage.from_urdf)(file, limits=True)


def mjcf_trials() -> list[Trial]:
    """All attributes and elements of the schema, with what is expanded before it is checked."""
    text = pytest.importorskip("mujoco").mj_printSchema(False, False)
    chain: list[str] = []
    trials: list[Trial] = []
    for line in text.splitlines():
        head = re.match(r"( *)(?:\(world\))?(\w+) \([*?!R@]\) *", line)
        if head:
            chain = [*chain[: len(head[1]) // 3], head[2]]
        place = PLACES.get("/".join(chain))
        path = "/".join(chain[1:]).replace("body", BODY, 1) if chain[1:2] == ["body"] else "/".join(chain[1:])
        leaf = len(chain) == 3 or (len(chain) == 2 and path in ("size", "statistic"))
        if place is None and head and leaf:
            trials.append(Trial(path))
        if place is not None:
            trials += [Trial(place, attribute) for attribute in line[head.end() if head else 0 :].split()]
    of_actuators = [Trial("actuator/motor", key) for key in ("armature", "damping")]  # as of all others
    return [*trials, *of_actuators, Trial("include", "file"), *map(Trial, NOT_IN_SCHEMA)]


# ---- pages -------------------------------------------------------------------------------------------------------


def page(title: str, verdicts: dict[Trial, str]) -> str:
    """Page of a table: of each element, the attributes that are obeyed, listed and refused."""
    rows: dict[str, dict[str, list[str]]] = {}
    for trial, verdict in verdicts.items():
        element, name = (trial.path, trial.attribute) if trial.attribute else trial.path.rpartition("/")[::2]
        element = element.replace(f"{INNER}/", "body/").replace(BODY, "body").replace("[2]", "") or "the document"
        label = f"{element}/..." if not trial.attribute else element
        rows.setdefault(label, {OBEYED: [], LISTED: [], REQUESTED: [], REFUSED: []})[verdict].append(name)
    cells = {label: [", ".join(names) or "–" for names in row.values()] for label, row in rows.items()}
    columns = ("element", "obeyed", "listed in `left_out`", "left out on request", "refused, by name and line")
    head = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    return "\n".join([title, *head, *(f"| `{label}` | {' | '.join(row)} |" for label, row in cells.items()), ""])


MJCF_NOTES = """

Constraints are exact, while those of MuJoCo are soft. Actuators, and contacts between geoms, are listed; instead of
an actuator, use the input `J_force` of the joint. With `limits=True`, limits of joints become stops. Included files
must be in the folder of the document.

13 of the 14 files of Gymnasium and 14 of the 19 files of dm_control's suite can be read. At 20 random states of each,
the mass matrix and the forces (weights, centrifugal forces, springs, dampers) agree with MuJoCo to 1e-12 of the
largest. The other files need features that linkages do not support: `swimmer.xml` and `fish.xml` a fluid (`density`),
`ball_in_cup.xml` a tendon with a limit, and `dog.xml` meshes, because it has bodies without `<inertial>`. `lqr.xml`
has no joint until a program adds bodies.
"""
URDF_NOTES = """

A joint that mimics another is coupled to it by a constraint, whose force is `lambda_J_mimic`.

60 of the 69 files of Gepetto/example-robot-data can be read, some of them with `balance_inertia=True` or
`floating_base=True`. At 20 random states of each, the mass matrix and the forces agree with Pinocchio to 1e-12 of the
largest. Of the other files, six have joints that move no mass, two name a link or joint that does not exist, and one
is empty.
"""


def title(name: str, source: str, besides: str, peer: str, notes: str) -> str:
    """Beginning of a page, before its table."""
    text = f"""The table lists each attribute of {source}. Each was tried by itself, in a small model. Obeyed
    attributes affect either the picture or the equations; in the latter case mass matrix, accelerations,
    limits{besides} agree with {peer} to nine digits. Attributes and elements in the column 'listed in `left_out`' do
    not enter the equations. They are named in `left_out` of the
    [class](../howto/build-a-linkage.md#load-urdf-or-mjcf), which the commands print; what is inside a listed element
    is left out with it. A feature that would affect the motion, but that linkages do not support, is refused, unless
    you ask for it to be left out: `leave_out=["viscosity"]`, `--leave-out viscosity`. It is then listed in `left_out`,
    too."""
    filled = textwrap.fill(" ".join(text.split()), 116, break_on_hyphens=False)
    return f"# {name}: which elements and attributes are read\n\n{filled}\n\n{notes.strip()}\n"


MJCF_TITLE = title("MJCF", "the schema of MuJoCo 4", ", dry friction, loops and couplings", "MuJoCo", MJCF_NOTES)
URDF_TITLE = title("URDF", "the format, versions 1.0 to 1.2", " and dry friction", "Pinocchio", URDF_NOTES)


# ---- numbers of the peers ----------------------------------------------------------------------------------------


def limits_and_friction(tree: type[Linkage], joint: str) -> list[float]:
    """Lower and upper limit and dry friction of a joint; 0 where there is none."""
    starts = {p.name: p.start for p in tree.parameters}
    return [starts.get(f"{joint}_{key}", 0.0) for key in ("minimum", "maximum", "friction")]


def residual(tree: type[Linkage], state: dict[str, float]) -> float:
    """Distance by which the joints that close loops are open."""
    m = tree()
    values = m.start_values() | state
    offsets = [ca.SX(getattr(m, c.name)) for c in m.constraints if "_angle_" not in c.name]
    function = ca.Function("open", [*m.symbols.values()], [ca.norm_2(ca.vertcat(*offsets)) if offsets else ca.SX(0)])
    return float(function(*(values[name] for name in m.symbols)))


def numbers(tree: type[Linkage], q: np.ndarray, v: np.ndarray, joints: list[str]) -> dict[str, np.ndarray]:
    """Mass matrix, accelerations, and the further numbers of a class at a state."""
    names = [*(c.name for c in tree.coordinates), *(n for o in tree.orientations for n in o.quaternion)]
    rates = [*(f"{c.name}_dot" for c in tree.coordinates), *(n for o in tree.orientations for n in o.rates)]
    state = dict(zip((*names, *rates), map(float, (*q, *v)), strict=True))
    equations, looped = derive(tree), bool(tree.constraints)
    found = {"mass matrix": np.array(equations.evaluate("mass_matrix", **state))}
    if not looped:
        found["accelerations"] = np.ravel(equations.evaluate("accelerations", **state))
    found["loops"] = np.array([residual(tree, state), looped])
    return found | {"limits, friction": np.array([limits_and_friction(tree, joint) for joint in joints])}


def mujoco_numbers(mujoco: Any, text: str, q: np.ndarray, v: np.ndarray, *, looped: bool) -> dict[str, np.ndarray]:
    """The same of MuJoCo, with the names of its joints."""
    model = mujoco.MjModel.from_xml_string(text)
    data, free = mujoco.MjData(model), model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    data.qpos[:], data.qvel[:] = q + (model.qpos0 * ([1, 1, 1, 0, 0, 0, 0, 1] if free else 1)), v
    mujoco.mj_forward(model, data)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    off = model.opt.disableflags
    bits = mujoco.mjtDisableBit
    without = [bool(off & (bits.mjDSBL_CONSTRAINT | bit)) for bit in (bits.mjDSBL_LIMIT, bits.mjDSBL_FRICTIONLOSS)]
    limits = model.jnt_range * (model.jnt_limited[:, None] & (not without[0]))
    friction = model.dof_frictionloss[model.jnt_dofadr] * (not without[1])
    is_loop = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    open_by = np.linalg.norm(data.efc_pos[is_loop][:3]) if is_loop.any() else 0.0
    found = {"mass matrix": matrix, "loops": np.array([open_by, is_loop.any()])}
    if not looped:
        found["accelerations"] = data.qacc_smooth.copy()
    return found | {"limits, friction": np.column_stack([limits, friction])}


@pytest.mark.slow
def test_what_is_obeyed_gives_the_numbers_of_mujoco(tmp_path: Path) -> None:
    """To nine digits, at a random state; each attribute changes one of them, or a name."""
    mujoco = pytest.importorskip("mujoco")
    rng = np.random.default_rng(43)
    for trial in mjcf_trials():
        if trial.verdict("mjcf", tmp_path / "small.xml") != OBEYED or trial.path == "include":
            continue
        base = SMALL.get(trial.path, MJCF)
        text = trial.document(base, VALUES)
        tree = linkage("mjcf", tmp_path / "small.xml", text)
        free = bool(tree.orientations)
        q, v = rng.uniform(-0.6, 0.6, 8 if free else 2), rng.uniform(-1, 1, 7 if free else 2)
        order = [0, 1, 2, 4, 5, 6, 7, 3] if free else [0, 1]  # our coordinates come before orientations
        rate_order = [0, 1, 2, 4, 5, 6, 3] if free else [0, 1]
        if free:
            q[4:] /= np.linalg.norm(q[4:])
        expected = mujoco_numbers(mujoco, text, q[order], v[rate_order], looped=bool(tree.constraints))
        model = mujoco.MjModel.from_xml_string(text)
        names = [model.joint(i).name for i in range(2)]
        got = numbers(tree, q if free else q + model.qpos0, v, names)
        if free:
            back = np.argsort(rate_order)
            expected["mass matrix"] = expected["mass matrix"][back[:, None], back]
            expected["accelerations"] = expected["accelerations"][back]
        if trial.path == "equality/weld" or (
            len(tree.constraints) == 1 and "_offset_" in tree.constraints[0].name
        ):  # one of two in the plane; at another point
            got["loops"], expected["loops"] = got["loops"][1:], expected["loops"][1:]
        assert_same(got, expected, trial)


# ---- URDF --------------------------------------------------------------------------------------------------------

URDF = """<robot name="small">
  <link name="base"/>
  <link name="a">
    <inertial><origin xyz="0.1 0 0.2"/><mass value="2"/><inertia ixx="1" iyy="1.1" izz="1.2"/></inertial>
    <visual><origin xyz="0 0 0.1"/><geometry><box size="1 2 3"/></geometry></visual>
    <collision><geometry><sphere radius="1"/></geometry></collision>
  </link>
  <link name="b"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>
  <joint name="p" type="revolute">
    <parent link="base"/><child link="a"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/><limit lower="-1" upper="2"/>
    <dynamics damping="0.3"/>
  </joint>
  <joint name="s" type="prismatic">
    <parent link="a"/><child link="b"/><axis xyz="1 0 0"/><limit lower="-1" upper="1"/>
  </joint>
</robot>"""
_ORIGIN = {"xyz": "1 2 3", "rpy": "0.1 0.2 0.3", "quat_xyzw": "0.1 0.2 0.3 0.9"}
_NO_ELEMENT = ("1", {})
URDF_ATTRIBUTES = {  # wiki.ros.org/urdf/XML, and versions 1.1 and 1.2 of urdfdom; an element as a whole: ""
    "": {"name": "other", "version": "1.1"},
    "link": {"name": ("root", {"joint/parent": {"link": "root"}}), "type": "1"},
    "link[2]/inertial/origin": _ORIGIN,
    "link[2]/inertial/mass": {"value": "3"},
    "link[2]/inertial/inertia": {"ixx": "1.2", "ixy": "0.1", "ixz": "0.1", "iyy": "1.3", "iyz": "0.1", "izz": "0.9"},
    "link[2]/visual": {"name": "box"},
    "link[2]/visual/origin": _ORIGIN,
    "link[2]/visual/geometry/box": {"size": "1 1 1"},
    "link/visual/geometry/cylinder": {"": ("1", {"link/visual/geometry/cylinder": {"radius": "1", "length": "2"}})},
    "link/visual/geometry/sphere": {"": ("1", {"link/visual/geometry/sphere": {"radius": "1"}})},
    "link/visual/geometry/capsule": {"": ("1", {"link/visual/geometry/capsule": {"radius": "1", "length": "2"}})},
    "link/visual/geometry/mesh": {"": _NO_ELEMENT},
    "link[2]/visual/material": {"": _NO_ELEMENT},
    "link/collision": {"": _NO_ELEMENT},
    "joint": {"name": "other", "type": "continuous"},
    "joint/origin": _ORIGIN,
    "joint/parent": {"link": ("c", {"link": {"name": "c"}})},
    "joint/child": {"link": ("c", {"link[2]": {"name": "c"}, "joint[2]/parent": {"link": "c"}})},
    "joint/axis": {"xyz": "1 2 3"},
    "joint/limit": {"lower": "-0.5", "upper": "1.5"}
    | dict.fromkeys(("effort", "velocity", "acceleration", "deceleration", "jerk"), "1"),
    "joint/dynamics": {"damping": "0.5", "friction": "0.4"},
    "joint/mimic": {"joint": "s"} | {key: ("0.5", {"joint/mimic": {"joint": "s"}}) for key in ("multiplier", "offset")},
    "joint/calibration": {"": _NO_ELEMENT},
    "joint/safety_controller": {"": _NO_ELEMENT},
    "material": {"": _NO_ELEMENT},
    "transmission": {"": _NO_ELEMENT},
    "gazebo": {"": _NO_ELEMENT},
    "sensor": {"": _NO_ELEMENT},
}


FORMATS: dict[str, tuple[Any, str, dict[str, dict[str, Any]]]] = {
    "mjcf": (read_mjcf, MJCF, VALUES),
    "urdf": (read_urdf, URDF, URDF_ATTRIBUTES),
}
"""By format: its reader, a small model, and values of attributes."""


def urdf_trials() -> list[Trial]:
    """All attributes and elements of the format."""
    return [Trial(path, attribute) for path, attributes in URDF_ATTRIBUTES.items() for attribute in attributes]


def pinocchio_numbers(pinocchio: Any, text: str, q: np.ndarray, v: np.ndarray) -> dict[str, np.ndarray]:
    """Mass matrix, accelerations under damping, limits and dry friction of the joints of a robot."""
    root = ElementTree.fromstring(text)
    for tag, needed in (("limit", ("effort", "velocity")), ("inertia", ("ixy", "ixz", "iyz"))):
        for element in root.iter(tag):
            element.attrib |= {key: element.get(key, "0") for key in needed}
    model = pinocchio.buildModelFromXML(ElementTree.tostring(root, encoding="unicode"))
    data = model.createData()
    turning = model.nq > len(q)  # a continuous joint has cosine and sine
    place = np.array([np.cos(q[0]), np.sin(q[0]), q[1]]) if turning else q
    matrix = pinocchio.crba(model, data, place)
    accelerations = pinocchio.aba(model, data, place, v, -model.damping * v)
    low, high = (x[-2:] * ([0, 1] if turning else 1) for x in (model.lowerPositionLimit, model.upperPositionLimit))
    return {
        "mass matrix": np.triu(matrix) + np.triu(matrix, 1).T,
        "accelerations": accelerations,
        "limits, friction": np.column_stack([low, high, model.friction]),
        "loops": np.zeros(2),
    }


@pytest.mark.slow
def test_what_is_obeyed_gives_the_numbers_of_pinocchio(tmp_path: Path) -> None:
    """To nine digits, at a random state."""
    pinocchio = pytest.importorskip("pinocchio")
    rng, file = np.random.default_rng(43), tmp_path / "small.urdf"
    for trial in urdf_trials():
        if trial.verdict("urdf", file) != OBEYED or trial.attribute == "quat_xyzw":  # of newer versions of urdfdom
            continue
        if trial.path == "joint/mimic":  # it has a test of its own
            continue
        text = trial.document(URDF, URDF_ATTRIBUTES)
        tree = linkage("urdf", file, text)
        q, v = rng.uniform(-0.6, 0.6, 2), rng.uniform(-1, 1, 2)
        assert_same(
            numbers(tree, q, v, [c.name for c in tree.coordinates]), pinocchio_numbers(pinocchio, text, q, v), trial
        )


def test_quat_xyzw_is_rpy_in_other_words(tmp_path: Path) -> None:
    """A turn by 0.6 about y."""
    found = []
    for words in ('rpy="0 0.6 0"', f'quat_xyzw="0 {np.sin(0.3)} 0 {np.cos(0.3)}"'):
        (tmp_path / "small.urdf").write_text(URDF.replace('<origin xyz="0 0 1"/>', f'<origin xyz="0 0 1" {words}/>'))
        tree = Linkage.from_urdf(tmp_path / "small.urdf")
        found.append(numbers(tree, np.array([0.3, 0.2]), np.array([1.0, 2.0]), [])["accelerations"])
    np.testing.assert_allclose(*found, rtol=1e-12, atol=0)  # the same rotation but for rounding


def assert_same(got: dict[str, np.ndarray], expected: dict[str, np.ndarray], trial: Trial) -> None:
    """Equal to nine digits of the largest number of each kind."""
    assert got.keys() == expected.keys()
    for key, value in expected.items():
        scale = 1e-9 * max(1.0, np.abs(value).max())
        np.testing.assert_allclose(got[key], value, rtol=0, atol=scale, err_msg=f"{trial}: {key}")


# ---- pages -------------------------------------------------------------------------------------------------------


def written(name: str, folder: Path) -> str:
    """Page of a format."""
    title, trials = (MJCF_TITLE, mjcf_trials()) if name == "mjcf" else (URDF_TITLE, urdf_trials())
    return page(title, {trial: trial.verdict(name, folder / "small.xml") for trial in trials})


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.variants(core=0)
def test_the_page_is_up_to_date(name: str, tmp_path: Path) -> None:
    text = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    assert text == written(name, tmp_path), f"python {__file__} writes it"


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for name in FORMATS:
            (PAGES / f"{name}.md").write_text(written(name, Path(folder)), encoding="utf-8")
