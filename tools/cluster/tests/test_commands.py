"""Studies and benchmarks over a cluster have the rows of one machine's."""

import json

import pytest

from brickwalk_cluster import Cluster, Failed
from brickwalk_cluster.command import parser
from brickwalk_cluster.command import run as command
from brickwalk_cluster.commands import merge, split


def rows(folder):
    first, *lines = (folder / "rows.jsonl").read_text().splitlines()
    return json.loads(first), [json.loads(line) for line in lines]


def named(row):
    """What tells a measurement from others."""
    return json.dumps([row[name] for name in ("view", "effect", "method", "settings", "cache_bytes", "cold")])


def test_options_are_split():
    rest, option, values, output = split("study", ["s.bricks", "--quick", "-o", "out", "--effects=ao,shadow"])
    assert (rest, option, values, str(output)) == (["s.bricks", "--quick"], "--effects", ["ao", "shadow"], "out")
    assert len(split("bench roma", ["--output=out"])[2]) == 8
    with pytest.raises(Failed, match="-o DIR"):
        split("study", ["s.bricks"])
    with pytest.raises(Failed, match="--effects: a value"):
        split("study", ["s.bricks", "--effects"])


def test_a_study_has_the_rows_of_one_machine(city, run, tmp_path, capfd):
    options = ["--quick", "--size", "32x18", "--samples", "2", "--repeat", "1", "--effects", "ao,diffuse"]
    options += ["--caches", "100", "--adapter", "cpu"]
    run("study", city, "-o", tmp_path / "whole", *options)
    line = ["study", str(city), "-o", str(tmp_path / "out"), *options, "--workers", "2", "-q"]
    assert command(line) == 0, capfd.readouterr().err
    (header, own), (truth_header, truth) = rows(tmp_path / "out"), rows(tmp_path / "whole")
    assert header == truth_header
    assert sorted(map(named, own)) == sorted(map(named, truth)) and len(own) > 4
    # Errors do not depend on who measures, times do.
    errors = {named(row): row["flip_same"] for row in truth}
    assert {named(row): row["flip_same"] for row in own} == errors
    for name in ("study.json", "study.csv", "report.html"):
        assert (tmp_path / "out" / name).exists()
    # A rerun measures nothing.
    before = (tmp_path / "out" / "rows.jsonl").read_text()
    assert command(line) == 0
    assert sorted((tmp_path / "out" / "rows.jsonl").read_text().splitlines()) == sorted(before.splitlines())


def test_rows_of_other_devices_are_refused(tmp_path):
    for number, name in enumerate(["one", "other"]):
        folder = tmp_path / str(number)
        folder.mkdir()
        head = json.dumps({"format": 1, "settings": {}, "adapter": {"name": name}, "commit": "1"})
        (folder / "rows.jsonl").write_text(head + "\n" + json.dumps({"row": number}) + "\n")
    with pytest.raises(Failed, match="another adapter"):
        merge(tmp_path / "out", [tmp_path / "0", tmp_path / "1"])
    assert merge(tmp_path / "out", [tmp_path / "0"]) == 1
    assert merge(tmp_path / "out", [tmp_path / "0"]) == 1


def test_a_conversion_has_the_bytes_of_one_machine(run, tmp_path, capfd):
    model = tmp_path / "squares.obj"
    rows = [f"v {x} {(x * y) % 7} {y}" for y in range(60) for x in range(60)]
    corners = [(60 * y + x + 1, 60 * y + x + 2, 60 * y + x + 62) for y in range(59) for x in range(59)]
    model.write_text("\n".join([*rows, *(f"f {a} {b} {c}" for a, b, c in corners)]) + "\n")
    run("convert", model, "-o", tmp_path / "one.bricks", "--brick-triangles", "500", "--lod", "on")
    line = ["convert", str(model), "-o", str(tmp_path / "many.bricks"), "--brick-triangles", "500", "--lod", "on"]
    assert command([*line, "--workers", "2", "-q"]) == 0, capfd.readouterr().err
    assert (tmp_path / "many.bricks").read_bytes() == (tmp_path / "one.bricks").read_bytes()
    assert command(["convert", "none.obj", "-o", str(tmp_path / "a.bricks"), "--workers", "1"]) == 1
    assert "none.obj" in capfd.readouterr().err
    with pytest.raises(SystemExit):
        command([*line, "--nonsense"])


def test_what_a_part_says_is_passed_on(tmp_path, program, capfd):
    with Cluster(workers=1):
        pass
    line = ["study", "none.bricks", "-o", str(tmp_path / "out"), "--effects", "ao", "--workers", "1", "-q"]
    assert command(line) == 1
    said = capfd.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("brickwalk-cluster: ") and "none.bricks" in said


def test_counts_may_be_thousands():
    words = ["convert", "a.glb", "-o", "a.bricks", "--brick-triangles"]
    for text, count in [("7", 7), ("16K", 16_000), ("1M", 1_000_000)]:
        assert parser().parse_args([*words, text]).brick_triangles == count
    for wrong in ["0", "2M", "1.5K", "-1", "K", "\u0663"]:
        with pytest.raises(SystemExit):
            parser().parse_args([*words, wrong])
