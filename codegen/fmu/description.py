"""modelDescription.xml, and buildDescription.xml of FMI 3.0."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from qpmpc._version import __version__
from qpmpc.codegen.parts.units import UNITS
from qpmpc.codegen.parts.variables import Kind, Variable

Fmi = Literal["2", "3"]
FMIS: tuple[Fmi, ...] = ("2", "3")
VERSION: dict[Fmi, str] = {"2": "2.0", "3": "3.0"}
ELEMENT: dict[Fmi, dict[Kind, str]] = {
    "2": {"real": "Real", "integer": "Integer", "boolean": "Boolean"},
    "3": {"real": "Float64", "integer": "Int32", "boolean": "Boolean"},
}
LOGGED = {
    "logStatusWarning": "What an importer should know",
    "logStatusDiscard": "Steps beyond the end of the trip",
    "logStatusError": "Calls that are refused, and why",
}
TOOL = f"qpmpc-iptm {__version__}"


@dataclass(frozen=True)
class About:
    """What is said of an FMU as a whole.

    Attributes
    ----------
    identifier : begins the names of its files; that of its library
    name, description : for people
    token : tells it from every FMU made of other sources
    trip_s : after which it ends; None if it goes on
    """

    identifier: str
    name: str
    description: str
    token: str
    trip_s: int | None


def model_description(
    fmi: Fmi, about: About, variables: list[Variable], sources: Iterable[str]
) -> bytes:
    """Return modelDescription.xml."""
    root = Element("fmiModelDescription", _of_model(fmi, about))
    step = {"fixedInternalStepSize": "1"} if fmi == "3" else {}
    state = "canGetAndSetFMUState" if fmi == "3" else "canGetAndSetFMUstate"
    simulation = SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": about.identifier,
            "canBeInstantiatedOnlyOncePerProcess": "false",
            **({"canNotUseMemoryManagementFunctions": "true"} if fmi == "2" else {}),
            state: "true",
            "canHandleVariableCommunicationStepSize": "false",
            **step,
        },
    )
    if fmi == "2":
        files = SubElement(simulation, "SourceFiles")
        for name in sources:
            SubElement(files, "File", name=name)
    _add_units(root, variables)
    categories = SubElement(root, "LogCategories")
    for name, text in LOGGED.items():
        SubElement(categories, "Category", name=name, description=text)
    experiment = {"startTime": "0", "stepSize": "1"}
    if about.trip_s is not None:
        experiment["stopTime"] = str(about.trip_s)
    SubElement(root, "DefaultExperiment", experiment)
    listed = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        _add_variable(listed, fmi, reference, variable)
    _add_structure(root, fmi, variables)
    return _text(root)


def build_description(identifier: str, sources: Iterable[str]) -> bytes:
    """Return buildDescription.xml of FMI 3.0."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = SubElement(configuration, "SourceFileSet", language="C99")
    for name in sources:
        SubElement(files, "SourceFile", name=name)
    return _text(root)


def _of_model(fmi: Fmi, about: About) -> dict[str, str]:
    token = "guid" if fmi == "2" else "instantiationToken"
    return {
        "fmiVersion": VERSION[fmi],
        "modelName": about.name,
        token: about.token,
        "description": about.description,
        "generationTool": TOOL,
        "license": "Apache-2.0",
        "variableNamingConvention": "flat",
    }


def _add_units(root: Element, variables: list[Variable]) -> None:
    definitions = SubElement(root, "UnitDefinitions")
    used = {variable.unit for variable in variables}
    for name, unit in UNITS.items():
        if name in used:
            element = SubElement(definitions, "Unit", name=name)
            base = {key: str(exponent) for key, exponent in unit.base.items()}
            if unit.factor != 1.0:
                base["factor"] = str(unit.factor)
            if unit.offset:
                base["offset"] = str(unit.offset)
            SubElement(element, "BaseUnit", base)
            for display, factor in unit.displays.items():
                SubElement(element, "DisplayUnit", name=display, factor=str(factor))


def _add_variable(root: Element, fmi: Fmi, reference: int, variable: Variable) -> None:
    kind, role = variable.kind, variable.role
    variability = {"parameter": "fixed", "tunable": "tunable"}.get(role, "discrete")
    about = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description,
        "causality": "parameter" if role == "tunable" else role,
        "variability": "continuous" if variable.continuous else variability,
    }
    if role in ("parameter", "tunable", "output"):
        about["initial"] = "exact" if variable.at_start is None else "calculated"
    typed: dict[str, str] = {}
    if variable.unit is not None:
        typed["unit"] = variable.unit
    if variable.display is not None:
        typed["displayUnit"] = variable.display
    for name, limit in (("min", variable.low), ("max", variable.high)):
        if limit is not None:
            typed[name] = _number(limit, kind)
    if role != "independent" and variable.at_start is None:
        typed["start"] = _number(variable.start, kind)
    element = ELEMENT[fmi][kind]
    if fmi == "2":
        SubElement(SubElement(root, "ScalarVariable", about), element, typed)
    else:
        SubElement(root, element, about | typed)


def _add_structure(root: Element, fmi: Fmi, variables: list[Variable]) -> None:
    """Add the outputs, with the inputs from which they follow at once."""
    structure = SubElement(root, "ModelStructure")
    references = {variable.name: place for place, variable in enumerate(variables)}
    outputs = [variable for variable in variables if variable.role == "output"]
    inputs = [variable.name for variable in variables if variable.role == "input"]
    by_index = fmi == "2"  # from 1
    first, attribute = (1, "index") if by_index else (0, "valueReference")

    def unknown(parent: Element, tag: str, name: str, known: Iterable[str]) -> None:
        dependencies = " ".join(str(first + references[each]) for each in known)
        place = {attribute: str(first + references[name]), "dependencies": dependencies}
        SubElement(parent, tag, place)

    parent = SubElement(structure, "Outputs") if by_index else structure
    for variable in outputs:
        tag = "Unknown" if by_index else "Output"
        unknown(parent, tag, variable.name, inputs if variable.follows else ())
    calculated = [variable for variable in outputs if variable.at_start is not None]
    if calculated:
        parent = SubElement(structure, "InitialUnknowns") if by_index else structure
        for variable in calculated:
            tag = "Unknown" if by_index else "InitialUnknown"
            unknown(parent, tag, variable.name, variable.at_start or ())


def _number(value: float, kind: Kind) -> str:
    if kind == "boolean":
        return "true" if value else "false"
    return str(int(value)) if kind == "integer" else repr(float(value))


def _text(root: Element) -> bytes:
    indent(root)
    text: str = tostring(root, "unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()
