"""FMUs of other tools: a controller with their descriptions, and descriptions drawn from the schema."""

import re
import subprocess
import zipfile
from pathlib import Path
from random import Random
from xml.sax.saxutils import quoteattr

from references import ROOT

XSI = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
# Name, value reference, causality, type, and SI unit of the variables of the controller in docs/controller-fmu.md.
VARIABLES = [
    ("response", 0, "input", "Real", "m"),
    ("reference", 1, "input", "Real", "m"),
    ("active", 2, "input", "Boolean", None),
    ("omega", 3, "output", "Real", "rad/s"),
    ("E", 4, "output", "Real", "m"),
    ("phase_error", 5, "output", "Real", "rad"),
]
STRUCTURE = (
    '<ModelStructure><Outputs><Unknown index="4"/><Unknown index="5"/><Unknown index="6"/></Outputs></ModelStructure>'
)
UNITS = """<UnitDefinitions>
  <Unit name="m"><BaseUnit m="1"/><DisplayUnit name="mm" factor="1e3"/></Unit>
  <Unit name="rad"><BaseUnit rad="1"/><DisplayUnit name="deg" factor="57.29577951308232"/></Unit>
  <Unit name="rad/s"><BaseUnit s="-1" rad="1"/></Unit>
</UnitDefinitions>"""


def library(folder: Path, omega: float = 1, amplitude: float = 1, changed: tuple[str, str] = ("", "")) -> bytes:
    """The controller of docs/controller-fmu.md, compiled; SI units per unit of its outputs, and replaced code."""
    (code,) = re.findall(r"```c\n(.*?)```", (ROOT / "docs/controller-fmu.md").read_text(), re.DOTALL)
    plain = "COPY(fmi2GetReal, double, value[n], STORED)"
    assert plain in code
    scaled = f"static const double si[] = {{1, 1, 1, {omega!r}, {amplitude!r}, 1}};\n"
    code = code.replace(plain, scaled + "COPY(fmi2GetReal, double, value[n], STORED / si[r[n]])")
    assert changed[0] in code
    code = code.replace(*changed) if changed[0] else code
    (folder / "mine.c").write_text(code)
    compiler = ["cc", "-O2", "-shared", "-fPIC", "mine.c", "-lm", "-o", "mine.so"]
    subprocess.run(compiler, cwd=folder, check=True)
    return (folder / "mine.so").read_bytes()


def compiled(folder: Path, source: str, *options: str) -> bytes:
    """A library of tests/foreign."""
    compiler = ["cc", "-O2", "-shared", "-fPIC", *options, ROOT / "tests/foreign" / source, "-lm", "-o", "mine.so"]
    subprocess.run(compiler, cwd=folder, check=True)
    return (folder / "mine.so").read_bytes()


def example(path: Path, folder: Path) -> Path:
    """The FMU of docs/controller-fmu.md, with its description."""
    (text,) = re.findall(r"```xml\n(.*?)```", (ROOT / "docs/controller-fmu.md").read_text(), re.DOTALL)
    return pack(path, text, library(folder))


def pack(
    path: Path, description: str | bytes, binary: bytes | None = None, *, prefix: str = "", platform: str = "linux64"
) -> Path:
    """An FMU; `prefix` is before the name of each entry."""
    with zipfile.ZipFile(path, "w") as files:
        files.writestr(f"{prefix}modelDescription.xml", description)
        if binary is not None:
            files.writestr(f"{prefix}binaries/{platform}/mine.so", binary)
    return path


def describe(
    root: str = "",
    before: str = UNITS,
    interface: str = 'canHandleVariableCommunicationStepSize="true"',
    variable: str = "",
    inside: str = "",
    after: str = "",
    units: dict[str, str] | None = None,
) -> str:
    """The description of the controller, with what a tool adds; `inside`: elements after the type of a variable."""
    rows = []
    for name, reference, causality, kind, unit in VARIABLES:
        start = (
            ' start="0.0"' if causality == "input" and kind == "Real" else ' start="0"' if causality == "input" else ""
        )
        unit = (units or {}).get(name, unit)
        unit = f' unit="{unit}"' if unit else ""
        discrete = ' variability="discrete"' if kind == "Boolean" else ""
        rows.append(
            f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}"{discrete} {variable}>'
            f"<{kind}{unit}{start}/>{inside}</ScalarVariable>"
        )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="2.0" modelName="mine" guid="{{mine-1}}" {root}>'
        f'<CoSimulation modelIdentifier="mine" {interface}/>{before}'
        f"<ModelVariables>{''.join(rows)}{after}</ModelVariables>{STRUCTURE}</fmiModelDescription>"
    )


ANNOTATIONS = """<Annotations><Tool name="%s"><Element xmlns="urn:tool"><ScalarVariable/><![CDATA[<x>]]></Element>
  </Tool>  </Annotations>"""
VENDOR = '<VendorAnnotations><Tool name="%s"><%s a="1"><Deep><ScalarVariable/></Deep></%s></Tool></VendorAnnotations>'
EXPERIMENT = '<DefaultExperiment startTime="0.0" stopTime="1.0E+01" tolerance="1E-4"/>'
MODES = """<TypeDefinitions><SimpleType name="Mode"><Enumeration quantity="mode"><Item name="off" value="0"/>
  <Item name="on" value="1" description="&lt;running&gt;"/></Enumeration></SimpleType>
  <SimpleType name="Modelica.Length"><Real quantity="Length" unit="m" displayUnit="mm" min="-INF" max="INF"/>
  </SimpleType></TypeDefinitions>"""
MODE = """<ScalarVariable name="mode" valueReference="6" causality="local" variability="discrete">
  <Enumeration declaredType="Mode"/></ScalarVariable>"""
ALIAS = """<ScalarVariable name="alias.omega" valueReference="3" causality="local">
  <Real unit="rad/s" min="-1.79769313486232E+308"/>
  </ScalarVariable>"""
# Descriptions as these tools write them: their attributes, order, namespaces, annotations and forms of numbers.
TOOLS = {
    "Dymola": describe(
        f'{XSI} xsi:noNamespaceSchemaLocation="fmi2ModelDescription.xsd" generationTool="Dymola Version 2024x" '
        'generationDateAndTime="2024-02-01T10:00:00Z" variableNamingConvention="structured" '
        'numberOfEventIndicators="0"',
        UNITS + MODES + EXPERIMENT + VENDOR % ("Dymola", "Experiment", "Experiment"),
        'needsExecutionTool="false" canHandleVariableCommunicationStepSize="true" canInterpolateInputs="1" '
        'maxOutputDerivativeOrder="1" canRunAsynchronuously="0" providesDirectionalDerivative="true"',
        'canHandleMultipleSetPerTimeInstant="false"',
        after=MODE,
    ),
    "Simulink (FMIKit)": describe(
        'generationTool="Simulink (R2023b) with FMI Kit 3.1" description="" author="&#220;."',
        UNITS + EXPERIMENT,
        'canHandleVariableCommunicationStepSize="true" canBeInstantiatedOnlyOncePerProcess="true"',
    ),
    "Simulink": describe(
        'generationTool="Simulink (R2024a)" variableNamingConvention="structured" version="1.7"',
        UNITS + MODES + EXPERIMENT + VENDOR % ("Simulink", "Simulink", "Simulink"),
        inside=ANNOTATIONS % "Simulink",
        after=MODE,
    ),
    "OpenModelica": describe(
        'generationTool="OpenModelica Compiler v1.23" variableNamingConvention="structured" license="&#10;x"',
        UNITS + MODES + '<LogCategories><Category name="logEvents"/></LogCategories>' + EXPERIMENT,
        'needsExecutionTool="false" canGetAndSetFMUstate="true" canSerializeFMUstate="false"',
        'isValueChangeable="true"',
        after=ALIAS,
    ),
    "PythonFMU": describe(
        'generationTool="PythonFMU 0.7.0" author=""', UNITS, 'needsExecutionTool="true" canInterpolateInputs="false"'
    ),
    "fmu4cpp": describe('generationTool="fmu4cpp"', UNITS + '<DefaultExperiment startTime="0" stepSize=".001"/>'),
    "20-sim": describe(
        'generationTool="20-sim" description="a&#xA;b"',
        UNITS + EXPERIMENT + VENDOR % ("20-sim", "x:y xmlns:x='urn:x'", "x:y"),
    ).replace("<ModelVariables>", "<!-- variables --><ModelVariables><?tool hint?>"),
    "MapleSim": describe(
        'generationTool="MapleSim 2023" copyright="(c)" numberOfEventIndicators=" 0 "', UNITS + EXPERIMENT, after=ALIAS
    ).replace('valueReference="3"', 'valueReference=" 3 "'),
}


def attributes(random: Random, table: dict[str, list[str]], *needed: str) -> str:
    """Some attributes of a table, and all that are needed, in any order."""
    names = [name for name in table if name in needed or random.random() < 0.4]
    random.shuffle(names)
    return "".join(
        f"{random.choice([' ', chr(10), '  '])}{name}={quoteattr(random.choice(table[name]))}" for name in names
    )


WHOLE = ["0", " 1 ", "+7", "-12", "007", "2147483647", "-2147483648"]
COUNT = ["0", " 1 ", "+7", "007", "4294967295", "-0"]
REAL = ["0", "1.5", "-1E-3", ".5", "5.", " 1e5 ", "INF", "-INF", "NaN", "+2.0e+2", "1E400", "-0"]
TRUTH = ["true", "false", "1", "0", " true "]
TEXT = ["", "x", "a b", " spaces  inside ", "ümläut µm", "<&>\"'", "line\nbreak", "3", "true", "日本"]
# Names of units, which a description has to define.
NAMED = ["u", " spaces  inside ", "µ·<&>\"'", "3"]
TYPED = {
    "Real": {"quantity": TEXT, "unit": NAMED, "relativeQuantity": TRUTH, "min": REAL}
    | {"max": REAL, "nominal": REAL, "unbounded": TRUTH},
    "Integer": {"quantity": TEXT, "min": WHOLE, "max": WHOLE},
    "Boolean": {},
    "String": {},
}
# Combinations that the standard allows, and whether they need a start value.
ROLES = [
    ("causality='parameter' variability='fixed'", True),
    ("variability='tunable' causality='parameter' initial='exact'", True),
    ("causality='calculatedParameter' variability='fixed' initial='approx'", True),
    ("causality='calculatedParameter' variability='tunable'", False),
    ("causality='input' variability='discrete'", True),
    ("variability='continuous' causality='input'", True),
    ("causality='output' variability='continuous'", False),
    ("causality='output' variability='discrete' initial='calculated'", False),
    ("causality='local' variability='discrete' initial='exact'", True),
    ("initial='approx' variability='continuous'", True),
    ("variability='constant'", True),
]
STARTS = {"Real": REAL, "Integer": WHOLE, "Boolean": TRUTH, "String": TEXT, "Enumeration": WHOLE}


def several(random: Random, make, least: int = 1) -> str:
    return "".join(make() for _ in range(random.randint(least, 3)))


def maybe(random: Random, text: str) -> str:
    gap = random.choice(["", "\n\t", "<!-- <Real/> -->", "<?tool hint?>"])
    return gap + text if random.random() < 0.5 else gap


def drawn(random: Random) -> str:
    """A description that the schema accepts."""
    flags = ["needsExecutionTool", "canBeInstantiatedOnlyOncePerProcess", "canNotUseMemoryManagementFunctions"]
    flags += ["canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative"]
    interface = {"modelIdentifier": ["mine"]} | dict.fromkeys(flags, TRUTH)
    more = ("canHandleVariableCommunicationStepSize", "canInterpolateInputs", "canRunAsynchronuously")
    exchanges = interface | {"completedIntegratorStepNotNeeded": TRUTH}
    source = "<SourceFiles><File name='a.c'/></SourceFiles>"
    exchange = (
        f"<ModelExchange{attributes(random, exchanges, 'modelIdentifier')}>{maybe(random, source)}</ModelExchange>"
    )
    both = interface | dict.fromkeys(more, TRUTH) | {"maxOutputDerivativeOrder": COUNT}
    coupled = f"<CoSimulation{attributes(random, both, 'modelIdentifier')}>{maybe(random, source)}</CoSimulation>"
    base = dict.fromkeys(("kg", "m", "s", "A", "K", "mol", "cd", "rad"), WHOLE) | {"factor": REAL, "offset": REAL}
    names, mode = iter(range(1000)), "M"

    mode_type = f"<SimpleType name='{mode}'><Enumeration><Item name='off' value='0'/></Enumeration></SimpleType>"

    def unit(name: str) -> str:
        display = f"<DisplayUnit name='d{next(names)}'{attributes(random, {'factor': REAL, 'offset': REAL})}/>"
        exponents = f"<BaseUnit{attributes(random, base)}/>"
        return f"<Unit name={quoteattr(name)}>{maybe(random, exponents)}{maybe(random, display)}</Unit>"

    def declared() -> str:
        kind = random.choice([*TYPED, "Enumeration"])
        content = f"<{kind}{attributes(random, TYPED.get(kind, {'quantity': TEXT}))}"
        items = several(random, lambda: f"<Item name='i{next(names)}' value='{next(names)}'/>")
        content += f">{items}</Enumeration>" if kind == "Enumeration" else "/>"
        return f"<SimpleType name='t{next(names)}'{attributes(random, {'description': TEXT})}>{content}</SimpleType>"

    def annotations(element: str) -> str:
        inside = random.choice(["", "<a:b xmlns:a='urn:a'><Real/><![CDATA[<&]]></a:b>", "<x><y><z/></y></x>"])
        tools = several(random, lambda: f"<Tool name='v{next(names)}'>{inside}</Tool>")
        return f"<{element}>{tools}</{element}>"

    def variable() -> str:
        kind = random.choice(list(STARTS))
        own = TYPED.get(kind, {"quantity": TEXT, "min": WHOLE, "max": WHOLE}) | {"start": STARTS[kind]}
        own |= {"reinit": TRUTH} if kind == "Real" else {}
        declares = f" declaredType='{mode}'" if kind == "Enumeration" else ""
        role, starts = random.choice(ROLES if kind == "Real" else [row for row in ROLES if "continuous" not in row[0]])
        head = f"<ScalarVariable name='v{next(names)}' valueReference='{random.choice(COUNT)}' {role}"
        head += attributes(random, {"description": TEXT, "canHandleMultipleSetPerTimeInstant": TRUTH}) + ">"
        own = attributes(random, own, *(["start"] if starts else [])) if starts or own.pop("start") else ""
        return f"{head}<{kind}{declares}{own}/>{maybe(random, annotations('Annotations'))}</ScalarVariable>"

    def unknown() -> str:
        # FMPy itself reads lists with single spaces only.
        kinds = {"dependencies": ["1", "1 1"], "dependenciesKind": ["dependent", "constant fixed", "tunable discrete"]}
        return f"<Unknown index='{random.choice(['1', ' 1 ', '+1', '001'])}'{attributes(random, kinds)}/>"

    structure = "".join(
        maybe(random, f"<{key}>{several(random, unknown)}</{key}>")
        for key in ("Outputs", "Derivatives", "InitialUnknowns")
    )
    experiment = dict.fromkeys(("startTime", "stopTime", "tolerance", "stepSize"), REAL)
    root = {
        "description": TEXT,
        "author": TEXT,
        "version": TEXT,
        "copyright": TEXT,
        "license": TEXT,
        "generationTool": TEXT,
    }
    root |= {"generationDateAndTime": ["2024-02-01T10:00:00Z"], "variableNamingConvention": ["flat", "structured"]}
    root |= {"numberOfEventIndicators": COUNT, "modelName": TEXT, "guid": TEXT}
    schema = random.choice(["", f' {XSI} xsi:noNamespaceSchemaLocation="fmi2ModelDescription.xsd"'])
    category = f"<Category name='c{next(names)}'{attributes(random, {'description': TEXT})}/>"
    return (
        random.choice(["", "<!-- made -->"])
        + f"<fmiModelDescription fmiVersion='2.0'{schema}{attributes(random, root, 'modelName', 'guid')}>"
        + random.choice([coupled, exchange + coupled, coupled + exchange, coupled + coupled])
        + f"<UnitDefinitions>{''.join(map(unit, NAMED))}</UnitDefinitions>"
        + f"<TypeDefinitions>{mode_type}{several(random, declared, 0)}</TypeDefinitions>"
        + maybe(random, f"<LogCategories>{category}</LogCategories>")
        + maybe(random, f"<DefaultExperiment{attributes(random, experiment)}/>")
        + maybe(random, annotations("VendorAnnotations"))
        + f"<ModelVariables>{several(random, variable)}</ModelVariables><ModelStructure>{structure}</ModelStructure>"
        + "</fmiModelDescription>"
    )


def damaged(random: Random, text: str) -> bytes:
    """The description with a fault that no reader can pass over."""
    cut = random.randrange(1, len(text) - 1)
    faults = [
        lambda: text[:cut].encode(),
        lambda: text.replace("</ModelVariables>", "", 1).encode(),
        lambda: re.sub(r"valueReference='[^']*'", "valueReference='x'", text, count=1).encode(),
        lambda: re.sub(r" valueReference='[^']*'", "", text, count=1).encode(),
        lambda: re.sub("guid=", "gid=", text, count=1).encode(),
        lambda: text.replace("<ModelVariables>", "<ModelVariables>&nothing;", 1).encode(),
        lambda: text.replace("<ModelVariables>", "<ModelVariables><", 1).encode(),
        lambda: b"<?xml version='1.0' encoding='klingon'?>" + text.encode(),
        lambda: text.replace("fmiModelDescription", "html").encode(),
        lambda: text.replace("fmiVersion='2.0'", f"fmiVersion='{random.choice(['1.0', '3.0', ''])}'", 1).encode(),
        lambda: b"",
        lambda: bytes(random.randrange(256) for _ in range(cut)),
        lambda: ("<a>" * 100_000).encode(),
    ]
    return random.choice(faults)()
