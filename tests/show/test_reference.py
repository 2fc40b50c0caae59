"""The reference of all files says everything, and what is committed of it is what it says."""

import json
import re

import pytest
import yaml

from sdt_drake.cli.app import main
from sdt_drake.io.resources import models_dir
from sdt_drake.io.schema import parts
from sdt_drake.run.recording import Recording
from sdt_drake.show.reference import FILES, SCHEMAS, TOPICS, schema_text, with_reference

MODELS = models_dir()


class Yaml12(yaml.SafeLoader):
    """As editors read it: 1e3 is a number; tags, which JSON does not have, are left out."""


Yaml12.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$"),
    list("-+.0123456789"),
)
Yaml12.add_multi_constructor(
    "!", lambda loader, tag, node: loader.construct_mapping(node, deep=True)
)


@pytest.mark.parametrize("schema", [*FILES.values(), Recording])
def test_reference_has_meaning_of_every_field_and_unit_of_every_number(schema):
    rows = [entry for part in parts(schema) for entry in part.entries]
    assert [row.name for row in rows if len(row.meaning) < 4] == []
    assert [row.name for row in rows if "number" in row.takes and not row.unit] == []
    of_a_side = [x for x in rows if re.match(r"(N m( s)?(/rad)?|kg m²|deg\S*|rad)(,|$)", x.unit)]
    assert [row.name for row in of_a_side if not row.unit.endswith("side")] == []


def test_committed_reference_equals_the_command():
    page = (MODELS / "README.md").read_text(encoding="utf-8")
    assert with_reference(page, "models/README.md") == page
    for topic in FILES:
        assert (MODELS / SCHEMAS / f"{topic}.json").read_text("utf-8") == schema_text(topic)
    # The tags that editors have to be told.
    schemas = "".join(TOPICS[topic]().markdown() for topic in FILES)
    tags = set(re.findall(r"`(!\w+)`", schemas))
    assert set(re.findall(r'"(!\w+) mapping"', page)) == tags and len(tags) == 14


def test_reference_command_prints_and_writes_all_topics(tmp_path, capsys):
    for topic in TOPICS:
        assert main(["docs", "files", topic]) == 0
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    assert "  controller.omega_r: a number > 0 [rad/s]; default none\n" in out
    assert main(["docs", "files"]) == 0 and "scenario " in capsys.readouterr().out
    assert main(["docs", "files", "--out", str(tmp_path / "all")]) == 0
    assert main(["docs", "files", "--out", str(tmp_path / "all")]) == 0  # again
    assert len(list((tmp_path / "all").rglob("*.json"))) == len(FILES)
    assert main(["docs", "files", "motion", "--out", str(tmp_path / "motion.json")]) == 0
    assert json.loads((tmp_path / "motion.json").read_text())["required"] == ["duration"]
