"""Findings in the formats that CI services show: JUnit XML and SARIF 2.1.0."""

import json
from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree import ElementTree

from viewer.checking.findings import Finding
from viewer.checking.record import MEASURES, Record, Subject, measured
from viewer.scene.json_text import printable

SARIF_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
RULES: Mapping[str, str] = {
    "limit": "A measured value lies beyond its limit in the budget.",
    "worse": "A measured value is worse than in the accepted report.",
    "gone": "A texture of the accepted report is missing.",
}


def junit_xml(record: Record, findings: Sequence[Finding]) -> bytes:
    """Return JUnit XML with a suite for each kind of subject and a case for each subject. Waived findings are skipped tests."""
    by_subject: dict[Subject, list[Finding]] = {}
    for finding in findings:
        by_subject.setdefault(finding.subject, []).append(finding)
    subjects = [subject for subject, _ in measured(record)]
    subjects += [subject for subject in by_subject if subject not in set(subjects)]
    root = ElementTree.Element("testsuites", name="ntc-viewer check")
    for kind in dict.fromkeys(subject.kind for subject in subjects):
        suite = ElementTree.SubElement(root, "testsuite", name=kind)
        failed = skipped = 0
        cases = [subject for subject in subjects if subject.kind == kind]
        for subject in cases:
            case = ElementTree.SubElement(suite, "testcase", classname=kind, name=printable(subject.text))
            failing = [printable(each.text) for each in by_subject.get(subject, ()) if not each.is_waived]
            waived = [printable(each.text) for each in by_subject.get(subject, ()) if each.is_waived]
            if failing:
                failed += 1
                ElementTree.SubElement(case, "failure", message=failing[0]).text = "\n".join(failing)
            elif waived:
                skipped += 1
                ElementTree.SubElement(case, "skipped", message=waived[0])
        suite.attrib |= {"tests": str(len(cases)), "failures": str(failed), "skipped": str(skipped), "errors": "0"}
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def sarif_json(record: Record, findings: Sequence[Finding], version: str) -> bytes:
    """Return the findings as SARIF: errors, and notes for waived ones. The location of each is the pack's file."""
    packs = {texture.name: texture.pack for texture in record.textures}
    results: list[dict[str, Any]] = []
    for finding in findings:
        place = packs.get(finding.subject.name) or record.source
        result: dict[str, Any] = {
            "ruleId": finding.kind,
            "level": "note" if finding.is_waived else "error",
            "message": {"text": printable(finding.text)},
            "locations": [
                {
                    "physicalLocation": {"artifactLocation": {"uri": place.replace("\\", "/")}},
                    "logicalLocations": [{"name": printable(finding.subject.text), "kind": finding.subject.kind}],
                }
            ],
            "partialFingerprints": {"subject": f"{finding.kind}:{finding.subject.text}:{finding.measure}"},
        }
        if finding.measure is not None:
            result["properties"] = {
                "measure": MEASURES[finding.measure].heading,
                "value": finding.value,
                "bound": finding.bound,
            }
        if finding.is_waived and finding.waiver is not None:
            result["suppressions"] = [{"kind": "external", "justification": printable(finding.waiver.reason)}]
        results.append(result)
    rules = [{"id": name, "shortDescription": {"text": text}} for name, text in RULES.items()]
    driver = {"name": "ntc-viewer", "version": version, "rules": rules}
    document = {"$schema": SARIF_SCHEMA, "version": "2.1.0", "runs": [{"tool": {"driver": driver}, "results": results}]}
    return json.dumps(document, indent=1, allow_nan=False).encode() + b"\n"
