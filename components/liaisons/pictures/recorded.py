"""A recorded motion as one HTML file."""

from __future__ import annotations

import base64

from liaisons.pictures.declared import Picture
from liaisons.pictures.frames import Frames
from liaisons.pictures.inline import page


def recorded_page(picture: Picture, shown: Frames, *, title: str, speed: float, rate: float) -> bytes:
    """A page that plays the motion, to be dragged and zoomed.

    :param shown: evenly spaced in time.
    :param rate: frames a second.
    """
    plan = {
        "picture": picture.document,
        "signals": picture.variables,
        "values": base64.b64encode(shown.values.astype("<f4").tobytes()).decode(),
        "frames": len(shown.time),
        "rate": rate,
        "speed": speed,
        "start": float(shown.time[0]),
        "plane": picture.plane,
    }
    return page("recorded.html", ("picture.js", "recorded.js"), title, "", plan)
