"""Statuses and errors in Python: numbers and advice equal those of the core, and pickling keeps them."""

from __future__ import annotations

import pickle

import pytest

from armlet import _core, errors
from armlet.status import Status


def test_statuses_agree_with_the_core() -> None:
    assert [(int(s), s.name.lower(), s.advice) for s in Status] == [tuple(row) for row in _core.statuses()]


def test_tree() -> None:
    parents = {
        errors.InputError: (errors.ArmletError, ValueError),
        errors.ModelError: (errors.InputError,),
        errors.SolveError: (errors.ArmletError, RuntimeError),
        errors.FormatError: (errors.ArmletError, ValueError),
        errors.InternalError: (errors.ArmletError, RuntimeError),
    }
    assert {name for name in errors.__all__} == {cls.__name__ for cls in parents} | {"ArmletError"}
    for cls, bases in parents.items():
        assert cls.__bases__ == bases
        assert cls.__doc__


@pytest.mark.parametrize(
    "error",
    [
        errors.InputError("mass_matrix: q is wrong"),
        errors.ModelError("arm.urdf:7: duplicate joint", "arm.urdf", 7),
        errors.SolveError("simulate: diverged", Status.DIVERGED, 0.25, {"q": [1.0]}),
        errors.FormatError("load: damaged"),
        errors.InternalError("a fault"),
    ],
)
def test_errors_pickle_with_their_data(error: errors.ArmletError) -> None:
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is type(error)
    assert str(back) == str(error)
    assert vars(back) == vars(error)


def test_status_pickles() -> None:
    assert pickle.loads(pickle.dumps(Status.EVENT)) is Status.EVENT
