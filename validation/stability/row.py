"""What a row of the campaign says."""

from dataclasses import dataclass, field


@dataclass
class Row:
    naive: str  #: how the naive method fails, with numbers
    answer: str  #: what the program does about it, with numbers
    checks: dict = field(default_factory=dict)  #: sentence -> whether it holds

    def passes(self):
        return all(self.checks.values())
