"""What ``brickwalk jobs`` prints runs: each line by itself, and the template by Open Job Description's own tool."""

import json
import os
import random
import shutil
import subprocess
import sys

import pytest
from conftest import frames

VIEW = ["--frames", "5", "--size", "48x27", "--adapter", "cpu"]


@pytest.fixture
def whole(city, run, tmp_path):
    run("walk", city, "-o", tmp_path / "whole", *VIEW)
    return frames(tmp_path / "whole")


def jobs(program, form, city, output, folder):
    line = [program, "jobs", "--format", form, "--chunk", "2", "--", "-q", "walk", str(city), "-o", output, *VIEW]
    return subprocess.run(line, cwd=folder, check=True, stdout=subprocess.PIPE, text=True).stdout


def environment(program):
    return {**os.environ, "PATH": os.pathsep.join([os.path.dirname(program), os.environ["PATH"]])}


def test_each_line_runs_by_itself(city, program, whole, tmp_path):
    lines = jobs(program, "lines", city, "it's out", tmp_path).splitlines()
    assert len(lines) == 4
    *parts, join = lines
    random.Random(5).shuffle(parts)
    for line in parts:
        subprocess.run(["sh", "-c", line], cwd=tmp_path, env=environment(program), check=True)
    assert len(list((tmp_path / "it's out" / "parts").iterdir())) == 5
    subprocess.run(["sh", "-c", join], cwd=tmp_path, env=environment(program), check=True)
    assert frames(tmp_path / "it's out") == whole
    # The last line alone renders all of it.
    shutil.rmtree(tmp_path / "it's out")
    subprocess.run(["sh", "-c", join], cwd=tmp_path, env=environment(program), check=True)
    assert frames(tmp_path / "it's out") == whole


def test_bands_are_lines_of_their_own(city, program, run, tmp_path):
    view = ["--size", "64x128", "--bands", "2", "--frames", "1", "--quality", "draft", "--adapter", "cpu"]
    run("walk", city, "-o", tmp_path / "whole", *view)
    line = [program, "jobs", "--format", "lines", "--chunk", "1", "--", "-q", "walk", str(city), "-o", "out", *view]
    lines = subprocess.run(line, cwd=tmp_path, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    assert [line.split()[-2:] for line in lines[:-1]] == [["--part", "0"], ["--part", "1"]]
    for line in reversed(lines[:-1]):
        subprocess.run(["sh", "-c", line], cwd=tmp_path, env=environment(program), check=True)
    subprocess.run(["sh", "-c", lines[-1]], cwd=tmp_path, env=environment(program), check=True)
    assert frames(tmp_path / "out") == frames(tmp_path / "whole")
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["parts"]["joined"] == 2


def test_the_template_is_checked_and_runs(city, program, whole, tmp_path):
    tool = shutil.which("openjd") or os.path.join(os.path.dirname(sys.executable), "openjd")
    template = tmp_path / "job.json"
    template.write_text(jobs(program, "openjd", city, "out", tmp_path))
    check = subprocess.run([tool, "check", str(template)], capture_output=True, text=True)
    assert check.returncode == 0, check.stdout + check.stderr
    line = [tool, "run", str(template), "--step", "Join", "--run-dependencies"]
    done = subprocess.run(line, env=environment(program), capture_output=True, text=True, cwd="/")
    assert done.returncode == 0, done.stdout + done.stderr
    assert frames(tmp_path / "out") == whole
    # The control: the tool notices a template that is none.
    other = json.loads(template.read_text())
    del other["steps"][0]["script"]
    template.write_text(json.dumps(other))
    assert subprocess.run([tool, "check", str(template)], capture_output=True).returncode != 0
