"""The state of an estimator on disk: bit for bit, whole or not at all, and never one of something else."""

import hashlib
import os
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from inercal.faces.stream.checkpoint import alone, fingerprint, load, save
from inercal.foundation.errors import InputError


class Inner(NamedTuple):
    x: np.ndarray
    n: int


@dataclass(frozen=True)
class State:
    x: np.ndarray
    counts: np.ndarray
    inner: Inner
    t: float
    on: bool
    name: str


def example() -> State:
    rng = np.random.default_rng(1)
    return State(
        rng.standard_normal((3, 4)), np.arange(5), Inner(np.zeros((0, 3)), 2**70), 0.1 + 0.2, True, "α, β\n"
    )


def bits(x: np.ndarray) -> bytes:
    return np.ascontiguousarray(x).tobytes()


def test_every_part_comes_back_as_it_was(tmp_path):
    state = example()
    save(tmp_path / "c", "demo", "f", state)
    back = load(tmp_path / "c", "demo", "f", state)
    assert type(back) is State
    assert type(back.inner) is Inner
    assert (back.inner.n, back.t, back.on, back.name) == (2**70, 0.1 + 0.2, True, "α, β\n")
    for a, b in ((state.x, back.x), (state.counts, back.counts), (state.inner.x, back.inner.x)):
        assert (a.dtype, a.shape, bits(a)) == (b.dtype, b.shape, bits(b))
        assert b.flags.writeable


@settings(deadline=None, max_examples=40)
@given(
    arrays(np.float64, array_shapes(min_dims=0, max_dims=3, min_side=0), elements=st.floats(width=64)),
    st.floats(),
    st.integers(),
    st.text(st.characters(codec="utf-8")),
)
def test_digits_are_exact(tmp_path_factory, x, t, n, text):
    """Also of NaN, infinities, negative zeros and subnormals, in arrays of any order in memory."""
    path = tmp_path_factory.mktemp("state") / "c"
    state = {"x": np.array(x, order="F"), "t": t, "n": n, "text": text}
    save(path, "demo", "f", state)
    back = load(path, "demo", "f", state)
    assert bits(back["x"]) == bits(x)
    assert back["x"].shape == x.shape
    assert bits(np.array(back["t"])) == bits(np.array(t)) or (t != t and back["t"] != back["t"])
    assert (type(back["n"]), back["n"], back["text"]) == (int, n, text)


def test_arrays_may_have_grown(tmp_path):
    save(tmp_path / "c", "demo", "f", {"x": np.ones((7, 3))})
    assert load(tmp_path / "c", "demo", "f", {"x": np.zeros((0, 3))})["x"].shape == (7, 3)


@pytest.mark.parametrize(
    "other",
    [
        {"x": np.zeros(3)},
        {"x": np.zeros((1, 3), np.int64)},
        {"y": np.zeros((1, 3))},
        {"x": 1.0},
        {"x": np.zeros((1, 3)), "n": 1},
    ],
)
def test_a_state_of_another_form_is_refused(other, tmp_path):
    save(tmp_path / "c", "demo", "f", {"x": np.ones((7, 3))})
    with pytest.raises(InputError, match="another version of inercal"):
        load(tmp_path / "c", "demo", "f", other)


def test_a_state_of_something_else_is_refused(tmp_path):
    state = example()
    save(tmp_path / "c", "demo", "f", state)
    with pytest.raises(InputError, match="another command, expected one of other"):
        load(tmp_path / "c", "other", "f", state)
    with pytest.raises(InputError, match="other settings or inputs"):
        load(tmp_path / "c", "demo", "g", state)


def test_any_damage_is_seen(tmp_path):
    """Every single byte changed, and every length cut: one sentence, and never a state."""
    path = tmp_path / "c"
    state = {"x": np.ones(3), "t": 1.5}
    save(path, "demo", "f", state)
    whole = path.read_bytes()
    spoiled = [whole[:i] + bytes([byte ^ 1]) + whole[i + 1 :] for i, byte in enumerate(whole)]
    spoiled += [whole[:i] for i in range(len(whole))] + [whole + b"0", b"t [s],acc_x [g]\n0,1\n"]
    for data in spoiled:
        path.write_bytes(data)
        with pytest.raises(InputError, match="checkpoint") as caught:
            load(path, "demo", "f", state)
        assert "\n" not in str(caught.value)


def test_a_later_format_is_said(tmp_path):
    (tmp_path / "c").write_bytes(b"inercal checkpoint 2 " + hashlib.sha256(b"").hexdigest().encode() + b"\n")
    with pytest.raises(InputError, match="format 2, expected 1"):
        load(tmp_path / "c", "demo", "f", {})


def test_no_file(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path / "c", "demo", "f", {})


def test_what_cannot_be_saved_leaves_the_older_state(tmp_path):
    save(tmp_path / "c", "demo", "f", {"n": 1})
    with pytest.raises(TypeError, match=r"state\.x is a object"):
        save(tmp_path / "c", "demo", "f", {"x": object()})
    with pytest.raises(InputError, match="cannot be written"):
        save(tmp_path / "none" / "c", "demo", "f", {"n": 2})
    assert load(tmp_path / "c", "demo", "f", {"n": 0}) == {"n": 1}
    assert [path.name for path in tmp_path.iterdir()] == ["c"]


def test_fingerprints_tell_settings_apart():
    base = {"a": np.array([1.0, 2.0]), "b": {"c": "x", "d": 1}}
    others = [
        {**base, "a": np.array([1.0, np.nextafter(2.0, 3.0)])},
        {**base, "a": np.array([[1.0, 2.0]])},
        {**base, "b": {"c": "x", "d": 1.0}},
        {**base, "b": {"c": "y", "d": 1}},
        {**base, "e": ""},
    ]
    marks = [fingerprint(each) for each in (base, *others)]
    assert len(set(marks)) == len(marks)
    assert fingerprint({**base, "a": base["a"].copy()}) == marks[0]


@pytest.mark.parametrize("another", [True, False])
def test_the_lock_of_a_run_that_ends_just_then_is_not_taken(another, tmp_path, monkeypatch):
    """Between opening the file and locking it the other run removes it; a third may have begun with one of its own."""
    fcntl = pytest.importorskip("fcntl", reason="locks as on POSIX")
    lock, flock = tmp_path / "c.lock", fcntl.flock

    def late(file, how):
        lock.unlink()
        if another:
            lock.touch()
        flock(file, how)

    monkeypatch.setattr(fcntl, "flock", late)
    with pytest.raises(InputError, match="c: is in use by another run"), alone(tmp_path / "c"):
        pass
    assert lock.exists() == another


def test_the_lock_spares_what_is_somebodys(tmp_path):
    """A link of the lock's name had its target emptied, silently."""
    pytest.importorskip("fcntl", reason="locks as on POSIX")
    mine = tmp_path / "mine.txt"
    mine.write_text("mine")
    lock = tmp_path / "c.lock"
    for make in (lambda: lock.symlink_to(mine), lambda: lock.hardlink_to(mine), lambda: lock.write_text("mine"),
                 lambda: lock.symlink_to(tmp_path / "none"), lambda: os.mkfifo(lock), lock.mkdir):  # fmt: skip
        make()
        with pytest.raises(InputError, match=r"c(\.lock)?: (is|cannot)"), alone(tmp_path / "c"):
            pass
        assert lock.is_symlink() or lock.exists()
        lock.rmdir() if lock.is_dir() and not lock.is_symlink() else lock.unlink()
    assert mine.read_text() == "mine"
    assert not (tmp_path / "none").exists()
    lock.touch()  # as a killed run leaves it
    with alone(tmp_path / "c"):
        assert lock.exists()
    assert not lock.exists()
