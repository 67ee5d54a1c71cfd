"""Findings of a check: values beyond their limits, values worse than accepted ones, and exceptions that cover them."""

import datetime
from dataclasses import dataclass
from typing import Literal

from viewer.checking.budget import Budget, Waiver
from viewer.checking.record import MEASURES, MeasureName, Record, Subject, Values, measured

FindingKind = Literal["limit", "worse", "gone"]
RANK: dict[FindingKind, int] = {"limit": 0, "worse": 1, "gone": 2}


@dataclass(frozen=True)
class Finding:
    """Value that fails a check, unless an exception covers it."""

    kind: FindingKind
    """limit: beyond the budget's limit. worse: worse than the accepted value. gone: a texture of the accepted record is missing."""
    subject: Subject
    measure: MeasureName | None = None
    value: float = 0.0
    bound: float = 0.0
    """Limit, or accepted value."""
    excess: float = 0.0
    """Distance beyond the limit or the allowed loss, as a share of it."""
    waiver: Waiver | None = None
    """Exception that covers the value."""
    is_waived: bool = False
    """True until the exception ends: the finding does not fail the check."""

    @property
    def text(self) -> str:
        """Text of the finding, one line."""
        if self.measure is None:
            return f"{self.subject.text}: was accepted, and is not there any more"
        measure = MEASURES[self.measure]
        value, bound = measure.text(self.value), measure.text(self.bound)
        side = "at least" if measure.higher_is_better else "at most"
        reference = f"limit {side} {bound}" if self.kind == "limit" else f"accepted {bound}"
        line = f"{self.subject.text}: {measure.title} {value}, {reference}"
        if self.waiver is None:
            return line
        until = f"exception {'until' if self.is_waived else 'ended on'} {self.waiver.until}: {self.waiver.reason}"
        return f"{line} ({until})"


def find(record: Record, budget: Budget, accepted: Record | None, today: datetime.date) -> tuple[Finding, ...]:
    """Return the values in `record` that exceed a limit of `budget` or are worse than in `accepted`: failures first, worst first."""
    accepted_values = measured(accepted) if accepted is not None else ()
    before = {_identity(subject): values for subject, values in accepted_values}
    findings: list[Finding] = []
    seen = set()
    for subject, values in measured(record):
        seen.add(_identity(subject))
        findings += _of_subject(subject, values, before.get(_identity(subject), {}), budget)
    if accepted is not None:
        findings += [
            Finding("gone", subject)
            for subject, _ in measured(accepted)
            if subject.kind == "texture" and _identity(subject) not in seen
        ]
    waived = [_with_waiver(finding, budget, today) for finding in findings]
    return tuple(sorted(waived, key=lambda each: (each.is_waived, RANK[each.kind], -each.excess, each.subject.text)))


def _identity(subject: Subject) -> tuple[str, str, int, str | None]:
    """Return the key of a subject for comparison between records. Packs have the same key whatever their source."""
    return subject.kind, "" if subject.kind == "pack" else subject.name, subject.number, subject.map


def _of_subject(subject: Subject, values: Values, before: Values, budget: Budget) -> list[Finding]:
    findings: list[Finding] = []
    for name, value in values.items():
        measure, limit = MEASURES[name], budget.limit(subject, name)
        if limit is not None and measure.violates(value, limit):
            findings.append(Finding("limit", subject, name, value, limit, abs(value - limit) / max(abs(limit), 1e-12)))
        if name in before:
            loss, allowed = measure.loss(value, before[name]), budget.allowed_loss(name)
            if loss > allowed + 1e-9:
                findings.append(Finding("worse", subject, name, value, before[name], loss / max(allowed, 1e-12)))
    return findings


def _with_waiver(finding: Finding, budget: Budget, today: datetime.date) -> Finding:
    if finding.measure is None:
        return finding
    waivers = [each for each in budget.exception if each.covers(finding.subject, finding.measure)]
    if not waivers:
        return finding
    latest = max(waivers, key=lambda each: each.until)
    return Finding(
        finding.kind,
        finding.subject,
        finding.measure,
        finding.value,
        finding.bound,
        finding.excess,
        latest,
        latest.until >= today,
    )


def failures(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Return the findings that no exception covers."""
    return tuple(each for each in findings if not each.is_waived)
