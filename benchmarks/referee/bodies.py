"""Bodies as MJCF writes them."""

from __future__ import annotations

DUST = 1e-12  # [kg], [kg.m2]: what carries only others, since engines refuse 0


def body(
    name: str,
    joints: str,
    *,
    at: str = "0 0 0",
    mass: float = DUST,
    centre: str = "0 0 0",
    inertia: tuple[float, float, float] = (DUST, DUST, DUST),
    inside: str = "",
) -> str:
    """A body with its joints and the bodies that it carries."""
    moments = " ".join(map(str, inertia))
    return (
        f'<body name="{name}" pos="{at}">{joints}<inertial pos="{centre}" mass="{mass}" diaginertia="{moments}"/>'
        f"{inside}</body>"
    )


def joint(name: str, kind: str, axis: str = "0 0 1", more: str = "") -> str:
    """A hinge, slide or ball."""
    along = "" if kind == "ball" else f' axis="{axis}"'
    return f'<joint name="{name}" type="{kind}"{along} {more}/>'
