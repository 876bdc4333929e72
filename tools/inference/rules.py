"""What a diagnosis may use: all of it, or, to see what each part is worth, all but one."""

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Rules:
    """Each is one idea of docs/explanation/diagnosis.md, left out where False."""

    nuisance: bool = True  # parameters within [uncertainty] and biases are free in every fit
    splice: bool = True  # measurements hold the flight to its course; without, windows fly on commands alone
    whiteness: bool = True  # what is left is tested; without, no gap is ever unknown
    evidence: bool = True  # labels compared by evidence; without, by the gap on runs left out alone

    def without(self, part: str) -> "Rules":
        """These rules less one part."""
        return replace(self, **{part: False})
