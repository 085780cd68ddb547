"""The default experiment of a system; its step size is in annotations."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element, SubElement

from liaisons.base.arguments import check_finite
from liaisons.cosim import DefaultExperiment, SystemDocument
from liaisons_exchange.ssp.xml import child_path, tag

_TOLERANCE = 1e-4  # what OMSimulator takes by itself


def effective_experiment(
    document: SystemDocument,
    start_time: float | None = None,
    stop_time: float | None = None,
    step_size: float | None = None,
) -> DefaultExperiment:
    """Start, stop and step size: those given, else those of the document, else those of the FMUs.

    :raises SimulationError: for what is no finite number.
    """
    for label, value in (("start_time", start_time), ("stop_time", stop_time), ("step_size", step_size)):
        if value is not None:
            check_finite(label, value)
    last, usual = document.experiment, document.common_experiment
    if start_time is None:  # that of a run goes with its end
        start_time = (last.start_time or 0.0) if stop_time is None and last.stop_time is not None else 0.0
    if stop_time is None:
        later = (stop for stop in (last.stop_time, usual.stop_time) if stop is not None and stop > start_time)
        stop_time = next(later, None)
    if step_size is None:
        step_size = usual.step_size if last.step_size is None else last.step_size
    times = start_time, stop_time, step_size
    return DefaultExperiment(*(None if time is None else _without_rounding(time) for time in times))


def _without_rounding(time: float) -> float:
    """Time without the rounding errors of summed steps: 2 for 2.000000000000001."""
    few = float(f"{time:.14g}")
    return few if abs(few - time) <= 4 * math.ulp(time) else time


def add_simulation_information(system: Element, experiment: DefaultExperiment) -> None:
    """Add the annotation of the step size that OMSimulator reads, as the last child of the system."""
    if experiment.step_size is None:
        return
    annotation = _add_annotation(system, "org.openmodelica")
    information = SubElement(SubElement(annotation, tag("oms:Annotations")), tag("oms:SimulationInformation"))
    SubElement(
        information,
        tag("oms:FixedStepMaster"),
        description="oms-ma",
        stepSize=repr(experiment.step_size),
        absoluteTolerance=repr(_TOLERANCE),
        relativeTolerance=repr(_TOLERANCE),
    )


def add_experiment(root: Element, experiment: DefaultExperiment) -> None:
    """Add the default experiment, with the annotation of the step size that libcosim reads."""
    times = {"startTime": experiment.start_time, "stopTime": experiment.stop_time}
    attributes = {name: repr(float(value)) for name, value in times.items() if value is not None}
    element = SubElement(root, tag("ssd:DefaultExperiment"), attributes)
    if experiment.step_size is not None:
        algorithm = SubElement(_add_annotation(element, "com.opensimulationplatform"), tag("osp:Algorithm"))
        SubElement(algorithm, tag("osp:FixedStepAlgorithm"), baseStepSize=repr(experiment.step_size))


def read_experiment(root: Element) -> DefaultExperiment:
    """Default experiment of a structure, with the step size of its annotations.

    :raises ValueError: for a number that is none.
    """
    element = root.find(tag("ssd:DefaultExperiment"))
    attributes = {} if element is None else element.attrib
    stop = attributes.get("stopTime")
    steps = [
        step
        for name, attribute in (("osp:FixedStepAlgorithm", "baseStepSize"), ("oms:FixedStepMaster", "stepSize"))
        for algorithm in root.iter(tag(name))
        if (step := algorithm.get(attribute)) is not None
    ]
    start = float(attributes.get("startTime", math.nan))
    begin = start if math.isfinite(start) else None
    span = None if stop is None else float(stop), float(steps[0]) if steps else None
    return DefaultExperiment(begin, *span).usable()


def _add_annotation(parent: Element, kind: str) -> Element:
    """Add an annotation, and return its element.

    :param kind: domain of its author, as ``"org.openmodelica"``.
    """
    annotations = parent.find(child_path("ssd:Annotations"))
    if annotations is None:
        annotations = SubElement(parent, tag("ssd:Annotations"))
    return SubElement(annotations, tag("ssc:Annotation"), type=kind)
