"""What a record holds: named float64 fields with units, and their message definition as other programs read it.

A record is float64 throughout, scalars and arrays of fixed length, one behind the other. On disk it is a ROS 2 message
("ros2msg" definition, "cdr" encoding), which for such records is the four bytes of CDR_HEADER and the numbers as they
lie in memory; Foxglove and the ROS tools open it as it is.
"""

import json
import re
from dataclasses import asdict, dataclass

CDR_HEADER = b"\x00\x01\x00\x00"  # little-endian CDR, no options
SCHEMA_ENCODING = "ros2msg"
MESSAGE_ENCODING = "cdr"

EVENTS_TOPIC = "/events"
RECORDING = "recording"  # metadata entry that the parts of one recording share, and no other recording has
# Severities of rcl_interfaces/msg/Log.
DEBUG, INFO, WARN, ERROR, FATAL = 10, 20, 30, 40, 50

_NAME = re.compile(r"[a-z](_?[a-z0-9])*\Z")
_TYPE = re.compile(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*\Z")
_TOPIC = re.compile(r"/[a-z][a-z0-9_/]*\Z")
_LINE = re.compile(r"float64(?:\[(\d+)\])?\s+(\w+)\s*(?:#\s*(?:\[(.*?)\]\s?)?(.*))?\Z")


@dataclass(frozen=True)
class Field:
    """One field: name as in ROS (lower case, digits, single underscores), unit ('1' for none), what it is."""

    name: str
    unit: str
    description: str = ""
    count: int = 0  # 0: a scalar; n: an array of n

    def __post_init__(self):
        if not _NAME.match(self.name):
            raise ValueError(f"field {self.name!r}: expected lower case letters, digits and single underscores")
        if self.count < 0:
            raise ValueError(f"field {self.name!r}: count {self.count} is negative")
        if any(c in self.unit + self.description for c in "\r\n#") or set("[]") & set(self.unit):
            raise ValueError(f"field {self.name!r}: no line break, '#' or bracket in a unit or description")

    @property
    def width(self) -> int:
        """Places it takes in a record."""
        return self.count or 1


@dataclass(frozen=True)
class RecordSpec:
    """A kind of record: where it goes and what stands in it, in order.

    `spare` records are the first not to be recorded when the disk cannot follow (a simulation's truth, debugging).
    """

    topic: str
    schema_name: str  # "glider_msgs/msg/Tick"
    fields: tuple[Field, ...]
    spare: bool = False

    def __post_init__(self):
        object.__setattr__(self, "fields", tuple(self.fields))
        if not _TOPIC.match(self.topic) or self.topic == EVENTS_TOPIC:
            raise ValueError(f"topic {self.topic!r}: expected /lower_case and not {EVENTS_TOPIC}")
        if not _TYPE.match(self.schema_name):
            raise ValueError(f"schema name {self.schema_name!r}: expected package/msg/Type")
        names = [field.name for field in self.fields]
        if not names or len(set(names)) < len(names):
            raise ValueError(f"{self.topic}: fields missing or named twice")

    @property
    def width(self) -> int:
        """Numbers in a record."""
        return sum(field.width for field in self.fields)

    def index(self, name: str) -> int:
        """Place of a field's (first) number in a record; KeyError for a name that is not there."""
        place = 0
        for field in self.fields:
            if field.name == name:
                return place
            place += field.width
        raise KeyError(f"{self.topic} has no field {name!r}")

    def text(self) -> str:
        """The message definition, ros2msg, units and descriptions as comments."""
        lines = []
        for field in self.fields:
            kind = f"float64[{field.count}]" if field.count else "float64"
            lines.append(f"{kind} {field.name}  # [{field.unit}] {field.description}".rstrip())
        return "\n".join(lines) + "\n"


def parse_fields(text: str) -> tuple[Field, ...] | None:
    """The fields of a message definition; None where it is not one of float64 scalars and fixed arrays alone."""
    fields = []
    for line in text.splitlines():
        line = line.strip()
        if not line or line.startswith("#"):
            continue
        match = _LINE.match(line)
        if not match:
            return None
        count, name, unit, description = match.groups()
        try:
            fields.append(Field(name, unit or "", (description or "").strip().replace("#", ""), int(count or 0)))
        except ValueError:
            return None
    return tuple(fields) or None


def specs_to_json(specs: tuple[RecordSpec, ...] | list[RecordSpec]) -> str:
    """Specs as JSON text, for the recording process and for the log itself."""
    return json.dumps([asdict(spec) for spec in specs])


def specs_from_json(text: str) -> list[RecordSpec]:
    """The inverse of specs_to_json; ValueError, TypeError or KeyError where it is something else."""
    return [
        RecordSpec(item["topic"], item["schema_name"], tuple(Field(**field) for field in item["fields"]), item["spare"])
        for item in json.loads(text)
    ]


LOG_SCHEMA_NAME = "rcl_interfaces/msg/Log"
LOG_SCHEMA = """\
byte DEBUG=10
byte INFO=20
byte WARN=30
byte ERROR=40
byte FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
