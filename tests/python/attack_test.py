"""The standing attack on the package (fuzz/attack/attack.py), some seconds with a fixed seed and with a new one."""

import importlib.util
import pathlib
import secrets

import pytest

FILE = pathlib.Path(__file__).resolve().parents[2] / "fuzz" / "attack" / "attack.py"


def load_attack():
    spec = importlib.util.spec_from_file_location("raydix_attack", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("seed", [1, "fresh"])
def test_every_call_against_numpy(seed):
    if seed == "fresh":
        seed = secrets.randbits(48)
    print(f"seed {seed}")
    attack = load_attack()
    tally = attack.attack(10, seed)
    assert set(tally.cases) == set(attack.KINDS)
    assert not tally.findings, "\n".join(f"{e['what']} ({e['where']})\n{e['detail']}" for e in tally.examples)


def test_a_wrong_answer_is_found(monkeypatch):
    attack = load_attack()
    right = attack.raydix.Points.count
    monkeypatch.setattr(attack.raydix.Points, "count", lambda *args: right(*args) + 1)
    assert "points: count" in attack.attack(0.5, 1, ["points"]).findings
