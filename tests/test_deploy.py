"""The files for containers say what the program takes: plans, names and commands; no engine runs them here."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from ftcc.groundside.cli import app
from ftcc.groundside.nodes import NodesPlan, read_plan
from ftcc.groundside.scenario import load, resolve

yaml: Any = pytest.importorskip("yaml")

DEPLOY = Path(__file__).parents[1] / "deploy"
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
KUBERNETES = list(yaml.safe_load_all((DEPLOY / "kubernetes.yaml").read_text()))
(SERVICE,) = (one for one in KUBERNETES if one["kind"] == "Service")
PODS = {one["metadata"]["name"]: one for one in KUBERNETES if one["kind"] in ("Job", "ConfigMap")}
KEYS = re.search(r"^ftcc (keys mesh \S+ --swarm .*)$", (DEPLOY / "README.md").read_text(), re.MULTILINE)


def parsed(words: list[str]) -> dict[str, Any]:
    """What the command line makes of a command, which is not run."""
    group: Any = get_command(app)
    context = None
    while hasattr(group, "commands"):
        context = group.make_context("ftcc", [words[0]], parent=context, resilient_parsing=True)
        group, words = group.commands[words[0]], words[1:]
    return dict(group.make_context("ftcc", words, parent=context).params)


def plan_in_pods(tmp_path: Path) -> NodesPlan:
    path = tmp_path / "nodes.toml"
    path.write_text(PODS["ftcc-nodes"]["data"]["nodes.toml"].replace("POD_IP", "127.0.0.1"))
    return read_plan(path)


def plan_of_compose(tmp_path: Path) -> NodesPlan:
    path = tmp_path / "nodes.toml"
    path.write_text((DEPLOY / "nodes.toml").read_text().replace('"lead:', '"127.0.0.1:'))
    return read_plan(path)


def spec_of(name: str) -> dict[str, Any]:
    spec: dict[str, Any] = PODS[name]["spec"]["template"]["spec"]
    return spec


def commands() -> Iterator[list[str]]:
    """Every `ftcc` command of both files, without its first word."""
    for service in COMPOSE["services"].values():
        if service.get("entrypoint") == ["sh", "-c"]:
            (line,) = service["command"]
            yield shlex.split(line.partition("|| ftcc ")[2])
        else:
            yield service["command"]
    for job in ("lead", "node"):
        yield spec_of(job)["containers"][0]["args"]


@pytest.mark.parametrize("words", list(commands()), ids=" ".join)
def test_every_command_is_one_of_the_program(words: list[str]) -> None:
    assert parsed(words)


@pytest.mark.parametrize("read", [plan_of_compose, plan_in_pods])
def test_the_plans_place_uavs_that_the_scenario_has_and_leave_some_to_the_leading_container(
    read: Any, tmp_path: Path
) -> None:
    plan = read(tmp_path)
    uavs = resolve(load("containment")).uavs
    leading = [uav for uav in uavs if plan.place(uav) == ("", "")]
    plan.require_in(uavs)
    assert leading


def test_every_node_of_the_plans_is_started_and_finds_the_leading_container(tmp_path: Path) -> None:
    named = {node.name for node in plan_of_compose(tmp_path).nodes}
    services = COMPOSE["services"]
    assert named == {parsed(services[name]["command"])["name"] for name in ("n0", "n1")}
    assert {parsed(services[name]["command"])["join"] for name in named} == {"lead:7447"}
    assert services["lead"]["hostname"] == "lead"
    job = PODS["node"]["spec"]
    asked = parsed(spec_of("node")["containers"][0]["args"])
    started = {asked["name"].replace("$(JOB_COMPLETION_INDEX)", str(i)) for i in range(job["completions"])}
    assert {node.name for node in plan_in_pods(tmp_path).nodes} == started
    assert job["parallelism"] == job["completions"]  # all must fly at once
    host, _, port = asked["join"].partition(":")
    assert SERVICE["metadata"]["name"] == host
    assert SERVICE["spec"]["ports"][0]["port"] == int(port)
    assert SERVICE["spec"]["selector"].items() <= PODS["lead"]["spec"]["template"]["metadata"]["labels"].items()


def test_there_is_a_key_for_every_uav_and_every_node(tmp_path: Path) -> None:
    assert KEYS is not None
    (line,) = COMPOSE["services"]["keys"]["command"]
    for words in (shlex.split(KEYS[1]), shlex.split(line.partition("|| ftcc ")[2])):
        made = parsed(words)
        first, last = map(int, made["uavs"].split("-"))
        assert set(resolve(load("containment")).uavs) <= set(range(first, last + 1))
        assert set(made["node"]) == {node.name for node in plan_of_compose(tmp_path).nodes}


def test_every_volume_that_is_mounted_is_there() -> None:
    for service in COMPOSE["services"].values():
        for mount in service.get("volumes", []):
            source = mount.partition(":")[0]
            assert source in COMPOSE["volumes"] or source == "./runs" or (DEPLOY / source).exists()
    for job in ("lead", "node"):
        spec = spec_of(job)
        volumes = {volume["name"] for volume in spec["volumes"]}
        for container in (*spec["initContainers"], *spec["containers"]):
            assert {mount["name"] for mount in container["volumeMounts"]} <= volumes
